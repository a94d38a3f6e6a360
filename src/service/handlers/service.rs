//! The gRPC service and its methods for views and frames. Each converts a request to plain values, asks the render
//! thread, and converts the answer to a message.
//!
//! Methods of the camera are in [`super::camera`], those of the scene in [`super::scene_changes`], frames on request in
//! [`super::next_frame`], and encoding in [`crate::service::frames::image_encoding`].

use std::{pin::Pin, sync::Arc, time::Duration};

use tokio::{
    sync::{Mutex, OwnedSemaphorePermit, Semaphore, mpsc, watch},
    task,
    time::timeout,
};
use tokio_stream::{Stream, wrappers::ReceiverStream};
use tonic::{Request, Response, Status};

use super::stats;
use crate::{
    gpu::AdapterReport,
    plan::{Limits, Planner},
    service::{
        cluster::Cluster,
        displays::{headset::Headset, windows::Windows},
        engine::{background_jobs::BackgroundJobs, render_handle::RenderHandle, shared_state::Capacity},
        frames::{
            errors::{Refused, RenderFailure, failed, refused},
            frame_stream::{FrameStream, Source},
            image_encoding::{Encoders, ImageFormat, ImageRequest, ReaderState},
            rendered_frame::RenderedFrame,
            stream_budget::StreamBudget,
            video::Rate,
        },
        network::{
            access::By,
            clients::{ClientInfo, Held, Shares},
        },
        proto,
        scene::{
            excerpts::listed,
            state::{SceneCatalogue, SceneError, SceneState},
            views::ViewId,
        },
        state_file::StateFile,
        wire::{encoding, refusals, views::view_to_pb},
    },
    xr,
};

/// Maximum number of concurrent Identify calls; further calls are refused. Each searches the stars of a part of the sky.
const LOOKING: usize = 8;

/// A stream repeats its message after this time without a change: proxies end silent streams after a minute, and clients may expect a sign of life.
const REPEATS: Duration = Duration::from_secs(15);

/// Range of the rate of `StreamFrames`, Hz; 0 is allowed too.
const RATES_HZ: std::ops::RangeInclusive<f64> = 0.001..=10_000.0;

/// Range of the longest side of scaled-down images, pixels; 0 is allowed too.
const MAX_SIZES: std::ops::RangeInclusive<u32> = 16..=16_384;

/// Maximum number of attempts to make a change when other changes come first.
pub(crate) const MOST_ATTEMPTS: usize = 8;

/// A call fails after this time without a frame from the headset, for example while it is not worn.
const HEADSET_PATIENCE: Duration = Duration::from_secs(5);

/// State shared by all calls.
#[derive(Clone)]
pub(crate) struct Service {
    pub(crate) render: RenderHandle,
    pub(crate) headset: Option<Arc<Headset>>,
    pub(crate) windows: Option<Arc<Windows>>,
    /// The daemon's part in a cluster.
    pub(crate) cluster: Option<Arc<Cluster>>,
    pub(crate) adapter: Arc<AdapterReport>,
    pub(crate) limits: Arc<Limits>,
    pub(crate) catalogues: Arc<Vec<SceneCatalogue>>,
    pub(crate) stars: u64,
    /// Places for streams of the scene and of statistics.
    watchers: Arc<Semaphore>,
    pub(crate) background_jobs: BackgroundJobs,
    /// The state file; the lock serialises changes.
    pub(crate) state: Arc<Mutex<Option<StateFile>>>,
    pub(crate) shares: Arc<Shares>,
    /// Lock that serialises calls that place asteroids.
    pub(crate) placing: Arc<Semaphore>,
    /// Planner for checks of changes; the lock serialises them.
    pub(crate) planner: Arc<Mutex<Planner>>,
    /// Places for Identify calls.
    pub(crate) looking: Arc<Semaphore>,
    /// Serialises Verify calls.
    pub(crate) verifying: Arc<Semaphore>,
    /// Places for RenderFrame calls, from the queue to the last encoded byte.
    pending: Arc<Semaphore>,
    pub(crate) encoders: Arc<Encoders>,
}

