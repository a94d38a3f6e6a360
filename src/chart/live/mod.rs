//! The axis `live`: the daemon as users run it. Measures frames per second that a daemon delivers to a client as 8-bit RGBA while the camera turns,
//! and the errors of these images, for several budgets (`accuracy.display_codes`).
//!
//! Each configuration runs in one daemon per budget, because the budget is a key of the configuration. All daemons run at
//! the same time and take turns in rounds, so that other activity of the machine affects all of them alike; daemons without
//! a reader draw nothing. The figures of a round are medians, and a row has the medians over the rounds.
//!
//! `service` comes after `chart` in the layers, so the caller passes in a function that starts a daemon ([`StartDaemon`]). Errors are measured with
//! the chart's own renderer, in the same view and at the exposure that the daemon delivered: the image of the budget against the exact one, before
//! rounding, over several poses of the same turn.
//!
//! A daemon that does not start, and a view that is not delivered, have rows without figures; the notes give the reason.

mod errors;
mod extent;
mod row;

pub(super) use self::row::{budget_of, keeps_budget};
pub use self::{
    extent::{LiveExtent, LiveScene},
    row::LiveMetric,
};
use super::{Axis, Budget, ChartError, ReportStep, Row, Step, timing::Spread};
use crate::render::Renderer;
use std::time::Duration;

/// Number of uncounted frames before the first round of a view. They build the map of faint light and other data.
const FIRST_SKIPPED: usize = 12;
/// Number of uncounted frames before each of the other rounds.
const SKIPPED: usize = 3;
/// Turning rate of the camera, degrees per second.
pub const LIVE_TURN_DEG_S: f64 = 5.0;

/// A configuration with a budget.
#[derive(Clone, Debug, PartialEq)]
pub struct LiveRequest<'a> {
    /// Name of the configuration.
    pub name: &'a str,
    /// The configuration, TOML.
    pub text: &'a str,
    /// Overrides of keys (`key=value`), the budget included.
    pub set: Vec<String>,
}

/// Measurements of a round.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct LiveRound {
    /// Frames per second that arrived.
    pub frames_per_s: f64,
    /// Median time between the arrivals of consecutive frames, ms.
    pub interval_ms: f64,
    /// Median time from the arrival of a frame's pose to the arrival of the frame, ms.
    pub age_ms: f64,
    /// Exposure, EV at ISO 100.
    pub ev100: f64,
    /// Pixels of all images of the view.
    pub pixels: u64,
    /// Median time of each part of a frame in the daemon, ms.
    pub parts_ms: Vec<(String, f64)>,
}

/// A running daemon, which ends when it is dropped.
pub trait LiveDaemon {
    /// Measures one round of a view, after `skipped` frames; the camera turns by [`LIVE_TURN_DEG_S`].
    ///
    /// # Errors
    /// The reason why frames are not delivered.
    fn measure(&mut self, view: &str, skipped: usize, length: Duration) -> Result<LiveRound, String>;
}

/// Function that starts a daemon; its error is the reason why the daemon does not serve.
pub type StartDaemon<'a> = &'a mut dyn FnMut(&LiveRequest<'_>) -> Result<Box<dyn LiveDaemon>, String>;

/// A configuration with a budget: its daemon, and the measurements of its views.
struct Run<'a> {
    scene: &'a LiveScene,
    codes: f64,
    /// The daemon, while it is needed.
    daemon: Option<Box<dyn LiveDaemon>>,
    /// Why the daemon did not start.
    failure: Option<String>,
    views: Vec<Shown<'a>>,
}

/// Measurements of a view.
struct Shown<'a> {
    view: &'a str,
    rounds: Vec<LiveRound>,
    failure: Option<String>,
}

impl Run<'_> {
    /// Measures a round of every view.
    fn measure(&mut self, number: usize, length: Duration) {
        let Some(daemon) = &mut self.daemon else { return };
        for shown in self.views.iter_mut().filter(|shown| shown.failure.is_none()) {
            match daemon.measure(shown.view, if number == 0 { FIRST_SKIPPED } else { SKIPPED }, length) {
                Ok(round) => shown.rounds.push(round),
                Err(reason) => shown.failure = Some(reason),
            }
        }
    }
}

impl Shown<'_> {
    /// Returns the spread of a figure over the rounds; `None` if there is no round, or if a later round failed.
    fn spread(&self, figure: impl Fn(&LiveRound) -> f64) -> Option<Spread> {
        let values: Vec<f64> = self.rounds.iter().map(figure).collect();
        Spread::from_values(&values).filter(|_| self.failure.is_none())
    }

    fn median(&self, figure: impl Fn(&LiveRound) -> f64) -> Option<f64> {
        self.spread(figure).map(|spread| spread.median_ms)
    }
}

pub(super) fn run(
    renderer: &mut Renderer,
    start: StartDaemon<'_>,
    extent: &LiveExtent,
    budget: Budget,
    report_step: ReportStep<'_>,
) -> Result<Vec<Row>, ChartError> {
    let daemons: usize = extent.scenes.iter().map(|scene| scene.budgets_codes.len()).sum();
    let total = daemons + extent.rounds + extent.scenes.len();
    let mut done = 0;
    let mut step = |task: String| {
        report_step(&Step { axis: Axis::Live, done, total, task });
        done += 1;
    };
    // Start a daemon for each configuration and budget.
    let mut runs = Vec::new();
    for scene in &extent.scenes {
        for &codes in &scene.budgets_codes {
            step(format!("starting {}, {codes} codes", scene.name));
            let set = scene.overrides(codes);
            let started = start(&LiveRequest { name: &scene.name, text: &scene.text, set });
            let (daemon, failure) = match started {
                Ok(daemon) => (Some(daemon), None),
                Err(reason) => (None, Some(reason)),
            };
            let shown = |view| Shown { view, rounds: Vec::new(), failure: None };
            let views = scene.views.iter().map(|view| shown(view.as_str())).collect();
            runs.push(Run { scene, codes, daemon, failure, views });
        }
    }
    // Measure in turns; each round begins with another daemon. Every daemon has at least one round.
    for round in 0..extent.rounds {
        step(format!("round {}", round + 1));
        if round == 0 || !budget.is_over() {
            let first = round % runs.len().max(1);
            let (before, from_first) = runs.split_at_mut(first);
            from_first.iter_mut().chain(before).for_each(|run| run.measure(round, extent.round));
        }
    }
    // End the daemons, so that they take no memory while errors are measured.
    runs.iter_mut().for_each(|run| run.daemon = None);
    let mut rows = Vec::new();
    for scene in &extent.scenes {
        step(format!("errors of {}", scene.name));
        let of_scene: Vec<&Run<'_>> = runs.iter().filter(|run| std::ptr::eq(run.scene, scene)).collect();
        rows.extend(row::rows(renderer, scene, &of_scene, extent)?);
    }
    Ok(rows)
}
