//! The single-file store: a chunked star set, ready to be drawn.
//!
//! Layout, little-endian: a header of 64 bytes ([`Header`]), a description in UTF-8 (padded with zeros to a multiple of 16 bytes), the table of
//! chunks ([`StoredChunk`], 112 bytes each), the stars ([`PackedStar`], 16 bytes each), the velocities of the stars that move ([`StoredVelocity`], 16
//! bytes each), and the names in UTF-8: one line for each named star with its index, its proper name and its designations, separated by tabs. Version
//! 1, which can still be read, has neither velocities nor names. Positions are at J2000.0. A CRC-32 (as in PNG and zlib) covers everything from the
//! version to the end. The file is written next to its destination and renamed, so that a reader never sees an incomplete file. Lengths in the header
//! are compared with the file's length before anything is allocated.

use std::io::{self, BufWriter, Read, Write};
use std::path::{Path, PathBuf};

use bytemuck::{Pod, Zeroable};
use glam::DVec3;

use super::StarRecord;
use super::chunks::{Chunk, StarSet};
use super::motion::StarVelocity;
use super::names::{NamedStar, NamesOfStar, StarNames};
use super::packed::{PackedStar, temperature_of_step_k};
use crate::files;
use crate::units::magnitude_from_illuminance_lx;

const _: () = assert!(cfg!(target_endian = "little"), "stores are little-endian and read without conversion");

/// First bytes of every store.
pub const MAGIC: [u8; 8] = *b"STERSTAR";
/// Version of the layout that is written; older versions can also be read.
pub const VERSION: u32 = 2;
/// Longest description, bytes.
const LONGEST_DESCRIPTION: usize = 1 << 16;

/// Errors from writing or reading a store.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StoreError {
    /// An I/O error.
    #[error("{}: {source}", path.display())]
    Io {
        /// The store.
        path: PathBuf,
        /// The system's error.
        source: io::Error,
    },
    /// The file is not a store.
    #[error("{}: not a star store (it does not begin with {:?}); `steradian catalogue import` makes one from a catalogue", path.display(), "STERSTAR")]
    NotAStore {
        /// The file.
        path: PathBuf,
    },
    /// The store has another version.
    #[error("{}: store version {found}; this program reads versions 1 to {VERSION}; import the catalogue again", path.display())]
    Version {
        /// The file.
        path: PathBuf,
        /// Its version.
        found: u32,
    },
    /// The file is damaged.
    #[error("{}: damaged store: {problem}", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// Description of the damage.
        problem: String,
    },
}

/// The first 64 bytes.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Header {
    magic: [u8; 8],
    crc32: u32,
    version: u32,
    chunk_count: u64,
    star_count: u64,
    description_bytes: u64,
    velocity_count: u64,
    names_bytes: u64,
    reserved: [u8; 8],
}

/// A [`StarVelocity`] as stored in the file.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct StoredVelocity {
    star: u32,
    velocity: [f32; 3],
}

/// A [`Chunk`] as stored in the file.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct StoredChunk {
    first: u32,
    count: u32,
    at_infinity: u32,
    reserved: u32,
    origin_pc: [f64; 3],
    radius_pc: f64,
    axis: [f64; 3],
    half_angle_rad: f64,
    nearest_pc: f64,
    faintest_lx: f64,
    brightest_lx: f64,
    total_lx: f64,
}

impl From<&Chunk> for StoredChunk {
    fn from(chunk: &Chunk) -> Self {
        Self {
            first: chunk.first,
            count: chunk.count,
            at_infinity: u32::from(chunk.at_infinity),
            reserved: 0,
            origin_pc: chunk.origin_pc.to_array(),
            radius_pc: chunk.radius_pc,
            axis: chunk.axis.to_array(),
            half_angle_rad: chunk.half_angle_rad,
            nearest_pc: chunk.nearest_pc,
            faintest_lx: chunk.faintest_lx,
            brightest_lx: chunk.brightest_lx,
            total_lx: chunk.total_lx,
        }
    }
}

impl From<&StoredChunk> for Chunk {
    fn from(stored: &StoredChunk) -> Self {
        Self {
            first: stored.first,
            count: stored.count,
            at_infinity: stored.at_infinity != 0,
            origin_pc: DVec3::from_array(stored.origin_pc),
            radius_pc: stored.radius_pc,
            axis: DVec3::from_array(stored.axis),
            half_angle_rad: stored.half_angle_rad,
            nearest_pc: stored.nearest_pc,
            faintest_lx: stored.faintest_lx,
            brightest_lx: stored.brightest_lx,
            total_lx: stored.total_lx,
        }
    }
}

