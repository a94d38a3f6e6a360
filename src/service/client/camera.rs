//! The client's long-running calls about the camera.

use std::time::SystemTime;

use tokio::{sync::mpsc, task::JoinHandle};
use tokio_stream::wrappers::ReceiverStream;
use tonic::{Response, Status, Streaming};

use super::connection::{Client, ClientError, received_camera};
use crate::{
    observer::Frame,
    scene::Camera,
    service::{proto, scene::camera::CameraUpdate, wire::camera},
};

/// Capacity of the queue of poses to be sent.
const WAITING: usize = 16;

/// Lease that a stream of poses requests.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lease {
    /// No lease: poses are accepted while no other client holds it.
    None,
    /// Takes the lease if it is free.
    Take,
    /// Takes the lease, even from another holder.
    TakeOver,
}

/// A stream of poses. Dropping it ends the stream and releases the lease.
#[derive(Debug)]
pub struct Steering {
    poses: mpsc::Sender<proto::StreamCameraRequest>,
    answer: JoinHandle<Result<Response<proto::StreamCameraResponse>, Status>>,
}

impl Steering {
    /// Moves the camera; waits if poses are queued faster than they are sent. Returns `false` if the daemon has ended
    /// the stream; [`Self::end`] returns the reason.
    pub async fn send(&mut self, update: &CameraUpdate) -> bool {
        self.pass(update, None).await
    }

    /// Sends a pose for a time of the daemon's clock. The camera moves to it from the previous pose; each frame shows the camera's place at the time
    /// at which the frame is displayed.
    pub async fn send_for(&mut self, update: &CameraUpdate, time: SystemTime) -> bool {
        self.pass(update, Some(time.into())).await
    }

    async fn pass(&mut self, update: &CameraUpdate, time: Option<prost_types::Timestamp>) -> bool {
        let camera = Some(camera::update_to_pb(update));
        let message = proto::StreamCameraRequest { camera, time, ..proto::StreamCameraRequest::default() };
        !self.answer.is_finished() && self.poses.send(message).await.is_ok()
    }

    /// Ends the stream; returns the camera after the last pose, and the number of accepted poses.
    pub async fn end(self) -> Result<(Camera, u64), ClientError> {
        let Self { poses, answer } = self;
        drop(poses);
        let answer = answer.await.map_err(|error| Status::internal(error.to_string()))??.into_inner();
        let camera = answer.camera.ok_or(ClientError::Answer { field: "camera" })?;
        Ok((received_camera(camera)?, answer.poses))
    }
}

/// Changes of the camera. Dropping it ends the stream.
#[derive(Debug)]
pub struct CameraReceiver {
    stream: Streaming<proto::Camera>,
}

impl CameraReceiver {
    /// Waits for the next change; `None` when the daemon has ended the stream without an error.
    pub async fn next(&mut self) -> Result<Option<Camera>, ClientError> {
        self.stream.message().await?.map(received_camera).transpose()
    }
}

impl Client {
    /// Moves the camera if it has the expected revision; returns the camera with its new revision.
    pub async fn move_camera(&mut self, update: &CameraUpdate, expected_revision: u64) -> Result<Camera, ClientError> {
        let expected_revision = Some(expected_revision);
        let request = proto::SetCameraRequest { expected_revision, ..camera::update_to_pb(update) };
        received_camera(self.camera.set_camera(request).await?.into_inner())
    }

    /// Points the camera at a body or a star. The camera is then fixed to the reference frame `frame`, whose pole is up; if it is `None`, to its
    /// current frame.
    pub async fn look_at(&mut self, name: &str, frame: Option<Frame>) -> Result<Camera, ClientError> {
        let frame = frame.map_or(proto::SkyFrame::Unspecified, camera::sky_frame_to_pb).into();
        let look = Some(proto::Look { frame, at: name.to_owned(), ..Default::default() });
        let request = proto::SetCameraRequest { look, ..Default::default() };
        received_camera(self.camera.set_camera(request).await?.into_inner())
    }

    /// Returns the holder of the lease of the camera; empty if there is none.
    pub async fn camera_holder(&mut self) -> Result<String, ClientError> {
        Ok(self.camera.get_camera(proto::GetCameraRequest {}).await?.into_inner().holder)
    }

    /// Opens a stream of poses. Clients that are refused in the meantime see the name `holder`.
    pub async fn steer(&mut self, lease: Lease, holder: &str) -> Result<Steering, ClientError> {
        let (poses, stream) = mpsc::channel(WAITING);
        let lease = match lease {
            Lease::None => proto::CameraLease::None,
            Lease::Take => proto::CameraLease::Take,
            Lease::TakeOver => proto::CameraLease::TakeOver,
        };
        let (lease, holder) = (lease.into(), holder.to_owned());
        let first = proto::StreamCameraRequest { camera: None, lease, holder, time: None };
        // The channel is new and has room.
        poses.send(first).await.map_err(|_| Status::internal("the stream has no reader"))?;
        let mut camera = self.camera.clone();
        let answer = tokio::spawn(async move { camera.stream_camera(ReceiverStream::new(stream)).await });
        Ok(Steering { poses, answer })
    }

    /// Watches the camera: its current value, and every change.
    pub async fn watch_camera(&mut self) -> Result<CameraReceiver, ClientError> {
        Ok(CameraReceiver { stream: self.camera.watch_camera(proto::WatchCameraRequest {}).await?.into_inner() })
    }
}
