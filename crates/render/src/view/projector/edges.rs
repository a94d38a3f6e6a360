//! Computed edge blends, for calibrations without blend masks. Each projector's share falls smoothly to zero at the
//! borders of its raster, and the shares of all projectors that reach a direction sum to one.
//!
//! With the weight w of a position on a projector's own raster, alpha = w / (sum of the w of all projectors there). w =
//! (16 x (1 - x) y (1 - y))^2 with x and y relative to the raster's sides, so the share and its slope vanish at the
//! borders. If a part of the raster is not used, w falls to zero at its border in the same way.

use std::{f64::consts::PI, sync::Arc};

use glam::{DQuat, DVec2, DVec3};
use rayon::prelude::*;

use super::blend::{Blend, between};
use crate::view::projection::{PlaneMapping, TabulatedMapping, pixel_centre};

/// Width of the ramp towards an unused part of the raster, pixels.
const RAMP_PX: f32 = 64.0;

/// One of several projectors.
#[derive(Clone, Debug, PartialEq)]
pub struct Beam {
    /// Directions of its pixels, in view axes.
    pub mapping: Arc<TabulatedMapping>,
    /// View axes to those of the dome.
    pub dome_from_view: DQuat,
    /// Its black level relative to its white: black is raised to the level of the region with the most projectors. 0:
    /// black is not raised.
    pub black: f64,
}

/// Weights of a projector's raster.
struct Field<'a> {
    beam: &'a Beam,
    /// Axis in dome axes, and cosine of the angle around it beyond which the projector does not reach.
    axis: DVec3,
    least_cos: f64,
    /// Distance to the nearest unused pixel, at most [`RAMP_PX`], pixels; `None` if all are used.
    unused_px: Option<Vec<f32>>,
}

impl<'a> Field<'a> {
    fn new(beam: &'a Beam) -> Self {
        let cone = beam.mapping.bounding_cone(1.0);
        let least_cos = if cone.half_angle_rad < PI { cone.half_angle_rad.cos() } else { -1.0 };
        Self { beam, axis: beam.dome_from_view * cone.axis, least_cos, unused_px: unused_px(&beam.mapping) }
    }

    /// The weight at a position of the raster, pixels.
    fn weight(&self, pixel: DVec2) -> f64 {
        let [width, height] = self.beam.mapping.size();
        let (x, y) = (pixel.x / f64::from(width), pixel.y / f64::from(height));
        let edges = 16.0 * x * (1.0 - x) * y * (1.0 - y);
        let unused = self.unused_px.as_ref().map_or(1.0, |distances| {
            let size = [width as usize, height as usize];
            let distance = |x: usize, y: usize| f64::from(distances[y * size[0] + x]);
            between(size, pixel.to_array(), distance) / f64::from(RAMP_PX)
        });
        (edges * unused).powi(2)
    }

    /// The weight in a direction of the dome; `None` if the projector does not reach it.
    fn towards(&self, direction: DVec3) -> Option<f64> {
        if direction.dot(self.axis) < self.least_cos {
            return None;
        }
        let mapping = &self.beam.mapping;
        let pixel = mapping.pixel_from_direction(self.beam.dome_from_view.inverse() * direction)?;
        let [width, height] = mapping.size();
        let inside = pixel.x >= 0.0 && pixel.y >= 0.0 && pixel.x < f64::from(width) && pixel.y < f64::from(height);
        (inside && mapping.contains(pixel.x as u32, pixel.y as u32)).then(|| self.weight(pixel))
    }
}

/// The blends of projectors that light a dome together, in the same order.
pub fn edge_blends(beams: &[Beam]) -> Vec<Blend> {
    let fields: Vec<Field<'_>> = beams.iter().map(Field::new).collect();
    // For each pixel: its share, and the number of projectors that reach it.
    let shares = fields.iter().enumerate().map(|(own, field)| {
        let mapping = &field.beam.mapping;
        let width = mapping.size()[0];
        let share = |index: usize| {
            let pixel = pixel_centre(index as u32 % width, index as u32 / width);
            let Some(direction) = mapping.direction_from_pixel(pixel) else { return (0.0, 0) };
            let direction = field.beam.dome_from_view * direction;
            let weight = field.weight(pixel);
            let others = fields.iter().enumerate().filter(|(other, _)| *other != own);
            let (mut sum, mut count) = (weight, 1);
            for other_weight in others.filter_map(|(_, other)| other.towards(direction)) {
                sum += other_weight;
                count += 1;
            }
            (if sum > 0.0 { weight / sum } else { 1.0 / f64::from(count) }, count)
        };
        let pixels = mapping.size().map(|side| side as usize).iter().product::<usize>();
        (0..pixels).into_par_iter().map(share).collect::<Vec<(f64, i32)>>()
    });
    let shares: Vec<_> = shares.collect();
    let most = shares.iter().flatten().map(|(_, count)| *count).max().unwrap_or(1);
    let blends = shares.iter().zip(beams).map(|(shares, beam)| {
        let weights = shares.iter().map(|(share, count)| {
            let lift = if *count == 0 { 0.0 } else { beam.black * f64::from(most - count) / f64::from(*count) };
            [*share as f32, lift.min(1.0) as f32]
        });
        Blend::from_weights(beam.mapping.size(), weights.collect())
    });
    blends.collect()
}

/// Distances to the nearest unused pixel, at most [`RAMP_PX`]: two passes with steps to the eight neighbours (Rosenfeld
/// and Pfaltz 1968), which overestimates lengths by at most 8 %.
fn unused_px(mapping: &TabulatedMapping) -> Option<Vec<f32>> {
    let [width, height] = mapping.size().map(|side| side as usize);
    if mapping.pixels() == width as u64 * height as u64 {
        return None;
    }
    let used = |index: usize| mapping.contains((index % width) as u32, (index / width) as u32);
    let mut distances: Vec<f32> = (0..width * height).map(|index| if used(index) { RAMP_PX } else { 0.0 }).collect();
    let before = [[-1_i64, 0], [-1, -1], [0, -1], [1, -1]];
    let mut pass = |indices: &mut dyn Iterator<Item = usize>, sign: i64| {
        for index in indices {
            let (x, y) = ((index % width) as i64, (index / width) as i64);
            for [i, j] in before.map(|step| step.map(|by| sign * by)) {
                let (x, y) = (x + i, y + j);
                if (0..width as i64).contains(&x) && (0..height as i64).contains(&y) {
                    let step = if i != 0 && j != 0 { std::f32::consts::SQRT_2 } else { 1.0 };
                    distances[index] = distances[index].min(distances[y as usize * width + x as usize] + step);
                }
            }
        }
    };
    pass(&mut (0..width * height), 1);
    pass(&mut (0..width * height).rev(), -1);
    Some(distances)
}
