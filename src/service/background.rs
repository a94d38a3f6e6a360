//! Threads that stand back behind those that render: what encodes, places, bakes and checks has the cores that frames leave.

use std::cell::Cell;

/// How far they stand back, in steps of the system's priority (`nice`).
const STEPS: i32 = 10;

thread_local! {
    static STANDS_BACK: Cell<bool> = const { Cell::new(false) };
}

/// Lowers the priority of the calling thread, and of the threads that it starts from then on. Where the system does not know priorities of
/// threads, all stay equal.
pub(super) fn stand_back() {
    if STANDS_BACK.replace(true) {
        return;
    }
    #[cfg(target_os = "linux")]
    if let Err(error) = rustix::process::setpriority_process(None, STEPS) {
        tracing::debug!("a thread keeps its priority: {error}");
    }
}
