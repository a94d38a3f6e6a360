//! `[scene]`: what there is to see, when, and from where.

use serde::de::value::MapAccessDeserializer;
use serde::de::{Error, MapAccess, Visitor};
use serde::{Deserialize, Deserializer};
use toml::value::Datetime;

use super::error::Fault;
use crate::catalogue::galaxy::MOST_STARS;
use crate::scene::{Camera, PoseError};

/// `[scene]`.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SceneConfig {
    /// Star catalogues; they add up.
    pub catalogues: Vec<CatalogueConfig>,
    /// The moment that is shown, with its offset from UTC: spins and orbits follow it.
    pub time: Datetime,
    /// The camera at the start.
    pub camera: CameraConfig,
}

impl Default for SceneConfig {
    fn default() -> Self {
        Self {
            catalogues: vec![CatalogueConfig::Named("builtin:bright".to_owned())],
            time: default_time(),
            camera: CameraConfig::default(),
        }
    }
}

/// 2026-01-01T00:00:00Z.
fn default_time() -> Datetime {
    Datetime {
        date: Some(toml::value::Date { year: 2026, month: 1, day: 1 }),
        time: Some(toml::value::Time { hour: 0, minute: 0, second: Some(0), nanosecond: None }),
        offset: Some(toml::value::Offset::Z),
    }
}

/// One entry of `catalogues`.
#[derive(Clone, Debug, PartialEq)]
pub enum CatalogueConfig {
    /// `builtin:bright`, or a file: CSV, JSON or a store. Relative paths start at the configuration's folder.
    Named(String),
    /// `{ galaxy = { stars, seed, fainter_than } }`: synthetic stars.
    Galaxy(GalaxyConfig),
}

/// A synthetic galaxy.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GalaxyConfig {
    /// Number of stars: the brightest of the model, as seen from the Sun.
    pub stars: usize,
    /// Seed of the random numbers.
    #[serde(default = "one")]
    pub seed: u64,
    /// No star is brighter than this apparent V magnitude: the real bright stars come from a catalogue.
    pub fainter_than: Option<f64>,
}

fn one() -> u64 {
    1
}

impl<'de> Deserialize<'de> for CatalogueConfig {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(CatalogueVisitor)
    }
}

struct CatalogueVisitor;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct GalaxyEntry {
    galaxy: GalaxyConfig,
}

impl<'de> Visitor<'de> for CatalogueVisitor {
    type Value = CatalogueConfig;

    fn expecting(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter
            .write_str("\"builtin:bright\", a file, or { galaxy = { stars = 300000, seed = 1, fainter_than = 3.5 } }")
    }

    fn visit_str<E: Error>(self, name: &str) -> Result<CatalogueConfig, E> {
        match name.strip_prefix("builtin:") {
            _ if name.is_empty() => Err(E::custom("an empty name: allowed are \"builtin:bright\" and files")),
            Some("bright") | None => Ok(CatalogueConfig::Named(name.to_owned())),
            Some("galaxy") => Err(E::custom(
                "`builtin:galaxy` needs its numbers: write { galaxy = { stars = 300000, seed = 1, fainter_than = 3.5 } }",
            )),
            Some(_) => Err(E::custom(format!("unknown built-in catalogue `{name}`: allowed is `builtin:bright`"))),
        }
    }

    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<CatalogueConfig, A::Error> {
        let entry = GalaxyEntry::deserialize(MapAccessDeserializer::new(map))?;
        Ok(CatalogueConfig::Galaxy(entry.galaxy))
    }
}

/// `[scene.camera]`.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct CameraConfig {
    /// ICRS barycentric position, m.
    pub position_m: [f64; 3],
    /// Unit quaternion x, y, z, w from view axes to world axes.
    pub orientation: [f64; 4],
    /// Velocity in units of the speed of light, ICRS axes; at most 0.9999.
    pub velocity_c: [f64; 3],
}

impl Default for CameraConfig {
    fn default() -> Self {
        Self { position_m: [0.0; 3], orientation: [0.0, 0.0, 0.0, 1.0], velocity_c: [0.0; 3] }
    }
}

impl CameraConfig {
    /// The camera; a fault names the key below `scene.camera`.
    pub(super) fn camera(&self) -> Result<Camera, Fault> {
        Camera::new(self.position_m, self.orientation, self.velocity_c).map_err(|error| {
            let key = match &error {
                PoseError::NotFinite { key, .. } => key,
                PoseError::NotUnit { .. } => "orientation",
                PoseError::TooFast { .. } => "velocity_c",
            };
            Fault::new(key, error.to_string())
        })
    }
}

impl SceneConfig {
    /// Checks what types alone do not say; a fault names the key below `scene`.
    pub(super) fn check(&self) -> Result<(), Fault> {
        for (index, catalogue) in self.catalogues.iter().enumerate() {
            if let CatalogueConfig::Galaxy(galaxy) = catalogue {
                galaxy.check().map_err(|fault| fault.within(&format!("catalogues[{index}].galaxy")))?;
            }
        }
        if self.time.date.is_none() || self.time.time.is_none() || self.time.offset.is_none() {
            let problem = format!("{}: date, time and offset are needed, for instance 2026-01-01T00:00:00Z", self.time);
            return Err(Fault::new("time", problem));
        }
        self.camera.camera().map_err(|fault| fault.within("camera"))?;
        Ok(())
    }
}

impl GalaxyConfig {
    fn check(&self) -> Result<(), Fault> {
        if self.stars == 0 || self.stars > MOST_STARS {
            return Err(Fault::new("stars", format!("{}: allowed are 1 to {MOST_STARS}", self.stars)));
        }
        match self.fainter_than {
            Some(magnitude) if !magnitude.is_finite() => Err(Fault::new(
                "fainter_than",
                format!("{magnitude}: a finite magnitude is needed; leave the key out for no limit"),
            )),
            _ => Ok(()),
        }
    }
}
