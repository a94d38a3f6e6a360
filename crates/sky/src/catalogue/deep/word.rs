//! A star of a leaf in 64 bits.
//!
//! | bits | content | decoded as |
//! |---|---|---|
//! | 47 to 63 | x in the cell | (code + 0.5) / 2^17 |
//! | 30 to 46 | y in the cell | (code + 0.5) / 2^17 |
//! | 19 to 29 | light | V = M + 10 code / 2047, M the layer's brightest magnitude |
//! | 11 to 18 | temperature | 1/T = 1/100000 K + code (1/2000 K - 1/100000 K) / 255 |
//! | 1 to 10 | distance | 0: at infinity; else 100 pc x 2000^((code - 1) / 1022) |
//! | 0 | spare | 0 |
//!
//! Largest errors: position 6.4 mas in cells of order 8 (2.6 mas rms); distance 0.38 %; colour 0.0005 in u'v' (stars below 2000 K get 2000 K); light
//! 0.23 % when rounded. The writer carries the remainder of the light to the next star ([`LightCarry`]): the error of a star is then up to 0.46 %,
//! and that of the sum over a leaf of 1,300 stars 2e-7. A word does not contain its cell, so that the same word at the same index of a leaf is always
//! the same star.

use std::sync::LazyLock;

use crate::{
    photometry::blackbody::rec709_in_gamut,
    units::{illuminance_lx_from_magnitude, magnitude_from_illuminance_lx},
};

/// Bits of each coordinate in the cell.
pub const PLACE_BITS: u32 = 17;
/// Range of a layer's light, from the brightest to the faintest, magnitudes.
pub const MAGNITUDES: f64 = 10.0;
/// Highest code of the light.
pub const LIGHT_STEPS: u32 = 2047;
/// Highest code of the temperature.
pub const TEMPERATURE_STEPS: u32 = 255;
/// Lowest and highest temperature, K.
pub const TEMPERATURES_K: [f64; 2] = [2000.0, 100_000.0];
/// Nearest and farthest finite distance, pc.
pub const DISTANCES_PC: [f64; 2] = [100.0, 200_000.0];
const DISTANCE_STEPS: u32 = 1022;

/// The fields of a word.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Word {
    /// Coordinates in the cell, in units of 2^-17.
    pub place: [u32; 2],
    /// Code of the light, 0 to 2047: 0 is the brightest.
    pub light: u32,
    /// Code of the temperature, 0 to 255: 0 is the hottest.
    pub temperature: u32,
    /// Code of the distance, 0 to 1023: 0 is infinity.
    pub distance: u32,
}

impl Word {
    /// The word as 64 bits.
    pub fn bits(self) -> u64 {
        let Self { place: [x, y], light, temperature, distance } = self;
        u64::from(x) << 47
            | u64::from(y) << 30
            | u64::from(light) << 19
            | u64::from(temperature) << 11
            | u64::from(distance) << 1
    }

    /// The fields of 64 bits.
    pub fn from_bits(bits: u64) -> Self {
        let field = |from: u32, width: u32| (bits >> from) as u32 & ((1 << width) - 1);
        Self {
            place: [field(47, 17), field(30, 17)],
            light: field(19, 11),
            temperature: field(11, 8),
            distance: field(1, 10),
        }
    }

    /// Coordinates in the cell, 0 to 1.
    pub fn inside(self) -> [f64; 2] {
        self.place.map(|code| (f64::from(code) + 0.5) / f64::from(1_u32 << PLACE_BITS))
    }
}

/// Fractional code of a temperature in kelvin. Temperatures outside [`TEMPERATURES_K`] get that of the nearest end.
fn temperature_position(temperature_k: f64) -> f64 {
    let [cool, hot] = TEMPERATURES_K.map(f64::recip);
    let position = (temperature_k.recip() - hot) / (cool - hot);
    position.clamp(0.0, 1.0) * f64::from(TEMPERATURE_STEPS)
}

