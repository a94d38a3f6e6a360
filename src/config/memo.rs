//! The last result of a computation that takes seconds with projectors, with its input.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Keeps the last result. Clones share it.
#[derive(Clone, Debug)]
pub(super) struct Memo<K, V>(Arc<Mutex<Option<(K, V)>>>);

impl<K, V> Default for Memo<K, V> {
    fn default() -> Self {
        Self(Arc::default())
    }
}

impl<K, V> PartialEq for Memo<K, V> {
    /// Always equal, because the result follows from the configuration.
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

impl<K: Clone + PartialEq, V: Clone> Memo<K, V> {
    fn last(&self) -> MutexGuard<'_, Option<(K, V)>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Returns the last result if it is of this input; otherwise makes a new one and keeps it. The lock is not held meanwhile: the work is parallel.
    ///
    /// # Errors
    ///
    /// The error of `make`; the last result stays.
    pub(super) fn of<E>(&self, input: &K, make: impl FnOnce() -> Result<V, E>) -> Result<V, E> {
        if let Some((_, result)) = self.last().as_ref().filter(|(of, _)| of == input) {
            return Ok(result.clone());
        }
        let result = make()?;
        *self.last() = Some((input.clone(), result.clone()));
        Ok(result)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_result_is_made_again_only_for_another_input() {
        let memo = Memo::default();
        let of = |input: u32, made: Result<u32, ()>| memo.of(&input, || made);
        assert_eq!(of(1, Ok(10)), Ok(10));
        assert_eq!(of(1, Ok(11)), Ok(10));
        assert_eq!(of(2, Err(())), Err(()));
        assert_eq!(of(1, Ok(12)), Ok(10));
        assert_eq!(of(2, Ok(20)), Ok(20));
        assert_eq!(memo.clone().of(&2, || Err(())), Ok(20));
        assert_eq!(of(1, Ok(13)), Ok(13));
    }
}
