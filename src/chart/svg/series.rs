//! The picture of an axis that has only times: one line per method, from workload to workload.

use ::svg::node::element::{Polyline, Rectangle, Text, Title};

use super::{
    MARGIN,
    axes::{self, Scale},
    grouped,
    labels::{self, Box4},
    panel, with_head,
};
use crate::chart::{About, Axis, Row};

const SIZE: [f64; 2] = [1100.0, 700.0];
/// Space for the names at the right, pixels.
const NAMES: f64 = 200.0;

/// The times of one method.
struct Series<'a> {
    method: &'a str,
    source: &'a str,
    /// Index in the list of workloads, and time, ms.
    times: Vec<(usize, f64)>,
}

/// Draws the rows of an axis.
pub fn draw(axis: Axis, rows: &[&Row], about: &About) -> String {
    // Group the rows: a place on the time axis per workload, a series per method, and the methods without a time.
    let mut workloads: Vec<&Row> = Vec::new();
    let mut series: Vec<Series<'_>> = Vec::new();
    let mut without: Vec<&str> = Vec::new();
    for row in rows {
        let same = |known: &&Row| known.workload == row.workload || by_count(axis) && known.items == row.items;
        let known = workloads.iter().position(same);
        let place = known.unwrap_or_else(|| {
            workloads.push(row);
            workloads.len() - 1
        });
        let Some(ms) = row.gpu_ms_median.filter(|ms| *ms > 0.0) else {
            if !without.contains(&row.method.as_str()) {
                without.push(&row.method);
            }
            continue;
        };
        match series.iter_mut().find(|series| series.method == row.method) {
            Some(series) => series.times.push((place, ms)),
            None => series.push(Series { method: &row.method, source: &row.source, times: vec![(place, ms)] }),
        }
    }
    // Head of the picture with a subtitle, and the frame.
    let subtitle = match rows.first() {
        Some(row) if axis == Axis::Scale => {
            format!("galaxy seen towards the anticentre, {} x {} pixels; lower is better", row.width, row.height)
        }
        Some(row) if axis == Axis::Asteroids => format!(
            "a field of constant volume, all of it on screen, {} x {} pixels; time of the asteroid passes and planning; published figures come \
             from other hardware; lower is better",
            row.width, row.height
        ),
        Some(row) => format!("{} stars in the catalogue; lower is better", grouped(row.items)),
        None => "nothing was measured".to_owned(),
    };
    let mut document = with_head(axis, SIZE, &subtitle, about);
    let frame = Box4 { left: MARGIN + 62.0, top: 112.0, right: SIZE[0] - MARGIN - NAMES, bottom: SIZE[1] - 90.0 };
    document = document.add(
        Rectangle::new()
            .set("x", frame.left)
            .set("y", frame.top)
            .set("width", frame.right - frame.left)
            .set("height", frame.bottom - frame.top)
            .set("class", "frame"),
    );
    // Names of the methods without a time, below the frame.
    if !without.is_empty() {
        let text = format!("without a time: {}", without.join(", "));
        for (index, line) in panel::wrapped(&text, 150).into_iter().enumerate() {
            let y = frame.bottom + 48.0 + 13.0 * index as f64;
            document = document.add(Text::new(line).set("x", frame.left).set("y", y).set("class", "small"));
        }
    }
    let times = || series.iter().flat_map(|series| &series.times).map(|time| time.1);
    let (least, most) = (times().fold(f64::INFINITY, f64::min), times().fold(0.0, f64::max));
    if most > 0.0 {
        // Show at least half a decade, so that noise does not fill the picture.
        let middle = (least * most).sqrt();
        let y = Scale {
            from: (least * 0.85).min(middle / 2.0),
            to: (most * 1.15).max(middle * 2.0),
            start_px: frame.bottom,
            end_px: frame.top,
        };
        // Grid and labels of both axes.
        for (digit, decade) in y.ticks() {
            let value = digit * 10f64.powi(decade);
            document = axes::level(document, y.px(value), format!("{} ms", axes::label(digit, decade)), &frame);
        }
        let places = places(axis, &workloads, &frame);
        for (place, row) in places.iter().zip(&workloads) {
            let name =
                if axis == Axis::Asteroids { row.workload.split(' ').next() } else { Some(row.workload.as_str()) };
            document = axes::upright(document, *place, name.unwrap_or_default(), &frame);
        }
        // Place the name of each series next to its last point.
        let last: Vec<([f64; 2], f64)> = series
            .iter()
            .filter_map(|series| series.times.last().map(|time| (series, time)))
            .map(|(series, (place, ms))| ([places[*place], y.px(*ms)], labels::width_px(series.method)))
            .collect();
        let labels = labels::place(&last, &[], Box4 { left: frame.right - 16.0, right: SIZE[0] - 2.0, ..frame });
        // Draw each series: line, marks with tooltips, and name.
        for ((series, label), ([x, last_y], _)) in series.iter().zip(labels).zip(&last) {
            let colour = panel::colour(series.source);
            let points: Vec<String> =
                series.times.iter().map(|(place, ms)| format!("{:.1},{:.1}", places[*place], y.px(*ms))).collect();
            let line = Polyline::new().set("points", points.join(" ")).set("fill", "none").set("stroke", colour);
            document = document.add(line.set("stroke-opacity", 0.6));
            for (place, ms) in &series.times {
                let tip = format!("{}, {}: {ms:.3} ms", series.method, workloads[*place].workload);
                document =
                    document.add(panel::mark(series.source, places[*place], y.px(*ms), 4.0).add(Title::new(tip)));
            }
            if label.far {
                document = document.add(panel::leader([*x, *last_y], &label.area));
            }
            let name = Text::new(series.method).set("x", label.area.left).set("y", label.area.bottom - 2.5);
            document = document.add(name);
        }
    }
    let caption = match axis {
        Axis::Scale => "stars in the catalogue",
        Axis::Asteroids => "asteroids",
        _ => "views of one frame",
    };
    axes::caption(document, caption, &frame).to_string() + "\n"
}

