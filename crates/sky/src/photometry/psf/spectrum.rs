//! Sampling of a spectrum by weighted wavelengths, and conversion of their sums to linear Rec. 709.
//!
//! The tristimulus density of a black body (Planck times the CIE 1931 functions, linear between the rows of the
//! table) is distributed over wavelengths evenly spaced in the visible range: each nanometre is shared in proportion
//! between the two wavelengths next to it. The sum is therefore the colour of the whole spectrum for any number of
//! wavelengths.

use crate::photometry::{
    blackbody::SECOND_RADIATION_M_K,
    cie1931::{COLOUR_MATCHING, wavelength_m},
    rec709::{luminance, rec709_from_xyz},
};

/// The sampled visible range; beyond it the eye has less than 5e-5 of its peak sensitivity.
const RANGE_M: [f64; 2] = [380e-9, 780e-9];

/// Points between two rows of the table, 1 nm apart.
const SUBSTEPS: usize = 5;

/// Largest number of wavelengths: one for each nanometre.
pub const MAX_WAVELENGTHS: usize = 400;

/// A wavelength and the tristimulus value X, Y, Z of its part of the spectrum. The sum of Y is 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Line {
    /// Wavelength, metres.
    pub wavelength_m: f64,
    /// X, Y, Z.
    pub xyz: [f64; 3],
}

/// Spectral radiance of a black body per metre of wavelength, in units of that at 555 nm.
fn relative_radiance(wavelength_m: f64, temperature_k: f64) -> f64 {
    const UNIT_M: f64 = 555e-9;
    let exponent = |wavelength_m: f64| SECOND_RADIATION_M_K / (wavelength_m * temperature_k);
    exponent(UNIT_M).exp_m1() / exponent(wavelength_m).exp_m1() * (UNIT_M / wavelength_m).powi(5)
}

/// Tristimulus density of a black body in steps of 1 nm: wavelength and X, Y, Z.
fn density(temperature_k: f64) -> impl Iterator<Item = (f64, [f64; 3])> {
    (0..(COLOUR_MATCHING.len() - 1) * SUBSTEPS + 1).map(move |i| {
        let (row, part) = (i / SUBSTEPS, (i % SUBSTEPS) as f64 / SUBSTEPS as f64);
        let row_values = |row: usize| {
            let radiance = relative_radiance(wavelength_m(row), temperature_k);
            COLOUR_MATCHING[row].map(|weight| weight * radiance)
        };
        let (low, high) = (row_values(row), row_values((row + 1).min(COLOUR_MATCHING.len() - 1)));
        let wavelength = wavelength_m(row) + part * (wavelength_m(1) - wavelength_m(0));
        (wavelength, std::array::from_fn(|c| low[c] * (1.0 - part) + high[c] * part))
    })
}

/// `count` wavelengths (1 to [`MAX_WAVELENGTHS`]) with their shares of the light of a black body of `temperature_k`.
/// A single one is the mean wavelength, weighted by luminance.
pub fn lines(temperature_k: f64, count: usize) -> Vec<Line> {
    let total_y: f64 = density(temperature_k).map(|(_, xyz)| xyz[1]).sum();
    let mean_m = density(temperature_k).map(|(wavelength, xyz)| wavelength * xyz[1]).sum::<f64>() / total_y;
    let step_m = (RANGE_M[1] - RANGE_M[0]) / count as f64;
    let place = |i: usize| if count == 1 { mean_m } else { RANGE_M[0] + (i as f64 + 0.5) * step_m };
    let mut lines: Vec<Line> = (0..count).map(|i| Line { wavelength_m: place(i), xyz: [0.0; 3] }).collect();
    for (wavelength, xyz) in density(temperature_k) {
        let position = ((wavelength - RANGE_M[0]) / step_m - 0.5).clamp(0.0, (count - 1) as f64);
        let (first, part) = (position.floor() as usize, position.fract());
        for (index, weight) in [(first, 1.0 - part), (first + 1, part)] {
            if let Some(line) = lines.get_mut(index) {
                (0..3).for_each(|c| line.xyz[c] += xyz[c] * weight / total_y);
            }
        }
    }
    lines
}

/// Linear Rec. 709 of X, Y, Z without negative channels: if a fringe's colour is outside the gamut, it is mixed with
/// just enough white to bring the lowest channel to 0. Luminance is kept; over a whole picture the sums of the
/// channels change slightly.
pub fn rec709_keeping_luminance(xyz: [f64; 3]) -> [f64; 3] {
    let rgb = rec709_from_xyz(xyz);
    let lowest = rgb[0].min(rgb[1]).min(rgb[2]);
    if lowest >= 0.0 {
        return rgb;
    }
    let y = luminance(rgb);
    let saturation = y / (y - lowest);
    rgb.map(|channel| (y + saturation * (channel - y)).max(0.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::photometry::blackbody::rec709_at_unit_luminance;

    fn colour_error(lines: &[Line], temperature_k: f64) -> f64 {
        let sum = lines.iter().fold([0.0; 3], |sum, line| std::array::from_fn(|c| sum[c] + line.xyz[c]));
        let rgb = rec709_from_xyz(sum);
        let expected = rec709_at_unit_luminance(temperature_k);
        (0..3).fold(0.0, |worst: f64, c| worst.max((rgb[c] / luminance(rgb) - expected[c]).abs()))
    }

    #[test]
    fn any_number_of_wavelengths_has_the_colour_of_the_whole_spectrum() {
        let mut worst: f64 = 0.0;
        for temperature_k in [2500.0, 5772.0, 6504.0, 20_000.0] {
            for count in [1, 2, 7, 32, 95, MAX_WAVELENGTHS] {
                worst = worst.max(colour_error(&lines(temperature_k, count), temperature_k));
            }
        }
        println!("largest error of a channel: {worst:.1e}");
        assert!(worst < 2e-4, "{worst}");
        // The lines of another star must fail, and so must a missing line.
        assert!(colour_error(&lines(5772.0, 32), 6000.0) > 5e-3);
        assert!(colour_error(&lines(5772.0, 32)[..20], 5772.0) > 5e-3);
    }

    #[test]
    fn a_single_wavelength_is_the_mean_of_the_luminance() {
        let only = lines(5772.0, 1)[0];
        assert!((only.wavelength_m - 560e-9).abs() < 5e-9, "{}", only.wavelength_m);
        assert!((only.xyz[1] - 1.0).abs() < 1e-12);
        // Cooler is redder.
        assert!(lines(3000.0, 1)[0].wavelength_m > only.wavelength_m + 5e-9);
    }

    #[test]
    fn gamut_mapping_keeps_the_luminance() {
        for row in COLOUR_MATCHING {
            let (raw, inside) = (rec709_from_xyz(row), rec709_keeping_luminance(row));
            assert!(inside.iter().all(|channel| *channel >= 0.0));
            assert!((luminance(inside) - luminance(raw)).abs() < 1e-9 * (1.0 + luminance(raw).abs()), "{row:?}");
        }
        assert_eq!(rec709_keeping_luminance([0.0; 3]), [0.0; 3]);
        assert_eq!(rec709_keeping_luminance([0.95, 1.0, 1.09]), rec709_from_xyz([0.95, 1.0, 1.09]));
    }
}
