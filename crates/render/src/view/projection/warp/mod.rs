//! A projector's raster as a projection, from directions on a grid over the raster as calibrations measure them.
//!
//! Directions are interpolated by splines through the samples ([`Interpolation`]), so the solid angle of a pixel is |d
//! dir/du x d dir/dv| of a smooth map. The pixel of a direction is found by Newton steps from the nearest point of a
//! lattice. Cells with an unknown corner are outside of the picture.

mod nearest;
mod spline;

use std::f64::consts::PI;

use glam::{DVec2, DVec3};
pub use spline::Interpolation;

use self::{
    nearest::Nearest,
    spline::{Jet, Surface, cell},
};
use super::{BoundingCone, PlaneMapping, ProjectionError, check_size};

/// Maximum number of samples along a side.
pub const MOST_SAMPLES: usize = 8192;
/// Maximum number of Newton steps; a smooth map needs three to five.
const STEPS: usize = 12;
/// The search ends after a step shorter than this, pixels.
const FOUND_PX: f64 = 1e-9;
/// How far beyond the raster positions are found, cells of the grid: half a cell for samples at cell centres, plus a
/// fringe for stars on the border.
const BEYOND_CELLS: f64 = 1.0;

/// Positions of the samples of a grid.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Placement {
    /// The first and the last sample are on the borders of the raster.
    Corners,
    /// At the centres of equal cells, like the pixels of a picture.
    Centres,
}

/// Directions on a grid over a raster.
#[derive(Clone, Debug, PartialEq)]
pub struct DirectionGrid {
    /// Samples in a row, 2 to [`MOST_SAMPLES`].
    pub columns: usize,
    /// Rows, 2 to [`MOST_SAMPLES`].
    pub rows: usize,
    /// Unit vectors in view axes, row by row from the top of the raster; `None` if unknown or if no light goes there.
    pub samples: Vec<Option<DVec3>>,
    /// Positions of the samples.
    pub placement: Placement,
    /// Interpolation between the samples.
    pub interpolation: Interpolation,
}

impl DirectionGrid {
    /// Bytes that determine the projection of a raster of `size` pixels, and differ from those of any other.
    pub fn identity(&self, size: [u32; 2]) -> Vec<u8> {
        let mut bytes = Vec::with_capacity(32 + 25 * self.samples.len());
        size.iter().for_each(|side| bytes.extend(side.to_le_bytes()));
        [self.columns, self.rows].iter().for_each(|side| bytes.extend((*side as u64).to_le_bytes()));
        bytes.extend([self.placement as u8, self.interpolation as u8]);
        for sample in &self.samples {
            bytes.push(u8::from(sample.is_some()));
            sample.iter().flat_map(|direction| direction.to_array()).for_each(|part| bytes.extend(part.to_le_bytes()));
        }
        bytes
    }
}

/// Reasons why a grid is not a valid projection.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum WarpError {
    /// The size of the raster is invalid.
    #[error(transparent)]
    Size(#[from] ProjectionError),
    /// Too few or too many samples, or a different number of directions.
    #[error(
        "a grid of {columns} x {rows} with {directions} directions: each side must have 2 to 8192 samples, with one direction per sample"
    )]
    Samples {
        /// Samples along a row.
        columns: usize,
        /// Samples along a column.
        rows: usize,
        /// Number of directions passed in.
        directions: usize,
    },
    /// A direction is not a unit vector.
    #[error("sample ({column}, {row}): {direction:?} is not a unit vector")]
    Direction {
        /// Column.
        column: usize,
        /// Row.
        row: usize,
        /// The direction.
        direction: DVec3,
    },
    /// No cell of the grid has known directions at all its corners.
    #[error("no cell of the grid has known directions at all four corners")]
    Empty,
}

/// The projection of a projector's raster; see the module.
#[derive(Debug)]
pub struct Warp {
    size: [u32; 2],
    grid: [usize; 2],
    placement: Placement,
    /// Samples per pixel.
    scale: DVec2,
    surface: Surface,
    /// For each cell, row by row: whether all corners are known.
    cells: Vec<bool>,
    nearest: Nearest,
    /// Largest angle from the lattice's mean direction to one of its points, and the longest side of a pixel there,
    /// rad.
    reach_rad: f64,
    longest_px_rad: f64,
}

