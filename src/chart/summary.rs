//! The summary: one line per method with its times and its most important errors, as text and for the page.

use super::{
    AsteroidMetric, Axis, GlareMetric, LiveMetric, Row,
    html::{distinct, figure, metric_of},
    live::{budget_of, keeps_budget},
    pareto_front,
    scores::Metric,
    svg::grouped,
};

/// Errors of the summary with their headings; [`Metric::OrderBitsDiffer`] follows as yes or no.
const ERRORS: [(Metric, &str); 6] = [
    (Metric::FluxStarRms, "flux"),
    (Metric::CentroidPx, "centroid px"),
    (Metric::FlickerK1, "flicker k1"),
    (Metric::FlickerK10, "k10"),
    (Metric::FlickerK100, "k100"),
    (Metric::EllipticityView45Deg, "ellipticity"),
];
/// Errors of the summary of asteroids with their headings.
const ASTEROID_ERRORS: [(AsteroidMetric, &str); 5] = [
    (AsteroidMetric::SilhouetteIou, "IoU"),
    (AsteroidMetric::OutlinePx, "outline px"),
    (AsteroidMetric::NormalDeg, "normals deg"),
    (AsteroidMetric::DisparityPx, "disparity px"),
    (AsteroidMetric::Light, "light"),
];
/// With more workloads than this, only those of the larger skies have a column.
const MANY_WORKLOADS: usize = 6;
/// Minimum number of stars of a larger sky.
const MANY_STARS: u64 = 1_000_000;
/// Text of a missing figure.
const NONE: &str = "\u{2013}";

/// Headings of the summary of delivered frames.
const LIVE: [&str; 10] =
    ["ms", "frames/s", "pose ms", "EV100", "in view", "drawn", "99.9 %", "largest", "kept", "Pareto"];

/// One line per method of the axis `stars`, `glare` or `asteroids`, per view and budget of the axis `live`; empty if the
/// axis has no rows.
pub(super) struct Summary {
    /// Workloads with a column.
    pub workloads: Vec<String>,
    /// Headings of the columns after those of the times.
    pub headings: Vec<String>,
    /// Method, source, times, errors; for stars also whether shuffles are identical.
    pub lines: Vec<Vec<String>>,
}

impl Summary {
    /// Summarises the axis `stars` of all rows of a chart.
    pub(super) fn stars(rows: &[Row]) -> Self {
        let stars: Vec<&Row> = rows.iter().filter(|row| row.axis == Axis::Stars.name()).collect();
        let mut workloads = distinct(&stars, |row| &row.workload);
        if workloads.len() > MANY_WORKLOADS {
            let large = |name: &&str| stars.iter().any(|row| row.workload == *name && row.items >= MANY_STARS);
            workloads.retain(large);
        }
        let line = |method: &str| {
            let of_method: Vec<&Row> = stars.iter().filter(|row| row.method == method).copied().collect();
            let source = of_method.first().map_or(String::new(), |row| row.source.clone());
            let mut line = vec![method.to_owned(), source];
            line.extend(workloads.iter().map(|workload| {
                let ms = of_method.iter().find(|row| row.workload == *workload).and_then(|row| row.gpu_ms_median);
                ms.map_or(NONE.to_owned(), |ms| format!("{ms:.1}"))
            }));
            // Errors of single stars are the same in every workload.
            let value = |metric| of_method.iter().find(|row| metric_of(row) == Some(metric))?.error_value;
            line.extend(ERRORS.map(|(metric, _)| value(metric).map_or(NONE.to_owned(), figure)));
            line.push(
                value(Metric::OrderBitsDiffer).map_or(NONE, |share| if share == 0.0 { "yes" } else { "no" }).into(),
            );
            line
        };
        let lines = distinct(&stars, |row| &row.method).into_iter().map(line).collect();
        let headings = ERRORS.iter().map(|(_, heading)| *heading).chain(["identical"]).map(str::to_owned).collect();
        Self { workloads: workloads.into_iter().map(str::to_owned).collect(), headings, lines }
    }

    /// Summarises the axis `glare` of all rows of a chart: time and rms error of the veil in every workload.
    pub(super) fn glare(rows: &[Row]) -> Self {
        let metric = GlareMetric::VeilRms.name();
        let glare: Vec<&Row> =
            rows.iter().filter(|row| row.axis == Axis::Glare.name() && row.error_metric == metric).collect();
        let workloads = distinct(&glare, |row| &row.workload);
        let line = |method: &str| {
            let row = |workload: &str| glare.iter().find(|row| row.method == method && row.workload == workload);
            let source = glare.iter().find(|row| row.method == method).map_or(String::new(), |row| row.source.clone());
            let times = workloads.iter().map(|workload| {
                row(workload).and_then(|row| row.gpu_ms_median).map_or(NONE.to_owned(), |ms| format!("{ms:.2}"))
            });
            let errors = workloads
                .iter()
                .map(|workload| row(workload).and_then(|row| row.error_value).map_or(NONE.to_owned(), figure));
            [method.to_owned(), source].into_iter().chain(times).chain(errors).collect()
        };
        let lines = distinct(&glare, |row| &row.method).into_iter().map(line).collect();
        let headings = (1..=workloads.len()).map(|number| format!("rms {number}")).collect();
        Self { workloads: workloads.into_iter().map(str::to_owned).collect(), headings, lines }
    }

