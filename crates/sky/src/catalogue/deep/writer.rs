//! Writes leaves and planes bucket by bucket, and records each finished bucket, so that the work can be continued.
//!
//! The record of a bucket ([`BucketRecord`]) contains the bucket's part of the index tables. It is appended to the file `finished` after the bucket's
//! leaves and tiles are written. The lengths of the other files follow from the records: data that a killed program wrote beyond them are cut off.

use std::fs::{File, OpenOptions};
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use super::bucket::{BucketLeaves, BucketSums};
use super::composite::{CellSum, Quantiser};
use super::error::DeepError;
use super::finish::Tables;
use super::index::Segment;
use super::tile::{Tile, cells_per_tile, tile_order, words_of_tile};
use super::{BUCKET_ORDER, BUCKETS, LAYERS, PLANES};
use crate::photometry::rec709::luminance;

/// Parses numbers from the bytes of a record.
fn list<T: bytemuck::Pod>(bytes: &[u8]) -> Vec<T> {
    let mut list = vec![T::zeroed(); bytes.len() / size_of::<T>()];
    bytemuck::cast_slice_mut(&mut list).copy_from_slice(bytes);
    list
}

/// Name of the file of finished buckets.
pub const FINISHED: &str = "finished";

/// A finished bucket.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BucketRecord {
    /// Leaves of all layers.
    pub leaves: Vec<Segment>,
    /// Tiles of all planes.
    pub tiles: Vec<Segment>,
    /// Light of each layer in its four cells of order 5.
    pub sums: Vec<[f64; 3]>,
    /// Numbers of stars: those that were left out because they equal another star; those with a median colour; those of the limiting magnitude that
    /// later buckets may still keep.
    pub counts: [u64; 3],
}

const fn leaves_per_bucket() -> usize {
    LAYERS[0].leaves_per_bucket() + LAYERS[1].leaves_per_bucket() + LAYERS[2].leaves_per_bucket()
}

fn tiles_per_bucket() -> usize {
    PLANES.iter().map(|plane| plane.tiles_per_bucket()).sum()
}

/// Size of a record with its checksum, bytes.
fn record_bytes() -> usize {
    8 * (leaves_per_bucket() + tiles_per_bucket()) + 24 * 4 * LAYERS.len() + 24 + 4
}

impl BucketRecord {
    fn to_bytes(&self) -> Vec<u8> {
        let mut bytes: Vec<u8> = Vec::with_capacity(record_bytes());
        bytes.extend_from_slice(bytemuck::cast_slice(&self.leaves));
        bytes.extend_from_slice(bytemuck::cast_slice(&self.tiles));
        bytes.extend_from_slice(bytemuck::cast_slice(&self.sums));
        bytes.extend_from_slice(bytemuck::cast_slice(&self.counts));
        bytes.extend_from_slice(&crc32fast::hash(&bytes).to_le_bytes());
        bytes
    }

    /// Inverse of [`Self::to_bytes`]; `None` if the record is incomplete or damaged.
    fn from_bytes(bytes: &[u8]) -> Option<Self> {
        let (content, crc32) = bytes.split_last_chunk()?;
        if bytes.len() != record_bytes() || crc32fast::hash(content) != u32::from_le_bytes(*crc32) {
            return None;
        }
        let mut rest = content;
        let mut take = |bytes: usize| {
            let (taken, left) = rest.split_at(bytes);
            rest = left;
            taken
        };
        Some(Self {
            leaves: list(take(8 * leaves_per_bucket())),
            tiles: list(take(8 * tiles_per_bucket())),
            sums: list(take(24 * 4 * LAYERS.len())),
            counts: bytemuck::pod_read_unaligned(take(24)),
        })
    }

    /// Leaves of each layer.
    fn leaves_by_layer(&self) -> Vec<&[Segment]> {
        split(&self.leaves, LAYERS.iter().map(|layer| layer.leaves_per_bucket()))
    }

    /// Tiles of each plane.
    fn tiles_by_plane(&self) -> Vec<&[Segment]> {
        split(&self.tiles, PLANES.iter().map(|plane| plane.tiles_per_bucket()))
    }
}

fn split(mut list: &[Segment], lengths: impl Iterator<Item = usize>) -> Vec<&[Segment]> {
    let mut parts = Vec::new();
    for length in lengths {
        let (part, rest) = list.split_at(length);
        parts.push(part);
        list = rest;
    }
    parts
}

