//! The daemon's service over a real socket, with a small engine instead of the renderer.

#![allow(clippy::unwrap_used, reason = "a test may panic on unexpected values")]

use testkit::exr_file;
use testkit::spk;

mod access;
mod calls;
mod camera;
mod clock;
mod daemon;
mod headset;
mod hostile;
mod lifecycle;
mod objects;
mod overlay;
mod page;
mod protocol;
mod pull;
mod quality;
mod refusals;
mod rig;
mod scene;
mod sky;
mod starting;
mod state;
mod streams;
mod verify;
mod video;
mod views;
