//! Azimuthal mappings around the optical axis -z: domes and fisheye lenses. Let p be the position in the circle of the
//! picture (+x right, +y up, |p| = rho <= 1), theta the angle from the axis and F the field of view:
//!
//! | mapping | rho | allowed F | solid angle per unit area of p |
//! |---|---|---|---|
//! | equidistant | theta / (F/2) | up to 360 degrees | sin(theta)/theta (F/2)^2 |
//! | equisolid | sin(theta/2) / sin(F/4) | up to 360 degrees | 4 sin^2(F/4) |
//! | orthographic | sin(theta) / sin(F/2) | up to 180 degrees | s^2 / sqrt(1 - (s rho)^2), s = sin(F/2) |
//! | stereographic | tan(theta/2) / tan(F/4) | below 360 degrees | 4 t^2 / (1 + (t rho)^2)^2, t = tan(F/4) |
//!
//! The circle is inscribed in the shorter side; a pixel is inside if its centre is inside the circle.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use glam::{DVec2, DVec3};

use super::{
    BoundingCone, Footprint, PlaneMapping, ProjectionError, Tap, check_size, integrate_over_rectangle, pixel_centre,
};

/// How the angle from the axis maps to a radius.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum FisheyeMapping {
    /// Radius proportional to the angle.
    Equidistant,
    /// Equal areas for equal solid angles.
    Equisolid,
    /// Orthographic projection: the picture looks like a sphere seen from far away.
    Orthographic,
    /// Conformal.
    Stereographic,
}

named!(FisheyeMapping {
    Equidistant = "equidistant",
    Equisolid = "equisolid",
    Orthographic = "orthographic",
    Stereographic = "stereographic",
});

/// A round picture of the sky around -z.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fisheye {
    size: [u32; 2],
    /// The mapping.
    pub mapping: FisheyeMapping,
    /// Half of the field of view, rad.
    pub half_fov_rad: f64,
    /// The radius of the rim before normalisation: F/2, sin(F/4), sin(F/2) or tan(F/4).
    pub(crate) rim: f64,
}

impl Fisheye {
    /// A fisheye view with field of view `fov_rad` across the circle.
    pub fn new(size: [u32; 2], mapping: FisheyeMapping, fov_rad: f64) -> Result<Self, ProjectionError> {
        check_size(size)?;
        let slack = 1e-12;
        let (ok, allowed) = match mapping {
            FisheyeMapping::Equidistant => {
                (fov_rad <= TAU + slack, "an equidistant fisheye shows more than 0 and at most 360 degrees")
            }
            FisheyeMapping::Equisolid => {
                (fov_rad <= TAU + slack, "an equisolid fisheye shows more than 0 and at most 360 degrees")
            }
            FisheyeMapping::Orthographic => (
                fov_rad <= PI + slack,
                "an orthographic fisheye shows more than 0 and at most 180 degrees (beyond that, the sky folds back on itself)",
            ),
            FisheyeMapping::Stereographic => (
                fov_rad <= 359f64.to_radians() + slack,
                "a stereographic fisheye shows more than 0 and at most 359 degrees (at 360 the picture is infinite)",
            ),
        };
        if !(fov_rad > 0.0 && ok) {
            return Err(ProjectionError::OutOfRange { parameter: "fov_deg", value: fov_rad.to_degrees(), allowed });
        }
        let half_fov_rad = (fov_rad / 2.0).min(PI);
        let rim = match mapping {
            FisheyeMapping::Equidistant => half_fov_rad,
            FisheyeMapping::Equisolid => (half_fov_rad / 2.0).sin(),
            FisheyeMapping::Orthographic => half_fov_rad.sin(),
            FisheyeMapping::Stereographic => (half_fov_rad / 2.0).tan(),
        };
        Ok(Self { size, mapping, half_fov_rad, rim })
    }

    /// Radius of the circle in pixels.
    pub fn radius_px(&self) -> f64 {
        f64::from(self.size[0].min(self.size[1])) / 2.0
    }

    /// Whether the picture shows every direction; then no light may be lost at its rim.
    pub fn is_full_sphere(&self) -> bool {
        self.half_fov_rad >= PI - 1e-9
    }

    /// Whether the pixel's centre lies less than one and a half pixels from the rim. Uses integers (twice the offset
    /// from the centre), so that the shader decides identically.
    fn is_within_rim(&self, x: u32, y: u32) -> bool {
        let [width, height] = self.size.map(i64::from);
        let (dx, dy) = (2 * i64::from(x) + 1 - width, 2 * i64::from(y) + 1 - height);
        let n = width.min(height);
        dx * dx + dy * dy > (n - 3).max(0).pow(2)
    }

