//! Photometry: from magnitude and temperature to light, and how that light is spread over pixels.
//!
//! `atmosphere` and `sky_light` are the air over an observer, `cie1931` and `rec709` hold the standards, `blackbody` turns temperatures into colours, `kernel` shares a star's light
//! among pixels, `psf` holds the pictures that optics make of a star, `star_image` the image of a sprite,
//! `reflection` says how surfaces throw light back, `phase_curve` how bright planets were measured, `rings` what Saturn's reflect and hide, `corona` what is around the Sun, `glare` how scattered light falls off, `exposure` chooses the luminance that is shown white, `tone_map` turns luminance into display values.

pub mod atmosphere;
pub mod blackbody;
pub mod cie1931;
pub mod colour_index;
pub mod corona;
pub mod exposure;
pub mod glare;
pub mod kernel;
pub mod phase_curve;
pub mod psf;
pub mod rec709;
pub mod reflection;
pub mod rings;
pub mod sky_light;
pub mod star_image;
pub mod tone_map;
