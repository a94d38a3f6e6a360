//! Bodies: ellipsoids with a surface that reflects the light of the scene's suns, and suns, which emit light.
//!
//! Lengths in metres, angles in radians, luminance in cd/m^2, light as linear Rec. 709.
//!
//! An ellipsoid is the unit sphere, stretched along its axes: a point of its surface is identified by the corresponding point of the sphere (`seen`).
//! The light of a sun comes from the sun's centre. It falls on the whole body from one direction and with one illuminance, which are computed for the
//! body's centre: suns are far away compared with the size of the bodies that they light. Light reflected by bodies falls on others in the same way
//! (the light of the Earth on the Moon). Of the shadows of each sun on a body (`shadow`), only the deepest counts.

mod check;
mod emission;
mod preset;
mod seen;
mod shadow;
mod shape;
mod suns;
mod texture;

use std::sync::Arc;

use glam::{DQuat, DVec3};

pub(super) use self::check::{check_albedo, check_position};
pub use self::{
    check::{BRIGHTEST_ALBEDO, FARTHEST_M, MOST_BODIES, MOST_SUNS, RADII_M, check_name, check_names, check_suns},
    preset::{SUN_ABSOLUTE_MAGNITUDE, SUN_LIMB_DARKENING},
    seen::{Hit, SeenBody, hides},
    shadow::{Occluder, Shadow, hidden_share},
    suns::{Light, Sun, lights_on, mean_radius_m, reflected_lx, suns},
    texture::Texture,
};
pub use crate::{ephemeris::Ephemeris, photometry::reflection::ReflectionLaw, solar_system::SolarBody};

/// Reflection properties of a surface.
#[derive(Clone, Debug, PartialEq)]
pub struct Surface {
    /// The reflection law.
    pub law: ReflectionLaw,
    /// Geometric albedo for red, green and blue: brightness of a sphere at full phase relative to a white Lambert disc
    /// of the same size.
    pub geometric_albedo: [f64; 3],
    /// The body whose measured phase curve the brightness follows; `None`: the reflection law.
    pub phase_curve: Option<SolarBody>,
    /// Albedo factors over the body.
    pub texture: Option<Arc<Texture>>,
}

/// Light emitted by a body: the same at every point of its surface, except for limb darkening.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Emission {
    /// Luminance at the middle of the disc, as linear Rec. 709, cd/m^2.
    pub luminance_cd_m2: [f64; 3],
    /// Linear limb darkening u: L(mu) = L(1) (1 - u (1 - mu)).
    pub limb_darkening: f64,
    /// Whether it has a corona ([`crate::photometry::corona`]).
    pub corona: bool,
}

/// Rotation of a body around its +z axis.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Spin {
    /// Sidereal period, s; negative for retrograde rotation, `None` for no rotation.
    pub period_s: Option<f64>,
    /// Rotation angle at time 0, rad.
    pub phase_rad: f64,
}

/// An ellipsoid.
#[derive(Clone, Debug, PartialEq)]
pub struct Body {
    /// Unique among the bodies of a scene.
    pub name: String,
    /// Ephemeris that gives its position at the scene's time ([`SceneObjects::at`](crate::scene::SceneObjects::at)). A body of the Solar System also
    /// takes its orientation from there; its spin is then left at the default.
    pub ephemeris: Option<Ephemeris>,
    /// Its centre: ICRS, barycentric, m.
    pub position_m: DVec3,
    /// Semi-axes along its x, y and z, m.
    pub radii_m: DVec3,
    /// Rotation from the body's axes to world axes, without its spin.
    pub orientation: DQuat,
    /// Its rotation.
    pub spin: Spin,
    /// Its reflection properties.
    pub surface: Surface,
    /// Emitted light; `None` if it is not a sun.
    pub emission: Option<Emission>,
    /// Transmittance between the body and the eye, by channel: 1 except through air
    /// ([`SceneObjects::seen_from`](crate::scene::SceneObjects::seen_from)).
    pub seen_through: [f64; 3],
}

impl Body {
    /// Angular radius of its largest semi-axis as seen from `eye_m`, rad; at most pi / 2.
    pub fn angular_radius_rad(&self, eye_m: DVec3) -> f64 {
        (self.radii_m.max_element() / (self.position_m - eye_m).length()).min(1.0).asin()
    }

    /// Rotation from the body's axes to world axes at a time, s.
    pub fn world_from_body(&self, time_s: f64) -> DQuat {
        let turns = self.spin.period_s.map_or(0.0, |period_s| (time_s / period_s).rem_euclid(1.0));
        self.orientation * DQuat::from_rotation_z(self.spin.phase_rad + turns * std::f64::consts::TAU)
    }
}
