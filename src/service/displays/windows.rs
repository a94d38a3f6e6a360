//! Windows on monitors of the daemon's machine: the [`windows`](crate::windows) host, and the thread that runs the
//! windows.
//!
//! Windows request the next frame of all their views together, so that views share a frame if possible; views with
//! different settings have separate frames. They request again as soon as the frame arrives, and present in the
//! meantime. A frame is due as for streams: when scene or camera change, while an exposure adapts, and once a second.
//!
//! Without a display, the daemon continues and tries again at intervals.

use std::{
    collections::HashMap,
    io,
    panic::{AssertUnwindSafe, catch_unwind},
    sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError},
    thread,
    time::Duration,
};

use tokio::{
    runtime::Handle,
    sync::{mpsc, oneshot},
    time::{Instant, timeout_at},
};

use crate::{
    config::WindowConfig,
    platform::process,
    render::Wanted,
    service::{
        engine::{
            render_handle::RenderHandle,
            stage::{Stage, StageWork},
        },
        frames::{errors::RenderFailure, rendered_frame::RenderedFrame, schedule::Revisions},
        scene::{state::SceneState, views::ViewId},
        threads::{RunningThread, panic_message},
    },
    windows::{Command, Host, Next, ShownImage, WindowFigures, WindowFrame, WindowImage, WindowState},
};

/// Time that windows wait for a frame before they check for other changes.
const PATIENCE: Duration = Duration::from_millis(30);
/// Delay before the next request after a failed frame.
const AFTER_FAILURE: Duration = Duration::from_millis(100);
/// Interval between attempts to open a display.
const LOOK_FOR_DISPLAY: Duration = Duration::from_secs(5);
/// Maximum number of unhandled key presses.
const MOST_KEYS: usize = 8;

/// Result of the windows' thread.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum WindowsEnd {
    /// The windows were closed on request.
    InOrder,
    /// There is no display, for this reason. Opening can be tried again.
    NoDisplay(String),
    /// The windows cannot be opened or shown, for this reason.
    Failed(String),
}

/// Opens windows for a host, and returns when they have ended.
pub type OpenWindows = Box<dyn FnMut(Arc<dyn Host>) -> WindowsEnd + Send>;

/// Windows for [`run`](crate::service::run).
pub struct WindowsOptions {
    /// The windows.
    pub windows: Vec<WindowConfig>,
    /// Opens them, on their own thread. The daemon continues if it fails or panics.
    pub open: OpenWindows,
}

type Reply = Result<Arc<RenderedFrame>, RenderFailure>;

/// Requested frames.
struct Asked {
    /// Replies, or their receivers, with the views that they belong to.
    frames: Vec<(ViewId, Result<Reply, oneshot::Receiver<Reply>>)>,
    scene: SceneState,
}

#[derive(Default)]
struct State {
    figures: Vec<WindowFigures>,
    asked: Option<Asked>,
    /// Number of the last displayed frame of each view, and the revisions of all of them.
    seen: HashMap<ViewId, u64>,
    seen_revisions: Option<Revisions>,
    /// Whether the windows are to end.
    ending: bool,
}

/// The service's view of the windows.
pub(crate) struct Windows {
    configs: Vec<WindowConfig>,
    render: RenderHandle,
    runtime: Handle,
    state: Mutex<State>,
    wake: Condvar,
    /// Presses of the test pattern key.
    keys: mpsc::Sender<()>,
}

impl Windows {
    /// Creates windows that are not open yet, and the receiver of presses of the test pattern key. Needs a tokio
    /// runtime.
    pub(crate) fn new(configs: Vec<WindowConfig>, render: RenderHandle) -> (Self, mpsc::Receiver<()>) {
        let (keys, pressed) = mpsc::channel(MOST_KEYS);
        let state = State { figures: figures(&configs, "not opened yet"), ..State::default() };
        let runtime = Handle::current();
        (Self { configs, render, runtime, state: Mutex::new(state), wake: Condvar::new(), keys }, pressed)
    }

    fn state(&self) -> MutexGuard<'_, State> {
        // Nothing can panic while the lock is held, so a poisoned state is consistent.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Returns the current figures.
    pub(crate) fn report(&self) -> Vec<WindowFigures> {
        self.state().figures.clone()
    }

    /// Ends the windows.
    pub(crate) fn drain(&self) {
        self.state().ending = true;
        self.wake.notify_all();
    }

    /// Starts the thread that opens the windows.
    pub(crate) fn spawn(self: &Arc<Self>, mut open: OpenWindows) -> io::Result<RunningThread> {
        let windows = Arc::clone(self);
        RunningThread::spawn("windows", move || windows.keep_open(&mut open))
    }