/// A store in memory.
#[derive(Clone, Debug, Default)]
pub struct Store {
    /// Human-readable description of the source of the stars.
    pub description: String,
    /// The stars at J2000.0.
    pub stars: StarSet,
    /// Velocities of the stars that move; indices are those of `stars.stars`.
    pub velocities: Vec<StarVelocity>,
    /// Names of stars.
    pub names: Vec<NamesOfStar>,
}

impl Store {
    /// Creates a store from records at J2000.0. Velocities and names refer to the indices of the records.
    pub fn from_records(
        description: String,
        records: Vec<StarRecord>,
        mut velocities: Vec<StarVelocity>,
        mut names: Vec<NamesOfStar>,
    ) -> Self {
        let (stars, order) = StarSet::from_records_with_order(records);
        let mut place = vec![0_u32; order.len()];
        for (index, record) in order.into_iter().enumerate() {
            place[record as usize] = index as u32;
        }
        velocities.iter_mut().for_each(|velocity| velocity.star = place[velocity.star as usize]);
        velocities.sort_unstable_by_key(|velocity| velocity.star);
        names.iter_mut().for_each(|names| names.star = place[names.star as usize]);
        names.sort_unstable_by_key(|names| names.star);
        Self { description, stars, velocities, names }
    }

    /// Returns the stars in the order of the store at their positions `years` Julian years after J2000.0. Light and colour are those of
    /// [`records_of`].
    pub fn records(&self, years: f64) -> Vec<StarRecord> {
        let mut records = records_of(&self.stars);
        for velocity in &self.velocities {
            velocity.apply(&mut records[velocity.star as usize], years);
        }
        records
    }

    /// Returns the named stars among `records`, which must be in the order of the store.
    pub fn named(&self, records: &[StarRecord]) -> Vec<NamedStar> {
        self.names.iter().map(|of| NamedStar::from_file(of.names.clone(), records[of.star as usize])).collect()
    }
}

/// Returns the velocities and names of the stars for which `keep` is true. Their indices then refer to the stars that are kept.
pub fn kept(
    keep: &[bool],
    velocities: &[StarVelocity],
    names: Vec<NamesOfStar>,
) -> (Vec<StarVelocity>, Vec<NamesOfStar>) {
    let mut next = 0;
    let places: Vec<Option<u32>> = keep
        .iter()
        .map(|keep| {
            next += u32::from(*keep);
            keep.then(|| next - 1)
        })
        .collect();
    let place = |star: u32| places[star as usize];
    let velocities = velocities.iter().filter_map(|v| Some(StarVelocity { star: place(v.star)?, ..*v })).collect();
    let names = names.into_iter().filter_map(|of| Some(NamesOfStar { star: place(of.star)?, ..of })).collect();
    (velocities, names)
}

/// Writes names as lines of text; tabs and line breaks in names become blanks.
fn lines_of_names(names: &[NamesOfStar]) -> Vec<u8> {
    let mut text = String::new();
    for NamesOfStar { star, names } in names {
        text.push_str(&star.to_string());
        for name in [&names.name].into_iter().chain(&names.designations) {
            text.push('\t');
            text.extend(name.chars().map(|c| if c.is_control() { ' ' } else { c }));
        }
        text.push('\n');
    }
    text.into_bytes()
}

/// Inverse of [`lines_of_names`]; the error describes the damage.
fn names_of_lines(text: &[u8], stars: usize) -> Result<Vec<NamesOfStar>, String> {
    let text = std::str::from_utf8(text).map_err(|_| "its names are not UTF-8".to_owned())?;
    let entry = |line: &str| {
        let mut fields = line.split('\t');
        let star = fields.next()?.parse().ok().filter(|star: &u32| (*star as usize) < stars)?;
        let name = fields.next()?.to_owned();
        Some(NamesOfStar { star, names: StarNames { name, designations: fields.map(str::to_owned).collect() } })
    };
    text.lines().map(|line| entry(line).ok_or_else(|| "a line of its names is not valid".to_owned())).collect()
}

/// Returns whether the file begins with the magic bytes of a store; false for a file shorter than those.
pub fn is_store(path: &Path) -> Result<bool, StoreError> {
    let io_error = |source| StoreError::Io { path: path.to_owned(), source };
    let mut start = Vec::with_capacity(MAGIC.len());
    let file = files::open_regular(path).map_err(io_error)?;
    file.take(MAGIC.len() as u64).read_to_end(&mut start).map_err(io_error)?;
    Ok(start == MAGIC)
}

