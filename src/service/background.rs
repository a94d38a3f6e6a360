//! Threads that stand back behind those that render: what encodes, places, bakes and checks has the cores that frames leave.

use std::{cell::Cell, sync::OnceLock};

use rayon::{ThreadPool, ThreadPoolBuilder};

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

/// Does long work that is shared among cores, on threads of its own: frames are planned on those that all else uses, and would wait behind it.
pub(super) fn on_own_cores<T: Send>(work: impl FnOnce() -> T + Send) -> T {
    static POOL: OnceLock<Option<ThreadPool>> = OnceLock::new();
    let pool = POOL.get_or_init(|| {
        let name = |number| format!("background-{number}");
        let pool = ThreadPoolBuilder::new().thread_name(name).start_handler(|_| stand_back()).build();
        pool.inspect_err(|error| tracing::warn!("long work shares the threads of frames: {error}")).ok()
    });
    match pool {
        Some(pool) => pool.install(work),
        None => work(),
    }
}
