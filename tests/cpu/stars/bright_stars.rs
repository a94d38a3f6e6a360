//! The built-in table of bright stars compared with the Yale Bright Star Catalogue, which is not part of this
//! project: the environment variable `STERADIAN_BSC_CSV` is the path of a CSV file with the columns
//! `hr,ra_deg,dec_deg,v_mag,teff_k,name`.

use std::path::Path;

use steradian::catalogue::StarRecord;
use steradian::catalogue::bright::{COMPLETE_TO_V_MAG, MIRA_VARIABLES, named_bright_stars};
use steradian::catalogue::names::NamedStar;
use steradian::catalogue::reader::read_csv;

/// Entries closer than this are compared by their combined light, because catalogues split stars differently.
const SAME_PLACE_DEG: f64 = 0.05;

const MAGNITUDE_TOLERANCE: f64 = 0.15;

/// Stars for which the Yale catalogue lists too high a brightness. T Coronae Borealis (HR 5958, right ascension and
/// declination in degrees) is listed with the 2.0 mag of its outbursts, a few days in eighty years; it normally has 10
/// mag.
const NOT_BRIGHT: [(f64, f64); 1] = [(239.876, 25.920)];

/// Pairs that the Yale catalogue lists as two stars, each with the combined magnitude: delta Serpentis (3.80 mag) and
/// epsilon Arietis (4.63 mag).
const COUNTED_TWICE: [(f64, f64); 2] = [(233.7004, 10.5388), (44.8029, 21.3403)];

fn yale() -> Vec<StarRecord> {
    let path = std::env::var("STERADIAN_BSC_CSV").expect("STERADIAN_BSC_CSV was set when this test was built");
    let read = read_csv(Path::new(&path), 0.0).unwrap_or_else(|e| panic!("{e}"));
    assert!(read.stars.len() > 9000, "this is not the Yale catalogue: {}", read.report);
    read.stars
}

fn separation_deg(a: &StarRecord, b: &StarRecord) -> f64 {
    a.position.angle_between(b.position).to_degrees()
}

fn near<'a>(star: &StarRecord, stars: &'a [StarRecord]) -> Vec<&'a StarRecord> {
    stars.iter().filter(|other| separation_deg(star, other) < SAME_PLACE_DEG).collect()
}

fn combined_magnitude(stars: &[&StarRecord]) -> f64 {
    -2.5 * stars.iter().map(|s| 10f64.powf(-0.4 * s.apparent_magnitude())).sum::<f64>().log10()
}

fn is_at(star: &StarRecord, places: &[(f64, f64)]) -> bool {
    places.iter().any(|&(ra_deg, dec_deg)| {
        let (ra, dec) = (ra_deg.to_radians(), dec_deg.to_radians());
        let place = glam::DVec3::new(dec.cos() * ra.cos(), dec.cos() * ra.sin(), dec.sin());
        star.position.angle_between(place).to_degrees() < SAME_PLACE_DEG
    })
}

/// Returns the Mira variables of the table. Their brightness differs from that in the catalogue.
fn miras() -> Vec<StarRecord> {
    let numbers: Vec<String> = MIRA_VARIABLES.iter().map(|(number, ..)| format!("HR {number}")).collect();
    let table = named_bright_stars(0.0);
    let is_mira = |star: &&NamedStar| {
        numbers.iter().any(|number| star.designation == *number || star.others.iter().any(|other| other == number))
    };
    table.iter().filter(is_mira).map(|star| star.star).collect()
}

/// Whether `star` equals one of `counterparts`, or has their combined light.
fn is_among(star: &StarRecord, counterparts: &[&StarRecord]) -> bool {
    let agrees = |magnitude: f64| (magnitude - star.apparent_magnitude()).abs() <= MAGNITUDE_TOLERANCE;
    counterparts.iter().any(|other| agrees(other.apparent_magnitude()))
        || (!counterparts.is_empty() && agrees(combined_magnitude(counterparts)))
}

