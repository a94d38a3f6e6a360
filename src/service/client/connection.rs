//! A client of the daemon in plain Rust types.

use std::{
    error::Error,
    time::{Duration, SystemTime},
};

use tonic::{Code, Status, Streaming, service::interceptor::InterceptedService, transport::Endpoint};

use super::credentials::{Credentials, Transport};
use crate::{
    config::ViewSpec,
    gpu::AdapterReport,
    output::Encoding,
    plan::settings::{ExposureKeys, GlareKeys, ToneMapKeys},
    scene::{Camera, PoseError},
    service::{
        proto::{
            self, camera_service_client::CameraServiceClient, diagnostics_service_client::DiagnosticsServiceClient,
            scene_service_client::SceneServiceClient, view_service_client::ViewServiceClient,
        },
        scene::{camera::CameraUpdate, views::ViewUpdate},
        wire::{
            camera::{self, CameraMessageError, camera_from_pb},
            encoding,
            views::{keys_from_pb, spec_from_pb, spec_to_pb, view_replacement_to_pb, view_update_to_pb},
        },
    },
};

/// The daemon is pinged after this time.
const KEEPALIVE_INTERVAL: Duration = Duration::from_secs(10);
/// A daemon that does not answer a ping within this time is disconnected.
const KEEPALIVE_TIMEOUT: Duration = Duration::from_secs(5);

/// Errors of calls.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ClientError {
    /// The address is invalid, or no daemon answers there.
    #[error("cannot connect to {uri}: {}", causes(source))]
    Connect {
        /// The address.
        uri: String,
        /// Cause.
        source: tonic::transport::Error,
    },
    /// The token is invalid.
    #[error("the token contains invalid characters")]
    Token,
    /// The daemon refuses the call, or the connection broke.
    #[error("{code:?}: {message}")]
    Status {
        /// The status code.
        code: Code,
        /// Message of the daemon.
        message: String,
    },
    /// The daemon sent an invalid answer.
    #[error("the answer lacks a valid {field}")]
    Answer {
        /// The field.
        field: &'static str,
    },
    /// The change names an unknown key.
    #[error("{0}")]
    Update(String),
    /// The daemon sent an invalid camera.
    #[error("the answer holds an impossible camera: {0}")]
    Camera(#[from] PoseError),
}

/// Returns the causes of an error. The error itself names only the library's layer (`transport error`).
fn causes(error: &dyn Error) -> String {
    let mut texts: Vec<String> = Vec::new();
    let mut next = error.source();
    while let Some(cause) = next {
        next = cause.source();
        let text = cause.to_string();
        // Many errors repeat the text of their cause.
        texts.retain(|known| !text.contains(known.as_str()));
        if !texts.iter().any(|known| known.contains(&text)) {
            texts.push(text);
        }
    }
    if texts.is_empty() { error.to_string() } else { texts.join(": ") }
}

impl ClientError {
    /// Returns the status code, if the daemon answered.
    pub fn code(&self) -> Option<Code> {
        match self {
            ClientError::Status { code, .. } => Some(*code),
            _ => None,
        }
    }
}

impl From<CameraMessageError> for ClientError {
    fn from(error: CameraMessageError) -> Self {
        match error {
            CameraMessageError::Field(field) => ClientError::Answer { field },
            CameraMessageError::Pose(error) => ClientError::Camera(error),
        }
    }
}

impl From<Status> for ClientError {
    fn from(status: Status) -> Self {
        // The text of a connection error often names only the library's layer.
        let causes = status.source().map(|_| causes(&status)).filter(|causes| causes.starts_with(status.message()));
        ClientError::Status { code: status.code(), message: causes.unwrap_or_else(|| status.message().to_owned()) }
    }
}

