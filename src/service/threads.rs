//! Threads of lower priority than the rendering ones, and the message of a thread that panicked.

use std::{any::Any, cell::Cell, sync::OnceLock};

use rayon::{ThreadPool, ThreadPoolBuilder};

/// Difference of priority in the steps of the system's `nice` value.
const STEPS: i32 = 10;

thread_local! {
    static STANDS_BACK: Cell<bool> = const { Cell::new(false) };
}

/// Lowers the priority of the calling thread and of the threads that it starts afterwards. On systems without thread
/// priorities, all threads stay equal.
pub(crate) fn stand_back() {
    if STANDS_BACK.replace(true) {
        return;
    }
    #[cfg(target_os = "linux")]
    if let Err(error) = rustix::process::setpriority_process(None, STEPS) {
        tracing::debug!("cannot lower the priority of a thread: {error}");
    }
}

/// Runs long parallel work in a dedicated low-priority thread pool. In the global pool, the planning of frames would
/// wait for it.
pub(crate) fn on_own_cores<T: Send>(work: impl FnOnce() -> T + Send) -> T {
    static POOL: OnceLock<Option<ThreadPool>> = OnceLock::new();
    let pool = POOL.get_or_init(|| {
        let name = |number| format!("background-{number}");
        let pool = ThreadPoolBuilder::new().thread_name(name).start_handler(|_| stand_back()).build();
        pool.inspect_err(|error| {
            tracing::warn!("cannot start the background thread pool; long work shares the threads of frames: {error}")
        })
        .ok()
    });
    match pool {
        Some(pool) => pool.install(work),
        None => work(),
    }
}

/// Returns the message of a panic.
pub(crate) fn panic_message(payload: &(dyn Any + Send)) -> String {
    let text = payload.downcast_ref::<String>().map(String::as_str);
    text.or_else(|| payload.downcast_ref::<&str>().copied()).unwrap_or("no message").to_owned()
}
