//! A projector's response to codes: its gamma, and the look-up table that corrects its colours.

use super::lut::Lut;
use crate::photometry::tone_map::{linear_from_srgb, srgb_from_linear};

/// Maps linear light, in units of the projector's white, to the codes sent to the projector.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Response {
    /// Exponent from code to light; `None` for the sRGB curve.
    pub gamma: Option<f64>,
    /// Applied to the codes, last.
    pub lut: Option<Lut>,
}

impl Response {
    /// Codes, 0 to 1, for light from 0 to 1.
    pub fn codes(&self, light: [f64; 3]) -> [f64; 3] {
        let codes = light.map(|light| self.code(light.clamp(0.0, 1.0)));
        self.lut.as_ref().map_or(codes, |lut| lut.look_up(codes).map(|code| code.clamp(0.0, 1.0)))
    }

    /// The code of light before the look-up table.
    pub(super) fn code(&self, light: f64) -> f64 {
        self.gamma.map_or_else(|| srgb_from_linear(light), |gamma| light.powf(1.0 / gamma))
    }

    /// The light of a code before the look-up table.
    pub(super) fn light(&self, code: f64) -> f64 {
        self.gamma.map_or_else(|| linear_from_srgb(code), |gamma| code.powf(gamma))
    }
}

/// Converts light to 8-bit codes with a table.
#[derive(Clone, Debug)]
pub(super) struct EightBits {
    /// Least light that rounds to each code.
    least: [f32; 256],
    /// For each of 4096 levels of light, the code at which the search starts.
    first: Vec<u8>,
}

impl EightBits {
    /// Creates the table for the curve of a projector. The projector's look-up table is applied afterwards.
    pub(super) fn new(response: &Response) -> Self {
        let between = |code: usize| response.light((code as f64 - 0.5) / 255.0) as f32;
        let least: [f32; 256] = std::array::from_fn(|code| if code == 0 { f32::MIN } else { between(code) });
        let first =
            (0..4096).map(|at| (least.partition_point(|least| *least <= at as f32 / 4096.0) - 1) as u8).collect();
        Self { least, first }
    }

    pub(super) fn code(&self, light: f32) -> u8 {
        let index = ((light * 4096.0) as usize).min(4095);
        let mut code = self.first[index];
        while code < 255 && self.least[usize::from(code) + 1] <= light {
            code += 1;
        }
        code
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_code_round_trips() {
        for gamma in [None, Some(1.0), Some(2.2), Some(2.6)] {
            let response = Response { gamma, lut: None };
            let codes = EightBits::new(&response);
            for code in 0..=255_u8 {
                let light = response.light(f64::from(code) / 255.0);
                assert_eq!(codes.code(light as f32), code, "{gamma:?}");
                assert!((response.codes([light; 3])[1] * 255.0 - f64::from(code)).abs() < 1e-9);
            }
            assert_eq!((codes.code(-0.1), codes.code(7.0)), (0, 255));
        }
    }
}
