//! `index.html`: the pictures, and a readable table for every workload. One file without scripts; the pictures are next
//! to it.

use std::fmt::Write as _;

use super::{
    About, AsteroidMetric, Axis, DeepMetric, GlareMetric, LiveMetric, ProjectorMetric, Row, scores::Metric,
    summary::Summary, svg::grouped, timing::TIMING_EV100,
};

/// Columns of the table of the axis `stars`, with their headings.
const STARS: [(Metric, &str); 13] = [
    (Metric::FluxStarRms, "flux error, one star"),
    (Metric::FluxTotal, "flux error, frame"),
    (Metric::CentroidPx, "centroid error, px"),
    (Metric::FlickerK1, "flicker k = 1"),
    (Metric::FlickerK10, "flicker k = 10"),
    (Metric::FlickerK100, "flicker k = 100"),
    (Metric::EllipticityView45Deg, "ellipticity"),
    (Metric::WidthVariation, "width variation"),
    (Metric::ColourUv, "colour u'v'"),
    (Metric::DynamicRange, "dynamic range"),
    (Metric::Keeps20000Stars, "keeps of 20,000"),
    (Metric::Seam, "seam"),
    (Metric::OrderBitsDiffer, "shuffles identical"),
];

/// Columns of the axis `glare`.
const GLARE: [(GlareMetric, &str); 7] = [
    (GlareMetric::VeilRms, "veil, rms error"),
    (GlareMetric::VeilLargest, "veil, largest error"),
    (GlareMetric::Roundness, "not round"),
    (GlareMetric::Slope, "slope"),
    (GlareMetric::FromOutside, "from outside"),
    (GlareMetric::Seam, "step at edges"),
    (GlareMetric::FluxKept, "light kept"),
];

/// Columns of the axis `asteroids`.
const ASTEROIDS: [(AsteroidMetric, &str); 5] = [
    (AsteroidMetric::SilhouetteIou, "silhouette, IoU"),
    (AsteroidMetric::OutlinePx, "outline, px"),
    (AsteroidMetric::NormalDeg, "normals, degrees"),
    (AsteroidMetric::DisparityPx, "disparity, px"),
    (AsteroidMetric::Light, "light"),
];

/// Columns of the axis `projectors`.
const PROJECTORS: [(ProjectorMetric, &str); 5] = [
    (ProjectorMetric::LightRms, "light, rms error"),
    (ProjectorMetric::LightLargest, "light, largest"),
    (ProjectorMetric::CentroidPx, "centroid, px"),
    (ProjectorMetric::WidthPx, "width, px"),
    (ProjectorMetric::WidthVariation, "width varies"),
];

/// Columns of the axis `live`.
const LIVE: [(LiveMetric, &str); 8] = [
    (LiveMetric::FramesPerS, "frames/s"),
    (LiveMetric::PoseAgeMs, "age of the pose, ms"),
    (LiveMetric::Error999Codes, "error, 99.9 %, codes"),
    (LiveMetric::ErrorLargestCodes, "largest error, codes"),
    (LiveMetric::Ev100, "EV100"),
    (LiveMetric::Pixels, "pixels"),
    (LiveMetric::StarsInView, "stars in view"),
    (LiveMetric::StarsDrawn, "stars drawn"),
];

/// Columns of the axis `scale`: figures of deep stores.
const SCALE: [(DeepMetric, &str); 5] = [
    (DeepMetric::Error999Codes, "error, 99.9 %, codes"),
    (DeepMetric::ErrorLargestCodes, "largest error, codes"),
    (DeepMetric::ReadMib, "read, MiB"),
    (DeepMetric::MemoryMib, "memory, MiB"),
    (DeepMetric::Drawn, "drawn one by one"),
];

/// An error column.
#[derive(Clone, Copy)]
struct Column {
    metric: &'static str,
    heading: &'static str,
    meaning: &'static str,
}

