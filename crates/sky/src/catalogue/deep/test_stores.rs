//! Small stores for tests.

use std::path::Path;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::super::StarRecord;
use super::super::names::StarNames;
use super::build::{Build, BuildOptions, BuildReport, NewStar};
use super::cells::tests::directions;

/// Options of a store in a folder.
pub fn options(out: &Path) -> BuildOptions {
    BuildOptions { out: out.to_owned(), memory_bytes: 1 << 30, job: "test".to_owned(), cells: None }
}

/// Stars all over the sky with V from 12 to `faintest`. A few of them move, a few have names, a few are at infinity, and a few have no colour.
pub fn stars(count: u32, seed: u64, faintest: f64) -> Vec<(StarRecord, NewStar)> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let star = |(index, direction): (usize, glam::DVec3)| {
        let distance_known = index % 11 != 0;
        let distance_pc = if distance_known { rng.random_range(60.0..5000.0) } else { 1.0 };
        let modulus = if distance_known { 5.0 * f64::log10(distance_pc / 10.0) } else { 0.0 };
        let record = StarRecord {
            position: direction * distance_pc,
            magnitude: (rng.random_range(12.0..faintest) - modulus) as f32,
            temperature_k: rng.random_range(2500.0..15_000.0),
            distance_known,
        };
        let velocity =
            (index % 7 == 0).then(|| [1e-5, -2e-5, 5e-6].map(|axis: f32| axis * distance_pc as f32 / 1000.0));
        let name = StarNames { name: format!("Star {index}"), designations: vec![format!("HIP {index}")] };
        let names = (index % 100 == 0).then_some(name);
        (record, NewStar { velocity, names, without_colour: index % 13 == 0, ..NewStar::default() })
    };
    directions(count).into_iter().enumerate().map(star).collect()
}

/// Builds a store of these stars.
pub fn built(out: &Path, stars: &[(StarRecord, NewStar)]) -> BuildReport {
    let mut build = Build::open(options(out)).expect("a new store");
    stars.iter().try_for_each(|(star, about)| build.add(*star, about.clone())).expect("added");
    build.finish(None, "a test".to_owned(), &mut |_| ()).expect("built")
}

/// Names and contents of all files in a folder.
pub fn all_files(folder: &Path) -> Vec<(std::ffi::OsString, Vec<u8>)> {
    let entries = std::fs::read_dir(folder).expect("a folder").map(|entry| entry.expect("an entry"));
    let mut files: Vec<_> =
        entries.map(|entry| (entry.file_name(), std::fs::read(entry.path()).expect("read"))).collect();
    files.sort();
    files
}
