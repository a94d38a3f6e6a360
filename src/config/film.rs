//! The path of a film: TOML with the same strict rules as configurations. Keyframes give quantities at frame numbers; `output::film` interpolates
//! between them.

use std::path::Path;

use glam::{DQuat, DVec3};
use serde::Deserialize;
use toml::{Table, Value};

use super::document::{deserialise, parse};
use super::error::{ConfigError, finite};
use super::look::{Look, Towards};
use super::time::WrittenTime;
use crate::files;
use crate::observer::Frame;
use crate::plan::settings::MAGNITUDES;
use crate::ranges::KeyError;
use crate::scene::{Camera, PoseError};

/// Maximum size of a path file, bytes.
const MOST_BYTES: u64 = 64 << 20;
/// Frames per second.
const FPS: [f64; 2] = [1.0, 240.0];
/// Vertical field of view, degrees; 0 is refused.
const MOST_FOV_Y_DEG: f64 = 178.0;
/// Beyond these values, f32 cannot represent both the luminance of white and the light of the stars.
const EV100: [f64; 2] = [-100.0, 100.0];
const COMPENSATION_EV: [f64; 2] = [-30.0, 30.0];
/// Smallest and largest factor on the size of the picture's plane.
const FOV_SCALES: [f64; 2] = [1e-6, 1e6];

/// Progress along the segment between two keyframes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Easing {
    /// At a constant rate.
    Linear,
    /// Smoothly: the rate does not jump at the ends of the segment.
    #[default]
    Smooth,
}

/// Exposure of a keyframe.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ExposureKey {
    /// The exposure value at ISO 100.
    Ev100(f64),
    /// Compensation of the automatic exposure; positive darkens.
    CompensationEv(f64),
}

/// Field of view that a keyframe gives perspective views.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FovKey {
    /// Factor on the width and height of the picture's plane, that is, on the tangents of the angles of its edges.
    Scale(f64),
    /// Vertical field of view, degrees.
    YDeg(f64),
}

/// Values of a frame. `None` means the value of the configuration or, in a keyframe, a value interpolated from the neighbouring keyframes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FrameValues {
    /// Position, ICRS, barycentric, m.
    pub position_m: Option<DVec3>,
    /// Rotation from camera axes to those of the path's frame.
    pub frame_from_camera: Option<DQuat>,
    /// Moment, s since 2000-01-01T12:00:00Z.
    pub time_s: Option<f64>,
    /// Field of view of perspective views.
    pub fov: Option<FovKey>,
    /// Exposure.
    pub exposure: Option<ExposureKey>,
    /// Stars fainter than this apparent magnitude are not drawn.
    pub magnitude_limit: Option<f64>,
    /// Velocity, ICRS axes, in units of the speed of light.
    pub velocity_c: Option<DVec3>,
}

/// One keyframe.
#[derive(Clone, Debug, PartialEq)]
pub struct Keyframe {
    /// Number of the frame.
    pub frame: u32,
    /// The quantities that it gives.
    pub values: FrameValues,
    /// Easing of the segment that begins here.
    pub easing: Easing,
}

