//! Sends notifications to systemd, if it has started the daemon and waits for them. A failure is logged.

use sd_notify::NotifyState;

/// Clients can connect.
pub(crate) fn ready() {
    notify(NotifyState::Ready);
}

/// The daemon is ending.
pub(crate) fn stopping() {
    notify(NotifyState::Stopping);
}

fn notify(state: NotifyState<'_>) {
    if let Err(error) = sd_notify::notify(&[state]) {
        tracing::warn!("cannot notify systemd: {error}");
    }
}
