//! Bodies in a plan: what each viewport sees of them, and the light that they send there.

pub mod blocks;
pub mod light;
mod meeting;
pub mod seen;
pub mod textures;
