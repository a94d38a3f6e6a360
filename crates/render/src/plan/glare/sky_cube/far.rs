//! Light of distant stars, kept while the camera flies.
//!
//! Space is divided into cubes of several sizes; each cube contains sixty-four of the next smaller size. A star is far from a cube if its distance is
//! large compared with the cube's side. For each star, the largest cube that contains the camera and from which the star is far is selected. Its
//! light is added to a cell of the sky, as seen from the centre of that cube; a cell's sum has light, centroid and mean parallax. For other positions
//! in that cube, each sum is moved like a single star. So during a flight only the stars around the camera are read repeatedly; the others are read
//! only when the camera leaves a cube. The result depends on the position of the camera, not on its path.
//!
//! The error is of second order in the ratio of displacement to distance, which is at most 0.87 / 48. It is below a millionth of the light of the
//! sky, and 1.4 % of the light of any part of 3 degrees. Most of this 1.4 % is due to the cells (`tests`).

use std::sync::{Arc, Weak};

use glam::DVec3;
use rayon::prelude::*;

use super::{
    Source,
    cells::{Moments, Sky, grouped},
};
use crate::{
    catalogue::chunks::{Chunk, StarSet},
    photometry::rec709::luminance,
    plan::stars::cull::VisibleChunk,
};

/// Number of sizes of cubes.
const SIZES: usize = 8;
/// Side of the largest cubes, pc, and ratio of the sides of two sizes.
const LARGEST_PC: f64 = 256.0;
const RATIO: f64 = 4.0;
/// Least distance from the centre of a cube at which a star counts as far, in sides of the cube.
const FAR_SIDES: f64 = 48.0;
/// The barycentre is at this fraction of the side of the largest cube. So it is at 0.4 or 0.6 of the side of every smaller cube, and cameras near the
/// Sun are near the middle of their cubes.
const PLACE_OF_BARYCENTRE: f64 = 0.4;
/// Stars that are nearer to the camera than this are always read again for each position, pc.
pub(super) const NEAREST_PC: f64 = 0.1;
/// Number of stars below which keeping the sums saves no time.
pub(super) const FEWEST_STARS: usize = 200_000;

/// The stars of a cell of the sky, as seen from the centre of a cube.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct FarSource {
    /// Light and directions.
    sum: Moments,
    /// Reciprocals of the distances, weighted by illuminance, lx/pc.
    parallax: f64,
}

impl FarSource {
    /// A star at a position relative to the centre, pc. `is_at_infinity`: the position is a direction.
    pub(super) fn of(source: &Source, place_pc: DVec3, is_at_infinity: bool) -> Self {
        let per_pc = if is_at_infinity { 0.0 } else { place_pc.length().recip() };
        Self { sum: Moments::of(source), parallax: source.illuminance_lx * per_pc }
    }

    pub(super) fn add(&mut self, other: &Self) {
        self.sum.add(&other.sum);
        self.parallax += other.parallax;
    }

    /// The sum as seen from a position relative to the centre, pc; `None` if the sum is dark.
    fn seen_from(&self, place_pc: DVec3) -> Option<Source> {
        let Moments { light, place } = self.sum;
        let direction = place.try_normalize()?;
        // Displacement in units of the distance.
        let seen = direction - place_pc * (self.parallax / luminance(light));
        let brighter = seen.length_squared().recip();
        let light = light.map(|channel| channel * brighter);
        Some(Source { direction: seen.try_normalize()?, illuminance_lx: luminance(light), light })
    }
}

/// The sums of the stars of one size of cubes.
#[derive(Clone, Debug)]
struct Held {
    /// Centres of the cubes of this size and the larger ones; empty for stars at infinity.
    centres_pc: Vec<DVec3>,
    sources: Vec<FarSource>,
}

/// Sums of distant stars, one for each size of the cubes from which they are far. The last sum is that of the stars at infinity.
#[derive(Clone, Debug, Default)]
pub struct FarLight {
    of: Weak<StarSet>,
    faintest_lx: f64,
    held: [Option<Held>; SIZES + 1],
}

/// Side of the cubes of a size, pc.
fn side_pc(size: usize) -> f64 {
    LARGEST_PC / RATIO.powi((SIZES - 1 - size) as i32)
}

/// The centres of the cubes that contain a position, from the smallest to the largest, pc.
fn centres_pc(place_pc: DVec3) -> [DVec3; SIZES] {
    std::array::from_fn(|size| {
        let side = side_pc(size);
        // The lattices of all sizes have a corner in common, so that smaller cubes are parts of larger ones.
        let offset = DVec3::splat(PLACE_OF_BARYCENTRE * LARGEST_PC / side);
        ((place_pc / side + offset).floor() + 0.5 - offset) * side
    })
}

