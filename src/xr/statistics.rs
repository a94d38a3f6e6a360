//! Statistics of a headset: age of its poses, missed frames, and time of each stage. `recorder` collects them.

use serde::Serialize;

/// Distribution of a time over the last frames, ms.
#[derive(Clone, Copy, Debug, PartialEq, Default, Serialize)]
pub struct Distribution {
    /// Median.
    pub median_ms: f64,
    /// 95th percentile.
    pub p95_ms: f64,
    /// Maximum.
    pub max_ms: f64,
}

/// Statistics of a headset since the daemon started; times cover the last 300 rendered frames.
#[derive(Clone, Debug, PartialEq, Default, Serialize)]
pub struct HeadsetStatistics {
    /// Number of sessions.
    pub sessions: u64,
    /// Number of losses of the runtime or its session.
    pub losses: u64,
    /// Frames requested by the runtime.
    pub frames: u64,
    /// Frames rendered and submitted.
    pub rendered: u64,
    /// Frames that the runtime did not want to be rendered.
    pub not_wanted: u64,
    /// Wanted frames that could not be drawn: see [`Status::Connected::problem`](super::Status).
    pub left_out: u64,
    /// Refreshes of the display without a new frame, between two wanted frames.
    pub missed: u64,
    /// Number of moves of the room's origin.
    pub recentred: u64,
    /// Time between refreshes of the display, as reported by the runtime, ms.
    pub period_ms: f64,
    /// Time from the query of the pose to the submission of the frame's commands.
    pub pose_age_at_submission: Distribution,
    /// Time from the query of the pose to the expected display of the frame; `None` if the runtime's clock cannot be
    /// read.
    pub pose_age_at_display: Option<Distribution>,
    /// Time of each stage of a frame with its name, in order. The last one is the GPU's time if the adapter has timestamps.
    pub stages: Vec<(&'static str, Distribution)>,
}
