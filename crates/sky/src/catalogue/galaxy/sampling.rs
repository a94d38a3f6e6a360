//! Expected star counts, and stars drawn from them.
//!
//! A star of absolute magnitude M at distance modulus plus extinction mu appears at V = M + mu. Therefore the number of stars of a population that
//! are brighter than V is the integral over space of density times `brighter_than(V - mu)`. Volume times density is accumulated once in a histogram
//! over mu; the number for any V is then a short sum.
//!
//! Stars are drawn by thinning. Each cell of the sightlines gets a Poisson number of proposals from an upper bound of the density and of the
//! luminosity function; each proposal is then kept with the probability at its own position. The result follows the continuous model: the cells are
//! not visible in the sky.

use super::luminosity_function::{BRIGHTEST, LuminosityFunction};
use super::sightlines::{
    Cell, LATITUDES, LONGITUDES, PLANE_CORNERS, SHELLS, Sightlines, corner_pc, distance_modulus_mag, plane_index,
};
use super::structure::{POPULATIONS, Place, Population};
use crate::catalogue::StarRecord;
use crate::coordinates;
use glam::DMat3;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Poisson};
use rayon::prelude::*;
use std::ops::Range;

/// Number of columns of cells that are drawn together from one random stream.
const BLOCK_LONGITUDES: usize = 4;
/// Number of blocks of the sky, the units of parallel work.
pub const BLOCKS: usize = LONGITUDES / BLOCK_LONGITUDES;

/// Factor by which the density inside a cell may exceed that at its corners.
const DENSITY_HEADROOM: f64 = 1.1;

/// Histogram of distance modulus plus extinction: first value, steps per magnitude, number of steps. Stars beyond its
/// end (behind 36 magnitudes of dust and distance) are never visible.
const MODULUS_FROM: f64 = -5.0;
const MODULUS_STEPS_PER_MAG: f64 = 40.0;
const MODULUS_STEPS: usize = 41 * 40;

/// The model of the Milky Way, prepared for counting and drawing.
pub struct Sky {
    sightlines: Sightlines,
    functions: [LuminosityFunction; POPULATIONS],
    /// Volume in cubic parsecs times relative density, by population and modulus.
    weighted_volume: Vec<f64>,
    icrs_from_galactic: DMat3,
}

/// Apparent V magnitudes from `brightest` (inclusive, may be minus infinity) to `faintest` (exclusive).
#[derive(Clone, Copy, Debug)]
pub struct MagnitudeRange {
    /// Brightest magnitude, inclusive.
    pub brightest: f64,
    /// Faintest magnitude, exclusive.
    pub faintest: f64,
}

/// Relative densities at the corners of one plane of constant longitude.
type DensityPlane = Vec<[f32; POPULATIONS]>;

fn density_plane(longitude: usize) -> DensityPlane {
    let mut plane = vec![[0f32; POPULATIONS]; PLANE_CORNERS];
    for latitude in 0..=LATITUDES {
        for distance in 0..=SHELLS {
            let p = corner_pc(longitude, latitude, distance);
            plane[plane_index(latitude, distance)] = Place::from_sun(p.x, p.y, p.z).densities().map(|d| d as f32);
        }
    }
    plane
}

impl Sky {
    /// Integrates dust and densities along all lines of sight.
    pub fn new() -> Self {
        let sightlines = Sightlines::new();
        // Blocks are added in order, so that rounding does not depend on the number of threads.
        let blocks: Vec<Vec<f64>> =
            (0..BLOCKS).into_par_iter().map(|block| block_weighted_volume(&sightlines, block)).collect();
        let mut weighted_volume = vec![0.0; POPULATIONS * MODULUS_STEPS];
        for block in &blocks {
            for (sum, value) in weighted_volume.iter_mut().zip(block) {
                *sum += value;
            }
        }
        Self {
            sightlines,
            functions: LuminosityFunction::all(),
            weighted_volume,
            icrs_from_galactic: coordinates::icrs_from_galactic(),
        }
    }

    /// The lines of sight, with their dust.
    pub fn sightlines(&self) -> &Sightlines {
        &self.sightlines
    }

    /// The luminosity functions, in the order of [`Population::ALL`].
    pub fn functions(&self) -> &[LuminosityFunction; POPULATIONS] {
        &self.functions
    }

    /// Expected number of stars over the whole sky with an apparent V magnitude below `v_mag`.
    pub fn brighter_than(&self, v_mag: f64) -> f64 {
        let mut sum = 0.0;
        for (function, volumes) in self.functions.iter().zip(self.weighted_volume.chunks(MODULUS_STEPS)) {
            for (step, volume) in volumes.iter().enumerate() {
                let modulus = MODULUS_FROM + (step as f64 + 0.5) / MODULUS_STEPS_PER_MAG;
                if modulus > v_mag - BRIGHTEST {
                    break;
                }
                sum += volume * function.brighter_than(v_mag - modulus);
            }
        }
        sum
    }

