//! Moments, with or without an observer, and the frames of reference that depend on them.

use std::f64::consts::FRAC_PI_2;

use glam::{DMat3, DQuat, DVec3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{Clock, Place, Standpoint};
use crate::{
    catalogue::epoch::Vantage,
    coordinates::{direction_from_lon_lat, icrs_from_galactic, lon_lat_from_direction},
    ephemeris::{Ephemeris, Kernels, icrs_from_ecliptic},
    solar_system::SolarBody,
    units::{DAY_S, LIGHT_M_S},
};

/// Interval of the observer positions from which stars are seen, s.
const VANTAGE_S: f64 = 0.5 * DAY_S;

/// The observer of a scene.
///
/// The scene is drawn from the observer's position at one moment, the epoch. A camera that moved with the Earth, at
/// 30 km/s, would need everything that depends on its position to be rebuilt at every step. Bodies and stars
/// ([`Observer::vantage`]) are drawn relative to that position as they are seen at the displayed moment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Observer {
    /// Position on the Earth.
    pub place: Place,
    /// Parameters of the Earth's rotation.
    pub clock: Clock,
    /// Moment of the epoch, s since 2000-01-01T12:00:00 of civil time.
    pub epoch_s: f64,
    /// State of the observer at the epoch. Stars are loaded as seen from its position. The scene is drawn from there,
    /// even after the observer has [moved](Self::moved).
    pub epoch: Standpoint,
}

impl Observer {
    /// Creates an observer with an epoch, s since 2000-01-01T12:00:00 of civil time.
    pub fn new(place: Place, clock: Clock, time_s: f64) -> Self {
        Self { place, clock, epoch_s: time_s, epoch: place.standpoint(time_s, &clock) }
    }

    /// Returns the observer at another place, or with other parameters of the Earth's rotation. The scene is still
    /// drawn from the old position, so that a camera keeps its place.
    #[must_use]
    pub fn moved(&self, place: Place, clock: Clock) -> Self {
        let epoch = Standpoint { position_m: self.epoch.position_m, ..place.standpoint(self.epoch_s, &clock) };
        Self { place, clock, epoch, ..*self }
    }

    /// Rotation from the axes of the horizon to ICRS at a moment.
    pub fn icrs_from_horizon(&self, time_s: f64) -> DQuat {
        DQuat::from_mat3(&self.place.icrs_from_horizon(time_s, &self.clock))
    }

    /// Vantage from which stars are seen at a moment: that of the nearest midnight or noon of civil time. Aberration
    /// changes by 0.1 arcsec within this time.
    pub fn vantage(&self, time_s: f64) -> Vantage {
        self.standpoint(Self::vantage_number(time_s) as f64 * VANTAGE_S).vantage(self.epoch.position_m)
    }

    /// Number of that midnight or noon.
    pub fn vantage_number(time_s: f64) -> i64 {
        (time_s / VANTAGE_S).round() as i64
    }

    /// State of the observer at a moment.
    pub fn standpoint(&self, time_s: f64) -> Standpoint {
        self.place.standpoint(time_s, &self.clock)
    }
}

/// A moment, and the observer if there is one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moment {
    /// TDB, s since J2000.0.
    tdb_s: f64,
    /// The observer at this moment and the position from which the scene is drawn, m; `None`: bodies have their
    /// geometric positions, without light time and aberration.
    observed_from: Option<(Standpoint, DVec3)>,
}

impl Moment {
    /// Creates a moment, s since 2000-01-01T12:00:00 of civil time.
    pub fn new(time_s: f64, observer: Option<&Observer>) -> Self {
        let clock = observer.map(|observer| observer.clock).unwrap_or_default();
        let observed_from = observer.map(|observer| (observer.standpoint(time_s), observer.epoch.position_m));
        Self { tdb_s: clock.tt_s(time_s), observed_from }
    }

    /// Centre of the Earth below the observer, as drawn, m.
    pub fn earth_m(&self) -> Option<DVec3> {
        self.observed_from.as_ref().map(|(standpoint, origin_m)| *origin_m - standpoint.from_earth_m)
    }

