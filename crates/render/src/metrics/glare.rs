//! Glare: how the luminance falls off around a source, whether it is the same in all directions, and how much light it
//! contains.
//!
//! Angles are angles between directions, never distances on the screen: "round" means round in view space. The source itself is not glare; the caller
//! must choose angles outside its image.

use std::f64::consts::TAU;

use glam::{DVec2, DVec3};

use super::{
    HdrView,
    error::{MetricError, not_negative, positive},
    flux::{illuminance_near_direction_lx, total_illuminance_lx},
    image::separation_rad,
};
use crate::view::projection::pixel_centre;

/// A ring around a source.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Annulus {
    /// Inner (inclusive) and outer (exclusive) angle from the source, rad; the ring contains the pixels whose centres
    /// lie between them.
    pub edges_rad: [f64; 2],
    /// Geometric mean of the angles of its pixels, weighted by solid angle, rad.
    pub angle_rad: f64,
    /// Mean luminance of its pixels, weighted by solid angle, cd/m^2.
    pub luminance_cd_m2: f64,
    /// The same mean of the luminance expected at the centres of the same pixels, cd/m^2.
    pub expected_cd_m2: f64,
    /// Number of its pixels.
    pub pixels: usize,
}

impl Annulus {
    /// Returns the luminance divided by the expected one, minus 1.
    pub fn relative_error(&self) -> f64 {
        self.luminance_cd_m2 / self.expected_cd_m2 - 1.0
    }
}

/// Returns the mean luminance in rings around `direction`, over all images of one view. There is one ring between each two successive values of
/// `edges_rad`, which must increase. Rings without a pixel are left out. `expected` is the expected luminance at an angle from `direction`, cd/m^2.
///
/// # Errors
/// [`MetricError::TooFew`] below two edges, [`MetricError::NotPositive`] for an expected luminance that is not a positive number,
/// [`MetricError::NoLight`] if no pixel lies in any ring.
pub fn radial_profile(
    images: &[HdrView<'_>],
    direction: DVec3,
    edges_rad: &[f64],
    expected: impl Fn(f64) -> f64,
) -> Result<Vec<Annulus>, MetricError> {
    if edges_rad.len() < 2 {
        return Err(MetricError::TooFew { what: "edges of rings", found: edges_rad.len(), least: 2 });
    }
    let empty = |edges: &[f64]| Annulus {
        edges_rad: [edges[0], edges[1]],
        angle_rad: 0.0,
        luminance_cd_m2: 0.0,
        expected_cd_m2: 0.0,
        pixels: 0,
    };
    let mut rings: Vec<(Annulus, f64)> = edges_rad.windows(2).map(|edges| (empty(edges), 0.0)).collect();
    for image in images {
        let [width, height] = image.size();
        for (x, y) in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
            let Some(angle_rad) = image.direction(x, y).map(|at| separation_rad(at, direction)) else { continue };
            let after = edges_rad.partition_point(|edge| *edge <= angle_rad);
            if after == 0 || after == edges_rad.len() || angle_rad == 0.0 {
                continue;
            }
            let (ring, area) = &mut rings[after - 1];
            let omega = image.mapping().solid_angle_sr(x, y);
            *area += omega;
            ring.angle_rad += omega * angle_rad.ln();
            ring.luminance_cd_m2 += omega * image.luminance_cd_m2(x, y);
            ring.expected_cd_m2 += omega * positive("expected luminance", expected(angle_rad))?;
            ring.pixels += 1;
        }
    }
    rings.retain(|(_, area)| *area > 0.0);
    if rings.is_empty() {
        return Err(MetricError::NoLight("a profile"));
    }
    let mean = |(ring, area): (Annulus, f64)| Annulus {
        angle_rad: (ring.angle_rad / area).exp(),
        luminance_cd_m2: ring.luminance_cd_m2 / area,
        expected_cd_m2: ring.expected_cd_m2 / area,
        ..ring
    };
    Ok(rings.into_iter().map(mean).collect())
}

