//! Timing: frames of all methods in turn, so that other activity of the machine affects all of them alike.
//!
//! Every method draws one frame that is not counted (it builds pipelines and buffers, uploads stars, fills caches), then one frame per round; each
//! round begins with another method. Time that fast methods do not use is available to the slower ones. A method whose frames have used its share
//! skips the remaining rounds and gets a note, but fast methods draw [`LEAST_ROUNDS`] regardless of the budget. If the first frame already exceeds
//! the share, its time is used.

use std::time::{Duration, Instant};

use super::{Axis, Budget, ChartError, Row, Score};
use crate::{
    gpu::GpuError,
    plan::settings::{RenderSettings, StarMethod},
    render::{FrameRequest, RenderError, Renderer, Wanted},
    scene::SceneSnapshot,
    view::Rig,
};

/// A frame whose total time is no longer than this is drawn regardless of the budget.
pub(super) const FAST: Duration = Duration::from_millis(150);
/// Minimum number of rounds of a method whose frames are [`FAST`].
const LEAST_ROUNDS: usize = 3;

/// Times of several frames, ms.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spread {
    /// Median; for an even number of frames the mean of the middle two.
    pub median_ms: f64,
    /// Shortest.
    pub min_ms: f64,
    /// Longest.
    pub max_ms: f64,
}

impl Spread {
    /// Returns the spread of values; `None` if there are none.
    pub fn from_values(values: &[f64]) -> Option<Self> {
        let mut sorted = values.to_vec();
        sorted.sort_by(f64::total_cmp);
        let (min_ms, max_ms) = (*sorted.first()?, *sorted.last()?);
        let half = sorted.len() / 2;
        let lower = if sorted.len().is_multiple_of(2) { half - 1 } else { half };
        Some(Self { median_ms: (sorted[lower] + sorted[half]) / 2.0, min_ms, max_ms })
    }
}

/// Timing result of one method.
#[derive(Clone, Debug, PartialEq, Default)]
pub(super) struct Timed {
    /// Times; `None` if the method was not drawn or the adapter has no timestamps.
    pub spread: Option<Spread>,
    /// Reason for a missing time, or a limitation of the time.
    pub note: String,
    /// Whether the method could not be drawn.
    pub failed: bool,
    /// Total duration of the last frame.
    pub took: Duration,
}

/// Returns the message of an error that affects one method only.
///
/// # Errors
/// [`ChartError::Gpu`] if the device is lost, because then no method can be drawn.
pub(super) fn message_of(error: RenderError) -> Result<String, ChartError> {
    match error {
        RenderError::Gpu(GpuError::Refused(_)) => Ok(error.to_string()),
        RenderError::Gpu(error) => Err(ChartError::Gpu(error)),
        error => Ok(error.to_string()),
    }
}

/// Exposure of every method in every workload: the default of a manual exposure. There a star of about magnitude 3
/// reaches display white if all of its light falls into one pixel of a view of 1080 pixels and 60 degrees.
pub(super) const TIMING_EV100: f64 = -3.0;

/// Common contents of all rows of a workload.
pub(super) struct Case {
    pub axis: Axis,
    pub workload: String,
    pub adapter: String,
    /// Size of the (first) image, pixels.
    pub size: [u32; 2],
    pub items: u64,
    /// Whether every image is a flat plane.
    pub planes: bool,
}

impl Case {
    /// Returns the row of a star method and a metric.
    pub fn row(&self, method: StarMethod, timed: &Timed, metric: &str, score: &Score) -> Row {
        let through_faces = method.needs_planes() && !self.planes;
        let note = if through_faces { "published for a plane: drawn through cube faces" } else { "" };
        self.named_row([method.name(), method.source().name()], timed, metric, score, note)
    }

