//! The chart: speed against accuracy of every method, from one run.
//!
//! An [`Axis`] compares many methods in one respect. Its module uses a renderer to produce [`Row`]s: one figure of merit and the time of the method,
//! for each method, workload and metric. `csv`, `svg` and `html` display the rows and do not depend on how they were measured, so a new axis is an
//! entry in [`Axis`] and a module with one function.
//!
//! - `workloads`: skies and views of a quick and of a full run;
//! - `timing`: frames of all methods in turn, within a time budget;
//! - `scenes`: small artificial skies whose correct picture is known;
//! - `scores`: the figures of one method over those scenes, by [`crate::metrics`];
//! - `stars`, `glare`, `asteroids`, `projectors`, `views`, `scale`, `live`: the axes;
//! - `deep`: stores that do not fit in memory, for the axis `scale`;
//! - `display_errors`: errors of display images against exact ones, for the axis `live` and for tests;
//! - `summary`: one line per method;
//! - `pareto`: methods that no other method beats in both time and accuracy.
//!
//! Time is GPU time from the clearing of the first buffer to the end of the last pass, plus culling on the CPU, in ms.
//! It thus covers clear, cull, splat and resolve for every method; for the axes `glare` and `asteroids` it covers their
//! passes, and on the axis `live` it is the time between frames that reach a client. Scores are dimensionless unless the metric's name has a unit. A figure that could not be measured is empty,
//! never 0, and the notes give the reason.

mod asteroids;
mod csv;
mod deep;
mod display_errors;
mod glare;
mod html;
mod live;
mod pareto;
mod projectors;
mod scale;
mod scenes;
mod scores;
mod stars;
mod summary;
mod svg;
mod timing;
mod views;
mod workloads;

use std::{
    fmt, io,
    path::{Path, PathBuf},
    time::{Duration, Instant, SystemTime, UNIX_EPOCH},
};

use self::workloads::Skies;
pub use self::{
    asteroids::AsteroidExtent,
    csv::{COLUMNS, Row, read_csv, write_csv},
    deep::DeepMetric,
    display_errors::{DisplayErrors, code_errors},
    live::{LIVE_TURN_DEG_S, LiveDaemon, LiveExtent, LiveMetric, LiveRequest, LiveRound, LiveScene, StartDaemon},
    pareto::{ParetoError, pareto_front},
    projectors::ProjectorMetric,
    scores::{AsteroidMetric, GlareMetric, Metric, Score, Scores, ScoringSize, score_method},
    summary::summary,
    timing::Spread,
    workloads::{Extent, GlareExtent, Sky, ViewShape},
};
use crate::{
    catalogue::{deep::DeepError, galaxy::GalaxyError},
    files,
    gpu::{AdapterReport, GpuError},
    render::Renderer,
    scene::{asteroids::SpecError, loader::LoadError},
    view::RigError,
};

