//! Meshes: nodes on the raster, each with a position in a content and optionally an intensity, joined by triangles.
//!
//! If the nodes are the points of a regular lattice that fills the raster, they are used as the grid directly. Other
//! meshes are rasterised in f64, with linear interpolation within each triangle, as in the programs for which they are
//! made. The grid then has samples at the cell centres.

use glam::DVec2;

use super::{
    Border, Grid, Interpolation, Mask, Placement, Reader,
    content::Content,
    edge::{Placed, placed},
    fault::{Fault, rounded, shown},
};
use crate::view::projector::DISPLAY_GAMMA;

/// Maximum number of nodes of a mesh.
pub(super) const MOST_NODES: usize = 1 << 22;
/// Maximum number of triangles of a mesh.
pub(super) const MOST_TRIANGLES: usize = 1 << 23;
/// Maximum number of tests of a sample against a triangle. Only a mesh that overlaps itself many times exceeds it.
const MOST_TRIALS: usize = 1 << 28;
/// Largest deviation of a node from its lattice position, relative to the raster. Decimal numbers in files are rounded.
const LATTICE_WITHIN: f64 = 1e-5;
/// Maximum number of columns or rows of rasterised meshes.
const MOST_DRAWN: usize = 1024;
/// Maximum width or height of a mask made from intensities.
const MOST_MASK_SIDE: usize = 2048;

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Node {
    /// Position on the raster: from 0 to 1, right and upwards.
    pub place: DVec2,
    /// Position in the content: from 0 to 1, right and upwards.
    pub content: DVec2,
    /// Factor on the display codes; a node with a negative factor is not drawn.
    pub intensity: f64,
}

#[derive(Clone, Debug, Default)]
pub(super) struct Mesh {
    pub nodes: Vec<Node>,
    pub triangles: Vec<[u32; 3]>,
}

/// A mesh or a content on a raster.
pub(super) struct Warped {
    pub grid: Grid,
    /// Where the content ends.
    pub border: Option<Border>,
    /// Factor on the display codes.
    pub intensities: Option<Mask>,
}

/// Returns the grid of a content that fills the raster.
pub(super) fn sampled(content: &Content, [columns, rows]: [usize; 2]) -> Warped {
    let share = |i: usize, count: usize| i as f64 / (count - 1) as f64;
    let nodes = (0..rows).flat_map(|j| (0..columns).map(move |i| (i, j)));
    let places = nodes.map(|(i, j)| Some(DVec2::new(share(i, columns), 1.0 - share(j, rows)))).collect();
    let Placed { samples, border, .. } = placed(content, places, columns, false);
    let grid = Grid { columns, rows, samples, placement: Placement::Corners, interpolation: Interpolation::Smooth };
    Warped { grid, border, intensities: None }
}

impl Mesh {
    /// Adds the triangles of a lattice of nodes, row by row.
    pub fn join_lattice(&mut self, columns: usize, rows: usize) {
        for row in 1..rows {
            for column in 1..columns {
                let low = ((row - 1) * columns + column) as u32;
                let high = low + columns as u32;
                self.triangles.extend([[low - 1, low, high], [low - 1, high, high - 1]]);
            }
        }
    }

    /// Checks the limits that all formats share.
    pub fn check(&self, place: &str) -> Result<(), Fault> {
        if self.nodes.len() > MOST_NODES || self.triangles.len() > MOST_TRIANGLES || self.triangles.is_empty() {
            let problem = format!("{} nodes and {} triangles", self.nodes.len(), self.triangles.len());
            let allowed = format!("must have at most {MOST_NODES} nodes and 1 to {MOST_TRIANGLES} triangles");
            return Err(Fault::new(place, problem, allowed));
        }
        for (index, node) in self.nodes.iter().enumerate() {
            let finite = node.place.is_finite() && node.content.is_finite();
            let bounded = finite && node.intensity.is_finite() && node.intensity <= 1.0;
            if !bounded || node.place.abs().max_element() > 1e6 {
                let [place_at, content] = [node.place, node.content].map(|at| shown(at.to_array()));
                let problem = format!("place {place_at}, content {content}, intensity {}", rounded(node.intensity));
                let allowed = "must be finite numbers, places within 1e6, and intensities at most 1 (nodes with a negative intensity are not drawn)";
                return Err(Fault::new(format!("{place}: node {index} (from 0)"), problem, allowed));
            }
        }
        if let Some(triangle) = self.triangles.iter().find(|t| t.iter().any(|i| *i as usize >= self.nodes.len())) {
            let problem = format!("a triangle of the nodes {triangle:?} (from 0)");
            return Err(Fault::new(place, problem, format!("there are {} nodes", self.nodes.len())));
        }
        Ok(())
    }

