//! Positions of a raster's pixels on another projector's raster, interpolated in cells.
//!
//! The positions of five by five nodes of a cell are computed exactly. Between them, polynomials of degree four interpolate (Lagrange). This takes a
//! fortieth of the time that exact positions of all pixels take. A cell in which they are not accurate enough, or through which the edge of the other
//! picture passes, has exact positions.

use std::{array, ops::Range};

use glam::DVec2;
use rayon::prelude::*;

use super::Field;
use crate::view::projection::{PlaneMapping, pixel_centre};

/// Side of a cell, pixels.
const CELL_PX: u32 = 32;
/// Steps between nodes along a side of a cell.
const STEPS: usize = 4;
/// Nodes along a side of a cell.
const NODES: usize = STEPS + 1;
/// Largest error of an interpolated position at three places of a cell, pixels.
const CLOSE_PX: f64 = 1e-4;
/// Places of a cell where the interpolation is compared, 0 to 1. They are between nodes, where the error is largest.
const COMPARED: [[f64; 2]; 3] = [[0.125, 0.125], [0.375, 0.875], [0.875, 0.375]];

/// A cell of [`CELL_PX`] by [`CELL_PX`] pixels; those at the right and lower edges of a raster may be smaller.
enum Cell {
    /// The other projector does not reach the cell.
    Apart,
    /// Positions of the nodes, row by row.
    Smooth(Box<[[DVec2; NODES]; NODES]>),
    /// Every position is computed.
    Exact,
}

/// Weights of the nodes at a place along a side of a cell, 0 to 1.
fn weights(place: f64) -> [f64; NODES] {
    let x = STEPS as f64 * place;
    let [a, b, c, d, e] = array::from_fn(|node| x - node as f64);
    [b * c * d * e / 24.0, -a * c * d * e / 6.0, a * b * d * e / 4.0, -a * b * c * e / 6.0, a * b * c * d / 24.0]
}

/// The weighted sum of positions.
fn sum(positions: [DVec2; NODES], weights: &[f64; NODES]) -> DVec2 {
    positions.iter().zip(weights).map(|(position, weight)| *weight * *position).sum()
}

/// Interpolates along the columns of a cell: the result is a row of nodes.
fn row(nodes: &[[DVec2; NODES]; NODES], weights: &[f64; NODES]) -> [DVec2; NODES] {
    array::from_fn(|column| sum(nodes.map(|row| row[column]), weights))
}

/// The cells along one side of a raster.
#[derive(Clone, Copy)]
struct Side(u32);

impl Side {
    fn cells(self) -> usize {
        self.0.div_ceil(CELL_PX) as usize
    }

    fn nodes(self) -> usize {
        STEPS * self.cells() + 1
    }

    /// The pixels of a cell.
    fn pixels(self, cell: usize) -> Range<u32> {
        let first = cell as u32 * CELL_PX;
        first..(first + CELL_PX).min(self.0)
    }

    /// The place of a node, pixels.
    fn place(self, node: usize) -> f64 {
        let cell = (node / STEPS).min(self.cells() - 1);
        let pixels = self.pixels(cell);
        f64::from(pixels.start) + pixels.len() as f64 * (node - STEPS * cell) as f64 / STEPS as f64
    }

    /// The weights of the nodes for the centre of each pixel.
    fn weights(self) -> Vec<[f64; NODES]> {
        let of_cell = |cell| {
            let length = self.pixels(cell).len();
            (0..length).map(move |pixel| weights((pixel as f64 + 0.5) / length as f64))
        };
        (0..self.cells()).flat_map(of_cell).collect()
    }
}

/// Positions of the nodes of a raster on another raster, row by row; `None` where the other projector does not reach.
pub(super) struct Nodes {
    sides: [Side; 2],
    positions: Vec<Option<DVec2>>,
}

impl Nodes {
    pub(super) fn new(own: &Field<'_>, other: &Field<'_>) -> Self {
        let sides = own.beam.mapping.size().map(Side);
        let columns = sides[0].nodes();
        let place = |index: usize| DVec2::new(sides[0].place(index % columns), sides[1].place(index / columns));
        let positions =
            (0..columns * sides[1].nodes()).into_par_iter().map(|index| own.position_on(other, place(index)));
        Self { sides, positions: positions.collect() }
    }

    fn at(&self, column: usize, row: usize) -> Option<DVec2> {
        self.positions[row * self.sides[0].nodes() + column]
    }

    /// For each cell, whether it has a node of the other raster. `back`: the positions of these nodes on this raster.
    fn reached(&self, back: &Self) -> Vec<bool> {
        let [columns, rows] = self.sides.map(Side::cells);
        let mut reached = vec![false; columns * rows];
        for place in back.positions.iter().flatten() {
            let [x, y] = [place.x, place.y].map(|at| (at / f64::from(CELL_PX)).floor());
            if x >= 0.0 && y >= 0.0 && x < columns as f64 && y < rows as f64 {
                reached[y as usize * columns + x as usize] = true;
            }
        }
        reached
    }
}

