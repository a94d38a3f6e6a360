//! Image requests and their encoding: the images of one view of a frame in an encoding. The images are encoded once for
//! all equal requests, on low-priority threads. Each client has few places in the queue for encoders, so that no client
//! starves the others.

use std::{
    collections::HashMap,
    sync::{
        Arc, Mutex, PoisonError,
        atomic::{AtomicU64, Ordering::Relaxed},
    },
    thread,
    time::{Duration, Instant},
};

use tokio::{
    sync::{OnceCell, Semaphore, SemaphorePermit},
    task,
};
use tonic::Status;
use tracing::Span;

use super::{
    rendered_frame::RenderedFrame,
    video::{Audience, LastPicture, Picture, Rate, Videos},
};
use crate::{
    output::{self, EncodeError, Encoding},
    render::{FrameImage, ViewStatistics, Wanted},
    service::{
        SPANS,
        network::clients::ClientInfo,
        proto,
        scene::views::ViewId,
        threads,
        wire::{camera, encoding, refusals},
    },
};

/// Encoding and size of images.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) struct ImageFormat {
    pub(crate) encoding: Encoding,
    /// Longest side, pixels; 0: full size.
    pub(crate) max_size: u32,
}

impl ImageFormat {
    /// Whether the encoding is slow: such images have separate encoders.
    fn is_slow(self) -> bool {
        self.encoding == Encoding::Exr
    }

    /// Returns the maximum size of an image with this many pixels, bytes.
    pub(crate) fn most_bytes(self, pixels: u64) -> u64 {
        // Compressed data may be slightly larger than the input.
        match self.encoding {
            Encoding::Rgba8 => 4 * pixels,
            Encoding::Png | Encoding::Jpeg | Encoding::H264 => 4 * pixels + pixels / 16 + 65_536,
            Encoding::Rgb32f => 12 * pixels,
            Encoding::Exr => 16 * pixels + pixels + 65_536,
        }
    }

    /// Returns a smaller copy; `None` if the image is small enough.
    pub(crate) fn reduced(self, image: &FrameImage) -> Option<FrameImage> {
        (self.max_size > 0).then(|| output::reduced(image, self.max_size)).flatten()
    }

    /// Returns the message of an encoded image.
    pub(crate) fn message(self, image: &FrameImage, data: Vec<u8>, key_frame: bool) -> proto::Image {
        proto::Image {
            part: image.part.name().unwrap_or_default().to_owned(),
            width: image.width,
            height: image.height,
            encoding: encoding::encoding_to_pb(self.encoding).into(),
            data: data.into(),
            key_frame,
        }
    }
}

/// The images, or a problem that would recur at every further attempt.
type Images = Result<Vec<proto::Image>, NotEncoded>;

/// Reasons why an image is not encoded.
#[derive(Clone, Debug)]
enum NotEncoded {
    /// The encoding does not support images of this size, so the client can request another encoding.
    Size(String),
    /// The encoder failed.
    Failed(String),
}

impl From<EncodeError> for NotEncoded {
    fn from(error: EncodeError) -> Self {
        match error {
            EncodeError::TooLargeForH264 { .. } | EncodeError::TooLargeForJpeg { .. } => Self::Size(error.to_string()),
            _ => Self::Failed(error.to_string()),
        }
    }
}

impl From<NotEncoded> for Status {
    fn from(problem: NotEncoded) -> Self {
        match problem {
            NotEncoded::Size(problem) => refusals::invalid(format!("encoding: {problem}")),
            NotEncoded::Failed(problem) => Status::internal(problem),
        }
    }
}

/// Returns the status of a call whose image cannot be encoded.
pub(super) fn unencoded(error: EncodeError) -> Status {
    NotEncoded::from(error).into()
}

/// Encoded images of a frame, by view and format.
#[derive(Debug, Default)]
pub(crate) struct EncodedImages {
    images: Mutex<HashMap<(ViewId, ImageFormat), EncodedOnce>>,
}

