//! A page contains the stars of a leaf or the composite stars of a tile, in the form that the renderer reads.
//!
//! A page has a centre c, a unit vector in f32. A star is in the direction g = c + x u + y v, with the unit vectors u and v of [`page_axes`]. Seen
//! from `camera` (pc from the barycentre), the star is in the direction g - camera p, where p is its parallax in 1/pc times the length of g.
//! Therefore a star has the same accuracy at 100 pc and at infinity; in cells of order 6, f32 numbers have steps of 0.2 mas.

use std::sync::LazyLock;

use bytemuck::{Pod, Zeroable};
use glam::{DVec3, Vec3};

use super::super::super::epoch::Epoch;
use super::super::super::packed::{MIN_TEMPERATURE_K, PackedStar};
use super::super::cells::{CellFrame, cell_count};
use super::super::composite::Composite;
use super::super::error::DeepError;
use super::super::reader::{DeepStore, Leaf, light_scale};
use super::super::tile::{Tile, tile_order, words_of_tile};
use super::super::word::{DISTANCES_PC, LIGHT_STEPS, TEMPERATURE_STEPS, Word, temperature_k};
use super::super::{BUCKET_ORDER, LAYERS, PLANES};
use crate::photometry::rec709::luminance;

/// Greatest parallax of a star in a leaf, 1/pc.
pub const MOST_PARALLAX: f64 = 1.0 / DISTANCES_PC[0];

/// Position of the bits of a composite star that hold its light; see [`Composite::from_bits`].
const LIGHT_SHIFT: u32 = 32;

/// Identifies a page.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum PageKey {
    /// A leaf.
    Leaf {
        /// Index of its layer in [`LAYERS`].
        layer: u8,
        /// Number of its cell.
        cell: u32,
    },
    /// A tile.
    Tile {
        /// Index of its plane in [`PLANES`].
        plane: u8,
        /// Number of its cell.
        cell: u32,
    },
}

/// Axis and half-angle (rad) of a cone that contains a cell.
fn cone_of(order: u8, cell: u64) -> (DVec3, f64) {
    let frame = CellFrame::new(order, cell);
    (frame.centre, frame.radius_rad())
}

/// Cones of the cells of the bucket order and of the next two orders, of which each frame tests most. They are not computed in parallel: a pool
/// thread that waits for a part of the result may start other work that needs these cones, and would wait for itself.
static CONES: [LazyLock<Vec<(DVec3, f64)>>; 3] = [
    LazyLock::new(|| cones_of(BUCKET_ORDER)),
    LazyLock::new(|| cones_of(BUCKET_ORDER + 1)),
    LazyLock::new(|| cones_of(BUCKET_ORDER + 2)),
];

fn cones_of(order: u8) -> Vec<(DVec3, f64)> {
    (0..cell_count(order)).map(|cell| cone_of(order, cell)).collect()
}

impl PageKey {
    /// Order of its cell.
    pub fn order(self) -> u8 {
        match self {
            Self::Leaf { layer, .. } => LAYERS[usize::from(layer)].order,
            Self::Tile { plane, .. } => tile_order(PLANES[usize::from(plane)].order),
        }
    }

    /// Number of its cell.
    pub fn cell(self) -> u64 {
        match self {
            Self::Leaf { cell, .. } | Self::Tile { cell, .. } => u64::from(cell),
        }
    }

    /// Whether the page contains composite stars.
    pub fn is_composite(self) -> bool {
        matches!(self, Self::Tile { .. })
    }

    /// Number of stars of the page in a store, without reading the page.
    pub fn stars(self, store: &DeepStore) -> u32 {
        match self {
            Self::Leaf { layer, cell } => store.leaf_stars(usize::from(layer), u64::from(cell)),
            Self::Tile { plane, cell } => store.tile_stars(usize::from(plane), u64::from(cell)),
        }
    }

    /// Axis (a unit vector) and half-angle (rad) of a cone that contains all stars of the cell.
    pub fn cone(self) -> (DVec3, f64) {
        let (order, cell) = (self.order(), self.cell());
        match CONES.get(usize::from(order - BUCKET_ORDER)) {
            Some(cones) => cones[cell as usize],
            None => cone_of(order, cell),
        }
    }
}

