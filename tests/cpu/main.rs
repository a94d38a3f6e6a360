//! What needs no adapter: twins in f64 against closed forms, configurations, catalogues, shaders as text, and the order of modules.
#![allow(clippy::unwrap_used, reason = "what must not happen in a test may panic")]

use testkit as common;
use testkit::spk;

mod apparent_places;
mod bodies;
mod configuration;
mod dome_check;
mod kernels;
mod layering;
mod overlay;
mod psf;
mod shaders;
mod sky;
mod stars;
mod theatre;
