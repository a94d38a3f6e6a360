//! Bodies in f64, ray by ray: every pixel is divided into n x n parts, and a ray through the centre of each is
//! intersected with the nearest body.
//!
//! A part is weighted by its solid angle, computed from the directions of the midpoints of its sides, so that pixels at a pole or far off the axis
//! are also correct. Parts beyond the rim of a round picture are left out. The luminance of a pixel is the mean over its solid angle of the luminance
//! along its rays, with 0 where they hit no body: the caller must add the stars and the sky behind them with the weight 1 - coverage.
//!
//! The eye is at rest. Luminance in cd/m^2 as linear Rec. 709.

use std::sync::Arc;

use glam::{DQuat, DVec2, DVec3};
use rayon::prelude::*;

pub use crate::scene::bodies::hides;
use crate::{
    scene::{
        SceneObjects,
        bodies::{Body, SeenBody, Sun, lights_on, suns},
    },
    view::projection::PlaneMapping,
};

/// A picture of bodies.
#[derive(Clone, Debug, PartialEq)]
pub struct BodyImage {
    /// Width and height, pixels.
    pub size: [u32; 2],
    /// Mean luminance of every pixel, row by row from the top.
    pub luminance_cd_m2: Vec<[f64; 3]>,
    /// Fraction of the solid angle of every pixel that bodies cover, 0 to 1.
    pub coverage: Vec<f64>,
}

impl BodyImage {
    /// Returns the illuminance of all pixels together, lx: the sum of luminance times solid angle.
    pub fn illuminance_lx(&self, mapping: &dyn PlaneMapping) -> [f64; 3] {
        let width = self.size[0];
        let mut sum = [0.0; 3];
        for (index, rgb) in self.luminance_cd_m2.iter().enumerate() {
            let omega_sr = mapping.solid_angle_sr(index as u32 % width, index as u32 / width);
            (0..3).for_each(|channel| sum[channel] += rgb[channel] * omega_sr);
        }
        sum
    }

    /// Returns the solid angle that bodies cover in the picture, sr.
    pub fn covered_sr(&self, mapping: &dyn PlaneMapping) -> f64 {
        let width = self.size[0];
        let part = |(index, coverage): (usize, &f64)| {
            coverage * mapping.solid_angle_sr(index as u32 % width, index as u32 / width)
        };
        self.coverage.iter().enumerate().map(part).sum()
    }
}

/// A body with its bounding cone.
struct Target<'a> {
    seen: SeenBody<'a>,
    axis: DVec3,
    /// Cosine of half the opening angle.
    least_cos: f64,
}

/// Draws the bodies of a scene for an eye at `eye_m` (world axes) with the rotation `world_from_view` from view axes to
/// world axes, with `samples` x `samples` rays per pixel.
pub fn draw(
    objects: &SceneObjects,
    eye_m: DVec3,
    world_from_view: DQuat,
    mapping: &dyn PlaneMapping,
    samples: u32,
) -> BodyImage {
    draw_lit(&objects.bodies, &suns(objects), objects.time_s, Eye { eye_m, world_from_view }, mapping, samples)
}

/// An eye at rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Eye {
    /// Its position, world axes, m.
    pub eye_m: DVec3,
    /// Rotation from view axes to world axes.
    pub world_from_view: DQuat,
}

