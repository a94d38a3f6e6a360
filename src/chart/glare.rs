//! The axis `glare`: times every glare method in every projection, and measures errors against the reference.
//!
//! The time covers the glare passes only; the notes give the time of the whole frame. Methods may keep data between frames: in every turn, a method
//! draws one frame that is not counted, and then one with the camera turned a little, which is counted. For the second frame, `sky_cube` reuses its
//! map of the sky. The variant `sky_cube_in_flight` draws a third frame from another place, which needs a new map. Its time includes the CPU time for
//! the map, measured as the difference between the planning times of the second and the third frame.
//!
//! Errors are measured in smaller views of the same projections, in which every compared pixel can be compared with
//! every star.

use std::time::Instant;

use glam::{DQuat, DVec3};

use super::{
    Axis, Budget, ChartError, Extent, GlareMetric, ReportStep, Row, Score, Scores, Sky, Step, ViewShape,
    scores::{GlareScenes, ScoredSky, score_glare},
    timing::{self, Case, Spread, TIMING_EV100, Taken, Timed, message_of},
    workloads::{Skies, rig_of, snapshot},
};
use crate::{
    plan::settings::{ExposureSettings, GlareMethod, GlareSettings, PyramidWeights, RenderSettings},
    render::{FrameRequest, FrameTimes, Renderer, Wanted},
    scene::{Camera, SceneSnapshot},
    units::PARSEC_M,
    view::Rig,
};

/// Angle by which the camera turns between frames, rad.
const TURN_RAD: f64 = 0.01;
/// Distance by which a camera in flight moves between frames, m.
const STEP_M: f64 = 1e-4 * PARSEC_M;

/// A method with its options.
#[derive(Clone, Debug, PartialEq)]
struct Variant {
    name: String,
    settings: GlareSettings,
    /// Whether the camera moves from frame to frame.
    in_flight: bool,
}

/// Returns all charted variants; first the one without glare, to which the others add their time.
fn variants() -> Vec<Variant> {
    let variant = |method: GlareMethod, weights: PyramidWeights, suffix: &str| Variant {
        name: format!("{}{suffix}", method.name()),
        settings: GlareSettings { method, weights, ..GlareSettings::default() },
        in_flight: false,
    };
    let mut all = vec![variant(GlareMethod::None, PyramidWeights::Equal, "")];
    for method in GlareMethod::DRAWING {
        let equal = variant(method, PyramidWeights::Equal, "");
        if method == GlareMethod::SkyCube {
            let in_flight = Variant { name: format!("{}_in_flight", equal.name), in_flight: true, ..equal.clone() };
            all.extend([equal, in_flight]);
        } else {
            all.extend([equal, variant(method, PyramidWeights::Halved, "_halved")]);
        }
    }
    all
}

impl Variant {
    /// Returns the note on every row of the variant.
    fn note(&self) -> &'static str {
        match (self.settings.method, self.settings.weights) {
            (GlareMethod::SkyCube, _) if self.in_flight => {
                "the camera moves: the map of the sky is recomputed for every frame"
            }
            (GlareMethod::SkyCube, _) => "the map of the sky is reused, as during head rotation",
            (GlareMethod::ScreenPyramid | GlareMethod::ViewPyramid, PyramidWeights::Halved) => {
                "weights are halved from level to level, as published, which gives inverse-cube falloff"
            }
            (GlareMethod::ScreenPyramid | GlareMethod::ViewPyramid, PyramidWeights::Equal) => {
                "equal weights: inverse-square falloff"
            }
            _ => "no glare",
        }
    }
}

