//! What makes a display image of light.

mod exposure;
mod wanted;
