//! Computed edge blends, for calibrations without blend masks. Each projector's share falls smoothly to zero at the
//! borders of its raster, and the shares of all projectors that reach a direction sum to one.
//!
//! With the weight w of a position on a projector's own raster, alpha = w / (sum of w over all projectors that reach the direction). w = (16 x (1 -
//! x) y (1 - y))^2 with x and y relative to the raster's sides, so the share and its slope vanish at the borders. If a part of the raster is not
//! used, w falls to zero at its border in the same way.

mod kept;
mod positions;

use std::{convert::Infallible, f64::consts::PI, sync::Arc};

use glam::{DQuat, DVec2, DVec3};
use rayon::prelude::*;

use self::positions::{Nodes, Positions};
use super::blend::{Blend, between};
use crate::{
    cache,
    view::projection::{PlaneMapping, TabulatedMapping, pixel_centre},
};

/// Width of the ramp towards an unused part of the raster, pixels.
const RAMP_PX: f32 = 64.0;

/// One of several projectors.
#[derive(Clone, Debug, PartialEq)]
pub struct Beam {
    /// Directions of its pixels, in view axes.
    pub mapping: Arc<TabulatedMapping>,
    /// View axes to those of the dome.
    pub dome_from_view: DQuat,
    /// Its black level relative to its white. Black is raised to the level of the region that the most projectors light. 0: black is not raised.
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

    /// The position on the raster of a direction of the dome, pixels; it may be outside of the raster. `None` if the projector does not reach it.
    fn position(&self, direction: DVec3) -> Option<DVec2> {
        if direction.dot(self.axis) < self.least_cos {
            return None;
        }
        self.beam.mapping.pixel_from_direction(self.beam.dome_from_view.inverse() * direction)
    }

    /// The weight at a position; `None` if the projector has no pixel there.
    fn weight_inside(&self, pixel: DVec2) -> Option<f64> {
        let mapping = &self.beam.mapping;
        let [width, height] = mapping.size();
        let inside = pixel.x >= 0.0 && pixel.y >= 0.0 && pixel.x < f64::from(width) && pixel.y < f64::from(height);
        // Without unused pixels no look into the table is needed, which takes longer than the weight.
        let is_used = || self.unused_px.is_none() || mapping.contains(pixel.x as u32, pixel.y as u32);
        (inside && is_used()).then(|| self.weight(pixel))
    }

    /// The position on another raster of the direction of a pixel coordinate; see [`Self::position`].
    fn position_on(&self, other: &Self, pixel: DVec2) -> Option<DVec2> {
        other.position(self.direction(pixel)?)
    }

    /// The direction of a position on the raster, dome axes.
    fn direction(&self, pixel: DVec2) -> Option<DVec3> {
        Some(self.beam.dome_from_view * self.beam.mapping.direction_from_pixel(pixel)?)
    }
}

/// The blends of projectors that light a dome together, in the same order. The cache of the process keeps them, if it also keeps the tables of all
/// mappings.
pub fn edge_blends(beams: &[Beam]) -> Vec<Blend> {
    let Some(inputs) = kept::inputs(beams) else { return compute(beams) };
    let blends = cache::kept_or_made(kept::PART, &[&inputs], kept::FORM, || {
        tracing::info!("computing the edge blends of {} projectors", beams.len());
        Ok::<_, Infallible>(compute(beams))
    });
    let Ok(blends) = blends;
    blends
}