pub(super) fn run(
    renderer: &mut Renderer,
    extent: &Extent,
    skies: &mut Skies,
    budget: Budget,
    report_step: ReportStep<'_>,
) -> Result<Vec<Row>, ChartError> {
    // Views for the scores, each listed once.
    let variants = variants();
    let views = &extent.glare.views;
    let mut small: Vec<ViewShape> = Vec::new();
    for (_, view) in views {
        if !small.contains(view) {
            small.push(*view);
        }
    }
    let total = small.len() + views.len();
    let mut done = 0;
    let mut step = |task: String| {
        report_step(&Step { axis: Axis::Glare, done, total, task });
        done += 1;
    };
    // Score every variant in these views.
    let records = skies.records(Sky::Galaxy(extent.glare.scored_stars))?;
    let mut scores = Vec::new();
    for &view in &small {
        step(format!("scoring in {}", view.name()));
        scores.push(score_variants(renderer, &variants, view, &records, extent.glare.pixels)?);
    }
    // Time every variant in each view; the budget is divided by the number of pixels.
    let sky = Sky::Galaxy(extent.glare.stars);
    let scene = snapshot(skies.records(sky)?.to_vec());
    let pixels = |view: ViewShape| -> f64 {
        let images = match view {
            ViewShape::Stereo(_) => 2.0,
            ViewShape::Cubemap(_) => 6.0,
            _ => 1.0,
        };
        images * view.size().map(f64::from).iter().product::<f64>()
    };
    let mut rows = Vec::new();
    for (index, &(view, scored)) in views.iter().enumerate() {
        let workload = format!("{} {}", sky.name(), view.name());
        step(format!("timing {workload}"));
        let left: f64 = views[index..].iter().map(|(view, _)| pixels(*view)).sum();
        let rig = rig_of(vec![("chart", view.kind())])?;
        let (rounds, budget) = (extent.glare.rounds, budget.part(pixels(view) / left, 1));
        let timed = time_variants(renderer, &variants, &scene, &rig, rounds, budget)?;
        let case = Case {
            axis: Axis::Glare,
            workload,
            adapter: renderer.adapter().adapter.clone(),
            size: view.size(),
            items: extent.glare.stars as u64,
            planes: view.is_flat(),
        };
        let scores = small.iter().position(|view| *view == scored).map(|index| &scores[index]);
        // One row per variant and metric.
        for (index, variant) in variants.iter().enumerate() {
            let (timed, notes) = &timed[index];
            let note =
                [variant.note(), notes].into_iter().filter(|note| !note.is_empty()).collect::<Vec<_>>().join("; ");
            let source = variant.settings.method.source().name();
            for metric in GlareMetric::ALL {
                let score = scores.and_then(|scores| scores[index].as_ref()?.get(metric));
                let mut score = score.cloned().unwrap_or_else(|| Score::none("does not apply: no glare"));
                if score.value.is_some() {
                    let [width, height] = scored.size();
                    let scored = format!("scored at {width} x {height} pixels");
                    score.note = if score.note.is_empty() { scored } else { format!("{}; {scored}", score.note) };
                }
                rows.push(case.named_row([&variant.name, source], timed, metric.name(), &score, &note));
            }
        }
    }
    Ok(rows)
}

/// Scores every variant in a view; variants without glare have no score. In flight, a method gives the same picture as at rest.
fn score_variants(
    renderer: &mut Renderer,
    variants: &[Variant],
    view: ViewShape,
    records: &[crate::catalogue::StarRecord],
    pixels: usize,
) -> Result<Vec<Option<Scores<GlareMetric>>>, ChartError> {
    // The default kernel is a formula, so building it cannot fail.
    let Ok(kernel) = GlareSettings::default().kernel() else { return Ok(vec![None; variants.len()]) };
    let scenes = GlareScenes::new(view, &ScoredSky { records, pixels }, kernel)?;
    let mut found: Vec<Option<Scores<GlareMetric>>> = Vec::new();
    for (index, variant) in variants.iter().enumerate() {
        let same = variants[..index].iter().position(|other| other.settings == variant.settings);
        found.push(match same {
            Some(same) => found[same].clone(),
            None if variant.settings.method == GlareMethod::None => None,
            None => Some(score_glare(renderer, &variant.settings, &scenes)?),
        });
    }
    Ok(found)
}

/// Times of a variant's frames, in addition to those of the glare passes, ms; the first entry belongs to the first turn.
#[derive(Clone, Debug, Default)]
struct FrameNotes {
    whole_gpu: Vec<f64>,
    map_cpu: Vec<f64>,
}

impl FrameNotes {
    /// Describes the times in one line. The first turn, which builds pipelines, counts only if there is no other.
    fn note(&self) -> String {
        let median =
            |values: &[f64]| Spread::from_values(values.get(1..).filter(|rest| !rest.is_empty()).unwrap_or(values));
        let whole = median(&self.whole_gpu).map(|spread| format!("whole frame {:.2} ms", spread.median_ms));
        let map = median(&self.map_cpu).map(|spread| format!("{:.2} ms of the time on the CPU", spread.median_ms));
        whole.into_iter().chain(map).collect::<Vec<_>>().join("; ")
    }
}

/// Times every variant; returns a note with each time.
fn time_variants(
    renderer: &mut Renderer,
    variants: &[Variant],
    scene: &SceneSnapshot,
    rig: &Rig,
    rounds: usize,
    budget: Budget,
) -> Result<Vec<(Timed, String)>, ChartError> {
    let mut notes = vec![FrameNotes::default(); variants.len()];
    let timed = timing::rounds(variants.len(), rounds, budget, |index| {
        turn(renderer, &variants[index], scene, rig, &mut notes[index])
    })?;
    let with_note = |((mut timed, notes), variant): ((Timed, FrameNotes), &Variant)| {
        if variant.settings.method == GlareMethod::None && !timed.failed {
            // Without glare there is no pass to time, so the missing time must not be reported as a limitation of the adapter.
            timed.note = String::new();
        }
        (timed, notes.note())
    };
    Ok(timed.into_iter().zip(notes).zip(variants).map(with_note).collect())
}

