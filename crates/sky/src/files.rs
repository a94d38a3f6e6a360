//! Reading of regular files of limited size. Written files appear as a whole or not at all: they are written next to
//! their destination and renamed.

use std::{
    cell::RefCell,
    fs::{self, File},
    io::{self, BufRead, BufReader, Read, Write},
    path::{Path, PathBuf},
};

use exr::{
    error::Error as ExrError,
    meta::MetaData,
    prelude::{AnyChannels, FlatSamples, Image, Layer, ReadChannels, ReadLayers},
};
use flate2::read::MultiGzDecoder;
use sha2::{Digest, Sha256};
use tempfile::NamedTempFile;

use crate::platform;

thread_local! {
    /// Files opened by this thread inside [`reading`].
    static OPENED: RefCell<Option<Vec<PathBuf>>> = const { RefCell::new(None) };
}

/// Runs `read` and returns its result with the files that it opened on this thread, each once, in order. This includes
/// files to which other files refer; only their readers know them. The files of a nested call are not included in those
/// of the outer call.
pub fn reading<T>(read: impl FnOnce() -> T) -> (T, Vec<PathBuf>) {
    let outer = OPENED.replace(Some(Vec::new()));
    let value = read();
    let opened = OPENED.replace(outer).unwrap_or_default();
    let mut files: Vec<PathBuf> = Vec::with_capacity(opened.len());
    for path in opened {
        if !files.contains(&path) {
            files.push(path);
        }
    }
    (value, files)
}

/// Opens a file for reading, unless it is a folder, a pipe or a device, which may never end.
pub fn open_regular(path: &Path) -> io::Result<File> {
    let is_regular = |metadata: &fs::Metadata| match (metadata.is_file(), metadata.is_dir()) {
        (true, _) => Ok(()),
        (_, true) => Err(io::Error::from(io::ErrorKind::IsADirectory)),
        _ => Err(io::Error::new(io::ErrorKind::InvalidInput, "it is a pipe or a device; only regular files are read")),
    };
    // Checked before opening, because opening a pipe waits for a writer; and again after, because the path may refer
    // to another file by then.
    is_regular(&fs::metadata(path)?)?;
    let file = File::open(path)?;
    is_regular(&file.metadata()?)?;
    OPENED.with_borrow_mut(|opened| opened.iter_mut().for_each(|opened| opened.push(path.to_owned())));
    Ok(file)
}

/// First bytes of a file compressed with gzip.
const GZIP: &[u8] = b"\x1f\x8b";

/// Returns the content of a file, and whether its first bytes are those of gzip. Such a file is decompressed while it
/// is read.
pub fn expanded(file: File) -> io::Result<(Box<dyn BufRead>, bool)> {
    let mut file = BufReader::new(file);
    let is_gzip = file.fill_buf()?.starts_with(GZIP);
    Ok(if is_gzip { (Box::new(BufReader::new(MultiGzDecoder::new(file))), true) } else { (Box::new(file), false) })
}

/// Reads a regular file of at most `most_bytes`.
pub fn read_bounded(path: &Path, most_bytes: u64) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    // One byte more than the limit shows that the file exceeds it.
    open_regular(path)?.take(most_bytes + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > most_bytes {
        let problem = format!("it must have at most {most_bytes} bytes");
        return Err(io::Error::new(io::ErrorKind::FileTooLarge, problem));
    }
    Ok(bytes)
}

/// Like [`read_bounded`], for a text file.
pub fn read_text_bounded(path: &Path, most_bytes: u64) -> io::Result<String> {
    let bytes = read_bounded(path, most_bytes)?;
    String::from_utf8(bytes).map_err(|error| {
        let (valid, bytes) = (error.utf8_error().valid_up_to(), error.as_bytes());
        // A UTF-16 file begins with a byte order mark.
        let problem = if bytes.starts_with(b"\xff\xfe") || bytes.starts_with(b"\xfe\xff") {
            "it is UTF-16: save it as UTF-8".to_owned()
        } else {
            let line = bytes[..valid].iter().filter(|byte| **byte == b'\n').count() + 1;
            format!("line {line} is not UTF-8: save the file as UTF-8")
        };
        io::Error::new(io::ErrorKind::InvalidData, problem)
    })
}

/// Reads the first layer of an OpenEXR file, all channels at full resolution. The decoder allocates everything that
/// the header announces before it sees a pixel; `allowed` therefore checks width, height and number of channels
/// first.
pub fn read_exr<E>(
    bytes: &[u8],
    allowed: impl Fn(usize, usize, usize) -> Result<(), E>,
    unreadable: impl Fn(ExrError) -> E,
) -> Result<Image<Layer<AnyChannels<FlatSamples>>>, E> {
    let headers = MetaData::read_from_buffered(io::Cursor::new(bytes), false).map_err(&unreadable)?.headers;
    if let Some(header) = headers.iter().find(|header| !header.deep) {
        allowed(header.layer_size.0, header.layer_size.1, header.channels.list.len())?;
    }
    exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .first_valid_layer()
        .all_attributes()
        .non_parallel()
        .from_buffered(io::Cursor::new(bytes))
        .map_err(unreadable)
}

