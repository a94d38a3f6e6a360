//! H.264 video of views: sequences of pictures, each encoded relative to the previous one.
//!
//! A reader can decode a picture if it has the previous picture of the sequence; otherwise it needs a key picture.
//! Readers of the same view, size and rate that get the same frames therefore share a sequence, and each picture is
//! encoded once. When a reader starts or has missed a frame, the next picture of its sequence becomes a key picture. If
//! that frame is encoded already, the reader gets a separate sequence until its readers join the other one again.

use std::{
    collections::HashMap,
    hash::{BuildHasher, RandomState},
    sync::{
        Arc, Mutex, PoisonError,
        atomic::{AtomicU64, Ordering::Relaxed},
    },
    time::{Duration, Instant},
};

use tonic::Status;

use super::image_encoding::{ImageFormat, unencoded};
use crate::{
    output::{EncodeError, VideoEncoder},
    render::FrameImage,
    service::{proto, wire::refusals},
};

/// Maximum number of sequences of one audience; further readers get key pictures only.
const MOST_SEQUENCES: usize = 8;
/// Approximate limit of the memory of all encoders, bytes.
const MOST_BYTES: u64 = 512 << 20;
/// A sequence without readers for this time ends.
const IDLE: Duration = Duration::from_secs(10);
/// A new reader joins a sequence only if it was read within this time.
const LIVELY: Duration = Duration::from_secs(1);
/// Interval of the key pictures at which readers of two sequences join.
const MERGES: Duration = Duration::from_secs(2);

/// The last picture that a reader has received.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct LastPicture {
    /// Number of the sequence.
    pub(crate) sequence: u64,
    /// Number of the frame.
    pub(crate) frame: u64,
}

impl LastPicture {
    /// Reads the numbers of a request; `None`: the reader has no picture.
    pub(crate) fn from_numbers(sequence: u64, frame: u64) -> Option<Self> {
        (sequence != 0).then_some(Self { sequence, frame })
    }
}

/// Rate at which a client reads.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Rate {
    /// A frame on each request.
    Pulled,
    /// Frames at least this far apart.
    Streamed(Duration),
}

/// Readers that may share sequences: those with the same view, size and rate.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(crate) struct Audience {
    pub(crate) view: Arc<str>,
    pub(crate) form: ImageFormat,
    pub(crate) rate: Rate,
}

/// The sequences of all audiences.
#[derive(Debug, Default)]
pub(crate) struct Videos {
    audiences: Mutex<HashMap<Audience, SharedSequences>>,
    budget: Arc<Budget>,
}

/// Sequences of one audience; the lock serialises their encoding.
pub(crate) type SharedSequences = Arc<tokio::sync::Mutex<Sequences>>;

/// Number of the last sequence, and memory of all encoders.
#[derive(Debug)]
struct Budget {
    sequences: AtomicU64,
    bytes: AtomicU64,
}

impl Default for Budget {
    fn default() -> Self {
        // Start at a random number. A reader from before a restart of the daemon, whose frames have the same numbers, must not name a sequence of
        // this daemon.
        let before_first = RandomState::new().hash_one(0) >> 1;
        Self { sequences: AtomicU64::new(before_first), bytes: AtomicU64::new(0) }
    }
}

/// Memory of the encoders of a sequence, released on drop.
#[derive(Debug)]
struct Share {
    budget: Arc<Budget>,
    bytes: u64,
}

impl Drop for Share {
    fn drop(&mut self) {
        self.budget.bytes.fetch_sub(self.bytes, Relaxed);
    }
}

/// The sequences of one audience.
#[derive(Debug)]
pub(crate) struct Sequences {
    rate: Rate,
    form: ImageFormat,
    all: Vec<Sequence>,
    merged: Option<Instant>,
    budget: Arc<Budget>,
}

#[derive(Debug)]
struct Sequence {
    number: u64,
    /// One encoder for each image of the view.
    encoders: Vec<VideoEncoder>,
    sizes: Vec<[u32; 2]>,
    /// Frame of the last picture. The next field is the frame that this picture depends on; `None`: it is a key picture.
    last: u64,
    from: Option<u64>,
    images: Vec<proto::Image>,
    used: Instant,
    /// Whether the next picture is a key picture, so that readers of another sequence can join.
    invites: bool,
    _share: Share,
}

