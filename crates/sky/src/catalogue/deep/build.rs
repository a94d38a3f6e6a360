//! Builds a deep store in bounded memory, in two passes.
//!
//! The first pass distributes the stars of the leaves to a file for each cell of order 4 (20 bytes a star, [`spill`](super::spill)); bright stars are
//! collected. The second pass reads cell by cell, encodes several at a time on all cores, and appends them in the order of the cells. So the bytes of a
//! store depend on its stars alone, and not on their order or the number of threads.
//!
//! Work is done in a folder next to the destination, `NAME.partial`, with the state of the work and the unfinished store in `store`. Another run with
//! the same inputs continues there; finished inputs and cells are not done again. At the end `store` is renamed: a reader never sees a part of a store.
//! The state survives the end of the process at any time. After a power failure checksums show whether it is usable.

use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use rayon::prelude::*;

use super::super::StarRecord;
use super::super::names::StarNames;
use super::super::store::{self, Store};
use super::bucket::{BucketLeaves, BucketStar, FAINTEST_MAG};
use super::cells::SkyPlace;
use super::error::DeepError;
use super::index::{self, BrightFile};
pub use super::journal::Counts;
use super::journal::{BrightStars, State};
use super::resident::{is_resident, keeps_names, listed_again};
use super::spill::{self, Spill};
use super::writer::{EncodedBucket, Writer};
use super::{BRIGHT_FILE, BUCKET_ORDER, BUCKETS, DeepStore, EPOCH_YEAR, LAYERS, is_deep_store};
use crate::files;

/// Smallest limit of memory, bytes.
pub const LEAST_MEMORY: u64 = 64 << 20;
/// Limit of memory if none is given, bytes.
pub const DEFAULT_MEMORY: u64 = 1 << 30;

/// Memory that the second pass needs for each star of a bucket: as read, sorted, and encoded.
const BYTES_PER_STAR: u64 = 64;
/// Memory for the cells of a bucket's planes.
const BYTES_PER_BUCKET: u64 = 9 << 20;
/// Memory that each bright star needs while they are sorted.
const BYTES_PER_BRIGHT_STAR: u64 = 140;
/// Memory for the program and the tables of the store.
const BASE_MEMORY: u64 = 48 << 20;
/// Time between checkpoints.
const CHECKPOINT_EVERY: Duration = Duration::from_secs(10);
/// Largest number of buckets that are encoded at a time.
const MOST_AT_ONCE: u64 = 64;

/// Julian years from J2000.0 to the epoch of leaves.
const YEARS: f64 = EPOCH_YEAR - 2000.0;

/// Destination and limits.
#[derive(Clone, Debug)]
pub struct BuildOptions {
    /// The store: a folder.
    pub out: PathBuf,
    /// Limit of the memory, bytes.
    pub memory_bytes: u64,
    /// All that determines the stars: an unfinished store is only continued if it is the same.
    pub job: String,
}

/// Progress of one part of the work.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BuildStep {
    /// Description of the part.
    pub work: &'static str,
    /// Finished units.
    pub done: u64,
    /// All units.
    pub total: u64,
}

/// Receives the progress.
pub type OnStep<'a> = dyn FnMut(BuildStep) + Send + 'a;

/// A star on its way to a store.
#[derive(Clone, Debug, Default)]
pub struct NewStar {
    /// Proper and radial motion, as in [`StarVelocity`](super::super::motion::StarVelocity).
    pub velocity: Option<[f32; 3]>,
    /// Names, if it has some.
    pub names: Option<StarNames>,
    /// Whether its temperature is a guess.
    pub without_colour: bool,
    /// Whether its distance is that of the prior.
    pub prior_distance: bool,
    /// Whether it is a star of the built-in table.
    pub is_built_in: bool,
}

/// Stars that are fainter than the requested number of stars are left out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limit {
    /// V magnitude of the faintest star.
    pub v_mag: f32,
    /// Number of stars of exactly this magnitude that are kept.
    pub ties: u64,
}

