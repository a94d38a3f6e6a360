//! Inverse search as on the GPU: from a direction to its position in the picture, by Newton steps on the table from a
//! nearby start. The shader `shaders/shared/tabulated.wgsl` does the same in f32.

use glam::{DVec2, DVec3};

use super::nodes::{Nodes, part_of, pixel_of_place};

/// Maximum number of steps; three are usual.
pub const MOST_STEPS: u32 = 12;
/// Maximum length of a step, pixels.
pub const LONGEST_STEP_PX: f32 = 2.0;
/// After a step shorter than this, directions are interpolated with the cubic, pixels.
pub const NEAR_PX: f32 = 0.5;
/// The search ends after a step with the cubic that is shorter than this, pixels. The slopes come from the four nodes
/// around, so the remaining error is a small fraction of the step.
pub const DONE_PX: f32 = 0.01;

/// Position of `direction` (unit vector) in the picture, starting in the middle of the four nodes around `start`. If
/// the search leaves the table there is no image, except if the picture shows the full sphere: then the last position
/// is returned.
pub(super) fn search(nodes: &Nodes, direction: DVec3, start: [u32; 2], shows_everything: bool) -> Option<DVec2> {
    let mut place = DVec2::new(f64::from(start[0]), f64::from(start[1])) + 0.5;
    let mut held = place;
    let mut is_near = false;
    for _ in 0..MOST_STEPS {
        let part = part_of(place);
        let Some([a, b, c, d]) = nodes.quad(place) else { return shows_everything.then(|| pixel_of_place(held)) };
        held = place;
        let along_x = (b - a).lerp(d - c, part.y);
        let along_y = (c - a).lerp(d - b, part.x);
        let linear = || a.lerp(b, part.x).lerp(c.lerp(d, part.x), part.y);
        let direction_here = if is_near { nodes.between(place).unwrap_or_else(linear) } else { linear() };
        // Solve for at + x along_x + y along_y parallel to the direction: Cramer's rule, ignoring the component along
        // the direction.
        let missing = direction - direction_here.normalize();
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