#[test]
#[cfg_attr(not(has_bsc_csv), ignore = "set STERADIAN_BSC_CSV to a copy of the Yale Bright Star Catalogue as CSV")]
fn every_star_of_the_table_is_in_the_yale_catalogue() {
    let yale = yale();
    let table = named_bright_stars(0.0);
    let stars: Vec<StarRecord> = table.iter().map(|s| s.star).collect();
    let miras = miras();
    assert_eq!(miras.len(), MIRA_VARIABLES.len());
    let mut worst_deg = 0.0f64;
    for entry in &table {
        let counterparts = near(&entry.star, &yale);
        let agrees = if is_at(&entry.star, &COUNTED_TWICE) {
            let together = combined_magnitude(&near(&entry.star, &stars));
            counterparts.iter().all(|yale| (yale.apparent_magnitude() - together).abs() <= MAGNITUDE_TOLERANCE)
        } else {
            is_at(&entry.star, &NOT_BRIGHT)
                || !near(&entry.star, &miras).is_empty()
                || is_among(&entry.star, &counterparts)
        };
        assert!(agrees, "{}: {counterparts:?}", entry.designation);
        let nearest = counterparts.iter().map(|c| separation_deg(&entry.star, c)).fold(f64::INFINITY, f64::min);
        worst_deg = worst_deg.max(nearest);
    }
    println!("{} stars, each within {:.1} arcsec of a star in the Yale catalogue", table.len(), worst_deg * 3600.0);
}

#[test]
#[cfg_attr(not(has_bsc_csv), ignore = "set STERADIAN_BSC_CSV to a copy of the Yale Bright Star Catalogue as CSV")]
fn the_table_has_every_bright_star_of_the_yale_catalogue() {
    let yale = yale();
    let table: Vec<StarRecord> = named_bright_stars(0.0).iter().map(|s| s.star).collect();
    let (mut places, miras) = (0, miras());
    for star in &yale {
        let group = near(star, &yale);
        let light = combined_magnitude(&group);
        if group.iter().any(|star| !near(star, &miras).is_empty()) {
            continue;
        }
        if light >= COMPLETE_TO_V_MAG || is_at(star, &NOT_BRIGHT) || is_at(star, &COUNTED_TWICE) {
            continue;
        }
        let ours = near(star, &table);
        assert!(!ours.is_empty(), "no entry near {star:?}");
        // The combined light at the position is right, and a star that is bright enough by itself is listed separately.
        let difference = (combined_magnitude(&ours) - light).abs();
        assert!(difference <= MAGNITUDE_TOLERANCE, "{difference} mag of difference near {star:?}");
        places += 1;
    }
    assert!(places > 270, "{places}");
    println!(
        "{places} entries of the Yale catalogue at positions brighter than V = {COMPLETE_TO_V_MAG} were all found"
    );
}

/// Real pairs of equal stars, each listed with its own light: 42 Com, HR 6749 and HR 9074. A duplicated star, by
/// contrast, would appear twice at one position with the same brightness, or as a pair of which each star has the
/// combined light.
const EQUAL_PAIRS: [&str; 3] = ["42 Com", "HR 6749", "HR 9074"];

#[test]
fn no_star_is_duplicated() {
    let mut table = named_bright_stars(0.0);
    table.sort_by(|a, b| a.star.position.normalize().z.total_cmp(&b.star.position.normalize().z));
    let near_z = f64::to_radians(1.0 / 3600.0);
    let mut equal = Vec::new();
    for (i, a) in table.iter().enumerate() {
        let z = a.star.position.normalize().z;
        for b in table[i + 1..].iter().take_while(|b| b.star.position.normalize().z - z < near_z) {
            let unlike = (a.star.apparent_magnitude() - b.star.apparent_magnitude()).abs();
            if separation_deg(&a.star, &b.star) * 3600.0 < 1.0 && unlike < 0.02 {
                equal.push(a.designation.as_ref().min(b.designation.as_ref()));
            }
        }
    }
    equal.sort_unstable();
    assert_eq!(equal, EQUAL_PAIRS);
}
