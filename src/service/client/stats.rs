//! The client's calls about statistics.

use std::time::SystemTime;

use tonic::Streaming;

use super::connection::{Client, ClientError, ViewImageForm, time};
use crate::{service::proto, windows::Intervals, xr::Distribution};

/// Status of a daemon's headset.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum HeadsetStatus {
    /// There is no session.
    Disconnected {
        /// Result of the last attempt.
        reason: String,
        /// Whether the daemon tries again.
        retrying: bool,
    },
    /// There is a session.
    Connected {
        /// Name and version of the OpenXR runtime.
        runtime: String,
        /// Name of the system, as reported by the runtime.
        system: String,
        /// Adapter that the runtime has chosen.
        adapter: String,
        /// State of the session: `idle`, `ready`, `synchronized`, `visible`, `focused`, `stopping` ...
        session_state: String,
        /// The images of the eyes.
        images: Vec<ViewImageForm>,
        /// Reason why frames are skipped, if they are.
        problem: Option<String>,
    },
}

impl From<proto::HeadsetStatus> for HeadsetStatus {
    fn from(status: proto::HeadsetStatus) -> Self {
        if status.connected {
            Self::Connected {
                runtime: status.runtime,
                system: status.system,
                adapter: status.adapter,
                session_state: status.session_state,
                images: status.images.into_iter().map(ViewImageForm::from).collect(),
                problem: Some(status.reason).filter(|reason| !reason.is_empty()),
            }
        } else {
            Self::Disconnected { reason: status.reason, retrying: status.retrying }
        }
    }
}

/// Times of a frame, ms.
#[derive(Clone, Debug, PartialEq)]
pub struct ReceivedTimes {
    /// Planning and recording on the CPU.
    pub plan_ms: f64,
    /// Culling on the CPU, part of `plan_ms`.
    pub cull_ms: f64,
    /// From submission to the end of the readback, without times in which other frames were planned or read back.
    pub gpu_and_readback_ms: f64,
    /// Sum of planning and the time above.
    pub total_ms: f64,
    /// All passes on the GPU; `None` if the adapter has no timestamps.
    pub gpu_ms: Option<f64>,
    /// Each pass on the GPU, by name; empty if the adapter has no timestamps.
    pub passes_ms: Vec<(String, f64)>,
    /// Number of buffers, bind groups and pipelines created for the frame: zero in a steady state.
    pub objects_made: u64,
}

impl From<proto::FrameTimes> for ReceivedTimes {
    fn from(times: proto::FrameTimes) -> Self {
        Self {
            plan_ms: times.plan_ms,
            cull_ms: times.cull_ms,
            gpu_and_readback_ms: times.gpu_and_readback_ms,
            total_ms: times.total_ms,
            gpu_ms: times.gpu_ms,
            passes_ms: times.passes.into_iter().map(|pass| (pass.name, pass.ms)).collect(),
            objects_made: times.objects_made,
        }
    }
}

/// Statistics of a headset since the daemon started; times are of the last 300 rendered frames.
#[derive(Clone, Debug, PartialEq)]
pub struct ReceivedHeadset {
    /// Name of its view.
    pub view: String,
    /// Status.
    pub status: HeadsetStatus,
    /// Number of sessions.
    pub sessions: u64,
    /// Number of losses of the runtime or its session.
    pub losses: u64,
    /// Frames that the runtime requested.
    pub frames: u64,
    /// Frames that were rendered and submitted.
    pub rendered: u64,
    /// Frames that the runtime did not want rendered.
    pub not_wanted: u64,
    /// Frames that the runtime requested and that could not be drawn.
    pub left_out: u64,
    /// Refreshes of the display without a frame in time, between two requested frames.
    pub missed: u64,
    /// Number of times that the room's origin moved.
    pub recentred: u64,
    /// Interval of the display's refreshes, ms.
    pub period_ms: f64,
    /// Time from the request of the poses to the submission of the frame's commands.
    pub pose_age_at_submission: Distribution,
    /// Time from the request of the poses to the predicted display of the frame; `None` if the runtime's clock cannot
    /// be read.
    pub pose_age_at_display: Option<Distribution>,
    /// Each stage of a frame in order, by name.
    pub stages: Vec<(String, Distribution)>,
}

impl From<proto::Distribution> for Distribution {
    fn from(time: proto::Distribution) -> Self {
        Self { median_ms: time.median_ms, p95_ms: time.p95_ms, max_ms: time.max_ms }
    }
}

