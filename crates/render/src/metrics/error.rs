//! Why a metric has no value.

/// Reasons why a metric has no value.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MetricError {
    /// The number of pixels differs from that of the mapping's picture.
    #[error("{pixels} pixels do not fill a picture of {width} x {height}")]
    PixelCount {
        /// Number of pixels passed in.
        pixels: usize,
        /// Width of the mapping.
        width: u32,
        /// Height of the mapping.
        height: u32,
    },
    /// A pixel is not light: a channel is NaN or infinite, or the luminance is negative.
    #[error("pixel ({x}, {y}) is not light: a channel is not finite or the luminance is negative")]
    NotLight {
        /// Column.
        x: u32,
        /// Row.
        y: u32,
    },
    /// A pixel outside of the picture, which has no solid angle, is lit.
    #[error("pixel ({x}, {y}) is lit but lies outside of the picture")]
    OutsidePicture {
        /// Column.
        x: u32,
        /// Row.
        y: u32,
    },
    /// The measured area contains no light.
    #[error("no light where {0} is measured")]
    NoLight(&'static str),
    /// The two compared images differ in size.
    #[error("images of {}x{} and {}x{} pixels cannot be compared", .0[0], .0[1], .1[0], .1[1])]
    Sizes([u32; 2], [u32; 2]),
    /// There are too few values, images or positions.
    #[error("{what}: {found} given, at least {least} needed")]
    TooFew {
        /// The kind of values.
        what: &'static str,
        /// How many were passed in.
        found: usize,
        /// How many are needed.
        least: usize,
    },
    /// A number is not positive and finite (a measured amount of light may also be 0).
    #[error("{what} = {value}: must be positive and finite")]
    NotPositive {
        /// Name of the number.
        what: &'static str,
        /// Its value.
        value: f64,
    },
    /// Two sources are too close to be separated.
    #[error("sources {distance_px} px apart cannot be separated with windows of {radius_px} px")]
    Overlap {
        /// Distance of the sources, px.
        distance_px: f64,
        /// Radius of each window, px.
        radius_px: f64,
    },
}

/// Returns `value` if it is positive and finite.
pub(super) fn positive(what: &'static str, value: f64) -> Result<f64, MetricError> {
    if value > 0.0 && value.is_finite() { Ok(value) } else { Err(MetricError::NotPositive { what, value }) }
}

/// Returns `value` if it is finite and not negative.
pub(super) fn not_negative(what: &'static str, value: f64) -> Result<f64, MetricError> {
    if value >= 0.0 && value.is_finite() { Ok(value) } else { Err(MetricError::NotPositive { what, value }) }
}
