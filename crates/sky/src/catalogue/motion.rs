//! Proper motion of stars along straight lines in space. A star without a known distance is treated as if its radial
//! velocity were 0.

use glam::DVec3;

use crate::units::ARCSECOND_RAD;

/// One astronomical unit per year in km/s: the speed of 1 arcsec a year at 1 pc.
const KM_S_PER_AU_A: f64 = 4.740_470_446_352;

/// A star's motion, in the units of catalogues.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StarMotion {
    /// Proper motion in right ascension times the cosine of the declination, arcsec a Julian year.
    pub pm_ra_arcsec: f64,
    /// Proper motion in declination, arcsec a Julian year.
    pub pm_dec_arcsec: f64,
    /// Radial velocity, km/s, positive away from the observer; 0 if unknown.
    pub radial_velocity_km_s: f64,
}

impl StarMotion {
    /// Returns the position after `years` Julian years, pc, or a unit vector if the distance is unknown. `direction`
    /// is the unit vector to the star's position before, ICRS axes.
    pub fn after(&self, direction: DVec3, distance_pc: Option<f64>, years: f64) -> DVec3 {
        let east = DVec3::new(-direction.y, direction.x, 0.0).try_normalize().unwrap_or(DVec3::Y);
        let north = direction.cross(east);
        let turned = direction + (east * self.pm_ra_arcsec + north * self.pm_dec_arcsec) * (ARCSECOND_RAD * years);
        let Some(distance_pc) = distance_pc else { return turned.normalize() };
        let au_per_year = self.radial_velocity_km_s / KM_S_PER_AU_A;
        turned * distance_pc + direction * (au_per_year * ARCSECOND_RAD * years)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::coordinates::{direction_from_lon_lat, lon_lat_from_direction};

    #[test]
    fn proper_motion_is_east_and_north_and_radial_velocity_away() {
        let start = direction_from_lon_lat(1.0, 0.5);
        let motion = StarMotion { pm_ra_arcsec: 0.3, pm_dec_arcsec: -0.4, radial_velocity_km_s: 0.0 };
        let (longitude, latitude) = lon_lat_from_direction(motion.after(start, None, 10.0));
        assert!(((longitude - 1.0) * 0.5_f64.cos() / ARCSECOND_RAD - 3.0).abs() < 1e-4);
        assert!(((latitude - 0.5) / ARCSECOND_RAD + 4.0).abs() < 1e-4);
        // 4.74 km/s is one astronomical unit a year: 1 arcsec a year at 1 pc.
        let away = StarMotion { radial_velocity_km_s: KM_S_PER_AU_A, ..StarMotion::default() };
        let moved_pc = away.after(start, Some(2.0), 100.0).length() - 2.0;
        assert!((moved_pc / (100.0 * ARCSECOND_RAD) - 1.0).abs() < 1e-9, "{moved_pc}");
        // East is defined at a pole too.
        assert!(motion.after(DVec3::Z, Some(1.0), 1.0).is_finite());
    }
}
