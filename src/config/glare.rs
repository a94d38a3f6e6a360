//! `[glare]`: light scattered in the eye or the lens.

use serde::Deserialize;

use super::error::{Fault, finite};
use crate::plan::settings::GlareMethod;

/// How scattered light falls off with the angle.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Default)]
#[serde(rename_all = "snake_case")]
pub enum GlareKernel {
    /// Inverse square of the angle.
    #[default]
    InverseSquare,
    /// Sum of Gaussians.
    Gaussians,
    /// CIE general disability glare.
    Cie,
    /// A given point-spread function.
    Psf,
}

/// `[glare]`. `kernel`, `inner_deg` and `fraction` are checked here and take effect together with a glare method; `none`,
/// and `auto` as long as there is no method to choose, scatter no light.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct GlareConfig {
    /// The method.
    pub method: GlareMethod,
    /// The kernel.
    pub kernel: GlareKernel,
    /// Angle below which the kernel stays constant, degrees.
    pub inner_deg: f64,
    /// Share of the light that is scattered.
    pub fraction: f64,
}

impl Default for GlareConfig {
    fn default() -> Self {
        Self { method: GlareMethod::Auto, kernel: GlareKernel::InverseSquare, inner_deg: 0.1, fraction: 0.1 }
    }
}

impl GlareConfig {
    pub(super) fn check(&self) -> Result<(), Fault> {
        finite("inner_deg", self.inner_deg)?;
        if !(self.inner_deg > 0.0 && self.inner_deg <= 180.0) {
            return Err(Fault::new("inner_deg", format!("{}: allowed are angles above 0 up to 180", self.inner_deg)));
        }
        if !(0.0..=1.0).contains(&self.fraction) {
            return Err(Fault::new("fraction", format!("{}: allowed are shares from 0 to 1", self.fraction)));
        }
        Ok(())
    }
}
