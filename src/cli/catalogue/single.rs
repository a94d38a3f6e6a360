//! Stores in one file.

use std::path::Path;

use crate::catalogue::deep::export::{self, Rows};
use crate::catalogue::deep::slice::Selection;
use crate::catalogue::packed::PackedStar;
use crate::catalogue::reader::NAMED_STARS_KEPT;
use crate::catalogue::store::{self, Store};
use crate::cli::{CliError, load, results};
use crate::scene::loader::{LoadError, LoadedCatalogue, StarSource};
use crate::units::{illuminance_lx_from_magnitude, magnitude_from_illuminance_lx};

/// Writes catalogues as one store, and reports the omitted data.
pub fn write(sources: &[StarSource], out: &Path) -> Result<(), CliError> {
    let (mut store, report) = load::import(sources).map_err(|error| match error {
        // In this command the parameters come from the command line, so the error must not name configuration keys.
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
        // Report everything in the file that the store does not keep.
        if !rows.unused.is_empty() {
            results::line(format!("not stored: the columns {}", rows.unused.join(", ")))?;
        }
        for note in &rows.notes {
            results::line(format!("note: {note}"))?;
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

/// Checks a store by reading it, which verifies its checksum.
pub fn check(path: &Path, light: bool) -> Result<(), CliError> {
    let store = store::read(path).map_err(CliError::ReadStore)?;
    if light {
        let problem = format!("--light: {} is a store in one file, which has no composite stars", path.display());
        return Err(CliError::Usage(problem));
    }
    results::line(format!("{}: {} stars, the checksum is right", path.display(), store.stars.stars.len()))
}

/// Writes a part of a store as a new store.
pub fn slice(path: &Path, selection: &Selection, out: &Path) -> Result<(), CliError> {
    let whole = store::read(path).map_err(CliError::ReadStore)?;
    let records = whole.records(0.0);
    let keep: Vec<bool> = records.iter().map(|star| selection.contains(star)).collect();
    let (velocities, names) = store::kept(&keep, &whole.velocities, whole.names);
    let records: Vec<_> = records.into_iter().zip(&keep).filter(|(_, keep)| **keep).map(|(star, _)| star).collect();
    if records.is_empty() {
        let problem = format!("{} has no star in this selection: {}", path.display(), selection.describe());
        return Err(CliError::Usage(problem));
    }
    let stars = records.len();
    let description = format!("{}\npart: {}", whole.description, selection.describe());
    store::write(out, &Store::from_records(description, records, velocities, names)).map_err(CliError::WriteStore)?;
    results::line(format!("wrote {}: {stars} of {} stars", out.display(), keep.len()))
}

/// Writes the stars of a store as a table.
pub fn export(path: &Path, selection: &Selection, out: &Path) -> Result<(), CliError> {
    let store = store::read(path).map_err(CliError::ReadStore)?;
    let rows = export::export(Rows::Single(&store), selection, out, &mut |_| ()).map_err(CliError::Deep)?;
    results::line(format!("wrote {}: {rows} stars", out.display()))
}

/// Reports the contents of a store.
pub fn info(path: &Path) -> Result<(), CliError> {
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
    results::line(format!("illuminance       {total_lx:.4e} lx in total, as seen from the Solar System"))
}

fn apparent_lx(star: &PackedStar, distance_pc: f64) -> f64 {
    star.illuminance_at_1_pc_lx() / (distance_pc * distance_pc)
}
