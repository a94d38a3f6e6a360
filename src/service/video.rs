//! H.264 of views: sequences of pictures, each coded from the one before it.
//!
//! A picture can be read by whoever has had the one that it is coded from; all others need a key picture. Readers of the same view, size and rate that get the
//! same frames therefore share a sequence, and each of its pictures is coded once. A reader that has missed a frame, or begins, makes the next picture
//! of a sequence a key picture; where that frame is coded already, it gets a sequence of its own, which ends when its readers are back in the other one.

use std::{
    collections::HashMap,
    sync::{
        Arc, Mutex, PoisonError,
        atomic::{AtomicU64, Ordering::Relaxed},
    },
    time::{Duration, Instant},
};

use tonic::Status;

use super::{order::Form, proto, refusals};
use crate::{
    output::{EncodeError, VideoEncoder},
    render::FrameImage,
};

/// Sequences of one audience at the same time; readers beyond get key pictures.
const MOST_SEQUENCES: usize = 8;
/// Memory of all encoders, bytes, about.
const MOST_BYTES: u64 = 512 << 20;
/// A sequence that nobody has read for this long ends.
const IDLE: Duration = Duration::from_secs(10);
/// A reader that begins joins a sequence that was read within this time.
const LIVELY: Duration = Duration::from_secs(1);
/// Time between two key pictures by which readers of two sequences come together.
const MERGES: Duration = Duration::from_secs(2);

/// The picture that a reader has had last.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Seen {
    /// Number of the sequence.
    pub(super) sequence: u64,
    /// Number of its frame.
    pub(super) frame: u64,
}

impl Seen {
    /// From what a request says; `None`: nothing was seen.
    pub(super) fn of(sequence: u64, frame: u64) -> Option<Self> {
        (sequence != 0).then_some(Self { sequence, frame })
    }
}

/// At which rate somebody reads.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum Rate {
    /// A frame whenever the last one is read.
    Pulled,
    /// Frames at least so far apart.
    Streamed(Duration),
}

/// Those who may share sequences: readers of a view at a size and a rate.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(super) struct Audience {
    pub(super) view: Arc<str>,
    pub(super) form: Form,
    pub(super) rate: Rate,
}

/// The sequences of all audiences.
#[derive(Debug, Default)]
pub(super) struct Videos {
    audiences: Mutex<HashMap<Audience, SharedSequences>>,
    budget: Arc<Budget>,
}

/// One picture is coded after the other.
pub(super) type SharedSequences = Arc<tokio::sync::Mutex<Sequences>>;

/// Numbers of sequences, and the memory of all encoders.
#[derive(Debug, Default)]
struct Budget {
    sequences: AtomicU64,
    bytes: AtomicU64,
}

/// Memory of the encoders of a sequence.
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
pub(super) struct Sequences {
    rate: Rate,
    form: Form,
    all: Vec<Sequence>,
    merged: Option<Instant>,
    budget: Arc<Budget>,
}

#[derive(Debug)]
struct Sequence {
    number: u64,
    /// One for each image of the view.
    encoders: Vec<VideoEncoder>,
    sizes: Vec<[u32; 2]>,
    /// Frame of the last picture, and what it was coded from; `None`: it is a key picture.
    last: u64,
    from: Option<u64>,
    images: Vec<proto::Image>,
    used: Instant,
    /// Its next picture is a key picture, so that readers of others can join.
    invites: bool,
    _share: Share,
}

/// A picture of a view.
#[derive(Clone, Debug)]
pub(super) struct Picture {
    pub(super) images: Vec<proto::Image>,
    pub(super) seen: Seen,
}

