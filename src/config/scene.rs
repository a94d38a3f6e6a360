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
use toml::value::{Date, Datetime, Offset, Time};
use toml::{Table, Value};

use super::error::Fault;
use super::look::{Aim, Look};
use super::observer::ObserverConfig;
use crate::catalogue::galaxy::MOST_STARS;
use crate::catalogue::healpix::{BrightnessUnit, LightMap};
use crate::observer::{Frame, Observer};
use crate::relativity::MAX_SPEED_C;
use crate::scene::{Camera, PoseError, SceneClock};
use crate::units::J2000_UNIX_S;

/// `[scene]`.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SceneConfig {
    /// Star catalogues, concatenated: `"builtin:bright"`, files (CSV, JSON or stores), `{ galaxy = { ... } }` for synthetic stars, or `{ light = { ... } }` for a map of light that does not come from single stars.
    pub catalogues: Vec<CatalogueConfig>,
    /// Time shown, with its offset from UTC, or `"now"`: spins and ephemerides follow it. Days have 86,400 s; a 60th second is the first of the next minute.
    #[schemars(schema_with = "super::reference::time")]
    pub time: Datetime,
    /// Seconds of the scene per real second in `serve`, `show` and `xr`; negative: backwards. The default is 1 with `time = "now"`, otherwise 0.
    #[schemars(range(min = -SceneClock::MOST_RATE, max = SceneClock::MOST_RATE))]
    pub time_rate: f64,
    /// A place on the Earth from where the scene is seen.
    pub observer: Option<ObserverConfig>,
    /// SPK kernels of the SPICE toolkit for bodies with `ephemeris = "spk:NUMBER"`; later files take precedence. They are held in memory.
    pub kernels: Vec<PathBuf>,
    /// Whether the Sun, the Moon, the planets and their largest moons are among the bodies, at their places at the scene's time; by default if there is an observer. Bodies of the same name, preset or
    /// ephemeris replace them.
    pub solar_system: Option<bool>,
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
            camera: CameraConfig::default(),
        }
    }
}

/// Replaces `scene.time = "now"` by the present time, with a time rate of 1, so that the configuration that was used can be used again.
pub(super) fn set_now(document: &mut Table, now: SystemTime) {
    let Some(scene) = document.get_mut("scene").and_then(Value::as_table_mut) else { return };
    if scene.get("time").and_then(Value::as_str) != Some("now") {
        return;
    }
    let unix_s = now.duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default().as_secs_f64();
    if let Some(time) = written_time(unix_s - J2000_UNIX_S) {
        scene.insert("time".to_owned(), Value::Datetime(time));
        scene.entry("time_rate").or_insert(Value::Float(1.0));
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
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum CatalogueConfig {
    /// Synthetic stars.
    Galaxy(GalaxyConfig),
    /// A map of light.
    Light(LightConfig),
    /// `builtin:bright`, or a file: CSV, JSON or a store. Relative paths start at the configuration's folder.
    #[serde(untagged)]
    Named(String),
}

/// A synthetic Milky Way whose star counts follow those of the real sky.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GalaxyConfig {
    /// Number of stars: the brightest ones of the model, as seen from the Sun.
    #[schemars(range(min = 1, max = MOST_STARS))]
    pub stars: usize,
    /// Seed of the random number generator.
    #[serde(default = "one")]
    pub seed: u64,
    /// Stars brighter than this apparent V magnitude are left out, so that a catalogue can provide them; absent: no limit.
    pub fainter_than: Option<f64>,
    /// Whether the light of all fainter stars is seen, the band of the Milky Way and the Magellanic Clouds.
    #[serde(default = "yes")]
    pub unresolved_light: bool,
}

/// A map of light that does not come from single stars, instead of that of the galaxy: HEALPix cells in a FITS file, nested, in celestial coordinates, with one column of numbers.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LightConfig {
    /// The file. Relative paths start at the configuration's folder.
    pub file: PathBuf,
    /// Unit of the numbers.
    pub unit: LightUnit,
    /// Colour of all of it: that of a star of this B-V, magnitudes.
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
    /// The map, whose path starts at `folder`.
    pub(super) fn map(&self, folder: &Path) -> LightMap {
        let unit = match self.unit {
            LightUnit::CdM2 => BrightnessUnit::Luminance,
            LightUnit::S10 => BrightnessUnit::S10,
            LightUnit::MagArcsec2 => BrightnessUnit::MagnitudePerArcsec2,
        };
        LightMap { path: folder.join(&self.file), unit, b_v: self.b_v }
    }
}

