//! Glare: how light scattered in the eye or the lens falls off with the angle from its source.
//!
//! A kernel is a function of the angle between two directions only. Its integral over the sphere is 1; the share of
//! the light that is scattered is a separate number. Units: radians, 1/sr.
//!
//! `inverse_square` has a closed integral; `gaussians`, `cie` and `psf` are shapes that `normalised` integrates.
//! `split` divides a kernel into a smooth part and one that ends at an angle.

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

/// Fall-off of scattered light with the angle theta from the source.
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

named!(GlareKernelName {
    InverseSquare = "inverse_square",
    Gaussians = "gaussians",
    Cie = "cie",
    Psf = "psf",
});

/// A kernel of glare.
pub trait GlareKernel: Send + Sync {
    /// Density per steradian at an angle from 0 to pi, 1/sr. The integral over the sphere is 1.
    fn per_sr(&self, angle_rad: f64) -> f64;

    /// Share of the light that falls within an angle of its source.
    fn share_within(&self, angle_rad: f64) -> f64;

    /// Angle below which the kernel is practically constant, rad.
    fn inner_rad(&self) -> f64;
}

/// Errors from making a kernel.
#[derive(Debug, thiserror::Error)]
pub enum GlareKernelError {
    /// The kernel `psf` has no file.
    #[error(
        "psf_file: missing; the kernel `psf` requires a CSV file with the columns theta_deg,per_sr, an OpenEXR or a FITS file"
    )]
    NoFile,
    /// A table cannot be read.
    #[error("cannot read {}: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// The system's error.
        source: io::Error,
    },
    /// A line of a table is invalid.
    #[error("{}:{line}: {problem}", path.display())]
    Row {
        /// The file.
        path: PathBuf,
        /// Line, from 1.
        line: usize,
        /// Description of the problem and of valid lines.
        problem: String,
    },
    /// A table as a whole is not usable.
    #[error("{}: {problem}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// Description of the problem and of a valid table.
        problem: String,
    },
    /// The inner angle covers the whole table.
    #[error("inner_deg = {inner_deg}: must be less than {last_deg}, where {} ends", path.display())]
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
