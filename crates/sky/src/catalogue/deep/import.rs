//! Imports catalogues into a deep store.
//!
//! Files are read by several threads at a time and pass their stars on in batches; none is held in memory (except JSON). The rules are:
//!
//! - Stars are placed at J2000.0 with their motion; those of leaves are then moved to J2016.0, and their motion is dropped.
//! - A parallax below five times its error is not inverted: the distance follows from a prior ([`prior`](super::prior)). Stars of files without a
//!   column of errors keep their distance, or are at infinity if they have none.
//! - Stars without colour get the median temperature of their leaf or, if it has none, of their cell of order 4. Bright stars without colour get the
//!   Sun's temperature.
//! - If `builtin:bright` is imported too, stars of other catalogues within 2" and one magnitude of one of its stars are left out.
//! - Rows that are equal to another one in position, brightness, colour and distance are left out.
//!
//! The report gives the number of stars for each rule.

use std::fmt;
use std::path::PathBuf;
use std::sync::mpsc::sync_channel;
use std::time::UNIX_EPOCH;

use super::super::motion::velocity_by_star;
use super::super::reader::{CatalogueError, CatalogueRead, ReadReport, StreamedStar, stream_file};
use super::super::store;
use super::super::{StarRecord, bright, distance_modulus};
use rayon::prelude::*;

use super::build::{Build, BuildOptions, BuildReport, BuildStep, NewStar, OnStep, Sources};
use super::error::DeepError;
use super::hats::{self, is_hats};
use super::import_report::{ReadInput, Rows, input_lines};
use super::part::Input;
use super::prior::prior_distance_pc;
use super::slice::{Selection, each_bright_star, each_star};
use super::{DeepStore, is_deep_store};
use crate::files;

/// Number of batches that may wait between the readers and the writer.
const BATCHES: usize = 8;

/// A catalogue to import.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ImportSource {
    /// The built-in table of bright stars.
    Bright,
    /// A catalogue, a single-file store, a deep store, or a folder of a catalogue in HATS ([`hats`](super::hats)).
    File(PathBuf),
}

impl fmt::Display for ImportSource {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Bright => f.write_str(bright::NAME),
            Self::File(path) => write!(f, "{}", path.display()),
        }
    }
}

impl ImportSource {
    /// Returns name, length and modification time of the file: an unfinished store is continued only if they are the same.
    fn identity(&self) -> Result<String, DeepError> {
        let Self::File(path) = self else { return Ok(self.to_string()) };
        if is_deep_store(path) {
            return Ok(format!("{self} ({})", DeepStore::open_whole(path)?.root()));
        }
        let opened = files::open_regular(path).and_then(|file| file.metadata());
        let metadata =
            opened.map_err(|source| DeepError::Catalogue(CatalogueError::Open { path: path.clone(), source }))?;
        let modified = metadata.modified().ok().and_then(|time| time.duration_since(UNIX_EPOCH).ok());
        Ok(format!("{self} ({} bytes, {} ns)", metadata.len(), modified.map_or(0, |time| time.as_nanos())))
    }
}

impl ImportSource {
    /// Digest of the content; see [`Input`].
    fn digest(&self) -> Result<String, DeepError> {
        match self {
            Self::Bright => Ok(bright::NAME.to_owned()),
            Self::File(path) if is_deep_store(path) => Ok(DeepStore::open(path)?.root()),
            Self::File(path) => Ok(files::sha256_of_file(path).map_err(DeepError::io(path))?.1),
        }
    }
}

/// Result of an import.
#[derive(Clone, Debug, PartialEq)]
pub struct ImportReport {
    /// The store.
    pub build: BuildReport,
    /// A line for each catalogue, and lines for its data that the store lacks.
    pub catalogues: Vec<String>,
}