/// Draws the frames of one turn: see the module documentation.
fn turn(
    renderer: &mut Renderer,
    variant: &Variant,
    scene: &SceneSnapshot,
    rig: &Rig,
    notes: &mut FrameNotes,
) -> Result<Taken, ChartError> {
    let mut settings = RenderSettings { glare: variant.settings.clone(), ..RenderSettings::default() };
    settings.exposure = ExposureSettings::manual(TIMING_EV100);
    let start = Instant::now();
    let mut frame = |turned_rad: f64, along_m: f64| -> Result<Result<FrameTimes, String>, ChartError> {
        let world_from_camera = scene.camera.world_from_camera * DQuat::from_rotation_y(turned_rad);
        let position_m = scene.camera.position_m + DVec3::X * along_m;
        let moved = SceneSnapshot { camera: Camera { world_from_camera, position_m, ..scene.camera }, ..scene.clone() };
        match renderer.render(
            FrameRequest::new(&moved, rig).settings(&settings).wanted(Wanted { hdr_stays: true, ..Wanted::default() }),
        ) {
            Ok(frame) => Ok(Ok(frame.times)),
            Err(error) => message_of(error).map(Err),
        }
    };
    let mut frames = vec![(0.0, 0.0), (TURN_RAD, 0.0)];
    frames.extend(variant.in_flight.then_some((TURN_RAD, STEP_M)));
    let mut times = Vec::new();
    for (turned_rad, along_m) in frames {
        match frame(turned_rad, along_m)? {
            Ok(found) => times.push(found),
            Err(message) => return Ok(Err(message)),
        }
    }
    Ok(Ok((counted(&times, variant.in_flight, notes), start.elapsed())))
}

/// Returns the time of the last frame of a turn, ms; `None` if no glare pass could be timed.
fn counted(times: &[FrameTimes], in_flight: bool, notes: &mut FrameNotes) -> Option<f64> {
    let (last, before) = times.split_last()?;
    notes.whole_gpu.extend(last.gpu_ms);
    let passes: Vec<f64> = last.passes_ms.iter().filter(|pass| pass.0 == "glare").map(|pass| pass.1).collect();
    if passes.is_empty() {
        return None;
    }
    let map_ms = before.last().filter(|_| in_flight).map(|kept| (last.plan_ms - kept.plan_ms).max(0.0));
    notes.map_cpu.extend(map_ms);
    Some(passes.iter().sum::<f64>() + map_ms.unwrap_or(0.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn variants_have_unique_names_and_cover_all_methods() {
        let all = variants();
        let names: Vec<&str> = all.iter().map(|variant| variant.name.as_str()).collect();
        assert_eq!(
            names,
            [
                "none",
                "sky_cube",
                "sky_cube_in_flight",
                "screen_pyramid",
                "screen_pyramid_halved",
                "view_pyramid",
                "view_pyramid_halved"
            ]
        );
        assert!(GlareMethod::DRAWING.iter().all(|method| names.contains(&method.name())));
        for (index, variant) in all.iter().enumerate() {
            assert!(!all[..index].contains(variant), "{}", variant.name);
        }
    }

    fn times(passes_ms: &[(&'static str, f64)], plan_ms: f64) -> FrameTimes {
        FrameTimes { passes_ms: passes_ms.to_vec(), plan_ms, gpu_ms: Some(20.0), ..FrameTimes::default() }
    }

    #[test]
    fn time_covers_glare_passes_and_recomputed_map() {
        let before = times(&[("stars", 1.0), ("glare", 50.0)], 4.0);
        let last = times(&[("stars", 1.0), ("glare", 2.0), ("glare", 3.0), ("exposure", 7.0)], 10.0);
        let mut notes = FrameNotes::default();
        assert_eq!(counted(&[before.clone(), last.clone()], false, &mut notes), Some(5.0));
        assert_eq!(notes.note(), "whole frame 20.00 ms");
        let mut notes = FrameNotes::default();
        assert_eq!(counted(&[before.clone(), last], true, &mut notes), Some(11.0));
        assert_eq!(notes.note(), "whole frame 20.00 ms; 6.00 ms of the time on the CPU");
        // Without a glare pass there is no time, rather than a time of zero.
        assert_eq!(counted(&[before.clone(), times(&[("stars", 1.0)], 1.0)], true, &mut notes), None);
        // The first turn does not count if there are others.
        notes.map_cpu.extend([1.0, 3.0]);
        assert!(notes.note().contains("2.00 ms of the time"), "{}", notes.note());
    }
}
