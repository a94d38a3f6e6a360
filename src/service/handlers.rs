//! The calls: each turns a message into plain values, asks the render thread, and turns the answer into a message.
//!
//! Calls of the camera are in [`super::camera`], frames one by one in [`super::pull`], their encoding in [`super::order`].

use std::{pin::Pin, sync::Arc, time::Duration};

use tokio::{
    sync::{Mutex, OwnedSemaphorePermit, Semaphore, mpsc},
    task,
    time::timeout,
};
use tokio_stream::{Stream, wrappers::ReceiverStream};
use tonic::{Request, Response, Status};

use super::{
    background,
    camera::unmoved,
    clients::{ClientInfo, Held, Shares},
    convert, convert_stats,
    convert_views::{view_to_pb, view_update_from_pb},
    frames::{FrameStream, Source},
    headset::Headset,
    order::{Encoders, Form, Order},
    proto,
    render::{Capacity, Refused, RenderHandle},
    scene::{MadeUpdate, SceneError, SceneState, SceneUpdate},
    server::SceneCatalogue,
    slot::{RenderFailure, RenderedFrame},
    state::{Saved, SnapshotName, StateError, StateFile},
    views::{ViewSet, ViewUpdate},
    workshop::Workshop,
};
use crate::{
    gpu::AdapterReport,
    plan::{
        Limits, Output, PlanOutputs, Planner,
        settings::AsteroidSettings,
        view_settings::{FrameGroup, frame_groups},
    },
    scene::{SceneSnapshot, asteroids::ShapeSet},
    view::{Rig, check_name},
    xr,
};

/// Rates that `StreamFrames` takes, Hz, besides 0.
const RATES_HZ: std::ops::RangeInclusive<f64> = 0.001..=10_000.0;

/// Longest sides of smaller copies, pixels, besides 0.
const MAX_SIZES: std::ops::RangeInclusive<u32> = 16..=16_384;

/// How often a change is checked anew because the scene has changed meanwhile.
const MOST_ATTEMPTS: usize = 8;

/// Longest name of a snapshot, characters.
const MOST_NAME: usize = 64;

/// A session that shows nothing for this long, as while nobody wears the headset, has no frame for a call.
const HEADSET_PATIENCE: Duration = Duration::from_secs(5);

/// What every call needs.
#[derive(Clone)]
pub(super) struct Service {
    pub(super) render: RenderHandle,
    pub(super) headset: Option<Arc<Headset>>,
    rig: Arc<Rig>,
    pub(super) adapter: Arc<AdapterReport>,
    limits: Arc<Limits>,
    catalogues: Arc<Vec<SceneCatalogue>>,
    pub(super) stars: u64,
    /// Streams of the scene and of figures.
    watchers: Arc<Semaphore>,
    pub(super) workshop: Workshop,
    /// Where acknowledged changes are kept; one change after the other.
    pub(super) state: Arc<Mutex<Option<StateFile>>>,
    pub(super) shares: Arc<Shares>,
    /// Calls that place asteroids: one at a time.
    placing: Arc<Semaphore>,
    /// Of calls that plan frames to see whether they can be drawn: one at a time.
    planner: Arc<Mutex<Planner>>,
    /// Calls of Verify: one at a time.
    pub(super) verifying: Arc<Semaphore>,
    /// Calls of RenderFrame that are not finished yet, from the queue to the last encoded byte.
    pending: Arc<Semaphore>,
    pub(super) encoders: Arc<Encoders>,
}

impl Service {
    pub(super) fn new(
        render: RenderHandle,
        headset: Option<Arc<Headset>>,
        rig: Arc<Rig>,
        (adapter, limits): (AdapterReport, Limits),
        (catalogues, stars): (Vec<SceneCatalogue>, u64),
        capacity: Capacity,
        (workshop, shares, state): (Workshop, Arc<Shares>, Option<StateFile>),
    ) -> Self {
        Self {
            render,
            headset,
            rig,
            adapter: Arc::new(adapter),
            limits: Arc::new(limits),
            catalogues: Arc::new(catalogues),
            stars,
            watchers: Arc::new(Semaphore::new(capacity.subscribers)),
            workshop,
            state: Arc::new(Mutex::new(state)),
            shares,
            placing: Arc::new(Semaphore::new(1)),
            planner: Arc::default(),
            verifying: Arc::new(Semaphore::new(1)),
            pending: Arc::new(Semaphore::new(capacity.requests)),
            encoders: Arc::new(Encoders::new()),
        }
    }

