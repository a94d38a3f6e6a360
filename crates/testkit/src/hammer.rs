//! The Hammer map of the whole sky, a mapping that the library does not have. It is an equal-area map in an ellipse.
//! Its edge is the meridian behind the eye, from pole to pole.

use std::f64::consts::{PI, SQRT_2};

use glam::{DVec2, DVec3};
use steradian::view::projection::{BoundingCone, PlaneMapping};

/// Hammer projection (1892) centred on -z, +y at the top, with the given height in pixels.
pub struct Hammer(pub u32);

impl Hammer {
    /// Pixels per unit of the plane, on which the ellipse has the half axes 2 sqrt 2 and sqrt 2.
    fn scale(&self) -> f64 {
        f64::from(self.0) / (2.0 * SQRT_2)
    }

    fn middle(&self) -> DVec2 {
        DVec2::new(f64::from(self.0), f64::from(self.0) / 2.0)
    }
}

impl PlaneMapping for Hammer {
    fn size(&self) -> [u32; 2] {
        [2 * self.0, self.0]
    }

    fn pixel_from_direction(&self, direction: DVec3) -> Option<DVec2> {
        let direction = direction.try_normalize()?;
        let across = direction.x.hypot(direction.z);
        let half_longitude = direction.x.atan2(-direction.z) / 2.0;
        let w = (1.0 + across * half_longitude.cos()).sqrt();
        Some(
            self.middle() + DVec2::new(2.0 * across * half_longitude.sin(), -direction.y) * (SQRT_2 / w * self.scale()),
        )
    }

    fn direction_from_pixel(&self, pixel: DVec2) -> Option<DVec3> {
        let p = (pixel - self.middle()) / self.scale();
        // cos^2 of a quarter of the longitude on the equator; 1/2 on the ellipse.
        let squared = 1.0 - p.x * p.x / 16.0 - p.y * p.y / 4.0;
        if squared < 0.5 {
            return None;
        }
        let z = squared.sqrt();
        let longitude = 2.0 * (z * p.x).atan2(2.0 * (2.0 * squared - 1.0));
        let sine = (-z * p.y).clamp(-1.0, 1.0);
        let across = (1.0 - sine * sine).sqrt();
        Some(DVec3::new(across * longitude.sin(), sine, -across * longitude.cos()))
    }

    fn solid_angle_sr(&self, x: u32, y: u32) -> f64 {
        if self.contains(x, y) { self.scale().powi(-2) } else { 0.0 }
    }

    fn shows_full_sphere(&self) -> bool {
        true
    }

    fn bounding_cone(&self, _margin_px: f64) -> BoundingCone {
        BoundingCone { axis: DVec3::NEG_Z, half_angle_rad: PI }
    }
}
