//! Glare: how light that is scattered in the eye or the lens falls off with the angle from its source.
//!
//! A kernel is a function of the angle between two directions and of nothing else. Its integral over the sphere is 1: what
//! share of the light is scattered at all is another number. Units: radians, 1/sr.

mod inverse_square;

use serde::{Deserialize, Serialize};

pub use self::inverse_square::InverseSquareKernel;

/// How scattered light falls off with the angle.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize, Default)]
#[serde(rename_all = "snake_case")]
pub enum GlareKernelName {
    /// Inverse square of the angle.
    #[default]
    InverseSquare,
    /// Sum of Gaussians.
    Gaussians,
    /// CIE general disability glare.
    Cie,
    /// A given table.
    Psf,
}

/// A kernel of glare.
pub trait GlareKernel: Send + Sync {
    /// Density per steradian at an angle from 0 to pi, 1/sr. The integral over the sphere is 1.
    fn per_sr(&self, angle_rad: f64) -> f64;

    /// Share of the light that falls within an angle of its source.
    fn share_within(&self, angle_rad: f64) -> f64;

    /// Angle below which the kernel is as good as constant, rad.
    fn inner_rad(&self) -> f64;
}