impl TryFrom<proto::HeadsetStats> for ReceivedHeadset {
    type Error = ClientError;

    fn try_from(stats: proto::HeadsetStats) -> Result<Self, ClientError> {
        let status = stats.status.ok_or(ClientError::Answer { field: "status" })?;
        let needed = |time: Option<proto::Distribution>, field| {
            time.map(Distribution::from).ok_or(ClientError::Answer { field })
        };
        let stage = |stage: proto::StageTime| Ok((stage.name, needed(stage.time, "stages.time")?));
        Ok(Self {
            view: status.view.clone(),
            status: status.into(),
            sessions: stats.sessions,
            losses: stats.losses,
            frames: stats.frames,
            rendered: stats.rendered,
            not_wanted: stats.not_wanted,
            left_out: stats.left_out,
            missed: stats.missed,
            recentred: stats.recentred,
            period_ms: stats.period_ms,
            pose_age_at_submission: needed(stats.pose_age_at_submission, "pose_age_at_submission")?,
            pose_age_at_display: stats.pose_age_at_display.map(Distribution::from),
            stages: stats.stages.into_iter().map(stage).collect::<Result<_, ClientError>>()?,
        })
    }
}

/// Statistics of a daemon.
#[derive(Clone, Debug, PartialEq)]
pub struct ReceivedStats {
    /// Time at which they were read, by the daemon's clock.
    pub time: SystemTime,
    /// Frames of the render thread since the start, without a headset's.
    pub frames_rendered: u64,
    /// Open streams of all views.
    pub streams: u32,
    /// Frames that streams have dropped since the start.
    pub frames_dropped: u64,
    /// Times of the render thread's last frame; `None` before the first.
    pub last_frame: Option<ReceivedTimes>,
    /// The headset; `None` if the daemon drives none.
    pub headset: Option<ReceivedHeadset>,
    /// Quality level of display images; `None` without `accuracy.frame_ms`.
    pub quality: Option<ReceivedQuality>,
    /// Results of audits; `None` without `accuracy.audit`.
    pub audit: Option<ReceivedAudits>,
    /// Failed frames since the start.
    pub frames_failed: u64,
    /// Reason of the last frame's failure; empty if it succeeded.
    pub problem: String,
    /// Number of encodings of a view's images since the start.
    pub encoded: u64,
    /// Open connections.
    pub connections: u32,
    /// Requests that were refused because of a limit since the start.
    pub refused: u64,
    /// Windows on monitors of the daemon's machine.
    pub windows: Vec<ReceivedWindow>,
}

/// A window on a monitor of the daemon's machine.
#[derive(Clone, Debug, PartialEq)]
pub struct ReceivedWindow {
    /// Its name.
    pub name: String,
    /// Name of its view.
    pub view: String,
    /// Its image of the view; empty for a view's only one.
    pub part: String,
    /// `shown`, `monitor_missing`, `view_missing`, `no_display` or `closed`.
    pub state: String,
    /// Reason why it is not shown, if there is more to say; otherwise empty.
    pub reason: String,
    /// Name of its monitor; empty if unknown.
    pub monitor: String,
    /// Refresh rate of the monitor, Hz; `None` if unknown.
    pub refresh_hz: Option<f64>,
    /// Number of the displayed frame; 0: none yet.
    pub frame_number: u64,
    /// Number of displayed frames.
    pub frames: u64,
    /// Intervals between frames; `None` before the second.
    pub intervals: Option<Intervals>,
    /// Refreshes without a new frame between two frames; `None` if frames do not wait for refreshes, or the rate is
    /// unknown.
    pub missed: Option<u64>,
}

impl From<proto::WindowStats> for ReceivedWindow {
    fn from(stats: proto::WindowStats) -> Self {
        let intervals = stats.intervals.map(|proto::WindowIntervals { median_ms, p99_ms, longest_ms }| Intervals {
            median_ms,
            p99_ms,
            longest_ms,
        });
        Self {
            name: stats.name,
            view: stats.view,
            part: stats.part,
            state: stats.state,
            reason: stats.reason,
            monitor: stats.monitor,
            refresh_hz: stats.refresh_hz,
            frame_number: stats.frame_number,
            frames: stats.frames,
            intervals,
            missed: stats.missed,
        }
    }
}

