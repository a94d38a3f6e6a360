//! Bodies: ellipsoids with a surface that reflects the light of the scene's suns, and suns, which give light
//! themselves.
//!
//! Lengths in metres, angles in radians, luminance in cd/m^2, light as linear Rec. 709.
//!
//! An ellipsoid is the unit sphere, stretched along its axes: a point of its surface is named by the point of the
//! sphere that it comes from (`seen`). The light of a sun comes from its middle, and falls on all of a body from one
//! direction and with one illuminance, those at the body's middle: suns are far away, measured by the bodies they
//! light. What bodies reflect falls on others in the same way (the light of the Earth on the Moon). Of the shadows that fall on a body (`shadow`) the deepest one of each sun counts.

mod check;
mod emission;
mod preset;
mod seen;
mod shadow;
mod suns;
mod texture;

use std::sync::Arc;

use glam::{DQuat, DVec3};

pub(super) use self::check::{check_albedo, check_position};
pub use self::{
    preset::{SUN_ABSOLUTE_MAGNITUDE, SUN_LIMB_DARKENING},
    check::{
        BRIGHTEST_ALBEDO, BodyError, FARTHEST_M, MOST_BODIES, MOST_SUNS, RADII_M, check_name, check_names, check_suns,
    },
    seen::{Hit, SeenBody, hides},
    shadow::{Occluder, Shadow, hidden_share},
    suns::{Light, Sun, lights_on, mean_radius_m, reflected_lx, suns},
    texture::Texture,
};
pub use crate::{ephemeris::Ephemeris, photometry::reflection::ReflectionLaw, solar_system::SolarBody};

/// What a surface reflects.
#[derive(Clone, Debug, PartialEq)]
pub struct Surface {
    /// The law.
    pub law: ReflectionLaw,
    /// Geometric albedo, of red, green and blue: a sphere of it at full phase is so many times as bright as a white
    /// Lambert disc.
    pub geometric_albedo: [f64; 3],
    /// The body whose measured phase curve its light follows; `None`: it follows the law.
    pub phase_curve: Option<SolarBody>,
    /// Factors on the albedo, over the body.
    pub texture: Option<Arc<Texture>>,
}

/// What a body gives off by itself: the same from every point of its surface, but for limb darkening.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Emission {
    /// Luminance at the middle of the disc, as linear Rec. 709, cd/m^2.
    pub luminance_cd_m2: [f64; 3],
    /// Linear limb darkening u: L(mu) = L(1) (1 - u (1 - mu)).
    pub limb_darkening: f64,
    /// Whether there is a corona around it ([`crate::photometry::corona`]).
    pub corona: bool,
}

/// How a body turns around its +z axis.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Spin {
    /// Sidereal period, s; negative turns the other way, `None` does not turn.
    pub period_s: Option<f64>,
    /// Turn at time 0, rad.
    pub phase_rad: f64,
}

/// An ellipsoid.
#[derive(Clone, Debug, PartialEq)]
pub struct Body {
    /// Unique among the bodies of a scene.
    pub name: String,
    /// What says where it is: the scene's moment gives its position ([`SceneObjects::at`](crate::scene::SceneObjects::at)). As a body of the Solar System it also stands as that does, and
    /// has no spin of its own.
    pub ephemeris: Option<Ephemeris>,
    /// Its centre: ICRS, barycentric, m.
    pub position_m: DVec3,
    /// Semi-axes along its x, y and z, m.
    pub radii_m: DVec3,
    /// Rotation from the body's axes to world axes before it turns.
    pub orientation: DQuat,
    /// How it turns.
    pub spin: Spin,
    /// What it reflects.
    pub surface: Surface,
    /// What it gives off; `None`: no sun.
    pub emission: Option<Emission>,
    /// Share of its light that reaches the eye, by channel: 1 but where air is between ([`SceneObjects::seen_from`](crate::scene::SceneObjects::seen_from)).
    pub seen_through: [f64; 3],
}

impl Body {
    /// Angular radius of its largest semi-axis for an eye at a place, m; rad, a quarter turn at most.
    pub fn angular_radius_rad(&self, eye_m: DVec3) -> f64 {
        (self.radii_m.max_element() / (self.position_m - eye_m).length()).min(1.0).asin()
    }

    /// Rotation from the body's axes to world axes at a time, s.
    pub fn world_from_body(&self, time_s: f64) -> DQuat {
        let turns = self.spin.period_s.map_or(0.0, |period_s| (time_s / period_s).rem_euclid(1.0));
        self.orientation * DQuat::from_rotation_z(self.spin.phase_rad + turns * std::f64::consts::TAU)
    }
}
