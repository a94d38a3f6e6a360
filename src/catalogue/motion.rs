//! Motion of stars: straight through space where parallax and radial velocity are known, along a great circle at a constant rate where they are not.

use glam::DVec3;

use crate::{coordinates::direction_from_lon_lat, units::ARCSECOND_RAD};

/// Kilometres per second that are one astronomical unit a year: 1 pc of distance and 1 arcsec a year.
const KM_S_PER_AU_A: f64 = 4.740_470_446_352;

/// A star at epoch J2000.0, as catalogues have it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CatalogueMotion {
    /// Right ascension and declination, ICRS, rad.
    pub ra_rad: f64,
    /// Declination, rad.
    pub dec_rad: f64,
    /// Proper motion in right ascension times the cosine of the declination, arcsec a Julian year.
    pub pm_ra_arcsec: f64,
    /// Proper motion in declination, arcsec a Julian year.
    pub pm_dec_arcsec: f64,
    /// Parallax, arcsec; 0 or less: unknown.
    pub parallax_arcsec: f64,
    /// Radial velocity, km/s, positive away; 0 where it is unknown.
    pub radial_velocity_km_s: f64,
}

impl CatalogueMotion {
    /// Place after some Julian years from J2000.0: parsecs from the barycentre where the parallax is known, a unit vector otherwise.
    pub fn at(&self, years: f64) -> DVec3 {
        let radial = direction_from_lon_lat(self.ra_rad, self.dec_rad);
        let east = DVec3::new(-self.ra_rad.sin(), self.ra_rad.cos(), 0.0);
        let north = radial.cross(east);
        let turning = (east * self.pm_ra_arcsec + north * self.pm_dec_arcsec) * ARCSECOND_RAD;
        if self.parallax_arcsec <= 0.0 {
            return (radial + turning * years).normalize();
        }
        let distance_pc = 1.0 / self.parallax_arcsec;
        let au_per_year = self.radial_velocity_km_s / KM_S_PER_AU_A;
        (radial + turning * years) * distance_pc + radial * (au_per_year * ARCSECOND_RAD * years)
    }
}
