//! Starting points of the inverse search: an azimuthal equidistant grid, around an axis, that covers the part of the sky that the picture shows. Each
//! cell has a node of the table near the image of its directions.
//!
//! A map of the sphere has cuts, where neighbouring directions have images far apart. A cell with a cut has two starts
//! and the line between them, fitted to the positions where the mapping jumps, which are found by bisection.

use std::f64::consts::PI;

use glam::{DVec2, DVec3};

use super::{
    super::PlaneMapping,
    nodes::{Nodes, place_of_pixel},
    patches::PATCH_BIT,
};

/// Marks a missing node.
pub const NO_START: u32 = u32::MAX;
/// Approximate side of a cell, pixels.
const CELL_PX: f64 = 2.5;
/// Maximum number of cells along a side of the grid.
const MOST_SIDE: f64 = 2047.0;
/// Jumps are searched if the images of a cell deviate from even spacing by more than this: a fraction of their distance, plus a number of pixels.
const UNEVEN: [f64; 2] = [0.1, 0.05];
/// Number of points along a side of a cell at which a cut is searched.
const CUT_POINTS: usize = 9;
/// Number of bisection steps between two of them.
const HALVINGS: usize = 28;
/// A distance that remains larger than this after all bisections is a jump, pixels.
const JUMP_PX: f64 = 0.05;

/// A cell, four words. The first two are the start nodes on both sides of a cut (column in the lower half of the word, row in the upper half). The
/// third is the unit normal of the cut as two signed 16-bit fractions. The fourth is the signed distance of the cut from the middle of the cell along
/// the normal, in cells, as the bits of an f32. Without a cut the second node is [`NO_START`]. A word with [`PATCH_BIT`] refers to a patch instead of
/// a node. If both nodes are [`NO_START`], the other words contain the distance to the picture: see [`super::outside`].
pub(super) type Cell = [u32; 4];

const EMPTY: Cell = [NO_START, NO_START, 0, 0];

/// Grid of starts.
pub(super) struct Starts {
    /// Cells along a side.
    pub(super) side: u32,
    /// Unit vectors: the axis of the grid, and the directions of its columns and rows.
    pub(super) axis: DVec3,
    pub(super) right: DVec3,
    pub(super) up: DVec3,
    /// Cells per radian.
    pub(super) scale: f64,
    pub(super) cells: Vec<Cell>,
    /// Samples of the cells that have patches instead of nodes: see [`super::patches`].
    pub(super) patches: Vec<[f32; 2]>,
}

/// Start of the search for a direction.
pub(super) enum Beginning {
    /// Start in the middle of the four nodes around this one.
    Node([u32; 2]),
    /// The image is in the patch at this group of words, at this position in the cell.
    Patch(u32, DVec2),
}

/// Signed distance between a position in a cell, from (-0.5, -0.5) to (0.5, 0.5), and the cut of the cell. The first start is used for positive
/// distances.
pub(super) fn side_of_cut([.., normal, offset]: Cell, local: DVec2) -> f64 {
    let fraction = |word: u32| f64::from(word as u16 as i16) / 32767.0;
    DVec2::new(fraction(normal), fraction(normal >> 16)).dot(local) - f64::from(f32::from_bits(offset))
}

/// Three pieces of the picture meet at the direction of this pixel.
pub(super) struct Junction(pub(super) [u32; 2]);

/// A tested direction within a cell.
#[derive(Clone, Copy)]
struct Sample {
    /// Position in the cell, from -0.5 to 0.5.
    local: DVec2,
    /// Its image.
    pixel: Option<DVec2>,
    /// Whether the search can start there.
    held: bool,
}

/// Coordinate in a cell of one of `count` samples along its side.
fn coordinate(index: usize, count: usize) -> f64 {
    index as f64 / (count - 1) as f64 - 0.5
}

fn packed(pixel: DVec2) -> u32 {
    let node = place_of_pixel(pixel).floor();
    (node.x as u32) | ((node.y as u32) << 16)
}

