//! Console events that end the daemon and commands that run until they are stopped.

use std::{
    future::{Future, pending},
    io,
};

use tokio::signal::windows::{ctrl_break, ctrl_c, ctrl_close, ctrl_logoff, ctrl_shutdown};

/// Returns a future that resolves when the user or the system ends the program; the handlers are installed when this function returns. Needs a tokio
/// runtime with I/O. After each of the last three events, Windows gives a program about five seconds to end.
///
/// # Errors
///
/// The system refuses the handlers.
pub(crate) fn end() -> io::Result<impl Future<Output = ()> + Send> {
    let (mut interrupt, mut pause, mut close) = (ctrl_c()?, ctrl_break()?, ctrl_close()?);
    let (mut logoff, mut shutdown) = (ctrl_logoff()?, ctrl_shutdown()?);
    Ok(async move {
        tokio::select! {
            _ = interrupt.recv() => tracing::info!("Ctrl-C: ending"),
            _ = pause.recv() => tracing::info!("Ctrl-Break: ending"),
            _ = close.recv() => tracing::info!("the console was closed: ending"),
            _ = logoff.recv() => tracing::info!("the user logs off: ending"),
            _ = shutdown.recv() => tracing::info!("the system shuts down: ending"),
        }
    })
}

/// Does nothing: Windows has no such signal.
///
/// # Errors
///
/// None.
pub(crate) fn survive_hangup() -> io::Result<()> {
    Ok(())
}

/// Signal that reloads the access rules: Windows has none.
pub(crate) struct ReloadSignal(());

impl ReloadSignal {
    /// Logs that there is no such signal.
    ///
    /// # Errors
    ///
    /// None.
    pub(crate) fn install() -> io::Result<Self> {
        tracing::info!("access rules are read once, at the start: Windows has no SIGHUP");
        Ok(Self(()))
    }

    /// Never resolves.
    pub(crate) async fn next(&mut self) -> Option<()> {
        pending().await
    }
}
