//! Tests of parts and their merge: the merged store has the bytes of a store that is made at once, and unsuitable parts are refused.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::DVec3;

use super::super::StarRecord;
use super::super::bright;
use super::super::galaxy::{GalaxyError, GalaxyParameters};
use super::build::{BuildOptions, BuildReport};
use super::cell_range::CellRange;
use super::cells::SkyPlace;
use super::check::check;
use super::import::{ImportReport, ImportSource, import};
use super::index::Index;
use super::merge::merge;
use super::part::{self, PartRecord};
use super::synth::{Blocks, synthesise_with};
use super::test_stores::all_files;
use super::{BUCKET_ORDER, BUCKETS, DeepError, DeepStore, index};
use crate::units::ARCSECOND_RAD;

fn options(out: &Path, cells: Option<CellRange>) -> BuildOptions {
    BuildOptions { out: out.to_owned(), memory_bytes: 1 << 30, job: String::new(), cells }
}

fn cell(direction: DVec3) -> u64 {
    SkyPlace::from_direction(direction).cell(BUCKET_ORDER)
}

/// About 1,000 directions in a few cells all over the sky. There are few cells, because cells with stars take most of the time.
fn directions() -> impl Iterator<Item = DVec3> {
    super::cells::tests::directions(30_000).into_iter().filter(|direction| cell(*direction).is_multiple_of(29))
}

/// A star of the built-in table, and a direction within 2" of it that is in another cell.
fn pair_across_a_border() -> (DVec3, f64, DVec3) {
    let across = |direction: DVec3| {
        let side = direction.any_orthonormal_vector();
        let offsets =
            (0..16).map(|i| glam::DQuat::from_axis_angle(direction, f64::from(i) * std::f64::consts::FRAC_PI_8) * side);
        offsets
            .map(|offset| (direction + offset * 1.9 * ARCSECOND_RAD).normalize())
            .find(|near| cell(*near) != cell(direction))
    };
    let stars = bright::read(0.0).stars;
    let found = stars.iter().find_map(|star| {
        let direction = star.position.normalize();
        across(direction).map(|near| (direction, star.apparent_magnitude(), near))
    });
    found.expect("one of 9,096 stars is within 2 arcsec of a border")
}

/// A catalogue of about 1,000 stars in cells all over the sky. Some have no colour or are repeated, and one duplicates a star of the built-in table
/// across a border of cells.
fn catalogue(folder: &Path) -> (PathBuf, u64) {
    let (direction, v_mag, near) = pair_across_a_border();
    let (ra, dec) = crate::coordinates::lon_lat_from_direction(near);
    let mut text = format!(
        "ra_deg,dec_deg,v_mag,teff_k,distance_pc,pm_ra_mas_yr,pm_dec_mas_yr,name\n{},{},{v_mag},5000,,,,\n",
        ra.rem_euclid(std::f64::consts::TAU).to_degrees(),
        dec.to_degrees()
    );
    for (i, direction) in directions().enumerate() {
        let (ra, dec) = crate::coordinates::lon_lat_from_direction(direction);
        let [ra, dec] = [ra.rem_euclid(std::f64::consts::TAU), dec].map(f64::to_degrees);
        let colour = if i % 7 == 0 { String::new() } else { format!("{}", 3000 + i) };
        let motion = if i % 5 == 0 { "150,-90" } else { "," };
        let name = if i % 50 == 0 { format!("Star {i}") } else { String::new() };
        let line = format!("{ra},{dec},{:.3},{colour},{},{motion},{name}\n", 12.0 + 0.008 * i as f64, 60 + 5 * i);
        text += &line;
        if i % 100 == 0 {
            text += &line;
        }
    }
    let path = folder.join("stars.csv");
    fs::write(&path, text).expect("written");
    (path, cell(direction).max(cell(near)))
}

/// A small set of stars in place of the model; many of them have the same magnitude.
struct Drawn {
    blocks: Vec<Vec<StarRecord>>,
}

impl Drawn {
    fn new() -> Self {
        let star = |(i, direction): (usize, DVec3)| {
            // Every ninth star is nearer than 100 pc and is therefore a bright star.
            let distance_pc = if i % 9 == 0 { 50.0 } else { 300.0 + i as f64 };
            let v_mag = 13.0 + 0.125 * (i % 10) as f64;
            let magnitude = (v_mag - crate::catalogue::distance_modulus(distance_pc)) as f32;
            StarRecord { position: direction * distance_pc, magnitude, temperature_k: 5e3, distance_known: true }
        };
        let stars: Vec<StarRecord> = directions().enumerate().map(star).collect();
        Self { blocks: stars.chunks(100).map(<[_]>::to_vec).collect() }
    }
}

