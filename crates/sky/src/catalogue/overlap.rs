//! Detects stars that would be drawn twice, because they are in two catalogues of a scene, or twice in one file.
//!
//! Two entries count as the same star if they are within [`SAME_STAR_ARCSEC`] and [`SAME_STAR_MAG`] (apparent V) of each other, seen from the Solar
//! System. The smaller catalogue is sorted by HEALPix cell. One bit for every cell of the sky records whether a star of this catalogue is in the cell
//! or in a neighbouring one. These bits exclude most stars of the larger catalogue.

use std::fmt;
use std::sync::atomic::{AtomicU64, Ordering};

use cdshealpix::nested::{self, Layer};
use glam::DVec3;
use rayon::prelude::*;

use super::StarRecord;
use crate::units::ARCSECOND_RAD;

/// Entries closer than this, in arcseconds, may be one star.
pub const SAME_STAR_ARCSEC: f64 = 10.0;

/// Entries whose apparent magnitudes differ by no more than this may be one star.
pub const SAME_STAR_MAG: f64 = 0.3;

/// Magnitudes are stored as f32: without this, 5.0 and 5.3 would differ by more than 0.3.
const MAGNITUDE_ROUNDING: f64 = 1e-5;

/// HEALPix depth with cells of 3.2": the equivalent of [`DEPTH`] for [`REPEATED_ARCSEC`].
const REPEATED_DEPTH: u8 = 16;

/// HEALPix depth with cells of 51". They are wide enough that the counterpart of a star is in the same cell or a neighbouring one, even where cells
/// are narrow.
const DEPTH: u8 = 12;

/// Two catalogues with stars in common.
#[derive(Clone, Debug, PartialEq)]
pub struct Overlap {
    /// Name of one catalogue.
    pub first: String,
    /// Name of the other.
    pub second: String,
    /// Number of stars of the smaller catalogue that are in the other.
    pub count: usize,
    /// The brightest common star, with the values of `first`.
    pub example: StarRecord,
}

impl fmt::Display for Overlap {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { first, second, count, example } = self;
        write!(
            f,
            "{count} of the stars of {first} and {second} are within {SAME_STAR_ARCSEC} arcseconds and {SAME_STAR_MAG} mag \
             of each other, the brightest with {}",
            described(example)
        )
    }
}

/// Rows of one file closer than this, arcseconds, with magnitudes that differ by no more than [`REPEATED_MAG`] are probably one star: catalogues
/// rarely resolve double stars of equal brightness that are this close.
pub const REPEATED_ARCSEC: f64 = 0.5;
/// See [`REPEATED_ARCSEC`].
pub const REPEATED_MAG: f64 = 0.05;

/// Stars that seem to be in one catalogue twice.
#[derive(Clone, Debug, PartialEq)]
pub struct Repetition {
    /// Name of the catalogue.
    pub name: String,
    /// Number of stars that repeat an earlier entry.
    pub count: usize,
    /// The brightest of them.
    pub example: StarRecord,
}

impl fmt::Display for Repetition {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { name, count, example } = self;
        write!(
            f,
            "{count} of the stars of {name} are within {REPEATED_ARCSEC} arcseconds and {REPEATED_MAG} mag of another star of the same \
             file, the brightest with {}",
            described(example)
        )
    }
}

/// Finds stars that seem to be in a catalogue twice; `None` if there are none.
pub fn find_repetitions(name: &str, stars: &[StarRecord]) -> Option<Repetition> {
    let layer = nested::get(REPEATED_DEPTH);
    let by_cell = sorted_by_cell(layer, stars);
    let within = Tolerance::new(REPEATED_ARCSEC, REPEATED_MAG);
    // A star repeats only entries that come before it in the file.
    let repeated: Vec<usize> = by_cell
        .par_chunk_by(|a, b| a.0 == b.0)
        .flat_map_iter(|own| {
            let near = near_cell(layer, own[0].0, &by_cell, stars);
            own.iter().map(|(_, index)| *index).filter(move |index| {
                let star = Entry::new(stars, *index);
                within.matches(&star, &near).any(|other| other.index < star.index)
            })
        })
        .collect();
    let brightness = |index: &&usize| stars[**index].apparent_magnitude();
    let example = repeated.iter().min_by(|p, q| brightness(p).total_cmp(&brightness(q)).then(p.cmp(q)))?;
    Some(Repetition { name: name.to_owned(), count: repeated.len(), example: stars[*example] })
}

/// Describes the magnitude and position of a star, for messages.
fn described(star: &StarRecord) -> String {
    let DVec3 { x, y, z } = star.position.normalize_or_zero();
    let ra_deg = y.atan2(x).to_degrees().rem_euclid(360.0);
    let dec_deg = z.clamp(-1.0, 1.0).asin().to_degrees();
    let v_mag = star.apparent_magnitude();
    format!("V = {v_mag:.2} at right ascension {ra_deg:.4} and declination {dec_deg:.4} degrees")
}

