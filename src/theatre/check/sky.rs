//! Sampled directions over a dome.

use std::f64::consts::PI;

use glam::DVec3;
use rayon::prelude::*;

use super::{Dome, DomeMap, Hit, MapPoint, Projector};

/// Number of directions over the dome.
const SAMPLES: usize = 20_000;
/// Points along a side of the picture of the dome.
const MAP_SIDE: usize = 180;

/// A picture of the dome as a domemaster: the axis in the middle, the front at the bottom.
pub(super) fn map(dome: Dome, projectors: &[Projector<'_>]) -> DomeMap {
    let axis = dome.axis();
    // The front is the direction in which the dome's axis tilts.
    let front = (DVec3::NEG_Z - axis * axis.dot(DVec3::NEG_Z)).normalize_or(axis.any_orthonormal_vector());
    let right = front.cross(axis);
    let half_rad = 0.5 * dome.fov_deg.to_radians();
    let point = |index: usize| {
        let [x, y] = [index % MAP_SIDE, index / MAP_SIDE].map(|at| (at as f64 + 0.5) / MAP_SIDE as f64 * 2.0 - 1.0);
        let radius = x.hypot(y);
        if radius > 1.0 {
            return None;
        }
        let across = (right * x + front * y).normalize_or_zero();
        let (sin, cos) = (radius * half_rad).sin_cos();
        let direction = axis * cos + across * sin;
        let hits: Vec<Hit> = projectors.iter().filter_map(|projector| projector.hit(direction)).collect();
        let arcmin = hits.iter().map(|hit| hit.longer_rad.to_degrees() * 60.0).fold(f64::INFINITY, f64::min);
        Some(MapPoint { projectors: hits.len(), sum: hits.iter().map(|hit| hit.share).sum(), arcmin })
    };
    DomeMap { side: MAP_SIDE, points: (0..MAP_SIDE * MAP_SIDE).into_par_iter().map(point).collect() }
}

pub(super) fn pairs(count: usize) -> impl Iterator<Item = [usize; 2]> {
    (0..count).flat_map(move |first| (first + 1..count).map(move |second| [first, second]))
}

/// Directions over the dome, each with the same solid angle.
pub(super) fn lattice(dome: Dome) -> Vec<DVec3> {
    let axis = dome.axis();
    let (right, up) = axis.any_orthonormal_pair();
    let least = (0.5 * dome.fov_deg.to_radians()).cos();
    let golden = PI * (3.0 - 5.0_f64.sqrt());
    let sample_direction = |index: usize| {
        let along = 1.0 - (1.0 - least) * (index as f64 + 0.5) / SAMPLES as f64;
        let (sin, cos) = (golden * index as f64).sin_cos();
        let across = (1.0 - along * along).max(0.0).sqrt();
        axis * along + (right * cos + up * sin) * across
    };
    (0..SAMPLES).map(sample_direction).collect()
}

pub(super) fn percentiles(mut values: Vec<f64>, shares: [f64; 3]) -> [f64; 3] {
    values.sort_by(f64::total_cmp);
    shares.map(|share| {
        let index = ((values.len() as f64 * share) as usize).min(values.len().saturating_sub(1));
        values.get(index).copied().unwrap_or(f64::NAN)
    })
}

/// Returns the approximate centre and radius of the largest circle without light. The centre is the dark direction that is farthest from all lit
/// directions.
pub(super) fn widest_gap(directions: &[DVec3], counts: &[usize]) -> Option<[f64; 3]> {
    let lit: Vec<DVec3> = directions.iter().zip(counts).filter(|(_, count)| **count > 0).map(|(d, _)| *d).collect();
    let dark = directions.iter().zip(counts).filter(|(_, count)| **count == 0).map(|(d, _)| *d);
    // A few hundred directions suffice to find the centre.
    let dark: Vec<DVec3> = dark.collect();
    let stride = dark.len().div_ceil(400).max(1);
    let radius =
        |direction: &DVec3| lit.iter().map(|lit| lit.dot(*direction)).fold(-1.0, f64::max).clamp(-1.0, 1.0).acos();
    let widest = dark.iter().step_by(stride).map(|direction| (radius(direction), direction));
    let (radius, middle) = widest.max_by(|(a, _), (b, _)| a.total_cmp(b))?;
    let azimuth = middle.x.atan2(-middle.z).to_degrees();
    Some([azimuth, middle.y.asin().to_degrees(), radius.to_degrees()])
}
