//! The picture that the coordinates of a warp refer to, and the direction of each of its points. Coordinates: u from 0
//! (left) to 1 (right), v from 0 (bottom) to 1 (top).

use glam::{DMat3, DVec2, DVec3};

use super::fault::{Fault, rounded, shown};
use crate::view::projection::ContentShape;

/// Tolerance at the edge of a picture, because f32 and decimal numbers are rounded.
pub(super) const SLACK: f64 = 1e-5;

/// Largest deviation of the corner of a projection plane from a right angle, degrees.
const RECTANGLE_WITHIN_DEG: f64 = 0.1;

/// A picture in dome axes.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Content {
    /// A flat picture; points are relative to the eye.
    Plane {
        lower_left: DVec3,
        /// Along its lower edge.
        right: DVec3,
        /// Along its left edge.
        up: DVec3,
    },
    /// An equidistant fisheye.
    Fisheye {
        half_fov_rad: f64,
        /// The columns are the directions to the right and up in the picture, and the direction of its centre.
        dome_from_picture: DMat3,
        /// Radius of the circle, relative to half the picture's width and height.
        radius: [f64; 2],
        /// Half the size of the drawn part, relative to half the picture's width and height.
        edge: [f64; 2],
        /// Position of the middle of the picture in the circle, in radii of the circle.
        middle: [f64; 2],
        /// Point from which the directions of the circle are seen: right, up and towards its centre, in radii of the dome.
        eye: DVec3,
    },
    /// An equirectangular picture: longitude to the right, latitude upwards. The centre is the front.
    Equirectangular,
}

/// Rotation of a frustum that initially looks along -z: `yaw` to the right, then `pitch` upwards, then `roll` clockwise
/// as seen from behind.
pub(super) fn yaw_pitch_roll(yaw_rad: f64, pitch_rad: f64, roll_rad: f64) -> DMat3 {
    DMat3::from_rotation_y(-yaw_rad) * DMat3::from_rotation_x(pitch_rad) * DMat3::from_rotation_z(-roll_rad)
}

impl Content {
    /// A frustum from the signed angles of its edges (left and down negative), rad.
    pub fn frustum(left: f64, right: f64, down: f64, up: f64, rotation: DMat3) -> Result<Self, Fault> {
        let within = |angle: f64| angle.abs() < 89.99f64.to_radians();
        if !([left, right, down, up].into_iter().all(within) && left < right && down < up) {
            let degrees = [left, right, down, up].map(f64::to_degrees);
            return Err(Fault::new(
                "frustum",
                format!("left, right, down and up are {} degrees", shown(degrees)),
                "must be between -89.99 and 89.99 degrees, left less than right, down less than up (left and down are negative)",
            ));
        }
        let [left, right, down, up] = [left, right, down, up].map(f64::tan);
        Ok(Self::Plane {
            lower_left: rotation * DVec3::new(left, down, -1.0),
            right: rotation * DVec3::X * (right - left),
            up: rotation * DVec3::Y * (up - down),
        })
    }

    /// A plane from three of its corners and the eye.
    pub fn corners(lower_left: DVec3, upper_left: DVec3, upper_right: DVec3, eye: DVec3) -> Result<Self, Fault> {
        let (right, up, lower_left) = (upper_right - upper_left, upper_left - lower_left, lower_left - eye);
        let area = right.cross(up);
        // Volume that the plane and the eye span, relative to the lengths of the sides. It is 0 if the plane is seen edge-on.
        let seen = -area.dot(lower_left) / (area.length() * lower_left.length());
        if !seen.is_finite() || seen.abs() <= 1e-6 {
            return Err(Fault::new(
                "projection plane",
                "its corners are on one line, or the eye lies in its plane",
                "must be three corners of a rectangle whose plane does not contain the eye",
            ));
        }
        let off_deg = (right.angle_between(up).to_degrees() - 90.0).abs();
        if off_deg > RECTANGLE_WITHIN_DEG {
            let angle_deg = rounded(right.angle_between(up).to_degrees());
            return Err(Fault::new(
                "projection plane",
                format!("its sides meet at {angle_deg} degrees in the upper left corner"),
                format!("must be three corners of a rectangle: 90 degrees within {RECTANGLE_WITHIN_DEG}"),
            ));
        }
        Ok(Self::Plane { lower_left, right, up })
    }

