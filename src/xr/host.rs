//! Whom a headset is driven for: the daemon, or the program itself.

use std::{sync::Arc, time::SystemTime};

use glam::{DQuat, DVec3};

use super::statistics::HeadsetStatistics;
use crate::{
    plan::settings::RenderSettings,
    render::{Frame, Wanted},
    scene::{Camera, PoseError, SceneSnapshot},
};

/// What a headset is to show now.
#[derive(Clone, Debug)]
pub struct Shown {
    /// The scene, with the newest camera: the room's origin in the scene.
    pub snapshot: SceneSnapshot,
    /// How it is drawn.
    pub settings: RenderSettings,
    /// When the camera was set.
    pub camera_time: SystemTime,
}

/// How far controllers move the camera from one frame to the next.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Flight {
    /// Change of place, world axes, m.
    pub translation_m: DVec3,
    /// Rotation in world axes, to apply after the camera's own: unit length.
    pub rotation: DQuat,
}

impl Flight {
    /// A camera after the flight: one revision later.
    ///
    /// # Errors
    ///
    /// It would be at a place that is no place any more.
    pub fn moved(&self, camera: &Camera) -> Result<Camera, PoseError> {
        let position_m = camera.position_m + self.translation_m;
        let orientation = (self.rotation * camera.world_from_camera).normalize();
        let moved = Camera::new(position_m.to_array(), orientation.to_array(), camera.velocity_c.to_array())?;
        Ok(Camera { revision: camera.revision + 1, ..moved })
    }
}

/// What the eyes saw in one frame, as clients get it.
#[derive(Clone, Debug)]
pub struct MirroredFrame {
    /// The frame: its one view has the images of the left and the right eye, as far as [`Host::mirror`] wanted them.
    pub frame: Arc<Frame>,
    /// The camera: the origin of the room.
    pub camera: Camera,
    /// When the poses of the eyes were asked for.
    pub pose_time: SystemTime,
    /// When the frame was finished.
    pub render_time: SystemTime,
}

/// How it stands with the headset.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Status {
    /// There is no session.
    Disconnected {
        /// Why: what the last attempt came to.
        reason: String,
        /// Whether it is going to be tried again.
        retrying: bool,
    },
    /// There is a session.
    Connected {
        /// Name and version of the runtime.
        runtime: String,
        /// Name of the system, as the runtime tells it.
        system: String,
        /// State of the session: `idle`, `ready`, `synchronized`, `visible`, `focused`, `stopping` ...
        state: &'static str,
        /// Width and height of each eye's image, pixels: left, right.
        sizes: [[u32; 2]; 2],
        /// Adapter that the runtime has chosen.
        adapter: String,
        /// Why frames are left out, while they are.
        problem: Option<String>,
    },
}

/// Whom a headset is driven for. None of the calls may block: they are made from frame to frame.
pub trait Host: Send + Sync {
    /// What to show; `None`: the headset is to end.
    fn shown(&self) -> Option<Shown>;

    /// Moves the camera.
    fn fly(&self, flight: &Flight);

    /// Which images of the next frame are wanted back from the GPU.
    fn mirror(&self) -> Wanted;

    /// Takes a finished frame that [`Host::mirror`] wanted images of.
    fn publish(&self, frame: MirroredFrame);

    /// Takes how it stands, whenever that has changed.
    fn status(&self, status: Status);

    /// Takes the figures of the headset so far, after each frame.
    fn statistics(&self, statistics: &HeadsetStatistics);
}