/// An encoded picture of a view.
#[derive(Clone, Debug)]
pub(crate) struct Picture {
    pub(crate) images: Vec<proto::Image>,
    pub(crate) seen: LastPicture,
}

impl Videos {
    /// Returns the sequences of an audience, and drops those of audiences without readers.
    pub(crate) fn sequences(&self, audience: &Audience) -> SharedSequences {
        let mut audiences = self.audiences.lock().unwrap_or_else(PoisonError::into_inner);
        audiences.retain(|_, sequences| {
            let Ok(mut sequences) = sequences.try_lock() else { return true };
            sequences.all.retain(|sequence| sequence.used.elapsed() < IDLE);
            !sequences.all.is_empty()
        });
        let Audience { form, rate, .. } = *audience;
        let new = || {
            let budget = Arc::clone(&self.budget);
            Arc::new(tokio::sync::Mutex::new(Sequences { rate, form, all: Vec::new(), merged: None, budget }))
        };
        Arc::clone(audiences.entry(audience.clone()).or_insert_with(new))
    }
}

impl Sequence {
    /// Returns the picture of a frame if it is encoded already and a reader that has received `seen` can decode it.
    fn coded(&mut self, frame: u64, seen: Option<LastPicture>) -> Option<Picture> {
        let follows = |from| seen == Some(LastPicture { sequence: self.number, frame: from });
        if self.last != frame || self.images.is_empty() || !self.from.is_none_or(follows) {
            return None;
        }
        self.used = Instant::now();
        Some(Picture { images: self.images.clone(), seen: LastPicture { sequence: self.number, frame } })
    }
}

impl Sequences {
    /// Returns the picture of a frame if it is encoded already and a reader that has received `seen` can decode it.
    pub(crate) fn coded(&mut self, frame: u64, seen: Option<LastPicture>) -> Option<Picture> {
        self.all.iter_mut().find_map(|sequence| sequence.coded(frame, seen))
    }

    /// Encodes the picture of a frame for a reader that has received `seen`. `images` contains all images of the view.
    pub(crate) fn code(
        &mut self,
        frame: u64,
        seen: Option<LastPicture>,
        images: &[&FrameImage],
    ) -> Result<Picture, Status> {
        let form = self.form;
        let small: Vec<Option<FrameImage>> = images.iter().map(|image| form.reduced(image)).collect();
        let images: Vec<&FrameImage> =
            small.iter().zip(images).map(|(small, image)| small.as_ref().unwrap_or(image)).collect();
        let sizes: Vec<[u32; 2]> = images.iter().map(|image| [image.width, image.height]).collect();
        // A change of size starts a new sequence.
        self.all.retain(|sequence| sequence.sizes == sizes);
        let index = match self.choose(frame, seen) {
            Some(index) => index,
            None => self.begin(sizes)?,
        };
        let sequence = &mut self.all[index];
        let follows = seen == Some(LastPicture { sequence: sequence.number, frame: sequence.last });
        let is_key = !follows || sequence.invites;
        let mut coded = Vec::with_capacity(images.len());
        for (encoder, image) in sequence.encoders.iter_mut().zip(images) {
            match encoder.encode(image, is_key) {
                Ok(data) => coded.push(form.message(image, data, is_key)),
                Err(error) => {
                    self.all.remove(index);
                    return Err(unencoded(error));
                }
            }
        }
        let from = (!is_key).then_some(sequence.last);
        let picture = Picture { images: coded, seen: LastPicture { sequence: sequence.number, frame } };
        sequence.images = picture.images.clone();
        (sequence.last, sequence.from, sequence.used, sequence.invites) = (frame, from, Instant::now(), false);
        self.bring_together(index, frame);
        Ok(picture)
    }

    /// Chooses the sequence that continues with the picture of a frame; `None`: a new one.
    fn choose(&self, frame: u64, seen: Option<LastPicture>) -> Option<usize> {
        let open = || self.all.iter().enumerate().filter(|(_, sequence)| sequence.last < frame);
        let index = |found: Option<(usize, &Sequence)>| found.map(|(index, _)| index);
        let inviting = index(open().find(|(_, sequence)| sequence.invites));
        let own = |sequence: &Sequence| seen == Some(LastPicture { sequence: sequence.number, frame: sequence.last });
        let own = index(open().find(|(_, sequence)| own(sequence)));
        let lively = || {
            let lively = open().filter(|(_, sequence)| sequence.used.elapsed() < LIVELY);
            index(lively.max_by_key(|(_, sequence)| sequence.used))
        };
        // Readers that request single frames usually get frames of their own, so a key picture in another reader's sequence would take that sequence
        // away from it.
        let joined = || matches!(self.rate, Rate::Streamed(_)).then(lively).flatten();
        inviting.or(own).or_else(joined)
    }

