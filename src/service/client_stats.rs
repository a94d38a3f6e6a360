//! The client's call about figures.

use std::time::SystemTime;

use tonic::Streaming;

use super::{
    client::{Client, ClientError, ViewImageForm, time},
    proto,
};
use crate::{windows::Intervals, xr::Distribution};

/// How it stands with a daemon's headset.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum HeadsetStatus {
    /// There is no session.
    Disconnected {
        /// Why: what the last attempt came to.
        reason: String,
        /// Whether it is going to be tried again.
        retrying: bool,
    },
    /// There is a session.
    Connected {
        /// Name and version of the OpenXR runtime.
        runtime: String,
        /// Name of the system, as the runtime tells it.
        system: String,
        /// Adapter that the runtime has chosen.
        adapter: String,
        /// State of the session: `idle`, `ready`, `synchronized`, `visible`, `focused`, `stopping` ...
        session_state: String,
        /// The images of the eyes.
        images: Vec<ViewImageForm>,
        /// Why frames are left out, while they are.
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

/// Where the time of a frame went, ms.
#[derive(Clone, Debug, PartialEq)]
pub struct ReceivedTimes {
    /// Planning and recording on the CPU.
    pub plan_ms: f64,
    /// Culling on the CPU, part of `plan_ms`.
    pub cull_ms: f64,
    /// From submission to the end of the readback, without the time in which other frames were planned or read back.
    pub gpu_and_readback_ms: f64,
    /// Planning and the time above together.
    pub total_ms: f64,
    /// All passes on the GPU; `None` where the adapter has no timestamps.
    pub gpu_ms: Option<f64>,
    /// Each pass on the GPU, by name; empty where the adapter has no timestamps.
    pub passes_ms: Vec<(String, f64)>,
    /// Buffers, bind groups and pipelines that were made for the frame: none in a steady state.
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

/// Figures of a headset since the daemon started; times are of the last 300 frames that were rendered.
#[derive(Clone, Debug, PartialEq)]
pub struct ReceivedHeadset {
    /// Name of its view.
    pub view: String,
    /// How it stands.
    pub status: HeadsetStatus,
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
    /// Frames that the runtime wanted and that could not be drawn.
    pub left_out: u64,
    /// Refreshes of the display that no frame came for in time, between two frames that were wanted.
    pub missed: u64,
    /// How often the room's origin has moved.
    pub recentred: u64,
    /// Time between refreshes of the display, ms.
    pub period_ms: f64,
    /// From the pose's being asked for to the submission of the frame's commands.
    pub pose_age_at_submission: Distribution,
    /// From the pose's being asked for to the moment at which the runtime expects to show the frame; `None` where the
    /// runtime's clock cannot be read.
    pub pose_age_at_display: Option<Distribution>,
    /// Each stage of a frame in its order, by name.
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

/// Figures of a daemon.
#[derive(Clone, Debug, PartialEq)]
pub struct ReceivedStats {
    /// When they were read, by the daemon's clock.
    pub time: SystemTime,
    /// Frames that the render thread has made since the start; a headset's are not among them.
    pub frames_rendered: u64,
    /// Streams of frames now, of all views.
    pub streams: u32,
    /// Frames that streams have dropped since the start.
    pub frames_dropped: u64,
    /// Where the time of the render thread's last frame went; `None` before the first.
    pub last_frame: Option<ReceivedTimes>,
    /// The headset; `None` if the daemon drives none.
    pub headset: Option<ReceivedHeadset>,
    /// What display images give up to be in time; `None` without `accuracy.frame_ms`.
    pub quality: Option<ReceivedQuality>,
    /// What audits of frames have found; `None` without `accuracy.audit`.
    pub audit: Option<ReceivedAudits>,
    /// Frames since the start that could not be drawn.
    pub frames_failed: u64,
    /// Why the last frame could not be drawn; empty if it could.
    pub problem: String,
    /// Times since the start that the images of a view of a frame were encoded.
    pub encoded: u64,
    /// Connections now.
    pub connections: u32,
    /// Requests since the start that were refused because they would have taken more than they may.
    pub refused: u64,
    /// Windows on monitors of the daemon's machine.
    pub windows: Vec<ReceivedWindow>,
}

/// A window on a monitor of the daemon's machine.
#[derive(Clone, Debug, PartialEq)]
pub struct ReceivedWindow {
    /// Its name.
    pub name: String,
    /// Name of the view that it shows.
    pub view: String,
    /// Which image of it; empty for a view's only one.
    pub part: String,
    /// `shown`, `monitor_missing`, `view_missing`, `no_display` or `closed`.
    pub state: String,
    /// Why it is not shown, where there is more to say; otherwise empty.
    pub reason: String,
    /// Name of the monitor that it is on; empty: not known.
    pub monitor: String,
    /// Refreshes of the monitor per second; `None`: the system does not tell.
    pub refresh_hz: Option<f64>,
    /// Number of the frame that it shows; 0: none yet.
    pub frame_number: u64,
    /// Frames that it has shown.
    pub frames: u64,
    /// Times from one frame to the next; `None` before the second.
    pub intervals: Option<Intervals>,
    /// Refreshes between two frames that no new one came for; `None`: frames do not wait for refreshes, or their rate is not known.
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

/// What display images give up to be in time.
#[derive(Clone, Debug, PartialEq)]
pub struct ReceivedQuality {
    /// How long a frame may take, ms.
    pub frame_ms: f64,
    /// How long frames of this level take, smoothed, ms; `None` while that is not known.
    pub smoothed_ms: Option<f64>,
    /// Level of frames to come: 0 is as configured.
    pub level: u32,
    /// What it gives up, in words.
    pub given_up: Vec<String>,
}

/// Audits of frames since the daemon started.
#[derive(Clone, Debug, PartialEq)]
pub struct ReceivedAudits {
    /// Frames audited.
    pub frames_audited: u64,
    /// Those of them that break an error budget.
    pub frames_broken: u64,
    /// Number of the last frame that was looked at.
    pub last_frame_number: u64,
    /// Its images.
    pub images: Vec<ReceivedImageAudit>,
    /// What of it was not compared, and why.
    pub not_audited: Vec<String>,
}

/// Errors of the sampled pixels of an image.
#[derive(Clone, Debug, PartialEq)]
pub struct ReceivedImageAudit {
    /// Name of the view.
    pub view: String,
    /// Which of its images; empty where it has one.
    pub part: String,
    /// Whether it is an HDR image.
    pub hdr: bool,
    /// Pixels compared.
    pub pixels: u32,
    /// The error that 99.9 % of their channels do not exceed, and what it may be.
    pub error_999: [f64; 2],
    /// The largest error, and what it may be.
    pub largest: [f64; 2],
    /// Unit of the errors.
    pub unit: String,
    /// Whether both are within the budget.
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

/// Figures as they come. Dropping it ends the stream.
#[derive(Debug)]
pub struct StatsReceiver {
    stream: Streaming<proto::Stats>,
}

impl StatsReceiver {
    /// Waits for the next figures; `None` when the daemon has ended the stream in good order.
    pub async fn next(&mut self) -> Result<Option<ReceivedStats>, ClientError> {
        self.stream.message().await?.map(ReceivedStats::try_from).transpose()
    }
}

impl Client {
    /// Figures of the daemon and of its headset, every `interval_s` (0.1 to 60 s; `None`: 1 s) and whenever the headset's
    /// status changes.
    pub async fn watch_stats(&mut self, interval_s: Option<f64>) -> Result<StatsReceiver, ClientError> {
        let request = proto::WatchStatsRequest { interval_s };
        Ok(StatsReceiver { stream: self.diagnostics.watch_stats(request).await?.into_inner() })
    }
}