    /// Position at which a body is drawn, relative to the barycentre, ICRS axes, m, and its orientation if its
    /// ephemeris defines one. With an observer, light time and aberration are included. The error says why the kernels
    /// do not give the position.
    pub fn place(&self, ephemeris: Ephemeris, kernels: Option<&Kernels>) -> Result<(DVec3, Option<DQuat>), String> {
        match ephemeris {
            Ephemeris::Of(body) => Ok(self.placed(ephemeris, |at_s| body.barycentric_m(at_s))),
            Ephemeris::Spk(number) => {
                let kernels =
                    kernels.ok_or_else(|| format!("{ephemeris}: no kernels are loaded; list them in scene.kernels"))?;
                let known_m = kernels.barycentric_m(number, self.tdb_s)?;
                Ok(self.placed(ephemeris, |at_s| kernels.barycentric_m(number, at_s).unwrap_or(known_m)))
            }
        }
    }

    fn placed(&self, ephemeris: Ephemeris, barycentric_m: impl Fn(f64) -> DVec3) -> (DVec3, Option<DQuat>) {
        let (place_m, left_s) = match &self.observed_from {
            None => (barycentric_m(self.tdb_s), self.tdb_s),
            Some((standpoint, origin_m)) => {
                let seen_m = standpoint.apparent_of_m(barycentric_m);
                (*origin_m + seen_m, self.tdb_s - seen_m.length() / LIGHT_M_S)
            }
        };
        (place_m, ephemeris.stands_as().map(|body| body.icrs_from_body(left_s)))
    }

    /// TDB, s since J2000.0.
    pub fn tdb_s(&self) -> f64 {
        self.tdb_s
    }
}

/// Frame of reference for directions: z to the frame's pole, x to longitude 0.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Frame {
    /// Right ascension and declination.
    #[default]
    Icrs,
    /// Longitude from the galactic centre.
    Galactic,
    /// Mean ecliptic and equinox of J2000.0.
    Ecliptic,
    /// Axes of the observer's horizon: azimuth, from north through east, and altitude. Longitude in these axes is
    /// minus the azimuth.
    Horizon,
    /// Axes of the Sun, which rotate with it: east longitude and latitude on its surface.
    Sun,
    /// Axes of Mercury, which rotate with it: east longitude and latitude on its surface.
    Mercury,
    /// Axes of Venus, which rotate with it: east longitude and latitude on its surface.
    Venus,
    /// Axes of the Earth, which rotate with it: east longitude and latitude on its surface.
    Earth,
    /// Axes of the Moon, which rotate with it: east longitude and latitude on its surface.
    Moon,
    /// Axes of Mars, which rotate with it: east longitude and latitude on its surface.
    Mars,
    /// Axes of Jupiter, which rotate with it: east longitude and latitude on its surface.
    Jupiter,
    /// Axes of Saturn, which rotate with it: east longitude and latitude on its surface.
    Saturn,
    /// Axes of Uranus, which rotate with it: east longitude and latitude on its surface.
    Uranus,
    /// Axes of Neptune, which rotate with it: east longitude and latitude on its surface.
    Neptune,
    /// Axes of Io, which rotate with it: east longitude and latitude on its surface.
    Io,
    /// Axes of Europa, which rotate with it: east longitude and latitude on its surface.
    Europa,
    /// Axes of Ganymede, which rotate with it: east longitude and latitude on its surface.
    Ganymede,
    /// Axes of Callisto, which rotate with it: east longitude and latitude on its surface.
    Callisto,
    /// Axes of Titan, which rotate with it: east longitude and latitude on its surface.
    Titan,
}

