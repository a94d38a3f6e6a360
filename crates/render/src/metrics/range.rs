//! Dynamic range: whether a faint source next to a bright one keeps its light. A format or accumulator with too few
//! digits loses it.

use glam::DVec2;

use super::{
    HdrView,
    error::{MetricError, positive},
    flux::illuminance_near_pixel_lx,
};

/// Expected point source.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointSource {
    /// Position in continuous pixel coordinates.
    pub pixel: DVec2,
    /// Illuminance at the eye, lx.
    pub illuminance_lx: f64,
}

/// Relative errors of two sources in one image: -0.01 if one per cent is lost, -1 for a missing source.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FaintBesideBright {
    /// Relative error of the bright source.
    pub bright_error: f64,
    /// Relative error of the faint source.
    pub faint_error: f64,
    /// Expected illuminance of the bright source divided by that of the faint one.
    pub ratio: f64,
}

/// Measures two sources in windows of `radius_px`. The windows must not overlap, and each must contain the whole kernel
/// and no other light; glare of the bright source would count as light of the faint one.
///
/// # Errors
/// [`MetricError::Overlap`] if the sources are closer than two radii, [`MetricError::NotPositive`] if an expected illuminance
/// or the radius is not a positive number, [`MetricError::OutsidePicture`] if a pixel outside of the picture has light.
pub fn faint_beside_bright(
    image: &HdrView<'_>,
    bright: PointSource,
    faint: PointSource,
    radius_px: f64,
) -> Result<FaintBesideBright, MetricError> {
    positive("window's radius", radius_px)?;
    let distance_px = (bright.pixel - faint.pixel).length();
    if distance_px.is_nan() || distance_px <= 2.0 * radius_px {
        return Err(MetricError::Overlap { distance_px, radius_px });
    }
    let error = |what: &'static str, source: PointSource| -> Result<f64, MetricError> {
        let expected_lx = positive(what, source.illuminance_lx)?;
        Ok(illuminance_near_pixel_lx(image, source.pixel, radius_px)? / expected_lx - 1.0)
    };
    Ok(FaintBesideBright {
        bright_error: error("illuminance of the bright source", bright)?,
        faint_error: error("illuminance of the faint source", faint)?,
        ratio: bright.illuminance_lx / faint.illuminance_lx,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        metrics::synthetic::Canvas,
        photometry::kernel::SplatKernel,
        units::illuminance_lx_from_magnitude,
        view::projection::{Perspective, PlaneMapping},
    };

    const RADIUS_PX: f64 = 2.5;

    /// Returns Sirius (-1.46) and a star of magnitude 21, six pixels apart.
    fn pair() -> [PointSource; 2] {
        [(10.3, -1.46), (16.4, 21.0)].map(|(x, magnitude)| PointSource {
            pixel: DVec2::new(x, 12.8),
            illuminance_lx: illuminance_lx_from_magnitude(magnitude),
        })
    }

    fn draw<'a>(mapping: &'a dyn PlaneMapping, sources: [PointSource; 2]) -> Canvas<'a> {
        sources.into_iter().fold(Canvas::new(mapping), |canvas, source| {
            let direction = mapping.direction_from_pixel(source.pixel).unwrap();
            canvas.star(direction, source.illuminance_lx, &|centre| SplatKernel::BSpline.footprint(centre))
        })
    }

    #[test]
    fn a_faint_star_that_lost_light_is_found() {
        let mapping = Perspective::symmetric([32, 24], 0.5).unwrap();
        let [bright, faint] = pair();
        let right = draw(&mapping, [bright, faint]);
        let found = faint_beside_bright(&right.view(), bright, faint, RADIUS_PX).unwrap();
        assert!(found.bright_error.abs() < 1e-12 && found.faint_error.abs() < 1e-12, "{found:?}");
        assert!((found.ratio.log10() - 0.4 * 22.46).abs() < 1e-12);

        let dimmed = PointSource { illuminance_lx: 0.97 * faint.illuminance_lx, ..faint };
        let found = faint_beside_bright(&draw(&mapping, [bright, dimmed]).view(), bright, faint, RADIUS_PX).unwrap();
        assert!((found.faint_error + 0.03).abs() < 1e-12 && found.bright_error.abs() < 1e-12, "{found:?}");
    }

    #[test]
    fn sixteen_bits_of_the_bright_star_lose_the_faint_one() {
        let mapping = Perspective::symmetric([32, 24], 0.5).unwrap();
        let [bright, faint] = pair();
        let mut canvas = draw(&mapping, [bright, faint]);
        let most = canvas.pixels.iter().flatten().fold(0.0_f64, |a, b| a.max(*b));
        for channel in canvas.pixels.iter_mut().flatten() {
            *channel = (*channel / most * 65_535.0).round() / 65_535.0 * most;
        }
        let found = faint_beside_bright(&canvas.view(), bright, faint, RADIUS_PX).unwrap();
        assert!(found.bright_error.abs() < 1e-3, "{found:?}");
        assert_eq!(found.faint_error, -1.0);
    }

    #[test]
    fn windows_that_overlap_and_missing_expectations_are_refused() {
        let mapping = Perspective::symmetric([32, 24], 0.5).unwrap();
        let [bright, faint] = pair();
        let canvas = draw(&mapping, [bright, faint]);
        let measure = |faint, radius| faint_beside_bright(&canvas.view(), bright, faint, radius);
        assert!(matches!(measure(faint, 3.1), Err(MetricError::Overlap { .. })));
        assert!(measure(PointSource { illuminance_lx: 0.0, ..faint }, RADIUS_PX).is_err());
        assert!(measure(faint, 0.0).is_err());
    }
}
