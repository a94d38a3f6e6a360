//! Bodies and asteroids: checks of their light, of their outlines, of occlusion, and of everything that replaces meshes.
//!
//! The truth of an asteroid is its finest mesh, drawn with 4 x 4 samples per pixel; the truth of a body's light is the
//! integral over its disc in f64 ([`crate::plan::bodies::light`]). The limits for impostors, levels of detail and
//! points follow from the half pixel that the plan guarantees. The settings select the methods under test:
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
