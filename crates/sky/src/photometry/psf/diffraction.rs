//! Fraunhofer diffraction: the far field of an aperture is the squared modulus of its Fourier transform.
//!
//! Light of wavelength lambda that passes an aperture of area A has, at the angle theta, the density |integral of
//! exp(-2 pi i x theta / lambda) dA|^2 / (A lambda^2) per steradian, for small angles (Goodman, Introduction to
//! Fourier Optics, 4.3); its integral is 1.
//!
//! **One angular scale.** A transform of M samples at a distance dx has steps of lambda / (M dx). The aperture is
//! therefore sampled separately for every wavelength, with dx = lambda / (M step): all wavelengths share the angular
//! step, and no picture with its fringes has to be rescaled.
//!
//! **Sampling.** The intensity has no detail finer than lambda / D, so steps of lambda / 2D resolve it completely;
//! wider pixels are sums of several steps. The transform covers [`PADDING`] times the angle that is kept, because
//! light beyond its end is aliased. The samples are means over cells, which dims the far field by the cell's sinc^2;
//! the result is divided by it.
//!
//! **Position.** The centre of the picture is the centre of the texture: between the four central pixels if its size
//! is even. A phase ramp over the aperture shifts the transform by half a step.

use rayon::prelude::*;
use rustfft::{Fft, FftPlanner, num_complex::Complex};

use super::{Aperture, PsfError};

/// Ratio of the angle covered by a transform to that of the picture.
pub const PADDING: usize = 4;

/// Longest transform.
pub const MAX_TRANSFORM: usize = 16_384;

/// Number of fine columns in one unit of work: rows are then read in whole cache lines.
const BLOCK: usize = 16;

/// How an aperture's far field is sampled.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sampling {
    /// Pixels along a side of the picture.
    pub size: usize,
    /// Angular size of a pixel, radians.
    pub pixel_rad: f64,
    /// Steps of the transform along a side of a pixel.
    pub steps: usize,
    /// Length of the transform.
    pub transform: usize,
}

impl Sampling {
    /// The coarsest sampling that resolves all detail down to `shortest_m`, the shortest wavelength.
    pub fn new(size: usize, pixel_rad: f64, diameter_m: f64, shortest_m: f64) -> Result<Self, PsfError> {
        let steps = (2.0 * pixel_rad * diameter_m / shortest_m - 1e-9).ceil().max(1.0);
        // Compared in floating point: the product may exceed any integer type.
        let needed = PADDING as f64 * size as f64 * steps;
        if needed > MAX_TRANSFORM as f64 {
            let allowed_steps = (MAX_TRANSFORM / PADDING / size.max(1)) as f64;
            return Err(PsfError::TooFine { transform: needed, allowed_steps, needed_steps: steps });
        }
        Ok(Self { size, pixel_rad, steps: steps as usize, transform: smooth_at_least(needed as usize) })
    }

    /// Angle of a step, radians.
    pub fn step_rad(&self) -> f64 {
        self.pixel_rad / self.steps as f64
    }
}

/// The smallest number of at least `least` without prime factors above 5: its transform is fast.
fn smooth_at_least(least: usize) -> usize {
    let is_smooth = |mut n: usize| {
        for factor in [2, 3, 5] {
            while n.is_multiple_of(factor) {
                n /= factor;
            }
        }
        n == 1
    };
    (least.max(2)..).find(|n| is_smooth(*n)).unwrap_or(least)
}

/// Share of the light of one wavelength in each pixel, row by row from the top. The sum is the share in the picture:
/// at most 1, apart from light that is aliased from beyond the transform's end.
pub fn monochromatic(aperture: Aperture, diameter_m: f64, wavelength_m: f64, sampling: &Sampling) -> Vec<f64> {
    let Sampling { size, steps, transform, .. } = *sampling;
    let dx_m = wavelength_m / (transform as f64 * sampling.step_rad());
    let n = ((diameter_m / dx_m).ceil() as usize + 2).min(transform);
    let cells = aperture.grid(n, dx_m / diameter_m);
    let open: f64 = cells.iter().sum();
    let share = far_field(&cells, n, transform, size, steps);
    let scale = 1.0 / (open * (transform as f64).powi(2));
    share.into_iter().map(|value| value * scale).collect()
}

