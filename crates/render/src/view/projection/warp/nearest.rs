//! Finds the lattice point whose direction is nearest to a given one: the start of the Newton steps.

use glam::{DVec2, DVec3};

/// Cells along a side of the map around the middle of the picture.
const SIDE: usize = 128;

/// A map of the sphere around the lattice's mean direction (azimuthal, equal area), with the nearest point for each
/// cell.
#[derive(Clone, Debug, Default)]
pub(super) struct Nearest {
    axis: DVec3,
    right: DVec3,
    up: DVec3,
    /// Radius of the picture on the map; the whole sphere has radius 2.
    radius: f64,
    cells: Vec<DVec2>,
}

impl Nearest {
    /// Builds the map from points and their directions.
    pub(super) fn new(points: &[(DVec2, DVec3)]) -> Self {
        let sum: DVec3 = points.iter().map(|(_, direction)| *direction).sum();
        let axis = sum.try_normalize().unwrap_or(DVec3::NEG_Z);
        let (right, up) = axis.any_orthonormal_pair();
        let mut map = Self { axis, right, up, radius: 0.0, cells: Vec::new() };
        let placed: Vec<(DVec2, DVec2)> =
            points.iter().map(|(pixel, direction)| (map.place(*direction), *pixel)).collect();
        // Directions slightly beyond the picture start at its border.
        map.radius = 1.1 * placed.iter().map(|(place, _)| place.length()).fold(1e-6, f64::max);
        map.cells = map.filled(&placed);
        map
    }

    /// Mean direction.
    pub(super) fn axis(&self) -> DVec3 {
        self.axis
    }

    /// Position on the map: at distance 2 sin(angle / 2) from its middle.
    fn place(&self, direction: DVec3) -> DVec2 {
        // Opposite to the axis, any azimuth is valid.
        let across = DVec2::new(direction.dot(self.right), direction.dot(self.up));
        across.normalize_or(DVec2::X) * direction.distance(self.axis)
    }

    fn cell(&self, place: DVec2) -> Option<[usize; 2]> {
        let scaled = (place / self.radius + 1.0) * (SIDE as f64 / 2.0);
        let inside = |at: f64| (0.0..SIDE as f64).contains(&at).then_some(at as usize);
        Some([inside(scaled.x)?, inside(scaled.y)?])
    }

    /// Each cell gets the point nearest to its middle, by propagating points from cell to cell.
    fn filled(&self, placed: &[(DVec2, DVec2)]) -> Vec<DVec2> {
        let middle = |index: usize| {
            let coordinate = |cell: usize| ((cell as f64 + 0.5) / (SIDE as f64 / 2.0) - 1.0) * self.radius;
            DVec2::new(coordinate(index % SIDE), coordinate(index / SIDE))
        };
        let mut best: Vec<Option<usize>> = vec![None; SIDE * SIDE];
        let offer = |best: &mut Vec<Option<usize>>, cell: usize, point: usize| {
            let distance = |point: usize| placed[point].0.distance_squared(middle(cell));
            let better = best[cell].is_none_or(|held| distance(point) < distance(held));
            if better {
                best[cell] = Some(point);
            }
            better
        };
        let mut changed: Vec<usize> = Vec::new();
        for (point, (place, _)) in placed.iter().enumerate() {
            if let Some([x, y]) = self.cell(*place)
                && offer(&mut best, y * SIDE + x, point)
            {
                changed.push(y * SIDE + x);
            }
        }
        while let Some(cell) = changed.pop() {
            let Some(point) = best[cell] else { continue };
            let [x, y] = [(cell % SIDE) as i64, (cell / SIDE) as i64];
            for [dx, dy] in [[1, 0], [-1, 0], [0, 1], [0, -1]] {
                let [x, y] = [x + dx, y + dy];
                let inside = |at: i64| (0..SIDE as i64).contains(&at);
                let neighbour = (y * SIDE as i64 + x) as usize;
                if inside(x) && inside(y) && offer(&mut best, neighbour, point) {
                    changed.push(neighbour);
                }
            }
        }
        best.into_iter().map(|point| point.map_or(DVec2::ZERO, |point| placed[point].1)).collect()
    }

    /// Starting points for a direction, the best first: that of its cell of the map, then those of the cells around it. There are none if the
    /// direction is far from the picture.
    pub(super) fn start_points(&self, direction: DVec3) -> impl Iterator<Item = DVec2> {
        let held = self.cell(self.place(direction)).map(|at| at.map(|index| index as i64));
        let around = [[0, 0], [1, 0], [-1, 0], [0, 1], [0, -1], [1, 1], [-1, 1], [1, -1], [-1, -1]];
        around.into_iter().filter_map(move |[dx, dy]| {
            let [x, y] = held?;
            let inside = |at: i64| (0..SIDE as i64).contains(&at).then_some(at as usize);
            self.cells.get(inside(y + dy)? * SIDE + inside(x + dx)?).copied()
        })
    }
}
