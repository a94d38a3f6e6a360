//! The calls: each turns a message into plain values, asks the render thread, and turns the answer into a message.
//!
//! Calls of the camera are in [`super::camera`], those of the scene in [`super::changes`], frames one by one in [`super::pull`], their encoding in [`super::order`].

use std::{pin::Pin, sync::Arc, time::Duration};

use tokio::{
    sync::{Mutex, OwnedSemaphorePermit, Semaphore, mpsc, watch},
    task,
    time::timeout,
};
use tokio_stream::{Stream, wrappers::ReceiverStream};
use tonic::{Request, Response, Status};

use super::{
    access::By,
    clients::{ClientInfo, Held, Shares},
    convert, convert_stats,
    convert_views::view_to_pb,
    frames::{FrameStream, Source},
    headset::Headset,
    order::{Encoders, Form, Order, Reading},
    proto, refusals,
    render::{Capacity, Refused, RenderHandle},
    room::Room,
    scene::{SceneError, SceneState},
    server::SceneCatalogue,
    slot::{RenderFailure, RenderedFrame},
    state::StateFile,
    video::Rate,
    views::ViewId,
    windows::Windows,
    workshop::Workshop,
};
use crate::{
    gpu::AdapterReport,
    plan::{Limits, Planner},
    xr,
};

/// Calls of Identify at the same time; more are refused. Each goes through the stars of a part of the sky.
const LOOKING: usize = 8;

/// Rates that `StreamFrames` takes, Hz, besides 0.
const RATES_HZ: std::ops::RangeInclusive<f64> = 0.001..=10_000.0;

/// Longest sides of smaller copies, pixels, besides 0.
const MAX_SIZES: std::ops::RangeInclusive<u32> = 16..=16_384;

/// How often a change is checked anew because the scene has changed meanwhile.
pub(super) const MOST_ATTEMPTS: usize = 8;

/// A session that shows nothing for this long, as while nobody wears the headset, has no frame for a call.
const HEADSET_PATIENCE: Duration = Duration::from_secs(5);

/// What every call needs.
#[derive(Clone)]
pub(super) struct Service {
    pub(super) render: RenderHandle,
    pub(super) headset: Option<Arc<Headset>>,
    pub(super) windows: Option<Arc<Windows>>,
    pub(super) adapter: Arc<AdapterReport>,
    pub(super) limits: Arc<Limits>,
    pub(super) catalogues: Arc<Vec<SceneCatalogue>>,
    pub(super) stars: u64,
    /// Streams of the scene and of figures.
    watchers: Arc<Semaphore>,
    pub(super) workshop: Workshop,
    /// Where acknowledged changes are kept; one change after the other.
    pub(super) state: Arc<Mutex<Option<StateFile>>>,
    pub(super) shares: Arc<Shares>,
    /// Calls that place asteroids: one at a time.
    pub(super) placing: Arc<Semaphore>,
    /// Of calls that plan frames to see whether they can be drawn: one at a time.
    pub(super) planner: Arc<Mutex<Planner>>,
    /// Calls of Identify: a few at a time.
    pub(super) looking: Arc<Semaphore>,
    /// Calls of Verify: one at a time.
    pub(super) verifying: Arc<Semaphore>,
    /// Calls of RenderFrame that are not finished yet, from the queue to the last encoded byte.
    pending: Arc<Semaphore>,
    pub(super) encoders: Arc<Encoders>,
}

impl Service {
    pub(super) fn new(
        render: RenderHandle,
        (headset, windows): (Option<Arc<Headset>>, Option<Arc<Windows>>),
        (adapter, limits): (AdapterReport, Limits),
        (catalogues, stars): (Vec<SceneCatalogue>, u64),
        capacity: Capacity,
        (workshop, shares, state): (Workshop, Arc<Shares>, Option<StateFile>),
    ) -> Self {
        Self {
            render,
            headset,
            windows,
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
            looking: Arc::new(Semaphore::new(LOOKING)),
            verifying: Arc::new(Semaphore::new(1)),
            pending: Arc::new(Semaphore::new(capacity.requests)),
            encoders: Arc::new(Encoders::new()),
        }
    }