/// A bucket that is ready to be written. Everything in it depends on its stars alone.
pub struct EncodedBucket {
    leaves: BucketLeaves,
    segments: [Vec<Segment>; LAYERS.len()],
    light: [[[f64; 3]; 4]; LAYERS.len()],
    /// Tiles of all planes, and the words of the tiles of each plane.
    tiles: Vec<Segment>,
    tile_words: Vec<Vec<u64>>,
}

impl EncodedBucket {
    /// Adds up the leaves of a bucket, encodes its planes, and computes checksums.
    ///
    /// # Errors
    /// A cell has more light than a composite star can hold.
    pub fn new(bucket: u64, leaves: BucketLeaves) -> Result<Self, DeepError> {
        let (segments, BucketSums { light, planes }) = (leaves.segments(), BucketSums::new(&leaves));
        let mut tiles = Vec::with_capacity(tiles_per_bucket());
        let mut tile_words = Vec::with_capacity(PLANES.len());
        for (plane, cells) in planes.iter().enumerate() {
            let mut words = Vec::new();
            tiles.extend(tiles_of(bucket, plane, cells, &mut words)?);
            tile_words.push(words);
        }
        Ok(Self { leaves, segments, light, tiles, tile_words })
    }
}

/// Encodes the tiles of a plane in a bucket, and adds them to `words`. The remainder of rounding is carried within the bucket only, from bright cells
/// to faint ones. Steps of fainter cells are smaller, so that the final remainder is half a step of the faintest cell.
fn tiles_of(bucket: u64, plane: usize, cells: &[CellSum], words: &mut Vec<u64>) -> Result<Vec<Segment>, DeepError> {
    let kind = PLANES[plane];
    if cells.is_empty() {
        return Ok(vec![Segment::default(); kind.tiles_per_bucket()]);
    }
    let per_tile = cells_per_tile(kind.order);
    let first = bucket << (2 * (tile_order(kind.order) - BUCKET_ORDER));
    let brightest_lx = |index: &usize| cells[*index].light_lx.into_iter().fold(0.0, f64::max);
    let mut with_stars: Vec<usize> = (0..cells.len()).filter(|index| !cells[*index].is_empty()).collect();
    with_stars.sort_by(|a, b| brightest_lx(b).total_cmp(&brightest_lx(a)).then(a.cmp(b)));
    let mut quantiser = Quantiser::default();
    let mut codes = vec![0; cells.len()];
    for index in with_stars {
        codes[index] = quantiser.encode(&cells[index]).map_err(|bright| DeepError::TooBright {
            cell: first * per_tile as u64 + index as u64,
            order: kind.order,
            magnitude: kind.magnitude,
            illuminance_lx: luminance(bright.light_lx),
        })?;
    }
    let mut segments = Vec::with_capacity(kind.tiles_per_bucket());
    for (cells, codes) in cells.chunks(per_tile).zip(codes.chunks(per_tile)) {
        let mut tile = Tile::default();
        let with_stars = codes.iter().enumerate().filter(|(index, _)| !cells[*index].is_empty());
        with_stars.for_each(|(index, bits)| tile.push(index as u32, *bits));
        let of_tile = tile.to_words(kind.order);
        segments.push(Segment::new(tile.bits.len() as u32, &of_tile));
        words.extend(of_tile);
    }
    Ok(segments)
}

/// A file to which data are appended.
struct Growing {
    path: PathBuf,
    file: File,
}

impl Growing {
    /// Opens a file and truncates it to a length.
    fn open(path: PathBuf, length: u64) -> Result<Self, DeepError> {
        let file = OpenOptions::new().read(true).write(true).create(true).truncate(false).open(&path);
        let mut file = file.map_err(DeepError::io(&path))?;
        let found = file.metadata().map_err(DeepError::io(&path))?.len();
        if found < length {
            return Err(DeepError::damaged(
                &path,
                format!("it has {found} bytes but must have {length}; remove the unfinished store"),
            ));
        }
        file.set_len(length).and_then(|()| file.seek(SeekFrom::End(0))).map_err(DeepError::io(&path))?;
        Ok(Self { path, file })
    }

    fn append(&mut self, bytes: &[u8]) -> Result<(), DeepError> {
        self.file.write_all(bytes).map_err(DeepError::io(&self.path))
    }
}

/// Writer of the files of leaves and planes.
pub struct Writer {
    leaves: Vec<Growing>,
    planes: Vec<Growing>,
    finished: Growing,
    records: Vec<BucketRecord>,
}

