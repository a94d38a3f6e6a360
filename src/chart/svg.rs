//! The picture of an axis: time against error in double-logarithmic panels, one point per method, the Pareto front as a
//! line.
//!
//! The axis `stars` shows one workload, [`HEADLINE`] if it was run, with one panel per error metric; the table lists all workloads. The axis `glare`
//! has one panel per projection, the axis `live` one per configuration and view. Methods without a figure are listed below their panel. Errors below
//! [`LEAST_ERROR`], which are invisible, are drawn on the lowest line. Sources differ by colour and by the shape of their marks.

mod axes;
mod labels;
mod panel;
mod series;

use ::svg::{
    Document,
    node::element::{Rectangle, Style, Text},
};

use self::panel::{Panel, Point};
use super::{
    About, AsteroidMetric, Axis, GlareMetric, LiveMetric, ProjectorMetric, Row, html::distinct, scores::Metric,
    timing::TIMING_EV100,
};

/// Workload of the picture, if it was run.
const HEADLINE: &str = "1M anticentre-1080p";
/// Metrics of the panels.
const PANELS: [Metric; 6] = [
    Metric::FluxStarRms,
    Metric::FlickerK10,
    Metric::CentroidPx,
    Metric::EllipticityView45Deg,
    Metric::DynamicRange,
    Metric::Keeps20000Stars,
];
/// Smaller errors are drawn as this one.
pub(super) const LEAST_ERROR: f64 = 1e-7;

const STYLE: &str = "text{font-family:'DejaVu Sans',Verdana,Helvetica,sans-serif;font-size:11px;fill:#222;paint-order:stroke;stroke:#fff;stroke-width:2px} \
     .title{font-size:19px;font-weight:bold} .small{font-size:11px;fill:#555} .name{font-size:13px;font-weight:bold} \
     .grid{stroke:#e4e4e4;stroke-width:1} .frame{fill:none;stroke:#999;stroke-width:1} \
     .front{fill:none;stroke:#444;stroke-width:1.6;stroke-dasharray:5 3} .leader{stroke:#aaa;stroke-width:0.7} \
     .best{font-weight:bold}";

const COLUMNS: usize = 2;
const PANEL_WIDTH: f64 = 640.0;
const PANEL_HEIGHT: f64 = 440.0;
const HEAD_HEIGHT: f64 = 112.0;
const MARGIN: f64 = 16.0;

/// Draws the rows of one axis.
pub(super) fn draw(axis: Axis, rows: &[&Row], about: &About) -> String {
    match axis {
        Axis::Stars => stars(axis, rows, about),
        Axis::Glare => glare(axis, rows, about),
        Axis::Asteroids => series::draw(axis, &as_they_grow(rows), about),
        Axis::Projectors => projectors(axis, rows, about),
        Axis::Views | Axis::Scale => series::draw(axis, rows, about),
        Axis::Live => live(axis, rows, about),
    }
}

/// Returns an empty picture with its head: title, subtitle and provenance.
fn with_head(axis: Axis, [width, height]: [f64; 2], subtitle: &str, about: &About) -> Document {
    let mut document = Document::new()
        .set("viewBox", (0, 0, width, height))
        .set("width", width)
        .set("height", height)
        .set("role", "img")
        .add(::svg::node::element::Title::new(axis.title()))
        .add(Style::new(STYLE))
        .add(Rectangle::new().set("width", width).set("height", height).set("fill", "#ffffff"));
    let text =
        |x: f64, y: f64, class: &str, content: &str| Text::new(content).set("x", x).set("y", y).set("class", class);
    let from = format!("{} ({}), {}: {}", about.adapter, about.driver, about.date, about.command);
    document = document
        .add(text(MARGIN, 32.0, "title", axis.title()))
        .add(text(MARGIN, 52.0, "small", subtitle))
        .add(text(MARGIN, 68.0, "small", &from));
    let mut x = MARGIN + 6.0;
    for source in panel::SOURCES {
        document = document.add(panel::mark(source, x, 88.0, 5.0)).add(text(x + 10.0, 92.0, "", source));
        x += 34.0 + labels::width_px(source);
    }
    document
}

/// Returns a picture of panels.
fn with_panels(axis: Axis, subtitle: &str, panels: &[Panel], about: &About) -> String {
    let lines = panels.len().div_ceil(COLUMNS);
    let width = COLUMNS as f64 * PANEL_WIDTH + 2.0 * MARGIN;
    let height = HEAD_HEIGHT + lines as f64 * PANEL_HEIGHT + 2.0 * MARGIN;
    let mut document = with_head(axis, [width, height], subtitle, about);
    for (index, panel) in panels.iter().enumerate() {
        let (column, line) = (index % COLUMNS, index / COLUMNS);
        let corner = [MARGIN + column as f64 * PANEL_WIDTH, HEAD_HEIGHT + line as f64 * PANEL_HEIGHT];
        document = panel.draw(document, corner, [PANEL_WIDTH, PANEL_HEIGHT]);
    }
    document.to_string() + "\n"
}

