//! Stars near a direction, such as that of a pointer.

use glam::{DQuat, DVec3};

use super::cull::{CullSettings, SPLAT_MARGIN_PX, light_at, near_stars, visible_chunks};
use crate::{
    catalogue::{
        chunks::StarSet,
        deep::{DeepError, LAYERS},
        packed::{PackedStar, temperature_of_step_k},
    },
    observer::Refraction,
    relativity::Motion,
    scene::Camera,
    units::{PARSEC_M, illuminance_lx_from_magnitude},
    view::{
        Part, Viewport,
        projection::{Perspective, Projection},
    },
};

/// Maximum search radius, rad.
pub const MOST_RADIUS_RAD: f64 = 0.2;

/// Margin around the circle in which leaves are read: air and the position of the camera change directions by less than this.
const CIRCLE_MARGIN_RAD: f64 = 1e-3;

/// A star as a camera sees it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SeenStar {
    /// Unit vector of the apparent direction, ICRS axes.
    pub direction: DVec3,
    /// Angle from the search direction, rad.
    pub separation_rad: f64,
    /// Illuminance, lx.
    pub illuminance_lx: f64,
    /// Temperature at rest, K.
    pub temperature_k: f64,
    /// Position relative to the Solar System's barycentre, pc; a unit vector for a star of unknown distance.
    pub position: DVec3,
    /// Distance from the camera, pc; `None`: not known.
    pub distance_pc: Option<f64>,
}

/// Returns the brightest `most` stars of at least `faintest_lx` within an angle (rad, at most [`MOST_RADIUS_RAD`]) of a unit direction, in order of
/// decreasing brightness. Leaves of a deep store are read if they are needed.
///
/// # Errors
/// A leaf is damaged or cannot be read.
pub fn stars_near(
    set: &StarSet,
    (camera, refraction): (&Camera, Option<Refraction>),
    direction: DVec3,
    radius_rad: f64,
    faintest_lx: f64,
    most: usize,
) -> Result<Vec<SeenStar>, DeepError> {
    let radius_rad = radius_rad.min(MOST_RADIUS_RAD);
    let motion = Motion::new(camera.velocity_c);
    // A square picture that contains the circle; the stars in it are tested individually.
    let plane = Perspective::symmetric([8, 8], 2.0 * radius_rad.max(1e-6)).expect("a narrow square picture is valid");
    let everything = Viewport {
        view: 0,
        part: Part::Whole,
        projection: Projection::Perspective(plane),
        world_from_view: DQuat::from_rotation_arc(DVec3::NEG_Z, direction),
        eye_offset_m: DVec3::ZERO,
        viewing_circle_m: 0.0,
    };
    let cull = CullSettings { faintest_lx, enabled: true, motion, refraction, margin_px: SPLAT_MARGIN_PX };
    let camera_pc = camera.position_m / PARSEC_M;
    let mut found: Vec<SeenStar> = Vec::new();
    for visible in visible_chunks(set, camera_pc, &[everything], cull) {
        let chunk = &set.chunks[visible.chunk];
        let seen = |(place_pc, star): (DVec3, &PackedStar)| {
            let illuminance_lx = light_at(place_pc, star, motion);
            let seen = motion.map_or(place_pc, |motion| motion.seen(place_pc)).try_normalize()?;
            let seen = refraction.map_or(seen, |refraction| refraction.seen(seen));
            // For small angles, the sine is accurate, while the cosine is 1.
            let separation_rad = seen.cross(direction).length().atan2(seen.dot(direction));
            (illuminance_lx >= faintest_lx && separation_rad <= radius_rad).then(|| SeenStar {
                direction: seen,
                separation_rad,
                illuminance_lx,
                temperature_k: temperature_of_step_k(star.temperature_step()),
                position: if chunk.at_infinity { place_pc } else { place_pc + camera_pc },
                distance_pc: (!chunk.at_infinity).then(|| place_pc.length()),
            })
        };
        found.extend(near_stars(set, chunk, visible.origin_pc).take(visible.count as usize).filter_map(seen));
        // The result has at most the requested number of stars and does not depend on the order of the chunks.
        keep_brightest(&mut found, most);
    }
    let Some(deep) = &set.deep else { return Ok(found) };
    // Read layer by layer. A fainter layer is read only if it can still contribute, so that few leaves are read even for a wide circle.
    let arriving = refraction.map_or(direction, |refraction| refraction.arriving(direction));
    for (layer, of_layer) in LAYERS.iter().enumerate() {
        let brightest_lx = illuminance_lx_from_magnitude(of_layer.brightest_mag());
        let is_full = found.len() == most && found.last().is_some_and(|star| star.illuminance_lx >= brightest_lx);
        if is_full || brightest_lx < faintest_lx {
            break;
        }
        for key in deep.leaves_near(layer, arriving, radius_rad + CIRCLE_MARGIN_RAD) {
            let page = deep.read(key)?;
            found.extend(page.stars.iter().filter_map(|star| {
                let (towards, factor) = page.seen(star, camera_pc);
                let packed = star.packed();
                let illuminance_lx = packed.illuminance_at_1_pc_lx() * factor;
                let seen = towards.try_normalize()?;
                let seen = refraction.map_or(seen, |refraction| refraction.seen(seen));
                let separation_rad = seen.cross(direction).length().atan2(seen.dot(direction));
                let place_pc = towards / f64::from(star.parallax);
                (illuminance_lx >= faintest_lx && separation_rad <= radius_rad).then(|| SeenStar {
                    direction: seen,
                    separation_rad,
                    illuminance_lx,
                    temperature_k: temperature_of_step_k(packed.temperature_step()),
                    position: place_pc + camera_pc,
                    distance_pc: page.is_distance_known(star).then(|| place_pc.length()),
                })
            }));
            keep_brightest(&mut found, most);
        }
    }
    Ok(found)
}

