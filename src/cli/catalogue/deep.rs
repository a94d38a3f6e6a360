//! Deep stores: stores that are folders, for catalogues larger than memory.

use std::path::{Path, PathBuf};

use crate::catalogue::deep::build::{BuildOptions, BuildReport, Tally};
use crate::catalogue::deep::cell_range::CellRange;
use crate::catalogue::deep::export::{self, Rows};
use crate::catalogue::deep::import::{self, ImportReport, ImportSource};
use crate::catalogue::deep::index::Segments;
use crate::catalogue::deep::merge::{self, MergeReport};
use crate::catalogue::deep::part::{Input, PartRecord};
use crate::catalogue::deep::slice::Selection;
use crate::catalogue::deep::{self, DeepError, DeepStore, LAYERS, PLANES, SUM_ORDER, resident, synth};
use crate::catalogue::galaxy::GalaxyParameters;
use crate::cli::progress::BuildProgress;
use crate::cli::{CliError, results};
use crate::photometry::rec709::luminance;
use crate::scene::loader::StarSource;

fn options(out: &Path, memory_bytes: u64, cells: Option<CellRange>) -> BuildOptions {
    BuildOptions { out: out.to_owned(), memory_bytes, job: String::new(), cells }
}

/// Imports catalogues.
pub fn import(sources: &[StarSource], out: &Path, memory_bytes: u64, cells: Option<CellRange>) -> Result<(), CliError> {
    let sources: Vec<ImportSource> = sources
        .iter()
        .map(|source| match source {
            StarSource::File(path) => ImportSource::File(path.clone()),
            _ => ImportSource::Bright,
        })
        .collect();
    let options = options(out, memory_bytes, cells);
    let imported = BuildProgress::during(|on_step| import::import(&sources, options, on_step));
    let ImportReport { build, catalogues } = imported.map_err(write_error)?;
    for catalogue in &catalogues {
        results::line(catalogue)?;
    }
    report(out, &build)
}

/// Makes a synthetic galaxy.
pub fn synth(
    parameters: &GalaxyParameters,
    out: &Path,
    memory_bytes: u64,
    cells: Option<CellRange>,
) -> Result<(), CliError> {
    let options = options(out, memory_bytes, cells);
    let made = BuildProgress::during(|on_step| synth::synthesise(parameters, options, on_step));
    report(out, &made.map_err(write_error)?)
}

/// Joins the parts of a store into a whole store.
pub fn merge(parts: &[PathBuf], out: &Path) -> Result<(), CliError> {
    let merged = BuildProgress::during(|on_step| merge::merge(parts, out, on_step));
    let MergeReport { build, catalogues } = merged.map_err(write_error)?;
    for catalogue in &catalogues {
        results::line(catalogue)?;
    }
    report(out, &build)
}

/// Writes a part of a store as a new store.
pub fn slice(path: &Path, selection: &Selection, out: &Path, memory_bytes: u64) -> Result<(), CliError> {
    let store = open_whole(path)?;
    let options = options(out, memory_bytes, None);
    let made = BuildProgress::during(|on_step| deep::slice::slice(&store, selection, options, on_step));
    let made = made.map_err(|error| match error {
        DeepError::NoStars { .. } => {
            CliError::Usage(format!("{} has no star in this selection: {}", path.display(), selection.describe()))
        }
        other => CliError::Deep(other),
    })?;
    report(out, &made)
}

/// Writes the stars of a store as a table.
pub fn export(path: &Path, selection: &Selection, out: &Path) -> Result<(), CliError> {
    let store = open_whole(path)?;
    let rows = BuildProgress::during(|on_step| export::export(Rows::Deep(&store), selection, out, on_step));
    results::line(format!("wrote {}: {} stars", out.display(), rows.map_err(CliError::Deep)?))
}

/// Checks a store.
pub fn check(path: &Path, light: bool) -> Result<(), CliError> {
    let store = open(path)?;
    let checked = BuildProgress::during(|on_step| deep::check::check(&store, light, on_step));
    let checked = checked.map_err(CliError::Deep)?;
    results::line(format!(
        "{}: {} stars (in {} leaves and the table of bright stars), {} composite stars in {} tiles: all checksums are right",
        path.display(),
        checked.stars,
        checked.leaves,
        checked.composites,
        checked.tiles
    ))?;
    if let Some(difference) = checked.light {
        results::line(format!(
            "light             every composite star matches its cell; sums of planes differ by at most {difference:.1e} from those of their leaves"
        ))?;
    }
    results::line(format!("root checksum     {}", store.root()))
}

