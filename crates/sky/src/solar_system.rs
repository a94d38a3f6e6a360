//! The bodies of the Solar System by name. Their properties are in the modules that use them: sizes and surfaces in
//! `scene::bodies`, positions and rotation in `ephemeris`, brightness as a function of phase in
//! `photometry::phase_curve`.

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

named!(SolarBody {
    Sun = "sun",
    Mercury = "mercury",
    Venus = "venus",
    Earth = "earth",
    Moon = "moon",
    Mars = "mars",
    Jupiter = "jupiter",
    Saturn = "saturn",
    Uranus = "uranus",
    Neptune = "neptune",
    Io = "io",
    Europa = "europa",
    Ganymede = "ganymede",
    Callisto = "callisto",
    Titan = "titan",
});

impl SolarBody {
    /// The planet that the moon orbits; `None` for the Sun and the planets.
    pub fn planet(self) -> Option<Self> {
        match self {
            Self::Moon => Some(Self::Earth),
            Self::Io | Self::Europa | Self::Ganymede | Self::Callisto => Some(Self::Jupiter),
            Self::Titan => Some(Self::Saturn),
            _ => None,
        }
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
