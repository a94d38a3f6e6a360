//! Stars in f64: the twin of the star and resolve passes.

use glam::{DQuat, DVec3};

use super::gaussian;
use crate::{
    catalogue::{
        chunks::StarSet,
        packed::{PackedStar, temperature_of_step_k},
    },
    photometry::{
        blackbody::rec709_in_gamut,
        kernel::{SplatKernel, bright_kernel},
    },
    plan::GaussianWidth,
    relativity::{Motion, illuminance_factor},
    units::PARSEC_M,
    view::projection::PlaneMapping,
};

/// Position, orientation and velocity of the eye of an image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Eye {
    /// ICRS barycentric position, m.
    pub position_m: DVec3,
    /// Rotation from view axes to world axes.
    pub world_from_view: DQuat,
    /// Velocity in units of the speed of light, world axes; below 1.
    pub velocity_c: DVec3,
}

impl Default for Eye {
    fn default() -> Self {
        Self { position_m: DVec3::ZERO, world_from_view: DQuat::IDENTITY, velocity_c: DVec3::ZERO }
    }
}

/// An image in f64.
#[derive(Clone, Debug, PartialEq)]
pub struct ReferenceImage {
    /// Width and height, pixels.
    pub size: [u32; 2],
    /// Illuminance of every pixel in linear Rec. 709, lx, row by row from the top.
    pub illuminance_lx: Vec<[f64; 3]>,
    /// Number of stars that reached a pixel.
    pub stars: u64,
}

impl ReferenceImage {
    /// Returns the luminance in cd/m^2 of every pixel: illuminance divided by solid angle.
    pub fn luminance_cd_m2(&self, mapping: &dyn PlaneMapping) -> Vec<[f64; 3]> {
        let width = self.size[0];
        self.illuminance_lx
            .iter()
            .enumerate()
            .map(|(index, rgb)| {
                let omega = mapping.solid_angle_sr(index as u32 % width, index as u32 / width);
                if omega > 0.0 { rgb.map(|channel| channel / omega) } else { [0.0; 3] }
            })
            .collect()
    }
}

/// Kernel that spreads a star's light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum StarKernel {
    /// A kernel of a fixed number of pixels.
    Splat(SplatKernel),
    /// A Gaussian that is round in view space.
    Gaussian(GaussianWidth),
    /// The kernel of stars too bright for the B-spline, with the weight of the Gaussian in the blend.
    Bright(f64),
}

impl From<SplatKernel> for StarKernel {
    fn from(kernel: SplatKernel) -> Self {
        Self::Splat(kernel)
    }
}

/// A star as an eye sees it.
pub struct SeenStar {
    /// Direction in view space, of any length.
    pub direction: DVec3,
    /// Illuminance at the eye, lx.
    pub illuminance_lx: f64,
    /// Colour temperature, K.
    pub temperature_k: f64,
}

/// Computes how an eye sees stars.
pub struct Sight {
    eye_pc: DVec3,
    view_from_world: DQuat,
    motion: Option<Motion>,
}

impl Sight {
    /// Builds the view of an eye.
    pub fn new(eye: Eye) -> Self {
        Self {
            eye_pc: eye.position_m / PARSEC_M,
            view_from_world: eye.world_from_view.conjugate(),
            motion: Motion::new(eye.velocity_c),
        }
    }

    /// Whether the eye moves; motion also changes colours.
    pub fn moves(&self) -> bool {
        self.motion.is_some()
    }

    /// Returns the star at a position, or in a direction if it is at infinity; `None` at the exact position of the eye, where it has no direction.
    pub fn seen_star(&self, position: DVec3, at_infinity: bool, star: &PackedStar) -> Option<SeenStar> {
        let place = if at_infinity { position.normalize_or_zero() } else { position - self.eye_pc };
        let distance_squared = place.length_squared();
        if distance_squared == 0.0 {
            return None;
        }
        let illuminance_lx = star.illuminance_at_1_pc_lx() / distance_squared;
        let temperature_k = temperature_of_step_k(star.temperature_step());
        Some(match &self.motion {
            None => SeenStar { direction: self.view_from_world * place, illuminance_lx, temperature_k },
            Some(motion) => {
                let doppler = motion.doppler_of(place);
                SeenStar {
                    direction: self.view_from_world * motion.seen(place),
                    illuminance_lx: illuminance_lx * illuminance_factor(temperature_k, doppler),
                    temperature_k: temperature_k * doppler,
                }
            }
        })
    }
}