    fn view_names(&self) -> Vec<&str> {
        let views = self.rig.views().iter().map(|view| view.name.as_str());
        views.chain(self.headset.iter().map(|headset| headset.name())).collect()
    }

    fn no_view(&self, name: &str) -> Status {
        Status::not_found(format!("no view `{name}`; the views are: {}", self.view_names().join(", ")))
    }

    /// A view as it is in a scene.
    fn view(&self, name: &str, scene: &SceneState) -> Result<proto::View, Status> {
        if let Some(number) = self.rig.index_of(name) {
            return Ok(view_to_pb(&self.rig.views()[number], number, scene));
        }
        let headset = self.headset.as_ref().filter(|headset| headset.name() == name);
        let headset = headset.ok_or_else(|| self.no_view(name))?;
        Ok(convert_stats::headset_view_to_pb(headset, &self.render.general(scene), scene))
    }

    /// The views of a scene after a change of one of them, if they can be drawn then.
    async fn changed_views(&self, scene: &SceneState, number: usize, update: &ViewUpdate) -> Result<ViewSet, Status> {
        let general = self.render.general(scene);
        let views = scene.views.changed(&general, number, update).map_err(Status::invalid_argument)?;
        let before = frame_groups(&self.rig, &general, &scene.views.settings);
        let after = frame_groups(&self.rig, &general, &views.settings);
        // What has not changed is drawn already.
        let changed = after.into_iter().filter(|group| !before.contains(group)).collect();
        self.plan(self.render.snapshot(scene), changed).await?;
        Ok(views)
    }

    /// Whether frames of a scene can be drawn, with the camera and the adapter that there are: what is accepted must not fail later.
    async fn plan(&self, snapshot: SceneSnapshot, groups: Vec<FrameGroup>) -> Result<(), Status> {
        // One after the other: each plan may take long, and memory.
        let planner = Arc::clone(&self.planner).lock_owned().await;
        let limits = Arc::clone(&self.limits);
        let planning = move || {
            let mut planner = planner;
            background::on_own_cores(|| {
                groups.iter().try_for_each(|group| {
                    let outputs = PlanOutputs::new(Output::Hdr);
                    planner.plan(&snapshot, &group.rig, &group.settings, None, outputs, &limits).map(drop)
                })
            })
        };
        let planned = task::spawn_blocking(planning).await;
        let planned = planned.map_err(|error| Status::internal(format!("planning a frame failed: {error}")))?;
        planned.map_err(|error| Status::invalid_argument(error.to_string()))
    }

    /// The scene after a change, if it can be drawn then.
    async fn changed_scene(&self, update: &SceneUpdate, expected: Option<u64>) -> Result<SceneState, Status> {
        for _ in 0..MOST_ATTEMPTS {
            let scene = self.render.scene().map_err(refused)?;
            scene.expect(expected).map_err(|error| unchanged(&error))?;
            let made = self.made(update, &scene).await?;
            let changed = scene.clone().changed(&made, expected).map_err(|error| unchanged(&error))?;
            if update.changes_what_is_drawn() {
                self.prepare(&scene, &changed).await?;
            }
            match self.commit(changed, scene.revision).await? {
                Ok(scene) => return Ok(scene),
                Err(error) if expected.is_some() => return Err(unchanged(&error)),
                // What was checked is not the scene any more.
                Err(SceneError::Revision { .. }) => {}
                Err(error) => return Err(unchanged(&error)),
            }
        }
        Err(Status::aborted("the scene has changed again and again meanwhile: try again"))
    }

    /// Makes sure that a scene can be drawn, and makes what its first frame would take long for.
    async fn prepare(&self, before: &SceneState, after: &SceneState) -> Result<(), Status> {
        let groups = frame_groups(&self.rig, &self.render.general(after), &after.views.settings);
        self.plan(self.render.snapshot(after), groups).await?;
        let new = new_sets(before, after);
        // Without fields, what was made for some before is let go.
        if new.is_empty() && (before.objects.drawn.fields.is_empty() || !after.objects.drawn.fields.is_empty()) {
            return Ok(());
        }
        let baked = self.workshop.bake(new, after.asteroids.clone()).await.map_err(refused)?;
        baked.map_err(Status::invalid_argument)
    }

