//! Reads a deep store: the index when it is opened, everything else when it is requested.

use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use glam::{DVec3, Vec3};

use super::super::store::{self, Store};
use super::super::{StarRecord, distance_modulus};
use super::cell_range::CellRange;
use super::cells::{CellFrame, cell_count};
use super::error::DeepError;
use super::index::{self, Index, Segments};
use super::tile::{Tile, tile_order, words_of_tile};
use super::word::{LightScale, Word, distance_pc, temperature_k};
use super::{BRIGHT_FILE, LAYERS, PLANES};
use crate::units::magnitude_from_illuminance_lx;
use crate::{files, platform};

/// The light codes of a layer.
pub(super) fn light_scale(layer: usize) -> &'static LightScale {
    static SCALES: LazyLock<[LightScale; LAYERS.len()]> =
        LazyLock::new(|| LAYERS.map(|layer| LightScale::new(layer.magnitude)));
    &SCALES[layer]
}

/// Returns whether the path is a folder with an index of a deep store. A damaged index also counts, so that its damage is reported later.
pub fn is_deep_store(path: &Path) -> bool {
    path.is_dir() && path.join(index::NAME).exists()
}

/// A star of a leaf.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DeepStar {
    /// Unit vector at the store's epoch, ICRS axes, seen from the barycentre.
    pub direction: DVec3,
    /// Illuminance at the barycentre, lx.
    pub illuminance_lx: f64,
    /// Temperature, K.
    pub temperature_k: f64,
    /// Distance, pc; `None`: at infinity.
    pub distance_pc: Option<f64>,
}

impl DeepStar {
    /// Apparent V magnitude at the barycentre.
    pub fn v_mag(&self) -> f64 {
        magnitude_from_illuminance_lx(self.illuminance_lx)
    }

    /// Returns the star in the form in which readers return stars.
    pub fn record(&self) -> StarRecord {
        let distance = self.distance_pc.unwrap_or(1.0);
        let modulus = self.distance_pc.map_or(0.0, distance_modulus);
        StarRecord {
            position: self.direction * distance,
            magnitude: (self.v_mag() - modulus) as f32,
            temperature_k: self.temperature_k as f32,
            distance_known: self.distance_pc.is_some(),
        }
    }
}

/// A leaf whose checksum was verified.
#[derive(Clone, Debug)]
pub struct Leaf {
    /// Index of its layer in [`LAYERS`].
    pub layer: usize,
    /// Number of its cell in the order of the layer, nested.
    pub cell: u64,
    /// Its cell.
    pub frame: CellFrame,
    /// Words of its stars, brightest first; see [`Word`].
    pub words: Vec<u64>,
}

impl Leaf {
    /// Decodes a star. The same leaf and index always give the same star of a store.
    pub fn star(&self, index: usize) -> DeepStar {
        let word = Word::from_bits(self.words[index]);
        let (direction, illuminance_lx, distance_pc) = self.place_and_light(word);
        DeepStar { direction, illuminance_lx, temperature_k: temperature_k(word.temperature), distance_pc }
    }

    /// Direction, illuminance at the barycentre in lx, and distance in pc (`None`: at infinity) of the star with this word; as in [`Self::star`].
    #[inline]
    pub(super) fn place_and_light(&self, word: Word) -> (DVec3, f64, Option<f64>) {
        let illuminance_lx = light_scale(self.layer).illuminance_lx(word.light);
        (self.frame.direction(word.inside()), illuminance_lx, distance_pc(word.distance))
    }

    /// Direction of a star minus that of the centre of the cell, for views whose pixels are finer than the steps of f32 unit vectors.
    pub fn offset(&self, index: usize) -> Vec3 {
        self.frame.offset(Word::from_bits(self.words[index]).inside())
    }
}

/// An open deep store.
#[derive(Debug)]
pub struct DeepStore {
    folder: PathBuf,
    index: Index,
    root: [u8; 32],
    /// Files of the layers and of the planes, with their paths.
    leaves: Vec<(PathBuf, File)>,
    planes: Vec<(PathBuf, File)>,
}