/// Encoded lazily, by the first request.
type EncodedOnce = Arc<OnceCell<Images>>;

impl EncodedImages {
    fn entry(&self, view: ViewId, form: ImageFormat) -> EncodedOnce {
        let mut images = self.images.lock().unwrap_or_else(PoisonError::into_inner);
        Arc::clone(images.entry((view, form)).or_default())
    }
}

/// Places for concurrent encodings, and statistics of the encodings.
#[derive(Debug)]
pub(crate) struct Encoders {
    quick: Semaphore,
    slow: Semaphore,
    videos: Videos,
    /// Count, bytes and total duration of encodings since the start.
    count: AtomicU64,
    bytes: AtomicU64,
    busy_ns: AtomicU64,
}

impl Encoders {
    /// Creates one place per core for fast encodings, and half as many for slow ones.
    pub(crate) fn new() -> Self {
        let cores = thread::available_parallelism().map_or(1, usize::from);
        let (quick, slow) = (Semaphore::new(cores), Semaphore::new((cores / 2).max(1)));
        let [count, bytes, busy_ns] = [0; 3].map(AtomicU64::new);
        Self { quick, slow, videos: Videos::default(), count, bytes, busy_ns }
    }

    /// Returns how many times images of a view were encoded.
    pub(crate) fn count(&self) -> u64 {
        self.count.load(Relaxed)
    }

    /// Returns the total size of these images, bytes.
    pub(crate) fn bytes(&self) -> u64 {
        self.bytes.load(Relaxed)
    }

    fn note(&self, images: &[proto::Image], begun: Instant) {
        self.count.fetch_add(1, Relaxed);
        self.bytes.fetch_add(images.iter().map(|image| image.data.len() as u64).sum(), Relaxed);
        self.busy_ns.fetch_add(u64::try_from(begun.elapsed().as_nanos()).unwrap_or(u64::MAX), Relaxed);
    }

    /// Returns the total duration of their encoding.
    pub(crate) fn busy(&self) -> Duration {
        Duration::from_nanos(self.busy_ns.load(Relaxed))
    }
}

/// A request for the images of one view in a format.
#[derive(Clone)]
pub(crate) struct ImageRequest {
    pub(crate) name: Arc<str>,
    pub(crate) view: ViewId,
    /// Pixels of the images at the time of the request; a change of the geometry may change them.
    pub(crate) pixels: u64,
    pub(crate) form: ImageFormat,
    /// `None`: a single frame is requested.
    pub(crate) rate: Option<Rate>,
    pub(crate) encoders: Arc<Encoders>,
    pub(crate) client: ClientInfo,
}

/// State of the reader that a message depends on.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct ReaderState {
    /// Frames that the reader has missed.
    pub(crate) dropped: u64,
    /// Number of the stream; 0: none.
    pub(crate) stream: u64,
    /// The last video picture that the reader has received.
    pub(crate) seen: Option<LastPicture>,
}

impl ImageRequest {
    pub(crate) fn wanted(&self) -> Wanted {
        self.form.encoding.wanted()
    }

    /// Returns the maximum size of a message, bytes.
    pub(crate) fn most_bytes(&self) -> u64 {
        self.form.most_bytes(self.pixels)
    }

    /// Returns the message of a frame.
    pub(crate) async fn encode(
        &self,
        rendered: &Arc<RenderedFrame>,
        reading: ReaderState,
    ) -> Result<proto::Frame, Status> {
        if let Some(rate) = self.rate.filter(|_| self.form.encoding == Encoding::H264) {
            let Picture { images, seen } = self.picture(rendered, rate, reading.seen).await?;
            return Ok(proto::Frame { video: seen.sequence, ..self.message(rendered, images, reading) });
        }
        let cell = rendered.encoded.entry(self.view, self.form);
        let images = cell.get_or_try_init(|| self.images(rendered)).await?;
        Ok(self.message(rendered, images.clone().map_err(Status::from)?, reading))
    }