/// Result of a build.
#[derive(Clone, Debug, PartialEq)]
pub struct BuildReport {
    /// Number of bright stars.
    pub bright: u64,
    /// Number of stars in each layer.
    pub layers: [u64; LAYERS.len()],
    /// Stars that needed a rule, and those that were left out.
    pub counts: Counts,
    /// Stars in leaves without colour that got the median temperature of their cell.
    pub median_colour: u64,
    /// Left out: stars that equal another one in every field.
    pub repeated: u64,
    /// Left out: stars within 2" and one magnitude of a star of the built-in table.
    pub listed_again: u64,
    /// Motions and names of bright stars that are stored.
    pub motions: u64,
    /// See `motions`.
    pub names: u64,
    /// Length of all files.
    pub bytes: u64,
    /// Root checksum.
    pub root: String,
}

/// A store that is being built.
pub struct Build {
    options: BuildOptions,
    folder: PathBuf,
    /// Held until the end, so that no other program works in the folder.
    _lock: File,
    state: State,
    spill: Spill,
    bright: BrightStars,
    /// When the state was saved or read.
    saved: Instant,
}

/// Folder of the stars between the passes, in the folder of the work.
const CELLS: &str = "cells";
/// Folder of the unfinished store, in the folder of the work.
const STORE: &str = "store";

/// Folder of the work on a store.
pub fn unfinished_folder(out: &Path) -> PathBuf {
    with_suffix(out, ".partial")
}

fn with_suffix(path: &Path, suffix: &str) -> PathBuf {
    // Components drop a separator at the end of the path.
    let mut name: std::ffi::OsString = path.components().collect::<PathBuf>().into_os_string();
    name.push(suffix);
    name.into()
}

impl Build {
    /// Begins a store, or continues an unfinished one with the same job.
    ///
    /// # Errors
    /// The destination is something else than a deep store, an unfinished store has another job or is in use, or I/O fails.
    pub fn open(options: BuildOptions) -> Result<Self, DeepError> {
        if options.out.exists() && !is_deep_store(&options.out) {
            return Err(DeepError::Occupied { path: options.out });
        }
        if options.memory_bytes < LEAST_MEMORY {
            return Err(memory_error("a deep store", LEAST_MEMORY, options.memory_bytes));
        }
        let folder = unfinished_folder(&options.out);
        fs::create_dir_all(&folder).map_err(DeepError::io(&folder))?;
        let lock_path = folder.join("lock");
        let lock = File::create(&lock_path).map_err(DeepError::io(&lock_path))?;
        match lock.try_lock() {
            Ok(()) => {}
            Err(fs::TryLockError::WouldBlock) => return Err(DeepError::Busy { path: folder }),
            Err(fs::TryLockError::Error(error)) => return Err(DeepError::io(&lock_path)(error)),
        }
        let (read, store) = (State::read(&folder)?, folder.join(STORE));
        // A program that was killed after it had renamed the store left the rest behind.
        let read = read.filter(|state| !state.is_read || store.exists());
        fs::create_dir_all(&store).map_err(DeepError::io(&store))?;
        let state = match read {
            Some(state) if state.job != options.job => {
                return Err(DeepError::OtherJob { path: folder, found: state.job });
            }
            Some(state) => state,
            None => State::new(&options.job),
        };
        let cells = folder.join(CELLS);
        let (spill, bright) = if state.is_read {
            // The second pass only reads the files.
            (Spill::without_files(cells), BrightStars::default())
        } else {
            let spill = Spill::open(cells, &state.spill, options.memory_bytes / 4)?;
            (spill, BrightStars::read(&folder, state.bright)?)
        };
        Ok(Self { options, folder, _lock: lock, state, spill, bright, saved: Instant::now() })
    }

    /// Number of inputs that are finished.
    pub fn steps_done(&self) -> usize {
        self.state.steps
    }

