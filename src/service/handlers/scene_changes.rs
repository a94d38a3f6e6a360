//! Methods that change the scene, and snapshots. A change is prepared, checked by a plan, and saved before it is
//! applied and acknowledged. Changes of views are in [`super::view_changes`].

use std::sync::Arc;

use tokio::task;
use tokio_stream::wrappers::ReceiverStream;
use tonic::{Request, Response, Status};

use super::{
    camera::unmoved,
    service::{MOST_ATTEMPTS, Service, changed_meanwhile, unchanged},
};
use crate::{
    plan::{Output, PlanOutputs, settings::AsteroidSettings, view_settings::FrameGroup},
    scene::{SceneObjects, SceneSnapshot, asteroids::ShapeSet},
    service::{
        frames::errors::{Refused, refused},
        network::{access::By, clients::ClientInfo},
        proto,
        scene::{
            excerpts::listed,
            state::{MadeUpdate, SceneError, SceneState, SceneUpdate},
        },
        state_file::{Saved, SnapshotName, StateError, StateFile},
        threads,
        wire::{camera, refusals, scene},
    },
    view::check_name,
};

/// Maximum length of a snapshot's name, characters.
const MOST_NAME: usize = 64;

/// Maximum memory on the adapter for the impostor atlases of all shapes of a scene. Rendering the atlases needs twice as much in addition.
const MOST_ATLAS_BYTES: u64 = 512 << 20;

impl Service {
    /// Checks that frames of a scene can be drawn with the current camera and adapter, so that an accepted change
    /// cannot fail later.
    pub(crate) async fn plan(&self, snapshot: SceneSnapshot, groups: Vec<FrameGroup>) -> Result<(), Status> {
        // Plan one at a time: each plan may take long, and much memory.
        let planner = Arc::clone(&self.planner).lock_owned().await;
        let limits = Arc::clone(&self.limits);
        let planning = move || {
            let mut planner = planner;
            threads::on_own_cores(|| {
                groups.iter().try_for_each(|group| {
                    let outputs = PlanOutputs::new(Output::Hdr);
                    planner.plan(&snapshot, &group.rig, &group.settings, None, outputs, &limits).map(drop)
                })
            })
        };
        let planned = task::spawn_blocking(planning).await;
        let planned = planned.map_err(|error| Status::internal(format!("planning a frame failed: {error}")))?;
        planned.map_err(|error| refusals::invalid(error.to_string()))
    }

    /// Returns the scene after a change if it can be drawn.
    pub(crate) async fn changed_scene(
        &self,
        update: &SceneUpdate,
        expected: Option<u64>,
    ) -> Result<SceneState, Status> {
        for _ in 0..MOST_ATTEMPTS {
            let scene = self.scene_of(expected)?;
            update.overlay.check_views(&self.view_names(&scene)).map_err(refusals::invalid)?;
            let made = self.made(update, &scene).await?;
            let changed =
                scene.clone().changed(&made, expected, self.render.time().now()).map_err(|error| unchanged(&error))?;
            let covered = changed.objects.check_covered(&scene.objects, update.time_s.is_some());
            covered.map_err(refusals::invalid)?;
            if update.needs_plan_check() {
                self.prepare(&scene, &changed).await?;
            }
            if let Some(scene) = self.commit(changed, scene.revision, expected).await? {
                return Ok(scene);
            }
        }
        Err(changed_meanwhile())
    }

    /// Checks that a scene can be drawn, and prepares data that its first frame would wait for.
    async fn prepare(&self, before: &SceneState, after: &SceneState) -> Result<(), Status> {
        check_atlases(before, after)?;
        let groups = after.views.frame_groups(&self.render.general(after));
        self.plan(self.render.snapshot(after), groups.clone()).await?;
        let new = new_sets(before, after);
        // If the change removes all fields, this releases the data of the earlier ones.
        let ends_fields = !before.objects.drawn.fields.is_empty() && after.objects.drawn.fields.is_empty();
        let needs_shaders = !new.is_empty() || brings_shaders(&before.objects.drawn, &after.objects.drawn);
        let pipelines = self.background_jobs.pipelines.clone();
        if needs_shaders {
            pipelines.begin(Arc::clone(&after.objects.drawn), groups);
        }
        if !new.is_empty() || ends_fields {
            let baked = self.background_jobs.bake(new, after.asteroids.clone()).await.map_err(refused)?;
            baked.map_err(refusals::invalid)?;
        }
        if needs_shaders {
            let waited = task::spawn_blocking(move || pipelines.wait()).await;
            waited.map_err(|error| Status::internal(format!("waiting for pipelines failed: {error}")))?;
            let compiled = self.background_jobs.compile().await.map_err(refused)?;
            compiled.map_err(Status::internal)?;
        }
        Ok(())
    }

