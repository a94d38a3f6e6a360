//! Encodes and writes frames in the background. Frames go through a bounded channel to a few threads; drawing blocks while the channel is full.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::sync::{Mutex, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use super::super::OutputError;
use super::error::FilmError;
use super::images::{FilmFormat, ImageWords, encode_image};
use crate::files;
use crate::render::FrameImage;

/// Maximum number of threads. Memory holds one frame per thread, one waiting frame, and one that is being drawn.
const MOST_WRITERS: usize = 3;

/// One image and its file.
#[derive(Debug)]
pub struct FrameFile {
    /// Target file.
    pub path: PathBuf,
    /// The image.
    pub image: FrameImage,
    /// Metadata.
    pub words: ImageWords,
}

/// Handle that receives frames.
pub struct FilmWriter<'a> {
    frames: SyncSender<Vec<FrameFile>>,
    error: &'a Mutex<Option<FilmError>>,
    written: &'a AtomicUsize,
}

impl FilmWriter<'_> {
    /// Queues the files of a frame; blocks while the threads are busy. Each file is written atomically.
    ///
    /// # Errors
    ///
    /// The error of an earlier frame.
    pub fn write(&self, frame: Vec<FrameFile>) -> Result<(), FilmError> {
        if let Some(error) = self.error.lock().unwrap_or_else(PoisonError::into_inner).take() {
            return Err(error);
        }
        self.frames.send(frame).map_err(|_| FilmError::Writers)
    }

    /// Number of frames written so far.
    pub fn written(&self) -> usize {
        self.written.load(Ordering::Relaxed)
    }
}

/// Totals of all threads.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Written {
    /// Frames written.
    pub frames: usize,
    /// Bytes of their files.
    pub bytes: u64,
    /// Time of encoding, summed over all threads.
    pub encoding: Duration,
    /// Time of writing, summed over all threads.
    pub writing: Duration,
    /// Number of threads.
    pub threads: usize,
}

/// Sums of all threads.
#[derive(Default)]
struct Sums {
    bytes: AtomicU64,
    encoding_us: AtomicU64,
    writing_us: AtomicU64,
}

/// Receives the path and the bytes of each file before it gets its final name.
pub type BeforeFile<'a> = dyn Fn(&Path, &[u8]) -> Result<(), FilmError> + Sync + 'a;

fn write_frame(
    format: FilmFormat,
    frame: Vec<FrameFile>,
    before: &BeforeFile<'_>,
    sums: &Sums,
) -> Result<(), FilmError> {
    let add = |sum: &AtomicU64, since: Instant| {
        sum.fetch_add(u64::try_from(since.elapsed().as_micros()).unwrap_or(u64::MAX), Ordering::Relaxed);
    };
    for FrameFile { path, image, words } in frame {
        let begun = Instant::now();
        match encode_image(format, &image, &words) {
            Ok(bytes) => {
                add(&sums.encoding_us, begun);
                let begun = Instant::now();
                before(&path, &bytes)?;
                files::write_whole_synced(&path, &bytes).map_err(|source| OutputError::Write { path, source })?;
                add(&sums.writing_us, begun);
                sums.bytes.fetch_add(bytes.len() as u64, Ordering::Relaxed);
            }
            Err(source) => return Err(OutputError::Encode { path, source }.into()),
        }
    }
    Ok(())
}

fn next(frames: &Mutex<Receiver<Vec<FrameFile>>>) -> Option<Vec<FrameFile>> {
    frames.lock().unwrap_or_else(PoisonError::into_inner).recv().ok()
}

/// Runs `draw` with a writer and waits until all queued frames are written; returns the result of `draw`, and the
/// totals. `before` receives each file before it gets its final name.
///
/// # Errors
///
/// The error of `draw`, or of a file that cannot be written.
pub fn with_writer<T, E: From<FilmError>>(
    format: FilmFormat,
    before: &BeforeFile<'_>,
    draw: impl FnOnce(&FilmWriter<'_>) -> Result<T, E>,
) -> Result<(T, Written), E> {
    let threads = thread::available_parallelism().map_or(1, usize::from).min(MOST_WRITERS);
    let (sender, receiver) = sync_channel(1);
    let receiver = Mutex::new(receiver);
    let error = Mutex::new(None);
    let written = AtomicUsize::new(0);
    let sums = Sums::default();
    let drawn = thread::scope(|scope| {
        for _ in 0..threads {
            scope.spawn(|| {
                while let Some(frame) = next(&receiver) {
                    match write_frame(format, frame, before, &sums) {
                        Ok(()) => {
                            written.fetch_add(1, Ordering::Relaxed);
                        }
                        // Keep the first error; the threads continue to receive frames so that drawing does not block.
                        Err(problem) => {
                            error.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(problem);
                        }
                    }
                }
            });
        }
        let writer = FilmWriter { frames: sender, error: &error, written: &written };
        // This call drops the writer, and the threads end when the channel is empty.
        let drawn = draw(&writer);
        drop(writer);
        drawn
    })?;
    match error.into_inner().unwrap_or_else(PoisonError::into_inner) {
        Some(problem) => Err(problem.into()),
        None => {
            let written = Written {
                frames: written.into_inner(),
                bytes: sums.bytes.into_inner(),
                encoding: Duration::from_micros(sums.encoding_us.into_inner()),
                writing: Duration::from_micros(sums.writing_us.into_inner()),
                threads,
            };
            Ok((drawn, written))
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failed precondition of a test may panic")]
mod tests {
    use super::super::super::encode::tests::sample;
    use super::*;
    use crate::photometry::tone_map::ToneMapSettings;

    fn frame(path: PathBuf) -> Vec<FrameFile> {
        let words = ImageWords { exposure_ev100: 0.0, tone_map: ToneMapSettings::default(), attributes: Vec::new() };
        vec![FrameFile { path, image: sample(8, 8), words }]
    }

    #[test]
    fn all_frames_are_written_and_a_failure_leaves_no_partial_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = |number: usize| folder.path().join(format!("{number}.png"));
        let written = with_writer::<_, FilmError>(FilmFormat::Png8, &|_, _| Ok(()), |writer| {
            (0..20).try_for_each(|number| writer.write(frame(path(number))))
        });
        let (_, written) = written.unwrap();
        let bytes = std::fs::metadata(path(0)).unwrap().len();
        assert_eq!((written.frames, written.bytes), (20, 20 * bytes));
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 20, "no other file is left");
        std::fs::create_dir(path(30)).unwrap();
        let failed = with_writer::<_, FilmError>(FilmFormat::Png8, &|_, _| Ok(()), |writer| {
            (29..50).try_for_each(|number| writer.write(frame(path(number))))
        });
        assert!(failed.unwrap_err().to_string().contains("30.png"));
        let names = std::fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap().file_name());
        assert!(names.into_iter().all(|name| name.to_str().unwrap().ends_with(".png")), "no temporary file is left");
    }
}
