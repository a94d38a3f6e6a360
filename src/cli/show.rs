//! `show`: displays the windows of a configuration without a daemon.

use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::{Duration, SystemTime};

use clap::Args;

use super::ending::ended_by_signal;
use super::{
    CliError,
    load::{self, LoadedScene, PendingObjects},
    lock, results,
};
use crate::config::{Config, WindowConfig};
use crate::gpu::{Gpu, GpuOptions};
use crate::plan::view_settings::FrameGroup;
use crate::render::{Frame, FrameRequest, RenderError, Renderer, Wanted};
use crate::scene::overlay::Overlay;
use crate::scene::{EndNotice, SceneClock, SceneObjects, SceneSnapshot, SeenStars};
use crate::view::Rig;
use crate::windows::{
    self, Command, Host, Intervals, Next, ShownImage, WindowFigures, WindowFrame, WindowImage, WindowState,
    WithoutDisplay,
};

/// Maximum time that windows wait for a frame before they check for other changes.
const PATIENCE: Duration = Duration::from_millis(30);

/// Arguments of `show`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    steradian show --config configs/windows.toml\n  \
    steradian show --config configs/dome.toml --frames 300\n  \
    steradian show --monitors\n\n\
    Opens the [[windows]] of a configuration; without any, one decorated window for each image of each view. Draws until Escape, Q, a\n\
    closed window, SIGINT or SIGTERM; then prints frames, intervals and missed refreshes of each window.\n\
    Keys: T test pattern, B blackout, I names of windows and monitors, F full screen. Needs X11 or Wayland: docs/windows.md.")]
pub struct ShowArguments {
    /// Configuration file. Default: a dome and a flat view of bright and synthetic stars.
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Override a key of the configuration; can be repeated.
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Exit after this many frames.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..), allow_negative_numbers = true)]
    frames: Option<u64>,
    /// Open all windows with a frame and in their own sizes; the desktop places them.
    #[arg(long)]
    windowed: bool,
    /// List the monitors of this machine and exit.
    #[arg(long, conflicts_with_all = ["config", "set", "frames", "windowed"])]
    monitors: bool,
}

/// Images that these windows show.
pub(super) fn wanted_by(windows: &[WindowConfig]) -> Wanted {
    let mut wanted = Wanted::default();
    windows.iter().for_each(|window| wanted |= window.format.wanted(false));
    wanted
}

/// Runs the command.
pub fn run(arguments: ShowArguments, options: &GpuOptions) -> Result<(), CliError> {
    if arguments.monitors {
        for monitor in windows::monitors()? {
            results::line(monitor)?;
        }
        return Ok(());
    }
    let config = Config::load_or_built_in(arguments.config.as_deref(), &arguments.set)?;
    // The scene's clock starts when the configuration is read.
    let clock = config.clock();
    let (rig, camera, groups) = (config.rig()?, config.camera()?, config.frame_groups()?);
    let of_windows = windows_of(&config, &rig, arguments.windowed)?;
    if config.accuracy.frame_ms.is_some() {
        tracing::info!(
            "{}: accuracy.frame_ms applies only to `serve`: windows are always drawn at full quality",
            config.origin
        );
    }
    // Check everything that can be refused before loading the stars, which takes longest.
    windows::check_display()?;
    let objects = PendingObjects::begin(&config);
    let mut renderer = Renderer::new(Gpu::open(options)?);
    renderer.check(&rig).map_err(|error| CliError::render(error.into(), &config.origin))?;
    let ended = ended_by_signal().map_err(CliError::Runtime)?;
    let wanted = wanted_by(&of_windows);
    let LoadedScene { stars, objects, prepared, .. } =
        load::scene(&config, objects, &groups, wanted, &mut renderer, None)?;
    prepared.map_err(|error| CliError::render(error, &config.origin))?;

    let sizes: Vec<[u32; 2]> = of_windows.iter().filter_map(|window| size_of(window, &rig)).collect();
    let adapter = renderer.adapter().adapter.clone();
    // While one frame is presented, another waits in the channel and a third is drawn.
    let (sender, frames) = sync_channel(1);
    let viewer = Arc::new(Viewer {
        frames: Mutex::new(frames),
        shown: Mutex::new(vec![false; of_windows.len()]),
        figures: Mutex::default(),
        most_frames: arguments.frames,
        test_patterns: AtomicBool::new(false),
        ended,
    });
    let stars = Arc::new(stars);
    let scene = SceneSnapshot { revision: 1, stars: Arc::clone(&stars), objects: Arc::clone(&objects), camera };
    let stars = SeenStars::new(stars, objects.observer.as_ref(), config.star_sources());
    let of_drawing = Arc::clone(&viewer);
    let configs = of_windows.clone();
    let drawing = thread::Builder::new().name("draw".to_owned()).spawn(move || {
        Drawing {
            viewer: of_drawing,
            renderer,
            rig,
            groups,
            windows: configs,
            scene,
            objects,
            clock,
            end_notice: EndNotice::default(),
            stars,
            sender,
        }
        .run()
    });
    let drawing = drawing.map_err(CliError::Runtime)?;
    let host: Arc<dyn Host> = Arc::clone(&viewer) as Arc<dyn Host>;
    let opened = windows::open(&of_windows, &sizes, &adapter, host, WithoutDisplay::Ends);
    viewer.ended.store(true, Relaxed);
    // Drain frames until the drawing thread ends, because it may be blocked on a full channel.
    while matches!(lock(&viewer.frames).recv_timeout(PATIENCE), Ok(_) | Err(RecvTimeoutError::Timeout)) {}
    let drawn = drawing.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic));
    drawn.map_err(|error| CliError::render(error, &config.origin))?;
    opened?;
    for figures in lock(&viewer.figures).iter() {
        results::line(report(figures))?;
    }
    Ok(())
}

