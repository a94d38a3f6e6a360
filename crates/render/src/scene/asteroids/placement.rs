//! Random positions, sizes and spins of the asteroids of a field, from a seed.
//!
//! Each block of instances has its own random stream, so a field depends only on its parameters and not on the number
//! of threads. Lengths are in metres, in the field's axes, times in seconds. Asteroids may overlap.

use std::f64::consts::{PI, TAU};

use glam::{DVec3, Vec3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use super::{
    Instances,
    groups::{self, Placed},
    packed::Asteroid,
    shapes::MOST_SHAPES,
};

/// Maximum number of instances of a field.
pub const MOST_INSTANCES: u32 = 1 << 26;
/// Largest ratio of the radii of a field. At this ratio the smallest radius is 65 packing steps, so it is accurate to 0.8 %.
pub const LARGEST_RADIUS_RATIO: f64 = 1000.0;
/// Largest ratio of the spin periods of a field. A period is the base period divided by an integer: 32767 for the shortest period and at least 32 for
/// the longest, which is therefore accurate to 1.6 %.
pub const LARGEST_PERIOD_RATIO: f64 = 1000.0;
/// Steepest distribution of sizes.
pub const STEEPEST_SIZE_INDEX: f64 = 10.0;
/// Largest distance from a field's centre, m: beyond it the squares of lengths overflow f32.
pub const LARGEST_EXTENT_M: f64 = 1e18;

/// Number of instances that share a random stream.
const BLOCK: u32 = 4096;
/// Turns per base period of the shortest spin period.
const FASTEST_RATE: f64 = 32_767.0;

/// The space that asteroids fill, around the centre of the field.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Placement {
    /// Uniformly in a box.
    Box {
        /// Lengths of its sides along x, y and z, m.
        size_m: DVec3,
    },
    /// In a torus around z whose cross-section is an ellipse. With q from 0 in the middle of the ellipse to 1 on its
    /// rim, the density in space is proportional to cos^2(pi q / 2): a belt without sharp edges.
    Belt {
        /// Inner radius, m.
        inner_m: f64,
        /// Outer radius, m.
        outer_m: f64,
        /// Full height of the cross-section, m.
        height_m: f64,
    },
    /// Uniformly in a flat ring around z.
    Ring {
        /// Inner radius, m.
        inner_m: f64,
        /// Outer radius, m.
        outer_m: f64,
        /// Full thickness, m; 0 for a sheet.
        thickness_m: f64,
    },
}

/// Parameters of a random field.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FieldParameters {
    /// Number of asteroids, 1 to [`MOST_INSTANCES`].
    pub instances: u32,
    /// Seed of the random numbers.
    pub seed: u64,
    /// Their positions.
    pub placement: Placement,
    /// Smallest and largest mean radius, m.
    pub radius_m: [f64; 2],
    /// Slope of the size distribution: the number of asteroids larger than r is proportional to r^-size_index. 0:
    /// uniform in the logarithm of r.
    pub size_index: f64,
    /// Shortest and longest spin period, s. Periods are uniform in their logarithm; half of the asteroids spin
    /// backwards.
    pub spin_period_s: [f64; 2],
}

/// Reasons why a field cannot be generated.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FieldError {
    /// A parameter is out of range.
    #[error("{key} = {value}: {allowed}")]
    OutOfRange {
        /// The parameter.
        key: &'static str,
        /// Its value.
        value: String,
        /// Valid values.
        allowed: String,
    },
    /// The number of shapes is out of range.
    #[error(
        "{shapes} shapes with {bounds} bounds: a field must have 1 to {MOST_SHAPES} shapes, each with a bound of at least 1"
    )]
    Shapes {
        /// Number of shapes.
        shapes: usize,
        /// Number of bounds.
        bounds: usize,
    },
}

fn refused(key: &'static str, value: impl ToString, allowed: impl Into<String>) -> FieldError {
    FieldError::OutOfRange { key, value: value.to_string(), allowed: allowed.into() }
}

