//! The plate with which a window identifies itself: white letters on black at its centre.

use crate::plan::overlay::text::{Line, width_px};

/// Height of the letters as a share of the window's height.
const LETTERS: f64 = 1.0 / 8.0;
/// Maximum width of the plate as a share of the window's width.
const WIDEST: f64 = 0.9;
/// Smallest and largest letters, pixels.
const LETTERS_PX: [f64; 2] = [8.0, 160.0];
/// Line spacing, and margin, as multiples of the letters' height.
const LEADING: f64 = 1.4;
const MARGIN: f64 = 0.5;

/// Text of a plate, and the size of its window.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct PlateText {
    pub(super) lines: Vec<String>,
    pub(super) window: [u32; 2],
}

impl PlateText {
    /// Returns width and height, and R, G, B, A of each pixel as sRGB codes. The plate is at most as large as the window.
    pub(super) fn pixels(&self) -> ([u32; 2], Vec<u8>) {
        let [width, height] = self.window.map(f64::from);
        let widest = |size_px: f64| self.lines.iter().map(|line| width_px(line, size_px)).fold(1.0, f64::max);
        let wanted = (height * LETTERS).clamp(LETTERS_PX[0], LETTERS_PX[1]);
        let room = (width * WIDEST - 2.0 * MARGIN * wanted).max(1.0);
        let size_px = (wanted * (room / widest(wanted)).min(1.0)).max(LETTERS_PX[0]);
        let margin = MARGIN * size_px;
        let of_plate = [widest(size_px) + 2.0 * margin, size_px * LEADING * self.lines.len() as f64 + 2.0 * margin];
        let size = [0, 1].map(|axis| (of_plate[axis].ceil() as u32).clamp(1, self.window[axis].max(1)));
        let mut pixels = [0, 0, 0, 255].repeat(size[0] as usize * size[1] as usize);
        for (number, text) in self.lines.iter().enumerate() {
            let line = Line::new(text, size_px);
            // The pen starts at the line's first pixel on the baseline.
            let baseline = (margin + size_px * (LEADING * number as f64 + 1.0)).round() as i64;
            let left = ((f64::from(size[0]) - width_px(text, size_px)) / 2.0).round() as i64;
            for (x, y, covered) in line.pixels() {
                let (x, y) = (left + i64::from(x), baseline + i64::from(y));
                if (0..i64::from(size[0])).contains(&x) && (0..i64::from(size[1])).contains(&y) {
                    let start = 4 * (y as usize * size[0] as usize + x as usize);
                    for code in &mut pixels[start..start + 3] {
                        *code = (*code).max(covered);
                    }
                }
            }
        }
        (size, pixels)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn plate_contains_its_letters_and_fits_into_its_window() {
        for window in [[1280, 720], [320, 200], [64, 32], [9, 5]] {
            let text = PlateText { lines: vec!["1 dome left".to_owned(), "DP-1".to_owned()], window };
            let ([width, height], pixels) = text.pixels();
            assert!(width <= window[0] && height <= window[1], "{window:?}: {width} x {height}");
            assert_eq!(pixels.len(), 4 * (width * height) as usize);
            let lit = pixels.chunks_exact(4).filter(|pixel| pixel[0] > 128).count();
            // A smaller window has no room for letters.
            assert!(lit > 0 || window[0] < 64, "{window:?}: the plate is empty");
            if window[0] >= 320 {
                // Letters do not touch the border.
                let border = (0..width as usize).any(|x| pixels[4 * x] > 0);
                assert!(!border, "{window:?}");
            }
        }
    }
}