impl Writer {
    /// Opens the files of an unfinished store in `folder`, and continues after the last bucket that has a record in `work`.
    pub fn open(folder: &Path, work: &Path) -> Result<Self, DeepError> {
        let records = read_records(&work.join(FINISHED))?;
        let (mut leaf_words, mut tile_words) = ([0_u64; LAYERS.len()], [0_u64; PLANES.len()]);
        for record in &records {
            for (words, leaves) in leaf_words.iter_mut().zip(record.leaves_by_layer()) {
                *words += leaves.iter().map(|leaf| u64::from(leaf.count)).sum::<u64>();
            }
            for ((words, tiles), plane) in tile_words.iter_mut().zip(record.tiles_by_plane()).zip(PLANES) {
                *words += tiles.iter().map(|tile| words_of_tile(plane.order, tile.count)).sum::<u64>();
            }
        }
        let leaves = LAYERS.iter().zip(leaf_words);
        let planes = PLANES.iter().zip(tile_words);
        Ok(Self {
            leaves: leaves
                .map(|(layer, words)| Growing::open(folder.join(layer.file()), 8 * words))
                .collect::<Result<_, _>>()?,
            planes: planes
                .map(|(plane, words)| Growing::open(folder.join(plane.file()), 8 * words))
                .collect::<Result<_, _>>()?,
            finished: Growing::open(work.join(FINISHED), (records.len() * record_bytes()) as u64)?,
            records,
        })
    }

    /// Number of finished buckets, which is also the index of the next bucket.
    pub fn finished(&self) -> u64 {
        self.records.len() as u64
    }

    /// Number of stars of the limiting magnitude that later buckets may still keep; `None` before the first bucket.
    pub fn ties_left(&self) -> Option<u64> {
        self.records.last().map(|record| record.counts[2])
    }

    /// Appends the next bucket.
    pub fn append(&mut self, bucket: &EncodedBucket, ties_left: u64) -> Result<(), DeepError> {
        let EncodedBucket { leaves, segments, light, tiles, tile_words } = bucket;
        for (file, words) in self.leaves.iter_mut().zip(&leaves.words) {
            file.append(bytemuck::cast_slice(words))?;
        }
        for (file, words) in self.planes.iter_mut().zip(tile_words) {
            file.append(bytemuck::cast_slice(words))?;
        }
        let record = BucketRecord {
            leaves: segments.concat(),
            tiles: tiles.clone(),
            sums: light.concat(),
            counts: [leaves.repeated, leaves.median_colour, ties_left],
        };
        self.finished.append(&record.to_bytes())?;
        self.records.push(record);
        Ok(())
    }

    /// Numbers of stars that were left out because they equal another star, and of stars that got a median colour.
    pub fn counts(&self) -> [u64; 2] {
        [0, 1].map(|count| self.records.iter().map(|record| record.counts[count]).sum())
    }

    /// The tables of the finished store.
    ///
    /// # Errors
    /// Buckets are missing.
    pub fn tables(&self) -> Result<Tables, DeepError> {
        if self.finished() != BUCKETS {
            let problem = format!("{} of {BUCKETS} cells are finished", self.records.len());
            return Err(DeepError::damaged(&self.finished.path, problem));
        }
        // A layer or plane without stars has no table.
        let used = |list: Vec<Segment>| if list.iter().all(|segment| segment.count == 0) { Vec::new() } else { list };
        let leaves = (0..LAYERS.len())
            .map(|layer| used(self.records.iter().flat_map(|r| r.leaves_by_layer()[layer]).copied().collect()));
        let tiles = (0..PLANES.len())
            .map(|plane| used(self.records.iter().flat_map(|r| r.tiles_by_plane()[plane]).copied().collect()));
        let sums = (0..LAYERS.len()).map(|layer| {
            self.records.iter().flat_map(|record| &record.sums[4 * layer..4 * layer + 4]).copied().collect()
        });
        Ok(Tables { leaves: leaves.collect(), sums: sums.collect(), tiles: tiles.collect() })
    }
}

/// Reads the records up to the first incomplete one.
fn read_records(path: &Path) -> Result<Vec<BucketRecord>, DeepError> {
    let mut bytes = Vec::new();
    match File::open(path) {
        Ok(file) => file.take(BUCKETS * record_bytes() as u64).read_to_end(&mut bytes).map_err(DeepError::io(path))?,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(Vec::new()),
        Err(error) => return Err(DeepError::io(path)(error)),
    };
    Ok(bytes.chunks(record_bytes()).map_while(BucketRecord::from_bytes).collect())
}
