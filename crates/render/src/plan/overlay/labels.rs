//! Labels next to directions and points.

use glam::DVec3;

use super::{
    AT_INFINITY, BEFORE_ALL, Drawing, Eye, Ink, OverlayPlanError,
    text::{Place, Run},
};
use crate::scene::{SceneObjects, overlay::Anchor, surroundings::BEYOND_AIR_M};

pub(super) fn draw(drawing: &mut Drawing<'_>, eye: &Eye<'_>, objects: &SceneObjects) -> Result<(), OverlayPlanError> {
    for label in &objects.overlay.labels {
        let (direction, nearness) = match label.anchor {
            Anchor::Direction(direction) => (direction, AT_INFINITY),
            Anchor::Point(point_m) => (point_m - eye.position_m, nearness(eye, objects, point_m)),
        };
        if direction.length_squared() == 0.0 {
            // The eye is at the point.
            continue;
        }
        let ink = Ink { colour: label.colour, opacity: label.opacity };
        let place = Place::Beside { gap_px: 0.3 * label.size_px };
        let run = Run { text: &label.text, size_px: label.size_px, ink, nearness, place, edged: true };
        let is_near = direction.length() <= BEYOND_AIR_M && matches!(label.anchor, Anchor::Point(_));
        let seen = if is_near { eye.apparent_without_air(direction) } else { eye.apparent(direction) };
        drawing.text_at(eye, seen, &run)?;
    }
    Ok(())
}

/// Inverse distance of a label, 1/m. A label at a point inside a body is in front of that body, which it names, and behind
/// all nearer surfaces.
fn nearness(eye: &Eye<'_>, objects: &SceneObjects, point_m: DVec3) -> f64 {
    let own = objects.bodies.iter().filter_map(|body| {
        let radius_m = body.radii_m.max_element();
        let inside = point_m.distance(body.position_m) <= radius_m;
        inside.then(|| eye.position_m.distance(body.position_m) - radius_m)
    });
    let distance_m = own.fold(eye.position_m.distance(point_m), f64::min);
    if distance_m > 0.0 { 1.0 / distance_m } else { BEFORE_ALL }
}
