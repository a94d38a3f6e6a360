//! Input of a check: a renderer and settings, with the helpers that all checks share.

use glam::DVec3;

use super::objects::Fault;
use crate::{
    gpu::GpuError,
    metrics::{self, HdrView, MetricError},
    photometry::glare::GlareKernelError,
    plan::{
        GaussianWidth,
        settings::{ExposureSettings, GlareSettings, RenderSettings, StarMethod, StarSettings},
    },
    reference::stars::{gaussian, point_spread::PointSpreadError},
    render::{Frame, FrameImage, FrameRequest, RenderError, Renderer, Wanted},
    scene::SceneSnapshot,
    view::{
        Rig, RigError, ViewImage,
        projection::{PlaneMapping, ProjectionError},
    },
};

/// Reason why a check has no figures.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CheckError {
    /// A frame could not be rendered.
    #[error(transparent)]
    Render(#[from] RenderError),
    /// A metric has no value.
    #[error(transparent)]
    Metric(#[from] MetricError),
    /// A view cannot be built.
    #[error(transparent)]
    Rig(#[from] RigError),
    /// A projection cannot be built.
    #[error(transparent)]
    Projection(#[from] ProjectionError),
    /// A point-spread function cannot be built.
    #[error(transparent)]
    PointSpread(#[from] PointSpreadError),
    /// The glare kernel cannot be built or read.
    #[error("glare: {0}")]
    Glare(#[from] GlareKernelError),
    /// The device failed.
    #[error(transparent)]
    Gpu(#[from] GpuError),
    /// The renderer did not return a requested output.
    #[error("the frame lacks {0}")]
    Missing(&'static str),
}

/// Input of a check; see the documentation of the module.
pub struct Context<'a> {
    /// The renderer.
    pub renderer: &'a mut Renderer,
    /// Settings of frames. Glare takes light from stars, so it is off unless a glare check turns it on. Stars of every magnitude are drawn unless a
    /// check sets a limit.
    pub settings: RenderSettings,
    /// The glare under test.
    pub glare: GlareSettings,
    /// Glare that defines the expected falloff: equal to `glare`, unless a test changes it to make a check fail.
    pub expected_glare: GlareSettings,
    /// Difference between the true and the drawn bodies and asteroids. There is none unless a test sets one to make a
    /// check fail.
    pub object_fault: Fault,
}

impl<'a> Context<'a> {
    /// Returns a context for one check of the methods in the settings.
    pub fn new(renderer: &'a mut Renderer, settings: &RenderSettings) -> Self {
        let glare = settings.glare.clone();
        let mut settings = RenderSettings { glare: GlareSettings::none(), ..settings.clone() };
        // A magnitude limit is meant for the scene of the configuration, but checks use their own stars.
        settings.stars.magnitude_limit = StarSettings::default().magnitude_limit;
        Self { renderer, settings, expected_glare: glare.clone(), glare, object_fault: Fault::NONE }
    }

    /// The star method under test.
    pub fn method(&self) -> StarMethod {
        self.settings.stars.method
    }

    /// Share of a star's light that falls inside of a picture. It is 1 for a star whose kernel does not reach the border. The exception is the method
    /// whose kernel is round in the sky: in wide flat views, this kernel extends outwards over hundreds of pixels.
    pub fn share_inside(&self, mapping: &dyn PlaneMapping, direction: DVec3) -> f64 {
        if self.method() != StarMethod::PixelGaussian {
            return 1.0;
        }
        let width = GaussianWidth::new(&self.settings.stars.pixel_gaussian);
        gaussian::taps(mapping, width, direction).iter().map(|tap| tap.weight).sum()
    }

    /// Sets the exposure so that `white_cd_m2` is displayed as white.
    pub fn expose_for(&mut self, white_cd_m2: f64) {
        let at_0 = crate::photometry::exposure::white_luminance_cd_m2(0.0);
        self.settings.exposure = ExposureSettings::manual((white_cd_m2 / at_0).log2());
    }

    /// Renders the HDR images of all views.
    pub fn render(&mut self, scene: &SceneSnapshot, rig: &Rig) -> Result<Frame, CheckError> {
        Ok(self.renderer.render(FrameRequest::new(scene, rig).settings(&self.settings).wanted(Wanted::hdr()))?)
    }

    /// Measures the light of every view of a scene, lx.
    pub fn light_lx(&mut self, scene: &SceneSnapshot, rig: &Rig) -> Result<Vec<f64>, CheckError> {
        let frame = self.render(scene, rig)?;
        light_of_views_lx(&frame, rig)
    }

    /// Factor on measured light before it is compared. It is 1 or, for methods of relative brightness, the best fit to pairs of measured and expected
    /// light.
    pub fn scale(&self, pairs: &[(f64, f64)]) -> Result<f64, CheckError> {
        if self.method().is_relative() { Ok(metrics::fitted_scale(pairs)?) } else { Ok(1.0) }
    }

    /// Largest relative error of pairs of measured and expected light, after the measured light is scaled by [`Self::scale`].
    pub fn worst_flux_error(&self, pairs: &[(f64, f64)]) -> Result<f64, CheckError> {
        Ok(worst_error(self.scale(pairs)?, pairs))
    }
}

/// Largest relative error of pairs of measured and expected light, after the measured light is multiplied by `scale`.
pub fn worst_error(scale: f64, pairs: &[(f64, f64)]) -> f64 {
    worst(pairs.iter().map(|(measured, expected)| (scale * measured / expected - 1.0).abs()))
}

/// Largest of several numbers; NaN if one of them is NaN or there are none.
pub fn worst(values: impl IntoIterator<Item = f64>) -> f64 {
    values.into_iter().reduce(|a, b| if a.is_nan() || b.is_nan() { f64::NAN } else { a.max(b) }).unwrap_or(f64::NAN)
}

/// Returns pairs of an image of a frame and the corresponding image of the rig.
pub fn images<'a>(frame: &'a Frame, rig: &'a Rig) -> impl Iterator<Item = (&'a FrameImage, &'a ViewImage)> {
    frame.images.iter().zip(rig.views().iter().flat_map(|view| &view.images))
}

/// Returns the pixels of an image: R, G, B in cd/m^2 and the solid angle in sr.
pub fn hdr_pixels(image: &FrameImage) -> Result<&[[f32; 4]], CheckError> {
    image.hdr.as_deref().ok_or(CheckError::Missing("an HDR image"))
}

/// Returns an image as the metrics need it. Solid angles are computed in f64, not by the shader.
pub fn hdr_view<'a>(image: &'a FrameImage, mapping: &'a dyn PlaneMapping) -> Result<HdrView<'a>, CheckError> {
    Ok(HdrView::new(mapping, hdr_pixels(image)?)?)
}

/// Measures the light of every view of a frame over all of its images, lx.
pub fn light_of_views_lx(frame: &Frame, rig: &Rig) -> Result<Vec<f64>, CheckError> {
    let mut light = vec![0.0; rig.views().len()];
    for (image, of_view) in images(frame, rig) {
        light[image.view] += metrics::illuminance_lx(&hdr_view(image, of_view.projection.mapping())?)?;
    }
    Ok(light)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn worst_pair_counts_and_no_pairs_fail() {
        assert!((worst_error(1.0, &[(2.0, 2.0), (0.98, 1.0), (1.01, 1.0)]) - 0.02).abs() < 1e-12);
        assert_eq!(worst_error(2.0, &[(1.0, 2.0)]), 0.0);
        assert!(worst_error(1.0, &[]).is_nan() && worst_error(1.0, &[(f64::NAN, 1.0), (1.0, 1.0)]).is_nan());
        assert!(worst([1.0, f64::NAN, 2.0]).is_nan());
    }
}
