//! Preparation of the first frame: loads stars and compiles pipelines, with progress.

use std::sync::Arc;
use std::thread::{self, JoinHandle};

use super::CliError;
use super::progress::Progress;
use crate::catalogue::chunks::StarSet;
use crate::catalogue::epoch::Epoch;
use crate::catalogue::store::Store;
use crate::config::{Config, ConfigError};
use crate::plan::view_settings::FrameGroup;
use crate::render::{RenderError, Renderer, Wanted};
use crate::scene::SceneObjects;
use crate::scene::loader::{LoadError, LoadReport, StarSource, import_stars, load_stars};
use crate::service::StartProgress;

/// Everything of a scene except the stars, computed by a thread: most commands open the adapter meanwhile.
pub struct PendingObjects(JoinHandle<Result<SceneObjects, ConfigError>>);

impl PendingObjects {
    /// Begins to compute the scene of a configuration.
    pub fn begin(config: &Config) -> Self {
        let config = config.clone();
        Self(thread::spawn(move || config.objects()))
    }

    fn wait(self) -> Result<Arc<SceneObjects>, CliError> {
        Ok(Arc::new(self.0.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))?))
    }
}

/// The scene of a configuration.
pub struct LoadedScene {
    /// The stars.
    pub stars: StarSet,
    /// Report of the loader.
    pub report: LoadReport,
    /// Everything except the stars.
    pub objects: Arc<SceneObjects>,
    /// Whether the driver accepted all shaders.
    pub prepared: Result<(), RenderError>,
}

/// Loads the scene of a configuration and meanwhile compiles the pipelines for the `wanted` images of all views. Also reports the progress to `told`.
pub fn scene(
    config: &Config,
    objects: PendingObjects,
    groups: &[FrameGroup],
    wanted: Wanted,
    renderer: &mut Renderer,
    told: Option<&StartProgress>,
) -> Result<LoadedScene, CliError> {
    let objects = objects.wait()?;
    warn_of_asteroids_between_eyes(config, groups);
    let (prepared, loaded) = thread::scope(|scope| {
        let preparing = scope.spawn(|| {
            tracing::info!("preparing shaders");
            let progress = Progress::of_start(told, "shaders");
            let mut report_step = |step| progress.prepare_step(step);
            let prepared = groups.iter().try_for_each(|FrameGroup { rig, settings, .. }| {
                renderer.prepare(&objects, rig, settings, wanted, &[], &mut report_step)
            });
            tracing::info!("shaders ready after {:.1} s", progress.finish());
            prepared
        });
        let loaded = stars(&config.star_sources(), &config.epoch(), &config.origin, told);
        (preparing.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)), loaded)
    });
    let (stars, report) = loaded?;
    Ok(LoadedScene { stars, report, objects, prepared })
}

/// Warns that asteroids in omni-directional stereo are drawn from the midpoint between the eyes, and reports the
/// distance beyond which they are correct.
fn warn_of_asteroids_between_eyes(config: &Config, groups: &[FrameGroup]) {
    if config.asteroid_fields.is_empty() {
        return;
    }
    for view in groups.iter().flat_map(|group| group.rig.views()) {
        if let Some(image) = view.images.first().filter(|image| image.viewing_circle_m != 0.0) {
            let from_m = image.viewing_circle_m.abs() / image.projection.middle_pixel_rad();
            tracing::warn!(
                "{}: view {}: asteroids are drawn from the midpoint between its eyes; the error is below one pixel from {from_m:.3e} m on",
                config.origin,
                view.name
            );
        }
    }
}

/// Loads the catalogues with progress, and warns of rejected rows and of stars listed in two catalogues. `origin` names the configuration in errors;
/// it is empty for command-line arguments. Also reports the progress to `told`.
pub fn stars(
    sources: &[StarSource],
    epoch: &Epoch,
    origin: &str,
    told: Option<&StartProgress>,
) -> Result<(StarSet, LoadReport), CliError> {
    let progress = Progress::of_start(told, "stars");
    let loaded = load_stars(sources, epoch, &mut |step| progress.load_step(&step));
    let (set, report) = loaded.map_err(|source| CliError::Load {
        origin: if origin.is_empty() { String::new() } else { format!("{origin}: ") },
        source,
    })?;
    tracing::info!("{} stars ready after {:.1} s", set.stars.len(), progress.finish());
    log(&report);
    Ok((set, report))
}

/// Reads catalogues for a store, with progress and the same warnings.
pub fn import(sources: &[StarSource]) -> Result<(Store, LoadReport), LoadError> {
    let progress = Progress::new();
    let (store, report) = import_stars(sources, &mut |step| progress.load_step(&step))?;
    tracing::info!("{} stars ready after {:.1} s", store.stars.stars.len(), progress.finish());
    log(&report);
    Ok((store, report))
}

fn log(report: &LoadReport) {
    for rows in report.catalogues.iter().filter_map(|catalogue| catalogue.rows.as_ref()) {
        if rows.rejected > 0 {
            tracing::warn!("{rows}");
        } else {
            tracing::info!("{rows}");
        }
    }
    for overlap in &report.overlaps {
        tracing::warn!("{overlap}: both entries are added, so these stars are twice as bright");
    }
    for repetition in &report.repetitions {
        tracing::warn!(
            "{repetition}: these are double stars, or stars that are listed twice and therefore twice as bright; all entries are added"
        );
    }
}