    /// Summarises the axis `asteroids`: the time of every workload, and each error from the first workload that
    /// measured it. Workloads of ratios show the ratio.
    pub(super) fn asteroids(rows: &[Row]) -> Self {
        let asteroids: Vec<&Row> = rows.iter().filter(|row| row.axis == Axis::Asteroids.name()).collect();
        let first_metric = AsteroidMetric::SilhouetteIou.name();
        let is_error = |row: &&&Row| AsteroidMetric::ALL.iter().any(|metric| metric.name() == row.error_metric);
        let timed: Vec<&Row> = asteroids.iter().filter(|row| row.error_metric == first_metric).copied().collect();
        let ratios: Vec<&Row> = asteroids.iter().filter(|row| !is_error(row)).copied().collect();
        let mut workloads = distinct(&timed, |row| &row.workload);
        let items = |workload: &str| timed.iter().find(|row| row.workload == workload).map_or(0, |row| row.items);
        // The rows start with published figures, so sort the workloads.
        workloads.sort_by_key(|workload| items(workload));
        let metrics = distinct(&ratios, |row| &row.error_metric);
        let line = |method: &str| {
            let of_method = || asteroids.iter().filter(|row| row.method == method);
            let source = of_method().next().map_or(String::new(), |row| row.source.clone());
            let times = workloads.iter().map(|workload| {
                let row = timed.iter().find(|row| row.method == method && row.workload == *workload);
                row.and_then(|row| row.gpu_ms_median).map_or(NONE.to_owned(), |ms| format!("{ms:.1}"))
            });
            let value = |metric: &str| {
                let found = of_method().find(|row| row.error_metric == metric && row.error_value.is_some());
                found.and_then(|row| row.error_value).map_or(NONE.to_owned(), figure)
            };
            let errors = ASTEROID_ERRORS.iter().map(|(metric, _)| value(metric.name()));
            let ratios = metrics.iter().map(|metric| value(metric));
            [method.to_owned(), source].into_iter().chain(times).chain(errors).chain(ratios).collect()
        };
        let lines = distinct(&asteroids, |row| &row.method).into_iter().map(line).collect();
        let headings = ASTEROID_ERRORS.iter().map(|(_, heading)| (*heading).to_owned());
        let headings = headings.chain(metrics.iter().map(|metric| (*metric).to_owned())).collect();
        Self { workloads: workloads.into_iter().map(str::to_owned).collect(), headings, lines }
    }

    /// Summarises the axis `live`: one line per view and budget.
    pub(super) fn live(rows: &[Row]) -> Self {
        let live: Vec<&Row> = rows.iter().filter(|row| row.axis == Axis::Live.name()).collect();
        let mut lines = Vec::new();
        for workload in distinct(&live, |row| &row.workload) {
            let of_workload: Vec<&Row> = live.iter().filter(|row| row.workload == workload).copied().collect();
            let methods = distinct(&of_workload, |row| &row.method);
            let row = |method: &str, metric: LiveMetric| {
                of_workload.iter().find(|row| row.method == method && row.error_metric == metric.name())
            };
            let value = |method: &str, metric| row(method, metric).and_then(|row| row.error_value);
            // Time and error of the budgets that have both.
            let timed = methods.iter().filter_map(|method| {
                let row = row(method, LiveMetric::Error999Codes)?;
                Some((*method, (row.gpu_ms_median?, row.error_value?)))
            });
            let (named, points): (Vec<&str>, Vec<(f64, f64)>) = timed.unzip();
            // Figures that cannot be compared are not on the front.
            let front = pareto_front(&points).unwrap_or_default();
            for method in methods {
                let text = |metric, format: fn(f64) -> String| value(method, metric).map_or(NONE.to_owned(), format);
                let errors = value(method, LiveMetric::Error999Codes).zip(value(method, LiveMetric::ErrorLargestCodes));
                let budget = row(method, LiveMetric::Error999Codes).and_then(|row| budget_of(row));
                let kept = budget.zip(errors).map(|(budget, (most, largest))| keeps_budget(budget, most, largest));
                let on_front = named.iter().position(|name| *name == method).map(|index| front.contains(&index));
                let yes_no =
                    |answer: Option<bool>| answer.map_or(NONE, |yes| if yes { "yes" } else { "no" }).to_owned();
                let time = of_workload.iter().find(|row| row.method == method).and_then(|row| row.gpu_ms_median);
                lines.push(vec![
                    format!("{workload}, {method}"),
                    "steradian".to_owned(),
                    time.map_or(NONE.to_owned(), |ms| format!("{ms:.1}")),
                    text(LiveMetric::FramesPerS, |value| format!("{value:.1}")),
                    text(LiveMetric::PoseAgeMs, |value| format!("{value:.0}")),
                    text(LiveMetric::Ev100, |value| format!("{value:.1}")),
                    text(LiveMetric::StarsInView, |value| grouped(value as u64)),
                    text(LiveMetric::StarsDrawn, |value| grouped(value as u64)),
                    text(LiveMetric::Error999Codes, |value| format!("{value:.3}")),
                    text(LiveMetric::ErrorLargestCodes, |value| format!("{value:.3}")),
                    yes_no(kept),
                    yes_no(on_front),
                ]);
            }
        }
        Self { workloads: Vec::new(), headings: LIVE.map(str::to_owned).to_vec(), lines }
    }

