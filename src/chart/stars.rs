//! The axis `stars`: times every method of drawing stars in every workload, and measures all of its errors.
//!
//! Exposure is manual and the same in every workload ([`TIMING_EV100`]), so that all methods show the same. The sky of
//! a million stars is also timed at typical exposures of users, together with whole frames with readback: display
//! images within their budget, and HDR images. The errors of single stars do not depend on the workload; they are
//! measured once over the scoring scenes and repeated in each workload. The error of the whole frame's light is
//! measured per workload: that frame omits stars near the border of the picture, because the part of their light that
//! falls inside depends on the profile.

use glam::{DQuat, DVec2};
use rayon::prelude::*;

use super::{
    Axis, Budget, ChartError, Extent, Metric, ReportStep, Row, Score, Scores, Sky, Step, ViewShape, score_method,
    scores::settings_of,
    timing::{self, Case, FAST, Spread, TIMING_EV100, Timed, message_of},
    workloads::{Skies, projection_of, rig_of, snapshot},
};
use crate::{
    catalogue::StarRecord,
    metrics::{HdrView, relative_flux_error},
    plan::settings::{RenderSettings, StarMethod},
    render::{FrameRequest, Renderer, Wanted},
    scene::SceneSnapshot,
    units::illuminance_lx_from_magnitude,
    view::{Rig, projection::PlaneMapping},
};

/// Share of the time for the scores.
const SCORES_SHARE: f64 = 0.35;
/// Share of a workload's time for the interleaved frames; the rest is for the light of whole frames.
const TIMING_SHARE: f64 = 0.7;
/// Stars nearer to the border than this share of the picture's height are left out when the light of a frame is
/// measured.
const BORDER: f64 = 0.1;

/// A workload with the common contents of its rows.
struct Workload<'a> {
    name: String,
    sky: &'a [StarRecord],
    scene: &'a SceneSnapshot,
    view: ViewShape,
    ev100: f64,
    rounds: usize,
}

pub(super) fn run(
    renderer: &mut Renderer,
    extent: &Extent,
    skies: &mut Skies,
    budget: Budget,
    report_step: ReportStep<'_>,
) -> Result<Vec<Row>, ChartError> {
    let workloads = extent.workloads();
    let total = StarMethod::ALL.len() + extent.skies.len() + workloads;
    let mut done = 0;
    let mut step = |task: String| {
        report_step(&Step { axis: Axis::Stars, done, total, task });
        done += 1;
    };
    let mut scores = Vec::new();
    let share = budget.part(SCORES_SHARE, StarMethod::ALL.len()).left();
    for method in StarMethod::ALL {
        step(format!("scoring {}", method.name()));
        scores.push(score_method(renderer, method, extent.scoring, share)?);
    }
    let mut rows = Vec::new();
    let weight = |skies: &[(Sky, Vec<ViewShape>)]| -> f64 {
        skies.iter().map(|(sky, views)| sky.weight() * views.len() as f64).sum()
    };
    let exposed = extent.exposed_sky();
    for (index, (sky, views)) in extent.skies.iter().enumerate() {
        step(format!("making {} stars", sky.name()));
        let records = skies.records(*sky)?;
        let scene = snapshot(records.to_vec());
        for (done, &view) in views.iter().enumerate() {
            let name = workload_name(*sky, view);
            let of_users = if exposed == Some(index) { &extent.exposures[..] } else { &[] };
            let exposures = 1 + of_users.len();
            let ahead = sky_weight_ahead(extent, exposed.filter(|exposed| *exposed > index));
            let left =
                sky.weight() * ((views.len() - done) * exposures) as f64 + weight(&extent.skies[index + 1..]) + ahead;
            let part = budget.part(sky.weight() * exposures as f64 / left, 1);
            for (turn, &ev100) in [TIMING_EV100].iter().chain(of_users).enumerate() {
                let name = if turn == 0 { name.clone() } else { format!("{name} ev100 {ev100}") };
                step(format!("timing {name}"));
                let workload = Workload { name, sky: &records, scene: &scene, view, ev100, rounds: extent.rounds };
                rows.extend(workload.rows(renderer, &scores, part.part(1.0 / (exposures - turn) as f64, 1))?);
            }
        }
    }
    Ok(rows)
}

