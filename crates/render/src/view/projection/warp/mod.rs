//! A projector's raster as a projection, from directions on a grid over the raster as calibrations measure them.
//!
//! Directions are interpolated by splines through the samples ([`Interpolation`]), so the solid angle of a pixel is |d dir/du x d dir/dv| of a smooth
//! map. With linear interpolation it is the sum of the solid angles of the pixel's parts in the cells. The pixel of a direction is found by Newton
//! steps from the nearest point of a lattice. Cells with an unknown corner are outside of the picture, and so is everything beyond its [`Border`].

mod border;
mod facets;
mod nearest;
mod spline;

use std::f64::consts::PI;

pub use border::{Border, ContentShape};
pub(super) use facets::triangle_sr;
use glam::{DVec2, DVec3};
pub use spline::Interpolation;

use self::{
    border::Ends,
    nearest::Nearest,
    spline::{Jet, Surface, cell},
};
use super::{BoundingCone, PlaneMapping, ProjectionError, check_size};

/// Maximum number of samples along a side.
pub const MOST_SAMPLES: usize = 8192;
/// Maximum number of Newton steps; a smooth map needs three to five, and more around a point at which it shrinks to nothing.
const STEPS: usize = 40;
/// Maximum number of times that a step is halved.
const HALVINGS: usize = 8;
/// Steps shorter than this are not checked, pixels.
const SURE_PX: f64 = 1e-6;
/// The search ends after a step shorter than this, pixels.
const FOUND_PX: f64 = 1e-9;
/// Ratio of area to squared length below which pixels have shrunk to lines.
const SHRUNK: f64 = 0.2;
/// Distance beyond the raster up to which positions are found, cells of the grid: half a cell for samples at cell centres, plus a fringe for stars on
/// the border.
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
    /// Bytes that identify the projection of a raster of `size` pixels: those of any other projection are different.
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
    /// A border has another number of places than the grid has samples.
    #[error("the border has {places} places, but the grid has {samples} samples: each sample must have one place")]
    Border {
        /// Places of the border.
        places: usize,
        /// Samples of the grid.
        samples: usize,
    },
    /// No cell of the grid has known directions at all its corners, or none of them shows the content.
    #[error("no cell of the grid has known directions at all four corners and lies in the content")]
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
    /// Where the content ends; `None` if it fills the grid.
    ends: Option<Ends>,
    interpolation: Interpolation,
    nearest: Nearest,
    /// Pixels along the edge of the picture where it shrinks to a point, with their directions.
    shrunk_edge: Vec<(DVec2, DVec3)>,
    /// Whether most of the picture is seen from behind, as if from outside of the sphere.
    mirrored: bool,
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
        Self::within(size, grid, None)
    }

    /// As [`Warp::new`]; beyond the border of the content, if it has one, nothing is shown.
    ///
    /// # Errors
    ///
    /// The grid is invalid, or the border does not fit it.
    pub fn within(size: [u32; 2], grid: &DirectionGrid, border: Option<&Border>) -> Result<Self, WarpError> {
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
        if let Some(places) = border.map(|border| border.places.len()).filter(|places| *places != directions) {
            return Err(WarpError::Border { places, samples: directions });
        }
        let ends = border.map(|border| Ends::new(border, [columns, rows], grid.interpolation));
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
            ends,
            interpolation: grid.interpolation,
            nearest,
            shrunk_edge: Vec::new(),
            mirrored: false,
            reach_rad,
            longest_px_rad,
        };
        let (origin, one) = (warp.in_samples(DVec2::ZERO), warp.in_samples(DVec2::ONE));
        warp.scale = DVec2::new(one[0] - origin[0], one[1] - origin[1]);
        let lattice = warp.lattice();
        if lattice.is_empty() {
            return Err(WarpError::Empty);
        }
        let jets: Vec<Jet> = lattice.iter().filter_map(|(pixel, _)| warp.jet(*pixel)).collect();
        warp.longest_px_rad = jets.iter().map(|jet| jet.across.length().max(jet.down.length())).fold(0.0, f64::max);
        warp.mirrored = 2 * jets.iter().filter(|jet| warp.is_right_way(jet)).count() < jets.len();
        if warp.ends.is_some() && jets.iter().any(is_shrunk) {
            warp.shrunk_edge = warp.shrunk_edge();
        }
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
        let (unit, length) = unit_of(value)?;
        let scale = self.scale;
        let tangent = |slope: DVec3, scale: f64| (slope - unit * unit.dot(slope)) * (scale / length);
        Some(Jet { value: unit, across: tangent(across, scale.x), down: tangent(down, scale.y) })
    }

    /// The direction of [`Self::jet`].
    fn direction(&self, pixel: DVec2) -> Option<DVec3> {
        unit_of(self.surface.value(self.in_samples(pixel))).map(|(unit, _)| unit)
    }

    /// Whether all corners of the cell around a position, in sample units, are known.
    fn has_corners(&self, [x, y]: [f64; 2]) -> bool {
        self.cells[cell(y, self.grid[1]) * (self.grid[0] - 1) + cell(x, self.grid[0])]
    }

    /// Whether the picture covers a position.
    fn is_known(&self, pixel: DVec2) -> bool {
        let at = self.in_samples(pixel);
        self.has_corners(at) && self.ends.as_ref().is_none_or(|ends| ends.holds(at))
    }

    /// The pixels along the edge of the picture where it shrinks to a point, with their directions.
    fn shrunk_edge(&self) -> Vec<(DVec2, DVec3)> {
        let (width, height) = (self.size[0] as usize, self.size[1] as usize);
        let centre = |x: usize, y: usize| super::pixel_centre(x as u32, y as u32);
        // Extend the raster by a column on each side and a row above and below, in which nothing is shown.
        let row = |y: usize| {
            let shown = (0..width).map(|x| y < height && self.is_known(centre(x, y)));
            [false].into_iter().chain(shown).chain([false]).collect::<Vec<bool>>()
        };
        let mut rows = [vec![false; width + 2], row(0), row(1)];
        let mut found = Vec::new();
        for y in 0..height {
            let at_edge = |x: &usize| rows[1][x + 1] && rows.iter().any(|row| row[*x..x + 3].contains(&false));
            let edge = (0..width).filter(at_edge).map(|x| centre(x, y));
            found.extend(edge.filter_map(|pixel| Some((pixel, self.jet(pixel).filter(is_shrunk)?.value))));
            rows.rotate_left(1);
            rows[2] = row(y + 2);
        }
        found
    }

    /// The edge pixel whose direction is nearest to a given one.
    fn nearest_at_edge(&self, direction: DVec3) -> Option<DVec2> {
        let distance = |(_, other): &&(DVec2, DVec3)| other.distance_squared(direction);
        let nearest = self.shrunk_edge.iter().min_by(|a, b| distance(a).total_cmp(&distance(b)));
        nearest.map(|(pixel, _)| *pixel)
    }

    fn lattice_sides(&self) -> [usize; 2] {
        self.grid.map(|samples| (2 * (samples - 1)).clamp(32, 160))
    }

    /// Points of the picture with their directions: several per cell of a small grid, and at most some tens of thousands.
    fn lattice(&self) -> Vec<(DVec2, DVec3)> {
        let [across, down] = self.lattice_sides();
        let [width, height] = self.size.map(f64::from);
        let points = (0..down).flat_map(|y| (0..across).map(move |x| [x, y]));
        let place = |[x, y]: [usize; 2]| {
            DVec2::new((x as f64 + 0.5) / across as f64 * width, (y as f64 + 0.5) / down as f64 * height)
        };
        let known = points.map(place).filter(|pixel| self.is_known(*pixel));
        known.filter_map(|pixel| Some((pixel, self.direction(pixel)?))).collect()
    }
}

