//! Decides which stars of a deep store are bright stars, and which of them are duplicates.

use cdshealpix::nested;
use glam::{DVec3, Vec3};
use std::collections::HashMap;

use super::super::StarRecord;
use super::super::names::StarNames;
use crate::units::ARCSECOND_RAD;

/// Stars brighter than this V magnitude count as bright stars.
pub const BRIGHTER_THAN: f32 = 13.0;
/// Stars nearer than this distance, pc, count as bright stars.
pub const NEARER_THAN_PC: f64 = 100.0;
/// Stars with a larger proper motion than this, arcsec per Julian year, count as bright stars.
pub const FASTER_THAN_ARCSEC: f64 = 0.2;

/// Stars of a catalogue within this angle of a star of the built-in table, and within this difference in magnitude, are taken to be that star.
const SAME_WITHIN_RAD: f64 = 2.0 * ARCSECOND_RAD;
const SAME_WITHIN_MAG: f64 = 1.0;
/// HEALPix order of the cells in which such stars are searched: 3.4 arcminutes wide.
const SEARCH_ORDER: u8 = 10;

/// Proper motion of a star with a velocity as in [`StarVelocity`](super::super::motion::StarVelocity), arcsec per Julian year.
pub fn proper_motion_arcsec(star: &StarRecord, velocity: [f32; 3]) -> f64 {
    let velocity = Vec3::from_array(velocity).as_dvec3();
    let distance = star.position.length();
    let direction = star.position / distance;
    velocity.reject_from_normalized(direction).length() / distance / ARCSECOND_RAD
}

/// Whether a star of apparent magnitude `v_mag` belongs to the bright stars.
pub fn is_resident(star: &StarRecord, v_mag: f32, velocity: Option<[f32; 3]>) -> bool {
    v_mag < BRIGHTER_THAN
        || (star.distance_known && star.position.length() < NEARER_THAN_PC)
        || velocity.is_some_and(|velocity| proper_motion_arcsec(star, velocity) > FASTER_THAN_ARCSEC)
}

/// Names of bright stars are kept if they are brighter than this V magnitude, nearer than [`NAMED_NEARER_THAN_PC`], or have a proper name. The rule
/// depends on the star alone. It bounds the memory, because in Gaia's catalogue every star has a number.
pub const NAMED_BRIGHTER_THAN: f32 = 10.0;
/// See [`NAMED_BRIGHTER_THAN`], pc.
pub const NAMED_NEARER_THAN_PC: f64 = 25.0;

/// Whether the names of a bright star are kept.
pub fn keeps_names(star: &StarRecord, v_mag: f32, names: &StarNames) -> bool {
    v_mag < NAMED_BRIGHTER_THAN
        || (star.distance_known && star.position.length() < NAMED_NEARER_THAN_PC)
        || !names.name.is_empty()
}

/// Returns for each star whether it repeats one of `listed`: within 2" and one magnitude of it. Both lists must be at the same epoch.
pub fn listed_again<'a>(listed: &[StarRecord], stars: impl Iterator<Item = &'a StarRecord>) -> Vec<bool> {
    let cell = |direction: DVec3| {
        let (longitude, latitude) = crate::coordinates::lon_lat_from_direction(direction);
        nested::hash(SEARCH_ORDER, longitude.rem_euclid(std::f64::consts::TAU), latitude)
    };
    let mut cells: HashMap<u64, Vec<u32>> = HashMap::new();
    for (index, star) in listed.iter().enumerate() {
        let own = cell(star.position);
        cells.entry(own).or_default().push(index as u32);
        nested::neighbours(SEARCH_ORDER, own, false).values_vec().into_iter().for_each(|next| {
            cells.entry(next).or_default().push(index as u32);
        });
    }
    let is_same = |star: &StarRecord, other: &StarRecord| {
        let angle = star.position.normalize().cross(other.position.normalize()).length();
        // The cross product is also small for opposite directions.
        angle < SAME_WITHIN_RAD
            && star.position.dot(other.position) > 0.0
            && (star.apparent_magnitude() - other.apparent_magnitude()).abs() < SAME_WITHIN_MAG
    };
    let found = |star: &StarRecord| {
        cells
            .get(&cell(star.position))
            .is_some_and(|near| near.iter().any(|index| is_same(star, &listed[*index as usize])))
    };
    stars.map(found).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::catalogue::motion::StarMotion;

    fn star(position: DVec3, v: f64) -> StarRecord {
        let magnitude = (v - 5.0 * (position.length() / 10.0).log10()) as f32;
        StarRecord { position, magnitude, temperature_k: 5000.0, distance_known: true }
    }

    #[test]
    fn bright_near_and_fast_stars_are_resident() {
        let far = star(DVec3::new(300.0, 400.0, 0.0), 14.0);
        assert!(!is_resident(&far, 14.0, None));
        assert!(!is_resident(&far, 13.0, None));
        assert!(is_resident(&far, 12.999, None));
        assert!(is_resident(&star(DVec3::Y * 99.0, 18.0), 18.0, None));
        let motion = |pm_ra_arcsec: f64| {
            let motion = StarMotion { pm_ra_arcsec, pm_dec_arcsec: 0.0, radial_velocity_km_s: 300.0 };
            motion.velocity(far.position.normalize(), Some(500.0)).as_vec3().to_array()
        };
        assert!((proper_motion_arcsec(&far, motion(0.3)) - 0.3).abs() < 1e-6);
        assert!(is_resident(&far, 14.0, Some(motion(0.21))));
        assert!(!is_resident(&far, 14.0, Some(motion(0.19))));
    }

    #[test]
    fn stars_within_two_arcseconds_and_one_magnitude_are_listed_again() {
        let listed = [star(DVec3::new(0.3, -0.2, 0.8) * 50.0, 5.0), star(DVec3::Z * 20.0, 3.0)];
        let at = |arcsec: f64, v: f64| {
            let direction = listed[0].position.normalize();
            star((direction + direction.any_orthonormal_vector() * arcsec * ARCSECOND_RAD).normalize() * 52.0, v)
        };
        let stars =
            [at(1.9, 5.9), at(2.1, 5.0), at(0.0, 6.1), at(0.0, 3.9), star(DVec3::Z * 3.0, 3.1), star(-DVec3::Z, 3.0)];
        assert_eq!(listed_again(&listed, stars.iter()), [true, false, false, false, true, false]);
    }
}