    /// Puts a scene in place of the one that it was made for: on disk first, where there is a file of states, and then before everybody's eyes.
    async fn commit(&self, scene: SceneState, made_for: u64) -> Result<Result<SceneState, SceneError>, Status> {
        // One change after the other, so that what is on disk is what is shown.
        let file = Arc::clone(&self.state).lock_owned().await;
        let now = self.render.scene().map_err(refused)?;
        if let Err(error) = now.expect(Some(made_for)) {
            return Ok(Err(error));
        }
        let render = self.render.clone();
        let writing = move || {
            let next = SceneState { revision: made_for + 1, ..scene };
            if let Some(file) = file.as_ref() {
                file.save(&Saved::of(&next, None)).map_err(|error| unsaved(&error))?;
            }
            let replaced = render.replace_scene(next, made_for).map_err(refused);
            // Not before it is shown.
            drop(file);
            replaced
        };
        task::spawn_blocking(writing).await.map_err(|error| Status::internal(format!("saving failed: {error}")))?
    }

    /// The scene and the camera of a snapshot in place of those there are.
    async fn load(&self, saved: &Saved, expected: Option<u64>) -> Result<SceneState, Status> {
        let camera = saved.camera.map(convert::camera_update_from_pb);
        for _ in 0..MOST_ATTEMPTS {
            let scene = self.render.scene().map_err(refused)?;
            scene.expect(expected).map_err(|error| unchanged(&error))?;
            let (general, of, before) = (self.render.general(&scene), saved.clone(), scene.clone());
            let permit = Arc::clone(&self.placing).acquire_owned().await.map_err(|_| refused(Refused::Ending))?;
            let placing = move || {
                let _permit = permit;
                background::on_own_cores(|| of.applied(&before, &general))
            };
            let changed = task::spawn_blocking(placing).await;
            let changed = changed.map_err(|error| Status::internal(format!("placing asteroids failed: {error}")))?;
            let changed = changed.map_err(Status::failed_precondition)?;
            self.prepare(&scene, &changed).await?;
            match self.commit(changed, scene.revision).await? {
                Ok(scene) => {
                    if let Some(camera) = &camera {
                        self.render.set_camera(camera, None, None).map_err(|error| unmoved(&error))?;
                    }
                    return Ok(scene);
                }
                Err(error) if expected.is_some() => return Err(unchanged(&error)),
                Err(_) => {}
            }
        }
        Err(Status::aborted("the scene has changed again and again meanwhile: try again"))
    }

    /// Does something with the file of states.
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

    /// What a change needs.
    async fn made(&self, update: &SceneUpdate, scene: &SceneState) -> Result<MadeUpdate, Status> {
        if !update.places_asteroids() {
            return update.make(scene).map_err(Status::invalid_argument);
        }
        // One after the other: each may take all cores and much memory.
        let permit = Arc::clone(&self.placing).acquire_owned().await.map_err(|_| refused(Refused::Ending))?;
        let (update, scene) = (update.clone(), scene.clone());
        let placing = move || {
            // Until it is done, also if the caller does not wait for it.
            let _permit = permit;
            background::on_own_cores(|| update.make(&scene))
        };
        let placed = task::spawn_blocking(placing).await;
        let placed = placed.map_err(|error| Status::internal(format!("placing asteroids failed: {error}")))?;
        placed.map_err(Status::invalid_argument)
    }