impl Starts {
    /// A grid around `axis` that reaches to `half_angle_rad`, for a picture of `pixels` pixels. All cells are still
    /// empty.
    fn new(axis: DVec3, half_angle_rad: f64, pixels: u64) -> Self {
        let wanted = ((pixels as f64).sqrt() / CELL_PX).clamp(9.0, MOST_SIDE) as u32;
        // Use an odd number, so that no border between cells passes through the axis, where cuts are likely.
        let side = wanted | 1;
        let (right, up) = if axis == DVec3::NEG_Z { (DVec3::X, DVec3::Y) } else { axis.any_orthonormal_pair() };
        let scale = f64::from(side) / 2.0 / (half_angle_rad.min(PI) * 1.001);
        Self { side, axis, right, up, scale, cells: Vec::new(), patches: Vec::new() }
    }

    /// Position of a direction (unit vector) in the grid, cells.
    pub(super) fn place(&self, direction: DVec3) -> DVec2 {
        let across = DVec2::new(direction.dot(self.right), direction.dot(self.up));
        let sine = across.length();
        let azimuth = if sine > 1e-20 { across / sine } else { DVec2::X };
        azimuth * (sine.atan2(direction.dot(self.axis)) * self.scale) + f64::from(self.side) / 2.0
    }

    /// The direction at a position; `None` beyond the antipode.
    pub(super) fn direction(&self, place: DVec2) -> Option<DVec3> {
        let from_middle = (place - f64::from(self.side) / 2.0) / self.scale;
        let angle = from_middle.length();
        if angle > PI {
            return None;
        }
        let azimuth = if angle > 0.0 { from_middle / angle } else { DVec2::X };
        let (sin, cos) = angle.sin_cos();
        Some(self.axis * cos + (self.right * azimuth.x + self.up * azimuth.y) * sin)
    }

    /// Start of the search for a direction; `None` if it has no image.
    pub(super) fn start(&self, direction: DVec3) -> Option<Beginning> {
        let place = self.place(direction);
        let side = f64::from(self.side);
        if !(0.0..side).contains(&place.x) || !(0.0..side).contains(&place.y) {
            return None;
        }
        let held = place.floor();
        let cell = self.cells[held.y as usize * self.side as usize + held.x as usize];
        let [first, second, ..] = cell;
        let beyond = side_of_cut(cell, place - held - 0.5) <= 0.0;
        match if second != NO_START && beyond { second } else { first } {
            NO_START => None,
            patch if patch & PATCH_BIT != 0 => Some(Beginning::Patch(patch & !PATCH_BIT, place - held)),
            node => Some(Beginning::Node([node & 0xffff, node >> 16])),
        }
    }

    /// Whether the mapping has a cut.
    pub(super) fn has_cut(&self) -> bool {
        self.cells.iter().any(|[_, second, ..]| *second != NO_START)
    }
}

/// Fills a grid with the mapping's own inverse.
struct Filler<'a> {
    starts: Starts,
    source: &'a dyn PlaneMapping,
    nodes: &'a Nodes,
}

/// Builds the grid of a mapping.
pub(super) fn starts(
    source: &(dyn PlaneMapping + Send),
    nodes: &Nodes,
    (axis, half_angle_rad): (DVec3, f64),
    pixels: u64,
) -> Result<Starts, Junction> {
    let mut filler = Filler { starts: Starts::new(axis, half_angle_rad, pixels), source, nodes };
    let side = filler.starts.side;
    let rows = super::rows::by_rows(side, |y| {
        let mut left = None;
        (0..side).map(|x| filler.cell(x, y, &mut left)).collect::<Result<Vec<_>, _>>()
    });
    let mut cells = Vec::with_capacity((side * side) as usize);
    for row in rows {
        cells.extend(row?);
    }
    filler.starts.cells = spread(cells, side as usize);
    super::outside::write_distances(&mut filler.starts.cells, side as usize, filler.starts.scale);
    Ok(filler.starts)
}

/// Copies a neighbour's start into cells without one: the picture may reach into them between the tested points.
fn spread(mut cells: Vec<Cell>, side: usize) -> Vec<Cell> {
    for _ in 0..2 {
        let before = &cells.clone();
        for (index, cell) in cells.iter_mut().enumerate().filter(|(_, cell)| cell[0] == NO_START) {
            let (x, y) = (index % side, index / side);
            let near = |coordinate: usize| coordinate.saturating_sub(1)..(coordinate + 2).min(side);
            let neighbours = near(y).flat_map(|y| near(x).map(move |x| before[y * side + x]));
            if let Some(found) = neighbours.into_iter().find(|other| other[0] != NO_START) {
                *cell = [found[0], NO_START, 0, 0];
            }
        }
    }
    cells
}

