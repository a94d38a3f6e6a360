//! Point-spread functions on the sphere: the distribution of a star's light over directions, per steradian.
//!
//! Offsets are in the tangent plane of the star, in terms of angle and azimuth (azimuthal equidistant): the length of
//! an offset is the angular distance from the star in rad. Every function is normalised: its integral over the sphere
//! is 1 in each channel, so that illuminance is conserved.

use std::f64::consts::{PI, TAU};

use glam::DVec2;

/// The distribution of a star's light.
pub trait PointSpread: Sync {
    /// Returns the fraction of the star's light per steradian at an offset (+x right, +y up, rad), in linear Rec. 709 channels.
    fn per_sr(&self, offset_rad: DVec2) -> [f64; 3];

    /// Returns the angle from the star beyond which there is no light, rad, at most pi.
    fn radius_rad(&self) -> f64;

    /// Returns the scale of the finest detail, rad: within a square with this side, a polynomial approximates the function well. Larger pixels are
    /// subdivided for the quadrature.
    fn detail_rad(&self) -> f64;
}

/// Reasons why a point-spread function cannot be created.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PointSpreadError {
    /// A width is not a positive number, or too large for the sphere.
    #[error("{what} = {value} rad: must be more than 0 and at most {most}")]
    Width {
        /// Name of the width.
        what: &'static str,
        /// Its value.
        value: f64,
        /// The largest valid value.
        most: f64,
    },
    /// A table has the wrong number of values.
    #[error("the table has {given} values; it must have {needed}")]
    Count {
        /// Number of values passed in.
        given: usize,
        /// The required number.
        needed: String,
    },
    /// A channel has no light, or a value that is negative or not finite.
    #[error("channel {channel} of a table: values must be finite, not negative, and not all 0")]
    NoLight {
        /// 0 red, 1 green, 2 blue.
        channel: usize,
    },
}

fn width(what: &'static str, value: f64, most: f64) -> Result<f64, PointSpreadError> {
    if value > 0.0 && value <= most { Ok(value) } else { Err(PointSpreadError::Width { what, value, most }) }
}

/// Nodes and weights of Gauss-Legendre quadrature over [-1, 1] with five points: exact to the ninth degree (Abramowitz and
/// Stegun, table 25.4).
pub(crate) const FIVE_POINTS: [(f64, f64); 5] = [
    (-0.906_179_845_938_664, 0.236_926_885_056_189_1),
    (-0.538_469_310_105_683_1, 0.478_628_670_499_366_5),
    (0.0, 0.568_888_888_888_888_9),
    (0.538_469_310_105_683_1, 0.478_628_670_499_366_5),
    (0.906_179_845_938_664, 0.236_926_885_056_189_1),
];

/// Returns the integral of a function from `from` to `to` in `cells` equal parts.
fn integrate(from: f64, to: f64, cells: usize, value: impl Fn(f64) -> f64) -> f64 {
    let half = (to - from) / (2.0 * cells as f64);
    let cell = |i: usize| {
        let centre = from + half * (2 * i + 1) as f64;
        FIVE_POINTS.iter().map(|(node, weight)| weight * value(centre + half * node)).sum::<f64>() * half
    };
    (0..cells).map(cell).sum()
}

/// A Gaussian that is round in the sky: exp(-theta^2 / (2 sigma^2)) divided by its integral over the sphere, cut off at
/// seven standard deviations (beyond which lies 2e-11 of the light).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gaussian {
    sigma_rad: f64,
    radius_rad: f64,
    peak_per_sr: f64,
}

impl Gaussian {
    /// Creates a Gaussian of standard deviation `sigma_rad`, which must be more than 0 and at most 1 rad.
    ///
    /// # Errors
    /// [`PointSpreadError::Width`] for other widths.
    pub fn new(sigma_rad: f64) -> Result<Self, PointSpreadError> {
        let sigma_rad = width("standard deviation", sigma_rad, 1.0)?;
        let radius_rad = (7.0 * sigma_rad).min(PI);
        let density = |theta: f64| (-0.5 * (theta / sigma_rad).powi(2)).exp() * theta.sin();
        let integral = TAU * integrate(0.0, radius_rad, 56, density);
        Ok(Self { sigma_rad, radius_rad, peak_per_sr: 1.0 / integral })
    }

    /// Returns the fraction of the light per steradian at the centre: 1 / (2 pi sigma^2) for small sigma.
    pub fn peak_per_sr(&self) -> f64 {
        self.peak_per_sr
    }
}

impl PointSpread for Gaussian {
    fn per_sr(&self, offset_rad: DVec2) -> [f64; 3] {
        let square = offset_rad.length_squared();
        if square > self.radius_rad * self.radius_rad {
            return [0.0; 3];
        }
        [self.peak_per_sr * (-0.5 * square / (self.sigma_rad * self.sigma_rad)).exp(); 3]
    }

    fn radius_rad(&self) -> f64 {
        self.radius_rad
    }