/// Returns the error columns of an axis that has one table per workload.
fn columns(axis: Axis) -> Vec<Column> {
    let column = |(metric, heading, meaning)| Column { metric, heading, meaning };
    match axis {
        Axis::Stars => STARS.map(|(metric, heading)| column((metric.name(), heading, metric.meaning()))).to_vec(),
        Axis::Glare => GLARE.map(|(metric, heading)| column((metric.name(), heading, metric.meaning()))).to_vec(),
        Axis::Asteroids => {
            ASTEROIDS.map(|(metric, heading)| column((metric.name(), heading, metric.meaning()))).to_vec()
        }
        Axis::Projectors => {
            PROJECTORS.map(|(metric, heading)| column((metric.name(), heading, metric.meaning()))).to_vec()
        }
        Axis::Live => LIVE.map(|(metric, heading)| column((metric.name(), heading, metric.meaning()))).to_vec(),
        Axis::Scale => SCALE.map(|(metric, heading)| column((metric.name(), heading, metric.meaning()))).to_vec(),
        Axis::Views => Vec::new(),
    }
}

const STYLE: &str = "body{font:15px/1.5 system-ui,sans-serif;margin:2rem auto;max-width:1400px;padding:0 1rem;color:#222}\
    h1{font-size:1.5rem} h2{font-size:1.2rem;margin-top:2.5rem} img{width:100%;height:auto;border:1px solid #ddd}\
    .wide{overflow-x:auto} table{border-collapse:collapse;font-size:13px} th,td{padding:3px 8px;border-bottom:1px solid #ddd;\
    text-align:right;white-space:nowrap} th{vertical-align:bottom;white-space:normal;background:#f4f4f4}\
    td:first-child,td:nth-child(2),td:last-child,th:first-child,th:nth-child(2){text-align:left}\
    td:last-child{white-space:normal;min-width:18rem;color:#555} .summary td:last-child{min-width:0;color:inherit} tr.none td{color:#999} dt{font-weight:bold} dd{margin:0 0 .4rem 1rem}\
    code{background:#f4f4f4;padding:1px 4px}";

/// Escapes text for use between tags and in attributes.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// Returns the metric of a row if it belongs to the axis `stars`.
pub(super) fn metric_of(row: &Row) -> Option<Metric> {
    Metric::ALL.into_iter().find(|metric| metric.name() == row.error_metric)
}

/// Formats a figure with its significant digits.
pub(super) fn figure(value: f64) -> String {
    match value.abs() {
        0.0 => "0".to_owned(),
        size if !(1e-3..1e4).contains(&size) => format!("{value:.1e}"),
        size if size < 0.1 => format!("{value:.4}"),
        size if size < 10.0 => format!("{value:.3}"),
        _ => format!("{value:.1}"),
    }
}

/// Returns the distinct values of the rows in order of first occurrence.
pub(super) fn distinct<'a>(rows: &[&'a Row], value: fn(&Row) -> &str) -> Vec<&'a str> {
    let mut found: Vec<&str> = Vec::new();
    for row in rows {
        if !found.contains(&value(row)) {
            found.push(value(row));
        }
    }
    found
}