    pub(super) fn order(&self, client: &ClientInfo, name: &str, encoding: i32, max_size: u32) -> Result<Order, Status> {
        let headset = self.headset.as_ref().filter(|headset| headset.name() == name).map(Arc::clone);
        // The frames of a headset have one view.
        let view = self.rig.index_of(name).or(headset.as_ref().map(|_| 0)).ok_or_else(|| self.no_view(name))?;
        let encoding = convert::encoding_from_pb(encoding).ok_or_else(|| {
            Status::invalid_argument(format!("encoding = {encoding}: one of RGBA8, PNG, JPEG, RGB32F, EXR is needed"))
        })?;
        if max_size > 0 && encoding.wanted().hdr {
            let problem = format!("max_size = {max_size}: {} images have the size of the view", encoding.name());
            return Err(Status::invalid_argument(problem));
        }
        if max_size > 0 && !MAX_SIZES.contains(&max_size) {
            let (least, most) = (MAX_SIZES.start(), MAX_SIZES.end());
            let problem = format!("max_size = {max_size}: allowed are 0 and {least} to {most} pixels");
            return Err(Status::invalid_argument(problem));
        }
        let form = Form { encoding, max_size };
        let (encoders, client) = (Arc::clone(&self.encoders), client.clone());
        Ok(Order { name: name.into(), view, headset, form, encoders, client })
    }

    /// Bytes of a message of the order's view, at most.
    pub(super) fn most_bytes(&self, order: &Order) -> u64 {
        let pixels = |[width, height]: [u32; 2]| u64::from(width) * u64::from(height);
        order.form.most_bytes(match &order.headset {
            Some(headset) => headset.sizes().into_iter().map(pixels).sum(),
            None => {
                self.rig.views()[order.view].images.iter().map(|image| pixels(image.projection.mapping().size())).sum()
            }
        })
    }

    /// The place of a stream of the scene or of figures.
    pub(super) fn watcher(&self) -> Result<OwnedSemaphorePermit, Status> {
        let place = Arc::clone(&self.watchers).try_acquire_owned();
        place.map_err(|_| Status::resource_exhausted("too many streams of scene and figures: end one first"))
    }

    /// A frame of the order's view, rendered after the call.
    async fn rendered(&self, order: &Order) -> Result<Arc<RenderedFrame>, Status> {
        let reply = match &order.headset {
            None => self.render.request(order.view, order.wanted()).map_err(refused)?.await,
            Some(headset) => {
                let reply = headset.request(order.wanted()).map_err(refused)?;
                timeout(HEADSET_PATIENCE, reply).await.map_err(|_| {
                    let seconds = HEADSET_PATIENCE.as_secs();
                    let why = match headset.report().0 {
                        xr::Status::Connected { problem: Some(problem), .. } => format!(": {problem}"),
                        _ => String::new(),
                    };
                    Status::unavailable(format!("the headset has not shown a frame for {seconds} s{why}"))
                })?
            }
        };
        reply.unwrap_or(Err(RenderFailure::Ended)).map_err(|failure| failed(&failure))
    }
}

/// An answer that holds bytes until it is sent.
fn holding<T>(answer: T, held: Held) -> Response<T> {
    let mut response = Response::new(answer);
    response.extensions_mut().insert(held);
    response
}

pub(super) fn refused(refused: Refused) -> Status {
    match refused {
        Refused::Full => Status::resource_exhausted("too many RenderFrame calls are waiting: try again later"),
        Refused::Subscribers(most) => Status::resource_exhausted(format!(
            "there are {most} streams already, the most there may be: end one first"
        )),
        Refused::Headset(reason) => failed(&RenderFailure::Headset(reason)),
        Refused::Ending => Status::unavailable("the daemon is shutting down"),
    }
}

/// The name of a snapshot, if it is one.
fn snapshot_name(name: String) -> Result<String, Status> {
    check_name(&name).map_err(|error| Status::invalid_argument(error.to_string()))?;
    if name.len() > MOST_NAME {
        return Err(Status::invalid_argument(format!("name: at most {MOST_NAME} characters are allowed")));
    }
    Ok(name)
}

/// Sets of shapes that a scene after a change has and that one before has not, or draws otherwise, each once.
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

fn unsaved(error: &StateError) -> Status {
    tracing::error!("{error}");
    match error {
        StateError::Full => Status::resource_exhausted(error.to_string()),
        _ => Status::internal(format!("nothing was changed: {error}")),
    }
}

fn unchanged(error: &SceneError) -> Status {
    match error {
        SceneError::Revision { .. } => Status::aborted(error.to_string()),
        SceneError::Invalid(_) => Status::invalid_argument(error.to_string()),
    }
}

pub(super) fn failed(failure: &RenderFailure) -> Status {
    match failure {
        RenderFailure::Engine(_) => Status::internal(failure.to_string()),
        RenderFailure::Headset(_) | RenderFailure::Ended => Status::unavailable(failure.to_string()),
    }
}

