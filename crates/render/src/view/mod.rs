//! Views: projections, poses, and the flat list of viewports that a frame renders.

mod kind;
pub mod projection;
pub mod projector;
mod rig;

pub use kind::{Eye, Fov, ViewKind};
pub use rig::{MAX_EYE_OFFSET_M, Packing, Part, Rig, RigError, View, ViewImage, ViewPicture, Viewport, check_name};
