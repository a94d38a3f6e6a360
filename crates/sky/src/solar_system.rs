//! The bodies of the Solar System by name. Their properties are in the modules that use them: sizes and surfaces in
//! `scene::bodies`, positions and rotation in `ephemeris`, brightness against phase in `photometry::phase_curve`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A body of the Solar System.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum SolarBody {
    /// The Sun.
    Sun,
    /// Mercury.
    Mercury,
    /// Venus.
    Venus,
    /// The Earth.
    Earth,
    /// The Earth's moon.
    Moon,
    /// Mars.
    Mars,
    /// Jupiter.
    Jupiter,
    /// Saturn; with its rings if its light comes from its measured phase curve.
    Saturn,
    /// Uranus.
    Uranus,
    /// Neptune.
    Neptune,
    /// Jupiter's moon Io.
    Io,
    /// Jupiter's moon Europa.
    Europa,
    /// Jupiter's moon Ganymede.
    Ganymede,
    /// Jupiter's moon Callisto.
    Callisto,
    /// Saturn's moon Titan.
    Titan,
}

impl SolarBody {
    /// All bodies.
    pub const ALL: [Self; 15] = [
        Self::Sun,
        Self::Mercury,
        Self::Venus,
        Self::Earth,
        Self::Moon,
        Self::Mars,
        Self::Jupiter,
        Self::Saturn,
        Self::Uranus,
        Self::Neptune,
        Self::Io,
        Self::Europa,
        Self::Ganymede,
        Self::Callisto,
        Self::Titan,
    ];

    /// Name in configurations.
    pub fn name(self) -> &'static str {
        match self {
            Self::Sun => "sun",
            Self::Mercury => "mercury",
            Self::Venus => "venus",
            Self::Earth => "earth",
            Self::Moon => "moon",
            Self::Mars => "mars",
            Self::Jupiter => "jupiter",
            Self::Saturn => "saturn",
            Self::Uranus => "uranus",
            Self::Neptune => "neptune",
            Self::Io => "io",
            Self::Europa => "europa",
            Self::Ganymede => "ganymede",
            Self::Callisto => "callisto",
            Self::Titan => "titan",
        }
    }

    /// The planet that the moon orbits; `None` for the Sun and the planets.
    pub fn planet(self) -> Option<Self> {
        match self {
            Self::Moon => Some(Self::Earth),
            Self::Io | Self::Europa | Self::Ganymede | Self::Callisto => Some(Self::Jupiter),
            Self::Titan => Some(Self::Saturn),
            _ => None,
        }
    }

    /// The body with a name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|body| body.name() == name)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn from_name_inverts_name() {
        for body in SolarBody::ALL {
            assert_eq!(SolarBody::from_name(body.name()), Some(body));
        }
        assert_eq!(SolarBody::from_name("pluto"), None);
    }
}