impl Blocks for Drawn {
    fn blocks(&self) -> usize {
        self.blocks.len()
    }

    fn counted_from(&self) -> f32 {
        13.6
    }

    fn draw(&self, block: usize, _: u32, sink: &mut dyn FnMut(StarRecord)) -> Result<(), GalaxyError> {
        self.blocks[block].iter().for_each(|star| sink(*star));
        Ok(())
    }
}

fn parts_of(
    folder: &Path,
    ranges: &[(u64, u64)],
    make: impl Fn(BuildOptions) -> BuildReport,
) -> (Vec<PathBuf>, Vec<BuildReport>) {
    let part = |&(first, end): &(u64, u64)| {
        let out = folder.join(format!("part-{first}"));
        let report = make(options(&out, CellRange::new(first, end)));
        (out, report)
    };
    ranges.iter().map(part).unzip()
}

fn merge_error(parts: &[PathBuf], out: &Path) -> String {
    merge(parts, out, &mut |_| ()).expect_err("refused").to_string()
}

#[test]
fn an_import_in_eight_parts_has_the_bytes_of_one() {
    let folder = tempfile::tempdir().expect("a folder");
    let (file, border) = catalogue(folder.path());
    let sources = [ImportSource::Bright, ImportSource::File(file)];
    let make = |options| import(&sources, options, &mut |_| ()).expect("imported");
    let (whole, merged) = (folder.path().join("whole"), folder.path().join("merged"));
    let ImportReport { build: expected, catalogues } = make(options(&whole, None));
    assert!(expected.tally.listed_again >= 1 && expected.tally.repeated > 5, "{expected:?}");
    assert!(expected.tally.median_colour > 80 && expected.names > 1 && expected.motions > 100, "{expected:?}");

    // A part begins at the border between a star of the built-in table and its copy.
    let mut starts = vec![0, 1, 700, 1100, 1536, 2000, 2900];
    starts.push(if starts.contains(&border) { border + 1 } else { border });
    starts.sort_unstable();
    let ends = starts[1..].iter().copied().chain([BUCKETS]);
    let ranges: Vec<(u64, u64)> = starts.iter().copied().zip(ends).collect();
    let (mut parts, reports) = parts_of(folder.path(), &ranges, |options| make(options).build);
    let stars = |report: &BuildReport| report.bright + report.layers.iter().sum::<u64>();
    assert_eq!(reports.iter().map(stars).sum::<u64>(), stars(&expected));
    assert!(reports.iter().all(|report| report.root != expected.root));
    for (number, part) in parts.iter().enumerate() {
        check(&DeepStore::open(part).expect("a part"), number == 3, &mut |_| ()).expect("a valid part");
        let error = DeepStore::open_whole(part).expect_err("a part").to_string();
        assert!(error.contains("of 0..3072") && error.contains("catalogue merge"), "{error}");
    }
    parts.reverse();
    let report = merge(&parts, &merged, &mut |_| ()).expect("merged");
    assert!(all_files(&merged) == all_files(&whole));
    assert_eq!((report.build, report.catalogues), (expected, catalogues));
    assert!(!folder.path().join("merged.partial").exists());

    // A part must not be an input of an import, and the merge must not replace one.
    let error = import(&[ImportSource::File(parts[0].clone())], options(&folder.path().join("x"), None), &mut |_| ());
    assert!(matches!(error, Err(DeepError::IsPart { .. })));
    assert!(matches!(merge(&parts, &parts[3], &mut |_| ()), Err(DeepError::Occupied { .. })));
}

#[test]
fn a_synthetic_galaxy_in_eight_parts_has_the_bytes_of_one() {
    let folder = tempfile::tempdir().expect("a folder");
    let model = Arc::new(Drawn::new());
    let all: Vec<StarRecord> = model.blocks.concat();
    // The limit falls among stars of the same magnitude.
    let stars = all.len() * 3 / 4;
    let parameters = GalaxyParameters { stars, seed: 3, fainter_than: None, unresolved_light: false };
    let make = |options| synthesise_with(|| Ok(Arc::clone(&model)), &parameters, options, &mut |_| ()).expect("made");
    let (whole, merged) = (folder.path().join("whole"), folder.path().join("merged"));
    let expected = make(options(&whole, None));
    let ranges: Vec<(u64, u64)> = (0..8).map(|part| (384 * part, 384 * (part + 1))).collect();
    let (parts, _) = parts_of(folder.path(), &ranges, make);
    let report = merge(&parts, &merged, &mut |_| ()).expect("merged");
    assert_eq!(report.build, expected);
    assert_eq!(expected.bright + expected.layers.iter().sum::<u64>(), stars as u64);
    assert!(all_files(&merged) == all_files(&whole));
    // A galaxy with another seed is another input.
    let other = GalaxyParameters { seed: 4, ..parameters };
    let part = options(&parts[5], CellRange::new(1920, 2304));
    synthesise_with(|| Ok(Arc::clone(&model)), &other, part, &mut |_| ()).expect("made");
    let error = merge_error(&parts, &merged);
    assert!(error.contains("part-1920") && error.contains("seed 4") && error.contains("seed 3"), "{error}");
}