/// Returns the weight of the timings at the exposures of users, or 0 if their sky has been drawn already.
fn sky_weight_ahead(extent: &Extent, exposed: Option<usize>) -> f64 {
    exposed.map_or(0.0, |index| {
        let (sky, views) = &extent.skies[index];
        sky.weight() * (views.len() * extent.exposures.len()) as f64
    })
}

fn workload_name(sky: Sky, view: ViewShape) -> String {
    format!("{} {}", sky.name(), view.name())
}

impl Workload<'_> {
    fn rows(&self, renderer: &mut Renderer, scores: &[Scores], budget: Budget) -> Result<Vec<Row>, ChartError> {
        let rig = rig_of(vec![("chart", self.view.kind())])?;
        let lights = self.sky.par_iter().map(illuminance_lx);
        let faintest_lx = lights.reduce(|| f64::INFINITY, f64::min);
        let settings = StarMethod::ALL.map(|method| settings_of(method, self.ev100, faintest_lx));
        let timing = budget.part(TIMING_SHARE, 1);
        let mut timed = timing::frames(renderer, self.scene, &rig, &settings, self.rounds, timing)?;
        if self.ev100 != TIMING_EV100 {
            for (method, (timed, settings)) in StarMethod::ALL.iter().zip(timed.iter_mut().zip(&settings)) {
                if *method == StarMethod::Auto {
                    timed.note = self.whole_frames(renderer, &rig, settings)?;
                }
            }
        }
        let totals = self.totals(renderer, &rig, &settings, &timed, budget)?;
        let case = Case {
            axis: Axis::Stars,
            workload: self.name.clone(),
            adapter: renderer.adapter().adapter.clone(),
            size: self.view.size(),
            items: self.sky.len() as u64,
            planes: self.view.is_flat(),
        };
        let mut rows = Vec::new();
        for (index, method) in StarMethod::ALL.into_iter().enumerate() {
            for metric in Metric::ALL {
                let score = if metric == Metric::FluxTotal { Some(&totals[index]) } else { scores[index].get(metric) };
                let mut score = score.cloned().unwrap_or_default();
                if method.is_relative() && score.value.is_some() {
                    let note = "relative brightness: after one fitted scale";
                    score.note =
                        if score.note.is_empty() { note.to_owned() } else { format!("{note}; {}", score.note) };
                }
                rows.push(case.row(method, &timed[index], metric.name(), &score));
            }
        }
        Ok(rows)
    }

    /// Measures whole frames with all passes and readback: display images within their budget, and HDR images.
    fn whole_frames(
        &self,
        renderer: &mut Renderer,
        rig: &Rig,
        settings: &RenderSettings,
    ) -> Result<String, ChartError> {
        let mut medians = Vec::new();
        for (kind, wanted) in [("display", Wanted::display()), ("HDR", Wanted::hdr())] {
            let mut times = Vec::new();
            // The first turn builds buffers and the map of faint stars.
            for turn in 0..=self.rounds {
                match renderer.render(FrameRequest::new(self.scene, rig).settings(settings).wanted(wanted)) {
                    Ok(frame) if turn > 0 => times.push(frame.times.total_ms),
                    Ok(_) => {}
                    Err(error) => return message_of(error),
                }
            }
            medians.extend(Spread::from_values(&times).map(|spread| format!("{kind} {:.1} ms", spread.median_ms)));
        }
        Ok(format!("whole frames with readback: {}", medians.join(", ")))
    }

    /// Measures the error of the light of the whole frame for each method.
    fn totals(
        &self,
        renderer: &mut Renderer,
        rig: &Rig,
        settings: &[RenderSettings],
        timed: &[Timed],
        budget: Budget,
    ) -> Result<Vec<Score>, ChartError> {
        let projection = projection_of(rig);
        let mapping = projection.mapping();
        // A picture of the whole sky has no border.
        let inner = (!matches!(self.view, ViewShape::FullSky(_))).then(|| {
            let margin_px = BORDER * f64::from(self.view.size()[1]);
            inside(self.sky, mapping, self.scene.camera.world_from_camera, margin_px)
        });
        let expected_lx: f64 = inner.as_deref().unwrap_or(self.sky).iter().map(illuminance_lx).sum();
        let inner_scene = inner.map(snapshot);
        let scene = inner_scene.as_ref().unwrap_or(self.scene);
        let mut totals = Vec::new();
        for ((method, settings), timed) in StarMethod::ALL.into_iter().zip(settings).zip(timed) {
            totals.push(if self.ev100 != TIMING_EV100 {
                Score::none(format!("measured at ev100 {TIMING_EV100}"))
            } else if !method.draws_catalogue() {
                Score::none("does not apply: the sky is procedural, its stars cannot be placed")
            } else if method.is_relative() {
                Score::none("does not apply: brightness is relative, so the frame's light has no scale")
            } else if timed.failed {
                Score::none(timed.note.clone())
            } else if budget.is_over() && timed.took > FAST {
                Score::none("not measured: the budget was used up")
            } else {
                match renderer.render(FrameRequest::new(scene, rig).settings(settings).wanted(Wanted::hdr())) {
                    Ok(frame) => score_of_light(&frame, mapping, expected_lx),
                    Err(error) => Score::none(message_of(error)?),
                }
            });
        }
        Ok(totals)
    }
}

