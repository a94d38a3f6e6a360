//! Proper motion of stars along straight lines in space. A star without a known distance is treated as if its radial
//! velocity were 0.

use glam::{DVec3, Vec3};

use super::StarRecord;
use crate::units::ARCSECOND_RAD;

/// One astronomical unit per year in km/s: the speed of 1 arcsec per year at 1 pc.
const KM_S_PER_AU_A: f64 = 4.740_470_446_352;

/// One parsec per Julian year in km/s.
const KM_S_PER_PC_A: f64 = KM_S_PER_AU_A / ARCSECOND_RAD;

/// A star's motion, in the units of catalogues.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StarMotion {
    /// Proper motion in right ascension times the cosine of the declination, arcsec per Julian year.
    pub pm_ra_arcsec: f64,
    /// Proper motion in declination, arcsec per Julian year.
    pub pm_dec_arcsec: f64,
    /// Radial velocity, km/s, positive away from the observer; 0 if unknown.
    pub radial_velocity_km_s: f64,
}

/// Velocity of a star in a list.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StarVelocity {
    /// Index of the star.
    pub star: u32,
    /// Velocity along the ICRS axes, pc per Julian year; for a star at infinity, radians per Julian year.
    pub velocity: [f32; 3],
}

impl StarVelocity {
    /// Moves the star for `years` Julian years.
    pub fn apply(&self, star: &mut StarRecord, years: f64) {
        let moved = star.position + Vec3::from_array(self.velocity).as_dvec3() * years;
        star.position = if star.distance_known { moved } else { moved.normalize_or(star.position) };
    }
}

/// Returns a function that gives the velocity of a star by its index. The velocities must be sorted by star, and the function must be called for
/// every index in ascending order.
pub fn velocity_by_star(velocities: &[StarVelocity]) -> impl FnMut(usize) -> Option<[f32; 3]> {
    let mut rest = velocities.iter().peekable();
    move |index| rest.next_if(|velocity| velocity.star as usize == index).map(|velocity| velocity.velocity)
}

/// Unit vectors to the east and to the north of a direction.
fn east_and_north(direction: DVec3) -> [DVec3; 2] {
    let east = DVec3::new(-direction.y, direction.x, 0.0).try_normalize().unwrap_or(DVec3::Y);
    [east, direction.cross(east)]
}

impl StarMotion {
    /// Inverse of [`Self::velocity`]; the radial velocity of a star without a distance is 0.
    pub fn from_velocity(velocity: DVec3, direction: DVec3, distance_pc: Option<f64>) -> Self {
        let [pm_ra_arcsec, pm_dec_arcsec] =
            east_and_north(direction).map(|axis| velocity.dot(axis) / distance_pc.unwrap_or(1.0) / ARCSECOND_RAD);
        let radial_velocity_km_s = distance_pc.map_or(0.0, |_| velocity.dot(direction) * KM_S_PER_PC_A);
        Self { pm_ra_arcsec, pm_dec_arcsec, radial_velocity_km_s }
    }

    /// Velocity of the star's position, pc per Julian year. Without a distance, it is the velocity of the end of the unit vector, radians per Julian
    /// year. The velocity is constant, because stars move along straight lines.
    pub fn velocity(&self, direction: DVec3, distance_pc: Option<f64>) -> DVec3 {
        let [east, north] = east_and_north(direction);
        let turning = (east * self.pm_ra_arcsec + north * self.pm_dec_arcsec) * ARCSECOND_RAD;
        let Some(distance_pc) = distance_pc else { return turning };
        turning * distance_pc + direction * (self.radial_velocity_km_s / KM_S_PER_AU_A * ARCSECOND_RAD)
    }

    /// Returns the position after `years` Julian years, pc, or a unit vector if the distance is unknown. `direction` is the unit vector to the star's
    /// initial position, ICRS axes.
    pub fn after(&self, direction: DVec3, distance_pc: Option<f64>, years: f64) -> DVec3 {
        let moved = direction * distance_pc.unwrap_or(1.0) + self.velocity(direction, distance_pc) * years;
        if distance_pc.is_some() { moved } else { moved.normalize() }
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
        // 4.74 km/s is one astronomical unit per year: 1 arcsec per year at 1 pc.
        let away = StarMotion { radial_velocity_km_s: KM_S_PER_AU_A, ..StarMotion::default() };
        let moved_pc = away.after(start, Some(2.0), 100.0).length() - 2.0;
        assert!((moved_pc / (100.0 * ARCSECOND_RAD) - 1.0).abs() < 1e-9, "{moved_pc}");
        // A motion is recovered from its velocity.
        let motion = StarMotion { radial_velocity_km_s: 30.0, ..motion };
        for (distance_pc, radial_velocity_km_s) in [(Some(7.0), 30.0), (None, 0.0)] {
            let found = StarMotion::from_velocity(motion.velocity(start, distance_pc), start, distance_pc);
            let off = [
                found.pm_ra_arcsec - motion.pm_ra_arcsec,
                found.pm_dec_arcsec - motion.pm_dec_arcsec,
                found.radial_velocity_km_s - radial_velocity_km_s,
            ];
            assert!(off.iter().all(|off| off.abs() < 1e-9), "{found:?}");
        }
        // East is also defined at a pole.
        assert!(motion.after(DVec3::Z, Some(1.0), 1.0).is_finite());
    }
}