    fn keep_open(self: &Arc<Self>, open: &mut OpenWindows) {
        let mut reported = false;
        loop {
            let host: Arc<dyn Host> = Arc::clone(self) as Arc<dyn Host>;
            // State left by a panicking run is not used again.
            let end = catch_unwind(AssertUnwindSafe(|| open(host)))
                .unwrap_or_else(|payload| WindowsEnd::Failed(format!("panic: {}", panic_message(payload.as_ref()))));
            let problem = match end {
                WindowsEnd::InOrder => return,
                WindowsEnd::NoDisplay(problem) => {
                    self.state().figures = figures(&self.configs, &problem);
                    if !std::mem::replace(&mut reported, true) {
                        tracing::error!("cannot open windows: {problem}; the daemon continues and tries again");
                    }
                    let waited = self.wake.wait_timeout_while(self.state(), LOOK_FOR_DISPLAY, |state| !state.ending);
                    if waited.unwrap_or_else(PoisonError::into_inner).0.ending {
                        return;
                    }
                    continue;
                }
                WindowsEnd::Failed(problem) => problem,
            };
            tracing::error!("the windows have ended: {problem}; the daemon continues");
            self.state().figures = figures(&self.configs, &problem);
            return;
        }
    }

    /// Returns the images that the visible windows show.
    fn wanted(&self, scene: &SceneState, shown: &[bool]) -> Vec<(ViewId, Wanted)> {
        let mut wanted: Vec<(ViewId, Wanted)> = Vec::new();
        for (config, _) in self.configs.iter().zip(shown).filter(|(_, shown)| **shown) {
            let Some((id, _)) = scene.views.named(&config.view) else { continue };
            let patterned = scene.objects.drawn.overlay.test_patterns.contains(&config.view);
            let of_window = config.format.wanted(patterned);
            match wanted.iter_mut().find(|(known, _)| *known == id) {
                Some((_, wanted)) => *wanted |= of_window,
                None => wanted.push((id, of_window)),
            }
        }
        wanted
    }

    /// Requests the next frame of the views of all visible windows.
    fn ask(&self, scene: SceneState, shown: &[bool], state: &mut State) -> Option<()> {
        let wanted = self.wanted(&scene, shown);
        let replies = self.render.next_of_views(&wanted, &state.seen).ok()?;
        let frames = wanted.iter().map(|(id, _)| *id).zip(replies.into_iter().map(Err)).collect();
        state.asked = Some(Asked { frames, scene });
        Some(())
    }

    /// Returns the images that the windows show, taken from the requested frames.
    fn images(&self, asked: &Asked, shown: &[bool]) -> WindowFrame {
        let frame = |id: ViewId, _| {
            asked.frames.iter().find(|(of, _)| *of == id).and_then(|(_, frame)| match frame {
                Ok(Ok(rendered)) => Some(rendered),
                _ => None,
            })
        };
        self.images_of(&asked.scene, shown, frame)
    }

    /// Returns the images that the windows show; `frame` finds the frame of a view with the images that a window wants.
    fn images_of<'a>(
        &self,
        scene: &SceneState,
        shown: &[bool],
        frame: impl Fn(ViewId, Wanted) -> Option<&'a Arc<RenderedFrame>>,
    ) -> WindowFrame {
        let image = |(config, shown): (&WindowConfig, &bool)| {
            let Some((id, index)) = scene.views.named(&config.view) else { return WindowImage::NoView };
            let patterned = scene.objects.drawn.overlay.test_patterns.contains(&config.view);
            let (Some(rendered), true) = (frame(id, config.format.wanted(patterned)), *shown) else {
                return WindowImage::AsBefore;
            };
            let number = rendered.views.iter().position(|known| *known == id);
            let is_it = |image: &crate::render::FrameImage| {
                Some(image.view) == number && image.part.name() == config.part.as_deref()
            };
            match rendered.frame.images.iter().position(is_it) {
                Some(image) => WindowImage::Image(ShownImage {
                    frame: Arc::clone(&rendered.frame),
                    image,
                    tone_map: scene.views.settings[index].tone_map,
                }),
                // A client has changed the view, and it no longer has this part.
                None => WindowImage::NoView,
            }
        };
        WindowFrame { images: self.configs.iter().zip(shown).map(image).collect() }
    }

    /// Returns the next action of the windows of a led worker.
    fn next_staged(&self, stage: &Stage, scene: &SceneState, shown: &[bool]) -> Next {
        self.render.show_in_windows(self.wanted(scene, shown));
        match stage.next(PATIENCE) {
            None => Next::Drawing,
            Some(StageWork::Prepare(number, pictures)) => {
                // A window with more than 8 bits shows the codes of the display image until the worker knows that it wants another one.
                let frame =
                    |id, wanted| pictures.frame_of(id, wanted).or_else(|| pictures.frame_of(id, Wanted::display()));
                Next::Prepare(number, self.images_of(scene, shown, frame))
            }
            Some(StageWork::Present(number)) => Next::Present(number),
            Some(StageWork::Discard(number)) => Next::Discard(number),
            Some(StageWork::Black) => {
                Next::Frame(WindowFrame { images: self.configs.iter().map(|_| WindowImage::Black).collect() })
            }
        }
    }

    /// Waits for the requested frames; returns whether all have arrived.
    fn wait(&self, asked: &mut Asked) -> bool {
        let deadline = Instant::now() + PATIENCE;
        self.runtime.block_on(async {
            for (_, frame) in &mut asked.frames {
                if let Err(receiver) = frame {
                    match timeout_at(deadline, receiver).await {
                        // A dropped sender means that the daemon ends.
                        Ok(reply) => *frame = Ok(reply.unwrap_or(Err(RenderFailure::Ended))),
                        Err(_) => return false,
                    }
                }
            }
            true
        })
    }
}