    fn detail_rad(&self) -> f64 {
        self.sigma_rad
    }
}

/// A table over the angle from the star, interpolated linearly.
#[derive(Clone, Debug, PartialEq)]
pub struct RadialTable {
    step_rad: f64,
    per_sr: Vec<[f64; 3]>,
}

impl RadialTable {
    /// Creates a table of relative values at 0, `step_rad`, 2 `step_rad` and so on. Beyond the last value there is no light. Each channel is
    /// normalised.
    ///
    /// # Errors
    /// See [`PointSpreadError`].
    pub fn new(step_rad: f64, mut values: Vec<[f64; 3]>) -> Result<Self, PointSpreadError> {
        if values.len() < 2 {
            return Err(PointSpreadError::Count { given: values.len(), needed: "at least 2".to_owned() });
        }
        let cells = values.len() - 1;
        width("step of the table", step_rad, PI / cells as f64)?;
        let integrals = [0, 1, 2].map(|channel| {
            let segment = |i: usize| {
                let (from, to) = (values[i][channel], values[i + 1][channel]);
                let start = i as f64 * step_rad;
                let value = |theta: f64| (from + (to - from) * (theta - start) / step_rad) * theta.sin();
                integrate(start, start + step_rad, 1, value)
            };
            TAU * (0..cells).map(segment).sum::<f64>()
        });
        normalise(&mut values, integrals)?;
        Ok(Self { step_rad, per_sr: values })
    }
}

impl PointSpread for RadialTable {
    fn per_sr(&self, offset_rad: DVec2) -> [f64; 3] {
        let place = offset_rad.length() / self.step_rad;
        let index = place as usize;
        let Some([from, to]) = self.per_sr.get(index..).and_then(|rest| rest.first_chunk::<2>()) else {
            return [0.0; 3];
        };
        [0, 1, 2].map(|c| from[c] + (to[c] - from[c]) * (place - index as f64))
    }

    fn radius_rad(&self) -> f64 {
        (self.per_sr.len() - 1) as f64 * self.step_rad
    }

    fn detail_rad(&self) -> f64 {
        self.step_rad
    }
}

/// A picture of a star, row by row from the top, centred on the star. It is bilinear between texel centres, and black outside of them.
#[derive(Clone, Debug, PartialEq)]
pub struct ImageTable {
    size: [usize; 2],
    texel_rad: f64,
    per_sr: Vec<[f64; 3]>,
}

impl ImageTable {
    /// Creates a table of `size` (width, height) relative values. Its texels are `texel_rad` wide and high. Each channel is normalised.
    ///
    /// # Errors
    /// See [`PointSpreadError`].
    pub fn new(size: [usize; 2], texel_rad: f64, mut values: Vec<[f64; 3]>) -> Result<Self, PointSpreadError> {
        let [columns, rows] = size;
        if columns < 2 || rows < 2 || columns.checked_mul(rows) != Some(values.len()) {
            let needed = format!("{columns} x {rows}, at least 2 x 2");
            return Err(PointSpreadError::Count { given: values.len(), needed });
        }
        let half_diagonal = ((columns - 1) as f64).hypot((rows - 1) as f64) / 2.0;
        width("texel of the table", texel_rad, PI / half_diagonal)?;
        let table = Self { size, texel_rad, per_sr: std::mem::take(&mut values) };
        let middle = DVec2::new(columns as f64 - 1.0, rows as f64 - 1.0) / 2.0;
        let mut integrals = [0.0; 3];
        for row in 0..rows - 1 {
            for column in 0..columns - 1 {
                for (v, weight_v) in FIVE_POINTS {
                    for (u, weight_u) in FIVE_POINTS {
                        let place = DVec2::new(column as f64 + 0.5 + u / 2.0, row as f64 + 0.5 + v / 2.0);
                        let theta = (place - middle).length() * texel_rad;
                        // Area on the sphere divided by area of the tangent plane.
                        let sinc = if theta > 0.0 { theta.sin() / theta } else { 1.0 };
                        let weight = weight_u * weight_v * sinc * (texel_rad / 2.0).powi(2);
                        for (sum, value) in integrals.iter_mut().zip(table.value_at(place)) {
                            *sum += weight * value;
                        }
                    }
                }
            }
        }
        let mut table = table;
        normalise(&mut table.per_sr, integrals)?;
        Ok(table)
    }

    /// Returns the value at a position in units of texels. (0, 0) is the centre of the upper left texel.
    fn value_at(&self, place: DVec2) -> [f64; 3] {
        let [columns, rows] = self.size.map(|side| (side - 1) as f64);
        if !(0.0..=columns).contains(&place.x) || !(0.0..=rows).contains(&place.y) {
            return [0.0; 3];
        }
        let (x, y) = ((place.x as usize).min(self.size[0] - 2), (place.y as usize).min(self.size[1] - 2));
        let (fx, fy) = (place.x - x as f64, place.y - y as f64);
        let value = |dx: usize, dy: usize, c: usize| self.per_sr[(y + dy) * self.size[0] + x + dx][c];
        [0, 1, 2].map(|c| {
            let [top, bottom] = [0, 1].map(|dy| value(0, dy, c) * (1.0 - fx) + value(1, dy, c) * fx);
            top * (1.0 - fy) + bottom * fy
        })
    }
}

