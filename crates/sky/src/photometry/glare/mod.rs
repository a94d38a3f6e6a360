//! Glare: how light that is scattered in the eye or the lens falls off with the angle from its source.
//!
//! A kernel is a function of the angle between two directions and of nothing else. Its integral over the sphere is 1: what
//! share of the light is scattered at all is another number. Units: radians, 1/sr.
//!
//! `inverse_square` has its integral in closed form; `gaussians`, `cie` and `psf` are forms that `normalised` integrates. `split` divides
//! a kernel into what is smooth and what ends at an angle.

mod cie;
mod gaussians;
mod inverse_square;
mod normalised;
mod psf;
pub mod split;

use std::io;
use std::path::PathBuf;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use self::{
    cie::{Cie, EyeColour},
    gaussians::Gaussians,
    inverse_square::InverseSquareKernel,
    normalised::{Normalised, Shape},
    psf::PsfTable,
};
use super::psf::PsfError;

/// How scattered light falls off with the angle theta from the source.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize, Default, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum GlareKernelName {
    /// theta^-2.
    #[default]
    InverseSquare,
    /// The sum of Gaussians of "Smaller than Pixels".
    Gaussians,
    /// CIE 135/1 general disability glare equation, valid from 0.1 to 100 degrees.
    Cie,
    /// A table or image from `psf_file`.
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

/// Why there is no kernel.
#[derive(Debug, thiserror::Error)]
pub enum GlareKernelError {
    /// The kernel `psf` without a file.
    #[error(
        "psf_file: missing; the kernel `psf` needs a CSV file with the columns theta_deg,per_sr, an OpenEXR or a FITS file"
    )]
    NoFile,
    /// A table cannot be read.
    #[error("cannot read {}: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// A line of a table is not what it must be.
    #[error("{}:{line}: {problem}", path.display())]
    Row {
        /// The file.
        path: PathBuf,
        /// Line, from 1.
        line: usize,
        /// What is wrong and what is allowed.
        problem: String,
    },
    /// A table as a whole is not usable.
    #[error("{}: {problem}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What is wrong and what is needed.
        problem: String,
    },
    /// The inner angle leaves nothing of a table.
    #[error("inner_deg = {inner_deg}: allowed is less than {last_deg}, where {} ends", path.display())]
    Inner {
        /// The file.
        path: PathBuf,
        /// The inner angle, degrees.
        inner_deg: f64,
        /// The last angle of the file, degrees.
        last_deg: f64,
    },
    /// A point-spread function is not usable.
    #[error(transparent)]
    Psf(#[from] PsfError),
    /// The integral of a form is not a positive number.
    #[error("the kernel `{0:?}` has no integral")]
    NoIntegral(GlareKernelName),
}
