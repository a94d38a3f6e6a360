//! The calls: each turns a message into plain values, asks the render thread, and turns the answer into a message.
//!
//! Frames are encoded on threads of their own, as many at once as there are processor cores.

use std::{pin::Pin, sync::Arc, thread, time::Duration};

use tokio::{
    sync::{OwnedSemaphorePermit, Semaphore, mpsc},
    task,
    time::timeout,
};
use tokio_stream::{Stream, wrappers::ReceiverStream};
use tonic::{Request, Response, Status};

use super::{
    convert, convert_stats,
    convert_views::{view_to_pb, view_update_from_pb},
    frames::FrameStream,
    headset::Headset,
    proto,
    render::{Capacity, Refused, RenderHandle},
    scene::{SceneError, SceneState},
    server::SceneCatalogue,
    slot::{RenderFailure, RenderedFrame},
    views::{ViewSet, ViewUpdate},
};
use crate::{
    gpu::AdapterReport,
    output::{self, Encoding},
    plan::{
        Limits, Output, PlanOutputs, Planner,
        view_settings::{FrameGroup, frame_groups},
    },
    render::{ViewStatistics, Wanted},
    view::Rig,
    xr,
};

/// Rates that `StreamFrames` takes, Hz, besides 0.
const RATES_HZ: std::ops::RangeInclusive<f64> = 0.001..=10_000.0;

/// How often a change is checked anew because the scene has changed meanwhile.
const MOST_ATTEMPTS: usize = 8;

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
    /// Calls that place asteroids: one at a time.
    placing: Arc<Semaphore>,
    /// Calls that plan frames to see whether they can be drawn: one at a time.
    planning: Arc<Semaphore>,
    /// Calls of Verify: one at a time.
    pub(super) verifying: Arc<Semaphore>,
    /// Calls of RenderFrame that are not finished yet, from the queue to the last encoded byte.
    pending: Arc<Semaphore>,
    encoders: Arc<Semaphore>,
}

/// The images of one view, and how they are to be encoded.
#[derive(Clone)]
pub(super) struct Order {
    name: Arc<str>,
    /// Index in its frames.
    view: usize,
    /// Who makes its frames, if not the render thread.
    headset: Option<Arc<Headset>>,
    encoding: Encoding,
    encoders: Arc<Semaphore>,
}