/// Imports catalogues. The same stars give the same bytes, independent of the order of the catalogues and the number of threads. `options.job` is
/// replaced.
///
/// # Errors
/// A catalogue cannot be read or has no usable row, or the store cannot be written.
pub fn import(
    sources: &[ImportSource],
    options: BuildOptions,
    on_step: &mut OnStep<'_>,
) -> Result<ImportReport, DeepError> {
    let groups = groups_of(sources)?;
    let sources: &Vec<ImportSource> = &groups.iter().flat_map(|group| group.sources.clone()).collect();
    let identities: Vec<String> = sources.iter().map(ImportSource::identity).collect::<Result<_, _>>()?;
    // With thousands of files the list would make messages too long.
    let job = match &identities[..] {
        [first, .., last] if identities.len() > 4 => {
            format!(
                "{first} ... {last}, {} files, {:08x}",
                identities.len(),
                crc32fast::hash(identities.concat().as_bytes())
            )
        }
        few => few.join(", "),
    };
    let (job, is_part) = (options.job_of(&job), options.cells.is_some());
    let mut build = Build::open(BuildOptions { job, ..options })?;
    let mut inputs: Vec<ReadInput> = match build.source() {
        "" => Vec::new(),
        text => serde_json::from_str(text).map_err(|_| {
            DeepError::damaged(
                &first_path(sources),
                "the state of its import cannot be used; remove the unfinished store",
            )
        })?,
    };
    let total = sources.len() as u64;
    let at_once = rayon::current_num_threads();
    while !build.is_read() && build.steps_done().max(inputs.len()) < sources.len() {
        let first = inputs.len();
        on_step(BuildStep { work: "reading catalogues", done: first as u64, total });
        let some = &sources[first..(first + at_once).min(sources.len())];
        inputs.extend(read_some(some, &mut build, is_part)?);
        if build.is_checkpoint_due() || inputs.len() == sources.len() {
            let source =
                serde_json::to_string(&inputs).map_err(|error| DeepError::io(&first_path(sources))(error.into()))?;
            build.checkpoint(inputs.len(), source)?;
        }
    }
    let mut rest = &inputs[..];
    let reports = groups.iter().filter_map(|group| {
        let (first, others) = rest.split_at_checked(group.sources.len())?;
        rest = others;
        Some(input_lines(&group.name, first))
    });
    let reports: Vec<Vec<String>> = reports.collect();
    let description: Vec<&str> = reports.iter().filter_map(|lines| lines.first()).map(String::as_str).collect();
    let description = description.join("\n");
    let lines = reports.concat();
    let inputs =
        sources.iter().zip(inputs).map(|(source, input)| Input { name: source.to_string(), digest: input.digest });
    let sources = Sources { description, lines: lines.clone(), inputs: inputs.collect() };
    let build = build.finish(None, sources, on_step)?;
    Ok(ImportReport { build, catalogues: lines })
}

/// A longer run of files is summed up in one line of the report.
const FILES_EACH: usize = 8;

/// Sources that share a line of the report.
struct Group {
    name: String,
    sources: Vec<ImportSource>,
}

/// Groups the sources for the report. A catalogue in HATS forms one group, in which its folder is replaced by its files; a long run of files also
/// forms one group.
fn groups_of(sources: &[ImportSource]) -> Result<Vec<Group>, DeepError> {
    let mut groups = Vec::new();
    let is_table = |source: &ImportSource| matches!(source, ImportSource::File(path) if !path.is_dir());
    for run in sources.chunk_by(|first, second| is_table(first) && is_table(second)) {
        match run {
            [ImportSource::File(path)] if is_hats(path) => {
                let sources: Vec<ImportSource> = hats::files_of(path)?.into_iter().map(ImportSource::File).collect();
                groups.push(Group { name: format!("{} ({} files)", path.display(), sources.len()), sources });
            }
            [ImportSource::File(path)] if !is_deep_store(path) => {
                hats::refuse_other_folder(path)?;
                groups.push(Group { name: path.display().to_string(), sources: run.to_vec() });
            }
            [first, .., last] if run.len() > FILES_EACH => {
                let name = format!("{first} ... {last} ({} files)", run.len());
                groups.push(Group { name, sources: run.to_vec() });
            }
            few => groups
                .extend(few.iter().map(|source| Group { name: source.to_string(), sources: vec![source.clone()] })),
        }
    }
    Ok(groups)
}

/// Path of the first source, for errors that do not concern a particular source.
fn first_path(sources: &[ImportSource]) -> PathBuf {
    match sources.first() {
        Some(ImportSource::File(path)) => path.clone(),
        _ => PathBuf::from(bright::NAME),
    }
}

