//! One panel: logarithmic axes, marks, labels and the Pareto front.

use ::svg::{
    Document,
    node::element::{Circle, Line, Path, Polyline, Rectangle, Text, Title},
};

use super::{
    LEAST_ERROR,
    axes::{self, Scale},
    labels::{self, Box4},
};
use crate::chart::pareto_front;

/// Sources in the order of the legend.
pub const SOURCES: [&str; 6] = [
    "steradian",
    "smaller-than-pixels",
    "celestia-star-psf",
    "billion-stars-cubemap",
    "star-fields-psf-godot",
    "asteroid-field-rendering",
];
/// Colours of the sources: the palette of Okabe and Ito, which colour-blind readers can distinguish.
const COLOURS: [&str; 6] = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#b8860b", "#3d3d3d"];

/// A method in a panel.
pub struct Point {
    /// Label of the point.
    pub label: String,
    /// Source of the method.
    pub source: String,
    /// Time, ms.
    pub ms: f64,
    /// Error, at least [`LEAST_ERROR`].
    pub error: f64,
}

/// Time against one error.
pub struct Panel {
    /// Name of the error metric.
    pub name: String,
    /// Meaning of the metric.
    pub meaning: String,
    /// Work that was timed.
    pub timed: &'static str,
    /// The methods with a figure.
    pub points: Vec<Point>,
    /// The methods without one.
    pub without: Vec<String>,
}

/// Returns the mark of a source.
pub fn mark(source: &str, x: f64, y: f64, r: f64) -> Path {
    let index = SOURCES.iter().position(|name| *name == source).unwrap_or(0);
    let shape = match index {
        0 => format!("M{} {y}a{r} {r} 0 1 0 {} 0a{r} {r} 0 1 0 {} 0Z", x - r, 2.0 * r, -2.0 * r),
        1 => format!("M{} {}h{}v{}h{}Z", x - r, y - r, 2.0 * r, 2.0 * r, -2.0 * r),
        2 => format!("M{x} {}L{} {}H{}Z", y - 1.2 * r, x + 1.1 * r, y + 0.9 * r, x - 1.1 * r),
        3 => format!("M{x} {}L{} {y}L{x} {}L{} {y}Z", y - 1.3 * r, x + 1.3 * r, y + 1.3 * r, x - 1.3 * r),
        4 => format!("M{x} {}L{} {}H{}Z", y + 1.2 * r, x + 1.1 * r, y - 0.9 * r, x - 1.1 * r),
        _ => format!("M{} {}H{}V{}H{}Z", x - 1.3 * r, y - 0.7 * r, x + 1.3 * r, y + 0.7 * r, x - 1.3 * r),
    };
    Path::new().set("d", shape).set("fill", COLOURS[index]).set("stroke", "#ffffff").set("stroke-width", 0.8)
}

/// Returns the colour of a source.
pub fn colour(source: &str) -> &'static str {
    COLOURS[SOURCES.iter().position(|name| *name == source).unwrap_or(0)]
}

/// Returns the line from a point to its distant label.
pub fn leader([x, y]: [f64; 2], label: &Box4) -> Line {
    let end = x.clamp(label.left, label.right);
    let edge = y.clamp(label.top + 1.0, label.bottom - 1.0);
    Line::new().set("x1", x).set("y1", y).set("x2", end).set("y2", edge).set("class", "leader")
}

/// Wraps words into lines of at most this many characters.
pub fn wrapped(text: &str, characters: usize) -> Vec<String> {
    let mut lines = vec![String::new()];
    for word in text.split(' ') {
        let line = lines.last_mut().filter(|line| line.is_empty() || line.len() + word.len() < characters);
        match line {
            Some(line) => {
                if !line.is_empty() {
                    line.push(' ');
                }
                line.push_str(word);
            }
            None => lines.push(word.to_owned()),
        }
    }
    lines
}

