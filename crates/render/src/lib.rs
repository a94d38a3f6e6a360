//! The multi-view renderer: scenes, views, plans, and the passes that draw them on an adapter, with the f64 twin of each pass.
//!
//! This crate is for programs that draw. Data flows in one direction: [`scene`] and [`view`] are planned by [`plan`] on the CPU, drawn by [`render`]
//! on an adapter ([`gpu`]), compared with [`reference`](mod@reference), and judged by [`metrics`]. Distances are in metres, angles in radians,
//! luminance in cd/m².

#[macro_use(named, settings)]
extern crate steradian_sky;

pub use glam;

// Modules of `steradian-sky`, so that `crate::photometry` names the same module in all crates.
pub(crate) use steradian_sky::{
    cache, calendar, catalogue, coordinates, ephemeris, files, memory_size, observer, photometry, picture_file, ranges,
    relativity, sky_pictures, solar_system, units,
};

mod platform;

pub mod scene;
pub mod view;

pub mod plan;

pub mod gpu;

pub mod metrics;

pub mod reference;

pub mod render;