    /// Encodes the view's images of a frame on a blocking thread.
    async fn images(&self, rendered: &Arc<RenderedFrame>) -> Result<Images, Status> {
        let _places = self.places().await?;
        let begun = Instant::now();
        let (view, form, rendered) = (self.view, self.form, Arc::clone(rendered));
        let span = self.span(&rendered);
        let encoding = move || {
            let _entered = span.enter();
            let images = rendered.images_of(view);
            threads::encode_beside_long_work(form.is_slow(), || images.map(|image| encoded(form, image)).collect())
        };
        let images: Images = task::spawn_blocking(encoding).await.map_err(|error| not_encoded(&error))?;
        self.encoders.note(images.as_deref().unwrap_or_default(), begun);
        Ok(images)
    }

    fn span(&self, rendered: &RenderedFrame) -> Span {
        let (view, encoding) = (&*self.name, self.form.encoding.name());
        tracing::trace_span!(target: SPANS, "encode", view, encoding, frame = rendered.frame.number)
    }

    /// Waits for a place to encode.
    async fn places(&self) -> Result<[SemaphorePermit<'_>; 2], Status> {
        let ending = |_| Status::unavailable("the daemon is shutting down");
        let of_all = if self.form.is_slow() { &self.encoders.slow } else { &self.encoders.quick };
        // Take the client's own place first: a client with many calls then delays other clients little.
        let own = self.client.encoding(self.form.is_slow()).acquire().await.map_err(ending)?;
        Ok([own, of_all.acquire().await.map_err(ending)?])
    }

    /// Returns the picture of a frame in a video sequence, for a reader that has received `seen`.
    async fn picture(
        &self,
        rendered: &Arc<RenderedFrame>,
        rate: Rate,
        seen: Option<LastPicture>,
    ) -> Result<Picture, Status> {
        let audience = Audience { view: Arc::clone(&self.name), form: self.form, rate };
        // Lock the sequences before taking places: a waiting request must not hold a place.
        let mut sequences = self.encoders.videos.sequences(&audience).lock_owned().await;
        if let Some(picture) = sequences.coded(rendered.frame.number, seen) {
            return Ok(picture);
        }
        let _places = self.places().await?;
        let begun = Instant::now();
        let (view, rendered) = (self.view, Arc::clone(rendered));
        let span = self.span(&rendered);
        let coding = move || {
            let _entered = span.enter();
            threads::stand_back();
            let images: Vec<&FrameImage> = rendered.images_of(view).collect();
            sequences.code(rendered.frame.number, seen, &images)
        };
        let picture = task::spawn_blocking(coding).await.map_err(|error| not_encoded(&error))??;
        self.encoders.note(&picture.images, begun);
        Ok(picture)
    }

    fn message(&self, rendered: &RenderedFrame, images: Vec<proto::Image>, reading: ReaderState) -> proto::Frame {
        let ReaderState { dropped, stream, .. } = reading;
        let frame = &rendered.frame;
        let of_view = |view: &ViewStatistics| view.limiting_magnitude;
        proto::Frame {
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
            camera: Some(proto::Camera {
                look: rendered.horizontal.map(camera::horizontal_to_pb),
                ..camera::camera_to_pb(&rendered.camera)
            }),
            stream,
            video: 0,
            residual_codes: frame.plan.deep.as_ref().map(|deep| deep.residual_codes),
            images,
        }
    }
}

fn not_encoded(error: &task::JoinError) -> Status {
    Status::internal(format!("encoding the frame failed: {error}"))
}

fn encoded(form: ImageFormat, image: &FrameImage) -> Result<proto::Image, NotEncoded> {
    let small = form.reduced(image);
    let image = small.as_ref().unwrap_or(image);
    let data = output::encode(form.encoding, image)?;
    Ok(form.message(image, data, form.encoding == Encoding::H264))
}