/// Quality level of display images.
#[derive(Clone, Debug, PartialEq)]
pub struct ReceivedQuality {
    /// Allowed frame time, ms.
    pub frame_ms: f64,
    /// Smoothed frame time of this level, ms; `None` if unknown.
    pub smoothed_ms: Option<f64>,
    /// Level of the next frames; 0: as configured.
    pub level: u32,
    /// Descriptions of the reductions.
    pub given_up: Vec<String>,
}

/// Audits of frames since the daemon started.
#[derive(Clone, Debug, PartialEq)]
pub struct ReceivedAudits {
    /// Audited frames.
    pub frames_audited: u64,
    /// Frames that exceed an error budget.
    pub frames_broken: u64,
    /// Number of the last audited frame.
    pub last_frame_number: u64,
    /// Its images.
    pub images: Vec<ReceivedImageAudit>,
    /// Parts that were not compared, with reasons.
    pub not_audited: Vec<String>,
}

/// Errors of the sampled pixels of an image.
#[derive(Clone, Debug, PartialEq)]
pub struct ReceivedImageAudit {
    /// Name of the view.
    pub view: String,
    /// Its part of the view; empty for a view's only image.
    pub part: String,
    /// Whether it is an HDR image.
    pub hdr: bool,
    /// Number of compared pixels.
    pub pixels: u32,
    /// The 99.9th percentile of the channels' errors, and its limit.
    pub error_999: [f64; 2],
    /// The largest error, and its limit.
    pub largest: [f64; 2],
    /// Unit of the errors.
    pub unit: String,
    /// Whether both are within their limits.
    pub within_budget: bool,
    /// Column and row of the largest error.
    pub worst: [u32; 2],
}

impl From<proto::QualityStats> for ReceivedQuality {
    fn from(proto::QualityStats { frame_ms, smoothed_ms, level, given_up }: proto::QualityStats) -> Self {
        Self { frame_ms, smoothed_ms, level, given_up }
    }
}

impl From<proto::AuditStats> for ReceivedAudits {
    fn from(stats: proto::AuditStats) -> Self {
        let image = |image: proto::ImageAudit| ReceivedImageAudit {
            view: image.view,
            part: image.part,
            hdr: image.hdr,
            pixels: image.pixels,
            error_999: [image.error_999, image.budget],
            largest: [image.largest, image.most],
            unit: image.unit,
            within_budget: image.within_budget,
            worst: [image.worst_x, image.worst_y],
        };
        Self {
            frames_audited: stats.frames_audited,
            frames_broken: stats.frames_broken,
            last_frame_number: stats.last_frame_number,
            images: stats.images.into_iter().map(image).collect(),
            not_audited: stats.not_audited,
        }
    }
}

impl TryFrom<proto::Stats> for ReceivedStats {
    type Error = ClientError;

    fn try_from(stats: proto::Stats) -> Result<Self, ClientError> {
        Ok(Self {
            time: time(stats.time, "time")?,
            frames_rendered: stats.frames_rendered,
            streams: stats.streams,
            frames_dropped: stats.frames_dropped,
            last_frame: stats.last_frame.map(ReceivedTimes::from),
            headset: stats.headset.map(ReceivedHeadset::try_from).transpose()?,
            quality: stats.quality.map(ReceivedQuality::from),
            audit: stats.audit.map(ReceivedAudits::from),
            frames_failed: stats.frames_failed,
            problem: stats.problem,
            encoded: stats.encoded,
            connections: stats.connections,
            refused: stats.refused,
            windows: stats.windows.into_iter().map(ReceivedWindow::from).collect(),
        })
    }
}

/// Statistics at intervals. Dropping it ends the stream.
#[derive(Debug)]
pub struct StatsReceiver {
    stream: Streaming<proto::Stats>,
}

impl StatsReceiver {
    /// Waits for the next statistics; `None` when the daemon has ended the stream in order.
    pub async fn next(&mut self) -> Result<Option<ReceivedStats>, ClientError> {
        self.stream.message().await?.map(ReceivedStats::try_from).transpose()
    }
}

impl Client {
    /// Streams the statistics of the daemon and of its headset every `interval_s` (0.1 to 60 s; `None`: 1 s) and at
    /// each change of the headset's status.
    pub async fn watch_stats(&mut self, interval_s: Option<f64>) -> Result<StatsReceiver, ClientError> {
        let request = proto::WatchStatsRequest { interval_s };
        Ok(StatsReceiver { stream: self.diagnostics.watch_stats(request).await?.into_inner() })
    }
}
