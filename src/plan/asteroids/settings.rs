//! The settings of asteroid fields.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};

/// What stands in for the mesh of an asteroid that is far enough away.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize, Default)]
#[serde(rename_all = "snake_case")]
pub enum ImpostorMethod {
    /// The best of ours.
    #[default]
    Auto,
    /// Nothing: meshes at every distance, down to points.
    None,
    /// Published: an atlas over pitch and yaw, chosen by the camera's orientation, rolled on a square parallel to the image plane.
    EulerAtlas,
    /// An octahedral atlas; the nearest tile, chosen by the eye's place, on a square that faces the eye.
    Octahedral,
    /// The same with three tiles blended, moved by their depth.
    OctahedralBlend,
}

impl ImpostorMethod {
    /// All of them.
    pub const ALL: [Self; 5] = [Self::Auto, Self::None, Self::EulerAtlas, Self::Octahedral, Self::OctahedralBlend];

    /// Name in configurations and charts.
    pub fn name(self) -> &'static str {
        match self {
            Self::Auto => "auto",
            Self::None => "none",
            Self::EulerAtlas => "euler_atlas",
            Self::Octahedral => "octahedral",
            Self::OctahedralBlend => "octahedral_blend",
        }
    }

    /// The method of a name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|method| method.name() == name)
    }

    /// What draws: no `auto`.
    pub fn chosen(self) -> Self {
        if self == Self::Auto { Self::OctahedralBlend } else { self }
    }
}

/// Where instances are tested against viewports.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize, Default)]
#[serde(rename_all = "snake_case")]
pub enum Culling {
    /// On the adapter, for all viewports at once.
    #[default]
    Gpu,
    /// On the CPU, one instance after the other, as renderers without compute shaders do.
    Cpu,
}

/// `[asteroids]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct AsteroidSettings {
    /// What stands in for far meshes.
    pub impostor: ImpostorMethod,
    /// Where instances are culled.
    pub culling: Culling,
    /// Factor on the distances at which detail is left out: 1 keeps every error below half a pixel.
    pub quality: f64,
    /// Tiles along a side of an impostor atlas.
    pub tiles: u32,
    /// Pixels along a side of a tile.
    pub tile_px: u32,
    /// Samples along each side of a pixel.
    pub samples: u32,
    /// Whether only the finest mesh is drawn, for every asteroid: what the others are compared with.
    pub finest_only: bool,
    /// Where baked atlases are kept; empty: nowhere.
    pub cache: PathBuf,
}

impl Default for AsteroidSettings {
    fn default() -> Self {
        Self {
            impostor: ImpostorMethod::Auto,
            culling: Culling::Gpu,
            quality: 1.0,
            tiles: 32,
            tile_px: 32,
            samples: 2,
            finest_only: false,
            cache: PathBuf::new(),
        }
    }
}

/// Qualities that are allowed.
const QUALITIES: [f64; 2] = [0.1, 10.0];

impl AsteroidSettings {
    /// Checks every number.
    ///
    /// # Errors
    ///
    /// The key at fault, and what is allowed.
    pub fn check(&self) -> Result<(), (&'static str, String)> {
        Self::check_quality(self.quality)?;
        for (key, value, [least, most]) in [("tiles", self.tiles, [4, 64]), ("tile_px", self.tile_px, [8, 256])] {
            if !(value.is_power_of_two() && (least..=most).contains(&value)) {
                return Err((key, format!("{value}: allowed are powers of two from {least} to {most}")));
            }
        }
        if !(1..=4).contains(&self.samples) {
            return Err(("samples", format!("{}: allowed are 1 to 4", self.samples)));
        }
        Ok(())
    }

    /// Checks a quality.
    ///
    /// # Errors
    ///
    /// The key, and what is allowed.
    pub fn check_quality(quality: f64) -> Result<(), (&'static str, String)> {
        let [least, most] = QUALITIES;
        if (least..=most).contains(&quality) {
            return Ok(());
        }
        Err(("quality", format!("{quality}: allowed are {least} to {most}")))
    }
}
