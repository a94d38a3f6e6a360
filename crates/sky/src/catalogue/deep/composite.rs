//! Composite stars: the light of all stars of a cell that are fainter than a plane's limit.
//!
//! | bits | content | decoded as |
//! |---|---|---|
//! | 55 to 63, 46 to 54, 37 to 45 | red, green, blue | code x 2^(exponent - 56) lx |
//! | 32 to 36 | exponent | 0 to 31, common to the three |
//! | 25 to 31, 18 to 24 | centroid, x and y in the cell | (code + 0.5) / 128 |
//! | 8 to 17 | mean parallax | the inverse of the distance with this code in a leaf word |
//! | 0 to 7 | spread of the parallax | 0: none; else 0.01/pc x 10^(-6 (255 - code) / 254) |
//!
//! Colours are linear Rec. 709. Centroid, mean parallax and its standard deviation are weighted by luminance. The largest light is 1.56e-5 lx
//! per channel (V = -1.97 for white); light of V = 22 still has 8 bits. [`Quantiser`] carries the remainder of rounding from cell to cell, so
//! that the sum over a plane is that of its stars.

use std::sync::LazyLock;

use super::word::{distance_code, distance_pc};
use crate::photometry::rec709::luminance;

const MANTISSA_BITS: u32 = 9;
const LARGEST_MANTISSA: f64 = 511.0;
/// Base-2 logarithm of the unit of the mantissa when the exponent is 0.
pub const UNIT_LOG2: i32 = -56;
const LARGEST_EXPONENT: i32 = 31;
const CENTROID_STEPS: f64 = 128.0;
const LARGEST_SPREAD: f64 = 0.01;
const SPREAD_DECADES: f64 = 6.0;
const SPREAD_STEPS: f64 = 254.0;

/// Largest light of a channel, lx.
pub fn largest_lx() -> f64 {
    LARGEST_MANTISSA * f64::from(UNIT_LOG2 + LARGEST_EXPONENT).exp2()
}

/// Tables of decoded values: computing the logarithms for each star would take longer than the rest of its decoding.
struct Codes {
    /// Unit of the light of each exponent, lx.
    units: [f64; 32],
    /// Spread of the parallax, 1/pc.
    spreads: [f64; 256],
}

static CODES: LazyLock<Codes> = LazyLock::new(|| {
    let spread = |code: usize| match code {
        0 => 0.0,
        _ => LARGEST_SPREAD * 10_f64.powf(-SPREAD_DECADES * (SPREAD_STEPS + 1.0 - code as f64) / SPREAD_STEPS),
    };
    Codes {
        units: std::array::from_fn(|exponent| (exponent as f64 + f64::from(UNIT_LOG2)).exp2()),
        spreads: std::array::from_fn(spread),
    }
});

/// A decoded composite star.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Composite {
    /// Illuminance at the barycentre per channel, linear Rec. 709, lx.
    pub light_lx: [f64; 3],
    /// Centroid in the cell, each coordinate 0 to 1.
    pub inside: [f64; 2],
    /// Mean of the inverse distance, 1/pc.
    pub parallax: f64,
    /// Standard deviation of the inverse distance, 1/pc.
    pub spread: f64,
}

impl Composite {
    /// Decodes a composite star from 64 bits.
    pub fn from_bits(bits: u64) -> Self {
        let field = |from: u32, width: u32| (bits >> from) as u32 & ((1 << width) - 1);
        let Codes { units, spreads } = &*CODES;
        let unit = units[field(32, 5) as usize];
        Self {
            light_lx: [55, 46, 37].map(|from| f64::from(field(from, MANTISSA_BITS)) * unit),
            inside: [25, 18].map(|from| (f64::from(field(from, 7)) + 0.5) / CENTROID_STEPS),
            parallax: distance_pc(field(8, 10)).map_or(0.0, f64::recip),
            spread: spreads[field(0, 8) as usize],
        }
    }
}

/// Largest difference per channel between the light of composite stars and that of their cells, if the remainder of rounding was carried from cell to
/// cell. It is one step of the brightest composite star, whose largest channel is `brightest_lx`, lx.
pub fn largest_rest_lx(brightest_lx: f64) -> f64 {
    brightest_lx / 256.0 + f64::from(UNIT_LOG2).exp2()
}

/// Weighted sums over the stars of a cell.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CellSum {
    /// Illuminance at the barycentre per channel, linear Rec. 709, lx.
    pub light_lx: [f64; 3],
    /// Sum of luminance times each coordinate in the cell.
    centroid: [f64; 2],
    /// Sums of luminance times inverse distance and of luminance times the square of the inverse distance.
    parallax: [f64; 2],
}

impl CellSum {
    /// Adds a star.
    pub fn add(&mut self, light_lx: [f64; 3], inside: [f64; 2], parallax: f64) {
        let weight = luminance(light_lx);
        self.light_lx.iter_mut().zip(light_lx).for_each(|(sum, light)| *sum += light);
        self.centroid.iter_mut().zip(inside).for_each(|(sum, x)| *sum += weight * x);
        self.parallax[0] += weight * parallax;
        self.parallax[1] += weight * parallax * parallax;
    }

