//! Checks the frames in the folder of a film: finds those that are missing, damaged, or from another film.

use std::collections::BTreeSet;
use std::fs;
use std::io::{self, Cursor};
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};

use rayon::prelude::*;
use serde::Serialize;

use super::checksums::{self, Checksums};
use super::error::FilmError;
use super::folder::{FilmRecord, failed, held_record, names};
use super::frames::{FrameRange, file_name, number_of};
use crate::files;

/// Maximum size of a frame file, bytes.
const MOST_BYTES: u64 = 16 << 30;

/// State of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Fault {
    /// It does not exist.
    Missing,
    /// It is truncated, or bytes of it changed.
    Damaged,
    /// It is a complete picture, but does not belong to this film.
    Foreign,
}

impl Fault {
    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Missing => "missing",
            Self::Damaged => "damaged",
            Self::Foreign => "foreign",
        }
    }
}

/// A file with a fault.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
pub struct FaultyFile {
    /// Its frame.
    pub frame: u32,
    /// Its name.
    pub file: String,
    /// Its state.
    pub fault: Fault,
    /// Description.
    pub problem: String,
    /// Whether the film has this frame. A repair removes files of frames that the film does not have.
    pub belongs: bool,
}

/// State of a film.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct FilmStatus {
    /// Digest of the film.
    pub film: String,
    /// Ranges of its frames; the end of each range is excluded.
    pub frames: Vec<FrameRange>,
    /// Number of files that it must have.
    pub files: usize,
    /// Number of files with the right checksum.
    pub verified: usize,
    /// Number of files that can be read and have no checksum.
    pub without_checksum: usize,
    /// All other files, sorted by frame.
    pub faults: Vec<FaultyFile>,
    /// Notes for people.
    pub notes: Vec<String>,
}

impl FilmStatus {
    /// Number of files with this fault.
    pub fn count(&self, fault: Fault) -> usize {
        self.faults.iter().filter(|file| file.fault == fault).count()
    }

    /// Frames that must be drawn again.
    pub fn frames_to_draw(&self) -> Vec<u32> {
        let frames: BTreeSet<u32> = self.faults.iter().filter(|file| file.belongs).map(|file| file.frame).collect();
        frames.into_iter().collect()
    }
}

