//! Star methods, by name: the project's own and those of published systems, as published.
//!
//! A method is a footprint (the pixels that a star reaches) times a profile (the distribution of its light over them) times an
//! accumulator (the sum of the light of many stars).

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Publication of a method, as named in `chart.csv`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum MethodSource {
    /// This project.
    Steradian,
    /// Schneegans, Kreskowski, Gerndt: "Smaller than Pixels: Rendering Millions of Stars in Real-Time".
    SmallerThanPixels,
    /// The proposal of a Gaussian point-spread function for Celestia.
    CelestiaStarPsf,
    /// "Rendering a Billion Stars?": a procedural sky on a distorted cube grid.
    BillionStarsCubemap,
    /// "Rendering star fields in 3D": textures of point-spread functions on billboards.
    StarFieldsPsf,
    /// Marques Dias: "High-Performance Asteroid Field Rendering".
    AsteroidFieldRendering,
}

named!(MethodSource {
    Steradian = "steradian",
    SmallerThanPixels = "smaller-than-pixels",
    CelestiaStarPsf = "celestia-star-psf",
    BillionStarsCubemap = "billion-stars-cubemap",
    StarFieldsPsf = "star-fields-psf-godot",
    AsteroidFieldRendering = "asteroid-field-rendering",
});

/// How the light of many stars in a pixel is summed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Accumulator {
    /// Atomic integer sums: independent of the order.
    FixedPoint,
    /// Luminance and temperature as two half floats in a 32-bit word, updated by compare and exchange.
    PackedCompareExchange,
    /// Additive blending of the graphics pipeline.
    Blending,
    /// No sum: every pixel is computed individually.
    PerPixel,
}

/// How stars are drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize, Default, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum StarMethod {
    /// For each star, the cheapest of tent, B-spline and bright kernel whose flicker stays below `accuracy.flicker`.
    #[default]
    Auto,
    /// 3 × 3 quadratic B-spline: constant width at every sub-pixel position.
    #[serde(rename = "bspline")]
    BSpline,
    /// 2 × 2 bilinear tent: cheaper, but its width depends on the sub-pixel position.
    Tent,
    /// Gaussian integrated over the pixels, its width in pixels or as an angle; circular on the sky.
    PixelGaussian,
    /// Published compute rasteriser: 2 × 2 splat, two half floats in a 32-bit word, every star in catalogue order.
    PackedCas,
    /// `packed_cas`, but with stars that are culled and sorted as for the project's own methods.
    PackedCasSorted,
    /// Published: points of one pixel.
    HardwarePoint,
    /// Published: points of one pixel with antialiased edges.
    HardwareSmoothPoint,
    /// Published: discs of constant solid angle that face the camera.
    Disc,
    /// Published: `disc` with a brightness that falls off to the edge.
    SmoothDisc,
    /// Published: discs whose size increases with the brightness of the star.
    ScaledDisc,
    /// Published: large billboards with built-in glare.
    GlareDisc,
    /// Published: textured billboards of constant solid angle that face the camera.
    Sprite,
    /// Published: Gaussian plus glare Gaussian, sampled at pixel centres, relative to a limiting magnitude.
    GaussianPsf,
    /// `gaussian_psf`, integrated over the pixels.
    GaussianPsfIntegrated,
    /// Published: squares parallel to the screen, of constant size in pixels.
    ScreenBillboard,
    /// Published: procedural sky, one star per cell of a distorted cube grid.
    CellSky,
    /// Published: point-spread function texture, cropped by brightness.
    PsfTexture,
}

named!(StarMethod {
    Auto = "auto",
    BSpline = "bspline",
    Tent = "tent",
    PixelGaussian = "pixel_gaussian",
    PackedCas = "packed_cas",
    PackedCasSorted = "packed_cas_sorted",
    HardwarePoint = "hardware_point",
    HardwareSmoothPoint = "hardware_smooth_point",
    Disc = "disc",
    SmoothDisc = "smooth_disc",
    ScaledDisc = "scaled_disc",
    GlareDisc = "glare_disc",
    Sprite = "sprite",
    GaussianPsf = "gaussian_psf",
    GaussianPsfIntegrated = "gaussian_psf_integrated",
    ScreenBillboard = "screen_billboard",
    CellSky = "cell_sky",
    PsfTexture = "psf_texture",
});

impl StarMethod {
    /// Whether its brightest kernel is a Gaussian that is round in view space.
    pub fn has_round_kernel(self) -> bool {
        self == Self::PixelGaussian
    }

    /// Publication of the method.
    pub fn source(self) -> MethodSource {
        match self {
            Self::Auto | Self::BSpline | Self::Tent | Self::PixelGaussian => MethodSource::Steradian,
            Self::PackedCas
            | Self::PackedCasSorted
            | Self::HardwarePoint
            | Self::HardwareSmoothPoint
            | Self::Disc
            | Self::SmoothDisc
            | Self::ScaledDisc
            | Self::GlareDisc
            | Self::Sprite => MethodSource::SmallerThanPixels,
            Self::GaussianPsf | Self::GaussianPsfIntegrated | Self::ScreenBillboard => MethodSource::CelestiaStarPsf,
            Self::CellSky => MethodSource::BillionStarsCubemap,
            Self::PsfTexture => MethodSource::StarFieldsPsf,
        }
    }

    /// The accumulator.
    pub fn accumulator(self) -> Accumulator {
        match self {
            Self::Auto | Self::BSpline | Self::Tent | Self::PixelGaussian => Accumulator::FixedPoint,
            Self::PackedCas | Self::PackedCasSorted => Accumulator::PackedCompareExchange,
            Self::CellSky => Accumulator::PerPixel,
            _ => Accumulator::Blending,
        }
    }

    /// Whether every star of the catalogue is read, in catalogue order and once per view, instead of the result of culling.
    pub fn reads_catalogue(self) -> bool {
        self == Self::PackedCas || self.accumulator() == Accumulator::Blending
    }

    /// Whether the result of culling is read.
    pub fn reads_visible(self) -> bool {
        self.draws_catalogue() && !self.reads_catalogue()
    }

    /// Whether the method was published for a flat image plane, and uses cube faces for other projections.
    pub fn needs_planes(self) -> bool {
        self.accumulator() == Accumulator::Blending
    }

    /// Whether brightness is relative to the display, so that scores are computed after fitting a scale.
    pub fn is_relative(self) -> bool {
        matches!(self, Self::GaussianPsf | Self::GaussianPsfIntegrated | Self::ScreenBillboard | Self::CellSky)
    }

    /// Whether the stars are those of the catalogue and not procedural.
    pub fn draws_catalogue(self) -> bool {
        self != Self::CellSky
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_unique_and_match_the_configuration() {
        for (index, method) in StarMethod::ALL.into_iter().enumerate() {
            assert_eq!(StarMethod::ALL.iter().position(|other| other.name() == method.name()), Some(index));
            assert_eq!(StarMethod::from_name(method.name()), Some(method));
            assert_eq!(serde_json::to_value(method).unwrap(), method.name());
        }
        assert_eq!(StarMethod::from_name("point"), None);
    }
}
