//! The file `index` of a deep store: the tables of its other files, with their checksums.
//!
//! Layout, little-endian: a header of 128 bytes ([`Header`]), the description in UTF-8 (padded with zeros to a multiple of 8 bytes), an entry for
//! each layer and each plane ([`PartEntry`], 24 bytes), the sums of light (for each layer with stars three f64 numbers for each cell of order 5),
//! then a [`Segment`] (8 bytes) for each leaf of the layers that have stars, and for each tile of the planes that have stars.
//!
//! The segments of a file are in the order of their cells, without gaps. Their offsets are sums of counts, so that leaves cannot overlap. The root
//! checksum is the SHA-256 of the index with zeros in place of the root checksum. It covers the index and, through the checksums in the index, the
//! whole store.

use std::path::Path;

use bytemuck::{Pod, Zeroable};
use sha2::{Digest, Sha256};

use super::cell_range::CellRange;
use super::cells::cell_count;
use super::error::DeepError;
use super::tile::{tile_order, words_of_bits, words_of_tile};
use super::{COARSEST_PLANE, LAYERS, Layer, PLANES, Plane, SUM_ORDER};

/// First bytes of an index.
pub const MAGIC: [u8; 8] = *b"STERDEEP";
/// Current version of stores. Versions 1 and 2 also have planes of order 6, which are not read. Version 1 has no parts, and its planes carry the
/// remainder of rounding across all cells.
pub const VERSION: u32 = 3;
/// Order of the coarsest planes of versions 1 and 2.
const COARSEST_BEFORE: u8 = 6;
/// Name of the file.
pub const NAME: &str = "index";
/// Longest description, bytes.
const LONGEST_DESCRIPTION: u64 = 1 << 20;
/// Byte range of the root checksum.
const ROOT: std::ops::Range<usize> = 16..48;

#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Header {
    magic: [u8; 8],
    version: u32,
    layers: u32,
    root: [u8; 32],
    epoch_year: f64,
    description_bytes: u64,
    bright_bytes: u64,
    bright_stars: u64,
    bright_crc32: u32,
    planes: u32,
    /// First cell and end of the range of a part; 0 and 0 for a whole store.
    cells: [u32; 2],
    /// SHA-256 of the record of a part.
    part: [u8; 32],
}

/// Entry of a layer or plane.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct PartEntry {
    magnitude: u32,
    order: u32,
    /// Number of stars, or of composite stars.
    stars: u64,
    /// Number of segments: 0 if there are no stars.
    segments: u64,
}

/// A leaf or a tile.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct Segment {
    /// Number of stars or composite stars.
    pub count: u32,
    /// CRC-32 of its bytes; 0 if it has none.
    pub crc32: u32,
}

impl Segment {
    /// Creates the segment of these words.
    pub fn new(count: u32, words: &[u64]) -> Self {
        Self { count, crc32: crc32fast::hash(bytemuck::cast_slice(words)) }
    }
}

/// The segments of one file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Segments {
    /// The segments in the order of their cells; empty if none has a star.
    pub list: Vec<Segment>,
    /// First word of each segment, and the end of the last.
    first: Vec<u64>,
}

impl Segments {
    /// `words` returns the number of words of a segment from its number of stars.
    fn new(list: Vec<Segment>, words: impl Fn(u32) -> u64) -> Option<Self> {
        let mut first = Vec::with_capacity(list.len() + 1);
        let mut next = 0_u64;
        for segment in &list {
            first.push(next);
            next = next.checked_add(words(segment.count))?;
        }
        first.push(next);
        Some(Self { list, first })
    }

    /// First word and number of words of a segment.
    pub fn range(&self, segment: usize) -> (u64, u64) {
        (self.first[segment], self.first[segment + 1] - self.first[segment])
    }

    /// Length of the file, bytes.
    pub fn bytes(&self) -> u64 {
        8 * self.first.last().copied().unwrap_or(0)
    }

    /// Number of stars in all segments.
    pub fn stars(&self) -> u64 {
        self.list.iter().map(|segment| u64::from(segment.count)).sum()
    }
}

