//! Named dark clouds near the Sun, modelled as Gaussians in space. They obscure the Milky Way at the positions of the real clouds.
//!
//! Positions and sizes: Dame, Hartmann and Thaddeus 2001, ApJ 547, 792 and Dame et al. 1987, ApJ 322, 706 (CO).
//! Distances: Zucker et al. 2020, A&A 633, A51. Extinctions are rounded means over the given size.

use glam::DVec3;

/// A dark cloud.
struct Cloud {
    /// Galactic longitude and latitude of its centre, degrees.
    centre_deg: [f64; 2],
    /// Standard deviations along longitude and latitude, degrees.
    sigma_deg: [f64; 2],
    /// Distance of its centre, pc.
    distance_pc: f64,
    /// Extinction along the line of sight through its centre, V magnitudes.
    extinction_mag: f64,
}

const fn cloud(centre_deg: [f64; 2], sigma_deg: [f64; 2], distance_pc: f64, extinction_mag: f64) -> Cloud {
    Cloud { centre_deg, sigma_deg, distance_pc, extinction_mag }
}

const CLOUDS: [Cloud; 21] = [
    // The Great Rift: Serpens and Aquila, Ophiuchus, Vulpecula, Cygnus.
    cloud([30.0, 4.0], [7.0, 2.0], 260.0, 2.5),
    cloud([18.0, 4.5], [5.0, 2.0], 260.0, 2.0),
    cloud([42.0, 1.5], [6.0, 1.5], 350.0, 2.0),
    cloud([57.0, 1.0], [6.0, 1.5], 400.0, 2.2),
    cloud([78.0, 0.0], [5.0, 1.8], 800.0, 2.5),
    cloud([90.0, 1.0], [3.0, 1.5], 800.0, 1.8),
    // The Pipe, rho Ophiuchi, Lupus.
    cloud([359.0, 5.0], [3.5, 1.2], 150.0, 2.2),
    cloud([354.0, 16.0], [2.5, 2.0], 140.0, 3.0),
    cloud([340.0, 12.0], [4.0, 3.0], 160.0, 1.0),
    cloud([343.0, 2.5], [7.0, 1.5], 200.0, 1.5),
    // The Coalsack, Chamaeleon, Circinus, Vela.
    cloud([302.0, -0.5], [2.2, 1.8], 180.0, 2.2),
    cloud([299.0, -16.0], [3.0, 2.0], 190.0, 1.2),
    cloud([317.5, -4.0], [2.0, 1.2], 700.0, 1.5),
    cloud([265.0, 0.5], [4.0, 1.5], 900.0, 2.0),
    // Orion, Monoceros.
    cloud([211.0, -19.5], [3.0, 1.2], 410.0, 2.5),
    cloud([206.0, -13.0], [2.0, 1.6], 410.0, 2.5),
    cloud([215.0, -12.0], [2.0, 1.2], 800.0, 1.5),
    // Taurus, Perseus, Auriga, Cepheus.
    cloud([171.0, -15.0], [4.5, 2.5], 140.0, 1.8),
    cloud([159.5, -19.5], [2.5, 1.4], 290.0, 2.0),
    cloud([163.0, -8.5], [3.5, 1.4], 470.0, 1.5),
    cloud([109.0, 15.0], [5.0, 3.0], 350.0, 1.2),
];

/// A cloud in space, prepared for evaluation.
struct Placed {
    middle_pc: DVec3,
    /// Unit vectors along the line of sight, longitude and latitude, each divided by its standard deviation, per pc.
    axes: [DVec3; 3],
    /// Opacity at the centre, V magnitudes per pc.
    opacity: f64,
    /// Distance from the centre beyond which the cloud is neglected, pc.
    reach_pc: f64,
}

/// All clouds.
pub struct Clouds(Vec<Placed>);

impl Clouds {
    /// Places the clouds in space. The depth of each cloud is the mean of its two widths.
    pub fn new() -> Self {
        Self(CLOUDS.iter().map(placed).collect())
    }

    /// Opacity of the clouds at galactic Cartesian parsecs from the Sun, V magnitudes per pc.
    pub fn opacity_mag_per_pc(&self, place_pc: DVec3) -> f64 {
        let opacity = |cloud: &Placed| {
            let off = place_pc - cloud.middle_pc;
            if off.length_squared() > cloud.reach_pc * cloud.reach_pc {
                return 0.0;
            }
            let squares: f64 = cloud.axes.iter().map(|axis| axis.dot(off).powi(2)).sum();
            cloud.opacity * (-0.5 * squares).exp()
        };
        self.0.iter().map(opacity).sum()
    }
}

fn placed(cloud: &Cloud) -> Placed {
    let [l, b] = cloud.centre_deg.map(f64::to_radians);
    let towards = crate::coordinates::direction_from_lon_lat(l, b);
    let along_l = DVec3::new(-l.sin(), l.cos(), 0.0);
    let along_b = towards.cross(along_l);
    let [across, up] = cloud.sigma_deg.map(|deg| cloud.distance_pc * deg.to_radians().tan());
    let deep = (across * up).sqrt();
    Placed {
        middle_pc: cloud.distance_pc * towards,
        axes: [towards / deep, along_l / across, along_b / up],
        opacity: cloud.extinction_mag / (deep * std::f64::consts::TAU.sqrt()),
        reach_pc: 4.0 * across.max(up),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_of_sight_through_a_cloud_has_its_extinction() {
        let clouds = Clouds::new();
        for cloud in &CLOUDS {
            let [l, b] = cloud.centre_deg.map(f64::to_radians);
            let towards = crate::coordinates::direction_from_lon_lat(l, b);
            let sum: f64 = (0..4000).map(|i| clouds.opacity_mag_per_pc(towards * f64::from(i) * 0.5) * 0.5).sum();
            // Other clouds may be in front of the cloud or behind it.
            assert!((0.99..2.2).contains(&(sum / cloud.extinction_mag)), "{:?}: {sum}", cloud.centre_deg);
        }
    }
}