    /// Returns the magnitude up to which `stars` stars are expected, but at most `faintest`.
    pub fn magnitude_with(&self, stars: f64, faintest: f64) -> f64 {
        let (mut low, mut high) = (BRIGHTEST + MODULUS_FROM, faintest);
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if self.brighter_than(middle) < stars {
                low = middle;
            } else {
                high = middle;
            }
        }
        high
    }

    /// Draws the stars of adjacent blocks of the sky (below [`BLOCKS`]) with apparent magnitudes in `range`, and passes them to `sink` one by one. Each
    /// block and `round` has its own random stream, so that disjoint ranges can be drawn one after the other.
    pub fn draw_blocks(
        &self,
        blocks: Range<usize>,
        range: MagnitudeRange,
        (seed, round): (u64, u32),
        sink: &mut dyn FnMut(StarRecord),
    ) {
        let mut west = density_plane(blocks.start * BLOCK_LONGITUDES);
        for block in blocks {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            rng.set_stream(u64::from(round) << 32 | block as u64);
            for longitude in block * BLOCK_LONGITUDES..(block + 1) * BLOCK_LONGITUDES {
                let east = density_plane(longitude + 1);
                for latitude in 0..LATITUDES {
                    for shell in 0..SHELLS {
                        let cell = Cell { longitude, latitude, shell };
                        self.draw_cell(cell, [&west, &east], range, &mut rng, sink);
                    }
                }
                west = east;
            }
        }
    }

    fn draw_cell(
        &self,
        cell: Cell,
        densities: [&DensityPlane; 2],
        range: MagnitudeRange,
        rng: &mut ChaCha8Rng,
        sink: &mut dyn FnMut(StarRecord),
    ) {
        let bounds = self.cell_bounds(cell, densities);
        if range.faintest - bounds.nearest_modulus <= BRIGHTEST {
            return;
        }
        // Compute the upper bound of the number of stars, and the part of each luminosity function that can be in range.
        let volume = cell.volume_pc3();
        let mut parts = [(0.0, 0.0); POPULATIONS];
        let mut proposals = [0.0; POPULATIONS];
        let mut total = 0.0;
        for (i, function) in self.functions.iter().enumerate() {
            let from = function.brighter_than(range.brightest - bounds.farthest_modulus);
            let to = function.brighter_than(range.faintest - bounds.nearest_modulus);
            parts[i] = (from, to);
            proposals[i] = volume * bounds.density[i] * (to - from);
            total += proposals[i];
        }
        if total <= 0.0 {
            return;
        }
        let poisson = Poisson::new(total).expect("the bound of a cell is positive, finite and below 1e10");
        let count = poisson.sample(rng) as u64;
        for _ in 0..count {
            // Choose the population, then the magnitude and the position of the star.
            let mut pick = rng.random::<f64>() * total;
            let mut i = 0;
            while i + 1 < POPULATIONS && (pick >= proposals[i] || proposals[i] == 0.0) {
                pick -= proposals[i];
                i += 1;
            }
            let function = &self.functions[i];
            let (from, to) = parts[i];
            let absolute_mag = function.magnitude_at(from + (to - from) * rng.random::<f64>());
            let spot = self.sightlines.spot(cell, [rng.random(), rng.random(), rng.random()]);
            let chance: f64 = rng.random();
            let p = spot.position_pc;
            if chance * bounds.density[i] > Place::from_sun(p.x, p.y, p.z).density(Population::ALL[i]) {
                continue;
            }
            let mut star = StarRecord {
                position: self.icrs_from_galactic * p,
                magnitude: (absolute_mag + spot.extinction_mag) as f32,
                temperature_k: 0.0,
                distance_known: true,
            };
            // Test the rounded value in the record and not the original one: no star may be even slightly brighter than the limit.
            if (range.brightest..range.faintest).contains(&star.apparent_magnitude()) {
                star.temperature_k = function.draw_temperature_k(absolute_mag, rng);
                sink(star);
            }
        }
    }

    fn cell_bounds(&self, cell: Cell, densities: [&DensityPlane; 2]) -> CellBounds {
        let extinctions = [self.sightlines.plane(cell.longitude), self.sightlines.plane(cell.longitude + 1)];
        let mut density = [0f32; POPULATIONS];
        let (mut least_near, mut most_far) = (f32::INFINITY, 0f32);
        for side in 0..2 {
            for latitude in [cell.latitude, cell.latitude + 1] {
                let near = plane_index(latitude, cell.shell);
                least_near = least_near.min(extinctions[side][near]);
                most_far = most_far.max(extinctions[side][near + 1]);
                for corner in [near, near + 1] {
                    for (bound, value) in density.iter_mut().zip(densities[side][corner]) {
                        *bound = bound.max(value);
                    }
                }
            }
        }
        CellBounds {
            density: density.map(|d| f64::from(d) * DENSITY_HEADROOM),
            nearest_modulus: distance_modulus_mag(cell.shell) + f64::from(least_near),
            farthest_modulus: distance_modulus_mag(cell.shell + 1) + f64::from(most_far),
        }
    }
}