    /// Names of all views of a scene, that of the headset last.
    pub(super) fn view_names<'a>(&'a self, scene: &'a SceneState) -> Vec<&'a str> {
        scene.views.names().chain(self.headset.iter().map(|headset| headset.name())).collect()
    }

    pub(super) fn no_view(&self, name: &str, scene: &SceneState) -> Status {
        let names = self.view_names(scene).join(", ");
        let names = if names.is_empty() { "none" } else { &names };
        refusals::absent("view", name, format!("no view `{name}`; the views are: {names}"))
    }

    /// The headset, if a view's name is its.
    pub(super) fn headset_named(&self, name: &str) -> Option<&Arc<Headset>> {
        self.headset.as_ref().filter(|headset| headset.name() == name)
    }

    /// A view as it is in a scene.
    pub(super) fn view(&self, name: &str, scene: &SceneState) -> Result<proto::View, Status> {
        if let Some((_, index)) = scene.views.named(name) {
            return Ok(view_to_pb(index, scene));
        }
        let headset = self.headset_named(name).ok_or_else(|| self.no_view(name, scene))?;
        Ok(convert_stats::headset_view_to_pb(headset, &self.render.general(scene), scene))
    }

    pub(super) fn order(&self, client: &ClientInfo, name: &str, encoding: i32, max_size: u32) -> Result<Order, Status> {
        let scene = self.render.scene().map_err(refused)?;
        let headset = self.headset_named(name).map(Arc::clone);
        let pixels = |[width, height]: [u32; 2]| u64::from(width) * u64::from(height);
        let (view, pixels) = match (scene.views.named(name), &headset) {
            (Some((view, index)), _) => (view, scene.views.pixels_of(index)),
            (None, Some(headset)) => (ViewId::HEADSET, headset.sizes().into_iter().map(pixels).sum()),
            (None, None) => return Err(self.no_view(name, &scene)),
        };
        let encoding = convert::encoding_from_pb(encoding).ok_or_else(|| {
            refusals::invalid(format!("encoding = {encoding}: one of RGBA8, PNG, JPEG, RGB32F, EXR, H264 is needed"))
        })?;
        if max_size > 0 && encoding.wanted().hdr {
            let problem = format!("max_size = {max_size}: {} images have the size of the view", encoding.name());
            return Err(refusals::invalid(problem));
        }
        if max_size > 0 && !MAX_SIZES.contains(&max_size) {
            let (least, most) = (MAX_SIZES.start(), MAX_SIZES.end());
            let problem = format!("max_size = {max_size}: allowed are 0 and {least} to {most} pixels");
            return Err(refusals::invalid(problem));
        }
        let form = Form { encoding, max_size };
        let (encoders, client) = (Arc::clone(&self.encoders), client.clone());
        Ok(Order { name: name.into(), view, pixels, headset, form, rate: None, encoders, client })
    }

    /// The place of a stream of the scene or of figures.
    pub(super) fn watcher(&self) -> Result<OwnedSemaphorePermit, Status> {
        let place = Arc::clone(&self.watchers).try_acquire_owned();
        place.map_err(|_| refusals::exhausted("streams", "too many streams of scene and figures: end one first"))
    }

