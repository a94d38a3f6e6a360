//! The event thread: opens and places windows, watches monitors, and handles keys.
//!
//! Monitors are checked twice a second. If the monitor of a window is missing, the window is hidden or not opened yet;
//! it is shown when the monitor appears.

use std::{
    collections::HashMap,
    sync::{Arc, atomic::Ordering::Relaxed},
    thread::{self, JoinHandle},
    time::{Duration, Instant},
};

use winit::{
    application::ApplicationHandler,
    dpi::{PhysicalPosition, PhysicalSize},
    event::{ElementState, KeyEvent, WindowEvent},
    event_loop::{ActiveEventLoop, ControlFlow, EventLoop, EventLoopProxy},
    keyboard::{Key, NamedKey},
    window::{Fullscreen, Window, WindowId},
};

use super::{
    WindowsError,
    desk::Desk,
    host::{Command, Host},
    monitors::{self, Monitor, MonitorReport},
    platform::{Desktop, check_display, on_any_thread, outlive_the_display},
    presenter::Presenter,
    statistics::WindowState,
};
use crate::config::{MonitorChoice, WindowConfig};

/// Interval between two checks of the monitors.
const LOOK: Duration = Duration::from_millis(500);

/// Behaviour of the program when its X server ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WithoutDisplay {
    /// The program ends, as X11 programs do.
    Ends,
    /// The program continues, and the call of [`open`] never returns.
    GoesOn,
}

/// Messages from the presenting thread to the event loop.
#[derive(Clone, Copy, Debug)]
enum Notice {
    /// The thread has ended.
    Ended,
}

/// Opens windows for a host and shows its frames until the host ends them. `sizes` are the sizes of the images, pixels; `preferred` is the adapter to
/// use if it can present. The calling thread runs the event loop until that end; a process can do this only once. `without_display` selects the
/// behaviour when the display ends.
///
/// # Errors
///
/// There is no display, or the display can show none of the windows.
pub fn open(
    configs: &[WindowConfig],
    sizes: &[[u32; 2]],
    preferred: &str,
    host: Arc<dyn Host>,
    without_display: WithoutDisplay,
) -> Result<(), WindowsError> {
    let events = event_loop()?;
    if without_display == WithoutDisplay::GoesOn {
        outlive_the_display().map_err(WindowsError::Display)?;
    }
    let desk = Arc::new(Desk::new(configs.len()));
    let presenter = Presenter::new(configs.to_vec(), Arc::clone(&host), Arc::clone(&desk), preferred.to_owned());
    let proxy = events.create_proxy();
    let mut app = App {
        configs: configs.to_vec(),
        sizes: sizes.to_vec(),
        host,
        desk,
        proxy,
        presenter: Presenting::NotYet(Box::new(presenter)),
        placed: configs.iter().map(Placed::from_config).collect(),
        numbers: HashMap::new(),
        known: Vec::new(),
        desktop: None,
        looked: None,
        focused: false,
        outcome: Ok(()),
    };
    let run = events.run_app(&mut app).map_err(|error| WindowsError::Display(error.to_string()));
    app.end();
    run.and(app.outcome)
}

/// Returns the current monitors. A process can call this once, and cannot open windows afterwards.
///
/// # Errors
///
/// There is no display.
pub fn monitors() -> Result<Vec<MonitorReport>, WindowsError> {
    struct Look(Result<Vec<MonitorReport>, String>);
    impl ApplicationHandler<Notice> for Look {
        fn resumed(&mut self, events: &ActiveEventLoop) {
            let found = Desktop::of(events).and_then(|desktop| monitors::monitors(events, desktop.as_ref()));
            self.0 = found.map(|found| found.into_iter().map(|monitor| monitor.report).collect());
            events.exit();
        }

        fn window_event(&mut self, _: &ActiveEventLoop, _: WindowId, _: WindowEvent) {}
    }
    let mut look = Look(Ok(Vec::new()));
    event_loop()?.run_app(&mut look).map_err(|error| WindowsError::Display(error.to_string()))?;
    look.0.map_err(WindowsError::Display)
}

/// Creates the event loop on any thread, because the main thread of a daemon has other work.
fn event_loop() -> Result<EventLoop<Notice>, WindowsError> {
    check_display()?;
    let mut builder = EventLoop::with_user_event();
    on_any_thread(&mut builder);
    builder.build().map_err(|error| WindowsError::Display(error.to_string()))
}

/// State of the presenting thread.
enum Presenting {
    NotYet(Box<Presenter>),
    Runs(JoinHandle<Result<(), WindowsError>>),
    Ended,
}

/// Placement of a window.
#[derive(Clone, Debug, PartialEq)]
struct Placed {
    /// Whether it fills its monitor.
    fills: bool,
    /// Monitor on which it was placed; `None` while it is not visible.
    on: Option<MonitorReport>,
    closed: bool,
}