/// A view of the daemon.
#[derive(Clone, Debug, PartialEq)]
pub struct ViewForm {
    /// Its name.
    pub name: String,
    /// Type as in configurations, or `headset`.
    pub kind: String,
    /// Images, in the order in which frames contain them. A headset has none while it is not connected.
    pub images: Vec<proto::ViewImage>,
    /// Exposure group; empty: none.
    pub exposure_group: String,
    /// Effective exposure: the keys that have an effect.
    pub exposure: ExposureKeys,
    /// Effective glare.
    pub glare: GlareKeys,
    /// Effective tone mapping.
    pub tone_map: ToneMapKeys,
    /// Keys that the view or its group sets itself: `glare.fraction`.
    pub own_keys: Vec<String>,
    /// Specification, which can be changed and sent back; `None` if no keys describe the geometry, as for a headset.
    pub definition: Option<ViewSpec>,
    /// Revision of the scene, which includes changes of views.
    pub revision: u64,
}

impl TryFrom<proto::View> for ViewForm {
    type Error = ClientError;

    fn try_from(view: proto::View) -> Result<Self, ClientError> {
        let lacks = |field| move |_| ClientError::Answer { field };
        let definition = view.definition.as_ref().map(spec_from_pb).transpose();
        Ok(Self {
            images: view.images,
            exposure: keys_from_pb(&view.exposure.unwrap_or_default(), "exposure").map_err(lacks("exposure"))?,
            glare: keys_from_pb(&view.glare.unwrap_or_default(), "glare").map_err(lacks("glare"))?,
            tone_map: keys_from_pb(&view.tone_map.unwrap_or_default(), "tone_map").map_err(lacks("tone_map"))?,
            name: view.name,
            kind: view.r#type,
            exposure_group: view.exposure_group,
            own_keys: view.own_keys,
            definition: definition.map_err(|_| ClientError::Answer { field: "definition" })?.map(|(spec, _)| spec),
            revision: view.revision,
        })
    }
}

/// A received image.
#[derive(Clone, Debug, PartialEq)]
pub struct ReceivedImage {
    /// Empty for a view's only image, otherwise `left`, `right` or the name of the cube face.
    pub part: String,
    /// Width, pixels.
    pub width: u32,
    /// Height, pixels.
    pub height: u32,
    /// Encoding of `data`.
    pub encoding: Encoding,
    /// The encoded pixels.
    pub data: Vec<u8>,
    /// H.264: whether it can be decoded without earlier images.
    pub key_frame: bool,
}

/// A frame of one view.
#[derive(Clone, Debug, PartialEq)]
pub struct ReceivedFrame {
    /// Name of the view.
    pub view: String,
    /// Number of the frame, counted over all views of the renderer; a headset has a separate count.
    pub number: u64,
    /// Revision of the scene.
    pub scene_revision: u64,
    /// Revision of the camera.
    pub camera_revision: u64,
    /// Time at which the daemon received that camera, by its clock; for a headset: time at which it requested the poses
    /// of the eyes.
    pub pose_time: SystemTime,
    /// Time at which the frame was rendered, by the daemon's clock.
    pub render_time: SystemTime,
    /// Exposure, EV at ISO 100.
    pub exposure_ev100: f64,
    /// Limiting magnitude of stars in the display image; `None` if unknown.
    pub limiting_magnitude: Option<f64>,
    /// Deep stores: upper bound of a pixel's error due to stars that have not been read yet, 8-bit codes; `None`: no stars of a deep store are drawn.
    pub residual_codes: Option<f64>,
    /// Number of frames that this stream has dropped so far.
    pub dropped: u64,
    /// Quality level of its display images; 0: as configured.
    pub quality_level: u32,
    /// Descriptions of the reductions of quality.
    pub given_up: Vec<String>,
    /// Camera of the frame; for a headset: the origin of the room.
    pub camera: Camera,
    /// The images of the view.
    pub images: Vec<ReceivedImage>,
    /// H.264: the sequence that the images belong to; otherwise 0.
    pub video: u64,
}

/// Information about the daemon and its adapter.
#[derive(Clone, Debug, PartialEq)]
pub struct ServerInfo {
    /// Version of the daemon.
    pub version: String,
    /// Adapter, driver, features, used limits (sorted by name), and fallbacks.
    pub adapter: AdapterReport,
    /// Number of stars in the scene.
    pub stars: u64,
    /// Revision of the scene.
    pub scene_revision: u64,
    /// Frames rendered since the start.
    pub frames_rendered: u64,
    /// Status of the headset; `None` if the daemon drives none.
    pub headset: Option<proto::HeadsetStatus>,
}

