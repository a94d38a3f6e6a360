//! A deep store that a scene draws: pages are read when views need them, and kept in memory up to a limit.
//!
//! [`detail`] lists the pages of each level of detail, [`page`] defines the content of a page, and `pages` reads pages in the background and keeps
//! them in memory.

pub mod detail;
pub mod page;
mod pages;

use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use glam::DVec3;

use self::detail::BASE_PLANE;
use self::pages::{Pages, Readers};
pub use self::{
    detail::Detail,
    page::{Page, PageKey, PageStar},
};
use super::super::epoch::Epoch;
use super::composite::Composite;
use super::error::DeepError;
use super::reader::{DeepStar, DeepStore};
use super::tile::Tile;
use super::{BUCKET_ORDER, BUCKETS, LAYERS};

/// The stars of a deep store as seen at an epoch. Clones and other epochs of the same store share its memory.
#[derive(Clone, Debug)]
pub struct DeepSky {
    epoch: Epoch,
    readers: Arc<Readers>,
    base: Arc<Base>,
}

/// The composite stars that are always in memory.
#[derive(Debug)]
struct Base {
    /// A tile for each cell of [`super::BUCKET_ORDER`].
    tiles: Arc<Vec<Tile>>,
    pages: Vec<Arc<Page>>,
}

impl Base {
    fn at_epoch(&self, epoch: &Epoch) -> Arc<Self> {
        let of_tile = |(cell, tile): (usize, &Tile)| {
            let page = Page::of_tile(usize::from(BASE_PLANE), cell as u64, tile, epoch);
            Arc::new(Page { id: pages::new_id(), ..page })
        };
        let pages = self.tiles.iter().enumerate().map(of_tile).collect();
        Arc::new(Self { tiles: Arc::clone(&self.tiles), pages })
    }
}

/// State of the pages of a store, for reports and statistics.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DeepStatistics {
    /// Bytes of the pages in memory.
    pub bytes: u64,
    /// Pages read so far.
    pub pages_read: u64,
    /// Bytes read for them.
    pub bytes_read: u64,
}

impl DeepSky {
    /// Opens a store and reads its coarsest composite stars.
    ///
    /// # Errors
    /// It cannot be opened, or these are damaged.
    pub fn open(folder: &Path, epoch: &Epoch) -> Result<Self, DeepError> {
        let readers = Arc::new(Readers::new(DeepStore::open_whole(folder)?));
        let mut tiles = Vec::new();
        for bucket in 0..BUCKETS {
            tiles.push(readers.pages().store().tile(usize::from(BASE_PLANE), bucket)?);
        }
        let base = Base { tiles: Arc::new(tiles), pages: Vec::new() }.at_epoch(epoch);
        Ok(Self { epoch: *epoch, readers, base })
    }

    /// Returns the same store as seen at another epoch.
    #[must_use]
    pub fn at_epoch(&self, epoch: &Epoch) -> Self {
        if *epoch == self.epoch {
            return self.clone();
        }
        Self { base: self.base.at_epoch(epoch), epoch: *epoch, readers: Arc::clone(&self.readers) }
    }

    /// The store.
    pub fn store(&self) -> &DeepStore {
        self.pages().store()
    }

    /// Light of all leaves together, lx.
    pub fn total_lx(&self) -> f64 {
        self.base.pages.iter().map(|page| page.total_lx).sum()
    }

    /// Returns the composite stars of the base as seen from a position in pc: direction (of any length) and light (linear Rec. 709, lx).
    pub fn base_light(&self, place_pc: DVec3) -> impl Iterator<Item = (DVec3, [f64; 3])> {
        (0..BUCKETS).flat_map(move |bucket| self.base_light_of(bucket, place_pc))
    }