/// Parts of a daemon that a configuration may leave out.
pub(crate) struct OptionalParts {
    pub(crate) headset: Option<Arc<Headset>>,
    pub(crate) windows: Option<Arc<Windows>>,
    pub(crate) cluster: Option<Arc<Cluster>>,
}

impl Service {
    pub(crate) fn new(
        render: RenderHandle,
        OptionalParts { headset, windows, cluster }: OptionalParts,
        (adapter, limits): (AdapterReport, Limits),
        (catalogues, stars): (Vec<SceneCatalogue>, u64),
        capacity: Capacity,
        (background_jobs, shares, state): (BackgroundJobs, Arc<Shares>, Option<StateFile>),
    ) -> Self {
        Self {
            render,
            headset,
            windows,
            cluster,
            adapter: Arc::new(adapter),
            limits: Arc::new(limits),
            catalogues: Arc::new(catalogues),
            stars,
            watchers: Arc::new(Semaphore::new(capacity.subscribers)),
            background_jobs,
            state: Arc::new(Mutex::new(state)),
            shares,
            placing: Arc::new(Semaphore::new(1)),
            planner: Arc::default(),
            looking: Arc::new(Semaphore::new(LOOKING)),
            verifying: Arc::new(Semaphore::new(1)),
            pending: Arc::new(Semaphore::new(capacity.requests)),
            encoders: Arc::new(Encoders::new()),
        }
    }

    /// Returns the names of all views of a scene, the headset's last.
    pub(crate) fn view_names<'a>(&'a self, scene: &'a SceneState) -> Vec<&'a str> {
        scene.views.names().chain(self.headset.iter().map(|headset| headset.name())).collect()
    }

    pub(crate) fn no_view(&self, name: &str, scene: &SceneState) -> Status {
        let names = listed(self.view_names(scene));
        refusals::absent("view", name, format!("no view `{name}`; the views are: {names}"))
    }

    /// Returns the headset if this is the name of its view.
    pub(crate) fn headset_named(&self, name: &str) -> Option<&Arc<Headset>> {
        self.headset.as_ref().filter(|headset| headset.name() == name)
    }

    /// Returns the headset if it renders the frames of a view; all others come from the render thread.
    pub(crate) fn headset_of(&self, view: ViewId) -> Option<&Arc<Headset>> {
        self.headset.as_ref().filter(|_| view == ViewId::HEADSET)
    }

    /// Returns the message of a view of a scene.
    pub(crate) fn view(&self, name: &str, scene: &SceneState) -> Result<proto::View, Status> {
        if let Some((_, index)) = scene.views.named(name) {
            return Ok(view_to_pb(index, scene));
        }
        let headset = self.headset_named(name).ok_or_else(|| self.no_view(name, scene))?;
        Ok(stats::headset_view_to_pb(headset, &self.render.general(scene), scene))
    }

    pub(crate) fn image_request(
        &self,
        client: &ClientInfo,
        name: &str,
        encoding: i32,
        max_size: u32,
    ) -> Result<ImageRequest, Status> {
        let scene = self.render.scene().map_err(refused)?;
        let headset = self.headset_named(name);
        let pixels = |[width, height]: [u32; 2]| u64::from(width) * u64::from(height);
        let (view, pixels) = match (scene.views.named(name), headset) {
            (Some((view, index)), _) => (view, scene.views.pixels_of(index)),
            (None, Some(headset)) => (ViewId::HEADSET, headset.sizes().into_iter().map(pixels).sum()),
            (None, None) => return Err(self.no_view(name, &scene)),
        };
        if let Some(own) = self.render.led_views().filter(|own| headset.is_none() && !own.iter().any(|own| own == name))
        {
            let own = listed(own.iter().map(|own| &**own));
            let problem = format!("this node draws {own}; ask the node that draws `{name}`");
            return Err(Status::failed_precondition(problem));
        }
        let encoding = encoding::encoding_from_pb(encoding).ok_or_else(|| {
            refusals::invalid(format!("encoding = {encoding}: must be one of RGBA8, PNG, JPEG, RGB32F, EXR, H264"))
        })?;
        if max_size > 0 && encoding.wanted().reads_hdr() {
            let problem = format!(
                "max_size = {max_size}: must be 0, because {} images have the size of the view",
                encoding.name()
            );
            return Err(refusals::invalid(problem));
        }
        if max_size > 0 && !MAX_SIZES.contains(&max_size) {
            let (least, most) = (MAX_SIZES.start(), MAX_SIZES.end());
            let problem = format!("max_size = {max_size}: must be 0, or between {least} and {most} pixels");
            return Err(refusals::invalid(problem));
        }
        let form = ImageFormat { encoding, max_size };
        let (encoders, client) = (Arc::clone(&self.encoders), client.clone());
        Ok(ImageRequest { name: name.into(), view, pixels, form, rate: None, encoders, client })
    }