/// Reads the camera of an answer.
pub(crate) fn received_camera(camera: proto::Camera) -> Result<Camera, ClientError> {
    Ok(camera_from_pb(camera)?)
}

pub(crate) fn time(time: Option<prost_types::Timestamp>, field: &'static str) -> Result<SystemTime, ClientError> {
    time.and_then(|time| time.try_into().ok()).ok_or(ClientError::Answer { field })
}

impl TryFrom<proto::Frame> for ReceivedFrame {
    type Error = ClientError;

    fn try_from(frame: proto::Frame) -> Result<Self, ClientError> {
        let images = frame.images.into_iter().map(|image| {
            let encoding = encoding::encoding_from_pb(image.encoding);
            Ok(ReceivedImage {
                part: image.part,
                width: image.width,
                height: image.height,
                encoding: encoding.ok_or(ClientError::Answer { field: "encoding" })?,
                data: image.data.into(),
                key_frame: image.key_frame,
            })
        });
        Ok(Self {
            view: frame.view,
            number: frame.frame_number,
            scene_revision: frame.scene_revision,
            camera_revision: frame.camera_revision,
            pose_time: time(frame.pose_time, "pose_time")?,
            render_time: time(frame.render_time, "render_time")?,
            exposure_ev100: frame.exposure_ev100,
            limiting_magnitude: frame.limiting_magnitude,
            residual_codes: frame.residual_codes,
            dropped: frame.dropped,
            quality_level: frame.quality_level,
            given_up: frame.given_up,
            camera: received_camera(frame.camera.ok_or(ClientError::Answer { field: "camera" })?)?,
            images: images.collect::<Result<_, ClientError>>()?,
            video: frame.video,
        })
    }
}

/// The frames of a subscription. Dropping it ends the subscription. Frames are acknowledged when they are returned, so
/// that a slow reader still gets new frames.
#[derive(Debug)]
pub struct FrameReceiver {
    stream: Streaming<proto::Frame>,
    view: ViewServiceClient<Transport>,
}

impl FrameReceiver {
    /// Waits for the next frame; `None` when the daemon has ended the stream without an error.
    pub async fn next(&mut self) -> Result<Option<ReceivedFrame>, ClientError> {
        let Some(frame) = self.stream.message().await? else { return Ok(None) };
        let read = proto::AcknowledgeFrameRequest { stream: frame.stream, frame_number: frame.frame_number };
        match self.view.acknowledge_frame(read).await {
            Ok(_) => {}
            // If the stream has ended, or the daemon accepts no new calls, the next request for a frame reports it.
            Err(status) if matches!(status.code(), Code::NotFound | Code::Cancelled | Code::Unavailable) => {}
            Err(status) => return Err(status.into()),
        }
        ReceivedFrame::try_from(frame).map(Some)
    }
}

/// Identifies the last frame that the client has, so that the next one can be requested: a [`ReceivedFrame`], or the number of a frame (0: none).
/// With a number, H.264 starts with a key picture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct After {
    number: u64,
    video: u64,
}

impl From<u64> for After {
    fn from(number: u64) -> Self {
        Self { number, video: 0 }
    }
}

impl From<&ReceivedFrame> for After {
    fn from(frame: &ReceivedFrame) -> Self {
        Self { number: frame.number, video: frame.video }
    }
}

fn next_request(view: &str, encoding: Encoding, after: After, max_size: u32) -> proto::NextFrameRequest {
    let encoding = encoding::encoding_to_pb(encoding).into();
    let After { number: after_frame_number, video } = after;
    proto::NextFrameRequest { view: view.to_owned(), encoding, after_frame_number, max_size, video }
}

/// A connection to a daemon. Clones share it.
#[derive(Clone, Debug)]
pub struct Client {
    pub(crate) camera: CameraServiceClient<Transport>,
    view: ViewServiceClient<Transport>,
    pub(crate) diagnostics: DiagnosticsServiceClient<Transport>,
    pub(crate) scene: SceneServiceClient<Transport>,
}

/// Maximum size of the frames into which HTTP/2 divides a message, bytes. The daemon makes a system call for each, and the default is 16 KiB.
const MOST_HTTP2_FRAME_BYTES: u32 = 1 << 20;