impl Frame {
    /// Name in configurations.
    pub fn name(self) -> &'static str {
        match self {
            Self::Icrs => "icrs",
            Self::Galactic => "galactic",
            Self::Ecliptic => "ecliptic",
            Self::Horizon => "horizon",
            _ => self.body().map_or("", SolarBody::name),
        }
    }

    /// The body to which the axes are fixed.
    pub fn body(self) -> Option<SolarBody> {
        match self {
            Self::Icrs | Self::Galactic | Self::Ecliptic | Self::Horizon => None,
            Self::Sun => Some(SolarBody::Sun),
            Self::Mercury => Some(SolarBody::Mercury),
            Self::Venus => Some(SolarBody::Venus),
            Self::Earth => Some(SolarBody::Earth),
            Self::Moon => Some(SolarBody::Moon),
            Self::Mars => Some(SolarBody::Mars),
            Self::Jupiter => Some(SolarBody::Jupiter),
            Self::Saturn => Some(SolarBody::Saturn),
            Self::Uranus => Some(SolarBody::Uranus),
            Self::Neptune => Some(SolarBody::Neptune),
            Self::Io => Some(SolarBody::Io),
            Self::Europa => Some(SolarBody::Europa),
            Self::Ganymede => Some(SolarBody::Ganymede),
            Self::Callisto => Some(SolarBody::Callisto),
            Self::Titan => Some(SolarBody::Titan),
        }
    }

    /// Whether the frame rotates with time, so that a camera rotates with it.
    pub fn turns(self) -> bool {
        self == Self::Horizon || self.body().is_some()
    }

    /// Longitude in the frame's axes, rad, of an angle in degrees. For the horizon the angle is an azimuth, which
    /// counts in the opposite direction.
    pub fn longitude_rad(self, angle_deg: f64) -> f64 {
        let sign = if self == Self::Horizon { -1.0 } else { 1.0 };
        sign * angle_deg.to_radians()
    }

    /// Angle in degrees, 0 to 360, of a longitude in the frame's axes, rad: the inverse of [`Self::longitude_rad`].
    pub fn longitude_deg(self, longitude_rad: f64) -> f64 {
        let sign = if self == Self::Horizon { -1.0 } else { 1.0 };
        let angle_deg = (sign * longitude_rad).to_degrees().rem_euclid(360.0);
        // The remainder of a tiny negative angle rounds up to the full circle.
        if angle_deg < 360.0 { angle_deg } else { 0.0 }
    }

    /// Rotation from the frame's axes to ICRS at a moment, s since 2000-01-01T12:00:00 of civil time; `None` for the
    /// horizon without an observer.
    pub fn icrs_from(self, observer: Option<&Observer>, time_s: f64) -> Option<DMat3> {
        match self {
            Self::Icrs => Some(DMat3::IDENTITY),
            Self::Galactic => Some(icrs_from_galactic()),
            Self::Ecliptic => Some(icrs_from_ecliptic()),
            Self::Horizon => observer.map(|observer| {
                let icrs_from_horizon = observer.place.icrs_from_horizon(time_s, &observer.clock);
                let [east, zenith, south] = icrs_from_horizon.to_cols_array_2d().map(DVec3::from_array);
                DMat3::from_cols(-south, -east, zenith)
            }),
            _ => {
                let clock = observer.map_or_else(Clock::default, |observer| observer.clock);
                self.body().map(|body| DMat3::from_quat(body.icrs_from_body(clock.tt_s(time_s))))
            }
        }
    }
}

/// Rotation from a camera's axes to those of a frame, for a camera that looks towards a longitude and latitude, with
/// its up direction towards the frame's pole. `roll_rad` turns the top of its picture to the left (counter-clockwise):
/// a position angle from the pole through increasing longitude. Angles in rad.
pub fn frame_from_camera(longitude_rad: f64, latitude_rad: f64, roll_rad: f64) -> DQuat {
    let ahead = direction_from_lon_lat(longitude_rad, latitude_rad);
    // The up direction is that of increasing latitude, which is defined even at the poles.
    let up = direction_from_lon_lat(longitude_rad, latitude_rad + FRAC_PI_2);
    let level = DQuat::from_mat3(&DMat3::from_cols(ahead.cross(up), up, -ahead));
    (level * DQuat::from_rotation_z(roll_rad)).normalize()
}

/// Longitude, latitude and roll of a camera, rad: the inverse of [`frame_from_camera`].
pub fn direction_of_camera(frame_from_camera_axes: DQuat) -> [f64; 3] {
    let (longitude_rad, latitude_rad) = lon_lat_from_direction(frame_from_camera_axes * DVec3::NEG_Z);
    let level = frame_from_camera(longitude_rad, latitude_rad, 0.0);
    let right = level.inverse() * (frame_from_camera_axes * DVec3::X);
    [longitude_rad, latitude_rad, right.y.atan2(right.x)]
}
