//! Shape: the width of a star's image and its deviation from a circle, both from the second moments of its light.
//!
//! In view space the offsets are angles on the sphere: direction and angular distance from the centroid, in the tangent
//! plane there (azimuthal equidistant). A star must be round *there*; on the image plane of a wide view a round star is
//! an ellipse. Every pixel counts as a point at its centre with the weight luminance times solid angle. The widths
//! therefore do not include the extent of the pixels themselves (a variance of 1/12 pixel along each axis), and a star
//! in a single pixel has zero width.

use glam::{DVec2, DVec3};

use super::{
    HdrView,
    centroid::mean_direction,
    error::MetricError,
    image::{lit_near_direction, separation_rad},
    moments::moments,
};

/// Size of a star's image along its longest and its shortest axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shape {
    /// Standard deviation along the longest axis, in the unit of the measurement: px or rad.
    pub major: f64,
    /// Standard deviation along the perpendicular axis.
    pub minor: f64,
}

impl Shape {
    /// Returns the root mean square distance of the light from its centroid.
    pub fn rms_radius(&self) -> f64 {
        self.major.hypot(self.minor)
    }

    /// 1 - minor / major: 0 for a round star, 1 for a line. `None` for a point.
    pub fn ellipticity(&self) -> Option<f64> {
        (self.major > 0.0).then(|| 1.0 - self.minor / self.major)
    }
}

/// Returns the shape of the light within `radius_px` of `expected` on the image plane, pixels.
///
/// # Errors
/// [`MetricError::NoLight`] if there is no light, [`MetricError::OutsidePicture`] if a pixel outside of the picture has light.
pub fn shape_px(image: &HdrView<'_>, expected: DVec2, radius_px: f64) -> Result<Shape, MetricError> {
    shape(&image.lit_near_pixel(expected, radius_px)?)
}

