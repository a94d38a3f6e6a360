//! Computed edge blends, for calibrations without blend masks. Each projector's share falls smoothly to zero at the
//! borders of its raster, and the shares of all projectors that reach a direction sum to one.
//!
//! With the weight w of a position on a projector's own raster, alpha = w / (sum of w over all projectors that reach the direction). w = (16 x (1 -
//! x) y (1 - y))^2 with x and y relative to the raster's sides, so the share and its slope vanish at the borders. If a part of the raster is not
//! used, w falls to zero at its border in the same way.

use std::{array, f64::consts::PI, sync::Arc};

use glam::{DQuat, DVec2, DVec3};
use rayon::prelude::*;

use super::blend::{Blend, between};
use crate::view::projection::{PlaneMapping, TabulatedMapping, pixel_centre};

/// Width of the ramp towards an unused part of the raster, pixels.
const RAMP_PX: f32 = 64.0;
/// Side of a cell, pixels: in it the positions on other rasters are interpolated.
const CELL_PX: u32 = 16;
/// Largest error of an interpolated position at two places of a cell, pixels.
const CLOSE_PX: f64 = 1e-3;

/// One of several projectors.
#[derive(Clone, Debug, PartialEq)]
pub struct Beam {
    /// Directions of its pixels, in view axes.
    pub mapping: Arc<TabulatedMapping>,
    /// View axes to those of the dome.
    pub dome_from_view: DQuat,
    /// Its black level relative to its white. Black is raised to the level of the region that the most projectors light. 0: black is not raised.
    pub black: f64,
}

/// Weights of a projector's raster.
struct Field<'a> {
    beam: &'a Beam,
    /// Axis in dome axes, and cosine of the angle around it beyond which the projector does not reach.
    axis: DVec3,
    least_cos: f64,
    /// Distance to the nearest unused pixel, at most [`RAMP_PX`], pixels; `None` if all are used.
    unused_px: Option<Vec<f32>>,
}

impl<'a> Field<'a> {
    fn new(beam: &'a Beam) -> Self {
        let cone = beam.mapping.bounding_cone(1.0);
        let least_cos = if cone.half_angle_rad < PI { cone.half_angle_rad.cos() } else { -1.0 };
        Self { beam, axis: beam.dome_from_view * cone.axis, least_cos, unused_px: unused_px(&beam.mapping) }
    }

    /// The weight at a position of the raster, pixels.
    fn weight(&self, pixel: DVec2) -> f64 {
        let [width, height] = self.beam.mapping.size();
        let (x, y) = (pixel.x / f64::from(width), pixel.y / f64::from(height));
        let edges = 16.0 * x * (1.0 - x) * y * (1.0 - y);
        let unused = self.unused_px.as_ref().map_or(1.0, |distances| {
            let size = [width as usize, height as usize];
            let distance = |x: usize, y: usize| f64::from(distances[y * size[0] + x]);
            between(size, pixel.to_array(), distance) / f64::from(RAMP_PX)
        });
        (edges * unused).powi(2)
    }

    /// The position on the raster of a direction of the dome, pixels; it may be outside of the raster. `None` if the projector does not reach it.
    fn position(&self, direction: DVec3) -> Option<DVec2> {
        if direction.dot(self.axis) < self.least_cos {
            return None;
        }
        self.beam.mapping.pixel_from_direction(self.beam.dome_from_view.inverse() * direction)
    }

    /// The weight at a position; `None` if the projector has no pixel there.
    fn weight_inside(&self, pixel: DVec2) -> Option<f64> {
        let mapping = &self.beam.mapping;
        let [width, height] = mapping.size();
        let inside = pixel.x >= 0.0 && pixel.y >= 0.0 && pixel.x < f64::from(width) && pixel.y < f64::from(height);
        // Without unused pixels no look into the table is needed, which takes longer than the weight.
        let is_used = || self.unused_px.is_none() || mapping.contains(pixel.x as u32, pixel.y as u32);
        (inside && is_used()).then(|| self.weight(pixel))
    }

    /// The position on another raster of the direction of a pixel coordinate; see [`Self::position`].
    fn position_on(&self, other: &Self, pixel: DVec2) -> Option<DVec2> {
        other.position(self.direction(pixel)?)
    }

    /// The direction of a position on the raster, dome axes.
    fn direction(&self, pixel: DVec2) -> Option<DVec3> {
        Some(self.beam.dome_from_view * self.beam.mapping.direction_from_pixel(pixel)?)
    }
}