impl Filler<'_> {
    fn sample(&self, cell: DVec2, local: DVec2) -> Sample {
        let direction = self.starts.direction(cell + 0.5 + local);
        let pixel = direction.and_then(|direction| self.source.pixel_from_direction(direction));
        let held = pixel.is_some_and(|pixel| self.nodes.quad(place_of_pixel(pixel)).is_some());
        Sample { local, pixel, held }
    }

    /// Samples of a cell, `count` along each side, including its corners.
    fn samples(&self, cell: DVec2, count: usize) -> Vec<Sample> {
        let at = |index: usize| coordinate(index, count);
        let places = (0..count).flat_map(|j| (0..count).map(move |i| DVec2::new(at(i), at(j))));
        places.map(|local| self.sample(cell, local)).collect()
    }

    /// The 3 x 3 samples of a cell. `left`: the samples of the right side of the cell on its left, which are then replaced by those of this one.
    fn coarse(&self, cell: DVec2, left: &mut Option<[Sample; 3]>) -> [Sample; 9] {
        let samples = std::array::from_fn(|index| {
            let (column, row) = (index % 3, index / 3);
            let local = DVec2::new(coordinate(column, 3), coordinate(row, 3));
            match left {
                Some(left) if column == 0 => Sample { local, ..left[row] },
                _ => self.sample(cell, local),
            }
        });
        *left = Some([samples[2], samples[5], samples[8]]);
        samples
    }

    /// `left`: see [`Self::coarse`].
    fn cell(&self, x: u32, y: u32, left: &mut Option<[Sample; 3]>) -> Result<Cell, Junction> {
        let cell = DVec2::new(f64::from(x), f64::from(y));
        // For cells that are evenly mapped or have no image, a few samples are sufficient.
        let coarse = self.coarse(cell, left);
        if coarse.iter().any(|sample| sample.held) && is_even(&coarse) {
            return Ok(nearest_to(&coarse, DVec2::ZERO));
        }
        if coarse.iter().all(|sample| sample.pixel.is_none()) {
            return Ok(EMPTY);
        }
        if !coarse.iter().any(|sample| sample.held) && is_even(&coarse) {
            return Ok(EMPTY);
        }
        // Otherwise search for jumps between neighbouring samples.
        let fine = self.samples(cell, CUT_POINTS);
        if !fine.iter().any(|sample| sample.held) {
            return Ok(EMPTY);
        }
        let pairs = (0..CUT_POINTS * CUT_POINTS).flat_map(|index| {
            let right = (index % CUT_POINTS + 1 < CUT_POINTS).then_some(index + 1);
            let below = (index / CUT_POINTS + 1 < CUT_POINTS).then_some(index + CUT_POINTS);
            [right, below].into_iter().flatten().map(move |other| (index, other))
        });
        // Collect the jumps, and join samples without a jump between them into pieces.
        let mut jumps = Vec::new();
        let mut pieces: Vec<usize> = (0..fine.len()).collect();
        for (a, b) in pairs {
            match self.jump(cell, fine[a], fine[b]) {
                Some(place) => jumps.push((place, fine[b].local - fine[a].local)),
                None if fine[a].held && fine[b].held => join(&mut pieces, a, b),
                None => {}
            }
        }
        // One cut can separate only two pieces.
        let mut found: Vec<usize> = (0..fine.len()).filter(|i| fine[*i].held).map(|i| root(&pieces, i)).collect();
        found.sort_unstable();
        found.dedup();
        if jumps.is_empty() {
            return Ok(nearest_to(&fine, DVec2::ZERO));
        }
        if found.len() > 2 {
            let held = fine.iter().find(|sample| sample.held).and_then(|sample| sample.pixel).unwrap_or_default();
            return Err(Junction([held.x.max(0.0) as u32, held.y.max(0.0) as u32]));
        }
        Ok(divided(&fine, &jumps))
    }

    /// Position between two neighbouring samples where the mapping jumps, if it does.
    fn jump(&self, cell: DVec2, a: Sample, b: Sample) -> Option<DVec2> {
        let (mut a, mut b) = (a, b);
        if a.pixel?.distance(b.pixel?) < JUMP_PX {
            return None;
        }
        for _ in 0..HALVINGS {
            let middle = self.sample(cell, (a.local + b.local) / 2.0);
            let pixel = middle.pixel?;
            if pixel.distance(a.pixel?) < pixel.distance(b.pixel?) {
                a = middle
            } else {
                b = middle
            }
            if a.pixel?.distance(b.pixel?) < JUMP_PX {
                return None;
            }
        }
        Some((a.local + b.local) / 2.0)
    }
}