#[tonic::async_trait]
impl proto::view_service_server::ViewService for Service {
    type StreamFramesStream = Pin<Box<dyn Stream<Item = Result<proto::Frame, Status>> + Send>>;

    async fn list_views(
        &self,
        _: Request<proto::ListViewsRequest>,
    ) -> Result<Response<proto::ListViewsResponse>, Status> {
        let scene = self.render.scene().map_err(refused)?;
        let views = self.view_names().into_iter().map(|name| self.view(name, &scene));
        Ok(Response::new(proto::ListViewsResponse { views: views.collect::<Result<_, Status>>()? }))
    }

    async fn get_view(&self, request: Request<proto::GetViewRequest>) -> Result<Response<proto::View>, Status> {
        let scene = self.render.scene().map_err(refused)?;
        Ok(Response::new(self.view(&request.into_inner().view, &scene)?))
    }

    async fn update_view(&self, request: Request<proto::UpdateViewRequest>) -> Result<Response<proto::View>, Status> {
        let request = request.into_inner();
        let name = request.view.as_ref().map(|view| view.name.clone()).unwrap_or_default();
        let Some(number) = self.rig.index_of(&name) else {
            if self.headset.as_ref().is_some_and(|headset| headset.name() == name) {
                let problem = "the headset has the general settings, those of the configuration";
                return Err(Status::invalid_argument(format!("view `{name}`: {problem}")));
            }
            return Err(self.no_view(&name));
        };
        let update = view_update_from_pb(&request).map_err(Status::invalid_argument)?;
        let expected = request.expected_revision;
        for _ in 0..MOST_ATTEMPTS {
            let scene = self.render.scene().map_err(refused)?;
            scene.expect(expected).map_err(|error| unchanged(&error))?;
            let views = self.changed_views(&scene, number, &update).await?;
            let changed = SceneState { views: Arc::new(views), ..scene.clone() };
            match self.commit(changed, scene.revision).await? {
                Ok(scene) => return Ok(Response::new(self.view(&name, &scene)?)),
                Err(error) if expected.is_some() => return Err(unchanged(&error)),
                // What was checked is not the scene any more.
                Err(_) => {}
            }
        }
        Err(Status::aborted("the scene has changed again and again meanwhile: try again"))
    }

    async fn render_frame(
        &self,
        request: Request<proto::RenderFrameRequest>,
    ) -> Result<Response<proto::Frame>, Status> {
        let client = ClientInfo::of(&request)?;
        let request = request.into_inner();
        let order = self.order(&client, &request.view, request.encoding, request.max_size)?;
        let _own = client.render()?;
        let _pending = self.pending.try_acquire().map_err(|_| refused(Refused::Full))?;
        let held = client.hold_output(self.most_bytes(&order))?;
        let rendered = self.rendered(&order).await?;
        Ok(holding(order.encode(&rendered, 0, 0).await?, held))
    }

    async fn next_frame(&self, request: Request<proto::NextFrameRequest>) -> Result<Response<proto::Frame>, Status> {
        let client = ClientInfo::of(&request)?;
        let (frame, held) = self.pull(&client, &request.into_inner()).await?;
        Ok(holding(frame, held))
    }

    async fn next_frames(
        &self,
        request: Request<proto::NextFramesRequest>,
    ) -> Result<Response<proto::NextFramesResponse>, Status> {
        let client = ClientInfo::of(&request)?;
        let (frames, held) = self.pull_several(&client, &request.into_inner().views).await?;
        Ok(holding(proto::NextFramesResponse { frames }, held))
    }

    async fn acknowledge_frame(
        &self,
        request: Request<proto::AcknowledgeFrameRequest>,
    ) -> Result<Response<proto::AcknowledgeFrameResponse>, Status> {
        let proto::AcknowledgeFrameRequest { stream, frame_number } = request.into_inner();
        if self.render.streams().acknowledge(stream, frame_number) {
            return Ok(Response::new(proto::AcknowledgeFrameResponse {}));
        }
        Err(Status::not_found(format!("no stream {stream} whose frames are acknowledged, or it has ended")))
    }