/// Positions on another projector's raster in a cell of [`CELL_PX`] by [`CELL_PX`] pixels of a raster.
enum Cell {
    /// The other projector does not reach the cell.
    Apart,
    /// Positions are interpolated between three by three nodes, row by row.
    Smooth([DVec2; 9]),
    /// Every position is computed.
    Exact,
}

/// Cells of a raster, row by row, with the positions on another projector's raster. Computing each pixel would take thirty times as long.
struct Cells {
    size: [u32; 2],
    columns: usize,
    cells: Vec<Cell>,
}

/// Weights of three nodes of a parabola at 0, 1/2 and 1.
fn parabola(t: f64) -> [f64; 3] {
    [(1.0 - t) * (1.0 - 2.0 * t), 4.0 * t * (1.0 - t), t * (2.0 * t - 1.0)]
}

/// Value at a place of a cell, 0 to 1, between three by three nodes.
fn between_nodes(nodes: &[DVec2; 9], place: DVec2) -> DVec2 {
    let [columns, rows] = [parabola(place.x), parabola(place.y)];
    let row = |r: usize| columns[0] * nodes[3 * r] + columns[1] * nodes[3 * r + 1] + columns[2] * nodes[3 * r + 2];
    rows[0] * row(0) + rows[1] * row(1) + rows[2] * row(2)
}

/// Positions on another projector's raster at the corners and middles of the cells of a raster, row by row.
struct Nodes {
    size: [u32; 2],
    /// Number of columns and rows of cells.
    cells: [usize; 2],
    positions: Vec<Option<DVec2>>,
}

impl Nodes {
    fn new(own: &Field<'_>, other: &Field<'_>) -> Self {
        let size = own.beam.mapping.size();
        let cells = size.map(|side| side.div_ceil(CELL_PX) as usize);
        let columns = 2 * cells[0] + 1;
        let mut nodes = Self { size, cells, positions: Vec::new() };
        nodes.positions = (0..columns * (2 * cells[1] + 1))
            .into_par_iter()
            .map(|index| own.position_on(other, nodes.place(index % columns, index / columns)))
            .collect();
        nodes
    }

    /// The place of a node on the raster, pixels. The last cell of a row or column may be smaller; its middle node is in its middle.
    fn place(&self, column: usize, row: usize) -> DVec2 {
        let along = |node: usize, side: u32| {
            let edge = |cell: usize| (cell as u32 * CELL_PX).min(side);
            0.5 * f64::from(edge(node / 2) + edge(node.div_ceil(2)))
        };
        DVec2::new(along(column, self.size[0]), along(row, self.size[1]))
    }

    fn at(&self, column: usize, row: usize) -> Option<DVec2> {
        self.positions[row * (2 * self.cells[0] + 1) + column]
    }

