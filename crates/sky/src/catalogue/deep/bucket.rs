//! Encodes the stars of one cell of order 4 (a bucket) as leaves and planes.
//!
//! Everything here depends on the stars of the cell alone and not on their order, so that cells can be encoded in parallel, and the same stars
//! always give the same bytes.

use std::ops::Range;

use bytemuck::{Pod, Zeroable};

use super::cells::{SkyPlace, spread};
use super::composite::{CellSum, coarser};
use super::index::Segment;
use super::reader::light_scale;
use super::word::{ColourCarry, LightCarry, MAGNITUDES, PLACE_BITS, Word, colours, distance_code, distance_pc};
use super::{BUCKET_ORDER, LAYERS, PLANES, SUM_ORDER};
use crate::units::{SOLAR_TEMPERATURE_K, illuminance_lx_from_magnitude};

/// Faintest magnitude that a leaf can hold.
pub const FAINTEST_MAG: f64 = LAYERS[LAYERS.len() - 1].magnitude as f64 + MAGNITUDES;

/// A star of a bucket, in the form in which it is stored on disk between the two passes of an import.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct BucketStar {
    /// Coordinates in the face that contains the bucket.
    pub xy: [u32; 2],
    /// Apparent V magnitude.
    pub v_mag: f32,
    /// Distance, pc; 0: at infinity.
    pub distance_pc: f32,
    /// Temperature, K; 0: unknown.
    pub temperature_k: f32,
}

/// Returns the index of the layer for a magnitude: the last layer whose brightest magnitude is not fainter than this magnitude. Stars brighter than
/// all layers belong to the first one.
fn layer_of(v_mag: f32) -> usize {
    LAYERS.iter().rposition(|layer| v_mag >= f32::from(layer.magnitude)).unwrap_or(0)
}

/// Maps an f32 to an integer with the same sort order.
fn ordered(value: f32) -> u32 {
    let bits = value.to_bits();
    if bits >> 31 == 0 { bits | 1 << 31 } else { !bits }
}

impl BucketStar {
    fn content(&self) -> [u32; 5] {
        let [x, y] = self.xy;
        [ordered(self.v_mag), x, y, ordered(self.distance_pc), ordered(self.temperature_k)]
    }
}

/// The leaves of a bucket.
#[derive(Clone, Debug, Default)]
pub struct BucketLeaves {
    /// Words of each layer, leaf by leaf.
    pub words: [Vec<u64>; LAYERS.len()],
    /// Number of stars of each leaf.
    pub counts: [Vec<u32>; LAYERS.len()],
    /// Number of stars that were left out because they equal another star in every field.
    pub repeated: u64,
    /// Number of stars without colour that got the median temperature of their leaf or bucket.
    pub median_colour: u64,
}

impl BucketLeaves {
    /// Encodes the stars of a bucket.
    pub fn encode(bucket: u64, mut stars: Vec<BucketStar>) -> Self {
        let face = (bucket >> (2 * BUCKET_ORDER)) as u8;
        let leaf_of = |star: &BucketStar| {
            let layer = layer_of(star.v_mag);
            let place = SkyPlace { face, xy: star.xy };
            (layer, place.cell(LAYERS[layer].order) as usize & (LAYERS[layer].leaves_per_bucket() - 1))
        };
        // Sort by layer, then by leaf, then from the brightest star; sort stars of equal magnitude by their other fields.
        let key = |star: &BucketStar| {
            let (layer, leaf) = leaf_of(star);
            (layer as u64) << 60
                | (leaf as u64) << 40
                | u64::from(ordered(star.v_mag)) << 8
                | u64::from(star.xy[0] >> 24)
        };
        let mut sorted: Vec<(u64, BucketStar)> = stars.iter().map(|star| (key(star), *star)).collect();
        sorted
            .sort_unstable_by(|(a, first), (b, second)| a.cmp(b).then_with(|| first.content().cmp(&second.content())));
        let before = stars.len();
        sorted.dedup_by(|a, b| a.1 == b.1);
        stars.clear();
        stars.extend(sorted.iter().map(|(_, star)| *star));
        drop(sorted);
        let mut leaves = Self { repeated: (before - stars.len()) as u64, ..Self::default() };
        leaves.counts = LAYERS.map(|layer| vec![0; layer.leaves_per_bucket()]);

        let median_of_bucket = median_temperature_k(&stars);
        let mut carries = [(LightCarry::default(), ColourCarry::default()); LAYERS.len()];
        for run in stars.chunk_by(|a, b| leaf_of(a) == leaf_of(b)) {
            let (layer, leaf) = leaf_of(&run[0]);
            leaves.counts[layer][leaf] = run.len() as u32;
            let without_colour = run.iter().filter(|star| star.temperature_k == 0.0).count();
            leaves.median_colour += without_colour as u64;
            let median = if without_colour == 0 { None } else { median_temperature_k(run) };
            let median = median.or(median_of_bucket).unwrap_or(SOLAR_TEMPERATURE_K);
            let order = LAYERS[layer].order;
            leaves.words[layer].extend(run.iter().map(|star| {
                let temperature = if star.temperature_k == 0.0 { median } else { star.temperature_k };
                let distance = (star.distance_pc > 0.0).then_some(f64::from(star.distance_pc));
                let light = illuminance_lx_from_magnitude(f64::from(star.v_mag));
                let (of_light, of_colour) = &mut carries[layer];
                let word = Word {
                    place: SkyPlace { face, xy: star.xy }.in_cell(order, PLACE_BITS),
                    light: of_light.code(light_scale(layer), light),
                    temperature: of_colour.code(f64::from(temperature), light),
                    distance: distance_code(distance),
                };
                word.bits()
            }));
        }
        leaves
    }