    async fn stream_frames(
        &self,
        request: Request<proto::StreamFramesRequest>,
    ) -> Result<Response<Self::StreamFramesStream>, Status> {
        let client = ClientInfo::of(&request)?;
        let request = request.into_inner();
        let order = self.order(&client, &request.view, request.encoding, request.max_size)?;
        let held = client.hold_output(self.most_bytes(&order))?;
        let rate = request.max_rate_hz;
        let interval = if rate == 0.0 {
            Duration::ZERO
        } else if RATES_HZ.contains(&rate) {
            Duration::from_secs_f64(rate.recip())
        } else {
            let (min, max) = (RATES_HZ.start(), RATES_HZ.end());
            let message = format!("max_rate_hz = {rate}: allowed are 0 (every frame) and {min} to {max}");
            return Err(Status::invalid_argument(message));
        };
        let subscription = match &order.headset {
            None => self.render.subscribe(order.view, order.wanted(), interval),
            Some(headset) => headset.subscribe(order.wanted(), interval),
        };
        let subscription = subscription.map_err(refused)?;
        let acknowledged = request.acknowledged.then(|| self.render.streams().acknowledged());
        let stream: Self::StreamFramesStream = Box::pin(FrameStream::new(Source { subscription, acknowledged }, order));
        Ok(holding(stream, held))
    }
}

#[tonic::async_trait]
impl proto::scene_service_server::SceneService for Service {
    type WatchSceneStream = ReceiverStream<Result<proto::Scene, Status>>;

    async fn get_scene(&self, _: Request<proto::GetSceneRequest>) -> Result<Response<proto::Scene>, Status> {
        let scene = self.render.scene().map_err(refused)?;
        Ok(Response::new(convert::scene_to_pb(&scene, &self.catalogues)))
    }

    async fn update_scene(
        &self,
        request: Request<proto::UpdateSceneRequest>,
    ) -> Result<Response<proto::Scene>, Status> {
        let request = request.into_inner();
        let update = convert::scene_update_from_pb(&request).map_err(Status::invalid_argument)?;
        update.overlay.check_views(&self.view_names()).map_err(Status::invalid_argument)?;
        let scene = self.changed_scene(&update, request.expected_revision).await?;
        Ok(Response::new(convert::scene_to_pb(&scene, &self.catalogues)))
    }

    async fn save_snapshot(
        &self,
        request: Request<proto::SaveSnapshotRequest>,
    ) -> Result<Response<proto::Snapshot>, Status> {
        let name = snapshot_name(request.into_inner().name)?;
        let saved = Saved::of(&self.render.scene().map_err(refused)?, Some(&self.render.camera()));
        let time = saved.time;
        let of = name.clone();
        self.with_state(move |file| file.save_snapshot(&of, &saved)).await?;
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
        let proto::LoadSnapshotRequest { name, expected_revision } = request.into_inner();
        let of = name.clone();
        let Some(saved) = self.with_state(move |file| file.snapshot(&of)).await? else {
            let names = self.with_state(StateFile::snapshots).await?;
            let names: Vec<String> = names.into_iter().map(|known| known.name).collect();
            return Err(Status::not_found(format!("no snapshot `{name}`; there are: {}", names.join(", "))));
        };
        let scene = self.load(&saved, expected_revision).await?;
        Ok(Response::new(convert::scene_to_pb(&scene, &self.catalogues)))
    }

    async fn watch_scene(
        &self,
        _: Request<proto::WatchSceneRequest>,
    ) -> Result<Response<Self::WatchSceneStream>, Status> {
        let permit = self.watcher()?;
        let mut scenes = self.render.watch_scene();
        if scenes.borrow().is_none() {
            return Err(refused(Refused::Ending));
        }
        let catalogues = Arc::clone(&self.catalogues);
        let (sender, stream) = mpsc::channel(1);
        task::spawn(async move {
            let _permit = permit;
            loop {
                // A reader that is slow finds the newest scene when there is room for it.
                let Ok(room) = sender.reserve().await else { return };
                let Some(scene) = scenes.borrow_and_update().clone() else { return };
                room.send(Ok(convert::scene_to_pb(&scene, &catalogues)));
                tokio::select! {
                    () = sender.closed() => return,
                    changed = scenes.changed() => if changed.is_err() { return },
                }
            }
        });
        Ok(Response::new(ReceiverStream::new(stream)))
    }
}
