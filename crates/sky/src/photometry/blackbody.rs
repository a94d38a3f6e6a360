//! Colour and luminance of a black body.
//!
//! Planck's spectrum is integrated with the CIE 1931 colour matching functions (`cie1931`), converted to linear Rec.
//! 709 and divided by its luminance. The result is a colour with Y = 1, to be multiplied by an illuminance or a
//! luminance. It is *not* normalised to its largest channel: that would dim a 2300 K star by 0.8 mag relative to one
//! of 6500 K.
//!
//! Below 1900 K blue (and below 964 K green) is negative: such light is redder than the display's primaries.
//! [`rec709_in_gamut`] mixes in just enough D65 white to bring the lowest channel to zero; the luminance is kept.
//!
//! Units: kelvin, cd/m^2. Radiation constants are the exact ones of the SI of 2019.

use thiserror::Error;

use super::cie1931::{COLOUR_MATCHING, STEP_M, wavelength_m};
use super::rec709::{luminance, rec709_from_xyz};

pub use super::rec709::uv_prime;

/// Second radiation constant h c / k, metre kelvin.
pub(super) const SECOND_RADIATION_M_K: f64 = 6.626_070_15e-34 * 299_792_458.0 / 1.380_649e-23;

/// 2 h c^2, W m^2 per steradian.
const FIRST_RADIATION_RADIANCE: f64 = 2.0 * 6.626_070_15e-34 * 299_792_458.0 * 299_792_458.0;

/// Luminous efficacy of radiation at 540 THz (SI), lumens per watt.
const LUMINOUS_EFFICACY_LM_W: f64 = 683.0;

/// Temperatures beyond which a colour has reached its limit to f64 precision: a line at the red end of the table, and
/// the Rayleigh-Jeans tail.
const LIMITING_TEMPERATURES_K: [f64; 2] = [1.0, 1e12];

/// Tristimulus values X, Y, Z of a black body, in units of its spectral radiance at the table's longest wavelength.
///
/// With x = c2 / (lambda T), the ratio of two values of 1 / (e^x - 1) is written so that neither overflows.
fn tristimulus(temperature_k: f64) -> [f64; 3] {
    let temperature_k = temperature_k.clamp(LIMITING_TEMPERATURES_K[0], LIMITING_TEMPERATURES_K[1]);
    let exponent = |wavelength: f64| SECOND_RADIATION_M_K / (wavelength * temperature_k);
    let longest_m = wavelength_m(COLOUR_MATCHING.len() - 1);
    let x_longest = exponent(longest_m);
    let mut sum = [0.0; 3];
    for (index, row) in COLOUR_MATCHING.iter().enumerate() {
        let wavelength = wavelength_m(index);
        let x = exponent(wavelength);
        let radiance = (x_longest - x).exp() * (-x_longest).exp_m1() / (-x).exp_m1() * (longest_m / wavelength).powi(5);
        for (total, weight) in sum.iter_mut().zip(row) {
            *total += radiance * weight;
        }
    }
    sum
}

/// CIE 1931 chromaticity x, y of a black body of `temperature_k`. NaN gives NaN.
pub fn chromaticity_xy(temperature_k: f64) -> [f64; 2] {
    let [x, y, z] = tristimulus(temperature_k);
    [x / (x + y + z), y / (x + y + z)]
}

/// Linear Rec. 709 RGB of a black body of `temperature_k`, with [`luminance`] = 1; may be out of gamut (negative).
/// Temperatures outside 1 to 1e12 K give the limits; NaN gives NaN.
pub fn rec709_at_unit_luminance(temperature_k: f64) -> [f64; 3] {
    at_unit_luminance(rec709_from_xyz(tristimulus(temperature_k)))
}

fn at_unit_luminance(rgb: [f64; 3]) -> [f64; 3] {
    let y = luminance(rgb);
    rgb.map(|channel| channel / y)
}

/// The colour of [`rec709_at_unit_luminance`] brought into gamut: mixed with D65 white until no channel is negative;
/// [`luminance`] is still 1.
pub fn rec709_in_gamut(temperature_k: f64) -> [f64; 3] {
    in_gamut(rec709_at_unit_luminance(temperature_k))
}

