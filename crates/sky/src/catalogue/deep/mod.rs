//! Deep stores: catalogues that do not fit in memory, such as Gaia's 1.8 billion stars.
//!
//! A deep store is a folder. Its stars are stored in three forms:
//!
//! - **Bright** stars are brighter than V = 13, nearer than 100 pc, or have a proper motion above 0.2"/yr ([`resident`]). They are in `bright`, a
//!   single-file store ([`super::store`]), with motions and names. A renderer keeps all of them in memory.
//! - **Leaves** contain the other stars, in three layers by magnitude ([`LAYERS`]) and in HEALPix cells of orders 6, 7 and 8. Each star has 64 bits
//!   ([`word`]); the brightest ones come first. They are read when a narrow view needs them.
//! - **Planes** contain the light of the leaves as composite stars, one for each cell of an order ([`composite`]). The plane of V = 15 contains the
//!   light of the layers of V = 15 and V = 17. Wide views draw planes instead of individual stars.
//!
//! | file | content |
//! |---|---|
//! | `index` | version, epoch, description, tables with checksums, sums of light ([`index`]) |
//! | `bright` | the bright stars |
//! | `leaves-13`, `leaves-15`, `leaves-17` | words of the stars of each layer, leaf by leaf |
//! | `plane-M-ORDER` | composite stars of the light fainter than V = M, tile by tile ([`tile`]) |
//!
//! Numbers are little-endian. Positions in leaves and planes are at the epoch given in the index, in the ICRS, as seen from the barycentre. Files are
//! read by positioned reads into buffers of the caller's size. They are not mapped into memory: if another program truncated a mapped file, the
//! process would end. Every leaf and tile has a CRC-32 and is never returned if the checksum is wrong.
//!
//! [`live`] reads the stars that views need while they are drawn. [`build`] writes stores in bounded memory, [`import`] and [`synth`] deliver stars
//! to it, [`merge`] joins parts that were made separately, [`check`], [`slice`] and [`export`] read whole stores.

mod bucket;
pub mod build;
pub mod cell_range;
pub mod cells;
pub mod check;
pub mod composite;
mod error;
pub mod export;
mod finish;
pub mod hats;
pub mod import;
mod import_report;
pub mod index;
mod journal;
pub mod live;
pub mod merge;
pub mod part;
pub mod prior;
mod reader;
pub mod resident;
pub mod slice;
mod spill;
pub mod synth;
pub mod tile;
pub mod word;
mod work;
mod writer;

pub use error::DeepError;
pub use reader::{DeepStar, DeepStore, Leaf, is_deep_store};

#[cfg(test)]
mod damage_tests;
#[cfg(test)]
mod merge_tests;
#[cfg(test)]
mod test_stores;

/// A layer of leaves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Layer {
    /// V magnitude of its brightest stars. All stars of the next layer are fainter than those of this one.
    pub magnitude: u8,
    /// HEALPix order of its leaves.
    pub order: u8,
}

/// A plane of composite stars.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Plane {
    /// It contains the light of the layer of this magnitude and of all fainter layers.
    pub magnitude: u8,
    /// HEALPix order of its cells.
    pub order: u8,
}

/// The layers.
pub const LAYERS: [Layer; 3] =
    [Layer { magnitude: 13, order: 6 }, Layer { magnitude: 15, order: 7 }, Layer { magnitude: 17, order: 8 }];

/// The planes. For each layer their orders range from four orders finer than its leaves to [`COARSEST_PLANE`].
pub const PLANES: [Plane; 15] = [
    Plane { magnitude: 13, order: 10 },
    Plane { magnitude: 13, order: 9 },
    Plane { magnitude: 13, order: 8 },
    Plane { magnitude: 13, order: 7 },
    Plane { magnitude: 15, order: 11 },
    Plane { magnitude: 15, order: 10 },
    Plane { magnitude: 15, order: 9 },
    Plane { magnitude: 15, order: 8 },
    Plane { magnitude: 15, order: 7 },
    Plane { magnitude: 17, order: 12 },
    Plane { magnitude: 17, order: 11 },
    Plane { magnitude: 17, order: 10 },
    Plane { magnitude: 17, order: 9 },
    Plane { magnitude: 17, order: 8 },
    Plane { magnitude: 17, order: 7 },
];

/// Order of the coarsest planes. A cell of the bucket order contains 64 cells of this order. Therefore rounding changes the sum of its light by at
/// most 1e-6; with 16 cells, the change could be 3.3e-6.
pub const COARSEST_PLANE: u8 = 7;

/// Order of the cells whose sums of light are in the index.
pub const SUM_ORDER: u8 = 5;

/// Order of the cells (buckets) that are written one after the other.
pub const BUCKET_ORDER: u8 = 4;

/// Number of buckets.
pub const BUCKETS: u64 = cells::cell_count(BUCKET_ORDER);

/// Epoch of the positions in leaves that imports write, Julian year. It is that of Gaia's third data release.
pub const EPOCH_YEAR: f64 = 2016.0;

/// Name of the file of the bright stars.
pub const BRIGHT_FILE: &str = "bright";

impl Layer {
    /// V magnitude that no star of the layer exceeds in brightness. The remainder of rounding that is carried from star to star may make a star half
    /// a step brighter.
    pub fn brightest_mag(self) -> f64 {
        f64::from(self.magnitude) - 0.01
    }

    /// Name of its file.
    pub fn file(self) -> String {
        format!("leaves-{}", self.magnitude)
    }

    /// Number of its leaves in a cell of [`BUCKET_ORDER`].
    pub const fn leaves_per_bucket(self) -> usize {
        1 << (2 * (self.order - BUCKET_ORDER))
    }
}

impl Plane {
    /// Name of its file.
    pub fn file(self) -> String {
        format!("plane-{}-{}", self.magnitude, self.order)
    }

    /// Number of its tiles in a cell of [`BUCKET_ORDER`].
    pub const fn tiles_per_bucket(self) -> usize {
        1 << (2 * (tile::tile_order(self.order) - BUCKET_ORDER))
    }
}
