//! Bodies: ellipsoids with a surface that reflects the light of the scene's suns, and suns, which give light themselves.
//!
//! Lengths in metres, angles in radians, luminance in cd/m^2, light as linear Rec. 709.

use std::sync::Arc;

use glam::{DQuat, DVec3};

/// How a surface spreads the light that falls on it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default)]
pub enum ReflectionLaw {
    /// Equally bright from everywhere: L = (3 p / 2) E cos(i) / pi.
    Lambert,
    /// Single scattering in a dark, powdery surface: L = 2 p E / pi * cos(i) / (cos(i) + cos(e)). At full phase the disc is flat.
    #[default]
    LommelSeeliger,
}

/// What a surface reflects.
#[derive(Clone, Debug, PartialEq)]
pub struct Surface {
    /// The law.
    pub law: ReflectionLaw,
    /// Geometric albedo, of red, green and blue: a sphere of it at full phase is so many times as bright as a white Lambert disc.
    pub geometric_albedo: [f64; 3],
    /// Factors on the albedo, over the body.
    pub texture: Option<Arc<Texture>>,
}

/// Factors on the albedo of a body, in longitude and latitude: the left edge is longitude -180 degrees, the middle is the body's
/// +x axis, the top is its +z axis; longitude grows to the right, towards +y.
#[derive(Clone, Debug, PartialEq)]
pub struct Texture {
    /// Width and height, texels.
    pub size: [u32; 2],
    /// Linear factors of red, green and blue, 0 to 1, row by row from the top.
    pub rgb: Vec<[f32; 3]>,
}

/// What a body gives off by itself: the same from every point of its surface, but for limb darkening.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Emission {
    /// Luminance at the middle of the disc, as linear Rec. 709, cd/m^2.
    pub luminance_cd_m2: [f64; 3],
    /// Linear limb darkening u: L(mu) = L(1) (1 - u (1 - mu)).
    pub limb_darkening: f64,
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
}

impl Body {
    /// Rotation from the body's axes to world axes at a time, s.
    pub fn world_from_body(&self, time_s: f64) -> DQuat {
        let turns = self.spin.period_s.map_or(0.0, |period_s| (time_s / period_s).rem_euclid(1.0));
        self.orientation * DQuat::from_rotation_z(self.spin.phase_rad + turns * std::f64::consts::TAU)
    }
}