impl Client {
    /// Connects to a daemon at, for example, `http://127.0.0.1:7143` or `unix:PATH`.
    ///
    /// # Errors
    ///
    /// The address is invalid, or no daemon answers.
    pub async fn connect(uri: &str) -> Result<Self, ClientError> {
        Self::connect_as(uri, &Credentials::default()).await
    }

    /// Connects to a daemon with access control at, for example, `https://control.example.org:7143`.
    ///
    /// # Errors
    ///
    /// The address or the credentials are invalid, or no daemon answers. Unknown credentials are reported by the first
    /// call.
    pub async fn connect_as(uri: &str, credentials: &Credentials) -> Result<Self, ClientError> {
        let failed = |source| ClientError::Connect { uri: uri.to_owned(), source };
        let mut endpoint = Endpoint::from_shared(uri.to_owned()).map_err(failed)?;
        // These intervals reveal a daemon that hangs within 15 s.
        endpoint = endpoint
            .tcp_nodelay(true)
            .max_frame_size(MOST_HTTP2_FRAME_BYTES)
            .http2_keep_alive_interval(KEEPALIVE_INTERVAL)
            .keep_alive_timeout(KEEPALIVE_TIMEOUT)
            .keep_alive_while_idle(true);
        if uri.starts_with("https:") {
            endpoint = endpoint.tls_config(credentials.tls()).map_err(failed)?;
        }
        let channel = endpoint.connect().await.map_err(failed)?;
        let channel = InterceptedService::new(channel, credentials.bearer()?);
        Ok(Self {
            camera: CameraServiceClient::new(channel.clone()),
            // A frame of large views may be hundreds of megabytes in size, but the default limit is 4 MiB.
            view: ViewServiceClient::new(channel.clone()).max_decoding_message_size(usize::MAX),
            diagnostics: DiagnosticsServiceClient::new(channel.clone()),
            scene: SceneServiceClient::new(channel),
        })
    }

    /// Returns the current camera.
    pub async fn camera(&mut self) -> Result<Camera, ClientError> {
        received_camera(self.camera.get_camera(proto::GetCameraRequest {}).await?.into_inner())
    }

    /// Moves the camera; returns the camera with its new revision.
    pub async fn set_camera(&mut self, update: &CameraUpdate) -> Result<Camera, ClientError> {
        received_camera(self.camera.set_camera(camera::update_to_pb(update)).await?.into_inner())
    }

    /// Lists the views.
    pub async fn views(&mut self) -> Result<Vec<ViewForm>, ClientError> {
        let answer = self.view.list_views(proto::ListViewsRequest {}).await?.into_inner();
        answer.views.into_iter().map(ViewForm::try_from).collect()
    }

    /// Returns a view.
    pub async fn view(&mut self, name: &str) -> Result<ViewForm, ClientError> {
        self.view.get_view(proto::GetViewRequest { view: name.to_owned() }).await?.into_inner().try_into()
    }

    /// Creates a view if the scene has the expected revision.
    pub async fn create_view(
        &mut self,
        spec: &ViewSpec,
        expected_revision: Option<u64>,
    ) -> Result<ViewForm, ClientError> {
        let definition = spec_to_pb(spec).map_err(|error| ClientError::Update(error.to_string()))?;
        let request = proto::CreateViewRequest { definition: Some(definition), expected_revision };
        self.view.create_view(request).await?.into_inner().try_into()
    }

    /// Deletes a view if the scene has the expected revision; returns the new revision.
    pub async fn delete_view(&mut self, name: &str, expected_revision: Option<u64>) -> Result<u64, ClientError> {
        let request = proto::DeleteViewRequest { view: name.to_owned(), expected_revision };
        Ok(self.view.delete_view(request).await?.into_inner().revision)
    }

    /// Changes a view if the scene has the expected revision; returns the changed view.
    pub async fn update_view(
        &mut self,
        name: &str,
        update: &ViewUpdate,
        expected_revision: Option<u64>,
    ) -> Result<ViewForm, ClientError> {
        let request = view_update_to_pb(name, update, expected_revision).map_err(ClientError::Update)?;
        self.view.update_view(request).await?.into_inner().try_into()
    }