/// Returns the figures of windows without an image.
fn figures(configs: &[WindowConfig], reason: &str) -> Vec<WindowFigures> {
    let figures = |config: &WindowConfig| {
        let state = WindowState::NoDisplay(reason.to_owned());
        WindowFigures::new(&config.name, &config.view, config.part.as_deref().unwrap_or_default(), state)
    };
    configs.iter().map(figures).collect()
}

impl Host for Windows {
    fn presenting_began(&self) {
        let is_asked = self.render.stage().is_some_and(|stage| stage.real_time);
        if is_asked && let Err(error) = process::real_time_thread_alone() {
            tracing::warn!("cluster: no real-time scheduling of the thread that presents: {error}");
        }
    }

    fn next(&self, shown: &[bool]) -> Next {
        let Ok(scene) = self.render.scene() else { return Next::End };
        let mut state = self.state();
        if state.ending {
            return Next::End;
        }
        if let Some(stage) = self.render.stage() {
            drop(state);
            return self.next_staged(&stage, &scene, shown);
        }
        let nothing_wanted = || {
            let views = self.configs.iter().zip(shown).filter(|(_, shown)| **shown);
            views.map(|(config, _)| config).all(|config| scene.views.named(&config.view).is_none())
        };
        if state.asked.is_none() {
            if nothing_wanted() {
                let empty = Asked { frames: Vec::new(), scene };
                drop(state);
                thread::sleep(PATIENCE);
                return Next::Frame(self.images(&empty, shown));
            }
            if self.ask(scene.clone(), shown, &mut state).is_none() {
                return Next::End;
            }
        }
        let Some(mut asked) = state.asked.take() else { return Next::Drawing };
        drop(state);
        let complete = self.wait(&mut asked);
        let mut state = self.state();
        if !complete {
            let is_seen = self.render.revisions().is_none_or(|newest| state.seen_revisions == Some(newest));
            // A change of the visible windows leads to a new request.
            state.asked = Some(asked);
            return if is_seen { Next::Unchanged } else { Next::Drawing };
        }
        let mut failed = false;
        state.seen.clear();
        for (id, frame) in &asked.frames {
            match frame {
                Ok(Ok(rendered)) => {
                    state.seen.insert(*id, rendered.frame.number);
                    state.seen_revisions = Some(rendered.shows);
                }
                Ok(Err(RenderFailure::Ended)) => return Next::End,
                // The render thread has logged the reason.
                _ => failed = true,
            }
        }
        let frame = self.images(&asked, shown);
        if failed {
            drop(state);
            thread::sleep(AFTER_FAILURE);
        } else if !nothing_wanted() && self.ask(scene.clone(), shown, &mut state).is_none() {
            return Next::End;
        }
        Next::Frame(frame)
    }

    fn prepared(&self, number: u64, is_ready: bool) {
        if let Some(stage) = self.render.stage() {
            stage.prepared(number, is_ready);
        }
    }

    fn presenting_ended(&self) {
        if let Some(stage) = self.render.stage() {
            stage.end_windows();
        }
    }

    fn command(&self, command: Command) {
        match command {
            // If keys are pressed faster than the scene changes, presses that do not fit into the queue are lost.
            Command::TestPattern => drop(self.keys.try_send(())),
            Command::Quit => tracing::info!("ignored: keys and closed windows do not end the daemon"),
        }
    }

    fn figures(&self, figures: Vec<WindowFigures>) {
        self.state().figures = figures;
    }
}
