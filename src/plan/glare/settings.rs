//! The `[glare]` settings: which method, which kernel, how much light.

use std::path::PathBuf;
use std::sync::Arc;

use serde::{Deserialize, Serialize};

use crate::photometry::glare::{
    Cie, EyeColour, Gaussians, GlareKernel, GlareKernelError, GlareKernelName, InverseSquareKernel, Normalised,
    PsfTable,
};
use crate::plan::stars::method::{MethodSource, StarMethod};

/// How glare is computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize, Default)]
#[serde(rename_all = "snake_case")]
pub enum GlareMethod {
    /// The cheapest method that is right in every projection.
    #[default]
    Auto,
    /// No glare.
    None,
    /// On the sky: far from its source from a map that all views share, near it from the sources one by one.
    SkyCube,
    /// A pyramid of blurred images, horizontal and vertical on the screen.
    ScreenPyramid,
    /// A pyramid of blurred images, along axes of view space.
    ViewPyramid,
}

impl GlareMethod {
    /// Every method that draws glare.
    pub const ALL: [Self; 3] = [Self::SkyCube, Self::ScreenPyramid, Self::ViewPyramid];

    /// Name in configurations, manifests and charts.
    pub fn name(self) -> &'static str {
        match self {
            Self::Auto => "auto",
            Self::None => "none",
            Self::SkyCube => "sky_cube",
            Self::ScreenPyramid => "screen_pyramid",
            Self::ViewPyramid => "view_pyramid",
        }
    }

    /// Where the method comes from.
    pub fn source(self) -> MethodSource {
        match self {
            Self::Auto | Self::None | Self::SkyCube => MethodSource::Steradian,
            Self::ScreenPyramid | Self::ViewPyramid => MethodSource::SmallerThanPixels,
        }
    }
}

/// Weights of the levels of a pyramid.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize, Default)]
#[serde(rename_all = "snake_case")]
pub enum PyramidWeights {
    /// Each level half as much as the one before, as published: the inverse cube of the angle.
    Halved,
    /// All the same: the inverse square of the angle.
    #[default]
    Equal,
}

/// Glare settings.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct GlareSettings {
    /// The method.
    pub method: GlareMethod,
    /// The kernel. Pyramids have one of their own.
    pub kernel: GlareKernelName,
    /// Angle below which the kernel stays constant, degrees.
    pub inner_deg: f64,
    /// Share of the light that is scattered.
    pub fraction: f64,
    /// Age of the eye, years, for the kernel `cie`.
    pub age_years: f64,
    /// Colour of the eye, for the kernel `cie`.
    pub eye_colour: EyeColour,
    /// Whether the kernel itself tells what share is scattered, in place of `fraction`. Only `cie` does.
    pub absolute: bool,
    /// Table or picture of the kernel `psf`.
    pub psf_file: Option<PathBuf>,
    /// Weights of the levels of a pyramid.
    pub weights: PyramidWeights,
}

impl Default for GlareSettings {
    fn default() -> Self {
        Self {
            method: GlareMethod::Auto,
            kernel: GlareKernelName::InverseSquare,
            inner_deg: 0.1,
            fraction: 0.1,
            age_years: 35.0,
            eye_colour: EyeColour::default(),
            absolute: false,
            psf_file: None,
            weights: PyramidWeights::Equal,
        }
    }
}

impl GlareSettings {
    /// No glare.
    pub fn none() -> Self {
        Self { method: GlareMethod::None, ..Self::default() }
    }

    fn cie(&self) -> Cie {
        Cie::new(self.inner_deg.to_radians(), self.age_years, self.eye_colour)
    }