    /// Returns the reason why no point of the raster has a direction; `inside` is the number of nodes whose coordinates lie in the content.
    fn without_directions(&self, inside: usize, place: &str) -> Fault {
        if inside > 0 {
            let allowed = "its triangles must cover the raster, and their nodes must be drawn";
            return Fault::new(place, "no point of the raster has a direction", allowed);
        }
        let all = || self.nodes.iter().map(|node| node.content);
        let low = all().fold(DVec2::INFINITY, DVec2::min).to_array();
        let high = all().fold(DVec2::NEG_INFINITY, DVec2::max).to_array();
        let problem = format!(
            "no point of the raster has a direction: the nodes have the coordinates {} to {} of the picture",
            shown(low),
            shown(high)
        );
        let allowed = "u and v must be between 0 and 1 (fractions of the picture, not pixels), and within the circle of a fisheye";
        Fault::new(place, problem, allowed)
    }

    /// Returns the number of columns, the number of rows and the index of the node at each position (from the top), if
    /// the nodes are a regular lattice that fills the raster and the triangles leave no hole.
    fn lattice(&self) -> Option<(usize, usize, Vec<u32>)> {
        let distinct = |axis: usize| {
            let mut values: Vec<f64> = self.nodes.iter().map(|node| node.place[axis]).collect();
            values.sort_unstable_by(f64::total_cmp);
            values.dedup_by(|next, last| *next - *last <= LATTICE_WITHIN);
            values.len()
        };
        let (columns, rows) = (distinct(0), distinct(1));
        if columns < 2 || rows < 2 || columns.checked_mul(rows)? != self.nodes.len() {
            return None;
        }
        let index = |value: f64, count: usize| {
            let position = value * (count - 1) as f64;
            let whole = position.round();
            // Relative to the raster.
            let off = (position - whole).abs() / (count - 1) as f64;
            (off <= LATTICE_WITHIN && (0.0..=(count - 1) as f64).contains(&whole)).then_some(whole as usize)
        };
        let mut order = vec![u32::MAX; self.nodes.len()];
        let mut places = Vec::with_capacity(self.nodes.len());
        for (i, node) in self.nodes.iter().enumerate() {
            let (column, row) = (index(node.place.x, columns)?, rows - 1 - index(node.place.y, rows)?);
            let slot = &mut order[row * columns + column];
            if *slot != u32::MAX {
                return None;
            }
            *slot = i as u32;
            places.push((column, row));
        }
        // There must be two triangles in every cell.
        let mut halves = vec![0_u8; (columns - 1) * (rows - 1)];
        for triangle in &self.triangles {
            let corners = triangle.map(|i| places[i as usize]);
            let range = |coordinate: fn(&(usize, usize)) -> usize| {
                let values = corners.each_ref().map(coordinate);
                let low = values[0].min(values[1]).min(values[2]);
                (low, values[0].max(values[1]).max(values[2]) - low)
            };
            let ((column, wide), (row, high)) = (range(|c| c.0), range(|c| c.1));
            let degenerate = corners[0] == corners[1] || corners[1] == corners[2] || corners[2] == corners[0];
            if degenerate || wide == 0 || high == 0 {
                continue;
            }
            if (wide, high) != (1, 1) {
                return None;
            }
            let half = &mut halves[row * (columns - 1) + column];
            *half = half.saturating_add(1);
        }
        halves.iter().all(|half| *half == 2).then_some((columns, rows, order))
    }