impl Placed {
    fn from_config(config: &WindowConfig) -> Self {
        Self { fills: config.fullscreen, on: None, closed: false }
    }
}

struct App {
    configs: Vec<WindowConfig>,
    sizes: Vec<[u32; 2]>,
    host: Arc<dyn Host>,
    desk: Arc<Desk>,
    proxy: EventLoopProxy<Notice>,
    presenter: Presenting,
    placed: Vec<Placed>,
    /// Indices of the windows by their system identifiers.
    numbers: HashMap<WindowId, usize>,
    /// The monitors at the last check.
    known: Vec<Monitor>,
    /// Set on X11.
    desktop: Option<Desktop>,
    /// Time of the last check.
    looked: Option<Instant>,
    /// Whether one of the windows has the keyboard focus.
    focused: bool,
    outcome: Result<(), WindowsError>,
}

impl App {
    /// Checks the monitors if it is time, and places every window.
    fn look(&mut self, events: &ActiveEventLoop) {
        let now = Instant::now();
        if self.looked.is_some_and(|looked| now.duration_since(looked) < LOOK) {
            return;
        }
        self.looked = Some(now);
        match monitors::monitors(events, self.desktop.as_ref()) {
            Ok(found) if found != self.known => {
                self.known = found;
                for monitor in &self.known {
                    tracing::debug!("monitor {}", monitor.report);
                }
            }
            Ok(_) => {}
            Err(problem) => {
                self.fail(events, WindowsError::Display(problem));
                return;
            }
        }
        self.place(events);
        self.focus();
    }

    /// Places every window.
    fn place(&mut self, events: &ActiveEventLoop) {
        let mut filled: HashMap<String, String> = HashMap::new();
        for index in 0..self.configs.len() {
            if self.placed[index].closed {
                continue;
            }
            let meant = self.meant(index, &filled);
            if let Ok(Some(monitor)) = &meant
                && self.placed[index].fills
            {
                filled.insert(monitor.report.name.clone(), self.configs[index].name.clone());
            }
            match meant {
                Ok(monitor) => self.show(events, index, monitor.as_ref()),
                Err(reason) => self.hide(index, reason),
            }
        }
    }

    /// Returns the monitor of a window; `Ok(None)` if the desktop chooses it.
    fn meant(&self, index: usize, filled: &HashMap<String, String>) -> Result<Option<Monitor>, String> {
        let (config, fills) = (&self.configs[index], self.placed[index].fills);
        if config.monitor.is_none() && !fills {
            return Ok(None);
        }
        let monitor = monitors::chosen(&self.known, config.monitor.as_ref())?;
        match filled.get(&monitor.report.name).filter(|_| fills) {
            Some(other) => Err(format!("window `{other}` already fills monitor `{}`", monitor.report.name)),
            None => Ok(Some(monitor.clone())),
        }
    }

    /// Returns the position of a window, or `None` if the desktop chooses it, and its size.
    fn geometry(&self, index: usize, monitor: Option<&Monitor>) -> (Option<[i32; 2]>, [u32; 2]) {
        let (config, fills) = (&self.configs[index], self.placed[index].fills);
        let size = config.size.unwrap_or(self.sizes[index]);
        match (monitor, config.position) {
            (Some(monitor), _) if fills => (Some(monitor.report.position), monitor.report.size),
            (Some(monitor), Some(position)) => {
                let origin = monitor.report.position;
                (Some([origin[0] + position[0], origin[1] + position[1]]), size)
            }
            (Some(monitor), None) => {
                // Centred, but with the upper left corner on the monitor.
                let spare = |axis: usize| (i64::from(monitor.report.size[axis]) - i64::from(size[axis])).max(0) / 2;
                let middle = [0, 1].map(|axis| monitor.report.position[axis] + spare(axis) as i32);
                (Some(middle), size)
            }
            (None, position) => (position, size),
        }
    }