/// Finds common stars in every pair of `catalogues` (name and stars); pairs without any are left out.
///
/// The cell of every star is computed; only stars near a star of the other catalogue need more time. The function needs 25 MB of memory in addition
/// to the stars, plus 16 bytes for each star of the smaller catalogue, plus 32 bytes for each star of the larger catalogue that is near one of these.
pub fn find_overlaps(catalogues: &[(&str, &[StarRecord])]) -> Vec<Overlap> {
    let mut overlaps = Vec::new();
    for (i, &(first, a)) in catalogues.iter().enumerate() {
        for &(second, b) in &catalogues[i + 1..] {
            let is_first_smaller = a.len() <= b.len();
            let ordered = if is_first_smaller { (a, b) } else { (b, a) };
            let pairs = common_stars(ordered.0, ordered.1, SAME_STAR_ARCSEC, SAME_STAR_MAG);
            let in_order = |&(small, large): &(usize, usize)| {
                if is_first_smaller { (small, large) } else { (large, small) }
            };
            let brightest = pairs.par_iter().map(in_order).min_by(|p, q| {
                let magnitude = |pair: &(usize, usize)| a[pair.0].apparent_magnitude();
                magnitude(p).total_cmp(&magnitude(q)).then(p.cmp(q))
            });
            let Some(example) = brightest.map(|(index, _)| a[index]) else { continue };
            let count = pairs.len();
            overlaps.push(Overlap { first: first.to_owned(), second: second.to_owned(), count, example });
        }
    }
    overlaps
}

/// Returns pairs of indices (into `few` and `many`) of entries that may be one star: for each entry of `few` the brightest of `many`.
fn common_stars(few: &[StarRecord], many: &[StarRecord], within_arcsec: f64, within_mag: f64) -> Vec<(usize, usize)> {
    if few.is_empty() {
        return Vec::new();
    }
    let layer = nested::get(DEPTH);

    // Sort the smaller catalogue by cell, and mark the cells near its stars.
    let by_cell = sorted_by_cell(layer, few);
    let is_near: Vec<AtomicU64> = (0..layer.n_hash().div_ceil(64)).map(|_| AtomicU64::new(0)).collect();
    by_cell.par_chunk_by(|a, b| a.0 == b.0).for_each_init(Vec::new, |near, of_cell| {
        near.clear();
        layer.append_bulk_neighbours(of_cell[0].0, near);
        near.push(of_cell[0].0);
        for &cell in near.iter() {
            is_near[(cell / 64) as usize].fetch_or(1 << (cell % 64), Ordering::Relaxed);
        }
    });

    // Keep the stars of the larger catalogue in marked cells, sorted too, so that neighbours in the sky are
    // neighbours in memory.
    let mut candidates: Vec<(u64, usize)> = many
        .par_iter()
        .enumerate()
        .filter_map(|(index, star)| Some((cell(layer, star)?, index)))
        .filter(|&(cell, _)| is_near[(cell / 64) as usize].load(Ordering::Relaxed) >> (cell % 64) & 1 == 1)
        .collect();
    candidates.par_sort_unstable();

    let within = Tolerance::new(within_arcsec, within_mag);
    by_cell
        .par_chunk_by(|a, b| a.0 == b.0)
        .flat_map_iter(|own| {
            let near = near_cell(layer, own[0].0, &candidates, many);
            own.iter().filter_map(move |(_, index)| {
                let found = within.matches(&Entry::new(few, *index), &near).next()?.index;
                Some((*index, found))
            })
        })
        .collect()
}

/// A star in the form in which stars are compared.
struct Entry {
    direction: DVec3,
    magnitude: f64,
    index: usize,
}

impl Entry {
    fn new(stars: &[StarRecord], index: usize) -> Self {
        Self { direction: stars[index].position.normalize(), magnitude: stars[index].apparent_magnitude(), index }
    }
}

/// Largest differences between entries of the same star.
#[derive(Clone, Copy)]
struct Tolerance {
    /// Square of the chord on the unit sphere.
    chord_squared: f64,
    magnitude: f64,
}

impl Tolerance {
    fn new(arcsec: f64, magnitude: f64) -> Self {
        let chord = 2.0 * (0.5 * arcsec * ARCSECOND_RAD).sin();
        Self { chord_squared: chord * chord, magnitude: magnitude + MAGNITUDE_ROUNDING }
    }

