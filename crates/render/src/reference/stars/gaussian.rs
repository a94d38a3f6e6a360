//! The Gaussian that is round in view space, in f64: the twin of `shaders/shared/gaussian.wgsl`.
//!
//! Every pixel within the cut gets exp(-c^2 / (2 sigma^2)) times its solid angle, with c the chord between the star's direction and the pixel's
//! centre. The norm is the sum over the pixels if the kernel lies inside of the picture, or if neighbouring pictures continue beyond its border;
//! otherwise it is the integral over the sphere, 2 pi sigma^2 (1 - exp(-cut^2 / 2)), which is exact since c dc = sin(theta) dtheta.

use std::f64::consts::TAU;

use glam::DVec3;

use crate::{
    photometry::kernel::GAUSSIAN_CUT,
    plan::GaussianWidth,
    view::projection::{PlaneMapping, Tap, pixel_centre},
};

/// Returns density times solid angle of every pixel within the cut, before division by the norm. It visits every pixel of the picture, for any
/// mapping, and is slow and simple.
fn weights(mapping: &dyn PlaneMapping, sigma_rad: f64, direction: DVec3) -> Vec<Tap> {
    let [columns, rows] = mapping.size();
    let mut taps = Vec::new();
    for y in 0..rows {
        for x in 0..columns {
            let centre = mapping.contains(x, y).then(|| mapping.direction_from_pixel(pixel_centre(x, y))).flatten();
            let Some(centre) = centre else { continue };
            let chord = (centre - direction).length() / sigma_rad;
            if chord <= GAUSSIAN_CUT {
                taps.push(Tap { x, y, weight: (-0.5 * chord * chord).exp() * mapping.solid_angle_sr(x, y) });
            }
        }
    }
    taps
}

/// Whether the whole circle of the cut lies in the picture.
fn is_whole(mapping: &dyn PlaneMapping, direction: DVec3, cut_rad: f64) -> bool {
    let (right, up) = direction.any_orthonormal_pair();
    (0..32).all(|step| {
        let (sin, cos) = (f64::from(step) / 32.0 * TAU).sin_cos();
        let rim = direction * cut_rad.cos() + (right * cos + up * sin) * cut_rad.sin();
        mapping.pixel_from_direction(rim).is_some_and(|image| mapping.direction_from_pixel(image).is_some())
    })
}

/// Returns the pixels that a star in `direction` (any length) reaches, with their weights. Empty if the star has no image.
pub fn taps(mapping: &dyn PlaneMapping, width: GaussianWidth, direction: DVec3) -> Vec<Tap> {
    let direction = direction.normalize_or_zero();
    let Some([longer, _]) = mapping.pixel_extent_rad(direction) else { return Vec::new() };
    if mapping.pixel_from_direction(direction).is_none() {
        return Vec::new();
    }
    let sigma = width.sigma_at_rad(longer);
    let total = |taps: &[Tap]| taps.iter().map(|tap| tap.weight).sum::<f64>();
    let mut taps = weights(mapping, sigma, direction);
    let norm = if mapping.shows_full_sphere() || is_whole(mapping, direction, GAUSSIAN_CUT * sigma) {
        total(&taps)
    } else {
        let light = |other: &dyn PlaneMapping, seen: DVec3| total(&weights(other, sigma, seen));
        mapping
            .light_with_neighbours(direction, &light)
            .unwrap_or_else(|| TAU * sigma * sigma * (1.0 - (-0.5 * GAUSSIAN_CUT * GAUSSIAN_CUT).exp()))
    };
    for tap in &mut taps {
        tap.weight /= norm;
    }
    taps
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::view::projection::{CubeFace, Equirectangular, Face, Perspective};

    const WIDTH: GaussianWidth = GaussianWidth { sigma_rad: 0.0, sigma_px: 0.757 };

    #[test]
    fn the_weights_sum_to_one_inside_and_over_all_faces_of_a_cube() {
        let plane = Perspective::symmetric([64, 48], 0.8).unwrap();
        for direction in [DVec3::new(0.01, 0.02, -1.0), DVec3::new(0.3, -0.25, -1.0)] {
            let sum: f64 = taps(&plane, WIDTH, direction).iter().map(|tap| tap.weight).sum();
            assert!((sum - 1.0).abs() < 1e-12, "{sum}");
        }
        for direction in [DVec3::new(1.0, 1.0, -1.0), DVec3::new(0.3, 1.0, -0.999), DVec3::new(0.2, 0.3, 1.0)] {
            let sum: f64 = Face::ALL
                .into_iter()
                .map(|face| {
                    let mapping = CubeFace::new(face, 64).unwrap();
                    let seen = face.cube_from_face().conjugate() * direction;
                    taps(&mapping, WIDTH, seen).iter().map(|tap| tap.weight).sum::<f64>()
                })
                .sum();
            assert!((sum - 1.0).abs() < 1e-12, "{direction}: {sum}");
        }
    }

    /// The second moments of a wide kernel far off the axis match the Gaussian in every direction of the sky.
    #[test]
    fn the_kernel_is_round_in_the_sky_with_the_requested_width() {
        let plane = Perspective::symmetric([400, 400], 2.0).unwrap();
        let width = GaussianWidth { sigma_rad: 0.02, sigma_px: 0.757 };
        let direction = DVec3::new(1.1, 0.4, -1.0).normalize();
        let (right, up) = direction.any_orthonormal_pair();
        let (mut xx, mut yy, mut xy) = (0.0, 0.0, 0.0);
        for tap in taps(&plane, width, direction) {
            let offset = plane.direction_from_pixel(pixel_centre(tap.x, tap.y)).unwrap() - direction;
            let (x, y) = (offset.dot(right), offset.dot(up));
            xx += tap.weight * x * x;
            yy += tap.weight * y * y;
            xy += tap.weight * x * y;
        }
        let variance = 0.02 * 0.02;
        assert!((xx / variance - 1.0).abs() < 2e-3 && (yy / variance - 1.0).abs() < 2e-3, "{xx} {yy}");
        assert!((xy / variance).abs() < 1e-3);
    }

    #[test]
    fn a_star_on_the_pole_of_an_equirectangular_picture_is_whole() {
        let mapping = Equirectangular::new([64, 32]).unwrap();
        for direction in [DVec3::Y, DVec3::new(0.02, 1.0, 0.01), DVec3::new(0.0, 0.0, 1.0)] {
            let sum: f64 = taps(&mapping, WIDTH, direction).iter().map(|tap| tap.weight).sum();
            assert!((sum - 1.0).abs() < 1e-12, "{direction}: {sum}");
        }
    }
}