/// Returns the page.
pub(super) fn page(rows: &[Row], pictures: &[(Axis, String)], about: &About) -> String {
    let mut page = String::new();
    // Writing to a string cannot fail.
    let mut add = |text: &str| page.push_str(text);
    // Head of the page.
    add("<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n");
    add("<meta name=\"viewport\" content=\"width=device-width\">\n<title>Steradian: speed against accuracy</title>\n");
    add(&format!("<style>{STYLE}</style>\n</head>\n<body>\n<h1>Speed against accuracy</h1>\n"));
    add(&format!(
        "<p>Adapter <b>{}</b> ({}), {}, made with <code>{}</code>. All figures: <a href=\"chart.csv\">chart.csv</a>.</p>\n",
        escaped(&about.adapter),
        escaped(&about.driver),
        escaped(&about.date),
        escaped(&about.command)
    ));
    // Per axis: picture, summary of all methods, and a table per workload.
    for (axis, picture) in pictures {
        let of_axis: Vec<&Row> = rows.iter().filter(|row| row.axis == axis.name()).collect();
        add(&format!("<h2>{}</h2>\n", escaped(axis.title())));
        add(&format!("<p><img src=\"{}\" alt=\"{}\"></p>\n", escaped(picture), escaped(axis.title())));
        let columns = columns(*axis);
        if columns.is_empty() {
            add(&matrix(&of_axis));
            continue;
        }
        add(&match axis {
            Axis::Scale => matrix(&of_axis),
            Axis::Glare => summary(
                &Summary::glare(rows),
                "errors are rms errors of the veil; the workloads are in the same order as for the times",
            ),
            Axis::Asteroids => {
                let remark = "errors are measured in the first view, disparity in the view with two eyes; published figures come from other hardware";
                summary(&Summary::asteroids(rows), remark)
            }
            Axis::Live => summary(
                &Summary::live(rows),
                "errors in 8-bit codes relative to the exact image; a budget is kept if 99.9 % of the channels are within it and all within four times that; Pareto: no other budget is faster and has a smaller error",
            ),
            _ => {
                let remark = "errors are those of single stars; identical: shuffled stars give the same bits";
                summary(&Summary::stars(rows), remark)
            }
        });
        for workload in distinct(&of_axis, |row| &row.workload) {
            let of_workload: Vec<&Row> = of_axis.iter().filter(|row| row.workload == workload).copied().collect();
            if of_workload.iter().any(|row| columns.iter().any(|column| column.metric == row.error_metric)) {
                add(&table(workload, &of_workload, &columns));
            } else if *axis != Axis::Scale {
                add(&matrix(&of_workload));
            }
        }
    }
    // Explanation of the columns.
    add(
        "<h2>Meaning of the columns</h2>\n<dl>\n<dt>ms</dt><dd>median (shortest to longest) of the frames of interleaved rounds: \
         clear, cull, splat and resolve; the HDR image is computed and stays on the GPU. ",
    );
    add(&format!(
        "The exposure is manual, ev100 = {TIMING_EV100}, for every method: a star of about magnitude 3 reaches display white if all \
         of its light falls into one pixel of a view of 1080 pixels and 60 degrees. Workloads whose names end with another ev100 use \
         that exposure, a typical one for users; their notes of <code>auto</code> give the times of whole frames with readback. The exposure matters to methods that depend on what the display \
         shows. On the axis <code>glare</code> the time covers the glare passes only, plus the map of the sky on the CPU \
         if it is recomputed for every frame; on the axis <code>asteroids</code> it covers the asteroid passes and planning on \
         the CPU; on the axis <code>live</code> it is the time between frames that reach a client over gRPC, the median of rounds (shortest to longest).</dd>\n"
    ));
    for Column { metric, heading, meaning } in pictures.iter().flat_map(|(axis, _)| columns(*axis)) {
        add(&format!("<dt>{heading} (<code>{metric}</code>)</dt><dd>{}.</dd>\n", escaped(meaning)));
    }
    add(
        "</dl>\n<p>All figures except the frame's flux error and the time are measured on single stars in dedicated scenes, the same for \
         every workload; errors of glare and of asteroids are measured in smaller views of the same projections. A dash means that the figure does not apply or could not be measured; the notes give the reason. The Pareto front contains \
         the methods that no other method beats in both time and error.</p>\n</body>\n</html>\n",
    );
    page
}

/// Returns the table of all methods; `remark` describes its figures other than times.
fn summary(summary: &Summary, remark: &str) -> String {
    let times = summary.workloads.iter().map(|name| format!("<th>ms, {}</th>", escaped(name)));
    let heads: String =
        times.chain(summary.headings.iter().map(|name| format!("<th>{}</th>", escaped(name)))).collect();
    let mut table = format!(
        "<h3>Every method</h3>\n<p>Times are medians; {}.</p>\n\
         <div class=\"wide\"><table class=\"summary\">\n<tr><th>method</th><th>source</th>{heads}</tr>\n",
        escaped(remark)
    );
    for line in &summary.lines {
        let cells: String = line.iter().map(|cell| format!("<td>{}</td>", escaped(cell))).collect();
        table += &format!("<tr>{cells}</tr>\n");
    }
    table + "</table></div>\n"
}