/// Mixes a colour of luminance 1 with D65 white until no channel is negative.
fn in_gamut(rgb: [f64; 3]) -> [f64; 3] {
    let lowest = rgb[0].min(rgb[1]).min(rgb[2]);
    if lowest >= 0.0 || rgb[0].is_nan() {
        return rgb;
    }
    // White at Y = 1 is (1, 1, 1). The lowest channel becomes 0; rounding must not make it slightly negative.
    let saturation = 1.0 / (1.0 - lowest);
    rgb.map(|channel| (1.0 + saturation * (channel - 1.0)).max(0.0))
}

/// Photopic luminance of a black body of `temperature_k`, cd/m^2: 683 lm/W times the integral of spectral radiance
/// times V(lambda). Zero at and below 0 K, and where it underflows (below about 24 K); NaN gives NaN.
pub fn luminance_cd_m2(temperature_k: f64) -> f64 {
    // Not f64::max, which would turn NaN into 0.
    let temperature_k = if temperature_k < 0.0 { 0.0 } else { temperature_k };
    let radiance_m: f64 = COLOUR_MATCHING
        .iter()
        .enumerate()
        .map(|(index, row)| {
            let wavelength = wavelength_m(index);
            let x = SECOND_RADIATION_M_K / (wavelength * temperature_k);
            row[1] * FIRST_RADIATION_RADIANCE / (wavelength.powi(5) * x.exp_m1())
        })
        .sum();
    LUMINOUS_EFFICACY_LM_W * radiance_m * STEP_M
}

/// Natural logarithm of [`luminance_cd_m2`], even where the luminance itself underflows f64. Temperatures are clamped
/// to 1 to 1e12 K; NaN gives NaN.
pub fn ln_luminance_cd_m2(temperature_k: f64) -> f64 {
    let [_, y, _] = tristimulus(temperature_k);
    ln_luminance_of(y, temperature_k)
}

/// Logarithm of the luminance of a black body whose `tristimulus` has this Y.
fn ln_luminance_of(y: f64, temperature_k: f64) -> f64 {
    let temperature_k = temperature_k.clamp(LIMITING_TEMPERATURES_K[0], LIMITING_TEMPERATURES_K[1]);
    // `tristimulus` is in units of the radiance at the longest wavelength: c1 lambda^-5 / (e^x - 1), with e^x
    // factored out.
    let longest_m = wavelength_m(COLOUR_MATCHING.len() - 1);
    let x = SECOND_RADIATION_M_K / (longest_m * temperature_k);
    let scale = LUMINOUS_EFFICACY_LM_W * STEP_M * FIRST_RADIATION_RADIANCE / longest_m.powi(5);
    (y * scale / -(-x).exp_m1()).ln() - x
}

/// Colour and luminance of a black body, from one sum over its spectrum.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Blackbody {
    /// The colour of [`rec709_in_gamut`].
    pub colour: [f64; 3],
    /// The value of [`ln_luminance_cd_m2`].
    pub ln_luminance: f64,
}

impl Blackbody {
    /// The black body of `temperature_k`. Temperatures outside 1 to 1e12 K give the limits; NaN gives NaN.
    pub fn new(temperature_k: f64) -> Self {
        let xyz = tristimulus(temperature_k);
        let colour = in_gamut(at_unit_luminance(rec709_from_xyz(xyz)));
        Self { colour, ln_luminance: ln_luminance_of(xyz[1], temperature_k) }
    }
}

/// Errors from making a [`BlackbodyTable`].
#[derive(Clone, Copy, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum BlackbodyTableError {
    /// The range is empty, not positive or not finite.
    #[error("temperatures from {min_k} K to {max_k} K: must satisfy 0 < lowest < highest < infinity")]
    Range {
        /// Requested lowest temperature, kelvin.
        min_k: f64,
        /// Requested highest temperature, kelvin.
        max_k: f64,
    },
    /// Interpolation needs at least two entries.
    #[error("{0} entries: must be at least 2")]
    Size(usize),
}

