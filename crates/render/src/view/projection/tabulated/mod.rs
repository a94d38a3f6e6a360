//! Any mapping as a table, which lets the GPU draw custom projections.
//!
//! [`TabulatedMapping::new`] queries a [`PlaneMapping`] for the direction and the solid angle of every pixel, and for the starting points of the
//! inverse search (from a direction to its pixel). The GPU has only these numbers, not the formula. Between pixel centres, directions are
//! interpolated by cubic convolution (Keys 1981). The pixel of a direction is found by Newton steps on the interpolated directions; around kinks,
//! such as the poles of many maps of the sphere, a finer table is used. In f64 everything still goes through the mapping itself, so that the f64
//! twins draw the mapping and not its table. Baking compares table and mapping at four points of every pixel. It refuses mappings that differ from
//! their table by more than [`LIMIT_PX`], fold, tear or are not finite, and the error names the pixel. At kinks, at the edges of flat facets and in
//! slivers of pixels the limits are wider: see [`TableAccuracy`].
//!
//! At a cut of the mapping, a star's image is on the side for which the mapping returns its position. If the mapping shows the full sphere, light
//! beyond the edge of the picture is added to the pixels inside, so that no light is lost. Otherwise the edge is a border, and light beyond it is not
//! in the picture.

mod bake;
mod check;
mod error;
mod kept;
mod nodes;
mod outside;
mod patches;
mod pole;
mod rows;
mod search;
mod starts;
#[cfg(test)]
mod tests;

use std::{
    f64::consts::PI,
    fmt,
    sync::{Arc, Mutex, PoisonError, Weak},
};

pub use bake::MOST_SIDE_PX;
pub use check::{LIMIT_PX, TableAccuracy};
pub use error::TabulationError;
use glam::{DVec2, DVec3};
pub use nodes::FRINGE;
pub use patches::{PATCH_BIT, PATCH_STEPS};
pub use search::{DONE_PX, LONGEST_STEP_PX, MOST_STEPS, NEAR_PX};
pub use starts::NO_START;

use self::{
    bake::Baked,
    nodes::Nodes,
    starts::{Beginning, Starts},
};
use super::{BoundingCone, Footprint, PlaneMapping, Tap};
use crate::cache;

/// Number of four-word groups before the directions of a table: see [`TabulatedMapping::words`].
pub const HEADER: u32 = 4;

/// A mapping with its table. Two instances are equal only if they are the same object.
pub struct TabulatedMapping {
    source: Arc<dyn PlaneMapping + Send>,
    baked: Baked,
    starts: Starts,
    has_cut: bool,
    accuracy: TableAccuracy,
    /// Key of its inputs in the cache; `None` if they are not known.
    key: Option<cache::Key>,
}

impl fmt::Debug for TabulatedMapping {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut fields = f.debug_struct("TabulatedMapping");
        fields.field("size", &self.size()).field("sum_sr", &self.baked.sum_sr).field("accuracy", &self.accuracy);
        fields.finish_non_exhaustive()
    }
}

impl PartialEq for TabulatedMapping {
    fn eq(&self, other: &Self) -> bool {
        std::ptr::eq(self, other)
    }
}

/// Everything that is baked.
struct Tables {
    baked: Baked,
    starts: Starts,
    accuracy: TableAccuracy,
}

/// Least angle to which a picture and its fringe must extend, rad: f32 does not resolve smaller angles.
const LEAST_REACH_RAD: f64 = 1e-7;

fn tables(source: &(dyn PlaneMapping + Send)) -> Result<Tables, TabulationError> {
    let [width, height] = source.size();
    // Between the pixels of a single column or row there is nothing to interpolate, unless the mapping continues beyond it.
    let is_line = width < 2 || height < 2;
    make_tables(source).map_err(|error| match error {
        TabulationError::Coarse { .. } | TabulationError::Torn { .. } if is_line => {
            TabulationError::TooSmall { width, height }
        }
        error => error,
    })
}

fn make_tables(source: &(dyn PlaneMapping + Send)) -> Result<Tables, TabulationError> {
    let baked = bake::bake(source)?;
    if !bake::is_within(LEAST_REACH_RAD, baked.reach_rad[1]) {
        let [width, height] = source.size();
        return Err(TabulationError::TooSmall { width, height });
    }
    let all = source.shows_full_sphere();
    let around = (baked.axis, if all || baked.reach_rad[1] > 0.98 * PI { PI } else { baked.reach_rad[1] });
    let mut starts = starts::starts(source, &baked.nodes, around, baked.pixels)
        .map_err(|starts::Junction(pixel)| TabulationError::Junction { pixel })?;
    let compare = |starts: &Starts| check::compare(source, &baked.nodes, |n| lookup(starts, &baked.nodes, n, all));
    let mut found = compare(&starts);
    let directions = found.to_refine(source, baked.pixels)?;
    if !directions.is_empty() {
        let base = HEADER as usize + baked.nodes.values.len() + starts.cells.len();
        patches::refine(&mut starts, source, &directions, base as u32);
        found = compare(&starts);
    }
    let accuracy = found.accuracy(source)?;
    Ok(Tables { baked, starts, accuracy })
}