impl DeepStore {
    /// Opens a store: reads its index, and checks the lengths of all files. The contents are checked when they are read.
    ///
    /// # Errors
    /// The folder is not a deep store of this version, its index is damaged, or a file is missing or has another length.
    pub fn open(folder: &Path) -> Result<Self, DeepError> {
        let path = folder.join(index::NAME);
        let bytes = match files::read_bounded(&path, Index::most_bytes()) {
            Ok(bytes) => bytes,
            Err(error) if folder.is_dir() && error.kind() == io::ErrorKind::NotFound => {
                return Err(DeepError::NotAStore { path: folder.to_owned() });
            }
            Err(error) => return Err(DeepError::io(&path)(error)),
        };
        let (index, root) = Index::from_bytes(&path, &bytes)?;
        let open = |name: String, expected: u64| {
            let path = folder.join(name);
            let file = files::open_regular(&path).map_err(DeepError::io(&path))?;
            check_length(&path, &file, expected)?;
            Ok((path, file))
        };
        let leaves = LAYERS.iter().zip(&index.leaves).map(|(layer, leaves)| open(layer.file(), leaves.bytes()));
        let leaves = leaves.collect::<Result<_, DeepError>>()?;
        let planes = PLANES.iter().zip(&index.tiles).map(|(plane, tiles)| open(plane.file(), tiles.bytes()));
        let planes = planes.collect::<Result<_, DeepError>>()?;
        open(BRIGHT_FILE.to_owned(), index.bright.bytes)?;
        Ok(Self { folder: folder.to_owned(), index, root, leaves, planes })
    }

    /// Opens a store that must have all cells. Use it for everything except work on parts.
    ///
    /// # Errors
    /// Those of [`Self::open`], or the store is a part.
    pub fn open_whole(folder: &Path) -> Result<Self, DeepError> {
        let store = Self::open(folder)?;
        match store.index.part {
            Some(part) if part.cells != CellRange::ALL => {
                Err(DeepError::IsPart { path: folder.to_owned(), cells: part.cells.to_string() })
            }
            _ => Ok(store),
        }
    }

    /// The index.
    pub fn index(&self) -> &Index {
        &self.index
    }

    /// The root checksum in hexadecimal. Two stores with the same root checksum have the same content.
    pub fn root(&self) -> String {
        files::hexadecimal(&self.root)
    }

    /// Its folder.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Path of one of its files.
    pub fn part(&self, name: &str) -> PathBuf {
        self.folder.join(name)
    }

    /// Total length of all files, bytes, except those that only a merge of parts needs.
    pub fn bytes(&self) -> u64 {
        let parts = self.index.leaves.iter().chain(&self.index.tiles).map(Segments::bytes).sum::<u64>();
        parts + self.index.bright.bytes + self.index.to_bytes().0.len() as u64
    }

    /// Reads the bright stars, which are at J2000.0.
    ///
    /// # Errors
    /// The file cannot be read, is damaged, or does not belong to the index.
    pub fn bright(&self) -> Result<Store, DeepError> {
        let path = self.folder.join(BRIGHT_FILE);
        let header = store::read_header(&path)?;
        let expected = self.index.bright;
        if (header.crc32, header.stars) != (expected.crc32, expected.stars) {
            return Err(DeepError::damaged(
                &path,
                "its checksum differs from the one in the index: it belongs to another store",
            ));
        }
        Ok(store::read(&path)?)
    }

    /// Reads a leaf; a leaf without stars is not read from the disk.
    ///
    /// # Errors
    /// The layer has no such leaf, it cannot be read, or its checksum is wrong.
    pub fn leaf(&self, layer: usize, cell: u64) -> Result<Leaf, DeepError> {
        let words = self.leaf_words(layer, cell)?;
        Ok(Leaf { layer, cell, frame: CellFrame::new(LAYERS[layer].order, cell), words })
    }