/// Error of a chart.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ChartError {
    /// The device failed, so later measurements would be meaningless.
    #[error(transparent)]
    Gpu(GpuError),
    /// The stars of a workload cannot be made.
    #[error(transparent)]
    Galaxy(#[from] GalaxyError),
    /// A deep store of the axis `scale` cannot be made.
    #[error(transparent)]
    Deep(#[from] DeepError),
    /// A deep store of the axis `scale` cannot be loaded.
    #[error(transparent)]
    Load(#[from] Box<LoadError>),
    /// The asteroids of a workload cannot be made.
    #[error(transparent)]
    Field(#[from] SpecError),
    /// The projector of the axis `projectors` cannot be built.
    #[error("projectors: {0}")]
    Projector(String),
    /// A view of a workload cannot be built.
    #[error(transparent)]
    Rig(#[from] RigError),
    /// A file cannot be written.
    #[error("cannot write {path}: {source}")]
    Write {
        /// The file.
        path: PathBuf,
        /// Reason.
        source: io::Error,
    },
    /// The table cannot be written or read.
    #[error("chart.csv: {0}")]
    Csv(String),
}

/// Subject of a chart.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Axis {
    /// Every method of drawing stars: time against each error.
    Stars,
    /// Every method of drawing glare, in every projection: time against each error.
    Glare,
    /// Every method of drawing asteroid fields: time against the number of asteroids, and errors relative to the finest meshes.
    Asteroids,
    /// Drawing directly into a projector's pixels compared with warping a flat picture: time against errors of stars.
    Projectors,
    /// Cost of each additional view of the same frame.
    Views,
    /// Time against the number of stars.
    Scale,
    /// Time between the frames that a daemon delivers to a client, against the errors of these display images.
    Live,
}

named!(Axis {
    Stars = "stars",
    Glare = "glare",
    Asteroids = "asteroids",
    Projectors = "projectors",
    Views = "views",
    Scale = "scale",
    Live = "live",
});

impl Axis {
    /// Returns the heading of the axis.
    pub fn title(self) -> &'static str {
        match self {
            Self::Stars => "Drawing stars: time against error",
            Self::Glare => "Glare: time against error",
            Self::Asteroids => "Fields of asteroids: time against their number",
            Self::Projectors => "Projectors: time against error of stars",
            Self::Views => "Many views of one frame: each by itself and all together",
            Self::Scale => "Time against the number of stars",
            Self::Live => "Delivered frames: time against error of display images",
        }
    }

    /// Parses a name.
    ///
    /// # Errors
    ///
    /// The name is unknown; the message lists the valid ones.
    pub fn parse(name: &str) -> Result<Self, String> {
        Self::from_name(name).ok_or_else(|| format!("must be one of {}", Self::ALL.map(Self::name).join(", ")))
    }
}

/// A step of the work, for progress reports.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Step {
    /// The axis.
    pub axis: Axis,
    /// Number of steps of the axis that are done.
    pub done: usize,
    /// Number of steps of the axis.
    pub total: usize,
    /// Description of the step that starts.
    pub task: String,
}

/// Callback that receives progress.
pub type ReportStep<'a> = &'a mut dyn FnMut(&Step);

/// Charts the axes one after the other. `start_daemon` starts the daemons of the axis `live`.
///
/// # Errors
/// [`ChartError`] if the device fails or a workload cannot be made. A method that fails has rows with a note.
pub fn run(
    renderer: &mut Renderer,
    axes: &[Axis],
    extent: &Extent,
    start_daemon: StartDaemon<'_>,
    report_step: ReportStep<'_>,
) -> Result<Vec<Row>, ChartError> {
    let budget = Budget::new(extent.budget);
    let mut skies = Skies::default();
    let mut rows = Vec::new();
    for (index, &axis) in axes.iter().enumerate() {
        let weight = |axis: Axis| match axis {
            Axis::Stars => 6.0,
            Axis::Glare | Axis::Asteroids | Axis::Live => 3.0,
            Axis::Projectors | Axis::Views | Axis::Scale => 1.0,
        };
        let share = weight(axis) / axes[index..].iter().map(|axis| weight(*axis)).sum::<f64>();
        let budget = budget.part(share, 1);
        rows.extend(match axis {
            Axis::Stars => stars::run(renderer, extent, &mut skies, budget, report_step)?,
            Axis::Glare => glare::run(renderer, extent, &mut skies, budget.at_most(extent.glare.budget), report_step)?,
            Axis::Asteroids => asteroids::run(renderer, extent, budget.at_most(extent.asteroids.budget), report_step)?,
            Axis::Projectors => projectors::run(renderer, extent, &mut skies, budget, report_step)?,
            Axis::Views => views::run(renderer, extent, &mut skies, budget, report_step)?,
            Axis::Scale => scale::run(renderer, extent, &mut skies, budget, report_step)?,
            Axis::Live => {
                let budget = budget.at_most(extent.live.budget);
                live::run(renderer, start_daemon, &extent.live, budget, report_step)?
            }
        });
    }
    Ok(rows)
}

/// A span of time that an axis divides among its parts.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Budget {
    end: Instant,
}

impl Budget {
    fn new(length: Duration) -> Self {
        Self { end: Instant::now() + length }
    }

    /// Returns the remaining time, zero if the budget is used up.
    fn left(&self) -> Duration {
        self.end.saturating_duration_since(Instant::now())
    }

    /// Returns one of `parts` equal parts of a share (0 to 1) of the remaining time.
    fn part(&self, share: f64, parts: usize) -> Self {
        Self { end: Instant::now() + self.left().mul_f64(share) / parts.max(1) as u32 }
    }

    /// Returns this budget, limited to a length.
    fn at_most(&self, length: Duration) -> Self {
        Self { end: self.end.min(Instant::now() + length) }
    }

    fn is_over(&self) -> bool {
        self.left() == Duration::ZERO
    }
}

