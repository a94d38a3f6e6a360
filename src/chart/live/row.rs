//! Rows of the axis `live`: one per configuration, view, budget and metric.

use super::{LiveExtent, LiveScene, Run, Shown, errors::Compared};
use crate::{
    chart::{Axis, ChartError, Row},
    render::Renderer,
};

/// Figure of a row of the axis `live`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LiveMetric {
    /// Error that 99.9 % of the channels of the display image do not exceed, 8-bit codes.
    Error999Codes,
    /// Largest error of the display image, 8-bit codes.
    ErrorLargestCodes,
    /// Frames per second that arrive.
    FramesPerS,
    /// Age of the pose of a frame that arrives, ms.
    PoseAgeMs,
    /// Exposure, EV at ISO 100.
    Ev100,
    /// Number of pixels.
    Pixels,
    /// Number of stars in view.
    StarsInView,
    /// Number of stars that are drawn one by one.
    StarsDrawn,
}

named!(LiveMetric {
    Error999Codes = "display_error_999_codes",
    ErrorLargestCodes = "display_error_largest_codes",
    FramesPerS = "frames_per_s",
    PoseAgeMs = "pose_age_ms",
    Ev100 = "ev100",
    Pixels = "pixels",
    StarsInView = "stars_in_view",
    StarsDrawn = "stars_drawn",
});

impl LiveMetric {
    /// Describes the metric in one line.
    pub fn meaning(self) -> &'static str {
        match self {
            Self::Error999Codes => {
                "error that 99.9 % of the channels do not exceed, relative to the exact image, 8-bit codes before rounding"
            }
            Self::ErrorLargestCodes => "the largest error, 8-bit codes before rounding",
            Self::FramesPerS => "frames per second that reach a client as 8-bit RGBA",
            Self::PoseAgeMs => "time from the arrival of a pose at the daemon to the arrival of its frame, median, ms",
            Self::Ev100 => "exposure of the delivered frames, EV at ISO 100",
            Self::Pixels => "pixels of a delivered frame",
            Self::StarsInView => "stars in the picture of the exact image",
            Self::StarsDrawn => "stars that the delivered frames draw one by one; the others are in a map",
        }
    }
}

/// Returns the name of the method, which is the budget.
pub(super) fn method(codes: f64) -> String {
    format!("{codes} codes")
}

/// Returns the budget of a row of the axis `live`, codes.
pub(in crate::chart) fn budget_of(row: &Row) -> Option<f64> {
    row.method.strip_suffix(" codes")?.parse().ok()
}

/// Whether an image keeps its budget: 99.9 % of the channels are within it, and all of them within four times that.
pub(in crate::chart) fn keeps_budget(budget_codes: f64, most_codes: f64, largest_codes: f64) -> bool {
    most_codes <= budget_codes && largest_codes <= 4.0 * budget_codes
}