/// Black-body colours in gamut with Y = 1 for the GPU, at temperatures in geometric progression: entry `i` of `n` is
/// at min * (max / min)^(i / (n - 1)). Linear interpolation between entries keeps Y = 1.
#[derive(Clone, Debug, PartialEq)]
pub struct BlackbodyTable {
    /// Linear Rec. 709 RGB, one entry per temperature, ascending.
    pub entries: Vec<[f32; 3]>,
    min_k: f64,
    max_k: f64,
}

impl BlackbodyTable {
    /// Makes a table of `n` entries from `min_k` to `max_k` kelvin.
    pub fn new(min_k: f64, max_k: f64, n: usize) -> Result<Self, BlackbodyTableError> {
        if !(min_k > 0.0 && min_k < max_k && max_k.is_finite()) {
            return Err(BlackbodyTableError::Range { min_k, max_k });
        }
        if n < 2 {
            return Err(BlackbodyTableError::Size(n));
        }
        let last = (n - 1) as f64;
        let entries = (0..n)
            .map(|i| rec709_in_gamut(min_k * (max_k / min_k).powf(i as f64 / last)).map(|channel| channel as f32))
            .collect();
        Ok(Self { entries, min_k, max_k })
    }

    /// Lowest temperature, kelvin.
    pub fn min_k(&self) -> f64 {
        self.min_k
    }

    /// Highest temperature, kelvin.
    pub fn max_k(&self) -> f64 {
        self.max_k
    }

    /// Fractional index of a temperature: (n - 1) ln(T / min) / ln(max / min), from 0 to n - 1. Temperatures outside
    /// the table give its ends; NaN gives NaN.
    pub fn index_of(&self, temperature_k: f64) -> f64 {
        let last = (self.entries.len() - 1) as f64;
        let temperature_k = temperature_k.clamp(self.min_k, self.max_k);
        ((temperature_k / self.min_k).ln() / (self.max_k / self.min_k).ln() * last).clamp(0.0, last)
    }