/// Writes a store; an existing file is replaced as a whole or not at all.
pub fn write(path: &Path, store: &Store) -> Result<(), StoreError> {
    let io_error = |source| StoreError::Io { path: path.to_owned(), source };
    let mut description = store.description.clone().into_bytes();
    if description.len() > LONGEST_DESCRIPTION {
        let problem =
            format!("its description has {} bytes but must have at most {LONGEST_DESCRIPTION}", description.len());
        return Err(StoreError::Damaged { path: path.to_owned(), problem });
    }
    let names = lines_of_names(&store.names);
    let mut header = Header {
        magic: MAGIC,
        crc32: 0,
        version: VERSION,
        chunk_count: store.stars.chunks.len() as u64,
        star_count: store.stars.stars.len() as u64,
        description_bytes: description.len() as u64,
        velocity_count: store.velocities.len() as u64,
        names_bytes: names.len() as u64,
        reserved: [0; 8],
    };
    description.resize(description.len().next_multiple_of(16), 0);
    let chunks: Vec<StoredChunk> = store.stars.chunks.iter().map(StoredChunk::from).collect();
    let velocities: Vec<StoredVelocity> =
        store.velocities.iter().map(|v| StoredVelocity { star: v.star, velocity: v.velocity }).collect();
    let parts: [&[u8]; 5] = [
        &description,
        bytemuck::cast_slice(&chunks),
        bytemuck::cast_slice(&store.stars.stars),
        bytemuck::cast_slice(&velocities),
        &names,
    ];
    header.crc32 = checksum(&header, parts);

    let mut file = BufWriter::new(files::beside(path).map_err(io_error)?);
    file.write_all(bytemuck::bytes_of(&header)).map_err(io_error)?;
    for part in parts {
        file.write_all(part).map_err(io_error)?;
    }
    let file = file.into_inner().map_err(|error| io_error(error.into_error()))?;
    files::publish(file, path).map_err(io_error)
}

fn checksum(header: &Header, parts: [&[u8]; 5]) -> u32 {
    let mut hasher = crc32fast::Hasher::new();
    hasher.update(&bytemuck::bytes_of(header)[12..]);
    for part in parts {
        hasher.update(part);
    }
    hasher.finalize()
}

/// Contents of a header, for reports.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StoreHeader {
    /// Version of the layout of the file.
    pub version: u32,
    /// Number of stars.
    pub stars: u64,
    /// Number of stars that move.
    pub velocities: u64,
    /// Checksum of the content.
    pub crc32: u32,
}

/// Reads the header of a store; checks only the magic bytes and the version.
///
/// # Errors
/// The file cannot be read, or is not a store of a known version.
pub fn read_header(path: &Path) -> Result<StoreHeader, StoreError> {
    let mut file = files::open_regular(path).map_err(|source| StoreError::Io { path: path.to_owned(), source })?;
    let header = header_of(path, &mut file)?;
    let Header { version, star_count: stars, velocity_count: velocities, crc32, .. } = header;
    Ok(StoreHeader { version, stars, velocities, crc32 })
}

/// Reads the header at the start of a file. In version 1 the counts that later versions added are 0.
fn header_of(path: &Path, file: &mut std::fs::File) -> Result<Header, StoreError> {
    let mut start = Vec::with_capacity(size_of::<Header>());
    let read = file.take(size_of::<Header>() as u64).read_to_end(&mut start);
    read.map_err(|source| StoreError::Io { path: path.to_owned(), source })?;
    if !start.starts_with(&MAGIC) {
        return Err(StoreError::NotAStore { path: path.to_owned() });
    }
    if start.len() < size_of::<Header>() {
        let problem = format!("its {} bytes are too few for a header", start.len());
        return Err(StoreError::Damaged { path: path.to_owned(), problem });
    }
    let header: Header = bytemuck::pod_read_unaligned(&start);
    if !(1..=VERSION).contains(&header.version) {
        return Err(StoreError::Version { path: path.to_owned(), found: header.version });
    }
    if header.version == 1 && (header.velocity_count > 0 || header.names_bytes > 0) {
        let problem = "a store of version 1 has neither velocities nor names".to_owned();
        return Err(StoreError::Damaged { path: path.to_owned(), problem });
    }
    Ok(header)
}

