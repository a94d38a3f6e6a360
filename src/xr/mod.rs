//! The headset: an OpenXR session whose eyes are views as all others.
//!
//! ```text
//! runtime  --display time, poses, fields of view-->  headset thread  -->  Rig  -->  Renderer  -->  swapchain images
//! host (scene, camera)  -->  headset thread  --flight, mirrored frames, statistics-->  host
//! ```
//!
//! The thread owns a device of its own, which the runtime has made: a headset and the other views of a daemon neither
//! wait for each other nor fail together, and the runtime may choose another adapter.
//!
//! [`drive`] connects, shows frames until the [`Host`] ends it, and connects again when the runtime was lost. [`Headset`] is
//! one connection, step by step.

mod capture;
mod drive;
mod error;
mod eyes;
mod flight;
mod headset;
mod host;
mod input;
mod runtime;
mod statistics;
mod swapchain;

pub use capture::{CapturedImage, CapturedPixels};
pub use drive::{FirstFailure, drive};
pub use error::XrError;
pub use headset::{Headset, HeadsetFrame, Step};
pub use host::{Flight, Host, MirroredFrame, Shown, Status};
pub use runtime::{check_set_up, loader};
pub use statistics::{Distribution, HeadsetStatistics, Recorder};
