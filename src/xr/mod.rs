//! The headset: an OpenXR session whose eyes are views as all others.
//!
//! ```text
//! runtime  --display time-->  headset thread  --poses, fields of view-->  Rig  -->  Renderer  -->  swapchain images
//! host (scene, camera)  -->   headset thread  --flight, mirror frames, statistics-->  host
//! ```
//!
//! The thread owns a device of its own, which the runtime has made: a headset and the other views of a daemon neither
//! wait for each other nor fail together, and the runtime may choose another adapter.
//!
//! [`drive`] connects, shows frames until the [`Host`] ends it, and connects again when the runtime was lost.

mod host;
mod statistics;

pub use host::{Flight, Host, MirroredFrame, Shown, Status};
pub use statistics::{Distribution, HeadsetStatistics};
