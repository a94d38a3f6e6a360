//! Windows on the monitors of the daemon's machine: whom [`windows`](crate::windows) opens them for, and the thread on which that is done.
//!
//! Windows ask for the next frame of all their views at once, so that one frame serves all that it can show: those of views with settings of their own are
//! frames of their own. They ask again as soon as they have it, and present meanwhile. A frame is due as for streams: when scene or camera have changed, while an
//! exposure adapts, and once a second.
//!
//! Without a display the daemon goes on, and looks for one again and again.

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

use super::{
    handlers::Service,
    headset::panic_message,
    overlay::OverlayChange,
    render::RenderHandle,
    scene::{SceneState, SceneUpdate},
    schedule::Revisions,
    slot::{RenderFailure, RenderedFrame},
    views::ViewId,
};
use crate::{
    config::WindowConfig,
    render::Wanted,
    windows::{Command, Host, Next, ShownImage, WindowFigures, WindowFrame, WindowImage, WindowState},
};

/// How long windows wait for a frame before they look whether something else has changed.
const PATIENCE: Duration = Duration::from_millis(30);
/// After a frame that could not be drawn another one is not asked for sooner.
const AFTER_FAILURE: Duration = Duration::from_millis(100);
/// Between two looks for a display.
const LOOK_FOR_DISPLAY: Duration = Duration::from_secs(5);
/// Keys that wait to be acted upon.
const MOST_KEYS: usize = 8;

/// How the windows of a daemon ended.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum WindowsEnd {
    /// As they were told to.
    InOrder,
    /// There is no display yet: why. They may be opened again.
    NoDisplay(String),
    /// They cannot be opened or shown: why.
    Failed(String),
}

/// Opens windows for a host, and returns when they have ended.
pub type OpenWindows = Box<dyn FnMut(Arc<dyn Host>) -> WindowsEnd + Send>;

/// Windows for [`run`](super::run).
pub struct WindowsOptions {
    /// What they show.
    pub windows: Vec<WindowConfig>,
    /// Opens them, on a thread of its own. The daemon goes on when it fails or panics.
    pub open: OpenWindows,
}

type Reply = Result<Arc<RenderedFrame>, RenderFailure>;

/// What was asked for.
struct Asked {
    /// Replies, or what they were, with the views that they are of.
    frames: Vec<(ViewId, Result<Reply, oneshot::Receiver<Reply>>)>,
    scene: SceneState,
}

#[derive(Default)]
struct State {
    figures: Vec<WindowFigures>,
    asked: Option<Asked>,
    /// Number of the frame of each view that was shown last, and what all of them showed.
    seen: HashMap<ViewId, u64>,
    seen_revisions: Option<Revisions>,
    /// The windows are to end.
    ending: bool,
}

/// What the service knows of the windows.
pub(super) struct Windows {
    configs: Vec<WindowConfig>,
    render: RenderHandle,
    runtime: Handle,
    state: Mutex<State>,
    wake: Condvar,
    /// Presses of the key for test patterns.
    keys: mpsc::Sender<()>,
}

/// The running thread.
pub(super) struct WindowsThread {
    pub(super) join: thread::JoinHandle<()>,
    /// Resolves (with an error, since nothing is sent) when the thread has ended.
    pub(super) ended: oneshot::Receiver<()>,
}

impl Windows {
    /// Windows that are not opened yet, and the presses of their key for test patterns. Needs a tokio runtime.
    pub(super) fn new(configs: Vec<WindowConfig>, render: RenderHandle) -> (Self, mpsc::Receiver<()>) {
        let (keys, pressed) = mpsc::channel(MOST_KEYS);
        let state = State { figures: figures(&configs, "they are about to be opened"), ..State::default() };
        let runtime = Handle::current();
        (Self { configs, render, runtime, state: Mutex::new(state), wake: Condvar::new(), keys }, pressed)
    }

    fn state(&self) -> MutexGuard<'_, State> {
        // Nothing can panic while the lock is held, so a poisoned state is whole.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The figures now.
    pub(super) fn report(&self) -> Vec<WindowFigures> {
        self.state().figures.clone()
    }

    /// Ends them, soon.
    pub(super) fn drain(&self) {
        self.state().ending = true;
        self.wake.notify_all();
    }

    /// Starts the thread that opens them.
    pub(super) fn spawn(self: &Arc<Self>, mut open: OpenWindows) -> io::Result<WindowsThread> {
        let (sender, ended) = oneshot::channel();
        let windows = Arc::clone(self);
        let join = thread::Builder::new().name("windows".to_owned()).spawn(move || {
            // Dropped at the very end: whoever sees that knows that the windows are gone.
            let _ended: oneshot::Sender<()> = sender;
            windows.keep_open(&mut open);
        })?;
        Ok(WindowsThread { join, ended })
    }