    /// Returns the content and the intensity at the cell centres of the raster, top row first.
    fn drawn(&self, columns: usize, rows: usize, place: &str) -> Result<Vec<Option<[f64; 3]>>, Fault> {
        let mut cells = vec![None; columns * rows];
        let mut trials = 0_usize;
        for triangle in &self.triangles {
            let [a, b, c] = triangle.map(|i| self.nodes[i as usize]);
            if a.intensity < 0.0 || b.intensity < 0.0 || c.intensity < 0.0 {
                continue;
            }
            // Positions in units of cells, downwards; cell centres lie at integers.
            let place_of =
                |node: &Node| DVec2::new(node.place.x * columns as f64 - 0.5, (1.0 - node.place.y) * rows as f64 - 0.5);
            let (pa, pb, pc) = (place_of(&a), place_of(&b), place_of(&c));
            let area = (pb - pa).perp_dot(pc - pa);
            if area.abs() < 1e-12 {
                continue;
            }
            let low = pa.min(pb).min(pc).max(DVec2::ZERO).ceil();
            let high = pa.max(pb).max(pc).min(DVec2::new(columns as f64, rows as f64) - 1.0).floor();
            if low.x > high.x || low.y > high.y {
                continue;
            }
            let [first_column, first_row, last_column, last_row] = [low.x, low.y, high.x, high.y].map(|at| at as usize);
            trials = trials.saturating_add((last_column - first_column + 1) * (last_row - first_row + 1));
            if trials > MOST_TRIALS {
                return Err(Fault::new(place, "its triangles overlap many times", "a mesh must cover the raster once"));
            }
            for row in first_row..=last_row {
                for column in first_column..=last_column {
                    let p = DVec2::new(column as f64, row as f64);
                    let wb = (p - pa).perp_dot(pc - pa) / area;
                    let wc = (pb - pa).perp_dot(p - pa) / area;
                    let wa = 1.0 - wb - wc;
                    // A point on an edge is in both triangles.
                    if wa < -1e-9 || wb < -1e-9 || wc < -1e-9 {
                        continue;
                    }
                    let content = a.content * wa + b.content * wb + c.content * wc;
                    let intensity = a.intensity * wa + b.intensity * wb + c.intensity * wc;
                    cells[row * columns + column] = Some([content.x, content.y, intensity]);
                }
            }
        }
        Ok(cells)
    }
}

