//! Unix sockets are refused: neither the standard library nor tokio has them on Windows. No value of these types exists.

use std::{
    io,
    path::Path,
    pin::Pin,
    task::{Context, Poll},
};

use tokio::{
    io::{AsyncRead, AsyncWrite, ReadBuf},
    runtime::Handle,
};

/// A path to listen on.
pub(crate) enum LocalSocket {}

impl LocalSocket {
    /// Refuses every path.
    ///
    /// # Errors
    ///
    /// Always.
    pub(crate) fn new(_: &Path) -> Result<Self, &'static str> {
        Err("Unix sockets are not supported on Windows")
    }

    /// Whether the path leads to a socket.
    pub(crate) fn exists(&self) -> bool {
        match *self {}
    }

    /// Returns the kind of file at the path; `None` if none exists or it is a socket.
    pub(crate) fn obstacle(&self) -> Option<&'static str> {
        match *self {}
    }

    /// Whether a process listens at the path.
    pub(crate) fn answers(&self) -> bool {
        match *self {}
    }

    /// Removes a socket that a daemon left behind.
    pub(crate) fn release(&self) -> io::Result<bool> {
        match *self {}
    }

    /// Binds the socket.
    pub(crate) fn bind(&self) -> io::Result<LocalListener> {
        match *self {}
    }
}

/// Listening socket.
pub(crate) enum LocalListener {}

impl LocalListener {
    /// Returns two listeners for the same socket: one for this runtime and one for another runtime.
    pub(crate) fn twice(self, _: &Handle) -> io::Result<(Self, Self)> {
        match self {}
    }

    /// Accepts a connection.
    pub(crate) fn poll_accept(&self, _: &mut Context<'_>) -> Poll<io::Result<(LocalStream, u32)>> {
        match *self {}
    }
}

/// An accepted connection.
pub(crate) enum LocalStream {}

impl AsyncRead for LocalStream {
    fn poll_read(self: Pin<&mut Self>, _: &mut Context<'_>, _: &mut ReadBuf<'_>) -> Poll<io::Result<()>> {
        match *self {}
    }
}

impl AsyncWrite for LocalStream {
    fn poll_write(self: Pin<&mut Self>, _: &mut Context<'_>, _: &[u8]) -> Poll<io::Result<usize>> {
        match *self {}
    }

    fn poll_flush(self: Pin<&mut Self>, _: &mut Context<'_>) -> Poll<io::Result<()>> {
        match *self {}
    }

    fn poll_shutdown(self: Pin<&mut Self>, _: &mut Context<'_>) -> Poll<io::Result<()>> {
        match *self {}
    }
}