    fn begin(&mut self, sizes: Vec<[u32; 2]>) -> Result<usize, Status> {
        let oldest = self.all.iter().enumerate().min_by_key(|(_, sequence)| sequence.used).map(|(at, _)| at);
        if let Some(oldest) = oldest.filter(|_| self.all.len() >= MOST_SEQUENCES) {
            self.all.remove(oldest);
        }
        let bytes = sizes.iter().map(|[width, height]| VideoEncoder::memory_bytes(*width, *height)).sum();
        let share = Share { budget: Arc::clone(&self.budget), bytes };
        if self.budget.bytes.fetch_add(bytes, Relaxed) + bytes > MOST_BYTES {
            let problem = "too many views are encoded as H.264 at present: end a stream, reduce max_size, or use JPEG";
            return Err(refusals::exhausted("video", problem));
        }
        let encoders = sizes.iter().map(|[width, height]| VideoEncoder::new(*width, *height));
        let encoders = encoders.collect::<Result<_, EncodeError>>().map_err(unencoded)?;
        let number = self.budget.sequences.fetch_add(1, Relaxed) + 1;
        let (last, used) = (0, Instant::now());
        let images = Vec::new();
        self.all.push(Sequence {
            number,
            encoders,
            sizes,
            last,
            from: None,
            images,
            used,
            invites: false,
            _share: share,
        });
        Ok(self.all.len() - 1)
    }

