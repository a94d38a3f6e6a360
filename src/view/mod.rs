//! Views: projections, poses, and the flat list of viewports that a frame renders.

pub mod projection;
mod rig;

pub use rig::{Eye, Fov, Part, Rig, RigError, View, ViewImage, ViewKind, Viewport, check_name};