impl Warp {
    /// Builds the projection of a raster of `size` pixels.
    ///
    /// # Errors
    ///
    /// The grid is invalid.
    pub fn new(size: [u32; 2], grid: &DirectionGrid) -> Result<Self, WarpError> {
        check_size(size)?;
        let (columns, rows) = (grid.columns, grid.rows);
        let allowed = 2..=MOST_SAMPLES;
        let directions = grid.samples.len();
        if !(allowed.contains(&columns) && allowed.contains(&rows)) || directions != columns * rows {
            return Err(WarpError::Samples { columns, rows, directions });
        }
        let is_unit = |direction: &DVec3| (direction.length() - 1.0).abs() < 1e-3;
        let wrong = grid.samples.iter().enumerate().find_map(|(at, direction)| {
            let direction = direction.filter(|direction| !is_unit(direction))?;
            Some(WarpError::Direction { column: at % columns, row: at / columns, direction })
        });
        if let Some(wrong) = wrong {
            return Err(wrong);
        }
        let known = |x: usize, y: usize| grid.samples[y * columns + x].is_some();
        let cells = (0..rows - 1).flat_map(|y| (0..columns - 1).map(move |x| [x, y]));
        let cells: Vec<bool> =
            cells.map(|[x, y]| known(x, y) && known(x + 1, y) && known(x, y + 1) && known(x + 1, y + 1)).collect();
        if !cells.contains(&true) {
            return Err(WarpError::Empty);
        }
        let surface = Surface::new(&filled(&grid.samples, columns), [columns, rows], grid.interpolation);
        let nearest = Nearest::default();
        let (reach_rad, longest_px_rad) = (0.0, 0.0);
        let mut warp = Self {
            size,
            grid: [columns, rows],
            placement: grid.placement,
            scale: DVec2::ZERO,
            surface,
            cells,
            nearest,
            reach_rad,
            longest_px_rad,
        };
        let (origin, one) = (warp.in_samples(DVec2::ZERO), warp.in_samples(DVec2::ONE));
        warp.scale = DVec2::new(one[0] - origin[0], one[1] - origin[1]);
        let lattice = warp.lattice();
        let sides = lattice.iter().filter_map(|(pixel, _)| warp.jet(*pixel));
        warp.longest_px_rad = sides.map(|jet| jet.across.length().max(jet.down.length())).fold(0.0, f64::max);
        warp.nearest = Nearest::new(&lattice);
        let axis = warp.nearest.axis();
        warp.reach_rad = lattice.iter().map(|(_, direction)| direction.angle_between(axis)).fold(0.0, f64::max);
        Ok(warp)
    }

    /// Position in units of samples.
    fn in_samples(&self, pixel: DVec2) -> [f64; 2] {
        let sample_coordinate = |at: f64, side: u32, samples: usize| match self.placement {
            Placement::Corners => at / f64::from(side) * (samples - 1) as f64,
            Placement::Centres => at / f64::from(side) * samples as f64 - 0.5,
        };
        [sample_coordinate(pixel.x, self.size[0], self.grid[0]), sample_coordinate(pixel.y, self.size[1], self.grid[1])]
    }

    /// Direction, of unit length, and its derivatives per pixel.
    fn jet(&self, pixel: DVec2) -> Option<Jet> {
        let Jet { value, across, down } = self.surface.evaluate(self.in_samples(pixel));
        let length = value.length();
        if length.is_nan() || length <= 0.1 {
            return None;
        }
        let unit = value / length;
        let scale = self.scale;
        let tangent = |slope: DVec3, scale: f64| (slope - unit * unit.dot(slope)) * (scale / length);
        Some(Jet { value: unit, across: tangent(across, scale.x), down: tangent(down, scale.y) })
    }

    /// Whether the cell around a position has all its corners.
    fn is_known(&self, pixel: DVec2) -> bool {
        let [x, y] = self.in_samples(pixel);
        self.cells[cell(y, self.grid[1]) * (self.grid[0] - 1) + cell(x, self.grid[0])]
    }

    fn lattice_sides(&self) -> [usize; 2] {
        self.grid.map(|samples| (2 * (samples - 1)).clamp(32, 160))
    }