    /// If another sequence has a picture of the same frame, the readers of both can share one sequence, so this makes the other one's next picture a
    /// key picture.
    fn bring_together(&mut self, at: usize, frame: u64) {
        let too_soon = self.merged.is_some_and(|merged| merged.elapsed() < MERGES);
        let other = |(other, sequence): &(usize, &mut Sequence)| *other != at && sequence.last == frame;
        if let Some((_, other)) = self.all.iter_mut().enumerate().find(other).filter(|_| !too_soon) {
            other.invites = true;
            self.merged = Some(Instant::now());
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic on unexpected values")]
mod tests {
    use super::*;
    use crate::{output::Encoding, view::Part};

    fn image(level: u8) -> FrameImage {
        let display = (0..64 * 32).flat_map(|at| [level.wrapping_add((at % 7) as u8), level, 9, 255]).collect();
        FrameImage {
            view: 0,
            part: Part::Whole,
            width: 64,
            height: 32,
            display: Some(display),
            hdr: None,
            projector: None,
        }
    }

    fn audience(rate: Rate) -> Audience {
        Audience { view: "one".into(), form: ImageFormat { encoding: Encoding::H264, max_size: 0 }, rate }
    }

    /// A reader that behaves as a client.
    #[derive(Default)]
    struct Reader {
        seen: Option<LastPicture>,
        keys: usize,
    }

    impl Reader {
        fn read(&mut self, sequences: &mut Sequences, frame: u64) -> Picture {
            let image = image(frame as u8);
            let picture = match sequences.coded(frame, self.seen) {
                Some(picture) => picture,
                None => sequences.code(frame, self.seen, &[&image]).unwrap(),
            };
            let is_key = picture.images[0].key_frame;
            let follows = sequences.all.iter().find(|one| one.number == picture.seen.sequence).unwrap().from;
            assert!(
                is_key || self.seen == follows.map(|frame| LastPicture { sequence: picture.seen.sequence, frame }),
                "frame {frame} cannot be decoded"
            );
            self.keys += usize::from(is_key);
            self.seen = Some(picture.seen);
            picture
        }
    }

    #[test]
    fn readers_share_a_sequence_and_can_decode_every_picture() {
        let videos = Videos::default();
        let shared = videos.sequences(&audience(Rate::Streamed(Duration::ZERO)));
        let mut sequences = shared.try_lock().unwrap();
        let (mut first, mut second, mut slow) = (Reader::default(), Reader::default(), Reader::default());
        for frame in 1..=40 {
            let of_first = first.read(&mut sequences, frame);
            // Starts late, when the frame is already encoded for the first reader.
            if frame >= 10 {
                let of_second = second.read(&mut sequences, frame);
                // The readers join within the next frame.
                assert!(frame < 12 || of_second.images == of_first.images, "{frame}");
            }
            if frame % 9 == 0 && frame < 30 {
                slow.read(&mut sequences, frame);
            }
        }
        assert!(first.keys <= 5 && second.keys <= 5, "{} {}", first.keys, second.keys);
        assert_eq!(slow.keys, 1, "the slow reader has a separate sequence");
        assert!(sequences.all.len() <= 3);
    }

    #[test]
    fn pull_readers_do_not_take_each_others_sequence() {
        let videos = Videos::default();
        let shared = videos.sequences(&audience(Rate::Pulled));
        let mut sequences = shared.try_lock().unwrap();
        let (mut odd, mut even) = (Reader::default(), Reader::default());
        for frame in 1..=40 {
            if frame % 2 == 1 {
                odd.read(&mut sequences, frame)
            } else {
                even.read(&mut sequences, frame)
            };
        }
        assert_eq!((odd.keys, even.keys), (1, 1));
        // There are more readers than sequences, but each can still decode its pictures.
        let mut many: Vec<Reader> = (0..2 * MOST_SEQUENCES).map(|_| Reader::default()).collect();
        let count = many.len() as u64;
        for frame in 41..41 + 4 * count {
            many[(frame % count) as usize].read(&mut sequences, frame);
        }
        assert_eq!(sequences.all.len(), MOST_SEQUENCES);
    }

    #[test]
    fn unknown_sequences_and_new_sizes_start_with_a_key_picture() {
        let videos = Videos::default();
        let shared = videos.sequences(&audience(Rate::Pulled));
        let mut sequences = shared.try_lock().unwrap();
        let mut reader = Reader { seen: LastPicture::from_numbers(77, 5), keys: 0 };
        reader.read(&mut sequences, 6);
        reader.read(&mut sequences, 7);
        assert_eq!(reader.keys, 1);
        let large = FrameImage { width: 32, height: 64, ..image(3) };
        let picture = sequences.code(8, reader.seen, &[&large]).unwrap();
        assert!(picture.images[0].key_frame && sequences.all.len() == 1);
        assert_eq!(LastPicture::from_numbers(0, 9), None);
    }

    #[test]
    fn a_reader_from_before_a_restart_gets_a_key_picture() {
        let seen = || {
            let shared = Videos::default().sequences(&audience(Rate::Pulled));
            let mut sequences = shared.try_lock().unwrap();
            sequences.code(5, None, &[&image(1)]).unwrap().seen
        };
        let before = seen();
        let shared = Videos::default().sequences(&audience(Rate::Pulled));
        let mut sequences = shared.try_lock().unwrap();
        let own = sequences.code(5, None, &[&image(1)]).unwrap().seen;
        assert_eq!((own.frame, before.frame), (5, 5));
        assert!(sequences.code(6, Some(before), &[&image(2)]).unwrap().images[0].key_frame);
        assert!(!sequences.code(7, Some(own), &[&image(3)]).unwrap().images[0].key_frame);
    }

    #[test]
    fn memory_is_limited_and_released() {
        let videos = Videos::default();
        let shared = videos.sequences(&audience(Rate::Pulled));
        let mut sequences = shared.try_lock().unwrap();
        sequences.code(1, None, &[&image(1)]).unwrap();
        let held = videos.budget.bytes.load(Relaxed);
        assert_eq!(held, VideoEncoder::memory_bytes(64, 32));
        videos.budget.bytes.store(MOST_BYTES, Relaxed);
        let refused = sequences.code(2, None, &[&image(2)]).unwrap_err();
        assert_eq!(refused.code(), tonic::Code::ResourceExhausted);
        assert_eq!(videos.budget.bytes.load(Relaxed), MOST_BYTES, "a refused sequence holds no memory");
        sequences.all.clear();
        assert_eq!(videos.budget.bytes.load(Relaxed), MOST_BYTES - held);
        drop(sequences);
        videos.sequences(&audience(Rate::Streamed(Duration::ZERO)));
        assert_eq!(videos.audiences.lock().unwrap().len(), 1, "the empty audience is removed");
    }
}
