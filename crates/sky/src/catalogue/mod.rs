//! Star catalogues: readers, generators, and the forms in which stars are stored.

pub mod bright;
pub mod chunks;
pub mod constellations;
pub mod deep;
pub mod diffuse;
pub mod epoch;
pub mod galaxy;
pub mod healpix;
pub mod motion;
pub mod names;
pub mod overlap;
pub mod packed;
pub mod reader;
pub mod spectra;
pub mod store;
pub mod variable;
pub mod zodiacal_light;

use glam::DVec3;

/// A star, as every reader and generator returns it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StarRecord {
    /// If `distance_known`: ICRS barycentric position in parsecs. Otherwise: unit vector towards the star, which is
    /// at infinity.
    pub position: DVec3,
    /// If `distance_known`: absolute V magnitude (at 10 pc). Otherwise: apparent V magnitude.
    pub magnitude: f32,
    /// Effective temperature in kelvin.
    pub temperature_k: f32,
    /// Whether `position` is a position in space (true) or a direction (false).
    pub distance_known: bool,
}

/// Apparent minus absolute magnitude of a star at this distance, without extinction.
pub fn distance_modulus(distance_pc: f64) -> f64 {
    5.0 * (distance_pc / 10.0).log10()
}

impl StarRecord {
    /// Apparent V magnitude as seen from the Solar-System barycentre.
    pub fn apparent_magnitude(&self) -> f64 {
        if self.distance_known {
            f64::from(self.magnitude) + distance_modulus(self.position.length())
        } else {
            f64::from(self.magnitude)
        }
    }
}
