//! Solid angles of pixels in a map that is linear between its samples.
//!
//! Between the lines of samples, a straight line along a row or column of the raster is a straight line in space. Seen from the eye, it is an arc of
//! a great circle. The part of a pixel in a cell of the grid is therefore a spherical quadrilateral. The sum over the cells is the pixel's solid
//! angle, even if the pixel contains edges of triangles.

use glam::DVec3;

/// Solid angle of the triangle of three unit vectors, sr; negative if they are clockwise as seen from outside of the
/// sphere (van Oosterom and Strackee 1983).
pub(in super::super) fn triangle_sr(a: DVec3, b: DVec3, c: DVec3) -> f64 {
    2.0 * a.dot((b - a).cross(c - a)).atan2(1.0 + a.dot(b) + b.dot(c) + c.dot(a))
}

/// Positions at which to cut the range from `from` to `to`, in sample units: both ends, and the lines of samples between them at which the map has an
/// edge.
pub(super) fn cuts(from: f64, to: f64, samples: usize) -> Vec<f64> {
    // Beyond the first and the last sample, the outermost cells continue.
    let first = (from.floor() + 1.0).max(1.0) as usize;
    let lines = (first..samples.saturating_sub(1)).map(|line| line as f64).take_while(|line| *line < to);
    [from].into_iter().chain(lines).chain([to]).collect()
}

/// Solid angle of a rectangle of the raster, sr. The rectangle is cut at the columns and the rows. `direction` is evaluated at the cuts, and
/// `is_known` in the middle between them. An unknown part is assumed to have the mean density of the rest.
pub(super) fn rectangle_sr(
    columns: &[f64],
    rows: &[f64],
    direction: impl Fn([f64; 2]) -> Option<DVec3>,
    is_known: impl Fn([f64; 2]) -> bool,
) -> f64 {
    let (mut sum_sr, mut known, mut all) = (0.0, 0.0, 0.0);
    for row in rows.windows(2) {
        for column in columns.windows(2) {
            let ([left, right], [top, bottom]) = ([column[0], column[1]], [row[0], row[1]]);
            let area = (right - left) * (bottom - top);
            all += area;
            if !is_known([(left + right) / 2.0, (top + bottom) / 2.0]) {
                continue;
            }
            let corners = [[left, top], [left, bottom], [right, bottom], [right, top]].map(&direction);
            let [Some(a), Some(b), Some(c), Some(d)] = corners else { continue };
            sum_sr += triangle_sr(a, b, c) + triangle_sr(a, c, d);
            known += area;
        }
    }
    if known > 0.0 { sum_sr.abs() * all / known } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::FRAC_PI_2;

    use super::*;

    #[test]
    fn an_octant_has_half_a_pi() {
        assert!((triangle_sr(DVec3::X, DVec3::Y, DVec3::Z) - FRAC_PI_2).abs() < 1e-15);
        assert!((triangle_sr(DVec3::Y, DVec3::X, DVec3::Z) + FRAC_PI_2).abs() < 1e-15);
    }

    #[test]
    fn pixels_are_cut_at_the_samples_that_have_an_edge() {
        assert_eq!(cuts(2.25, 3.25, 9), [2.25, 3.0, 3.25]);
        assert_eq!(cuts(2.0, 4.5, 9), [2.0, 3.0, 4.0, 4.5]);
        // At the first and the last sample there is no edge.
        assert_eq!(cuts(-0.5, 0.5, 9), [-0.5, 0.5]);
        assert_eq!(cuts(7.5, 8.5, 9), [7.5, 8.5]);
        assert_eq!(cuts(-0.5, 1.5, 2), [-0.5, 1.5]);
    }

    #[test]
    fn the_parts_of_a_folded_plane_add_up_and_an_unknown_part_is_replaced() {
        // Both halves of the square are flat, and the second one is narrower.
        let direction = |[x, y]: [f64; 2]| {
            let wide = if x < 1.0 { x } else { 1.0 + 0.5 * (x - 1.0) };
            Some(DVec3::new(0.01 * wide, -0.01 * y, -1.0).normalize())
        };
        let whole = rectangle_sr(&[0.0, 1.0, 2.0], &[0.0, 1.0], direction, |_| true);
        assert!((whole / 1.5e-4 - 1.0).abs() < 2e-4, "{whole}");
        let half = rectangle_sr(&[0.0, 1.0, 2.0], &[0.0, 1.0], direction, |[x, _]| x < 1.0);
        assert!((half / 2e-4 - 1.0).abs() < 2e-4, "{half}");
        assert_eq!(rectangle_sr(&[0.0, 1.0], &[0.0, 1.0], direction, |_| false), 0.0);
    }
}
