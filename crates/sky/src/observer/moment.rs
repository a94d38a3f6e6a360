//! What is seen at a moment: by an observer, or from nowhere in particular.

use std::f64::consts::FRAC_PI_2;

use glam::{DMat3, DQuat, DVec3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{Clock, Place, Standpoint};
use crate::{
    catalogue::epoch::Vantage,
    coordinates::{direction_from_lon_lat, icrs_from_galactic},
    ephemeris::{Ephemeris, Kernels, icrs_from_ecliptic},
    solar_system::SolarBody,
    units::{DAY_S, LIGHT_M_S},
};

/// Stars are seen from where the observer is every so many seconds.
const VANTAGE_S: f64 = 0.5 * DAY_S;

/// The observer of a scene.
///
/// The place from which the scene is drawn is that of one moment, the epoch: a camera that went on with the Earth, at 30 km/s, would have everything that depends on its place made
/// anew for every step. Bodies are drawn there as they are seen at the moment that is shown, and so are stars ([`Observer::vantage`]).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Observer {
    /// Where.
    pub place: Place,
    /// What is known of the Earth's rotation.
    pub clock: Clock,
    /// The moment of the epoch, s since 2000-01-01T12:00:00 of civil time.
    pub epoch_s: f64,
    /// How the observer is then; stars are loaded as seen from its place, and the scene is drawn there, also after the observer has [moved](Self::moved).
    pub epoch: Standpoint,
}

impl Observer {
    /// An observer whose epoch is a moment, s since 2000-01-01T12:00:00 of civil time.
    pub fn new(place: Place, clock: Clock, time_s: f64) -> Self {
        Self { place, clock, epoch_s: time_s, epoch: place.at(time_s, &clock) }
    }

    /// The observer at another place, or with other knowledge of the Earth's rotation. The scene is drawn from where it was, so that a camera may stay.
    #[must_use]
    pub fn moved(&self, place: Place, clock: Clock) -> Self {
        let epoch = Standpoint { position_m: self.epoch.position_m, ..place.at(self.epoch_s, &clock) };
        Self { place, clock, epoch, ..*self }
    }

    /// Rotation from the axes of the horizon to those of ICRS at a moment.
    pub fn icrs_from_horizon(&self, time_s: f64) -> DQuat {
        DQuat::from_mat3(&self.place.icrs_from_horizon(time_s, &self.clock))
    }

    /// From where stars are seen at a moment: that of the nearest midnight or noon of civil time, within which aberration changes by 0.1 arcsec.
    pub fn vantage(&self, time_s: f64) -> Vantage {
        self.at(Self::vantage_number(time_s) as f64 * VANTAGE_S).vantage(self.epoch.position_m)
    }

    /// Number of that midnight or noon.
    pub fn vantage_number(time_s: f64) -> i64 {
        (time_s / VANTAGE_S).round() as i64
    }

    /// Where and how the observer is at a moment.
    pub fn at(&self, time_s: f64) -> Standpoint {
        self.place.at(time_s, &self.clock)
    }
}

/// A moment, and who looks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moment {
    /// TDB, s since J2000.0.
    tdb_s: f64,
    /// The observer at the moment, and from where the scene is drawn, m; `None`: bodies are where they are, not where they are seen.
    seen: Option<(Standpoint, DVec3)>,
}

impl Moment {
    /// A moment, s since 2000-01-01T12:00:00 of civil time.
    pub fn new(time_s: f64, observer: Option<&Observer>) -> Self {
        let clock = observer.map(|observer| observer.clock).unwrap_or_default();
        let seen = observer.map(|observer| (observer.at(time_s), observer.epoch.position_m));
        Self { tdb_s: clock.tt_s(time_s), seen }
    }

    /// The middle of the Earth below the observer, as it is drawn, m.
    pub fn earth_m(&self) -> Option<DVec3> {
        self.seen.as_ref().map(|(standpoint, origin_m)| *origin_m - standpoint.from_earth_m)
    }

