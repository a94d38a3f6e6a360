//! Tests of the frame lock: single steps of both state machines, and whole clusters in the simulation of `sim`.
#![allow(clippy::unwrap_used, clippy::panic, reason = "a failed precondition of a test may panic")]

mod clusters;
mod model;
mod mutations;
mod random;
mod sim;
mod steps;
