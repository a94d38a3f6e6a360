//! Light emitted by suns.

use std::f64::consts::PI;

use super::Emission;
use crate::{
    photometry::blackbody::rec709_in_gamut,
    units::{PARSEC_M, illuminance_lx_from_magnitude},
};

impl Emission {
    /// Returns the emission of a star with a given absolute V magnitude: a sphere of `radius_m` with the colour of a black body of `temperature_k`
    /// and linear limb darkening `limb_darkening`. Its light, summed over the disc, gives this magnitude at 10 parsecs. The star has no corona.
    pub fn of_star(absolute_magnitude: f64, temperature_k: f64, radius_m: f64, limb_darkening: f64) -> Self {
        let intensity_cd = illuminance_lx_from_magnitude(absolute_magnitude) * (10.0 * PARSEC_M).powi(2);
        let mean_cd_m2 = intensity_cd / (PI * radius_m * radius_m);
        let middle_cd_m2 =
            mean_cd_m2 / Self { luminance_cd_m2: [1.0; 3], limb_darkening, corona: false }.mean_over_middle();
        let luminance_cd_m2 = rec709_in_gamut(temperature_k).map(|channel| channel * middle_cd_m2);
        Self { luminance_cd_m2, limb_darkening, corona: false }
    }

    /// Mean luminance of the disc, which scales the corona, cd/m^2; `None` without a corona.
    pub fn corona_cd_m2(&self) -> Option<[f64; 3]> {
        self.corona.then(|| self.luminance_cd_m2.map(|channel| channel * self.mean_over_middle()))
    }

    /// Ratio of the mean luminance of a sphere's disc to the luminance at the centre: 1 - u / 3.
    pub fn mean_over_middle(&self) -> f64 {
        1.0 - self.limb_darkening / 3.0
    }

    /// Luminance for an eye at an angle from the normal, cd/m^2.
    pub fn luminance_at(&self, cos_e: f64) -> [f64; 3] {
        self.luminance_cd_m2.map(|channel| channel * (1.0 - self.limb_darkening * (1.0 - cos_e)))
    }
}
