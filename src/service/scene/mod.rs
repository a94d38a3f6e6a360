//! The part of the scene that clients may change, in plain types. The render thread holds it; every change makes a new revision.

pub(crate) mod camera;
pub(crate) mod excerpts;
pub(crate) mod objects;
pub(crate) mod observer;
pub(crate) mod overlay;
pub(crate) mod state;
pub(crate) mod views;
