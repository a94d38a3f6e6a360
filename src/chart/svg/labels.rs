//! Places the labels of points: next to the point if there is room, otherwise farther away with a line to it.

/// Height of a label, pixels.
pub const HEIGHT: f64 = 12.0;
/// Mean width of a character at font size 11, pixels; a generous estimate.
const CHARACTER: f64 = 6.6;
/// Clearance around marks, including rings, pixels.
const MARK: f64 = 9.0;

/// Estimates the width of a text at font size 11, pixels.
pub fn width_px(text: &str) -> f64 {
    text.chars().count() as f64 * CHARACTER
}

/// Estimates the width of a bold text at font size 11, pixels.
pub fn bold_width_px(text: &str) -> f64 {
    1.15 * width_px(text)
}

/// A rectangle: left, top, right, bottom.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Box4 {
    /// Left edge.
    pub left: f64,
    /// Upper edge.
    pub top: f64,
    /// Right edge.
    pub right: f64,
    /// Lower edge.
    pub bottom: f64,
}

impl Box4 {
    fn overlaps(&self, other: &Self) -> bool {
        self.left < other.right && other.left < self.right && self.top < other.bottom && other.top < self.bottom
    }

    fn inside(&self, frame: &Self) -> bool {
        self.left >= frame.left && self.right <= frame.right && self.top >= frame.top && self.bottom <= frame.bottom
    }
}

/// A label with its position.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placed {
    /// Area covered by the label.
    pub area: Box4,
    /// Whether the label is away from its point, so that a line must connect them.
    pub far: bool,
}

/// Places the labels of points at (x, y) within `frame`; widths are in pixels. Labels overlap neither each other nor a mark if there is room nearby;
/// otherwise they take the position with the least overlap. They avoid `line`, a sequence of vertical and horizontal segments, if that causes no
/// other overlap.
pub fn place(points: &[([f64; 2], f64)], line: &[[f64; 2]], frame: Box4) -> Vec<Placed> {
    let marks: Vec<Box4> = points
        .iter()
        .map(|([x, y], _)| Box4 { left: x - MARK, top: y - MARK, right: x + MARK, bottom: y + MARK })
        .collect();
    let pieces: Vec<Box4> = line
        .windows(2)
        .map(|ends| Box4 {
            left: ends[0][0].min(ends[1][0]) - 1.0,
            top: ends[0][1].min(ends[1][1]) - 1.0,
            right: ends[0][0].max(ends[1][0]) + 1.0,
            bottom: ends[0][1].max(ends[1][1]) + 1.0,
        })
        .collect();
    let mut order: Vec<usize> = (0..points.len()).collect();
    // Go from top to bottom, so that crowded labels stack in the order of their points.
    order.sort_by(|&a, &b| points[a].0[1].total_cmp(&points[b].0[1]).then(points[a].0[0].total_cmp(&points[b].0[0])));
    let mut placed: Vec<Option<Placed>> = vec![None; points.len()];
    for index in order {
        let ([x, y], width) = points[index];
        let area = |left: f64, middle: f64| Box4 {
            left,
            top: middle - HEIGHT / 2.0,
            right: left + width,
            bottom: middle + HEIGHT / 2.0,
        };
        let mut candidates = vec![
            (area(x + MARK + 2.0, y), false),
            (area(x - MARK - 2.0 - width, y), false),
            (area(x - width / 2.0, y - MARK - HEIGHT / 2.0 - 1.0), false),
            (area(x - width / 2.0, y + MARK + HEIGHT / 2.0 + 1.0), false),
        ];
        for ring in 1..16 {
            let off = f64::from(ring) * (HEIGHT + 1.0);
            for vertical in [-off, off] {
                candidates.push((area(x + MARK + 8.0, y + vertical), true));
                candidates.push((area(x - MARK - 8.0 - width, y + vertical), true));
                candidates.push((area(x - width / 2.0, y + vertical), true));
            }
        }
        let trouble = |area: &Box4| {
            let others = placed.iter().flatten().filter(|other| other.area.overlaps(area)).count();
            let marks = marks.iter().filter(|mark| mark.overlaps(area)).count();
            let crossed = pieces.iter().filter(|piece| piece.overlaps(area)).count();
            1000 * usize::from(!area.inside(&frame)) + 100 * (others + marks) + crossed
        };
        // `min_by_key` returns the first of equal candidates, which is the nearest.
        let best = candidates.iter().min_by_key(|(area, _)| trouble(area));
        placed[index] = best.map(|&(area, far)| Placed { area, far });
    }
    placed.into_iter().flatten().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const FRAME: Box4 = Box4 { left: 0.0, top: 0.0, right: 500.0, bottom: 300.0 };

    #[test]
    fn labels_overlap_neither_each_other_nor_marks() {
        // Eighteen points: nine in one spot, the others in a row at the right border.
        let mut points = vec![([250.0, 150.0], 110.0); 9];
        points.extend((0..9).map(|i| ([495.0, 30.0 + 7.0 * f64::from(i)], 80.0)));
        let placed = place(&points, &[], FRAME);
        assert_eq!(placed.len(), points.len());
        for (index, label) in placed.iter().enumerate() {
            assert!(label.area.inside(&FRAME), "{label:?}");
            for other in &placed[..index] {
                assert!(!label.area.overlaps(&other.area), "{label:?} {other:?}");
            }
            assert!((label.area.right - label.area.left - points[index].1).abs() < 1e-9);
        }
    }

    #[test]
    fn label_avoids_the_line() {
        let line = [[100.0, 0.0], [100.0, 100.0], [500.0, 100.0]];
        let placed = place(&[([100.0, 100.0], 50.0)], &line, FRAME);
        assert!(placed[0].area.right < 99.0 || placed[0].area.top > 101.0, "{placed:?}");
    }

    #[test]
    fn single_label_is_next_to_its_point() {
        let placed = place(&[([100.0, 100.0], 50.0)], &[], FRAME);
        assert!(!placed[0].far && placed[0].area.left <= 100.0 + MARK + 2.0);
        // At the right border the label moves to the other side.
        let placed = place(&[([490.0, 100.0], 50.0)], &[], FRAME);
        assert!(!placed[0].far && placed[0].area.right < 490.0);
    }
}
