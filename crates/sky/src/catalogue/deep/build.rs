//! Builds a deep store in bounded memory, in two passes.
//!
//! The first pass distributes the stars of the leaves to a file for each cell of order 4 (20 bytes per star, [`spill`](super::spill)); bright stars
//! are collected. The second pass reads cell by cell, encodes several at a time on all cores, and appends them in the order of the cells. Therefore
//! the bytes of a store depend on its stars alone, and not on their order or the number of threads.
//!
//! With a range of cells ([`CellRange`]) the store is a part ([`part`](super::part)): it contains only the stars of these cells, and the other cells
//! are empty.
//!
//! The working folder is next to the destination and called `NAME.partial`. It contains the state of the work, and the unfinished store in `store`.
//! Another run with the same inputs continues there; finished inputs and cells are not done again. At the end `store` is renamed: a reader never sees
//! an incomplete store. The state stays valid if the process ends at any time. After a power failure, checksums reveal whether it is usable.

use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use rayon::prelude::*;

use super::super::StarRecord;
use super::super::names::StarNames;
use super::bucket::{BucketLeaves, BucketStar, FAINTEST_MAG};
use super::cell_range::CellRange;
use super::cells::SkyPlace;
use super::error::DeepError;
pub use super::finish::{Sources, Tally};
use super::finish::{complete, ready_bright};
pub use super::journal::Counts;
use super::journal::{BrightStars, State};
use super::resident::{is_resident, keeps_names};
use super::spill::{self, Spill};
pub use super::work::unfinished_folder;
use super::work::{self, STORE};
use super::writer::{EncodedBucket, Writer};
use super::{BUCKET_ORDER, BUCKETS, EPOCH_YEAR, LAYERS};

/// Minimum memory limit, bytes.
pub const LEAST_MEMORY: u64 = 64 << 20;
/// Default memory limit, bytes.
pub const DEFAULT_MEMORY: u64 = 1 << 30;

/// Memory that the second pass needs for each star of a bucket, bytes: for its copies as read, sorted and encoded.
const BYTES_PER_STAR: u64 = 64;
/// Memory for the cells of a bucket's planes, bytes.
const BYTES_PER_BUCKET: u64 = 9 << 20;
/// Memory for each bright star during sorting, bytes.
const BYTES_PER_BRIGHT_STAR: u64 = 140;
/// Memory for the program and the tables of the store, bytes.
const BASE_MEMORY: u64 = 48 << 20;
/// Time between checkpoints.
const CHECKPOINT_EVERY: Duration = Duration::from_secs(10);
/// Maximum number of buckets that are encoded at a time.
const MOST_AT_ONCE: u64 = 64;

/// Julian years from J2000.0 to the epoch of leaves.
const YEARS: f64 = EPOCH_YEAR - 2000.0;

/// Destination and limits.
#[derive(Clone, Debug)]
pub struct BuildOptions {
    /// Folder of the store.
    pub out: PathBuf,
    /// Memory limit, bytes.
    pub memory_bytes: u64,
    /// Description of everything that determines the stars. An unfinished store is continued only if its description is the same.
    pub job: String,
    /// If given, makes a part of the store with the stars of these cells.
    pub cells: Option<CellRange>,
}

impl BuildOptions {
    /// Returns the job: the inputs, and the range of cells if there is one.
    pub(super) fn job_of(&self, inputs: &str) -> String {
        self.cells.map_or_else(|| inputs.to_owned(), |cells| format!("{inputs}, cells {cells}"))
    }
}

/// Progress of one part of the work.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BuildStep {
    /// Name of this part of the work.
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
    /// Names, if it has any.
    pub names: Option<StarNames>,
    /// Whether its colour is unknown; its temperature is then a guess.
    pub without_colour: bool,
    /// Whether its distance was computed from the prior.
    pub prior_distance: bool,
    /// Whether it is a star of the built-in table.
    pub is_built_in: bool,
}

/// Faint limit that leaves the requested number of stars.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limit {
    /// V magnitude of the faintest star that is kept.
    pub v_mag: f32,
    /// Number of bright stars of exactly this magnitude that are kept. They are the first ones in the order of the cells of order 4.
    pub bright_ties: u64,
    /// Number of stars in leaves of exactly this magnitude that are kept. They are the first ones in the order of the cells of order 4.
    pub leaf_ties: u64,
}