/// Returns the windows of a configuration, or the default windows if it has none.
fn windows_of(config: &Config, rig: &Rig, windowed: bool) -> Result<Vec<WindowConfig>, CliError> {
    if rig.views().is_empty() {
        return Err(CliError::Usage(format!("{}: views: at least one [[views]] is needed to show", config.origin)));
    }
    let images = rig.views().iter().flat_map(|view| view.images.iter().map(|image| (&view.name, image.part)));
    if config.windows.is_empty() {
        return Ok(images.map(|(view, part)| WindowConfig::of_image(view, part)).collect());
    }
    let in_frame = |window: &WindowConfig| {
        if windowed {
            WindowConfig { fullscreen: false, monitor: None, position: None, ..window.clone() }
        } else {
            window.clone()
        }
    };
    Ok(config.windows.iter().map(in_frame).collect())
}

/// Returns width and height of a window's image, pixels.
pub(super) fn size_of(window: &WindowConfig, rig: &Rig) -> Option<[u32; 2]> {
    let (_, view, image) = window.image_of(rig)?;
    Some(view.output_size(&view.images[image]))
}

fn report(figures: &WindowFigures) -> String {
    let WindowFigures { name, monitor, refresh_hz, frames, intervals, missed, state, .. } = figures;
    let on = if monitor.is_empty() { String::new() } else { format!(" on {monitor}") };
    let refresh = refresh_hz.map_or("refresh rate unknown".to_owned(), |rate| format!("{rate:.2} Hz"));
    let times = intervals.map_or("no intervals".to_owned(), |Intervals { median_ms, p99_ms, longest_ms }| {
        format!("intervals median {median_ms:.2} ms, 99 % below {p99_ms:.2}, at most {longest_ms:.2}")
    });
    let missed = missed.map_or("missed refreshes unknown".to_owned(), |missed| format!("{missed} refreshes missed"));
    let state = match state {
        WindowState::Shown => String::new(),
        other if other.reason().is_empty() => format!("; {}", other.name()),
        other => format!("; {}: {}", other.name(), other.reason()),
    };
    format!("{name}{on}: {frames} frames, {refresh}, {times}, {missed}{state}")
}

/// Host of the windows of `show`. Nothing changes its scene except the key for test patterns.
struct Viewer {
    frames: Mutex<Receiver<WindowFrame>>,
    /// Which windows are visible.
    shown: Mutex<Vec<bool>>,
    figures: Mutex<Vec<WindowFigures>>,
    /// Number of frames after which to end.
    most_frames: Option<u64>,
    test_patterns: AtomicBool,
    ended: Arc<AtomicBool>,
}

impl Host for Viewer {
    fn next(&self, shown: &[bool]) -> Next {
        if self.ended.load(Relaxed) {
            return Next::End;
        }
        shown.clone_into(&mut lock(&self.shown));
        match lock(&self.frames).recv_timeout(PATIENCE) {
            Ok(frame) => Next::Frame(frame),
            Err(RecvTimeoutError::Timeout) => Next::Drawing,
            // The reason of the failure is known when the thread is joined.
            Err(RecvTimeoutError::Disconnected) => Next::End,
        }
    }

