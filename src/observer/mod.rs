//! A place on the Earth at a moment: where its observer is among the planets, how fast, and how the horizon lies.
//!
//! Axes of the horizon are those of a camera that looks north: +x east, +y to the zenith (the normal of the ellipsoid), -z north. Azimuth counts from north through east.

mod clock;
mod refraction;

use glam::{DMat3, DQuat, DVec3};
use sofars::{coords::gd2gc, pnp::c2t06a};

pub use self::{clock::Clock, refraction::Air};
use crate::{ephemeris::Ephemeris, relativity::Motion, units::LIGHT_M_S};

/// The Earth's rate of rotation, rad/s of UT1.
const ROTATION_RAD_S: f64 = 7.292_115_146_7e-5;
/// SOFA's number of the ellipsoid WGS84.
const WGS84: i32 = 1;
const J2000_JD: f64 = 2_451_545.0;
const DAY_S: f64 = 86_400.0;

/// A place on the Earth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    /// Geodetic latitude on WGS84, rad, north positive, at most a quarter turn.
    pub latitude_rad: f64,
    /// Longitude, rad, east positive.
    pub longitude_rad: f64,
    /// Height over the ellipsoid, m.
    pub height_m: f64,
}

/// An observer at a moment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Standpoint {
    /// TT, s since J2000.0.
    pub tt_s: f64,
    /// Place from the barycentre, ICRS axes, m.
    pub position_m: DVec3,
    /// Velocity over that of light, ICRS axes.
    pub velocity_c: DVec3,
    /// From the axes of the horizon to those of ICRS.
    pub icrs_from_horizon: DMat3,
    /// From the axes of the rotating Earth (z to the pole, x to Greenwich) to those of ICRS.
    pub icrs_from_earth: DMat3,
}

/// A moment, and who looks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moment {
    /// s since 2000-01-01T12:00:00 of civil time.
    pub time_s: f64,
    /// TDB, s since J2000.0.
    pub tdb_s: f64,
    /// The observer; `None`: bodies are where they are, not where they are seen.
    pub standpoint: Option<Standpoint>,
}

impl Moment {
    /// Where a body is drawn, from the barycentre, ICRS axes, m, and how it stands: with an observer as the light has it that arrives.
    pub fn place(&self, body: Ephemeris) -> (DVec3, DQuat) {
        match &self.standpoint {
            None => (body.barycentric_m(self.tdb_s), body.icrs_from_body(self.tdb_s)),
            Some(standpoint) => {
                let seen_m = standpoint.apparent_m(body);
                let left_s = self.tdb_s - seen_m.length() / LIGHT_M_S;
                (standpoint.position_m + seen_m, body.icrs_from_body(left_s))
            }
        }
    }
}

impl Place {
    /// The place at a moment, s since 2000-01-01T12:00:00 of civil time. Polar motion, at most 0.3 arcsec, is left out.
    pub fn at(&self, time_s: f64, clock: &Clock) -> Standpoint {
        let (tt_s, ut1_s) = (clock.tt_s(time_s), clock.ut1_s(time_s));
        let rows = c2t06a(J2000_JD, tt_s / DAY_S, J2000_JD, ut1_s / DAY_S, 0.0, 0.0);
        let icrs_from_earth = DMat3::from_cols_array_2d(&rows);
        let (sin_latitude, cos_latitude) = self.latitude_rad.sin_cos();
        let (sin_longitude, cos_longitude) = self.longitude_rad.sin_cos();
        // It refuses heights below the Earth's middle alone.
        let from_earth_m = gd2gc(WGS84, self.longitude_rad, self.latitude_rad, self.height_m).unwrap_or_default();
        let place_m = icrs_from_earth * DVec3::from_array(from_earth_m);
        let rotation = icrs_from_earth * DVec3::Z * ROTATION_RAD_S;
        let east = DVec3::new(-sin_longitude, cos_longitude, 0.0);
        let zenith = DVec3::new(cos_latitude * cos_longitude, cos_latitude * sin_longitude, sin_latitude);
        let velocity_m_s = Ephemeris::Earth.velocity_m_s(tt_s) + rotation.cross(place_m);
        Standpoint {
            tt_s,
            position_m: Ephemeris::Earth.barycentric_m(tt_s) + place_m,
            velocity_c: velocity_m_s / LIGHT_M_S,
            icrs_from_horizon: icrs_from_earth * DMat3::from_cols(east, zenith, east.cross(zenith)),
            icrs_from_earth,
        }
    }
}

impl Standpoint {
    /// Where a body is seen without air: its direction in ICRS axes, light time and aberration included, times its distance, m. The Sun's deflection of light, 0.02 arcsec at 20
    /// degrees from it, is left out.
    pub fn apparent_m(&self, body: Ephemeris) -> DVec3 {
        let place_m = body.astrometric_m(self.position_m, self.tt_s);
        self.aberrated(place_m)
    }

    /// A direction of any length as the observer sees it.
    pub fn aberrated(&self, direction: DVec3) -> DVec3 {
        Motion::new(self.velocity_c).map_or(direction, |motion| motion.seen(direction).normalize() * direction.length())
    }

    /// Azimuth and altitude of a direction in ICRS axes, rad.
    pub fn azimuth_altitude_rad(&self, direction: DVec3) -> [f64; 2] {
        let local = self.icrs_from_horizon.transpose() * direction.normalize();
        let azimuth = local.x.atan2(-local.z);
        [azimuth.rem_euclid(std::f64::consts::TAU), local.y.clamp(-1.0, 1.0).asin()]
    }
}

/// Rotation from a camera's axes to those of ICRS, where it looks to a longitude and latitude of a frame, its up towards the frame's pole but for `roll`, by which it is turned
/// clockwise as it sees itself; rad. Columns of `frame`: the frame's axes in ICRS.
pub fn icrs_from_camera(frame: &DMat3, longitude: f64, latitude: f64, roll: f64) -> DQuat {
    let (sin_longitude, cos_longitude) = longitude.sin_cos();
    let (sin_latitude, cos_latitude) = latitude.sin_cos();
    let forward = DVec3::new(cos_latitude * cos_longitude, cos_latitude * sin_longitude, sin_latitude);
    let up = DVec3::new(-sin_latitude * cos_longitude, -sin_latitude * sin_longitude, cos_latitude);
    let level = DMat3::from_cols(forward.cross(up), up, -forward);
    (DQuat::from_mat3(&(*frame * level)) * DQuat::from_rotation_z(-roll)).normalize()
}

/// Direction of azimuth and altitude, rad, in the axes of the horizon.
pub fn horizontal_direction(azimuth_rad: f64, altitude_rad: f64) -> DVec3 {
    let (sin_azimuth, cos_azimuth) = azimuth_rad.sin_cos();
    let (sin_altitude, cos_altitude) = altitude_rad.sin_cos();
    DVec3::new(sin_azimuth * cos_altitude, sin_altitude, -cos_azimuth * cos_altitude)
}
