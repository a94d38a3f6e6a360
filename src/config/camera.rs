//! The camera of a configuration: its position, and its direction, given by `look` or the observer's keys.

use std::fmt::Display;

use glam::{DQuat, DVec3};

use super::look::{Aim, Towards};
use super::{Config, ConfigError, ObserverConfig};
use crate::catalogue::{
    bright::named_bright_stars,
    constellations::{self, middles},
    epoch::Epoch,
    names,
};
use crate::coordinates::lon_lat_from_direction;
use crate::observer::{Moment, Observer, Refraction};
use crate::ranges::KeyError;
use crate::scene::Camera;
use crate::scene::surroundings::BEYOND_AIR_M;
use crate::units::{JULIAN_YEAR_S, PARSEC_M};

impl Config {
    /// The camera at the start, with revision 0.
    pub fn camera(&self) -> Result<Camera, ConfigError> {
        self.camera_at(self.scene.time_s())
    }

    /// The camera at a moment, s since 2000-01-01T12:00:00Z, with revision 0. A camera in the horizon frame turns with the Earth.
    pub fn camera_at(&self, time_s: f64) -> Result<Camera, ConfigError> {
        self.camera_of(time_s).map_err(|fault| self.error(fault.within("scene")))
    }

    /// Like [`Self::camera_at`], but an error names the key below `scene`.
    pub(super) fn camera_of(&self, time_s: f64) -> Result<Camera, KeyError> {
        let observer = self.observer();
        let camera = &self.scene.camera;
        let of_camera = |fault: KeyError| fault.within("camera");
        let at_rest = camera.camera(observer.map(|observer| observer.epoch.position_m), None).map_err(of_camera)?;
        let Some(aim) = self.scene.aim()? else { return Ok(at_rest) };
        let of_look = if observer.is_some() { "observer.look" } else { "camera.look" };
        let turned = self
            .turned(&aim, (time_s, observer.as_ref()), at_rest.position_m)
            .map_err(|fault| fault.within(of_look))?;
        let turned = camera.camera(Some(at_rest.position_m), Some(turned)).map_err(of_camera)?;
        Ok(Camera { frame: aim.frame, as_of_s: time_s, ..turned })
    }

    /// Rotation from camera axes to those of ICRS.
    fn turned(&self, aim: &Aim, seen: (f64, Option<&Observer>), camera_m: DVec3) -> Result<DQuat, KeyError> {
        let (time_s, observer) = seen;
        let Some(icrs_from_frame) = aim.frame.icrs_from(observer, time_s) else {
            return Err(KeyError::new("frame", "horizon: needs [scene.observer]"));
        };
        let frame_from_camera = match &aim.towards {
            Towards::Direction([longitude_rad, latitude_rad]) => aim.frame_from_camera(*longitude_rad, *latitude_rad),
            Towards::Object(name) => {
                let seen_m = self.seen_m(self.relative_m(name, seen, camera_m)?, seen);
                let in_frame = icrs_from_frame.transpose() * seen_m;
                let (longitude_rad, latitude_rad) = lon_lat_from_direction(in_frame);
                aim.frame_from_camera(longitude_rad, latitude_rad)
            }
        };
        Ok(DQuat::from_mat3(&icrs_from_frame) * frame_from_camera)
    }

    /// Position relative to the camera, m, of a body, of a star of the built-in table, or of the middle of a constellation. Constellations, and stars
    /// without a known distance, are at 1 pc.
    fn relative_m(
        &self,
        name: &str,
        (time_s, observer): (f64, Option<&Observer>),
        camera_m: DVec3,
    ) -> Result<DVec3, KeyError> {
        let fault = |problem: &dyn Display| KeyError::new("at", format!("`{name}`: {problem}"));
        let Some(body) = self.bodies.iter().find(|body| names::is_same(&body.name, name)) else {
            let without = Epoch { years: time_s / JULIAN_YEAR_S, seen_from: None };
            let epoch = observer.map_or(without, |observer| observer.epoch.of_stars());
            let named = named_bright_stars(epoch.years);
            if let Some(found) = names::find(named.iter(), name) {
                let star = epoch.seen(found.star);
                return Ok(star.position * PARSEC_M - if star.distance_known { camera_m } else { DVec3::ZERO });
            }
            if let Some(number) = constellations::find(name) {
                return Ok(epoch.seen_place(middles()[number].1, false) * PARSEC_M);
            }
            let bodies: Vec<&str> = self.bodies.iter().map(|body| &body.name[..]).collect();
            let bodies = if bodies.is_empty() { "none".to_owned() } else { bodies.join(", ") };
            let unknown =
                format!("neither a body, nor a star of builtin:bright, nor a constellation; the bodies are: {bodies}");
            return Err(fault(&unknown));
        };
        let place_m = match body.ephemeris {
            Some(of) => {
                let kernels = self.kernels()?;
                Moment::new(time_s, observer).place(of, kernels.as_deref()).map_err(|problem| fault(&problem))?.0
            }
            None => body.body()?.position_m,
        };
        if place_m == camera_m {
            return Err(fault(&"the camera is at its centre"));
        }
        Ok(place_m - camera_m)
    }

    /// Apparent position of a distant object through the observer's air, m relative to the camera.
    fn seen_m(&self, place_m: DVec3, (time_s, observer): (f64, Option<&Observer>)) -> DVec3 {
        let air = self.scene.observer.as_ref().and_then(ObserverConfig::refracting);
        let (Some(observer), Some(air)) = (observer, air) else { return place_m };
        let zenith = observer.icrs_from_horizon(time_s) * DVec3::Y;
        if place_m.length() > BEYOND_AIR_M {
            Refraction { zenith, density: air.density() }.seen(place_m)
        } else {
            place_m
        }
    }
}
