//! Tests that need no adapter: of f64 twins (against closed forms), configurations, catalogues, shader sources, and the
//! order of modules.
#![allow(clippy::unwrap_used, reason = "tests may panic")]

use testkit as common;
use testkit::spk;

mod apparent_places;
mod architecture_picture;
mod bodies;
mod configuration;
mod dome_check;
mod instruction_counts;
mod kernels;
mod layering;
mod overlay;
mod platform;
mod psf;
mod shader_limits;
mod shader_translation;
mod shaders;
mod sky;
mod stars;
mod theatre;
mod theatre_edges;
mod theatre_formats;