/// The file `bright`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct BrightFile {
    /// Length, bytes.
    pub bytes: u64,
    /// Number of stars.
    pub stars: u64,
    /// The CRC-32 in its header, which is that of its content.
    pub crc32: u32,
}

/// The entry of a part of a store ([`part`](super::part)).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PartOfIndex {
    /// Its cells.
    pub cells: CellRange,
    /// SHA-256 of its record.
    pub sha256: [u8; 32],
}

/// Contents of an index.
#[derive(Clone, Debug, PartialEq)]
pub struct Index {
    /// Version of the store, 1 to [`VERSION`].
    pub version: u32,
    /// Epoch of the positions in leaves and planes, Julian year. The positions in `bright` are at J2000.0.
    pub epoch_year: f64,
    /// Human-readable description of the source of the stars.
    pub description: String,
    /// Cells and record of a part; `None` for a whole store.
    pub part: Option<PartOfIndex>,
    /// The bright stars.
    pub bright: BrightFile,
    /// Leaves of each layer, in the order of [`LAYERS`].
    pub leaves: Vec<Segments>,
    /// Light of each layer in each cell of order [`SUM_ORDER`]: illuminance at the barycentre per channel, linear Rec. 709, lx.
    /// Empty for a layer without stars.
    pub sums: Vec<Vec<[f64; 3]>>,
    /// Tiles of each plane, in the order of [`PLANES`].
    pub tiles: Vec<Segments>,
}

impl Index {
    /// Creates the index of a whole store. Segments of leaves and tiles must have the lengths of [`LAYERS`] and [`PLANES`], or be empty. Returns
    /// `None` if the counts overflow.
    pub fn new(
        (epoch_year, description): (f64, String),
        bright: BrightFile,
        leaves: Vec<Vec<Segment>>,
        mut sums: Vec<Vec<[f64; 3]>>,
        tiles: Vec<Vec<Segment>>,
    ) -> Option<Self> {
        // A layer without stars has no sums.
        sums.iter_mut().zip(&leaves).filter(|(_, leaves)| leaves.is_empty()).for_each(|(sums, _)| sums.clear());
        let leaves = leaves.into_iter().map(|list| Segments::new(list, u64::from)).collect::<Option<_>>()?;
        let tiles = tiles.into_iter().zip(PLANES);
        let tiles = tiles.map(|(list, plane)| Segments::new(list, |count| words_of_tile(plane.order, count)));
        let tiles = tiles.collect::<Option<_>>()?;
        Some(Self { version: VERSION, epoch_year, description, part: None, bright, leaves, sums, tiles })
    }

    /// Number of stars in `bright` and in all leaves.
    pub fn stars(&self) -> u64 {
        self.bright.stars + self.leaves.iter().map(Segments::stars).sum::<u64>()
    }

    /// Returns the bytes of the file, and the root checksum that they contain.
    pub fn to_bytes(&self) -> (Vec<u8>, [u8; 32]) {
        let mut description = self.description.clone().into_bytes();
        let header = Header {
            magic: MAGIC,
            version: self.version,
            layers: LAYERS.len() as u32,
            root: [0; 32],
            epoch_year: self.epoch_year,
            description_bytes: description.len() as u64,
            bright_bytes: self.bright.bytes,
            bright_stars: self.bright.stars,
            bright_crc32: self.bright.crc32,
            planes: planes_of(self.version).len() as u32,
            cells: self.part.map_or([0; 2], |part| [part.cells.first(), part.cells.end()].map(|cell| cell as u32)),
            part: self.part.map_or([0; 32], |part| part.sha256),
        };
        description.resize(description.len().next_multiple_of(8), 0);
        let entry = |magnitude: u8, order: u8, segments: &Segments| PartEntry {
            magnitude: u32::from(magnitude),
            order: u32::from(order),
            stars: segments.stars(),
            segments: segments.list.len() as u64,
        };
        let layers = LAYERS.iter().zip(&self.leaves).map(|(layer, leaves)| entry(layer.magnitude, layer.order, leaves));
        let unread = Segments::default();
        let planes = planes_of(self.version).into_iter().map(|(Plane { magnitude, order }, index)| {
            entry(magnitude, order, index.map_or(&unread, |index| &self.tiles[index]))
        });
        let entries: Vec<PartEntry> = layers.chain(planes).collect();

        let mut bytes = bytemuck::bytes_of(&header).to_vec();
        bytes.extend(description);
        bytes.extend_from_slice(bytemuck::cast_slice(&entries));
        self.sums.iter().for_each(|sums| bytes.extend_from_slice(bytemuck::cast_slice(sums)));
        for segments in self.leaves.iter().chain(&self.tiles) {
            bytes.extend_from_slice(bytemuck::cast_slice(&segments.list));
        }
        let root = root_of(&bytes);
        bytes[ROOT].copy_from_slice(&root);
        (bytes, root)
    }