/// Checks a length: above 0, or at least 0, and at most [`LARGEST_EXTENT_M`].
fn check_length(key: &'static str, value: f64, zero_allowed: bool) -> Result<(), FieldError> {
    let above = value > 0.0 || (zero_allowed && value == 0.0);
    if above && value <= LARGEST_EXTENT_M {
        return Ok(());
    }
    let from = if zero_allowed { "0 or more" } else { "more than 0" };
    Err(refused(key, value, format!("must be {from} and at most {LARGEST_EXTENT_M:e} m")))
}

/// Smallest mean radius, m, and smallest spin period, s.
pub const LEAST_OF_RANGE: f64 = 1e-3;

/// Checks two values: the first at least [`LEAST_OF_RANGE`], the second not smaller and at most `ratio` times as large.
fn check_range(key: &'static str, [low, high]: [f64; 2], ratio: f64) -> Result<(), FieldError> {
    if low >= LEAST_OF_RANGE && low <= high && high <= LARGEST_EXTENT_M && high <= low * ratio {
        return Ok(());
    }
    let allowed = format!(
        "must be two numbers of at least {LEAST_OF_RANGE}, smallest first, the largest at most {ratio} times as large and \
         at most {LARGEST_EXTENT_M:e}"
    );
    Err(refused(key, format!("[{low}, {high}]"), allowed))
}

fn check_radii(inner: (&'static str, f64), outer: (&'static str, f64)) -> Result<(), FieldError> {
    check_length(inner.0, inner.1, true)?;
    check_length(outer.0, outer.1, false)?;
    if outer.1 <= inner.1 {
        return Err(refused(outer.0, outer.1, format!("it must be above {} = {}", inner.0, inner.1)));
    }
    Ok(())
}

impl Placement {
    /// Checks that all sizes are valid lengths.
    ///
    /// # Errors
    ///
    /// [`FieldError::OutOfRange`] with the key and the valid values.
    pub fn check(&self) -> Result<(), FieldError> {
        match *self {
            Self::Box { size_m } => {
                size_m.to_array().into_iter().try_for_each(|side| check_length("placement.size_m", side, false))
            }
            Self::Belt { inner_m, outer_m, height_m } => {
                check_radii(("placement.inner_m", inner_m), ("placement.outer_m", outer_m))?;
                check_length("placement.height_m", height_m, false)
            }
            Self::Ring { inner_m, outer_m, thickness_m } => {
                check_radii(("placement.inner_m", inner_m), ("placement.outer_m", outer_m))?;
                check_length("placement.thickness_m", thickness_m, true)
            }
        }
    }

    /// Draws a random position, m.
    fn draw(&self, rng: &mut ChaCha8Rng) -> DVec3 {
        match *self {
            Self::Box { size_m } => size_m * DVec3::from_array([0; 3].map(|_| centred(rng))),
            Self::Belt { inner_m, outer_m, height_m } => loop {
                let (q, angle) = (unit(rng).sqrt(), unit(rng) * TAU);
                let radius = 0.5 * ((inner_m + outer_m) + (outer_m - inner_m) * q * angle.cos());
                // The circumference grows with the distance from the axis.
                if unit(rng) * outer_m < radius * (0.5 * PI * q).cos().powi(2) {
                    return around_axis(radius, 0.5 * height_m * q * angle.sin(), rng);
                }
            },
            Self::Ring { inner_m, outer_m, thickness_m } => {
                let [inner, outer] = [inner_m, outer_m].map(|radius| radius * radius);
                let radius = (inner + (outer - inner) * unit(rng)).sqrt();
                let z = thickness_m * centred(rng);
                around_axis(radius.clamp(inner_m, outer_m), z, rng)
            }
        }
    }
}

/// Uniform in [0, 1).
fn unit(rng: &mut ChaCha8Rng) -> f64 {
    rng.random_range(0.0..1.0)
}

/// Uniform in [-0.5, 0.5).
fn centred(rng: &mut ChaCha8Rng) -> f64 {
    unit(rng) - 0.5
}

