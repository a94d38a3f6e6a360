//! Keeps pages in memory up to a limit, and reads those that views ask for, in separate threads.

use std::collections::{HashMap, HashSet};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use rayon::prelude::*;

use super::super::super::epoch::Epoch;
use super::super::error::DeepError;
use super::super::reader::DeepStore;
use super::DeepStatistics;
use super::page::{Page, PageKey};

/// Number of threads that read pages.
const READERS: usize = 2;
/// Number of pages that a thread takes from the list at a time.
const TAKEN_AT_ONCE: usize = 16;
/// A request that is not renewed within this time is dropped: the view has moved on.
const FORGOTTEN_AFTER: Duration = Duration::from_millis(1500);
/// A page that was drawn within this time is not removed.
const KEPT_FOR: Duration = Duration::from_millis(500);
/// Limit of the memory for pages until another one is set, bytes.
const FIRST_LIMIT: u64 = 1 << 30;

/// A page in memory.
#[derive(Debug)]
struct Held {
    page: Arc<Page>,
    epoch: Epoch,
    used: Instant,
}

/// A requested page.
#[derive(Clone, Copy, Debug)]
struct Want {
    urgency: f64,
    epoch: Epoch,
    asked: Instant,
}

#[derive(Debug)]
struct State {
    held: HashMap<PageKey, Held>,
    wants: HashMap<PageKey, Want>,
    limit: u64,
    statistics: DeepStatistics,
    /// Message of the first error, and the pages that could not be read.
    problem: Option<String>,
    damaged: HashSet<PageKey>,
    /// Delay before each read of a page in the background, to simulate a slow disk.
    delay: Duration,
    is_closing: bool,
}

/// The pages of a store.
#[derive(Debug)]
pub(super) struct Pages {
    store: DeepStore,
    state: Mutex<State>,
    wake: Condvar,
}

/// Threads that read the pages of a store; they end when their last user is dropped.
#[derive(Debug)]
pub(super) struct Readers {
    pages: Arc<Pages>,
}

/// Returns an identifier for a new page that is unique among the pages of all stores.
pub(super) fn new_id() -> u64 {
    static NEXT: AtomicU64 = AtomicU64::new(1);
    NEXT.fetch_add(1, Ordering::Relaxed)
}

impl Readers {
    pub(super) fn new(store: DeepStore) -> Self {
        let state = State {
            held: HashMap::new(),
            wants: HashMap::new(),
            limit: FIRST_LIMIT,
            statistics: DeepStatistics::default(),
            problem: None,
            damaged: HashSet::new(),
            delay: Duration::ZERO,
            is_closing: false,
        };
        let pages = Arc::new(Pages { store, state: Mutex::new(state), wake: Condvar::new() });
        for number in 0..READERS {
            let own = Arc::clone(&pages);
            let started = thread::Builder::new().name(format!("deep stars {number}")).spawn(move || own.serve());
            if let Err(error) = started {
                tracing::error!("cannot start a thread that reads stars: {error}");
            }
        }
        Self { pages }
    }

    pub(super) fn pages(&self) -> &Pages {
        &self.pages
    }
}

impl Drop for Readers {
    fn drop(&mut self) {
        self.pages.state().is_closing = true;
        self.pages.wake.notify_all();
    }
}

impl Pages {
    pub(super) fn store(&self) -> &DeepStore {
        &self.store
    }

    /// Reads a page without keeping it.
    pub(super) fn read(&self, key: PageKey, epoch: &Epoch) -> Result<Page, DeepError> {
        Page::read(&self.store, key, epoch, new_id())
    }

    pub(super) fn held(&self, keys: &[PageKey]) -> Vec<Option<Arc<Page>>> {
        let now = Instant::now();
        let mut state = self.state();
        let mut page = |key: &PageKey| {
            let held = state.held.get_mut(key)?;
            held.used = now;
            Some(Arc::clone(&held.page))
        };
        keys.iter().map(&mut page).collect()
    }

    pub(super) fn ask(&self, epoch: &Epoch, wants: &[(PageKey, f64)]) {
        let now = Instant::now();
        let mut state = self.state();
        let State { held, wants: known, damaged, .. } = &mut *state;
        for (key, urgency) in wants {
            if held.get(key).is_none_or(|held| held.epoch != *epoch) && !damaged.contains(key) {
                known.insert(*key, Want { urgency: *urgency, epoch: *epoch, asked: now });
            }
        }
        let is_needed = !state.wants.is_empty();
        drop(state);
        if is_needed {
            self.wake.notify_all();
        }
    }

