//! The procedural sky of the seed "Rendering a Billion Stars?" in f64: the twin of `shaders/stars/cell_sky.wgsl`.
//!
//! A direction is mapped to a position on a cube face, u and v in [-1, 1]; the published distortion u, v *= sqrt(2 -
//! max(|u|, |v|)) moves it; a grid of `cells` x `cells` per face gives its cell. Each cell of each layer has one star,
//! with position, brightness and colour from an integer hash of cell, face, layer and seed. The star exists if one of
//! its random numbers is below the density: a band about the galactic equator (the article uses a map without
//! specifying it). The star is a cone of brightness in the coordinates of the cell, with its radius scaled by the zoom,
//! so that it has `radius_px` pixels in the centre of a face. Brightness is relative: display white is 1.
//!
//! Consequences of evaluating only one cell, as published: a star is cut off at the border of its cell if it is wider
//! than the available space (half of the cell's half side), and it is as distorted as its cell: round in the centre of
//! a face, but sqrt(2) times as wide across a face's edge as along it, and with a ratio of sqrt(3) at the corners.
//!
//! **Effect of the distortion on the cells' areas** (200 cells per side; largest solid angle divided by smallest, and standard deviation divided by
//! mean; measured by a test):
//!
//! | grid | largest / smallest | std / mean |
//! |---|---|---|
//! | plain cube | 5.14 | 0.380 |
//! | published distortion | 1.93 | 0.114 |
//! | equal angles, u = tan(pi a / 4) | 1.41 | 0.090 |
//!
//! It removes most of the plain cube's unevenness, but less than equal angles would. Those require an arc tangent. Its areas are smallest on the
//! diagonals near the corners (0.37 of a plain central cell) and largest at the middles of the edges (0.71). It maps a face onto itself and preserves
//! its edges (factor sqrt(2 - 1) = 1): the cells of two faces meet at the edges. The factor has a crease on the diagonals, where |u| = |v|: the cells
//! there are kites.
//!
//! Units: radians; directions in ICRS.

use std::f64::consts::{FRAC_PI_4, SQRT_2};

use glam::{DVec2, DVec3};

use crate::coordinates::{GALACTIC_POLE_DEC_DEG, GALACTIC_POLE_RA_DEG, direction_from_lon_lat};
use crate::photometry::blackbody::rec709_in_gamut;
use crate::plan::settings::CellSkySettings;
use crate::plan::stars::cell_sky::{BAND_SINE, EVEN_DENSITY, FAINTEST, JITTER};

/// Temperatures of the colours between which the colours of stars are interpolated.
const COLOURS_K: [f64; 3] = [3500.0, 6504.0, 12_000.0];

/// A star of the procedural sky.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CellStar {
    /// Unit direction, ICRS.
    pub direction: DVec3,
    /// Brightness at its centre, display white = 1.
    pub brightness: f64,
    /// Linear Rec. 709 colour, Y = 1.
    pub colour: [f64; 3],
    /// Position in its cell, each coordinate from -1 to 1.
    pub inner: DVec2,
}

/// Identifies a cell of a layer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Cell {
    /// Layer.
    pub layer: u32,
    /// Face: -z, +x, -x, +z, +y, -y.
    pub face: u32,
    /// Index along u.
    pub column: u32,
    /// Index along v.
    pub row: u32,
}

/// Returns the face (-z, +x, -x, +z, +y, -y) and position u, v on it for a direction of any nonzero length.
pub fn face_place(d: DVec3) -> (u32, DVec2) {
    let a = d.abs();
    if a.z >= a.x && a.z >= a.y {
        if d.z < 0.0 { (0, DVec2::new(d.x, d.y) / a.z) } else { (3, DVec2::new(-d.x, d.y) / a.z) }
    } else if a.x >= a.y {
        if d.x > 0.0 { (1, DVec2::new(d.z, d.y) / a.x) } else { (2, DVec2::new(-d.z, d.y) / a.x) }
    } else if d.y > 0.0 {
        (4, DVec2::new(d.x, d.z) / a.y)
    } else {
        (5, DVec2::new(d.x, -d.z) / a.y)
    }
}

