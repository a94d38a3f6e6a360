//! Windows has no supervisor that waits for notifications of a console program. Only a log line reports the state.

/// Clients can connect.
pub(crate) fn ready() {
    tracing::debug!("ready; no supervisor is notified: Windows has no systemd");
}

/// The daemon is ending.
pub(crate) fn stopping() {
    tracing::debug!("ending; no supervisor is notified: Windows has no systemd");
}