/// Returns the table of one workload.
fn table(workload: &str, rows: &[&Row], columns: &[Column]) -> String {
    let mut table = String::new();
    let first = rows.first();
    let [width, height] = first.map_or([0, 0], |row| [row.width, row.height]);
    let mut add = |text: std::fmt::Arguments<'_>| {
        // Writing to a string cannot fail.
        let _ = table.write_fmt(text);
    };
    add(format_args!(
        "<h3>{}</h3>\n<p>{} {}, {width} x {height} pixels.</p>\n<div class=\"wide\"><table>\n<tr><th>method</th><th>source</th><th>ms</th>",
        escaped(workload),
        grouped(first.map_or(0, |row| row.items)),
        if first.is_some_and(|row| row.axis == Axis::Asteroids.name()) {
            "asteroids"
        } else {
            "stars in the catalogue"
        }
    ));
    for Column { heading, meaning, .. } in columns {
        add(format_args!("<th title=\"{}\">{}</th>", escaped(meaning), escaped(heading)));
    }
    add(format_args!("<th>notes</th></tr>\n"));
    for method in distinct(rows, |row| &row.method) {
        let of_method: Vec<&Row> = rows.iter().filter(|row| row.method == method).copied().collect();
        let row = of_method[0];
        let class = if row.gpu_ms_median.is_none() { " class=\"none\"" } else { "" };
        add(format_args!(
            "<tr{class}><td>{}</td><td>{}</td><td>{}</td>",
            escaped(method),
            escaped(&row.source),
            time(row)
        ));
        let mut notes: Vec<&str> = Vec::new();
        for Column { metric, .. } in columns {
            let found = of_method.iter().find(|row| row.error_metric == *metric);
            add(format_args!(
                "<td>{}</td>",
                found.and_then(|row| row.error_value).map_or("\u{2013}".to_owned(), |value| {
                    match *metric == Metric::OrderBitsDiffer.name() {
                        true if value == 0.0 => "yes".to_owned(),
                        true => format!("no ({:.1} % of pixels)", 100.0 * value),
                        false => figure(value),
                    }
                })
            ));
            for note in found.map_or("", |row| row.notes.as_str()).split("; ").filter(|note| !note.is_empty()) {
                if !notes.contains(&note) {
                    notes.push(note);
                }
            }
        }
        add(format_args!("<td>{}</td></tr>\n", escaped(&notes.join("; "))));
    }
    add(format_args!("</table></div>\n"));
    table
}

/// Returns the table of an axis that has one figure besides the time: one row per method, one column per workload.
fn matrix(rows: &[&Row]) -> String {
    let workloads = distinct(rows, |row| &row.workload);
    let metric = rows.first().map_or("", |row| row.error_metric.as_str());
    let heads: String = workloads.iter().map(|name| format!("<th>{}</th>", escaped(name))).collect();
    let mut table = format!(
        "<p>ms (shortest to longest), in brackets <code>{}</code>.</p>\n<div class=\"wide\"><table>\n\
         <tr><th>method</th><th>source</th>{heads}<th>notes</th></tr>\n",
        escaped(metric)
    );
    for method in distinct(rows, |row| &row.method) {
        let of_method: Vec<&Row> = rows.iter().filter(|row| row.method == method).copied().collect();
        let class = if of_method.iter().all(|row| row.gpu_ms_median.is_none()) { " class=\"none\"" } else { "" };
        let cells = workloads.iter().map(|name| match of_method.iter().find(|row| row.workload == *name) {
            Some(row) => match row.error_value {
                Some(value) => format!("<td>{} [{}]</td>", time(row), figure(value)),
                None => format!("<td>{}</td>", time(row)),
            },
            None => "<td>\u{2013}</td>".to_owned(),
        });
        let cells: String = cells.collect();
        let mut notes: Vec<&str> = Vec::new();
        for note in of_method.iter().flat_map(|row| row.notes.split("; ")).filter(|note| !note.is_empty()) {
            // A missing figure is visible without a note.
            if !notes.contains(&note) && !note.starts_with("does not apply") {
                notes.push(note);
            }
        }
        table += &format!(
            "<tr{class}><td>{}</td><td>{}</td>{cells}<td>{}</td></tr>\n",
            escaped(method),
            escaped(&of_method[0].source),
            escaped(&notes.join("; "))
        );
    }
    table + "</table></div>\n"
}

