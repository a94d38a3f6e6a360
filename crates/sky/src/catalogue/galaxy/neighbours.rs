//! The galaxies visible to the naked eye: modelled as exponential discs with the total light of each galaxy.
//!
//! Magnitudes, colours, position angles and axis ratios: de Vaucouleurs et al. 1991, Third Reference Catalogue. Scale
//! lengths: about 1/3.2 of the radius at 25 B magnitudes per square arcsecond. The catalogued light of the Magellanic
//! Clouds already contains the extinction.

use glam::DVec3;

use crate::{
    coordinates::direction_from_lon_lat,
    photometry::{blackbody::rec709_in_gamut, colour_index::temperature_k_from_b_v},
    units::illuminance_lx_from_magnitude,
};

/// A component of a galaxy: an ellipse on the sky.
struct Part {
    /// ICRS right ascension and declination of its centre, degrees.
    centre_deg: [f64; 2],
    v_mag: f64,
    b_v: f64,
    /// Exponential scale length along the major axis, degrees.
    scale_deg: f64,
    /// Axis ratio, minor over major.
    ratio: f64,
    /// Position angle of the major axis, from north through east, degrees.
    angle_deg: f64,
}

const fn part(centre_deg: [f64; 2], v_mag: f64, b_v: f64, scale_deg: f64, ratio: f64, angle_deg: f64) -> Part {
    Part { centre_deg, v_mag, b_v, scale_deg, ratio, angle_deg }
}

const PARTS: [Part; 6] = [
    // Large Magellanic Cloud, V = 0.40: a disc, and a bar with a quarter of the light.
    part([80.0, -69.0], 0.71, 0.51, 1.55, 0.85, 170.0),
    part([80.9, -69.8], 1.90, 0.51, 0.62, 0.30, 120.0),
    // Small Magellanic Cloud, V = 2.25.
    part([13.2, -72.8], 2.25, 0.45, 0.72, 0.58, 45.0),
    // Andromeda, V = 3.44: disc and bulge.
    part([10.685, 41.269], 3.75, 0.92, 0.46, 0.30, 35.0),
    part([10.685, 41.269], 4.95, 0.98, 0.08, 0.70, 45.0),
    // Triangulum, V = 5.72.
    part([23.462, 30.660], 5.72, 0.55, 0.17, 0.59, 23.0),
];

/// Number of scale lengths beyond which the light is neglected.
const REACH: f64 = 9.0;

struct Placed {
    towards: DVec3,
    /// Unit vectors along the major and minor axis, divided by the scale length (rad).
    axes: [DVec3; 2],
    central_cd_m2: [f64; 3],
    least_cosine: f64,
}

/// The galaxies as seen from the Sun.
pub struct Neighbours(Vec<Placed>);

impl Neighbours {
    /// Places all galaxies.
    pub fn new() -> Self {
        Self(PARTS.iter().map(placed).collect())
    }

    /// Luminance towards a unit vector, world axes, cd/m^2.
    pub fn luminance_cd_m2(&self, towards: DVec3) -> [f64; 3] {
        let mut light = [0.0; 3];
        for part in self.0.iter().filter(|part| towards.dot(part.towards) > part.least_cosine) {
            let radius = part.axes.map(|axis| axis.dot(towards)).into_iter().map(|x| x * x).sum::<f64>().sqrt();
            let falls = (-radius).exp();
            light.iter_mut().zip(part.central_cd_m2).for_each(|(sum, central)| *sum += falls * central);
        }
        light
    }
}

fn placed(part: &Part) -> Placed {
    let [ra, dec] = part.centre_deg.map(f64::to_radians);
    let towards = direction_from_lon_lat(ra, dec);
    let east = DVec3::new(-ra.sin(), ra.cos(), 0.0);
    let north = towards.cross(east);
    let (sin, cos) = part.angle_deg.to_radians().sin_cos();
    let (long, short) = (north * cos + east * sin, east * cos - north * sin);
    let scale = part.scale_deg.to_radians();
    // An exponential disc with central luminance L and scale lengths a and b gives the illuminance 2 pi L a b.
    let central = illuminance_lx_from_magnitude(part.v_mag) / (std::f64::consts::TAU * scale * scale * part.ratio);
    Placed {
        towards,
        axes: [long / scale, short / (scale * part.ratio)],
        central_cd_m2: rec709_in_gamut(temperature_k_from_b_v(part.b_v)).map(|c| central * c),
        least_cosine: (REACH * scale).cos(),
    }
}