    /// Returns the entries that may be the same star, from the brightest on. `near` must be sorted by magnitude, so that the search is fast even if
    /// many stars are at one position.
    fn matches<'n>(self, star: &Entry, near: &'n [Entry]) -> impl Iterator<Item = &'n Entry> + use<'n> {
        let (direction, magnitude) = (star.direction, star.magnitude);
        let start = near.partition_point(|other| other.magnitude < magnitude - self.magnitude);
        near[start..]
            .iter()
            .take_while(move |other| other.magnitude <= magnitude + self.magnitude)
            .filter(move |other| other.direction.distance_squared(direction) <= self.chord_squared)
    }
}

/// Returns the cells and indices of stars, sorted; stars at the origin are left out.
fn sorted_by_cell(layer: &Layer, stars: &[StarRecord]) -> Vec<(u64, usize)> {
    let mut by_cell: Vec<(u64, usize)> =
        stars.par_iter().enumerate().filter_map(|(index, star)| Some((cell(layer, star)?, index))).collect();
    by_cell.par_sort_unstable();
    by_cell
}

/// Returns the entries in a cell and its neighbours, sorted by magnitude and index. `by_cell` must be sorted.
fn near_cell(layer: &Layer, cell: u64, by_cell: &[(u64, usize)], stars: &[StarRecord]) -> Vec<Entry> {
    let mut cells = Vec::with_capacity(9);
    layer.append_bulk_neighbours(cell, &mut cells);
    cells.push(cell);
    let in_cell = |cell: u64| {
        let start = by_cell.partition_point(|entry| entry.0 < cell);
        by_cell[start..].iter().take_while(move |entry| entry.0 == cell)
    };
    let mut near: Vec<Entry> =
        cells.into_iter().flat_map(in_cell).map(|(_, index)| Entry::new(stars, *index)).collect();
    near.sort_unstable_by(|a, b| a.magnitude.total_cmp(&b.magnitude).then(a.index.cmp(&b.index)));
    near
}

