//! Bodies and asteroids: their light, their outlines, occlusion, and replacements of meshes.
//!
//! The truth of an asteroid is its finest mesh, drawn with 4 x 4 samples per pixel; the truth of a body's light is the
//! integral over its disc in f64 ([`crate::plan::bodies::light`]). The allowed difference of impostors, levels of
//! detail and points follows from the half pixel that the plan guarantees. The settings select the methods under test:
//! `asteroids.impostor`, `asteroids.quality` and others.

mod bodies;
mod fields;
mod head;
pub mod stage;
mod stereo;
mod tiles;
mod tumble;

pub use self::stage::Fault;
pub(super) use self::{
    bodies::{hides_stars, light as body_light, shrinks},
    fields::{light as asteroid_light, occlusion, seams},
    head::moves,
    stereo::in_stereo,
    tiles::tiles,
    tumble::tumbles,
};
