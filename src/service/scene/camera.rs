//! Camera changes as clients request them.

use crate::{
    observer::Frame,
    scene::{Camera, PoseError},
};

/// Changes of a camera; `None` keeps a value.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CameraUpdate {
    /// ICRS barycentric position, m.
    pub position_m: Option<[f64; 3]>,
    /// Camera axes to world axes, unit quaternion x, y, z, w.
    pub orientation: Option<[f64; 4]>,
    /// Velocity in units of the speed of light, world axes; at most 0.9999 long.
    pub velocity_c: Option<[f64; 3]>,
    /// Reference frame of the axes.
    pub frame: Option<Frame>,
}

impl CameraUpdate {
    /// Returns the camera after this change of `old`.
    pub(crate) fn applied_to(&self, old: &Camera) -> Result<Camera, PoseError> {
        let moved = Camera::new(
            self.position_m.unwrap_or(old.position_m.to_array()),
            self.orientation.unwrap_or(old.world_from_camera.to_array()),
            self.velocity_c.unwrap_or(old.velocity_c.to_array()),
        )?;
        Ok(Camera { frame: self.frame.unwrap_or(old.frame), as_of_s: old.as_of_s, ..moved })
    }
}
