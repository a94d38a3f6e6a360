//! Signals of the daemon and of commands that run until they are stopped.

use std::{future::Future, io};

use tokio::signal::unix::{Signal, SignalKind, signal};

/// Returns a future that resolves on SIGINT or SIGTERM; the handlers are installed when this function returns. Needs a
/// tokio runtime with I/O.
///
/// # Errors
///
/// The system refuses the handlers.
pub(crate) fn end() -> io::Result<impl Future<Output = ()> + Send> {
    let mut interrupt = signal(SignalKind::interrupt())?;
    let mut terminate = signal(SignalKind::terminate())?;
    Ok(async move {
        tokio::select! {
            _ = interrupt.recv() => tracing::info!("SIGINT: ending"),
            _ = terminate.recv() => tracing::info!("SIGTERM: ending"),
        }
    })
}

/// Prevents SIGHUP from ending the process, which is its default action, until the program ends. Needs a tokio runtime with I/O.
///
/// # Errors
///
/// The system refuses the handler.
pub(crate) fn survive_hangup() -> io::Result<()> {
    // The handler stays installed when the value is dropped.
    signal(SignalKind::hangup()).map(drop)
}

/// Signal that reloads the access rules: SIGHUP.
pub(crate) struct ReloadSignal(Signal);

impl ReloadSignal {
    /// Installs the handler. Needs a tokio runtime with I/O.
    ///
    /// # Errors
    ///
    /// The system refuses the handler.
    pub(crate) fn install() -> io::Result<Self> {
        signal(SignalKind::hangup()).map(Self)
    }

    /// Waits for the next signal; returns `None` if there will be no more signals.
    pub(crate) async fn next(&mut self) -> Option<()> {
        self.0.recv().await
    }
}