    /// Takes a place for a stream of the scene, the camera or of statistics, and one of the client's places.
    pub(crate) fn watcher(&self, client: &ClientInfo) -> Result<[OwnedSemaphorePermit; 2], Status> {
        let own = client.watch()?;
        let place = Arc::clone(&self.watchers).try_acquire_owned();
        let place = place.map_err(|_| {
            refusals::exhausted("streams", "too many streams of scene, camera and statistics: end one first")
        })?;
        Ok([own, place])
    }

    /// Streams the current value and every change, until the value is `None`, and repeats the value after [`REPEATS`] without a change, so that
    /// proxies do not end the stream. A slow reader gets the newest value when there is room for it.
    pub(crate) fn watched<T, M>(
        &self,
        client: &ClientInfo,
        mut values: watch::Receiver<Option<T>>,
        to_pb: impl Fn(&T) -> M + Send + 'static,
    ) -> Result<ReceiverStream<Result<M, Status>>, Status>
    where
        T: Clone + Send + Sync + 'static,
        M: Send + 'static,
    {
        let permit = self.watcher(client)?;
        if values.borrow().is_none() {
            return Err(refused(Refused::Ending));
        }
        let (sender, stream) = mpsc::channel(1);
        task::spawn(async move {
            let _permit = permit;
            loop {
                let Ok(room) = sender.reserve().await else { return };
                let Some(value) = values.borrow_and_update().clone() else { return };
                room.send(Ok(to_pb(&value)));
                tokio::select! {
                    () = sender.closed() => return,
                    changed = timeout(REPEATS, values.changed()) => if let Ok(Err(_)) = changed { return },
                }
            }
        });
        Ok(ReceiverStream::new(stream))
    }

