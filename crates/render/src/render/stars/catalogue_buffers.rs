//! Stars of a scene in the form that the published methods read: all stars, five numbers each, in the order of a
//! catalogue.
//!
//! The default order is by right ascension, like the numbers of the Bright Star, Henry Draper and Hipparcos catalogues: consecutive stars lie in one
//! narrow strip of the sky from pole to pole. Another order can be requested to examine its influence.
//!
//! No shader: holds buffers.
//! No twin: holds buffers.

use std::sync::Arc;

use glam::DVec3;
use rand::{SeedableRng, seq::SliceRandom};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use crate::{
    catalogue::{
        chunks::StarSet,
        packed::{PackedStar, temperature_of_step_k},
    },
    gpu::{Gpu, storage_buffer},
    render::stars::layout,
    units::magnitude_from_illuminance_lx,
};

/// A buffer of stars in the order of the catalogue.
pub(crate) struct CatalogueDraw<'a> {
    pub stars: &'a wgpu::Buffer,
    pub count: u32,
}

/// Distance assigned to stars at infinity, pc. It is so large that the camera's position does not change their
/// direction in f32.
const INFINITY_PC: f64 = 1e12;
/// Distance to which absolute magnitudes refer, pc.
const ABSOLUTE_PC: f64 = 10.0;

/// Catalogue in GPU buffers, each small enough for a binding.
pub(super) struct CatalogueBuffers {
    set: Arc<StarSet>,
    /// Seed of the order; `None`: by right ascension.
    order: Option<u64>,
    /// Buffer and number of its stars.
    segments: Vec<(wgpu::Buffer, u32)>,
}

impl CatalogueBuffers {
    pub(super) fn new(gpu: &Gpu, set: Arc<StarSet>, order: Option<u64>) -> Self {
        let mut stars: Vec<(f32, layout::CatalogueStar)> = set.iter().map(catalogue_star).collect();
        stars.par_sort_by(|a, b| a.0.total_cmp(&b.0));
        if let Some(seed) = order {
            stars.shuffle(&mut ChaCha8Rng::seed_from_u64(seed));
        }
        let fitting = (gpu.max_binding_bytes() / size_of::<layout::CatalogueStar>() as u64) as usize;
        let segments = stars
            .chunks(fitting)
            .map(|part| {
                let part: Vec<layout::CatalogueStar> = part.iter().map(|(_, star)| *star).collect();
                (storage_buffer(gpu, "catalogue stars", &part), part.len() as u32)
            })
            .collect();
        Self { set, order, segments }
    }

    /// Lists the buffers of all stars.
    pub(super) fn draws(&self) -> Vec<CatalogueDraw<'_>> {
        self.segments.iter().map(|(stars, count)| CatalogueDraw { stars, count: *count }).collect()
    }

    /// Whether these buffers hold the stars of `set` in this order.
    pub(super) fn holds(&self, set: &Arc<StarSet>, order: Option<u64>) -> bool {
        Arc::ptr_eq(&self.set, set) && self.order == order
    }
}

/// Returns the right ascension in rad and the encoded star.
fn catalogue_star((place, at_infinity, star): (DVec3, bool, &PackedStar)) -> (f32, layout::CatalogueStar) {
    let (place, illuminance_at_10_pc_lx) = if at_infinity {
        (place * INFINITY_PC, star.illuminance_at_1_pc_lx() * (INFINITY_PC / ABSOLUTE_PC).powi(2))
    } else {
        (place, star.illuminance_at_1_pc_lx() / ABSOLUTE_PC.powi(2))
    };
    let [x, y, z] = place.as_vec3().to_array();
    let packed = layout::CatalogueStar {
        x,
        y,
        z,
        absolute_magnitude: magnitude_from_illuminance_lx(illuminance_at_10_pc_lx) as f32,
        temperature: temperature_of_step_k(star.temperature_step()) as f32,
    };
    (place.y.atan2(place.x).rem_euclid(std::f64::consts::TAU) as f32, packed)
}
