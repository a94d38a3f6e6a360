//! The point of the sky around which a picture shrinks to nothing: the antipode of a fisheye of almost 360 degrees.
//!
//! Pixels around it are slivers whose long sides point to it. The edge of the grid of starts is the antipode of the grid's axis, and each cell there
//! has one azimuth. If both antipodes are the same point, no cell has images on all sides of the picture.

use glam::{DVec2, DVec3};

/// Ratio of the sides of a sliver.
const SLIVER: f64 = 0.1;
/// Largest distance of a sliver from the point, rad.
const NEAR_RAD: f64 = 0.5;

/// Direction of a pixel, and derivatives of the direction along the pixel's sides.
pub(super) type Sides = (DVec3, [DVec3; 2]);

/// Whether the sides (longer, shorter) are those of a sliver.
pub(super) fn is_sliver([longer, shorter]: [f64; 2]) -> bool {
    shorter < SLIVER * longer
}

/// Normal of the great circle along the longer side of a pixel.
fn along_longer((direction, [along_x, along_y]): &Sides) -> DVec3 {
    let (xx, yy, xy) = (along_x.length_squared(), along_y.length_squared(), along_x.dot(*along_y));
    let turn = DVec2::from_angle(0.5 * (2.0 * xy).atan2(xx - yy));
    direction.cross(*along_x * turn.x + *along_y * turn.y).normalize_or_zero()
}

/// The point to which all slivers point. It is the intersection of the great circles of the first sliver and of the sliver most perpendicular to it.
/// `None` if any sliver is far from this point.
pub(super) fn pole(slivers: &[Sides]) -> Option<DVec3> {
    let first = along_longer(slivers.first()?);
    let crossing = |sides: &Sides| first.cross(along_longer(sides));
    let meets = slivers.iter().map(crossing).max_by(|a, b| a.length_squared().total_cmp(&b.length_squared()))?;
    let meets = meets.try_normalize()?;
    let pole = meets * meets.dot(slivers[0].0).signum();
    slivers.iter().all(|(direction, _)| direction.angle_between(pole) < NEAR_RAD).then_some(pole)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Creates a sliver at an angle from the pole +z. Its longer side points to the pole, or is perpendicular to that direction.
    fn sliver(azimuth: f64, angle: f64, points_to_pole: bool) -> Sides {
        let (sin, cos) = azimuth.sin_cos();
        let (radial, around) = (DVec3::new(cos, sin, 0.0), DVec3::new(-sin, cos, 0.0));
        let tangent = radial * angle.cos() - DVec3::Z * angle.sin();
        let [long, short] = if points_to_pole { [tangent, around] } else { [around, tangent] };
        (radial * angle.sin() + DVec3::Z * angle.cos(), [long * 0.6 + short * 0.0008, long * 0.8 - short * 0.0006])
    }

    #[test]
    fn slivers_point_to_the_pole_and_others_have_none() {
        let ring = |points: bool| (0..40).map(|i| sliver(0.1 * f64::from(i), 0.1, points)).collect::<Vec<Sides>>();
        let found = pole(&ring(true));
        assert!(found.is_some_and(|found| found.abs_diff_eq(DVec3::Z, 1e-9)), "{found:?}");
        assert_eq!(pole(&[]), None);
        // Slivers at the two edges of a wide flat picture.
        let edges = [sliver(0.0, 1.5, false), sliver(3.0, 1.5, false), sliver(1.5, 1.5, false)];
        assert_eq!(pole(&edges), None);
        assert!(is_sliver([1.0, 0.05]) && !is_sliver([1.0, 0.5]));
    }
}
