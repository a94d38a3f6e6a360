//! The axis `views`: cost of additional views of the same frame. A window, the two eyes of a headset, a cubemap and a
//! dome are drawn separately and all together; stars are read once for all views. The figure of the combined frame is
//! its time divided by the sum of the separate times: below 1, one frame of many views is cheaper than many frames.

use super::{
    Axis, Budget, ChartError, Extent, ReportStep, Row, Score, Sky, Step, ViewShape,
    scores::settings_of,
    timing::{self, Case, TIMING_EV100},
    workloads::{Skies, rig_of, snapshot},
};
use crate::{plan::settings::StarMethod, render::Renderer, units::illuminance_lx_from_magnitude, view::ViewKind};

/// Returns the views by name, with the size of their first image.
fn views() -> Vec<(&'static str, ViewKind, [u32; 2])> {
    let shapes = [
        ("window", ViewShape::Flat([1280, 720])),
        ("stereo", ViewShape::Stereo([1024; 2])),
        ("cubemap", ViewShape::Cubemap(512)),
        ("dome", ViewShape::Dome(1024)),
    ];
    shapes.map(|(name, shape)| (name, shape.kind(), shape.size())).to_vec()
}

pub(super) fn run(
    renderer: &mut Renderer,
    extent: &Extent,
    skies: &mut Skies,
    budget: Budget,
    report_step: ReportStep<'_>,
) -> Result<Vec<Row>, ChartError> {
    // Scene, views and settings; the last set has all views together.
    let sky = Sky::Galaxy(extent.many_views_stars);
    let records = skies.records(sky)?;
    let faintest = records.iter().map(|record| record.apparent_magnitude()).fold(f64::NEG_INFINITY, f64::max);
    let scene = snapshot(records.to_vec());
    let views = views();
    let total = views.len() + 1;
    let together: Vec<(&str, ViewKind)> = views.iter().map(|(name, kind, _)| (*name, kind.clone())).collect();
    let all = rig_of(together)?;
    let settings =
        StarMethod::ALL.map(|method| settings_of(method, TIMING_EV100, illuminance_lx_from_magnitude(faintest)));
    let adapter = renderer.adapter().adapter.clone();
    let mut rows = Vec::new();
    let mut apart_ms = vec![Some(0.0); StarMethod::ALL.len()];
    let mut sets = Vec::new();
    for (name, kind, size) in &views {
        sets.push((*name, rig_of(vec![(*name, kind.clone())])?, *size));
    }
    sets.push(("all together", all, views[0].2));
    // Time every set of views.
    for (done, (name, rig, size)) in sets.into_iter().enumerate() {
        report_step(&Step { axis: Axis::Views, done, total, task: format!("{name}, {} stars", sky.name()) });
        let timed = timing::frames(renderer, &scene, &rig, &settings, extent.rounds, budget.part(1.0, total - done))?;
        let last = done + 1 == total;
        let case = Case {
            axis: Axis::Views,
            workload: name.to_owned(),
            adapter: adapter.clone(),
            size,
            items: extent.many_views_stars as u64,
            planes: matches!(name, "window" | "stereo" | "cubemap"),
        };
        // One row per method; the last set has the ratio to the sum of the separate times.
        for (index, method) in StarMethod::ALL.into_iter().enumerate() {
            let ms = timed[index].spread.map(|spread| spread.median_ms);
            let score = if last {
                let share = ms.zip(apart_ms[index]).map(|(together, apart)| together / apart);
                Score { value: share, note: String::new() }
            } else {
                apart_ms[index] = apart_ms[index].zip(ms).map(|(sum, ms)| sum + ms);
                Score { value: None, note: "does not apply to a single view".to_owned() }
            };
            rows.push(case.row(method, &timed[index], "time_over_views_apart", &score));
        }
    }
    Ok(rows)
}