    /// The kernel, its integral over the sphere 1. That of `psf` is read from its file.
    ///
    /// # Errors
    /// [`GlareKernelError`] where the file of `psf` is missing or not usable; the other kernels have none for settings in
    /// their ranges.
    pub fn kernel(&self) -> Result<Arc<dyn GlareKernel>, GlareKernelError> {
        let inner_rad = self.inner_deg.to_radians();
        let no_integral = || GlareKernelError::NoIntegral(self.kernel);
        Ok(match self.kernel {
            GlareKernelName::InverseSquare => Arc::new(InverseSquareKernel::new(inner_rad)),
            GlareKernelName::Gaussians => Arc::new(Normalised::new(Gaussians::new(inner_rad)).ok_or_else(no_integral)?),
            GlareKernelName::Cie => Arc::new(Normalised::new(self.cie()).ok_or_else(no_integral)?),
            GlareKernelName::Psf => {
                let file = self.psf_file.as_ref().ok_or(GlareKernelError::NoFile)?;
                Arc::new(PsfTable::read(file)?.kernel(inner_rad)?)
            }
        })
    }

    /// Share of the light that is scattered: `fraction`, or what the kernel itself tells.
    pub fn fraction_scattered(&self) -> f64 {
        if self.is_absolute() { self.cie().scattered_share() } else { self.fraction }
    }

    /// Whether the kernel itself tells what share is scattered.
    fn is_absolute(&self) -> bool {
        self.absolute && self.kernel == GlareKernelName::Cie
    }

    /// The method that draws a frame whose stars are drawn by `stars`. `sky_cube` reads the catalogue; where no star of it is
    /// drawn the image alone tells what glares.
    pub fn chosen(&self, stars: StarMethod) -> GlareMethod {
        match self.method {
            // An eye that tells its own share scatters some.
            _ if self.fraction == 0.0 && !self.is_absolute() => GlareMethod::None,
            GlareMethod::Auto if stars.draws_catalogue() => GlareMethod::SkyCube,
            GlareMethod::Auto => GlareMethod::ViewPyramid,
            method => method,
        }
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;

    #[test]
    fn every_name_is_a_kernel_of_its_own() {
        let folder = tempfile::tempdir().unwrap();
        let psf_file = folder.path().join("eye.csv");
        std::fs::write(&psf_file, "theta_deg,per_sr\n0.1,3\n90,1e-3\n").unwrap();
        let settings = |kernel| GlareSettings { kernel, psf_file: Some(psf_file.clone()), ..GlareSettings::default() };
        let names =
            [GlareKernelName::InverseSquare, GlareKernelName::Gaussians, GlareKernelName::Cie, GlareKernelName::Psf];
        let kernels = names.map(|name| settings(name).kernel().unwrap());
        for (i, kernel) in kernels.iter().enumerate() {
            assert!((kernel.share_within(PI) - 1.0).abs() < 1e-12, "{:?}", names[i]);
            for other in &kernels[..i] {
                assert!((kernel.per_sr(1.0) / other.per_sr(1.0) - 1.0).abs() > 0.01, "{:?}", names[i]);
            }
        }
        let missing = GlareSettings { psf_file: None, ..settings(GlareKernelName::Psf) };
        assert!(matches!(missing.kernel(), Err(GlareKernelError::NoFile)));
    }

    #[test]
    fn what_is_scattered_is_the_fraction_or_what_the_eye_scatters() {
        let relative = GlareSettings { kernel: GlareKernelName::Cie, fraction: 0.25, ..GlareSettings::default() };
        assert_eq!(relative.fraction_scattered(), 0.25);
        let absolute = GlareSettings { absolute: true, ..relative };
        // 28 per cent between 0.1 and 100 degrees, and what the formula adds below and beyond.
        let share = absolute.fraction_scattered();
        assert!((share - 0.39).abs() < 2e-3, "{share}");
        let old = GlareSettings { age_years: 80.0, ..absolute.clone() };
        assert!(old.fraction_scattered() > 1.2 * share);
        let light = GlareSettings { eye_colour: EyeColour::Light, ..absolute.clone() };
        assert!(light.fraction_scattered() > share);
        // Nothing scattered needs no method, whatever the unused fraction says.
        assert_eq!(GlareSettings { fraction: 0.0, ..absolute.clone() }.fraction_scattered(), share);
    }
}
