//! The log of changes: who changed what, from which revision to which. Lines have the target `steradian::changes`.

use std::time::{Duration, Instant};

use tonic::{Request, Status};

use super::Caller;
use crate::service::clients::ClientInfo;

/// What the lines are found by.
const TARGET: &str = "steradian::changes";
/// The parts of a change that are named.
const MOST_PARTS: usize = 16;
/// Poses of a client that come faster than this have one line together.
const MOVES: Duration = Duration::from_secs(1);

/// Who makes a change.
#[derive(Clone, Debug)]
pub(in crate::service) struct By {
    caller: Caller,
    client: ClientInfo,
}

impl By {
    /// Who makes a call.
    ///
    /// # Errors
    ///
    /// It did not come through the daemon's port.
    pub(in crate::service) fn of<T>(request: &Request<T>) -> Result<Self, Status> {
        Ok(Self { caller: Caller::of(request)?, client: ClientInfo::of(request)? })
    }

    /// For the log, and for those who wait for a lease.
    pub(in crate::service) fn client(&self) -> &ClientInfo {
        &self.client
    }

    /// What something was changed to from the revision before.
    pub(in crate::service) fn changed(&self, call: &str, parts: &[String], to: u64) {
        let (first, rest) = parts.split_at(parts.len().min(MOST_PARTS));
        let more = if rest.is_empty() { String::new() } else { format!(" and {} more", rest.len()) };
        let what = if first.is_empty() { String::new() } else { format!(" of {}{more}", first.join(", ")) };
        self.line(&format!("{call}{what}: revision {} to {to}", to.saturating_sub(1)));
    }

    /// Anything else.
    pub(in crate::service) fn did(&self, what: &str) {
        self.line(what);
    }

    /// A pose that brought the camera to a revision.
    pub(in crate::service) fn moved(&self, to: u64) {
        if let Some(moves) = self.client.note_move(to, Instant::now()) {
            self.line(&moves.in_words());
        }
    }

    fn line(&self, what: &str) {
        tracing::info!(target: TARGET, by = &*self.caller.name, client = self.client.name(), "{what}");
    }
}

/// Poses of a client that have one line together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::service) struct Moves {
    from: u64,
    to: u64,
    count: u64,
    since: Instant,
}

impl Moves {
    /// One pose more; the line that is due.
    pub(in crate::service) fn note(moves: &mut Option<Self>, to: u64, now: Instant) -> Option<Self> {
        let before = moves.filter(|moves| now.saturating_duration_since(moves.since) >= MOVES);
        let begins = moves.is_none() || before.is_some();
        let new = Self { from: to.saturating_sub(1), to, count: 1, since: now };
        match moves {
            Some(moves) if !begins => {
                (moves.to, moves.count) = (to, moves.count + 1);
                None
            }
            // The first of all has its line at once.
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

    /// What is left at the end.
    pub(in crate::service) fn rest(self) -> Option<Self> {
        Some(self).filter(|moves| moves.count > 0)
    }

    pub(in crate::service) fn in_words(&self) -> String {
        format!("SetCamera, {} poses: revision {} to {} of the camera", self.count, self.from, self.to)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_pose_is_in_one_line_and_lines_are_a_second_apart() {
        let begin = Instant::now();
        let mut moves = None;
        let mut lines = Vec::new();
        for step in 0..2500_u32 {
            let now = begin + Duration::from_millis(u64::from(step));
            lines.extend(Moves::note(&mut moves, 11 + u64::from(step), now).map(|line| (step, line)));
        }
        lines.extend(moves.and_then(Moves::rest).map(|line| (2500, line)));
        assert_eq!(lines.iter().map(|(step, _)| *step).collect::<Vec<_>>(), [0, 1000, 2000, 2500]);
        assert_eq!(lines.iter().map(|(_, line)| line.count).sum::<u64>(), 2500);
        for pair in lines.windows(2) {
            assert_eq!(pair[1].1.from, pair[0].1.to, "no revision is left out");
        }
        assert_eq!(lines[0].1.in_words(), "SetCamera, 1 poses: revision 10 to 11 of the camera");
    }
}