    /// Returns the scene if it has the expected revision.
    pub(crate) fn scene_of(&self, expected: Option<u64>) -> Result<SceneState, Status> {
        let scene = self.render.scene().map_err(refused)?;
        scene.expect(expected).map_err(|error| unchanged(&error))?;
        Ok(scene)
    }

    /// Replaces the scene that a change was made for. Returns `None` if another change came first and the client expected no particular revision; the
    /// caller then repeats the change.
    pub(crate) async fn commit(
        &self,
        scene: SceneState,
        made_for: u64,
        expected: Option<u64>,
    ) -> Result<Option<SceneState>, Status> {
        match self.replace(scene, made_for).await? {
            Ok(scene) => Ok(Some(scene)),
            Err(SceneError::Revision { .. }) if expected.is_none() => Ok(None),
            Err(error) => Err(unchanged(&error)),
        }
    }

    /// Saves a change, if there is a state file, and then applies it.
    async fn replace(&self, scene: SceneState, made_for: u64) -> Result<Result<SceneState, SceneError>, Status> {
        // Apply one change at a time, so that the file matches the displayed scene.
        let file = Arc::clone(&self.state).lock_owned().await;
        let now = self.render.scene().map_err(refused)?;
        if let Err(error) = now.expect(Some(made_for)) {
            return Ok(Err(error));
        }
        let render = self.render.clone();
        let writing = move || {
            let next = SceneState { revision: made_for + 1, ..scene };
            if let Some(file) = file.as_ref() {
                file.save(&Saved::from_scene(&next, None, render.time())).map_err(|error| unsaved(&error))?;
            }
            let moves = now.objects.drawn.observer != next.objects.drawn.observer;
            let replaced = render.replace_scene(next, made_for).map_err(refused);
            if let Some(file) = file.as_ref().filter(|_| moves) {
                // The camera has changed with the scene.
                file.save_camera(&render.camera()).map_err(|error| unsaved(&error))?;
            }
            // Log it only after it is applied.
            drop(file);
            replaced
        };
        task::spawn_blocking(writing).await.map_err(|error| Status::internal(format!("saving failed: {error}")))?
    }

    /// Replaces the scene and the camera by those of a snapshot.
    async fn load(&self, saved: &Saved, expected: Option<u64>) -> Result<SceneState, Status> {
        let camera = saved.camera.clone().map(camera::camera_update_from_pb).transpose();
        let camera = camera.map_err(|problem| Status::failed_precondition(format!("camera.{problem}")))?;
        if camera.is_some() {
            // Check this before anything is changed.
            self.render.check_lease(None).map_err(|error| unmoved(&error))?;
        }
        for _ in 0..MOST_ATTEMPTS {
            let scene = self.scene_of(expected)?;
            let (general, of, before) = (self.render.general(&scene), saved.clone(), scene.clone());
            let now = self.render.time().now();
            let changed = self.placed(move || of.applied(&before, &general, now)).await?;
            let changed = changed.map_err(Status::failed_precondition)?;
            if let Some(headset) = &self.headset
                && changed.views.named(headset.name()).is_some()
            {
                let problem = format!("the snapshot has a view `{}`, which is the name of the headset", headset.name());
                return Err(Status::failed_precondition(problem));
            }
            self.prepare(&scene, &changed).await?;
            if let Some(scene) = self.commit(changed, scene.revision, expected).await? {
                if let Some(camera) = &camera {
                    self.render.set_camera(camera, None, None).map_err(|error| {
                        let status = unmoved(&error);
                        // Another client has taken the lease in the meantime.
                        let problem = format!("the scene was loaded, but not its camera: {error}");
                        Status::with_details(status.code(), problem, status.details().to_vec().into())
                    })?;
                }
                return Ok(scene);
            }
        }
        Err(changed_meanwhile())
    }