/// Squared modulus of the transform, of length `transform`, of `n` x `n` centred samples, summed over the `steps` x
/// `steps` steps of each of the `size` x `size` central pixels. The result is divided by the sinc^2 of the cells.
fn far_field(cells: &[f64], n: usize, transform: usize, size: usize, steps: usize) -> Vec<f64> {
    let width = size * steps;
    let fft = FftPlanner::new().plan_fft_forward(transform);
    // exp(2 pi i k (width - 1) / 2 / M): output 0 is the fine column at the left edge of the picture.
    let phase: Vec<Complex<f64>> = (0..n)
        .map(|k| {
            // The product is reduced modulo 2 M in integers, so that the angle loses no digit.
            let turn = (k * (width - 1)) % (2 * transform);
            Complex::from_polar(1.0, std::f64::consts::PI * turn as f64 / transform as f64)
        })
        .collect();
    let rows = transform_rows(cells, n, width, &phase, fft.as_ref());
    // The transform of real samples is symmetric: half of the columns are enough.
    let half = size.div_ceil(2);
    let per_block = BLOCK.div_ceil(steps);
    let sinc2: Vec<f64> = (0..width)
        .map(|k| {
            let x = std::f64::consts::PI * (k as f64 + 0.5 - 0.5 * width as f64) / transform as f64;
            if x == 0.0 { 1.0 } else { (x.sin() / x).powi(2) }
        })
        .collect();
    let blocks: Vec<Vec<f64>> = (0..half.div_ceil(per_block))
        .into_par_iter()
        .map(|block| {
            let columns = block * per_block..((block + 1) * per_block).min(half);
            pixel_columns(&rows, width, columns, steps, transform, &phase, &sinc2, fft.as_ref())
        })
        .collect();
    let mut picture = vec![0.0; size * size];
    for (column, values) in blocks.iter().flat_map(|block| block.chunks_exact(size)).enumerate() {
        for (row, value) in values.iter().enumerate() {
            picture[row * size + column] = *value;
            picture[(size - 1 - row) * size + size - 1 - column] = *value;
        }
    }
    picture
}

/// Transforms every row of the samples and keeps its first `width` values.
fn transform_rows(
    cells: &[f64],
    n: usize,
    width: usize,
    phase: &[Complex<f64>],
    fft: &dyn Fft<f64>,
) -> Vec<Complex<f64>> {
    let mut rows = vec![Complex::default(); n * width];
    rows.par_chunks_mut(width).zip(cells.par_chunks(n)).for_each_init(
        || (vec![Complex::default(); fft.len()], vec![Complex::default(); fft.get_inplace_scratch_len()]),
        |(line, scratch), (kept, samples)| {
            line.fill(Complex::default());
            for ((value, sample), turn) in line.iter_mut().zip(samples).zip(phase) {
                *value = turn * *sample;
            }
            fft.process_with_scratch(line, scratch);
            kept.copy_from_slice(&line[..width]);
        },
    );
    rows
}

