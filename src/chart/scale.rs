//! The axis `scale`: time against the number of stars in the usual flat view. The figure is the time per star of the
//! catalogue. Deep stores follow ([`deep`]).

use super::{
    Axis, Budget, ChartError, Extent, ReportStep, Row, Score, Sky, Step, ViewShape, deep,
    scores::settings_of,
    timing::{self, Case, TIMING_EV100},
    workloads::{Skies, rig_of, snapshot},
};
use crate::{plan::settings::StarMethod, render::Renderer, units::illuminance_lx_from_magnitude};

const VIEW: ViewShape = ViewShape::Flat([1920, 1080]);

pub(super) fn run(
    renderer: &mut Renderer,
    extent: &Extent,
    skies: &mut Skies,
    budget: Budget,
    report_step: ReportStep<'_>,
) -> Result<Vec<Row>, ChartError> {
    let rig = rig_of(vec![("chart", VIEW.kind())])?;
    let mut rows = Vec::new();
    for (done, &stars) in extent.scale.iter().enumerate() {
        let sky = Sky::Galaxy(stars);
        report_step(&Step {
            axis: Axis::Scale,
            done,
            total: extent.scale.len(),
            task: format!("{} stars", sky.name()),
        });
        let records = skies.records(sky)?;
        let faintest = records.iter().map(|record| record.apparent_magnitude()).fold(f64::NEG_INFINITY, f64::max);
        let scene = snapshot(records.to_vec());
        let workload = sky.name();
        let settings =
            StarMethod::ALL.map(|method| settings_of(method, TIMING_EV100, illuminance_lx_from_magnitude(faintest)));
        // Half of the time is for deep stores.
        let budget = budget.part(0.5, extent.scale.len() - done);
        let timed = timing::frames(renderer, &scene, &rig, &settings, extent.rounds, budget)?;
        let adapter = renderer.adapter().adapter.clone();
        let case = Case { axis: Axis::Scale, workload, adapter, size: VIEW.size(), items: stars as u64, planes: true };
        for (method, timed) in StarMethod::ALL.into_iter().zip(&timed) {
            let per_star = timed.spread.map(|spread| spread.median_ms * 1e6 / stars as f64);
            rows.push(case.row(method, timed, "ns_per_star", &Score { value: per_star, note: String::new() }));
        }
    }
    rows.extend(deep::run(renderer, (&extent.deep, &extent.stores), extent.rounds, budget, report_step)?);
    Ok(rows)
}