    /// As [`Self::base_light`], for one cell of [`super::BUCKET_ORDER`].
    pub fn base_light_of(&self, bucket: u64, place_pc: DVec3) -> impl Iterator<Item = (DVec3, [f64; 3])> {
        let page = &self.base.pages[bucket as usize];
        page.stars.iter().map(move |star| {
            let (relative, factor) = page.seen(star, place_pc);
            let composite = Composite::from_bits(u64::from(star.light) << 32);
            (relative, composite.light_lx.map(|light| light * factor))
        })
    }

    /// Position of a star of the store as seen at the epoch, pc.
    pub fn place_pc(&self, star: &DeepStar) -> DVec3 {
        page::seen_place(&self.epoch, star.direction, star.distance_pc)
    }

    /// Returns the pages that are in memory, in the order of the keys; `None` for those that are not. The base is always in memory. Pages of another
    /// epoch of the same store are returned until they have been read again.
    pub fn pages_of(&self, keys: &[PageKey]) -> Vec<Option<Arc<Page>>> {
        let mut held = self.pages().held(keys);
        for (held, key) in held.iter_mut().zip(keys) {
            if let PageKey::Tile { plane: BASE_PLANE, cell } = key {
                *held = Some(Arc::clone(&self.base.pages[*cell as usize]));
            }
        }
        held
    }

    /// Returns the leaves that have stars and overlap a circle around a unit vector. `layer` is the index of their layer in [`super::LAYERS`].
    pub fn leaves_near(&self, layer: usize, axis: DVec3, radius_rad: f64) -> Vec<PageKey> {
        let order = LAYERS[layer].order;
        let key = |cell: u64| PageKey::Leaf { layer: layer as u8, cell: cell as u32 };
        let is_near = |key: PageKey| {
            let (centre, half_angle_rad) = key.cone();
            centre.angle_between(axis) <= half_angle_rad + radius_rad
        };
        // Convert cells of the bucket order to cells of the layer.
        let shift = 2 * (order - BUCKET_ORDER);
        let buckets = (0..BUCKETS).filter(|bucket| is_near(PageKey::Tile { plane: BASE_PLANE, cell: *bucket as u32 }));
        let leaves = buckets.flat_map(|bucket| (bucket << shift..(bucket + 1) << shift).map(key));
        leaves.filter(|key| key.stars(self.store()) > 0 && is_near(*key)).collect()
    }

    /// Returns a page from memory; a page that is not in memory is read and not kept.
    ///
    /// # Errors
    /// It is damaged or cannot be read.
    pub fn read(&self, key: PageKey) -> Result<Arc<Page>, DeepError> {
        let held = self.pages_of(&[key]).pop().flatten();
        held.map_or_else(|| self.pages().read(key, &self.epoch).map(Arc::new), Ok)
    }

    /// Requests pages from the readers, which read the most urgent ones first. A newer request for a page replaces an older one.
    pub fn ask(&self, wants: &[(PageKey, f64)]) {
        self.pages().ask(&self.epoch, wants);
    }

    /// Reads pages now, on all cores. Pages that were found damaged before are not tried again.
    ///
    /// # Errors
    /// One of them is damaged or cannot be read; the others are in memory.
    pub fn load(&self, keys: &[PageKey]) -> Result<(), DeepError> {
        self.pages().load(&self.epoch, keys)
    }

    /// Sets the limit of the memory for pages, bytes.
    pub fn set_limit(&self, bytes: u64) {
        self.pages().set_limit(bytes);
    }

    /// Returns statistics of the pages in memory and of the pages read so far.
    pub fn statistics(&self) -> DeepStatistics {
        self.pages().statistics()
    }

    /// Returns the message of the first error in reading a page, if there was one.
    pub fn problem(&self) -> Option<String> {
        self.pages().problem()
    }

    /// Delays each read of a page in the background, to simulate a slow disk.
    #[doc(hidden)]
    pub fn set_delay(&self, delay: Duration) {
        self.pages().set_delay(delay);
    }

    fn pages(&self) -> &Pages {
        self.readers.pages()
    }
}

#[cfg(test)]
mod tests;
