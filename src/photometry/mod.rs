//! Photometry: from magnitude and temperature to light, and how that light is spread over pixels.

pub mod kernel;
//! Photometry: from magnitude and temperature to light.

pub mod colour_index;
