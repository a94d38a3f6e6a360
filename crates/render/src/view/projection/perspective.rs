//! Perspective projection onto a flat plane: symmetric, or off-axis from four angles as in OpenXR.

use std::f64::consts::FRAC_PI_2;

use glam::{DVec2, DVec3};

use super::{BoundingCone, PlaneMapping, ProjectionError, check_size};

/// Greatest angle from the optical axis to an edge, degrees. Beyond it, f32 has no sub-pixel accuracy near the rim.
pub const MAX_EDGE_DEG: f64 = 89.0;
const MAX_EDGE_RAD: f64 = MAX_EDGE_DEG / 180.0 * std::f64::consts::PI;

/// A flat picture bounded by four planes through the eye; tangents are measured from the principal ray -z.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Perspective {
    size: [u32; 2],
    /// Tangents of the left and right edge (left < right) and of the lower and upper edge (down < up).
    pub(crate) left: f64,
    pub(crate) right: f64,
    pub(crate) down: f64,
    pub(crate) up: f64,
}

impl Perspective {
    /// Creates a symmetric picture with a vertical field of view in rad and square pixels. Both the vertical and the horizontal field of view must be
    /// above 0 and at most 178 degrees.
    pub fn symmetric(size: [u32; 2], fov_y_rad: f64) -> Result<Self, ProjectionError> {
        check_size(size)?;
        if !(fov_y_rad > 0.0 && fov_y_rad <= 2.0 * MAX_EDGE_RAD + 1e-12) {
            return Err(ProjectionError::OutOfRange {
                parameter: "fov_y_deg",
                value: fov_y_rad.to_degrees(),
                allowed: "the field of view of a perspective view must be above 0 and at most 178 degrees (a flat plane cannot show 180); use fisheye or equirectangular for more",
            });
        }
        let up = (fov_y_rad / 2.0).tan();
        let right = up * f64::from(size[0]) / f64::from(size[1]);
        if right.atan() > MAX_EDGE_RAD {
            return Err(ProjectionError::OutOfRange {
                parameter: "fov_y_deg",
                value: fov_y_rad.to_degrees(),
                allowed: "with this aspect ratio the horizontal field of view exceeds 178 degrees; make the view narrower or use fisheye",
            });
        }
        Ok(Self { size, left: -right, right, down: -up, up })
    }

    /// Creates an off-axis picture from four signed angles in rad (the left and lower ones are usually negative), each within +-89 degrees.
    pub fn off_axis(
        size: [u32; 2],
        left_rad: f64,
        right_rad: f64,
        up_rad: f64,
        down_rad: f64,
    ) -> Result<Self, ProjectionError> {
        check_size(size)?;
        for (parameter, value) in [
            ("fov.left_deg", left_rad),
            ("fov.right_deg", right_rad),
            ("fov.up_deg", up_rad),
            ("fov.down_deg", down_rad),
        ] {
            if value.is_nan() || value.abs() > MAX_EDGE_RAD + 1e-12 {
                let allowed = "each angle must lie within -89 and 89 degrees";
                return Err(ProjectionError::OutOfRange { parameter, value: value.to_degrees(), allowed });
            }
        }
        if left_rad >= right_rad {
            let allowed =
                "the angle to the left must be smaller than the one to the right (angles to the left are negative)";
            return Err(ProjectionError::OutOfRange {
                parameter: "fov.left_deg",
                value: left_rad.to_degrees(),
                allowed,
            });
        }
        if down_rad >= up_rad {
            let allowed = "the angle down must be smaller than the one up (angles downwards are negative)";
            return Err(ProjectionError::OutOfRange {
                parameter: "fov.down_deg",
                value: down_rad.to_degrees(),
                allowed,
            });
        }
        Ok(Self { size, left: left_rad.tan(), right: right_rad.tan(), down: down_rad.tan(), up: up_rad.tan() })
    }

    /// Creates a picture from the tangents of its four edges. They must be finite and ordered, which the other constructors ensure.
    pub(crate) fn from_tangents(size: [u32; 2], [left, right, down, up]: [f64; 4]) -> Self {
        Self { size, left, right, down, up }
    }

    fn tangent_per_pixel(&self) -> DVec2 {
        DVec2::new((self.right - self.left) / f64::from(self.size[0]), (self.up - self.down) / f64::from(self.size[1]))
    }

    /// Solid angle between the four edges, sr.
    pub(crate) fn picture_solid_angle_sr(&self) -> f64 {
        corner(self.right, self.up) - corner(self.left, self.up) - corner(self.right, self.down)
            + corner(self.left, self.down)
    }