/// A star of a page.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct PageStar {
    /// Coordinates along the page's axes.
    pub xy: [f32; 2],
    /// Parallax in 1/pc, times the length of its direction g.
    pub parallax: f32,
    /// Encoded light at the barycentre: for a star as in [`PackedStar`], for a composite star the upper 32 bits of its word.
    pub light: u32,
}

impl PageStar {
    /// Returns the light of a star of a leaf, as a packed star at infinity.
    pub fn packed(&self) -> PackedStar {
        PackedStar { offset_pc: [0.0; 3], light: self.light }
    }
}

/// The bits of [`PackedStar::light`] for each code of the light and of the temperature. The light of a star combines the bits of both codes.
struct PackedLights {
    /// By layer.
    of_light: [Vec<u32>; LAYERS.len()],
    of_temperature: Vec<u32>,
}

/// Computed once, because computing the logarithms for each star would take longer than everything else.
static PACKED_LIGHTS: LazyLock<PackedLights> = LazyLock::new(|| {
    let packed = |illuminance_lx, temperature_k| PackedStar::new(Vec3::ZERO, illuminance_lx, temperature_k).light;
    let of_light = |layer: usize| {
        (0..=LIGHT_STEPS).map(|code| packed(light_scale(layer).illuminance_lx(code), MIN_TEMPERATURE_K)).collect()
    };
    PackedLights {
        of_light: std::array::from_fn(of_light),
        of_temperature: (0..=TEMPERATURE_STEPS).map(|code| packed(0.0, temperature_k(code))).collect(),
    }
});

/// The stars of a leaf or tile.
#[derive(Clone, Debug)]
pub struct Page {
    /// Identifier, unique among all pages that were ever read.
    pub id: u64,
    /// Leaf or tile.
    pub key: PageKey,
    /// Direction of the centre of its cell, a unit vector in f32, ICRS axes.
    pub centre: Vec3,
    /// Its stars, those of a leaf from the brightest to the faintest.
    pub stars: Vec<PageStar>,
    /// Illuminance at the barycentre of the brightest star, lx.
    pub brightest_lx: f64,
    /// Illuminance at the barycentre of the faintest star, lx.
    pub faintest_lx: f64,
    /// Illuminance at the barycentre of all stars together, lx.
    pub total_lx: f64,
}

/// The unit vectors u and v, perpendicular to a page's centre and to each other.
pub fn page_axes(centre: DVec3) -> [DVec3; 2] {
    let pole = if centre.z.abs() < 0.9 { DVec3::Z } else { DVec3::X };
    let u = pole.cross(centre).normalize();
    [u, centre.cross(u)]
}

/// Converts directions to stars of a page.
struct PageFrame {
    centre: DVec3,
    axes: [DVec3; 2],
}

impl PageFrame {
    fn new(towards: DVec3) -> Self {
        let centre = towards.as_vec3().as_dvec3();
        Self { centre, axes: page_axes(centre) }
    }

    /// Converts a star at a position, pc from the barycentre.
    fn star(&self, place: DVec3, light: u32) -> PageStar {
        let scale = self.centre.length_squared() / place.dot(self.centre);
        let [x, y] = self.axes.map(|axis| place.dot(axis) * scale);
        // The length of g divided by the distance.
        PageStar { xy: [x as f32, y as f32], parallax: scale as f32, light }
    }
}

impl Page {
    /// Reads a page from a store, as seen at an epoch.
    ///
    /// # Errors
    /// The leaf or tile cannot be read, or is damaged.
    pub fn read(store: &DeepStore, key: PageKey, epoch: &Epoch, id: u64) -> Result<Self, DeepError> {
        let mut page = match key {
            PageKey::Leaf { layer, cell } => Self::of_leaf(&store.leaf(usize::from(layer), u64::from(cell))?, epoch),
            PageKey::Tile { plane, cell } => {
                let (plane, cell) = (usize::from(plane), u64::from(cell));
                Self::of_tile(plane, cell, &store.tile(plane, cell)?, epoch)
            }
        };
        page.id = id;
        Ok(page)
    }