/// Reads a store and checks its magic, version, length and checksum, and that the chunks cover the stars.
pub fn read(path: &Path) -> Result<Store, StoreError> {
    let io_error = |source| StoreError::Io { path: path.to_owned(), source };
    let damaged = |problem: String| StoreError::Damaged { path: path.to_owned(), problem };
    let mut file = files::open_regular(path).map_err(io_error)?;
    let length = file.metadata().map_err(io_error)?.len();
    let header = header_of(path, &mut file)?;

    // The lengths in the header must match the file's length, so that a damaged header cannot cause a huge
    // allocation.
    let description_bytes = header.description_bytes.checked_next_multiple_of(16);
    let expected = description_bytes.and_then(|description| {
        let chunks = header.chunk_count.checked_mul(size_of::<StoredChunk>() as u64)?;
        let stars = header.star_count.checked_mul(size_of::<PackedStar>() as u64)?;
        let velocities = header.velocity_count.checked_mul(size_of::<StoredVelocity>() as u64)?;
        let parts = [description, chunks, stars, velocities, header.names_bytes];
        parts.into_iter().try_fold(size_of::<Header>() as u64, u64::checked_add)
    });
    if expected != Some(length) || header.star_count > u64::from(u32::MAX) {
        return Err(damaged(format!(
            "{length} bytes do not match {} chunks with {} stars, {} velocities and {} bytes of names: truncated or altered",
            header.chunk_count, header.star_count, header.velocity_count, header.names_bytes
        )));
    }
    // Read the contents and compute their checksum.
    let mut description = vec![0; description_bytes.unwrap_or(0) as usize];
    let mut chunks = vec![StoredChunk::zeroed(); header.chunk_count as usize];
    let mut stars = vec![PackedStar::zeroed(); header.star_count as usize];
    file.read_exact(&mut description).map_err(io_error)?;
    file.read_exact(bytemuck::cast_slice_mut(&mut chunks)).map_err(io_error)?;
    file.read_exact(bytemuck::cast_slice_mut(&mut stars)).map_err(io_error)?;
    let mut velocities = vec![StoredVelocity::zeroed(); header.velocity_count as usize];
    let mut names = vec![0; header.names_bytes as usize];
    file.read_exact(bytemuck::cast_slice_mut(&mut velocities)).map_err(io_error)?;
    file.read_exact(&mut names).map_err(io_error)?;
    let parts: [&[u8]; 5] = [
        &description,
        bytemuck::cast_slice(&chunks),
        bytemuck::cast_slice(&stars),
        bytemuck::cast_slice(&velocities),
        &names,
    ];
    let found = checksum(&header, parts);
    if found != header.crc32 {
        return Err(damaged(format!("its checksum is {found:08x}, but its header has {:08x}", header.crc32)));
    }

    // The chunks must cover the stars without gaps.
    description.truncate(header.description_bytes as usize);
    let description = String::from_utf8(description).map_err(|_| damaged("its description is not UTF-8".to_owned()))?;
    let chunks: Vec<Chunk> = chunks.iter().map(Chunk::from).collect();
    let mut next: u32 = 0;
    for (index, chunk) in chunks.iter().enumerate() {
        let end = chunk.first.checked_add(chunk.count);
        match end {
            Some(end) if chunk.first == next && end as usize <= stars.len() => next = end,
            _ => return Err(damaged(format!("chunk {index} does not follow the previous one"))),
        }
    }
    if next as usize != stars.len() {
        return Err(damaged(format!("its chunks cover {next} of {} stars", stars.len())));
    }
    let is_valid =
        |v: &StoredVelocity| (v.star as usize) < stars.len() && v.velocity.iter().all(|axis| axis.is_finite());
    if let Some(index) = velocities.iter().position(|velocity| !is_valid(velocity)) {
        return Err(damaged(format!("velocity {index} does not belong to a star")));
    }
    let velocities = velocities.iter().map(|v| StarVelocity { star: v.star, velocity: v.velocity }).collect();
    let names = names_of_lines(&names, stars.len()).map_err(damaged)?;
    Ok(Store { description, stars: StarSet::new(chunks, stars), velocities, names })
}