impl Videos {
    /// The sequences of an audience. Those that nobody reads any more end.
    pub(super) fn of(&self, audience: &Audience) -> SharedSequences {
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
    /// The picture of a frame, if it is coded already and somebody who has seen `seen` can read it.
    fn coded(&mut self, frame: u64, seen: Option<Seen>) -> Option<Picture> {
        let follows = |from| seen == Some(Seen { sequence: self.number, frame: from });
        if self.last != frame || self.images.is_empty() || !self.from.is_none_or(follows) {
            return None;
        }
        self.used = Instant::now();
        Some(Picture { images: self.images.clone(), seen: Seen { sequence: self.number, frame } })
    }
}

impl Sequences {
    /// The picture of a frame, if it is coded already and somebody who has seen `seen` can read it.
    pub(super) fn coded(&mut self, frame: u64, seen: Option<Seen>) -> Option<Picture> {
        self.all.iter_mut().find_map(|sequence| sequence.coded(frame, seen))
    }

    /// Codes the picture of a frame for somebody who has seen `seen`. The images are all those of the view.
    pub(super) fn code(&mut self, frame: u64, seen: Option<Seen>, images: &[&FrameImage]) -> Result<Picture, Status> {
        let form = self.form;
        let small: Vec<Option<FrameImage>> = images.iter().map(|image| form.reduced(image)).collect();
        let images: Vec<&FrameImage> =
            small.iter().zip(images).map(|(small, image)| small.as_ref().unwrap_or(image)).collect();
        let sizes: Vec<[u32; 2]> = images.iter().map(|image| [image.width, image.height]).collect();
        // A view of another size begins anew.
        self.all.retain(|sequence| sequence.sizes == sizes);
        let at = match self.choose(frame, seen) {
            Some(at) => at,
            None => self.begin(sizes)?,
        };
        let sequence = &mut self.all[at];
        let follows = seen == Some(Seen { sequence: sequence.number, frame: sequence.last });
        let is_key = !follows || sequence.invites;
        let mut coded = Vec::with_capacity(images.len());
        for (encoder, image) in sequence.encoders.iter_mut().zip(images) {
            match encoder.encode(image, is_key) {
                Ok(data) => coded.push(form.message(image, data, is_key)),
                Err(error) => {
                    self.all.remove(at);
                    return Err(Status::internal(error.to_string()));
                }
            }
        }
        let from = (!is_key).then_some(sequence.last);
        let picture = Picture { images: coded, seen: Seen { sequence: sequence.number, frame } };
        sequence.images = picture.images.clone();
        (sequence.last, sequence.from, sequence.used, sequence.invites) = (frame, from, Instant::now(), false);
        self.bring_together(at, frame);
        Ok(picture)
    }

    /// The sequence that a picture of a frame continues; `None`: a new one.
    fn choose(&self, frame: u64, seen: Option<Seen>) -> Option<usize> {
        let open = || self.all.iter().enumerate().filter(|(_, sequence)| sequence.last < frame);
        let of = |found: Option<(usize, &Sequence)>| found.map(|(at, _)| at);
        let inviting = of(open().find(|(_, sequence)| sequence.invites));
        let own = |sequence: &Sequence| seen == Some(Seen { sequence: sequence.number, frame: sequence.last });
        let own = of(open().find(|(_, sequence)| own(sequence)));
        let lively = || {
            let lively = open().filter(|(_, sequence)| sequence.used.elapsed() < LIVELY);
            of(lively.max_by_key(|(_, sequence)| sequence.used))
        };
        // Those who pull have frames of their own as a rule: a key picture in the sequence of another would take it from that one.
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
            let problem =
                "too many views are coded as H.264 at present: end a stream, ask for less by max_size, or for JPEG";
            return Err(refusals::exhausted("video", problem));
        }
        let encoders = sizes.iter().map(|[width, height]| VideoEncoder::new(*width, *height));
        let encoders =
            encoders.collect::<Result<_, EncodeError>>().map_err(|error| refusals::invalid(error.to_string()))?;
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

    /// Where another sequence has a picture of the same frame, their readers can share one: its next picture is a key picture.
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
#[allow(clippy::unwrap_used, reason = "what must not happen in a test may panic")]
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
        Audience { view: "one".into(), form: Form { encoding: Encoding::H264, max_size: 0 }, rate }
    }

