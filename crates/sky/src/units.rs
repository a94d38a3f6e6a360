//! Physical constants and unit conversions. Inside the crate angles are radians, lengths are metres or parsecs (as
//! named), illuminance is lux, luminance cd/m^2, solid angle steradian.

/// One parsec in metres (IAU 2015 resolution B2: 648000/pi astronomical units).
pub const PARSEC_M: f64 = 3.085_677_581_491_367e16;

/// One astronomical unit in metres (IAU 2012, resolution B2).
pub const ASTRONOMICAL_UNIT_M: f64 = 149_597_870_700.0;

/// Speed of light in vacuum, m/s.
pub const LIGHT_M_S: f64 = 299_792_458.0;

/// One day of civil time, s.
pub const DAY_S: f64 = 86_400.0;

/// The Julian date of J2000.0, 2000-01-01T12:00:00.
pub const J2000_JD: f64 = 2_451_545.0;

/// One Julian year, s.
pub const JULIAN_YEAR_S: f64 = 365.25 * DAY_S;

/// J2000.0 in s since 1970-01-01T00:00:00Z, in days of 86,400 s.
pub const J2000_UNIX_S: f64 = 946_728_000.0;

/// The Earth's rate of rotation, rad/s of UT1 (IERS Conventions 2010).
pub const EARTH_ROTATION_RAD_S: f64 = 7.292_115_146_7e-5;

/// 0 degrees Celsius, K.
pub const KELVIN_OF_ZERO_CELSIUS: f64 = 273.15;
/// One arcsecond in radians.
pub const ARCSECOND_RAD: f64 = std::f64::consts::PI / 648_000.0;

/// Luminance of a surface of 0 mag per square arcsecond, cd/m^2.
pub const LUMINANCE_0_MAG_PER_ARCSEC2: f64 = 10.8e4;

/// Illuminance of a star of apparent magnitude 0, lux: the surface brightness relation of
/// Schneegans et al. 2025, eqs. 1 and 2, times one square arcsecond.
pub const ILLUMINANCE_MAG_0_LX: f64 = LUMINANCE_0_MAG_PER_ARCSEC2 * ARCSECOND_RAD * ARCSECOND_RAD;

/// Temperature of stars with unknown colour: the Sun's nominal effective temperature (IAU 2015 B3), kelvin.
pub const SOLAR_TEMPERATURE_K: f32 = 5772.0;

/// Illuminance in lux of a star of apparent magnitude `v_mag`.
pub fn illuminance_lx_from_magnitude(v_mag: f64) -> f64 {
    ILLUMINANCE_MAG_0_LX * 10f64.powf(-0.4 * v_mag)
}

/// Luminance of a surface in V magnitudes per square arcsecond, cd/m^2.
pub fn luminance_from_mag_per_arcsec2(mag: f64) -> f64 {
    LUMINANCE_0_MAG_PER_ARCSEC2 * 10f64.powf(-0.4 * mag)
}

/// Apparent magnitude of a star with an illuminance of `illuminance_lx`.
pub fn magnitude_from_illuminance_lx(illuminance_lx: f64) -> f64 {
    -2.5 * (illuminance_lx / ILLUMINANCE_MAG_0_LX).log10()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn magnitude_zero_gives_the_published_illuminance() {
        assert!((ILLUMINANCE_MAG_0_LX / 2.53848e-6 - 1.0).abs() < 2e-6);
    }

    #[test]
    fn magnitude_and_illuminance_are_inverse() {
        for m in [-26.7, -1.46, 0.0, 6.0, 21.0] {
            assert!((magnitude_from_illuminance_lx(illuminance_lx_from_magnitude(m)) - m).abs() < 1e-12);
        }
    }
}