    /// Whether all inputs are read.
    pub fn is_read(&self) -> bool {
        self.state.is_read
    }

    /// State of the source at the last checkpoint, or empty.
    pub fn source(&self) -> &str {
        &self.state.source
    }

    /// Adds a star at J2000.0.
    ///
    /// # Errors
    /// Writing fails, or there are too many bright stars for the memory.
    pub fn add(&mut self, record: StarRecord, about: NewStar) -> Result<(), DeepError> {
        let v_mag = record.apparent_magnitude() as f32;
        self.state.counts.delivered += 1;
        self.state.counts.prior_distance += u64::from(about.prior_distance);
        self.state.counts.at_infinity += u64::from(!record.distance_known);
        if is_resident(&record, v_mag, about.velocity) {
            self.state.counts.bright_without_colour += u64::from(about.without_colour);
            let names = about.names.filter(|names| {
                let keeps = keeps_names(&record, v_mag, names);
                self.state.counts.names_left_out += u64::from(!keeps);
                keeps
            });
            self.bright.push(record, about.velocity, names, about.is_built_in);
            return self.check_bright();
        }
        self.add_faint(record, v_mag, &about)
    }

    fn check_bright(&self) -> Result<(), DeepError> {
        let stars = self.bright.records.len() as u64;
        let needed = BASE_MEMORY + stars * BYTES_PER_BRIGHT_STAR;
        if needed <= self.options.memory_bytes {
            return Ok(());
        }
        Err(memory_error(&format!("{stars} bright stars"), needed, self.options.memory_bytes))
    }

    fn add_faint(&mut self, mut record: StarRecord, v_mag: f32, about: &NewStar) -> Result<(), DeepError> {
        if f64::from(v_mag) > FAINTEST_MAG {
            self.state.counts.too_faint += 1;
            return Ok(());
        }
        self.state.counts.names_left_out += u64::from(about.names.is_some());
        if let Some(velocity) = about.velocity {
            self.state.counts.motions_left_out += 1;
            super::super::motion::StarVelocity { star: 0, velocity }.apply(&mut record, YEARS);
        }
        let place = SkyPlace::from_direction(record.position);
        let star = BucketStar {
            xy: place.xy,
            v_mag,
            distance_pc: if record.distance_known { record.position.length() as f32 } else { 0.0 },
            temperature_k: if about.without_colour { 0.0 } else { record.temperature_k },
        };
        self.spill.push(place.cell(BUCKET_ORDER), star)
    }

    /// Whether the last checkpoint is so old that it is time for another one.
    pub fn is_checkpoint_due(&self) -> bool {
        self.saved.elapsed() > CHECKPOINT_EVERY
    }

    /// Saves the state after the first `steps` inputs.
    pub fn checkpoint(&mut self, steps: usize, source: String) -> Result<(), DeepError> {
        self.state.spill = self.spill.flush()?;
        self.state.bright = self.bright.save(&self.folder)?;
        self.state.steps = steps;
        self.state.source = source;
        self.state.write(&self.folder)?;
        self.saved = Instant::now();
        Ok(())
    }

    /// Writes the store after all inputs; `limit`: see [`Limit`].
    ///
    /// # Errors
    /// No star is left, memory does not suffice for the largest cell, or I/O fails.
    pub fn finish(
        mut self,
        limit: Option<Limit>,
        description: String,
        on_step: &mut OnStep<'_>,
    ) -> Result<BuildReport, DeepError> {
        if !self.state.is_read {
            self.state.is_read = true;
            self.checkpoint(self.state.steps, self.state.source.clone())?;
        }
        let Self { options, folder, _lock, state, spill, bright, .. } = self;
        drop((spill, bright));
        let bright = ready_bright(&folder, &state, limit)?;
        let writer =
            encode_all(&folder, &state, &options, limit.map(|limit| (limit.v_mag, bright.ties_left)), on_step)?;
        on_step(BuildStep { work: "sorting bright stars", done: 0, total: 1 });
        let report = complete(&folder.join(STORE), description, state.counts, &writer, bright)?;
        drop((writer, _lock));
        publish(&folder, &options.out)?;
        Ok(report)
    }
}

