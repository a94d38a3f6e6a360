//! Areas of silhouettes of closed meshes: the triangles that face the eye are drawn, and pixels are counted.

use glam::DVec3;

/// Area of the silhouette of a closed mesh along a unit direction, square units of the positions. `bound` is the radius of
/// a sphere around all positions; the picture has `side` x `side` pixels.
pub(crate) fn area(positions: &[DVec3], triangles: &[[u32; 3]], bound: f64, direction: DVec3, side: usize) -> f64 {
    let (right, up) = direction.any_orthonormal_pair();
    let scale = side as f64 / (2.0 * bound);
    let flat: Vec<[f64; 2]> = positions.iter().map(|p| [right, up].map(|axis| (p.dot(axis) + bound) * scale)).collect();
    let mut covered = vec![false; side * side];
    for triangle in triangles {
        fill(triangle.map(|vertex| flat[vertex as usize]), side, &mut covered);
    }
    covered.iter().filter(|pixel| **pixel).count() as f64 / (scale * scale)
}

/// Marks the pixels whose centres lie in a counter-clockwise triangle. Clockwise triangles are the far side of a closed
/// body.
fn fill([a, b, c]: [[f64; 2]; 3], side: usize, covered: &mut [bool]) {
    if (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1]) <= 0.0 {
        return;
    }
    let low = a[1].min(b[1]).min(c[1]);
    let high = a[1].max(b[1]).max(c[1]);
    for row in first_centre(low)..first_centre(high).min(side) {
        let y = row as f64 + 0.5;
        let (mut left, mut right) = (f64::INFINITY, f64::NEG_INFINITY);
        for (from, to) in [(a, b), (b, c), (c, a)] {
            if (from[1] <= y) != (to[1] <= y) {
                let x = from[0] + (to[0] - from[0]) * (y - from[1]) / (to[1] - from[1]);
                (left, right) = (left.min(x), right.max(x));
            }
        }
        let columns = first_centre(left)..first_centre(right).min(side);
        if !columns.is_empty() {
            covered[row * side + columns.start..row * side + columns.end].fill(true);
        }
    }
}

/// The first pixel whose centre is not before a position. `f64::ceil` is a call into the C library on processors of the
/// baseline, and this is called for every row.
pub(crate) fn first_centre(position: f64) -> usize {
    let beyond = position - 0.5;
    let below = beyond as usize;
    below.saturating_add(usize::from((below as f64) < beyond))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_centre_is_that_of_the_ceiling() {
        for (position, first) in [(-3.0, 0), (0.0, 0), (0.5, 0), (0.51, 1), (1.5, 1), (1.6, 2), (7.49, 7)] {
            assert_eq!(first_centre(position), first, "{position}");
        }
        assert_eq!(first_centre(f64::INFINITY), usize::MAX);
    }
}
