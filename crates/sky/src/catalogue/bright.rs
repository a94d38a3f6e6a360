//! `builtin:bright`: the stars visible to the naked eye, without any file.
//!
//! The table `bright_stars.csv` is compiled into the program and is read by the same CSV reader as any other
//! catalogue. Its header names the columns and the sources of their values.

use std::sync::LazyLock;

use super::StarRecord;
use super::names::NamedStar;
use super::reader::{CatalogueRead, read_csv_from};
use super::variable::{self, VARIABLE_STARS};

/// Name of this catalogue in configurations.
pub const NAME: &str = "builtin:bright";

/// The table holds every star brighter than this V magnitude, except variable stars that reach it only at maximum.
pub const COMPLETE_TO_V_MAG: f64 = 6.5;

/// Mira variables of the table: number in the Bright Star Catalogue, and V at maximum and minimum (General Catalogue of Variable Stars 5.1; Samus et
/// al. 2017). The table has the mean of the two magnitudes, because the single magnitude in a catalogue is arbitrary and often that of a maximum.
pub const MIRA_VARIABLES: [(u16, f64, f64); 26] = [
    (90, 5.8, 14.9),
    (663, 6.7, 14.6),
    (681, 2.0, 10.1),
    (758, 5.4, 12.6),
    (868, 4.7, 14.3),
    (1607, 5.5, 11.7),
    (2063, 4.8, 13.0),
    (2671, 6.0, 14.0),
    (3248, 6.1, 11.8),
    (3816, 3.9, 10.5),
    (3882, 4.4, 11.3),
    (3999, 4.5, 9.9),
    (4800, 6.6, 13.5),
    (4808, 6.1, 12.1),
    (5080, 3.5, 10.9),
    (5101, 6.3, 13.2),
    (5147, 5.5, 9.0),
    (5326, 5.3, 11.8),
    (5894, 5.2, 14.4),
    (6119, 6.4, 13.4),
    (7002, 5.9, 9.2),
    (7243, 5.5, 12.0),
    (7564, 3.3, 14.2),
    (8113, 5.2, 11.3),
    (8992, 5.8, 12.4),
    (9066, 4.7, 13.5),
];

const TABLE: &str = include_str!("bright_stars.csv");

/// Returns the brightest stars of the night sky, without the Sun, at their positions `years` Julian years after
/// J2000.0, sorted by right ascension at J2000.0.
pub fn bright_stars(years: f64) -> Vec<StarRecord> {
    read(years).stars
}

/// Returns the same stars with their velocities.
pub fn read(years: f64) -> CatalogueRead {
    read_table(TABLE, years)
}

/// Reads the table, or a part of it that consists of its head and some of its rows.
fn read_table(table: &str, years: f64) -> CatalogueRead {
    // The table is part of the program: a row that cannot be read is a bug, which the tests below catch.
    let read = read_csv_from(table.as_bytes(), NAME, years).expect("the built-in table is a catalogue");
    assert_eq!(read.report.rejected, 0, "the built-in table has unusable rows: {}", read.report);
    read
}

/// Returns the row index of each variable star with an ephemeris in the table, in the order of [`VARIABLE_STARS`].
pub fn variable_rows() -> [usize; variable::COUNT] {
    *VARIABLE_ROWS
}

static VARIABLE_ROWS: LazyLock<[usize; variable::COUNT]> = LazyLock::new(|| {
    VARIABLE_STARS.map(|star| {
        let start = format!("{},", star.hr);
        // The table is part of the program, and a test checks that it contains every variable star.
        rows().position(|row| row.starts_with(&start)).expect("a star of the table")
    })
});

/// The table reduced to the rows of the variable stars, in the order of [`VARIABLE_STARS`].
static VARIABLE_TABLE: LazyLock<String> = LazyLock::new(|| {
    let head = TABLE.lines().take(TABLE.lines().count() - rows().count());
    let rows: Vec<&str> = rows().collect();
    head.chain(variable_rows().map(|row| rows[row])).flat_map(|line| [line, "\n"]).collect()
});

/// Returns the variable stars with an ephemeris, in the order of [`VARIABLE_STARS`]. Their positions are those of `years` Julian years after J2000.0,
/// their brightness is that of `brightness_years` after J2000.0.
pub fn variable_stars(years: f64, brightness_years: f64) -> Vec<StarRecord> {
    let stars = read_table(&VARIABLE_TABLE, years).stars;
    let varied = stars.into_iter().zip(variable::magnitudes(brightness_years));
    varied.map(|(star, magnitude)| with_apparent_magnitude(star, magnitude)).collect()
}

fn with_apparent_magnitude(star: StarRecord, magnitude: f64) -> StarRecord {
    StarRecord { magnitude: (f64::from(star.magnitude) + magnitude - star.apparent_magnitude()) as f32, ..star }
}

fn rows() -> impl Iterator<Item = &'static str> {
    TABLE.lines().filter(|line| !line.starts_with('#')).skip(1)
}