    fn command(&self, command: Command) {
        match command {
            Command::TestPattern => {
                self.test_patterns.fetch_xor(true, Relaxed);
            }
            Command::Quit => self.ended.store(true, Relaxed),
        }
    }

    fn figures(&self, figures: Vec<WindowFigures>) {
        let least =
            figures.iter().filter(|figures| figures.state == WindowState::Shown).map(|figures| figures.frames).min();
        if least.zip(self.most_frames).is_some_and(|(least, most)| least >= most) {
            self.ended.store(true, Relaxed);
        }
        *lock(&self.figures) = figures;
    }
}

/// State of the drawing thread.
struct Drawing {
    viewer: Arc<Viewer>,
    renderer: Renderer,
    rig: Rig,
    groups: Vec<FrameGroup>,
    windows: Vec<WindowConfig>,
    scene: SceneSnapshot,
    /// Objects of the configuration.
    objects: Arc<SceneObjects>,
    clock: SceneClock,
    end_notice: EndNotice,
    stars: Arc<SeenStars>,
    sender: SyncSender<WindowFrame>,
}

impl Drawing {
    fn run(mut self) -> Result<(), RenderError> {
        let mut patterned = false;
        while !self.viewer.ended.load(Relaxed) {
            let wanted = self.viewer.test_patterns.load(Relaxed);
            if patterned != wanted {
                patterned = wanted;
                self.scene.revision += 1;
                self.scene.objects = self.objects_with(patterned);
            }
            let now = SystemTime::now();
            self.end_notice.look(&self.clock, now);
            let time_s = self.clock.time_s(now);
            self.scene = self.stars.scene_at(&self.scene, time_s);
            let shown = lock(&self.viewer.shown).clone();
            if !shown.contains(&true) {
                thread::sleep(PATIENCE);
                continue;
            }
            let frame = self.draw(&shown, patterned)?;
            if self.sender.send(frame).is_err() {
                return Ok(());
            }
        }
        Ok(())
    }

    fn objects_with(&self, patterned: bool) -> Arc<SceneObjects> {
        let now = self.scene.objects.as_ref();
        if !patterned {
            let overlay = Arc::clone(&self.objects.overlay);
            return Arc::new(SceneObjects { overlay, ..now.clone() });
        }
        let mut names: Vec<String> = self.windows.iter().map(|window| window.view.clone()).collect();
        names.dedup();
        let overlay = Arc::new(Overlay { test_patterns: names, ..(*self.objects.overlay).clone() });
        Arc::new(SceneObjects { overlay, ..now.clone() })
    }

    /// Draws one frame of the same scene for each group of views that a window shows.
    fn draw(&mut self, shown: &[bool], patterned: bool) -> Result<WindowFrame, RenderError> {
        let mut wanted = vec![Wanted::default(); self.rig.views().len()];
        for (window, _) in self.windows.iter().zip(shown).filter(|(_, shown)| **shown) {
            if let Some((view, ..)) = window.image_of(&self.rig) {
                wanted[view] |= window.format.wanted(patterned);
            }
        }
        let mut frames: Vec<(usize, Arc<Frame>)> = Vec::new();
        for (number, group) in self.groups.iter().enumerate() {
            let of_group: Vec<Wanted> = group.views.iter().map(|view| wanted[*view]).collect();
            if of_group.iter().all(|wanted| *wanted == Wanted::default()) {
                continue;
            }
            let request = FrameRequest::for_group(&self.scene, &self.groups, number).wanted_per_view(&of_group);
            frames.push((number, Arc::new(self.renderer.render(request)?.with_views(&group.views))));
        }
        let image = |(window, shown): (&WindowConfig, &bool)| {
            let found = window.image_of(&self.rig).filter(|_| *shown).and_then(|(view, of_view, image)| {
                let part = of_view.images[image].part;
                frames.iter().find_map(|(group, frame)| {
                    let image = frame.images.iter().position(|image| image.view == view && image.part == part)?;
                    let tone_map = self.groups[*group].settings.tone_map;
                    Some(ShownImage { frame: Arc::clone(frame), image, tone_map })
                })
            });
            found.map_or(WindowImage::AsBefore, WindowImage::Image)
        };
        Ok(WindowFrame { images: self.windows.iter().zip(shown).map(image).collect() })
    }
}