    pub(super) fn load(&self, epoch: &Epoch, keys: &[PageKey]) -> Result<(), DeepError> {
        let missing: Vec<PageKey> = {
            let mut state = self.state();
            // Avoid reading a page both here and in the background.
            state.wants.clear();
            let is_held = |key: &&PageKey| state.held.get(key).is_some_and(|held| held.epoch == *epoch);
            keys.iter().filter(|key| !is_held(key) && !state.damaged.contains(key)).copied().collect()
        };
        let pages: Vec<(PageKey, Result<Page, DeepError>)> =
            missing.par_iter().map(|key| (*key, self.read(*key, epoch))).collect();
        let mut state = self.state();
        let mut first = Ok(());
        for (key, page) in pages {
            match page {
                Ok(page) => state.keep(page, epoch),
                Err(error) => {
                    state.note(key, &error);
                    first = first.and(Err(error));
                }
            }
        }
        state.make_room();
        first
    }

    pub(super) fn set_limit(&self, bytes: u64) {
        let mut state = self.state();
        if state.limit != bytes {
            state.limit = bytes;
            state.make_room();
        }
    }

    pub(super) fn statistics(&self) -> DeepStatistics {
        self.state().statistics
    }

    pub(super) fn problem(&self) -> Option<String> {
        self.state().problem.clone()
    }

    pub(super) fn set_delay(&self, delay: Duration) {
        self.state().delay = delay;
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Reads requested pages until the last user is dropped.
    fn serve(&self) {
        loop {
            let taken = {
                let mut state = self.state();
                loop {
                    if state.is_closing {
                        return;
                    }
                    let taken = state.take();
                    if !taken.is_empty() {
                        break taken;
                    }
                    state = self.wake.wait(state).unwrap_or_else(PoisonError::into_inner);
                }
            };
            for (key, want) in taken {
                let delay = self.state().delay;
                if delay > Duration::ZERO {
                    thread::sleep(delay);
                }
                let read = self.read(key, &want.epoch);
                let mut state = self.state();
                match read {
                    Ok(page) => {
                        state.keep(page, &want.epoch);
                        state.make_room();
                    }
                    Err(error) => state.note(key, &error),
                }
            }
        }
    }
}

impl State {
    /// Removes the most urgent requests from the list and returns them; drops requests that were not renewed.
    fn take(&mut self) -> Vec<(PageKey, Want)> {
        self.wants.retain(|_, want| want.asked.elapsed() < FORGOTTEN_AFTER);
        let mut wants: Vec<(PageKey, Want)> = self.wants.iter().map(|(key, want)| (*key, *want)).collect();
        let order = |a: &(PageKey, Want), b: &(PageKey, Want)| b.1.urgency.total_cmp(&a.1.urgency).then(a.0.cmp(&b.0));
        if wants.len() > TAKEN_AT_ONCE {
            wants.select_nth_unstable_by(TAKEN_AT_ONCE - 1, order);
            wants.truncate(TAKEN_AT_ONCE);
        }
        wants.sort_by(order);
        for (key, _) in &wants {
            self.wants.remove(key);
        }
        wants
    }

    /// Records that a page cannot be read, so that it is not tried again.
    fn note(&mut self, key: PageKey, error: &DeepError) {
        tracing::error!("stars cannot be read: {error}");
        self.damaged.insert(key);
        self.problem.get_or_insert_with(|| error.to_string());
    }

    fn keep(&mut self, page: Page, epoch: &Epoch) {
        let bytes = page.bytes();
        self.statistics.pages_read += 1;
        self.statistics.bytes_read += page.file_bytes();
        let held = Held { epoch: *epoch, used: Instant::now(), page: Arc::new(page) };
        let before = self.held.insert(held.page.key, held);
        self.statistics.bytes = self.statistics.bytes + bytes - before.map_or(0, |held| held.page.bytes());
    }

    /// Removes the least recently used pages until the rest fits. Pages that were used a moment ago stay.
    fn make_room(&mut self) {
        if self.statistics.bytes <= self.limit {
            return;
        }
        let mut oldest: Vec<(Instant, PageKey)> = self.held.iter().map(|(key, held)| (held.used, *key)).collect();
        oldest.sort_unstable();
        for (used, key) in oldest {
            // Free a little more than necessary, so that not every new page starts another search.
            if self.statistics.bytes <= self.limit - self.limit / 8 || used.elapsed() < KEPT_FOR {
                break;
            }
            if let Some(held) = self.held.remove(&key) {
                self.statistics.bytes -= held.page.bytes();
            }
        }
    }
}
