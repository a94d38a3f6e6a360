//! Signals that end a command which would go on by itself.

use std::{
    io,
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    thread,
};

use crate::service;

/// Becomes true with SIGINT or SIGTERM, which from now on end nothing by themselves.
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
        tracing::info!("ending after the frame in hand");
        tell.store(true, Ordering::Relaxed);
    })?;
    Ok(ended)
}