    /// A fisheye centred on the apex of a dome that is tilted to the front by `tilt_rad`; the bottom is the front.
    /// `radius` is that of its circle, relative to half the picture's width and height.
    pub fn fisheye(fov_rad: f64, tilt_rad: f64, radius: [f64; 2]) -> Result<Self, Fault> {
        if !(fov_rad > 0.0 && fov_rad <= std::f64::consts::TAU + 1e-9) {
            let problem = format!("field of view of {} degrees", rounded(fov_rad.to_degrees()));
            return Err(Fault::new("fisheye", problem, "must be more than 0 and at most 360 degrees"));
        }
        if !tilt_rad.is_finite() {
            return Err(Fault::new("fisheye", "tilt is not finite", "must be a finite number of degrees"));
        }
        let (sin, cos) = tilt_rad.sin_cos();
        let dome_from_picture = DMat3::from_cols(DVec3::X, DVec3::new(0.0, sin, cos), DVec3::new(0.0, cos, -sin));
        let (middle, eye) = ([0.0; 2], DVec3::ZERO);
        Ok(Self::Fisheye { half_fov_rad: fov_rad / 2.0, dome_from_picture, radius, edge: radius, middle, eye })
    }

    /// The same fisheye, but the picture shows only a part of its circle: `edge`, `middle` and `eye` are those of [`Content::Fisheye`].
    #[must_use]
    pub fn cut(mut self, new_edge: [f64; 2], new_middle: [f64; 2], new_eye: DVec3) -> Self {
        if let Self::Fisheye { edge, middle, eye, .. } = &mut self {
            (*edge, *middle, *eye) = (new_edge, new_middle, new_eye);
        }
        self
    }

    /// Returns the range of coordinates that the picture fills.
    pub fn shape(&self) -> ContentShape {
        let (mut low, mut high, mut ellipse) = (DVec2::ZERO, DVec2::ONE, None);
        if let Self::Fisheye { radius, edge, middle, .. } = self {
            let [radius, edge, middle] = [*radius, *edge, *middle].map(DVec2::from);
            low = low.max((1.0 - edge) / 2.0);
            high = high.min((1.0 + edge) / 2.0);
            ellipse = Some([(1.0 - middle * radius) / 2.0, radius * (0.5 * (1.0 + SLACK))]);
        }
        ContentShape { low: low - SLACK, high: high + SLACK, ellipse }
    }

