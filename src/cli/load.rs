//! Loading stars with progress, and the warnings about what was found on the way.

use super::CliError;
use super::progress::LoadingProgress;
use crate::catalogue::chunks::StarSet;
use crate::scene::loader::{LoadReport, StarSource, load_stars};

/// Loads the catalogues, shows progress, and warns of rejected rows and of stars that stand in two catalogues. `origin`
/// names the configuration in errors; empty for arguments.
pub fn stars(sources: &[StarSource], origin: &str) -> Result<(StarSet, LoadReport), CliError> {
    let mut progress = LoadingProgress::new();
    let loaded = load_stars(sources, &mut |step| progress.step(&step));
    let (set, report) = loaded.map_err(|source| CliError::Load {
        origin: if origin.is_empty() { String::new() } else { format!("{origin}: ") },
        source,
    })?;
    progress.finish(set.stars.len());
    for rows in report.catalogues.iter().filter_map(|catalogue| catalogue.rows.as_ref()) {
        if rows.rejected > 0 {
            tracing::warn!("{rows}");
        } else {
            tracing::info!("{rows}");
        }
    }
    for overlap in &report.overlaps {
        tracing::warn!("{overlap}: catalogues add up, so they shine twice");
    }
    Ok((set, report))
}