    /// Returns the row of a method, given by name and source, and a metric; `note` precedes the notes of time and
    /// score.
    pub fn named_row(
        &self,
        [method, source]: [&str; 2],
        timed: &Timed,
        metric: &str,
        score: &Score,
        note: &str,
    ) -> Row {
        let mut notes: Vec<&str> = Vec::new();
        for text in [note, &timed.note, &score.note] {
            if !text.is_empty() && !notes.contains(&text) {
                notes.push(text);
            }
        }
        Row {
            axis: self.axis.name().to_owned(),
            method: method.to_owned(),
            source: source.to_owned(),
            workload: self.workload.clone(),
            adapter: self.adapter.clone(),
            width: self.size[0],
            height: self.size[1],
            items: self.items,
            gpu_ms_median: timed.spread.map(|spread| spread.median_ms),
            gpu_ms_min: timed.spread.map(|spread| spread.min_ms),
            gpu_ms_max: timed.spread.map(|spread| spread.max_ms),
            error_metric: metric.to_owned(),
            error_value: score.value,
            notes: notes.join("; "),
        }
    }
}

struct Run {
    times_ms: Vec<f64>,
    spent: Duration,
    /// Total duration of the last frame.
    last: Duration,
    warm_up_ms: Option<f64>,
    failure: Option<String>,
    sat_out: bool,
}

/// GPU time of a frame, ms, and its total duration with planning and waiting; or the reason why the method cannot draw
/// it.
pub(super) type Taken = Result<(Option<f64>, Duration), String>;

/// Draws the scene with each of `settings` for up to `rounds` rounds. HDR images are rendered and stay on the GPU.
pub(super) fn frames(
    renderer: &mut Renderer,
    scene: &SceneSnapshot,
    rig: &Rig,
    settings: &[RenderSettings],
    count: usize,
    budget: Budget,
) -> Result<Vec<Timed>, ChartError> {
    // GPU time of clear, cull, splat and resolve, and total duration with planning and waiting.
    rounds(settings.len(), count, budget, |index| {
        let start = Instant::now();
        match renderer.render(
            FrameRequest::new(scene, rig)
                .settings(&settings[index])
                .wanted(Wanted { hdr_stays: true, ..Wanted::default() }),
        ) {
            Ok(frame) => Ok(Ok((frame.times.gpu_ms.map(|ms| ms + frame.times.cull_ms), start.elapsed()))),
            Err(error) => message_of(error).map(Err),
        }
    })
}

/// Lets each of `methods` draw in turn for up to `rounds` rounds; `frame` draws with the method of an index.
pub(super) fn rounds(
    methods: usize,
    rounds: usize,
    budget: Budget,
    mut frame: impl FnMut(usize) -> Result<Taken, ChartError>,
) -> Result<Vec<Timed>, ChartError> {
    // Draw one frame per method that is not counted.
    let mut runs = Vec::new();
    for index in 0..methods {
        let mut run = Run {
            times_ms: Vec::new(),
            spent: Duration::ZERO,
            last: Duration::ZERO,
            warm_up_ms: None,
            failure: None,
            sat_out: false,
        };
        match frame(index)? {
            Ok((ms, took)) => (run.warm_up_ms, run.last) = (ms, took),
            Err(message) => run.failure = Some(message),
        }
        runs.push(run);
    }
    // Divide the budget.
    let needs: Vec<Duration> =
        runs.iter().filter(|run| run.failure.is_none()).map(|run| run.last * rounds as u32).collect();
    let share = fair_share(needs, budget.left());
    // Draw in turn until the rounds or the share of a method are used up.
    for round in 0..rounds {
        for turn in 0..runs.len() {
            let index = (round + turn) % runs.len();
            let run = &mut runs[index];
            if run.failure.is_some() || run.sat_out {
                continue;
            }
            let free = run.last <= FAST && round < LEAST_ROUNDS;
            if !free && (run.spent + run.last > share || budget.is_over()) {
                run.sat_out = true;
                continue;
            }
            match frame(index)? {
                Ok((ms, took)) => {
                    run.times_ms.extend(ms);
                    run.spent += took;
                    run.last = took;
                }
                Err(message) => run.failure = Some(message),
            }
        }
    }
    Ok(runs.into_iter().map(|run| run.result(rounds)).collect())
}