    fn empty(key: PageKey, centre: DVec3, stars: usize) -> Self {
        let stars = Vec::with_capacity(stars);
        let (brightest_lx, faintest_lx, total_lx) = (0.0, f64::INFINITY, 0.0);
        Self { id: 0, key, centre: centre.as_vec3(), stars, brightest_lx, faintest_lx, total_lx }
    }

    fn add(&mut self, star: PageStar, illuminance_lx: f64) {
        self.stars.push(star);
        self.brightest_lx = self.brightest_lx.max(illuminance_lx);
        self.faintest_lx = self.faintest_lx.min(illuminance_lx);
        self.total_lx += illuminance_lx;
    }

    fn of_leaf(leaf: &Leaf, epoch: &Epoch) -> Self {
        let frame = PageFrame::new(leaf.frame.centre);
        let key = PageKey::Leaf { layer: leaf.layer as u8, cell: leaf.cell as u32 };
        let mut page = Self::empty(key, frame.centre, leaf.words.len());
        let PackedLights { of_light, of_temperature } = &*PACKED_LIGHTS;
        let of_light = &of_light[leaf.layer];
        for bits in &leaf.words {
            let word = Word::from_bits(*bits);
            let (direction, illuminance_lx, distance_pc) = leaf.place_and_light(word);
            let light = of_light[word.light as usize] | of_temperature[word.temperature as usize];
            page.add(frame.star(seen_place(epoch, direction, distance_pc), light), illuminance_lx);
        }
        page
    }

    /// Creates a page of the composite stars of a tile. Its identifier is 0.
    pub(super) fn of_tile(plane: usize, cell: u64, tile: &Tile, epoch: &Epoch) -> Self {
        let order = PLANES[plane].order;
        let cells = CellFrame::new(tile_order(order), cell);
        let orders = order - tile_order(order);
        let frame = PageFrame::new(cells.centre);
        let key = PageKey::Tile { plane: plane as u8, cell: cell as u32 };
        let mut page = Self::empty(key, frame.centre, tile.bits.len());
        for (inner, bits) in tile.cells.iter().zip(&tile.bits) {
            let composite = Composite::from_bits(*bits);
            let direction = cells.direction_in_finer(u64::from(*inner), orders, composite.inside);
            let distance_pc = (composite.parallax > 0.0).then(|| composite.parallax.recip());
            let star = frame.star(seen_place(epoch, direction, distance_pc), (bits >> LIGHT_SHIFT) as u32);
            page.add(star, luminance(composite.light_lx));
        }
        page
    }

    /// Size of its stars in memory, bytes.
    pub fn bytes(&self) -> u64 {
        (self.stars.len() * size_of::<PageStar>()) as u64
    }

    /// Size of the page in its file, bytes.
    pub fn file_bytes(&self) -> u64 {
        let stars = self.stars.len() as u32;
        8 * match self.key {
            PageKey::Leaf { .. } => u64::from(stars),
            PageKey::Tile { plane, .. } => words_of_tile(PLANES[usize::from(plane)].order, stars),
        }
    }

    /// Whether a star of the page has a distance.
    pub fn is_distance_known(&self, star: &PageStar) -> bool {
        // The limit is half a code step nearer than the farthest distance, which means infinity.
        f64::from(star.parallax) * DISTANCES_PC[1] > 1.0 + 3e-3
    }

    /// Returns the direction g of a star as seen by the camera, and the star's illuminance there relative to that at the barycentre. The direction is
    /// g minus the displacement by the camera's position (pc from the barycentre).
    pub fn seen(&self, star: &PageStar, camera_pc: DVec3) -> (DVec3, f64) {
        let centre = self.centre.as_dvec3();
        let [u, v] = page_axes(centre);
        let towards = centre + u * f64::from(star.xy[0]) + v * f64::from(star.xy[1]);
        let relative = towards - camera_pc * f64::from(star.parallax);
        (relative, towards.length_squared() / relative.length_squared())
    }
}

/// Position of a star of the store as seen at an epoch, pc. Stars at infinity get the farthest distance that a word can hold.
pub(super) fn seen_place(epoch: &Epoch, direction: DVec3, distance_pc: Option<f64>) -> DVec3 {
    epoch.seen_place(direction * distance_pc.unwrap_or(DISTANCES_PC[1]), true)
}
