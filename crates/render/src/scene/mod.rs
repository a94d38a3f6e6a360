//! The scene: an immutable snapshot with a revision. All views of a frame show the same snapshot.

pub mod asteroids;
pub mod bodies;
mod clock;
pub mod landscape;
pub mod loader;
mod objects;
pub mod overlay;
mod seen_stars;
pub mod surroundings;

use std::sync::Arc;

use glam::{DQuat, DVec3};

pub use self::{
    clock::{EndNotice, SceneClock},
    objects::SceneObjects,
    seen_stars::SeenStars,
};
use crate::{catalogue::chunks::StarSet, observer::Frame, relativity::MAX_SPEED_C};

/// Reasons why a pose is refused.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PoseError {
    /// A component is NaN or infinite.
    #[error("{key} = {value:?}: every component must be a finite number")]
    NotFinite {
        /// The part of the pose.
        key: &'static str,
        /// Its components.
        value: Vec<f64>,
    },
    /// A position is farther from the barycentre than bodies can be.
    #[error("position_m = {value:?}: components must be at most {:e} m", bodies::FARTHEST_M)]
    TooFar {
        /// The position.
        value: [f64; 3],
    },
    /// The length of the quaternion is off by more than 1e-3.
    #[error(
        "{key} = {value:?}: must be a unit quaternion (x, y, z, w), but its length is {length}; a length within 1e-3 of 1 is normalised"
    )]
    NotUnit {
        /// The part of the pose.
        key: &'static str,
        /// The components x, y, z, w.
        value: [f64; 4],
        /// Their length.
        length: f64,
    },
    /// The speed is too close to the speed of light, or above it.
    #[error("velocity_c = {value:?}: the speed is {speed} of the speed of light: must be between 0 and {MAX_SPEED_C}")]
    TooFast {
        /// The velocity.
        value: [f64; 3],
        /// Its length.
        speed: f64,
    },
}

/// Checks that all components of a vector are finite.
pub fn finite_vector(key: &'static str, value: [f64; 3]) -> Result<DVec3, PoseError> {
    if value.iter().all(|v| v.is_finite()) {
        Ok(DVec3::from_array(value))
    } else {
        Err(PoseError::NotFinite { key, value: value.to_vec() })
    }
}

/// Builds a unit quaternion from (x, y, z, w). It is normalised if its length is within 1e-3 of 1; otherwise it is refused.
pub fn unit_quaternion(value: [f64; 4]) -> Result<DQuat, PoseError> {
    named_unit_quaternion("orientation", value)
}

/// The same for a value with another key.
pub fn named_unit_quaternion(key: &'static str, value: [f64; 4]) -> Result<DQuat, PoseError> {
    if !value.iter().all(|v| v.is_finite()) {
        return Err(PoseError::NotFinite { key, value: value.to_vec() });
    }
    let quaternion = DQuat::from_array(value);
    let length = quaternion.length();
    if (length - 1.0).abs() > 1e-3 {
        return Err(PoseError::NotUnit { key, value, length });
    }
    Ok(quaternion.normalize())
}

/// Position, orientation and velocity of the rig.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// ICRS barycentric position, m.
    pub position_m: DVec3,
    /// Rotation from camera axes to world axes.
    pub world_from_camera: DQuat,
    /// Velocity in units of the speed of light, world axes; its length is at most [`MAX_SPEED_C`].
    pub velocity_c: DVec3,
    /// The frame of reference. The camera rotates with it as time advances.
    pub frame: Frame,
    /// The time for which the orientation holds, s since 2000-01-01T12:00:00Z; only relevant in rotating frames.
    pub as_of_s: f64,
    /// Counts the changes of the camera.
    pub revision: u64,
}

impl Default for Camera {
    fn default() -> Self {
        Self {
            position_m: DVec3::ZERO,
            world_from_camera: DQuat::IDENTITY,
            velocity_c: DVec3::ZERO,
            frame: Frame::Icrs,
            as_of_s: 0.0,
            revision: 0,
        }
    }
}

impl Camera {
    /// A camera from plain numbers, as in configurations and client requests.
    pub fn new(position_m: [f64; 3], orientation: [f64; 4], velocity_c: [f64; 3]) -> Result<Self, PoseError> {
        let velocity = finite_vector("velocity_c", velocity_c)?;
        let speed = velocity.length();
        if speed > MAX_SPEED_C {
            return Err(PoseError::TooFast { value: velocity_c, speed });
        }
        let position = finite_vector("position_m", position_m)?;
        if position.abs().max_element() > bodies::FARTHEST_M {
            return Err(PoseError::TooFar { value: position_m });
        }
        Ok(Self {
            position_m: position,
            world_from_camera: unit_quaternion(orientation)?,
            velocity_c: velocity,
            frame: Frame::Icrs,
            as_of_s: 0.0,
            revision: 0,
        })
    }
}

/// Everything a frame shows.
#[derive(Clone, Debug)]
pub struct SceneSnapshot {
    /// Counts the changes of the scene, excluding those of the camera.
    pub revision: u64,
    /// All stars.
    pub stars: Arc<StarSet>,
    /// Bodies and asteroids.
    pub objects: Arc<SceneObjects>,
    /// The camera.
    pub camera: Camera,
}

impl SceneSnapshot {
    /// A scene of stars only, seen from the Solar System's barycentre along the axes of ICRS.
    pub fn of_stars(stars: StarSet) -> Self {
        Self { revision: 1, stars: Arc::new(stars), objects: Arc::default(), camera: Camera::default() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn invalid_poses_are_refused_and_nearly_unit_quaternions_normalised() {
        assert!(matches!(
            Camera::new([f64::NAN, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0], [0.0; 3]),
            Err(PoseError::NotFinite { .. })
        ));
        assert!(matches!(Camera::new([0.0; 3], [0.0, 0.0, 0.0, 1.1], [0.0; 3]), Err(PoseError::NotUnit { .. })));
        assert!(matches!(Camera::new([0.0; 3], [0.0; 4], [0.0; 3]), Err(PoseError::NotUnit { .. })));
        assert!(matches!(Camera::new([0.0; 3], [0.0, 0.0, 0.0, 1.0], [0.6, 0.8, 0.0]), Err(PoseError::TooFast { .. })));
        let moving = |velocity: [f64; 3]| Camera::new([0.0; 3], [0.0, 0.0, 0.0, 1.0], velocity);
        for speed in [0.99991, 1.0, 2.0, 1e300] {
            let message = moving([0.0, 0.0, -speed]).unwrap_err().to_string();
            assert!(message.contains("velocity_c") && message.contains("between 0 and 0.9999"), "{message}");
        }
        assert!(matches!(moving([0.0, f64::NAN, 0.0]), Err(PoseError::NotFinite { key: "velocity_c", .. })));
        assert_eq!(moving([0.0, MAX_SPEED_C, 0.0]).unwrap().velocity_c, DVec3::Y * MAX_SPEED_C);
        let camera = Camera::new([0.0; 3], [0.0, 0.0, 0.0, 1.0009], [0.0; 3]).unwrap();
        assert_eq!(camera.world_from_camera, DQuat::IDENTITY);
    }
}