    /// The index segments of the leaves, by layer.
    pub fn segments(&self) -> [Vec<Segment>; LAYERS.len()] {
        std::array::from_fn(|layer| {
            let leaves = self.ranges(layer).map(|range| Segment::new(range.len() as u32, &self.words[layer][range]));
            leaves.collect()
        })
    }

    /// Returns the range of words of each leaf of a layer.
    fn ranges(&self, layer: usize) -> impl Iterator<Item = Range<usize>> {
        let mut first = 0;
        self.counts[layer].iter().map(move |count| {
            first += *count as usize;
            first - *count as usize..first
        })
    }
}

/// Median temperature of the stars whose temperature is known.
fn median_temperature_k(stars: &[BucketStar]) -> Option<f32> {
    let mut known: Vec<f32> = stars.iter().map(|star| star.temperature_k).filter(|t| *t > 0.0).collect();
    let middle = known.len() / 2;
    (!known.is_empty()).then(|| *known.select_nth_unstable_by(middle, f32::total_cmp).1)
}

/// Sums of the light of a bucket's leaves, computed from the decoded words.
pub struct BucketSums {
    /// Light of each layer in each cell of [`SUM_ORDER`].
    pub light: [[[f64; 3]; 4]; LAYERS.len()],
    /// Cells of each plane in [`PLANES`]; empty if the bucket has no star of the plane.
    pub planes: Vec<Vec<CellSum>>,
}

/// Number of coordinate bits that select the cell of a layer's finest plane within a leaf: the finest plane is four orders finer than the leaves.
const FINER_ORDERS: u32 = 4;

const _: () =
    assert!(LAYERS[0].order + 4 == PLANES[0].order && LAYERS[2].order + 4 == PLANES[9].order && SUM_ORDER == 5);

impl BucketSums {
    /// Adds up the leaves of a bucket.
    pub fn new(leaves: &BucketLeaves) -> Self {
        let mut light = [[[0.0; 3]; 4]; LAYERS.len()];
        let mut planes: Vec<Vec<CellSum>> = vec![Vec::new(); PLANES.len()];
        // Begin with the faintest layer: a plane contains the light of its layer and of all fainter ones.
        let mut fainter: Vec<CellSum> = Vec::new();
        for layer in (0..LAYERS.len()).rev() {
            let mut cells = coarser(&fainter);
            if !leaves.words[layer].is_empty() {
                let own = layer_cells(layer, leaves, &mut light[layer]);
                if cells.is_empty() {
                    cells = own;
                } else {
                    let with_stars = cells.iter_mut().zip(&own).filter(|(_, own)| !own.is_empty());
                    with_stars.for_each(|(cell, own)| cell.merge(own));
                }
            }
            let of_layer = PLANES.iter().enumerate().filter(|(_, plane)| plane.magnitude == LAYERS[layer].magnitude);
            let mut current = cells.clone();
            for (index, _) in of_layer {
                let next = coarser(&current);
                planes[index] = std::mem::replace(&mut current, next);
            }
            fainter = cells;
        }
        Self { light, planes }
    }
}

