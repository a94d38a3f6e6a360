//! Photometry: from magnitude and temperature to light, and how that light is spread over pixels.

pub mod colour_index;
pub mod kernel;