    /// Accesses the state file.
    async fn with_state<T: Send + 'static>(
        &self,
        job: impl FnOnce(&StateFile) -> Result<T, StateError> + Send + 'static,
    ) -> Result<T, Status> {
        let file = Arc::clone(&self.state).lock_owned().await;
        let done = task::spawn_blocking(move || file.as_ref().map(job)).await;
        match done.map_err(|error| Status::internal(format!("saving failed: {error}")))? {
            Some(done) => done.map_err(|error| unsaved(&error)),
            None => Err(Status::failed_precondition(
                "the daemon keeps no state: start it with --state FILE, or with server.state in its configuration",
            )),
        }
    }

    /// Prepares a change.
    async fn made(&self, update: &SceneUpdate, scene: &SceneState) -> Result<MadeUpdate, Status> {
        if !update.takes_long() {
            return update.make(scene).map_err(refusals::invalid);
        }
        let (update, scene) = (update.clone(), scene.clone());
        self.placed(move || update.make(&scene)).await?.map_err(refusals::invalid)
    }

    /// Runs long work such as placing asteroids one at a time, because each may use all cores and much memory.
    async fn placed<T: Send + 'static>(&self, work: impl FnOnce() -> T + Send + 'static) -> Result<T, Status> {
        let permit = Arc::clone(&self.placing).acquire_owned().await.map_err(|_| refused(Refused::Ending))?;
        let placing = move || {
            // The lock is held until the work is done, even if the caller disconnects.
            let _permit = permit;
            threads::on_own_cores(work)
        };
        let placed = task::spawn_blocking(placing).await;
        placed.map_err(|error| Status::internal(format!("preparing the change failed: {error}")))
    }
}

fn unsaved(error: &StateError) -> Status {
    tracing::error!("{error}");
    match error {
        StateError::Full => refusals::exhausted("snapshots", error.to_string()),
        _ => Status::internal(format!("nothing was changed: {error}")),
    }
}

/// Checks the name of a snapshot.
fn snapshot_name(name: String) -> Result<String, Status> {
    check_name(&name).map_err(|error| refusals::invalid(error.to_string()))?;
    if name.len() > MOST_NAME {
        return Err(refusals::invalid(format!("name: must have at most {MOST_NAME} characters")));
    }
    Ok(name)
}

/// Whether a change adds the first objects of a kind, so that frames need additional shaders.
fn brings_shaders(before: &SceneObjects, after: &SceneObjects) -> bool {
    (before.bodies.is_empty() && !after.bodies.is_empty())
        || (before.surroundings.is_none() && after.surroundings.is_some())
        || (!before.zodiacal_light && after.zodiacal_light)
}

/// Returns the shape sets that are new after a change, or drawn differently, without duplicates.
fn new_sets(before: &SceneState, after: &SceneState) -> Vec<Arc<ShapeSet>> {
    let settings = |scene: &SceneState| {
        let AsteroidSettings { impostor, tiles, tile_px, finest_only, .. } = &scene.asteroids;
        (impostor.chosen(), *tiles, *tile_px, *finest_only)
    };
    let are_others = settings(before) != settings(after);
    let fields = &after.objects.drawn.fields;
    let is_known = |shapes: &Arc<ShapeSet>| {
        before.objects.drawn.fields.iter().any(|field| Arc::ptr_eq(&field.shapes, shapes)) && !are_others
    };
    let mut new: Vec<Arc<ShapeSet>> = Vec::new();
    for field in fields.iter().filter(|field| !is_known(&field.shapes)) {
        if !new.iter().any(|shapes| Arc::ptr_eq(shapes, &field.shapes)) {
            new.push(Arc::clone(&field.shapes));
        }
    }
    new
}

/// Checks that the impostor atlases of a scene fit. Those of the configuration may be larger, but must not grow.
fn check_atlases(before: &SceneState, after: &SceneState) -> Result<(), Status> {
    let bytes = |scene: &SceneState| {
        let mut sets: Vec<(u64, usize)> = Vec::new();
        for field in &scene.objects.drawn.fields {
            let set = (field.shapes.digest, field.shapes.shapes.len());
            if !sets.contains(&set) {
                sets.push(set);
            }
        }
        sets.iter().map(|(_, shapes)| scene.asteroids.atlas_bytes(*shapes)).sum::<u64>()
    };
    let needed = bytes(after);
    if needed <= MOST_ATLAS_BYTES || needed <= bytes(before) {
        return Ok(());
    }
    let [needed, most] = [needed, MOST_ATLAS_BYTES].map(|bytes| bytes >> 20);
    Err(refusals::exhausted(
        "impostor atlases",
        format!(
            "asteroid_fields: the impostors of their shapes need {needed} MiB, but at most {most} MiB are allowed: use fewer seeds or files of \
             shapes, or smaller asteroids.tiles and asteroids.tile_px"
        ),
    ))
}