/// Reads several catalogues at the same time. Contents are hashed only for parts, because hashing takes as long as reading the files once more.
fn read_some(sources: &[ImportSource], build: &mut Build, is_part: bool) -> Result<Vec<ReadInput>, DeepError> {
    let mut read: Vec<Option<Rows>> = vec![None; sources.len()];
    let mut streamed: Vec<(usize, &PathBuf)> = Vec::new();
    for (index, source) in sources.iter().enumerate() {
        match source {
            ImportSource::File(path) if !is_deep_store(path) && !store::is_store(path)? => streamed.push((index, path)),
            other => read[index] = Some(Rows::of_store(add_whole(other, build)?)),
        }
    }
    let reports = std::thread::scope(|scope| {
        let (sender, receiver) = sync_channel::<Vec<StreamedStar>>(BATCHES);
        let readers: Vec<_> = streamed
            .iter()
            .map(|&(_, path)| {
                let sender = sender.clone();
                scope.spawn(move || stream_file(path, 0.0, sender))
            })
            .collect();
        drop(sender);
        let added = receiver.iter().flatten().try_for_each(|star| add(build, star));
        // The readers stop when there is no receiver.
        drop(receiver);
        let reports: Vec<Result<ReadReport, CatalogueError>> = readers
            .into_iter()
            .map(|reader| reader.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)))
            .collect();
        added.map(|()| reports)
    })?;
    for ((index, _), report) in streamed.iter().zip(reports) {
        let report = report?;
        tracing::info!("{report}");
        read[*index] = Some(Rows::of_table(report));
    }
    let digests = sources.par_iter().map(|source| if is_part { source.digest() } else { Ok(String::new()) });
    let digests: Vec<String> = digests.collect::<Result<_, _>>()?;
    let inputs = read.into_iter().flatten().zip(digests);
    Ok(inputs.map(|(rows, digest)| ReadInput { rows, digest }).collect())
}

/// Adds the stars of the built-in table or of a store, and returns their number.
fn add_whole(source: &ImportSource, build: &mut Build) -> Result<u64, DeepError> {
    let mut count: u64 = 0;
    match source {
        ImportSource::Bright => {
            let CatalogueRead { stars, velocities, .. } = bright::read(0.0);
            let mut velocity_of = velocity_by_star(&velocities);
            for (index, star) in stars.into_iter().enumerate() {
                let velocity = velocity_of(index);
                build.add(star, NewStar { velocity, is_built_in: true, ..NewStar::default() })?;
                count += 1;
            }
        }
        ImportSource::File(path) => {
            let mut sink = |star: StarRecord, _: f64, about: NewStar| {
                count += 1;
                build.add(star, about)
            };
            let all = Selection::default();
            if is_deep_store(path) {
                each_star(&DeepStore::open_whole(path)?, &all, &mut sink, &mut |_| ())?;
            } else {
                each_bright_star(&store::read(path)?, &all, &mut sink)?;
            }
        }
    }
    Ok(count)
}

/// Adds a star that was read from a file.
fn add(build: &mut Build, streamed: StreamedStar) -> Result<(), DeepError> {
    let StreamedStar { mut star, mut velocity, names, without_colour, parallax } = streamed;
    let prior = parallax.and_then(prior_distance_pc);
    if let Some(distance_pc) = prior {
        (star, velocity) = at_distance(star, velocity, distance_pc);
    }
    build.add(star, NewStar { velocity, names, without_colour, prior_distance: prior.is_some(), is_built_in: false })
}

/// Moves a star to another distance; its direction, apparent magnitude and proper motion stay the same.
fn at_distance(star: StarRecord, velocity: Option<[f32; 3]>, distance_pc: f64) -> (StarRecord, Option<[f32; 3]>) {
    let before = star.position.length();
    let v_mag = star.apparent_magnitude();
    let moved = StarRecord {
        position: star.position * (distance_pc / before),
        magnitude: (v_mag - distance_modulus(distance_pc)) as f32,
        distance_known: true,
        ..star
    };
    (moved, velocity.map(|velocity| velocity.map(|axis| axis * (distance_pc / before) as f32)))
}