    /// Replaces the view that has the name of the specification if the scene has the expected revision.
    pub async fn replace_view(
        &mut self,
        spec: &ViewSpec,
        expected_revision: Option<u64>,
    ) -> Result<ViewForm, ClientError> {
        let request = view_replacement_to_pb(spec, expected_revision).map_err(ClientError::Update)?;
        self.view.update_view(request).await?.into_inner().try_into()
    }

    /// Renders a view with the newest camera.
    pub async fn render_frame(&mut self, view: &str, encoding: Encoding) -> Result<ReceivedFrame, ClientError> {
        let encoding = encoding::encoding_to_pb(encoding).into();
        let request = proto::RenderFrameRequest { view: view.to_owned(), encoding, max_size: 0 };
        self.view.render_frame(request).await?.into_inner().try_into()
    }

    /// Subscribes to a view. `max_rate_hz` = 0: every frame.
    pub async fn stream_frames(
        &mut self,
        view: &str,
        encoding: Encoding,
        max_rate_hz: f64,
    ) -> Result<FrameReceiver, ClientError> {
        let encoding = encoding::encoding_to_pb(encoding).into();
        let request = proto::StreamFramesRequest {
            view: view.to_owned(),
            encoding,
            max_rate_hz,
            acknowledged: true,
            max_size: 0,
        };
        let stream = self.view.stream_frames(request).await?.into_inner();
        Ok(FrameReceiver { stream, view: self.view.clone() })
    }

    /// Returns the next frame of a view after another one (0: any) as soon as it exists. Display images with a longest side above `max_size` pixels
    /// are scaled down; if it is 0, none are.
    pub async fn next_frame(
        &mut self,
        view: &str,
        encoding: Encoding,
        after: impl Into<After>,
        max_size: u32,
    ) -> Result<ReceivedFrame, ClientError> {
        let request = next_request(view, encoding, after.into(), max_size);
        self.view.next_frame(request).await?.into_inner().try_into()
    }

    /// Returns the next frames of several views, each after the last frame that the client has. Waits until at least one of them is ready, and
    /// returns all frames that are ready at that time.
    pub async fn next_frames<A: Into<After> + Copy>(
        &mut self,
        views: &[(&str, Encoding, A)],
    ) -> Result<Vec<ReceivedFrame>, ClientError> {
        let request = |(view, encoding, after): &(&str, Encoding, A)| next_request(view, *encoding, (*after).into(), 0);
        let request = proto::NextFramesRequest { views: views.iter().map(request).collect() };
        let answer = self.view.next_frames(request).await?.into_inner();
        answer.frames.into_iter().map(ReceivedFrame::try_from).collect()
    }

    /// Returns information about the daemon and its adapter.
    pub async fn info(&mut self) -> Result<ServerInfo, ClientError> {
        let info = self.diagnostics.get_info(proto::GetInfoRequest {}).await?.into_inner();
        let mut limits: Vec<(String, u64)> = info.limits.into_iter().collect();
        limits.sort();
        Ok(ServerInfo {
            version: info.version,
            adapter: AdapterReport {
                adapter: info.adapter,
                driver: info.driver,
                backend: info.backend,
                device_type: info.device_type,
                features: info.features,
                limits,
                fallbacks: info.fallbacks,
            },
            stars: info.stars,
            scene_revision: info.scene_revision,
            frames_rendered: info.frames_rendered,
            headset: info.headset,
        })
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic on unexpected values")]
mod tests {
    use super::*;

    #[tokio::test]
    async fn a_failed_connection_names_its_cause() {
        let listener = tokio::net::TcpListener::bind("127.0.0.1:0").await.unwrap();
        let uri = format!("http://{}", listener.local_addr().unwrap());
        drop(listener);
        let error = Client::connect(&uri).await.unwrap_err();
        let mut io = error.source();
        while let Some(cause) = io.and_then(Error::source) {
            io = Some(cause);
        }
        let text = error.to_string();
        assert!(text.starts_with(&format!("cannot connect to {uri}: ")), "{text}");
        assert!(text.contains(&io.unwrap().to_string()) && !text.contains("transport error"), "{text}");
    }
}