    fn show(&mut self, events: &ActiveEventLoop, index: usize, monitor: Option<&Monitor>) {
        // If the window is visible on the right monitor, there is nothing to do: only the report may have changed.
        let report = monitor.map(|monitor| monitor.report.clone());
        let window = self.desk.state().windows[index].window.clone();
        let is_shown = self.desk.state().windows[index].shown;
        let stays = match (&self.placed[index].on, &report) {
            (Some(on), Some(report)) => on.has_place_of(report),
            (on, report) => on.is_none() && report.is_none(),
        };
        if window.is_some() && is_shown && stays {
            if self.placed[index].on != report {
                self.desk.change(|desk| desk.windows[index].put_on(report.as_ref()));
                self.placed[index].on = report;
            }
            return;
        }
        // Create the window hidden, or adapt the existing one.
        let (position, [width, height]) = self.geometry(index, monitor);
        let fills = self.placed[index].fills;
        // The window library can do this only for monitors that it knows. On X11, the window is enlarged below.
        let handle = monitor.filter(|_| fills).and_then(|monitor| monitor.handle.clone());
        let fullscreen = handle.map(|handle| Fullscreen::Borderless(Some(handle)));
        let size = PhysicalSize::new(width, height);
        let place = position.map(|[x, y]| PhysicalPosition::new(x, y));
        let window = match window {
            Some(window) => {
                window.set_decorations(!fills);
                window.set_fullscreen(fullscreen);
                window
            }
            None => {
                let config = &self.configs[index];
                let mut attributes = Window::default_attributes()
                    .with_title(format!("{} - Steradian", config.name))
                    .with_inner_size(size)
                    .with_decorations(!fills)
                    .with_visible(false)
                    .with_fullscreen(fullscreen);
                if let Some(place) = place {
                    attributes = attributes.with_position(place);
                }
                match events.create_window(attributes) {
                    Ok(window) => {
                        window.set_cursor_visible(config.cursor);
                        self.numbers.insert(window.id(), index);
                        Arc::new(window)
                    }
                    Err(error) => {
                        let name = config.name.clone();
                        self.fail(events, WindowsError::Window { window: name, problem: error.to_string() });
                        return;
                    }
                }
            }
        };
        // Set position and size first: a window manager lets a window fill the monitor that it is on, and without a
        // manager they are sufficient.
        if let Some(place) = place {
            window.set_outer_position(place);
        }
        let now = window.request_inner_size(size);
        if let Err(problem) = self.fill(&window, fills) {
            tracing::warn!("window `{}`: cannot notify the window manager: {problem}", self.configs[index].name);
        }
        // Show the window and pass its state to the presenting thread.
        window.set_visible(true);
        match &report {
            Some(report) => tracing::info!("window `{}` is on monitor {report}", self.configs[index].name),
            None => tracing::debug!("window `{}` is open", self.configs[index].name),
        }
        self.placed[index].on = report;
        let inner = now.unwrap_or_else(|| window.inner_size());
        let on = monitor.map(|monitor| monitor.report.clone()).or_else(|| self.report_of(&window));
        self.desk.change(|desk| {
            let of_desk = &mut desk.windows[index];
            of_desk.window = Some(window);
            of_desk.shown = true;
            of_desk.state = WindowState::Shown;
            of_desk.size = [inner.width, inner.height];
            of_desk.put_on(on.as_ref());
            of_desk.stale += 1;
        });
    }

    /// Returns the monitor on which the desktop has placed a window.
    fn report_of(&self, window: &Window) -> Option<MonitorReport> {
        let monitor = if self.desktop.is_some() {
            let (place, size) = (window.inner_position().ok()?, window.inner_size());
            monitors::below(&self.known, [place.x, place.y], [size.width, size.height])
        } else {
            let handle = window.current_monitor()?;
            self.known.iter().find(|monitor| monitor.handle.as_ref() == Some(&handle))
        };
        monitor.map(|monitor| monitor.report.clone())
    }

    /// Asks the X11 window manager to make a window fill its monitor, or to undo that.
    fn fill(&self, window: &Window, fills: bool) -> Result<(), String> {
        match &self.desktop {
            Some(desktop) => desktop.fill(window, fills).map_err(|error| error.to_string()),
            None => Ok(()),
        }
    }

    fn hide(&mut self, index: usize, reason: String) {
        let state = WindowState::MonitorMissing(reason);
        let mut desk = self.desk.state();
        let of_desk = &mut desk.windows[index];
        if of_desk.state == state {
            return;
        }
        tracing::warn!("window `{}` is not shown: {}", self.configs[index].name, state.reason());
        if let Some(window) = of_desk.window.as_ref().filter(|_| of_desk.shown) {
            window.set_visible(false);
        }
        of_desk.shown = false;
        of_desk.state = state;
        of_desk.put_on(None);
        self.placed[index].on = None;
    }

    fn close(&mut self, index: usize) {
        self.placed[index].closed = true;
        let mut desk = self.desk.state();
        let of_desk = &mut desk.windows[index];
        of_desk.shown = false;
        of_desk.state = WindowState::Closed;
        if let Some(window) = &of_desk.window {
            window.set_visible(false);
        }
        drop(desk);
        tracing::info!("window `{}` was closed", self.configs[index].name);
    }

    fn fail(&mut self, events: &ActiveEventLoop, error: WindowsError) {
        self.outcome = Err(error);
        events.exit();
    }

