//! Interpolation of vectors on a regular grid: with cubic splines, which have continuous second derivatives, or
//! bilinearly from the four corners of a cell.
//!
//! A spline passes through all samples. At the ends its third derivative is continuous across the second and the second
//! to last sample (*not a knot*), so that it keeps its order there and extrapolates by half a cell (de Boor, *A
//! Practical Guide to Splines*, 1978, chapter IV). Along a side of two samples it is a line, of three samples a
//! parabola.

use glam::DVec3;

/// How values between samples are interpolated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Interpolation {
    /// Cubic splines.
    #[default]
    Smooth,
    /// Bilinearly from the four corners of a cell, as some file formats require.
    Linear,
}

/// A value and its derivatives along columns and rows, per sample.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Jet {
    pub(super) value: DVec3,
    pub(super) across: DVec3,
    pub(super) down: DVec3,
}

/// Vectors on a grid.
#[derive(Clone, Debug)]
pub(super) struct Surface {
    interpolation: Interpolation,
    /// Samples along both sides.
    samples: [usize; 2],
    /// Row by row: coefficients of the cubic B-spline (one more at each end than samples), or the samples themselves
    /// for linear interpolation.
    values: Vec<DVec3>,
}

impl Surface {
    /// Builds a surface through `values`, `samples[0]` by `samples[1]` (both at least 2), row by row.
    pub(super) fn new(values: &[DVec3], samples: [usize; 2], interpolation: Interpolation) -> Self {
        let [columns, rows] = samples;
        let values = match interpolation {
            Interpolation::Linear => values.to_vec(),
            Interpolation::Smooth => {
                let by_rows: Vec<Vec<DVec3>> = values.chunks_exact(columns).map(coefficients).collect();
                let width = columns + 2;
                let mut all = vec![DVec3::ZERO; width * (rows + 2)];
                let mut column = vec![DVec3::ZERO; rows];
                for x in 0..width {
                    for (value, row) in column.iter_mut().zip(&by_rows) {
                        *value = row[x];
                    }
                    for (y, value) in coefficients(&column).into_iter().enumerate() {
                        all[y * width + x] = value;
                    }
                }
                all
            }
        };
        Self { interpolation, samples, values }
    }

    /// The cell of a point, and the point's position in it.
    fn cell_at(&self, [x, y]: [f64; 2]) -> ([usize; 2], [f64; 2]) {
        let [columns, rows] = self.samples;
        let [i, j] = [cell(x, columns), cell(y, rows)];
        ([i, j], [x - i as f64, y - j as f64])
    }

    /// The value at a point, in sample units; beyond the first and the last sample the outermost cells are
    /// extrapolated.
    pub(super) fn evaluate(&self, at: [f64; 2]) -> Jet {
        let (held, [tx, ty]) = self.cell_at(at);
        let columns = self.samples[0];
        match self.interpolation {
            Interpolation::Linear => {
                self.sum(held, columns, [([1.0 - tx, tx], [-1.0, 1.0]), ([1.0 - ty, ty], [-1.0, 1.0])])
            }
            Interpolation::Smooth => self.sum(held, columns + 2, [basis(tx), basis(ty)]),
        }
    }

    /// [`Self::evaluate`] without the derivatives, which takes a third of the time.
    pub(super) fn value(&self, at: [f64; 2]) -> DVec3 {
        let (held, [tx, ty]) = self.cell_at(at);
        let columns = self.samples[0];
        match self.interpolation {
            Interpolation::Linear => self.sum_of_values(held, columns, [[1.0 - tx, tx], [1.0 - ty, ty]]),
            Interpolation::Smooth => self.sum_of_values(held, columns + 2, [basis(tx).0, basis(ty).0]),
        }
    }

    fn sum_of_values<const N: usize>(&self, [i, j]: [usize; 2], stride: usize, [x, y]: [[f64; N]; 2]) -> DVec3 {
        let mut sum = DVec3::ZERO;
        for (row, y) in y.into_iter().enumerate() {
            let values = &self.values[(j + row) * stride + i..][..N];
            let mut along = DVec3::ZERO;
            for column in 0..N {
                along += x[column] * values[column];
            }
            sum += y * along;
        }
        sum
    }

    fn sum<const N: usize>(&self, [i, j]: [usize; 2], stride: usize, weights: [([f64; N], [f64; N]); 2]) -> Jet {
        let [(x, dx), (y, dy)] = weights;
        let mut jet = Jet::default();
        for row in 0..N {
            let values = &self.values[(j + row) * stride + i..][..N];
            let mut along = DVec3::ZERO;
            let mut slope = DVec3::ZERO;
            for column in 0..N {
                along += x[column] * values[column];
                slope += dx[column] * values[column];
            }
            jet.value += y[row] * along;
            jet.across += y[row] * slope;
            jet.down += dy[row] * along;
        }
        jet
    }
}

/// Index of the cell that contains a position, or the nearest one.
pub(super) fn cell(at: f64, samples: usize) -> usize {
    // The conversion rounds down.
    (at.max(0.0) as usize).min(samples - 2)
}

/// The four cubic B-splines of a cell at `t` (0 to 1 in the cell), and their derivatives.
fn basis(t: f64) -> ([f64; 4], [f64; 4]) {
    let s = 1.0 - t;
    let middle = |t: f64| (3.0 * t * t * t - 6.0 * t * t + 4.0) / 6.0;
    let slope = |t: f64| (3.0 * t * t - 4.0 * t) / 2.0;
    ([s * s * s / 6.0, middle(t), middle(s), t * t * t / 6.0], [-s * s / 2.0, slope(t), -slope(s), t * t / 2.0])
}

