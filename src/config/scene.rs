//! `[scene]`: catalogues, time, observer and camera.

use std::{
    path::{Path, PathBuf},
    time::SystemTime,
};

use glam::{DQuat, DVec3};
use schemars::JsonSchema;
use serde::de::value::MapAccessDeserializer;
use serde::de::{Error, MapAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize};
use toml::{Table, Value};

use super::look::{Aim, Look};
use super::observer::ObserverConfig;
use super::time::WrittenTime;
use crate::catalogue::bright;
use crate::catalogue::galaxy::GalaxyParameters;
use crate::catalogue::healpix::{BrightnessUnit, LightMap};
use crate::observer::{Frame, Observer};
use crate::ranges::KeyError;
use crate::relativity::MAX_SPEED_C;
use crate::scene::{Camera, PoseError, SceneClock};
use crate::units::J2000_UNIX_S;

/// `[scene]`.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SceneConfig {
    /// Star catalogues, concatenated: `"builtin:bright"`, files (CSV, TSV, ECSV, JSON, VOTable, FITS or Parquet, also compressed with gzip; or stores), `{ galaxy = { ... } }` for synthetic stars, or `{ light = { ... } }` for a map of light that does not come from single stars.
    pub catalogues: Vec<CatalogueConfig>,
    /// Time shown, with its offset from UTC, or `"now"`: spins and ephemerides follow it. Days have 86,400 s; a 60th second is the first of the next
    /// minute. Dates are of the Gregorian calendar, even before 1582. Text may have a signed year from `"-6000-01-01T00:00:00Z"` (year 0 is 1 BC) to
    /// `"+10000-12-31T23:59:59Z"`, end with ` julian` for a date of the Julian calendar, or be a Julian date, `"JD 2451545.0"`, or a modified one,
    /// `"MJD 51544.5"`.
    #[schemars(schema_with = "super::reference::time")]
    pub time: WrittenTime,
    /// Seconds of the scene per real second in `serve`, `show` and `xr`; time runs backwards if it is negative. The default is 1 with `time = "now"`,
    /// otherwise 0.
    #[schemars(range(min = -SceneClock::MOST_RATE, max = SceneClock::MOST_RATE))]
    pub time_rate: f64,
    /// An observer on the Earth; the scene is seen from this place.
    pub observer: Option<ObserverConfig>,
    /// SPK kernels of the SPICE toolkit for bodies with `ephemeris = "spk:NUMBER"`; later files take precedence. The kernels are kept in memory.
    pub kernels: Vec<PathBuf>,
    /// Whether the Sun, the Moon, the planets and their largest moons are among the bodies, at their places at the scene's time. This is the default
    /// if there is an observer. Bodies of the same name, preset or ephemeris replace them.
    pub solar_system: Option<bool>,
    /// Whether the zodiacal light and the gegenschein are drawn, as seen from the Earth. They require an observer and the Solar System, and are drawn
    /// by default if both are present.
    pub zodiacal_light: Option<bool>,
    /// Whether ten variable stars of `builtin:bright`, such as Algol, delta Cephei and Mira, have the brightness that they have at the scene's time,
    /// see [catalogues.md](catalogues.md#variable-stars).
    pub variable_stars: bool,
    /// Initial camera pose and velocity.
    pub camera: CameraConfig,
}

impl Default for SceneConfig {
    fn default() -> Self {
        Self {
            catalogues: vec![CatalogueConfig::Named("builtin:bright".to_owned())],
            time: default_time(),
            time_rate: 0.0,
            observer: None,
            kernels: Vec::new(),
            solar_system: None,
            zodiacal_light: None,
            variable_stars: false,
            camera: CameraConfig::default(),
        }
    }
}

/// Replaces `scene.time = "now"` by the current time, so that the same pictures can be made again. The default time rate is then 1.
pub(super) fn set_now(document: &mut Table, now: SystemTime) {
    let Some(scene) = document.get_mut("scene").and_then(Value::as_table_mut) else { return };
    if scene.get("time").and_then(Value::as_str) != Some("now") {
        return;
    }
    let unix_s = now.duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default().as_secs_f64();
    if let Some(time) = WrittenTime::new(unix_s - J2000_UNIX_S) {
        scene.insert("time".to_owned(), time.to_value());
        scene.entry("time_rate").or_insert(Value::Float(1.0));
    }
}

/// 2026-01-01T00:00:00Z.
const DEFAULT_TIME_S: f64 = 820_497_600.0;

