//! What makes a display image of light.

mod exposure;
mod spot;
mod views;
mod wanted;
