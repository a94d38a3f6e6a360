//! Labels next to directions and points.

use std::f64::consts::FRAC_PI_4;

use glam::DVec3;

use super::{
    AT_INFINITY, BEFORE_ALL, Drawing, Eye, Ink, OverlayPlanError, ground_altitude_rad,
    text::{Place, Run},
};
use crate::scene::{
    SceneObjects,
    overlay::{Anchor, Label},
    surroundings::BEYOND_AIR_M,
};

/// Names of the points of the compass from north through east, every 45 degrees.
const COMPASS: [&str; 8] = ["N", "NE", "E", "SE", "S", "SW", "W", "NW"];
/// Heights of the names of the four points and of those between them, pixels.
const COMPASS_PX: [f64; 2] = [26.0, 16.0];
/// Altitude of the centres of the names above the ground, rad: 4 degrees.
const COMPASS_RAD: f64 = 0.07;

/// Writes the points of the compass above the ground.
pub(super) fn draw_cardinal_points(
    drawing: &mut Drawing<'_>,
    eye: &Eye<'_>,
    objects: &SceneObjects,
) -> Result<(), OverlayPlanError> {
    if !objects.overlay.cardinal_points {
        return Ok(());
    }
    for (index, text) in COMPASS.into_iter().enumerate() {
        let azimuth_rad = index as f64 * FRAC_PI_4;
        let altitude_rad = ground_altitude_rad(objects, azimuth_rad) + COMPASS_RAD;
        let Some(seen) = eye.towards_horizon([azimuth_rad, altitude_rad]) else { continue };
        let ink = Ink { colour: Label::COLOUR, opacity: 1.0 };
        let size_px = COMPASS_PX[index % 2];
        drawing.text_at(
            eye,
            seen,
            &Run { text, size_px, ink, nearness: AT_INFINITY, place: Place::Centred, edged: true },
        )?;
    }
    Ok(())
}

pub(super) fn draw(drawing: &mut Drawing<'_>, eye: &Eye<'_>, objects: &SceneObjects) -> Result<(), OverlayPlanError> {
    for label in &objects.overlay.labels {
        let (direction, nearness) = match label.anchor {
            Anchor::Direction(direction) => (direction, AT_INFINITY),
            Anchor::Point(point_m) => (point_m - eye.position_m, nearness(eye, objects, point_m)),
            // The direction is in view axes. Without an observer there is no such label: see `Overlay::check_observer`.
            Anchor::Horizon(place) => (eye.towards_horizon(place).unwrap_or(DVec3::ZERO), AT_INFINITY),
        };
        if direction.length_squared() == 0.0 {
            // The eye is at the point.
            continue;
        }
        let ink = Ink { colour: label.colour, opacity: label.opacity };
        let place = Place::Beside { gap_px: 0.3 * label.size_px };
        let run = Run { text: &label.text, size_px: label.size_px, ink, nearness, place, edged: true };
        let is_near = direction.length() <= BEYOND_AIR_M && matches!(label.anchor, Anchor::Point(_));
        let seen = match label.anchor {
            Anchor::Horizon(_) => direction,
            _ if is_near => eye.apparent_without_air(direction),
            _ => eye.apparent(direction),
        };
        drawing.text_at(eye, seen, &run)?;
    }
    Ok(())
}

/// Returns the inverse distance of a label, 1/m. If the label's point is inside a body, the label names that body: it is drawn in front of that body
/// and behind all nearer surfaces.
fn nearness(eye: &Eye<'_>, objects: &SceneObjects, point_m: DVec3) -> f64 {
    let own = objects.bodies.iter().filter_map(|body| {
        let radius_m = body.radii_m.max_element();
        let inside = point_m.distance(body.position_m) <= radius_m;
        inside.then(|| eye.position_m.distance(body.position_m) - radius_m)
    });
    let distance_m = own.fold(eye.position_m.distance(point_m), f64::min);
    if distance_m > 0.0 { 1.0 / distance_m } else { BEFORE_ALL }
}