#[allow(clippy::expect_used, reason = "the moment is a constant, and a test reads it")]
fn default_time() -> WrittenTime {
    WrittenTime::new(DEFAULT_TIME_S).expect("a scene may have this time")
}

/// One entry of `catalogues`.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum CatalogueConfig {
    /// Synthetic stars.
    Galaxy(GalaxyParameters),
    /// A map of light.
    Light(LightConfig),
    /// `builtin:bright`, or a file: CSV, TSV, ECSV, JSON, VOTable, FITS or Parquet, also compressed with gzip, or a store. Relative paths start at the configuration's folder.
    #[serde(untagged)]
    Named(String),
}

/// A map of light that does not come from single stars. It replaces the map of the synthetic galaxy. The file is a FITS file of HEALPix cells, nested
/// or in rings, in celestial or galactic coordinates. Cells without a value (UNSEEN) give no light.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LightConfig {
    /// The file. Relative paths start at the configuration's folder.
    pub file: PathBuf,
    /// Unit of the numbers.
    pub unit: LightUnit,
    /// Colour of the whole map, as the B-V of a star with the same colour, magnitudes.
    #[serde(default = "background_b_v")]
    #[schemars(range(min = -0.5, max = 3.0), extend("x-unit" = "magnitudes"))]
    pub b_v: f64,
}

/// Unit of a map of light.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum LightUnit {
    /// Luminance.
    CdM2,
    /// Stars of V = 10 per square degree.
    S10,
    /// V magnitudes per square arcsecond.
    MagArcsec2,
}

fn background_b_v() -> f64 {
    0.8
}

impl LightConfig {
    /// The map, whose path is relative to `folder`.
    pub(super) fn map(&self, folder: &Path) -> LightMap {
        let unit = match self.unit {
            LightUnit::CdM2 => BrightnessUnit::Luminance,
            LightUnit::S10 => BrightnessUnit::S10,
            LightUnit::MagArcsec2 => BrightnessUnit::MagnitudePerArcsec2,
        };
        LightMap { path: folder.join(&self.file), unit, b_v: self.b_v }
    }
}

impl<'de> Deserialize<'de> for CatalogueConfig {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(CatalogueVisitor)
    }
}

struct CatalogueVisitor;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct CatalogueEntry {
    galaxy: Option<GalaxyParameters>,
    light: Option<LightConfig>,
}

impl<'de> Visitor<'de> for CatalogueVisitor {
    type Value = CatalogueConfig;

    fn expecting(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter
            .write_str("\"builtin:bright\", a file, or { galaxy = { stars = 300000, seed = 1, fainter_than = 6.5 } }, or { light = { file = \"sky.fits\", unit = \"s10\" } }")
    }

    fn visit_str<E: Error>(self, name: &str) -> Result<CatalogueConfig, E> {
        match name.strip_prefix("builtin:") {
            _ if name.is_empty() => Err(E::custom("the name is empty: must be \"builtin:bright\" or a file")),
            Some("bright") | None => Ok(CatalogueConfig::Named(name.to_owned())),
            Some("galaxy") => Err(E::custom(
                "`builtin:galaxy` needs parameters: write { galaxy = { stars = 300000, seed = 1, fainter_than = 6.5 } }",
            )),
            Some(_) => Err(E::custom(format!("unknown built-in catalogue `{name}`: must be `builtin:bright`"))),
        }
    }

    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<CatalogueConfig, A::Error> {
        match CatalogueEntry::deserialize(MapAccessDeserializer::new(map))? {
            CatalogueEntry { galaxy: Some(galaxy), light: None } => Ok(CatalogueConfig::Galaxy(galaxy)),
            CatalogueEntry { galaxy: None, light: Some(light) } => Ok(CatalogueConfig::Light(light)),
            _ => Err(A::Error::custom("a catalogue of this kind has one key: galaxy or light")),
        }
    }
}

/// `[scene.camera]`.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct CameraConfig {
    /// Position, ICRS, barycentric; the origin by default.
    pub position_m: Option<[f64; 3]>,
    /// Unit quaternion from camera axes (+x right, +y up, looking along -z) to ICRS axes; the identity by default.
    pub orientation: Option<[f64; 4]>,
    /// Direction of the camera, instead of `orientation`. The horizon frame needs an observer.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub look: Option<Look>,
    /// Velocity, ICRS axes; the speed is at most 0.9999.
    #[schemars(inner(range(min = -MAX_SPEED_C, max = MAX_SPEED_C)))]
    pub velocity_c: Option<[f64; 3]>,
}