fn illuminance_lx(record: &StarRecord) -> f64 {
    illuminance_lx_from_magnitude(record.apparent_magnitude())
}

/// Returns the absolute value of the relative error of the light of a frame.
fn score_of_light(frame: &crate::render::Frame, mapping: &dyn PlaneMapping, expected_lx: f64) -> Score {
    let Some(pixels) = frame.images.first().and_then(|image| image.hdr.as_ref()) else {
        return Score::none("the frame has no HDR image");
    };
    let error = HdrView::new(mapping, pixels).and_then(|image| relative_flux_error(&[image], expected_lx));
    match error {
        Ok(error) => Score { value: Some(error.abs()), note: String::new() },
        Err(error) => Score::none(error.to_string()),
    }
}

/// Returns the stars that a picture shows farther than `margin_px` from its border.
fn inside(
    records: &[StarRecord],
    mapping: &dyn PlaneMapping,
    world_from_view: DQuat,
    margin_px: f64,
) -> Vec<StarRecord> {
    let view_from_world = world_from_view.conjugate();
    let [width, height] = mapping.size().map(f64::from);
    let is_displayed = |position: DVec2| {
        position.x >= 0.0
            && position.y >= 0.0
            && position.x < width
            && position.y < height
            && mapping.direction_from_pixel(position).is_some()
    };
    let keeps = |record: &&StarRecord| {
        let Some(position) = mapping.pixel_from_direction(view_from_world * record.position) else { return false };
        is_displayed(position)
            && (0..8).all(|step| {
                is_displayed(position + margin_px * DVec2::from_angle(f64::from(step) * std::f64::consts::FRAC_PI_4))
            })
    };
    records.par_iter().filter(keeps).copied().collect()
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::view::projection::{Fisheye, FisheyeMapping, Perspective};

    #[test]
    fn stars_near_the_border_are_omitted() {
        let star = |position| StarRecord { position, magnitude: 1.0, temperature_k: 5000.0, distance_known: true };
        let flat = Perspective::symmetric([100, 50], 1.0).unwrap();
        let star_at_pixel = |x: f64, y: f64| star(7.0 * flat.direction_from_pixel(DVec2::new(x, y)).unwrap());
        let stars = [
            star_at_pixel(50.0, 25.0),
            star_at_pixel(6.0, 25.0),
            star_at_pixel(4.0, 25.0),
            star_at_pixel(50.0, 44.0),
            star_at_pixel(50.0, 46.0),
            star(DVec3::Z),
        ];
        assert_eq!(inside(&stars, &flat, DQuat::IDENTITY, 5.0), [stars[0], stars[1], stars[3]]);
        // A camera that is turned away shows none of them.
        assert_eq!(inside(&stars[..5], &flat, DQuat::from_rotation_y(3.0), 5.0), []);

        let dome = Fisheye::new([100, 100], FisheyeMapping::Equidistant, std::f64::consts::PI).unwrap();
        let star_at_pixel = |x: f64, y: f64| star(dome.direction_from_pixel(DVec2::new(x, y)).unwrap());
        let stars = [
            star_at_pixel(50.0, 50.0),
            star_at_pixel(90.0, 50.0),
            star_at_pixel(97.0, 50.0),
            star_at_pixel(81.0, 81.0),
            star_at_pixel(84.0, 84.0),
        ];
        assert_eq!(inside(&stars, &dome, DQuat::IDENTITY, 5.0), [stars[0], stars[1], stars[3]]);
    }
}
