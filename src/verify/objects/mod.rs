//! Bodies and asteroids: their light, their outlines, what they hide, and what stands in for their meshes.
//!
//! Truth of an asteroid is its finest mesh, drawn with 4 x 4 samples a pixel; of a body's light the integral over its disc in f64
//! ([`crate::plan::bodies::light`]). What impostors, levels of detail and points may differ by follows from the half pixel that the
//! plan keeps. The settings say what is under test: `asteroids.impostor`, `asteroids.quality` and the others.

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