fn compute(beams: &[Beam]) -> Vec<Blend> {
    let fields: Vec<Field<'_>> = beams.iter().map(Field::new).collect();
    let nodes_of = |own: usize| {
        let nodes = |other: usize| (other != own).then(|| Nodes::new(&fields[own], &fields[other]));
        (0..fields.len()).map(nodes).collect()
    };
    let nodes: Vec<Vec<Option<Nodes>>> = (0..fields.len()).map(nodes_of).collect();
    // For each pixel: its share, and the number of projectors that reach it.
    let shares = fields.iter().enumerate().map(|(own, field)| {
        let others = fields.iter().enumerate().filter_map(|(index, other)| {
            let (nodes, back) = (nodes[own][index].as_ref()?, nodes[index][own].as_ref()?);
            Some((other, Positions::new(field, other, nodes, back)))
        });
        let others: Vec<_> = others.collect();
        let mapping = &field.beam.mapping;
        let [width, height] = mapping.size();
        // The sum of the weights of all projectors in the pixels of a row, and the number of projectors.
        let shares = |y: u32| {
            let mut sums: Vec<(f64, i32)> = vec![(0.0, 1); width as usize];
            for (other, positions) in &others {
                positions.of_row(y, |x, position| {
                    if let Some(weight) = other.weight_inside(position) {
                        let (sum, count) = &mut sums[x as usize];
                        *sum += weight;
                        *count += 1;
                    }
                });
            }
            let share = |(x, (others, count)): (u32, (f64, i32))| {
                if !mapping.contains(x, y) {
                    return (0.0, 0);
                }
                let weight = field.weight(pixel_centre(x, y));
                let sum = weight + others;
                (if sum > 0.0 { weight / sum } else { 1.0 / f64::from(count) }, count)
            };
            (0..width).zip(sums).map(share).collect::<Vec<_>>()
        };
        (0..height).into_par_iter().flat_map_iter(shares).collect::<Vec<(f64, i32)>>()
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

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "tests may panic")]
mod tests {
    use super::*;
    use crate::view::projection::{Fisheye, FisheyeMapping, Perspective};

    pub(super) fn beam(mapping: impl PlaneMapping + Send + 'static, azimuth_deg: f64, altitude_deg: f64) -> Beam {
        let turn = DQuat::from_rotation_y(azimuth_deg.to_radians()) * DQuat::from_rotation_x(altitude_deg.to_radians());
        Beam { mapping: Arc::new(TabulatedMapping::new(mapping).unwrap()), dome_from_view: turn, black: 0.01 }
    }

    pub(super) fn window() -> Perspective {
        Perspective::symmetric([8, 8], 0.9).unwrap()
    }

    /// A mapping with a key.
    pub(super) fn kept(inputs: &[u8]) -> Arc<TabulatedMapping> {
        TabulatedMapping::kept(window(), inputs).unwrap()
    }

    /// Returns the shares of a projector, and the number of projectors that reach each pixel, from the position of every pixel on the other rasters.
    fn exact(fields: &[Field<'_>], own: usize) -> Vec<(f64, f64)> {
        let field = &fields[own];
        let [width, height] = field.beam.mapping.size();
        let share = |index: u32| {
            let pixel = pixel_centre(index % width, index / width);
            let Some(direction) = field.direction(pixel) else { return (0.0, 0.0) };
            let weight = field.weight(pixel);
            let others = fields.iter().enumerate().filter(|(other, _)| *other != own);
            let of_others: Vec<f64> =
                others.filter_map(|(_, other)| other.weight_inside(other.position(direction)?)).collect();
            let sum = weight + of_others.iter().sum::<f64>();
            (if sum > 0.0 { weight / sum } else { 1.0 }, 1.0 + of_others.len() as f64)
        };
        (0..width * height).map(share).collect()
    }

    #[test]
    fn shares_are_those_of_exact_positions_within_3e_5() {
        let window = |size| Perspective::symmetric(size, 0.9).unwrap();
        let round = Fisheye::new([173, 173], FisheyeMapping::Equidistant, 1.6).unwrap();
        // Sizes that are not multiples of a cell, a small picture within a cell of the first one, and one that meets no other.
        let small = Perspective::symmetric([40, 40], 0.02).unwrap();
        let beams = [
            beam(window([317, 205]), 0.0, 10.0),
            beam(window([317, 205]), 50.0, 15.0),
            beam(round, 40.0, -20.0),
            beam(small, -7.0, 11.0),
            beam(window([64, 64]), 170.0, 0.0),
        ];
        let fields: Vec<Field<'_>> = beams.iter().map(Field::new).collect();
        let blends = edge_blends(&beams);
        let exact: Vec<_> = (0..beams.len()).map(|own| exact(&fields, own)).collect();
        let most = exact.iter().flatten().map(|(_, count)| *count).fold(1.0, f64::max);
        let mut largest = [0.0_f64; 2];
        for (blend, exact) in blends.iter().zip(&exact) {
            for (weights, (share, count)) in blend.weights().iter().zip(exact) {
                let black = if *count > 0.0 { 0.01 * (most - count) / count } else { 0.0 };
                for (largest, (found, exact)) in largest.iter_mut().zip(weights.iter().zip([*share, black])) {
                    *largest = largest.max((f64::from(*found) - exact).abs());
                }
            }
        }
        println!("largest difference of a share {:.1e}, of a black level {:.1e}", largest[0], largest[1]);
        assert!(largest[0] < 3e-5 && largest[1] < 2e-9);
        // Some pixels of each of the first four are shared, and the last one has all of its light.
        let shared =
            |own: usize| blends[own].weights().iter().filter(|weights| weights[0] > 0.1 && weights[0] < 0.9).count();
        assert!((0..4).all(|own| shared(own) > 3), "{:?}", [0, 1, 2, 3].map(shared));
        assert!(blends[4].weights().iter().all(|weights| weights[0] == 1.0));
    }
}