    fn key(&mut self, index: usize, key: &Key) {
        match key {
            Key::Named(NamedKey::Escape) => self.host.command(Command::Quit),
            Key::Character(letter) => match letter.to_lowercase().as_str() {
                "q" => self.host.command(Command::Quit),
                "t" => self.host.command(Command::TestPattern),
                "b" => self.desk.change(|desk| desk.blackout = !desk.blackout),
                "i" => self.desk.change(|desk| desk.identify = !desk.identify),
                "f" => {
                    let placed = &mut self.placed[index];
                    placed.fills = !placed.fills;
                    // Hide it here so that it is placed again.
                    self.desk.change(|desk| desk.windows[index].shown = false);
                }
                _ => {}
            },
            _ => {}
        }
    }

    /// Gives the keyboard focus to the first visible window if no window manager does.
    fn focus(&mut self) {
        let Some(desktop) = self.desktop.as_ref().filter(|_| !self.focused) else { return };
        let desk = self.desk.state().clone();
        let first = desk.windows.iter().find(|window| window.shown).and_then(|window| window.window.clone());
        let Some(window) = first else { return };
        if let Err(problem) = desktop.focus_if_unassigned(&window) {
            tracing::debug!("the keyboard focus is unchanged: {problem}");
        }
    }

    /// Ends the presenting thread and waits for it.
    fn end(&mut self) {
        self.desk.ended.store(true, Relaxed);
        if let Presenting::Runs(thread) = std::mem::replace(&mut self.presenter, Presenting::Ended) {
            let ended = thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic));
            if self.outcome.is_ok() {
                self.outcome = ended;
            }
        }
    }
}

impl ApplicationHandler<Notice> for App {
    fn resumed(&mut self, events: &ActiveEventLoop) {
        match Desktop::of(events) {
            Ok(desktop) => self.desktop = desktop,
            Err(problem) => {
                self.fail(events, WindowsError::Display(problem));
                return;
            }
        }
        let by_edid = |config: &&WindowConfig| matches!(config.monitor, Some(MonitorChoice::Edid(_)));
        if let Some(config) = self.configs.iter().find(by_edid).filter(|_| self.desktop.is_none()) {
            tracing::warn!("window `{}`: EDIDs can be read only with X11; name the connector instead", config.name);
        }
        self.look(events);
        let presenter = match std::mem::replace(&mut self.presenter, Presenting::Ended) {
            Presenting::NotYet(presenter) => presenter,
            other => {
                self.presenter = other;
                return;
            }
        };
        let (proxy, host) = (self.proxy.clone(), Arc::clone(&self.host));
        let started = thread::Builder::new().name("present".to_owned()).spawn(move || {
            // Notify the event loop, which waits for this event, even on a panic.
            struct EndNotice(EventLoopProxy<Notice>, Arc<dyn Host>);
            impl Drop for EndNotice {
                fn drop(&mut self) {
                    // An event loop without its display may never end.
                    self.1.presenting_ended();
                    // The event loop may have ended already.
                    let _ = self.0.send_event(Notice::Ended);
                }
            }
            let farewell = EndNotice(proxy, host);
            farewell.1.presenting_began();
            presenter.run()
        });
        match started {
            Ok(thread) => self.presenter = Presenting::Runs(thread),
            Err(error) => {
                self.fail(events, WindowsError::Display(format!("cannot start the presenting thread: {error}")))
            }
        }
    }

    fn user_event(&mut self, events: &ActiveEventLoop, Notice::Ended: Notice) {
        events.exit();
    }

    fn window_event(&mut self, events: &ActiveEventLoop, id: WindowId, event: WindowEvent) {
        let Some(&index) = self.numbers.get(&id) else { return };
        match event {
            WindowEvent::Resized(size) => self.desk.change(|desk| {
                let window = &mut desk.windows[index];
                window.size = [size.width, size.height];
                window.stale += 1;
            }),
            // A window that the desktop has placed may be moved later.
            WindowEvent::Moved(_) if self.placed[index].on.is_none() => {
                let window = self.desk.state().windows[index].window.clone();
                let on = window.and_then(|window| self.report_of(&window));
                self.desk.change(|desk| desk.windows[index].put_on(on.as_ref()));
            }
            WindowEvent::RedrawRequested => self.desk.change(|desk| desk.windows[index].stale += 1),
            WindowEvent::CloseRequested => {
                self.host.command(Command::Quit);
                self.close(index);
            }
            WindowEvent::Focused(focused) => self.focused = focused,
            WindowEvent::KeyboardInput {
                event: KeyEvent { logical_key, state: ElementState::Pressed, repeat: false, .. },
                is_synthetic: false,
                ..
            } => {
                self.key(index, &logical_key);
                self.place(events);
            }
            _ => {}
        }
    }

    fn about_to_wait(&mut self, events: &ActiveEventLoop) {
        self.look(events);
        events.set_control_flow(ControlFlow::WaitUntil(Instant::now() + LOOK));
    }
}
