//! Directions over a dome.

use std::f64::consts::PI;

use glam::{DVec2, DVec3};

use super::{Dome, Hit, MapPoint};

/// Directions over the dome.
const SAMPLES: usize = 20_000;

/// Every third direction.
pub(super) fn map(dome: Dome, directions: &[DVec3], hits: &[Vec<Option<Hit>>]) -> Vec<MapPoint> {
    let axis = dome.axis();
    // The front is where the dome's axis would be tilted further.
    let front = (DVec3::NEG_Z - axis * axis.dot(DVec3::NEG_Z)).normalize_or(axis.any_orthonormal_vector());
    let right = front.cross(axis);
    let point = |at: usize| {
        let direction = directions[at];
        let of: Vec<Hit> = hits.iter().filter_map(|of| of[at]).collect();
        let radius = direction.angle_between(axis) / (0.5 * dome.fov_deg.to_radians());
        let across = DVec2::new(direction.dot(right), -direction.dot(front)).normalize_or_zero();
        let arcmin = of.iter().map(|hit| hit.longer_rad.to_degrees() * 60.0).fold(f64::INFINITY, f64::min);
        MapPoint { place: across * radius, projectors: of.len(), sum: of.iter().map(|hit| hit.share).sum(), arcmin }
    };
    (0..directions.len()).step_by(3).map(point).collect()
}

pub(super) fn pairs(count: usize) -> impl Iterator<Item = [usize; 2]> {
    (0..count).flat_map(move |first| (first + 1..count).map(move |second| [first, second]))
}

/// Directions over the dome, each of the same solid angle.
pub(super) fn lattice(dome: Dome) -> Vec<DVec3> {
    let axis = dome.axis();
    let (right, up) = axis.any_orthonormal_pair();
    let least = (0.5 * dome.fov_deg.to_radians()).cos();
    let golden = PI * (3.0 - 5.0_f64.sqrt());
    let at = |index: usize| {
        let along = 1.0 - (1.0 - least) * (index as f64 + 0.5) / SAMPLES as f64;
        let (sin, cos) = (golden * index as f64).sin_cos();
        let across = (1.0 - along * along).max(0.0).sqrt();
        axis * along + (right * cos + up * sin) * across
    };
    (0..SAMPLES).map(at).collect()
}

pub(super) fn percentiles(mut values: Vec<f64>, shares: [f64; 3]) -> [f64; 3] {
    values.sort_by(f64::total_cmp);
    shares.map(|share| {
        let at = ((values.len() as f64 * share) as usize).min(values.len().saturating_sub(1));
        values.get(at).copied().unwrap_or(f64::NAN)
    })
}

/// Middle and radius of the largest circle without light, about: the dark direction that is farthest from all that are lit.
pub(super) fn widest_gap(directions: &[DVec3], counts: &[usize]) -> Option<[f64; 3]> {
    let lit: Vec<DVec3> = directions.iter().zip(counts).filter(|(_, count)| **count > 0).map(|(d, _)| *d).collect();
    let dark = directions.iter().zip(counts).filter(|(_, count)| **count == 0).map(|(d, _)| *d);
    // A few hundred of them are enough to find the middle.
    let dark: Vec<DVec3> = dark.collect();
    let stride = dark.len().div_ceil(400).max(1);
    let radius =
        |direction: &DVec3| lit.iter().map(|lit| lit.dot(*direction)).fold(-1.0, f64::max).clamp(-1.0, 1.0).acos();
    let widest = dark.iter().step_by(stride).map(|direction| (radius(direction), direction));
    let (radius, middle) = widest.max_by(|(a, _), (b, _)| a.total_cmp(b))?;
    let azimuth = middle.x.atan2(-middle.z).to_degrees();
    Some([azimuth, middle.y.asin().to_degrees(), radius.to_degrees()])
}
