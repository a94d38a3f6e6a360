//! Audits of rendered frames: a separate thread compares a small sample of pixels of single frames with an f64
//! reference.
//!
//! The render thread never waits: it hands over a frame only if the auditor is free. The auditor uses at most one core and pauses [`REST`] times the
//! duration of each audit, at least one second. Its average use is therefore at most a twentieth of a core, whatever the size of the catalogue.
//! Frames in the meantime are not audited.

use std::{
    io,
    sync::{
        Arc, Mutex, MutexGuard, PoisonError,
        mpsc::{Receiver, SyncSender, sync_channel},
    },
    thread,
    time::{Duration, Instant},
};

use crate::{
    audit::{AuditedScene, audit},
    plan::{Limits, audit::Audit, view_settings::FrameGroup},
    scene::SceneSnapshot,
    service::frames::rendered_frame::RenderedFrame,
};

/// Number of compared pixels per image.
const PIXELS: usize = 64;
/// Pause after an audit as a multiple of the duration of the audit, and the minimum pause.
const REST: u32 = 19;
const LEAST_REST: Duration = Duration::from_secs(1);

/// A frame to be audited.
pub(crate) struct AuditedFrame {
    pub(crate) rendered: Arc<RenderedFrame>,
    /// Its scene and camera.
    pub(crate) scene: SceneSnapshot,
    /// Settings and views of the frame.
    pub(crate) group: FrameGroup,
    /// Whether its exposure was adapted from earlier frames.
    pub(crate) adapted: bool,
}

/// Results of all audits since the start.
#[derive(Clone, Debug, Default)]
pub(crate) struct AuditFigures {
    /// Number of audited frames.
    pub(crate) audited: u64,
    /// Number of audited frames that exceed an error budget.
    pub(crate) broken: u64,
    /// Number and results of the last audit.
    pub(crate) last: Option<(u64, Audit)>,
}

#[derive(Default)]
struct State {
    figures: AuditFigures,
    /// Time from which the next frame may be handed over; `None` during an audit.
    free_at: Option<Instant>,
}

/// Results of the audits, shared with readers.
#[derive(Clone, Default)]
pub(crate) struct AuditReport {
    state: Arc<Mutex<State>>,
}

impl AuditReport {
    pub(crate) fn figures(&self) -> AuditFigures {
        self.state().figures.clone()
    }

    fn state(&self) -> MutexGuard<'_, State> {
        // Nothing can panic while the lock is held, so a poisoned state is consistent.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Handle of the render thread. The auditor's thread ends after the current audit when this is dropped.
pub(crate) struct Auditor {
    report: AuditReport,
    frames: SyncSender<AuditedFrame>,
}

impl Auditor {
    /// Starts the thread, which writes its results to `report`.
    pub(crate) fn spawn(report: AuditReport, limits: Limits) -> io::Result<Self> {
        let (frames, receiver) = sync_channel(1);
        report.state().free_at = Some(Instant::now());
        let thread_report = report.clone();
        let one_core = rayon::ThreadPoolBuilder::new().num_threads(1).build().map_err(io::Error::other)?;
        thread::Builder::new().name("audit".to_owned()).spawn(move || {
            work(&receiver, &thread_report, &one_core, &limits);
        })?;
        Ok(Self { report, frames })
    }

    /// Hands a frame over if the auditor is free; returns whether the auditor took it.
    pub(crate) fn offer(&self, frame: impl FnOnce() -> AuditedFrame) -> bool {
        let mut state = self.report.state();
        let is_free = state.free_at.is_some_and(|free_at| free_at <= Instant::now());
        if is_free {
            state.free_at = None;
            drop(state);
            // If the thread has ended, the auditor stays busy for good.
            return self.frames.try_send(frame()).is_ok();
        }
        is_free
    }
}

fn work(frames: &Receiver<AuditedFrame>, report: &AuditReport, one_core: &rayon::ThreadPool, limits: &Limits) {
    let mut was_broken = false;
    while let Ok(AuditedFrame { rendered, scene, group, adapted }) = frames.recv() {
        let began = Instant::now();
        let scene = AuditedScene {
            most_pixels: PIXELS,
            numbers: Some(&group.views),
            ..AuditedScene::for_group(&scene, &group, adapted)
        };
        let frame = &rendered.frame;
        let found = one_core.install(|| audit(&scene, frame, limits));
        // Planning fails if the scene has changed in the meantime.
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
                // Warn once per problem, not with every frame.
                if is_broken && !was_broken {
                    for image in found.broken() {
                        tracing::warn!("frame {}: exceeds its error budget: {}", frame.number, image.in_words());
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
