//! Tests of the renderer on an adapter, one folder per technique. `cargo test --release --test gpu glare::` runs those of glare.
#![allow(clippy::unwrap_used, reason = "a test fails by a panic")]

use testkit as common;

mod air;
mod asteroids;
mod audit;
mod bodies;
mod chart;
mod diffuse;
mod display;
mod display_poses;
mod display_stability;
mod glare;
mod hdr_budget;
mod overlay;
mod pool;
mod prepare;
mod smooth_light;
mod solid_angle;
mod stars;
mod steady;
mod tabulated;
mod theatre;
mod verify;