    /// For each cell, whether it has a node of the other raster. `back`: the positions of these nodes on this raster.
    fn reached(&self, back: &Self) -> Vec<bool> {
        let [columns, rows] = self.cells;
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

impl Cells {
    /// `nodes`: positions of the nodes of `own` on `other`; `back`: those of the nodes of `other` on `own`.
    fn new(own: &Field<'_>, other: &Field<'_>, nodes: &Nodes, back: &Nodes) -> Self {
        let [columns, rows] = nodes.cells;
        let reached = nodes.reached(back);
        let cell = |index: usize| {
            let (x, y) = (2 * (index % columns), 2 * (index / columns));
            let held: [Option<DVec2>; 9] = array::from_fn(|node| nodes.at(x + node % 3, y + node / 3));
            if held.iter().all(Option::is_some) {
                let held = held.map(Option::unwrap_or_default);
                let [corner, end] = [0, 2].map(|node| nodes.place(x + node, y + node));
                let is_close = |&place: &DVec2| {
                    own.position_on(other, corner + place * (end - corner))
                        .is_some_and(|exact| exact.distance(between_nodes(&held, place)) <= CLOSE_PX)
                };
                let is_smooth = [DVec2::splat(0.25), DVec2::splat(0.75)].iter().all(is_close);
                return if is_smooth { Cell::Smooth(held) } else { Cell::Exact };
            }
            // The edge of the other projector's picture may pass through a cell next to one that it reaches. A picture that is smaller than the
            // distance of the nodes has nodes in the cell.
            let mut around = (y.saturating_sub(2)..(y + 5).min(2 * rows + 1))
                .flat_map(|row| (x.saturating_sub(2)..(x + 5).min(2 * columns + 1)).map(move |column| (column, row)));
            let is_near = reached[index] || around.any(|(column, row)| nodes.at(column, row).is_some());
            if is_near { Cell::Exact } else { Cell::Apart }
        };
        Self { size: nodes.size, columns, cells: (0..columns * rows).into_par_iter().map(cell).collect() }
    }

    /// Returns the cell of a pixel, and the place of the pixel's centre in it, 0 to 1.
    fn of_pixel(&self, x: u32, y: u32) -> (&Cell, DVec2) {
        let cell = &self.cells[(y / CELL_PX) as usize * self.columns + (x / CELL_PX) as usize];
        let place = |pixel: u32, size: u32| {
            let first = pixel - pixel % CELL_PX;
            (f64::from(pixel - first) + 0.5) / f64::from(CELL_PX.min(size - first))
        };
        (cell, DVec2::new(place(x, self.size[0]), place(y, self.size[1])))
    }
}

/// The blends of projectors that light a dome together, in the same order.
pub fn edge_blends(beams: &[Beam]) -> Vec<Blend> {
    let fields: Vec<Field<'_>> = beams.iter().map(Field::new).collect();
    let nodes_of = |own: usize| {
        let nodes = |other: usize| (other != own).then(|| Nodes::new(&fields[own], &fields[other]));
        (0..fields.len()).map(nodes).collect()
    };
    let nodes: Vec<Vec<Option<Nodes>>> = (0..fields.len()).map(nodes_of).collect();
    // For each pixel: its share, and the number of projectors that reach it.
    let shares = fields.iter().enumerate().map(|(own, field)| {
        let others = fields.iter().enumerate().filter_map(|(index, other)| {
            let (nodes, back) = (nodes[own][index].as_ref()?, nodes[index][own].as_ref()?);
            Some((other, Cells::new(field, other, nodes, back)))
        });
        let others: Vec<_> = others.collect();
        let mapping = &field.beam.mapping;
        let [width, height] = mapping.size();
        let share = |index: usize| {
            let (x, y) = (index as u32 % width, index as u32 / width);
            if !mapping.contains(x, y) {
                return (0.0, 0);
            }
            let pixel = pixel_centre(x, y);
            let weight = field.weight(pixel);
            let (mut sum, mut count) = (weight, 1);
            for (other, cells) in &others {
                let position = match cells.of_pixel(x, y) {
                    (Cell::Apart, _) => None,
                    (Cell::Smooth(nodes), place) => Some(between_nodes(nodes, place)),
                    (Cell::Exact, _) => field.position_on(other, pixel),
                };
                if let Some(other_weight) = position.and_then(|position| other.weight_inside(position)) {
                    sum += other_weight;
                    count += 1;
                }
            }
            (if sum > 0.0 { weight / sum } else { 1.0 / f64::from(count) }, count)
        };
        let pixels = width as usize * height as usize;
        (0..pixels).into_par_iter().map(share).collect::<Vec<(f64, i32)>>()
    });
    let shares: Vec<_> = shares.collect();
    let most = shares.iter().flatten().map(|(_, count)| *count).max().unwrap_or(1);
    let blends = shares.iter().zip(beams).map(|(shares, beam)| {
        let weights = shares.iter().map(|(share, count)| {
            let lift = if *count == 0 { 0.0 } else { beam.black * f64::from(most - count) / f64::from(*count) };
            [*share as f32, lift.min(1.0) as f32]
        });
        Blend::from_weights(beam.mapping.size(), weights.collect())
    });
    blends.collect()
}

/// Distances to the nearest unused pixel, at most [`RAMP_PX`]: two passes with steps to the eight neighbours (Rosenfeld
/// and Pfaltz 1968), which overestimates lengths by at most 8 %.
fn unused_px(mapping: &TabulatedMapping) -> Option<Vec<f32>> {
    let [width, height] = mapping.size().map(|side| side as usize);
    if mapping.pixels() == width as u64 * height as u64 {
        return None;
    }
    let used = |index: usize| mapping.contains((index % width) as u32, (index / width) as u32);
    let mut distances: Vec<f32> = (0..width * height).map(|index| if used(index) { RAMP_PX } else { 0.0 }).collect();
    let before = [[-1_i64, 0], [-1, -1], [0, -1], [1, -1]];
    let mut pass = |indices: &mut dyn Iterator<Item = usize>, sign: i64| {
        for index in indices {
            let (x, y) = ((index % width) as i64, (index / width) as i64);
            for [i, j] in before.map(|step| step.map(|by| sign * by)) {
                let (x, y) = (x + i, y + j);
                if (0..width as i64).contains(&x) && (0..height as i64).contains(&y) {
                    let step = if i != 0 && j != 0 { std::f32::consts::SQRT_2 } else { 1.0 };
                    distances[index] = distances[index].min(distances[y as usize * width + x as usize] + step);
                }
            }
        }
    };
    pass(&mut (0..width * height), 1);
    pass(&mut (0..width * height).rev(), -1);
    Some(distances)
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "tests may panic")]
mod tests {
    use super::*;
    use crate::view::projection::{Fisheye, FisheyeMapping, Perspective};