fn memory_error(what: &str, needed: u64, limit: u64) -> DeepError {
    DeepError::Memory { what: what.to_owned(), needed_mib: needed.div_ceil(1 << 20), limit_mib: limit >> 20 }
}

/// Bright stars that are kept.
struct ReadyBright {
    stars: BrightStars,
    /// Stars that were left out because another one is equal.
    repeated: u64,
    listed_again: u64,
    /// Stars of the limiting magnitude that may be in leaves.
    ties_left: u64,
}

/// Leaves out bright stars beyond the limit, and those that the built-in table has too.
fn ready_bright(folder: &Path, state: &State, limit: Option<Limit>) -> Result<ReadyBright, DeepError> {
    let mut stars = BrightStars::read(folder, state.bright)?;
    let mut ties_left = 0;
    if let Some(limit) = limit {
        ties_left = limit.ties;
        let magnitudes: Vec<f32> = stars.records.par_iter().map(|star| star.apparent_magnitude() as f32).collect();
        // Among equals those with the smallest coordinates stay.
        let mut ties: Vec<usize> = (0..magnitudes.len()).filter(|index| magnitudes[*index] == limit.v_mag).collect();
        ties.sort_by(|a, b| {
            let [a, b] = [a, b].map(|index| stars.records[*index].position);
            a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)).then(a.z.total_cmp(&b.z))
        });
        let mut keep: Vec<bool> = magnitudes.iter().map(|v_mag| *v_mag < limit.v_mag).collect();
        ties.iter().take(limit.ties as usize).for_each(|index| keep[*index] = true);
        ties_left -= ties_left.min(ties.len() as u64);
        stars.retain(&keep);
    }
    let built_in: Vec<StarRecord> = stars
        .records
        .iter()
        .zip(&stars.is_built_in)
        .filter(|(_, is_built_in)| **is_built_in)
        .map(|(star, _)| *star)
        .collect();
    let mut again = 0;
    if !built_in.is_empty() && built_in.len() < stars.records.len() {
        let listed = listed_again(&built_in, stars.records.iter());
        let keep: Vec<bool> =
            listed.iter().zip(&stars.is_built_in).map(|(listed, built_in)| *built_in || !listed).collect();
        again = keep.iter().filter(|keep| !**keep).count() as u64;
        stars.retain(&keep);
    }
    let keep = first_of_equals(&stars.records);
    let repeated = keep.iter().filter(|keep| !**keep).count() as u64;
    if repeated > 0 {
        stars.retain(&keep);
    }
    Ok(ReadyBright { stars, repeated, listed_again: again, ties_left })
}

/// Whether each star is the first of those that equal it in every field.
fn first_of_equals(stars: &[StarRecord]) -> Vec<bool> {
    let content = |index: &u32| {
        let star = &stars[*index as usize];
        (
            star.position.to_array().map(f64::to_bits),
            star.magnitude.to_bits(),
            star.temperature_k.to_bits(),
            star.distance_known,
        )
    };
    let mut order: Vec<u32> = (0..stars.len() as u32).collect();
    order.par_sort_unstable_by(|a, b| content(a).cmp(&content(b)).then(a.cmp(b)));
    let mut is_first = vec![true; stars.len()];
    for pair in order.windows(2).filter(|pair| content(&pair[0]) == content(&pair[1])) {
        is_first[pair[1] as usize] = false;
    }
    is_first
}

