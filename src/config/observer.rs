//! `[scene.observer]`: a place on the Earth from where the scene is seen.

use std::{path::Path, sync::Arc};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::document::check_ranges;
use super::look::{Aim, Look};
use super::surroundings::{AirConfig, GroundConfig};
use crate::observer::{Clock, Frame, Place, RefractingAir, refraction::dip_rad};
use crate::ranges::KeyError;
use crate::scene::{landscape::Landscape, surroundings::Surroundings};

/// Default azimuth, degrees.
const SOUTH_DEG: f64 = 180.0;

/// A place on the Earth, the direction of the camera, and parameters of the Earth's rotation. The camera is at this place, instead of `scene.camera`; stars and bodies have their apparent
/// places, and the Sun, the Moon and the planets are part of the scene.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ObserverConfig {
    /// Geodetic latitude (WGS84), north positive.
    #[schemars(range(min = -90.0, max = 90.0))]
    pub latitude_deg: f64,
    /// Longitude, east positive.
    #[schemars(range(min = -360.0, max = 360.0))]
    pub longitude_deg: f64,
    // The range extends from the deepest places to far above the air.
    /// Height above the ellipsoid.
    #[serde(default)]
    #[schemars(range(min = -12_000.0, max = 1e6), extend("x-unit" = "m"))]
    pub height_m: f64,
    /// Azimuth of the direction of the camera, from north through east; 180 (south) by default.
    #[schemars(range(min = -360.0, max = 360.0))]
    pub azimuth_deg: Option<f64>,
    /// Altitude of that direction; 0 (the horizon) by default.
    #[schemars(range(min = -90.0, max = 90.0))]
    pub altitude_deg: Option<f64>,
    /// Angle by which the top of the picture is turned to the left; 0 by default.
    #[schemars(range(min = -360.0, max = 360.0))]
    pub roll_deg: Option<f64>,
    /// A direction in another frame, or a body, instead of these three keys. The camera follows a body in the horizon frame, unless `look` names
    /// another frame.
    pub look: Option<Look>,
    /// UT1 - UTC as the IERS has measured it: 0.1 s turns the sky by 1.5 arcseconds. Before 1972 it is UT1 minus civil time.
    #[serde(default)]
    #[schemars(range(min = -1.0, max = 1.0), extend("x-unit" = "s"))]
    pub ut1_minus_utc_s: f64,
    /// TT - UT1. By default it follows from the leap seconds for times since 1972, and is estimated for earlier times (Espenak and Meeus 2006).
    #[schemars(range(min = -1e6, max = 1e6), extend("x-unit" = "s"))]
    pub delta_t_s: Option<f64>,
    /// The air.
    #[serde(default)]
    pub air: AirConfig,
    /// The ground.
    #[serde(default)]
    pub ground: GroundConfig,
}

impl ObserverConfig {
    /// The place.
    pub fn place(&self) -> Place {
        Place {
            latitude_rad: self.latitude_deg.to_radians(),
            longitude_rad: self.longitude_deg.to_radians(),
            height_m: self.height_m,
        }
    }

    /// Returns the air and the ground around the observer, if there are any. Files are read from paths relative to `folder`; an error names the key
    /// below `scene.observer`.
    pub(super) fn surroundings(&self, folder: &Path) -> Result<Option<Surroundings>, KeyError> {
        let landscape = self.ground.landscape(folder).map_err(|fault| fault.within("ground"))?;
        Ok(self.surroundings_with(landscape.map(Arc::new)))
    }

    /// Returns the air and the ground around the observer, if there are any, with a landscape that has been read.
    pub fn surroundings_with(&self, landscape: Option<Arc<Landscape>>) -> Option<Surroundings> {
        let (air, refraction) = (self.air.air(self.height_m), self.refracting());
        let dip_rad = dip_rad(self.height_m, refraction.as_ref());
        let surroundings = Surroundings { air, refraction, ground: self.ground.ground(landscape, dip_rad) };
        (surroundings.air.is_some() || surroundings.ground.is_some()).then_some(surroundings)
    }

    /// Checks place, clock, air and ground by the rules of configurations. The error names the key, beginning with `observer`, and the valid values.
    pub fn check(&self) -> Result<(), String> {
        let written = |KeyError { key, problem }: KeyError| format!("{}: {problem}", key.trim_start_matches("scene."));
        let own = toml::Value::try_from(self).map_err(|error| format!("observer: {error}"))?;
        check_ranges::<Self>(&own).map_err(|fault| written(fault.within("observer")))?;
        self.check_surroundings().map_err(|fault| written(fault.within("observer")))
    }

    /// Checks the rules beyond types and ranges; an error names the key below `scene.observer`.
    pub(super) fn check_surroundings(&self) -> Result<(), KeyError> {
        self.ground.check().map_err(|fault| fault.within("ground"))?;
        self.air.check(self.height_m).map_err(|fault| fault.within("air"))
    }

    /// The refracting air; `None` without air.
    pub(super) fn refracting(&self) -> Option<RefractingAir> {
        self.air.refracting(self.height_m)
    }

    /// The direction of the camera; an error names the key below `scene.observer`.
    pub(super) fn aim(&self) -> Result<Aim, KeyError> {
        let given =
            [("azimuth_deg", self.azimuth_deg), ("altitude_deg", self.altitude_deg), ("roll_deg", self.roll_deg)];
        if let Some(look) = &self.look {
            if let Some((key, _)) = given.into_iter().find(|(_, given)| given.is_some()) {
                return Err(KeyError::new(key, "look is also given: give at most one of them"));
            }
            let at_body = look.at.is_some() && look.frame.is_none();
            let look = Look { frame: if at_body { Some(Frame::Horizon) } else { look.frame }, ..look.clone() };
            return look.aim().map_err(|fault| fault.within("look"));
        }
        let look = Look {
            azimuth_deg: Some(self.azimuth_deg.unwrap_or(SOUTH_DEG)),
            altitude_deg: Some(self.altitude_deg.unwrap_or(0.0)),
            roll_deg: self.roll_deg.unwrap_or(0.0),
            ..Look::default()
        };
        look.aim()
    }

    /// The clock.
    pub fn clock(&self) -> Clock {
        Clock { ut1_minus_utc_s: self.ut1_minus_utc_s, delta_t_s: self.delta_t_s }
    }
}