/// Positions of a raster's pixels on another projector's raster.
pub(super) struct Positions<'a> {
    own: &'a Field<'a>,
    other: &'a Field<'a>,
    sides: [Side; 2],
    /// Row by row.
    cells: Vec<Cell>,
    /// Weights of the nodes for each column and row of pixels.
    weights: [Vec<[f64; NODES]>; 2],
}

impl<'a> Positions<'a> {
    /// `nodes`: positions of the nodes of `own` on `other`; `back`: those of the nodes of `other` on `own`.
    pub(super) fn new(own: &'a Field<'a>, other: &'a Field<'a>, nodes: &Nodes, back: &Nodes) -> Self {
        let sides = nodes.sides;
        let [columns, rows] = sides.map(Side::cells);
        let reached = nodes.reached(back);
        let cell = |index: usize| {
            let cell = [index % columns, index / columns];
            let (x, y) = (STEPS * cell[0], STEPS * cell[1]);
            let held: [[Option<DVec2>; NODES]; NODES] =
                array::from_fn(|row| array::from_fn(|column| nodes.at(x + column, y + row)));
            if held.iter().flatten().all(Option::is_some) {
                let held = Box::new(held.map(|row| row.map(Option::unwrap_or_default)));
                let pixels = [0, 1].map(|axis| sides[axis].pixels(cell[axis]));
                let at = |place: f64, axis: usize| f64::from(pixels[axis].start) + place * pixels[axis].len() as f64;
                let is_close = |[x, y]: [f64; 2]| {
                    let found = sum(row(&held, &weights(y)), &weights(x));
                    let exact = own.position_on(other, DVec2::new(at(x, 0), at(y, 1)));
                    exact.is_some_and(|exact| exact.distance(found) <= CLOSE_PX)
                };
                let is_smooth = COMPARED.into_iter().all(is_close);
                return if is_smooth { Cell::Smooth(held) } else { Cell::Exact };
            }
            // The edge of the other projector's picture may pass through a cell none of whose nodes it reaches. Then it reaches a node at most two steps
            // beside the cell. A picture that is smaller than the distance of the nodes has nodes of its own in the cell.
            let last = sides.map(|side| side.nodes() - 1);
            let mut around = (y.saturating_sub(2)..=(y + STEPS + 2).min(last[1]))
                .flat_map(|row| (x.saturating_sub(2)..=(x + STEPS + 2).min(last[0])).map(move |column| (column, row)));
            let is_near = reached[index] || around.any(|(column, row)| nodes.at(column, row).is_some());
            if is_near { Cell::Exact } else { Cell::Apart }
        };
        let cells = (0..columns * rows).into_par_iter().map(cell).collect();
        Self { own, other, sides, cells, weights: sides.map(Side::weights) }
    }

    /// Calls `found` for each pixel of a row that the other projector reaches, with its column and its position on the other raster.
    pub(super) fn of_row(&self, y: u32, mut found: impl FnMut(u32, DVec2)) {
        let columns = self.sides[0].cells();
        let cells = &self.cells[(y / CELL_PX) as usize * columns..][..columns];
        for (cell, pixels) in cells.iter().zip((0..columns).map(|column| self.sides[0].pixels(column))) {
            match cell {
                Cell::Apart => {}
                Cell::Smooth(nodes) => {
                    let nodes = row(nodes, &self.weights[1][y as usize]);
                    pixels.for_each(|x| found(x, sum(nodes, &self.weights[0][x as usize])));
                }
                Cell::Exact => {
                    let exact = |x| Some((x, self.own.position_on(self.other, pixel_centre(x, y))?));
                    pixels.filter_map(exact).for_each(|(x, position)| found(x, position));
                }
            }
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "tests may panic")]
mod tests {
    use super::{super::tests::beam, *};
    use crate::view::projection::{Fisheye, FisheyeMapping, Perspective};

    #[test]
    fn cells_with_a_kink_are_exact() {
        // Positions on a fisheye beyond its antipode jump to the other side.
        let whole = Fisheye::new([96, 96], FisheyeMapping::Equidistant, 360_f64.to_radians()).unwrap();
        let beams = [beam(Perspective::symmetric([80, 80], 0.9).unwrap(), 180.0, 0.0), beam(whole, 0.0, 0.0)];
        let fields: Vec<Field<'_>> = beams.iter().map(Field::new).collect();
        let [nodes, back] = [(0, 1), (1, 0)].map(|(own, other)| Nodes::new(&fields[own], &fields[other]));
        let positions = Positions::new(&fields[0], &fields[1], &nodes, &back);
        // The antipode is in the middle of the raster, in the second cell of the second row.
        assert!(matches!(positions.cells[4], Cell::Exact));
    }
}
