//! Checks of a whole deep store.

use rayon::prelude::*;

use super::bucket::{BucketLeaves, BucketSums};
use super::build::{BuildStep, OnStep};
use super::composite::{CellSum, Composite, largest_rest_lx, represents};
use super::error::DeepError;
use super::part::PartRecord;
use super::tile::{Tile, cells_per_tile, tile_order};
use super::{BUCKET_ORDER, BUCKETS, DeepStore, LAYERS, PLANES};

/// Number of buckets that are checked at a time.
const AT_ONCE: u64 = 32;

/// Result of a check.
#[derive(Clone, Debug, PartialEq)]
pub struct CheckReport {
    /// Number of stars.
    pub stars: u64,
    /// Number of leaves with stars, and of tiles with composite stars.
    pub leaves: u64,
    /// See `leaves`.
    pub tiles: u64,
    /// Number of composite stars.
    pub composites: u64,
    /// Largest relative difference between the light of a plane and that of its leaves; `None` if light was not checked.
    pub light: Option<f64>,
}

/// Reads a store and verifies all checksums. With `light`, also adds up the light of all leaves and compares three things with it: every composite
/// star with the stars of its cell, the sum of each plane in every cell of order 4, and the sums in the index.
///
/// # Errors
/// The first damage that is found.
pub fn check(store: &DeepStore, light: bool, on_step: &mut OnStep<'_>) -> Result<CheckReport, DeepError> {
    let index = store.index();
    let bright = store.bright()?;
    if bright.stars.stars.len() as u64 != index.bright.stars {
        return Err(DeepError::damaged(
            &store.part(super::BRIGHT_FILE),
            "its number of stars differs from that in the index",
        ));
    }
    drop(bright);
    if let Some(part) = &index.part {
        PartRecord::read(store.folder(), part)?.bright(store.folder())?;
    }
    let (mut planes, mut leaves) = (vec![PlaneLight::default(); PLANES.len()], vec![[0.0; 3]; LAYERS.len()]);
    for first in (0..BUCKETS).step_by(AT_ONCE as usize) {
        on_step(BuildStep { work: "checking", done: first, total: BUCKETS });
        let checked =
            (first..(first + AT_ONCE).min(BUCKETS)).into_par_iter().map(|bucket| check_bucket(store, bucket, light));
        let checked: Vec<(Vec<PlaneLight>, Vec<[f64; 3]>)> = checked.collect::<Result<_, DeepError>>()?;
        for (of_planes, of_leaves) in checked {
            planes.iter_mut().zip(&of_planes).for_each(|(sum, light)| sum.merge(light));
            leaves.iter_mut().zip(of_leaves).for_each(|(sum, light)| add(sum, light));
        }
    }
    on_step(BuildStep { work: "checking", done: BUCKETS, total: BUCKETS });
    let difference = light.then(|| largest_difference(&planes, &leaves));
    let used = |list: &[super::index::Segment]| list.iter().filter(|segment| segment.count > 0).count() as u64;
    Ok(CheckReport {
        stars: index.stars(),
        leaves: index.leaves.iter().map(|segments| used(&segments.list)).sum(),
        tiles: index.tiles.iter().map(|segments| used(&segments.list)).sum(),
        composites: index.tiles.iter().map(super::index::Segments::stars).sum(),
        light: difference,
    })
}

fn add(sum: &mut [f64; 3], light: [f64; 3]) {
    sum.iter_mut().zip(light).for_each(|(sum, light)| *sum += light);
}

/// Sum of the light of a plane's composite stars, and its brightest channel.
#[derive(Clone, Debug, Default)]
struct PlaneLight {
    total_lx: [f64; 3],
    /// Largest light in one channel of a cell.
    brightest_lx: f64,
}

impl PlaneLight {
    fn merge(&mut self, other: &Self) {
        add(&mut self.total_lx, other.total_lx);
        self.brightest_lx = self.brightest_lx.max(other.brightest_lx);
    }
}

/// Returns the largest relative difference between the light of a whole plane and that of its layers.
fn largest_difference(planes: &[PlaneLight], leaves: &[[f64; 3]]) -> f64 {
    let mut worst: f64 = 0.0;
    for (plane, found) in PLANES.iter().zip(planes) {
        let mut expected = [0.0; 3];
        let layers = LAYERS.iter().zip(leaves).filter(|(layer, _)| layer.magnitude >= plane.magnitude);
        layers.for_each(|(_, light)| add(&mut expected, *light));
        let channels = found.total_lx.into_iter().zip(expected).filter(|pair| *pair != (0.0, 0.0));
        worst = channels.map(|(found, expected)| (found / expected - 1.0).abs()).fold(worst, f64::max);
    }
    worst
}

/// Reads the leaves of a bucket, in the form in which they are encoded.
pub(super) fn leaves_of(store: &DeepStore, bucket: u64) -> Result<BucketLeaves, DeepError> {
    let mut leaves = BucketLeaves::default();
    for (layer, kind) in LAYERS.iter().enumerate() {
        let count = kind.leaves_per_bucket() as u64;
        for cell in bucket * count..(bucket + 1) * count {
            let words = store.leaf_words(layer, cell)?;
            leaves.counts[layer].push(words.len() as u32);
            leaves.words[layer].extend(words);
        }
    }
    Ok(leaves)
}