/// Sorts by decreasing brightness, and keeps at most the requested number.
fn keep_brightest(found: &mut Vec<SeenStar>, most: usize) {
    found.sort_by(|a, b| b.illuminance_lx.total_cmp(&a.illuminance_lx));
    found.truncate(most);
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::*;
    use crate::{
        catalogue::bright::{bright_stars, named_bright_stars},
        units::magnitude_from_illuminance_lx,
    };

    #[test]
    fn named_stars_are_at_their_catalogue_positions_from_anywhere() {
        let set = StarSet::from_records(bright_stars(0.0));
        let far = Camera { position_m: DVec3::new(0.5, -0.2, 0.1) * PARSEC_M, ..Camera::default() };
        let fast = Camera { velocity_c: DVec3::new(0.3, 0.2, -0.4), ..Camera::default() };
        for camera in [Camera::default(), far, fast] {
            for named in named_bright_stars(0.0).iter().filter(|named| named.star.distance_known) {
                let place = named.star.position - camera.position_m / PARSEC_M;
                let seen = Motion::new(camera.velocity_c).map_or(place, |motion| motion.seen(place)).normalize();
                let found = stars_near(&set, (&camera, None), seen, 1e-4, 0.0, 8).unwrap();
                // In a close pair, the other star may be the brighter one.
                let off = |star: &SeenStar| star.position.distance(named.star.position) / place.length();
                // If two stars have the same position, take the one with the same brightness.
                let apparent = |star: &SeenStar| {
                    let distance_pc = star.distance_pc.unwrap_or(1.0);
                    magnitude_from_illuminance_lx(star.illuminance_lx) - 5.0 * (distance_pc / 10.0).log10()
                };
                let unlike = |star: &SeenStar| (apparent(star) - f64::from(named.star.magnitude)).abs();
                let key = |star: &SeenStar| ((1e7 * off(star)).round(), unlike(star));
                let there = found.iter().filter(|star| off(star) < 1e-5);
                let star = there.min_by(|a, b| key(a).partial_cmp(&key(b)).unwrap());
                let star = star.unwrap_or_else(|| panic!("{} is not found: {found:?}", named.name));
                assert!(star.separation_rad < 1e-6, "{}: {}", named.name, star.separation_rad);
                if camera == Camera::default() {
                    let error = magnitude_from_illuminance_lx(star.illuminance_lx) - named.star.apparent_magnitude();
                    assert!(error.abs() < 1e-3, "{}: {error}", named.name);
                }
            }
        }
    }

    #[test]
    fn the_brightest_come_first_and_at_most_the_requested_number() {
        let set = StarSet::from_records(bright_stars(0.0));
        // Orion's belt.
        let belt = DVec3::new(0.1019, 0.9946, -0.0209).normalize();
        let all = stars_near(&set, (&Camera::default(), None), belt, 0.15, 0.0, 100).unwrap();
        assert!(all.len() > 6 && all.windows(2).all(|pair| pair[0].illuminance_lx >= pair[1].illuminance_lx));
        assert!(all.iter().all(|star| star.separation_rad <= 0.15));
        let first = stars_near(&set, (&Camera::default(), None), belt, 0.15, 0.0, 3).unwrap();
        assert_eq!(first, all[..3]);
        let bright = stars_near(&set, (&Camera::default(), None), belt, 0.15, all[2].illuminance_lx, 100).unwrap();
        assert_eq!(bright, all[..3]);
        assert!(stars_near(&set, (&Camera::default(), None), -belt, 1e-6, 0.0, 8).unwrap().is_empty());
    }
}
