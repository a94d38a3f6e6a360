//! Twin of the pass of air and ground.

pub mod light;