/// Bytes in hexadecimal.
pub fn hexadecimal(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// SHA-256, hexadecimal.
pub fn sha256(bytes: &[u8]) -> String {
    hexadecimal(&Sha256::digest(bytes))
}

/// Length of a file and the SHA-256 of its content, hexadecimal.
pub fn sha256_of_file(path: &Path) -> io::Result<(u64, String)> {
    let mut file = open_regular(path)?;
    let (mut hash, mut block, mut bytes) = (Sha256::new(), vec![0; 1 << 20], 0);
    loop {
        match file.read(&mut block)? {
            0 => return Ok((bytes, hexadecimal(&hash.finalize()))),
            count => {
                hash.update(&block[..count]);
                bytes += count as u64;
            }
        }
    }
}

/// The folder that contains a file, or will contain it.
pub fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// Whether two paths lead to the same existing file, even through links.
pub fn is_same_file(first: &Path, second: &Path) -> bool {
    let (Ok(first_metadata), Ok(second_metadata)) = (fs::metadata(first), fs::metadata(second)) else { return false };
    match (platform::identity(&first_metadata), platform::identity(&second_metadata)) {
        (Some(first), Some(second)) => first == second,
        _ => matches!((fs::canonicalize(first), fs::canonicalize(second)), (Ok(first), Ok(second)) if first == second),
    }
}

/// Checks that a folder exists or can be created, and that files can be written into it. Nothing is left behind.
///
/// # Errors
///
/// The folder, or the one in which it would be created, is a file or not writable.
pub fn check_folder(folder: &Path) -> io::Result<()> {
    let existing = folder.ancestors().find(|path| path.exists()).unwrap_or(Path::new("."));
    if !existing.is_dir() {
        let which = if existing == folder { "it".to_owned() } else { existing.display().to_string() };
        return Err(io::Error::new(io::ErrorKind::NotADirectory, format!("{which} is a file, and a folder is needed")));
    }
    beside(&existing.join("file")).map(drop)
}

/// Creates a temporary file in the folder of `path`, with the permissions of any new file (by default only its owner
/// can read a temporary file).
pub fn beside(path: &Path) -> io::Result<NamedTempFile> {
    beside_with_suffix(path, "")
}

/// Like [`beside`]; the name of the file ends with `suffix`, for programs that depend on it.
pub fn beside_with_suffix(path: &Path, suffix: &str) -> io::Result<NamedTempFile> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(".steradian-").suffix(suffix);
    platform::share(&mut builder);
    builder.tempfile_in(folder_of(path))
}

/// Moves a finished temporary file to its destination; replaces an existing file.
pub fn publish(file: NamedTempFile, path: &Path) -> io::Result<()> {
    file.persist(path).map_err(|error| error.error)?;
    Ok(())
}

/// Writes a file as a whole or not at all.
pub fn write_whole(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let mut file = beside(path)?;
    file.write_all(bytes)?;
    publish(file, path)
}

/// Like [`write_whole`], but the data are flushed to the disk before the file gets its name.
pub fn write_whole_synced(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let mut file = beside(path)?;
    file.write_all(bytes)?;
    file.as_file().sync_all()?;
    publish(file, path)
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "tests may panic")]
mod tests {
    use super::*;

    #[test]
    fn folders_are_checked_without_being_created() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("file");
        write_whole(&path, b"x").unwrap();
        let new = folder.path().join("new/inner");
        assert!(check_folder(folder.path()).is_ok() && check_folder(&new).is_ok());
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1, "nothing was created");
        let problem = |path: &Path| check_folder(path).unwrap_err().to_string();
        assert_eq!(problem(&path), "it is a file, and a folder is needed");
        assert!(problem(&path.join("inner")).ends_with("file is a file, and a folder is needed"));
    }

    #[test]
    fn only_regular_files_of_a_bounded_size_are_read() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("file");
        write_whole(&path, b"four").unwrap();
        assert_eq!(read_bounded(&path, 4).unwrap(), b"four");
        assert_eq!(read_text_bounded(&path, 5).unwrap(), "four");
        assert_eq!(read_bounded(&path, 3).unwrap_err().kind(), io::ErrorKind::FileTooLarge);
        assert_eq!(read_bounded(folder.path(), 3).unwrap_err().kind(), io::ErrorKind::IsADirectory);
        assert_eq!(read_bounded(&folder.path().join("none"), 3).unwrap_err().kind(), io::ErrorKind::NotFound);
        let (text, opened) = reading(|| [4, 5].map(|most| read_text_bounded(&path, most).unwrap()));
        assert_eq!((text[0].as_str(), opened), ("four", vec![path.clone()]));
        write_whole(&path, &[0xff]).unwrap();
        assert_eq!(read_text_bounded(&path, 5).unwrap_err().kind(), io::ErrorKind::InvalidData);
        for (bytes, expected) in
            [(&b"a\nb = '\xe4'"[..], "line 2 is not UTF-8: save the file"), (b"\xff\xfea\0", "it is UTF-16: save it")]
        {
            write_whole(&path, bytes).unwrap();
            let problem = read_text_bounded(&path, 99).unwrap_err().to_string();
            assert!(problem.starts_with(expected), "{problem}");
        }
    }
}