/// Draws the axis `stars`: one panel per metric, for one workload.
fn stars(axis: Axis, rows: &[&Row], about: &About) -> String {
    let workload = headline(rows);
    let rows_shown: Vec<&Row> = rows.iter().filter(|row| Some(row.workload.as_str()) == workload).copied().collect();
    let subtitle = match rows_shown.first() {
        Some(row) => format!(
            "workload {}: {} stars in the catalogue, {} x {} pixels. ev100 = {TIMING_EV100}. Lower left is better; the dashed line is the Pareto front.",
            row.workload,
            grouped(row.items),
            row.width,
            row.height
        ),
        None => "nothing was measured".to_owned(),
    };
    with_panels(axis, &subtitle, &PANELS.map(|metric| panel_of(metric, &rows_shown)), about)
}

/// Draws the axis `glare`: one panel per projection with the error of the veil, and one panel for each other error, with the data of the workload
/// that measured it.
fn glare(axis: Axis, rows: &[&Row], about: &About) -> String {
    let workloads = distinct(rows, |row| &row.workload);
    let panel = |metric: GlareMetric, workload: &str| {
        let rows_shown: Vec<&Row> = rows.iter().filter(|row| row.workload == workload).copied().collect();
        glare_panel(metric, workload, &rows_shown)
    };
    let mut panels: Vec<Panel> = workloads.iter().map(|workload| panel(GlareMetric::VeilRms, workload)).collect();
    let with_dome = workloads.iter().find(|workload| workload.contains("dome")).or(workloads.first());
    panels.extend(with_dome.map(|workload| panel(GlareMetric::Roundness, workload)));
    let with_edges = workloads.iter().find(|workload| workload.contains("cubemap"));
    panels.extend(with_edges.map(|workload| panel(GlareMetric::Seam, workload)));
    let subtitle = match rows.first() {
        Some(row) => format!(
            "{} stars in the catalogue; time of the glare passes only. Errors relative to the convolution on the sphere in f64. Lower left is better; the dashed line is the Pareto front.",
            grouped(row.items)
        ),
        None => "nothing was measured".to_owned(),
    };
    with_panels(axis, &subtitle, &panels, about)
}

/// Draws the axis `projectors`: one panel per metric.
fn projectors(axis: Axis, rows: &[&Row], about: &About) -> String {
    let panels = ProjectorMetric::ALL.map(|metric| {
        let (points, without) = points(metric.name(), 0.0, rows);
        let (name, meaning) = (metric.name().to_owned(), metric.meaning().to_owned());
        Panel { name, meaning, timed: "the whole frame with readback", points, without }
    });
    let subtitle = match rows.first() {
        Some(row) => format!(
            "A projector that throws across a dome: {} x {} pixels, {} stars in the catalogue. Lower left is better; the dashed line is the Pareto front.",
            row.width,
            row.height,
            grouped(row.items)
        ),
        None => "nothing was measured".to_owned(),
    };
    with_panels(axis, &subtitle, &panels, about)
}

/// Draws the axis `live`: one panel per configuration and view.
fn live(axis: Axis, rows: &[&Row], about: &About) -> String {
    let metric = LiveMetric::Error999Codes;
    let panel = |workload: &str| {
        let of_workload: Vec<&Row> = rows.iter().filter(|row| row.workload == workload).copied().collect();
        let (points, without) = points(metric.name(), 0.0, &of_workload);
        let (name, meaning) = (format!("{workload}: {}", metric.name()), metric.meaning().to_owned());
        Panel { name, meaning, timed: "between frames that reach a client", points, without }
    };
    let panels: Vec<Panel> = distinct(rows, |row| &row.workload).into_iter().map(panel).collect();
    let subtitle = "accuracy.display_codes, frames of RGBA8 over gRPC while the camera turns. Lower left is better; the dashed line is the Pareto front.";
    with_panels(axis, subtitle, &panels, about)
}

/// Returns the rows of the axis `asteroids` that show how time grows with their number: one row per method and workload
/// of the largest flat picture, by increasing number.
fn as_they_grow<'a>(rows: &[&'a Row]) -> Vec<&'a Row> {
    let metric = AsteroidMetric::SilhouetteIou.name();
    let flat = |row: &&&Row| row.error_metric == metric && row.workload.ends_with('p');
    let mut rows_shown: Vec<&Row> = rows.iter().filter(flat).copied().collect();
    rows_shown.sort_by_key(|row| row.items);
    rows_shown
}

/// Formats a whole number in groups of three digits.
pub(super) fn grouped(number: u64) -> String {
    let digits = number.to_string();
    let groups: Vec<&str> =
        digits.as_bytes().rchunks(3).rev().filter_map(|group| std::str::from_utf8(group).ok()).collect();
    groups.join(",")
}

/// Returns the workload to show: the usual one, otherwise the first one.
fn headline<'a>(rows: &[&'a Row]) -> Option<&'a str> {
    let usual = rows.iter().find(|row| row.workload == HEADLINE);
    usual.or(rows.first()).map(|row| row.workload.as_str())
}

