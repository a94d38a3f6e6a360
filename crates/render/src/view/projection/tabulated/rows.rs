//! Parallel work on rows.

use std::{
    panic::resume_unwind,
    sync::atomic::{AtomicU32, Ordering::Relaxed},
    thread,
};

/// Returns the results of `make` for every row, in order, computed on all cores.
pub(super) fn by_rows<T: Send>(rows: u32, make: impl Fn(u32) -> T + Sync) -> Vec<T> {
    let threads = thread::available_parallelism().map_or(1, usize::from).min(rows as usize);
    let next = AtomicU32::new(0);
    let mut made: Vec<(u32, T)> = Vec::with_capacity(rows as usize);
    thread::scope(|scope| {
        let work = || {
            let mut own = Vec::new();
            loop {
                let row = next.fetch_add(1, Relaxed);
                if row >= rows {
                    return own;
                }
                own.push((row, make(row)));
            }
        };
        let workers: Vec<_> = (0..threads).map(|_| scope.spawn(work)).collect();
        for worker in workers {
            made.extend(worker.join().unwrap_or_else(|panic| resume_unwind(panic)));
        }
    });
    made.sort_unstable_by_key(|(row, _)| *row);
    made.into_iter().map(|(_, result)| result).collect()
}
