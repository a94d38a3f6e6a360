//! The surface of a procedural asteroid: its distance from the centre in every direction, and its brightness.
//!
//! It combines an ellipsoid, gradient noise in four octaves, and craters. All levels of detail sample this function.
//! Lengths are relative: the finished shape is scaled.

use std::f64::consts::TAU;

use glam::{DVec3, IVec3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Semi-axes of the ellipsoids: from nearly round to twice as long as thick.
pub(super) const SEMI_AXES: [[f64; 3]; 5] =
    [[1.0, 0.95, 0.88], [1.0, 0.86, 0.74], [1.0, 0.74, 0.64], [1.0, 0.66, 0.56], [1.0, 0.54, 0.47]];

/// Frequency, in waves per radius, and amplitude of the octaves of noise. The finest wave still spans several edges.
const OCTAVES: [(f64, f64); 4] = [(0.8, 0.17), (1.5, 0.08), (2.5, 0.03), (4.0, 0.006)];

/// Smallest and largest angular radius of a crater, rad, and the ratio of its depth to its radius.
const CRATER_RAD: [f64; 2] = [0.35, 0.75];
const CRATER_DEPTH: f64 = 0.13;
/// Ratios of the height and the width of a crater's rim to the crater's radius.
const RIM_HEIGHT: f64 = 0.03;
const RIM_WIDTH: f64 = 0.45;
const CRATERS: usize = 9;

/// Frequency and amplitude of the albedo's noise, and relative brightness excess of a crater floor.
const ALBEDO_FREQUENCY: f64 = 2.3;
const ALBEDO_AMPLITUDE: f64 = 0.2;
const CRATER_FLOOR: f64 = 0.06;

/// Gradient noise (Perlin 2002, *Improving noise*) from about -0.9 to 0.9. It is 0 at the lattice points, has a random slope at each of them, and has
/// continuous second derivatives in between.
struct GradientNoise {
    seed: u64,
}

impl GradientNoise {
    fn gradient(&self, cell: IVec3) -> DVec3 {
        let mut hash = self.seed;
        for coordinate in cell.to_array() {
            hash = mixed(hash ^ u64::from(coordinate as u32));
        }
        let z = (hash >> 32) as f64 / f64::from(u32::MAX) * 2.0 - 1.0;
        let (sin, cos) = ((hash & 0xffff_ffff) as f64 / 4_294_967_296.0 * TAU).sin_cos();
        let rho = (1.0 - z * z).max(0.0).sqrt();
        DVec3::new(rho * cos, rho * sin, z)
    }

    fn value(&self, place: DVec3) -> f64 {
        let floor = place.floor();
        let cell = floor.as_ivec3();
        let f = place - floor;
        let fade = f * f * f * (f * (f * 6.0 - 15.0) + 10.0);
        let mut sum = 0.0;
        for corner in 0..8 {
            let step = IVec3::new(corner & 1, (corner >> 1) & 1, corner >> 2);
            let weights = DVec3::select(step.cmpeq(IVec3::ONE), fade, 1.0 - fade);
            sum += weights.element_product() * self.gradient(cell + step).dot(f - step.as_dvec3());
        }
        sum * 1.5
    }
}

/// One step of SplitMix64 (Steele, Lea and Flood 2014): decorrelates neighbouring numbers.
fn mixed(value: u64) -> u64 {
    let mut z = value.wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

struct Crater {
    middle: DVec3,
    radius_rad: f64,
}

/// The surface of one shape.
pub(super) struct Surface {
    semi_axes: DVec3,
    relief: GradientNoise,
    tint: GradientNoise,
    craters: Vec<Crater>,
}

impl Surface {
    /// Surface `number` (an index into [`SEMI_AXES`]) of a seed.
    pub fn new(seed: u64, number: usize) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(number as u64);
        let craters = (0..CRATERS)
            .map(|_| {
                let z: f64 = rng.random_range(-1.0..1.0);
                let (sin, cos) = rng.random_range(0.0..TAU).sin_cos();
                let rho = (1.0 - z * z).sqrt();
                // Small craters are more frequent: the number of craters larger than a radius is inversely proportional to the square of that radius.
                let [small, large] = CRATER_RAD.map(|radius| radius.powi(-2));
                let radius_rad = (small + (large - small) * rng.random_range(0.0..1.0)).powf(-0.5);
                Crater { middle: DVec3::new(rho * cos, rho * sin, z), radius_rad }
            })
            .collect();
        let [relief, tint] = [rng.random(), rng.random()].map(|seed| GradientNoise { seed });
        Self { semi_axes: DVec3::from_array(SEMI_AXES[number]), relief, tint, craters }
    }

    /// The surface point in a unit direction of the ellipsoid.
    pub fn place(&self, direction: DVec3) -> DVec3 {
        let noise: f64 = OCTAVES
            .iter()
            .map(|&(frequency, amplitude)| {
                amplitude * self.relief.value(direction * frequency + DVec3::splat(frequency))
            })
            .sum();
        let craters: f64 = self.craters.iter().map(|crater| crater.height(direction)).sum();
        direction * self.semi_axes * (noise + craters).exp()
    }

    /// The albedo factor in a unit direction, with a mean of about 1.
    pub fn albedo(&self, direction: DVec3) -> f64 {
        let floors: f64 = self.craters.iter().map(|crater| crater.bowl(direction)).sum();
        1.0 + ALBEDO_AMPLITUDE * self.tint.value(direction * ALBEDO_FREQUENCY) + CRATER_FLOOR * floors
    }
}

impl Crater {
    /// Angular distance from its centre, divided by its angular radius.
    fn distance(&self, direction: DVec3) -> f64 {
        self.middle.cross(direction).length().atan2(self.middle.dot(direction)) / self.radius_rad
    }

    /// 1 at the centre of its bowl, 0 from its rim outwards.
    fn bowl(&self, direction: DVec3) -> f64 {
        let t = self.distance(direction);
        (1.0 - t * t).max(0.0).powi(2)
    }

    fn height(&self, direction: DVec3) -> f64 {
        let rim = RIM_HEIGHT * (-((self.distance(direction) - 1.0) / RIM_WIDTH).powi(2)).exp();
        self.radius_rad * (rim - CRATER_DEPTH * self.bowl(direction))
    }
}
