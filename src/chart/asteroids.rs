//! The axis `asteroids`: times every method of drawing a field of asteroids as their number grows, and measures errors
//! against meshes at the finest level of detail.
//!
//! The time covers the asteroid passes (culling, meshes and impostors, compositing, points) and planning on the CPU,
//! which includes culling if the adapter does not do it. The notes list the parts. Atlases are baked beforehand. There
//! are no stars. A frame is skipped if the previous workload predicts that it would exceed its share of the budget.
//!
//! - `workload`: the field, the camera, the drawing methods;
//! - `turn`: one frame and the times of its parts;
//! - `ratios`: field outside of every view, a second eye, the faces of a cube;
//! - `extent`: sizes of a quick and of a full run;
//! - `published`: figures of other hardware.

mod extent;
mod published;
mod ratios;
mod turn;
mod workload;

use std::time::Duration;

pub use self::extent::AsteroidExtent;
pub(super) use self::workload::SHAPE_SEED;
use self::{
    turn::{FrameParts, turn},
    workload::{Fields, Place, Variant, count_name},
};
use super::{
    AsteroidMetric, Axis, Budget, ChartError, Extent, ReportStep, Row, Scores, Step, ViewShape,
    scores::{AsteroidScenes, score_asteroids},
    timing::{self, Case, Timed},
    workloads::rig_of,
};
use crate::{render::Renderer, view::Rig};

/// Share of the time for ratios; the rest is for all sizes and views.
const RATIOS_SHARE: f64 = 0.15;

/// Field and view that are timed.
struct Workload {
    instances: u32,
    view: ViewShape,
    /// Index of the view in which its errors are measured.
    scored: usize,
}

impl Workload {
    fn name(&self) -> String {
        format!("{} asteroids {}", count_name(self.instances), view_name(self.view))
    }

    fn pixels(&self) -> f64 {
        let images = if matches!(self.view, ViewShape::Stereo(_)) { 2.0 } else { 1.0 };
        images * self.view.size().map(f64::from).iter().product::<f64>()
    }
}

fn view_name(view: ViewShape) -> String {
    match view {
        ViewShape::Flat([_, height]) => format!("{height}p"),
        other => other.name(),
    }
}

/// Cost of a method's last frame, with the numbers of asteroids and pixels in that frame.
#[derive(Clone, Copy)]
struct Known {
    took: Duration,
    instances: u32,
    pixels: f64,
}

pub(super) fn run(
    renderer: &mut Renderer,
    extent: &Extent,
    budget: Budget,
    report_step: ReportStep<'_>,
) -> Result<Vec<Row>, ChartError> {
    let extent = &extent.asteroids;
    let variants = Variant::all();
    // The first view is timed with all numbers of asteroids, each of the others with one number.
    let workloads: Vec<Workload> = extent
        .instances
        .iter()
        .map(|instances| Workload { instances: *instances, view: extent.views[0], scored: 0 })
        .chain(extent.views.iter().enumerate().skip(1).map(|(scored, view)| Workload {
            instances: extent.other_views_instances,
            view: *view,
            scored,
        }))
        .collect();
    let total = extent.views.len() + workloads.len() + ratios::RATIOS.len();
    let mut done = 0;
    let mut step = |task: String| {
        report_step(&Step { axis: Axis::Asteroids, done, total, task });
        done += 1;
    };
    // Score every variant in each view.
    let mut scores = Vec::new();
    for &view in &extent.views {
        step(format!("scoring in {}", view_name(view)));
        let scenes = AsteroidScenes::new(view.with_longer_side(extent.scored_px), &variants_settings(&variants))?;
        scores.push(score_variants(renderer, &variants, &scenes)?);
    }
    // Time every variant in each workload; the budget is divided by the expected cost.
    let mut rows = published::rows();
    let mut fields = Fields::default();
    let weight = |workload: &Workload| f64::from(workload.instances) + 0.1 * workload.pixels();
    let mut known: Vec<Option<Known>> = vec![None; variants.len()];
    let timing = budget.part(1.0 - RATIOS_SHARE, 1);
    for (index, workload) in workloads.iter().enumerate() {
        step(format!("timing {}", workload.name()));
        let left: f64 = workloads[index..].iter().map(weight).sum();
        let budget = timing.part(weight(workload) / left, 1);
        let scene = fields.scene(workload.instances, Place::Before)?;
        let rig = rig_of(vec![("chart", workload.view.kind())])?;
        let timed = time_variants(renderer, &variants, workload, &scene, &rig, extent.rounds, budget, &mut known)?;
        let case = Case {
            axis: Axis::Asteroids,
            workload: workload.name(),
            adapter: renderer.adapter().adapter.clone(),
            size: workload.view.size(),
            items: u64::from(workload.instances),
            planes: workload.view.is_flat(),
        };
        // One row per variant and metric.
        for ((variant, (timed, remark)), scores) in variants.iter().zip(&timed).zip(&scores[workload.scored]) {
            let note =
                [variant.note, remark].into_iter().filter(|note| !note.is_empty()).collect::<Vec<_>>().join("; ");
            for metric in AsteroidMetric::ALL {
                let score = scores.get(metric).cloned().unwrap_or_default();
                let names = [variant.name, variant.source.name()];
                rows.push(case.named_row(names, timed, metric.name(), &score, &note));
            }
        }
    }
    rows.extend(ratios::rows(renderer, extent, &mut fields, &variants, budget, &mut step)?);
    Ok(rows)
}

