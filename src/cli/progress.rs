//! Progress of long work on standard error: a bar on a terminal, plain log lines elsewhere.

use std::io::{self, IsTerminal};
use std::sync::LazyLock;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use indicatif::{MultiProgress, ProgressBar, ProgressStyle};

use crate::catalogue::deep::build::{BuildStep, OnStep};
use crate::render::PrepareStep;
use crate::scene::loader::LoadStep;
use crate::service::StartProgress;

/// All bars together, because several kinds of work run at the same time.
static BARS: LazyLock<MultiProgress> = LazyLock::new(MultiProgress::new);

/// Returns a bar if standard error is a terminal.
fn bar() -> Option<ProgressBar> {
    bar_like("{spinner} {wide_bar} {pos}/{len} {msg} [{elapsed}]")
}

fn bar_like(template: &str) -> Option<ProgressBar> {
    io::stderr().is_terminal().then(|| {
        let bar = BARS.add(ProgressBar::no_length());
        // The template has only known keys, so it parses. If it did not, the plain style would be used.
        let style = ProgressStyle::with_template(template);
        bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
        bar.enable_steady_tick(Duration::from_millis(120));
        bar
    })
}

/// Progress of one piece of work.
pub struct Progress<'a> {
    bar: Option<ProgressBar>,
    started: Instant,
    /// Second receiver of the steps, and the name that the work has there.
    told: Option<(&'a StartProgress, &'static str)>,
}

impl<'a> Progress<'a> {
    /// Starts the progress.
    pub fn new() -> Self {
        Self { bar: bar(), started: Instant::now(), told: None }
    }

    /// Starts the progress of one part of the preparation of the first frame.
    pub fn of_start(told: Option<&'a StartProgress>, work: &'static str) -> Self {
        Self { told: told.map(|told| (told, work)), ..Self::new() }
    }

    fn tell(&self, step: String) {
        if let Some((told, work)) = self.told {
            told.tell(work, step);
        }
    }

    /// Shows a step on the bar, with `done` of `total` steps before it; without a bar, calls `log`.
    pub fn step(&self, done: usize, total: usize, message: String, log: impl FnOnce(&str)) {
        match &self.bar {
            Some(bar) => {
                bar.set_length(total as u64);
                bar.set_position(done as u64);
                bar.set_message(message);
            }
            None => log(&message),
        }
    }

    /// Reports the next step of making pipelines.
    pub fn prepare_step(&self, PrepareStep { name, done, total }: PrepareStep) {
        self.tell(format!("shaders: {name} ({done} of {total})"));
        self.step(done, total, format!("shaders: {name}"), |text| tracing::debug!("{text} ({done} of {total})"));
    }

    /// Reports the next step of loading a scene.
    pub fn load_step(&self, step: &LoadStep) {
        let text = match step {
            LoadStep::Catalogue { name, .. } => format!("loading {name}"),
            LoadStep::Overlaps => "looking for stars listed in two catalogues".to_owned(),
            LoadStep::Chunks { stars } => format!("sorting {stars} stars"),
        };
        self.tell(text.clone());
        match (&self.bar, step) {
            (_, LoadStep::Catalogue { index, of, .. }) => {
                // One step per catalogue, plus one for sorting.
                self.step(*index, *of + 1, text, |text| tracing::info!("{text} ({} of {of})", index + 1));
            }
            (Some(bar), LoadStep::Chunks { .. }) => {
                bar.set_position(bar.length().unwrap_or(1).saturating_sub(1));
                bar.set_message(text);
            }
            (Some(bar), LoadStep::Overlaps) => bar.set_message(text),
            (None, _) => tracing::info!("{text}"),
        }
    }

    /// Ends the progress and returns its duration in seconds.
    pub fn finish(self) -> f64 {
        if let Some((told, work)) = self.told {
            told.done(work);
        }
        if let Some(bar) = self.bar {
            bar.finish_and_clear();
        }
        self.started.elapsed().as_secs_f64()
    }
}

/// Interval between plain log lines about a film.
const FILM_LINES: Duration = Duration::from_secs(5);

/// Progress of a film.
pub struct FilmProgress {
    bar: Option<ProgressBar>,
    started: Instant,
    last_line: Instant,
    frames: usize,
}