    /// Reads an index and its root checksum; `path` is its name in error messages.
    ///
    /// # Errors
    /// The bytes are not an index of this version, or they are damaged.
    pub fn from_bytes(path: &Path, bytes: &[u8]) -> Result<(Self, [u8; 32]), DeepError> {
        let damaged = |problem: &str| DeepError::damaged(path, problem);
        if !bytes.starts_with(&MAGIC) {
            return Err(DeepError::NotAStore { path: path.parent().unwrap_or(path).to_owned() });
        }
        let Some((header, rest)) = bytes.split_at_checked(size_of::<Header>()) else {
            return Err(damaged("it is shorter than a header"));
        };
        let header: Header = bytemuck::pod_read_unaligned(header);
        if !(1..=VERSION).contains(&header.version) {
            return Err(DeepError::Version { path: path.to_owned(), found: header.version });
        }
        let root = root_of(bytes);
        if root != header.root {
            return Err(damaged("its root checksum does not match its content"));
        }
        let planes = planes_of(header.version);
        if (header.layers as usize, header.planes as usize) != (LAYERS.len(), planes.len()) {
            return Err(damaged("its number of layers or planes is not that of its version"));
        }
        if header.description_bytes > LONGEST_DESCRIPTION || !header.epoch_year.is_finite() {
            return Err(damaged("its description or epoch is not valid"));
        }
        let part = match header.cells.map(u64::from) {
            [0, 0] if header.part == [0; 32] => None,
            [first, end] => {
                let cells = CellRange::new(first, end).ok_or_else(|| damaged("its range of cells is not valid"))?;
                Some(PartOfIndex { cells, sha256: header.part })
            }
        };
        // Everything is taken from `bytes`, so that no count can cause a larger allocation.
        let mut parts = Parts { rest };
        let description = parts.take(header.description_bytes.next_multiple_of(8));
        let description = description.and_then(|text| text.get(..header.description_bytes as usize));
        let description = description.and_then(|text| String::from_utf8(text.to_vec()).ok());
        let description = description.ok_or_else(|| damaged("its description is not UTF-8"))?;
        let short = || damaged("it is shorter than its tables");
        let entries: Vec<PartEntry> = parts.list((LAYERS.len() + planes.len()) as u64).ok_or_else(short)?;
        let sums_of = |entry: &PartEntry| if entry.segments == 0 { 0 } else { cell_count(SUM_ORDER) };
        let layers = entries.iter().take(LAYERS.len());
        let sums: Option<Vec<Vec<[f64; 3]>>> = layers.map(|entry| parts.list(sums_of(entry))).collect();
        let sums = sums.ok_or_else(short)?;
        let expected = LAYERS.iter().map(|&Layer { magnitude, order }| (magnitude, order, cell_count(order))).chain(
            planes.iter().map(|&(Plane { magnitude, order }, _)| (magnitude, order, cell_count(tile_order(order)))),
        );
        let mut lists = Vec::with_capacity(entries.len());
        for (entry, (magnitude, order, segments)) in entries.iter().zip(expected) {
            let is_known = (entry.magnitude, entry.order) == (u32::from(magnitude), u32::from(order));
            if !is_known || ![0, segments].contains(&entry.segments) {
                return Err(damaged("a layer or plane does not exist in this version"));
            }
            let list: Vec<Segment> = parts.list(entry.segments).ok_or_else(short)?;
            if list.iter().map(|segment| u64::from(segment.count)).sum::<u64>() != entry.stars {
                return Err(damaged("the counts of a layer or plane do not add up to its number of stars"));
            }
            lists.push(list);
        }
        if !parts.rest.is_empty() {
            return Err(damaged("it is longer than its tables"));
        }
        let tiles = lists.split_off(LAYERS.len()).into_iter().zip(&planes);
        let tiles = tiles.filter(|(_, (_, index))| index.is_some()).map(|(list, _)| list).collect();
        let bright = BrightFile { bytes: header.bright_bytes, stars: header.bright_stars, crc32: header.bright_crc32 };
        let index = Self::new((header.epoch_year, description), bright, lists, sums, tiles);
        let index = index.ok_or_else(|| damaged("its counts overflow"))?;
        Ok((Self { part, version: header.version, ..index }, root))
    }

