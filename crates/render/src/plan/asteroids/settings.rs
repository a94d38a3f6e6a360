//! Settings of asteroid fields.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::tiles::AtlasLayout;

/// Method that replaces the mesh of a distant asteroid.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize, Default, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum ImpostorMethod {
    /// `octahedral_splat`.
    #[default]
    Auto,
    /// No impostors: asteroids are drawn as meshes until they are small enough for points.
    None,
    /// The published method: an atlas over pitch and yaw, whose tile is selected by the orientation of the camera and drawn on a quad parallel to the
    /// image plane.
    EulerAtlas,
    /// An octahedral atlas: the tile nearest to the direction of the eye is drawn on a quad that faces the eye.
    Octahedral,
    /// An octahedral atlas: three tiles are blended, each with parallax from its depth.
    OctahedralBlend,
    /// As `octahedral_blend`, but splatted sample by sample, and from a single tile if its error is below half a pixel. Hidden asteroids are skipped.
    OctahedralSplat,
}

named!(ImpostorMethod {
    Auto = "auto",
    None = "none",
    EulerAtlas = "euler_atlas",
    Octahedral = "octahedral",
    OctahedralBlend = "octahedral_blend",
    OctahedralSplat = "octahedral_splat",
});

impl ImpostorMethod {
    /// The method that is used; never `auto`.
    pub fn chosen(self) -> Self {
        if self == Self::Auto { Self::OctahedralSplat } else { self }
    }
}

/// Where instances are culled.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize, Default, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Culling {
    /// On the GPU, for all viewports in one pass.
    #[default]
    Gpu,
    /// On the CPU, instance by instance, as renderers without compute shaders do.
    Cpu,
}

/// `[asteroids]`: how asteroids are drawn.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct AsteroidSettings {
    /// Impostor method, see [asteroid-methods.md](asteroid-methods.md).
    pub impostor: ImpostorMethod,
    /// Where instances are culled.
    pub culling: Culling,
    /// Factor on the level-of-detail distances; 1 keeps every error below half a pixel.
    #[schemars(range(min = AsteroidSettings::QUALITIES[0], max = AsteroidSettings::QUALITIES[1]))]
    pub quality: f64,
    /// Tiles along a side of an impostor atlas, a power of two.
    #[schemars(range(min = AsteroidSettings::TILES[0], max = AsteroidSettings::TILES[1]), extend("x-also" = "a power of two"))]
    pub tiles: u32,
    /// Pixels along a side of a tile, a power of two.
    #[schemars(range(min = AsteroidSettings::TILE_PX[0], max = AsteroidSettings::TILE_PX[1]), extend("x-unit" = "pixels", "x-also" = "a power of two"))]
    pub tile_px: u32,
    /// Samples along each axis of a pixel: samples² per pixel.
    #[schemars(range(min = AsteroidSettings::SAMPLES[0], max = AsteroidSettings::SAMPLES[1]))]
    pub samples: u32,
    /// Draws every asteroid with the finest mesh, as a reference.
    pub finest_only: bool,
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
        }
    }
}

impl AsteroidSettings {
    /// Range of `quality`.
    pub const QUALITIES: [f64; 2] = [0.1, 10.0];
    /// Range of `tiles`, powers of two.
    pub const TILES: [f64; 2] = [4.0, 64.0];
    /// Range of `tile_px`, powers of two.
    pub const TILE_PX: [f64; 2] = [8.0, 256.0];
    /// Range of `samples`.
    pub const SAMPLES: [f64; 2] = [1.0, 4.0];

    /// The impostor method, never `auto`; `None`: asteroids have no impostors.
    pub fn drawn_impostors(&self) -> Option<ImpostorMethod> {
        Some(self.impostor.chosen()).filter(|method| !self.finest_only && *method != ImpostorMethod::None)
    }

    /// Memory that an atlas of this number of shapes takes on the adapter, bytes. It holds normals and surfaces, each with four bytes per texel and a
    /// chain of mipmaps.
    pub fn atlas_bytes(&self, shapes: usize) -> u64 {
        let side = u64::from(self.tiles) * u64::from(self.tile_px);
        match AtlasLayout::for_method(self.impostor) {
            Some(_) if !self.finest_only => shapes as u64 * side * side * 8 * 4 / 3,
            _ => 0,
        }
    }

    /// Checks every number.
    ///
    /// # Errors
    ///
    /// The invalid key, and the valid values.
    pub fn check(&self) -> Result<(), (&'static str, String)> {
        Self::check_quality(self.quality)?;
        for (key, value, [least, most]) in
            [("tiles", self.tiles, Self::TILES), ("tile_px", self.tile_px, Self::TILE_PX)]
        {
            if !(value.is_power_of_two() && (least..=most).contains(&f64::from(value))) {
                return Err((key, format!("{value}: must be a power of two from {least} to {most}")));
            }
        }
        let [least, most] = Self::SAMPLES;
        if !(least..=most).contains(&f64::from(self.samples)) {
            return Err(("samples", format!("{}: must be between {least} and {most}", self.samples)));
        }
        Ok(())
    }

    /// Checks a quality.
    ///
    /// # Errors
    ///
    /// The key, and the valid values.
    pub fn check_quality(quality: f64) -> Result<(), (&'static str, String)> {
        let [least, most] = Self::QUALITIES;
        if (least..=most).contains(&quality) {
            return Ok(());
        }
        Err(("quality", format!("{quality}: must be between {least} and {most}")))
    }
}