impl Service {
    pub(super) fn new(
        render: RenderHandle,
        headset: Option<Arc<Headset>>,
        rig: Arc<Rig>,
        (adapter, limits): (AdapterReport, Limits),
        catalogues: Vec<SceneCatalogue>,
        stars: u64,
        capacity: Capacity,
    ) -> Self {
        let cores = thread::available_parallelism().map_or(1, usize::from);
        Self {
            render,
            headset,
            rig,
            adapter: Arc::new(adapter),
            limits: Arc::new(limits),
            catalogues: Arc::new(catalogues),
            stars,
            watchers: Arc::new(Semaphore::new(capacity.subscribers)),
            placing: Arc::new(Semaphore::new(1)),
            planning: Arc::new(Semaphore::new(1)),
            verifying: Arc::new(Semaphore::new(1)),
            pending: Arc::new(Semaphore::new(capacity.requests)),
            encoders: Arc::new(Semaphore::new(cores)),
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
        // One after the other: each plan may take long, and memory.
        let permit = Arc::clone(&self.planning).acquire_owned().await.map_err(|_| refused(Refused::Ending))?;
        let (snapshot, rig, limits) = (self.render.snapshot(scene), Arc::clone(&self.rig), Arc::clone(&self.limits));
        let before = frame_groups(&rig, &general, &scene.views.settings);
        let planning = move || {
            let _permit = permit;
            let after = frame_groups(&rig, &general, &views.settings);
            let check = |group: &&FrameGroup| {
                let outputs = PlanOutputs::new(Output::Hdr);
                Planner::new().plan(&snapshot, &group.rig, &group.settings, None, outputs, &limits).map(drop)
            };
            // What has not changed is drawn already.
            after.iter().filter(|group| !before.contains(group)).try_for_each(|group| check(&group)).map(|()| views)
        };
        let planned = task::spawn_blocking(planning).await;
        let planned = planned.map_err(|error| Status::internal(format!("planning a frame failed: {error}")))?;
        planned.map_err(|error| Status::invalid_argument(error.to_string()))
    }

    fn order(&self, name: &str, encoding: i32) -> Result<Order, Status> {
        let headset = self.headset.as_ref().filter(|headset| headset.name() == name).map(Arc::clone);
        // The frames of a headset have one view.
        let view = self.rig.index_of(name).or(headset.as_ref().map(|_| 0)).ok_or_else(|| self.no_view(name))?;
        let encoding = convert::encoding_from_pb(encoding).ok_or_else(|| {
            Status::invalid_argument(format!("encoding = {encoding}: one of RGBA8, PNG, JPEG, RGB32F, EXR is needed"))
        })?;
        Ok(Order { name: name.into(), view, headset, encoding, encoders: Arc::clone(&self.encoders) })
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

impl Order {
    fn wanted(&self) -> Wanted {
        self.encoding.wanted()
    }

    /// Encodes the view's images of a frame, away from the threads that serve connections.
    pub(super) async fn encode(self, rendered: Arc<RenderedFrame>, dropped: u64) -> Result<proto::Frame, Status> {
        let encoders = Arc::clone(&self.encoders);
        let _permit = encoders.acquire().await.map_err(|_| Status::unavailable("the daemon is shutting down"))?;
        task::spawn_blocking(move || self.message(&rendered, dropped))
            .await
            .map_err(|error| Status::internal(format!("encoding the frame failed: {error}")))?
    }

    fn message(&self, rendered: &RenderedFrame, dropped: u64) -> Result<proto::Frame, Status> {
        let frame = &rendered.frame;
        let images = frame.images.iter().filter(|image| image.view == self.view).map(|image| {
            let data = output::encode(self.encoding, image).map_err(|error| Status::internal(error.to_string()))?;
            Ok(proto::Image {
                part: image.part.name().unwrap_or_default().to_owned(),
                width: image.width,
                height: image.height,
                encoding: convert::encoding_to_pb(self.encoding).into(),
                data,
            })
        });
        let of_view = |view: &ViewStatistics| view.limiting_magnitude;
        Ok(proto::Frame {
            view: self.name.to_string(),
            frame_number: frame.number,
            scene_revision: frame.scene_revision,
            camera_revision: frame.camera_revision,
            pose_time: Some(rendered.pose_time.into()),
            render_time: Some(rendered.render_time.into()),
            exposure_ev100: frame.exposure_ev100,
            limiting_magnitude: frame.views.iter().find(|view| *view.name == *self.name).and_then(of_view),
            dropped,
            quality_level: rendered.given_up.level,
            given_up: rendered.given_up.what.clone(),
            images: images.collect::<Result<_, Status>>()?,
        })
    }
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
impl proto::camera_service_server::CameraService for Service {
    async fn get_camera(&self, _: Request<proto::GetCameraRequest>) -> Result<Response<proto::Camera>, Status> {
        Ok(Response::new(convert::camera_to_pb(&self.render.camera())))
    }

    async fn set_camera(&self, request: Request<proto::SetCameraRequest>) -> Result<Response<proto::Camera>, Status> {
        let update = convert::update_from_pb(request.into_inner());
        let camera = self.render.set_camera(&update).map_err(|error| Status::invalid_argument(error.to_string()))?;
        Ok(Response::new(convert::camera_to_pb(&camera)))
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
            match self.render.update_views(views, scene.revision).map_err(refused)? {
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
        let request = request.into_inner();
        let order = self.order(&request.view, request.encoding)?;
        let _pending = self.pending.try_acquire().map_err(|_| refused(Refused::Full))?;
        let rendered = self.rendered(&order).await?;
        Ok(Response::new(order.encode(rendered, 0).await?))
    }

    async fn stream_frames(
        &self,
        request: Request<proto::StreamFramesRequest>,
    ) -> Result<Response<Self::StreamFramesStream>, Status> {
        let request = request.into_inner();
        let order = self.order(&request.view, request.encoding)?;
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
        Ok(Response::new(Box::pin(FrameStream::new(subscription, order))))
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
        let expected = request.expected_revision;
        let scene = self.render.scene().map_err(refused)?;
        scene.expect(expected).map_err(|error| unchanged(&error))?;
        let made = if update.places_asteroids() {
            // One after the other: each may take all cores and much memory.
            let permit = Arc::clone(&self.placing).acquire_owned().await.map_err(|_| refused(Refused::Ending))?;
            let scene = self.render.scene().map_err(refused)?;
            let placing = move || {
                // Until it is done, also if the caller does not wait for it.
                let _permit = permit;
                update.make(&scene)
            };
            let placed = task::spawn_blocking(placing).await;
            placed.map_err(|error| Status::internal(format!("placing asteroids failed: {error}")))?
        } else {
            update.make(&scene)
        };
        let made = made.map_err(Status::invalid_argument)?;
        let changed = self.render.update_scene(&made, expected).map_err(refused)?;
        let scene = changed.map_err(|error| unchanged(&error))?;
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