/// Checks a bucket; returns the light of its planes and layers, if that was requested.
fn check_bucket(store: &DeepStore, bucket: u64, light: bool) -> Result<(Vec<PlaneLight>, Vec<[f64; 3]>), DeepError> {
    let leaves = leaves_of(store, bucket)?;
    let mut planes = Vec::with_capacity(PLANES.len());
    let sums = light.then(|| BucketSums::new(&leaves));
    for (plane, kind) in PLANES.iter().enumerate() {
        let first = bucket << (2 * (tile_order(kind.order) - BUCKET_ORDER));
        let mut total = PlaneLight::default();
        for number in 0..kind.tiles_per_bucket() {
            let tile = store.tile(plane, first + number as u64)?;
            let Some(sums) = &sums else { continue };
            let cells = sums.planes[plane].chunks(cells_per_tile(kind.order)).nth(number).unwrap_or_default();
            total.merge(&compare_tile(store, plane, first + number as u64, &tile, cells)?);
        }
        // In stores of version 1 the remainder of rounding was carried from bucket to bucket.
        if let Some(sums) = &sums
            && store.index().version > 1
        {
            compare_bucket(store, plane, bucket, &total, &sums.planes[plane])?;
        }
        planes.push(total);
    }
    let Some(sums) = sums else { return Ok((Vec::new(), Vec::new())) };
    // The index contains the sums of the same words in the same order.
    let mut of_leaves = vec![[0.0; 3]; LAYERS.len()];
    for (layer, of_layer) in sums.light.iter().enumerate() {
        for (quarter, light) in of_layer.iter().enumerate() {
            let cell = 4 * bucket + quarter as u64;
            let kept = store.index().sums[layer].get(cell as usize).copied().unwrap_or_default();
            if (0..3).any(|channel| (kept[channel] - light[channel]).abs() > 1e-9 * light[channel]) {
                let problem = format!(
                    "the light of cell {cell} of order 5 differs from that of the leaves of V = {}",
                    LAYERS[layer].magnitude
                );
                return Err(DeepError::damaged(&store.part(super::index::NAME), problem));
            }
            add(&mut of_leaves[layer], *light);
        }
    }
    Ok((planes, of_leaves))
}

/// Compares the light of a plane in a bucket with that of its cells.
fn compare_bucket(
    store: &DeepStore,
    plane: usize,
    bucket: u64,
    found: &PlaneLight,
    cells: &[CellSum],
) -> Result<(), DeepError> {
    let mut expected = [0.0; 3];
    cells.iter().for_each(|cell| add(&mut expected, cell.light_lx));
    let most = largest_rest_lx(found.brightest_lx);
    let off = found.total_lx.into_iter().zip(expected).map(|(found, expected)| (found - expected).abs());
    let off = off.fold(0.0, f64::max);
    // The sums themselves have a relative error of 1e-12.
    if off <= most + 1e-12 * found.brightest_lx * cells.len() as f64 {
        return Ok(());
    }
    let problem = format!(
        "the light of its composite stars in cell {bucket} of order {BUCKET_ORDER} differs by {off:.2e} lx from that of the leaves; carried rounding \
         leaves at most {most:.2e} lx"
    );
    Err(DeepError::damaged(&store.part(&PLANES[plane].file()), problem))
}

/// Compares the composite stars of a tile with the sums of its cells; returns the light of the composite stars.
fn compare_tile(
    store: &DeepStore,
    plane: usize,
    number: u64,
    tile: &Tile,
    cells: &[CellSum],
) -> Result<PlaneLight, DeepError> {
    let kind = PLANES[plane];
    let mut expected = cells.iter().enumerate().filter(|(_, sum)| !sum.is_empty());
    let mut total = PlaneLight::default();
    let wrong = |cell: u64, problem: &str| DeepError::DamagedPart {
        path: store.part(&kind.file()),
        part: "tile",
        cell: number,
        order: tile_order(kind.order),
        problem: format!("cell {cell} of order {} {problem}", kind.order),
    };
    let first = number * cells_per_tile(kind.order) as u64;
    for (cell, bits) in tile.cells.iter().zip(&tile.bits) {
        let composite = Composite::from_bits(*bits);
        let number = first + u64::from(*cell);
        match expected.next() {
            Some((index, sum)) if index as u32 == *cell => {
                if !represents(&composite, sum) {
                    return Err(wrong(number, "does not match the light of its stars"));
                }
            }
            _ => return Err(wrong(number, "has light but no stars, or an earlier cell has stars but no light")),
        }
        let brightest_lx = composite.light_lx.into_iter().fold(0.0, f64::max);
        total.merge(&PlaneLight { total_lx: composite.light_lx, brightest_lx });
    }
    match expected.next() {
        None => Ok(total),
        Some((index, _)) => Err(wrong(first + index as u64, "has stars but no light")),
    }
}