    /// Adds the sums of other stars of the same cell.
    pub fn merge(&mut self, other: &Self) {
        for channel in 0..3 {
            self.light_lx[channel] += other.light_lx[channel];
        }
        for axis in 0..2 {
            self.centroid[axis] += other.centroid[axis];
            self.parallax[axis] += other.parallax[axis];
        }
    }

    /// Whether the cell has no stars.
    pub fn is_empty(&self) -> bool {
        self.light_lx == [0.0; 3]
    }

    /// Returns the exact light, centroid, and mean and standard deviation of the inverse distance.
    pub fn exact(&self) -> Composite {
        let weight = luminance(self.light_lx);
        let [mean, square] = self.parallax.map(|sum| sum / weight);
        let inside = self.centroid.map(|sum| sum / weight);
        // The difference of two equal numbers has a rounding error of 1e-16 of each.
        let variance = square - mean * mean;
        let spread = if variance > 1e-13 * square { variance.sqrt() } else { 0.0 };
        Composite { light_lx: self.light_lx, inside, parallax: mean, spread }
    }
}

/// Returns the sums of the cells one order coarser; each combines four neighbouring cells of `finer`.
pub fn coarser(finer: &[CellSum]) -> Vec<CellSum> {
    let (fours, _) = finer.as_chunks::<4>();
    let merged = |four: &[CellSum; 4]| {
        let mut sum = CellSum::default();
        // Most cells of the finest orders are empty.
        for (index, cell) in four.iter().enumerate().filter(|(_, cell)| !cell.is_empty()) {
            let weight = luminance(cell.light_lx);
            let corner = [index & 1, index >> 1].map(|bit| bit as f64);
            let centroid = [0, 1].map(|axis| 0.5 * (cell.centroid[axis] + corner[axis] * weight));
            sum.merge(&CellSum { centroid, ..*cell });
        }
        sum
    };
    fours.iter().map(merged).collect()
}

/// Error: a cell has more light than a composite star can hold.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TooBright {
    /// Light per channel, lx.
    pub light_lx: [f64; 3],
}

/// Encodes the cells of a plane in order, and carries the remainder of rounding from cell to cell.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Quantiser {
    /// Remainder per channel, lx.
    pub rest_lx: [f64; 3],
}

impl Quantiser {
    /// Encodes a cell that is not empty.
    pub fn encode(&mut self, sum: &CellSum) -> Result<u64, TooBright> {
        let exact = sum.exact();
        let brightest = exact.light_lx.into_iter().fold(0.0, f64::max);
        // Add at most one step of this cell from the remainder, so that a faint cell after a bright one keeps its colour.
        let most = brightest / 256.0;
        let wanted = [0, 1, 2].map(|i| (exact.light_lx[i] + self.rest_lx[i].clamp(-most, most)).max(0.0));
        let largest = wanted.into_iter().fold(0.0, f64::max);
        // Choose the smallest exponent for which the largest channel fits.
        let exponent = ((largest / (LARGEST_MANTISSA + 0.499)).log2().ceil() as i32 - UNIT_LOG2).max(0);
        if exponent > LARGEST_EXPONENT {
            return Err(TooBright { light_lx: exact.light_lx });
        }
        let unit = f64::from(exponent + UNIT_LOG2).exp2();
        let codes = wanted.map(|light| (light / unit).round().min(LARGEST_MANTISSA));
        for (rest, (light, code)) in self.rest_lx.iter_mut().zip(exact.light_lx.into_iter().zip(codes)) {
            *rest += light - code * unit;
        }
        let [red, green, blue] = codes.map(|code| code as u64);
        let [x, y] = exact.inside.map(|x| (x * CENTROID_STEPS).floor().clamp(0.0, CENTROID_STEPS - 1.0) as u64);
        let parallax = if exact.parallax > 0.0 { distance_code(Some(exact.parallax.recip())) } else { 0 };
        let spread = spread_code(exact.spread);
        Ok(red << 55
            | green << 46
            | blue << 37
            | (exponent as u64) << 32
            | x << 25
            | y << 18
            | u64::from(parallax) << 8
            | spread)
    }
}

fn spread_code(spread: f64) -> u64 {
    let below = (LARGEST_SPREAD / spread).log10() * SPREAD_STEPS / SPREAD_DECADES;
    // Without a spread the logarithm is infinite, which gives code 0. A spread below the smallest one also gets code 0.
    (SPREAD_STEPS + 1.0 - below.round()).clamp(0.0, SPREAD_STEPS + 1.0) as u64
}