/// Adapter, date and command of a chart, shown to its readers.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct About {
    /// Name of the adapter.
    pub adapter: String,
    /// Driver of the adapter.
    pub driver: String,
    /// Date and time in UTC.
    pub date: String,
    /// Command line that made the chart.
    pub command: String,
}

impl About {
    /// Describes a chart made now on an adapter by a command.
    pub fn now(adapter: &AdapterReport, command: &str) -> Self {
        let seconds = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_secs());
        Self {
            adapter: adapter.adapter.clone(),
            driver: adapter.driver.clone(),
            date: UtcTime(seconds).to_string(),
            command: command.to_owned(),
        }
    }
}

/// Seconds since 1970-01-01T00:00:00 UTC, displayed as date and minute of the Gregorian calendar.
struct UtcTime(u64);

impl fmt::Display for UtcTime {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let leap = |year: u64| year.is_multiple_of(4) && !year.is_multiple_of(100) || year.is_multiple_of(400);
        let (mut day, mut year) = (self.0 / 86_400, 1970);
        while day >= 365 + u64::from(leap(year)) {
            day -= 365 + u64::from(leap(year));
            year += 1;
        }
        let february = 28 + u64::from(leap(year));
        let mut month = 1;
        for length in [31, february, 31, 30, 31, 30, 31, 31, 30, 31, 30, 31] {
            if day < length {
                break;
            }
            day -= length;
            month += 1;
        }
        let minutes = self.0 % 86_400 / 60;
        write!(f, "{year}-{month:02}-{:02} {:02}:{:02} UTC", day + 1, minutes / 60, minutes % 60)
    }
}

/// Writes `chart.csv`, one SVG per axis that has rows, and `index.html`; creates the folder. Returns the files.
///
/// # Errors
/// [`ChartError::Write`] with the file that cannot be written, [`ChartError::Csv`] if a row is invalid.
pub fn write(folder: &Path, rows: &[Row], about: &About) -> Result<Vec<PathBuf>, ChartError> {
    let wrong = |path: &Path| {
        let path = path.to_owned();
        move |source| ChartError::Write { path, source }
    };
    std::fs::create_dir_all(folder).map_err(wrong(folder))?;
    let mut files = vec![("chart.csv".to_owned(), write_csv(rows)?)];
    let mut pictures = Vec::new();
    for axis in Axis::ALL {
        let of_axis: Vec<&Row> = rows.iter().filter(|row| row.axis == axis.name()).collect();
        if !of_axis.is_empty() {
            let name = format!("{}.svg", axis.name());
            files.push((name.clone(), svg::draw(axis, &of_axis, about)));
            pictures.push((axis, name));
        }
    }
    files.push(("index.html".to_owned(), html::page(rows, &pictures, about)));
    let mut written = Vec::new();
    for (name, text) in files {
        let path = folder.join(name);
        files::write_whole(&path, text.as_bytes()).map_err(wrong(&path))?;
        written.push(path);
    }
    Ok(written)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unknown_axis_is_refused_with_the_valid_names() {
        for axis in Axis::ALL {
            assert_eq!(Axis::parse(axis.name()), Ok(axis));
        }
        assert_eq!(
            Axis::parse("Stars").unwrap_err(),
            "must be one of stars, glare, asteroids, projectors, views, scale, live"
        );
    }

    #[test]
    fn utc_dates_match_the_calendar() {
        for (seconds, text) in [
            (0, "1970-01-01 00:00 UTC"),
            (951_782_400, "2000-02-29 00:00 UTC"),
            (951_868_799, "2000-02-29 23:59 UTC"),
            (951_868_800, "2000-03-01 00:00 UTC"),
            (1_234_567_890, "2009-02-13 23:31 UTC"),
            (4_107_542_399, "2100-02-28 23:59 UTC"),
            (4_107_542_400, "2100-03-01 00:00 UTC"),
        ] {
            assert_eq!(UtcTime(seconds).to_string(), text);
        }
    }

    #[test]
    fn budget_divides_and_runs_out() {
        let budget = Budget::new(Duration::from_secs(100));
        let part = budget.part(0.5, 10);
        assert!(part.left() <= Duration::from_secs(5) && part.left() > Duration::from_secs(4));
        assert!(!part.is_over());
        assert!(budget.at_most(Duration::from_secs(1)).left() <= Duration::from_secs(1));
        assert!(part.at_most(Duration::from_secs(50)).left() <= Duration::from_secs(5));
        assert!(Budget::new(Duration::ZERO).part(1.0, 0).is_over());
    }
}