/// Reads the stars of a bucket that are not beyond the limit.
fn stars_of_bucket(
    folder: &Path,
    state: &State,
    bucket: u64,
    limit: Option<f32>,
) -> Result<(Vec<BucketStar>, Vec<BucketStar>), DeepError> {
    let mut stars = spill::read(&folder.join(CELLS), &state.spill, bucket)?;
    let mut ties = Vec::new();
    if let Some(limit) = limit {
        ties.extend(stars.iter().filter(|star| star.v_mag == limit).copied());
        // Their order must not depend on the order of the input.
        ties.sort_unstable_by_key(|star| star.xy);
        stars.retain(|star| star.v_mag < limit);
    }
    Ok((stars, ties))
}

/// The second pass.
fn encode_all(
    folder: &Path,
    state: &State,
    options: &BuildOptions,
    limit: Option<(f32, u64)>,
    on_step: &mut OnStep<'_>,
) -> Result<Writer, DeepError> {
    let mut writer = Writer::open(&folder.join(STORE), folder)?;
    let cost = |bucket: u64| BYTES_PER_BUCKET + BYTES_PER_STAR * spill::stars_of(&state.spill, bucket);
    // Bright stars are read again at the end, so that their memory is free now; they are kept if they are few.
    let bright_bytes = BYTES_PER_BRIGHT_STAR / 2 * state.bright[0];
    let memory = options.memory_bytes.saturating_sub(BASE_MEMORY + bright_bytes);
    if let Some(largest) = (writer.finished()..BUCKETS).map(cost).max().filter(|largest| *largest > memory) {
        return Err(memory_error(
            "the cell with the most stars",
            largest + BASE_MEMORY + bright_bytes,
            options.memory_bytes,
        ));
    }
    let total: u64 = (0..BUCKETS).map(|bucket| spill::stars_of(&state.spill, bucket)).sum();
    let mut done: u64 = (0..writer.finished()).map(|bucket| spill::stars_of(&state.spill, bucket)).sum();
    let mut ties_left = writer.ties_left().unwrap_or(limit.map_or(0, |(_, ties)| ties));
    let mut ready: Vec<(EncodedBucket, u64)> = Vec::new();
    let mut next = writer.finished();
    loop {
        // Half of the memory is for the buckets that are being written.
        let (first, mut used) = (next, 0);
        while next < BUCKETS && next - first < MOST_AT_ONCE && (next == first || used + cost(next) <= memory / 2) {
            used += cost(next);
            next += 1;
        }
        let read = || {
            (first..next).into_par_iter().map(|bucket| stars_of_bucket(folder, state, bucket, limit.map(|(v, _)| v)))
        };
        let encode = || -> Result<Vec<(EncodedBucket, u64)>, DeepError> {
            let read: Vec<(Vec<BucketStar>, Vec<BucketStar>)> = read().collect::<Result<_, _>>()?;
            let mut left = ties_left;
            let with_ties: Vec<(Vec<BucketStar>, u64)> = read
                .into_iter()
                .map(|(mut stars, ties)| {
                    let taken = left.min(ties.len() as u64);
                    stars.extend_from_slice(&ties[..taken as usize]);
                    left -= taken;
                    (stars, left)
                })
                .collect();
            let encoded = with_ties.into_par_iter().enumerate().map(|(index, (stars, left))| {
                (EncodedBucket::new(BucketLeaves::encode(first + index as u64, stars)), left)
            });
            Ok(encoded.collect())
        };
        let (written, encoded) =
            rayon::join(|| ready.iter().try_for_each(|(bucket, left)| writer.append(bucket, *left)), encode);
        written?;
        // Their files are not needed any more.
        for bucket in writer.finished() - ready.len() as u64..writer.finished() {
            spill::remove(&folder.join(CELLS), &state.spill, bucket)?;
            done += spill::stars_of(&state.spill, bucket);
        }
        on_step(BuildStep { work: "writing stars", done, total });
        ready = encoded?;
        if ready.is_empty() {
            return Ok(writer);
        }
        ties_left = ready.last().map_or(ties_left, |(_, left)| *left);
    }
}

