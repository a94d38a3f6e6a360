//! Threads whose end can be awaited, threads of lower priority than the rendering threads, and the message of a panic.

use std::{any::Any, cell::Cell, io, sync::OnceLock, thread};

use rayon::{ThreadPool, ThreadPoolBuilder};
use tokio::{
    sync::oneshot,
    time::{Instant, timeout_at},
};

use crate::platform::process;

thread_local! {
    static STANDS_BACK: Cell<bool> = const { Cell::new(false) };
}

/// Lowers the priority of the calling thread, and on Linux that of the threads that it starts afterwards. On systems without thread priorities, all
/// threads keep the same priority, and the log states this.
pub(crate) fn stand_back() {
    if STANDS_BACK.replace(true) {
        return;
    }
    if let Err(error) = process::lower_thread_priority() {
        tracing::debug!("cannot lower the priority of a thread: {error}");
    }
}

/// Runs long parallel work in a dedicated low-priority thread pool. In the global pool, the planning of frames would
/// wait for it.
pub(crate) fn on_own_cores<T: Send>(work: impl FnOnce() -> T + Send) -> T {
    static POOL: OnceLock<Option<ThreadPool>> = OnceLock::new();
    in_pool(&POOL, ("background", Priority::Low), work)
}

/// Runs the encoding of a frame in a separate thread pool. In the pool of long work, it would wait for a second or more until a thread has finished a
/// part of that work. Slow encodings have a low priority. Other encodings take a few milliseconds, and a client waits for each of them: with a low
/// priority they would take as long as the frame that a software driver draws meanwhile.
pub(crate) fn encode_beside_long_work<T: Send>(is_slow: bool, encoding: impl FnOnce() -> T + Send) -> T {
    static QUICK: OnceLock<Option<ThreadPool>> = OnceLock::new();
    static SLOW: OnceLock<Option<ThreadPool>> = OnceLock::new();
    match is_slow {
        true => in_pool(&SLOW, ("slow encoding", Priority::Low), encoding),
        false => in_pool(&QUICK, ("encoding", Priority::Normal), encoding),
    }
}

/// Priority of the threads of a pool.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Priority {
    Normal,
    Low,
}

/// Runs work in a pool that is started on first use.
fn in_pool<T: Send>(
    pool: &OnceLock<Option<ThreadPool>>,
    (name, priority): (&'static str, Priority),
    work: impl FnOnce() -> T + Send,
) -> T {
    let pool = pool.get_or_init(|| {
        let thread_name = move |number| format!("{name}-{number}");
        let start = move |_| {
            if priority == Priority::Low {
                stand_back();
            }
        };
        let pool = ThreadPoolBuilder::new().thread_name(thread_name).start_handler(start).build();
        pool.inspect_err(|error| {
            tracing::warn!(
                "cannot start the thread pool `{name}`, so its work uses the threads that plan frames: {error}"
            )
        })
        .ok()
    });
    match pool {
        Some(pool) => pool.install(work),
        None => work(),
    }
}

/// A running thread whose end can be awaited.
pub(crate) struct RunningThread<T = ()> {
    /// Result of the thread, or its panic.
    pub(crate) join: thread::JoinHandle<T>,
    /// Resolves (with an error, because nothing is sent) when the thread has ended.
    pub(crate) ended: oneshot::Receiver<()>,
}

impl<T: Send + 'static> RunningThread<T> {
    /// Starts a thread. When its end is visible, everything that `work` owns has been dropped.
    ///
    /// # Errors
    ///
    /// The system refuses the thread.
    pub(crate) fn spawn(name: &str, work: impl FnOnce() -> T + Send + 'static) -> io::Result<Self> {
        let (sender, ended) = oneshot::channel::<()>();
        let join = thread::Builder::new().name(name.to_owned()).spawn(move || {
            // Dropped last, even on a panic.
            let _ended = sender;
            work()
        })?;
        Ok(Self { join, ended })
    }

    /// Waits until `deadline` for the end of a thread that was asked to stop; `None` if it is still busy. Must not be
    /// called after `ended` has resolved.
    pub(crate) async fn result(mut self, deadline: Instant) -> Option<thread::Result<T>> {
        timeout_at(deadline, &mut self.ended).await.ok()?.ok();
        Some(self.join.join())
    }
}

/// Returns the message of a panic.
pub(crate) fn panic_message(payload: &(dyn Any + Send)) -> String {
    let text = payload.downcast_ref::<String>().map(String::as_str);
    text.or_else(|| payload.downcast_ref::<&str>().copied()).unwrap_or("no message").to_owned()
}