/// Formats the time of a row.
fn time(row: &Row) -> String {
    match (row.gpu_ms_median, row.gpu_ms_min, row.gpu_ms_max) {
        (Some(median), Some(min), Some(max)) => format!("{median:.2} ({min:.2}\u{2013}{max:.2})"),
        (Some(published), _, _) => format!("{published:.2}"),
        _ => "\u{2013}".to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn about() -> About {
        About {
            adapter: "GPU <1>".to_owned(),
            driver: "driver".to_owned(),
            date: "2026-01-01 00:00 UTC".to_owned(),
            command: "steradian chart --out \"a b\"".to_owned(),
        }
    }

    fn row(metric: Metric, value: Option<f64>) -> Row {
        Row {
            axis: "stars".to_owned(),
            method: "tent".to_owned(),
            source: "steradian".to_owned(),
            workload: "10k dome-8".to_owned(),
            gpu_ms_median: Some(1.25),
            gpu_ms_min: Some(1.0),
            gpu_ms_max: Some(9.0),
            error_metric: metric.name().to_owned(),
            error_value: value,
            notes: if value.is_none() { "no light".to_owned() } else { String::new() },
            ..Row::default()
        }
    }

    #[test]
    fn page_has_provenance_picture_and_table() {
        let rows = [
            row(Metric::CentroidPx, None),
            row(Metric::OrderBitsDiffer, Some(0.0)),
            row(Metric::FlickerK10, Some(0.0384)),
        ];
        let page = page(&rows, &[(Axis::Stars, "stars.svg".to_owned())], &about());
        for part in [
            "GPU &lt;1&gt;",
            "2026-01-01 00:00 UTC",
            "steradian chart --out &quot;a b&quot;",
            "<img src=\"stars.svg\"",
            "<td>tent</td><td>steradian</td><td>1.25 (1.00\u{2013}9.00)</td>",
            "<td>0.0384</td>",
            "<td>yes</td><td>no light</td></tr>",
        ] {
            assert!(page.contains(part), "`{part}` is not in {page}");
        }
        assert_eq!(page.matches("<tr>").count(), 4, "a head and one method, in the summary and in the workload");
        assert!(page.contains("ev100 = -3,") && page.contains("<th>ms, 10k dome-8</th>"), "{page}");
        let differing = super::table("w", &[&row(Metric::OrderBitsDiffer, Some(0.25))], &columns(Axis::Stars));
        assert!(differing.contains("no (25.0 % of pixels)"), "{differing}");
    }

    #[test]
    fn glare_table_has_glare_errors() {
        let row_of = |metric: GlareMetric, value| Row {
            axis: "glare".to_owned(),
            method: "sky_cube".to_owned(),
            error_metric: metric.name().to_owned(),
            error_value: Some(value),
            ..row(Metric::Seam, None)
        };
        let rows = [row_of(GlareMetric::Slope, -2.0), row_of(GlareMetric::FromOutside, 1.0)];
        let page = page(&rows, &[(Axis::Glare, "glare.svg".to_owned())], &about());
        for part in ["<img src=\"glare.svg\"", "<td>-2.000</td><td>1.000</td>", "veil_flux_kept", "<td>sky_cube</td>"] {
            assert!(page.contains(part), "`{part}` is not in {page}");
        }
        assert!(!page.contains("flicker_k10"), "the page has errors of stars");
    }

    #[test]
    fn figures_are_short_and_zero_is_0() {
        let found = [0.0, 1.234e-5, 0.038_41, 0.29, 1.0, 12.34, 123_456.0].map(figure);
        assert_eq!(found, ["0", "1.2e-5", "0.0384", "0.290", "1.000", "12.3", "1.2e5"]);
    }
}