/// Writes bright stars and index.
fn complete(
    folder: &Path,
    description: String,
    counts: Counts,
    writer: &Writer,
    bright: ReadyBright,
) -> Result<BuildReport, DeepError> {
    let ReadyBright { stars, repeated: repeated_bright, listed_again, .. } = bright;
    let (motions, names) = (stars.velocities.len() as u64, stars.names.len() as u64);
    let count = stars.records.len() as u64;
    let store = Store::from_records(description.clone(), stars.records, stars.velocities, stars.names);
    let path = folder.join(BRIGHT_FILE);
    store::write(&path, &store).map_err(|error| match error {
        store::StoreError::Io { path, source } => DeepError::io(&path)(source),
        other => DeepError::Bright(other),
    })?;
    drop(store);
    let header = store::read_header(&path)?;
    let bytes = fs::metadata(&path).map_err(DeepError::io(&path))?.len();
    let index = writer.index(EPOCH_YEAR, description, BrightFile { bytes, stars: count, crc32: header.crc32 })?;
    if index.stars() == 0 {
        return Err(DeepError::NoStars { path: folder.to_owned() });
    }
    let index_path = folder.join(index::NAME);
    files::write_whole(&index_path, &index.to_bytes().0).map_err(DeepError::io(&index_path))?;
    let store = DeepStore::open(folder)?;
    let [repeated, median_colour] = writer.counts();
    let report = BuildReport {
        bright: count,
        layers: std::array::from_fn(|layer| index.leaves[layer].stars()),
        counts,
        median_colour,
        repeated: repeated + repeated_bright,
        listed_again,
        motions,
        names,
        bytes: store.bytes(),
        root: store.root(),
    };
    Ok(report)
}