/// Result of a build.
#[derive(Clone, Debug, PartialEq)]
pub struct BuildReport {
    /// Cells of a part; `None`: a whole store.
    pub cells: Option<CellRange>,
    /// Number of bright stars.
    pub bright: u64,
    /// Number of stars in each layer.
    pub layers: [u64; LAYERS.len()],
    /// Numbers of stars that needed a rule, and of those that were left out.
    pub tally: Tally,
    /// Numbers of motions and names of bright stars that are stored.
    pub motions: u64,
    /// See `motions`.
    pub names: u64,
    /// Total length of all files, bytes.
    pub bytes: u64,
    /// Root checksum.
    pub root: String,
}

/// A store that is being built.
pub struct Build {
    options: BuildOptions,
    folder: PathBuf,
    /// Held until the end, so that no other program uses the folder.
    _lock: File,
    state: State,
    spill: Spill,
    bright: BrightStars,
    /// Time at which the state was last saved or read.
    saved: Instant,
}

/// Folder in the working folder for the stars between the two passes.
const CELLS: &str = "cells";
impl Build {
    /// Begins a store, or continues an unfinished one with the same job.
    ///
    /// # Errors
    /// The destination exists and is not a deep store, an unfinished store has another job or is in use, or I/O fails.
    pub fn open(options: BuildOptions) -> Result<Self, DeepError> {
        if options.memory_bytes < LEAST_MEMORY {
            return Err(memory_error("a deep store", LEAST_MEMORY, options.memory_bytes));
        }
        let (folder, lock) = work::begin(&options.out)?;
        let (read, store) = (State::read(&folder)?, folder.join(STORE));
        // Ignore the remains of a program that was killed after it had renamed the store.
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

    fn cells(&self) -> CellRange {
        self.options.cells.unwrap_or(CellRange::ALL)
    }

    /// Number of finished inputs.
    pub fn steps_done(&self) -> usize {
        self.state.steps
    }

    /// Whether all inputs are read.
    pub fn is_read(&self) -> bool {
        self.state.is_read
    }

    /// State of the source at the last checkpoint; empty if there is none.
    pub fn source(&self) -> &str {
        &self.state.source
    }

    /// Adds a star at J2000.0. A part leaves out stars in other cells, except stars of the built-in table, which may duplicate stars in its cells.
    ///
    /// # Errors
    /// Writing fails, or the bright stars exceed the memory limit.
    pub fn add(&mut self, record: StarRecord, about: NewStar) -> Result<(), DeepError> {
        let v_mag = record.apparent_magnitude() as f32;
        if !is_resident(&record, v_mag, about.velocity) {
            return self.add_faint(record, v_mag, &about);
        }
        let is_own = self.cells().contains_direction(record.position);
        if !is_own && !about.is_built_in {
            return Ok(());
        }
        let mut names_left_out = 0;
        let names = about.names.filter(|names| {
            let keeps = keeps_names(&record, v_mag, names);
            names_left_out += u64::from(!keeps);
            keeps
        });
        if is_own {
            let counts = &mut self.state.counts;
            counts.delivered(&record, about.prior_distance);
            counts.bright_without_colour += u64::from(about.without_colour);
            counts.names_left_out += names_left_out;
        }
        self.bright.push(record, about.velocity, names, about.is_built_in);
        self.check_bright()
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
        let is_too_faint = f64::from(v_mag) > FAINTEST_MAG;
        if let Some(velocity) = about.velocity.filter(|_| !is_too_faint) {
            super::super::motion::StarVelocity { star: 0, velocity }.apply(&mut record, YEARS);
        }
        let place = SkyPlace::from_direction(record.position);
        let cell = place.cell(BUCKET_ORDER);
        if !self.cells().contains(cell) {
            return Ok(());
        }
        let counts = &mut self.state.counts;
        counts.delivered(&record, about.prior_distance);
        if is_too_faint {
            counts.too_faint += 1;
            return Ok(());
        }
        counts.names_left_out += u64::from(about.names.is_some());
        counts.motions_left_out += u64::from(about.velocity.is_some());
        let star = BucketStar {
            xy: place.xy,
            v_mag,
            distance_pc: if record.distance_known { record.position.length() as f32 } else { 0.0 },
            temperature_k: if about.without_colour { 0.0 } else { record.temperature_k },
        };
        self.spill.push(cell, star)
    }

    /// Whether enough time has passed since the last checkpoint to make another one.
    pub fn is_checkpoint_due(&self) -> bool {
        self.saved.elapsed() > CHECKPOINT_EVERY
    }

    /// Saves the state after the first `steps` inputs were read.
    pub fn checkpoint(&mut self, steps: usize, source: String) -> Result<(), DeepError> {
        self.state.spill = self.spill.flush()?;
        self.state.bright = self.bright.save(&self.folder)?;
        self.state.steps = steps;
        self.state.source = source;
        self.state.write(&self.folder)?;
        self.saved = Instant::now();
        Ok(())
    }

    /// Writes the store after all inputs were added; for `limit` see [`Limit`].
    ///
    /// # Errors
    /// No star is left, the memory limit is too low for the largest cell, or I/O fails.
    pub fn finish(
        mut self,
        limit: Option<Limit>,
        sources: impl Into<Sources>,
        on_step: &mut OnStep<'_>,
    ) -> Result<BuildReport, DeepError> {
        if !self.state.is_read {
            self.state.is_read = true;
            self.checkpoint(self.state.steps, self.state.source.clone())?;
        }
        let cells = self.cells();
        let Self { options, folder, _lock, state, spill, bright, .. } = self;
        drop((spill, bright));
        let writer = encode_all(&folder, &state, &options, limit.map(|limit| (limit.v_mag, limit.leaf_ties)), on_step)?;
        on_step(BuildStep { work: "sorting bright stars", done: 0, total: 1 });
        let bright = ready_bright(&folder, &state, limit, cells)?;
        let [repeated, median_colour] = writer.counts();
        let tally = Tally {
            counts: state.counts,
            median_colour,
            repeated: repeated + bright.repeated,
            listed_again: bright.listed_again,
        };
        let tables = writer.tables()?;
        let report = complete(&folder.join(STORE), sources.into(), tally, tables, bright.stars, options.cells)?;
        drop((writer, _lock));
        work::publish(&folder, &options.out)?;
        Ok(report)
    }
}

fn memory_error(what: &str, needed: u64, limit: u64) -> DeepError {
    DeepError::Memory { what: what.to_owned(), needed_mib: needed.div_ceil(1 << 20), limit_mib: limit >> 20 }
}

/// Reads the stars of a bucket that are within the faint limit.
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
        // Sort these stars, because their order must not depend on the order of the input.
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
    let memory = options.memory_bytes.saturating_sub(BASE_MEMORY);
    if let Some(largest) = (writer.finished()..BUCKETS).map(cost).max().filter(|largest| *largest > memory) {
        return Err(memory_error("the cell with the most stars", largest + BASE_MEMORY, options.memory_bytes));
    }
    let total: u64 = (0..BUCKETS).map(|bucket| spill::stars_of(&state.spill, bucket)).sum();
    let mut done: u64 = (0..writer.finished()).map(|bucket| spill::stars_of(&state.spill, bucket)).sum();
    let mut ties_left = writer.ties_left().unwrap_or(limit.map_or(0, |(_, ties)| ties));
    let mut ready: Vec<(EncodedBucket, u64)> = Vec::new();
    let mut next = writer.finished();
    loop {
        // Half of the memory is reserved for the buckets that are being written.
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
                let bucket = first + index as u64;
                Ok((EncodedBucket::new(bucket, BucketLeaves::encode(bucket, stars))?, left))
            });
            encoded.collect()
        };
        let (written, encoded) =
            rayon::join(|| ready.iter().try_for_each(|(bucket, left)| writer.append(bucket, *left)), encode);
        written?;
        // Their files are no longer needed.
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