/// Returns the shape of the light within `radius_rad` of `expected` in view space, rad, over images that together show every direction at most once.
///
/// # Errors
/// Same as [`shape_px`].
pub fn shape_rad(images: &[HdrView<'_>], expected: DVec3, radius_rad: f64) -> Result<Shape, MetricError> {
    let lit = lit_near_direction(images, expected, radius_rad)?;
    let centre = mean_direction(&lit).ok_or(MetricError::NoLight("a shape"))?;
    let (right, up) = centre.any_orthonormal_pair();
    let offsets: Vec<(DVec2, f64)> = lit
        .iter()
        .map(|(direction, light)| {
            let across = DVec2::new(direction.dot(right), direction.dot(up));
            (across.normalize_or_zero() * separation_rad(*direction, centre), *light)
        })
        .collect();
    shape(&offsets)
}

fn shape(lit: &[(DVec2, f64)]) -> Result<Shape, MetricError> {
    let found = moments(lit).ok_or(MetricError::NoLight("a shape"))?;
    Ok(Shape { major: found.major, minor: found.minor })
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{FRAC_PI_4, PI};

    use super::*;
    use crate::{
        metrics::{
            sub_pixel_positions,
            synthetic::{Canvas, integrated_gaussian, one_pixel, sampled_gaussian},
        },
        photometry::kernel::SplatKernel,
        view::projection::{Equirectangular, Fisheye, FisheyeMapping, Footprint, Perspective, PlaneMapping},
    };

    #[test]
    fn a_star_stretched_by_a_fifth_is_found() {
        let mapping = Perspective::symmetric([64, 64], 0.01).unwrap();
        let pixel_rad = 2.0 * (0.005_f64).tan() / 64.0;
        let pixel = DVec2::new(31.2, 32.9);
        let direction = mapping.direction_from_pixel(pixel).unwrap();
        for (stretch, ellipticity) in [(1.0, 0.0), (1.2, 1.0 - 1.0 / 1.2)] {
            let kernel = sampled_gaussian(DVec2::new(3.0 * stretch, 3.0));
            let canvas = Canvas::new(&mapping).star(direction, 1.0, &kernel);
            let px = shape_px(&canvas.view(), pixel, 30.0).unwrap();
            let rad = shape_rad(&[canvas.view()], direction, 30.0 * pixel_rad).unwrap();
            for (found, unit) in [(px, 1.0), (rad, pixel_rad)] {
                assert!((found.major / unit - 3.0 * stretch).abs() < 3e-4, "{found:?}");
                assert!((found.minor / unit - 3.0).abs() < 3e-4, "{found:?}");
                assert!((found.ellipticity().unwrap() - ellipticity).abs() < 1e-4, "{found:?}");
                assert!((found.rms_radius() / unit - (3.0 * stretch).hypot(3.0)).abs() < 3e-4);
            }
        }
    }

    /// A kernel that is round on a flat image plane is an ellipse in the sky: at the angle a from the axis, a tangential step is cos a times a step
    /// at the centre, and a radial step is cos^2 a times. The ellipticity is therefore 1 - cos a.
    #[test]
    fn a_round_kernel_off_axis_is_an_ellipse_in_the_sky() {
        let mapping = Perspective::symmetric([2048, 2048], 1.9).unwrap();
        let pixel_rad = 2.0 * (0.95_f64).tan() / 2048.0;
        for angle in [0.0_f64, FRAC_PI_4 / 2.0, FRAC_PI_4] {
            let direction = DVec3::new(0.6 * angle.sin(), 0.8 * angle.sin(), -angle.cos());
            let kernel = sampled_gaussian(DVec2::splat(3.0));
            let canvas = Canvas::new(&mapping).star(direction, 1.0, &kernel);
            let found = shape_rad(&[canvas.view()], direction, 0.05).unwrap();
            let ellipticity = found.ellipticity().unwrap();
            assert!((ellipticity - (1.0 - angle.cos())).abs() < 1e-3, "{angle}: {ellipticity}");
            assert!((found.major / (3.0 * pixel_rad) - angle.cos()).abs() < 1e-3, "{angle}: {found:?}");
            let pixel = mapping.pixel_from_direction(direction).unwrap();
            assert!(shape_px(&canvas.view(), pixel, 20.0).unwrap().ellipticity().unwrap() < 1e-4);
        }
    }

    #[test]
    fn conformal_pictures_keep_a_round_star_round_and_poles_do_not_matter() {
        let mapping = Fisheye::new([1024, 1024], FisheyeMapping::Stereographic, PI).unwrap();
        let direction = DVec3::new(0.7, 0.3, -0.5).normalize();
        let kernel = sampled_gaussian(DVec2::splat(3.0));
        let canvas = Canvas::new(&mapping).star(direction, 1.0, &kernel);
        assert!(shape_rad(&[canvas.view()], direction, 0.1).unwrap().ellipticity().unwrap() < 3e-3);

        // A ring of light around the pole of an equirectangular picture is round in the sky and a line in the picture.
        let mapping = Equirectangular::new([128, 64]).unwrap();
        let mut canvas = Canvas::new(&mapping);
        canvas.pixels[..128].fill([1.0; 3]);
        let found = shape_rad(&[canvas.view()], DVec3::Y, 0.2).unwrap();
        assert!(found.ellipticity().unwrap() < 1e-9);
        assert!((found.rms_radius() / (PI / 128.0) - 1.0).abs() < 1e-9, "{found:?}");
    }

    /// These are means over sub-pixel positions. The variance of the tent along an axis is f (1 - f), with f the position between two pixels. Let g
    /// be the position along the other axis; then the mean of 1 - sqrt(smaller variance / larger variance) over f and g is 0.266 (Monte Carlo). The
    /// variance of the B-spline is constant; the design's table of kernels gives 0.003 for a Gaussian of 0.7 px over 5 x 5 pixels.
    #[test]
    fn kernels_have_their_ellipticities() {
        let mapping = Perspective::symmetric([16, 16], 0.01).unwrap();
        let mean = |kernel: Footprint<'_>| {
            let ellipticity = |position: DVec2| {
                let pixel = DVec2::splat(8.0) + position;
                let canvas = Canvas::new(&mapping).star(mapping.direction_from_pixel(pixel).unwrap(), 1.0, kernel);
                shape_px(&canvas.view(), pixel, 7.0).unwrap().ellipticity()
            };
            // A tent centred on a pixel is a point.
            let ellipticities: Vec<f64> = sub_pixel_positions(3000).filter_map(ellipticity).collect();
            assert!(ellipticities.len() >= 2999);
            ellipticities.iter().sum::<f64>() / ellipticities.len() as f64
        };
        let tent = mean(&|centre| SplatKernel::Tent.footprint(centre));
        let bspline = mean(&|centre| SplatKernel::BSpline.footprint(centre));
        let gaussian = mean(&integrated_gaussian(0.7, 5));
        println!("mean ellipticity of tent, B-spline, Gaussian 0.7 px: {tent:.4} {bspline:.4} {gaussian:.4}");
        assert!((tent - 0.266).abs() < 0.003 && bspline < 1e-6 && (gaussian - 0.003).abs() < 0.001);
    }

    #[test]
    fn a_point_has_no_ellipticity_and_black_no_shape() {
        let mapping = Perspective::symmetric([16, 16], 0.3).unwrap();
        let direction = mapping.direction_from_pixel(DVec2::new(7.3, 9.1)).unwrap();
        let canvas = Canvas::new(&mapping).star(direction, 0.3, &one_pixel);
        let found = shape_rad(&[canvas.view()], direction, 0.1).unwrap();
        assert_eq!((found.rms_radius(), found.ellipticity()), (0.0, None));
        assert!(shape_px(&canvas.view(), DVec2::splat(2.0), 3.0).is_err());
    }
}
