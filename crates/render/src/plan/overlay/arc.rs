//! Arcs on the sphere of directions around an eye: parts of circles, with their distances.

use std::f64::consts::{PI, TAU};

use glam::{DMat3, DVec3};

use super::{AT_INFINITY, BEFORE_ALL};

/// A part of a circle: `centre + u cos(phi) + v sin(phi)` for phi between two angles. `u` and `v` are perpendicular and as long as the
/// circle's radius on the unit sphere.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Arc {
    centre: DVec3,
    u: DVec3,
    v: DVec3,
    /// First and last angle, rad.
    pub angles: [f64; 2],
    /// Inverse distance: `nearness[0] cos(phi) + nearness[1] sin(phi)`, 1/m. This is exact for straight lines.
    nearness: [f64; 2],
    before_all: bool,
}

impl Arc {
    /// A whole circle at infinity: all its points are `radius_rad` from `axis`. Its angle is counted from `u`; `u`, `v`, `axis` are orthogonal unit
    /// vectors.
    pub fn circle(axis: DVec3, u: DVec3, v: DVec3, radius_rad: f64) -> Self {
        let (sin, cos) = radius_rad.sin_cos();
        let nearness = [AT_INFINITY; 2];
        Self { centre: axis * cos, u: u * sin, v: v * sin, angles: [0.0, TAU], nearness, before_all: false }
    }

    /// The part of a great circle at infinity from `-reach_rad` to `reach_rad` around the unit vector `middle`, towards the unit vector
    /// `v` orthogonal to it.
    pub fn half_circle(middle: DVec3, v: DVec3, reach_rad: f64) -> Self {
        let angles = [-reach_rad, reach_rad];
        Self { centre: DVec3::ZERO, u: middle, v, angles, nearness: [AT_INFINITY; 2], before_all: false }
    }

    /// The same arc, drawn in front of everything.
    pub fn before_all(self) -> Self {
        Self { before_all: true, ..self }
    }

    /// A straight line between two points relative to the eye, m; `None`: the eye is on it.
    pub fn straight_line(from_m: DVec3, to_m: DVec3) -> Option<Self> {
        let [near_from, near_to] = [from_m, to_m].map(|point| 1.0 / point.length());
        if !(near_from.is_finite() && near_to.is_finite()) {
            return None;
        }
        let (u, end) = (from_m * near_from, to_m * near_to);
        let angle = u.cross(end).length().atan2(u.dot(end));
        // A line that points at the eye appears as a point, and does not define a plane with the eye.
        let v = (end - u * u.dot(end)).try_normalize().filter(|_| angle > 1e-12 && angle < PI - 1e-9)?;
        // The inverse distance at `angle` must be `near_to`. 1 - cos is computed without cancellation.
        let rise = near_to - near_from + near_from * 2.0 * (angle / 2.0).sin().powi(2);
        let nearness = [near_from, rise / angle.sin()];
        Some(Self { centre: DVec3::ZERO, u, v, angles: [0.0, angle], nearness, before_all: false })
    }

    /// The arc in other axes.
    pub fn turned(self, rotation: &DMat3) -> Self {
        Self { centre: *rotation * self.centre, u: *rotation * self.u, v: *rotation * self.v, ..self }
    }

    /// Direction at an angle.
    pub fn direction(&self, angle: f64) -> DVec3 {
        let (sin, cos) = angle.sin_cos();
        self.centre + self.u * cos + self.v * sin
    }

    /// Inverse distance at an angle, 1/m.
    pub fn nearness(&self, angle: f64) -> f64 {
        if self.before_all {
            return BEFORE_ALL;
        }
        let (sin, cos) = angle.sin_cos();
        (self.nearness[0] * cos + self.nearness[1] * sin).max(AT_INFINITY)
    }

    /// Radius of the circle on the unit sphere, at most 1.
    pub fn radius(&self) -> f64 {
        self.u.length()
    }
}