/// Returns the slope of log luminance as a function of log angle: -2 for an inverse square law. It is a least-squares fit to the rings whose mean
/// angles lie within `between_rad`.
///
/// # Errors
/// [`MetricError::TooFew`] below three rings, [`MetricError::NotPositive`] if one of them is black.
pub fn log_log_slope(profile: &[Annulus], between_rad: [f64; 2]) -> Result<f64, MetricError> {
    let [least, most] = between_rad;
    let points = profile
        .iter()
        .filter(|ring| (least..=most).contains(&ring.angle_rad))
        .map(|ring| {
            let luminance = positive("luminance of a ring", ring.luminance_cd_m2)?;
            Ok(DVec2::new(ring.angle_rad.ln(), luminance.ln()))
        })
        .collect::<Result<Vec<_>, MetricError>>()?;
    if points.len() < 3 {
        return Err(MetricError::TooFew { what: "rings for a slope", found: points.len(), least: 3 });
    }
    let mean = points.iter().sum::<DVec2>() / points.len() as f64;
    let (products, squares) =
        points.iter().map(|point| *point - mean).fold((0.0, 0.0), |(products, squares), offset| {
            (products + offset.x * offset.y, squares + offset.x * offset.x)
        });
    Ok(products / squares)
}

/// Evenness of the luminance on a circle around a source.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Roundness {
    /// Largest |L / mean - 1| on the circle: 0 if glare is round in view space.
    pub largest_deviation: f64,
    /// Mean luminance on the circle, cd/m^2.
    pub mean_cd_m2: f64,
    /// Share of the circle that lies inside the picture.
    pub share_inside: f64,
}

/// Number of points on a circle.
const POINTS: u32 = 720;
/// Minimum number of points for a meaningful result: a tenth of the circle.
const FEWEST_POINTS: usize = 72;

/// Compares luminances at one angle around `direction` in all images of one view. Luminance is interpolated between
/// four pixel centres; points of the circle without four of them in one image are left out. If a kernel falls off with
/// the inverse square, interpolation adds up to 0.75 (pixel / angle)^2 to the deviation: the circle should be at least
/// 10 pixels wide.
///
/// # Errors
/// [`MetricError::NotPositive`] if the angle is not a positive number, [`MetricError::TooFew`] if less than a tenth of the
/// circle lies inside the picture, [`MetricError::NoLight`] if that part is black.
pub fn roundness(images: &[HdrView<'_>], direction: DVec3, angle_rad: f64) -> Result<Roundness, MetricError> {
    positive("angle of a circle", angle_rad)?;
    let direction = direction.normalize();
    let (right, up) = direction.any_orthonormal_pair();
    let (sine, cosine) = angle_rad.sin_cos();
    let luminances: Vec<f64> = (0..POINTS)
        .map(|i| DVec2::from_angle(TAU * f64::from(i) / f64::from(POINTS)) * sine)
        .map(|across| direction * cosine + right * across.x + up * across.y)
        .filter_map(|at| images.iter().find_map(|image| interpolated_cd_m2(image, at)))
        .collect();
    if luminances.len() < FEWEST_POINTS {
        let what = "points of a circle inside the picture";
        return Err(MetricError::TooFew { what, found: luminances.len(), least: FEWEST_POINTS });
    }
    let mean_cd_m2 = luminances.iter().sum::<f64>() / luminances.len() as f64;
    if mean_cd_m2 == 0.0 {
        return Err(MetricError::NoLight("roundness"));
    }
    let deviation = |luminance: &f64| (luminance / mean_cd_m2 - 1.0).abs();
    Ok(Roundness {
        largest_deviation: luminances.iter().map(deviation).fold(0.0, f64::max),
        mean_cd_m2,
        share_inside: luminances.len() as f64 / f64::from(POINTS),
    })
}

/// Returns the bilinearly interpolated luminance, cd/m^2; `None` if not all four pixels lie inside the picture.
fn interpolated_cd_m2(image: &HdrView<'_>, direction: DVec3) -> Option<f64> {
    let position = image.pixel(direction)? - DVec2::splat(0.5);
    let (first, part) = (position.floor(), position - position.floor());
    let mut sum = 0.0;
    for offset in [DVec2::ZERO, DVec2::X, DVec2::Y, DVec2::ONE] {
        let place = first + offset;
        let [width, height] = image.size().map(f64::from);
        // NaN fails this comparison too.
        if !((0.0..width).contains(&place.x) && (0.0..height).contains(&place.y)) {
            return None;
        }
        let (x, y) = (place.x as u32, place.y as u32);
        image.mapping().direction_from_pixel(pixel_centre(x, y))?;
        let weight = (1.0 - (part.x - offset.x).abs()) * (1.0 - (part.y - offset.y).abs());
        sum += weight * image.luminance_cd_m2(x, y);
    }
    Some(sum)
}

/// Relative errors over many positions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RelativeErrors {
    /// Root of the mean square.
    pub rms: f64,
    /// The largest absolute error.
    pub largest: f64,
}

