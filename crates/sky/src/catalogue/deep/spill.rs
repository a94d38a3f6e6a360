//! Stores stars on disk between the two passes of an import. There is one file for each cell of order 4; stars are appended to it in blocks.
//!
//! A [`SpillState`] contains the lengths and checksums of all files at one time. A program that continues the import truncates the files to these
//! lengths.

use std::fs::{self, File, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};

use bytemuck::Zeroable;

use super::BUCKETS;
use super::bucket::BucketStar;
use super::error::DeepError;

/// Length and checksum of each file.
pub type SpillState = Vec<(u64, u32)>;

/// The state without stars.
pub fn empty() -> SpillState {
    vec![(0, 0); BUCKETS as usize]
}

/// Smallest block that is written at a time, bytes.
const SMALLEST_BLOCK: u64 = 4 << 10;
/// Largest block.
const LARGEST_BLOCK: u64 = 256 << 10;

/// Files of the buckets.
pub struct Spill {
    folder: PathBuf,
    buffers: Vec<Vec<BucketStar>>,
    lengths: Vec<u64>,
    checksums: Vec<crc32fast::Hasher>,
    /// Number of stars in a full buffer.
    block: usize,
}

fn file_of(folder: &Path, bucket: u64) -> PathBuf {
    folder.join(format!("{bucket:04}"))
}

impl Spill {
    /// Creates the folder, or restores its files to a state. Buffers take at most `memory_bytes`, or 12 MiB if that is more.
    pub fn open(folder: PathBuf, state: &SpillState, memory_bytes: u64) -> Result<Self, DeepError> {
        fs::create_dir_all(&folder).map_err(DeepError::io(&folder))?;
        let bytes = (memory_bytes / BUCKETS).clamp(SMALLEST_BLOCK, LARGEST_BLOCK);
        let mut spill = Self {
            folder,
            buffers: vec![Vec::new(); BUCKETS as usize],
            lengths: vec![0; BUCKETS as usize],
            checksums: vec![crc32fast::Hasher::new(); BUCKETS as usize],
            block: bytes as usize / size_of::<BucketStar>(),
        };
        for bucket in 0..BUCKETS {
            let path = file_of(&spill.folder, bucket);
            let (length, crc32) = state[bucket as usize];
            if length == 0 {
                if path.exists() {
                    fs::remove_file(&path).map_err(DeepError::io(&path))?;
                }
                continue;
            }
            let file = OpenOptions::new().write(true).open(&path).map_err(DeepError::io(&path))?;
            let found = file.metadata().map_err(DeepError::io(&path))?.len();
            if found < length {
                return Err(DeepError::damaged(
                    &path,
                    format!("it has {found} bytes but must have {length}; remove the unfinished store"),
                ));
            }
            file.set_len(length).map_err(DeepError::io(&path))?;
            spill.lengths[bucket as usize] = length;
            spill.checksums[bucket as usize] = crc32fast::Hasher::new_with_initial_len(crc32, length);
        }
        Ok(spill)
    }

    /// A spill to which no stars are added.
    pub fn without_files(folder: PathBuf) -> Self {
        Self { folder, buffers: Vec::new(), lengths: Vec::new(), checksums: Vec::new(), block: 0 }
    }

    /// Adds a star.
    pub fn push(&mut self, bucket: u64, star: BucketStar) -> Result<(), DeepError> {
        let buffer = &mut self.buffers[bucket as usize];
        if buffer.capacity() == 0 {
            buffer.reserve_exact(self.block);
        }
        buffer.push(star);
        if buffer.len() >= self.block { self.write(bucket) } else { Ok(()) }
    }

    fn write(&mut self, bucket: u64) -> Result<(), DeepError> {
        let index = bucket as usize;
        let bytes: &[u8] = bytemuck::cast_slice(&self.buffers[index]);
        if bytes.is_empty() {
            return Ok(());
        }
        let path = file_of(&self.folder, bucket);
        let mut file = OpenOptions::new().append(true).create(true).open(&path).map_err(DeepError::io(&path))?;
        file.write_all(bytes).map_err(DeepError::io(&path))?;
        self.checksums[index].update(bytes);
        self.lengths[index] += bytes.len() as u64;
        self.buffers[index].clear();
        Ok(())
    }

    /// Writes all buffers.
    pub fn flush(&mut self) -> Result<SpillState, DeepError> {
        (0..BUCKETS).try_for_each(|bucket| self.write(bucket))?;
        Ok(self.lengths.iter().zip(&self.checksums).map(|(length, crc)| (*length, crc.clone().finalize())).collect())
    }
}

/// Number of stars of a bucket.
pub fn stars_of(state: &SpillState, bucket: u64) -> u64 {
    state[bucket as usize].0 / size_of::<BucketStar>() as u64
}

/// Reads the stars of a bucket and verifies their checksum.
pub fn read(folder: &Path, state: &SpillState, bucket: u64) -> Result<Vec<BucketStar>, DeepError> {
    let (length, crc32) = state[bucket as usize];
    if length == 0 {
        return Ok(Vec::new());
    }
    let path = file_of(folder, bucket);
    let mut stars = vec![BucketStar::zeroed(); stars_of(state, bucket) as usize];
    let file = File::open(&path).map_err(DeepError::io(&path))?;
    let bytes: &mut [u8] = bytemuck::cast_slice_mut(&mut stars);
    crate::platform::read_exact_at(&file, bytes, 0).map_err(DeepError::io(&path))?;
    if crc32fast::hash(bytes) != crc32 {
        return Err(DeepError::damaged(&path, "its checksum is wrong; remove the unfinished store"));
    }
    Ok(stars)
}

/// Removes the file of a bucket.
pub fn remove(folder: &Path, state: &SpillState, bucket: u64) -> Result<(), DeepError> {
    let path = file_of(folder, bucket);
    if state[bucket as usize].0 == 0 || !path.exists() {
        return Ok(());
    }
    fs::remove_file(&path).map_err(DeepError::io(&path))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn star(number: u32) -> BucketStar {
        BucketStar { xy: [number, number ^ 77], v_mag: 15.0, distance_pc: 200.0, temperature_k: 4000.0 }
    }

    #[test]
    fn stars_come_back_and_a_continued_spill_forgets_what_followed_its_state() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("buckets");
        let mut spill = Spill::open(path.clone(), &empty(), 0).expect("a new folder");
        (0..2000).try_for_each(|number| spill.push(u64::from(number % 3), star(number))).expect("pushed");
        let state = spill.flush().expect("flushed");
        (0..2000).try_for_each(|number| spill.push(5, star(number))).expect("pushed");
        (0..900).try_for_each(|number| spill.push(1, star(number))).expect("pushed");
        drop(spill);
        let mut spill = Spill::open(path.clone(), &state, 0).expect("continued");
        assert_eq!(read(&path, &state, 1).expect("valid").len(), 667);
        spill.push(1, star(9999)).expect("pushed");
        let state = spill.flush().expect("flushed");
        let stars = read(&path, &state, 1).expect("valid");
        assert_eq!((stars.len(), stars[1], stars[667]), (668, star(4), star(9999)));
        assert!(read(&path, &state, 5).expect("empty").is_empty());
        remove(&path, &state, 1).expect("removed");
        remove(&path, &state, 1).expect("nothing to remove");
        assert!(read(&path, &state, 1).is_err());
        let mut bytes = fs::read(path.join("0002")).expect("a file");
        bytes[100] ^= 1;
        fs::write(path.join("0002"), bytes).expect("written");
        assert!(read(&path, &state, 2).unwrap_err().to_string().contains("checksum"));
    }
}