    /// A reader that takes frames as a client does.
    #[derive(Default)]
    struct Reader {
        seen: Option<Seen>,
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
                is_key || self.seen == follows.map(|frame| Seen { sequence: picture.seen.sequence, frame }),
                "frame {frame} cannot be read"
            );
            self.keys += usize::from(is_key);
            self.seen = Some(picture.seen);
            picture
        }
    }

    #[test]
    fn readers_share_a_sequence_and_each_can_read_all_it_gets() {
        let videos = Videos::default();
        let shared = videos.of(&audience(Rate::Streamed(Duration::ZERO)));
        let mut sequences = shared.try_lock().unwrap();
        let (mut first, mut second, mut slow) = (Reader::default(), Reader::default(), Reader::default());
        for frame in 1..=40 {
            let of_first = first.read(&mut sequences, frame);
            // Begins late, and after the frame was coded for the first one.
            if frame >= 10 {
                let of_second = second.read(&mut sequences, frame);
                // They come together within the next frame.
                assert!(frame < 12 || of_second.images == of_first.images, "{frame}");
            }
            if frame % 9 == 0 && frame < 30 {
                slow.read(&mut sequences, frame);
            }
        }
        assert!(first.keys <= 5 && second.keys <= 5, "{} {}", first.keys, second.keys);
        assert_eq!(slow.keys, 1, "it has a sequence of its own");
        assert!(sequences.all.len() <= 3);
    }

    #[test]
    fn those_who_pull_frames_of_their_own_do_not_take_the_sequence_from_each_other() {
        let videos = Videos::default();
        let shared = videos.of(&audience(Rate::Pulled));
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
        // More than there are sequences for: still to be read.
        let mut many: Vec<Reader> = (0..2 * MOST_SEQUENCES).map(|_| Reader::default()).collect();
        let count = many.len() as u64;
        for frame in 41..41 + 4 * count {
            many[(frame % count) as usize].read(&mut sequences, frame);
        }
        assert_eq!(sequences.all.len(), MOST_SEQUENCES);
    }

    #[test]
    fn a_number_of_another_daemon_and_another_size_begin_with_a_key_picture() {
        let videos = Videos::default();
        let shared = videos.of(&audience(Rate::Pulled));
        let mut sequences = shared.try_lock().unwrap();
        let mut reader = Reader { seen: Seen::of(77, 5), keys: 0 };
        reader.read(&mut sequences, 6);
        reader.read(&mut sequences, 7);
        assert_eq!(reader.keys, 1);
        let large = FrameImage { width: 32, height: 64, ..image(3) };
        let picture = sequences.code(8, reader.seen, &[&large]).unwrap();
        assert!(picture.images[0].key_frame && sequences.all.len() == 1);
        assert_eq!(Seen::of(0, 9), None);
    }

    #[test]
    fn memory_is_bounded_and_given_back() {
        let videos = Videos::default();
        let shared = videos.of(&audience(Rate::Pulled));
        let mut sequences = shared.try_lock().unwrap();
        sequences.code(1, None, &[&image(1)]).unwrap();
        let held = videos.budget.bytes.load(Relaxed);
        assert_eq!(held, VideoEncoder::memory_bytes(64, 32));
        videos.budget.bytes.store(MOST_BYTES, Relaxed);
        let refused = sequences.code(2, None, &[&image(2)]).unwrap_err();
        assert_eq!(refused.code(), tonic::Code::ResourceExhausted);
        assert_eq!(videos.budget.bytes.load(Relaxed), MOST_BYTES, "what was refused holds nothing");
        sequences.all.clear();
        assert_eq!(videos.budget.bytes.load(Relaxed), MOST_BYTES - held);
        drop(sequences);
        videos.of(&audience(Rate::Streamed(Duration::ZERO)));
        assert_eq!(videos.audiences.lock().unwrap().len(), 1, "the empty one has gone");
    }
}
