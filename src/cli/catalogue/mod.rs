//! `catalogue`: star catalogues and their stores.

mod deep;
mod ranges;
mod single;

use std::path::{Path, PathBuf};

use clap::{Args, Subcommand};

use self::ranges::{Cone, Range};
use super::CliError;
use super::output::refuse_own_input;
use crate::cache;
use crate::catalogue::bright;
use crate::catalogue::deep::build::DEFAULT_MEMORY;
use crate::catalogue::deep::cell_range::CellRange;
use crate::catalogue::deep::slice::Selection;
use crate::catalogue::galaxy::{GalaxyParameters, MOST_STARS, stream::MOST_STREAMED};
use crate::catalogue::store;
use crate::memory_size::MemorySize;
use crate::scene::loader::StarSource;

/// Arguments of `catalogue`.
#[derive(Debug, Args)]
pub struct CatalogueArguments {
    #[command(subcommand)]
    command: CatalogueCommand,
}

#[derive(Debug, Subcommand)]
enum CatalogueCommand {
    /// Read catalogues (CSV, TSV, ECSV, JSON, VOTable, FITS, Parquet, also compressed with gzip; stores; folders of catalogues in HATS;
    /// builtin:bright) and write them as one store.
    #[command(after_help = "Examples:\n  \
        steradian catalogue import hipparcos.vot.gz --out hipparcos.stars\n  \
        steradian catalogue import builtin:bright faint.json --out sky.stars\n  \
        steradian catalogue import builtin:bright gaia/*.csv.gz --memory 2GiB --out gaia\n  \
        steradian catalogue import builtin:bright gaia/*.csv.gz --cells 0..384 --out part-0\n\n\
        A row that cannot be used is reported with its line number; exit code 65 if no row is usable.")]
    Import {
        /// Catalogues, concatenated.
        #[arg(required = true, value_name = "FILE")]
        files: Vec<PathBuf>,
        #[command(flatten)]
        output: Output,
        #[command(flatten)]
        share: Share,
    },
    /// Join the parts of a deep store that were made with `--cells`. The result has the same bytes as a store made in one run.
    #[command(after_help = "Example:\n  steradian catalogue merge part-* --out gaia\n\n\
        Parts must have the same inputs and be made by the same version, and each cell must be in one of them.")]
    Merge {
        /// The parts, in any order.
        #[arg(required = true, value_name = "STORE")]
        parts: Vec<PathBuf>,
        /// Folder to write. The parts are kept.
        #[arg(long, value_name = "STORE")]
        out: PathBuf,
    },
    /// Show the contents of a store.
    #[command(after_help = "Example:\n  steradian catalogue info hipparcos.stars")]
    Info {
        /// The store.
        #[arg(value_name = "STORE")]
        store: PathBuf,
    },
    /// Read a whole store and compare all its checksums.
    #[command(after_help = "Example:\n  steradian catalogue check galaxy --light\n\n\
        Exit code 65 if the store is damaged; the message names the file and the leaf or tile.")]
    Check {
        /// The store.
        #[arg(value_name = "STORE")]
        store: PathBuf,
        /// Also compare every composite star with the stars of its cell, and the light of the planes and the index with the light of the leaves.
        #[arg(long)]
        light: bool,
    },
    /// Write a part of a store as another store.
    #[command(after_help = "Examples:\n  \
        steradian catalogue slice galaxy --cone 83.8,-5.4,10 --out orion\n  \
        steradian catalogue slice galaxy --magnitudes 13..16 --distances-pc 0..500 --out near")]
    Slice {
        /// The store.
        #[arg(value_name = "STORE")]
        store: PathBuf,
        #[command(flatten)]
        part: Part,
        #[command(flatten)]
        output: Output,
    },
    /// Write the stars of a store as CSV or Parquet, with columns that `import` reads.
    #[command(after_help = "Examples:\n  \
        steradian catalogue export hipparcos.stars --out hipparcos.csv\n  \
        steradian catalogue export galaxy --magnitudes ..15 --out bright.parquet")]
    Export {
        /// The store.
        #[arg(value_name = "STORE")]
        store: PathBuf,
        #[command(flatten)]
        part: Part,
        /// The file to write; its name ends with .csv or .parquet.
        #[arg(long, value_name = "FILE")]
        out: PathBuf,
    },
    /// Generate a synthetic Milky Way and write it as a store.
    #[command(after_help = "Examples:\n  \
        steradian catalogue synth --stars 10000000 --seed 1 --out galaxy.stars\n  \
        steradian catalogue synth --stars 300000 --seed 1 --fainter-than 3.5 --out faint.stars\n  \
        steradian catalogue synth --stars 1000000000 --seed 1 --memory 2GiB --out galaxy")]
    Synth {
        /// Number of stars. They are the stars of the model that appear brightest from the Sun.
        #[arg(long, value_name = "N", value_parser = star_count, allow_negative_numbers = true)]
        stars: usize,
        /// Seed of the random number generator: the same seed gives the same stars.
        #[arg(long, value_name = "S", allow_negative_numbers = true)]
        seed: u64,
        /// Leave out stars that are brighter than this apparent V magnitude.
        #[arg(long, value_name = "MAGNITUDE", allow_negative_numbers = true)]
        fainter_than: Option<f64>,
        #[command(flatten)]
        output: Output,
        #[command(flatten)]
        share: Share,
    },
}

/// The store to write.
#[derive(Debug, Args)]
struct Output {
    /// The store to write: a file, or a folder (a deep store) with --memory or if the name ends with a slash.
    #[arg(long, value_name = "STORE")]
    out: PathBuf,
    /// Write a deep store, for catalogues larger than memory, and use at most this much memory (64MiB and more, such as 1GiB). An
    /// interrupted command continues if it is run again.
    #[arg(long, value_name = "SIZE", allow_hyphen_values = true)]
    memory: Option<MemorySize>,
}

/// Division of the work among several programs.
#[derive(Debug, Args)]
struct Share {
    /// Write a part of a deep store, with the stars in these cells of HEALPix order 4 (nested, 0..3072); `catalogue merge` joins the parts.
    #[arg(long, value_name = "A..B", allow_hyphen_values = true)]
    cells: Option<CellRange>,
}

impl Output {
    /// Returns the memory limit, bytes; `None` if no deep store is requested.
    fn deep_memory(&self) -> Option<u64> {
        let name = self.out.as_os_str().to_string_lossy();
        self.memory.map(|size| size.bytes).or_else(|| name.ends_with(std::path::is_separator).then_some(DEFAULT_MEMORY))
    }
}

/// Selects stars of a store. Without options, all of them are selected.
#[derive(Debug, Args)]
struct Part {
    /// Only stars in a cone: right ascension and declination of its axis and its half-angle, degrees.
    #[arg(long, value_name = "RA,DEC,RADIUS", allow_hyphen_values = true)]
    cone: Option<Cone>,
    /// Only stars of these apparent V magnitudes, such as 13..16 or ..15.
    #[arg(long, value_name = "A..B", allow_hyphen_values = true)]
    magnitudes: Option<Range>,
    /// Only stars at these distances, pc; stars at infinity are left out.
    #[arg(long, value_name = "A..B", allow_hyphen_values = true)]
    distances_pc: Option<Range>,
}

impl Part {
    fn selection(&self) -> Selection {
        Selection {
            cone: self.cone.map(|cone| (cone.axis, cone.half_rad)),
            magnitudes: self.magnitudes.map(|range| range.0),
            distances_pc: self.distances_pc.map(|range| range.0),
        }
    }
}

fn star_count(text: &str) -> Result<usize, String> {
    let valid = format!("must be a whole number between 1 and {MOST_STREAMED}");
    match text.parse() {
        Ok(stars) if (1..=MOST_STREAMED as usize).contains(&stars) => Ok(stars),
        _ => Err(valid),
    }
}

/// Runs the command. Every folder is opened as a deep store, so that a folder without an index is reported as such.
pub fn run(arguments: CatalogueArguments) -> Result<(), CliError> {
    match arguments.command {
        CatalogueCommand::Import { files, output, share: Share { cells } } => {
            check_output(&output.out, files.iter().map(PathBuf::as_path))?;
            let sources: Vec<StarSource> = files.into_iter().map(source_of).collect();
            // Folders are deep stores or catalogues in HATS, which may not fit in memory.
            let has_folder = sources.iter().any(|source| matches!(source, StarSource::File(path) if path.is_dir()));
            match output.deep_memory().or((has_folder || cells.is_some()).then_some(DEFAULT_MEMORY)) {
                Some(memory_bytes) => deep::import(&sources, &output.out, memory_bytes, cells),
                None => single::write(&sources, &output.out),
            }
        }
        CatalogueCommand::Synth { stars, seed, fainter_than, output, share: Share { cells } } => {
            let parameters = GalaxyParameters { stars, seed, fainter_than, unresolved_light: false };
            // More stars than this do not fit in a store in one file.
            let is_deep = stars > MOST_STARS || cells.is_some();
            let memory = output.deep_memory().or_else(|| is_deep.then_some(DEFAULT_MEMORY));
            check_output(&output.out, [])?;
            // The result is itself a file, so the cache need not keep the stars.
            cache::set_for_process(None);
            match memory {
                Some(memory_bytes) => deep::synth(&parameters, &output.out, memory_bytes, cells),
                None => single::write(&[StarSource::Galaxy(parameters)], &output.out),
            }
        }
        CatalogueCommand::Merge { parts, out } => deep::merge(&parts, &out),
        CatalogueCommand::Info { store } if store.is_dir() => deep::info(&store),
        CatalogueCommand::Info { store } => single::info(&store),
        CatalogueCommand::Check { store, light } if store.is_dir() => deep::check(&store, light),
        CatalogueCommand::Check { store, light } => single::check(&store, light),
        CatalogueCommand::Slice { store, part, output } if store.is_dir() => {
            check_output(&output.out, [store.as_path()])?;
            deep::slice(&store, &part.selection(), &output.out, output.memory.map_or(DEFAULT_MEMORY, |size| size.bytes))
        }
        CatalogueCommand::Slice { store, part, output } => match output.deep_memory() {
            Some(_) => Err(CliError::Usage(format!(
                "--memory: {} is a store in one file, and a part of it is such a file again; import it to make a deep store",
                store.display()
            ))),
            None => {
                check_output(&output.out, [store.as_path()])?;
                single::slice(&store, &part.selection(), &output.out)
            }
        },
        CatalogueCommand::Export { store, part, out } if store.is_dir() => {
            deep::export(&store, &part.selection(), &out)
        }
        CatalogueCommand::Export { store, part, out } => {
            refuse_own_input(&out, [store.as_path()])?;
            single::export(&store, &part.selection(), &out)
        }
    }
}

/// Refuses an output path that leads to an input, or to an existing file that is not a store: that file would be lost.
fn check_output<'a>(out: &Path, inputs: impl IntoIterator<Item = &'a Path>) -> Result<(), CliError> {
    refuse_own_input(out, inputs)?;
    if out.is_file() && store::read_header(out).is_err() {
        let problem = "exists and is not a store of stars: choose another file, or remove this one";
        return Err(CliError::Usage(format!("--out: {} {problem}", out.display())));
    }
    Ok(())
}

fn source_of(file: PathBuf) -> StarSource {
    if file.as_os_str() == bright::NAME { StarSource::Bright } else { StarSource::File(file) }
}