    /// Renders a frame of the requested view that begins after the call.
    async fn rendered(&self, image_request: &ImageRequest) -> Result<Arc<RenderedFrame>, Status> {
        let reply = match self.headset_of(image_request.view) {
            None => self.render.request(image_request.view, image_request.wanted()).map_err(refused)?.await,
            Some(headset) => {
                let reply = headset.request(image_request.wanted()).map_err(refused)?;
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

/// Returns an answer that keeps bytes reserved until it is sent.
fn holding<T>(answer: T, held: Held) -> Response<T> {
    let mut response = Response::new(answer);
    response.extensions_mut().insert(held);
    response
}

/// Returns the error after the last attempt at a change.
pub(crate) fn changed_meanwhile() -> Status {
    Status::aborted("the scene changed during every attempt: try again")
}

pub(crate) fn unchanged(error: &SceneError) -> Status {
    match error {
        SceneError::Revision { expected, found } => refusals::revision(error.to_string(), "scene", *expected, *found),
        SceneError::Invalid(_) => refusals::invalid(error.to_string()),
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
        let views = self.view_names(&scene).into_iter().map(|name| self.view(name, &scene));
        Ok(Response::new(proto::ListViewsResponse { views: views.collect::<Result<_, Status>>()? }))
    }

    async fn get_view(&self, request: Request<proto::GetViewRequest>) -> Result<Response<proto::View>, Status> {
        let scene = self.render.scene().map_err(refused)?;
        Ok(Response::new(self.view(&request.into_inner().view, &scene)?))
    }

    async fn create_view(&self, request: Request<proto::CreateViewRequest>) -> Result<Response<proto::View>, Status> {
        let by = By::from_request(&request)?;
        let _own = by.client().change()?;
        Ok(Response::new(self.created_view(&by, request.into_inner()).await?))
    }

    async fn update_view(&self, request: Request<proto::UpdateViewRequest>) -> Result<Response<proto::View>, Status> {
        let by = By::from_request(&request)?;
        let _own = by.client().change()?;
        Ok(Response::new(self.updated_view(&by, request.into_inner()).await?))
    }

    async fn delete_view(
        &self,
        request: Request<proto::DeleteViewRequest>,
    ) -> Result<Response<proto::DeleteViewResponse>, Status> {
        let by = By::from_request(&request)?;
        let _own = by.client().change()?;
        let revision = self.deleted_view(&by, request.into_inner()).await?;
        Ok(Response::new(proto::DeleteViewResponse { revision }))
    }

    async fn render_frame(
        &self,
        request: Request<proto::RenderFrameRequest>,
    ) -> Result<Response<proto::Frame>, Status> {
        let client = ClientInfo::from_request(&request)?;
        let request = request.into_inner();
        let image_request = self.image_request(&client, &request.view, request.encoding, request.max_size)?;
        let _own = client.render()?;
        let _pending = self.pending.try_acquire().map_err(|_| refused(Refused::Full))?;
        let held = client.hold_output(image_request.most_bytes())?;
        let rendered = self.rendered(&image_request).await?;
        let held = held.and(image_request.reserve_more(&rendered)?);
        Ok(holding(image_request.encode(&rendered, ReaderState::default()).await?, held))
    }

    async fn next_frame(&self, request: Request<proto::NextFrameRequest>) -> Result<Response<proto::Frame>, Status> {
        let client = ClientInfo::from_request(&request)?;
        let (frame, held) = self.pull(&client, &request.into_inner()).await?;
        Ok(holding(frame, held))
    }

    async fn next_frames(
        &self,
        request: Request<proto::NextFramesRequest>,
    ) -> Result<Response<proto::NextFramesResponse>, Status> {
        let client = ClientInfo::from_request(&request)?;
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
        Err(Status::not_found(format!("no stream {stream} with acknowledgements, or it has ended")))
    }

    async fn stream_frames(
        &self,
        request: Request<proto::StreamFramesRequest>,
    ) -> Result<Response<Self::StreamFramesStream>, Status> {
        let client = ClientInfo::from_request(&request)?;
        let request = request.into_inner();
        let image_request = self.image_request(&client, &request.view, request.encoding, request.max_size)?;
        let held = client.hold_output(image_request.most_bytes())?;
        let rate = request.max_rate_hz;
        let interval = if rate == 0.0 {
            Duration::ZERO
        } else if RATES_HZ.contains(&rate) {
            Duration::from_secs_f64(rate.recip())
        } else {
            let (min, max) = (RATES_HZ.start(), RATES_HZ.end());
            let message = format!("max_rate_hz = {rate}: must be 0 (every frame), or between {min} and {max}");
            return Err(refusals::invalid(message));
        };
        let place = client.stream()?;
        let image_request = ImageRequest { rate: Some(Rate::Streamed(interval)), ..image_request };
        let subscription = match self.headset_of(image_request.view) {
            None => self.render.subscribe(image_request.view, image_request.wanted(), interval),
            Some(headset) => headset.subscribe(image_request.wanted(), interval),
        };
        let subscription = subscription.map_err(refused)?;
        let budget = StreamBudget::new(&image_request);
        let acknowledged = request.acknowledged.then(|| self.render.streams().acknowledged());
        let stream: Self::StreamFramesStream = Box::pin(FrameStream::new(
            Source { subscription, acknowledged, seen: None, budget, _place: place },
            image_request,
        ));
        Ok(holding(stream, held))
    }
}
