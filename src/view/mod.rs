//! Views: projections, poses, and the flat list of viewports that a frame renders.

mod blend;
pub mod projection;
mod rig;

pub use blend::{Blend, BlendError, Weights};
pub use rig::{Eye, Fov, MAX_EYE_OFFSET_M, Part, Rig, RigError, View, ViewImage, ViewKind, Viewport, check_name};
