//! Interstellar dust: extinction in V magnitudes per parsec at each position.
//!
//! The opacity is an exponential disc times a log-normal factor from smooth noise of three sizes, plus the named dark clouds near the Sun (`clouds`),
//! so that a dark rift crosses the Milky Way. Both are part of the model: they do not depend on the seed of the stars. Published values are 0.7 to 1
//! mag/kpc near the Sun (here 1, the mean over clouds and the gaps between them) and a scale height of 100 to 125 pc (e.g. Vergely et al. 1998,
//! Marshall et al. 2006). Around the Sun, the Local Bubble is nearly empty out to 100 pc (Lallement et al. 2014).

use std::sync::LazyLock;

use glam::DVec3;

use super::{
    clouds::Clouds,
    noise::{LATTICE_NOISE_DEVIATION, lattice_noise},
    structure::Place,
};

/// Mean opacity in the plane at the Sun's distance from the centre, V magnitudes per parsec.
const LOCAL_OPACITY_MAG_PER_PC: f64 = 1.0e-3;
const LENGTH_PC: f64 = 3500.0;
const HEIGHT_PC: f64 = 110.0;
/// Distance from the Sun at which the dust has reached half of its full density, parsecs.
const BUBBLE_PC: f64 = 90.0;
/// The cloud factor is not evaluated if the opacity is below this share of the local one, which is the case far above the plane.
const NEGLIGIBLE_SHARE: f64 = 1e-4;

/// Edge lengths of the noise cells in parsecs, and the weight of each size.
const CLOUD_SIZES: [(f64, f64); 3] = [(700.0, 0.62), (280.0, 0.58), (110.0, 0.53)];
/// Standard deviation of the natural logarithm of the cloud factor.
const CLOUD_CONTRAST: f64 = 0.9;
/// Chosen from several dozen seeds: a few clouds near the Sun determine the appearance of the sky, and the noise does not reproduce the real ones.
/// With this seed a dark rift is at longitudes 20 to 60 degrees, as in the real sky, and star counts and the contrast between centre and anticentre
/// are about right.
const NOISE_SEED: u64 = 4_000;

/// The named clouds, and a distance beyond all of them, parsecs.
static CLOUDS: LazyLock<Clouds> = LazyLock::new(Clouds::new);
const FARTHEST_CLOUD_PC: f64 = 1300.0;

/// Extinction in V per path length at galactic Cartesian parsecs from the Sun, magnitudes per parsec.
pub fn opacity_mag_per_pc(x_pc: f64, y_pc: f64, z_pc: f64) -> f64 {
    let disc = Place::from_sun(x_pc, y_pc, z_pc).exponential_disc(LENGTH_PC, HEIGHT_PC);
    let distance2 = x_pc * x_pc + y_pc * y_pc + z_pc * z_pc;
    let bubble = distance2 / (distance2 + BUBBLE_PC * BUBBLE_PC);
    let smooth = LOCAL_OPACITY_MAG_PER_PC * disc * bubble;
    let clouds = if distance2 < FARTHEST_CLOUD_PC * FARTHEST_CLOUD_PC {
        CLOUDS.opacity_mag_per_pc(DVec3::new(x_pc, y_pc, z_pc))
    } else {
        0.0
    };
    clouds + if disc < NEGLIGIBLE_SHARE { smooth } else { smooth * cloud_factor(x_pc, y_pc, z_pc) }
}

/// Log-normal factor with mean 1.
fn cloud_factor(x_pc: f64, y_pc: f64, z_pc: f64) -> f64 {
    let normal: f64 = CLOUD_SIZES
        .iter()
        .zip(NOISE_SEED..)
        .map(|(&(size, weight), seed)| weight * lattice_noise(x_pc / size, y_pc / size, z_pc / size, seed))
        .sum::<f64>()
        / LATTICE_NOISE_DEVIATION;
    (CLOUD_CONTRAST * normal - 0.5 * CLOUD_CONTRAST * CLOUD_CONTRAST).exp()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Deterministic scattered positions: multiples of irrational steps.
    fn places() -> impl Iterator<Item = (f64, f64, f64)> {
        (0..100_000).map(|i| {
            let i = f64::from(i);
            ((i * 0.754_877_67).fract(), (i * 0.569_840_29).fract(), (i * 0.324_717_96).fract())
        })
    }

    #[test]
    fn clouds_and_gaps_average_to_the_smooth_disc() {
        let box_pc = 60_000.0;
        let mean = places().map(|(x, y, z)| cloud_factor(box_pc * x, box_pc * y, box_pc * z)).sum::<f64>() / 100_000.0;
        assert!((mean - 1.0).abs() < 0.05, "{mean}");
        // Near the Sun the disc without clouds has its local opacity.
        let smooth =
            Place::from_sun(0.0, 0.0, -super::super::structure::SUN_HEIGHT_PC).exponential_disc(LENGTH_PC, HEIGHT_PC);
        assert!((smooth - 1.0).abs() < 1e-12, "{smooth}");
    }

    #[test]
    fn dust_thins_out_above_the_plane_and_near_the_sun() {
        assert!(opacity_mag_per_pc(0.0, 0.0, 1000.0) < 1e-6);
        assert!(opacity_mag_per_pc(5.0, 0.0, 0.0) < 2e-5);
    }
}
