//! The headset: an OpenXR session whose eyes are ordinary views.
//!
//! ```text
//! runtime  --display time, poses, fields of view-->  headset thread  -->  Rig  -->  Renderer  -->  swapchain images
//! host (scene, camera)  -->  headset thread  --flight, mirrored frames, statistics-->  host
//! ```
//!
//! The thread owns a separate device, created by the runtime: a headset and the other views of a daemon neither wait
//! for each other nor fail together, and the runtime may choose another adapter.
//!
//! `drive` connects, shows frames until the [`Host`] ends it, and reconnects when the runtime was lost. `Headset` is
//! one connection, controlled step by step. Both need the feature `xr`; without it this module contains only the types
//! with which the service describes a headset.

#[cfg(feature = "xr")]
mod capture;
#[cfg(feature = "xr")]
mod drive;
#[cfg(feature = "xr")]
mod error;
#[cfg(feature = "xr")]
mod eyes;
#[cfg(feature = "xr")]
mod flight;
#[cfg(feature = "xr")]
mod headset;
mod host;
#[cfg(feature = "xr")]
mod input;
#[cfg(feature = "xr")]
mod recorder;
#[cfg(feature = "xr")]
mod runtime;
mod statistics;
#[cfg(feature = "xr")]
mod swapchain;

#[cfg(feature = "xr")]
pub use self::{
    capture::{CapturedImage, CapturedPixels},
    drive::{FirstFailure, drive},
    error::XrError,
    headset::{Headset, HeadsetFrame, Step},
    recorder::Recorder,
    runtime::{check_set_up, loader},
};
pub use self::{
    host::{Flight, Host, MirroredFrame, Shown, Status},
    statistics::{Distribution, HeadsetStatistics},
};
