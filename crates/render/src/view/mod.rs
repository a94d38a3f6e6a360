//! Views: projections, poses, and the flat list of viewports that a frame renders.

pub mod projection;
pub mod projector;
mod rig;

pub use rig::{
    Eye, Fov, MAX_EYE_OFFSET_M, Packing, Part, Rig, RigError, View, ViewImage, ViewKind, ViewPicture, Viewport,
    check_name,
};