/// The path of a film. The frame numbers of keyframes increase, and all values are within their ranges.
#[derive(Clone, Debug, PartialEq)]
pub struct FilmPath {
    /// Name of its file in messages.
    pub origin: String,
    /// Frames per second.
    pub fps: f64,
    /// The frame of the orientations, in which they are interpolated.
    pub frame: Frame,
    /// The place around which positions are interpolated: along great circles, and in the logarithm of the distance.
    pub around_m: Option<DVec3>,
    /// At least one.
    pub keyframes: Vec<Keyframe>,
    /// The document without comments, with sorted keys; digests are computed from it.
    pub document: String,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Document {
    #[serde(default = "default_fps")]
    fps: f64,
    around_m: Option<[f64; 3]>,
    #[serde(default)]
    keyframes: Vec<Table>,
}

fn default_fps() -> f64 {
    30.0
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct KeyframeTable {
    frame: u32,
    position_m: Option<[f64; 3]>,
    orientation: Option<[f64; 4]>,
    look: Option<Look>,
    time: Option<WrittenTime>,
    fov_scale: Option<f64>,
    fov_y_deg: Option<f64>,
    ev100: Option<f64>,
    compensation_ev: Option<f64>,
    magnitude_limit: Option<f64>,
    velocity_c: Option<[f64; 3]>,
    #[serde(default)]
    easing: Easing,
}

fn within(key: &str, value: f64, [least, most]: [f64; 2]) -> Result<f64, KeyError> {
    finite(key, value)?;
    if (least..=most).contains(&value) {
        Ok(value)
    } else {
        Err(KeyError::new(key, format!("{value}: must be between {least} and {most}")))
    }
}

fn vector(key: &'static str, value: [f64; 3]) -> Result<DVec3, KeyError> {
    crate::scene::finite_vector(key, value).map_err(|error| KeyError::new(key, error.to_string()))
}

fn either<A, B, T>(
    [first, second]: [&'static str; 2],
    one: Option<A>,
    other: Option<B>,
    with: impl FnOnce(A) -> Result<T, KeyError>,
    or_with: impl FnOnce(B) -> Result<T, KeyError>,
) -> Result<Option<T>, KeyError> {
    match (one, other) {
        (Some(_), Some(_)) => {
            Err(KeyError::new(second, format!("{first} is also given: at most one of {first} and {second} is allowed")))
        }
        (Some(value), None) => with(value).map(Some),
        (None, Some(value)) => or_with(value).map(Some),
        (None, None) => Ok(None),
    }
}

impl Keyframe {
    /// Formats the keyframe as a TOML table. Reading the table gives the same values, with times rounded to microseconds. `None` if the time is
    /// outside the range of a scene.
    pub fn text(&self) -> Option<String> {
        let mut text = format!("[[keyframes]]\nframe = {}\n", self.frame);
        // Values have enough digits to read back the same numbers.
        let mut line = |key: &str, value: String| text.push_str(&format!("{key} = {value}\n"));
        let FrameValues { position_m, frame_from_camera, time_s, fov, exposure, magnitude_limit, velocity_c } =
            self.values;
        if let Some(position_m) = position_m {
            line("position_m", format!("{:?}", position_m.to_array()));
        }
        if let Some(turn) = frame_from_camera {
            line("orientation", format!("{:?}", turn.to_array()));
        }
        if let Some(time_s) = time_s {
            line("time", WrittenTime::new(time_s)?.to_toml());
        }
        match fov {
            Some(FovKey::Scale(scale)) => line("fov_scale", format!("{scale:?}")),
            Some(FovKey::YDeg(deg)) => line("fov_y_deg", format!("{deg:?}")),
            None => {}
        }
        match exposure {
            Some(ExposureKey::Ev100(ev100)) => line("ev100", format!("{ev100:?}")),
            Some(ExposureKey::CompensationEv(ev)) => line("compensation_ev", format!("{ev:?}")),
            None => {}
        }
        if let Some(limit) = magnitude_limit {
            line("magnitude_limit", format!("{limit:?}"));
        }
        if let Some(velocity_c) = velocity_c {
            line("velocity_c", format!("{:?}", velocity_c.to_array()));
        }
        if self.easing == Easing::Linear {
            line("easing", "\"linear\"".to_owned());
        }
        Some(text)
    }
}

impl KeyframeTable {
    /// Returns the keyframe, and the reference frame of its orientation if it has one.
    fn keyframe(self) -> Result<(Keyframe, Option<Frame>), KeyError> {
        let orientation = |value: [f64; 4]| {
            let turned = crate::scene::unit_quaternion(value);
            turned.map(|turned| (turned, Frame::Icrs)).map_err(|error| KeyError::new("orientation", error.to_string()))
        };
        let look = |look: Look| {
            let aim = look.aim().map_err(|fault| fault.within("look"))?;
            match aim.towards {
                Towards::Direction([longitude_rad, latitude_rad]) => {
                    Ok((aim.frame_from_camera(longitude_rad, latitude_rad), aim.frame))
                }
                Towards::Object(_) => Err(KeyError::new("look.at", "keyframes require a direction: at is not allowed")),
            }
        };
        let fov_y_deg = |value: f64| {
            finite("fov_y_deg", value)?;
            if value > 0.0 && value <= MOST_FOV_Y_DEG {
                return Ok(FovKey::YDeg(value));
            }
            Err(KeyError::new("fov_y_deg", format!("{value}: must be above 0 and at most {MOST_FOV_Y_DEG} degrees")))
        };
        let velocity = |velocity_c: [f64; 3]| {
            let moving = Camera::new([0.0; 3], [0.0, 0.0, 0.0, 1.0], velocity_c);
            moving
                .map(|camera| camera.velocity_c)
                .map_err(|error: PoseError| KeyError::new("velocity_c", error.to_string()))
        };
        let turned = either(["orientation", "look"], self.orientation, self.look, orientation, look)?;
        let values = FrameValues {
            position_m: self.position_m.map(|value| vector("position_m", value)).transpose()?,
            frame_from_camera: turned.map(|(turned, _)| turned),
            time_s: self.time.map(|time| time.time_s()),
            fov: either(
                ["fov_scale", "fov_y_deg"],
                self.fov_scale,
                self.fov_y_deg,
                |value| within("fov_scale", value, FOV_SCALES).map(FovKey::Scale),
                fov_y_deg,
            )?,
            exposure: either(
                ["ev100", "compensation_ev"],
                self.ev100,
                self.compensation_ev,
                |value| within("ev100", value, EV100).map(ExposureKey::Ev100),
                |value| within("compensation_ev", value, COMPENSATION_EV).map(ExposureKey::CompensationEv),
            )?,
            magnitude_limit: self
                .magnitude_limit
                .map(|value| within("magnitude_limit", value, MAGNITUDES))
                .transpose()?,
            velocity_c: self.velocity_c.map(velocity).transpose()?,
        };
        Ok((Keyframe { frame: self.frame, values, easing: self.easing }, turned.map(|(_, frame)| frame)))
    }
}

impl FilmPath {
    /// Loads a file.
    ///
    /// # Errors
    ///
    /// The file cannot be read, is not TOML, or has a key that is unknown, is missing or has an invalid value. The message names the file and the
    /// key.
    pub fn load(path: &Path) -> Result<Self, ConfigError> {
        let text = files::read_text_bounded(path, MOST_BYTES)
            .map_err(|source| ConfigError::ReadPath { path: path.to_owned(), source })?;
        Self::from_text(&text, &path.display().to_string())
    }

    /// Reads TOML; `origin` names it in messages.
    ///
    /// # Errors
    ///
    /// Those of [`Self::load`].
    pub fn from_text(text: &str, origin: &str) -> Result<Self, ConfigError> {
        let table = parse(text, origin)?;
        let document = table.to_string();
        Self::from_table(table, origin, document).map_err(|fault| ConfigError::Key {
            origin: origin.to_owned(),
            key: fault.key,
            problem: fault.problem,
        })
    }

    fn from_table(table: Table, origin: &str, text: String) -> Result<Self, KeyError> {
        // The original tables: after deserialising into another table type, times are texts.
        let tables = table.get("keyframes").and_then(Value::as_array).cloned().unwrap_or_default();
        let document: Document = deserialise(Value::Table(table), "")?;
        let fps = within("fps", document.fps, FPS)?;
        let around_m = document.around_m.map(|value| vector("around_m", value)).transpose()?;
        if document.keyframes.is_empty() {
            return Err(KeyError::new("keyframes", "missing key: at least one [[keyframes]] is needed"));
        }
        let mut keyframes: Vec<Keyframe> = Vec::with_capacity(tables.len());
        let mut frame = None;
        for (index, table) in tables.into_iter().enumerate() {
            let place = format!("keyframes[{index}]");
            let (keyframe, of_keyframe) = deserialise::<KeyframeTable>(table, "")
                .and_then(KeyframeTable::keyframe)
                .map_err(|fault| fault.within(&place))?;
            let fault = |key: &str, problem: String| Err(KeyError::new(format!("{place}.{key}"), problem));
            match (frame, of_keyframe) {
                (Some(first), Some(other)) if first != other => {
                    let [first, other] = [first, other].map(Frame::name);
                    let problem = format!(
                        "its frame is {other}, but that of an earlier keyframe is {first}: all keyframes must have the same frame"
                    );
                    return fault("look.frame", problem);
                }
                _ => frame = frame.or(of_keyframe),
            }
            if let Some(last) = keyframes.last()
                && last.frame >= keyframe.frame
            {
                let problem =
                    format!("{}: must be above {}, the frame of the previous keyframe", keyframe.frame, last.frame);
                return fault("frame", problem);
            }
            if keyframe.values.position_m.is_some() && keyframe.values.position_m == around_m {
                return fault("position_m", "it equals around_m, and so has no direction from there".to_owned());
            }
            let other =
                |names: [&str; 2]| format!("keyframes have {} and {}: give only one of them", names[0], names[1]);
            let differs = |other: &Keyframe| match (other.values.fov, keyframe.values.fov) {
                (Some(FovKey::Scale(_)), Some(FovKey::YDeg(_))) => Some("fov_y_deg"),
                (Some(FovKey::YDeg(_)), Some(FovKey::Scale(_))) => Some("fov_scale"),
                _ => None,
            };
            if let Some(key) = keyframes.iter().find_map(differs) {
                return fault(key, other(["fov_scale", "fov_y_deg"]));
            }
            let differs = |other: &Keyframe| match (other.values.exposure, keyframe.values.exposure) {
                (Some(ExposureKey::Ev100(_)), Some(ExposureKey::CompensationEv(_))) => Some("compensation_ev"),
                (Some(ExposureKey::CompensationEv(_)), Some(ExposureKey::Ev100(_))) => Some("ev100"),
                _ => None,
            };
            if let Some(key) = keyframes.iter().find_map(differs) {
                return fault(key, other(["ev100", "compensation_ev"]));
            }
            keyframes.push(keyframe);
        }
        let frame = frame.unwrap_or_default();
        Ok(Self { origin: origin.to_owned(), fps, frame, around_m, keyframes, document: text })
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "what must not happen in a test may panic")]
mod tests {
    use super::*;

    #[test]
    fn what_is_wrong_is_named_with_file_key_and_what_is_allowed() {
        for (text, parts) in [
            ("", &["keyframes", "at least one"][..]),
            ("speed = 3\n[[keyframes]]\nframe = 0", &["speed", "unknown key", "keyframes"]),
            ("fps = 0.5\n[[keyframes]]\nframe = 0", &["fps", "between 1 and 240"]),
            ("fps = nan\n[[keyframes]]\nframe = 0", &["fps", "finite"]),
            ("[[keyframes]]\nfame = 0", &["keyframes[0].fame", "unknown key", "frame"]),
            ("[[keyframes]]\nframe = -1", &["keyframes[0].frame"]),
            ("[[keyframes]]\neasing = 'linear'", &["keyframes[0]", "missing key", "frame"]),
            ("[[keyframes]]\nframe = 3\n[[keyframes]]\nframe = 3", &["keyframes[1].frame", "above 3"]),
            ("[[keyframes]]\nframe = 3\neasing = 'bouncy'", &["keyframes[0].easing", "linear", "smooth"]),
            ("[[keyframes]]\nframe = 3\norientation = [0, 0, 0, 2]", &["keyframes[0].orientation", "unit quaternion"]),
            ("[[keyframes]]\nframe = 3\nlook = { ra_deg = 1, dec_deg = 91 }", &["look.dec_deg", "between -90 and 90"]),
            (
                "[[keyframes]]\nframe = 3\norientation = [0, 0, 0, 1]\nlook = { ra_deg = 1, dec_deg = 9 }",
                &["keyframes[0].look", "at most one of orientation and look"],
            ),
            (
                "[[keyframes]]\nframe = 0\norientation = [0, 0, 0, 1]\n[[keyframes]]\nframe = 1\nlook = { azimuth_deg = 1, altitude_deg = 9 }",
                &["keyframes[1].look.frame", "horizon", "icrs"],
            ),
            ("[[keyframes]]\nframe = 3\nlook = { at = 'moon' }", &["keyframes[0].look.at", "not allowed"]),
            ("[[keyframes]]\nframe = 3\ntime = 2026-01-01", &["keyframes[0].time", "offset"]),
            ("[[keyframes]]\nframe = 3\nfov_y_deg = 0", &["keyframes[0].fov_y_deg", "at most 178"]),
            ("[[keyframes]]\nframe = 3\nfov_scale = 0", &["keyframes[0].fov_scale", "must be"]),
            ("[[keyframes]]\nframe = 3\nvelocity_c = [1, 0, 0]", &["keyframes[0].velocity_c", "0.9999"]),
            (
                "[[keyframes]]\nframe = 3\nmagnitude_limit = 1e3",
                &["keyframes[0].magnitude_limit", "between -100 and 100"],
            ),
            (
                "around_m = [1, 2, 3]\n[[keyframes]]\nframe = 3\nposition_m = [1, 2, 3]",
                &["keyframes[0].position_m", "around_m"],
            ),
            (
                "[[keyframes]]\nframe = 0\nev100 = 1\n[[keyframes]]\nframe = 1\ncompensation_ev = 1",
                &["compensation_ev"],
            ),
            ("[[keyframes]]\nframe = 0\nfov_scale = 1\n[[keyframes]]\nframe = 1\nfov_y_deg = 1", &["fov_y_deg"]),
            ("[[keyframes", &["p.toml:1:"]),
        ] {
            let message = FilmPath::from_text(text, "p.toml").unwrap_err().to_string();
            for part in ["p.toml"].iter().chain(parts) {
                assert!(message.contains(part), "`{part}` is not in: {message}");
            }
        }
    }

    #[test]
    fn what_is_written_of_a_keyframe_is_read_as_the_same() {
        let values = FrameValues {
            position_m: Some(DVec3::new(1.0 / 3.0, -1e17, 149_597_870_700.123)),
            frame_from_camera: Some(DQuat::from_rotation_y(0.7).normalize()),
            time_s: Some(8.2e8 + 0.125),
            fov: Some(FovKey::YDeg(41.7)),
            exposure: Some(ExposureKey::Ev100(-4.7)),
            magnitude_limit: Some(6.3),
            velocity_c: Some(DVec3::new(0.0, 0.5, 0.0)),
        };
        let keyframes = [
            Keyframe { frame: 0, values: values.clone(), easing: Easing::Linear },
            Keyframe { frame: 7, values, easing: Easing::Smooth },
            Keyframe { frame: 9, values: FrameValues::default(), easing: Easing::Smooth },
        ];
        let text: String = keyframes.iter().map(|keyframe| keyframe.text().unwrap()).collect();
        let read = FilmPath::from_text(&text, "p.toml").unwrap();
        for (read, keyframe) in read.keyframes.iter().zip(&keyframes) {
            let turn = |keyframe: &Keyframe| keyframe.values.frame_from_camera.unwrap_or_default();
            assert!(turn(read).angle_between(turn(keyframe)) < 1e-15, "normalised again");
            let values = FrameValues { frame_from_camera: keyframe.values.frame_from_camera, ..read.values.clone() };
            assert_eq!((Keyframe { values, ..read.clone() }), *keyframe, "{text}");
        }
        let late = FrameValues { time_s: Some(1e13), ..FrameValues::default() };
        assert_eq!(Keyframe { frame: 0, values: late, easing: Easing::Smooth }.text(), None);
    }

    #[test]
    fn looking_gives_the_direction_and_the_top_of_the_picture() {
        let close = |a: DVec3, b: DVec3| assert!((a - b).length() < 1e-15, "{a} {b}");
        let turned = |ra_deg: f64, dec_deg: f64, roll_deg: f64| {
            let look = format!("{{ ra_deg = {ra_deg}, dec_deg = {dec_deg}, roll_deg = {roll_deg} }}");
            let path = FilmPath::from_text(&format!("[[keyframes]]\nframe = 0\nlook = {look}"), "p.toml").unwrap();
            path.keyframes[0].values.frame_from_camera.unwrap()
        };
        let look = turned(90.0, 0.0, 0.0);
        close(look * DVec3::NEG_Z, DVec3::Y);
        close(look * DVec3::Y, DVec3::Z);
        // East is where right ascension grows: -x from here.
        close(turned(90.0, 0.0, 90.0) * DVec3::Y, DVec3::NEG_X);
        close(turned(0.0, 90.0, 0.0) * DVec3::NEG_Z, DVec3::Z);
        close(turned(0.0, 90.0, 0.0) * DVec3::Y, DVec3::NEG_X);
    }
}