    /// Where a body is drawn, from the barycentre, ICRS axes, m, and how it stands, if its ephemeris says so: with an observer as the light has it that arrives. The error says why kernels
    /// do not have it.
    pub fn place(&self, of: Ephemeris, kernels: Option<&Kernels>) -> Result<(DVec3, Option<DQuat>), String> {
        match of {
            Ephemeris::Of(body) => Ok(self.placed(of, |at_s| body.barycentric_m(at_s))),
            Ephemeris::Spk(number) => {
                let kernels = kernels.ok_or_else(|| format!("{of}: there are no kernels; scene.kernels names them"))?;
                let known_m = kernels.barycentric_m(number, self.tdb_s)?;
                Ok(self.placed(of, |at_s| kernels.barycentric_m(number, at_s).unwrap_or(known_m)))
            }
        }
    }

    fn placed(&self, of: Ephemeris, barycentric_m: impl Fn(f64) -> DVec3) -> (DVec3, Option<DQuat>) {
        let (place_m, left_s) = match &self.seen {
            None => (barycentric_m(self.tdb_s), self.tdb_s),
            Some((standpoint, origin_m)) => {
                let seen_m = standpoint.apparent_of_m(barycentric_m);
                (*origin_m + seen_m, self.tdb_s - seen_m.length() / LIGHT_M_S)
            }
        };
        (place_m, of.stands_as().map(|body| body.icrs_from_body(left_s)))
    }

    /// TDB, s since J2000.0.
    pub fn tdb_s(&self) -> f64 {
        self.tdb_s
    }
}

/// Axes by which directions are told: z to the frame's pole, x to longitude 0.
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
    /// The observer's: azimuth, from north through east, and altitude. Longitude of these axes is minus the azimuth.
    Horizon,
    /// Those of the Sun: east longitude and latitude of its surface, with which they turn.
    Sun,
    /// Those of Mercury: east longitude and latitude of its surface, with which they turn.
    Mercury,
    /// Those of Venus: east longitude and latitude of its surface, with which they turn.
    Venus,
    /// Those of the Earth: east longitude and latitude of its surface, with which they turn.
    Earth,
    /// Those of the Moon: east longitude and latitude of its surface, with which they turn.
    Moon,
    /// Those of Mars: east longitude and latitude of its surface, with which they turn.
    Mars,
    /// Those of Jupiter: east longitude and latitude of its surface, with which they turn.
    Jupiter,
    /// Those of Saturn: east longitude and latitude of its surface, with which they turn.
    Saturn,
    /// Those of Uranus: east longitude and latitude of its surface, with which they turn.
    Uranus,
    /// Those of Neptune: east longitude and latitude of its surface, with which they turn.
    Neptune,
    /// Those of Io: east longitude and latitude of its surface, with which they turn.
    Io,
    /// Those of Europa: east longitude and latitude of its surface, with which they turn.
    Europa,
    /// Those of Ganymede: east longitude and latitude of its surface, with which they turn.
    Ganymede,
    /// Those of Callisto: east longitude and latitude of its surface, with which they turn.
    Callisto,
    /// Those of Titan: east longitude and latitude of its surface, with which they turn.
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

    /// The body whose axes they are.
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

    /// Whether they turn as time goes on, so that a camera turns with them.
    pub fn turns(self) -> bool {
        self == Self::Horizon || self.body().is_some()
    }

    /// Longitude in the frame's axes, rad, of what is told by degrees: of the horizon an azimuth, which grows the other way.
    pub fn longitude_rad(self, told_deg: f64) -> f64 {
        let sign = if self == Self::Horizon { -1.0 } else { 1.0 };
        sign * told_deg.to_radians()
    }

    /// Rotation from the frame's axes to those of ICRS at a moment, s since 2000-01-01T12:00:00 of civil time; `None` for the horizon where nobody stands on the ground.
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

/// Rotation from a camera's axes to those of a frame, where it looks to a longitude and latitude and its up is towards the frame's pole but for `roll`, by which the top of its
/// picture is turned to the left (counter-clockwise): a position angle from the pole through growing longitude; rad.
pub fn frame_from_camera(longitude_rad: f64, latitude_rad: f64, roll_rad: f64) -> DQuat {
    let ahead = direction_from_lon_lat(longitude_rad, latitude_rad);
    // Towards growing latitude: it is there at the poles too.
    let up = direction_from_lon_lat(longitude_rad, latitude_rad + FRAC_PI_2);
    let level = DQuat::from_mat3(&DMat3::from_cols(ahead.cross(up), up, -ahead));
    (level * DQuat::from_rotation_z(roll_rad)).normalize()
}