/// Reads all files of a film. `expected` gives the frames that it must have; the default is the frames of all runs. `on_file` receives the number of
/// finished files and the total number.
///
/// # Errors
///
/// The folder is not that of a film, or cannot be read.
pub fn film_status(
    folder: &Path,
    expected: Option<FrameRange>,
    on_file: &(dyn Fn(usize, usize) + Sync),
) -> Result<(FilmRecord, FilmStatus), FilmError> {
    let path = folder.join("film.json");
    let not_a_film = |problem: String| FilmError::NotAFilm { folder: folder.to_owned(), problem };
    let record = match held_record(&path)? {
        Some(Ok(record)) => record,
        Some(Err(error)) => return Err(not_a_film(format!("its film.json does not describe a film ({error})"))),
        None => return Err(not_a_film("it has no film.json".to_owned())),
    };
    let checksums = Checksums::read(folder).map_err(failed("read", &folder.join(checksums::NAME)))?;
    let mut notes = Vec::new();
    if checksums.is_none() {
        notes.push(format!(
            "no {}: an earlier version drew these frames; damaged files are found, but it is unknown whether the other files were changed",
            checksums::NAME
        ));
    }
    let existing: BTreeSet<String> = names(folder)?.into_iter().collect();
    let numbered = |name: &String| record.images.iter().find_map(|stem| number_of(name, stem, &record.extension));
    let (frames, is_known) = match (expected, &record.frames[..]) {
        (Some(range), _) => (vec![range], !record.frames.is_empty()),
        (None, []) => {
            let numbers: BTreeSet<u32> = existing.iter().filter_map(numbered).collect();
            let range = numbers.first().zip(numbers.last()).and_then(|(first, last)| FrameRange::new(*first, last + 1));
            notes.push(
                "film.json does not contain the range of frames: the range from the first to the last existing frame is assumed; --frames sets another one".to_owned(),
            );
            (range.into_iter().collect(), false)
        }
        (None, ranges) => (ranges.to_vec(), true),
    };
    let wanted: Vec<(u32, String)> = frames
        .iter()
        .flat_map(|range| range.frames(None))
        .flat_map(|frame| record.images.iter().map(move |stem| (frame, stem)))
        .map(|(frame, stem)| (frame, file_name(stem, frame, &record.extension)))
        .collect();

    // Files of frames that no run has drawn.
    let is_drawn = |frame: u32| record.frames.iter().any(|range| (range.first..range.end).contains(&frame));
    let strays = existing.iter().filter_map(|name| Some((numbered(name)?, name)));
    let strays =
        strays.filter(|(frame, _)| is_known && !is_drawn(*frame) && !frames.iter().any(|r| r.contains(*frame)));
    let strays = strays.map(|(frame, name)| FaultyFile {
        frame,
        file: name.clone(),
        fault: Fault::Foreign,
        problem: "no run of this film drew this frame".to_owned(),
        belongs: false,
    });
    let mut faults: Vec<FaultyFile> = strays.collect();

    let done = AtomicUsize::new(0);
    let judged: Vec<Option<FaultyFile>> = wanted
        .par_iter()
        .map(|(frame, name)| {
            let found = if existing.contains(name) {
                judge(folder, name, &record, checksums.as_ref())
            } else {
                Ok(Verdict::Faulty(Fault::Missing, "it does not exist".to_owned()))
            };
            on_file(done.fetch_add(1, Ordering::Relaxed) + 1, wanted.len());
            found.map(|verdict| match verdict {
                Verdict::Verified => None,
                Verdict::Unknown => Some(unknown(*frame, name)),
                Verdict::Faulty(fault, problem) => {
                    Some(FaultyFile { frame: *frame, file: name.clone(), fault, problem, belongs: true })
                }
            })
        })
        .collect::<Result<_, FilmError>>()?;
    let verified = judged.iter().filter(|found| found.is_none()).count();
    let (without, faulty): (Vec<_>, Vec<_>) = judged.into_iter().flatten().partition(|file| file.problem.is_empty());
    faults.extend(faulty);
    faults.sort();
    let status = FilmStatus {
        film: record.digest.clone(),
        frames,
        files: wanted.len(),
        verified,
        without_checksum: without.len(),
        faults,
        notes,
    };
    Ok((record, status))
}

/// A file that can be read and has no checksum; it has no problem.
fn unknown(frame: u32, name: &str) -> FaultyFile {
    FaultyFile { frame, file: name.to_owned(), fault: Fault::Foreign, problem: String::new(), belongs: true }
}

enum Verdict {
    Verified,
    /// It can be read and has no checksum.
    Unknown,
    Faulty(Fault, String),
}

/// Checks an existing file.
fn judge(folder: &Path, name: &str, record: &FilmRecord, checksums: Option<&Checksums>) -> Result<Verdict, FilmError> {
    let path = folder.join(name);
    let bytes = match files::read_bounded(&path, MOST_BYTES) {
        Ok(bytes) => bytes,
        Err(error) if error.kind() == io::ErrorKind::NotFound => {
            return Ok(Verdict::Faulty(Fault::Missing, "it does not exist".to_owned()));
        }
        Err(error) => return Err(failed("read", &path)(error)),
    };
    let recorded = checksums.and_then(|checksums| Some((checksums, checksums.by_name.get(name)?)));
    if let Some((checksums, sha256)) = recorded
        && files::sha256(&bytes) == *sha256
    {
        return Ok(if checksums.film == record.digest {
            Verdict::Verified
        } else {
            Verdict::Faulty(Fault::Foreign, format!("it is a frame of the film {:.12}", checksums.film))
        });
    }
    // Decode the file to find out whether it is damaged or a different picture.
    let read = if record.extension == "png" { read_png(&bytes) } else { read_exr(&bytes) };
    Ok(match (read, recorded) {
        (Err(problem), _) => Verdict::Faulty(Fault::Damaged, format!("{problem} ({} bytes)", bytes.len())),
        (Ok(Some(film)), _) if film != record.digest => {
            Verdict::Faulty(Fault::Foreign, format!("it is a frame of the film {film:.12}"))
        }
        (Ok(Some(_)), Some(_)) => Verdict::Faulty(Fault::Damaged, "its checksum is wrong".to_owned()),
        (Ok(None), Some(_)) => {
            Verdict::Faulty(Fault::Foreign, "it is a whole picture, but not the one that this film drew".to_owned())
        }
        (Ok(_), None) => Verdict::Unknown,
    })
}