/// Like [`draw`], but with suns that need not be among the bodies.
pub fn draw_lit(
    bodies: &[Arc<Body>],
    suns: &[Sun],
    time_s: f64,
    Eye { eye_m, world_from_view }: Eye,
    mapping: &dyn PlaneMapping,
    samples: u32,
) -> BodyImage {
    let targets: Vec<Target<'_>> = bodies
        .iter()
        .map(|body| {
            let to_body_m = body.position_m - eye_m;
            let sine = body.radii_m.max_element() / to_body_m.length();
            // The cone is widened by more than the rounding error of the cosine. An eye within the largest semi-axis
            // may see the body in any direction.
            let least_cos = if sine < 1.0 { (1.0 - sine * sine).sqrt() - 1e-12 } else { -1.0 };
            let seen = SeenBody::new(body, eye_m, &lights_on(body, suns, eye_m), time_s);
            Target { seen, axis: to_body_m.normalize_or_zero(), least_cos }
        })
        .collect();
    let [width, height] = mapping.size();
    let pixel = |x: u32, y: u32| pixel(&targets, world_from_view, mapping, samples.max(1), [x, y]);
    let rows = (0..height).into_par_iter().map(|y| (0..width).map(|x| pixel(x, y)).collect::<Vec<_>>());
    let pixels: Vec<([f64; 3], f64)> = rows.collect::<Vec<_>>().into_iter().flatten().collect();
    let (luminance_cd_m2, coverage) = pixels.into_iter().unzip();
    BodyImage { size: [width, height], luminance_cd_m2, coverage }
}

fn pixel(
    targets: &[Target<'_>],
    world_from_view: DQuat,
    mapping: &dyn PlaneMapping,
    samples: u32,
    [x, y]: [u32; 2],
) -> ([f64; 3], f64) {
    if !mapping.contains(x, y) {
        return ([0.0; 3], 0.0);
    }
    let step = 1.0 / f64::from(samples);
    let corner = DVec2::new(f64::from(x), f64::from(y));
    let middles = (0..samples).flat_map(|j| (0..samples).map(move |i| DVec2::new(f64::from(i), f64::from(j)) + 0.5));
    let seen: Vec<(DVec2, Option<[f64; 3]>)> = middles
        .map(|part| corner + part * step)
        .filter_map(|place| Some((place, nearest(targets, world_from_view * mapping.direction_from_pixel(place)?))))
        .collect();
    // Most pixels see no body: skip the weighting of their parts.
    if seen.iter().all(|(_, luminance)| luminance.is_none()) {
        return ([0.0; 3], 0.0);
    }
    let (mut luminance, mut covered, mut all) = ([0.0; 3], 0.0, 0.0);
    for (place, seen) in seen {
        let weight = part_sr(mapping, place, step / 2.0);
        all += weight;
        if let Some(seen) = seen {
            covered += weight;
            (0..3).for_each(|channel| luminance[channel] += weight * seen[channel]);
        }
    }
    if all > 0.0 { (luminance.map(|channel| channel / all), covered / all) } else { ([0.0; 3], 0.0) }
}

/// Returns the solid angle of the part of the plane within `half` of `at` along both axes, sr, accurate to second order. Sides beyond the picture's
/// rim are replaced by the centre.
fn part_sr(mapping: &dyn PlaneMapping, place: DVec2, half: f64) -> f64 {
    let across = |axis: DVec2| {
        let end = |sign: f64| mapping.direction_from_pixel(place + axis * (sign * half));
        match (end(-1.0), mapping.direction_from_pixel(place), end(1.0)) {
            (Some(before), _, Some(after)) => after - before,
            (Some(before), Some(middle), None) => (middle - before) * 2.0,
            (None, Some(middle), Some(after)) => (after - middle) * 2.0,
            _ => DVec3::ZERO,
        }
    };
    across(DVec2::X).cross(across(DVec2::Y)).length()
}

/// Returns the luminance of the nearest body along a direction in world axes.
fn nearest(targets: &[Target<'_>], direction: DVec3) -> Option<[f64; 3]> {
    let may_meet = targets.iter().filter(|target| target.axis.dot(direction) >= target.least_cos);
    let hits = may_meet.filter_map(|target| Some((target, target.seen.hit(direction)?)));
    let (target, hit) = hits.min_by(|a, b| a.1.distance_m.total_cmp(&b.1.distance_m))?;
    Some(target.seen.luminance_cd_m2(hit.unit))
}
