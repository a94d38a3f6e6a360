//! Figures of a headset: how old its poses are, what is missed, and where the time goes. `recorder` collects them.

use serde::Serialize;

/// Spread of a time over the last frames, ms.
#[derive(Clone, Copy, Debug, PartialEq, Default, Serialize)]
pub struct Distribution {
    /// Half of the frames are below.
    pub median_ms: f64,
    /// Of a hundred frames five are above.
    pub p95_ms: f64,
    /// The greatest.
    pub max_ms: f64,
}

/// Figures of a headset since the daemon started; times are of the last 300 frames that were rendered.
#[derive(Clone, Debug, PartialEq, Default, Serialize)]
pub struct HeadsetStatistics {
    /// Sessions so far.
    pub sessions: u64,
    /// How often the runtime or its session was lost.
    pub losses: u64,
    /// Frames that the runtime has asked for.
    pub frames: u64,
    /// Frames rendered and handed in.
    pub rendered: u64,
    /// Frames that the runtime did not want to be rendered.
    pub not_wanted: u64,
    /// Frames that the runtime wanted and that could not be drawn: see [`Status::Connected::problem`](super::Status).
    pub left_out: u64,
    /// Refreshes of the display that no frame came for in time, between two frames that were wanted.
    pub missed: u64,
    /// How often the room's origin has moved.
    pub recentred: u64,
    /// Time between refreshes of the display as the runtime tells it, ms.
    pub period_ms: f64,
    /// From the pose's being asked for to the submission of the frame's commands.
    pub pose_age_at_submission: Distribution,
    /// From the pose's being asked for to the moment at which the runtime expects to show the frame; `None` where the
    /// runtime's clock cannot be read.
    pub pose_age_at_display: Option<Distribution>,
    /// Each stage of a frame in its order, by name, and at last the GPU's time where the adapter has timestamps.
    pub stages: Vec<(&'static str, Distribution)>,
}
