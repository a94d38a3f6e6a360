//! Clusters of processes on this machine: a director and nodes of the built program, over Zenoh. No test asserts a time.
#![allow(clippy::unwrap_used, reason = "a test may panic on unexpected values")]

mod certificates;
mod processes;
mod refusals;
mod shows;