/// Returns the largest size of cubes that a chunk is far from; `None` if it is near even the smallest cube.
fn size_of(chunk: &Chunk, centres_pc: &[DVec3; SIZES]) -> Option<usize> {
    if chunk.at_infinity {
        return Some(SIZES);
    }
    (0..SIZES)
        .rev()
        .find(|size| (chunk.origin_pc - centres_pc[*size]).length() - chunk.radius_pc >= FAR_SIDES * side_pc(*size))
}

impl FarLight {
    /// Drops the sums if they are of other stars, or of stars down to another limit of illuminance, lx.
    pub fn keep_for(&mut self, set: &Arc<StarSet>, faintest_lx: f64) {
        if !std::ptr::eq(self.of.as_ptr(), Arc::as_ptr(set)) || self.faintest_lx != faintest_lx {
            *self = Self { of: Arc::downgrade(set), faintest_lx, ..Self::default() };
        }
    }

    /// The distant stars as seen from the position of `sky`, summed in cells, and the visible chunks of all other stars, in their order.
    pub(super) fn seen<'a>(
        &mut self,
        sky: &Sky<'_>,
        visible: &'a [VisibleChunk],
        cells: u32,
    ) -> (Vec<Source>, Vec<&'a VisibleChunk>) {
        let centres = centres_pc(sky.place_pc);
        let sizes: Vec<Option<usize>> = sky.set.chunks.iter().map(|chunk| size_of(chunk, &centres)).collect();
        let mut seen = Vec::new();
        for (size, held) in self.held.iter_mut().enumerate() {
            // Stars at infinity have no cubes: their sums are the same everywhere.
            let own = &centres[size..];
            let centre_pc = own.first().copied().unwrap_or(sky.place_pc);
            let kept = held.take().filter(|held| held.centres_pc == own);
            let held = held.insert(kept.unwrap_or_else(|| Held {
                centres_pc: own.to_vec(),
                sources: sky.far_sums(centre_pc, cells, |chunk| sizes[chunk] == Some(size)),
            }));
            let place_pc = sky.place_pc - centre_pc;
            seen.par_extend(held.sources.par_iter().filter_map(|source| source.seen_from(place_pc)));
        }
        (seen, visible.iter().filter(|visible| sizes[visible.chunk].is_none()).collect())
    }
}