    /// Colour at a temperature, interpolated linearly between the two nearest entries, as in the shader. NaN gives
    /// NaN.
    pub fn sample(&self, temperature_k: f64) -> [f64; 3] {
        let place = self.index_of(temperature_k);
        let below = (place.floor() as usize).min(self.entries.len() - 2);
        let part = place - below as f64;
        let (low, high) = (self.entries[below], self.entries[below + 1]);
        std::array::from_fn(|c| f64::from(low[c]) * (1.0 - part) + f64::from(high[c]) * part)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rows of the reference: temperature, x, y, and RGB at Y = 1, computed independently at high precision.
    fn reference() -> Vec<[f64; 6]> {
        let text = include_str!("../../../../tests/data/blackbody_srgb.csv");
        let rows: Vec<[f64; 6]> = text
            .lines()
            .skip(1)
            .map(|line| {
                let numbers: Vec<f64> = line.split(',').map(|field| field.trim().parse().unwrap()).collect();
                numbers.try_into().unwrap()
            })
            .collect();
        assert_eq!(rows.len(), 26);
        rows
    }

    #[test]
    fn one_sum_gives_the_colour_and_the_luminance() {
        for temperature_k in [0.5, 900.0, 3000.0, 5772.0, 4e4, 1e13] {
            let Blackbody { colour, ln_luminance } = Blackbody::new(temperature_k);
            assert_eq!(colour, rec709_in_gamut(temperature_k));
            assert_eq!(ln_luminance, ln_luminance_cd_m2(temperature_k));
        }
    }

    /// Largest deviation of any channel of `colour` over all rows of the reference.
    fn worst_channel_error(colour: impl Fn(f64) -> [f64; 3]) -> f64 {
        reference().iter().fold(0.0, |worst, row| {
            let rgb = colour(row[0]);
            (0..3).fold(worst, |worst: f64, c| worst.max((rgb[c] - row[3 + c]).abs()))
        })
    }

    const COLOUR_LIMIT: f64 = 2e-3;

    #[test]
    fn chromaticities_match_the_reference() {
        let mut worst: f64 = 0.0;
        for row in reference() {
            let [x, y] = chromaticity_xy(row[0]);
            worst = worst.max((x - row[1]).abs()).max((y - row[2]).abs());
        }
        println!("largest error of x, y: {worst:.2e}");
        assert!(worst < 5e-6, "{worst}");
    }

    #[test]
    fn colours_match_the_reference() {
        // The remaining difference comes from the luminance weights of the reference, whose white has one digit more:
        // 3.4e-4 of 4.6 at 1000 K.
        let worst = worst_channel_error(rec709_at_unit_luminance);
        println!("largest error of a channel: {worst:.2e}");
        assert!(worst < COLOUR_LIMIT, "{worst}");
    }

    #[test]
    fn a_wrong_table_fails_the_comparison() {
        let max_normalised = |t| {
            let rgb = rec709_at_unit_luminance(t);
            let max = rgb[0].max(rgb[1]).max(rgb[2]);
            rgb.map(|channel| channel / max)
        };
        assert!(worst_channel_error(max_normalised) > 0.5);
        assert!(worst_channel_error(|t| rec709_at_unit_luminance(1.005 * t)) > 5.0 * COLOUR_LIMIT);
        assert!(
            worst_channel_error(|t| {
                let [r, g, b] = rec709_at_unit_luminance(t);
                [b, g, r]
            }) > 1.0
        );
    }

    #[test]
    fn luminance_is_one_and_gamut_is_kept_at_every_temperature() {
        for t in [-5.0, 0.0, 1e-3, 30.0, 300.0, 900.0, 1000.0, 1899.0, 2300.0, 6504.0, 1e5, 1e9, 1e300, f64::INFINITY] {
            let (raw, inside) = (rec709_at_unit_luminance(t), rec709_in_gamut(t));
            assert!((luminance(raw) - 1.0).abs() < 1e-12, "{t} K: {raw:?}");
            assert!((luminance(inside) - 1.0).abs() < 1e-12, "{t} K: {inside:?}");
            assert!(inside.iter().all(|channel| *channel >= 0.0), "{t} K: {inside:?}");
            if raw.iter().all(|channel| *channel >= 0.0) {
                assert_eq!(raw, inside);
            } else {
                // The lowest channel is exactly 0, and the colour stays on the line to white.
                assert!(inside.contains(&0.0), "{t} K: {inside:?}");
                let ratio = |rgb: [f64; 3]| (rgb[0] - 1.0) / (rgb[1] - 1.0);
                assert!((ratio(raw) / ratio(inside) - 1.0).abs() < 1e-9);
            }
        }
        assert!(rec709_in_gamut(f64::NAN).iter().all(|channel| channel.is_nan()));
    }

    #[test]
    fn normalising_to_the_largest_channel_would_dim_cool_stars() {
        // 2300 K against 6500 K, in magnitudes: the figure at the top of the module.
        let max = |t: f64| -> f64 { rec709_at_unit_luminance(t).into_iter().fold(0.0, f64::max) };
        let magnitudes: f64 = 2.5 * (max(2300.0) / max(6500.0)).log10();
        assert!((magnitudes - 0.83).abs() < 0.01, "{magnitudes}");
    }

    #[test]
    fn luminance_at_freezing_platinum_is_the_old_candela() {
        // Until 1979 a black body at the freezing point of platinum (2041.4 K, ITS-90) had 60 cd/cm^2 by definition.
        // The candela that replaced it agrees within the half per cent of the uncertainty of that temperature.
        let found = luminance_cd_m2(2041.4);
        println!("freezing platinum: {found:.4e} cd/m^2");
        assert!((found / 6.0e5 - 1.0).abs() < 0.01, "{found}");
    }

    #[test]
    fn efficacy_peaks_at_ninety_five_lumens_per_watt_near_6640_k() {
        const STEFAN_BOLTZMANN: f64 = 5.670_374_419e-8;
        let efficacy = |t: f64| std::f64::consts::PI * luminance_cd_m2(t) / (STEFAN_BOLTZMANN * t.powi(4));
        let best =
            (5000..9000).step_by(10).map(f64::from).max_by(|a, b| efficacy(*a).total_cmp(&efficacy(*b))).unwrap();
        println!("best efficacy {:.2} lm/W at {best} K", efficacy(best));
        assert!((best - 6640.0).abs() < 60.0 && (efficacy(best) - 95.0).abs() < 1.0, "{best} K, {}", efficacy(best));
    }

    #[test]
    fn visible_light_ahead_of_a_fast_observer_grows_less_than_its_energy() {
        // Straight ahead at 0.9 c: D = 4.36, and E'/E = D^-2 Y(D T) / Y(T); energy alone would give D^2 = 19.
        let doppler = ((1.0 + 0.9) / (1.0 - 0.9_f64)).sqrt();
        let growth = luminance_cd_m2(doppler * 5800.0) / luminance_cd_m2(5800.0) / doppler.powi(2);
        println!("growth of illuminance straight ahead at 0.9 c, 5800 K: {growth:.3}");
        assert!((growth - 2.6).abs() < 0.05, "{growth}");
    }

    #[test]
    fn luminance_is_finite_at_the_ends_and_nan_is_not_hidden() {
        assert_eq!(luminance_cd_m2(0.0), 0.0);
        assert_eq!(luminance_cd_m2(-1.0), 0.0);
        assert!(luminance_cd_m2(1.0) == 0.0 && luminance_cd_m2(300.0) > 0.0);
        assert!(luminance_cd_m2(1e12).is_finite());
        assert!(luminance_cd_m2(f64::NAN).is_nan());
    }

    #[test]
    fn the_logarithm_matches_the_luminance_and_extends_below_its_underflow() {
        for t in [30.0, 100.0, 500.0, 5772.0, 1e5, 1.4e7, 1e12] {
            let (found, expected) = (ln_luminance_cd_m2(t), luminance_cd_m2(t).ln());
            assert!((found - expected).abs() < 1e-9 * expected.abs().max(1.0), "{t} K: {found} {expected}");
        }
        // Below the underflow of the luminance only Wien's law at the red end of the table, 830 nm, remains.
        let slope = (ln_luminance_cd_m2(3.0) - ln_luminance_cd_m2(4.0)) / (1.0 / 4.0 - 1.0 / 3.0);
        assert!((slope / (0.014_387_769 / 830e-9) - 1.0).abs() < 1e-3, "{slope}");
        assert!(ln_luminance_cd_m2(f64::NAN).is_nan());
    }

    #[test]
    fn table_is_exact_at_its_ends_and_interpolates_with_a_small_colour_error() {
        let table = BlackbodyTable::new(1000.0, 50_000.0, 256).unwrap();
        assert_eq!(table.entries.len(), 256);
        assert_eq!(table.entries[0], rec709_in_gamut(1000.0).map(|c| c as f32));
        assert_eq!(table.index_of(1000.0), 0.0);
        assert_eq!(table.index_of(50_000.0), 255.0);
        assert_eq!(table.index_of(5.0), 0.0);
        assert_eq!(table.index_of(f64::INFINITY), 255.0);
        assert!(table.index_of(f64::NAN).is_nan());
        assert!((table.index_of((1000.0_f64 * 50_000.0).sqrt()) - 127.5).abs() < 1e-9);
        let mut worst: f64 = 0.0;
        for step in 0..5000 {
            let t = 1000.0 * 50.0_f64.powf(f64::from(step) / 5000.0);
            let (found, exact) = (table.sample(t), rec709_in_gamut(t));
            assert!((luminance(found) - 1.0).abs() < 2e-7, "{t} K");
            let (a, b) = (uv_prime(found), uv_prime(exact));
            worst = worst.max((a[0] - b[0]).hypot(a[1] - b[1]));
        }
        println!("256 entries, 1000 to 50000 K: largest interpolation error in u'v' {worst:.2e}");
        assert!(worst < 2e-4, "{worst}");
    }

    #[test]
    fn impossible_tables_are_refused() {
        for (min_k, max_k) in [(0.0, 1e4), (-1.0, 1e4), (1e4, 1e4), (2e4, 1e4), (f64::NAN, 1e4), (1e3, f64::INFINITY)] {
            let error = BlackbodyTable::new(min_k, max_k, 16).unwrap_err();
            assert!(matches!(error, BlackbodyTableError::Range { .. }), "{error}");
        }
        assert_eq!(BlackbodyTable::new(1e3, 1e4, 1), Err(BlackbodyTableError::Size(1)));
    }
}
