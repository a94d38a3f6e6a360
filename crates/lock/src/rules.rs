//! Rules that the director and all nodes share: number of nodes, times, and the policy at the deadline of a frame.

use std::{error::Error, fmt};

use crate::messages::MAX_NODES;

/// Number of consecutive frames with READY after which a node takes part again, beginning with the next frame. The proof in [`crate::director`] needs
/// at least 3.
pub const READY_UNTIL_IN: u8 = 3;

/// Policy at the deadline of a frame if a node that takes part is not READY.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Policy {
    /// The frame is skipped for all: no node that takes part ever shows a newer frame than another one.
    Together,
    /// The frame is committed for the nodes that are READY; the others keep their last frame.
    Apart,
}

/// All times are in nanoseconds of monotonic clocks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Rules {
    /// Number of configured nodes. More than half of them must be READY for a COMMIT.
    pub nodes: u16,
    /// Time between two frames.
    pub period_ns: u64,
    /// Time from the tick of a frame to its verdict, at most one period.
    pub deadline_ns: u64,
    /// Time from the deadline to presentation. It leaves time for a COMMIT that is repeated or retransmitted.
    pub lead_ns: u64,
    /// Policy at the deadline.
    pub policy: Policy,
    /// Number of consecutive frames without READY after which a node is left out, at least 1.
    pub misses_until_out: u8,
    /// Time for which a director waits for all nodes before it starts with more than half of them.
    pub gather_ns: u64,
    /// Time for which a started director skips frames until all nodes are READY, before it starts with more than half of them. It must be long if
    /// nodes compute tables before their first frame.
    pub start_ns: u64,
    /// Time between two HELLO messages of a node.
    pub hello_ns: u64,
    /// Time without a message after which a node looks for a director.
    pub silence_ns: u64,
    /// Time without a new frame after which a node shows black or a logo.
    pub hold_ns: u64,
}

const MS: u64 = 1_000_000;

impl Rules {
    /// Default rules for a number of nodes and a frame rate. The policy is `together`, nodes are left out after three misses, and the deadline is
    /// three quarters of a period. The lead is 33 ms, within which all of 1,200 measured COMMITs arrived at 1 % loss.
    ///
    /// # Errors
    ///
    /// As [`Rules::checked`].
    pub fn at_hertz(nodes: u16, hertz: f64) -> Result<Self, RulesError> {
        if !(1.0..=1000.0).contains(&hertz) {
            return Err(RulesError::Hertz(hertz));
        }
        let period_ns = (1e9 / hertz).round() as u64;
        let rules = Self {
            nodes,
            period_ns,
            deadline_ns: period_ns / 4 * 3,
            lead_ns: 33 * MS,
            policy: Policy::Together,
            misses_until_out: 3,
            gather_ns: 5_000 * MS,
            start_ns: 5_000 * MS,
            hello_ns: 100 * MS,
            silence_ns: 1_000 * MS,
            hold_ns: 5_000 * MS,
        };
        rules.checked()
    }

    /// Returns these rules if they are valid.
    ///
    /// # Errors
    ///
    /// The number of nodes is outside 1 to [`MAX_NODES`], the deadline is 0 or longer than a period, the lead is longer than a second, or a time or
    /// the number of misses is 0.
    pub fn checked(self) -> Result<Self, RulesError> {
        if self.nodes == 0 || self.nodes > MAX_NODES {
            return Err(RulesError::Nodes(self.nodes));
        }
        if self.deadline_ns == 0 || self.deadline_ns > self.period_ns {
            return Err(RulesError::Deadline { deadline_ns: self.deadline_ns, period_ns: self.period_ns });
        }
        if self.lead_ns > 1_000 * MS {
            return Err(RulesError::Lead(self.lead_ns));
        }
        if self.hello_ns == 0 || self.silence_ns == 0 || self.hold_ns == 0 {
            return Err(RulesError::Zero);
        }
        if self.misses_until_out == 0 {
            return Err(RulesError::NoMisses);
        }
        Ok(self)
    }

    /// Whether this number of nodes is more than half of the configured ones. Two such sets always share a node.
    pub fn is_quorum(&self, count: usize) -> bool {
        2 * count > usize::from(self.nodes)
    }

    /// Time from the tick of a frame to its presentation.
    pub fn ahead_ns(&self) -> u64 {
        self.deadline_ns + self.lead_ns
    }

    /// Number of pictures that a node keeps besides the one that it shows: those that wait for a verdict or for their time, and one to draw into.
    pub fn pictures(&self) -> usize {
        usize::try_from(self.ahead_ns().div_ceil(self.period_ns)).unwrap_or(usize::MAX).saturating_add(1)
    }
}

/// Reason why rules are invalid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum RulesError {
    /// The number of nodes is out of range.
    Nodes(u16),
    /// This frame rate.
    Hertz(f64),
    /// The deadline is 0 or longer than a period.
    #[allow(missing_docs, reason = "the names of the keys")]
    Deadline { deadline_ns: u64, period_ns: u64 },
    /// This lead, ns.
    Lead(u64),
    /// A time is 0.
    Zero,
    /// The number of misses is 0: a node would be left out although it is READY.
    NoMisses,
}

impl fmt::Display for RulesError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Nodes(nodes) => write!(f, "{nodes} nodes: must be between 1 and {MAX_NODES}"),
            Self::Hertz(hertz) => write!(f, "{hertz} frames per second: must be between 1 and 1000"),
            Self::Deadline { deadline_ns, period_ns } => {
                write!(f, "a deadline of {deadline_ns} ns: must be above 0 and at most the period, {period_ns} ns")
            }
            Self::Lead(lead_ns) => write!(f, "a lead of {lead_ns} ns: must be at most a second"),
            Self::Zero => write!(f, "times of HELLO, silence and hold must be above 0"),
            Self::NoMisses => write!(f, "0 misses until a node is left out: must be at least 1"),
        }
    }
}

impl Error for RulesError {}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rules_that_cannot_hold_are_refused() {
        let good = Rules::at_hertz(6, 60.0).unwrap();
        assert_eq!(good.pictures(), 4);
        assert!(Rules::at_hertz(0, 60.0).is_err() && Rules::at_hertz(MAX_NODES + 1, 60.0).is_err());
        assert!(Rules::at_hertz(6, 0.0).is_err() && Rules::at_hertz(6, f64::NAN).is_err());
        let wrong = [
            Rules { deadline_ns: 0, ..good },
            Rules { deadline_ns: good.period_ns + 1, ..good },
            Rules { lead_ns: 1_001 * MS, ..good },
            Rules { hello_ns: 0, ..good },
            Rules { silence_ns: 0, ..good },
            Rules { hold_ns: 0, ..good },
            Rules { misses_until_out: 0, ..good },
        ];
        for rules in wrong {
            let error = rules.checked().unwrap_err();
            assert!(!error.to_string().is_empty());
        }
    }

    #[test]
    fn two_quorums_share_a_node() {
        for nodes in 1..=MAX_NODES {
            let rules = Rules::at_hertz(nodes, 60.0).unwrap();
            let least = (1..=usize::from(nodes)).find(|&count| rules.is_quorum(count)).unwrap();
            assert!(2 * least > usize::from(nodes) && !rules.is_quorum(least - 1));
        }
        assert!(!Rules::at_hertz(6, 60.0).unwrap().is_quorum(3));
    }
}