    /// Largest length of an index, bytes.
    pub fn most_bytes() -> u64 {
        let leaves: u64 = LAYERS.iter().map(|layer| cell_count(layer.order)).sum();
        let planes = planes_of(1);
        let tiles: u64 = planes.iter().map(|(plane, _)| cell_count(tile_order(plane.order))).sum();
        let entries = size_of::<PartEntry>() as u64 * (LAYERS.len() + planes.len()) as u64;
        let sums = 24 * cell_count(SUM_ORDER) * LAYERS.len() as u64;
        size_of::<Header>() as u64 + LONGEST_DESCRIPTION + entries + sums + 8 * (leaves + tiles)
    }
}

/// Returns the planes of a version in the order of its index, each with its index in [`PLANES`]; `None` if it is not read.
fn planes_of(version: u32) -> Vec<(Plane, Option<usize>)> {
    let mut planes = Vec::new();
    for (index, plane) in PLANES.into_iter().enumerate() {
        planes.push((plane, Some(index)));
        if plane.order == COARSEST_PLANE && version < 3 {
            planes.push((Plane { order: COARSEST_BEFORE, ..plane }, None));
        }
    }
    planes
}

/// SHA-256 of the bytes of an index with zeros in place of the root checksum.
pub fn root_of(bytes: &[u8]) -> [u8; 32] {
    let mut hash = Sha256::new();
    hash.update(&bytes[..ROOT.start]);
    hash.update([0; 32]);
    hash.update(&bytes[ROOT.end..]);
    hash.finalize().into()
}

/// Bytes that have not been read yet.
struct Parts<'a> {
    rest: &'a [u8],
}

impl<'a> Parts<'a> {
    fn take(&mut self, bytes: u64) -> Option<&'a [u8]> {
        let (taken, rest) = self.rest.split_at_checked(usize::try_from(bytes).ok()?)?;
        self.rest = rest;
        Some(taken)
    }

    fn list<T: Pod>(&mut self, count: u64) -> Option<Vec<T>> {
        let bytes = self.take(count.checked_mul(size_of::<T>() as u64)?)?;
        let mut list = vec![T::zeroed(); count as usize];
        bytemuck::cast_slice_mut(&mut list).copy_from_slice(bytes);
        Some(list)
    }
}

const _: () = assert!(words_of_bits(12) == 64 && size_of::<Header>() == 128);

#[cfg(test)]
mod tests {
    use super::*;

    fn index() -> Index {
        let mut leaves = vec![Vec::new(); LAYERS.len()];
        leaves[0] = (0..cell_count(6) as u32).map(|cell| Segment { count: cell % 3, crc32: cell }).collect();
        let mut tiles = vec![Vec::new(); PLANES.len()];
        tiles[3] = (0..cell_count(tile_order(7)) as u32).map(|cell| Segment { count: cell % 2, crc32: cell }).collect();
        let sums = vec![vec![[0.25, 0.5, 1.0]; cell_count(5) as usize], Vec::new(), Vec::new()];
        let bright = BrightFile { bytes: 1000, stars: 12, crc32: 7 };
        Index::new((2016.0, "a test, öäü".to_owned()), bright, leaves, sums, tiles).expect("small counts")
    }