/// Returns the unit direction of a position on a face: the inverse of [`face_place`].
pub fn face_direction(face: u32, uv: DVec2) -> DVec3 {
    let DVec2 { x: u, y: v } = uv;
    match face {
        0 => DVec3::new(u, v, -1.0),
        1 => DVec3::new(1.0, v, u),
        2 => DVec3::new(-1.0, v, -u),
        3 => DVec3::new(-u, v, 1.0),
        4 => DVec3::new(u, 1.0, v),
        _ => DVec3::new(u, -1.0, -v),
    }
    .normalize()
}

/// Returns the published distortion of a position on a face.
pub fn distort(uv: DVec2) -> DVec2 {
    uv * (2.0 - uv.abs().max_element()).sqrt()
}

/// Returns the inverse of [`distort`], by Newton's method: the derivative of m sqrt(2 - m) is (2 - 1.5 m) / sqrt(2 - m).
pub fn straighten(uv: DVec2) -> DVec2 {
    let wanted = uv.abs().max_element();
    let mut m = 0.85 * wanted;
    for _ in 0..8 {
        let root = (2.0 - m).sqrt();
        m = (m - (m * root - wanted) * root / (2.0 - 1.5 * m)).clamp(0.0, 1.0);
    }
    uv / (2.0 - m).sqrt()
}

/// Returns an integer hash with full avalanche (PCG by M. E. O'Neill, in the output form of Jarzynski and Olano 2020).
fn hash(value: u32) -> u32 {
    let state = value.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
    let word = ((state >> ((state >> 28) + 4)) ^ state).wrapping_mul(277_803_737);
    (word >> 22) ^ word
}

/// Returns a uniform number in [0, 1) with 24 bits.
fn unit(bits: u32) -> f64 {
    f64::from(bits >> 8) / f64::from(1_u32 << 24)
}

/// Returns the fraction of the cells that have a star, in a direction.
pub fn density(direction: DVec3) -> f64 {
    let pole = direction_from_lon_lat(GALACTIC_POLE_RA_DEG.to_radians(), GALACTIC_POLE_DEC_DEG.to_radians());
    EVEN_DENSITY + (1.0 - EVEN_DENSITY) * (-(direction.dot(pole) / BAND_SINE).powi(2)).exp()
}

/// Returns the star of a cell, if it has one. `settings.cells` must be at least 1.
pub fn star_in(cell: Cell, settings: &CellSkySettings) -> Option<CellStar> {
    let Cell { layer, face, column, row } = cell;
    let cells = settings.cells;
    let index = row.wrapping_mul(cells).wrapping_add(column);
    let key = hash(index ^ hash(layer.wrapping_mul(6).wrapping_add(face) ^ hash(settings.seed)));
    let random = |i: u32| unit(hash(key.wrapping_add(i)));
    let inner = (DVec2::new(random(0), random(1)) * 2.0 - 1.0) * JITTER;
    let grid = DVec2::new(f64::from(column), f64::from(row)) + 0.5 + 0.5 * inner;
    let direction = face_direction(face, straighten(grid / f64::from(cells) * 2.0 - 1.0));
    if random(2) >= density(direction) {
        return None;
    }
    let brightness = FAINTEST * (1.0 - random(3) * (1.0 - FAINTEST.powf(1.5))).powf(-2.0 / 3.0);
    let warmth = 2.0 * random(4);
    let [warm, white, blue] = COLOURS_K.map(rec709_in_gamut);
    let (from, to, part) = if warmth < 1.0 { (warm, white, warmth) } else { (white, blue, warmth - 1.0) };
    let colour = std::array::from_fn(|c| from[c] * (1.0 - part) + to[c] * part);
    Some(CellStar { direction, brightness, colour, inner })
}