/// Whether workloads are placed by the logarithm of their number of stars.
fn by_count(axis: Axis) -> bool {
    matches!(axis, Axis::Scale | Axis::Asteroids)
}

/// Returns the position of each workload: by the logarithm of its number of stars, or evenly spaced.
fn places(axis: Axis, workloads: &[&Row], frame: &Box4) -> Vec<f64> {
    let inner = [frame.left + 40.0, frame.right - 20.0];
    let even = |index: usize| inner[0] + (inner[1] - inner[0]) * index as f64 / (workloads.len() - 1).max(1) as f64;
    let items = |row: &Row| (row.items.max(1)) as f64;
    match (by_count(axis), workloads.first(), workloads.last()) {
        (true, Some(first), Some(last)) if last.items > first.items => {
            let scale = Scale { from: items(first), to: items(last), start_px: inner[0], end_px: inner[1] };
            workloads.iter().map(|row| scale.px(items(row))).collect()
        }
        _ => (0..workloads.len()).map(even).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(workload: &str, items: u64) -> Row {
        Row { workload: workload.to_owned(), items, ..Row::default() }
    }

    #[test]
    fn star_counts_are_logarithmic_and_views_evenly_spaced() {
        let rows = [row("a", 100), row("b", 1000), row("c", 100_000)];
        let rows: Vec<&Row> = rows.iter().collect();
        let frame = Box4 { left: -40.0, top: 0.0, right: 320.0, bottom: 1.0 };
        let near = |found: Vec<f64>, expected: [f64; 3]| found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-9);
        assert!(near(places(Axis::Scale, &rows, &frame), [0.0, 100.0, 300.0]));
        assert!(near(places(Axis::Views, &rows, &frame), [0.0, 150.0, 300.0]));
        assert_eq!(places(Axis::Scale, &rows[..1], &frame), [0.0]);
        assert!(places(Axis::Views, &[], &frame).is_empty());
    }
}
