//! Refraction by the air over an observer: G. G. Bennett, "The calculation of astronomical refraction in marine navigation", Journal of Navigation 35, 255, 1982, with the second
//! term that brings it within 0.9 arcsec of the Nautical Almanac's at all altitudes above the horizon.

/// The air at an observer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RefractingAir {
    /// Pressure, hPa; 0: there is none.
    pub pressure_hpa: f64,
    /// Temperature, degrees Celsius.
    pub temperature_c: f64,
}

/// Below this altitude, rad, refraction fades away: nothing is seen there.
const LOWEST_RAD: f64 = -0.02;
/// Over so many radians.
const FADING_RAD: f64 = 0.05;

impl RefractingAir {
    /// What is added to the altitude without air, rad, where `seen_rad` is that with air.
    pub fn refraction_of_seen_rad(&self, seen_rad: f64) -> f64 {
        let lowest = seen_rad.max(LOWEST_RAD).to_degrees();
        let first = 1.0 / (lowest + 7.31 / (lowest + 4.4)).to_radians().tan();
        let arcmin = first - 0.06 * (14.7 * first + 13.0).to_radians().sin();
        let density = self.pressure_hpa / 1010.0 * 283.0 / (273.0 + self.temperature_c);
        let fading = ((seen_rad - LOWEST_RAD) / FADING_RAD + 1.0).clamp(0.0, 1.0);
        density * (arcmin / 60.0).to_radians() * fading
    }

    /// What is added to an altitude without air, rad.
    pub fn refraction_rad(&self, altitude_rad: f64) -> f64 {
        let mut refraction = 0.0;
        for _ in 0..8 {
            refraction = self.refraction_of_seen_rad(altitude_rad + refraction);
        }
        refraction
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Mean refraction of the Nautical Almanac (1010 hPa, 10 degrees Celsius): apparent altitude, degrees, and arcminutes.
    const ALMANAC: [[f64; 2]; 8] =
        [[0.0, 34.5], [1.0, 24.4], [5.0, 9.9], [10.0, 5.3], [15.0, 3.57], [30.0, 1.68], [45.0, 0.97], [75.0, 0.26]];

    #[test]
    fn refraction_is_that_of_the_almanac_and_forward_undoes_backward() {
        let air = RefractingAir { pressure_hpa: 1010.0, temperature_c: 10.0 };
        for [degrees, arcmin] in ALMANAC {
            let seen_rad = degrees.to_radians();
            let found = air.refraction_of_seen_rad(seen_rad).to_degrees() * 60.0;
            assert!((found - arcmin).abs() < 0.05 + 0.002 * arcmin, "{degrees}: {found}");
            let true_rad = seen_rad - air.refraction_of_seen_rad(seen_rad);
            assert!((true_rad + air.refraction_rad(true_rad) - seen_rad).abs() < 1e-6, "{degrees}");
        }
        assert_eq!(RefractingAir { pressure_hpa: 0.0, temperature_c: 10.0 }.refraction_rad(0.3), 0.0);
    }
}
