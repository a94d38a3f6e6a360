//! Longitude and latitude over the whole sphere: the image centre is -z, its top is +y, longitude grows to the right. The image wraps at +-180
//! degrees, and continues beyond a pole on the opposite meridian.

use std::f64::consts::{PI, TAU};

use glam::{DVec2, DVec3};

use super::{BoundingCone, Footprint, PlaneMapping, ProjectionError, Tap, check_size};

/// The whole sphere in a rectangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Equirectangular {
    size: [u32; 2],
}

impl Equirectangular {
    /// An image of the whole sphere. The width must be even: beyond a pole the image continues half a turn away, which
    /// must be a whole number of pixels.
    pub fn new(size: [u32; 2]) -> Result<Self, ProjectionError> {
        check_size(size)?;
        if !size[0].is_multiple_of(2) {
            return Err(ProjectionError::OutOfRange {
                parameter: "size[0]",
                value: f64::from(size[0]),
                allowed: "the width of an equirectangular view must be even (beyond a pole the image continues half a turn away)",
            });
        }
        Ok(Self { size })
    }
}

impl PlaneMapping for Equirectangular {
    fn size(&self) -> [u32; 2] {
        self.size
    }

    fn pixel_from_direction(&self, direction: DVec3) -> Option<DVec2> {
        let across = direction.x.hypot(direction.z);
        let longitude = if across > 0.0 { direction.x.atan2(-direction.z) } else { 0.0 };
        let colatitude = across.atan2(direction.y);
        Some(DVec2::new((0.5 + longitude / TAU) * f64::from(self.size[0]), colatitude / PI * f64::from(self.size[1])))
    }

    fn direction_from_pixel(&self, pixel: DVec2) -> Option<DVec3> {
        let [width, height] = self.size.map(f64::from);
        if !(0.0..=width).contains(&pixel.x) || !(0.0..=height).contains(&pixel.y) {
            return None;
        }
        let (sin_longitude, cos_longitude) = ((pixel.x / width - 0.5) * TAU).sin_cos();
        let (sin_colatitude, cos_colatitude) = (pixel.y / height * PI).sin_cos();
        Some(DVec3::new(sin_colatitude * sin_longitude, cos_colatitude, -sin_colatitude * cos_longitude))
    }

    fn contains(&self, x: u32, y: u32) -> bool {
        x < self.size[0] && y < self.size[1]
    }

    /// The exact value: the zone between two latitudes, divided among the columns.
    fn solid_angle_sr(&self, x: u32, y: u32) -> f64 {
        if !self.contains(x, y) {
            return 0.0;
        }
        let [width, height] = self.size.map(f64::from);
        let colatitude = (f64::from(y) + 0.5) / height * PI;
        2.0 * (TAU / width) * colatitude.sin() * (PI / height / 2.0).sin()
    }

    fn bounding_cone(&self, _margin_px: f64) -> BoundingCone {
        BoundingCone { axis: DVec3::NEG_Z, half_angle_rad: PI }
    }

    fn shows_full_sphere(&self) -> bool {
        true
    }

    fn taps(&self, kernel: Footprint<'_>, direction: DVec3) -> Vec<Tap> {
        let Some(centre) = self.pixel_from_direction(direction) else { return Vec::new() };
        let [width, height] = self.size.map(i64::from);
        kernel(centre)
            .into_iter()
            .map(|(x, y, weight)| {
                let (x, y) = if y < 0 {
                    (x + width / 2, -1 - y)
                } else if y >= height {
                    (x + width / 2, 2 * height - 1 - y)
                } else {
                    (x, y)
                };
                Tap { x: x.rem_euclid(width) as u32, y: y.clamp(0, height - 1) as u32, weight }
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn centre_top_and_sides_map_to_the_expected_pixels() {
        let view = Equirectangular::new([200, 100]).unwrap();
        for (direction, pixel) in [
            (DVec3::NEG_Z, DVec2::new(100.0, 50.0)),
            (DVec3::X, DVec2::new(150.0, 50.0)),
            (DVec3::NEG_X, DVec2::new(50.0, 50.0)),
            (DVec3::Y, DVec2::new(100.0, 0.0)),
            (DVec3::NEG_Y, DVec2::new(100.0, 100.0)),
        ] {
            assert!((view.pixel_from_direction(direction).unwrap() - pixel).length() < 1e-9, "{direction}");
        }
    }

    #[test]
    fn odd_width_and_zero_are_refused() {
        assert!(Equirectangular::new([201, 100]).unwrap_err().to_string().contains("even"));
        assert!(Equirectangular::new([200, 0]).is_err());
    }

    #[test]
    fn pixels_sum_to_the_sphere() {
        let view = Equirectangular::new([64, 32]).unwrap();
        let sum: f64 = (0..32).map(|y| 64.0 * view.solid_angle_sr(0, y)).sum();
        assert!((sum / (4.0 * PI) - 1.0).abs() < 1e-12);
    }
}