/// Gives the store its name, and removes the folder of the work. An older store is replaced.
fn publish(folder: &Path, out: &Path) -> Result<(), DeepError> {
    let old = with_suffix(out, ".old");
    if out.exists() {
        fs::rename(out, &old).map_err(DeepError::io(out))?;
    }
    fs::rename(folder.join(STORE), out).map_err(DeepError::io(out))?;
    for rest in [folder, &old] {
        if rest.exists() {
            fs::remove_dir_all(rest).map_err(DeepError::io(rest))?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::super::test_stores::{built, options, stars};
    use super::*;

    fn all_files(folder: &Path) -> Vec<(std::ffi::OsString, Vec<u8>)> {
        let entries = fs::read_dir(folder).expect("a folder").map(|entry| entry.expect("an entry"));
        let mut files: Vec<_> =
            entries.map(|entry| (entry.file_name(), fs::read(entry.path()).expect("read"))).collect();
        files.sort();
        files
    }

    #[test]
    fn an_interrupted_store_is_continued_in_both_passes() {
        let folder = tempfile::tempdir().expect("a folder");
        let all = stars(3000, 5, 18.0);
        let whole = folder.path().join("whole");
        let expected = built(&whole, &all);
        let out = folder.path().join("continued");

        // A program that ends after its first checkpoint, and had added more.
        let mut build = Build::open(options(&out)).expect("new");
        all[..1000].iter().try_for_each(|(star, about)| build.add(*star, about.clone())).expect("added");
        build.checkpoint(1, "first".to_owned()).expect("saved");
        all[1000..1500].iter().try_for_each(|(star, about)| build.add(*star, about.clone())).expect("added");
        assert!(matches!(Build::open(options(&out)), Err(DeepError::Busy { .. })));
        drop(build);
        assert!(!out.exists(), "nothing appears before the end");

        let other = BuildOptions { job: "another".to_owned(), ..options(&out) };
        assert!(matches!(Build::open(other), Err(DeepError::OtherJob { .. })));
        let mut build = Build::open(options(&out)).expect("continued");
        assert_eq!((build.steps_done(), build.source(), build.is_read()), (1, "first", false));
        all[1000..].iter().try_for_each(|(star, about)| build.add(*star, about.clone())).expect("added");
        build.state.is_read = true;
        build.checkpoint(2, String::new()).expect("saved");
        // A few buckets are finished, and the next one is written in part.
        let mut writer = Writer::open(&build.folder.join(STORE), &build.folder).expect("opened");
        for bucket in 0..700 {
            let (stars, _) = stars_of_bucket(&build.folder, &build.state, bucket, None).expect("read");
            writer.append(&EncodedBucket::new(BucketLeaves::encode(bucket, stars)), 0).expect("written");
        }
        let torn = build.folder.join(STORE).join("leaves-13");
        let mut bytes = fs::read(&torn).expect("read");
        bytes.extend([7; 20]);
        fs::write(&torn, bytes).expect("written");
        drop((build, writer));

        let build = Build::open(options(&out)).expect("continued");
        assert!(build.is_read());
        let mut first = None;
        let found = build.finish(None, "a test".to_owned(), &mut |step: BuildStep| {
            first.get_or_insert(step.done);
        });
        assert!(first.is_some_and(|done| done > 300), "finished cells are not written again: {first:?}");
        assert_eq!(found.expect("built"), expected);
        assert!(all_files(&out) == all_files(&whole));
        assert_eq!(fs::read_dir(folder.path()).expect("a folder").count(), 2);
    }

    #[test]
    fn a_store_replaces_an_older_one_and_nothing_else() {
        let folder = tempfile::tempdir().expect("a folder");
        let out = folder.path().join("store");
        built(&out, &stars(200, 1, 15.0));
        let report = built(&out, &stars(300, 1, 15.0));
        assert_eq!(DeepStore::open(&out).expect("a store").root(), report.root);
        assert_eq!(fs::read_dir(folder.path()).expect("a folder").count(), 1);
        fs::write(folder.path().join("file"), b"text").expect("written");
        for name in ["file", "."] {
            let path = folder.path().join(name);
            assert!(matches!(Build::open(options(&path)), Err(DeepError::Occupied { .. })), "{name}");
        }
    }

    #[test]
    fn rules_are_counted_and_stars_are_where_they_should_be() {
        let folder = tempfile::tempdir().expect("a folder");
        let out = folder.path().join("store");
        let all = stars(3000, 5, 18.0);
        let mut twice = all.clone();
        twice.extend_from_slice(&all[..50]);
        let faint =
            StarRecord { magnitude: 28.0, distance_known: false, position: glam::DVec3::X, temperature_k: 4000.0 };
        twice.push((faint, NewStar::default()));
        let report = built(&out, &twice);
        assert_eq!((report.repeated, report.counts.too_faint, report.counts.delivered), (50, 1, all.len() as u64 + 51));
        assert_eq!(report.bright + report.layers.iter().sum::<u64>(), all.len() as u64);
        let store = DeepStore::open(&out).expect("a store");
        let bright = store.bright().expect("valid");
        assert_eq!((bright.velocities.len() as u64, bright.names.len() as u64), (report.motions, report.names));
        assert!(report.motions > 10 && report.names > 1 && report.median_colour > 50, "{report:?}");
        // A star of a leaf is at the epoch of the leaves.
        let (star, about) =
            all.iter().find(|(star, about)| about.velocity.is_some() && star.apparent_magnitude() > 17.1).expect("one");
        let mut moved = *star;
        let velocity = about.velocity.expect("it moves");
        super::super::super::motion::StarVelocity { star: 0, velocity }.apply(&mut moved, 16.0);
        let order = LAYERS[2].order;
        let leaf = store.leaf(2, SkyPlace::from_direction(moved.position).cell(order)).expect("a leaf");
        let off = |star: &StarRecord| {
            let of = |index: usize| leaf.star(index).direction.angle_between(star.position);
            (0..leaf.words.len()).map(of).fold(f64::INFINITY, f64::min) / crate::units::ARCSECOND_RAD
        };
        assert!(off(&moved) < 0.01 && off(star) > 0.05, "{} {}", off(&moved), off(star));
    }
}
