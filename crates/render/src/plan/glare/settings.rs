//! The `[glare]` settings: method, kernel, and scattered fraction.

use std::path::PathBuf;
use std::sync::Arc;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::photometry::glare::{
    Cie, EyeColour, Gaussians, GlareKernel, GlareKernelError, GlareKernelName, InverseSquareKernel, Normalised,
    PsfTable,
};
use crate::plan::stars::method::{MethodSource, StarMethod};
use crate::ranges::{KeyEffects, Obstacle};

/// How glare is computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize, Default, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum GlareMethod {
    /// `sky_cube`; `view_pyramid` where no catalogue stars are drawn (`cell_sky`).
    #[default]
    Auto,
    /// No glare.
    None,
    /// Convolution on the sphere: a low-resolution map shared by all views, and sprites near the sources.
    SkyCube,
    /// The published method: a pyramid of images that are blurred along the axes of the screen.
    ScreenPyramid,
    /// The published method: a pyramid of images that are blurred along axes of view space.
    ViewPyramid,
}

named!(GlareMethod {
    Auto = "auto",
    None = "none",
    SkyCube = "sky_cube",
    ScreenPyramid = "screen_pyramid",
    ViewPyramid = "view_pyramid",
});

impl GlareMethod {
    /// Every method that draws glare.
    pub const DRAWING: [Self; 3] = [Self::SkyCube, Self::ScreenPyramid, Self::ViewPyramid];

    /// Publication of the method.
    pub fn source(self) -> MethodSource {
        match self {
            Self::Auto | Self::None | Self::SkyCube => MethodSource::Steradian,
            Self::ScreenPyramid | Self::ViewPyramid => MethodSource::SmallerThanPixels,
        }
    }
}

/// Weights of the levels of a pyramid.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize, Default, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum PyramidWeights {
    /// Each level has half the weight of the previous one, as published. The glare falls off as theta^-3.
    Halved,
    /// All levels have equal weights. The glare falls off as theta^-2.
    #[default]
    Equal,
}

settings! {
    /// Glare: light scattered in the eye or the lens, as a veil around bright sources.
    pub struct GlareSettings, GlareKeys {
        /// Glare method, see [glare-methods.md](glare-methods.md).
        pub method: GlareMethod = GlareMethod::Auto,
        /// Kernel of `sky_cube`; the pyramids have fixed kernels.
        pub kernel: GlareKernelName = GlareKernelName::InverseSquare,
        /// Angle below which the kernel is constant. For `gaussians`, their minimum width.
        #[schemars(range(max = 180.0), extend("exclusiveMinimum" = 0.0, "x-unit" = "degrees"))]
        pub inner_deg: f64 = 0.1,
        /// Fraction of the light that is scattered.
        #[schemars(range(min = 0.0, max = 1.0), extend("x-unit" = "of the light"))]
        pub fraction: f64 = 0.1,
        /// `cie`: age of the observer.
        #[schemars(range(min = 0.0, max = 120.0), extend("x-unit" = "years"))]
        pub age_years: f64 = 35.0,
        /// `cie`: colour of the iris.
        pub eye_colour: EyeColour = EyeColour::default(),
        /// `cie`: whether the formula determines the scattered fraction (0.39 at 35 years) instead of `fraction`. The result must be at most 1.
        pub absolute: bool = false,
        /// Weights of the levels of the pyramids; with `auto` they apply to `cell_sky`.
        pub weights: PyramidWeights = PyramidWeights::Equal,
    }
    optional {
        /// `psf`: CSV file with the columns theta_deg,per_sr, or an EXR or FITS image. Required for this kernel.
        pub psf_file: PathBuf,
    }
}

impl KeyEffects for GlareSettings {
    type Keys = GlareKeys;

    fn with_keys(&self, keys: &GlareKeys) -> Self {
        self.with(keys)
    }