#[cfg(test)]
mod tests {
    use super::super::DeepStore;
    use super::super::test_stores::{all_files, built, options, stars};
    use super::*;

    #[test]
    fn an_interrupted_store_is_continued_in_both_passes() {
        let folder = tempfile::tempdir().expect("a folder");
        let all = stars(3000, 5, 18.0);
        let whole = folder.path().join("whole");
        let expected = built(&whole, &all);
        let out = folder.path().join("continued");

        // Simulate a program that added more stars after its first checkpoint and then ended.
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
        // Simulate a program that ended after a few buckets were finished, with the next one partly written.
        let mut writer = Writer::open(&build.folder.join(STORE), &build.folder).expect("opened");
        for bucket in 0..700 {
            let (stars, _) = stars_of_bucket(&build.folder, &build.state, bucket, None).expect("read");
            let encoded = EncodedBucket::new(bucket, BucketLeaves::encode(bucket, stars)).expect("encoded");
            writer.append(&encoded, 0).expect("written");
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
        let Tally { counts, repeated, median_colour, .. } = report.tally;
        assert_eq!((repeated, counts.too_faint, counts.delivered), (50, 1, all.len() as u64 + 51));
        assert_eq!(report.bright + report.layers.iter().sum::<u64>(), all.len() as u64);
        let store = DeepStore::open(&out).expect("a store");
        let bright = store.bright().expect("valid");
        assert_eq!((bright.velocities.len() as u64, bright.names.len() as u64), (report.motions, report.names));
        assert!(report.motions > 10 && report.names > 1 && median_colour > 50, "{report:?}");
        // The position of a star in a leaf is that of the leaves' epoch.
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
