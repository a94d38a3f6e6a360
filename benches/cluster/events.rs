//! Reads the frames of directors and nodes from their logs.

use std::{collections::HashMap, error::Error, fs};

use crate::processes::Life;

/// Identifies a frame: counter and random number of its epoch, and its number.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct FrameName {
    pub epoch: (u64, u64),
    pub number: u64,
}

/// Verdict of a director on a frame.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// Number of nodes in the mask.
    Commit(usize),
    Skip(String),
}

/// Log entries of a director about one frame.
#[derive(Clone, Debug, Default)]
pub struct Frame {
    pub state_ns: Option<u64>,
    /// Node, time of its first READY, and duration of drawing.
    pub ready: Vec<(String, u64, u64)>,
    /// The first verdict, with its time.
    pub verdict: Option<(Verdict, u64)>,
}

/// A frame that a node has shown.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Shown {
    pub node: String,
    /// Index of the node's process.
    pub life: usize,
    pub frame: FrameName,
    pub at_ns: u64,
}

/// All events in the logs.
#[derive(Debug, Default)]
pub struct Events {
    pub frames: HashMap<FrameName, Frame>,
    /// Frames of one process are in the order of its log.
    pub shown: Vec<Shown>,
}

/// Parses the words of a log line that follow the kind of event: frame, time, and further words.
fn parts<'a>(words: &[&'a str]) -> Option<(FrameName, u64, Vec<&'a str>)> {
    let [epoch, number, "at", at_ns, rest @ ..] = words else { return None };
    let (counter, run) = epoch.split_once('.')?;
    let epoch = (counter.parse().ok()?, u64::from_str_radix(run, 16).ok()?);
    Some((FrameName { epoch, number: number.parse().ok()? }, at_ns.parse().ok()?, rest.to_vec()))
}

impl Events {
    /// Reads the logs of all processes.
    pub fn read(lives: &[Life]) -> Result<Self, Box<dyn Error>> {
        let mut events = Self::default();
        for (index, life) in lives.iter().enumerate() {
            let log = fs::read_to_string(&life.log)?;
            events.add(index, life.node.as_deref(), &log);
        }
        Ok(events)
    }

    fn add(&mut self, life: usize, node: Option<&str>, log: &str) {
        for line in log.lines() {
            let Some((_, line)) = line.split_once(" TRACE ") else { continue };
            let words: Vec<&str> = line.split_whitespace().collect();
            let Some((kind, Some((name, at_ns, rest)))) = words.split_first().map(|(kind, rest)| (*kind, parts(rest)))
            else {
                continue;
            };
            if kind == "shown" {
                let node = node.unwrap_or_default().to_owned();
                self.shown.push(Shown { node, life, frame: name, at_ns });
                continue;
            }
            let frame = self.frames.entry(name).or_default();
            match (kind, &rest[..]) {
                ("state", []) => {
                    frame.state_ns.get_or_insert(at_ns);
                }
                ("ready", [node, drawn_ns]) => {
                    let is_known = frame.ready.iter().any(|(known, ..)| known == node);
                    if let (Ok(drawn_ns), false) = (drawn_ns.parse(), is_known) {
                        frame.ready.push(((*node).to_owned(), at_ns, drawn_ns));
                    }
                }
                ("commit", [nodes]) => {
                    let nodes = nodes.parse().unwrap_or(0);
                    frame.verdict.get_or_insert((Verdict::Commit(nodes), at_ns));
                }
                ("skip", [why]) => {
                    frame.verdict.get_or_insert((Verdict::Skip((*why).to_owned()), at_ns));
                }
                _ => {}
            }
        }
    }

    /// Returns only the events within a time range.
    pub fn within(&self, from_ns: u64, until_ns: u64) -> Self {
        let is_in = |at_ns: u64| (from_ns..=until_ns).contains(&at_ns);
        let frames = self.frames.iter().filter(|(_, frame)| frame.state_ns.is_some_and(is_in));
        let frames: HashMap<FrameName, Frame> = frames.map(|(name, frame)| (*name, frame.clone())).collect();
        // A frame belongs to the range that contains its STATE, even if it was shown a little later.
        let belongs = |shown: &&Shown| match self.frames.get(&shown.frame) {
            Some(_) => frames.contains_key(&shown.frame),
            None => is_in(shown.at_ns),
        };
        let shown = self.shown.iter().filter(belongs).cloned().collect();
        Self { frames, shown }
    }

    /// Committed frames, in their order.
    pub fn committed(&self) -> Vec<(FrameName, &Frame, usize, u64)> {
        let committed = self.frames.iter().filter_map(|(name, frame)| match frame.verdict {
            Some((Verdict::Commit(nodes), at_ns)) => Some((*name, frame, nodes, at_ns)),
            _ => None,
        });
        let mut committed: Vec<_> = committed.collect();
        committed.sort_by_key(|(name, ..)| *name);
        committed
    }
}
