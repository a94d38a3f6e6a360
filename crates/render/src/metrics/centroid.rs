//! Centroid: the centre of a star's light, compared with the star's expected position.
//!
//! Every pixel counts as a point at its centre with the weight luminance times solid angle. The window must contain all of the star's light and no
//! other light. Pixel coordinates do not continue beyond the edges of an image. Use directions if the window crosses the date line of an
//! equirectangular image or an edge of a cubemap.

use glam::{DVec2, DVec3};

use super::{
    HdrView,
    error::MetricError,
    image::{lit_near_direction, separation_rad},
    moments::moments,
};

/// Returns the centroid of the light within `radius_px` of `expected`, in continuous pixel coordinates.
///
/// # Errors
/// [`MetricError::NoLight`] if there is no light, [`MetricError::OutsidePicture`] if a pixel outside of the picture has light.
pub fn centroid_px(image: &HdrView<'_>, expected: DVec2, radius_px: f64) -> Result<DVec2, MetricError> {
    let lit = image.lit_near_pixel(expected, radius_px)?;
    Ok(moments(&lit).ok_or(MetricError::NoLight("a centroid"))?.mean)
}

/// Returns the distance between `expected` and the centroid of the light within `radius_px` of it, pixels.
///
/// # Errors
/// Same as [`centroid_px`].
pub fn centroid_error_px(image: &HdrView<'_>, expected: DVec2, radius_px: f64) -> Result<f64, MetricError> {
    Ok((centroid_px(image, expected, radius_px)? - expected).length())
}