impl TabulatedMapping {
    /// Bakes a mapping. A million pixels take up to three seconds on two cores; closed forms take less time than splines.
    ///
    /// # Errors
    ///
    /// The mapping cannot be tabulated; the error names the pixel.
    pub fn new(source: impl PlaneMapping + Send + 'static) -> Result<Self, TabulationError> {
        Self::shared(Arc::new(source))
    }

    /// As [`TabulatedMapping::new`], for a shared mapping.
    ///
    /// # Errors
    ///
    /// As [`TabulatedMapping::new`].
    pub fn shared(source: Arc<dyn PlaneMapping + Send>) -> Result<Self, TabulationError> {
        let tables = tables(&*source)?;
        Ok(Self::with_tables(source, tables, None))
    }

    /// As [`TabulatedMapping::new`], but the table is kept in the cache of the process. `inputs` are its key there, and must determine the mapping.
    /// While a mapping of the same inputs exists in the process, that one is returned.
    ///
    /// # Errors
    ///
    /// As [`TabulatedMapping::new`].
    pub fn kept(source: impl PlaneMapping + Send + 'static, inputs: &[u8]) -> Result<Arc<Self>, TabulationError> {
        type Shared = (cache::Key, Weak<TabulatedMapping>);
        static MAPPINGS: Mutex<Vec<Shared>> = Mutex::new(Vec::new());
        let key = cache::key(kept::PART, &[inputs]);
        // Returns the existing mapping, and forgets those that no longer exist.
        let find = |mappings: &mut Vec<Shared>| {
            mappings.retain(|(_, mapping)| mapping.strong_count() > 0);
            mappings.iter().find(|(of, _)| *of == key).and_then(|(_, mapping)| mapping.upgrade())
        };
        // No code panics while it holds the lock.
        let mappings = || MAPPINGS.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(mapping) = find(&mut mappings()) {
            return Ok(mapping);
        }
        let tables = cache::kept_or_made(kept::PART, &[inputs], kept::FORM, || {
            let [width, height] = source.size();
            tracing::info!("computing the table of a projection of {width} x {height} pixels");
            tables(&source)
        })?;
        let mut mappings = mappings();
        // Another thread may have been faster.
        if let Some(mapping) = find(&mut mappings) {
            return Ok(mapping);
        }
        let mapping = Arc::new(Self::with_tables(Arc::new(source), tables, Some(key)));
        mappings.push((key, Arc::downgrade(&mapping)));
        Ok(mapping)
    }

    fn with_tables(source: Arc<dyn PlaneMapping + Send>, tables: Tables, key: Option<cache::Key>) -> Self {
        let Tables { baked, starts, accuracy } = tables;
        let has_cut = starts.has_cut();
        Self { source, baked, starts, has_cut, accuracy, key }
    }

    /// Identifies the inputs of the mapping; `None` if they are not known ([`TabulatedMapping::new`]).
    pub fn key(&self) -> Option<&cache::Key> {
        self.key.as_ref()
    }

    /// Accuracy of the table.
    pub fn accuracy(&self) -> TableAccuracy {
        self.accuracy
    }

    /// Pixel coordinates of a direction (any length but 0) in the table, found with the algorithm of the GPU: in f64,
    /// but with the table's f32 values.
    pub fn lookup(&self, direction: DVec3) -> Option<DVec2> {
        lookup(&self.starts, &self.baked.nodes, direction.try_normalize()?, self.shows_full_sphere())
    }

    /// Whether neighbouring directions can have images far apart, each with its own neighbourhood.
    pub fn has_cut(&self) -> bool {
        self.has_cut
    }

    /// Solid angle of the picture: the sum over its pixels, sr.
    pub fn picture_solid_angle_sr(&self) -> f64 {
        self.baked.sum_sr
    }

    /// Least solid angle of a pixel, sr.
    pub fn smallest_pixel_sr(&self) -> f64 {
        self.baked.least_sr
    }

    /// Number of pixels in the picture.
    pub fn pixels(&self) -> u64 {
        self.baked.pixels
    }

    /// The shortest side of any pixel, and the shortest of the longer sides, rad.
    pub fn finest_pixel_rad(&self) -> [f64; 2] {
        [self.baked.shortest_rad, self.baked.longer_rad[0]]
    }

