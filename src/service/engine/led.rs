//! A led worker: the render thread draws a cue on one request and shows its pictures on another, instead of working at its own pace.
//!
//! A node of a cluster is led. Its render thread has the whole rig and draws its share of the views; requests and streams of clients wait for
//! the pictures that are shown. The director uses [`RenderHandle::content_at`] to compose cues.

use std::{
    collections::VecDeque,
    sync::Arc,
    time::{Instant, SystemTime},
};

use super::{
    render_handle::RenderHandle,
    shared_state::{Request, State, Subscriber},
    stage::Stage,
};
use crate::{
    plan::{Limits, settings::RenderSettings},
    render::Wanted,
    scene::{Camera, SceneSnapshot},
    service::{
        frames::{errors::RenderFailure, rendered_frame::RenderedFrame},
        scene::{state::SceneState, views::ViewId},
    },
};

/// Description of a frame that a led worker draws. Two nodes with the same cue draw the same frame.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Cue {
    /// Number of the frame, the same on all nodes.
    pub(crate) number: u64,
    /// Revision of the scene.
    pub(crate) scene: u64,
    /// Scene time, s since 2000-01-01T12:00:00Z.
    pub(crate) time_s: f64,
    /// The camera at that time.
    pub(crate) camera: Camera,
    /// Whether the camera has the same position as in the frame before.
    pub(crate) rests: bool,
    /// Quality level of display images.
    pub(crate) level: u32,
    /// Exposure of each frame group, EV at ISO 100.
    pub(crate) ev100: Vec<f32>,
}

/// A frame of a cue, with the images that it has.
#[derive(Clone, Debug)]
pub(crate) struct LedFrame {
    pub(crate) frame: Arc<RenderedFrame>,
    pub(crate) views: Vec<(ViewId, Wanted)>,
}

/// The frames of a cue.
#[derive(Clone, Debug)]
pub(crate) struct Pictures {
    pub(crate) frames: Vec<LedFrame>,
    /// Time at which their drawing began.
    pub(crate) start: Instant,
}

/// Callback that receives the result of drawing a cue.
pub(crate) type CueReply = Box<dyn FnOnce(Result<Pictures, CueError>) + Send>;

/// Reasons why a cue is not drawn.
#[derive(Clone, Debug, thiserror::Error)]
pub(crate) enum CueError {
    /// The scene is not that of the cue.
    #[error("the cue is for revision {wanted} of the scene, and this node has {found}")]
    Scene {
        /// Revision of the cue.
        wanted: u64,
        /// Revision of the node.
        found: u64,
    },
    /// The cue has exposures for another number of frame groups.
    #[error("the cue has {found} exposures, and the views have {wanted} groups")]
    Exposures {
        /// Number of groups.
        wanted: usize,
        /// Number of exposures.
        found: usize,
    },
    /// A newer cue came first.
    #[error("a newer cue replaced this one")]
    Replaced,
    /// A frame failed.
    #[error("{0}")]
    Frame(String),
}

/// A cue that is to be drawn.
pub(crate) struct CueRequest {
    pub(crate) cue: Cue,
    pub(crate) reply: CueReply,
}

/// State of a led worker.
pub(crate) struct Led {
    /// Names of the views that it draws.
    pub(crate) views: Arc<[String]>,
    /// The cue to be drawn next.
    pub(crate) next: Option<CueRequest>,
    /// Images, other than display images, that its windows show.
    pub(crate) of_windows: Vec<(ViewId, Wanted)>,
    /// Stage through which its windows get frames.
    pub(crate) stage: Arc<Stage>,
}

/// Content of a frame at a given time, for the director.
pub(crate) struct Content {
    pub(crate) scene: SceneState,
    pub(crate) snapshot: SceneSnapshot,
    /// General settings of frames, for views that set none themselves.
    pub(crate) settings: RenderSettings,
    pub(crate) limits: Limits,
    pub(crate) time_s: f64,
}

/// Whether an image that has `has` contains everything in `wanted`.
fn satisfies(has: Wanted, wanted: Wanted) -> bool {
    let mut both = has;
    both |= wanted;
    both == has
}

impl Pictures {
    /// Returns the same frames in black. A node shows them after a long time without a frame.
    pub(crate) fn blackened(&self) -> Self {
        let frames = self
            .frames
            .iter()
            .map(|LedFrame { frame, views }| LedFrame { frame: Arc::new(frame.blackened()), views: views.clone() });
        Self { frames: frames.collect(), ..*self }
    }

    /// Returns the frame that has the wanted images of a view.
    pub(crate) fn frame_of(&self, view: ViewId, wanted: Wanted) -> Option<&Arc<RenderedFrame>> {
        let has = |frame: &&LedFrame| frame.views.iter().any(|(of, has)| *of == view && satisfies(*has, wanted));
        self.frames.iter().find(has).map(|led| &led.frame)
    }
}

