//! Unix sockets.

use std::{
    io,
    os::unix::fs::FileTypeExt as _,
    path::{Path, PathBuf},
    task::{Context, Poll, ready},
};

use rustix::net::{AddressFamily, SocketAddrUnix, SocketFlags, SocketType, connect, socket_with};
pub(crate) use tokio::net::UnixStream as LocalStream;
use tokio::{net::UnixListener, runtime::Handle};

/// A path to listen on.
pub(crate) struct LocalSocket(PathBuf);

impl LocalSocket {
    /// Names a path.
    ///
    /// # Errors
    ///
    /// The path is too long.
    pub(crate) fn new(path: &Path) -> Result<Self, &'static str> {
        SocketAddrUnix::new(path).map_err(|_| "the path of a Unix socket has at most 107 bytes")?;
        Ok(Self(path.to_owned()))
    }

    /// Whether the path leads to a socket.
    pub(crate) fn exists(&self) -> bool {
        std::fs::metadata(&self.0).is_ok_and(|metadata| metadata.file_type().is_socket())
    }

    /// Returns the kind of file at the path; `None` if none exists or it is a socket.
    pub(crate) fn obstacle(&self) -> Option<&'static str> {
        match std::fs::metadata(&self.0).ok()?.file_type() {
            kind if kind.is_socket() => None,
            kind if kind.is_dir() => Some("folder"),
            kind if kind.is_file() => Some("file"),
            _ => Some("device"),
        }
    }

    /// Whether a process listens at the path.
    pub(crate) fn answers(&self) -> bool {
        self.attempt().is_ok()
    }

    /// Connects to the process that listens at the path. Does not block, even if that process is frozen and its queue of connections is full.
    fn attempt(&self) -> io::Result<()> {
        let socket = socket_with(AddressFamily::UNIX, SocketType::STREAM, SocketFlags::NONBLOCK, None)?;
        match connect(&socket, &SocketAddrUnix::new(&self.0)?).map_err(io::Error::from) {
            Err(error) if error.kind() == io::ErrorKind::WouldBlock => Ok(()),
            connected => connected,
        }
    }

    /// Removes a socket that a daemon left behind. Returns whether the path is then free; it is not if a process listens there.
    ///
    /// # Errors
    ///
    /// The socket cannot be removed.
    pub(crate) fn release(&self) -> io::Result<bool> {
        match self.attempt() {
            Ok(()) => return Ok(false),
            // For other files, the system gives the same error as for a socket without a listening process, so check that it is a socket.
            Err(error) if error.kind() == io::ErrorKind::ConnectionRefused && self.exists() => {
                std::fs::remove_file(&self.0)?;
            }
            // There is no socket, or it cannot be opened. Binding then reports the error.
            Err(_) => {}
        }
        Ok(true)
    }

    /// Binds a socket that its owner and group may open.
    ///
    /// # Errors
    ///
    /// Error of the system.
    pub(crate) fn bind(&self) -> io::Result<LocalListener> {
        const OWNER_AND_GROUP: u32 = 0o117;
        let mask = rustix::process::umask(rustix::fs::Mode::from_raw_mode(OWNER_AND_GROUP));
        let listener = UnixListener::bind(&self.0);
        rustix::process::umask(mask);
        listener.map(LocalListener)
    }
}

/// Listening socket.
pub(crate) struct LocalListener(UnixListener);

impl LocalListener {
    /// Returns two listeners for the same socket: one for this runtime and one for another runtime.
    ///
    /// # Errors
    ///
    /// Error of the system.
    pub(crate) fn twice(self, other: &Handle) -> io::Result<(Self, Self)> {
        let listener = self.0.into_std()?;
        let copy = listener.try_clone()?;
        let listener = UnixListener::from_std(listener)?;
        let _inside = other.enter();
        Ok((Self(listener), Self(UnixListener::from_std(copy)?)))
    }

    /// Accepts a connection, and returns it with the ID of the user at its other end.
    pub(crate) fn poll_accept(&self, context: &mut Context<'_>) -> Poll<io::Result<(LocalStream, u32)>> {
        let (stream, _) = ready!(self.0.poll_accept(context))?;
        let user = stream.peer_cred()?.uid();
        Poll::Ready(Ok((stream, user)))
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic on unexpected values")]
mod tests {
    use std::os::unix::net::{UnixListener, UnixStream};

    use super::*;

    #[test]
    fn a_process_that_accepts_nothing_still_has_its_socket() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("socket");
        let socket = LocalSocket::new(&path).unwrap();
        assert!(!socket.answers() && socket.release().unwrap(), "nothing is there");
        let listener = UnixListener::bind(&path).unwrap();
        rustix::net::listen(&listener, 0).unwrap();
        // One waiting connection fills the queue of this listener.
        let _waiting = UnixStream::connect(&path).unwrap();
        assert!(socket.answers() && !socket.release().unwrap() && path.exists());
        drop(listener);
        assert!(!socket.answers() && socket.release().unwrap() && !path.exists(), "a socket that was left behind");
    }

    #[test]
    fn paths_that_are_too_long_for_a_socket_are_refused() {
        assert!(LocalSocket::new(Path::new(&"x".repeat(100))).is_ok());
        assert!(LocalSocket::new(Path::new(&"x".repeat(200))).err().unwrap().contains("107 bytes"));
    }
}