impl Sky<'_> {
    /// The stars of some chunks, summed in cells, as seen from a position, pc. Dark cells are left out.
    fn far_sums(&self, centre_pc: DVec3, cells: u32, is_among: impl Fn(usize) -> bool) -> Vec<FarSource> {
        let visible = super::visible_everywhere(self.set, centre_pc, None, self.faintest_lx);
        let visible: Vec<_> = visible.into_iter().filter(|visible| is_among(visible.chunk)).collect();
        let from_centre = Sky { place_pc: centre_pc, ..*self };
        let sums = grouped(
            &visible,
            || vec![FarSource::default(); 6 * (cells * cells) as usize],
            |sums, visible| {
                let is_at_infinity = self.set.chunks[visible.chunk].at_infinity;
                for (place_pc, star) in from_centre.stars(visible) {
                    if let Some(source) = from_centre.source(place_pc, star, self.faintest_lx) {
                        let cell = super::cell_of(source.direction, cells);
                        sums[cell].add(&FarSource::of(&source, place_pc, is_at_infinity));
                    }
                }
            },
        );
        let add = |mut sums: Vec<FarSource>, others: Vec<FarSource>| {
            sums.iter_mut().zip(&others).for_each(|(sum, other)| sum.add(other));
            sums
        };
        let sums = sums.into_iter().reduce(add).into_iter().flatten();
        sums.filter(|source| luminance(source.sum.light) > 0.0).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        catalogue::StarRecord,
        plan::glare::sky_cube::{Cell, FINEST_CELLS, direction_of_cell, visible_everywhere},
    };

    /// Stars of a thick disc with the Sun in it, of several brightnesses; every twentieth is at infinity.
    fn sky(stars: u32) -> StarSet {
        let records = (0..stars).map(|i| {
            let turn = f64::from(i) * 2.399_963;
            let radius = 3000.0 * (f64::from(i % 9973) / 9973.0).powf(0.7) + 0.5;
            let height = 300.0 * (f64::from(i) * 0.754_877).fract() - 150.0;
            StarRecord {
                position: DVec3::new(radius * turn.cos(), radius * turn.sin(), height),
                magnitude: 3.0 + (i % 11) as f32,
                temperature_k: 3000.0 + (i % 7) as f32 * 2000.0,
                distance_known: i % 20 != 0,
            }
        });
        StarSet::from_records(records.collect())
    }

    fn cells(set: &StarSet, place_pc: DVec3, far: Option<&mut FarLight>) -> Vec<Cell> {
        let visible = visible_everywhere(set, place_pc, None, 0.0);
        let sky = Sky { set, place_pc, motion: None, local_sky: None, faintest_lx: 0.0, near_pc: 1e-6 };
        sky.gather(&visible, FINEST_CELLS, false, far).cells
    }

    /// Returns two relative differences: the greatest of the light around any direction, with Gaussian weights of a standard deviation of 3 degrees,
    /// and that of all light.
    fn differences(cells: &[Cell], others: &[Cell]) -> [f64; 2] {
        let around = |cells: &[Cell], towards: DVec3| {
            let weight = |cell: &Cell| (-(cell.direction - towards).length_squared() / (2.0 * 0.052 * 0.052)).exp();
            cells.iter().map(|cell| luminance(cell.light) * weight(cell)).sum::<f64>()
        };
        let most = (0..6 * 8 * 8).map(|index| {
            let towards = direction_of_cell(index, 8);
            (around(others, towards) / around(cells, towards) - 1.0).abs()
        });
        let [whole, other] = [cells, others].map(|cells| cells.iter().map(|cell| luminance(cell.light)).sum::<f64>());
        [most.fold(0.0, f64::max), (other / whole - 1.0).abs()]
    }

    #[test]
    fn distant_stars_have_their_light_and_place_along_a_flight() {
        let set = Arc::new(sky(300_000));
        let mut far = FarLight::default();
        far.keep_for(&set, 0.0);
        let [mut most_around, mut most_of_all] = [0.0_f64; 2];
        for number in 0..24 {
            let place_pc = DVec3::new(0.7, -0.3, 0.2) * 1.6_f64.powi(number - 8);
            let exact = cells(&set, place_pc, None);
            let [around, of_all] = differences(&exact, &cells(&set, place_pc, Some(&mut far)));
            [most_around, most_of_all] = [most_around.max(around), most_of_all.max(of_all)];
        }
        println!("{most_around:.2e} around a direction, {most_of_all:.2e} of all light");
        assert!(most_around < 0.02 && most_of_all < 1e-3, "{most_around} {most_of_all}");
        // Sums that are not moved have larger errors.
        let [start, end] = [DVec3::ZERO, DVec3::new(70.0, -30.0, 20.0)].map(|place_pc| cells(&set, place_pc, None));
        let [around, of_all] = differences(&end, &start);
        assert!(around > 0.1 && of_all > 2e-3, "{around} {of_all}");
    }

    #[test]
    fn the_path_to_a_place_makes_no_difference() {
        let set = Arc::new(sky(200_000));
        let end = DVec3::new(35.0, 8.0, -3.0);
        let mut flown = FarLight::default();
        flown.keep_for(&set, 0.0);
        for share in [0.0, 0.01, 0.2, 0.9, 0.95] {
            cells(&set, end * share, Some(&mut flown));
        }
        assert_eq!(cells(&set, end, Some(&mut flown)), cells(&set, end, Some(&mut FarLight::default())));
        // Other stars have other sums.
        let others = Arc::new(sky(210_000));
        flown.keep_for(&others, 0.0);
        assert_eq!(cells(&others, end, Some(&mut flown)), cells(&others, end, Some(&mut FarLight::default())));
    }

    #[test]
    fn a_place_is_in_its_cubes_and_the_barycentre_near_their_centres() {
        for number in 0..2000 {
            let place_pc = DVec3::new(0.3, -0.21, 0.17) * f64::from(number - 1000);
            for (size, centre) in centres_pc(place_pc).into_iter().enumerate() {
                let half = 0.5 * side_pc(size);
                assert!((place_pc - centre).abs().max_element() <= half * (1.0 + 1e-9), "{place_pc} {size}");
                let larger = centres_pc(centre);
                assert_eq!(larger[size..], centres_pc(place_pc)[size..], "cubes are parts of larger ones");
            }
        }
        for (size, centre) in centres_pc(DVec3::ZERO).into_iter().enumerate() {
            let half = 0.5 * side_pc(size);
            assert!(centre.abs().max_element() < 0.21 * half, "{size}: {centre}");
        }
    }
}