/// Returns the paths in a mask.
pub(crate) fn paths(mask: Option<prost_types::FieldMask>) -> Vec<String> {
    mask.map(|mask| mask.paths).unwrap_or_default()
}

#[tonic::async_trait]
impl proto::scene_service_server::SceneService for Service {
    type WatchSceneStream = ReceiverStream<Result<proto::Scene, Status>>;

    async fn get_scene(&self, _: Request<proto::GetSceneRequest>) -> Result<Response<proto::Scene>, Status> {
        let scene = self.render.scene().map_err(refused)?;
        Ok(Response::new(scene::scene_to_pb(&scene, &self.catalogues, self.render.time())))
    }

    async fn update_scene(
        &self,
        request: Request<proto::UpdateSceneRequest>,
    ) -> Result<Response<proto::Scene>, Status> {
        let by = By::from_request(&request)?;
        let _own = by.client().change()?;
        let request = request.into_inner();
        let update = scene::scene_update_from_pb(&request).map_err(refusals::invalid)?;
        let scene = self.changed_scene(&update, request.expected_revision).await?;
        by.changed("UpdateScene", &paths(request.update_mask), scene.revision);
        Ok(Response::new(scene::scene_to_pb(&scene, &self.catalogues, self.render.time())))
    }

    async fn save_snapshot(
        &self,
        request: Request<proto::SaveSnapshotRequest>,
    ) -> Result<Response<proto::Snapshot>, Status> {
        let by = By::from_request(&request)?;
        let _own = by.client().change()?;
        let name = snapshot_name(request.into_inner().name)?;
        let saved =
            Saved::from_scene(&self.render.scene().map_err(refused)?, Some(&self.render.camera()), self.render.time());
        let time = saved.time;
        let saved_name = name.clone();
        self.with_state(move |file| file.save_snapshot(&saved_name, &saved)).await?;
        by.did(&format!("SaveSnapshot of `{name}`"));
        Ok(Response::new(proto::Snapshot { name, time }))
    }

    async fn list_snapshots(
        &self,
        _: Request<proto::ListSnapshotsRequest>,
    ) -> Result<Response<proto::ListSnapshotsResponse>, Status> {
        let names = self.with_state(StateFile::snapshots).await?.into_iter();
        let snapshots = names.map(|SnapshotName { name, time }| proto::Snapshot { name, time }).collect();
        Ok(Response::new(proto::ListSnapshotsResponse { snapshots }))
    }

    async fn load_snapshot(
        &self,
        request: Request<proto::LoadSnapshotRequest>,
    ) -> Result<Response<proto::Scene>, Status> {
        let by = By::from_request(&request)?;
        let _own = by.client().change()?;
        let proto::LoadSnapshotRequest { name, expected_revision } = request.into_inner();
        let requested = name.clone();
        let Some(saved) = self.with_state(move |file| file.snapshot(&requested)).await? else {
            let names = self.with_state(StateFile::snapshots).await?;
            let names = listed(names.iter().map(|known| &*known.name));
            let problem = format!("no snapshot `{name}`; existing ones: {names}");
            return Err(refusals::absent("snapshot", &name, problem));
        };
        let scene = self.load(&saved, expected_revision).await?;
        by.changed("LoadSnapshot", &[name], scene.revision);
        Ok(Response::new(scene::scene_to_pb(&scene, &self.catalogues, self.render.time())))
    }

    async fn identify(
        &self,
        request: Request<proto::IdentifyRequest>,
    ) -> Result<Response<proto::IdentifyResponse>, Status> {
        let client = ClientInfo::from_request(&request)?;
        Ok(Response::new(self.identified(&client, request.get_ref()).await?))
    }

    async fn find(&self, request: Request<proto::FindRequest>) -> Result<Response<proto::FindResponse>, Status> {
        Ok(Response::new(self.found(request.get_ref())?))
    }

    async fn watch_scene(
        &self,
        request: Request<proto::WatchSceneRequest>,
    ) -> Result<Response<Self::WatchSceneStream>, Status> {
        let client = ClientInfo::from_request(&request)?;
        let catalogues = Arc::clone(&self.catalogues);
        let time = self.render.time().clone();
        let to_pb = move |scene: &SceneState| scene::scene_to_pb(scene, &catalogues, &time);
        Ok(Response::new(self.watched(&client, self.render.watch_scene(), to_pb)?))
    }
}
