//! Photometry: from magnitude and temperature to light.

pub mod colour_index;