impl Reader<'_> {
    /// Returns the grid of a mesh, the border of its content, and the mask of its intensities if there are any.
    pub(super) fn warped(
        &mut self,
        mesh: &Mesh,
        content: &Content,
        size_px: [u32; 2],
        place: &str,
    ) -> Result<Warped, Fault> {
        mesh.check(place)?;
        let [width, height] = size_px.map(|side| side as usize);
        let (grid, found) = if let Some((columns, rows, order)) = mesh.lattice() {
            self.take_grid(columns, rows, place)?;
            self.note(format!(
                "{place}: a regular lattice of {columns} x {rows} nodes from edge to edge of the raster"
            ));
            let node_place = |node: &Node| (node.intensity >= 0.0).then_some(node.content);
            let places = order.iter().map(|i| node_place(&mesh.nodes[*i as usize])).collect();
            let found = placed(content, places, columns, true);
            self.note_edge(place, "nodes", order.len(), &found);
            let (placement, interpolation) = (Placement::Corners, Interpolation::Smooth);
            (Grid { columns, rows, samples: Vec::new(), placement, interpolation }, found)
        } else {
            let shrink = (MOST_DRAWN as f64 / width.max(height) as f64).min(1.0);
            let [columns, rows] = [width, height].map(|side| ((side as f64 * shrink).round() as usize).max(2));
            self.take_grid(columns, rows, place)?;
            self.note(format!(
                "{place}: not a regular lattice: interpolated linearly within each triangle, at {columns} x {rows} cell centres"
            ));
            let cells = mesh.drawn(columns, rows, place)?;
            let places = cells.into_iter().map(|cell| cell.map(|[u, v, _]| DVec2::new(u, v))).collect();
            let found = placed(content, places, columns, false);
            self.note_edge(place, "cell centres", columns * rows, &found);
            let (placement, interpolation) = (Placement::Centres, Interpolation::Linear);
            (Grid { columns, rows, samples: Vec::new(), placement, interpolation }, found)
        };
        if !found.is_reached(grid.columns) {
            let shape = content.shape();
            let inside = mesh.nodes.iter().filter(|node| shape.holds(node.content)).count();
            return Err(mesh.without_directions(inside, place));
        }
        let Placed { samples, border, .. } = found;
        let grid = Grid { samples, ..grid };
        if mesh.nodes.iter().all(|node| node.intensity == 1.0) {
            return Ok(Warped { grid, border, intensities: None });
        }
        let [columns, rows] = [width, height].map(|side| side.min(MOST_MASK_SIDE));
        self.take_mask(columns as u32, rows as u32, place)?;
        self.note(format!(
            "{place}: node intensities are drawn as a mask of {columns} x {rows} pixels; they multiply the display codes; the light \
             is computed with the intensity to the power {DISPLAY_GAMMA}"
        ));
        let cells = mesh.drawn(columns, rows, place)?;
        let light = |cell: Option<[f64; 3]>| {
            cell.map_or(0.0, |[_, _, intensity]| intensity.clamp(0.0, 1.0).powf(DISPLAY_GAMMA))
        };
        let values = cells.into_iter().map(|cell| light(cell) as f32).collect();
        let intensities = Some(Mask { width: columns, height: rows, values, levels: 65535 });
        Ok(Warped { grid, border, intensities })
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failed assumption of a test panics")]
mod tests {
    use super::*;

    fn lattice(columns: usize, rows: usize) -> Mesh {
        let mut mesh = Mesh::default();
        for row in 0..rows {
            for column in 0..columns {
                let place = DVec2::new(column as f64 / (columns - 1) as f64, row as f64 / (rows - 1) as f64);
                mesh.nodes.push(Node { place, content: place * 0.5, intensity: 1.0 });
            }
        }
        mesh.join_lattice(columns, rows);
        mesh
    }

    #[test]
    fn a_lattice_is_recognised_in_any_order_unless_it_has_a_hole_or_a_shift() {
        let mesh = lattice(5, 4);
        let (columns, rows, order) = mesh.lattice().unwrap();
        assert_eq!((columns, rows), (5, 4));
        assert_eq!(mesh.nodes[order[0] as usize].place, DVec2::Y);
        assert_eq!(mesh.nodes[order[19] as usize].place, DVec2::X);
        let mut hole = mesh.clone();
        hole.triangles.pop();
        assert!(hole.lattice().is_none());
        let mut shifted = mesh.clone();
        shifted.nodes[7].place.x += 1e-3;
        assert!(shifted.lattice().is_none());
    }

    #[test]
    fn a_mesh_is_drawn_linearly_and_negative_intensities_leave_holes() {
        let mut mesh = lattice(3, 3);
        let cells = mesh.drawn(8, 6, "mesh").unwrap();
        for (i, cell) in cells.iter().enumerate() {
            let [u, v, intensity] = cell.unwrap();
            let expected = DVec2::new((i % 8) as f64 + 0.5, 5.5 - (i / 8) as f64) / DVec2::new(8.0, 6.0) * 0.5;
            assert!(DVec2::new(u, v).abs_diff_eq(expected, 1e-12), "{i}");
            assert!((intensity - 1.0).abs() < 1e-12);
        }
        // The node in the top right corner.
        mesh.nodes[8].intensity = -1.0;
        let cells = mesh.drawn(8, 6, "mesh").unwrap();
        assert!(cells[7].is_none() && cells[0].is_some() && cells[40].is_some());
    }

    #[test]
    fn overlapping_triangles_are_refused() {
        let mut mesh = lattice(2, 2);
        mesh.triangles = vec![[0, 1, 3]; 2000];
        assert!(mesh.drawn(1024, 1024, "mesh").is_err());
    }
}