/// Returns the brightness of the sky in a direction, linear Rec. 709, display white = 1. Pixels in the centre of the view have the size `pixel_rad`.
/// `settings.cells` must be at least 1.
pub fn brightness(direction: DVec3, pixel_rad: f64, settings: &CellSkySettings) -> [f64; 3] {
    let (face, uv) = face_place(direction);
    let cells = f64::from(settings.cells);
    let grid = (distort(uv) * 0.5 + 0.5) * cells;
    let cell = grid.floor().clamp(DVec2::ZERO, DVec2::splat(cells - 1.0));
    let inner = (grid - cell - 0.5) * 2.0;
    // In the centre of a face the distortion stretches by sqrt(2), and the half side of a cell is 1 / cells.
    let radius = SQRT_2 * settings.radius_px * pixel_rad * cells;
    let mut sum = [0.0; 3];
    for layer in 0..settings.layers {
        let cell = Cell { layer, face, column: cell.x as u32, row: cell.y as u32 };
        let Some(star) = star_in(cell, settings) else { continue };
        let profile = 1.0 - (inner - star.inner).length() / radius;
        if profile > 0.0 {
            (0..3).for_each(|c| sum[c] += star.colour[c] * star.brightness * profile);
        }
    }
    sum
}

/// Returns all stars, each as its direction and the brightness at its centre. There are up to 6 `layers` `cells`^2 of them.
pub fn stars(settings: &CellSkySettings) -> impl Iterator<Item = (DVec3, f64)> {
    let settings = *settings;
    let CellSkySettings { cells, layers, .. } = settings;
    let faces = (0..layers).flat_map(|layer| (0..6).map(move |face| (layer, face)));
    faces
        .flat_map(move |(layer, face)| {
            (0..cells).flat_map(move |row| (0..cells).map(move |column| Cell { layer, face, column, row }))
        })
        .filter_map(move |cell| star_in(cell, &settings).map(|star| (star.direction, star.brightness)))
}

/// Grids on a cube face.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum FaceGrid {
    /// Equal steps on the face.
    Plain,
    /// Equal steps after the published distortion.
    Published,
    /// Equal angles: u = tan(pi a / 4).
    Equiangular,
}

impl FaceGrid {
    /// Returns the position on the face for grid coordinates in [-1, 1], and area on the face per area of the grid.
    fn place(self, grid: DVec2) -> (DVec2, f64) {
        match self {
            Self::Plain => (grid, 1.0),
            Self::Published => {
                let uv = straighten(grid);
                // The derivative along the larger coordinate is (2 - 1.5 m) / sqrt(2 - m), along the smaller sqrt(2 -
                // m).
                (uv, 1.0 / (2.0 - 1.5 * uv.abs().max_element()))
            }
            Self::Equiangular => {
                let uv = DVec2::new((FRAC_PI_4 * grid.x).tan(), (FRAC_PI_4 * grid.y).tan());
                (uv, FRAC_PI_4 * FRAC_PI_4 * (1.0 + uv.x * uv.x) * (1.0 + uv.y * uv.y))
            }
        }
    }

    /// Returns the solid angles of the cells of a face, row by row, sr. Each cell is integrated as 8 x 8 midpoints of (1 + u^2 + v^2)^(-3/2).
    pub fn solid_angles_sr(self, cells: u32) -> Vec<f64> {
        const POINTS: u32 = 8;
        let step = 2.0 / f64::from(cells * POINTS);
        let coordinate = |i: u32| (f64::from(i) + 0.5) * step - 1.0;
        (0..cells * cells)
            .map(|cell| {
                let (column, row) = (cell % cells, cell / cells);
                (0..POINTS * POINTS)
                    .map(|i| {
                        DVec2::new(coordinate(column * POINTS + i % POINTS), coordinate(row * POINTS + i / POINTS))
                    })
                    .map(|grid| self.place(grid))
                    .map(|(uv, area)| area * (1.0 + uv.length_squared()).powf(-1.5) * step * step)
                    .sum()
            })
            .collect()
    }
}

#[cfg(test)]
mod tests;