#[test]
fn parts_that_do_not_fit_are_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let (path, out) = (|name: &str| folder.path().join(name), folder.path().join("out"));
    let file = path("stars.csv");
    let text = "ra_deg,dec_deg,v_mag\n10,20,14\n200,-70,15\n";
    fs::write(&file, text).expect("written");
    let source = [ImportSource::File(file.clone())];
    let make = |name: &str, first: u64, end: u64| {
        import(&source, options(&path(name), CellRange::new(first, end)), &mut |_| ()).expect("imported");
        path(name)
    };
    let [a, b, c, d] = [("a", 0, 1000), ("b", 1000, 2000), ("c", 2000, 3072), ("d", 1999, 3072)]
        .map(|(name, first, end)| make(name, first, end));
    for (parts, expected) in [
        (vec![&a, &b, &d], ["cells 1000..2000", "1999..3072", "overlap"]),
        (vec![&b, &b, &a, &c], ["cells 1000..2000", "b", "overlap"]),
        (vec![&a, &c], ["cells 1000..2000", "none of the parts", "--cells"]),
        (vec![&b], ["0..1000 and 2000..3072", "none of the parts", "--cells"]),
    ] {
        let error = merge_error(&parts.into_iter().cloned().collect::<Vec<_>>(), &out);
        assert!(expected.iter().all(|part| error.contains(part)), "{error}");
    }
    let all = [a.clone(), b.clone(), c.clone()];
    merge(&all, &out, &mut |_| ()).expect("the parts fit");

    let whole = path("whole");
    import(&source, options(&whole, None), &mut |_| ()).expect("imported");
    assert!(merge_error(&[a.clone(), whole], &out).contains("whole store"));
    // The same name and number of rows, but another star.
    fs::write(&file, text.replace("14", "13.9")).expect("written");
    make("b", 1000, 2000);
    let error = merge_error(&all, &out);
    assert!(error.contains("/b: it was made from other inputs") && error.contains("stars.csv"), "{error}");
    fs::write(&file, text).expect("written");
    make("b", 1000, 2000);

    // A record of another version, with a correct checksum.
    let store = DeepStore::open(&b).expect("a part");
    let json = fs::read_to_string(b.join(part::NAME)).expect("read");
    let with_record = |json: &str| {
        let mut index: Index = store.index().clone();
        let entry = index.part.as_mut().expect("a part");
        entry.sha256 = <sha2::Sha256 as sha2::Digest>::digest(json).into();
        fs::write(b.join(part::NAME), json).expect("written");
        fs::write(b.join(index::NAME), index.to_bytes().0).expect("written");
    };
    let version = format!("\"program\": \"{}\"", env!("CARGO_PKG_VERSION"));
    assert!(json.contains(&version));
    for changed in [json.replace(&version, "\"program\": \"0.0.1\""), json.replace("\"version\": 1", "\"version\": 9")]
    {
        with_record(&changed);
        let error = merge_error(&all, &out);
        assert!(error.contains("made by version") && error.contains("import this part again"), "{error}");
    }
    with_record(&json.replace("1000", "1001"));
    assert!(merge_error(&all, &out).contains("its cells are not those of the index"));
    // Damage to each file of a part.
    with_record(&json);
    let part = DeepStore::open(&c).expect("a part");
    let bytes = |name: &str| fs::metadata(c.join(name)).expect("a file").len();
    assert!(PartRecord::read(&c, &part.index().part.expect("a part")).is_ok() && bytes("bright-names") == 0);
    for (name, text) in [
        (part::NAME, "its checksum"),
        ("bright-stars", "its checksum"),
        ("bright-names", "its checksum"),
        ("leaves-15", "leaf"),
    ] {
        let whole = fs::read(c.join(name)).expect("read");
        let mut damaged = whole.clone();
        if damaged.is_empty() {
            damaged.push(1)
        } else {
            damaged[whole.len() / 2] ^= 1
        }
        fs::write(c.join(name), damaged).expect("written");
        let error = merge_error(&all, &out);
        assert!(error.contains(name) && error.contains(text), "{error}");
        fs::write(c.join(name), whole).expect("written");
    }
    merge(&all, &out, &mut |_| ()).expect("whole again");
}
