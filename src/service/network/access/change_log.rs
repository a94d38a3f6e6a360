//! The log of changes: the caller, the changed parts, and the revisions before and after. Lines have the target
//! `steradian::changes`.

use std::time::{Duration, Instant};

use tonic::{Request, Status};

use super::Caller;
use crate::service::network::clients::ClientInfo;

/// Target of the lines.
const TARGET: &str = "steradian::changes";
/// Maximum number of changed parts in a line.
const MOST_PARTS: usize = 16;
/// The camera poses that a client sends within this time share a line.
const MOVES: Duration = Duration::from_secs(60);

/// The caller of a change.
#[derive(Clone, Debug)]
pub(crate) struct By {
    caller: Caller,
    client: ClientInfo,
}

impl By {
    /// Returns the caller of a request.
    ///
    /// # Errors
    ///
    /// The request did not come through the daemon's port.
    pub(crate) fn from_request<T>(request: &Request<T>) -> Result<Self, Status> {
        Ok(Self { caller: Caller::from_request(request)?, client: ClientInfo::from_request(request)? })
    }

    /// Returns a text that names the client, for the log and for holders of a lease.
    pub(crate) fn client(&self) -> &ClientInfo {
        &self.client
    }

    /// Logs a change that led to a revision.
    pub(crate) fn changed(&self, call: &str, parts: &[String], to: u64) {
        let (first, rest) = parts.split_at(parts.len().min(MOST_PARTS));
        let more = if rest.is_empty() { String::new() } else { format!(" and {} more", rest.len()) };
        let parts = if first.is_empty() { String::new() } else { format!(" of {}{more}", first.join(", ")) };
        self.line(&format!("{call}{parts}: revision {} to {to}", to.saturating_sub(1)));
    }

    /// Logs another event.
    pub(crate) fn did(&self, what: &str) {
        self.line(what);
    }

    /// Logs a camera pose that led to a revision.
    pub(crate) fn moved(&self, to: u64) {
        if let Some(moves) = self.client.note_move(to, Instant::now()) {
            self.line(&moves.in_words());
        }
    }

    fn line(&self, what: &str) {
        tracing::info!(target: TARGET, by = &*self.caller.name, client = self.client.name(), "{what}");
    }
}

/// Camera poses of a client that share a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Moves {
    from: u64,
    to: u64,
    count: u64,
    since: Instant,
}

impl Moves {
    /// Adds a pose; returns the line that is due.
    pub(crate) fn note(moves: &mut Option<Self>, to: u64, now: Instant) -> Option<Self> {
        let before = moves.filter(|moves| now.saturating_duration_since(moves.since) >= MOVES);
        let begins = moves.is_none() || before.is_some();
        let new = Self { from: to.saturating_sub(1), to, count: 1, since: now };
        match moves {
            Some(moves) if !begins => {
                (moves.to, moves.count) = (to, moves.count + 1);
                None
            }
            // The first pose is logged at once.
            None => {
                *moves = Some(Self { count: 0, from: to, ..new });
                Some(new)
            }
            Some(_) => {
                *moves = Some(new);
                before.filter(|before| before.count > 0)
            }
        }
    }

    /// Returns the poses that are not logged yet.
    pub(crate) fn rest(self) -> Option<Self> {
        Some(self).filter(|moves| moves.count > 0)
    }

    pub(crate) fn in_words(&self) -> String {
        format!("SetCamera, {} poses: revision {} to {} of the camera", self.count, self.from, self.to)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_pose_is_logged_once_and_lines_are_a_minute_apart() {
        let begin = Instant::now();
        let mut moves = None;
        let mut lines = Vec::new();
        for step in 0..2500_u32 {
            let now = begin + Duration::from_millis(60 * u64::from(step));
            lines.extend(Moves::note(&mut moves, 11 + u64::from(step), now).map(|line| (step, line)));
        }
        lines.extend(moves.and_then(Moves::rest).map(|line| (2500, line)));
        assert_eq!(lines.iter().map(|(step, _)| *step).collect::<Vec<_>>(), [0, 1000, 2000, 2500]);
        assert_eq!(lines.iter().map(|(_, line)| line.count).sum::<u64>(), 2500);
        for pair in lines.windows(2) {
            assert_eq!(pair[1].1.from, pair[0].1.to, "lines cover consecutive revisions");
        }
        assert_eq!(lines[0].1.in_words(), "SetCamera, 1 poses: revision 10 to 11 of the camera");
    }
}
