//! Tests the axis `live` with tiny views of daemons that the built program runs. Times are not tested.

use std::{collections::BTreeSet, path::PathBuf, time::Duration};

use steradian::{
    chart::{self, Axis, Extent, LiveExtent, LiveMetric, LiveRequest, LiveScene, Row, read_csv},
    cli::Daemons,
    gpu::GpuOptions,
};

use super::{AMPLE, about, tiny, well_formed};

/// Returns a configuration with the real bright stars over a place on the Earth.
const SMALL: &str = r#"
    [scene]
    catalogues = ["builtin:bright"]
    time = 2026-11-09T20:00:00Z
    [scene.observer]
    latitude_deg = 48.0
    longitude_deg = 11.0
    [[views]]
    name = "dome"
    type = "dome_master"
    size = [96, 96]
    [[views]]
    name = "south"
    type = "perspective"
    size = [96, 54]
    fov_y_deg = 60.0
"#;

fn scene(name: &str, text: &str, views: &[&str], budgets_codes: &[f64]) -> LiveScene {
    LiveScene {
        name: name.to_owned(),
        text: text.to_owned(),
        views: views.iter().map(|view| (*view).to_owned()).collect(),
        budgets_codes: budgets_codes.to_vec(),
        set: Vec::new(),
    }
}

/// Runs the axis for these configurations, with short rounds.
fn rows(scenes: Vec<LiveScene>) -> Vec<Row> {
    let live = LiveExtent { scenes, rounds: 2, round: Duration::from_millis(50), poses: 2, budget: AMPLE };
    let extent = Extent { live, ..tiny() };
    let daemons = Daemons::new(PathBuf::from(env!("CARGO_BIN_EXE_steradian")), &GpuOptions::default(), false).unwrap();
    let mut start = |request: &LiveRequest<'_>| daemons.start(request);
    let mut steps = Vec::new();
    let mut renderer = crate::common::renderer();
    let mut report = |step: &chart::Step| steps.push(step.clone());
    let rows = chart::run(&mut renderer, &[Axis::Live], &extent, &mut start, &mut report).unwrap();
    assert!(steps.iter().enumerate().all(|(index, step)| step.done == index && step.total == steps.len()), "{steps:?}");
    // One row per configuration, view, budget and metric.
    let keys: BTreeSet<_> = rows.iter().map(|row| (&row.workload, &row.method, &row.error_metric)).collect();
    assert_eq!(keys.len(), rows.len());
    rows
}

fn figure(rows: &[Row], workload: &str, method: &str, metric: LiveMetric) -> Option<f64> {
    let key = (workload, method, metric.name());
    let found = rows.iter().find(|row| (&*row.workload, &*row.method, &*row.error_metric) == key);
    found.unwrap_or_else(|| panic!("no row {key:?}")).error_value
}

#[test]
fn delivered_frames_have_all_figures_and_keep_their_budgets() {
    let rows = rows(vec![scene("small", SMALL, &["dome", "south"], &[0.25, 1.0])]);
    assert_eq!(rows.len(), 2 * 2 * LiveMetric::ALL.len());
    for row in &rows {
        let times = [row.gpu_ms_min, row.gpu_ms_median, row.gpu_ms_max].map(Option::unwrap);
        assert!(0.0 < times[0] && times.is_sorted() && row.error_value.is_some(), "{row:?}");
        assert!((200..20_000).contains(&row.items) && row.width == 96 && !row.notes.is_empty(), "{row:?}");
    }
    for (workload, pixels) in [("small dome", 96.0 * 96.0), ("small south", 96.0 * 54.0)] {
        for (method, budget) in [("0.25 codes", 0.25), ("1 codes", 1.0)] {
            let value = |metric| figure(&rows, workload, method, metric).unwrap();
            let errors = [LiveMetric::Error999Codes, LiveMetric::ErrorLargestCodes].map(value);
            assert!(errors[0] <= errors[1], "{errors:?}");
            assert!(errors[0] <= budget && errors[1] <= 4.0 * budget, "{workload} {method}: {errors:?}");
            assert_eq!(value(LiveMetric::Pixels), pixels);
            assert!(value(LiveMetric::FramesPerS) > 0.0 && value(LiveMetric::PoseAgeMs) > 0.0);
            assert!((-12.0..0.0).contains(&value(LiveMetric::Ev100)), "{}", value(LiveMetric::Ev100));
            assert!(value(LiveMetric::StarsInView) >= value(LiveMetric::StarsDrawn).min(1.0));
        }
    }
    assert!(rows.iter().any(|row| row.notes.contains("plan ") && row.notes.contains("frame ")), "times of the passes");

    // Check the table, the picture, the page and the summary.
    let folder = tempfile::tempdir().unwrap();
    chart::write(folder.path(), &rows, &about()).unwrap();
    let read = |name: &str| std::fs::read_to_string(folder.path().join(name)).unwrap();
    assert_eq!(read_csv(&read("chart.csv")).unwrap(), rows);
    let (texts, html) = (well_formed(&read("live.svg")), read("index.html"));
    for workload in ["small dome", "small south"] {
        assert!(texts.iter().any(|text| text.contains(workload)) && html.contains(workload), "{workload}");
    }
    assert!(texts.iter().any(|text| text.contains("0.25 codes")) && html.contains("<td>0.25 codes</td>"));
    let summary = chart::summary(&rows);
    assert_eq!(summary.len(), 1 + 4, "{summary:#?}");
    assert!(summary[1].starts_with("small dome, 0.25 codes") && summary[1].contains("yes"), "{summary:#?}");
}

#[test]
fn daemons_and_views_that_fail_have_empty_rows_with_the_reason() {
    let wrong = SMALL.replace("dome_master", "dome_slave");
    let scenes = vec![scene("wrong", &wrong, &["dome"], &[0.5]), scene("small", SMALL, &["no_such_view"], &[0.5])];
    let rows = rows(scenes);
    assert_eq!(rows.len(), 2 * LiveMetric::ALL.len());
    for row in &rows {
        let figures = [row.gpu_ms_min, row.gpu_ms_median, row.gpu_ms_max, row.error_value];
        assert_eq!(figures, [None; 4], "{row:?}");
        let reason = if row.workload == "wrong dome" { "dome_slave" } else { "no_such_view" };
        assert!(row.notes.contains(reason), "{row:?}");
    }
    let summary = chart::summary(&rows);
    assert!(summary.iter().any(|line| line.starts_with("wrong dome, 0.5 codes: ") && line.contains("dome_slave")));
}
