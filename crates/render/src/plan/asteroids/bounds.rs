//! Distance from which an impostor may replace a mesh: beyond it, each error of the impostor is below half a pixel.
//!
//! R is the radius of the tile's content, D the distance, p the angle of a pixel, b the distance between the eyes:
//!
//! - *disparity*: a flat picture has no depth. The second eye sees a point R in front of the centre displaced by b R / D^2.
//! - *resolution*: one of the T - 2 texels across 2 R must not be larger than a pixel: 2 R / ((T - 2) D) <= p.
//! - *direction*: an error delta of the picture's direction displaces points at depth R by R delta.
//! - *perspective*: pictures in the atlas are parallel projections. A point at depth h and lateral offset x is seen at x / (D - h), not at x / D;
//!   with x^2 + h^2 = R^2 the difference is at most R^2 / 2 D^2. If each pixel's ray is intersected with the picture at its depth, only the limb has
//!   an error: the eye sees it R^2 / D in front of the centre, on a circle that is smaller than R by R (R / D)^2 / 2, which is an angle of R^3 / 2
//!   D^3.

use super::{AsteroidSettings, ImpostorMethod};

/// Total width of the free margin around a tile's picture, both sides together, texels.
pub const BORDER_PX: u32 = 2;

/// Distances, m, from which each error of an impostor is below half a pixel.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct ImpostorDistances {
    /// For disparity between the eyes: a flat picture has no depth.
    pub disparity_m: f64,
    /// For the resolution of the tile.
    pub resolution_m: f64,
    /// For the direction of the tile.
    pub direction_m: f64,
    /// For parallel instead of central projection.
    pub perspective_m: f64,
}

impl ImpostorDistances {
    /// The greatest of these distances.
    pub fn nearest_m(&self) -> f64 {
        self.disparity_m.max(self.resolution_m).max(self.direction_m).max(self.perspective_m)
    }
}

/// Bound of the error of the direction of an atlas of `tiles` x `tiles`, rad; `tests` compares it with a scan of the sphere. `euler_atlas`: error of
/// the orientation at the centre of the view; elsewhere, the angle from the axis is added, for any atlas size. `octahedral`: angle between the corner
/// and the centre of a tile in the middle of an octahedron's face, where tiles are largest. `octahedral_blend`: error of the weighted mean direction,
/// greatest where the cells bend over an edge of the octahedron.
pub fn direction_error_bound_rad(method: ImpostorMethod, tiles: u32) -> Option<f64> {
    let n = f64::from(tiles);
    match method.chosen() {
        ImpostorMethod::EulerAtlas => Some(2.0 * (std::f64::consts::PI / n).cos().powi(2).acos()),
        ImpostorMethod::Octahedral => Some(18.0_f64.sqrt() / n),
        ImpostorMethod::OctahedralBlend | ImpostorMethod::OctahedralSplat => Some(BLEND_ERROR / n),
        ImpostorMethod::Auto | ImpostorMethod::None => None,
    }
}

/// See [`direction_error_bound_rad`].
const BLEND_ERROR: f64 = 1.3;

/// Returns the distances for the impostor of an asteroid. The asteroid lies within a sphere of `radius_m` (mean radius times the shape's bound), a
/// pixel spans `pixel_rad`, and the eyes are `stereo_baseline_m` apart (0 for one eye). Errors are limited to half a pixel divided by `quality`.
/// `None`: the method has no atlas.
pub fn impostor_distances(
    method: ImpostorMethod,
    settings: &AsteroidSettings,
    radius_m: f64,
    pixel_rad: f64,
    stereo_baseline_m: f64,
    quality: f64,
) -> Option<ImpostorDistances> {
    let allowed_rad = pixel_rad / quality;
    let texels = f64::from(settings.tile_px.saturating_sub(BORDER_PX).max(1));
    let direction_rad = direction_error_bound_rad(method, settings.tiles)?;
    let perspective = match method.chosen() {
        ImpostorMethod::OctahedralBlend | ImpostorMethod::OctahedralSplat => allowed_rad.cbrt().recip(),
        _ => allowed_rad.sqrt().recip(),
    };
    Some(ImpostorDistances {
        disparity_m: (2.0 * stereo_baseline_m * radius_m / allowed_rad).sqrt(),
        resolution_m: 2.0 * radius_m / (texels * allowed_rad),
        direction_m: 2.0 * radius_m * direction_rad / allowed_rad,
        perspective_m: radius_m * perspective,
    })
}

