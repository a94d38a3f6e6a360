//! Stars of a deep store for chosen pixels. Around the pixels every star of the leaves is used. In other parts of the sky, the composite stars that
//! are always in memory represent the stars that scatter light.

use std::ops::Range;

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::{Painter, SampledImage, Star, Sums, veil_tree::Source, veil_tree::VeilTree, world_direction};
use crate::{
    catalogue::{
        deep::{
            BUCKET_ORDER, BUCKETS, DeepError, LAYERS,
            live::{DeepSky, PageKey, detail::BASE_PLANE},
        },
        packed::PackedStar,
    },
    photometry::rec709::luminance,
    plan::{
        KernelPlan,
        stars::deep::{WHOLE_FROM_MAGNITUDE, reaches_leaves},
    },
    units::{PARSEC_M, illuminance_lx_from_magnitude},
};

/// Number of parts into which the cells are distributed.
const PARTS: u64 = 64;
/// Distance from all chosen pixels beyond which the light of composite stars is scattered instead of that of their stars. The cells of composite
/// stars have a radius of half a degree, and [`super::veil_tree`] would not divide cells of this size at this distance either.
const FAR_RAD: f64 = 0.18;
/// Width of the cells of the composite stars that are always in memory, rad.
const CELL_RAD: f64 = 0.008;

/// Returns the directions of the chosen pixels of images.
fn directions(images: &[SampledImage<'_>]) -> Vec<DVec3> {
    images.iter().flat_map(|image| image.pixels.iter().filter_map(|pixel| world_direction(image, *pixel))).collect()
}

/// Returns the axis and half-angle in rad of a cone around a cell of the bucket order.
fn cone_of(bucket: u64) -> (DVec3, f64) {
    PageKey::Tile { plane: BASE_PLANE, cell: bucket as u32 }.cone()
}

/// Whether the leaves of a cell of the bucket order are read: the cells around chosen pixels, or all cells if some stars of the leaves are too faint
/// to be drawn.
fn is_read(bucket: u64, directions: &[DVec3], faintest_lx: f64) -> bool {
    if faintest_lx > illuminance_lx_from_magnitude(WHOLE_FROM_MAGNITUDE) {
        return true;
    }
    let (axis, half_angle_rad) = cone_of(bucket);
    let least_cos = (half_angle_rad + FAR_RAD).cos();
    directions.iter().any(|direction| direction.dot(axis) >= least_cos)
}

/// Returns the leaves in a cell, as layer and cell number. No layer has an order below `order`.
fn leaves_of(order: u8, cell: u64) -> impl Iterator<Item = (usize, u64)> {
    LAYERS.iter().enumerate().flat_map(move |(layer, of_layer)| {
        let shift = 2 * (of_layer.order - order);
        (cell << shift..(cell + 1) << shift).map(move |cell| (layer, cell))
    })
}

/// Returns the number of stars that [`super::pixels`] reads from leaves for these images, if stars fainter than `faintest_lx` are not drawn.
pub fn stars_to_read(deep: &DeepSky, faintest_lx: f64, images: &[SampledImage<'_>]) -> u64 {
    if !reaches_leaves(faintest_lx) {
        return 0;
    }
    let directions = directions(images);
    let read = (0..BUCKETS).into_par_iter().filter(|bucket| is_read(*bucket, &directions, faintest_lx));
    read.flat_map_iter(|bucket| leaves_of(BUCKET_ORDER, bucket))
        .map(|(layer, cell)| u64::from(deep.store().leaf_stars(layer, cell)))
        .sum()
}

impl Painter<'_> {
    /// Sums of the light of a deep store, in parts.
    pub(super) fn sums_of_leaves(&self, deep: &DeepSky) -> Result<Vec<Vec<Sums>>, DeepError> {
        if !reaches_leaves(self.sky.faintest_lx) {
            return Ok(Vec::new());
        }
        let directions = directions(self.images);
        let part = |part: u64| BUCKETS * part / PARTS..BUCKETS * (part + 1) / PARTS;
        let sums = |buckets| self.sums_of_buckets(deep, buckets, &directions);
        (0..PARTS).into_par_iter().map(part).map(sums).collect()
    }

    fn sums_of_buckets(
        &self,
        deep: &DeepSky,
        buckets: Range<u64>,
        directions: &[DVec3],
    ) -> Result<Vec<Sums>, DeepError> {
        let mut sums = vec![Sums::default(); self.directions.len()];
        let mut tree = VeilTree::default();
        let camera_pc = self.sky.eye_m / PARSEC_M;
        let share_in_cell = self.sky.glare.map_or(0.0, |glare| glare.kernel.share_within(CELL_RAD));
        // Stars of leaves never have the kernel of faint stars.
        let kernels_of = |image: &SampledImage<'_>| KernelPlan { tent_below_cd_m2: 0.0, ..image.kernels };
        for bucket in buckets {
            if is_read(bucket, directions, self.sky.faintest_lx) {
                let order = LAYERS[0].order;
                for cell in bucket << (2 * (order - BUCKET_ORDER))..(bucket + 1) << (2 * (order - BUCKET_ORDER)) {
                    let stars = self.stars_of_cell(deep, order, cell)?;
                    self.spread_all(&stars, kernels_of, &mut sums);
                    // The frame scatters the light of these stars from their composite stars. Their position differs from that of a star next to the
                    // pixel.
                    let (axis, half_angle_rad) = PageKey::Leaf { layer: 0, cell: cell as u32 }.cone();
                    let least_cos = (half_angle_rad + CELL_RAD).cos();
                    let sources = stars.iter().filter_map(|star| self.source(star, star.illuminance_lx));
                    self.add_veil(sources, &mut tree, &mut sums, |scattered, sums, veil, faint| {
                        let is_next = scattered.direction.dot(axis) >= least_cos;
                        sums.deep += share_in_cell * faint + if is_next { luminance(veil) } else { 0.0 };
                    });
                }
            } else if self.sky.glare.is_some() {
                let sources = deep.base_light_of(bucket, camera_pc).map(|(towards, rgb_lx)| Source {
                    direction: towards.normalize(),
                    rgb_lx,
                    faint_lx: 0.0,
                });
                self.add_veil(sources, &mut tree, &mut sums, |_, _, _, _| {});
            }
        }
        Ok(sums)
    }

    /// Returns the stars of all leaves in a cell of an order.
    fn stars_of_cell(&self, deep: &DeepSky, order: u8, cell: u64) -> Result<Vec<Star>, DeepError> {
        let mut stars = Vec::new();
        for (layer, cell) in leaves_of(order, cell) {
            let leaf = deep.store().leaf(layer, cell)?;
            stars.extend((0..leaf.words.len()).filter_map(|index| {
                let star = leaf.star(index);
                let place_pc = deep.place_pc(&star);
                let at_1_pc_lx = star.illuminance_lx * place_pc.length_squared();
                self.star(place_pc, false, &PackedStar::new(Vec3::ZERO, at_1_pc_lx, star.temperature_k))
            }));
        }
        Ok(stars)
    }
}
