//! What somebody asks for of a frame: the images of one view in an encoding. Images are encoded once for all who ask for the same, on threads
//! that stand back behind those that render, and fairly: each client has few places among those who wait for an encoder.

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
    SPANS, background,
    clients::ClientInfo,
    convert,
    headset::Headset,
    proto,
    slot::RenderedFrame,
    video::{Audience, Picture, Rate, Seen, Videos},
    views::ViewId,
};
use crate::{
    output::{self, Encoding},
    render::{FrameImage, ViewStatistics, Wanted},
};

/// How images are encoded.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct Form {
    pub(super) encoding: Encoding,
    /// Longest side, pixels; 0: as large as they are.
    pub(super) max_size: u32,
}

impl Form {
    /// Takes long: the encoders of such images are apart from those of others.
    fn is_slow(self) -> bool {
        self.encoding == Encoding::Exr
    }

    /// Bytes of an image of this many pixels, at most.
    pub(super) fn most_bytes(self, pixels: u64) -> u64 {
        // What compresses may come out a little larger than what it is given.
        match self.encoding {
            Encoding::Rgba8 => 4 * pixels,
            Encoding::Png | Encoding::Jpeg | Encoding::H264 => 4 * pixels + pixels / 16 + 65_536,
            Encoding::Rgb32f => 12 * pixels,
            Encoding::Exr => 16 * pixels + pixels + 65_536,
        }
    }

    /// A smaller copy; `None`: the image is as small already.
    pub(super) fn reduced(self, image: &FrameImage) -> Option<FrameImage> {
        (self.max_size > 0).then(|| output::reduced(image, self.max_size)).flatten()
    }

    /// The message of an image that is encoded.
    pub(super) fn message(self, image: &FrameImage, data: Vec<u8>, key_frame: bool) -> proto::Image {
        proto::Image {
            part: image.part.name().unwrap_or_default().to_owned(),
            width: image.width,
            height: image.height,
            encoding: convert::encoding_to_pb(self.encoding).into(),
            data: data.into(),
            key_frame,
        }
    }
}

type Images = Result<Vec<proto::Image>, String>;

/// Encoded images of a frame, by view and form.
#[derive(Debug, Default)]
pub(super) struct EncodedImages {
    images: Mutex<HashMap<(ViewId, Form), EncodedOnce>>,
}

/// Encoded by the first who asks.
type EncodedOnce = Arc<OnceCell<Images>>;

impl EncodedImages {
    fn of(&self, view: ViewId, form: Form) -> EncodedOnce {
        let mut images = self.images.lock().unwrap_or_else(PoisonError::into_inner);
        Arc::clone(images.entry((view, form)).or_default())
    }
}

/// Places for those who encode.
#[derive(Debug)]
pub(super) struct Encoders {
    quick: Semaphore,
    slow: Semaphore,
    videos: Videos,
    /// Times that images were encoded since the start, what that came to, and how long it took.
    count: AtomicU64,
    bytes: AtomicU64,
    busy_ns: AtomicU64,
}

impl Encoders {
    /// As many as there are cores, and half as many for what takes long.
    pub(super) fn new() -> Self {
        let cores = thread::available_parallelism().map_or(1, usize::from);
        let (quick, slow) = (Semaphore::new(cores), Semaphore::new((cores / 2).max(1)));
        let [count, bytes, busy_ns] = [0; 3].map(AtomicU64::new);
        Self { quick, slow, videos: Videos::default(), count, bytes, busy_ns }
    }

    /// Times that the images of a view of a frame were encoded.
    pub(super) fn count(&self) -> u64 {
        self.count.load(Relaxed)
    }

    /// Bytes of their images.
    pub(super) fn bytes(&self) -> u64 {
        self.bytes.load(Relaxed)
    }

    fn note(&self, images: &[proto::Image], begun: Instant) {
        self.count.fetch_add(1, Relaxed);
        self.bytes.fetch_add(images.iter().map(|image| image.data.len() as u64).sum(), Relaxed);
        self.busy_ns.fetch_add(u64::try_from(begun.elapsed().as_nanos()).unwrap_or(u64::MAX), Relaxed);
    }

    /// How long they took, added up.
    pub(super) fn busy(&self) -> Duration {
        Duration::from_nanos(self.busy_ns.load(Relaxed))
    }
}

/// The images of one view, and how they are to be encoded.
#[derive(Clone)]
pub(super) struct Order {
    pub(super) name: Arc<str>,
    pub(super) view: ViewId,
    /// Pixels of its images when this was made; another geometry may have others.
    pub(super) pixels: u64,
    /// Who makes its frames, if not the render thread.
    pub(super) headset: Option<Arc<Headset>>,
    pub(super) form: Form,
    /// `None`: one frame alone.
    pub(super) rate: Option<Rate>,
    pub(super) encoders: Arc<Encoders>,
    pub(super) client: ClientInfo,
}

