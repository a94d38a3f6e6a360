//! Values that are made at their first use, by parallel work.
//!
//! A thread of a pool that waits for its own parallel work takes up other work meanwhile. If it held a lock, and the other work needed the same lock,
//! it would wait for itself forever. So these values are made without a lock.

use std::sync::OnceLock;

/// Returns the value of a cell. If it has none, makes one, without a lock: two threads may do so at the same time, and the value of the first is kept.
pub(crate) fn get_or_make<T>(cell: &OnceLock<T>, make: impl FnOnce() -> T) -> &T {
    match cell.get() {
        Some(value) => value,
        None => {
            let value = make();
            cell.get_or_init(|| value)
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "tests may panic")]
mod tests {
    use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

    use rayon::prelude::*;

    use super::*;

    /// Jobs of a pool that all need the same value, which is made by parallel work of the same pool: a lock during this work would stop them.
    #[test]
    fn jobs_of_a_pool_may_need_a_value_that_its_parallel_work_makes() {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(2).build().unwrap();
        for _ in 0..50 {
            let cell = OnceLock::new();
            let made = AtomicUsize::new(0);
            let value = || {
                *get_or_make(&cell, || {
                    made.fetch_add(1, Relaxed);
                    (0..64_u64)
                        .into_par_iter()
                        .map(|n| (0..2000).fold(n, |sum, k| sum ^ sum.wrapping_mul(3).wrapping_add(k)))
                        .reduce(|| 0, u64::max)
                })
            };
            let values: Vec<u64> = pool.install(|| (0..16).into_par_iter().map(|_| value()).collect());
            assert!(values.iter().all(|found| *found == values[0]));
            assert!(made.into_inner() >= 1);
        }
    }

    #[test]
    fn a_value_is_made_once_by_one_thread() {
        let cell = OnceLock::new();
        assert_eq!(get_or_make(&cell, || 1), &1);
        assert_eq!(get_or_make(&cell, || 2), &1);
    }
}
