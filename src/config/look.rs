//! `look`: the direction of a camera, given in one of several frames or by an object's name, and its roll.

use glam::DQuat;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::error::finite;
use crate::observer::{Frame, frame_from_camera};
use crate::ranges::KeyError;

/// Largest longitude and roll, degrees: a full turn in both directions.
pub(crate) const MOST_TURN_DEG: f64 = 360.0;
/// Largest angle above the middle of the picture, degrees.
pub(crate) const MOST_ABOVE_DEG: f64 = 180.0;

/// Returns an error message if an angle is not finite or its absolute value is above `most`.
fn check_angle(key: &str, value: f64, most: f64) -> Result<(), KeyError> {
    finite(key, value)?;
    if value.abs() > most {
        return Err(KeyError::new(key, format!("{value}: must be between -{most} and {most}")));
    }
    Ok(())
}

/// Where a camera looks. The frame's pole is up.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Look {
    /// Frame of the direction, with which the camera turns: `icrs`, `galactic`, `ecliptic` (mean ecliptic and equinox of J2000.0), `horizon` (of
    /// `scene.observer`). The default is the frame of the keys that give the direction, or `icrs`.
    pub frame: Option<Frame>,
    /// Right ascension; frame `icrs`.
    #[schemars(range(min = -360.0, max = 360.0))]
    pub ra_deg: Option<f64>,
    /// Declination; frame `icrs`.
    #[schemars(range(min = -90.0, max = 90.0), extend("x-unit" = "degrees"))]
    pub dec_deg: Option<f64>,
    /// Azimuth, from north through east; frame `horizon`.
    #[schemars(range(min = -360.0, max = 360.0))]
    pub azimuth_deg: Option<f64>,
    /// Altitude; frame `horizon`.
    #[schemars(range(min = -90.0, max = 90.0), extend("x-unit" = "degrees"))]
    pub altitude_deg: Option<f64>,
    /// Longitude in the frames `galactic` and `ecliptic` and in those of bodies; for bodies, towards the east.
    #[schemars(range(min = -360.0, max = 360.0))]
    pub longitude_deg: Option<f64>,
    /// Latitude in the frames `galactic` and `ecliptic` and in those of bodies.
    #[schemars(range(min = -90.0, max = 90.0), extend("x-unit" = "degrees"))]
    pub latitude_deg: Option<f64>,
    /// Name of a body, of a star of `builtin:bright` (such as `Sirius`, `alf CMa` or `HR 2491`) or of a constellation, instead of a direction.
    pub at: Option<String>,
    /// Angle by which the top of the picture is turned to the left; in the frame `icrs` this is its position angle, from north through east.
    #[serde(default)]
    #[schemars(range(min = -360.0, max = 360.0))]
    pub roll_deg: f64,
    /// Angle by which the direction is above the middle of the picture, towards its top: in a domemaster, the direction is this far above the front
    /// rim.
    #[serde(default)]
    #[schemars(range(min = -180.0, max = 180.0), extend("x-unit" = "degrees"))]
    pub above_deg: f64,
}

/// A checked [`Look`], whose keys are consistent.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Aim {
    /// The frame.
    pub(super) frame: Frame,
    /// Where to.
    pub(super) towards: Towards,
    /// Angle by which the top of the picture is turned, rad.
    pub(super) roll_rad: f64,
    /// Angle of the direction above the camera's axis, rad.
    pub(super) above_rad: f64,
}

impl Aim {
    /// Rotation from camera axes to those of the frame, for a direction in that frame, rad.
    pub(super) fn frame_from_camera(&self, longitude_rad: f64, latitude_rad: f64) -> DQuat {
        let at_it = frame_from_camera(longitude_rad, latitude_rad, self.roll_rad);
        (at_it * DQuat::from_rotation_x(-self.above_rad)).normalize()
    }
}

/// Where a camera looks.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Towards {
    /// Longitude and latitude in the frame's axes, rad.
    Direction([f64; 2]),
    /// A body, a star or a constellation, by name.
    Object(String),
}

/// Names of the keys of a direction, by frame.
fn keys(frame: Frame) -> [&'static str; 2] {
    match frame {
        Frame::Icrs => ["ra_deg", "dec_deg"],
        Frame::Horizon => ["azimuth_deg", "altitude_deg"],
        _ => ["longitude_deg", "latitude_deg"],
    }
}