/// What a message says of its stream, and what it can rely on.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Reading {
    /// Frames that the reader has missed.
    pub(super) dropped: u64,
    /// Number of the stream.
    pub(super) stream: u64,
    /// The picture of video that the reader has had last.
    pub(super) seen: Option<Seen>,
}

impl Order {
    pub(super) fn wanted(&self) -> Wanted {
        self.form.encoding.wanted()
    }

    /// Bytes of a message, at most.
    pub(super) fn most_bytes(&self) -> u64 {
        self.form.most_bytes(self.pixels)
    }

    /// The message of a frame.
    pub(super) async fn encode(&self, rendered: &Arc<RenderedFrame>, reading: Reading) -> Result<proto::Frame, Status> {
        if let Some(rate) = self.rate.filter(|_| self.form.encoding == Encoding::H264) {
            let Picture { images, seen } = self.picture(rendered, rate, reading.seen).await?;
            return Ok(proto::Frame { video: seen.sequence, ..self.message(rendered, images, reading) });
        }
        let cell = rendered.encoded.of(self.view, self.form);
        let images = cell.get_or_try_init(|| self.images(rendered)).await?;
        Ok(self.message(rendered, images.clone().map_err(Status::internal)?, reading))
    }

    /// Encodes the view's images of a frame, away from the threads that serve connections.
    async fn images(&self, rendered: &Arc<RenderedFrame>) -> Result<Images, Status> {
        let _places = self.places().await?;
        let begun = Instant::now();
        let (view, form, rendered) = (self.view, self.form, Arc::clone(rendered));
        let span = self.span(&rendered);
        let encoding = move || {
            let _entered = span.enter();
            background::stand_back();
            let images = rendered.images_of(view);
            // What is coded in bands has the cores that frames leave.
            background::on_own_cores(|| images.map(|image| encoded(form, image)).collect())
        };
        let images: Images = task::spawn_blocking(encoding).await.map_err(|error| not_encoded(&error))?;
        self.encoders.note(images.as_deref().unwrap_or_default(), begun);
        Ok(images)
    }

    fn span(&self, rendered: &RenderedFrame) -> Span {
        let (view, encoding) = (&*self.name, self.form.encoding.name());
        tracing::trace_span!(target: SPANS, "encode", view, encoding, frame = rendered.frame.number)
    }

    /// Places for one who encodes.
    async fn places(&self) -> Result<[SemaphorePermit<'_>; 2], Status> {
        let ending = |_| Status::unavailable("the daemon is shutting down");
        let of_all = if self.form.is_slow() { &self.encoders.slow } else { &self.encoders.quick };
        // One's own place first: however many calls a client has, few of them wait before the calls of others.
        let own = self.client.encoding(self.form.is_slow()).acquire().await.map_err(ending)?;
        Ok([own, of_all.acquire().await.map_err(ending)?])
    }

    /// The picture of a frame in a sequence, for somebody who has seen `seen` of it.
    async fn picture(&self, rendered: &Arc<RenderedFrame>, rate: Rate, seen: Option<Seen>) -> Result<Picture, Status> {
        let audience = Audience { view: Arc::clone(&self.name), form: self.form, rate };
        // Before the places: who waits for this has none.
        let mut sequences = self.encoders.videos.of(&audience).lock_owned().await;
        if let Some(picture) = sequences.coded(rendered.frame.number, seen) {
            return Ok(picture);
        }
        let _places = self.places().await?;
        let begun = Instant::now();
        let (view, rendered) = (self.view, Arc::clone(rendered));
        let span = self.span(&rendered);
        let coding = move || {
            let _entered = span.enter();
            background::stand_back();
            let images: Vec<&FrameImage> = rendered.images_of(view).collect();
            sequences.code(rendered.frame.number, seen, &images)
        };
        let picture = task::spawn_blocking(coding).await.map_err(|error| not_encoded(&error))??;
        self.encoders.note(&picture.images, begun);
        Ok(picture)
    }

    fn message(&self, rendered: &RenderedFrame, images: Vec<proto::Image>, reading: Reading) -> proto::Frame {
        let Reading { dropped, stream, .. } = reading;
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
            camera: Some(convert::camera_to_pb(&rendered.camera)),
            stream,
            video: 0,
            images,
        }
    }
}

fn not_encoded(error: &task::JoinError) -> Status {
    Status::internal(format!("encoding the frame failed: {error}"))
}

fn encoded(form: Form, image: &FrameImage) -> Result<proto::Image, String> {
    let small = form.reduced(image);
    let image = small.as_ref().unwrap_or(image);
    let data = output::encode(form.encoding, image).map_err(|error| error.to_string())?;
    Ok(form.message(image, data, form.encoding == Encoding::H264))
}
