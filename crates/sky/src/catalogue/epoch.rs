//! The time at which stars are placed, and the vantage from which they are seen.

use std::sync::Arc;

use glam::DVec3;
use rayon::prelude::*;

use super::{StarRecord, chunks::StarSet, store::records_of};
use crate::relativity::seen_direction;

/// Time, position and velocity for which stars are shown. The default is J2000.0, at rest at the barycentre.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Epoch {
    /// Julian years since J2000.0; stars with a known motion are moved by this time.
    pub years: f64,
    /// Position and velocity of the observer; `None`: at rest at the barycentre.
    pub seen_from: Option<Vantage>,
}

/// A position in the Solar System and its velocity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Vantage {
    /// Relative to the barycentre, ICRS axes, pc.
    pub position_pc: DVec3,
    /// Velocity in units of the speed of light, ICRS axes; below 1e-3.
    pub velocity_c: DVec3,
    /// Position of the camera while it shows this vantage's sky, pc. It is the position of the vantage at another time.
    pub origin_pc: DVec3,
}

impl Epoch {
    /// Returns a star as the vantage sees it; its own motion must already be applied. A camera at rest at the origin of the vantage then sees the
    /// star in its aberrated direction and with its brightness. The changes of brightness and colour with velocity, 4e-4 at 30 km/s, are neglected.
    pub fn seen(&self, star: StarRecord) -> StarRecord {
        StarRecord { position: self.seen_place(star.position, star.distance_known), ..star }
    }

    /// Position of a star as the vantage sees it; see [`Self::seen`]. `place` is in pc if the distance is known, else a unit vector.
    pub fn seen_place(&self, place: DVec3, distance_known: bool) -> DVec3 {
        let turned = |from: Vantage| turned(place, distance_known, from.position_pc, from.velocity_c, from.origin_pc);
        self.seen_from.map_or(place, turned)
    }

    /// Inverse of `seen`: returns the star that the vantage sees as `star`.
    fn unseen(&self, star: StarRecord) -> StarRecord {
        let turned = |from: Vantage| {
            turned(star.position, star.distance_known, from.origin_pc, -from.velocity_c, from.position_pc)
        };
        StarRecord { position: self.seen_from.map_or(star.position, turned), ..star }
    }
}

/// Moves the position of a star: a camera at `to_pc` then sees it in the direction and at the distance in which an observer at `from_pc` with
/// velocity `velocity_c` sees the original.
fn turned(place: DVec3, distance_known: bool, from_pc: DVec3, velocity_c: DVec3, to_pc: DVec3) -> DVec3 {
    let [from_pc, to_pc] = [from_pc, to_pc].map(|place_pc| if distance_known { place_pc } else { DVec3::ZERO });
    let place = place - from_pc;
    // A star exactly at the observer's position stays there.
    to_pc + seen_direction(velocity_c, place) * place.length()
}

/// Returns the stars as another vantage sees them; their own motion does not change.
#[must_use]
pub fn seen_from(set: &StarSet, vantage: Vantage) -> StarSet {
    let epoch = Epoch { seen_from: Some(vantage), ..set.epoch };
    let mut records = records_of(set);
    records.par_iter_mut().for_each(|record| *record = epoch.seen(set.epoch.unseen(*record)));
    // Diffuse light varies over degrees only, so it is not moved.
    let mut named = set.named_in_files().to_vec();
    named.iter_mut().for_each(|named| named.star = epoch.seen(set.epoch.unseen(named.star)));
    StarSet::from_records(records)
        .of_epoch(epoch)
        .with_names(named)
        .with_unresolved(set.unresolved.clone())
        .with_deep(set.deep.as_ref().map(|deep| Arc::new(deep.at_epoch(&epoch))))
        .with_variability_of(set)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::{ARCSECOND_RAD, ASTRONOMICAL_UNIT_M, PARSEC_M};

    const STAR: StarRecord = StarRecord {
        position: DVec3::new(0.0, 10.0, 0.0),
        magnitude: 3.0,
        temperature_k: 5000.0,
        distance_known: true,
    };

    #[test]
    fn aberration_shifts_stars_towards_the_velocity_and_keeps_their_distance() {
        let position_pc = DVec3::X * (ASTRONOMICAL_UNIT_M / PARSEC_M);
        let vantage = Vantage { position_pc, velocity_c: DVec3::X * 1e-4, origin_pc: position_pc };
        let epoch = Epoch { years: 0.0, seen_from: Some(vantage) };
        for star in [STAR, StarRecord { position: DVec3::Y, distance_known: false, ..STAR }] {
            let origin_pc = if star.distance_known { position_pc } else { DVec3::ZERO };
            let [before, after] = [star.position, epoch.seen(star).position].map(|place| place - origin_pc);
            assert!((after.length() / before.length() - 1.0).abs() < 1e-12);
            // 1e-4 rad, 20.6 arcsec, towards +x.
            let shift_arcsec = (after.normalize() - before.normalize()) / ARCSECOND_RAD;
            assert!((shift_arcsec - DVec3::X * 20.626).length() < 2e-3, "{shift_arcsec}");
        }
        assert_eq!(Epoch::default().seen(STAR), STAR);
    }

    #[test]
    fn a_change_of_vantage_equals_building_the_set_for_it() {
        let au_pc = ASTRONOMICAL_UNIT_M / PARSEC_M;
        let first = Vantage { position_pc: DVec3::X * au_pc, velocity_c: DVec3::Y * 1e-4, origin_pc: DVec3::X * au_pc };
        let second = Vantage { position_pc: DVec3::NEG_Z * au_pc, velocity_c: DVec3::X * -9e-5, ..first };
        let stars = [STAR, StarRecord { position: DVec3::Z, distance_known: false, ..STAR }];
        let [at_first, at_second] = [first, second].map(|vantage| Epoch { years: 3.0, seen_from: Some(vantage) });
        let set = StarSet::from_records(stars.map(|star| at_first.seen(star)).to_vec()).of_epoch(at_first);
        let moved = seen_from(&set, second);
        assert_eq!(moved.epoch, at_second);
        for (found, star) in records_of(&moved).iter().zip(records_of(&StarSet::from_records(stars.to_vec()))) {
            let expected = at_second.seen(star);
            let from =
                |star: &StarRecord| star.position - if star.distance_known { first.origin_pc } else { DVec3::ZERO };
            assert!(from(found).angle_between(from(&expected)) < 0.02 * ARCSECOND_RAD, "{found:?} {expected:?}");
        }
    }
}