    /// Density at the pixel's centre times the area of the pixel. A shader computes this value if the approximation is sufficient.
    pub(crate) fn midpoint_solid_angle_sr(&self, x: u32, y: u32) -> f64 {
        self.density(self.plane_from_pixel(pixel_centre(x, y)).length()) / self.radius_px().powi(2)
    }

    fn plane_from_pixel(&self, pixel: DVec2) -> DVec2 {
        let centre = DVec2::new(f64::from(self.size[0]), f64::from(self.size[1])) / 2.0;
        let p = (pixel - centre) / self.radius_px();
        DVec2::new(p.x, -p.y)
    }

    fn rho_from_theta(&self, theta: f64) -> Option<f64> {
        match self.mapping {
            FisheyeMapping::Equidistant => Some(theta / self.rim),
            FisheyeMapping::Equisolid => Some((theta / 2.0).sin() / self.rim),
            FisheyeMapping::Orthographic => (theta <= FRAC_PI_2).then(|| theta.sin() / self.rim),
            FisheyeMapping::Stereographic => (theta < PI - 1e-4).then(|| (theta / 2.0).tan() / self.rim),
        }
    }

    fn theta_from_rho(&self, rho: f64) -> f64 {
        match self.mapping {
            FisheyeMapping::Equidistant => rho * self.rim,
            FisheyeMapping::Equisolid => 2.0 * (rho * self.rim).min(1.0).asin(),
            FisheyeMapping::Orthographic => (rho * self.rim).min(1.0).asin(),
            FisheyeMapping::Stereographic => 2.0 * (rho * self.rim).atan(),
        }
    }

    /// Solid angle per unit area of the unit circle.
    fn density(&self, rho: f64) -> f64 {
        let r2 = (self.rim * rho).powi(2);
        match self.mapping {
            FisheyeMapping::Equidistant => {
                let theta = self.rim * rho;
                let sinc = if theta < 1e-4 { 1.0 - theta * theta / 6.0 } else { theta.sin() / theta };
                self.rim * self.rim * sinc.abs()
            }
            FisheyeMapping::Equisolid => 4.0 * self.rim * self.rim,
            FisheyeMapping::Orthographic => self.rim * self.rim / (1.0 - r2).max(1e-12).sqrt(),
            FisheyeMapping::Stereographic => 4.0 * self.rim * self.rim / (1.0 + r2).powi(2),
        }
    }
}

impl PlaneMapping for Fisheye {
    fn size(&self) -> [u32; 2] {
        self.size
    }

    fn pixel_from_direction(&self, direction: DVec3) -> Option<DVec2> {
        let across = direction.x.hypot(direction.y);
        let theta = across.atan2(-direction.z);
        let rho = self.rho_from_theta(theta)?;
        // At the antipode every azimuth is valid; use the one to the right.
        let azimuth = if across > 0.0 { DVec2::new(direction.x, direction.y) / across } else { DVec2::X };
        let p = azimuth * rho * self.radius_px();
        Some(DVec2::new(f64::from(self.size[0]) / 2.0 + p.x, f64::from(self.size[1]) / 2.0 - p.y))
    }

    fn direction_from_pixel(&self, pixel: DVec2) -> Option<DVec3> {
        let p = self.plane_from_pixel(pixel);
        let rho = p.length();
        if rho > 1.0 {
            return None;
        }
        let (sin, cos) = self.theta_from_rho(rho).sin_cos();
        let azimuth = if rho > 0.0 { p / rho } else { DVec2::X };
        Some(DVec3::new(azimuth.x * sin, azimuth.y * sin, -cos))
    }

    fn contains(&self, x: u32, y: u32) -> bool {
        x < self.size[0] && y < self.size[1] && self.plane_from_pixel(pixel_centre(x, y)).length_squared() <= 1.0
    }

    /// Quadrature of the density over the pixel. The value at the pixel's centre is used near the orthographic rim,
    /// where the density grows without bound, and near the rim of the full sphere, where the density ends.
    fn solid_angle_sr(&self, x: u32, y: u32) -> f64 {
        if !self.contains(x, y) {
            return 0.0;
        }
        let centre = self.plane_from_pixel(pixel_centre(x, y));
        let half = DVec2::splat(0.5 / self.radius_px());
        let singular = self.mapping == FisheyeMapping::Orthographic || self.is_full_sphere();
        if singular && self.is_within_rim(x, y) {
            return self.midpoint_solid_angle_sr(x, y);
        }
        integrate_over_rectangle(centre, half, |p| self.density(p.length()))
    }

