//! Distances from directions without an image to the picture. A veil of light from a star outside the picture is
//! computed only if it reaches the picture.

use std::f64::consts::PI;

use super::starts::{Cell, NO_START};

/// Uncertainty of the distance, in cells: each cell is represented by its midpoint.
const SLACK_CELLS: f64 = 2.0;

/// Column and row steps to the nearest cell with a start, and the index of that cell; propagated from neighbour to
/// neighbour.
type Site = Option<(i64, i64, usize)>;

fn squared(site: Site) -> i64 {
    site.map_or(i64::MAX, |(x, y, _)| x * x + y * y)
}

/// Writes into every cell without a start: the node of the nearest cell that has one (third word), and the smallest
/// angle to that cell in rad as the bits of an f32 (fourth word). The grid has `side` x `side` cells, `scale` of them
/// per radian.
pub(super) fn write_distances(cells: &mut [Cell], side: usize, scale: f64) {
    let half_rad = side as f64 / 2.0 / scale;
    for (index, site) in nearest(cells, side).into_iter().enumerate() {
        if cells[index][0] != NO_START {
            continue;
        }
        let Some((x, y, number)) = site else { continue };
        let distance_cells = ((x * x + y * y) as f64).sqrt() - SLACK_CELLS;
        let from_middle = |index: usize| index as f64 + 0.5 - side as f64 / 2.0;
        let from_axis_rad = from_middle(index % side).hypot(from_middle(index / side)) / scale;
        let least_rad = (distance_cells.max(0.0) / scale * least_stretch(from_axis_rad.max(half_rad))) as f32;
        let node = cells[number][0];
        cells[index] = [NO_START, NO_START, node, least_rad.to_bits()];
    }
}

/// Lower bound of the ratio of angle to grid length, up to an angle from the axis: along lines through the axis the
/// ratio is 1, perpendicular to them angles are shorter by sin(angle) / angle.
fn least_stretch(angle_rad: f64) -> f64 {
    // A path between two positions that are farther than a quarter turn from the axis may pass through positions even farther from it.
    let safety = if angle_rad > PI / 2.0 { 0.8 } else { 1.0 };
    (angle_rad.sin() / angle_rad * safety).max(0.0)
}

/// The nearest cell with a start, for every cell: two passes over the grid, each using the neighbours already visited
/// (P.-E. Danielsson, "Euclidean distance mapping", Computer Graphics and Image Processing 14, 227, 1980).
fn nearest(cells: &[Cell], side: usize) -> Vec<Site> {
    let mut sites: Vec<Site> =
        cells.iter().enumerate().map(|(number, cell)| (cell[0] != NO_START).then_some((0, 0, number))).collect();
    let mut look = |x: usize, y: usize, steps: &[[i64; 2]]| {
        let index = y * side + x;
        for [dx, dy] in steps {
            let (other_x, other_y) = (x as i64 + dx, y as i64 + dy);
            if other_x < 0 || other_y < 0 || other_x >= side as i64 || other_y >= side as i64 {
                continue;
            }
            let other = sites[other_y as usize * side + other_x as usize];
            let found = other.map(|(x, y, number)| (x + dx, y + dy, number));
            if squared(found) < squared(sites[index]) {
                sites[index] = found;
            }
        }
    };
    for y in 0..side {
        (0..side).for_each(|x| look(x, y, &[[-1, 0], [-1, -1], [0, -1], [1, -1]]));
        (0..side).rev().for_each(|x| look(x, y, &[[1, 0]]));
    }
    for y in (0..side).rev() {
        (0..side).rev().for_each(|x| look(x, y, &[[1, 0], [1, 1], [0, 1], [-1, 1]]));
        (0..side).for_each(|x| look(x, y, &[[-1, 0]]));
    }
    sites
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_empty_cell_has_the_nearest_filled_cell() {
        let side = 41;
        let mut cells = vec![[NO_START, NO_START, 0, 0]; side * side];
        let filled = [(3, 4), (20, 30), (21, 30), (37, 2), (12, 25)];
        for (x, y) in filled {
            cells[y * side + x] = [(y * side + x) as u32, NO_START, 0, 0];
        }
        let scale = 100.0;
        write_distances(&mut cells, side, scale);
        let half_rad = side as f64 / 2.0 / scale;
        for (index, cell) in cells.iter().enumerate().filter(|(_, cell)| cell[0] == NO_START) {
            let distance =
                |(x, y): (usize, usize)| (x as f64 - (index % side) as f64).hypot(y as f64 - (index / side) as f64);
            let least = filled.into_iter().map(distance).fold(f64::INFINITY, f64::min);
            let middle = side as f64 / 2.0;
            let from_axis_rad =
                ((index % side) as f64 + 0.5 - middle).hypot((index / side) as f64 + 0.5 - middle) / scale;
            let found = f64::from(f32::from_bits(cell[3])) * scale / least_stretch(from_axis_rad.max(half_rad));
            // The result of two passes is exact to a fraction of a cell.
            assert!((found - (least - SLACK_CELLS).max(0.0)).abs() < 0.1, "{index}: {found} {least}");
            let node = cell[2] as usize;
            assert!(distance((node % side, node / side)) < least + 0.1, "{index}");
        }
    }
}