    /// Tangents of the edges, widened by `margin_px` on every side: left, right, down, up.
    pub fn edge_tangents(&self, margin_px: f64) -> [f64; 4] {
        let margin = self.tangent_per_pixel() * margin_px;
        [self.left - margin.x, self.right + margin.x, self.down - margin.y, self.up + margin.y]
    }
}

/// Solid angle of the rectangle between the principal ray and the corner (x, y) of a plane at distance 1.
fn corner(x: f64, y: f64) -> f64 {
    (x * y).atan2((1.0 + x * x + y * y).sqrt())
}

impl PlaneMapping for Perspective {
    fn size(&self) -> [u32; 2] {
        self.size
    }

    fn pixel_from_direction(&self, direction: DVec3) -> Option<DVec2> {
        if direction.z >= 0.0 {
            return None;
        }
        let tangent = DVec2::new(direction.x, direction.y) / -direction.z;
        let step = self.tangent_per_pixel();
        let pixel = DVec2::new((tangent.x - self.left) / step.x, (self.up - tangent.y) / step.y);
        pixel.is_finite().then_some(pixel)
    }

    fn direction_from_pixel(&self, pixel: DVec2) -> Option<DVec3> {
        let inside = pixel.x >= 0.0
            && pixel.y >= 0.0
            && pixel.x <= f64::from(self.size[0])
            && pixel.y <= f64::from(self.size[1]);
        let step = self.tangent_per_pixel();
        inside.then(|| DVec3::new(self.left + pixel.x * step.x, self.up - pixel.y * step.y, -1.0).normalize())
    }

    fn contains(&self, x: u32, y: u32) -> bool {
        x < self.size[0] && y < self.size[1]
    }

    /// The exact value, from the solid angles of four corners.
    fn solid_angle_sr(&self, x: u32, y: u32) -> f64 {
        if !self.contains(x, y) {
            return 0.0;
        }
        let step = self.tangent_per_pixel();
        let (x0, y0) = (self.left + f64::from(x) * step.x, self.up - f64::from(y) * step.y);
        let (x1, y1) = (x0 + step.x, y0 - step.y);
        (corner(x1, y0) - corner(x0, y0) - corner(x1, y1) + corner(x0, y1)).abs()
    }

    /// These bounds are exact for square pixels. The angular size of a pixel of a flat plane is proportional to the cosine of the angle from the axis
    /// in the tangential direction, and to the square of this cosine in the radial direction.
    fn pixel_extent_rad(&self, direction: DVec3) -> Option<[f64; 2]> {
        let cosine = -direction.z;
        let step = self.tangent_per_pixel();
        (cosine > 0.0).then(|| [step.max_element() * cosine, step.min_element() * cosine * cosine])
    }

    fn bounding_cone(&self, margin_px: f64) -> BoundingCone {
        let [left, right, down, up] = self.edge_tangents(margin_px);
        let corners =
            [(left, up), (right, up), (left, down), (right, down)].map(|(x, y)| DVec3::new(x, y, -1.0).normalize());
        let axis = corners.iter().sum::<DVec3>().normalize_or(DVec3::NEG_Z);
        let half_angle_rad = corners.iter().map(|c| axis.angle_between(*c)).fold(0.0, f64::max);
        BoundingCone { axis, half_angle_rad: half_angle_rad.min(FRAC_PI_2) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn impossible_fields_of_view_are_refused() {
        for degrees in [0.0, -10.0, 180.0, 178.5, 400.0, f64::NAN, f64::INFINITY] {
            assert!(Perspective::symmetric([64, 64], f64::to_radians(degrees)).is_err(), "{degrees} was accepted");
        }
        assert!(Perspective::symmetric([64, 64], 178f64.to_radians()).is_ok());
        assert!(Perspective::symmetric([640, 64], 178f64.to_radians()).is_err(), "too wide");
        assert!(Perspective::off_axis([64, 64], 0.5, -0.5, 0.5, -0.5).is_err(), "left and right swapped");
        assert!(Perspective::off_axis([64, 64], -0.5, 0.5, -0.5, 0.5).is_err(), "up and down swapped");
        assert!(Perspective::symmetric([0, 64], 1.0).is_err());
    }

    #[test]
    fn off_axis_is_a_window_of_the_symmetric_picture() {
        let whole = Perspective::symmetric([640, 480], 1.2).unwrap();
        let [left, right, down, up] = whole.edge_tangents(0.0);
        let window = Perspective::off_axis(
            [320, 480],
            left.atan(),
            (left + (right - left) / 2.0).atan(),
            up.atan(),
            down.atan(),
        )
        .unwrap();
        for (x, y) in [(0, 0), (319, 479), (100, 333), (319, 0)] {
            let (a, b) = (whole.solid_angle_sr(x, y), window.solid_angle_sr(x, y));
            assert!((a / b - 1.0).abs() < 1e-9, "{a} {b}");
        }
    }
}
