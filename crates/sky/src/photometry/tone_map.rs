//! Tone mapping in f64: from luminance in cd/m^2 to encoded display values from 0 to 1, which are the bytes of an
//! 8-bit image divided by 255.
//!
//! Four operators depend on the exposure: their input is linear Rec. 709 divided by the luminance of display white
//! (`exposure`); 1 is white and larger values are brighter than the display. The fifth, `calibrated`, uses the
//! luminance range of the display and displays each luminance unchanged, independent of the exposure. [`curves`] has
//! the curves, their sources and a table. Two optional steps surround them. Before them comes the eye's response to dim
//! light ([`scotopic`]); after them comes the preservation of hue for light outside the display's range ([`hue`]).
//!
//! A channel that is NaN or negative is displayed as black, an infinite one as the brightest value.

pub mod curves;
pub mod hue;
pub mod scotopic;

use std::sync::OnceLock;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use self::curves::{aces, filmic, reinhard_scale};
use super::exposure::{WHITE_LUMINANCE_AT_EV0_CD_M2, white_luminance_cd_m2};
pub use super::rec709::luminance;
use crate::ranges::{KeyEffects, Obstacle};

/// Brighter light is clamped to this value, both in cd/m^2 and in units of display white. Sums of three such values
/// stay finite even in f32.
pub const BRIGHTEST: f64 = 1e30;

/// Display value of linear `value`: the sRGB transfer curve (IEC 61966-2-1). Not clipped; NaN gives NaN.
pub fn srgb_from_linear(value: f64) -> f64 {
    if value <= 0.003_130_8 { 12.92 * value } else { 1.055 * value.powf(1.0 / 2.4) - 0.055 }
}

/// Linear value of display `value`: the inverse of [`srgb_from_linear`], with the standard's own threshold.
pub fn linear_from_srgb(value: f64) -> f64 {
    if value <= 0.040_45 { value / 12.92 } else { ((value + 0.055) / 1.055).powf(2.4) }
}

/// Light of each 8-bit code of a display image, 0 to 1.
pub fn light_of_codes() -> &'static [f32; 256] {
    static TABLE: OnceLock<[f32; 256]> = OnceLock::new();
    TABLE.get_or_init(|| std::array::from_fn(|code| linear_from_srgb(code as f64 / 255.0) as f32))
}

/// A tone-mapping operator: the conversion of light to a display value.
#[derive(Clone, Copy, Debug, Default, Eq, Hash, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ToneMapOperator {
    /// Duiker's film curve, per channel.
    #[default]
    Filmic,
    /// Linear, clipped at display white, sRGB transfer function.
    Srgb,
    /// Reinhard's extended operator on luminance; keeps the ratios of the channels.
    Reinhard,
    /// Narkowicz's fit of the ACES film curve, per channel.
    Aces,
    /// Absolute: displays each luminance unchanged on a display of known peak and black, independent of the exposure.
    Calibrated,
}

named!(ToneMapOperator {
    Filmic = "filmic",
    Srgb = "srgb",
    Reinhard = "reinhard",
    Aces = "aces",
    Calibrated = "calibrated",
});

/// Largest luminance of a calibrated display, cd/m^2.
const MOST_PEAK_CD_M2: f64 = 1e6;

settings! {
    /// Conversion of luminance to display values.
    #[derive(Copy)]
    pub struct ToneMapSettings, ToneMapKeys {
        /// Tone-mapping operator.
        pub operator: ToneMapOperator = ToneMapOperator::Filmic,
        /// `reinhard`: smallest luminance, relative to display white, that is mapped to the display's maximum.
        #[schemars(range(min = 1.0, max = 1e6), extend("x-unit" = "times display white"))]
        pub white: f64 = 16.0,
        /// `calibrated`: luminance of the display's white.
        #[schemars(range(max = MOST_PEAK_CD_M2), extend("exclusiveMinimum" = 0.0, "x-unit" = "cd/m^2"))]
        pub peak_cd_m2: f64 = 100.0,
        /// `calibrated`: luminance of the display's black, at most half of `peak_cd_m2`.
        // The contrast of a display is at least 2.
        #[schemars(range(min = 0.0, max = MOST_PEAK_CD_M2 / 2.0), extend("x-unit" = "cd/m^2"))]
        pub black_cd_m2: f64 = 0.0,
        /// Preservation of hue beyond the display's gamut: 0 clips or compresses each channel, 1 desaturates towards white at
        /// constant hue.
        #[schemars(range(min = 0.0, max = 1.0))]
        pub desaturation: f64 = 1.0,
        /// Strength of the shift to scotopic (rod) vision below 5 cd/m^2: less saturation, Purkinje shift to blue.
        #[schemars(range(min = 0.0, max = 1.0))]
        pub scotopic: f64 = 0.0,
        /// Whether rounding to 8 bits is dithered, with an ordered pattern.
        pub dither: bool = true,
    }
    optional {}
}

impl KeyEffects for ToneMapSettings {
    type Keys = ToneMapKeys;

    fn with_keys(&self, keys: &ToneMapKeys) -> Self {
        self.with(keys)
    }

    fn obstacle(&self, key: &str) -> Option<Obstacle> {
        let (operator, needed) = match key {
            "white" => (ToneMapOperator::Reinhard, "operator = \"reinhard\""),
            "peak_cd_m2" | "black_cd_m2" => (ToneMapOperator::Calibrated, "operator = \"calibrated\""),
            _ => return None,
        };
        let present = || format!("operator = \"{}\"", self.operator.name());
        (self.operator != operator).then(|| Obstacle { present: present(), needed })
    }
}

