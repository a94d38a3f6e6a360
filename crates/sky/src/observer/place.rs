//! A position on the Earth, and its position in the Solar System at a moment.

use std::f64::consts::FRAC_PI_2;

use glam::{DMat3, DVec3};
use sofars::{coords::gd2gc, pnp::c2t06a};

use super::Clock;
use crate::{
    catalogue::epoch::{Epoch, Vantage},
    coordinates::{direction_from_lon_lat, lon_lat_from_direction},
    ephemeris::astrometric_m,
    relativity::seen_direction,
    solar_system::SolarBody,
    units::{DAY_S, EARTH_ROTATION_RAD_S, J2000_JD, JULIAN_YEAR_S, LIGHT_M_S, PARSEC_M},
};

/// SOFA's identifier of the ellipsoid WGS84.
const WGS84: i32 = 1;

/// A position on the Earth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    /// Geodetic latitude on WGS84, rad, north positive, at most a quarter turn.
    pub latitude_rad: f64,
    /// Longitude, rad, east positive.
    pub longitude_rad: f64,
    /// Height above the ellipsoid, m.
    pub height_m: f64,
}

/// An observer at a moment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Standpoint {
    /// TT, s since J2000.0.
    pub tt_s: f64,
    /// Position relative to the barycentre, ICRS axes, m.
    pub position_m: DVec3,
    /// Position relative to the centre of the Earth, ICRS axes, m.
    pub from_earth_m: DVec3,
    /// Velocity in units of the speed of light, ICRS axes.
    pub velocity_c: DVec3,
    /// Rotation from the axes of the horizon to ICRS.
    pub icrs_from_horizon: DMat3,
}

impl Place {
    /// State of an observer at this place at a moment, s since 2000-01-01T12:00:00 of civil time. Polar motion, at most
    /// 0.3 arcsec, is left out.
    pub fn standpoint(&self, time_s: f64, clock: &Clock) -> Standpoint {
        let tt_s = clock.tt_s(time_s);
        let icrs_from_earth = icrs_from_earth(time_s, clock);
        let Ok(from_earth_m) = gd2gc(WGS84, self.longitude_rad, self.latitude_rad, self.height_m) else {
            unreachable!("SOFA supports WGS84")
        };
        let place_m = icrs_from_earth * DVec3::from_array(from_earth_m);
        let rotation = icrs_from_earth * DVec3::Z * EARTH_ROTATION_RAD_S;
        let velocity_m_s = SolarBody::Earth.velocity_m_s(tt_s) + rotation.cross(place_m);
        Standpoint {
            tt_s,
            position_m: SolarBody::Earth.barycentric_m(tt_s) + place_m,
            from_earth_m: place_m,
            velocity_c: velocity_m_s / LIGHT_M_S,
            icrs_from_horizon: icrs_from_earth * self.earth_from_horizon(),
        }
    }

    /// Rotation from the axes of the horizon to those of the rotating Earth.
    fn earth_from_horizon(&self) -> DMat3 {
        let zenith = direction_from_lon_lat(self.longitude_rad, self.latitude_rad);
        let east = direction_from_lon_lat(self.longitude_rad + FRAC_PI_2, 0.0);
        DMat3::from_cols(east, zenith, east.cross(zenith))
    }

    /// Rotation from the axes of the horizon to ICRS at a moment, as in [`Place::standpoint`].
    pub fn icrs_from_horizon(&self, time_s: f64, clock: &Clock) -> DMat3 {
        icrs_from_earth(time_s, clock) * self.earth_from_horizon()
    }
}

/// Rotation from the axes of the rotating Earth (z to the pole, x to Greenwich) to ICRS.
fn icrs_from_earth(time_s: f64, clock: &Clock) -> DMat3 {
    let [tt_days, ut1_days] = [clock.tt_s(time_s), clock.ut1_s(time_s)].map(|seconds| seconds / DAY_S);
    DMat3::from_cols_array_2d(&c2t06a(J2000_JD, tt_days, J2000_JD, ut1_days, 0.0, 0.0))
}

impl Standpoint {
    /// Vantage at this position for a scene that is drawn from `origin_m`.
    pub(super) fn vantage(&self, origin_m: DVec3) -> Vantage {
        let [position_pc, origin_pc] = [self.position_m, origin_m].map(|place_m| place_m / PARSEC_M);
        Vantage { position_pc, velocity_c: self.velocity_c, origin_pc }
    }

    /// Epoch of the stars as seen from here.
    pub fn of_stars(&self) -> Epoch {
        let vantage = self.vantage(self.position_m);
        Epoch { years: self.tt_s / JULIAN_YEAR_S, seen_from: Some(vantage) }
    }

    /// Apparent position of a body, without refraction: its direction in ICRS axes, with light time and aberration,
    /// times its distance, m. The deflection of light by the Sun, 0.02 arcsec at 20 degrees from it, is left out.
    pub fn apparent_m(&self, body: SolarBody) -> DVec3 {
        self.apparent_of_m(|at_s| body.barycentric_m(at_s))
    }

    /// As [`Self::apparent_m`], for a body whose position relative to the barycentre, m, is given as a function of
    /// time.
    pub fn apparent_of_m(&self, barycentric_m: impl Fn(f64) -> DVec3) -> DVec3 {
        self.aberrated(astrometric_m(barycentric_m, self.position_m, self.tt_s))
    }

    /// Aberrated direction as the observer sees it; the length is kept.
    pub fn aberrated(&self, direction: DVec3) -> DVec3 {
        seen_direction(self.velocity_c, direction) * direction.length()
    }

    /// Azimuth and altitude of a direction in ICRS axes, rad.
    pub fn azimuth_altitude_rad(&self, direction: DVec3) -> [f64; 2] {
        let local = self.icrs_from_horizon.transpose() * direction;
        let (azimuth, altitude) = lon_lat_from_direction(DVec3::new(-local.z, local.x, local.y));
        [azimuth, altitude]
    }
}

/// Direction at an azimuth and altitude, rad, in the axes of the horizon.
pub fn horizontal_direction(azimuth_rad: f64, altitude_rad: f64) -> DVec3 {
    let DVec3 { x: north, y: east, z: up } = direction_from_lon_lat(azimuth_rad, altitude_rad);
    DVec3::new(east, up, -north)
}