fn one() -> u64 {
    1
}

fn yes() -> bool {
    true
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
    galaxy: Option<GalaxyConfig>,
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
            _ if name.is_empty() => Err(E::custom("an empty name: must be \"builtin:bright\" or a file")),
            Some("bright") | None => Ok(CatalogueConfig::Named(name.to_owned())),
            Some("galaxy") => Err(E::custom(
                "`builtin:galaxy` needs its numbers: write { galaxy = { stars = 300000, seed = 1, fainter_than = 6.5 } }",
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
    pub look: Option<Look>,
    /// Velocity, ICRS axes; the speed is at most 0.9999.
    #[schemars(inner(range(min = -MAX_SPEED_C, max = MAX_SPEED_C)))]
    pub velocity_c: Option<[f64; 3]>,
}

impl CameraConfig {
    /// The direction that `look` gives; a fault names the key below `scene.camera`.
    fn aim(&self) -> Result<Option<Aim>, Fault> {
        let Some(look) = &self.look else { return Ok(None) };
        if self.orientation.is_some() {
            return Err(Fault::new("look", "orientation is given too: give at most one of orientation and look"));
        }
        let aim = look.aim().map_err(|fault| fault.within("look"))?;
        if aim.frame == Frame::Horizon {
            let problem = "horizon: needs an observer: write [scene.observer] instead of [scene.camera]";
            return Err(Fault::new("look.frame", problem));
        }
        Ok(Some(aim))
    }

    /// The camera at a position with an orientation; a fault names the key below `scene.camera`.
    pub(super) fn camera(&self, position_m: Option<DVec3>, turned: Option<DQuat>) -> Result<Camera, Fault> {
        let position_m = position_m.map_or(self.position_m.unwrap_or_default(), |place_m| place_m.to_array());
        let orientation = turned.unwrap_or_default().to_array();
        let orientation = self.orientation.unwrap_or(orientation);
        Camera::new(position_m, orientation, self.velocity_c.unwrap_or_default()).map_err(|error| {
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
    /// Checks the rules beyond types and ranges; a fault names the key below `scene`.
    pub(super) fn check(&self) -> Result<(), Fault> {
        if self.time.date.is_none() || self.time.time.is_none() || self.time.offset.is_none() {
            let problem = format!("{}: date, time and offset are needed, for instance 2026-01-01T00:00:00Z", self.time);
            return Err(Fault::new("time", problem));
        }
        if let Some(observer) = &self.observer {
            observer.check_surroundings().map_err(|fault| fault.within("observer"))?;
        }
        if self.observer.is_some() && self.camera != CameraConfig::default() {
            let problem = "scene.observer is given too, which places and directs the camera: give only one of them";
            return Err(Fault::new("camera", problem));
        }
        Ok(())
    }

    /// [`Self::time`] in s since 2000-01-01T12:00:00Z. Days have 86,400 s: leap seconds are left out, and a 60th second is
    /// the first of the next minute.
    pub fn time_s(&self) -> f64 {
        let (date, time) = (self.time.date.unwrap_or(J2000.0), self.time.time.unwrap_or(J2000.1));
        let days = days_since_1970(i64::from(date.year), i64::from(date.month), i64::from(date.day))
            - days_since_1970(2000, 1, 1);
        let offset_min = match self.time.offset {
            Some(Offset::Custom { minutes }) => i64::from(minutes),
            Some(Offset::Z) | None => 0,
        };
        let minutes = i64::from(time.hour) * 60 + i64::from(time.minute) - offset_min - 12 * 60;
        let seconds = days * 86_400 + minutes * 60 + i64::from(time.second.unwrap_or(0));
        seconds as f64 + f64::from(time.nanosecond.unwrap_or(0)) * 1e-9
    }

    /// The direction of the camera, if it is given by a direction or a body; a fault names the key below `scene`.
    pub(super) fn aim(&self) -> Result<Option<Aim>, Fault> {
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
    pub(super) fn has_solar_system(&self) -> bool {
        self.solar_system.unwrap_or(self.observer.is_some())
    }
}

/// Values for a missing date or time, which [`SceneConfig::check`] refuses.
const J2000: (Date, Time) =
    (Date { year: 2000, month: 1, day: 1 }, Time { hour: 12, minute: 0, second: Some(0), nanosecond: None });

/// Days from 1970-01-01 to a date of the Gregorian calendar, by eras of 400 years that begin in March (H. Hinnant,
/// "chrono-Compatible Low-Level Date Algorithms").
fn days_since_1970(year: i64, month: i64, day: i64) -> i64 {
    let year = if month <= 2 { year - 1 } else { year };
    let era = year.div_euclid(400);
    let year_of_era = year.rem_euclid(400);
    let day_of_year = (153 * ((month + 9) % 12) + 2) / 5 + day - 1;
    era * 146_097 + year_of_era * 365 + year_of_era / 4 - year_of_era / 100 + day_of_year - 719_468
}

/// The date of a number of days from 1970-01-01: the inverse.
fn date_of(days: i64) -> [i64; 3] {
    let from_march = days + 719_468;
    let era = from_march.div_euclid(146_097);
    let day_of_era = from_march.rem_euclid(146_097);
    let year_of_era = (day_of_era - day_of_era / 1460 + day_of_era / 36_524 - day_of_era / 146_096) / 365;
    let day_of_year = day_of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let month = (5 * day_of_year + 2) / 153;
    let (day, month) = (day_of_year - (153 * month + 2) / 5 + 1, if month < 10 { month + 3 } else { month - 9 });
    [era * 400 + year_of_era + i64::from(month <= 2), month, day]
}

/// A moment, s since 2000-01-01T12:00:00Z, as it is written; `None` beyond the years 0 to 9999, which TOML has. Rounded to microseconds, about the
/// resolution of a 64-bit float.
pub(super) fn written_time(time_s: f64) -> Option<Datetime> {
    const DAY_US: i64 = 86_400_000_000;
    let since_noon_us = (time_s * 1e6).round();
    if since_noon_us.is_nan() || since_noon_us.abs() > 1e18 {
        return None;
    }
    let unix_us = since_noon_us as i64 + days_since_1970(2000, 1, 1) * DAY_US + DAY_US / 2;
    let [year, month, day] = date_of(unix_us.div_euclid(DAY_US));
    let of_day_us = unix_us.rem_euclid(DAY_US);
    let seconds = of_day_us / 1_000_000;
    let nanosecond = u32::try_from(of_day_us % 1_000_000 * 1000).ok().filter(|nanoseconds| *nanoseconds > 0);
    let small = |value: i64| u8::try_from(value).ok();
    Some(Datetime {
        date: Some(Date {
            year: u16::try_from(year).ok().filter(|year| *year <= 9999)?,
            month: small(month)?,
            day: small(day)?,
        }),
        time: Some(Time {
            hour: small(seconds / 3600)?,
            minute: small(seconds / 60 % 60)?,
            second: small(seconds % 60),
            nanosecond,
        }),
        offset: Some(Offset::Z),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_count_from_noon_of_the_first_of_january_2000() {
        // Unix times as `date -d` prints them, less 946,728,000.
        for (text, unix_s) in [
            ("2000-01-01T12:00:00Z", 946_728_000.0),
            ("1970-01-01T00:00:00Z", 0.0),
            ("2000-02-29T00:00:00Z", 951_782_400.0),
            ("2026-01-01T00:00:00Z", 1_767_225_600.0),
            ("2031-05-06T07:08:09.5+02:00", 1_935_810_489.5),
            ("1900-03-01T00:00:00-01:30", -2_203_885_800.0),
            ("2016-12-31T23:59:60Z", 1_483_228_800.0),
        ] {
            let scene = SceneConfig { time: text.parse().unwrap(), ..SceneConfig::default() };
            assert_eq!(scene.time_s(), unix_s - 946_728_000.0, "{text}");
        }
    }

    #[test]
    fn written_times_are_read_as_the_same_moments() {
        for time_s in [0.0, -1e9 + 0.25, 8.2e8 + 0.125, 5_097_600.0, 5_184_000.0, -6e10, 2.4e11] {
            let time = written_time(time_s).unwrap();
            let read = SceneConfig { time: time.to_string().parse().unwrap(), ..SceneConfig::default() };
            assert_eq!(read.time_s(), time_s, "{time}");
        }
        assert_eq!(written_time(820_497_600.0).unwrap().to_string(), "2026-01-01T00:00:00Z");
        for beyond_s in [-7e10, 2.6e11, f64::NAN, f64::INFINITY] {
            assert_eq!(written_time(beyond_s), None, "{beyond_s}");
        }
    }
}
