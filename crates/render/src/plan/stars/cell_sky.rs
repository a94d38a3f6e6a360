//! The numbers of the procedural sky, which its shader and its twin in f64 take from here.

/// A star's place lies within this part of the cell's half side from the cell's middle.
pub const JITTER: f64 = 0.5;
/// Faintest star; the brightest is 1, and the numbers fall as brightness^-2.5.
pub const FAINTEST: f64 = 0.02;
/// Share of the cells that have a star far from the galactic equator, where all have one.
pub const EVEN_DENSITY: f64 = 0.25;
/// Sine of the latitude at which the band has sunk to 1/e.
pub const BAND_SINE: f64 = 0.2;