impl State {
    /// Returns the images, other than display images, that clients of a led worker wait for.
    pub(super) fn wanted_by_clients(&self) -> Vec<(ViewId, Wanted)> {
        let of_requests = self.queue.requests.iter().map(|request| (request.view, request.wanted));
        let of_streams = self.queue.subscribers.iter().map(|stream| (stream.view, stream.wanted));
        let of_windows = self.led.iter().flat_map(|led| led.of_windows.iter().copied());
        of_requests.chain(of_streams).chain(of_windows).filter(|(_, wanted)| wanted.reads_hdr()).collect()
    }
}

impl RenderHandle {
    /// Makes the worker led: from now on, it draws frames only for cues, with these views. `real_time` states whether the presenting thread asks for
    /// real-time scheduling.
    pub(crate) fn be_led(&self, views: Vec<String>, real_time: bool) {
        let stage = Arc::new(Stage::new(real_time));
        self.shared.state().led = Some(Led { views: views.into(), next: None, of_windows: Vec::new(), stage });
        self.shared.wake.notify_one();
    }

    /// Returns the views that a led worker draws; `None` if the worker is not led.
    pub(crate) fn led_views(&self) -> Option<Arc<[String]>> {
        self.shared.state().led.as_ref().map(|led| Arc::clone(&led.views))
    }

    /// Returns the stage of a led worker's windows; `None` if the worker is not led.
    pub(crate) fn stage(&self) -> Option<Arc<Stage>> {
        self.shared.state().led.as_ref().map(|led| Arc::clone(&led.stage))
    }

    /// Sets the images that the windows show, if the worker is led.
    pub(crate) fn show_in_windows(&self, wanted: Vec<(ViewId, Wanted)>) {
        if let Some(led) = &mut self.shared.state().led {
            led.of_windows = wanted;
        }
    }

    /// Draws a cue. The reply comes from the render thread after the device has finished; it is dropped if the daemon ends.
    pub(crate) fn draw_cue(&self, cue: Cue, reply: CueReply) {
        let replaced = {
            let mut state = self.shared.state();
            let Some(led) = &mut state.led else { return };
            led.next.replace(CueRequest { cue, reply })
        };
        self.shared.wake.notify_one();
        if let Some(replaced) = replaced {
            (replaced.reply)(Err(CueError::Replaced));
        }
    }

    /// Hands the pictures of a cue to all clients that wait for them.
    pub(crate) fn show(&self, pictures: &Pictures) {
        let now = Instant::now();
        let mut state = self.shared.state();
        state.queue.subscribers.retain(|subscriber| subscriber.slot.strong_count() > 0);
        for LedFrame { frame, views } in &pictures.frames {
            for (view, _) in views.iter().filter(|(view, _)| state.has_view(*view)).collect::<Vec<_>>() {
                state.queue.newest_frames.insert(*view, (frame.frame.number, frame.shows, pictures.start));
            }
        }
        let mut waiting: VecDeque<Request> = VecDeque::new();
        for request in std::mem::take(&mut state.queue.requests) {
            match pictures.frame_of(request.view, request.wanted) {
                // The caller may have disconnected.
                Some(frame) => drop(request.reply.send(Ok(Arc::clone(frame)))),
                None => waiting.push_back(request),
            }
        }
        state.queue.requests = waiting;
        for Subscriber { view, wanted, pace, slot } in &mut state.queue.subscribers {
            if let (Some(frame), Some(slot), true) =
                (pictures.frame_of(*view, *wanted), slot.upgrade(), pace.interval_is_over(now))
            {
                pace.served(frame.shows, now);
                slot.offer(Arc::clone(frame));
            }
        }
    }

    /// Replaces the scene by that of the director.
    pub(crate) fn adopt_scene(&self, scene: SceneState) -> Result<(), RenderFailure> {
        let mut state = self.shared.state();
        let before = state.scene.published.borrow().clone().ok_or(RenderFailure::Ended)?;
        state.scene.newest = scene.clone();
        state.scene.published.send_replace(Some(scene));
        state.end_deleted(&before.views);
        Ok(())
    }

    /// Returns the content of a frame that is shown at the daemon's time `time`; `None` while the daemon ends.
    pub(crate) fn content_at(&self, time: SystemTime) -> Option<Content> {
        let (scene, camera, settings, limits) = {
            let mut state = self.shared.state();
            let scene = state.scene.published.borrow().clone().filter(|_| !state.draining)?;
            state.follow(time);
            let settings = state.settings_of(&scene);
            (scene, state.camera.newest, settings, state.limits)
        };
        let time_s = scene.clock.time_s(time);
        Some(Content { snapshot: self.shared.snapshot(&scene, camera, time), scene, settings, limits, time_s })
    }
}
