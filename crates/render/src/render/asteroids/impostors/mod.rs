//! Impostors of asteroids on the adapter.

pub(crate) mod atlas;
pub(crate) mod bake;
pub(crate) mod draw;
pub mod probe;
pub(crate) mod splat;
#[cfg(test)]
mod tests;
mod texels;
