//! The solid angle of a pixel as the published systems compute it: two spherical triangles between the pixel's corners,
//! in f32.
//!
//! A triangle with unit vectors a, b, c has the solid angle 2 atan(|a (b x c)| / (1 + a b + b c + c a)) (A. van
//! Oosterom and J. Strackee, "The Solid Angle of a Plane Triangle", 1983). For a pixel the triple product is the
//! difference of numbers near 1: in f32 nearly all digits cancel. This function exists for measurements, not for use.

use glam::Vec3;
use rayon::prelude::*;

use crate::view::projection::{CubeFace, Face, PlaneMapping, ProjectionError};

/// Returns the solid angle of pixel (x, y) of a 90-degree face with `size` pixels per side, sr, as a shader computes it in f32.
pub fn pixel_solid_angle_sr(size: u32, x: u32, y: u32) -> f32 {
    let corner = |i: u32, j: u32| {
        let across = 2.0 * (i as f32) / size as f32 - 1.0;
        let up = 1.0 - 2.0 * (j as f32) / size as f32;
        Vec3::new(across, up, -1.0).normalize()
    };
    let [a, b, c, d] = [corner(x, y), corner(x + 1, y), corner(x + 1, y + 1), corner(x, y + 1)];
    triangle_sr(a, b, c) + triangle_sr(a, c, d)
}

fn triangle_sr(a: Vec3, b: Vec3, c: Vec3) -> f32 {
    2.0 * (a.dot(b.cross(c)).abs() / (1.0 + a.dot(b) + b.dot(c) + c.dot(a))).atan()
}

/// Relative errors of solid angles, over the pixels of a face.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RelativeErrors {
    /// 99th percentile of the absolute errors.
    pub p99: f64,
    /// The largest.
    pub largest: f64,
}

/// Measures the errors of `solid_angle_sr` on a 90-degree face with `size` pixels per side, relative to f64. It uses up to a million pixels that are
/// spread evenly over the face.
///
/// # Errors
/// The face has no pixels.
pub fn face_errors(
    size: u32,
    solid_angle_sr: impl Fn(u32, u32) -> f64 + Sync,
) -> Result<RelativeErrors, ProjectionError> {
    let face = CubeFace::new(Face::Front, size)?;
    // An odd step visits odd and even columns equally.
    let step = (size / 1000).max(1) | 1;
    let mut errors: Vec<f64> = (0..size)
        .into_par_iter()
        .step_by(step as usize)
        .flat_map_iter(|y| {
            let (face, solid_angle_sr) = (&face, &solid_angle_sr);
            (0..size)
                .step_by(step as usize)
                .map(move |x| (solid_angle_sr(x, y) / face.solid_angle_sr(x, y) - 1.0).abs())
        })
        .collect();
    errors.sort_unstable_by(f64::total_cmp);
    let last = errors.len() - 1;
    Ok(RelativeErrors { p99: errors[last * 99 / 100], largest: errors[last] })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn large_pixels_are_right_and_small_ones_lose_their_digits() {
        // A face of one pixel: a sixth of the sphere, 2 pi / 3 sr.
        assert!((f64::from(pixel_solid_angle_sr(1, 0, 0)) * 1.5 / std::f64::consts::PI - 1.0).abs() < 1e-6);
        for size in [1080, 4096, 8192] {
            let found = face_errors(size, |x, y| f64::from(pixel_solid_angle_sr(size, x, y))).unwrap();
            println!("two triangles in f32, {size}: p99 {:.2e}, largest {:.2e}", found.p99, found.largest);
            let least = [(1080, 1e-2), (4096, 0.2), (8192, 0.5)].iter().find(|(s, _)| *s == size).unwrap().1;
            assert!(found.p99 > least && found.largest >= found.p99);
        }
        // Test the measure itself: f64 compared with f64, and values that are one per cent too large.
        let face = CubeFace::new(Face::Front, 512).unwrap();
        assert_eq!(face_errors(512, |x, y| face.solid_angle_sr(x, y)).unwrap().largest, 0.0);
        let found = face_errors(512, |x, y| 1.01 * face.solid_angle_sr(x, y)).unwrap();
        assert!((found.p99 - 0.01).abs() < 1e-12 && (found.largest - 0.01).abs() < 1e-12);
        assert!(face_errors(0, |_, _| 0.0).is_err());
    }
}
