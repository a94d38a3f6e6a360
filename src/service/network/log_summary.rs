//! Lines of the log that clients can cause without having access. For each address and kind, the first line is written at once, and then at most one
//! line per second, which states the number of the others.

use std::{
    collections::{HashMap, hash_map::Entry},
    sync::{Arc, Mutex, PoisonError},
    time::Duration,
};

use tokio::{runtime::Handle, time::sleep};

/// Interval between the lines of an address and a kind.
const INTERVAL: Duration = Duration::from_secs(1);
/// Maximum number of pairs of address and kind that are counted separately; all others share one line per kind.
const MOST_APART: usize = 1024;
/// Address in the shared lines.
const OTHERS: &str = "others";

/// Kinds of lines.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Kind {
    /// A request was refused because of its host or its page.
    Misnamed,
    /// A caller has no access.
    Denied,
    /// A handshake failed.
    Handshake,
    /// A connection was closed by the daemon.
    Closed,
    /// A client disconnected.
    Disconnected,
}

impl Kind {
    fn write(self, client: &str, line: &str) {
        match self {
            Self::Denied => tracing::warn!(client, "{line}"),
            _ => tracing::info!(client, "{line}"),
        }
    }
}

/// Kind and address of lines that are counted together.
type Key = (Kind, Arc<str>);

/// Lines of one address and kind that were not written.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
struct Unwritten {
    count: u64,
    /// The last of these lines.
    last: String,
}

/// Number of lines of each kind and address in the last second.
#[derive(Debug, Default)]
pub(crate) struct LogSummary {
    unwritten: Mutex<HashMap<Key, Unwritten>>,
}

impl LogSummary {
    /// Counts a line; returns the key if the line is the first one and must be written.
    fn note(&self, kind: Kind, address: &str, line: &str) -> Option<Key> {
        // No code panics while it holds the lock, so the content is consistent even if the lock is poisoned.
        let mut all = self.unwritten.lock().unwrap_or_else(PoisonError::into_inner);
        let mut key: Key = (kind, address.into());
        if all.len() >= MOST_APART && !all.contains_key(&key) {
            key.1 = OTHERS.into();
        }
        match all.entry(key.clone()) {
            Entry::Vacant(free) => {
                free.insert(Unwritten::default());
                Some(key)
            }
            Entry::Occupied(counted) => {
                let counted = counted.into_mut();
                counted.count += 1;
                line.clone_into(&mut counted.last);
                None
            }
        }
    }

    /// Returns the lines since the last call. `None` if there were none; the next line is then a first one again.
    fn take(&self, key: &Key) -> Option<Unwritten> {
        let mut all = self.unwritten.lock().unwrap_or_else(PoisonError::into_inner);
        let counted = all.get_mut(key).map(std::mem::take).filter(|counted| counted.count > 0);
        if counted.is_none() {
            all.remove(key);
        }
        counted
    }

    /// Writes the first line of a kind and an address at once, and counts further lines. One line per second states their number.
    pub(crate) fn write(self: &Arc<Self>, kind: Kind, address: &str, client: &str, line: &str) {
        // Without a runtime the daemon has ended, and few connections are left.
        let Ok(runtime) = Handle::try_current() else { return kind.write(client, line) };
        let Some(key) = self.note(kind, address, line) else { return };
        kind.write(client, line);
        let summary = Arc::clone(self);
        runtime.spawn(async move {
            loop {
                sleep(INTERVAL).await;
                let Some(Unwritten { count, last }) = summary.take(&key) else { return };
                kind.write(&key.1, &format!("{count} more within a second, the last one: {last}"));
            }
        });
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic on unexpected values")]
mod tests {
    use super::*;

    #[test]
    fn the_first_line_is_written_and_others_are_counted_by_address_and_kind() {
        let summary = LogSummary::default();
        let first = summary.note(Kind::Denied, "192.0.2.1", "a").unwrap();
        for line in ["b", "c"] {
            assert_eq!(summary.note(Kind::Denied, "192.0.2.1", line), None);
        }
        let other = summary.note(Kind::Denied, "192.0.2.2", "d").unwrap();
        assert!(summary.note(Kind::Closed, "192.0.2.1", "e").is_some());
        assert_eq!(summary.take(&first), Some(Unwritten { count: 2, last: "c".to_owned() }));
        assert_eq!(summary.take(&other), None);
        // A second without a line: the next one is written at once.
        assert_eq!(summary.take(&first), None);
        assert!(summary.note(Kind::Denied, "192.0.2.1", "f").is_some());
    }

    #[test]
    fn many_addresses_share_a_line() {
        let summary = LogSummary::default();
        let written = (0..5000).filter(|number| summary.note(Kind::Closed, &number.to_string(), "a").is_some()).count();
        assert_eq!(written, MOST_APART + 1);
        let shared = (Kind::Closed, OTHERS.into());
        assert_eq!(summary.take(&shared).unwrap().count as usize, 5000 - MOST_APART - 1);
    }
}
