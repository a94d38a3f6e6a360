//! Code shared by the passes that compute display values: the variant of the tone mapping and its parameters.
//!
//! No shader: code shared by the passes that make display values: shaders/display/encode.wgsl.
//! No twin: photometry/tone_map.rs.

use crate::render::constants::display;
use crate::{
    plan::settings::{ToneMapOperator, ToneMapSettings},
    render::layout,
};

/// Tone-mapping options compiled into a pipeline, so that unused options cost nothing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct DisplayVariant {
    operator: ToneMapOperator,
    desaturates: bool,
    scotopic: bool,
    has_short_codes: bool,
}

impl DisplayVariant {
    pub(crate) fn from_settings(settings: &ToneMapSettings) -> Self {
        Self {
            operator: settings.operator,
            desaturates: settings.desaturation > 0.0,
            scotopic: settings.scotopic > 0.0,
            has_short_codes: false,
        }
    }

    /// The same tone mapping, with shorter approximations of codes: see `shaders/shared/srgb.wgsl`.
    pub(crate) fn with_short_codes(self, has_short_codes: bool) -> Self {
        Self { has_short_codes, ..self }
    }

    /// Returns the overridable constants of `shaders/display/encode.wgsl`.
    pub(crate) fn constants(self) -> [(&'static str, f64); 4] {
        let operator = match self.operator {
            ToneMapOperator::Filmic => display::OPERATOR_FILMIC,
            ToneMapOperator::Srgb => display::OPERATOR_SRGB,
            ToneMapOperator::Reinhard => display::OPERATOR_REINHARD,
            ToneMapOperator::Aces => display::OPERATOR_ACES,
            ToneMapOperator::Calibrated => display::OPERATOR_CALIBRATED,
        };
        let flag = |on: bool| f64::from(u8::from(on));
        [
            ("TONE_OPERATOR", f64::from(operator)),
            ("DESATURATES", flag(self.desaturates)),
            ("SCOTOPIC", flag(self.scotopic)),
            ("SHORT_CODES", flag(self.has_short_codes)),
        ]
    }
}

/// Encodes the parameters of the tone mapping.
pub(crate) fn encode_display(settings: &ToneMapSettings) -> layout::Display {
    layout::Display {
        white: settings.white as f32,
        peak_cd_m2: settings.peak_cd_m2 as f32,
        black_cd_m2: settings.black_cd_m2 as f32,
        desaturation: settings.desaturation as f32,
        scotopic: settings.scotopic as f32,
        dither: u32::from(settings.dither),
        ..Default::default()
    }
}
