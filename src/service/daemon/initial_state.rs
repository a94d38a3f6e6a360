//! The state that a daemon begins with: from its configuration, then from its state file.

use std::sync::Arc;

use super::{SceneOptions, ServeError, ViewOptions};
use crate::{
    config::ViewSpec,
    plan::settings::RenderSettings,
    scene::{SceneClock, SceneSnapshot, SeenStars},
    service::{
        displays::headset::HeadsetOptions,
        scene::{objects::Objects, state::SceneState, views::ViewSet},
        state_file::{StateError, StateFile},
        time_source::TimeSource,
        wire::camera::camera_from_pb,
    },
    view::{RigError, check_name},
};

/// Initial state of a daemon.
pub(super) struct Begun {
    pub(super) scene: SceneSnapshot,
    pub(super) objects: Objects,
    pub(super) clock: SceneClock,
    pub(super) views: ViewSet,
    pub(super) settings: RenderSettings,
}

/// Returns the initial state with the saved values of a state file.
fn restored(file: &StateFile, begun: Begun, time: &TimeSource) -> Result<Begun, StateError> {
    let Begun { mut scene, mut objects, mut clock, mut views, mut settings } = begun;
    let (saved, camera) = file.current_state()?;
    if let Some(saved) = saved {
        let configured = SceneState {
            revision: scene.revision,
            stars: settings.stars.clone(),
            asteroids: settings.asteroids.clone(),
            objects,
            clock,
            views: Arc::new(views),
            jumps: 0,
        };
        let restored = saved.applied(&configured, &settings, time.now()).map_err(|problem| file.content(problem))?;
        let revision = saved.scene.as_ref().map_or(restored.revision, |scene| scene.revision);
        tracing::info!("restored revision {revision} of the scene");
        let of_clients = restored.views.kept().filter(|view| view.geometry.has_keys()).map(|view| view.name);
        let of_clients: Vec<String> = of_clients.collect();
        if !of_clients.is_empty() {
            tracing::info!("restored views that clients have defined: {}", of_clients.join(", "));
        }
        let deleted: Vec<&str> = restored.views.deleted().collect();
        if !deleted.is_empty() {
            tracing::info!("views of the configuration that clients have deleted: {}", deleted.join(", "));
        }
        let kept = |name: &str| restored.objects.drawn.bodies.iter().any(|body| body.name == name);
        let bodies = scene.objects.bodies.iter().map(|body| body.name.as_str());
        let gone: Vec<&str> = bodies.filter(|name| !kept(name)).collect();
        if !gone.is_empty() {
            tracing::info!(
                "bodies of the configuration that are not restored, because the state file lacks them: {}",
                gone.join(", ")
            );
        }
        let (before, after) = (scene.objects.observer, restored.objects.drawn.observer);
        if before.map(|observer| observer.place) != after.map(|observer| observer.place) {
            tracing::info!("the place of the observer comes from the state file, not from the configuration");
        }
        let camera = scene.camera.on_horizon_of(before.as_ref(), after.as_ref());
        scene = SceneSnapshot { revision, objects: Arc::clone(&restored.objects.drawn), camera, ..scene };
        clock = saved.clock(restored.clock, time);
        (settings.stars, settings.asteroids) = (restored.stars, restored.asteroids);
        (objects, views) = (restored.objects, Arc::unwrap_or_clone(restored.views));
    }
    if let Some(camera) = camera {
        scene.camera = camera_from_pb(camera).map_err(|error| file.content(format!("the camera: {error}")))?;
    }
    Ok(Begun { scene, objects, clock, views, settings })
}

impl Begun {
    /// Returns the initial state and the stars as the configuration's observer sees them.
    pub(super) fn new(
        scene: SceneOptions,
        views: ViewOptions,
        headset: Option<&HeadsetOptions>,
        file: Option<&StateFile>,
    ) -> Result<(Self, Arc<SeenStars>), ServeError> {
        let SceneOptions { snapshot: scene, clock, time, asteroid_fields, observer, star_sources, .. } = scene;
        let ViewOptions { rig, settings, specs, folder } = views;
        let objects =
            Objects::new(Arc::clone(&scene.objects), &asteroid_fields, observer).map_err(ServeError::Objects)?;
        if let Some(HeadsetOptions { name, .. }) = headset {
            check_name(name).map_err(ServeError::Headset)?;
        }
        let specified = rig.views().iter().enumerate().map(|(index, view)| {
            let spec = specs.get(index).cloned();
            (spec.unwrap_or_else(|| ViewSpec::custom(&view.name)), view.clone())
        });
        let views = ViewSet::new(&settings, specified.collect(), &folder).map_err(ServeError::Views)?;
        let mut clock = clock.unwrap_or_else(|| SceneClock::stopped(scene.objects.time_s));
        // The machine's clock may have been set back since the configuration was read.
        clock.since = clock.since.min(time.now());
        // The state file may have another place of the observer.
        let seen_stars = SeenStars::new(Arc::clone(&scene.stars), scene.objects.observer.as_ref(), star_sources);
        let mut begun = Self { scene, objects, clock, views, settings };
        if let Some(file) = file {
            begun = restored(file, begun, &time)?;
        }
        if let Some(HeadsetOptions { name, .. }) = headset.filter(|headset| begun.views.named(&headset.name).is_some())
        {
            return Err(ServeError::Headset(RigError::Duplicate { name: name.clone() }));
        }
        Ok((begun, seen_stars))
    }
}