impl Panel {
    /// Adds the panel to a picture with its corner at `corner`.
    pub fn draw(&self, mut document: Document, corner: [f64; 2], size: [f64; 2]) -> Document {
        let text =
            |x: f64, y: f64, class: &str, content: &str| Text::new(content).set("x", x).set("y", y).set("class", class);
        let [left, top] = corner;
        let frame =
            Box4 { left: left + 62.0, top: top + 46.0, right: left + size[0] - 14.0, bottom: top + size[1] - 82.0 };
        document = document.add(text(frame.left, top + 20.0, "name", &self.name));
        document = document.add(text(frame.left, top + 36.0, "small", &self.meaning));
        let without = if self.without.is_empty() {
            String::new()
        } else {
            format!("without a figure: {}", self.without.join(", "))
        };
        for (index, line) in wrapped(&without, 88).into_iter().enumerate() {
            document = document.add(text(frame.left, frame.bottom + 48.0 + 13.0 * index as f64, "small", &line));
        }
        document = document.add(
            Rectangle::new()
                .set("x", frame.left)
                .set("y", frame.top)
                .set("width", frame.right - frame.left)
                .set("height", frame.bottom - frame.top)
                .set("class", "frame"),
        );
        if self.points.is_empty() {
            let middle = ((frame.left + frame.right) / 2.0, (frame.top + frame.bottom) / 2.0);
            return document
                .add(text(middle.0, middle.1, "small", "no method has a figure").set("text-anchor", "middle"));
        }
        let (x, y) = self.scales(&frame);
        document = axes::errors(axes::times(document, &x, self.timed, &frame), &y, &frame);
        self.marks(document, &x, &y, &frame)
    }

    fn scales(&self, frame: &Box4) -> (Scale, Scale) {
        let range = |value: fn(&Point) -> f64| {
            let values = self.points.iter().map(value);
            values.fold((f64::INFINITY, 0.0_f64), |(least, most), value| (least.min(value), most.max(value)))
        };
        let (fastest, slowest) = range(|point| point.ms);
        // Leave room for the labels to the right of the slowest method.
        let widen = (slowest / fastest).max(2.0).powf(0.12);
        let x = Scale { from: fastest / widen, to: slowest * widen, start_px: frame.left, end_px: frame.right };
        let (least, most) = range(|point| point.error);
        let decade = |value: f64, up: bool| {
            let exponent = value.log10();
            10f64.powf(if up { (exponent + 0.15).ceil() } else { (exponent - 0.05).floor() })
        };
        let top = decade(most, true);
        // Show at least two decades: a smaller difference does not matter.
        let from = decade(least, false).min(1e-2 * top);
        let y = Scale { from, to: top, start_px: frame.bottom, end_px: frame.top };
        (x, y)
    }

    fn marks(&self, mut document: Document, x: &Scale, y: &Scale, frame: &Box4) -> Document {
        let figures: Vec<(f64, f64)> = self.points.iter().map(|point| (point.ms, point.error)).collect();
        // Every point is finite, because the table refuses rows with other figures.
        let front = pareto_front(&figures).unwrap_or_default();
        // Staircase: no method reaches the region below and to the left of it.
        let mut stairs: Vec<[f64; 2]> = Vec::new();
        for &index in &front {
            let (px, py) = (x.px(figures[index].0), y.px(figures[index].1));
            stairs.push([px, stairs.last().map_or(frame.top, |before| before[1])]);
            stairs.push([px, py]);
        }
        stairs.extend(stairs.last().map(|last| [frame.right, last[1]]));
        let line: Vec<String> = stairs.iter().map(|[x, y]| format!("{x:.1},{y:.1}")).collect();
        document = document.add(Polyline::new().set("points", line.join(" ")).set("class", "front"));
        let places: Vec<([f64; 2], f64)> = self
            .points
            .iter()
            .enumerate()
            .map(|(index, point)| {
                let width = if front.contains(&index) { labels::bold_width_px } else { labels::width_px };
                ([x.px(point.ms), y.px(point.error)], width(&point.label))
            })
            .collect();
        for ((index, point), label) in self.points.iter().enumerate().zip(labels::place(&places, &stairs, *frame)) {
            let [px, py] = places[index].0;
            if label.far {
                document = document.add(leader(places[index].0, &label.area));
            }
            let on_front = front.contains(&index);
            if on_front {
                let ring = Circle::new().set("cx", px).set("cy", py).set("r", 8.5);
                document = document.add(ring.set("fill", "none").set("stroke", "#444").set("stroke-width", 1.2));
            }
            let least = if point.error <= LEAST_ERROR { "at most " } else { "" };
            let tip = format!("{}: {:.3} ms, {least}{:.3e}", point.label, point.ms, point.error);
            document = document.add(mark(&point.source, px, py, 5.0).add(Title::new(tip)));
            let class = if on_front { "best" } else { "" };
            document = document.add(
                Text::new(point.label.as_str())
                    .set("x", label.area.left)
                    .set("y", label.area.bottom - 2.5)
                    .set("class", class),
            );
        }
        document
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_lines_wrap_between_words() {
        assert_eq!(wrapped("one two three", 8), ["one two", "three"]);
        assert_eq!(wrapped("", 8), [""]);
        assert_eq!(wrapped("incomprehensible it", 8), ["incomprehensible", "it"]);
    }
}