/// Code of a temperature in kelvin. Temperatures outside [`TEMPERATURES_K`] get that of the nearest end.
pub fn temperature_code(temperature_k: f64) -> u32 {
    temperature_position(temperature_k).round() as u32
}

/// Temperature of a code, K.
pub fn temperature_k(code: u32) -> f64 {
    let [cool, hot] = TEMPERATURES_K.map(f64::recip);
    (hot + (cool - hot) * f64::from(code) / f64::from(TEMPERATURE_STEPS)).recip()
}

/// Linear Rec. 709 RGB of each temperature code, in gamut, with luminance 1.
pub fn colours() -> &'static [[f64; 3]; 256] {
    static COLOURS: LazyLock<[[f64; 3]; 256]> =
        LazyLock::new(|| std::array::from_fn(|code| rec709_in_gamut(temperature_k(code as u32))));
    &COLOURS
}

/// Code of a distance in parsecs. `None` and distances beyond the farthest one mean infinity; distances below the nearest one get its code.
pub fn distance_code(distance_pc: Option<f64>) -> u32 {
    let [near, far] = DISTANCES_PC;
    // Distances up to half a step beyond the farthest code still round to it.
    match distance_pc.map(|distance| (distance / near).ln() / (far / near).ln()) {
        Some(position) if position < 1.0 + 0.5 / f64::from(DISTANCE_STEPS) => {
            1 + (position.clamp(0.0, 1.0) * f64::from(DISTANCE_STEPS)).round() as u32
        }
        _ => 0,
    }
}

/// Distance of a code, pc; `None` for infinity.
pub fn distance_pc(code: u32) -> Option<f64> {
    static TABLE: LazyLock<Vec<f64>> = LazyLock::new(|| {
        let [near, far] = DISTANCES_PC;
        (0..=DISTANCE_STEPS).map(|step| near * (far / near).powf(f64::from(step) / f64::from(DISTANCE_STEPS))).collect()
    });
    TABLE.get(code.checked_sub(1)? as usize).copied()
}

/// Conversion between illuminances and light codes of a layer.
#[derive(Clone, Debug)]
pub struct LightScale {
    magnitude: f64,
    /// Illuminance of each code, lx.
    table: Vec<f64>,
}

impl LightScale {
    /// Creates the scale of the layer whose brightest stars have this V magnitude.
    pub fn new(magnitude: u8) -> Self {
        let magnitude = f64::from(magnitude);
        let of_code =
            |code| illuminance_lx_from_magnitude(magnitude + MAGNITUDES * f64::from(code) / f64::from(LIGHT_STEPS));
        Self { magnitude, table: (0..=LIGHT_STEPS).map(of_code).collect() }
    }

    /// Nearest code of an illuminance in lx. Illuminances outside the scale get the code of the nearest end.
    pub fn code(&self, illuminance_lx: f64) -> u32 {
        let steps =
            (magnitude_from_illuminance_lx(illuminance_lx) - self.magnitude) * f64::from(LIGHT_STEPS) / MAGNITUDES;
        // A negative illuminance would give NaN, which converts to code 0, the brightest one: return the faintest code instead.
        if illuminance_lx > 0.0 { steps.round().clamp(0.0, f64::from(LIGHT_STEPS)) as u32 } else { LIGHT_STEPS }
    }

    /// Illuminance of a code (at most 2047), lx.
    pub fn illuminance_lx(&self, code: u32) -> f64 {
        self.table[code as usize]
    }
}

/// Carries the remainder of rounding the light from star to star.
#[derive(Clone, Copy, Debug, Default)]
pub struct LightCarry {
    rest_lx: f64,
}

/// Largest remainder that a star takes over from the previous stars, as a share of its own light: half a step, so that a faint star after a bright
/// one keeps its light.
const MOST_TAKEN: f64 = 0.00225;