fn variants_settings(variants: &[Variant]) -> Vec<crate::plan::settings::AsteroidSettings> {
    variants.iter().map(|variant| variant.settings.clone()).collect()
}

/// Scores every variant in a view. Culling on the CPU leads to the same pictures as on the adapter, but is scored
/// separately.
fn score_variants(
    renderer: &mut Renderer,
    variants: &[Variant],
    scenes: &AsteroidScenes,
) -> Result<Vec<Scores<AsteroidMetric>>, ChartError> {
    let truth = scenes.truth(renderer)?;
    variants.iter().map(|variant| score_asteroids(renderer, &variant.settings, scenes, &truth)).collect()
}

/// Times every variant that fits into the budget; returns a note with each time.
#[expect(
    clippy::too_many_arguments,
    reason = "the renderer, the content, the repetitions and the earlier costs are separate inputs"
)]
fn time_variants(
    renderer: &mut Renderer,
    variants: &[Variant],
    workload: &Workload,
    scene: &crate::scene::SceneSnapshot,
    rig: &Rig,
    rounds: usize,
    budget: Budget,
    known: &mut [Option<Known>],
) -> Result<Vec<(Timed, String)>, ChartError> {
    let expected: Vec<Option<Duration>> =
        known.iter().map(|known| known.map(|known| workload.expected(known))).collect();
    let drawn = affordable(&expected, budget.left());
    let mut parts = vec![FrameParts::default(); variants.len()];
    let found = timing::rounds(drawn.len(), rounds, budget, |turn_of| {
        let index = drawn[turn_of];
        turn(renderer, &variants[index], scene, rig, &mut parts[index])
    })?;
    let mut timed: Vec<(Timed, String)> = expected
        .iter()
        .map(|expected| {
            let seconds = expected.map_or(0.0, |expected| expected.as_secs_f64());
            let note = format!("not drawn: a frame would take {seconds:.0} s, the budget was used up");
            (Timed { note, failed: true, ..Timed::default() }, String::new())
        })
        .collect();
    for (index, found) in drawn.into_iter().zip(found) {
        if !found.failed {
            let Workload { instances, .. } = *workload;
            known[index] = Some(Known { took: found.took, instances, pixels: workload.pixels() });
        }
        timed[index] = (found, parts[index].note());
    }
    Ok(timed)
}

impl Workload {
    /// Estimates the time of a whole frame from an earlier one: it grows with the number of asteroids and of pixels.
    fn expected(&self, known: Known) -> Duration {
        let grows = f64::from(self.instances) / f64::from(known.instances);
        known.took.mul_f64(grows * (self.pixels() / known.pixels).max(1.0))
    }
}

/// Returns the indices of the methods that can draw one frame each within the budget, the fastest first. Methods without an estimate are always
/// included.
fn affordable(expected: &[Option<Duration>], budget: Duration) -> Vec<usize> {
    let mut order: Vec<usize> = (0..expected.len()).collect();
    order.sort_by_key(|index| expected[*index]);
    let mut spent = Duration::ZERO;
    let mut drawn: Vec<usize> = order
        .into_iter()
        .filter(|index| {
            let Some(expected) = expected[*index] else { return true };
            let fits = spent + expected <= budget;
            if fits {
                spent += expected;
            }
            fits
        })
        .collect();
    drawn.sort_unstable();
    drawn
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn methods_beyond_the_budget_are_skipped_slowest_first() {
        let seconds = |seconds: &[u64]| -> Vec<Option<Duration>> {
            seconds.iter().map(|seconds| (*seconds > 0).then(|| Duration::from_secs(*seconds))).collect()
        };
        assert_eq!(affordable(&seconds(&[50, 2, 0, 3]), Duration::from_secs(10)), [1, 2, 3]);
        assert_eq!(affordable(&seconds(&[50, 2]), Duration::from_secs(100)), [0, 1]);
        assert_eq!(affordable(&seconds(&[50, 0]), Duration::ZERO), [1]);
    }

    #[test]
    fn expected_time_grows_with_the_number_of_asteroids() {
        let known = Known { took: Duration::from_secs(2), instances: 250_000, pixels: 100.0 };
        let workload = |instances, side| Workload { instances, view: ViewShape::Flat([side; 2]), scored: 0 };
        assert_eq!(workload(1_000_000, 10).expected(known), Duration::from_secs(8));
        assert_eq!(workload(250_000, 20).expected(known), Duration::from_secs(8));
        assert_eq!(workload(250_000, 5).expected(known), Duration::from_secs(2));
        assert_eq!(workload(1_000_000, 90).name(), "1M asteroids 90p");
    }
}