impl FilmProgress {
    /// Starts the progress with the number of frames to draw.
    pub fn new(frames: usize) -> Self {
        let bar = bar_like("{spinner} {wide_bar} {pos}/{len} {msg} [{elapsed}, {eta} left]");
        if let Some(bar) = &bar {
            bar.set_length(frames as u64);
        }
        Self { bar, started: Instant::now(), last_line: Instant::now(), frames }
    }

    /// Reports that `done` frames are drawn and that `frame` is the last of them.
    pub fn drawn(&mut self, frame: u32, done: usize) {
        if let Some(bar) = &self.bar {
            bar.set_position(done as u64);
            bar.set_message(format!("frame {frame}"));
        } else if self.last_line.elapsed() >= FILM_LINES || done == self.frames {
            self.last_line = Instant::now();
            let per_frame_s = self.started.elapsed().as_secs_f64() / done.max(1) as f64;
            let left_s = per_frame_s * (self.frames - done) as f64;
            tracing::info!("frame {frame}: {done} of {}, {per_frame_s:.3} s each, {left_s:.0} s left", self.frames);
        }
    }

    /// Ends the progress.
    pub fn finish(self) {
        if let Some(bar) = self.bar {
            bar.finish_and_clear();
        }
    }
}

/// Progress of reading the files of a film, from several threads.
pub struct FileProgress {
    bar: Option<ProgressBar>,
    last_line: Mutex<Instant>,
}

impl FileProgress {
    /// Starts the progress.
    pub fn new() -> Self {
        Self {
            bar: bar_like("{spinner} {wide_bar} {pos}/{len} {msg} [{elapsed}]"),
            last_line: Mutex::new(Instant::now()),
        }
    }

    /// Reports that `done` of `total` files are read.
    pub fn read(&self, done: usize, total: usize) {
        let Some(bar) = &self.bar else {
            let mut last_line = self.last_line.lock().unwrap_or_else(PoisonError::into_inner);
            if last_line.elapsed() >= FILM_LINES {
                *last_line = Instant::now();
                tracing::info!("reading frames: {done} of {total} files");
            }
            return;
        };
        bar.set_length(total as u64);
        bar.set_position(done as u64);
        bar.set_message("reading frames");
    }

    /// Ends the progress.
    pub fn finish(self) {
        if let Some(bar) = self.bar {
            bar.finish_and_clear();
        }
    }
}

/// Progress of building or reading a deep store: several parts of work, one after the other.
pub struct BuildProgress {
    bar: Option<ProgressBar>,
    /// The part, the time when it began, and the number of units that were done then.
    work: Option<(&'static str, Instant, u64)>,
    last_line: Instant,
}

impl BuildProgress {
    /// Shows the progress of `work`, which reports its steps.
    pub fn during<T>(work: impl FnOnce(&mut OnStep<'_>) -> T) -> T {
        let bar = bar_like("{spinner} {wide_bar} {percent}% {msg} [{elapsed}]");
        let mut progress = Self { bar, work: None, last_line: Instant::now() };
        let result = work(&mut |step| progress.step(step));
        if let Some(bar) = progress.bar {
            bar.finish_and_clear();
        }
        result
    }

    /// Reports a step: on a terminal at once, otherwise a line every five seconds and at the start of each part.
    fn step(&mut self, BuildStep { work, done, total }: BuildStep) {
        let is_new = self.work.is_none_or(|(current, ..)| current != work);
        if is_new {
            self.work = Some((work, Instant::now(), done));
        }
        // Time left, estimated from the mean speed of this part.
        let Some((_, started, from)) = self.work else { return };
        let elapsed_s = started.elapsed().as_secs_f64();
        let left_s = elapsed_s * total.saturating_sub(done) as f64 / done.saturating_sub(from).max(1) as f64;
        let left = if done > from { format!(", {left_s:.0} s left") } else { String::new() };
        if let Some(bar) = &self.bar {
            bar.set_length(total);
            bar.set_position(done);
            bar.set_message(format!("{work}{left}"));
        } else if is_new || self.last_line.elapsed() >= FILM_LINES {
            self.last_line = Instant::now();
            tracing::info!("{work}: {done} of {total}{left}");
        }
    }
}