/// Upper bounds for all positions in a cell.
struct CellBounds {
    density: [f64; POPULATIONS],
    nearest_modulus: f64,
    farthest_modulus: f64,
}

/// Returns the contribution of one block to the histogram, with one sample at the centre of each cell.
fn block_weighted_volume(sightlines: &Sightlines, block: usize) -> Vec<f64> {
    let mut sums = vec![0.0; POPULATIONS * MODULUS_STEPS];
    for longitude in block * BLOCK_LONGITUDES..(block + 1) * BLOCK_LONGITUDES {
        for latitude in 0..LATITUDES {
            for shell in 0..SHELLS {
                let cell = Cell { longitude, latitude, shell };
                let spot = sightlines.middle(cell);
                let bin = (spot.modulus_mag - MODULUS_FROM) * MODULUS_STEPS_PER_MAG;
                if bin < 0.0 || bin >= MODULUS_STEPS as f64 {
                    continue;
                }
                let volume = cell.volume_pc3();
                let p = spot.position_pc;
                for (i, density) in Place::from_sun(p.x, p.y, p.z).densities().into_iter().enumerate() {
                    sums[i * MODULUS_STEPS + bin as usize] += volume * density;
                }
            }
        }
    }
    sums
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_position_in_a_cell_is_denser_than_its_bound() {
        let sky = &*super::super::tests::SKY;
        let mut rng = ChaCha8Rng::seed_from_u64(11);
        let mut worst: f64 = 0.0;
        // Test blocks towards the centre, where the profiles are steepest, and in an ordinary direction.
        for longitude in [0, 479, 130] {
            let planes = [density_plane(longitude), density_plane(longitude + 1)];
            for latitude in 0..LATITUDES {
                for shell in 0..SHELLS {
                    let cell = Cell { longitude, latitude, shell };
                    let bounds = sky.cell_bounds(cell, [&planes[0], &planes[1]]);
                    for _ in 0..4 {
                        let spot = sky.sightlines.spot(cell, [rng.random(), rng.random(), rng.random()]);
                        assert!(spot.modulus_mag >= bounds.nearest_modulus - 1e-9);
                        assert!(spot.modulus_mag <= bounds.farthest_modulus + 1e-9);
                        let p = spot.position_pc;
                        for (i, &population) in Population::ALL.iter().enumerate() {
                            let density = Place::from_sun(p.x, p.y, p.z).density(population);
                            // The bound may be 0 where f32 underflows, because no stars can be lost there.
                            if density > 1e-30 {
                                worst = worst.max(density / bounds.density[i]);
                            }
                        }
                    }
                }
            }
        }
        assert!(worst <= 1.0, "density {worst} times its bound");
    }

    #[test]
    fn blocks_that_are_drawn_together_have_the_stars_of_single_ones() {
        let sky = &*super::super::tests::SKY;
        let range = MagnitudeRange { brightest: 4.0, faintest: 9.0 };
        let drawn = |blocks: Range<usize>| {
            let mut stars = Vec::new();
            sky.draw_blocks(blocks, range, (5, 0), &mut |star| stars.push(star));
            stars
        };
        let single: Vec<StarRecord> = (7..10).flat_map(|block| drawn(block..block + 1)).collect();
        assert!(single.len() > 100 && drawn(7..10) == single);
    }

    #[test]
    fn drawn_counts_match_the_expected_integral() {
        let sky = &*super::super::tests::SKY;
        // The second range has its own round, as if the first one had given too few stars. The range is narrower than the depth of a cell.
        for (round, (brightest, faintest)) in (0..).zip([(4.0, 9.5), (9.5, 9.6)]) {
            let range = MagnitudeRange { brightest, faintest };
            let drawn: usize = (0..BLOCKS)
                .into_par_iter()
                .map(|block| {
                    let mut drawn = 0;
                    sky.draw_blocks(block..block + 1, range, (5, round), &mut |_| drawn += 1);
                    drawn
                })
                .sum();
            let expected = sky.brighter_than(faintest) - sky.brighter_than(brightest);
            // The integral samples only the centre of each cell, so that its error is half a per cent. The tolerance adds five standard deviations of
            // the draw.
            let tolerance = 0.005 * expected + 5.0 * expected.sqrt();
            assert!((drawn as f64 - expected).abs() < tolerance, "{drawn} drawn, {expected:.0} expected");
        }
    }
}
