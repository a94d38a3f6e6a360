//! Interface between a headset and its host: the daemon, or the program itself.

use std::{sync::Arc, time::SystemTime};

use glam::{DQuat, DVec3};

use super::statistics::HeadsetStatistics;
use crate::{
    plan::settings::RenderSettings,
    render::{Frame, Wanted},
    scene::{Camera, PoseError, SceneSnapshot},
};

/// Scene that a headset shows now.
#[derive(Clone, Debug)]
pub struct Shown {
    /// Scene with the newest camera. The camera is the room's origin in the scene.
    pub snapshot: SceneSnapshot,
    /// Settings of the renderer.
    pub settings: RenderSettings,
    /// Time at which the camera was set.
    pub camera_time: SystemTime,
}

/// Movement of the camera by the controllers between two frames.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Flight {
    /// Translation, world axes, m.
    pub translation_m: DVec3,
    /// Rotation in world axes, applied after that of the camera: unit quaternion.
    pub rotation: DQuat,
}

impl Flight {
    /// Returns the camera after the flight, with the next revision.
    ///
    /// # Errors
    ///
    /// The new position is out of range.
    pub fn moved(&self, camera: &Camera) -> Result<Camera, PoseError> {
        let position_m = camera.position_m + self.translation_m;
        let orientation = (self.rotation * camera.world_from_camera).normalize();
        let moved = Camera::new(position_m.to_array(), orientation.to_array(), camera.velocity_c.to_array())?;
        Ok(Camera { revision: camera.revision + 1, ..moved })
    }
}

/// Images of the eyes in one frame, for clients.
#[derive(Clone, Debug)]
pub struct MirroredFrame {
    /// The frame: its one view has the images of the left and the right eye that [`Host::mirror`] requested.
    pub frame: Arc<Frame>,
    /// Camera, which is the origin of the room.
    pub camera: Camera,
    /// Time at which the poses of the eyes were queried.
    pub pose_time: SystemTime,
    /// Time at which the frame was finished.
    pub render_time: SystemTime,
}

/// Status of the headset.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Status {
    /// There is no session.
    Disconnected {
        /// Result of the last attempt.
        reason: String,
        /// Whether another attempt will be made.
        retrying: bool,
    },
    /// There is a session.
    Connected {
        /// Name and version of the runtime.
        runtime: String,
        /// Name of the system, reported by the runtime.
        system: String,
        /// State of the session: `idle`, `ready`, `synchronized`, `visible`, `focused`, `stopping` ...
        state: &'static str,
        /// Width and height of each eye's image, pixels: left, right.
        sizes: [[u32; 2]; 2],
        /// Adapter chosen by the runtime.
        adapter: String,
        /// Reason why frames are currently left out.
        problem: Option<String>,
    },
}

/// Host of a headset. Its methods must not block, because they are called in every frame.
pub trait Host: Send + Sync {
    /// Returns the scene to show; `None` ends the headset.
    fn shown(&self) -> Option<Shown>;

    /// Moves the camera.
    fn fly(&self, flight: &Flight);

    /// Returns the images of the next frame that are to be read back from the GPU.
    fn mirror(&self) -> Wanted;

    /// Receives a finished frame with the images requested by [`Host::mirror`].
    fn publish(&self, frame: MirroredFrame);

    /// Receives the status after each change.
    fn status(&self, status: Status);

    /// Receives the statistics so far after each frame.
    fn statistics(&self, statistics: &HeadsetStatistics);
}
