//! Calls that read, watch and move the camera, and that take its lease.

use std::{
    sync::Arc,
    time::{Duration, SystemTime},
};

use tokio::{sync::oneshot, task, time::timeout};
use tokio_stream::wrappers::ReceiverStream;
use tonic::{Request, Response, Status, Streaming};

use super::{find::turned, service::Service};
use crate::{
    config::hidden_character,
    observer::Frame,
    scene::Camera,
    service::{
        engine::{render_handle::RenderHandle, shared_state::CameraError},
        frames::errors::{Refused, refused},
        network::{access::By, clients::ClientInfo},
        proto::{self, CameraLease},
        scene::camera::CameraUpdate,
        wire::{camera, refusals},
    },
};

/// Maximum length of a lease holder's name, characters.
const MOST_NAME: usize = 64;

pub(crate) fn unmoved(error: &CameraError) -> Status {
    match error {
        CameraError::Pose(_) | CameraError::Scene(_) | CameraError::Time(_) => refusals::invalid(error.to_string()),
        CameraError::Revision { expected, found } => refusals::revision(error.to_string(), "camera", *expected, *found),
        CameraError::Leased { holder } => refusals::leased(error.to_string(), holder),
        CameraError::Ending => Status::unavailable(error.to_string()),
    }
}

/// Ends a stream of poses when its call ends.
struct Steering {
    render: RenderHandle,
    stream: u64,
    /// Lease of the stream, if it has one.
    lease: Option<u64>,
}

impl Drop for Steering {
    fn drop(&mut self) {
        self.render.end_stream(self.stream);
    }
}

/// Reads the lease request in the first message of a stream.
fn lease_of(message: &proto::StreamCameraRequest) -> Result<Option<bool>, Status> {
    let wrong = |problem: String| Err(refusals::invalid(problem));
    if message.holder.chars().count() > MOST_NAME {
        return wrong(format!("holder: must have at most {MOST_NAME} characters"));
    }
    if !message.holder.is_empty() && message.holder.trim().is_empty() {
        return wrong("holder: must not be blank".to_owned());
    }
    // The name is shown to other clients and in the log, where it must not imitate other text.
    if let Some(hidden) = hidden_character(&message.holder) {
        let code = u32::from(hidden);
        return wrong(format!("holder: must be without control and format characters, contains U+{code:04X}"));
    }
    match CameraLease::try_from(message.lease) {
        Ok(CameraLease::None) if !message.holder.is_empty() => {
            wrong("holder: must come with a lease, CAMERA_LEASE_TAKE or CAMERA_LEASE_TAKE_OVER".to_owned())
        }
        Ok(CameraLease::None) => Ok(None),
        Ok(CameraLease::Take) => Ok(Some(false)),
        Ok(CameraLease::TakeOver) => Ok(Some(true)),
        Err(_) => wrong(format!(
            "lease = {}: must be one of CAMERA_LEASE_NONE, CAMERA_LEASE_TAKE and CAMERA_LEASE_TAKE_OVER",
            message.lease
        )),
    }
}

/// Waits for a takeover; returns the new holder.
async fn taken_over(taken: &mut Option<oneshot::Receiver<String>>) -> String {
    match taken {
        // The lease is dropped without a message only when the daemon ends, which also ends the call.
        Some(taken) => taken.await.unwrap_or_default(),
        None => std::future::pending().await,
    }
}

/// Delay before another attempt to save a camera that could not be saved.
const RETRIES: Duration = Duration::from_secs(5);
/// Interval at which a moving camera is saved.
const SAVES: Duration = Duration::from_secs(1);

impl Service {
    /// Saves the camera while it moves and once at the end, until the daemon ends.
    pub(crate) async fn keep_camera(self) {
        let mut cameras = self.render.watch_camera();
        cameras.mark_unchanged();
        let mut last = *cameras.borrow();
        let mut fails = false;
        loop {
            // After an error, such as a full disk, try again even if the camera rests.
            let again = if fails { RETRIES } else { Duration::MAX };
            let ended = matches!(timeout(again, cameras.changed()).await, Ok(Err(_)));
            if !ended {
                // Wait until the next save is due, or the daemon ends.
                let _ = timeout(SAVES, cameras.wait_for(Option::is_none)).await;
            }
            let now = *cameras.borrow_and_update();
            let ends = ended || now.is_none();
            let newest = now.or_else(|| Some(self.render.camera()));
            if let Some(camera) = newest.filter(|camera| last.map(|last| last.revision) != Some(camera.revision)) {
                let file = Arc::clone(&self.state).lock_owned().await;
                let saving = move || file.as_ref().map_or(Ok(()), |file| file.save_camera(&camera));
                let saved = task::spawn_blocking(saving).await;
                match saved
                    .map_err(|error| error.to_string())
                    .and_then(|saved| saved.map_err(|error| error.to_string()))
                {
                    Ok(()) => {
                        last = Some(camera);
                        if std::mem::take(&mut fails) {
                            tracing::info!("the camera is saved again");
                        }
                    }
                    Err(error) if !fails => {
                        fails = true;
                        tracing::error!(
                            "cannot save the camera: {error}; the daemon tries again every {} s",
                            RETRIES.as_secs()
                        );
                    }
                    // It was reported.
                    Err(_) => {}
                }
            }
            if ends {
                return;
            }
        }
    }

