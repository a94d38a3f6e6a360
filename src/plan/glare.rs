//! The `[glare]` settings: which method, which kernel, how much light.

use serde::{Deserialize, Serialize};

use super::star_method::{MethodSource, StarMethod};
use crate::photometry::glare::GlareKernelName;

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
            weights: PyramidWeights::Equal,
        }
    }
}

impl GlareSettings {
    /// No glare.
    pub fn none() -> Self {
        Self { method: GlareMethod::None, ..Self::default() }
    }

    /// The method that draws a frame whose stars are drawn by `stars`. `sky_cube` reads the catalogue; where no star of it is
    /// drawn the image alone tells what glares.
    pub fn chosen(&self, _stars: StarMethod) -> GlareMethod {
        match self.method {
            _ if self.fraction == 0.0 => GlareMethod::None,
            GlareMethod::Auto => GlareMethod::None,
            method => method,
        }
    }
}