    /// Returns lines of text in columns; workloads are numbered.
    pub(super) fn text(&self) -> Vec<String> {
        if self.lines.is_empty() {
            return Vec::new();
        }
        let mut text: Vec<String> =
            self.workloads.iter().enumerate().map(|(index, name)| format!("ms {}: {name}", index + 1)).collect();
        let numbered = (1..=self.workloads.len()).map(|number| format!("ms {number}"));
        let mut cells = vec![vec!["method".to_owned()]];
        cells[0].extend(numbered.chain(self.headings.iter().cloned()));
        // The text omits the source, which is in the page.
        cells.extend(self.lines.iter().map(|line| [&line[..1], &line[2..]].concat()));
        let width = |column: usize| cells.iter().map(|line| line[column].chars().count()).max().unwrap_or(0);
        let widths: Vec<usize> = (0..cells[0].len()).map(width).collect();
        text.extend(cells.iter().map(|line| {
            let padded = line.iter().zip(&widths).enumerate().map(|(column, (cell, width))| match column {
                0 => format!("{cell:<width$}"),
                _ => format!("  {cell:>width$}"),
            });
            padded.collect()
        }));
        text
    }
}

/// Returns the summary of a chart as lines of text: time per workload and errors of every method of stars, glare, then
/// asteroids; then the delivered frames, with the reasons of missing ones.
pub fn summary(rows: &[Row]) -> Vec<String> {
    let summaries = [Summary::stars(rows), Summary::glare(rows), Summary::asteroids(rows), Summary::live(rows)];
    let missing = rows.iter().filter(|row| row.axis == Axis::Live.name() && row.gpu_ms_median.is_none());
    let first = missing.filter(|row| row.error_metric == LiveMetric::Error999Codes.name());
    let reasons = first.map(|row| format!("{}, {}: {}", row.workload, row.method, row.notes));
    summaries.iter().flat_map(Summary::text).chain(reasons).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(method: &str, workload: &str, metric: Metric, ms: Option<f64>, value: Option<f64>) -> Row {
        Row {
            axis: "stars".to_owned(),
            method: method.to_owned(),
            workload: workload.to_owned(),
            items: if workload.starts_with("1M") { 1_000_000 } else { 10 },
            error_metric: metric.name().to_owned(),
            gpu_ms_median: ms,
            error_value: value,
            ..Row::default()
        }
    }

    #[test]
    fn methods_have_a_line_and_missing_figures_a_dash() {
        let mut rows = vec![
            row("a", "10 w", Metric::CentroidPx, Some(2.0), Some(0.25)),
            row("a", "1M w", Metric::CentroidPx, Some(20.0), Some(0.25)),
            row("a", "1M w", Metric::OrderBitsDiffer, Some(20.0), Some(0.0)),
            row("long", "10 w", Metric::OrderBitsDiffer, None, Some(0.1)),
        ];
        let text = summary(&rows);
        let words = |line: &str| line.split_whitespace().map(str::to_owned).collect::<Vec<_>>();
        assert_eq!(text[..2], ["ms 1: 10 w", "ms 2: 1M w"]);
        assert_eq!(
            words(&text[3]),
            ["a", "2.0", "20.0", "\u{2013}", "0.250", "\u{2013}", "\u{2013}", "\u{2013}", "\u{2013}", "yes"]
        );
        assert!(words(&text[4])[..3] == ["long", "\u{2013}", "\u{2013}"] && text[4].ends_with("no"));
        assert!(text[2..].iter().all(|line| line.chars().count() == text[2].chars().count()), "{text:#?}");
        // With many workloads, only those with many stars have a column.
        rows.extend((0..9).map(|i| row("a", &format!("{i}k"), Metric::CentroidPx, Some(2.0), None)));
        assert_eq!(Summary::stars(&rows).workloads, ["1M w"]);
        assert!(summary(&[]).is_empty());
    }
    /// Budget, time, and errors of 99.9 % and of all channels.
    type Budgeted = (f64, Option<f64>, Option<[f64; 2]>);

    /// Rows of a view of the axis `live`.
    fn live_rows(figures: &[Budgeted]) -> Vec<Row> {
        let row = |(codes, ms, errors): &Budgeted, metric: LiveMetric| Row {
            axis: "live".to_owned(),
            method: format!("{codes} codes"),
            workload: "tonight dome".to_owned(),
            error_metric: metric.name().to_owned(),
            gpu_ms_median: *ms,
            error_value: match metric {
                LiveMetric::Error999Codes => errors.map(|errors| errors[0]),
                LiveMetric::ErrorLargestCodes => errors.map(|errors| errors[1]),
                _ => ms.map(|ms| 1e3 / ms),
            },
            notes: if ms.is_none() { "no port".to_owned() } else { String::new() },
            ..Row::default()
        };
        figures.iter().flat_map(|figures| LiveMetric::ALL.map(|metric| row(figures, metric))).collect()
    }

    /// Returns the last two columns of each budget: whether it is kept, and whether it is on the front.
    fn judged(figures: &[Budgeted]) -> Vec<[String; 2]> {
        let summary = Summary::live(&live_rows(figures));
        summary.lines.iter().map(|line| [line[10].clone(), line[11].clone()]).collect()
    }

    #[test]
    fn live_budgets_that_are_exceeded_or_dominated_are_not_passed() {
        let good = [(0.25, Some(90.0), Some([0.1, 0.4])), (0.5, Some(70.0), Some([0.3, 0.9]))];
        assert_eq!(judged(&good), [["yes", "yes"], ["yes", "yes"]]);
        // 99.9 % above the budget, and a largest error above four times the budget.
        assert_eq!(judged(&[(0.5, Some(70.0), Some([0.51, 0.9]))]), [["no", "yes"]]);
        assert_eq!(judged(&[(0.5, Some(70.0), Some([0.3, 2.01]))]), [["no", "yes"]]);
        // Slower and less accurate than the other budget.
        let dominated = [(0.25, Some(60.0), Some([0.1, 0.4])), (0.5, Some(70.0), Some([0.3, 0.9]))];
        assert_eq!(judged(&dominated), [["yes", "yes"], ["yes", "no"]]);
        // A figure that cannot be compared neither keeps its budget nor is on the front.
        let nan = [(0.25, Some(60.0), Some([f64::NAN, 0.4])), (0.5, Some(70.0), Some([0.3, 0.9]))];
        assert_eq!(judged(&nan), [["no", "no"], ["yes", "no"]]);
    }

    #[test]
    fn live_views_without_frames_have_dashes_and_the_reason() {
        let text = summary(&live_rows(&[(0.25, None, None), (0.5, Some(50.0), Some([0.3, 0.9]))]));
        let words: Vec<&str> = text[1].split_whitespace().collect();
        assert_eq!(words[..4], ["tonight", "dome,", "0.25", "codes"]);
        assert!(words[4..].iter().all(|word| *word == "\u{2013}"), "{text:#?}");
        assert!(text[2].contains("50.0") && text[2].contains("20.0"), "{text:#?}");
        assert_eq!(text[3], "tonight dome, 0.25 codes: no port");
        assert!(summary(&[]).is_empty());
    }

    #[test]
    fn glare_has_time_and_error_per_workload() {
        let row = |method: &str, workload: &str, ms, value| Row {
            axis: "glare".to_owned(),
            error_metric: GlareMetric::VeilRms.name().to_owned(),
            ..row(method, workload, Metric::Seam, ms, value)
        };
        let rows = [
            row("none", "a", None, None),
            row("sky_cube", "a", Some(2.0), Some(0.004)),
            row("sky_cube", "b", Some(3.0), Some(0.25)),
        ];
        let text = summary(&rows);
        let words: Vec<Vec<&str>> = text.iter().map(|line| line.split_whitespace().collect()).collect();
        assert_eq!(text[..2], ["ms 1: a", "ms 2: b"]);
        assert_eq!(words[2], ["method", "ms", "1", "ms", "2", "rms", "1", "rms", "2"]);
        assert_eq!(words[3], ["none", "\u{2013}", "\u{2013}", "\u{2013}", "\u{2013}"]);
        assert_eq!(words[4], ["sky_cube", "2.00", "3.00", "0.0040", "0.250"]);
    }
}