    /// Returns the message of a camera, with the holder of its lease and its direction for the scene's observer.
    fn camera_message(&self, camera: &Camera) -> proto::Camera {
        let look = self.render.horizontal(camera).map(camera::horizontal_to_pb);
        proto::Camera { holder: self.render.holder(), look, ..camera::camera_to_pb(camera) }
    }

    /// Returns the change that a request means for the current scene.
    fn camera_update(&self, mut request: proto::SetCameraRequest) -> Result<CameraUpdate, Status> {
        if request.turn.is_some() && (request.orientation.is_some() || request.look.is_some()) {
            return Err(refusals::invalid("turn: must not be combined with orientation or look"));
        }
        let look = request.look.take();
        let frame = camera::sky_frame_from_pb(request.frame).map_err(refusals::invalid)?;
        let update = CameraUpdate { frame, ..camera::update_from_pb(request) };
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
            return Err(refusals::invalid("look: must not be combined with orientation or frame"));
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
        by: &Steering,
    ) -> Result<Camera, Status> {
        if request.expected_revision.is_some() {
            return Err(refusals::invalid(
                "expected_revision: must be missing for a pose with a time, because the camera moves until then",
            ));
        }
        // The conversion would add nanoseconds outside of this range to the seconds.
        if !(0..1_000_000_000).contains(&time.nanos) {
            let problem = format!("time.nanos = {}: must be between 0 and 999999999", time.nanos);
            return Err(refusals::invalid(problem));
        }
        let time = SystemTime::try_from(time).map_err(|error| refusals::invalid(format!("time: {error}")))?;
        let update = self.camera_update(request)?;
        self.render.plan_camera(&update, time, (by.stream, by.lease)).map_err(|error| unmoved(&error))
    }
}

#[tonic::async_trait]
impl proto::camera_service_server::CameraService for Service {
    type WatchCameraStream = ReceiverStream<Result<proto::Camera, Status>>;

    async fn get_camera(&self, _: Request<proto::GetCameraRequest>) -> Result<Response<proto::Camera>, Status> {
        Ok(Response::new(self.camera_message(&self.render.camera())))
    }

    async fn set_camera(&self, request: Request<proto::SetCameraRequest>) -> Result<Response<proto::Camera>, Status> {
        let by = By::from_request(&request)?;
        let camera = self.place_camera(request.into_inner(), None)?;
        by.moved(camera.revision);
        Ok(Response::new(self.camera_message(&camera)))
    }

    async fn watch_camera(
        &self,
        request: Request<proto::WatchCameraRequest>,
    ) -> Result<Response<Self::WatchCameraStream>, Status> {
        let client = ClientInfo::from_request(&request)?;
        let service = self.clone();
        let to_pb = move |camera: &Camera| service.camera_message(camera);
        Ok(Response::new(self.watched(&client, self.render.watch_camera(), to_pb)?))
    }

    async fn stream_camera(
        &self,
        request: Request<Streaming<proto::StreamCameraRequest>>,
    ) -> Result<Response<proto::StreamCameraResponse>, Status> {
        let by = By::from_request(&request)?;
        let client = by.client();
        let mut messages = request.into_inner();
        let mut steering = Steering { render: self.render.clone(), stream: self.render.begin_stream(), lease: None };
        let mut taken: Option<oneshot::Receiver<String>> = None;
        let mut ends = self.render.watch_camera();
        let (mut is_first, mut poses) = (true, 0);
        loop {
            let message = tokio::select! {
                message = messages.message() => message?,
                by = taken_over(&mut taken), if taken.is_some() => {
                    return Err(refusals::leased(format!("`{by}` has taken over the lease of the camera"), &by));
                }
                _ = ends.wait_for(Option::is_none) => return Err(refused(Refused::Ending)),
            };
            let Some(message) = message else { break };
            if std::mem::take(&mut is_first) {
                if let Some(over) = lease_of(&message)? {
                    let holder = if message.holder.is_empty() { client.name() } else { message.holder.clone() };
                    let leased = self.render.lease_camera(steering.stream, &holder, over);
                    let is_taken = leased.map_err(|error| unmoved(&error))?;
                    by.did(&format!(
                        "StreamCamera: `{holder}` {} the lease",
                        if over { "takes over" } else { "takes" }
                    ));
                    steering.lease = Some(steering.stream);
                    taken = Some(is_taken);
                }
            } else if message.lease != 0 || !message.holder.is_empty() {
                return Err(refusals::invalid("lease and holder: must be in the first message only"));
            }
            if let Some(camera) = message.camera {
                let placed = match message.time {
                    None => self.place_camera(camera, steering.lease)?,
                    Some(time) => self.plan_camera(camera, time, &steering)?,
                };
                by.moved(placed.revision);
                poses += 1;
            } else if message.time.is_some() {
                return Err(refusals::invalid("time: must come with a camera, which is missing"));
            }
        }
        // The camera rests from here on.
        drop(steering);
        let camera = Some(self.camera_message(&self.render.camera()));
        Ok(Response::new(proto::StreamCameraResponse { camera, poses }))
    }
}