/// Converts the stars of a set back to records, to combine them with other catalogues. Light and colour are those of the packed stars: the
/// illuminance is within 3.1e-5 of the catalogue, the temperature within 0.13 %.
pub fn records_of(set: &StarSet) -> Vec<StarRecord> {
    let mut records = Vec::with_capacity(set.stars.len());
    records.extend(set.iter().map(|(position, at_infinity, star)| {
        let magnitude_at_1_pc = magnitude_from_illuminance_lx(star.illuminance_at_1_pc_lx());
        StarRecord {
            position: if at_infinity { position.normalize_or(DVec3::X) } else { position },
            magnitude: (magnitude_at_1_pc + if at_infinity { 0.0 } else { 5.0 }) as f32,
            temperature_k: temperature_of_step_k(star.temperature_step()) as f32,
            distance_known: !at_infinity,
        }
    }));
    records
}

#[cfg(test)]
mod tests {
    use super::*;

    fn records(count: usize) -> Vec<StarRecord> {
        (0..count)
            .map(|i| {
                let t = i as f64;
                let direction = DVec3::new(t.sin(), (1.7 * t).cos(), (0.3 * t).sin() + 0.1).normalize();
                let distance_known = i % 4 != 0;
                StarRecord {
                    position: if distance_known { direction * (2.0 + t) } else { direction },
                    magnitude: (t * 0.01 - 3.0) as f32,
                    temperature_k: 2500.0 + 10.0 * i as f32,
                    distance_known,
                }
            })
            .collect()
    }

    fn written(folder: &tempfile::TempDir) -> (PathBuf, Store) {
        let path = folder.path().join("set.stars");
        let velocity = |star: u32| StarVelocity { star, velocity: [1e-6 * star as f32, -1e-5, 2e-5] };
        let names = |star: u32| {
            let designations = vec![format!("HIP {star}"), "öäü".to_owned()];
            NamesOfStar {
                star,
                names: StarNames { name: if star == 7 { "Seven\tof 9" } else { "" }.to_owned(), designations },
            }
        };
        let velocities = (0..3000).step_by(7).map(velocity).collect();
        let names = (0..3000).step_by(501).chain([7]).map(names).collect();
        let store = Store::from_records("a spiral, öäü".to_owned(), records(3000), velocities, names);
        write(&path, &store).unwrap();
        (path, store)
    }

    /// Changes a file without damaging its checksum.
    fn altered(path: &Path, change: impl FnOnce(&mut Vec<u8>)) {
        let mut bytes = std::fs::read(path).unwrap();
        change(&mut bytes);
        let sum = crc32fast::hash(&bytes[12..]);
        bytes[8..12].copy_from_slice(&sum.to_le_bytes());
        std::fs::write(path, bytes).unwrap();
    }

    #[test]
    fn velocities_and_names_stay_with_their_stars() {
        let folder = tempfile::tempdir().unwrap();
        let store = read(&written(&folder).0).unwrap();
        let originals = records(3000);
        let now = store.records(0.0);
        let named = store.named(&now);
        assert_eq!(named.len(), 7);
        for star in &named {
            let number: usize = star.designation.trim_start_matches("HIP ").parse().unwrap();
            let original = originals[number].position;
            assert!((star.star.position - original).length() < 1e-6 * original.length(), "{star:?}");
            assert_eq!(star.name, if number == 7 { "Seven of 9" } else { "" });
            assert_eq!(star.others, ["öäü"]);
        }
        let later = store.records(1000.0);
        let moved: Vec<usize> = (0..3000).filter(|&i| now[i].position != later[i].position).collect();
        assert_eq!(moved.len(), 429);
        for (number, original) in originals.iter().enumerate().step_by(7 * 25) {
            let place = original.position + DVec3::new(1e-3 * number as f64, -1e-2, 2e-2);
            let expected = if original.distance_known { place } else { place.normalize() };
            let nearest = later.iter().map(|star| (star.position - expected).length()).fold(f64::INFINITY, f64::min);
            assert!(nearest < 1e-6 * expected.length(), "{number}: {nearest}");
        }
    }

    #[test]
    fn version_1_is_read_and_unknown_versions_are_not() {
        let folder = tempfile::tempdir().unwrap();
        let (path, store) = written(&folder);
        let versions = || read_header(&path).map(|header| (header.version, header.stars, header.velocities)).unwrap();
        assert_eq!(versions(), (2, 3000, 429));
        let end = 64 + 16 + 112 * store.stars.chunks.len() + 16 * 3000;
        altered(&path, |bytes| {
            bytes[12] = 1;
            bytes[40..56].fill(0);
            bytes.truncate(end);
        });
        let old = read(&path).unwrap();
        assert_eq!((old.stars.stars, old.velocities.len(), old.names.len()), (store.stars.stars, 0, 0));
        assert_eq!(versions(), (1, 3000, 0));
        for counts in [1u128 << 64, 1, u128::MAX] {
            altered(&path, |bytes| bytes[40..56].copy_from_slice(&counts.to_le_bytes()));
            assert!(read(&path).unwrap_err().to_string().contains("neither velocities nor names"));
        }
        for version in [0, 3] {
            altered(&path, |bytes| bytes[12] = version);
            assert!(read(&path).unwrap_err().to_string().contains("reads versions 1 to 2"));
        }
    }