impl ToneMapSettings {
    /// Returns the default settings with this operator.
    pub fn of(operator: ToneMapOperator) -> Self {
        Self { operator, ..Self::default() }
    }

    /// For an operator that does not depend on the exposure, the exposure value whose display white is the operator's
    /// white.
    pub fn white_ev100(&self) -> Option<f64> {
        (self.operator == ToneMapOperator::Calibrated).then(|| (self.peak_cd_m2 / WHITE_LUMINANCE_AT_EV0_CD_M2).log2())
    }

    /// Encoded display RGB, each from 0 to 1, for linear Rec. 709 in cd/m^2 if `white_cd_m2` is display white. Every
    /// operator maps black to black.
    pub fn display_rgb(&self, rgb_cd_m2: [f64; 3], white_cd_m2: f64) -> [f64; 3] {
        let mut light = rgb_cd_m2.map(shown_light);
        if self.scotopic > 0.0 {
            light = scotopic::shifted(light, self.scotopic);
        }
        let value = match self.operator {
            // The display adds its black to everything: a linear value v is seen as black + (peak - black) v.
            ToneMapOperator::Calibrated => {
                light.map(|channel| (channel - self.black_cd_m2).max(0.0) / (self.peak_cd_m2 - self.black_cd_m2))
            }
            _ => light.map(|channel| (channel / white_cd_m2).min(BRIGHTEST)),
        };
        let by_channel = match self.operator {
            ToneMapOperator::Filmic => value.map(filmic),
            ToneMapOperator::Srgb | ToneMapOperator::Calibrated => value.map(encoded),
            ToneMapOperator::Reinhard => {
                let scale = reinhard_scale(luminance(value), self.white);
                value.map(|channel| encoded(scale * channel))
            }
            ToneMapOperator::Aces => value.map(|channel| encoded(aces(channel))),
        };
        if self.desaturation <= 0.0 {
            return by_channel;
        }
        let linear = by_channel.map(linear_from_srgb);
        // A curve that acts on each channel defines the luminance only by its result.
        let wanted = match self.operator {
            ToneMapOperator::Filmic | ToneMapOperator::Aces => luminance(linear),
            ToneMapOperator::Srgb | ToneMapOperator::Calibrated => luminance(value),
            ToneMapOperator::Reinhard => luminance(value) * reinhard_scale(luminance(value), self.white),
        };
        let kept = hue::at_luminance(value, wanted.min(1.0));
        std::array::from_fn(|c| encoded(linear[c] + self.desaturation * (kept[c] - linear[c])))
    }

    /// Largest slope of the display value of grey relative to its luminance in units of white, above a quarter of a
    /// code.
    pub fn greatest_slope(&self) -> f64 {
        const STEPS_PER_OCTAVE: f64 = 16.0;
        const OCTAVES: f64 = 20.0;
        // The white of `calibrated` is its peak, independent of the exposure.
        let white = self.white_ev100().map_or(1.0, |_| self.peak_cd_m2);
        let ratio = STEPS_PER_OCTAVE.recip().exp2();
        let display_value = |value: f64| self.display_rgb([value * white; 3], white)[0];
        let values = (0..=(OCTAVES * STEPS_PER_OCTAVE) as u32).map(|step| (-f64::from(step) / STEPS_PER_OCTAVE).exp2());
        values
            .filter(|value| display_value(value * ratio) > 0.25 / 255.0)
            .map(|value| (display_value(value * ratio) - display_value(value)) / (value * (ratio - 1.0)))
            .fold(0.0, f64::max)
    }

    /// White light, relative to display white, whose display value is `code` of 255 before rounding; for
    /// `calibrated`, display white is the display's peak. `scotopic` is not applied, because it does not change the
    /// luminance of white.
    pub fn light_of_code(&self, code: f64) -> f64 {
        let plain = Self { scotopic: 0.0, ..*self };
        let white_cd_m2 = white_luminance_cd_m2(self.white_ev100().unwrap_or(0.0));
        let display_code = |light: f64| 255.0 * plain.display_rgb([light * white_cd_m2; 3], white_cd_m2)[1];
        // Every operator increases with the light: bisect the logarithm of the light to f64 precision.
        let (mut dark, mut bright) = (-60.0_f64, 60.0_f64);
        for _ in 0..64 {
            let middle = 0.5 * (dark + bright);
            if display_code(middle.exp2()) < code {
                dark = middle;
            } else {
                bright = middle;
            }
        }
        bright.exp2()
    }

    /// Byte of a display value without dithering.
    pub fn byte(encoded: f64) -> u8 {
        (encoded * 255.0).round() as u8
    }
}

/// Dither value that `shaders/display/encode.wgsl` adds at a pixel before rounding down: from 0 to 1.
pub fn dither_threshold(x: u32, y: u32) -> f64 {
    let value = x.wrapping_add(y.wrapping_mul(65_536));
    // PCG in the output form of Jarzynski and Olano (2020).
    let state = value.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
    let word = ((state >> ((state >> 28) + 4)) ^ state).wrapping_mul(277_803_737);
    f64::from(((word >> 22) ^ word) >> 8) / 16_777_216.0
}

/// A channel clamped for display: not negative, not NaN.
fn shown_light(channel: f64) -> f64 {
    if channel > 0.0 { channel.min(BRIGHTEST) } else { 0.0 }
}

/// sRGB value of a linear one, clipped.
fn encoded(linear: f64) -> f64 {
    srgb_from_linear(linear.clamp(0.0, 1.0))
}

#[cfg(test)]
mod tests;
