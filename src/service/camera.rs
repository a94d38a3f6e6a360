//! The calls that concern the camera: who may move it, and where it is.

use std::{
    sync::Arc,
    time::{Duration, SystemTime},
};

use tokio::{sync::oneshot, task, time::timeout};
use tokio_stream::wrappers::ReceiverStream;
use tonic::{Request, Response, Status, Streaming};

use super::{
    access::By,
    convert,
    find::turned,
    handlers::{Service, refused},
    proto::{self, CameraLease},
    refusals,
    render::{CameraError, CameraUpdate, Refused, RenderHandle},
};
use crate::{observer::Frame, scene::Camera};

/// Longest name of one who steers, characters.
const MOST_NAME: usize = 64;

pub(super) fn unmoved(error: &CameraError) -> Status {
    match error {
        CameraError::Pose(_) | CameraError::Scene(_) | CameraError::Time(_) => refusals::invalid(error.to_string()),
        CameraError::Revision { expected, found } => refusals::revision(error.to_string(), "camera", *expected, *found),
        CameraError::Leased { holder } => refusals::leased(error.to_string(), holder),
        CameraError::Ending => Status::unavailable(error.to_string()),
    }
}

/// Gives a lease back when the call that holds it ends, however it ends.
struct Steering {
    render: RenderHandle,
    lease: Option<u64>,
}

impl Drop for Steering {
    fn drop(&mut self) {
        if let Some(lease) = self.lease {
            self.render.release_camera(lease);
        }
    }
}

/// What the first message of a stream says of the lease.
fn lease_of(message: &proto::StreamCameraRequest) -> Result<Option<bool>, Status> {
    let wrong = |problem: String| Err(refusals::invalid(problem));
    if message.holder.chars().count() > MOST_NAME {
        return wrong(format!("holder: at most {MOST_NAME} characters are allowed"));
    }
    match CameraLease::try_from(message.lease) {
        Ok(CameraLease::None) => Ok(None),
        Ok(CameraLease::Take) => Ok(Some(false)),
        Ok(CameraLease::TakeOver) => Ok(Some(true)),
        Err(_) => wrong(format!(
            "lease = {}: allowed are CAMERA_LEASE_NONE, CAMERA_LEASE_TAKE and CAMERA_LEASE_TAKE_OVER",
            message.lease
        )),
    }
}

/// Who has taken a lease over.
async fn taken_over(taken: &mut Option<oneshot::Receiver<String>>) -> String {
    match taken {
        // A lease is dropped unsent at the end of the daemon alone, which ends the call too.
        Some(taken) => taken.await.unwrap_or_default(),
        None => std::future::pending().await,
    }
}

/// How often a camera that moves is saved.
const SAVES: Duration = Duration::from_secs(1);

impl Service {
    /// Saves the camera while it moves, and at the end, until the daemon ends.
    pub(super) async fn keep_camera(self) {
        let mut cameras = self.render.watch_camera();
        cameras.mark_unchanged();
        let mut last = *cameras.borrow();
        loop {
            let ended = cameras.changed().await.is_err();
            if !ended {
                // Until the next one is due, or the end.
                let _ = timeout(SAVES, cameras.wait_for(Option::is_none)).await;
            }
            let now = *cameras.borrow_and_update();
            let ends = ended || now.is_none();
            let newest = now.or_else(|| Some(self.render.camera()));
            if let Some(camera) = newest.filter(|camera| last.map(|last| last.revision) != Some(camera.revision)) {
                let file = Arc::clone(&self.state).lock_owned().await;
                let saving = move || file.as_ref().map_or(Ok(()), |file| file.save_camera(&camera));
                match task::spawn_blocking(saving).await {
                    Ok(Ok(())) => last = Some(camera),
                    Ok(Err(error)) => tracing::error!("the camera is not saved: {error}"),
                    Err(error) => tracing::error!("the camera is not saved: {error}"),
                }
            }
            if ends {
                return;
            }
        }
    }

    /// A camera, and who has its lease.
    fn told(&self, camera: &Camera) -> proto::Camera {
        proto::Camera { holder: self.render.holder(), ..convert::camera_to_pb(camera) }
    }