    fn beam(mapping: impl PlaneMapping + Send + 'static, azimuth_deg: f64, altitude_deg: f64) -> Beam {
        let turn = DQuat::from_rotation_y(azimuth_deg.to_radians()) * DQuat::from_rotation_x(altitude_deg.to_radians());
        Beam { mapping: Arc::new(TabulatedMapping::new(mapping).unwrap()), dome_from_view: turn, black: 0.01 }
    }

    /// Returns the shares of a projector, and the number of projectors that reach each pixel, from the position of every pixel on the other rasters.
    fn exact(fields: &[Field<'_>], own: usize) -> Vec<(f64, f64)> {
        let field = &fields[own];
        let [width, height] = field.beam.mapping.size();
        let share = |index: u32| {
            let pixel = pixel_centre(index % width, index / width);
            let Some(direction) = field.direction(pixel) else { return (0.0, 0.0) };
            let weight = field.weight(pixel);
            let others = fields.iter().enumerate().filter(|(other, _)| *other != own);
            let of_others: Vec<f64> =
                others.filter_map(|(_, other)| other.weight_inside(other.position(direction)?)).collect();
            let sum = weight + of_others.iter().sum::<f64>();
            (if sum > 0.0 { weight / sum } else { 1.0 }, 1.0 + of_others.len() as f64)
        };
        (0..width * height).map(share).collect()
    }

    #[test]
    fn shares_are_those_of_exact_positions_within_2e_4() {
        let window = |size| Perspective::symmetric(size, 0.9).unwrap();
        let round = Fisheye::new([173, 173], FisheyeMapping::Equidistant, 1.6).unwrap();
        // Sizes that are not multiples of a cell, a small picture within a cell of the first one, and one that meets no other.
        let small = Perspective::symmetric([40, 40], 0.02).unwrap();
        let beams = [
            beam(window([317, 205]), 0.0, 10.0),
            beam(window([317, 205]), 50.0, 15.0),
            beam(round, 40.0, -20.0),
            beam(small, -7.0, 11.0),
            beam(window([64, 64]), 170.0, 0.0),
        ];
        let fields: Vec<Field<'_>> = beams.iter().map(Field::new).collect();
        let blends = edge_blends(&beams);
        let exact: Vec<_> = (0..beams.len()).map(|own| exact(&fields, own)).collect();
        let most = exact.iter().flatten().map(|(_, count)| *count).fold(1.0, f64::max);
        let mut largest = [0.0_f64; 2];
        for (blend, exact) in blends.iter().zip(&exact) {
            for (weights, (share, count)) in blend.weights().iter().zip(exact) {
                let black = if *count > 0.0 { 0.01 * (most - count) / count } else { 0.0 };
                for (largest, (found, exact)) in largest.iter_mut().zip(weights.iter().zip([*share, black])) {
                    *largest = largest.max((f64::from(*found) - exact).abs());
                }
            }
        }
        println!("largest difference of a share {:.1e}, of a black level {:.1e}", largest[0], largest[1]);
        assert!(largest[0] < 2e-4 && largest[1] < 1e-6);
        // Some pixels of each of the first four are shared, and the last one has all of its light.
        let shared =
            |own: usize| blends[own].weights().iter().filter(|weights| weights[0] > 0.1 && weights[0] < 0.9).count();
        assert!((0..4).all(|own| shared(own) > 3), "{:?}", [0, 1, 2, 3].map(shared));
        assert!(blends[4].weights().iter().all(|weights| weights[0] == 1.0));
    }

    #[test]
    fn cells_with_a_kink_are_exact() {
        // Positions on a fisheye beyond its antipode jump to the other side.
        let whole = Fisheye::new([96, 96], FisheyeMapping::Equidistant, 360_f64.to_radians()).unwrap();
        let beams = [beam(Perspective::symmetric([80, 80], 0.9).unwrap(), 180.0, 0.0), beam(whole, 0.0, 0.0)];
        let fields: Vec<Field<'_>> = beams.iter().map(Field::new).collect();
        let [nodes, back] = [(0, 1), (1, 0)].map(|(own, other)| Nodes::new(&fields[own], &fields[other]));
        let cells = Cells::new(&fields[0], &fields[1], &nodes, &back);
        assert!(matches!(cells.of_pixel(40, 40).0, Cell::Exact));
    }
}