    /// `psf_file` is never reported as a key without effect: only a configuration can set it, possibly for views whose kernel becomes `psf` later.
    fn obstacle(&self, key: &str) -> Option<Obstacle> {
        let method = || format!("method = \"{}\"", self.method.name());
        let (present, needed) = match key {
            "method" | "psf_file" => return None,
            _ if self.method == GlareMethod::None => (method(), "method = \"auto\""),
            "age_years" | "eye_colour" | "absolute" if self.kernel != GlareKernelName::Cie => {
                (format!("kernel = \"{}\"", self.kernel.name()), "kernel = \"cie\"")
            }
            "fraction" if self.is_absolute() => ("absolute = true".to_owned(), "absolute = false"),
            "weights" if self.method == GlareMethod::SkyCube => (method(), "method = \"view_pyramid\""),
            _ => return None,
        };
        Some(Obstacle { present, needed })
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

    /// The kernel, normalised to an integral of 1 over the sphere. That of `psf` is read from its file.
    ///
    /// # Errors
    /// [`GlareKernelError`] if the file of `psf` is missing or invalid; the other kernels have no errors for settings in
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

    /// Fraction of the light that is scattered: `fraction`, or that of the kernel itself.
    pub fn fraction_scattered(&self) -> f64 {
        if self.is_absolute() { self.cie().scattered_share() } else { self.fraction }
    }

    /// Whether the kernel itself determines the scattered fraction.
    pub fn is_absolute(&self) -> bool {
        self.absolute && self.kernel == GlareKernelName::Cie
    }

    /// The method of a frame with the given star method. `sky_cube` reads the catalogue. If none of the catalogue's stars is drawn, glare can only be
    /// computed from the image.
    pub fn chosen(&self, stars: StarMethod) -> GlareMethod {
        match self.method {
            // A kernel that determines its own fraction scatters light even if `fraction` is 0.
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

    use serde_json::json;

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
        // The formula scatters 28 per cent of the light between 0.1 and 100 degrees; the remaining scattered light is outside this range.
        let share = absolute.fraction_scattered();
        assert!((share - 0.39).abs() < 2e-3, "{share}");
        let old = GlareSettings { age_years: 80.0, ..absolute.clone() };
        assert!(old.fraction_scattered() > 1.2 * share);
        let light = GlareSettings { eye_colour: EyeColour::Light, ..absolute.clone() };
        assert!(light.fraction_scattered() > share);
        // The unused fraction has no effect.
        assert_eq!(GlareSettings { fraction: 0.0, ..absolute.clone() }.fraction_scattered(), share);
    }

    #[test]
    fn keys_without_effect_name_the_value_that_they_need() {
        let general = GlareSettings::default();
        for (keys, expected) in [
            (json!({ "kernel": "cie", "age_years": 60.0, "eye_colour": "light", "absolute": true }), ""),
            (json!({ "method": "view_pyramid", "weights": "equal", "fraction": 0.2, "kernel": "gaussians" }), ""),
            (json!({ "weights": "halved", "inner_deg": 0.2, "psf_file": "eye.csv" }), ""),
            (
                json!({ "age_years": 60.0 }),
                "age_years: has no effect with kernel = \"inverse_square\": leave it out, or set kernel = \"cie\"",
            ),
            (json!({ "absolute": false }), "absolute: has no effect with kernel = \"inverse_square\""),
            (
                json!({ "kernel": "cie", "absolute": true, "fraction": 0.2 }),
                "fraction: has no effect with absolute = true",
            ),
            (
                json!({ "method": "none", "fraction": 0.2 }),
                "fraction: has no effect with method = \"none\": leave it out",
            ),
            (json!({ "method": "none", "kernel": "psf" }), "kernel: has no effect with method = \"none\""),
            (json!({ "method": "sky_cube", "weights": "equal" }), "weights: has no effect with method = \"sky_cube\""),
        ] {
            let keys: GlareKeys = serde_json::from_value(keys).unwrap();
            let problem = general.check_effects(&keys).err().map(|error| error.to_string()).unwrap_or_default();
            assert!(problem.starts_with(expected) && problem.is_empty() == expected.is_empty(), "{keys:?}: {problem}");
        }
    }
}