/// Unit vector and length of an interpolated direction; `None` if it is too short to have a direction, or NaN.
fn unit_of(value: DVec3) -> Option<(DVec3, f64)> {
    let length = value.length();
    (length > 0.1).then(|| (value / length, length))
}

/// Whether pixels are much longer than wide here, as around the antipode of a fisheye.
fn is_shrunk(jet: &Jet) -> bool {
    let (across, down) = (jet.across.length_squared(), jet.down.length_squared());
    jet.across.cross(jet.down).length() < SHRUNK * across.max(down)
}

/// Result of the search for a direction.
enum Search {
    Found(DVec2),
    /// The search left the raster and its fringe.
    Beyond,
    /// No step leads closer, or there were too many.
    Lost,
}

impl Warp {
    /// Whether the picture is seen from the same side here as at most of its points. Beyond a fold it is seen from behind.
    fn is_right_way(&self, jet: &Jet) -> bool {
        (jet.across.cross(jet.down).dot(jet.value) < 0.0) == self.mirrored
    }

    /// Newton steps from a position of the raster to that of a direction (unit vector). Steps that lead away from the direction, or across a fold,
    /// are shortened. This is needed where a picture shrinks to a point, as around the antipode of a fisheye: full steps would end on the far side of
    /// that point.
    fn search(&self, direction: DVec3, start: DVec2) -> Search {
        let beyond = BEYOND_CELLS / self.scale;
        let [least, most] = [-beyond, DVec2::from(self.size.map(f64::from)) + beyond];
        let mut pixel = start;
        let Some(mut jet) = self.jet(pixel) else { return Search::Lost };
        let right_way = self.is_right_way(&jet);
        for _ in 0..STEPS {
            let Jet { value, across, down } = jet;
            // The step in the plane of both derivatives that leads to the direction.
            let off = direction - value * value.dot(direction);
            let [aa, ab, bb] = [across.dot(across), across.dot(down), down.dot(down)];
            let determinant = aa * bb - ab * ab;
            if determinant.is_nan() || determinant <= 0.0 || value.dot(direction) <= 0.0 {
                return Search::Lost;
            }
            let [ra, rb] = [across.dot(off), down.dot(off)];
            let mut step = DVec2::new(bb * ra - ab * rb, aa * rb - ab * ra) / determinant;
            let length = step.length();
            if length < FOUND_PX {
                let found = (pixel + step).clamp(least, most);
                let inside = found.cmpgt(least).all() && found.cmplt(most).all();
                return if inside { Search::Found(found) } else { Search::Beyond };
            }
            // Rounding may hide the progress of a very short step.
            let accepted = |next: &Jet| {
                let closer = next.value.distance_squared(direction) < value.distance_squared(direction);
                (closer || length < SURE_PX) && (!right_way || self.is_right_way(next))
            };
            let next = (0..HALVINGS).find_map(|_| {
                let at = (pixel + step).clamp(least, most);
                step *= 0.5;
                self.jet(at).filter(accepted).map(|jet| (at, jet))
            });
            let is_at_end = (pixel.cmple(least) | pixel.cmpge(most)).any();
            match next {
                Some((at, _)) if at == pixel => return Search::Beyond,
                Some((at, next)) => (pixel, jet) = (at, next),
                None if is_at_end => return Search::Beyond,
                None => return Search::Lost,
            }
        }
        Search::Lost
    }
}