/// Returns the panel of a metric of the axis `stars`.
fn panel_of(metric: Metric, rows: &[&Row]) -> Panel {
    let (points, without) = points(metric.name(), metric.best(), rows);
    let name = if metric.best() == 0.0 { metric.name().to_owned() } else { format!("1 - {}", metric.name()) };
    let meaning = metric.meaning().to_owned();
    Panel { name, meaning, timed: "clear, cull, splat and resolve", points, without }
}

/// Returns the panel of a metric of the axis `glare` in a workload.
fn glare_panel(metric: GlareMetric, workload: &str, rows: &[&Row]) -> Panel {
    let (points, without) = points(metric.name(), metric.best(), rows);
    let (name, meaning) = (format!("{workload}: {}", metric.name()), metric.meaning().to_owned());
    Panel { name, meaning, timed: "the glare passes", points, without }
}

/// Returns the points of a metric, and the methods without one.
fn points(metric: &str, best: f64, rows: &[&Row]) -> (Vec<Point>, Vec<String>) {
    let (mut points, mut without) = (Vec::new(), Vec::new());
    for row in rows.iter().filter(|row| row.error_metric == metric) {
        match (row.gpu_ms_median, row.error_value) {
            (Some(ms), Some(value)) if ms > 0.0 => points.push(Point {
                label: row.method.clone(),
                source: row.source.clone(),
                ms,
                error: (value - best).abs().max(LEAST_ERROR),
            }),
            (Some(ms), _) => without.push(format!("{} ({ms:.1} ms)", row.method)),
            (None, _) => without.push(row.method.clone()),
        }
    }
    (points, without)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(method: &str, metric: Metric, ms: Option<f64>, value: Option<f64>) -> Row {
        Row {
            axis: "stars".to_owned(),
            method: method.to_owned(),
            source: "steradian".to_owned(),
            workload: "10k dome".to_owned(),
            error_metric: metric.name().to_owned(),
            gpu_ms_median: ms,
            error_value: value,
            ..Row::default()
        }
    }

    #[test]
    fn methods_without_figures_are_listed_and_not_drawn_as_zero() {
        let rows = [
            row("a", Metric::CentroidPx, Some(2.0), Some(0.0)),
            row("b", Metric::CentroidPx, Some(3.0), None),
            row("c", Metric::CentroidPx, None, Some(0.1)),
            row("d", Metric::FlickerK10, Some(3.0), Some(0.1)),
        ];
        let panel = panel_of(Metric::CentroidPx, &rows.iter().collect::<Vec<_>>());
        assert_eq!(panel.points.len(), 1);
        assert_eq!((panel.points[0].ms, panel.points[0].error), (2.0, LEAST_ERROR));
        assert_eq!(panel.without, ["b (3.0 ms)", "c"]);
    }

    #[test]
    fn glare_errors_are_distances_from_the_best_value() {
        let row = |metric: GlareMetric, value| Row {
            axis: "glare".to_owned(),
            workload: "1k dome-8".to_owned(),
            error_metric: metric.name().to_owned(),
            error_value: Some(value),
            ..row("a", Metric::Seam, Some(2.0), None)
        };
        let rows = [row(GlareMetric::Slope, -3.0), row(GlareMetric::VeilRms, 0.25), row(GlareMetric::FromOutside, 0.0)];
        let rows: Vec<&Row> = rows.iter().collect();
        let error = |metric| glare_panel(metric, "1k dome-8", &rows).points[0].error;
        let found = [GlareMetric::Slope, GlareMetric::VeilRms, GlareMetric::FromOutside].map(error);
        assert_eq!(found, [1.0, 0.25, 1.0]);
    }

    #[test]
    fn large_numbers_are_grouped() {
        assert_eq!([0, 999, 1000, 12_345_678].map(grouped), ["0", "999", "1,000", "12,345,678"]);
    }

    #[test]
    fn kept_share_is_drawn_as_lost_share() {
        let rows = [row("a", Metric::Keeps20000Stars, Some(2.0), Some(0.16))];
        let panel = panel_of(Metric::Keeps20000Stars, &rows.iter().collect::<Vec<_>>());
        assert!((panel.points[0].error - 0.84).abs() < 1e-12 && panel.name.starts_with("1 - "));
    }

    #[test]
    fn names_are_escaped() {
        let about = About {
            adapter: "<script>&\"".to_owned(),
            driver: "d".to_owned(),
            date: "2026".to_owned(),
            command: "c".to_owned(),
        };
        let rows = [row("a<b", Metric::CentroidPx, Some(2.0), Some(0.1))];
        let text = draw(Axis::Stars, &rows.iter().collect::<Vec<_>>(), &about);
        assert!(!text.contains("<script>") && !text.contains("a<b") && text.contains("a&lt;b"), "{text}");
        // A picture is drawn even without rows.
        assert!(Axis::ALL.iter().all(|axis| draw(*axis, &[], &about).contains("</svg>")));
    }
}