    /// The change that is asked for, of the scene as it is now.
    fn camera_update(&self, mut request: proto::SetCameraRequest) -> Result<CameraUpdate, Status> {
        let look = request.look.take();
        let frame = convert::sky_frame_from_pb(request.frame).map_err(refusals::invalid)?;
        let update = CameraUpdate { frame, ..convert::update_from_pb(request) };
        if look.is_none() && frame.is_none() {
            return Ok(update);
        }
        let state = self.render.scene().map_err(refused)?;
        let Some(look) = look else {
            if frame == Some(Frame::Horizon) && state.objects.drawn.observer.is_none() {
                return Err(refusals::invalid("frame: SKY_FRAME_HORIZON: the scene has no observer"));
            }
            return Ok(update);
        };
        if update.orientation.is_some() || frame.is_some() {
            return Err(refusals::invalid("look: orientation or frame is given too: at most one of them is allowed"));
        }
        let (turned, frame) = turned(&look, &self.render.snapshot(&state)).map_err(refusals::invalid)?;
        Ok(CameraUpdate { orientation: Some(turned.to_array()), frame: Some(frame), ..update })
    }

    fn place_camera(&self, request: proto::SetCameraRequest, lease: Option<u64>) -> Result<Camera, Status> {
        let expected = request.expected_revision;
        let update = self.camera_update(request)?;
        self.render.set_camera(&update, expected, lease).map_err(|error| unmoved(&error))
    }

    fn plan_camera(
        &self,
        request: proto::SetCameraRequest,
        time: prost_types::Timestamp,
        lease: Option<u64>,
    ) -> Result<Camera, Status> {
        if request.expected_revision.is_some() {
            return Err(refusals::invalid(
                "expected_revision: a pose with a time has none, since the camera moves until then",
            ));
        }
        let time = SystemTime::try_from(time).map_err(|error| refusals::invalid(format!("time: {error}")))?;
        let update = self.camera_update(request)?;
        self.render.plan_camera(&update, time, lease).map_err(|error| unmoved(&error))
    }
}

#[tonic::async_trait]
impl proto::camera_service_server::CameraService for Service {
    type WatchCameraStream = ReceiverStream<Result<proto::Camera, Status>>;

    async fn get_camera(&self, _: Request<proto::GetCameraRequest>) -> Result<Response<proto::Camera>, Status> {
        Ok(Response::new(self.told(&self.render.camera())))
    }

    async fn set_camera(&self, request: Request<proto::SetCameraRequest>) -> Result<Response<proto::Camera>, Status> {
        let by = By::of(&request)?;
        let camera = self.place_camera(request.into_inner(), None)?;
        by.moved(camera.revision);
        Ok(Response::new(self.told(&camera)))
    }

    async fn watch_camera(
        &self,
        _: Request<proto::WatchCameraRequest>,
    ) -> Result<Response<Self::WatchCameraStream>, Status> {
        let service = self.clone();
        Ok(Response::new(self.watched(self.render.watch_camera(), move |camera| service.told(camera))?))
    }

    async fn stream_camera(
        &self,
        request: Request<Streaming<proto::StreamCameraRequest>>,
    ) -> Result<Response<proto::StreamCameraResponse>, Status> {
        let by = By::of(&request)?;
        let client = by.client();
        let mut messages = request.into_inner();
        let mut steering = Steering { render: self.render.clone(), lease: None };
        let mut taken: Option<oneshot::Receiver<String>> = None;
        let mut ends = self.render.watch_camera();
        let (mut is_first, mut poses) = (true, 0);
        loop {
            let message = tokio::select! {
                message = messages.message() => message?,
                by = taken_over(&mut taken), if taken.is_some() => {
                    return Err(refusals::leased(format!("`{by}` has taken the lease of the camera over"), &by));
                }
                _ = ends.wait_for(Option::is_none) => return Err(refused(Refused::Ending)),
            };
            let Some(message) = message else { break };
            if std::mem::take(&mut is_first) {
                if let Some(over) = lease_of(&message)? {
                    let holder = if message.holder.is_empty() { client.name() } else { message.holder.clone() };
                    let (lease, is_taken) = self.render.lease_camera(&holder, over).map_err(|error| unmoved(&error))?;
                    by.did(&format!(
                        "StreamCamera: `{holder}` {} the lease",
                        if over { "takes over" } else { "takes" }
                    ));
                    steering.lease = Some(lease);
                    taken = Some(is_taken);
                }
            } else if message.lease != 0 || !message.holder.is_empty() {
                return Err(refusals::invalid("lease and holder: only the first message may have them"));
            }
            if let Some(camera) = message.camera {
                let placed = match message.time {
                    None => self.place_camera(camera, steering.lease)?,
                    Some(time) => self.plan_camera(camera, time, steering.lease)?,
                };
                by.moved(placed.revision);
                poses += 1;
            } else if message.time.is_some() {
                return Err(refusals::invalid("time: it is that of a camera, and there is none"));
            }
        }
        let camera = Some(self.told(&self.render.camera()));
        Ok(Response::new(proto::StreamCameraResponse { camera, poses }))
    }
}