/// Returns the stars of a set as seen by a moving eye. A star at the exact position of the eye has no direction and is left out.
pub(crate) fn seen_by(set: &StarSet, eye: Eye) -> impl Iterator<Item = SeenStar> {
    let sight = Sight::new(eye);
    set.iter().filter_map(move |(position, at_infinity, star)| sight.seen_star(position, at_infinity, star))
}

/// Draws all stars of a set. `kernel_for` selects the kernel from the illuminance at the eye in lx; `None` leaves the
/// star out.
pub fn draw<K: Into<StarKernel>>(
    set: &StarSet,
    eye: Eye,
    mapping: &dyn PlaneMapping,
    kernel_for: impl Fn(f64) -> Option<K>,
) -> ReferenceImage {
    let size = mapping.size();
    let mut image =
        ReferenceImage { size, illuminance_lx: vec![[0.0; 3]; size[0] as usize * size[1] as usize], stars: 0 };
    for SeenStar { direction, illuminance_lx, temperature_k } in seen_by(set, eye) {
        let Some(kernel) = kernel_for(illuminance_lx) else { continue };
        let taps = match kernel.into() {
            StarKernel::Splat(kernel) => mapping.taps(&|centre| kernel.footprint(centre), direction),
            StarKernel::Bright(part) => mapping.taps(&|centre| bright_kernel(part, centre), direction),
            StarKernel::Gaussian(width) => gaussian::taps(mapping, width, direction),
        };
        if taps.is_empty() {
            continue;
        }
        image.stars += 1;
        let colour = rec709_in_gamut(temperature_k);
        for tap in taps {
            let pixel = &mut image.illuminance_lx[tap.y as usize * size[0] as usize + tap.x as usize];
            for (sum, channel) in pixel.iter_mut().zip(colour) {
                *sum += channel * illuminance_lx * tap.weight;
            }
        }
    }
    image
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        catalogue::StarRecord,
        photometry::rec709::luminance,
        units::illuminance_lx_from_magnitude,
        view::projection::{CubeFace, Equirectangular, Face},
    };

    fn one_star(direction: DVec3, magnitude: f32) -> StarSet {
        let position = direction.normalize();
        StarSet::from_records(vec![StarRecord { position, magnitude, temperature_k: 9600.0, distance_known: false }])
    }

    #[test]
    fn a_star_on_a_cube_corner_is_whole() {
        let set = one_star(DVec3::new(1.0, 1.0, -1.0), 2.0);
        let mut sum = 0.0;
        for face in Face::ALL {
            let mapping = CubeFace::new(face, 32).unwrap();
            let eye = Eye { world_from_view: face.cube_from_face(), ..Default::default() };
            let image = draw(&set, eye, &mapping, |_| Some(SplatKernel::BSpline));
            sum += image.illuminance_lx.iter().map(|rgb| luminance(*rgb)).sum::<f64>();
        }
        assert!((sum / illuminance_lx_from_magnitude(2.0) - 1.0).abs() < 1e-4, "{sum}");
    }

    #[test]
    fn luminance_times_solid_angle_is_the_light_of_the_star() {
        let mapping = Equirectangular::new([64, 32]).unwrap();
        let image = draw(&one_star(DVec3::Y, 0.0), Eye::default(), &mapping, |_| Some(SplatKernel::Tent));
        let luminances = image.luminance_cd_m2(&mapping);
        let sum: f64 =
            (0..64 * 32).map(|i| luminance(luminances[i as usize]) * mapping.solid_angle_sr(i % 64, i / 64)).sum();
        assert!((sum / illuminance_lx_from_magnitude(0.0) - 1.0).abs() < 1e-4);
        assert_eq!(image.stars, 1);
    }
}
