//! `catalogue import`, `catalogue info`, `catalogue synth`: star catalogues and their stores.

use std::path::{Path, PathBuf};

use clap::{Args, Subcommand};

use super::{CliError, load, results};
use crate::cache;
use crate::catalogue::bright;
use crate::catalogue::galaxy::{GalaxyParameters, MOST_STARS};
use crate::catalogue::packed::PackedStar;
use crate::catalogue::reader::NAMED_STARS_KEPT;
use crate::catalogue::store::{self, Store};
use crate::scene::loader::{LoadError, LoadedCatalogue, StarSource};
use crate::units::{illuminance_lx_from_magnitude, magnitude_from_illuminance_lx};

/// Arguments of `catalogue`.
#[derive(Debug, Args)]
pub struct CatalogueArguments {
    #[command(subcommand)]
    command: CatalogueCommand,
}

#[derive(Debug, Subcommand)]
enum CatalogueCommand {
    /// Read catalogues (CSV, TSV, ECSV, JSON, VOTable, FITS, Parquet, also compressed with gzip; stores; builtin:bright) and write them as
    /// one store.
    #[command(after_help = "Examples:\n  \
        steradian catalogue import hipparcos.vot.gz --out hipparcos.stars\n  \
        steradian catalogue import builtin:bright faint.json --out sky.stars\n\n\
        A row that cannot be used is reported with its line number; exit code 65 if no row is usable.")]
    Import {
        /// Catalogues, concatenated.
        #[arg(required = true, value_name = "FILE")]
        files: Vec<PathBuf>,
        /// The store to write.
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
    /// Generate a synthetic Milky Way and write it as a store.
    #[command(after_help = "Examples:\n  \
        steradian catalogue synth --stars 10000000 --seed 1 --out galaxy.stars\n  \
        steradian catalogue synth --stars 300000 --seed 1 --fainter-than 3.5 --out faint.stars")]
    Synth {
        /// Number of stars: the apparently brightest of the model, as seen from the Sun.
        #[arg(long, value_name = "N", value_parser = star_count)]
        stars: usize,
        /// Seed of the random number generator: the same seed gives the same stars.
        #[arg(long, value_name = "S")]
        seed: u64,
        /// No star brighter than this apparent V magnitude.
        #[arg(long, value_name = "MAGNITUDE", allow_negative_numbers = true)]
        fainter_than: Option<f64>,
        /// The store to write.
        #[arg(long, value_name = "STORE")]
        out: PathBuf,
    },
}

fn star_count(text: &str) -> Result<usize, String> {
    let valid = format!("must be a whole number between 1 and {MOST_STARS}");
    match text.parse() {
        Ok(stars) if (1..=MOST_STARS).contains(&stars) => Ok(stars),
        _ => Err(valid),
    }
}

/// Runs the command.
pub fn run(arguments: CatalogueArguments) -> Result<(), CliError> {
    match arguments.command {
        CatalogueCommand::Import { files, out } => {
            let sources: Vec<StarSource> = files.into_iter().map(source_of).collect();
            write(&sources, &out)
        }
        CatalogueCommand::Synth { stars, seed, fainter_than, out } => {
            // The store is kept already.
            cache::set_for_process(None);
            write(&[StarSource::Galaxy(GalaxyParameters { stars, seed, fainter_than, unresolved_light: false })], &out)
        }
        CatalogueCommand::Info { store } => info(&store),
    }
}

fn source_of(file: PathBuf) -> StarSource {
    if file.as_os_str() == bright::NAME { StarSource::Bright } else { StarSource::File(file) }
}

fn write(sources: &[StarSource], out: &Path) -> Result<(), CliError> {
    let (mut store, report) = load::import(sources).map_err(|error| match error {
        // Here the numbers come from the command line and not from configuration keys.
        LoadError::Galaxy { source, .. } => CliError::Galaxy(source),
        source => CliError::Load { origin: String::new(), source },
    })?;
    let line = |catalogue: &LoadedCatalogue| {
        let source =
            catalogue.rows.as_ref().map(|rows| format!(", read as {}", rows.source.name())).unwrap_or_default();
        format!("{}: {} stars{source}", catalogue.name, catalogue.stars)
    };
    let lines: Vec<String> = report.catalogues.iter().map(line).collect();
    store.description = lines.join("\n");
    store::write(out, &store).map_err(CliError::WriteStore)?;
    for (line, catalogue) in lines.iter().zip(&report.catalogues) {
        let Some(rows) = &catalogue.rows else {
            results::line(line)?;
            continue;
        };
        results::line(format!("{line}, {} of {} rows rejected", rows.rejected, rows.rows))?;
        // Everything that the file has and the store lacks.
        if !rows.unused.is_empty() {
            results::line(format!("not stored: the columns {}", rows.unused.join(", ")))?;
        }
        for note in &rows.notes {
            results::line(format!("not stored: {note}"))?;
        }
        if rows.names_left_out > 0 {
            results::line(format!(
                "not stored: the names of {} stars after the first {NAMED_STARS_KEPT}",
                rows.names_left_out
            ))?;
        }
        if rows.repeated > 0 {
            results::line(format!("not stored: repeated rows: {}", rows.repeated))?;
        }
    }
    results::line(format!("stored: {} motions, names of {} stars", store.velocities.len(), store.names.len()))?;
    results::line(format!(
        "wrote {}: {} stars in {} chunks",
        out.display(),
        store.stars.stars.len(),
        store.stars.chunks.len()
    ))
}

fn info(path: &Path) -> Result<(), CliError> {
    let version = store::read_header(path).map_err(CliError::ReadStore)?.version;
    let Store { description, stars, velocities, names } = store::read(path).map_err(CliError::ReadStore)?;
    results::line(format!("store             {} (version {version})", path.display()))?;
    for line in description.lines() {
        results::line(format!("from              {line}"))?;
    }
    results::line(format!("stars             {}", stars.stars.len()))?;
    let at_infinity: u64 = stars.chunks.iter().filter(|c| c.at_infinity).map(|c| u64::from(c.count)).sum();
    results::line(format!("at infinity       {at_infinity}"))?;
    results::line(format!("with motion       {}", velocities.len()))?;
    results::line(format!("with names        {}", names.len()))?;
    results::line(format!("chunks            {}", stars.chunks.len()))?;

    // Apparent brightness from the barycentre.
    let (mut total_lx, mut brightest, mut faintest, mut naked_eye) = (0.0, f64::INFINITY, f64::NEG_INFINITY, 0u64);
    for (position, at_infinity, star) in stars.iter() {
        let illuminance_lx = apparent_lx(star, if at_infinity { 1.0 } else { position.length() });
        let magnitude = magnitude_from_illuminance_lx(illuminance_lx);
        total_lx += illuminance_lx;
        brightest = magnitude.min(brightest);
        faintest = magnitude.max(faintest);
        naked_eye += u64::from(illuminance_lx > illuminance_lx_from_magnitude(6.0));
    }
    if !stars.stars.is_empty() {
        results::line(format!("apparent V        {brightest:.2} to {faintest:.2}"))?;
    }
    results::line(format!("brighter than V 6 {naked_eye}"))?;
    results::line(format!("illuminance       {total_lx:.4e} lx in all, from the Solar System"))
}

fn apparent_lx(star: &PackedStar, distance_pc: f64) -> f64 {
    star.illuminance_at_1_pc_lx() / (distance_pc * distance_pc)
}