    #[test]
    fn an_index_is_read_as_it_was_written() {
        let index = index();
        let part = PartOfIndex { cells: CellRange::new(5, 3072).expect("a range"), sha256: [9; 32] };
        let of_part = Index { part: Some(part), ..index.clone() };
        let (found, _) = Index::from_bytes(Path::new("s/index"), &of_part.to_bytes().0).expect("a valid index");
        assert!(found == of_part && found != index);
        let (bytes, root) = index.to_bytes();
        assert!(bytes.len() as u64 <= Index::most_bytes());
        let (found, found_root) = Index::from_bytes(Path::new("s/index"), &bytes).expect("a valid index");
        assert!(found == index && found_root == root);
        assert_eq!(found.stars(), 12 + cell_count(6));
        assert_eq!(found.leaves[0].range(5), (1 + 2 + 1, 2));
        assert_eq!(found.leaves[0].bytes(), 8 * cell_count(6));
        assert_eq!(found.leaves[1].bytes(), 0);
        // Order 7 has one word of bits in a tile.
        assert_eq!(found.tiles[3].range(1), (0, 2));
        assert_eq!(found.tiles[3].bytes(), 8 * cell_count(tile_order(7)));
    }

    #[test]
    fn every_kind_of_damage_is_an_error() {
        let (whole, _) = index().to_bytes();
        let read = |bytes: &[u8]| Index::from_bytes(Path::new("s/index"), bytes).map(|_| ()).unwrap_err().to_string();
        for length in [0, 7, 8, 90, 128, 140, whole.len() / 2, whole.len() - 1] {
            read(&whole[..length]);
        }
        for place in (0..300).chain((300..whole.len()).step_by(7919)) {
            let mut bytes = whole.clone();
            bytes[place] ^= 4;
            read(&bytes);
        }
        // Damage with a correct checksum: wrong counts, orders and text.
        let altered = |change: &dyn Fn(&mut Vec<u8>)| {
            let mut bytes = whole.clone();
            change(&mut bytes);
            let root = root_of(&bytes);
            bytes[ROOT].copy_from_slice(&root);
            read(&bytes)
        };
        assert!(altered(&|bytes| bytes[12] = 2).contains("number of layers"));
        assert!(altered(&|bytes| bytes[8] = 4).contains("version 4"));
        for version in [1, 2] {
            let earlier = Index { version, ..index() };
            let (bytes, _) = earlier.to_bytes();
            // Earlier versions have the entries of three planes of order 6 in addition.
            assert_eq!(bytes.len(), whole.len() + 3 * size_of::<PartEntry>());
            let (found, _) = Index::from_bytes(Path::new("s/index"), &bytes).expect("an earlier version is read");
            assert!(found == earlier);
        }
        // A range of cells that begins after its end, or a record without cells.
        for (place, value) in [(88, 7), (100, 1)] {
            assert!(altered(&|bytes| bytes[place] = value).contains("range of cells"), "{place}");
        }
        assert!(altered(&|bytes| bytes[56..64].fill(0xff)).contains("description"));
        assert!(altered(&|bytes| bytes[128] = 0xff).contains("UTF-8"));
        assert!(altered(&|bytes| bytes.push(0)).contains("longer"));
        assert!(altered(&|bytes| bytes.truncate(bytes.len() - 8)).contains("shorter"));
        let entries = 128 + "a test, öäü".len().next_multiple_of(8);
        assert!(altered(&|bytes| bytes[entries] = 14).contains("not exist in this version"));
        assert!(altered(&|bytes| bytes[entries + 16..entries + 24].fill(0xff)).contains("not exist in this version"));
        assert!(altered(&|bytes| bytes[entries + 8] ^= 1).contains("number of stars"));
    }
}