impl LightCarry {
    /// Returns the code of a star's light plus the remainder of the previous stars.
    pub fn code(&mut self, scale: &LightScale, illuminance_lx: f64) -> u32 {
        let most = MOST_TAKEN * illuminance_lx;
        let taken = self.rest_lx.clamp(-most, most);
        let code = scale.code(illuminance_lx + taken);
        self.rest_lx += illuminance_lx - scale.illuminance_lx(code);
        code
    }
}

/// Carries the remainder of rounding temperatures from star to star, so that the colour of their sum is kept. The carried value is blue minus red
/// light, because [`LightCarry`] keeps the luminance.
#[derive(Clone, Copy, Debug, Default)]
pub struct ColourCarry {
    rest_lx: f64,
}

/// Blue minus red light at a fractional code, for luminance 1; interpolated by the cubic through four codes.
fn blueness(position: f64) -> f64 {
    let at = |code: i64| {
        let [red, _, blue] = colours()[code.clamp(0, i64::from(TEMPERATURE_STEPS)) as usize];
        blue - red
    };
    let first = position.floor() as i64;
    let t = position - first as f64;
    let [a, b, c, d] = [-1, 0, 1, 2].map(|step| at(first + step));
    b + 0.5 * t * (c - a + t * (2.0 * a - 5.0 * b + 4.0 * c - d + t * (3.0 * (b - c) + d - a)))
}

impl ColourCarry {
    /// Returns the code of a temperature in kelvin for a star of `illuminance_lx`. Chooses between the next lower and the next higher code: the one
    /// that leaves the smaller remainder.
    pub fn code(&mut self, temperature_k: f64, illuminance_lx: f64) -> u32 {
        let position = temperature_position(temperature_k);
        let exact = blueness(position);
        let rest = |code: f64| self.rest_lx + illuminance_lx * (exact - blueness(code));
        let [below, above] = [position.floor(), position.ceil()];
        let code = if rest(above).abs() < rest(below).abs() { above } else { below };
        self.rest_lx = rest(code);
        code as u32
    }
}

#[cfg(test)]
mod tests {
    use super::super::cells::{CellFrame, SkyPlace, tests::directions};
    use super::*;
    use crate::{photometry::blackbody::rec709_at_unit_luminance, photometry::rec709::uv_prime, units::ARCSECOND_RAD};

    #[test]
    fn all_fields_survive_the_bits() {
        let word = Word { place: [0x1_2345, 0x1_fffe], light: 2047, temperature: 200, distance: 1023 };
        assert_eq!(Word::from_bits(word.bits()), word);
        let other = Word { place: [0, 1], light: 1, temperature: 1, distance: 0 };
        assert_eq!(Word::from_bits(other.bits()), other);
        assert_eq!(word.bits() & 1, 0);
    }

    #[test]
    fn places_are_within_6_4_mas_at_order_8() {
        let all = directions(50_000);
        let (mut worst, mut squares) = (0.0_f64, 0.0);
        for &direction in &all {
            let place = SkyPlace::from_direction(direction);
            let word = Word { place: place.in_cell(8, PLACE_BITS), light: 0, temperature: 0, distance: 0 };
            let error = CellFrame::new(8, place.cell(8)).direction(word.inside()) - direction;
            let error_mas = error.length() / ARCSECOND_RAD * 1e3;
            worst = worst.max(error_mas);
            squares += error_mas * error_mas;
        }
        let rms = (squares / all.len() as f64).sqrt();
        assert!((5.0..6.5).contains(&worst) && (2.3..2.8).contains(&rms), "{worst} mas, {rms} mas rms");
    }

