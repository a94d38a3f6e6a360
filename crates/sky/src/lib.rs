//! The sky without a GPU: star catalogues and stores, ephemerides of the Solar System, observers on the Earth, and photometry.
//!
//! This crate is for programs that need positions, magnitudes or catalogues but draw nothing. Positions are f64 in ICRS axes, lengths in metres or
//! parsecs, angles in radians, illuminance in lux, luminance in cd/m²; names carry their unit.
//!
//! ```
//! use steradian_sky::{catalogue::bright::bright_stars, units::illuminance_lx_from_magnitude};
//!
//! let stars = bright_stars(0.0);
//! let total_lx: f64 = stars.iter().map(|star| illuminance_lx_from_magnitude(star.apparent_magnitude())).sum();
//! assert!(total_lx > 0.0);
//! ```

pub use glam;

#[macro_use]
mod names;
mod platform;

pub mod cache;
pub mod calendar;
pub mod coordinates;
#[doc(hidden)]
pub mod files;
mod fits;
pub mod memory_size;
mod once;
mod polynomial;
#[macro_use]
pub mod ranges;
pub mod sky_pictures;
pub mod solar_system;
pub mod units;

pub mod photometry;
#[doc(hidden)]
pub mod picture_file;

pub mod relativity;

pub mod catalogue;
pub mod ephemeris;

pub mod observer;