impl PointSpread for ImageTable {
    fn per_sr(&self, offset_rad: DVec2) -> [f64; 3] {
        let middle = DVec2::new(self.size[0] as f64 - 1.0, self.size[1] as f64 - 1.0) / 2.0;
        self.value_at(middle + DVec2::new(offset_rad.x, -offset_rad.y) / self.texel_rad)
    }

    fn radius_rad(&self) -> f64 {
        ((self.size[0] - 1) as f64).hypot((self.size[1] - 1) as f64) / 2.0 * self.texel_rad
    }

    fn detail_rad(&self) -> f64 {
        self.texel_rad
    }
}

fn normalise(values: &mut [[f64; 3]], integrals: [f64; 3]) -> Result<(), PointSpreadError> {
    for (channel, integral) in integrals.into_iter().enumerate() {
        let fine = values.iter().all(|value| value[channel].is_finite() && value[channel] >= 0.0);
        if !fine || integral.is_nan() || integral <= 0.0 {
            return Err(PointSpreadError::NoLight { channel });
        }
        for value in values.iter_mut() {
            value[channel] /= integral;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_narrow_gaussian_has_the_peak_of_the_plane() {
        let narrow = Gaussian::new(1e-4).unwrap();
        assert!((narrow.peak_per_sr() * TAU * 1e-8 - 1.0).abs() < 1e-8, "{}", narrow.peak_per_sr());
        // On the sphere the rings are smaller, by the factor 1 - sigma^2 / 3 to the next order.
        let wide = Gaussian::new(0.1).unwrap();
        let integral = 0.01 * (1.0 - 0.01 / 3.0 + 0.0001 / 15.0);
        assert!((wide.peak_per_sr() * TAU * integral - 1.0).abs() < 1e-7, "{}", wide.peak_per_sr());
        for wrong in [0.0, -1.0, f64::NAN, 2.0] {
            assert!(matches!(Gaussian::new(wrong), Err(PointSpreadError::Width { .. })), "{wrong}");
        }
    }

    /// A cap: constant up to 0.1 rad, so the value is the inverse of the cap's solid angle.
    #[test]
    fn tables_reproduce_their_values() {
        let cap = RadialTable::new(1e-4, (0..=1000).map(|_| [2.0, 4.0, 1.0]).collect()).unwrap();
        let omega = TAU * (1.0 - 0.1_f64.cos());
        let inside = cap.per_sr(DVec2::new(0.05, 0.01));
        assert!(inside.iter().all(|v| (v * omega - 1.0).abs() < 1e-9), "{inside:?}");
        assert_eq!(cap.per_sr(DVec2::new(0.2, 0.0)), [0.0; 3]);
        let line = RadialTable::new(0.5, vec![[1.0; 3], [0.0; 3]]).unwrap();
        let [at_half, at_0] = [0.25, 0.0].map(|x| line.per_sr(DVec2::new(x, 0.0))[1]);
        assert!((at_half / at_0 - 0.5).abs() < 1e-12);

        // Brighter at the upper right.
        let mut values = vec![[1.0; 3]; 9];
        values[2] = [3.0; 3];
        let image = ImageTable::new([3, 3], 1e-3, values).unwrap();
        let [corner, middle] = [DVec2::splat(1e-3), DVec2::ZERO].map(|at| image.per_sr(at)[0]);
        assert!((corner / middle - 3.0).abs() < 1e-9, "{corner} {middle}");
        // There are four cells; the mean of the one at the corner is 1.5.
        assert!((middle * 4.5e-6 - 1.0).abs() < 1e-6, "{middle}");
        assert_eq!(image.per_sr(DVec2::new(1.1e-3, 0.0)), [0.0; 3]);
    }

    #[test]
    fn tables_without_light_or_of_the_wrong_size_are_refused() {
        assert!(matches!(RadialTable::new(0.1, vec![[1.0; 3]]), Err(PointSpreadError::Count { .. })));
        assert!(matches!(RadialTable::new(9.0, vec![[1.0; 3]; 2]), Err(PointSpreadError::Width { .. })));
        let dark = vec![[1.0, 0.0, 1.0]; 4];
        assert_eq!(RadialTable::new(0.1, dark.clone()), Err(PointSpreadError::NoLight { channel: 1 }));
        assert_eq!(ImageTable::new([2, 2], 0.1, dark), Err(PointSpreadError::NoLight { channel: 1 }));
        assert!(matches!(ImageTable::new([2, 3], 0.1, vec![[1.0; 3]; 4]), Err(PointSpreadError::Count { .. })));
        assert!(ImageTable::new([2, 2], 0.1, vec![[1.0, f64::NAN, 1.0]; 4]).is_err());
    }
}
