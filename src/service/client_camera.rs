//! The client's calls about the camera that last.

use std::time::SystemTime;

use tokio::{sync::mpsc, task::JoinHandle};
use tokio_stream::wrappers::ReceiverStream;
use tonic::{Response, Status, Streaming};

use super::{
    client::{Client, ClientError, camera_from_pb},
    convert, proto,
    render::CameraUpdate,
};
use crate::{observer::Frame, scene::Camera};

/// Poses that wait to be sent.
const WAITING: usize = 16;

/// What a stream of poses does with the lease of the camera.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lease {
    /// Poses are taken while nobody has it.
    None,
    /// It is taken if nobody has it.
    Take,
    /// It is taken from whoever has it.
    TakeOver,
}

/// A stream of poses. Dropping it ends the stream, and gives the lease back.
#[derive(Debug)]
pub struct Steering {
    poses: mpsc::Sender<proto::StreamCameraRequest>,
    answer: JoinHandle<Result<Response<proto::StreamCameraResponse>, Status>>,
}

impl Steering {
    /// Moves the camera; waits where poses come faster than they are sent. `false`: the daemon has ended the stream, [`Self::end`] says why.
    pub async fn send(&mut self, update: &CameraUpdate) -> bool {
        self.pass(update, None).await
    }

    /// The same for a time by the daemon's clock: until then the camera moves there from the pose before, and frames show where it is when they are seen.
    pub async fn send_for(&mut self, update: &CameraUpdate, time: SystemTime) -> bool {
        self.pass(update, Some(time.into())).await
    }

    async fn pass(&mut self, update: &CameraUpdate, time: Option<prost_types::Timestamp>) -> bool {
        let camera = Some(convert::update_to_pb(update));
        let message = proto::StreamCameraRequest { camera, time, ..proto::StreamCameraRequest::default() };
        !self.answer.is_finished() && self.poses.send(message).await.is_ok()
    }

    /// Ends the stream; gives the camera after the last pose, and how many poses were taken.
    pub async fn end(self) -> Result<(Camera, u64), ClientError> {
        let Self { poses, answer } = self;
        drop(poses);
        let answer = answer.await.map_err(|error| Status::internal(error.to_string()))??.into_inner();
        let camera = answer.camera.ok_or(ClientError::Answer { field: "camera" })?;
        Ok((camera_from_pb(camera)?, answer.poses))
    }
}

/// The camera whenever it has changed. Dropping it ends the stream.
#[derive(Debug)]
pub struct CameraReceiver {
    stream: Streaming<proto::Camera>,
}

impl CameraReceiver {
    /// Waits for the next one; `None` when the daemon has ended the stream in good order.
    pub async fn next(&mut self) -> Result<Option<Camera>, ClientError> {
        self.stream.message().await?.map(camera_from_pb).transpose()
    }
}

impl Client {
    /// Moves the camera, if it has the revision expected; returns it with its new revision.
    pub async fn move_camera(&mut self, update: &CameraUpdate, expected_revision: u64) -> Result<Camera, ClientError> {
        let expected_revision = Some(expected_revision);
        let request = proto::SetCameraRequest { expected_revision, ..convert::update_to_pb(update) };
        camera_from_pb(self.camera.set_camera(request).await?.into_inner())
    }

    /// Points the camera at a body or a star, from then on hanging on the axes of `frame`, whose pole is up; without it on those that it hangs on.
    pub async fn look_at(&mut self, name: &str, frame: Option<Frame>) -> Result<Camera, ClientError> {
        let frame = frame.map_or(proto::SkyFrame::Unspecified, convert::sky_frame_to_pb).into();
        let look = Some(proto::Look { frame, at: name.to_owned(), ..Default::default() });
        let request = proto::SetCameraRequest { look, ..Default::default() };
        camera_from_pb(self.camera.set_camera(request).await?.into_inner())
    }

    /// Who has the lease of the camera; empty: nobody.
    pub async fn camera_holder(&mut self) -> Result<String, ClientError> {
        Ok(self.camera.get_camera(proto::GetCameraRequest {}).await?.into_inner().holder)
    }

    /// Streams poses. `holder` is told to those who are refused meanwhile.
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

    /// The camera now, and then whenever it has changed.
    pub async fn watch_camera(&mut self) -> Result<CameraReceiver, ClientError> {
        Ok(CameraReceiver { stream: self.camera.watch_camera(proto::WatchCameraRequest {}).await?.into_inner() })
    }
}
