//! The 16-byte star that the renderer reads: an offset from the chunk's origin and one word for the light.
//!
//! From the highest bit down, the word holds 7 bits of exponent and 14 of mantissa of the illuminance at 1 parsec
//! (relative error at most 3.1e-5), and 11 bits of temperature on a logarithmic scale from 500 to 100000 K (steps of
//! 0.26 %).

use std::ops::RangeInclusive;

use glam::Vec3;

/// Lowest temperature that the word can hold, kelvin.
pub const MIN_TEMPERATURE_K: f64 = 500.0;
/// Highest temperature that the word can hold, kelvin.
pub const MAX_TEMPERATURE_K: f64 = 100_000.0;
/// Number of octaves between the two temperatures: the base-2 logarithm of their ratio.
pub const TEMPERATURE_OCTAVES: f64 = 7.643_856_189_774_724;
/// Number of temperature steps.
pub const TEMPERATURE_STEPS: u32 = 2048;

/// The f32 exponent (biased by 127) that corresponds to exponent 0 of the word: 2^-78 lx, absolute magnitude 49.
pub const EXPONENT_BIAS: u32 = 49;

/// Illuminances at 1 pc that the word can hold, in lux: 2^-78 to just below 2^50.
pub const ILLUMINANCE_RANGE_LX: RangeInclusive<f64> = {
    let lowest = f32::from_bits(EXPONENT_BIAS << 23);
    let highest = f32::from_bits(((EXPONENT_BIAS + 127) << 23) | 0x007f_fe00);
    lowest as f64..=highest as f64
};

/// One star of a chunk.
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct PackedStar {
    /// Parsecs from the chunk's origin; in a chunk at infinity, the unit vector towards the star.
    pub offset_pc: [f32; 3],
    /// Illuminance at 1 pc and temperature.
    pub light: u32,
}

impl PackedStar {
    /// Packs a star. Illuminances at 1 pc outside [`ILLUMINANCE_RANGE_LX`] and temperatures outside their range are
    /// clamped.
    pub fn new(offset_pc: Vec3, illuminance_at_1_pc_lx: f64, temperature_k: f64) -> Self {
        // Both ends are exact in f32, so the conversion cannot round out of the range.
        let value = illuminance_at_1_pc_lx.clamp(*ILLUMINANCE_RANGE_LX.start(), *ILLUMINANCE_RANGE_LX.end()) as f32;
        // Round the mantissa to 14 bits; a carry into the exponent correctly rounds up to the next power of two.
        let rounded = (value.to_bits() - (EXPONENT_BIAS << 23)).saturating_add(1 << 8) >> 9;
        let brightness = rounded.min((1 << 21) - 1);
        let position = (temperature_k.clamp(MIN_TEMPERATURE_K, MAX_TEMPERATURE_K) / MIN_TEMPERATURE_K).ln()
            / (MAX_TEMPERATURE_K / MIN_TEMPERATURE_K).ln();
        let step = (position * f64::from(TEMPERATURE_STEPS - 1)).round() as u32;
        Self { offset_pc: offset_pc.to_array(), light: (brightness << 11) | step }
    }

    /// Illuminance of the star at 1 pc, lx; in a chunk at infinity, its illuminance at the observer.
    pub fn illuminance_at_1_pc_lx(&self) -> f64 {
        f64::from(f32::from_bits(((self.light >> 11) << 9) + (EXPONENT_BIAS << 23)))
    }

    /// Index into the table of colours.
    pub fn temperature_step(&self) -> u32 {
        self.light & (TEMPERATURE_STEPS - 1)
    }
}

/// Temperature of a step of the colour table, kelvin.
pub fn temperature_of_step_k(step: u32) -> f64 {
    MIN_TEMPERATURE_K * (MAX_TEMPERATURE_K / MIN_TEMPERATURE_K).powf(f64::from(step) / f64::from(TEMPERATURE_STEPS - 1))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn light_survives_packing() {
        for exponent in -300..145 {
            let illuminance = 10f64.powf(f64::from(exponent) / 13.0);
            let star = PackedStar::new(Vec3::X, illuminance, 5772.0);
            let error = star.illuminance_at_1_pc_lx() / illuminance - 1.0;
            assert!(error.abs() <= 3.2e-5, "{illuminance}: {error}");
        }
        for temperature in [500.0, 1000.0, 5772.0, 9600.0, 40_000.0, 100_000.0] {
            let star = PackedStar::new(Vec3::X, 1.0, temperature);
            assert!((temperature_of_step_k(star.temperature_step()) / temperature - 1.0).abs() < 1.4e-3);
        }
    }

    #[test]
    fn rounding_up_to_a_power_of_two_carries_into_the_exponent() {
        let star = PackedStar::new(Vec3::X, 2.0 - 1e-6, 5772.0);
        assert_eq!(star.illuminance_at_1_pc_lx(), 2.0);
    }

    #[test]
    fn out_of_range_light_is_clamped() {
        assert!(PackedStar::new(Vec3::X, 1e30, 5772.0).illuminance_at_1_pc_lx() > 1e14);
        let faint = PackedStar::new(Vec3::X, 0.0, 5772.0).illuminance_at_1_pc_lx();
        assert!(faint > 0.0 && faint < 1e-20);
    }

    #[test]
    fn octaves_are_the_logarithm_of_the_temperature_ratio() {
        assert_eq!(TEMPERATURE_OCTAVES, (MAX_TEMPERATURE_K / MIN_TEMPERATURE_K).log2());
    }

    #[test]
    fn the_ends_of_the_range_are_exact() {
        let (lowest, highest) = (*ILLUMINANCE_RANGE_LX.start(), *ILLUMINANCE_RANGE_LX.end());
        assert_eq!(lowest, 2f64.powi(-78));
        assert!((0.999..1.0).contains(&(highest / 2f64.powi(50))), "{highest}");
        for end in [lowest, highest] {
            assert_eq!(PackedStar::new(Vec3::X, end, 5772.0).illuminance_at_1_pc_lx(), end);
        }
    }
}
