//! From a direction to its place in the picture, as the adapter finds it: Newton steps on the table, from a place that is
//! near. The shader `shaders/shared/tabulated.wgsl` has the same in f32.

use glam::{DVec2, DVec3};

use super::nodes::{Nodes, pixel_of_place};

/// Steps at most; three are usual.
pub const MOST_STEPS: u32 = 12;
/// The longest step, pixels.
pub const LONGEST_STEP_PX: f32 = 2.0;
/// After a shorter step directions are taken from the cubic, pixels.
pub const NEAR_PX: f32 = 0.5;
/// After a shorter step with the cubic the place is found: the slopes are those of the four nodes around, so that what is
/// left is a small part of it, pixels.
pub const DONE_PX: f32 = 0.01;

/// Where the picture has `direction` (unit vector), beginning in the middle of the four nodes around `start`. Where the way leads out of
/// the table there is no image; but if the picture shows everything, it ends there.
pub(super) fn search(nodes: &Nodes, direction: DVec3, start: [u32; 2], shows_everything: bool) -> Option<DVec2> {
    let mut place = DVec2::new(f64::from(start[0]), f64::from(start[1])) + 0.5;
    let mut held = place;
    let mut is_near = false;
    for _ in 0..MOST_STEPS {
        let part = place - place.floor();
        let Some([a, b, c, d]) = nodes.quad(place) else { return shows_everything.then(|| pixel_of_place(held)) };
        held = place;
        let along_x = (b - a).lerp(d - c, part.y);
        let along_y = (c - a).lerp(d - b, part.x);
        let linear = || a.lerp(b, part.x).lerp(c.lerp(d, part.x), part.y);
        let at = if is_near { nodes.between(place).unwrap_or_else(linear) } else { linear() };
        // at + x along_x + y along_y is to be parallel to the direction: Cramer's rule, without what lies along it.
        let missing = direction - at.normalize();
        let across = along_y.cross(direction);
        let step = DVec2::new(missing.dot(across), missing.dot(direction.cross(along_x))) / along_x.dot(across);
        if !step.is_finite() {
            return shows_everything.then(|| pixel_of_place(held));
        }
        let longest = DVec2::splat(f64::from(LONGEST_STEP_PX));
        place += step.clamp(-longest, longest);
        let length = step.length();
        if is_near && length < f64::from(DONE_PX) {
            break;
        }
        is_near = length < f64::from(NEAR_PX);
    }
    Some(pixel_of_place(place))
}