fn open(path: &Path) -> Result<DeepStore, CliError> {
    DeepStore::open(path).map_err(CliError::Deep)
}

fn open_whole(path: &Path) -> Result<DeepStore, CliError> {
    DeepStore::open_whole(path).map_err(CliError::Deep)
}

fn write_error(error: DeepError) -> CliError {
    match error {
        DeepError::Galaxy(error) => CliError::Galaxy(error),
        other => CliError::Deep(other),
    }
}

/// Formats the mean bytes per star; empty for a part without stars.
fn a_star(bytes: u64, stars: u64) -> String {
    if stars == 0 { String::new() } else { format!(" ({:.2} a star)", bytes as f64 / stars as f64) }
}

/// Reports a store that was built.
fn report(out: &Path, build: &BuildReport) -> Result<(), CliError> {
    let Tally { counts, median_colour, repeated, listed_again } = build.tally;
    let notes = [
        (counts.prior_distance, "stars with a parallax below 5 times its error, or without one: distance by the prior"),
        (counts.at_infinity, "stars without distance: at infinity"),
        (median_colour, "stars without colour: median temperature of their cell"),
        (counts.bright_without_colour, "bright stars without colour: 5772 K"),
        (
            counts.motions_left_out,
            "not stored: proper motions below 0.2 arcsec per year of stars in leaves; these stars are placed where they were at 2016.0",
        ),
        (counts.names_left_out, "not stored: names of stars in leaves"),
        (counts.too_faint, "not stored: stars fainter than V = 27"),
        (repeated, "not stored: duplicates of other stars"),
        (listed_again, "not stored: stars within 2 arcsec and 1 mag of a star of builtin:bright"),
    ];
    for (count, note) in notes.into_iter().filter(|(count, _)| *count > 0) {
        results::line(format!("{note}: {count}"))?;
    }
    results::line(format!("stored: {} motions, names of {} stars", build.motions, build.names))?;
    let stars = build.bright + build.layers.iter().sum::<u64>();
    let cells = build.cells.map(|cells| format!("cells {cells} of {}, ", CellRange::ALL)).unwrap_or_default();
    results::line(format!(
        "wrote {}: {cells}{stars} stars, {} of them bright, {} bytes{}",
        out.display(),
        build.bright,
        build.bytes,
        a_star(build.bytes, stars)
    ))?;
    results::line(format!("root checksum {}", build.root))
}

/// Reports the contents of a store.
pub fn info(path: &Path) -> Result<(), CliError> {
    let store = open(path)?;
    let index = store.index();
    results::line(format!("store             {} (deep, version {})", path.display(), index.version))?;
    for line in index.description.lines() {
        results::line(format!("from              {line}"))?;
    }
    if let Some(part) = &index.part {
        results::line(format!("cells             {} of {}: a part of a store", part.cells, CellRange::ALL))?;
        for Input { name, digest } in PartRecord::read(path, part).map_err(CliError::Deep)?.inputs {
            results::line(format!(
                "input             {name}{}",
                if name == digest { String::new() } else { format!(" ({digest})") }
            ))?;
        }
    }
    results::line(format!("stars             {}", index.stars()))?;
    results::line(format!(
        "bright            {}: V below {}, nearer than {} pc, or faster than {} arcsec per year",
        index.bright.stars,
        resident::BRIGHTER_THAN,
        resident::NEARER_THAN_PC,
        resident::FASTER_THAN_ARCSEC
    ))?;
    for (layer, leaves) in LAYERS.iter().zip(&index.leaves) {
        results::line(format!("{:<18}{} in leaves of order {}", layer.file(), leaves.stars(), layer.order))?;
    }
    for (kind, tiles) in PLANES.iter().zip(&index.tiles).filter(|(_, tiles)| tiles.stars() > 0) {
        results::line(format!("{:<18}{} composite stars, {} bytes", kind.file(), tiles.stars(), tiles.bytes()))?;
    }
    let light_lx: f64 = index.sums.iter().flatten().map(|light| luminance(*light)).fold(0.0, |sum, light| sum + light);
    results::line(format!(
        "illuminance       {light_lx:.4e} lx from all leaves, summed in cells of order {SUM_ORDER}"
    ))?;
    let epoch = index.epoch_year;
    results::line(format!("epoch             J{epoch:.1} in leaves and planes, J2000.0 in bright"))?;
    let parts: u64 = index.leaves.iter().chain(&index.tiles).map(Segments::bytes).sum();
    results::line(format!(
        "bytes             {}{}, {parts} of them in leaves and planes",
        store.bytes(),
        a_star(store.bytes(), index.stars())
    ))?;
    results::line(format!("root checksum     {}", store.root()))
}