/// Coefficients of the cubic B-spline through samples: one more at each end than there are samples.
fn coefficients(samples: &[DVec3]) -> Vec<DVec3> {
    let n = samples.len();
    match samples {
        [] => Vec::new(),
        [only] => vec![*only; 3],
        // The coefficients of a line are the line itself; those of a parabola with second difference d are the parabola
        // minus d / 6.
        [first, second] => {
            let step = *second - *first;
            vec![*first - step, *first, *second, *second + step]
        }
        [a, b, c] => {
            let second = *a - 2.0 * *b + *c;
            let value = |k: f64| *b + k * (*c - *a) / 2.0 + k * k / 2.0 * second - second / 6.0;
            vec![value(-2.0), value(-1.0), value(0.0), value(1.0), value(2.0)]
        }
        _ => {
            // Not a knot at the second sample: the second derivatives m of the first three samples are linear, m0 = 2
            // m1 - m2; likewise at the other end. With m_k = c_(k-1) - 2 c_k + c_(k+1) and f_k = c_k + m_k / 6, the
            // others satisfy m_(k-1) / 6 + 2 m_k / 3 + m_(k+1) / 6 = f_(k-1) - 2 f_k + f_(k+1).
            let second = |k: usize| samples[k - 1] - 2.0 * samples[k] + samples[k + 1];
            let mut m = vec![DVec3::ZERO; n];
            m[1] = second(1);
            m[n - 2] = second(n - 2);
            if n > 4 {
                // Solve for the inner second derivatives, whose two outer neighbours are known: a tridiagonal system (Thomas algorithm).
                let mut upper = vec![0.0; n];
                let mut right = m.clone();
                for k in 2..n - 2 {
                    let pivot = 2.0 / 3.0 - upper[k - 1] / 6.0;
                    upper[k] = 1.0 / 6.0 / pivot;
                    right[k] = (second(k) - right[k - 1] / 6.0) / pivot;
                }
                for k in (2..n - 2).rev() {
                    m[k] = right[k] - upper[k] * m[k + 1];
                }
            }
            m[0] = 2.0 * m[1] - m[2];
            m[n - 1] = 2.0 * m[n - 2] - m[n - 3];
            let inner = samples.iter().zip(&m).map(|(sample, m)| *sample - *m / 6.0);
            let mut all: Vec<DVec3> = [DVec3::ZERO].into_iter().chain(inner).chain([DVec3::ZERO]).collect();
            all[0] = m[0] + 2.0 * all[1] - all[2];
            all[n + 1] = m[n - 1] + 2.0 * all[n] - all[n - 1];
            all
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sampled(samples: [usize; 2], function: impl Fn(f64, f64) -> f64) -> Vec<DVec3> {
        let [columns, rows] = samples;
        let points = (0..rows).flat_map(|y| (0..columns).map(move |x| (x as f64, y as f64)));
        points.map(|(x, y)| DVec3::new(function(x, y), x, -y)).collect()
    }

    #[test]
    fn cubic_polynomials_are_reproduced_also_beyond_the_ends() {
        let function = |x: f64, y: f64| 0.3 + x - 0.2 * y + 0.05 * x * x * x - 0.01 * x * x * y * y + 0.02 * y * y * y;
        for samples in [[4, 4], [5, 4], [6, 9], [33, 17]] {
            let surface = Surface::new(&sampled(samples, function), samples, Interpolation::Smooth);
            for step in 0..400 {
                let [x, y] = [7.0_f64, 13.0].map(|prime| (f64::from(step) * prime.sqrt()).fract());
                let [x, y] = [x * samples[0] as f64 - 0.5, y * samples[1] as f64 - 0.5];
                let jet = surface.evaluate([x, y]);
                assert!(
                    (jet.value.x / function(x, y) - 1.0).abs() < 1e-9,
                    "{samples:?} {x} {y}: {} {}",
                    jet.value.x,
                    function(x, y)
                );
                let h = 1e-5;
                let slope = (function(x + h, y) - function(x - h, y)) / (2.0 * h);
                assert!((jet.across.x - slope).abs() < 1e-6 * (1.0 + slope.abs()), "{x} {y}");
                assert!((jet.value.y - x).abs() < 1e-9 && (jet.down.z + 1.0).abs() < 1e-9);
            }
        }
    }

    #[test]
    fn few_samples_make_lines_and_parabolas() {
        let function = |x: f64, _: f64| 1.0 + 2.0 * x + 0.5 * x * x;
        let surface = Surface::new(&sampled([3, 2], function), [3, 2], Interpolation::Smooth);
        for x in [-0.5, 0.0, 0.3, 1.0, 1.7, 2.5] {
            assert!(
                (surface.evaluate([x, 0.25]).value - DVec3::new(function(x, 0.0), x, -0.25)).length() < 1e-12,
                "{x}"
            );
        }
    }

    #[test]
    fn splines_have_continuous_second_derivatives_and_linear_cells_do_not() {
        let wave = |x: f64, y: f64| (0.7 * x).sin() * (0.4 * y).cos();
        let values = sampled([20, 20], wave);
        let jump = |interpolation| {
            let surface = Surface::new(&values, [20, 20], interpolation);
            let slope = |x: f64| surface.evaluate([x, 7.3]).across.x;
            let h = 1e-4;
            let bend = |x: f64| (slope(x + h) - slope(x)) / h;
            ((slope(9.0 + h) - slope(9.0 - h)).abs(), (bend(9.0) - bend(9.0 - h)).abs())
        };
        let (smooth, bent) = jump(Interpolation::Smooth);
        assert!(smooth < 2e-4 && bent < 1e-3, "{smooth} {bent}");
        let (linear, _) = jump(Interpolation::Linear);
        assert!(linear > 3e-3, "{linear}");
    }
}