    #[test]
    fn colours_are_within_0_0005_and_distances_within_0_4_per_cent() {
        let [cool, hot] = TEMPERATURES_K;
        let (mut colour, mut distance): (f64, f64) = (0.0, 0.0);
        for step in 0..=5000 {
            let part = f64::from(step) / 5000.0;
            let t = cool * (hot / cool).powf(part);
            let [exact, found] = [t, temperature_k(temperature_code(t))].map(|t| uv_prime(rec709_at_unit_luminance(t)));
            colour = colour.max((exact[0] - found[0]).hypot(exact[1] - found[1]));
            let d = DISTANCES_PC[0] * (DISTANCES_PC[1] / DISTANCES_PC[0]).powf(part);
            let found = distance_pc(distance_code(Some(d))).expect("a finite distance");
            distance = distance.max((found / d - 1.0).abs());
        }
        assert!((3e-4..5.0e-4).contains(&colour), "{colour}");
        assert!((3e-3..4e-3).contains(&distance), "{distance}");
        assert_eq!(distance_code(None), 0);
        assert_eq!(distance_code(Some(1e9)), 0);
        assert_eq!(distance_pc(0), None);
        assert_eq!(distance_code(Some(3.0)), 1);
    }

    #[test]
    fn the_colour_of_a_sum_is_kept_and_no_star_is_off_by_more_than_a_step() {
        let (mut carry, mut exact, mut found, mut rounded) = (ColourCarry::default(), [0.0; 3], [0.0; 3], [0.0; 3]);
        for i in 0..5000_u32 {
            let temperature = 3000.0 + f64::from(i * 7919 % 5003);
            let lx = illuminance_lx_from_magnitude(13.0 + 7.0 * f64::from(i) / 5000.0);
            let code = carry.code(temperature, lx);
            assert!((f64::from(code) - temperature_position(temperature)).abs() < 1.0);
            let of_codes = [code, temperature_code(temperature)].map(|code| colours()[code as usize]);
            let colours = [rec709_in_gamut(temperature), of_codes[0], of_codes[1]];
            for (sum, colour) in [&mut exact, &mut found, &mut rounded].into_iter().zip(colours) {
                (0..3).for_each(|channel| sum[channel] += lx * colour[channel]);
            }
        }
        let worst = |sum: [f64; 3]| (0..3).map(|i| (sum[i] / exact[i] - 1.0).abs()).fold(0.0, f64::max);
        assert!(worst(found) < 5e-5 && worst(rounded) > 2.5 * worst(found), "{:e} {:e}", worst(found), worst(rounded));
        // Each end of the scale has one code.
        assert_eq!([1.0, 1e9].map(|t| ColourCarry::default().code(t, 1.0)), [1.0, 1e9].map(temperature_code));
    }

    #[test]
    fn light_is_within_0_23_per_cent_a_star_and_2e_7_a_leaf_of_1300() {
        let scale = LightScale::new(17);
        // The number of stars of a leaf, brightest first, distributed over magnitudes as in the sky.
        let stars: Vec<f64> = (1..=1300_u32)
            .map(|i| illuminance_lx_from_magnitude(17.0 + 3.2 * (f64::from(i) / 1300.0).sqrt()))
            .collect();
        let (mut rounded, mut carried, mut sums): (f64, f64, [f64; 2]) = (0.0, 0.0, [0.0; 2]);
        let mut carry = LightCarry::default();
        for &light in &stars {
            rounded = rounded.max((scale.illuminance_lx(scale.code(light)) / light - 1.0).abs());
            let found = scale.illuminance_lx(carry.code(&scale, light));
            carried = carried.max((found / light - 1.0).abs());
            sums = [sums[0] + light, sums[1] + found];
        }
        assert!((2.0e-3..2.3e-3).contains(&rounded), "{rounded}");
        assert!((2.0e-3..4.6e-3).contains(&carried), "{carried}");
        assert!((sums[1] / sums[0] - 1.0).abs() < 6e-7, "{}", sums[1] / sums[0] - 1.0);
    }

    #[test]
    fn a_faint_star_after_a_bright_one_keeps_its_light() {
        let scale = LightScale::new(13);
        let mut carry = LightCarry::default();
        let [bright, faint] = [13.0023, 20.0].map(illuminance_lx_from_magnitude);
        carry.code(&scale, bright);
        let found = scale.illuminance_lx(carry.code(&scale, faint));
        assert!((found / faint - 1.0).abs() < 4.6e-3);
    }
}
