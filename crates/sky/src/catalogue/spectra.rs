//! Distribution of each chunk's light over temperature. It gives an upper bound of the light that a moving camera receives.

use rayon::prelude::*;

use super::{
    chunks::{Chunk, StarSet},
    packed::{PackedStar, TEMPERATURE_STEPS},
};

/// Number of classes of temperature.
pub const CLASSES: usize = 32;
/// Number of temperature steps per class; the ends of a class differ by 18 %.
const STEPS_PER_CLASS: u32 = TEMPERATURE_STEPS / CLASSES as u32;

/// Light of a chunk's stars by temperature.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Spectrum {
    /// Total illuminance at 1 pc of the stars in each class, lx.
    pub light_lx: [f64; CLASSES],
}

impl Spectrum {
    /// Computes the spectrum of some stars.
    pub fn of(stars: &[PackedStar]) -> Self {
        let mut light_lx = [0.0; CLASSES];
        for star in stars {
            light_lx[(star.temperature_step() / STEPS_PER_CLASS) as usize] += star.illuminance_at_1_pc_lx();
        }
        Self { light_lx }
    }

    /// Iterates over the classes that have stars: lowest and highest temperature step, and illuminance at 1 pc, lx.
    pub fn classes(&self) -> impl Iterator<Item = ([u32; 2], f64)> {
        self.light_lx.iter().enumerate().filter(|(_, lx)| **lx > 0.0).map(|(class, lx)| {
            let first = class as u32 * STEPS_PER_CLASS;
            ([first, first + STEPS_PER_CLASS - 1], *lx)
        })
    }
}

/// Computes the spectra of all chunks, in their order.
pub(super) fn of_chunks(set: &StarSet) -> Vec<Spectrum> {
    set.chunks.par_iter().map(|chunk: &Chunk| Spectrum::of(set.stars_of(chunk))).collect()
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::catalogue::packed::{MAX_TEMPERATURE_K, MIN_TEMPERATURE_K};

    #[test]
    fn every_star_is_in_the_class_of_its_temperature() {
        for kelvin in [MIN_TEMPERATURE_K, 501.0, 3000.0, 5772.0, 40_000.0, MAX_TEMPERATURE_K] {
            let star = PackedStar::new(Vec3::X, 2.0, kelvin);
            let spectrum = Spectrum::of(&[star, star]);
            let classes: Vec<_> = spectrum.classes().collect();
            let [([first, last], lx)] = classes[..] else { panic!("{classes:?}") };
            assert!((first..=last).contains(&star.temperature_step()));
            assert_eq!(lx, 4.0);
        }
        assert_eq!(Spectrum::default().classes().count(), 0);
    }
}
