//! Runs the parsers with mutated inputs: each entry point of `fuzz/targets.rs` reads a few inputs, and in long tests as
//! many as a minute allows.
//!
//! `driver` describes the method, docs/fuzzing.md lists the parsers. The messages of the service are private, so their
//! tests are in `src/service/fuzz_tests.rs`.
#![allow(clippy::unwrap_used, reason = "tests may panic")]
#![allow(clippy::print_stderr, reason = "the reading process reports why it ends")]

mod driver;
mod formats;
mod seeds;
#[path = "../../fuzz/targets.rs"]
mod targets;

use driver::{Run, Target, as_it_is, check};
use testkit::theatre as theatre_sets;

/// Memory limit for parsers of small files, bytes.
const SMALL: u64 = 512 << 20;

macro_rules! fuzz {
    ($($name:ident: $seeds:expr, $tokens:expr, $repair:expr, $most_bytes:expr;)*) => {
        $(mod $name {
            use super::*;

            const TARGET: Target = Target {
                name: stringify!($name),
                read: targets::$name,
                seeds: $seeds,
                tokens: $tokens,
                repair: $repair,
                most_bytes: $most_bytes,
            };

            #[test]
            fn few() {
                check(&TARGET, Run::Short, concat!(module_path!(), "::few"));
            }

            #[test]
            #[ignore = "long: make test-all"]
            fn for_a_minute() {
                check(&TARGET, Run::Long, concat!(module_path!(), "::for_a_minute"));
            }
        })*

        const NAMES: &[&str] = &[$(stringify!($name)),*];
    };
}

fuzz! {
    configuration: seeds::configurations, seeds::KEYS, as_it_is, SMALL;
    film_path: seeds::film_paths, seeds::PATH_KEYS, as_it_is, SMALL;
    csv: seeds::csv, seeds::COLUMNS, as_it_is, SMALL;
    json: seeds::json, seeds::JSON, as_it_is, SMALL;
    votable: seeds::votable, seeds::VOTABLE, as_it_is, SMALL;
    fits_table: seeds::fits_table, seeds::CARDS, as_it_is, SMALL;
    parquet: seeds::parquet, &[], as_it_is, SMALL;
    star_store: seeds::star_store, &[], formats::repair_store, SMALL;
    deep_store: seeds::deep_store, &[], formats::repair_deep_store, SMALL;
    gltf: seeds::gltf, seeds::GLTF, |bytes| formats::repair_glb(bytes), SMALL;
    // The largest point-spread function has 4096 x 4096 pixels, decoded in f64.
    point_spread: seeds::point_spread, seeds::PSF, as_it_is, 3 << 30;
    // The largest texture has 2^27 texels: 400 MB as stored in the file, 1.6 GB as numbers.
    texture: seeds::textures, seeds::PNG, |bytes| formats::repair_png(bytes), 3 << 30;
    glare_table: seeds::glare_table, seeds::TABLE, as_it_is, SMALL;
    // The largest grid has 8192 x 8192 directions in f64, and a header of a few bytes can declare it.
    theatre: seeds::theatre, seeds::THEATRE, formats::repair_zip, 4 << 30;
}

/// For cargo-fuzz, each target needs a file and an entry in the manifest.
#[test]
fn every_target_is_a_cargo_fuzz_target_too() {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz");
    let manifest: toml::Table = std::fs::read_to_string(folder.join("Cargo.toml")).unwrap().parse().unwrap();
    let listed: Vec<&str> =
        manifest["bin"].as_array().unwrap().iter().map(|bin| bin["name"].as_str().unwrap()).collect();
    assert_eq!(listed, NAMES);
    for name in NAMES {
        let text = std::fs::read_to_string(folder.join(format!("fuzz_targets/{name}.rs"))).unwrap();
        assert!(text.contains(&format!("targets::{name}(data)")), "{name}: {text}");
    }
}

/// The driver must detect these failures; otherwise all other tests here would be worthless.
#[test]
#[should_panic(expected = "greedy: an input of 3 bytes ended the process")]
fn memory_beyond_the_limit_is_detected() {
    const GREEDY: Target = Target {
        name: "greedy",
        read: |data| std::hint::black_box(vec![data[0]; 8 << 30]).len().to_string(),
        seeds: || vec![b"one".to_vec()],
        tokens: &[],
        repair: as_it_is,
        most_bytes: SMALL,
    };
    check(&GREEDY, Run::Short, concat!(module_path!(), "::memory_beyond_the_limit_is_detected"));
}

#[test]
#[should_panic(expected = "fragile: an input of 5 bytes ended the process")]
fn a_panic_is_detected() {
    const FRAGILE: Target = Target {
        name: "fragile",
        read: |data| data[5].to_string(),
        seeds: || vec![b"short".to_vec()],
        tokens: &[],
        repair: as_it_is,
        most_bytes: SMALL,
    };
    check(&FRAGILE, Run::Short, concat!(module_path!(), "::a_panic_is_detected"));
}
