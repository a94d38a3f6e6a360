//! Logarithmic axes: positions of values, grid lines and labels.

use ::svg::{
    Document,
    node::element::{Line, Text},
};

use super::{LEAST_ERROR, labels::Box4};

/// A logarithmic axis.
#[derive(Clone, Copy, Debug)]
pub struct Scale {
    /// Value at the start.
    pub from: f64,
    /// Value at the end.
    pub to: f64,
    /// Position of the start, pixels.
    pub start_px: f64,
    /// Position of the end, pixels.
    pub end_px: f64,
}

impl Scale {
    /// Returns the position of a value, pixels.
    pub fn px(&self, value: f64) -> f64 {
        let part = (value.log10() - self.from.log10()) / (self.to.log10() - self.from.log10());
        self.start_px + part * (self.end_px - self.start_px)
    }

    /// Returns the values with a line and a label, as (digit, power of ten).
    pub fn ticks(&self) -> Vec<(f64, i32)> {
        let decades = self.from.log10().floor() as i32..=self.to.log10().ceil() as i32;
        let steps: &[f64] = match self.to / self.from {
            ratio if ratio < 2.5 => &[1.0, 1.2, 1.5, 1.8, 2.0, 2.5, 3.0, 3.5, 4.0, 4.5, 5.0, 6.0, 7.0, 8.0, 9.0],
            ratio if ratio < 12.0 => &[1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 7.0],
            ratio if ratio < 300.0 => &[1.0, 2.0, 5.0],
            _ => &[1.0],
        };
        decades
            .flat_map(|decade| steps.iter().map(move |step| (*step, decade)))
            .filter(|(step, decade)| {
                let value = step * 10f64.powi(*decade);
                value >= self.from * 0.999_999 && value <= self.to * 1.000_001
            })
            .collect()
    }
}

/// Formats a number for an axis.
pub fn label(digit: f64, decade: i32) -> String {
    match decade {
        0..5 => format!("{}", digit * 10f64.powi(decade)),
        -3..0 => format!("{:.*}", (-decade) as usize + usize::from(digit.fract() > 0.0), digit * 10f64.powi(decade)),
        _ => format!("{digit}e{decade}"),
    }
}

/// Returns a line of the grid.
fn line(x1: f64, y1: f64, x2: f64, y2: f64) -> Line {
    Line::new().set("x1", x1).set("y1", y1).set("x2", x2).set("y2", y2).set("class", "grid")
}

/// Adds a vertical line with a label below it.
pub fn upright(document: Document, x: f64, label: &str, frame: &Box4) -> Document {
    let label = Text::new(label).set("x", x).set("y", frame.bottom + 14.0).set("text-anchor", "middle");
    document.add(line(x, frame.top, x, frame.bottom)).add(label)
}

/// Adds a horizontal line with a label to its left.
pub fn level(document: Document, y: f64, label: String, frame: &Box4) -> Document {
    let label = Text::new(label).set("x", frame.left - 5.0).set("y", y + 4.0).set("text-anchor", "end");
    document.add(line(frame.left, y, frame.right, y)).add(label)
}

/// Adds the caption of the axis below the frame.
pub fn caption(document: Document, text: &str, frame: &Box4) -> Document {
    let caption = Text::new(text).set("x", (frame.left + frame.right) / 2.0).set("y", frame.bottom + 30.0);
    document.add(caption.set("text-anchor", "middle").set("class", "small"))
}

/// Adds the time axis along the lower edge; `timed` names the timed work.
pub fn times(mut document: Document, x: &Scale, timed: &str, frame: &Box4) -> Document {
    for (digit, decade) in x.ticks() {
        document = upright(document, x.px(digit * 10f64.powi(decade)), &label(digit, decade), frame);
    }
    caption(document, &format!("ms per frame: {timed}"), frame)
}

/// Adds the error axis along the left edge.
pub fn errors(mut document: Document, y: &Scale, frame: &Box4) -> Document {
    for (digit, decade) in y.ticks() {
        let value = digit * 10f64.powi(decade);
        // The lowest line also represents all smaller values, including zero.
        let least = if value <= LEAST_ERROR * 1.001 { "\u{2264} " } else { "" };
        if value >= LEAST_ERROR * 0.999 {
            document = level(document, y.px(value), format!("{least}{}", label(digit, decade)), frame);
        }
    }
    document
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn decades_have_equal_length() {
        let scale = Scale { from: 1e-3, to: 1e1, start_px: 400.0, end_px: 0.0 };
        for (value, px) in [(1e-3, 400.0), (1e-2, 300.0), (1.0, 100.0), (10.0, 0.0)] {
            assert!((scale.px(value) - px).abs() < 1e-9);
        }
        assert_eq!(scale.ticks().len(), 5);
        let shown_by = |from: f64, to: f64| -> Vec<String> {
            let scale = Scale { from, to, start_px: 0.0, end_px: 1.0 };
            scale.ticks().into_iter().map(|(digit, decade)| label(digit, decade)).collect()
        };
        assert_eq!(shown_by(3.0, 60.0), ["5", "10", "20", "50"]);
        assert_eq!(shown_by(12.0, 41.0), ["15", "20", "30", "40"]);
    }

    #[test]
    fn numbers_are_abbreviated() {
        let found = [(1.0, -7), (1.0, -3), (1.5, -2), (1.0, -1), (2.0, 0), (1.5, 0), (5.0, 1), (1.0, 4), (2.0, 6)];
        let found = found.map(|(digit, decade)| label(digit, decade));
        assert_eq!(found, ["1e-7", "0.001", "0.015", "0.1", "2", "1.5", "50", "10000", "2e6"]);
    }
}