/// Returns the cells of the finest plane of a layer with the light of its stars; also adds this light to the cells of [`SUM_ORDER`].
fn layer_cells(layer: usize, leaves: &BucketLeaves, light: &mut [[f64; 3]; 4]) -> Vec<CellSum> {
    let per_bucket = LAYERS[layer].leaves_per_bucket();
    let mut cells = vec![CellSum::default(); per_bucket << (2 * FINER_ORDERS)];
    let scale = light_scale(layer);
    let inner_bits = PLACE_BITS - FINER_ORDERS;
    for (leaf, range) in leaves.ranges(layer).enumerate() {
        let sum = &mut light[leaf * 4 / per_bucket];
        for bits in &leaves.words[layer][range] {
            let word = Word::from_bits(*bits);
            let illuminance_lx = scale.illuminance_lx(word.light);
            let light_lx = colours()[word.temperature as usize].map(|channel| channel * illuminance_lx);
            let [x, y] = word.place.map(|code| spread(code >> inner_bits) as usize);
            let inside = word
                .place
                .map(|code| (f64::from(code & ((1 << inner_bits) - 1)) + 0.5) / f64::from(1_u32 << inner_bits));
            let parallax = distance_pc(word.distance).map_or(0.0, f64::recip);
            cells[leaf << (2 * FINER_ORDERS) | x | y << 1].add(light_lx, inside, parallax);
            for channel in 0..3 {
                sum[channel] += light_lx[channel];
            }
        }
    }
    cells
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    fn stars(count: usize, bucket: u64) -> Vec<BucketStar> {
        let mut rng = ChaCha8Rng::seed_from_u64(9);
        // Corner of the bucket in its face.
        let gather = |from: u64| (0..4).fold(0_u32, |sum, bit| sum | ((bucket >> (2 * bit + from)) as u32 & 1) << bit);
        (0..count)
            .map(|i| BucketStar {
                xy: [0, 1].map(|axis| gather(axis) << 28 | rng.random::<u32>() >> 4),
                v_mag: rng.random_range(13.0..21.0),
                distance_pc: if i % 9 == 0 { 0.0 } else { rng.random_range(100.0..9000.0) },
                temperature_k: if i % 5 == 0 { 0.0 } else { rng.random_range(3000.0..9000.0) },
            })
            .collect()
    }

    #[test]
    fn leaves_do_not_depend_on_the_order_of_the_stars() {
        let bucket = 1234;
        let some = stars(5000, bucket);
        let first = BucketLeaves::encode(bucket, some.clone());
        let mut shuffled: Vec<BucketStar> = some.iter().rev().copied().collect();
        shuffled.rotate_left(777);
        // Repeated stars are left out and counted.
        shuffled.extend_from_slice(&some[..40]);
        let second = BucketLeaves::encode(bucket, shuffled);
        assert_eq!((first.words.clone(), first.counts.clone()), (second.words, second.counts));
        assert_eq!((first.repeated, second.repeated), (0, 40));
        assert_eq!(first.median_colour, 1000);
        assert_eq!(first.words.iter().map(Vec::len).sum::<usize>(), 5000);
    }

    #[test]
    fn leaves_are_brightest_first_and_stars_are_in_their_cells() {
        let bucket = 3071;
        let some = stars(3000, bucket);
        let leaves = BucketLeaves::encode(bucket, some.clone());
        let total: f64 = some.iter().map(|star| illuminance_lx_from_magnitude(f64::from(star.v_mag))).sum();
        let mut found = 0.0;
        for (layer, kind) in LAYERS.iter().enumerate() {
            for (leaf, range) in leaves.ranges(layer).enumerate() {
                let words = &leaves.words[layer][range];
                let lights: Vec<u32> = words.iter().map(|bits| Word::from_bits(*bits).light).collect();
                // The remainder of rounding that is carried may swap the order of neighbours of nearly equal light.
                assert!(lights.windows(2).all(|pair| pair[1] + 1 >= pair[0]), "{lights:?}");
                let cell = bucket << (2 * (kind.order - BUCKET_ORDER)) | leaf as u64;
                let frame = super::super::cells::CellFrame::new(kind.order, cell);
                for bits in words {
                    let word = Word::from_bits(*bits);
                    assert_eq!(SkyPlace::from_direction(frame.direction(word.inside())).cell(kind.order), cell);
                    found += light_scale(layer).illuminance_lx(word.light);
                }
            }
        }
        assert!((found / total - 1.0).abs() < 1e-5, "{found} {total}");
    }

    #[test]
    fn planes_have_the_light_of_their_layers() {
        let leaves = BucketLeaves::encode(7, stars(4000, 7));
        let sums = BucketSums::new(&leaves);
        for (plane, cells) in PLANES.iter().zip(&sums.planes) {
            assert_eq!(cells.len(), 1 << (2 * (plane.order - BUCKET_ORDER)));
            for channel in 0..3 {
                let found: f64 = cells.iter().map(|cell| cell.light_lx[channel]).sum();
                let layers = LAYERS.iter().zip(&sums.light).filter(|(layer, _)| layer.magnitude >= plane.magnitude);
                let exact: f64 = layers.flat_map(|(_, light)| light).map(|light| light[channel]).sum();
                assert!((found / exact - 1.0).abs() < 1e-12);
            }
        }
        let empty = BucketSums::new(&BucketLeaves::encode(7, Vec::new()));
        assert!(empty.planes.iter().all(Vec::is_empty));
    }
}
