//! Audits of the daemon's frames, beside the frames: a thread of its own compares a small sample of one frame at a time with f64.
//!
//! The render thread never waits for it: it hands over a frame if the auditor is free, and goes on. The auditor works on one core at most, and
//! rests [`REST`] times as long as an audit took, and a second at least: a twentieth of a core, whatever the catalogue. Frames that come meanwhile are not
//! audited.

use std::{
    io,
    sync::{
        Arc, Mutex, MutexGuard, PoisonError,
        mpsc::{Receiver, SyncSender, sync_channel},
    },
    thread,
    time::{Duration, Instant},
};

use super::slot::RenderedFrame;
use crate::{
    audit::{AuditedScene, audit},
    plan::{Limits, audit::Audit, view_settings::FrameGroup},
    scene::SceneSnapshot,
};

/// Pixels compared of an image.
const PIXELS: usize = 64;
/// Rest after an audit, in times of what it took, and at least.
const REST: u32 = 19;
const LEAST_REST: Duration = Duration::from_secs(1);

/// A frame that is to be audited.
pub(super) struct AuditedFrame {
    pub(super) rendered: Arc<RenderedFrame>,
    /// What it shows, with its camera.
    pub(super) scene: SceneSnapshot,
    /// How it was to be drawn.
    pub(super) group: FrameGroup,
    /// Whether its exposure came from the frames before it.
    pub(super) adapted: bool,
}

/// What audits have found since the start.
#[derive(Clone, Debug, Default)]
pub(super) struct AuditFigures {
    /// Frames that were audited.
    pub(super) audited: u64,
    /// Those of them that break a budget.
    pub(super) broken: u64,
    /// The last one: its number, and what was found.
    pub(super) last: Option<(u64, Audit)>,
}

#[derive(Default)]
struct State {
    figures: AuditFigures,
    /// When the next frame may be handed over; `None`: not while an audit is at work.
    free_at: Option<Instant>,
}

/// What the auditor has found, for whoever asks.
#[derive(Clone, Default)]
pub(super) struct AuditReport {
    state: Arc<Mutex<State>>,
}

impl AuditReport {
    pub(super) fn figures(&self) -> AuditFigures {
        self.state().figures.clone()
    }

    fn state(&self) -> MutexGuard<'_, State> {
        // Nothing can panic while the lock is held, so a poisoned state is whole.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The auditor, as the render thread has it. Its thread ends when this is dropped, after the audit at work.
pub(super) struct Auditor {
    report: AuditReport,
    frames: SyncSender<AuditedFrame>,
}

impl Auditor {
    /// Starts the thread. It tells `report` what it finds.
    pub(super) fn spawn(report: AuditReport, limits: Limits) -> io::Result<Self> {
        let (frames, receiver) = sync_channel(1);
        report.state().free_at = Some(Instant::now());
        let told = report.clone();
        let one_core = rayon::ThreadPoolBuilder::new().num_threads(1).build().map_err(io::Error::other)?;
        thread::Builder::new().name("audit".to_owned()).spawn(move || {
            work(&receiver, &told, &one_core, &limits);
        })?;
        Ok(Self { report, frames })
    }

    /// Hands a frame over, if the auditor is free; whether it was.
    pub(super) fn offer(&self, frame: impl FnOnce() -> AuditedFrame) -> bool {
        let mut state = self.report.state();
        let is_free = state.free_at.is_some_and(|free_at| free_at <= Instant::now());
        if is_free {
            state.free_at = None;
            drop(state);
            // A thread that has ended audits nothing any more, and stays busy for good.
            return self.frames.try_send(frame()).is_ok();
        }
        is_free
    }
}

fn work(frames: &Receiver<AuditedFrame>, report: &AuditReport, one_core: &rayon::ThreadPool, limits: &Limits) {
    let mut was_broken = false;
    while let Ok(AuditedFrame { rendered, scene, group, adapted }) = frames.recv() {
        let began = Instant::now();
        let of = AuditedScene {
            most_pixels: PIXELS,
            numbers: Some(&group.views),
            ..AuditedScene::of_group(&scene, &group, adapted)
        };
        let frame = &rendered.frame;
        let found = one_core.install(|| audit(&of, frame, limits));
        // A scene that cannot be planned any more was changed meanwhile.
        let found = found.map(|[mut shown, exact]| {
            shown.images.extend(exact.images);
            shown
        });
        let mut state = report.state();
        match found {
            Ok(found) => {
                let is_broken = found.is_broken();
                state.figures.audited += u64::from(!found.images.is_empty());
                state.figures.broken += u64::from(is_broken);
                // Once when it begins, not with every frame.
                if is_broken && !was_broken {
                    for image in found.broken() {
                        tracing::warn!(
                            "frame {}: the audit finds the error budget broken: {}",
                            frame.number,
                            image.in_words()
                        );
                    }
                }
                was_broken = is_broken;
                state.figures.last = Some((frame.number, found));
            }
            Err(error) => tracing::warn!("frame {} cannot be audited: {error}", frame.number),
        }
        state.free_at = Some(Instant::now() + (began.elapsed() * REST).max(LEAST_REST));
    }
}