    /// Returns the direction of a point of the picture. Points beyond the edge also have a direction, as far as the mapping continues.
    pub fn direction(&self, u: f64, v: f64) -> Option<DVec3> {
        match self {
            Self::Plane { lower_left, right, up } => (*lower_left + *right * u + *up * v).try_normalize(),
            Self::Fisheye { half_fov_rad, dome_from_picture, radius, middle, eye, .. } => {
                let (x, y) = ((2.0 * u - 1.0) / radius[0] + middle[0], (2.0 * v - 1.0) / radius[1] + middle[1]);
                let rho = x.hypot(y);
                // Beyond the antipode, the mapping continues on the other side, because splines need a smooth map even there.
                let theta = rho * half_fov_rad;
                // sin(theta) / rho is finite at 0.
                let across = if rho > 1e-12 { theta.sin() / rho } else { *half_fov_rad };
                (*dome_from_picture * (DVec3::new(across * x, across * y, theta.cos()) - *eye)).try_normalize()
            }
            Self::Equirectangular => {
                let (sin_lon, cos_lon) = ((u - 0.5) * std::f64::consts::TAU).sin_cos();
                let (sin_lat, cos_lat) = ((v - 0.5) * std::f64::consts::PI).sin_cos();
                Some(DVec3::new(cos_lat * sin_lon, sin_lat, -cos_lat * cos_lon))
            }
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failed assumption of a test panics")]
mod tests {
    use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI};

    use super::*;

    /// Returns the direction of a point if the point is in the picture.
    fn within(content: &Content, u: f64, v: f64) -> Option<DVec3> {
        if content.shape().holds(DVec2::new(u, v)) { content.direction(u, v) } else { None }
    }

    fn near(found: Option<DVec3>, expected: DVec3) {
        assert!(found.unwrap().abs_diff_eq(expected.normalize(), 1e-12), "{found:?}, not {expected}");
    }

    #[test]
    fn a_fisheye_is_a_domemaster() {
        let level = Content::fisheye(PI, 0.0, [1.0, 1.0]).unwrap();
        near(level.direction(0.5, 0.5), DVec3::Y);
        near(level.direction(0.5, 0.0), DVec3::NEG_Z);
        near(level.direction(1.0, 0.5), DVec3::X);
        near(level.direction(0.5, 0.25), DVec3::new(0.0, 1.0, -1.0));
        assert_eq!(within(&level, 0.0, 0.0), None);
        near(within(&level, 0.5, 1.0), DVec3::Z);
        let tilted = Content::fisheye(PI, FRAC_PI_4, [1.0, 1.0]).unwrap();
        near(tilted.direction(0.5, 0.5), DVec3::new(0.0, 1.0, -1.0));
        near(tilted.direction(0.5, 0.0), DVec3::new(0.0, -1.0, -1.0));
    }

    #[test]
    fn a_frustum_turns_right_then_up_then_rolls_clockwise() {
        let rotated = |rotation: DMat3| Content::frustum(-FRAC_PI_4, FRAC_PI_4, -0.1, 0.1, rotation).unwrap();
        near(rotated(DMat3::IDENTITY).direction(0.0, 0.5), DVec3::new(-1.0, 0.0, -1.0));
        near(rotated(yaw_pitch_roll(FRAC_PI_2, 0.0, 0.0)).direction(0.5, 0.5), DVec3::X);
        near(rotated(yaw_pitch_roll(0.3, FRAC_PI_2, 0.0)).direction(0.5, 0.5), DVec3::Y);
        near(rotated(yaw_pitch_roll(0.0, 0.0, FRAC_PI_2)).direction(1.0, 0.5), DVec3::new(0.0, -1.0, -1.0));
        assert!(Content::frustum(0.1, -0.1, -0.1, 0.1, DMat3::IDENTITY).is_err());
        assert!(Content::frustum(-FRAC_PI_2, 0.1, -0.1, 0.1, DMat3::IDENTITY).is_err());
    }

    #[test]
    fn corners_and_an_eye_are_a_frustum() {
        let corner = |x: f64, y: f64| DVec3::new(x, y, -3.0);
        let plane = Content::corners(corner(-1.0, -1.0), corner(-1.0, 2.0), corner(1.0, 2.0), DVec3::Z).unwrap();
        near(plane.direction(0.5, 0.0), DVec3::new(0.0, -1.0, -4.0));
        near(plane.direction(1.0, 1.0), DVec3::new(1.0, 2.0, -4.0));
        // Corners of a parallelogram.
        let leaning =
            |by: f64| Content::corners(corner(-1.0, -1.0), corner(-1.0 + by, 2.0), corner(1.0, 2.0), DVec3::Z);
        assert!(leaning(0.005).is_ok());
        let Err(Fault::Content { problem, .. }) = leaning(0.3) else { panic!("no rectangle") };
        assert!(problem.contains("its sides meet at 84.28"), "{problem}");
        assert!(Content::corners(corner(0.0, 0.0), corner(1.0, 1.0), corner(2.0, 2.0), DVec3::Z).is_err());
        assert!(Content::corners(corner(-1.0, -1.0), corner(-1.0, 2.0), corner(1.0, 2.0), corner(5.0, 5.0)).is_err());
    }

    #[test]
    fn an_equirectangular_map_has_the_front_in_its_centre() {
        near(Content::Equirectangular.direction(0.5, 0.5), DVec3::NEG_Z);
        near(Content::Equirectangular.direction(0.75, 0.5), DVec3::X);
        near(Content::Equirectangular.direction(0.1, 1.0), DVec3::Y);
    }
}
