//! Flux: the light that reaches the eye from an image, compared with the light that the stars send. For every star, view and method the sum over
//! pixels of luminance times solid angle must equal the star's illuminance. This is the first criterion for every method.

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::{
    HdrView,
    error::{MetricError, not_negative, positive},
    image::lit_near_direction,
};

/// Returns the illuminance of a whole image: the sum of luminance times solid angle, lx. Black gives 0.
///
/// # Errors
/// [`MetricError::OutsidePicture`] if a pixel outside of the picture has light.
pub fn illuminance_lx(image: &HdrView<'_>) -> Result<f64, MetricError> {
    let [width, height] = image.size();
    // Rows are summed separately and then in order, so that the result does not depend on the number of cores.
    let rows: Vec<f64> = (0..height)
        .into_par_iter()
        .map(|y| (0..width).map(|x| image.illuminance_lx(x, y)).sum())
        .collect::<Result<_, _>>()?;
    Ok(rows.iter().sum())
}

/// Returns the illuminance of all images of one view (the faces of a cubemap), lx.
///
/// # Errors
/// Same as [`illuminance_lx`].
pub fn total_illuminance_lx(images: &[HdrView<'_>]) -> Result<f64, MetricError> {
    images.iter().map(illuminance_lx).sum()
}

/// Returns the illuminance of all images of one view divided by `expected_lx`, minus 1: -0.01 if one per cent is lost.
///
/// # Errors
/// [`MetricError::NotPositive`] if the expected value is not positive, else as [`illuminance_lx`].
pub fn relative_flux_error(images: &[HdrView<'_>], expected_lx: f64) -> Result<f64, MetricError> {
    Ok(total_illuminance_lx(images)? / positive("expected illuminance", expected_lx)? - 1.0)
}

/// Returns the illuminance from the pixels whose centres lie within `radius_px` of `centre`, lx.
///
/// # Errors
/// Same as [`illuminance_lx`].
pub fn illuminance_near_pixel_lx(image: &HdrView<'_>, centre: DVec2, radius_px: f64) -> Result<f64, MetricError> {
    Ok(image.lit_near_pixel(centre, radius_px)?.iter().map(|(_, light)| light).sum())
}

/// Returns the illuminance from the pixels of several images whose centres lie within `radius_rad` of `direction`, lx.
///
/// # Errors
/// Same as [`illuminance_lx`].
pub fn illuminance_near_direction_lx(
    images: &[HdrView<'_>],
    direction: DVec3,
    radius_rad: f64,
) -> Result<f64, MetricError> {
    Ok(lit_near_direction(images, direction, radius_rad)?.iter().map(|(_, light)| light).sum())
}

/// Returns the single factor that brings the illuminances of a method with relative brightness closest to the expected ones: it minimises the sum of
/// squared relative errors. With q the ratio measured / expected, it is sum(q) / sum(q^2).
///
/// # Errors
/// [`MetricError::TooFew`] without pairs, [`MetricError::NotPositive`] if an expectation is not positive or a measurement is
/// negative, [`MetricError::NoLight`] if nothing was measured at all.
pub fn fitted_scale(measured_and_expected_lx: &[(f64, f64)]) -> Result<f64, MetricError> {
    if measured_and_expected_lx.is_empty() {
        return Err(MetricError::TooFew { what: "pairs for a scale", found: 0, least: 1 });
    }
    let (mut sum, mut sum_of_squares) = (0.0, 0.0);
    for (measured, expected) in measured_and_expected_lx {
        let ratio = not_negative("measured illuminance", *measured)? / positive("expected illuminance", *expected)?;
        sum += ratio;
        sum_of_squares += ratio * ratio;
    }
    if sum_of_squares > 0.0 { Ok(sum / sum_of_squares) } else { Err(MetricError::NoLight("a scale")) }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;
    use crate::{
        metrics::synthetic::Canvas,
        photometry::kernel::SplatKernel,
        view::projection::{CubeFace, Equirectangular, Face, Fisheye, FisheyeMapping, Perspective, PlaneMapping},
    };

    fn bspline(centre: DVec2) -> Vec<(i64, i64, f64)> {
        SplatKernel::BSpline.footprint(centre)
    }

    #[test]
    fn a_sphere_of_luminance_one_over_pi_has_four_lux() {
        let mapping = Equirectangular::new([256, 128]).unwrap();
        let pixels = vec![[1.0 / PI; 3]; 256 * 128];
        let found = illuminance_lx(&HdrView::new(&mapping, &pixels).unwrap()).unwrap();
        assert!((found - 4.0).abs() < 1e-12, "{found}");
        let face = CubeFace::new(Face::Front, 32).unwrap();
        let pixels = vec![[1.0_f32 / 3.0, 1.0 / 3.0, 1.0 / 3.0, 0.0]; 32 * 32];
        let image = HdrView::new(&face, &pixels).unwrap();
        assert!((total_illuminance_lx(&[image; 6]).unwrap() - 4.0 * PI / 3.0).abs() < 1e-6);
    }

    #[test]
    fn a_star_one_per_cent_too_bright_is_found_in_every_projection() {
        let mappings: [&dyn PlaneMapping; 3] = [
            &Perspective::symmetric([64, 48], 2.0).unwrap(),
            &Fisheye::new([64, 64], FisheyeMapping::Orthographic, PI).unwrap(),
            &Equirectangular::new([64, 32]).unwrap(),
        ];
        let direction = DVec3::new(0.5, -0.4, -1.0);
        for mapping in mappings {
            for (factor, error) in [(1.0, 0.0), (1.01, 0.01), (0.99, -0.01)] {
                let canvas = Canvas::new(mapping).star(direction, 2e-6 * factor, &bspline);
                let found = relative_flux_error(&[canvas.view()], 2e-6).unwrap();
                assert!((found - error).abs() < 1e-12, "{found} instead of {error}");
                let near = illuminance_near_direction_lx(&[canvas.view()], direction, 0.5).unwrap();
                assert!((near / 2e-6 - factor).abs() < 1e-12);
                let pixel = mapping.pixel_from_direction(direction).unwrap();
                assert!((illuminance_near_pixel_lx(&canvas.view(), pixel, 3.0).unwrap() / 2e-6 - factor).abs() < 1e-12);
                assert_eq!(illuminance_near_direction_lx(&[canvas.view()], -direction, 0.5), Ok(0.0));
            }
        }
    }

    #[test]
    fn an_invalid_expected_illuminance_is_an_error() {
        let mapping = Perspective::symmetric([8, 8], 1.0).unwrap();
        let black = Canvas::new(&mapping);
        assert_eq!(relative_flux_error(&[black.view()], 1e-6), Ok(-1.0));
        for wrong in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(relative_flux_error(&[black.view()], wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn a_fitted_scale_removes_only_a_common_factor() {
        let expected = [3e-6, 2e-8, 5e-11];
        let half: Vec<_> = expected.iter().map(|lx| (lx / 2.0, *lx)).collect();
        assert!((fitted_scale(&half).unwrap() - 2.0).abs() < 1e-15);
        // If one of two stars is lost, the scale of the other is unchanged. Ratios 1 and 0.5 give 1.5 / 1.25.
        assert!((fitted_scale(&[(1.0, 1.0), (0.0, 1.0)]).unwrap() - 1.0).abs() < 1e-15);
        assert!((fitted_scale(&[(1.0, 1.0), (0.5, 1.0)]).unwrap() - 1.2).abs() < 1e-15);
        assert!(fitted_scale(&[]).is_err() && fitted_scale(&[(0.0, 1.0)]).is_err());
        assert!(fitted_scale(&[(1.0, 0.0)]).is_err() && fitted_scale(&[(-1.0, 1.0)]).is_err());
    }
}