    /// A value as it is now, and then whenever it has changed, until it is `None`. A reader that is slow finds the newest when there is room for it.
    pub(super) fn watched<T, M>(
        &self,
        mut values: watch::Receiver<Option<T>>,
        to_pb: impl Fn(&T) -> M + Send + 'static,
    ) -> Result<ReceiverStream<Result<M, Status>>, Status>
    where
        T: Clone + Send + Sync + 'static,
        M: Send + 'static,
    {
        let permit = self.watcher()?;
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
                    changed = values.changed() => if changed.is_err() { return },
                }
            }
        });
        Ok(ReceiverStream::new(stream))
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
        Refused::Full => refusals::exhausted("frames", "too many RenderFrame calls are waiting: try again later"),
        Refused::Subscribers(most) => refusals::exhausted(
            "streams",
            format!("there are {most} streams already, the most there may be: end one first"),
        ),
        Refused::Deleted => Status::not_found("the view was deleted meanwhile"),
        Refused::Headset(reason) => failed(&RenderFailure::Headset(reason)),
        Refused::Ending => Status::unavailable("the daemon is shutting down"),
    }
}

/// The attempts at a change are used up.
pub(super) fn changed_meanwhile() -> Status {
    Status::aborted("the scene has changed again and again meanwhile: try again")
}

pub(super) fn unchanged(error: &SceneError) -> Status {
    match error {
        SceneError::Revision { expected, found } => refusals::revision(error.to_string(), "scene", *expected, *found),
        SceneError::Invalid(_) => refusals::invalid(error.to_string()),
    }
}

pub(super) fn failed(failure: &RenderFailure) -> Status {
    match failure {
        RenderFailure::Deleted(name) => refusals::absent("view", name, failure.to_string()),
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
        let views = self.view_names(&scene).into_iter().map(|name| self.view(name, &scene));
        Ok(Response::new(proto::ListViewsResponse { views: views.collect::<Result<_, Status>>()? }))
    }

    async fn get_view(&self, request: Request<proto::GetViewRequest>) -> Result<Response<proto::View>, Status> {
        let scene = self.render.scene().map_err(refused)?;
        Ok(Response::new(self.view(&request.into_inner().view, &scene)?))
    }

    async fn create_view(&self, request: Request<proto::CreateViewRequest>) -> Result<Response<proto::View>, Status> {
        let by = By::of(&request)?;
        Ok(Response::new(self.created_view(&by, request.into_inner()).await?))
    }

    async fn update_view(&self, request: Request<proto::UpdateViewRequest>) -> Result<Response<proto::View>, Status> {
        let by = By::of(&request)?;
        Ok(Response::new(self.updated_view(&by, request.into_inner()).await?))
    }

    async fn delete_view(
        &self,
        request: Request<proto::DeleteViewRequest>,
    ) -> Result<Response<proto::DeleteViewResponse>, Status> {
        let by = By::of(&request)?;
        let revision = self.deleted_view(&by, request.into_inner()).await?;
        Ok(Response::new(proto::DeleteViewResponse { revision }))
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
        let held = client.hold_output(order.most_bytes())?;
        let rendered = self.rendered(&order).await?;
        let held = held.and(order.more_room(&rendered)?);
        Ok(holding(order.encode(&rendered, Reading::default()).await?, held))
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
        let held = client.hold_output(order.most_bytes())?;
        let rate = request.max_rate_hz;
        let interval = if rate == 0.0 {
            Duration::ZERO
        } else if RATES_HZ.contains(&rate) {
            Duration::from_secs_f64(rate.recip())
        } else {
            let (min, max) = (RATES_HZ.start(), RATES_HZ.end());
            let message = format!("max_rate_hz = {rate}: allowed are 0 (every frame) and {min} to {max}");
            return Err(refusals::invalid(message));
        };
        let order = Order { rate: Some(Rate::Streamed(interval)), ..order };
        let subscription = match &order.headset {
            None => self.render.subscribe(order.view, order.wanted(), interval),
            Some(headset) => headset.subscribe(order.wanted(), interval),
        };
        let subscription = subscription.map_err(refused)?;
        let room = Room::new(&order);
        let acknowledged = request.acknowledged.then(|| self.render.streams().acknowledged());
        let stream: Self::StreamFramesStream =
            Box::pin(FrameStream::new(Source { subscription, acknowledged, seen: None, room }, order));
        Ok(holding(stream, held))
    }
}