    fn keep_open(self: &Arc<Self>, open: &mut OpenWindows) {
        let mut told = false;
        loop {
            let host: Arc<dyn Host> = Arc::clone(self) as Arc<dyn Host>;
            // What they have left behind is not used again.
            let end = catch_unwind(AssertUnwindSafe(|| open(host)))
                .unwrap_or_else(|payload| WindowsEnd::Failed(format!("panic: {}", panic_message(payload.as_ref()))));
            let problem = match end {
                WindowsEnd::InOrder => return,
                WindowsEnd::NoDisplay(problem) => {
                    self.state().figures = figures(&self.configs, &problem);
                    if !std::mem::replace(&mut told, true) {
                        tracing::error!(
                            "no windows are opened: {problem}; all else goes on, and a display is looked for"
                        );
                    }
                    let waited = self.wake.wait_timeout_while(self.state(), LOOK_FOR_DISPLAY, |state| !state.ending);
                    if waited.unwrap_or_else(PoisonError::into_inner).0.ending {
                        return;
                    }
                    continue;
                }
                WindowsEnd::Failed(problem) => problem,
            };
            tracing::error!("there are no windows any more: {problem}; all else goes on");
            self.state().figures = figures(&self.configs, &problem);
            return;
        }
    }

    /// Asks for the next frame of the views of all windows that are seen.
    fn ask(&self, scene: SceneState, shown: &[bool], state: &mut State) -> Option<()> {
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
        let replies = self.render.next_of_views(&wanted, &state.seen).ok()?;
        let frames = wanted.iter().map(|(id, _)| *id).zip(replies.into_iter().map(Err)).collect();
        state.asked = Some(Asked { frames, scene });
        Some(())
    }

    /// What the windows show of frames.
    fn images(&self, asked: &Asked, shown: &[bool]) -> WindowFrame {
        let image = |(config, shown): (&WindowConfig, &bool)| {
            let Some((id, index)) = asked.scene.views.named(&config.view) else { return WindowImage::NoView };
            let frame = asked.frames.iter().find(|(of, _)| *of == id).and_then(|(_, frame)| match frame {
                Ok(Ok(rendered)) => Some(rendered),
                _ => None,
            });
            let (Some(rendered), true) = (frame, *shown) else { return WindowImage::AsBefore };
            let number = rendered.views.iter().position(|known| *known == id);
            let is_it = |image: &crate::render::FrameImage| {
                Some(image.view) == number && image.part.name() == config.part.as_deref()
            };
            match rendered.frame.images.iter().position(is_it) {
                Some(image) => WindowImage::Image(ShownImage {
                    frame: Arc::clone(&rendered.frame),
                    image,
                    tone_map: asked.scene.views.settings[index].tone_map,
                }),
                // A client has made another view of it, which has no such part.
                None => WindowImage::NoView,
            }
        };
        WindowFrame { images: self.configs.iter().zip(shown).map(image).collect() }
    }

    /// Waits for what was asked for; whether all of it is there.
    fn wait(&self, asked: &mut Asked) -> bool {
        let deadline = Instant::now() + PATIENCE;
        self.runtime.block_on(async {
            for (_, frame) in &mut asked.frames {
                if let Err(receiver) = frame {
                    match timeout_at(deadline, receiver).await {
                        // A sender that is gone: the daemon ends.
                        Ok(reply) => *frame = Ok(reply.unwrap_or(Err(RenderFailure::Ended))),
                        Err(_) => return false,
                    }
                }
            }
            true
        })
    }
}

/// Figures of windows that show nothing.
fn figures(configs: &[WindowConfig], reason: &str) -> Vec<WindowFigures> {
    let figures = |config: &WindowConfig| {
        let state = WindowState::NoDisplay(reason.to_owned());
        WindowFigures::new(&config.name, &config.view, config.part.as_deref().unwrap_or_default(), state)
    };
    configs.iter().map(figures).collect()
}

impl Host for Windows {
    fn next(&self, shown: &[bool]) -> Next {
        let Ok(scene) = self.render.scene() else { return Next::End };
        let mut state = self.state();
        if state.ending {
            return Next::End;
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
            // Whoever sees another set of windows asks anew.
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
                // The render thread has told why.
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

    fn command(&self, command: Command) {
        match command {
            // Somebody who presses faster than scenes change means the last press at most.
            Command::TestPattern => drop(self.keys.try_send(())),
            Command::Quit => tracing::info!("a key or a closed window does not end the daemon"),
        }
    }

    fn figures(&self, figures: Vec<WindowFigures>) {
        self.state().figures = figures;
    }
}

impl Service {
    /// Changes the scene with each press of the windows' key for test patterns: all views of windows have one, or none any more.
    pub(super) async fn keep_test_patterns(self, windows: Vec<WindowConfig>, mut pressed: mpsc::Receiver<()>) {
        while pressed.recv().await.is_some() {
            let Ok(scene) = self.render.scene() else { return };
            let before = &scene.objects.drawn.overlay.test_patterns;
            let of_windows = |name: &String| windows.iter().any(|window| window.view == *name);
            let mut patterns: Vec<String> = before.iter().filter(|name| !of_windows(name)).cloned().collect();
            let mut views: Vec<&str> = windows.iter().map(|window| window.view.as_str()).collect();
            views.retain(|view| scene.views.named(view).is_some());
            views.dedup();
            let has_all = views.iter().all(|view| before.iter().any(|name| name == view));
            if !has_all {
                patterns.extend(views.iter().map(|view| (*view).to_owned()));
            }
            let overlay = OverlayChange { test_patterns: Some(patterns), ..OverlayChange::default() };
            let update = SceneUpdate { overlay, ..SceneUpdate::default() };
            match self.changed_scene(&update, None).await {
                Ok(scene) => {
                    let what = if has_all { "off" } else { "on" };
                    tracing::info!("a key of a window: test patterns {what}, revision {} of the scene", scene.revision);
                }
                Err(status) => tracing::error!("a key of a window: no test patterns: {}", status.message()),
            }
        }
    }
}