    #[test]
    fn velocities_and_names_of_missing_stars_are_damage() {
        let folder = tempfile::tempdir().unwrap();
        let (path, store) = written(&folder);
        let whole = std::fs::read(&path).unwrap();
        let velocities = 64 + 16 + 112 * store.stars.chunks.len() + 16 * 3000;
        let names = velocities + 16 * store.velocities.len();
        for (place, with, part) in [
            (velocities, &[0xff, 0xff, 0, 0][..], "velocity 0 does not belong to a star"),
            (velocities + 4, &f32::NAN.to_le_bytes(), "velocity 0 does not belong to a star"),
            (names, b"99999", "a line of its names"),
            (names, b"\xff", "not UTF-8"),
        ] {
            std::fs::write(&path, &whole).unwrap();
            altered(&path, |bytes| bytes[place..place + with.len()].copy_from_slice(with));
            let error = read(&path).unwrap_err().to_string();
            assert!(error.contains(part), "{error}");
        }
    }

    #[test]
    fn a_store_is_read_as_it_was_written() {
        let folder = tempfile::tempdir().unwrap();
        let (path, store) = written(&folder);
        let back = read(&path).unwrap();
        assert_eq!(back.description, store.description);
        assert_eq!(back.stars.chunks, store.stars.chunks);
        assert_eq!(back.stars.stars, store.stars.stars);
        assert!(is_store(&path).unwrap());
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "no temporary file is left");
    }

    #[test]
    fn an_empty_set_can_be_stored() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("none.stars");
        write(&path, &Store::default()).unwrap();
        assert!(read(&path).unwrap().stars.stars.is_empty());
    }

    #[test]
    fn every_truncation_and_every_altered_byte_is_detected() {
        let folder = tempfile::tempdir().unwrap();
        let (path, _) = written(&folder);
        let whole = std::fs::read(&path).unwrap();
        for length in [0, 7, 8, 63, 64, 90, whole.len() / 2, whole.len() - 1] {
            std::fs::write(&path, &whole[..length]).unwrap();
            let error = read(&path).unwrap_err();
            let expected = matches!(error, StoreError::NotAStore { .. }) == (length < 8);
            assert!(expected, "{length}: {error}");
        }
        std::fs::write(&path, [&whole[..], b"x"].concat()).unwrap();
        assert!(matches!(read(&path), Err(StoreError::Damaged { .. })));
        // The changed bytes are in the header, the description, the chunk table and the stars.
        for index in (0..200).chain((200..whole.len()).step_by(997)) {
            let mut bytes = whole.clone();
            bytes[index] ^= 0x10;
            std::fs::write(&path, &bytes).unwrap();
            assert!(read(&path).is_err(), "byte {index}");
        }
    }

    #[test]
    fn absurd_counts_allocate_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let (path, _) = written(&folder);
        let mut bytes = std::fs::read(&path).unwrap();
        bytes[16..56].fill(0xff);
        std::fs::write(&path, &bytes).unwrap();
        assert!(matches!(read(&path), Err(StoreError::Damaged { .. })));
    }

    #[test]
    fn records_come_back_within_the_precision_of_the_packed_star() {
        let original = StarSet::from_records(records(3000));
        let again = StarSet::from_records(records_of(&original));
        assert_eq!(again.stars.len(), 3000);
        let sum = |set: &StarSet| set.stars.iter().map(PackedStar::illuminance_at_1_pc_lx).sum::<f64>();
        assert!((sum(&again) / sum(&original) - 1.0).abs() < 1e-5);
        let infinite = |set: &StarSet| set.chunks.iter().filter(|c| c.at_infinity).map(|c| c.count).sum::<u32>();
        assert_eq!(infinite(&again), infinite(&original));
        let furthest = original
            .iter()
            .map(|(p, _, _)| again.iter().map(|(q, _, _)| (p - q).length()).fold(f64::INFINITY, f64::min) / p.length())
            .step_by(50)
            .fold(0.0, f64::max);
        assert!(furthest < 1e-6, "{furthest}");
    }
}