    /// Reads the words of a leaf; see [`Self::leaf`].
    pub(super) fn leaf_words(&self, layer: usize, cell: u64) -> Result<Vec<u64>, DeepError> {
        let Self { index, leaves, .. } = self;
        self.words(&leaves[layer], &index.leaves[layer], ("leaf", cell, LAYERS[layer].order))
    }

    /// Reads a tile of a plane; a tile without stars is not read from the disk. In the plane's order, the cell of composite star i is `cell *
    /// cells_per_tile + tile.cells[i]`.
    ///
    /// # Errors
    /// The plane has no such tile, it cannot be read, or its checksum is wrong.
    pub fn tile(&self, plane: usize, cell: u64) -> Result<Tile, DeepError> {
        let order = PLANES[plane].order;
        let words = self.tile_words(plane, cell)?;
        Tile::from_words(order, &words).ok_or_else(|| DeepError::DamagedPart {
            path: self.planes[plane].0.clone(),
            part: "tile",
            cell,
            order: tile_order(order),
            problem: "the bits of its cells do not match its composite stars".to_owned(),
        })
    }

    /// Reads the words of a tile; see [`Self::tile`].
    pub(super) fn tile_words(&self, plane: usize, cell: u64) -> Result<Vec<u64>, DeepError> {
        let Self { index, planes, .. } = self;
        self.words(&planes[plane], &index.tiles[plane], ("tile", cell, tile_order(PLANES[plane].order)))
    }

    /// Reads a segment and verifies its checksum. The segment lies within the file, because [`Self::open`] compared the lengths.
    fn words(
        &self,
        (path, file): &(PathBuf, File),
        segments: &Segments,
        (part, cell, order): (&'static str, u64, u8),
    ) -> Result<Vec<u64>, DeepError> {
        if cell >= cell_count(order) {
            return Err(DeepError::NoSuchPart { path: path.clone(), part, cell, last: cell_count(order) - 1 });
        }
        // A layer or plane without stars has no segments.
        let Some(segment) = segments.list.get(cell as usize).filter(|segment| segment.count > 0) else {
            return Ok(Vec::new());
        };
        let (first, count) = segments.range(cell as usize);
        let mut words = vec![0; count as usize];
        let bytes: &mut [u8] = bytemuck::cast_slice_mut(&mut words);
        let damaged = |problem: String| DeepError::DamagedPart { path: path.clone(), part, cell, order, problem };
        platform::read_exact_at(file, bytes, 8 * first).map_err(|error| match error.kind() {
            io::ErrorKind::UnexpectedEof => damaged("the file ends before this part".to_owned()),
            _ => DeepError::io(path)(error),
        })?;
        let found = crc32fast::hash(bytes);
        if found != segment.crc32 {
            return Err(damaged(format!("its checksum is {found:08x}, but the index has {:08x}", segment.crc32)));
        }
        Ok(words)
    }

    /// Number of composite stars of a plane's tile, without reading it.
    pub fn tile_stars(&self, plane: usize, cell: u64) -> u32 {
        self.index.tiles[plane].list.get(cell as usize).map_or(0, |segment| segment.count)
    }

    /// Number of stars of a leaf, without reading it.
    pub fn leaf_stars(&self, layer: usize, cell: u64) -> u32 {
        self.index.leaves[layer].list.get(cell as usize).map_or(0, |segment| segment.count)
    }

    /// Number of bytes that are read for a tile.
    pub fn tile_bytes(&self, plane: usize, cell: u64) -> u64 {
        8 * words_of_tile(PLANES[plane].order, self.tile_stars(plane, cell))
    }
}

fn check_length(path: &Path, file: &File, expected: u64) -> Result<(), DeepError> {
    let length = file.metadata().map_err(DeepError::io(path))?.len();
    if length == expected {
        return Ok(());
    }
    let problem = format!(
        "it has {length} bytes but should have {expected} according to the index: it is truncated, or belongs to another store"
    );
    Err(DeepError::damaged(path, problem))
}