/// Returns the errors of pairs of a measured and an expected value, relative to the expected value.
///
/// # Errors
/// [`MetricError::TooFew`] without pairs, [`MetricError::NotPositive`] if an expected value is not a positive number, or a
/// measured one is negative or not finite.
pub fn relative_errors(measured_and_expected: &[(f64, f64)]) -> Result<RelativeErrors, MetricError> {
    if measured_and_expected.is_empty() {
        return Err(MetricError::TooFew { what: "pairs to compare", found: 0, least: 1 });
    }
    let (mut squares, mut largest) = (0.0, 0.0_f64);
    for (measured, expected) in measured_and_expected {
        let error = not_negative("measured value", *measured)? / positive("expected value", *expected)? - 1.0;
        squares += error * error;
        largest = largest.max(error.abs());
    }
    Ok(RelativeErrors { rms: (squares / measured_and_expected.len() as f64).sqrt(), largest })
}

/// Returns the light that all images of one view show farther than `radius_rad` from a source: the sum of Y times solid angle, lx. Over the whole
/// sphere it equals the source's illuminance times the scattered fraction times the share of the kernel beyond that angle.
///
/// # Errors
/// [`MetricError::OutsidePicture`] if a pixel outside of the picture has light.
pub fn scattered_flux_lx(images: &[HdrView<'_>], direction: DVec3, radius_rad: f64) -> Result<f64, MetricError> {
    Ok(total_illuminance_lx(images)? - illuminance_near_direction_lx(images, direction, radius_rad)?)
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{FRAC_PI_4, PI};

    use super::*;
    use crate::{
        photometry::glare::{GlareKernel, InverseSquareKernel},
        view::projection::{CubeFace, Equirectangular, Face, Fisheye, FisheyeMapping, Perspective, PlaneMapping},
    };

    fn picture(mapping: &dyn PlaneMapping, luminance: impl Fn(DVec3, DVec2) -> f64) -> Vec<[f64; 3]> {
        let [width, height] = mapping.size();
        let pixels = (0..height).flat_map(|y| (0..width).map(move |x| pixel_centre(x, y)));
        pixels.map(|at| [mapping.direction_from_pixel(at).map_or(0.0, |d| luminance(d, at)); 3]).collect()
    }

    /// Returns a picture whose luminance is angle^power around a direction.
    fn power_law(mapping: &dyn PlaneMapping, direction: DVec3, power: i32) -> Vec<[f64; 3]> {
        picture(mapping, |at, _| separation_rad(at, direction).max(1e-3).powi(power))
    }

    fn log_edges(from: f64, to: f64) -> Vec<f64> {
        (0..=20).map(|i| from * (to / from).powf(f64::from(i) / 20.0)).collect()
    }

    #[test]
    fn a_profile_has_the_slope_of_its_own_kernel_only() {
        let mapping = Fisheye::new([128, 128], FisheyeMapping::Equidistant, PI).unwrap();
        let direction = DVec3::new(0.4, 0.1, -0.9).normalize();
        let expected = |t: f64| t.powi(-2);
        let edges = log_edges(0.1, 1.5);
        for (power, slope) in [(-2, -2.0), (-3, -3.0)] {
            let pixels = power_law(&mapping, direction, power);
            let image = [HdrView::new(&mapping, &pixels).unwrap()];
            let profile = radial_profile(&image, direction, &edges, expected).unwrap();
            assert_eq!(profile.len(), 20);
            let found = log_log_slope(&profile, [0.15, 1.4]).unwrap();
            assert!((found - slope).abs() < 0.01, "{found}");
            let errors = profile.iter().map(|ring| ring.relative_error().abs());
            let largest = errors.fold(0.0, f64::max);
            assert!(if power == -2 { largest < 1e-12 } else { largest > 1.0 }, "{largest}");
            assert!(
                profile.iter().all(|ring| ring.edges_rad[0] <= ring.angle_rad && ring.angle_rad < ring.edges_rad[1])
            );
            // Around another direction the same picture has a different profile.
            let wrong = radial_profile(&image, direction * DVec3::new(-1.0, 1.0, 1.0), &edges, expected).unwrap();
            assert!(wrong.iter().any(|ring| ring.relative_error().abs() > 0.5));
        }
    }

    #[test]
    fn profiles_join_the_faces_of_a_cube() {
        let direction = DVec3::new(1.0, 0.1, -1.0).normalize();
        let faces = [Face::Front, Face::Right].map(|face| (CubeFace::new(face, 64).unwrap(), face.cube_from_face()));
        let pixels = faces.each_ref().map(|(face, turn)| power_law(face, turn.conjugate() * direction, -2));
        let view = |i: usize| HdrView::new(&faces[i].0, &pixels[i]).unwrap().turned(faces[i].1);
        let edges = log_edges(0.2, 0.7);
        let both = radial_profile(&[view(0), view(1)], direction, &edges, |t| t.powi(-2)).unwrap();
        let one = radial_profile(&[view(0)], direction, &edges, |t| t.powi(-2)).unwrap();
        assert!(both.iter().zip(&one).all(|(both, one)| both.pixels > one.pixels));
        assert!(both.iter().all(|ring| ring.relative_error().abs() < 1e-12));
        let circles =
            [[view(0)].as_slice(), &[view(0), view(1)]].map(|views| roundness(views, direction, 0.5).unwrap());
        assert!(circles[1].share_inside > 1.8 * circles[0].share_inside && circles[1].largest_deviation < 0.01);
    }

    #[test]
    fn meaningless_profiles_are_refused() {
        let mapping = Perspective::symmetric([8, 8], 1.0).unwrap();
        let pixels = vec![[0.0; 3]; 64];
        let image = [HdrView::new(&mapping, &pixels).unwrap()];
        let profile = |edges: &[f64], expected: f64| radial_profile(&image, DVec3::NEG_Z, edges, |_| expected);
        assert!(matches!(profile(&[0.1], 1.0), Err(MetricError::TooFew { .. })));
        assert!(matches!(profile(&[2.0, 3.0], 1.0), Err(MetricError::NoLight(_))));
        assert!(profile(&[0.0, 0.5], 0.0).is_err() && profile(&[0.0, 0.5], f64::NAN).is_err());
        // A black picture has a relative error of -1, and no slope.
        let black = profile(&[0.1, 0.2, 0.3, 0.4], 1.0).unwrap();
        assert!(black.iter().all(|ring| ring.relative_error() == -1.0));
        assert!(matches!(log_log_slope(&black, [0.0, 1.0]), Err(MetricError::NotPositive { .. })));
        assert!(matches!(log_log_slope(&black[..0], [0.0, 1.0]), Err(MetricError::TooFew { .. })));
    }

    #[test]
    fn round_in_view_space_differs_from_round_on_the_screen() {
        let plane = Perspective::symmetric([200, 200], 2.0).unwrap();
        let fisheye = Fisheye::new([200, 200], FisheyeMapping::Equidistant, PI).unwrap();
        let mappings: [&dyn PlaneMapping; 2] = [&plane, &fisheye];
        for mapping in mappings {
            for off_axis in [0.0, 0.6, FRAC_PI_4] {
                let direction = DVec3::new(off_axis.sin(), 0.0, -off_axis.cos());
                let pixels = power_law(mapping, direction, -2);
                let view = HdrView::new(mapping, &pixels).unwrap();
                let found = roundness(&[view], direction, 0.3).unwrap();
                assert!(found.largest_deviation < 0.01, "{off_axis}: {found:?}");
                assert!((found.mean_cd_m2 * 0.09 - 1.0).abs() < 0.01);
                let centre = mapping.pixel_from_direction(direction).unwrap();
                let on_screen = picture(mapping, |_, at| (at - centre).length().max(1.0).powi(-2));
                let wrong = roundness(&[HdrView::new(mapping, &on_screen).unwrap()], direction, 0.3).unwrap();
                assert_eq!(wrong.largest_deviation > 0.02, off_axis > 0.0, "{off_axis}: {wrong:?}");
            }
        }
    }

    #[test]
    fn circles_outside_the_picture_and_black_circles_are_refused() {
        let mapping = Perspective::symmetric([64, 64], 1.0).unwrap();
        let pixels = power_law(&mapping, DVec3::NEG_Z, -2);
        let view = HdrView::new(&mapping, &pixels).unwrap();
        let found = |direction, angle| roundness(&[view], direction, angle);
        assert_eq!(found(DVec3::NEG_Z, 0.3).unwrap().share_inside, 1.0);
        let part = found(DVec3::new(0.5, 0.0, -1.0), 0.2).unwrap().share_inside;
        assert!((0.2..0.8).contains(&part), "{part}");
        assert!(matches!(found(DVec3::Z, 0.3), Err(MetricError::TooFew { .. })));
        assert!(found(DVec3::NEG_Z, 0.0).is_err() && found(DVec3::NEG_Z, f64::NAN).is_err());
        let black = vec![[0.0; 3]; 64 * 64];
        let black = HdrView::new(&mapping, &black).unwrap();
        assert_eq!(roundness(&[black], DVec3::NEG_Z, 0.3), Err(MetricError::NoLight("roundness")));
    }

    #[test]
    fn relative_errors_of_pairs_have_the_right_rms_and_maximum() {
        let found = relative_errors(&[(1.03, 1.0), (2.0, 2.0), (0.5, 0.52)]).unwrap();
        let low = 0.02 / 0.52;
        assert!((found.largest - low).abs() < 1e-12, "{found:?}");
        assert!((found.rms - ((0.03_f64.powi(2) + low * low) / 3.0).sqrt()).abs() < 1e-12);
        assert_eq!(relative_errors(&[(0.0, 1.0)]), Ok(RelativeErrors { rms: 1.0, largest: 1.0 }));
        for wrong in [(f64::NAN, 1.0), (1.0, f64::NAN), (1.0, 0.0), (-1.0, 1.0), (f64::INFINITY, 1.0)] {
            assert!(relative_errors(&[(1.0, 1.0), wrong]).is_err(), "{wrong:?}");
        }
        assert!(matches!(relative_errors(&[]), Err(MetricError::TooFew { .. })));
    }

    #[test]
    fn light_beyond_an_angle_matches_the_kernel() {
        let mapping = Equirectangular::new([256, 128]).unwrap();
        let kernel = InverseSquareKernel::new(0.01);
        let direction = DVec3::new(0.3, 0.4, -0.8).normalize();
        let flux = |fraction: f64| {
            let pixels = picture(&mapping, |at, _| fraction * kernel.per_sr(separation_rad(at, direction)));
            scattered_flux_lx(&[HdrView::new(&mapping, &pixels).unwrap()], direction, 0.5).unwrap()
        };
        let expected = 1.0 - kernel.share_within(0.5);
        assert!((flux(0.1) / (0.1 * expected) - 1.0).abs() < 2e-3, "{}", flux(0.1) / expected);
        assert!((flux(0.103) / (0.1 * expected) - 1.0).abs() > 0.02);
        assert_eq!(flux(0.0), 0.0);
    }
}