impl From<&Camera> for CameraConfig {
    fn from(camera: &Camera) -> Self {
        Self {
            position_m: Some(camera.position_m.to_array()),
            orientation: Some(camera.world_from_camera.to_array()),
            look: None,
            velocity_c: Some(camera.velocity_c.to_array()),
        }
    }
}

impl CameraConfig {
    /// Returns the direction that `look` gives; an error names the key below `scene.camera`.
    fn aim(&self) -> Result<Option<Aim>, KeyError> {
        let Some(look) = &self.look else { return Ok(None) };
        if self.orientation.is_some() {
            return Err(KeyError::new("look", "orientation is also given: give at most one of orientation and look"));
        }
        let aim = look.aim().map_err(|fault| fault.within("look"))?;
        if aim.frame == Frame::Horizon {
            let problem = "horizon: needs an observer: write [scene.observer] instead of [scene.camera]";
            return Err(KeyError::new("look.frame", problem));
        }
        Ok(Some(aim))
    }

    /// Returns the camera with this position and orientation; an error names the key below `scene.camera`.
    pub(super) fn camera(&self, position_m: Option<DVec3>, turned: Option<DQuat>) -> Result<Camera, KeyError> {
        let position_m = position_m.map_or(self.position_m.unwrap_or_default(), |place_m| place_m.to_array());
        let orientation = turned.unwrap_or_default().to_array();
        let orientation = self.orientation.unwrap_or(orientation);
        Camera::new(position_m, orientation, self.velocity_c.unwrap_or_default()).map_err(|error| {
            let key = match &error {
                PoseError::NotFinite { key, .. } => key,
                PoseError::TooFar { .. } => "position_m",
                PoseError::NotUnit { .. } => "orientation",
                PoseError::TooFast { .. } => "velocity_c",
            };
            KeyError::new(key, error.to_string())
        })
    }
}

impl SceneConfig {
    /// Checks the rules beyond types and ranges; an error names the key below `scene`.
    pub(super) fn check(&self) -> Result<(), KeyError> {
        if let Some(observer) = &self.observer {
            observer.check_surroundings().map_err(|fault| fault.within("observer"))?;
        }
        if self.observer.is_some() && self.camera != CameraConfig::default() {
            let problem = "scene.observer is also given, and determines the camera's position and direction: give only one of them";
            return Err(KeyError::new("camera", problem));
        }
        if self.zodiacal_light == Some(true) && !self.may_have_zodiacal_light() {
            let problem = "has no effect: the zodiacal light is drawn as seen from the Earth, so it requires scene.observer and the Solar System";
            return Err(KeyError::new("zodiacal_light", problem));
        }
        let is_bright =
            |catalogue: &CatalogueConfig| matches!(catalogue, CatalogueConfig::Named(name) if name == bright::NAME);
        if self.variable_stars && !self.catalogues.iter().any(is_bright) {
            let problem =
                "has no effect: the variable stars belong to \"builtin:bright\", which scene.catalogues does not list";
            return Err(KeyError::new("variable_stars", problem));
        }
        Ok(())
    }

    /// [`Self::time`] in s since 2000-01-01T12:00:00Z. Days have 86,400 s: leap seconds are left out, and a 60th second is
    /// the first of the next minute.
    pub fn time_s(&self) -> f64 {
        self.time.time_s()
    }

    /// Returns the direction of the camera if `look` or the observer's keys give it; an error names the key below `scene`.
    pub(super) fn aim(&self) -> Result<Option<Aim>, KeyError> {
        match &self.observer {
            Some(observer) => observer.aim().map(Some).map_err(|fault| fault.within("observer")),
            None => self.camera.aim().map_err(|fault| fault.within("camera")),
        }
    }

    /// The observer on the Earth, if there is one.
    pub(super) fn observer(&self) -> Option<Observer> {
        self.observer.as_ref().map(|observer| Observer::new(observer.place(), observer.clock(), self.time_s()))
    }

    /// Whether the bodies of the Solar System are part of the scene.
    pub(super) fn has_zodiacal_light(&self) -> bool {
        self.zodiacal_light.unwrap_or(true) && self.may_have_zodiacal_light()
    }

    fn may_have_zodiacal_light(&self) -> bool {
        self.observer.is_some() && self.has_solar_system()
    }

    pub(super) fn has_solar_system(&self) -> bool {
        self.solar_system.unwrap_or(self.observer.is_some())
    }
}