/// Returns the largest share of a budget per method, such that methods that need less get all that they need and the
/// others share the rest evenly.
fn fair_share(mut needs: Vec<Duration>, budget: Duration) -> Duration {
    needs.sort_unstable();
    let mut left = budget;
    for (index, need) in needs.iter().enumerate() {
        let even = left / (needs.len() - index) as u32;
        if *need > even {
            return even;
        }
        left -= *need;
    }
    Duration::MAX
}

impl Run {
    fn result(self, rounds: usize) -> Timed {
        if let Some(note) = self.failure {
            return Timed { note, failed: true, ..Timed::default() };
        }
        let Some(warm_up_ms) = self.warm_up_ms else {
            return Timed { note: "the adapter has no timestamps".to_owned(), took: self.last, ..Timed::default() };
        };
        let measured = self.times_ms.len();
        let note = match measured {
            0 => "time of the first frame only: the budget was used up".to_owned(),
            _ if measured < rounds => format!("{measured} of {rounds} rounds: the budget was used up"),
            _ => String::new(),
        };
        let spread = Spread::from_values(&self.times_ms).or_else(|| Spread::from_values(&[warm_up_ms]));
        Timed { spread, note, failed: false, took: self.last }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::PlanError;

    #[test]
    fn spread_has_median_and_extremes() {
        let spread = |values: &[f64]| Spread::from_values(values).map(|s| [s.median_ms, s.min_ms, s.max_ms]);
        assert_eq!(spread(&[]), None);
        assert_eq!(spread(&[3.0]), Some([3.0; 3]));
        assert_eq!(spread(&[9.0, 1.0]), Some([5.0, 1.0, 9.0]));
        assert_eq!(spread(&[9.0, 1.0, 2.0]), Some([2.0, 1.0, 9.0]));
        assert_eq!(spread(&[9.0, 1.0, 2.0, 100.0]), Some([5.5, 1.0, 100.0]));
    }

    fn run(times_ms: Vec<f64>, warm_up_ms: Option<f64>, failure: Option<&str>) -> Timed {
        let failure = failure.map(str::to_owned);
        let run = Run { times_ms, spent: Duration::ZERO, last: Duration::ZERO, warm_up_ms, failure, sat_out: false };
        run.result(3)
    }

    #[test]
    fn missing_times_have_a_note_and_are_never_zero() {
        let whole = run(vec![1.0, 2.0, 3.0], Some(9.0), None);
        assert_eq!((whole.spread.unwrap().max_ms, whole.note.as_str()), (3.0, ""));
        let short = run(vec![1.0], Some(9.0), None);
        assert!(short.spread.unwrap().max_ms == 1.0 && short.note.contains("1 of 3"), "{short:?}");
        let first = run(vec![], Some(9.0), None);
        assert!(first.spread.unwrap().median_ms == 9.0 && first.note.contains("first frame"), "{first:?}");
        let without = run(vec![], None, None);
        assert!(without.spread.is_none() && without.note.contains("timestamps"), "{without:?}");
        let failed = run(vec![1.0, 2.0], Some(9.0), Some("not drawn"));
        assert!(failed.spread.is_none() && failed.note == "not drawn", "{failed:?}");
    }

    #[test]
    fn unused_shares_go_to_other_methods() {
        let share = |needs: &[u64], budget: u64| {
            fair_share(needs.iter().map(|need| Duration::from_secs(*need)).collect(), Duration::from_secs(budget))
        };
        assert_eq!(share(&[100, 10, 100], 70), Duration::from_secs(30));
        assert_eq!(share(&[100, 100], 70), Duration::from_secs(35));
        assert_eq!(share(&[10, 100], 0), Duration::ZERO);
        assert_eq!([share(&[10, 20], 30), share(&[], 0)], [Duration::MAX; 2]);
    }

    #[test]
    fn only_a_lost_device_stops_the_run() {
        assert!(message_of(PlanError::AtRestOnly("sprite").into()).unwrap().contains("sprite"));
        assert!(message_of(RenderError::Gpu(GpuError::Refused("no memory".to_owned()))).unwrap().contains("no memory"));
        assert!(message_of(RenderError::Gpu(GpuError::NoAdapter("none".to_owned()))).is_err());
    }
}
