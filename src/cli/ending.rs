//! Signals that end a command which would otherwise continue to run.

use std::{
    io,
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    thread,
};

use crate::service;

/// Returns a flag that becomes true on SIGINT or SIGTERM, or their counterparts on Windows. From then on these signals no longer end the process by
/// themselves.
pub fn ended_by_signal() -> io::Result<Arc<AtomicBool>> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
    let signals = {
        let _entered = runtime.enter();
        service::signals()?
    };
    let ended = Arc::new(AtomicBool::new(false));
    let tell = Arc::clone(&ended);
    thread::Builder::new().name("signals".to_owned()).spawn(move || {
        runtime.block_on(signals);
        tracing::info!("ending after the current frame");
        tell.store(true, Ordering::Relaxed);
    })?;
    Ok(ended)
}