/// Returns the rows of a configuration from `runs`, the measurements of its daemons.
pub(super) fn rows(
    renderer: &mut Renderer,
    scene: &LiveScene,
    runs: &[&Run<'_>],
    extent: &LiveExtent,
) -> Result<Vec<Row>, ChartError> {
    let adapter = renderer.adapter().adapter.clone();
    // Draw exact images only if a daemon of the configuration delivers frames.
    let delivers = runs.iter().any(|run| run.views.iter().any(|shown| !shown.rounds.is_empty()));
    let compared =
        if delivers { Compared::load(scene) } else { Err("not drawn, because no frame is delivered".into()) };
    let mut rows = Vec::new();
    for (index, name) in scene.views.iter().enumerate() {
        let mut evs: Vec<f64> = runs.iter().filter_map(|run| run.views[index].median(|round| round.ev100)).collect();
        evs.sort_by(f64::total_cmp);
        let view = compared.as_ref().map_err(Clone::clone).and_then(|compared| compared.view(name));
        let size = view.as_ref().map_or([0; 2], |(_, size)| *size);
        // All budgets have the same exposure, except that it differs a little if the view is metered while it turns.
        let errors = match (&compared, &view, evs.get(evs.len() / 2)) {
            (Ok(compared), Ok((rig, _)), Some(&ev100)) => {
                compared.errors(renderer, rig, &scene.budgets_codes, ev100, extent.poses)?
            }
            (Err(reason), ..) | (_, Err(reason), _) => Err(reason.clone()),
            _ => Err("not drawn, because no frame is delivered".to_owned()),
        };
        for (number, run) in runs.iter().enumerate() {
            let shown = &run.views[index];
            let failure = run.failure.as_ref().or(shown.failure.as_ref());
            let found = errors.as_ref().map(|found| found[number]);
            let time = shown.spread(|round| round.interval_ms);
            for metric in LiveMetric::ALL {
                let value = match metric {
                    LiveMetric::Error999Codes => found.ok().map(|found| found.most_codes),
                    LiveMetric::ErrorLargestCodes => found.ok().map(|found| found.largest_codes),
                    LiveMetric::StarsInView => found.ok().map(|found| found.stars_in_view.round()),
                    LiveMetric::StarsDrawn => found.ok().map(|found| found.stars_drawn.round()),
                    LiveMetric::FramesPerS => shown.median(|round| round.frames_per_s),
                    LiveMetric::PoseAgeMs => shown.median(|round| round.age_ms),
                    LiveMetric::Ev100 => shown.median(|round| round.ev100),
                    LiveMetric::Pixels => shown.median(|round| round.pixels as f64),
                };
                // A view that is not delivered has no figures at all.
                let value = value.filter(|_| failure.is_none());
                let note = match (failure, found, value) {
                    (Some(reason), ..) => one_line(reason),
                    (None, Err(reason), None) => one_line(reason),
                    _ if metric == LiveMetric::FramesPerS => passes_note(shown, extent.rounds),
                    _ => "time between frames that arrive".to_owned(),
                };
                rows.push(Row {
                    axis: Axis::Live.name().to_owned(),
                    method: method(run.codes),
                    source: "steradian".to_owned(),
                    workload: format!("{} {name}", scene.name),
                    adapter: adapter.clone(),
                    width: size[0],
                    height: size[1],
                    items: compared.as_ref().map_or(0, Compared::stars),
                    gpu_ms_median: time.map(|time| time.median_ms),
                    gpu_ms_min: time.map(|time| time.min_ms),
                    gpu_ms_max: time.map(|time| time.max_ms),
                    error_metric: metric.name().to_owned(),
                    error_value: value,
                    notes: note,
                });
            }
        }
    }
    Ok(rows)
}

/// Returns a reason as one line, without the separator between notes.
fn one_line(reason: &str) -> String {
    reason.split_whitespace().collect::<Vec<_>>().join(" ").replace("; ", ", ")
}

/// Describes the median times of the parts of a frame in the daemon, ms.
fn passes_note(shown: &Shown<'_>, rounds: usize) -> String {
    let parts = shown.rounds.iter().max_by_key(|round| round.parts_ms.len()).map_or(&[][..], |round| &round.parts_ms);
    let part = |name: &str| {
        let times = shown.rounds.iter().filter_map(|round| Some(round.parts_ms.iter().find(|part| part.0 == name)?.1));
        crate::chart::timing::Spread::from_values(&times.collect::<Vec<_>>()).map_or(0.0, |spread| spread.median_ms)
    };
    let parts: Vec<String> = parts.iter().map(|(name, _)| format!("{name} {:.1}", part(name))).collect();
    let mut note = match &parts[..] {
        [] => "the daemon has no times".to_owned(),
        parts => format!("daemon, ms: {}", parts.join(", ")),
    };
    if shown.rounds.len() < rounds {
        note.push_str(&format!("; {} of {rounds} rounds: the budget was used up", shown.rounds.len()));
    }
    note
}