/// Whether the images of 3 x 3 samples are evenly spaced; false if one is missing.
fn is_even(samples: &[Sample]) -> bool {
    const TRIPLES: [[usize; 3]; 8] =
        [[0, 1, 2], [3, 4, 5], [6, 7, 8], [0, 3, 6], [1, 4, 7], [2, 5, 8], [0, 4, 8], [2, 4, 6]];
    TRIPLES.iter().all(|triple| match triple.map(|index| samples[index].pixel) {
        [Some(a), Some(middle), Some(b)] => (a + b - 2.0 * middle).length() <= UNEVEN[0] * a.distance(b) + UNEVEN[1],
        _ => false,
    })
}

/// A cell without a cut that starts at the sample nearest to a position.
fn nearest_to(samples: &[Sample], place: DVec2) -> Cell {
    start_near(samples, place, |_| true).map_or(EMPTY, |start| [start, NO_START, 0, 0])
}

fn start_near(samples: &[Sample], place: DVec2, allowed: impl Fn(&Sample) -> bool) -> Option<u32> {
    let held = samples.iter().filter(|sample| sample.held && allowed(sample));
    let nearest = held.min_by(|a, b| a.local.distance_squared(place).total_cmp(&b.local.distance_squared(place)))?;
    nearest.pixel.map(packed)
}

/// A cell with a cut fitted to its jumps, each given with the direction of the step that crossed it.
fn divided(samples: &[Sample], jumps: &[(DVec2, DVec2)]) -> Cell {
    let count = jumps.len() as f64;
    let middle = jumps.iter().map(|(place, _)| *place).sum::<DVec2>() / count;
    let way = jumps.iter().map(|(_, way)| *way).sum::<DVec2>();
    let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
    for (place, _) in jumps {
        let offset = *place - middle;
        (xx, xy, yy) = (xx + offset.x * offset.x, xy + offset.x * offset.y, yy + offset.y * offset.y);
    }
    // Perpendicular to the major axis of the jumps; for a single jump, the direction of the crossing step.
    let normal = if xx + yy > 1e-6 {
        let turn = 0.5 * (2.0 * xy).atan2(xx - yy);
        DVec2::new(-turn.sin(), turn.cos())
    } else {
        way.normalize_or(DVec2::X)
    };
    let offset = normal.dot(middle);
    let start_on_side = |sign: f64| {
        let on_side = |sample: &Sample| sign * (normal.dot(sample.local) - offset) > 1e-6;
        let places = samples.iter().filter(|sample| sample.held && on_side(sample)).map(|sample| sample.local);
        let (sum, held) = places.fold((DVec2::ZERO, 0.0), |(sum, held), local| (sum + local, held + 1.0));
        start_near(samples, sum / f64::max(held, 1.0), on_side)
    };
    match (start_on_side(1.0), start_on_side(-1.0)) {
        (Some(first), Some(second)) => {
            let fraction = |value: f64| u32::from((value * 32767.0).round() as i16 as u16);
            [first, second, fraction(normal.x) | (fraction(normal.y) << 16), (offset as f32).to_bits()]
        }
        (Some(only), None) | (None, Some(only)) => [only, NO_START, 0, 0],
        (None, None) => EMPTY,
    }
}

fn root(pieces: &[usize], mut index: usize) -> usize {
    while pieces[index] != index {
        index = pieces[index];
    }
    index
}

fn join(pieces: &mut [usize], a: usize, b: usize) {
    let (a, b) = (root(pieces, a), root(pieces, b));
    pieces[b.max(a)] = a.min(b);
}