    /// Points over the picture with their directions: some in every cell, at most a few ten thousand.
    fn lattice(&self) -> Vec<(DVec2, DVec3)> {
        let [across, down] = self.lattice_sides();
        let [width, height] = self.size.map(f64::from);
        let points = (0..down).flat_map(|y| (0..across).map(move |x| [x, y]));
        let place = |[x, y]: [usize; 2]| {
            DVec2::new((x as f64 + 0.5) / across as f64 * width, (y as f64 + 0.5) / down as f64 * height)
        };
        let known = points.map(place).filter(|pixel| self.is_known(*pixel));
        known.filter_map(|pixel| Some((pixel, self.jet(pixel)?.value))).collect()
    }
}

/// Extrapolates unknown directions from their known neighbours: only the splines use them, since they need some value
/// everywhere.
fn filled(directions: &[Option<DVec3>], columns: usize) -> Vec<DVec3> {
    let rows = directions.len() / columns;
    let mut known: Vec<Option<DVec3>> = directions.to_vec();
    while known.iter().any(Option::is_none) {
        let before = known.clone();
        let sample = |x: i64, y: i64| {
            let inside = x >= 0 && y >= 0 && x < columns as i64 && y < rows as i64;
            inside.then(|| before[y as usize * columns + x as usize]).flatten()
        };
        for (index, direction) in known.iter_mut().enumerate().filter(|(_, direction)| direction.is_none()) {
            let [x, y] = [(index % columns) as i64, (index / columns) as i64];
            let guesses = [[1, 0], [-1, 0], [0, 1], [0, -1]].into_iter().filter_map(|[dx, dy]| {
                let first = sample(x + dx, y + dy)?;
                // A line through the next two samples, or the next sample itself.
                Some(sample(x + 2 * dx, y + 2 * dy).map_or(first, |second| 2.0 * first - second))
            });
            let guesses: Vec<DVec3> = guesses.collect();
            *direction = (!guesses.is_empty()).then(|| guesses.iter().sum::<DVec3>() / guesses.len() as f64);
        }
    }
    known.into_iter().flatten().collect()
}

impl PlaneMapping for Warp {
    fn size(&self) -> [u32; 2] {
        self.size
    }

    fn pixel_from_direction(&self, direction: DVec3) -> Option<DVec2> {
        let direction = direction.try_normalize()?;
        let mut pixel = self.nearest.start_point(direction)?;
        let (width, height) = (f64::from(self.size[0]), f64::from(self.size[1]));
        let beyond = BEYOND_CELLS / self.scale;
        let [least, most] = [-beyond, DVec2::new(width, height) + beyond];
        for _ in 0..STEPS {
            let Jet { value, across, down } = self.jet(pixel)?;
            // The step in the plane of both derivatives that leads to the direction.
            let off = direction - value * value.dot(direction);
            let [aa, ab, bb] = [across.dot(across), across.dot(down), down.dot(down)];
            let determinant = aa * bb - ab * ab;
            if determinant.is_nan() || determinant <= 0.0 || value.dot(direction) <= 0.0 {
                return None;
            }
            let [ra, rb] = [across.dot(off), down.dot(off)];
            let step = DVec2::new(bb * ra - ab * rb, aa * rb - ab * ra) / determinant;
            pixel = (pixel + step).clamp(least, most);
            if step.length() < FOUND_PX {
                let inside = pixel.cmpgt(least).all() && pixel.cmplt(most).all();
                return inside.then_some(pixel);
            }
        }
        None
    }

    fn direction_from_pixel(&self, pixel: DVec2) -> Option<DVec3> {
        let (width, height) = (f64::from(self.size[0]), f64::from(self.size[1]));
        let inside = pixel.x >= 0.0 && pixel.y >= 0.0 && pixel.x <= width && pixel.y <= height;
        if inside && self.is_known(pixel) { Some(self.jet(pixel)?.value) } else { None }
    }

    fn bounding_cone(&self, margin_px: f64) -> BoundingCone {
        // At most from the outermost point of the lattice to the corner of the raster.
        let [across, down] = self.lattice_sides();
        let spacing = f64::from(self.size[0]) / across as f64 + f64::from(self.size[1]) / down as f64;
        let reach = self.reach_rad + 1.5 * (margin_px + spacing) * self.longest_px_rad;
        BoundingCone { axis: self.nearest.axis(), half_angle_rad: reach.min(PI) }
    }

    fn solid_angle_sr(&self, x: u32, y: u32) -> f64 {
        let centre = super::pixel_centre(x, y);
        if !self.contains(x, y) {
            return 0.0;
        }
        self.jet(centre).map_or(0.0, |Jet { across, down, .. }| across.cross(down).length())
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failed assumption of a test panics")]
mod tests;