/// HEALPix cell of a star as seen from the origin; `None` for a star at the origin.
fn cell(layer: &Layer, star: &StarRecord) -> Option<u64> {
    let DVec3 { x, y, z } = star.position.try_normalize()?;
    let longitude = y.atan2(x).rem_euclid(std::f64::consts::TAU);
    Some(layer.hash(longitude, z.clamp(-1.0, 1.0).asin()))
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use super::*;
    use crate::catalogue::bright::bright_stars;

    /// A star at infinity.
    fn star(ra_deg: f64, dec_deg: f64, v_mag: f32) -> StarRecord {
        let (ra, dec) = (ra_deg.to_radians(), dec_deg.to_radians());
        let position = DVec3::new(dec.cos() * ra.cos(), dec.cos() * ra.sin(), dec.sin());
        StarRecord { position, magnitude: v_mag, temperature_k: 5772.0, distance_known: false }
    }

    fn count(a: &[StarRecord], b: &[StarRecord]) -> usize {
        find_overlaps(&[("a", a), ("b", b)]).first().map_or(0, |o| o.count)
    }

    #[test]
    fn angle_and_magnitude_limits_are_exact() {
        let arcsec = 1.0 / 3600.0;
        for (ra, dec) in
            [(0.0, 0.0), (359.9999, 41.8), (45.0, -41.8103), (180.0, 66.0), (12.0, 89.999), (270.0, -89.9999)]
        {
            let a = [star(ra, dec, 5.0)];
            for (offset, magnitude, is_same) in
                [(0.0, 5.3, true), (9.9, 4.71, true), (-9.9, 5.0, true), (10.1, 5.0, false), (0.0, 5.31, false)]
            {
                let b = [star(ra, dec + offset * arcsec, magnitude)];
                assert_eq!(count(&a, &b), usize::from(is_same), "at {ra}, {dec}: {offset} arcsec, {magnitude} mag");
                let east = [star(ra + offset * arcsec / dec.to_radians().cos(), dec, magnitude)];
                // Closer to a pole, ten arcseconds in right ascension are no longer an arc of ten arcseconds.
                if dec.abs() < 89.0 {
                    assert_eq!(count(&a, &east), usize::from(is_same), "at {ra}, {dec}: {offset} arcsec east");
                }
            }
        }
    }

    #[test]
    fn stars_match_by_apparent_brightness_whatever_their_distance() {
        let near =
            StarRecord { position: star(10.0, 20.0, 0.0).position * 100.0, magnitude: 0.0, ..star(0.0, 0.0, 0.0) };
        let near = StarRecord { distance_known: true, ..near };
        assert_eq!(count(&[near], &[star(10.0, 20.0, 5.0)]), 1);
        assert_eq!(count(&[near], &[star(10.0, 20.0, 0.0)]), 0);
    }

    #[test]
    fn agrees_with_a_search_of_all_pairs_over_the_whole_sky() {
        // Stars along a spiral, and copies of them that are shifted by up to 20 arcseconds and 0.6 mag in a fixed pattern.
        let a: Vec<StarRecord> = (0..3000)
            .map(|i| {
                let i = f64::from(i);
                let dec_deg = (1.0 - 2.0 * (i + 0.5) / 3000.0).asin().to_degrees();
                star((i * 0.381_966 * TAU).to_degrees() % 360.0, dec_deg, 5.0)
            })
            .collect();
        let b: Vec<StarRecord> = a
            .iter()
            .enumerate()
            .map(|(i, s)| {
                // Half steps avoid the exact limit, where rounding decides.
                let shift = 20.0 * (((i * 7 % 100) as f64 + 0.5) / 100.0) * ARCSECOND_RAD;
                let angle = (i * 13 % 360) as f64;
                let east = DVec3::Z.cross(s.position).normalize();
                let north = s.position.cross(east);
                let towards = (east * angle.to_radians().cos() + north * angle.to_radians().sin()) * shift.tan();
                let magnitude = 5.0 + 0.6 * (((i * 3 % 10) as f32 + 0.5) / 10.0);
                StarRecord { position: (s.position + towards).normalize(), magnitude, ..*s }
            })
            .collect();
        let same = |p: &StarRecord, q: &StarRecord| {
            p.position.cross(q.position).length().asin() <= SAME_STAR_ARCSEC * ARCSECOND_RAD
                && p.position.dot(q.position) > 0.0
                && (p.apparent_magnitude() - q.apparent_magnitude()).abs() <= SAME_STAR_MAG
        };
        let expected = a.iter().filter(|p| b.iter().any(|q| same(p, q))).count();
        assert!((500..2000).contains(&expected), "{expected}");
        assert_eq!(count(&a, &b), expected);
        assert_eq!(count(&b, &a), expected);
    }

    #[test]
    fn stars_twice_in_one_file_are_counted_once_each() {
        let mut stars =
            vec![star(10.0, 20.0, 3.0), star(10.0, 20.0, 3.0), star(10.0001, 20.0, 3.04), star(10.0, 20.0, 3.1)];
        let found = find_repetitions("a.csv", &stars).unwrap();
        assert_eq!((found.count, found.example), (2, stars[1]), "0.34 arcsec; the last is 0.1 mag fainter");
        assert!(
            found.to_string().contains("2 of the stars of a.csv") && found.to_string().contains("V = 3.00"),
            "{found}"
        );
        stars.truncate(1);
        stars.push(star(10.0003, 20.0, 3.0));
        assert_eq!(find_repetitions("a.csv", &stars), None, "1 arcsec apart");
        assert_eq!(find_repetitions("a.csv", &[]), None);
        // Double stars with two equal components, such as alf Com.
        assert_eq!(find_repetitions("bright", &bright_stars(0.0)).map(|found| found.count), Some(3));
    }

    /// Rows at a placeholder position, and a light curve. If the entries were not sorted by magnitude, all pairs would be compared.
    #[test]
    fn many_entries_at_one_place_are_compared_with_few() {
        let place: Vec<StarRecord> = (0..200_000).map(|_| star(0.0, 0.0, 8.0)).collect();
        assert_eq!(find_repetitions("a.csv", &place).map(|found| found.count), Some(199_999));
        let curve: Vec<StarRecord> = (0..60_000_u16).map(|i| star(10.0, 20.0, 5.0 + 5e-5 * f32::from(i))).collect();
        let found = find_repetitions("a.csv", &curve).unwrap();
        assert_eq!((found.count, found.example), (59_999, curve[1]));
        assert_eq!((count(&place, &place), count(&curve, &curve), count(&place, &curve)), (200_000, 60_000, 0));
    }

    #[test]
    fn every_pair_is_reported_with_its_brightest_star() {
        let bright = bright_stars(0.0);
        let sirius = bright.iter().position(|s| (s.apparent_magnitude() + 1.46).abs() < 1e-3).unwrap();
        let some: Vec<StarRecord> = bright.iter().skip(sirius).step_by(5).copied().collect();
        let far_off = [star(3.0, -80.0, 12.0)];
        let overlaps = find_overlaps(&[("bright", &bright), ("none", &far_off), ("some", &some), ("empty", &[])]);
        assert_eq!(overlaps.len(), 1);
        assert_eq!((overlaps[0].first.as_str(), overlaps[0].second.as_str()), ("bright", "some"));
        assert_eq!(overlaps[0].count, some.len());
        assert_eq!(overlaps[0].example, bright[sirius]);
        let text = overlaps[0].to_string();
        for part in ["stars of bright and some are within 10 arcseconds", "V = -1.46", "101.28", "-16.71"] {
            assert!(text.contains(part), "{part} is not in: {text}");
        }
    }
}