/// Checks the checksums of all chunks of a PNG file. A PNG file does not name its film.
fn read_png(bytes: &[u8]) -> Result<Option<String>, String> {
    let mut rest = bytes.strip_prefix(b"\x89PNG\r\n\x1a\n").ok_or("it does not begin like a PNG file")?;
    loop {
        let truncated = || "it ends before the end of its picture".to_owned();
        let (length, after) = rest.split_first_chunk::<4>().ok_or_else(truncated)?;
        let length = u32::from_be_bytes(*length) as usize;
        let (chunk, after) = after.split_at_checked(length.saturating_add(4)).ok_or_else(truncated)?;
        let (crc32, after) = after.split_first_chunk::<4>().ok_or_else(truncated)?;
        let kind = String::from_utf8_lossy(&chunk[..4]);
        if crc32fast::hash(chunk) != u32::from_be_bytes(*crc32) {
            return Err(format!("the checksum of its part {kind} is wrong"));
        }
        if &chunk[..4] == b"IEND" {
            return if after.is_empty() { Ok(None) } else { Err("it continues after its last part".to_owned()) };
        }
        rest = after;
    }
}

/// Decodes an OpenEXR file; returns the film that its header names.
fn read_exr(bytes: &[u8]) -> Result<Option<String>, String> {
    let headers = exr::meta::MetaData::read_from_buffered(Cursor::new(bytes), false);
    let headers = headers.map_err(|error| format!("its header cannot be read: {error}"))?.headers;
    let film = headers.first().and_then(|header| header.own_attributes.other.get(&b"film_sha256"[..]).cloned());
    let film = film.and_then(|value| match value {
        exr::prelude::AttributeValue::Text(text) => Some(text.to_string()),
        _ => None,
    });
    let image = files::read_exr(bytes, |_, _, _| Ok(()), |error| format!("it cannot be decoded: {error}"));
    image.map(|_| film)
}

/// Recorded checksums of a folder by file name.
pub fn recorded_checksums(folder: &Path) -> Result<std::collections::BTreeMap<String, String>, FilmError> {
    let checksums = Checksums::read(folder).map_err(failed("read", &folder.join(checksums::NAME)))?;
    Ok(checksums.unwrap_or_default().by_name)
}

/// Removes a file of a folder.
pub fn remove_file(folder: &Path, name: &str) -> Result<(), FilmError> {
    let path = folder.join(name);
    fs::remove_file(&path).map_err(failed("remove", &path))
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failed precondition of a test may panic")]
mod tests {
    use super::super::super::encode::tests::sample;
    use super::super::images::{FilmFormat, ImageWords, encode_image};
    use super::*;
    use crate::photometry::tone_map::ToneMapSettings;

    #[test]
    fn every_flipped_byte_and_every_truncation_of_a_png_is_found() {
        let words = |film: &str| ImageWords {
            exposure_ev100: 0.0,
            tone_map: ToneMapSettings::default(),
            attributes: vec![("film_sha256", film.to_owned())],
        };
        let png = encode_image(FilmFormat::Png8, &sample(8, 8), &words("f")).unwrap();
        assert_eq!(read_png(&png), Ok(None));
        for place in 0..png.len() {
            let mut flipped = png.clone();
            flipped[place] ^= 1;
            assert!(read_png(&flipped).is_err(), "{place}");
            assert!(read_png(&png[..place]).is_err(), "{place}");
        }
        assert!(read_png(&[&png[..], &[0]].concat()).is_err());
        let exr = encode_image(FilmFormat::Exr32, &sample(8, 8), &words("f")).unwrap();
        assert_eq!(read_exr(&exr), Ok(Some("f".to_owned())));
        assert!(read_exr(&exr[..exr.len() - 1]).is_err() && read_exr(&png).is_err());
    }
}
