//! `[scene.observer]`: a place on the Earth from where the scene is seen.

use std::{path::Path, sync::Arc};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::error::Fault;
use super::look::{Aim, Look};
use super::ranges;
use super::surroundings::{AirConfig, GroundConfig};
use crate::observer::{Clock, Frame, Place, RefractingAir};
use crate::scene::{landscape::Landscape, surroundings::Surroundings};

/// Where one looks who says nothing, degrees of azimuth.
const SOUTH_DEG: f64 = 180.0;

/// A place on the Earth, where one looks from there, and what is known of the Earth's rotation. The camera stands there in place of `scene.camera`, stars and bodies are where they are
/// seen, and the Sun, the Moon and planets are there of themselves.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ObserverConfig {
    /// Geodetic latitude (WGS84), north positive.
    pub latitude_deg: f64,
    /// Longitude, east positive.
    pub longitude_deg: f64,
    /// Height above the ellipsoid.
    #[serde(default)]
    pub height_m: f64,
    /// Azimuth of the direction that the camera looks to, from north through east; 180, south, without it.
    pub azimuth_deg: Option<f64>,
    /// Its altitude, -90 to 90; 0, the horizon, without it.
    pub altitude_deg: Option<f64>,
    /// By which the top of the picture is turned to the left; 0 without it.
    pub roll_deg: Option<f64>,
    /// A direction of another frame, or a body, in place of these; without a frame the camera hangs on the horizon.
    pub look: Option<Look>,
    /// UT1 - UTC as the IERS has measured it: 0.1 s turns the sky by 1.5 arcseconds. Before 1972 UT1 less civil time.
    #[serde(default)]
    pub ut1_minus_utc_s: f64,
    /// TT - UT1; without it from leap seconds since 1972, and estimated before (Espenak and Meeus 2006).
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

    /// What is around it; `None`: nothing. Files are read from paths that start at `folder`; a fault names the key below `scene.observer`.
    pub(super) fn surroundings(&self, folder: &Path) -> Result<Option<Surroundings>, Fault> {
        let landscape = self.ground.landscape(folder).map_err(|fault| fault.within("ground"))?;
        Ok(self.surroundings_with(landscape.map(Arc::new)))
    }

    /// What is around it, with a landscape that has been read; `None`: nothing.
    pub fn surroundings_with(&self, landscape: Option<Arc<Landscape>>) -> Option<Surroundings> {
        let (air, refraction) = (self.air.air(self.height_m), self.refracting());
        let surroundings = Surroundings { air, refraction, ground: self.ground.ground(landscape) };
        (surroundings.air.is_some() || surroundings.ground.is_some()).then_some(surroundings)
    }

    /// Checks place, clock, air and ground as those of a configuration are checked. The error names the key, from `observer` on, and what is allowed.
    pub fn check(&self) -> Result<(), String> {
        let told = |Fault { key, problem }: Fault| format!("{}: {problem}", key.trim_start_matches("scene."));
        let own = toml::Table::try_from(self).map_err(|error| format!("observer: {error}"))?;
        let within = |key: &str, table: toml::Table| toml::Table::from_iter([(key.to_owned(), table.into())]);
        ranges::check(&within("scene", within("observer", own))).map_err(told)?;
        self.check_surroundings().map_err(|fault| told(fault.within("observer")))
    }

    /// Checks what types and ranges alone do not say; a fault names the key below `scene.observer`.
    pub(super) fn check_surroundings(&self) -> Result<(), Fault> {
        self.ground.check().map_err(|fault| fault.within("ground"))?;
        self.air.check(self.height_m).map_err(|fault| fault.within("air"))
    }

    /// What bends light there; `None`: there is no air.
    pub(super) fn refracting(&self) -> Option<RefractingAir> {
        self.air.refracting(self.height_m)
    }

    /// Where it looks; a fault names the key below `scene.observer`.
    pub(super) fn aim(&self) -> Result<Aim, Fault> {
        let given =
            [("azimuth_deg", self.azimuth_deg), ("altitude_deg", self.altitude_deg), ("roll_deg", self.roll_deg)];
        if let Some(look) = &self.look {
            if let Some((key, _)) = given.into_iter().find(|(_, given)| given.is_some()) {
                return Err(Fault::new(key, "look is given too: at most one of them is allowed"));
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