/// Whether a composite star represents the sums of a cell: the light agrees within two steps, the centroid within one step, and the mean parallax
/// within 1 %.
pub fn represents(found: &Composite, sum: &CellSum) -> bool {
    let exact = sum.exact();
    let step = found.light_lx.into_iter().fold(exact.light_lx.into_iter().fold(0.0, f64::max), f64::max) / 256.0;
    let step = step.max(f64::from(UNIT_LOG2).exp2());
    let light = (0..3).all(|i| (found.light_lx[i] - exact.light_lx[i]).abs() <= 2.0 * step);
    let centroid = (0..2).all(|axis| (found.inside[axis] - exact.inside[axis]).abs() <= 1.0 / CENTROID_STEPS);
    let nearest = distance_code(if exact.parallax > 0.0 { Some(exact.parallax.recip()) } else { None });
    let parallax = match distance_pc(nearest) {
        Some(distance) => (found.parallax * distance - 1.0).abs() < 0.01,
        // At the far end of the scale, rounding may give either infinity or the last step.
        None => found.parallax < 5.1e-6,
    };
    light && centroid && parallax
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::super::word::colours;
    use super::*;
    use crate::{photometry::rec709::uv_prime, units::illuminance_lx_from_magnitude};

    /// Cells with 0 to 40 stars each, of V = 13 to 23.
    fn cells(count: usize) -> Vec<CellSum> {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let mut cells = vec![CellSum::default(); count];
        for cell in &mut cells {
            for _ in 0..rng.random_range(0..40) {
                let colour = colours()[rng.random_range(20..256)];
                let lx = illuminance_lx_from_magnitude(23.0 + 2.0 * rng.random::<f64>().log10().max(-5.0));
                cell.add(
                    colour.map(|c| c * lx),
                    [rng.random(), rng.random()],
                    10_f64.powf(rng.random_range(-4.5..-2.0)),
                );
            }
        }
        cells
    }

    #[test]
    fn sums_of_a_plane_are_exact_and_each_composite_represents_its_cell() {
        let mut cells = cells(1 << 14);
        while cells.len() > 16 {
            let (mut quantiser, mut found, mut exact) = (Quantiser::default(), [0.0; 3], [0.0; 3]);
            for cell in cells.iter().filter(|cell| !cell.is_empty()) {
                let composite = Composite::from_bits(quantiser.encode(cell).expect("faint stars"));
                assert!(represents(&composite, cell), "{composite:?} {:?}", cell.exact());
                for channel in 0..3 {
                    found[channel] += composite.light_lx[channel];
                    exact[channel] += cell.light_lx[channel];
                }
                let spread = cell.exact().spread;
                assert!((composite.spread - spread).abs() <= 0.03 * spread, "{composite:?} {spread}");
                let [place, true_place] = [composite.light_lx, cell.light_lx].map(uv_prime);
                assert!((place[0] - true_place[0]).hypot(place[1] - true_place[1]) < 0.004);
            }
            let light = cells.iter().fold([0.0; 3], |sum, cell| [0, 1, 2].map(|i| sum[i] + cell.light_lx[i]));
            for channel in 0..3 {
                assert!((exact[channel] / light[channel] - 1.0).abs() < 1e-12);
                // The difference is the remainder left after the last few cells.
                let error = found[channel] / exact[channel] - 1.0;
                assert!(error.abs() < 0.02 / cells.len() as f64, "{} cells: {error:e}", cells.len());
            }
            cells = coarser(&cells);
        }
    }

    #[test]
    fn coarser_cells_have_the_sums_of_their_stars() {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let (mut fine, mut coarse) = (vec![CellSum::default(); 16], CellSum::default());
        for _ in 0..300 {
            let inside: [f64; 2] = [rng.random(), rng.random()];
            let fourth = inside.map(|x| (x * 4.0) as usize);
            let cell = (fourth[0] & 1) | (fourth[1] & 1) << 1 | (fourth[0] >> 1) << 2 | (fourth[1] >> 1) << 3;
            let light = [rng.random(), rng.random(), rng.random()];
            fine[cell].add(light, inside.map(|x| (x * 4.0).fract()), 1e-3);
            coarse.add(light, inside, 1e-3);
        }
        let found = coarser(&coarser(&fine));
        assert_eq!(found.len(), 1);
        let [found, exact] = [found[0].exact(), coarse.exact()];
        assert!((0..2).all(|axis| (found.inside[axis] - exact.inside[axis]).abs() < 1e-12), "{found:?} {exact:?}");
        assert!((found.parallax / 1e-3 - 1.0).abs() < 1e-12);
    }

    #[test]
    fn light_beyond_the_range_is_refused_and_other_light_is_not_its_composite() {
        let mut sum = CellSum::default();
        sum.add([2.0 * largest_lx(), 1e-9, 1e-9], [0.5; 2], 0.0);
        assert!(Quantiser::default().encode(&sum).is_err());
        let mut sum = CellSum::default();
        sum.add([0.9 * largest_lx(); 3], [0.5; 2], 0.0);
        let composite = Composite::from_bits(Quantiser::default().encode(&sum).expect("it fits"));
        assert!(represents(&composite, &sum));
        let [mut light, mut place, mut parallax] = [composite; 3];
        light.light_lx[2] *= 1.02;
        place.inside[0] += 0.02;
        parallax.parallax = 1e-4;
        assert!([light, place, parallax].iter().all(|wrong| !represents(wrong, &sum)));
    }
}