    /// Size of the table on the GPU, bytes.
    pub fn bytes(&self) -> u64 {
        let Starts { cells, patches, .. } = &self.starts;
        (HEADER as usize + self.baked.nodes.values.len() + cells.len() + patches.len()) as u64 * 16
    }

    /// The table as the GPU reads it, in groups of four words. The header contains the number of cells along a side of the grid of starts and the
    /// group index of the first cell; the grid's axis and its cells per radian; the direction of its columns; and the direction of its rows. The
    /// nodes (pixel centres), the cells, and the samples of their patches follow.
    pub(crate) fn words(&self) -> Vec<[u32; 4]> {
        let Starts { side, axis, right, up, scale, cells, patches } = &self.starts;
        let nodes = &self.baked.nodes.values;
        let vector = |direction: &DVec3, last: f64| {
            let [x, y, z] = direction.as_vec3().to_array();
            [x, y, z, last as f32].map(f32::to_bits)
        };
        let mut words = Vec::with_capacity(HEADER as usize + nodes.len() + cells.len() + patches.len());
        words.push([*side, HEADER + nodes.len() as u32, 0, 0]);
        words.extend([vector(axis, *scale), vector(right, 0.0), vector(up, 0.0)]);
        words.extend(nodes.iter().map(|node| node.map(f32::to_bits)));
        words.extend(cells);
        words.extend(patches.iter().map(|[x, y]| [x.to_bits(), y.to_bits(), 0, 0]));
        words
    }
}

fn lookup(starts: &Starts, nodes: &Nodes, direction: DVec3, shows_everything: bool) -> Option<DVec2> {
    match starts.start(direction)? {
        Beginning::Node(node) => search::search(nodes, direction, node, shows_everything),
        Beginning::Patch(group, part) => {
            let first = group as usize - HEADER as usize - nodes.values.len() - starts.cells.len();
            Some(patches::in_patch(&starts.patches[first..], part))
        }
    }
}

/// Uses the mapping itself, restricted to the picture of the table.
impl PlaneMapping for TabulatedMapping {
    fn size(&self) -> [u32; 2] {
        self.baked.nodes.size
    }

    fn pixel_from_direction(&self, direction: DVec3) -> Option<DVec2> {
        self.source.pixel_from_direction(direction)
    }

    fn direction_from_pixel(&self, pixel: DVec2) -> Option<DVec3> {
        let [width, height] = self.size();
        if !(pixel.x >= 0.0 && pixel.y >= 0.0 && pixel.x <= f64::from(width) && pixel.y <= f64::from(height)) {
            return None;
        }
        let held = self.contains((pixel.x as u32).min(width - 1), (pixel.y as u32).min(height - 1));
        if held { self.source.direction_from_pixel(pixel) } else { None }
    }

    fn contains(&self, x: u32, y: u32) -> bool {
        self.baked.nodes.contains(x, y)
    }

    fn solid_angle_sr(&self, x: u32, y: u32) -> f64 {
        if self.contains(x, y) { self.source.solid_angle_sr(x, y) } else { 0.0 }
    }

    fn shows_full_sphere(&self) -> bool {
        self.source.shows_full_sphere()
    }

    fn is_faceted(&self) -> bool {
        self.source.is_faceted()
    }

    /// Use the directions around the image: across a cut, the image has no derivative, but the direction has one.
    fn pixel_extent_rad(&self, direction: DVec3) -> Option<[f64; 2]> {
        let pixel = self.source.pixel_from_direction(direction)?;
        match bake::derivatives(&*self.source, pixel) {
            Some([along_x, along_y]) => Some(bake::singular_values(along_x, along_y)),
            None => self.source.pixel_extent_rad(direction),
        }
    }

    fn bounding_cone(&self, margin_px: f64) -> BoundingCone {
        if self.shows_full_sphere() {
            return BoundingCone { axis: self.baked.axis, half_angle_rad: PI };
        }
        // This includes half the diagonal of the last pixel.
        let reach_rad = self.baked.reach_rad[0] + (margin_px + 0.75) * self.baked.longer_rad[1];
        BoundingCone { axis: self.baked.axis, half_angle_rad: reach_rad.min(PI) }
    }

    fn taps(&self, kernel: Footprint<'_>, direction: DVec3) -> Vec<Tap> {
        let Some(centre) = self.pixel_from_direction(direction) else { return Vec::new() };
        let mut taps: Vec<Tap> = kernel(centre).into_iter().filter_map(|tap| self.tap_inside(tap)).collect();
        if self.shows_full_sphere() {
            // Nothing lies outside of this picture, so weights beyond its edge belong to the pixels inside.
            let inside: f64 = taps.iter().map(|tap| tap.weight).sum();
            for tap in &mut taps {
                tap.weight /= inside;
            }
        }
        taps
    }
}