/// The nearest distance, m, at which the impostor's errors stay below half a pixel divided by `quality`; see
/// [`impostor_distances`]. `None`: the method has no atlas.
pub fn nearest_distance_m(
    method: ImpostorMethod,
    settings: &AsteroidSettings,
    radius_m: f64,
    pixel_rad: f64,
    stereo_baseline_m: f64,
    quality: f64,
) -> Option<f64> {
    let distances = impostor_distances(method, settings, radius_m, pixel_rad, stereo_baseline_m, quality)?;
    Some(distances.nearest_m())
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "tests")]

    use glam::{DMat3, DQuat, DVec3};

    use super::{
        super::tiles::{angle_between_rad, direction_error_rad, orientation_error_rad},
        ImpostorMethod::{EulerAtlas, Octahedral, OctahedralBlend},
        *,
    };

    const R: f64 = 7.0;
    const P: f64 = 8e-4;
    const B: f64 = 0.064;

    fn distances(method: ImpostorMethod) -> ImpostorDistances {
        impostor_distances(method, &AsteroidSettings::default(), R, P, B, 1.0).unwrap()
    }

    /// Unit vectors evenly distributed over the sphere (golden spiral).
    fn sphere(count: u32) -> impl Iterator<Item = DVec3> {
        (0..count).map(move |i| {
            let z = 1.0 - (2.0 * f64::from(i) + 1.0) / f64::from(count);
            let (sin, cos) = (f64::from(i) * 2.399_963_229_728_653).sin_cos();
            let across = (1.0 - z * z).sqrt();
            DVec3::new(across * cos, across * sin, z)
        })
    }

    /// Greatest error, in pixels, of all points of the sphere that are visible to an eye at distance `d`.
    fn worst_px(d: f64, error_rad: impl Fn(DVec3) -> f64) -> f64 {
        let eye = DVec3::new(0.0, 0.0, d);
        let seen = |point: &DVec3| (eye - *point).dot(*point) >= 0.0;
        sphere(20_000).map(|unit| R * unit).filter(seen).map(error_rad).fold(0.0, f64::max) / P
    }

    #[test]
    fn at_the_distance_of_disparity_depth_is_worth_half_a_pixel() {
        let d = distances(Octahedral).disparity_m;
        let disparity = |d: f64| {
            worst_px(d, |point| {
                let angle = |x: f64| ((point.x - x) / (d - point.z)).atan() - (-x / d).atan();
                (angle(0.5 * B) - angle(-0.5 * B)).abs()
            })
        };
        let [far, near] = [disparity(d), disparity(0.5 * d)];
        assert!(far < 0.65 && far > 0.4 && near > 1.5, "{far} {near}");
    }

    #[test]
    fn at_the_distance_of_resolution_a_texel_is_a_pixel() {
        let d = distances(Octahedral).resolution_m;
        assert!((2.0 * (R / d).atan() / 30.0 / P - 1.0).abs() < 1e-3);
    }

    #[test]
    fn at_the_distance_of_direction_a_turned_picture_has_an_error_of_half_a_pixel() {
        for method in [EulerAtlas, Octahedral, OctahedralBlend] {
            let d = distances(method).direction_m;
            let turn = DMat3::from_rotation_y(direction_error_bound_rad(method, 32).unwrap());
            // In a parallel projection this is the only error.
            let error = |d: f64| worst_px(1e3 * d, |point| ((turn * point).x - point.x).abs() / d);
            assert!((error(d) - 0.5).abs() < 0.01 && error(0.5 * d) > 0.9, "{method:?}: {}", error(d));
        }
    }

    #[test]
    fn at_the_distance_of_perspective_a_parallel_picture_has_an_error_of_half_a_pixel() {
        let d = distances(Octahedral).perspective_m;
        let error = |d: f64| {
            worst_px(d, |point| {
                // The impostor's square is as large as the asteroid's outline.
                let outline = d / (d * d - R * R).sqrt();
                let aside = point.x.hypot(point.y);
                ((aside / (d - point.z)).atan() - (aside * outline / d).atan()).abs()
            })
        };
        let [far, near] = [error(d), error(0.5 * d)];
        assert!(far < 0.55 && near > 1.5, "{far} {near}");
        // With depth, only the outline has an error.
        let d = distances(OctahedralBlend).perspective_m;
        let limb = |d: f64| ((R / d).asin() - (R / d).atan()).abs() / P;
        assert!(limb(d) < 0.52 && limb(d) > 0.48 && limb(0.5 * d) > 3.0, "{}", limb(d));
    }

    #[test]
    fn the_largest_distance_counts_and_scales_with_quality() {
        let settings = AsteroidSettings::default();
        for method in [EulerAtlas, Octahedral, OctahedralBlend] {
            let all = distances(method);
            let nearest = |quality| nearest_distance_m(method, &settings, R, P, B, quality).unwrap();
            assert_eq!(nearest(1.0), all.nearest_m());
            assert!(nearest(2.0) > 1.4 * nearest(1.0));
            println!("{}: {all:.0?}, {:.0} radii", method.name(), nearest(1.0) / R);
        }
        assert_eq!(nearest_distance_m(ImpostorMethod::None, &settings, R, P, B, 1.0), None);
        // With a wide baseline, disparity limits the distance of small asteroids.
        let stereo = impostor_distances(Octahedral, &settings, 1e-3, P, 10.0, 1.0).unwrap();
        assert_eq!(stereo.nearest_m(), stereo.disparity_m);
    }

    #[test]
    fn bounds_of_the_direction_hold_over_the_sphere_and_are_close() {
        for tiles in [8, 16, 32, 64] {
            for method in [EulerAtlas, Octahedral, OctahedralBlend] {
                let worst = sphere(400_000).map(|direction| {
                    let view_from_shape = DMat3::from_quat(DQuat::from_rotation_arc(direction, DVec3::Z));
                    if method == EulerAtlas {
                        orientation_error_rad(method, view_from_shape, DVec3::Z, tiles).unwrap()
                    } else {
                        direction_error_rad(method, view_from_shape, DVec3::Z, tiles).unwrap()
                    }
                });
                let worst = worst.fold(0.0, f64::max);
                let bound = direction_error_bound_rad(method, tiles).unwrap();
                println!(
                    "{}, {tiles} tiles: {:.3} deg, bound {:.3} deg",
                    method.name(),
                    worst.to_degrees(),
                    bound.to_degrees()
                );
                assert!(worst <= bound * (1.0 + 1e-9) && worst > 0.8 * bound, "{method:?} {tiles}: {worst} {bound}");
            }
        }
        assert!(angle_between_rad(DVec3::X, DVec3::Y) > 1.5);
    }
}