/// Returns the unit direction of the centroid of the light within `radius_rad` of `expected`, over images that together show every direction at most
/// once.
///
/// # Errors
/// Same as [`centroid_px`].
pub fn centroid_direction(images: &[HdrView<'_>], expected: DVec3, radius_rad: f64) -> Result<DVec3, MetricError> {
    let lit = lit_near_direction(images, expected, radius_rad)?;
    mean_direction(&lit).ok_or(MetricError::NoLight("a centroid"))
}

/// Returns the angle between `expected` and the centroid of the light within `radius_rad` of it, rad.
///
/// # Errors
/// Same as [`centroid_px`].
pub fn centroid_error_rad(images: &[HdrView<'_>], expected: DVec3, radius_rad: f64) -> Result<f64, MetricError> {
    Ok(separation_rad(centroid_direction(images, expected, radius_rad)?, expected))
}

/// Returns the direction of the weighted sum of directions.
pub(super) fn mean_direction(lit: &[(DVec3, f64)]) -> Option<DVec3> {
    lit.iter().map(|(direction, light)| *direction * *light).sum::<DVec3>().try_normalize()
}

#[cfg(test)]
mod tests {
    use std::f64::consts::FRAC_1_SQRT_2;

    use super::*;
    use crate::{
        metrics::{
            sub_pixel_positions,
            synthetic::{Canvas, integrated_gaussian, one_pixel},
        },
        photometry::kernel::SplatKernel,
        view::projection::{CubeFace, Equirectangular, Face, Footprint, Perspective, PlaneMapping},
    };

    fn bspline(centre: DVec2) -> Vec<(i64, i64, f64)> {
        SplatKernel::BSpline.footprint(centre)
    }

    #[test]
    fn a_star_shifted_by_a_third_of_a_pixel_is_found() {
        let mapping = Perspective::symmetric([32, 32], 0.01).unwrap();
        let shift = DVec2::new(0.18, -0.24);
        let pixel_rad = 2.0 * (0.005_f64).tan() / 32.0;
        for position in sub_pixel_positions(50) {
            let pixel = DVec2::splat(15.0) + position;
            let direction = mapping.direction_from_pixel(pixel).unwrap();
            let right = Canvas::new(&mapping).star(direction, 1e-6, &bspline);
            assert!(centroid_error_px(&right.view(), pixel, 4.0).unwrap() < 1e-9);
            assert!(centroid_error_rad(&[right.view()], direction, 4.0 * pixel_rad).unwrap() < 1e-6 * pixel_rad);
            let wrong = Canvas::new(&mapping).star(direction, 1e-6, &|centre| bspline(centre + shift));
            let error_px = centroid_error_px(&wrong.view(), pixel, 4.0).unwrap();
            assert!((error_px - 0.3).abs() < 1e-9, "{error_px}");
            let error_rad = centroid_error_rad(&[wrong.view()], direction, 4.0 * pixel_rad).unwrap();
            assert!((error_rad / pixel_rad - 0.3).abs() < 1e-4, "{}", error_rad / pixel_rad);
        }
    }

    /// Root mean square of the centroid error over sub-pixel positions. The design's table of kernels gives 0.41 px for one pixel (exactly
    /// sqrt(1/6)), 0 for the tent and the B-spline, and 0.004 for a Gaussian of 0.7 px over 5 x 5 pixels.
    #[test]
    fn kernels_have_their_centroid_errors() {
        let mapping = Perspective::symmetric([16, 16], 0.01).unwrap();
        let rms = |kernel: Footprint<'_>| {
            let squares = sub_pixel_positions(3000).map(|position| {
                let pixel = DVec2::splat(8.0) + position;
                let canvas = Canvas::new(&mapping).star(mapping.direction_from_pixel(pixel).unwrap(), 1.0, kernel);
                centroid_error_px(&canvas.view(), pixel, 7.0).unwrap().powi(2)
            });
            (squares.sum::<f64>() / 3000.0).sqrt()
        };
        let tent = rms(&|centre| SplatKernel::Tent.footprint(centre));
        let found = [rms(&one_pixel), tent, rms(&bspline), rms(&integrated_gaussian(0.7, 5))];
        println!("rms centroid error of 1x1, tent, B-spline, Gaussian 0.7 px: {found:.4?} px");
        assert!((found[0] - (1.0 / 6.0_f64).sqrt()).abs() < 1e-3);
        assert!(found[1] < 1e-5 && found[2] < 1e-5);
        assert!((0.002..0.006).contains(&found[3]));
    }

    #[test]
    fn directions_continue_over_the_date_line_and_the_edge_of_a_cube() {
        let mapping = Equirectangular::new([720, 360]).unwrap();
        let direction = DVec3::new(0.0003, 0.1, 1.0).normalize();
        let canvas = Canvas::new(&mapping).star(direction, 1.0, &bspline);
        assert!(centroid_error_rad(&[canvas.view()], direction, 0.05).unwrap() < 1e-5);

        let faces = [Face::Front, Face::Right].map(|face| (face, CubeFace::new(face, 256).unwrap()));
        let direction = DVec3::new(FRAC_1_SQRT_2, 0.1, -FRAC_1_SQRT_2).normalize();
        let draw = |face: Face, mapping| {
            Canvas::new(mapping).star(face.cube_from_face().conjugate() * direction, 1.0, &bspline)
        };
        let canvases = [draw(faces[0].0, &faces[0].1), draw(faces[1].0, &faces[1].1)];
        let views = [0, 1].map(|i| canvases[i].view().turned(faces[i].0.cube_from_face()));
        let pixel_rad = 2.0 / 256.0 / 2.0;
        let whole = centroid_error_rad(&views, direction, 0.05).unwrap();
        // One face alone contains only half of the star, with its centroid half a pixel from the edge. The error of the
        // whole star comes from the curvature of the grid within a pixel.
        let half = centroid_error_rad(&views[..1], direction, 0.05).unwrap();
        assert!(whole < 0.1 * pixel_rad && half > 0.45 * pixel_rad, "{} {}", whole / pixel_rad, half / pixel_rad);
    }

    #[test]
    fn black_has_no_centroid() {
        let mapping = Perspective::symmetric([8, 8], 1.0).unwrap();
        let black = Canvas::new(&mapping);
        assert_eq!(centroid_px(&black.view(), DVec2::splat(4.0), 3.0).err(), Some(MetricError::NoLight("a centroid")));
        assert!(centroid_direction(&[black.view()], DVec3::NEG_Z, 3.0).is_err());
    }
}
