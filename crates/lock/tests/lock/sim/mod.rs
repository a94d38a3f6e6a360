//! A discrete-event simulation of a cluster. It runs the state machines of the crate, with simulated processes, clocks and connections, and checks
//! what every node shows. Deterministic by its seed. Used by the tests and by the example `model`.

pub mod checker;
pub mod delays;
pub mod figures;
pub mod setup;
pub mod world;
