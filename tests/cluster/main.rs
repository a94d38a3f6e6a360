//! Clusters of processes on this machine: a director and nodes of the built program, over Zenoh. Tests never assert measured times.
#![allow(clippy::unwrap_used, reason = "a test may panic on unexpected values")]

mod certificates;
mod processes;
mod refusals;
mod shows;