/// Returns the same stars with their names. Designations are those of Bayer, of Flamsteed or of a variable star with the constellation's
/// abbreviation, such as `alf CMa` or `R Leo`; other stars have their number in the Bright Star Catalogue, such as `HR 9077`.
pub fn named_bright_stars(years: f64) -> Vec<NamedStar> {
    rows()
        .zip(bright_stars(years))
        .map(|(row, star)| {
            let mut fields = row.split(',');
            let mut next = || fields.next().unwrap_or_default();
            let number = format!("HR {}", next());
            let (name, designation) = (next(), next());
            let others = if number == designation { Vec::new() } else { vec![number.into()] };
            NamedStar { name: name.into(), designation: designation.into(), others, star }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use std::collections::HashSet;

    use super::*;

    fn star(name: &str) -> StarRecord {
        named_bright_stars(0.0).into_iter().find(|s| s.name == name).unwrap_or_else(|| panic!("{name} is missing")).star
    }

    #[test]
    fn every_row_of_the_table_is_read_and_in_range() {
        let stars = named_bright_stars(0.0);
        assert_eq!(stars.len(), bright_stars(0.0).len());
        assert_eq!(stars.len(), 9096);
        for NamedStar { designation, star, .. } in &stars {
            assert!((-1.5..10.7).contains(&star.apparent_magnitude()), "{designation}: {}", star.apparent_magnitude());
            assert!((1_000.0..45_000.0).contains(&star.temperature_k), "{designation}: {}", star.temperature_k);
            if star.distance_known {
                assert!((1.3..1_000.0).contains(&star.position.length()), "{designation}");
            } else {
                assert!((star.position.length() - 1.0).abs() < 1e-12, "{designation}");
            }
        }
        let without_distance = stars.iter().filter(|s| !s.star.distance_known).count();
        assert_eq!(without_distance, 7042);
    }

    #[test]
    fn names_and_designations_are_unique() {
        let stars = named_bright_stars(0.0);
        let mut seen = HashSet::new();
        for s in &stars {
            assert!(!s.designation.is_empty() && seen.insert(s.designation.clone()), "{} twice", s.designation);
            assert!(s.name.is_empty() || seen.insert(s.name.clone()), "{} twice", s.name);
        }
    }

    #[test]
    fn well_known_stars_have_their_published_values() {
        for (name, v_mag, distance_pc, temperature_k) in [
            ("Sirius", -1.46, 2.64, 9_940.0),
            ("Canopus", -0.72, 95.0, 7_350.0),
            ("Vega", 0.03, 7.68, 9_600.0),
            ("Arcturus", -0.04, 11.26, 4_290.0),
            ("Polaris", 2.02, 133.0, 6_015.0),
        ] {
            let star = star(name);
            assert!((star.apparent_magnitude() - v_mag).abs() < 0.005, "{name}");
            assert!((star.position.length() / distance_pc - 1.0).abs() < 0.01, "{name}");
            assert!((f64::from(star.temperature_k) / temperature_k - 1.0).abs() < 0.01, "{name}");
        }
        let polaris = star("Polaris").position.normalize();
        assert!(polaris.z.asin().to_degrees() > 89.2);
        // Betelgeuse is opposite Rigel in Orion, 18.6 degrees apart.
        let angle = star("Betelgeuse").position.angle_between(star("Rigel").position).to_degrees();
        assert!((angle - 18.6).abs() < 0.1, "{angle}");
    }

    #[test]
    fn variable_stars_have_the_brightness_of_the_moment_and_the_place_of_the_table() {
        let table = bright_stars(20.0);
        let [then, later] = [21.0, 21.003].map(|years| variable_stars(20.0, years));
        for ((row, star), magnitude) in variable_rows().into_iter().zip(&then).zip(variable::magnitudes(21.0)) {
            assert_eq!(star.position, table[row].position);
            assert!((star.apparent_magnitude() - magnitude).abs() < 1e-5);
            let off = magnitude - table[row].apparent_magnitude();
            assert!(off.abs() < 5.5, "row {row} is off by {off} mag");
        }
        assert!(then.iter().zip(&later).any(|(a, b)| (a.magnitude - b.magnitude).abs() > 0.1));
    }

    #[test]
    fn mira_variables_have_their_mean_brightness() {
        let stars = named_bright_stars(0.0);
        for (number, maximum, minimum) in MIRA_VARIABLES {
            let number = format!("HR {number}");
            let found = stars.iter().find(|s| s.designation == number || s.others.iter().any(|other| *other == number));
            let found = found.unwrap_or_else(|| panic!("{number} is missing"));
            let mean = 0.5 * (maximum + minimum);
            assert!((found.star.apparent_magnitude() - mean).abs() < 1e-4, "{number}");
            assert!(mean > COMPLETE_TO_V_MAG || found.name == "Mira", "{number}");
        }
    }

    #[test]
    fn the_brightest_is_sirius_and_the_sun_is_absent() {
        let stars = named_bright_stars(0.0);
        let brightest =
            stars.iter().min_by(|a, b| a.star.apparent_magnitude().total_cmp(&b.star.apparent_magnitude())).unwrap();
        assert_eq!(brightest.name, "Sirius");
        assert!(stars.iter().all(|s| !matches!(s.name.as_ref(), "Sun" | "Sol")));
    }
}