/// Transforms the fine columns of some pixel columns and sums the squares per pixel, one column of pixels after the
/// other.
#[allow(clippy::too_many_arguments, reason = "the state of one transform, used once")]
fn pixel_columns(
    rows: &[Complex<f64>],
    width: usize,
    columns: std::ops::Range<usize>,
    steps: usize,
    transform: usize,
    phase: &[Complex<f64>],
    sinc2: &[f64],
    fft: &dyn Fft<f64>,
) -> Vec<f64> {
    let fine = columns.start * steps..columns.end * steps;
    let mut lines = vec![Complex::default(); fine.len() * transform];
    for (row, turn) in phase.iter().enumerate() {
        for (k, value) in rows[row * width + fine.start..row * width + fine.end].iter().enumerate() {
            lines[k * transform + row] = turn * value;
        }
    }
    fft.process(&mut lines);
    let size = width / steps;
    let mut pixels = vec![0.0; columns.len() * size];
    for (k, line) in lines.chunks_exact(transform).enumerate() {
        let column = &mut pixels[k / steps * size..][..size];
        for (j, value) in line[..width].iter().enumerate() {
            column[j / steps] += value.norm_sqr() / (sinc2[fine.start + k] * sinc2[j]);
        }
    }
    pixels
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn energy_is_conserved_by_the_transform() {
        // Parseval: the sum of all squares is M^2 times the sum of the samples' squares.
        let (n, transform) = (41, 128);
        let cells = Aperture::Jwst.grid(n, 1.03 / n as f64);
        let samples: f64 = cells.iter().map(|cell| cell * cell).sum::<f64>() * (transform * transform) as f64;
        let whole = |cells: &[f64]| -> f64 {
            let fft = FftPlanner::new().plan_fft_forward(transform);
            let phase = vec![Complex::new(1.0, 0.0); n];
            let rows = transform_rows(cells, n, transform, &phase, fft.as_ref());
            pixel_columns(&rows, transform, 0..transform, 1, transform, &phase, &[1.0; 128], fft.as_ref()).iter().sum()
        };
        let error = whole(&cells) / samples - 1.0;
        println!("Parseval: relative error {error:.1e}");
        assert!(error.abs() < 1e-12, "{error}");
        // A transform without one sample must fail.
        let mut wrong = cells.clone();
        wrong[n / 2 * n + n / 4] = 0.0;
        assert!((whole(&wrong) / samples - 1.0).abs() > 1e-4);
    }

    #[test]
    fn the_transform_matches_its_definition() {
        // Compared with the explicit sum, for an even and an odd size, with pixels of several steps.
        for (size, steps) in [(6, 1), (5, 1), (4, 3)] {
            let (n, transform) = (9, 60);
            let cells: Vec<f64> = (0..n * n).map(|i| f64::from(u32::try_from(i * 7 % 11).unwrap()) / 10.0).collect();
            let found = far_field(&cells, n, transform, size, steps);
            for row in 0..size {
                for column in 0..size {
                    let mut expected = 0.0;
                    for sub in 0..steps * steps {
                        let coordinate =
                            |pixel: usize, sub: usize| (pixel * steps + sub) as f64 + 0.5 - 0.5 * (size * steps) as f64;
                        let (u, v) = (coordinate(column, sub % steps), coordinate(row, sub / steps));
                        let mut sum = Complex::new(0.0, 0.0);
                        for (i, cell) in cells.iter().enumerate() {
                            let turn =
                                -std::f64::consts::TAU * ((i % n) as f64 * u + (i / n) as f64 * v) / transform as f64;
                            sum += Complex::from_polar(*cell, turn);
                        }
                        let sinc = |k: f64| {
                            let x = std::f64::consts::PI * k / transform as f64;
                            if x == 0.0 { 1.0 } else { x.sin() / x }
                        };
                        expected += sum.norm_sqr() / (sinc(u) * sinc(v)).powi(2);
                    }
                    let value = found[row * size + column];
                    assert!((value - expected).abs() < 1e-9, "{size} {steps} {row} {column}: {value} {expected}");
                }
            }
        }
    }

    #[test]
    fn transforms_have_fast_lengths_and_an_upper_limit() {
        assert_eq!([1, 7, 2048, 2049].map(smooth_at_least), [2, 8, 2048, 2160]);
        let fine = Sampling::new(512, 1e-5, 0.002, 380e-9).unwrap();
        assert_eq!((fine.steps, fine.transform), (1, 2048));
        assert!(matches!(Sampling::new(512, 1.0, 1.0, 380e-9), Err(PsfError::TooFine { .. })));
    }
}
