//! Photometry: conversion of magnitude and temperature to light, and its distribution over pixels.
//!
//! - `atmosphere` and `sky_light`: the air above an observer
//! - `cie1931` and `rec709`: colorimetric standards
//! - `blackbody`: colours from temperatures
//! - `kernel`: distribution of a star's light over pixels
//! - `psf`: pictures of a star formed by optics
//! - `star_image`: the image of a sprite
//! - `reflection`: reflection laws of surfaces
//! - `phase_curve`: measured brightness of planets
//! - `rings`: light and opacity of Saturn's rings
//! - `corona`: the corona of the Sun
//! - `glare`: fall-off of scattered light
//! - `exposure`: luminance of display white
//! - `tone_map`: display values from luminance

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