    fn bounding_cone(&self, margin_px: f64) -> BoundingCone {
        let rho = 1.0 + margin_px / self.radius_px();
        let half_angle_rad = match self.mapping {
            FisheyeMapping::Orthographic if rho * self.rim >= 1.0 => FRAC_PI_2,
            FisheyeMapping::Equisolid if rho * self.rim >= 1.0 => PI,
            _ => self.theta_from_rho(rho).min(PI),
        };
        BoundingCone { axis: DVec3::NEG_Z, half_angle_rad }
    }

    /// From the radial and tangential derivatives of the mapping. Beyond the rim, the derivatives at the rim are used. If the derivative of a mapping
    /// becomes infinite at its end, the angle that its last pixel covers is used.
    fn pixel_extent_rad(&self, direction: DVec3) -> Option<[f64; 2]> {
        let cosine = -direction.z;
        let sine = direction.x.hypot(direction.y);
        let half = (0.5 * (1.0 + cosine)).max(0.0).sqrt();
        let (rim, radius) = (self.rim, self.radius_px());
        let last_pixel = rim * (0.5 / radius).sqrt();
        let (radial, across) = match self.mapping {
            FisheyeMapping::Equidistant => {
                let theta = sine.atan2(cosine);
                (rim, if theta < 1e-3 { rim } else { rim * sine / theta })
            }
            FisheyeMapping::Equisolid => {
                let held = half.max((1.0 - rim * rim).max(0.0).sqrt()).max(last_pixel);
                (2.0 * rim / held, 2.0 * rim * held)
            }
            FisheyeMapping::Orthographic => (rim / cosine.max(self.half_fov_rad.cos()).max(last_pixel), rim),
            FisheyeMapping::Stereographic => {
                let held = half.max((1.0 + rim * rim).sqrt().recip());
                (2.0 * rim * held * held, 2.0 * rim * held * held)
            }
        };
        Some([radial.max(across) / radius, radial.min(across) / radius])
    }

    fn shows_full_sphere(&self) -> bool {
        self.is_full_sphere()
    }

    fn taps(&self, kernel: Footprint<'_>, direction: DVec3) -> Vec<Tap> {
        let Some(centre) = self.pixel_from_direction(direction) else { return Vec::new() };
        let mut taps: Vec<Tap> = kernel(centre).into_iter().filter_map(|tap| self.tap_inside(tap)).collect();
        if self.is_full_sphere() {
            // Nothing lies outside of this picture, so weights beyond the rim belong to the pixels inside.
            let total: f64 = taps.iter().map(|tap| tap.weight).sum();
            for tap in &mut taps {
                tap.weight /= total;
            }
        }
        taps
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn impossible_fields_of_view_are_refused() {
        for (mapping, degrees) in [
            (FisheyeMapping::Equidistant, 400.0),
            (FisheyeMapping::Equisolid, 361.0),
            (FisheyeMapping::Orthographic, 200.0),
            (FisheyeMapping::Stereographic, 360.0),
            (FisheyeMapping::Equidistant, 0.0),
            (FisheyeMapping::Equidistant, f64::NAN),
        ] {
            let error = Fisheye::new([64, 64], mapping, f64::to_radians(degrees)).unwrap_err().to_string();
            assert!(error.contains("fov_deg"), "{error}");
        }
    }

    #[test]
    fn pixel_and_direction_are_inverse() {
        for (mapping, degrees) in [
            (FisheyeMapping::Equidistant, 360.0),
            (FisheyeMapping::Equisolid, 300.0),
            (FisheyeMapping::Orthographic, 180.0),
            (FisheyeMapping::Stereographic, 220.0),
        ] {
            let view = Fisheye::new([300, 200], mapping, f64::to_radians(degrees)).unwrap();
            for pixel in
                [DVec2::new(150.0, 100.0), DVec2::new(180.3, 60.1), DVec2::new(90.0, 120.0), DVec2::new(150.0, 1.0)]
            {
                let back = view.pixel_from_direction(view.direction_from_pixel(pixel).unwrap()).unwrap();
                assert!((back - pixel).length() < 1e-6, "{mapping:?} {pixel} {back}");
            }
            assert_eq!(view.direction_from_pixel(DVec2::new(10.0, 100.0)), None);
        }
    }
}
