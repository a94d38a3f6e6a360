//! The calls: each turns a message into plain values, asks the render thread, and turns the answer into a message.
//!
//! Frames are encoded on threads of their own, as many at once as there are processor cores.

use std::{pin::Pin, sync::Arc, thread, time::Duration};

use tokio::{sync::Semaphore, task};
use tokio_stream::Stream;
use tonic::{Request, Response, Status};

use super::{
    convert,
    frames::FrameStream,
    proto,
    render::{Refused, RenderHandle},
    slot::{RenderFailure, RenderedFrame},
};
use crate::{
    frame::Wanted,
    gpu::AdapterReport,
    output::{self, Encoding},
    view::{Rig, View},
};

/// Rates that `StreamFrames` takes, Hz, besides 0.
const RATES_HZ: std::ops::RangeInclusive<f64> = 0.001..=10_000.0;

/// What every call needs.
#[derive(Clone)]
pub(super) struct Service {
    render: RenderHandle,
    rig: Arc<Rig>,
    adapter: Arc<AdapterReport>,
    stars: u64,
    scene_revision: u64,
    /// Calls of RenderFrame that are not finished yet, from the queue to the last encoded byte.
    pending: Arc<Semaphore>,
    encoders: Arc<Semaphore>,
}

/// The images of one view, and how they are to be encoded.
#[derive(Clone)]
pub(super) struct Order {
    rig: Arc<Rig>,
    view: usize,
    encoding: Encoding,
    encoders: Arc<Semaphore>,
}

impl Service {
    pub(super) fn new(
        render: RenderHandle,
        rig: Arc<Rig>,
        adapter: AdapterReport,
        stars: u64,
        scene_revision: u64,
        pending: usize,
    ) -> Self {
        let cores = thread::available_parallelism().map_or(1, usize::from);
        Self {
            render,
            rig,
            adapter: Arc::new(adapter),
            stars,
            scene_revision,
            pending: Arc::new(Semaphore::new(pending)),
            encoders: Arc::new(Semaphore::new(cores)),
        }
    }

    fn order(&self, view: &str, encoding: i32) -> Result<Order, Status> {
        let index = self.rig.index_of(view).ok_or_else(|| {
            let names: Vec<&str> = self.rig.views().iter().map(|view| view.name.as_str()).collect();
            Status::not_found(format!("no view `{view}`; the views are: {}", names.join(", ")))
        })?;
        let encoding = convert::encoding_from_pb(encoding).ok_or_else(|| {
            Status::invalid_argument(format!("encoding = {encoding}: one of RGBA8, PNG, JPEG, RGB32F, EXR is needed"))
        })?;
        Ok(Order { rig: Arc::clone(&self.rig), view: index, encoding, encoders: Arc::clone(&self.encoders) })
    }
}

impl Order {
    fn wanted(&self) -> Wanted {
        self.encoding.wanted()
    }

    fn view(&self) -> &View {
        &self.rig.views()[self.view]
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
        Ok(proto::Frame {
            view: self.view().name.clone(),
            frame_number: frame.number,
            scene_revision: frame.scene_revision,
            camera_revision: frame.camera_revision,
            pose_time: Some(rendered.pose_time.into()),
            render_time: Some(rendered.render_time.into()),
            exposure_ev100: frame.exposure_ev100,
            dropped,
            images: images.collect::<Result<_, Status>>()?,
        })
    }
}

fn refused(refused: Refused) -> Status {
    match refused {
        Refused::Full => Status::resource_exhausted("too many RenderFrame calls are waiting: try again later"),
        Refused::Subscribers(most) => Status::resource_exhausted(format!(
            "there are {most} streams already, the most there may be: end one first"
        )),
        Refused::Ending => Status::unavailable("the daemon is shutting down"),
    }
}

pub(super) fn failed(failure: &RenderFailure) -> Status {
    match failure {
        RenderFailure::Engine(_) => Status::internal(failure.to_string()),
        RenderFailure::Ended => Status::unavailable(failure.to_string()),
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
        let views = self.rig.views().iter().map(convert::view_to_pb).collect();
        Ok(Response::new(proto::ListViewsResponse { views }))
    }

    async fn render_frame(
        &self,
        request: Request<proto::RenderFrameRequest>,
    ) -> Result<Response<proto::Frame>, Status> {
        let request = request.into_inner();
        let order = self.order(&request.view, request.encoding)?;
        let _pending = self.pending.try_acquire().map_err(|_| refused(Refused::Full))?;
        let reply = self.render.request(order.view, order.wanted()).map_err(refused)?;
        let rendered = reply.await.unwrap_or(Err(RenderFailure::Ended)).map_err(|failure| failed(&failure))?;
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
        let subscription = self.render.subscribe(order.view, order.wanted(), interval).map_err(refused)?;
        Ok(Response::new(Box::pin(FrameStream::new(subscription, order))))
    }
}

#[tonic::async_trait]
impl proto::diagnostics_service_server::DiagnosticsService for Service {
    async fn get_info(&self, _: Request<proto::GetInfoRequest>) -> Result<Response<proto::Info>, Status> {
        let frames = self.render.frames_rendered();
        Ok(Response::new(convert::info_to_pb(&self.adapter, self.stars, self.scene_revision, frames)))
    }
}
