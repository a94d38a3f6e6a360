//! Code that depends on the operating system: permissions of new files, reads at a position, and the identity of files.

use std::fs::{File, Metadata};
use std::io;

/// Gives a temporary file the permissions of any new file: on Unix only its owner could read it otherwise. On Windows it inherits those of
/// its folder, as every new file does.
pub(crate) fn share(builder: &mut tempfile::Builder<'_, '_>) {
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(std::fs::Permissions::from_mode(0o666));
    }
    #[cfg(not(unix))]
    let _ = builder;
}

/// Fills a buffer with the bytes of a file from an offset on. Several threads may read one file: no position is shared.
///
/// # Errors
/// Reading fails, or the file ends before the buffer is full (`UnexpectedEof`).
pub(crate) fn read_exact_at(file: &File, buffer: &mut [u8], offset: u64) -> io::Result<()> {
    #[cfg(unix)]
    {
        use std::os::unix::fs::FileExt;
        file.read_exact_at(buffer, offset)
    }
    #[cfg(windows)]
    {
        use std::os::windows::fs::FileExt;
        let (mut left, mut offset) = (buffer, offset);
        while !left.is_empty() {
            match file.seek_read(left, offset) {
                Ok(0) => return Err(io::ErrorKind::UnexpectedEof.into()),
                Ok(count) => {
                    left = &mut left[count..];
                    offset += count as u64;
                }
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(error) => return Err(error),
            }
        }
        Ok(())
    }
}

/// The numbers that identify a file to the system, independent of its names: all hard links to a file have the same numbers. `None` on systems for
/// which the standard library does not provide them.
pub(crate) fn identity(metadata: &Metadata) -> Option<[u64; 2]> {
    #[cfg(unix)]
    {
        use std::os::unix::fs::MetadataExt;
        Some([metadata.dev(), metadata.ino()])
    }
    #[cfg(not(unix))]
    {
        let _ = metadata;
        None
    }
}