fn around_axis(radius: f64, z: f64, rng: &mut ChaCha8Rng) -> DVec3 {
    let (sin, cos) = (unit(rng) * TAU).sin_cos();
    DVec3::new(radius * cos, radius * sin, z)
}

impl FieldParameters {
    /// Checks all parameters.
    ///
    /// # Errors
    ///
    /// [`FieldError::OutOfRange`] with the key and the valid values.
    pub fn check(&self) -> Result<(), FieldError> {
        if self.instances == 0 || self.instances > MOST_INSTANCES {
            return Err(refused("instances", self.instances, format!("must be between 1 and {MOST_INSTANCES}")));
        }
        self.placement.check()?;
        check_range("radius_m", self.radius_m, LARGEST_RADIUS_RATIO)?;
        if !(0.0..=STEEPEST_SIZE_INDEX).contains(&self.size_index) {
            return Err(refused("size_index", self.size_index, format!("must be between 0 and {STEEPEST_SIZE_INDEX}")));
        }
        check_range("spin_period_s", self.spin_period_s, LARGEST_PERIOD_RATIO)
    }

    /// Ratio of the mean radius to the largest, for a quantile `share` from 0 (the smallest) to 1: the inverse of the cumulative distribution.
    fn radius_over_largest(&self, share: f64) -> f64 {
        let [smallest, largest] = self.radius_m;
        let ln_ratio = (largest / smallest).ln();
        let steepness = self.size_index * ln_ratio;
        // Position in the logarithm: -ln(1 - share (1 - e^-steepness)) / steepness, and its limit for zero steepness.
        let up = if steepness < 1e-9 { share } else { -(share * (-steepness).exp_m1()).ln_1p() / steepness };
        (-(1.0 - up) * ln_ratio).exp()
    }

    fn draw(&self, shapes: usize, rng: &mut ChaCha8Rng) -> Placed {
        let place_m = self.placement.draw(rng);
        let radius_over_largest = self.radius_over_largest(unit(rng));
        let [shortest, longest] = self.spin_period_s;
        let turns = (FASTEST_RATE * (shortest / longest).powf(unit(rng))).round().clamp(1.0, FASTEST_RATE) as i16;
        let z = 2.0 * centred(rng);
        let axis = around_axis((1.0 - z * z).sqrt(), z, rng);
        let asteroid = Asteroid {
            offset_m: Vec3::ZERO,
            radius_over_largest,
            shape: rng.random_range(0..shapes) as u8,
            axis,
            phase: rng.random(),
            rate: if rng.random() { turns } else { -turns },
        };
        Placed { place_m, packed: asteroid.into() }
    }
}

impl Instances {
    /// Generates the asteroids of a field and groups neighbours. `bounds` are the radii of the bounding spheres of the
    /// shapes ([`super::ShapeSet::bounds`]), mean radii.
    ///
    /// # Errors
    ///
    /// [`FieldError`] if a parameter is out of range.
    pub fn place(parameters: &FieldParameters, shapes: usize, bounds: &[f64]) -> Result<Self, FieldError> {
        parameters.check()?;
        let bounds_hold = bounds.iter().all(|bound| bound.is_finite() && *bound >= 1.0);
        if shapes == 0 || shapes > MOST_SHAPES || bounds.len() != shapes || !bounds_hold {
            return Err(FieldError::Shapes { shapes, bounds: bounds.len() });
        }
        let blocks = parameters.instances.div_ceil(BLOCK);
        let drawn: Vec<Vec<Placed>> = (0..blocks)
            .into_par_iter()
            .map(|block| {
                let mut rng = ChaCha8Rng::seed_from_u64(parameters.seed);
                rng.set_stream(u64::from(block));
                let count = BLOCK.min(parameters.instances - block * BLOCK);
                (0..count).map(|_| parameters.draw(shapes, &mut rng)).collect()
            })
            .collect();
        let largest_m = parameters.radius_m[1];
        let (packed, levels) = groups::grouped(drawn.into_iter().flatten().collect(), largest_m, bounds);
        Ok(Self { packed, levels, largest_m, base_period_s: parameters.spin_period_s[0] * FASTEST_RATE })
    }
}