impl Look {
    /// The checked direction; an error names the key within it.
    pub(super) fn aim(&self) -> Result<Aim, KeyError> {
        check_angle("roll_deg", self.roll_deg, MOST_TURN_DEG)?;
        let given = [
            ("ra_deg", self.ra_deg, Frame::Icrs),
            ("dec_deg", self.dec_deg, Frame::Icrs),
            ("azimuth_deg", self.azimuth_deg, Frame::Horizon),
            ("altitude_deg", self.altitude_deg, Frame::Horizon),
            ("longitude_deg", self.longitude_deg, Frame::Galactic),
            ("latitude_deg", self.latitude_deg, Frame::Galactic),
        ];
        let given: Vec<(&str, f64, Frame)> =
            given.into_iter().filter_map(|(key, value, frame)| Some((key, value?, frame))).collect();
        let of_keys = given.first().map(|(_, _, frame)| *frame);
        if self.frame.is_none() && of_keys == Some(Frame::Galactic) {
            return Err(KeyError::new(
                "frame",
                "missing key: longitude_deg and latitude_deg require it: `galactic`, `ecliptic` or a body",
            ));
        }
        let frame = self.frame.or(of_keys).unwrap_or_default();
        let [longitude, latitude] = keys(frame);
        if let Some((key, ..)) = given.iter().find(|(key, ..)| ![longitude, latitude].contains(key)) {
            let problem = format!("not a key of this frame: it has {longitude} and {latitude}");
            return Err(KeyError::new(*key, problem));
        }
        check_angle("above_deg", self.above_deg, MOST_ABOVE_DEG)?;
        let (roll_rad, above_rad) = (self.roll_deg.to_radians(), self.above_deg.to_radians());
        if let Some(body) = &self.at {
            return match given.first() {
                Some((key, ..)) => Err(KeyError::new(*key, "at is also given: give either a direction or at")),
                None => Ok(Aim { frame, towards: Towards::Object(body.clone()), roll_rad, above_rad }),
            };
        }
        let needed = |key: &str| {
            let found = given.iter().find(|(name, ..)| *name == key).map(|(_, value, _)| *value);
            let missing = format!("missing key: give {longitude} and {latitude}, or at");
            let value = found.ok_or_else(|| KeyError::new(key, missing))?;
            finite(key, value)?;
            Ok::<f64, KeyError>(value)
        };
        let [longitude_deg, latitude_deg] = [needed(longitude)?, needed(latitude)?];
        check_angle(longitude, longitude_deg, MOST_TURN_DEG)?;
        check_angle(latitude, latitude_deg, 90.0)?;
        let towards = Towards::Direction([frame.longitude_rad(longitude_deg), latitude_deg.to_radians()]);
        Ok(Aim { frame, towards, roll_rad, above_rad })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn aim(text: &str) -> Result<Aim, KeyError> {
        toml::from_str::<Look>(text).expect("a look").aim()
    }

    #[test]
    fn frames_follow_from_the_keys_of_directions() {
        let icrs = aim("ra_deg = 90\ndec_deg = 45").expect("a direction of ICRS");
        assert_eq!(icrs.frame, Frame::Icrs);
        let horizon = aim("azimuth_deg = 90\naltitude_deg = 0").expect("a direction of the horizon");
        assert_eq!(horizon.frame, Frame::Horizon);
        let Towards::Direction([longitude_rad, _]) = horizon.towards else { panic!("no direction") };
        assert_eq!(longitude_rad, -std::f64::consts::FRAC_PI_2);
        let body = aim("at = \"moon\"\nframe = \"horizon\"\nroll_deg = 10").expect("a body");
        assert_eq!((body.frame, body.towards), (Frame::Horizon, Towards::Object("moon".to_owned())));
    }

    #[test]
    fn keys_that_do_not_agree_are_refused_by_name() {
        for (text, key, part) in [
            ("", "ra_deg", "missing"),
            ("ra_deg = 3", "dec_deg", "missing"),
            ("ra_deg = 3\ndec_deg = 91", "dec_deg", "between -90 and 90"),
            ("ra_deg = nan\ndec_deg = 9", "ra_deg", "finite"),
            ("ra_deg = 1e300\ndec_deg = 9", "ra_deg", "between -360 and 360"),
            ("ra_deg = 3\ndec_deg = 9\nroll_deg = -361", "roll_deg", "between -360 and 360"),
            ("ra_deg = 3\ndec_deg = 9\nabove_deg = 181", "above_deg", "between -180 and 180"),
            ("longitude_deg = 3\nlatitude_deg = 9", "frame", "galactic"),
            ("frame = \"galactic\"\nra_deg = 3\ndec_deg = 9", "ra_deg", "longitude_deg and latitude_deg"),
            ("azimuth_deg = 3\ndec_deg = 9", "azimuth_deg", "not a key of this frame"),
            ("at = \"moon\"\nra_deg = 3", "ra_deg", "at is also given"),
            ("frame = \"horizon\"", "azimuth_deg", "missing"),
            ("at = \"moon\"\nroll_deg = inf", "roll_deg", "finite"),
        ] {
            let fault = aim(text).expect_err(text);
            assert!(fault.key == key && fault.problem.contains(part), "{text}: {fault:?}");
        }
    }
}