/// Extrapolates unknown directions from their known neighbours. Only the splines use these directions, since they need some value everywhere.
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
        let at_edge = std::iter::once_with(|| self.nearest_at_edge(direction)).flatten();
        for start in self.nearest.start_points(direction).chain(at_edge) {
            match self.search(direction, start) {
                Search::Found(pixel) => return Some(pixel),
                Search::Beyond if self.shrunk_edge.is_empty() => return None,
                Search::Beyond | Search::Lost => {}
            }
        }
        None
    }

    fn direction_from_pixel(&self, pixel: DVec2) -> Option<DVec3> {
        let (width, height) = (f64::from(self.size[0]), f64::from(self.size[1]));
        let inside = pixel.x >= 0.0 && pixel.y >= 0.0 && pixel.x <= width && pixel.y <= height;
        if inside && self.is_known(pixel) { self.direction(pixel) } else { None }
    }

    fn is_faceted(&self) -> bool {
        self.interpolation == Interpolation::Linear
    }

    fn bounding_cone(&self, margin_px: f64) -> BoundingCone {
        // Add at most the distance from the outermost point of the lattice to the corner of the raster.
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
        match self.interpolation {
            Interpolation::Smooth => {
                self.jet(centre).map_or(0.0, |Jet { across, down, .. }| across.cross(down).length())
            }
            Interpolation::Linear => {
                let ([left, top], [right, bottom]) = (self.in_samples(centre - 0.5), self.in_samples(centre + 0.5));
                let columns = facets::cuts(left, right, self.grid[0]);
                let rows = facets::cuts(top, bottom, self.grid[1]);
                let direction = |at: [f64; 2]| self.surface.evaluate(at).value.try_normalize();
                facets::rectangle_sr(&columns, &rows, direction, |at| self.has_corners(at))
            }
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failed assumption of a test panics")]
mod tests;
