//! Light from all over the sky that is of no single star: six pictures of luminance as the barycentre sees it ([`crate::sky_pictures`]), at infinity.
//!
//! Texels have three numbers of nine bits and share an exponent, as those of the map of faint stars (`shaders/shared/sky_texel.wgsl`): within 1/512 of the brightest of the three. Between texels
//! light is bilinear. Units: cd/m^2, linear Rec. 709.

use glam::DVec3;
use rayon::prelude::*;

use crate::{
    photometry::rec709,
    sky_pictures::{SkyPictures, TexelPlace},
};

/// Luminance of a texel's unit, cd/m^2.
pub const TEXEL_UNIT_CD_M2: f64 = 1e-4;
/// What a moving observer sees of it: black bodies of this temperature, kelvin, that of a star of B-V = 0.8, ...
const TEMPERATURE_K: f64 = 5200.0;
/// ... of which R, G and B show the light at these wavelengths, m.
const WAVELENGTHS_M: [f64; 3] = [612e-9, 549e-9, 465e-9];
/// Second radiation constant, m K (CODATA 2018).
const SECOND_RADIATION_M_K: f64 = 1.438_776_877e-2;
/// hc / (lambda k T) of R, G and B.
pub const EXPONENTS_AT_REST: [f64; 3] = [
    SECOND_RADIATION_M_K / (WAVELENGTHS_M[0] * TEMPERATURE_K),
    SECOND_RADIATION_M_K / (WAVELENGTHS_M[1] * TEMPERATURE_K),
    SECOND_RADIATION_M_K / (WAVELENGTHS_M[2] * TEMPERATURE_K),
];
/// Exponents of a texel's five bits: the least and the greatest.
const EXPONENTS: (i32, i32) = (-15, 16);

/// The pictures.
#[derive(Clone, Debug, PartialEq)]
pub struct DiffuseSky {
    pictures: SkyPictures,
    texels: Vec<u32>,
    mean_cd_m2: f64,
}

impl DiffuseSky {
    /// Pictures with texels of at most that size, from the luminance towards unit vectors in world axes, which is not negative.
    pub fn new(texel_rad: f64, luminance_cd_m2: impl Fn(DVec3) -> [f64; 3] + Sync) -> Self {
        let pictures = SkyPictures::of_texels(texel_rad);
        let texel = |index: usize| texel_of(luminance_cd_m2(pictures.direction(index)).map(|c| c / TEXEL_UNIT_CD_M2));
        let texels = (0..pictures.texels() as usize).into_par_iter().map(texel).collect();
        let mut sky = Self { pictures, texels, mean_cd_m2: 0.0 };
        sky.mean_cd_m2 = sky.mean();
        sky
    }

    /// Their size.
    pub fn pictures(&self) -> SkyPictures {
        self.pictures
    }

    /// All texels: R, G and B from the lowest bit on, nine each, then the exponent.
    pub fn texels(&self) -> &[u32] {
        &self.texels
    }

    /// Luminance towards a direction (not 0, world axes), cd/m^2.
    pub fn luminance_cd_m2(&self, towards: DVec3) -> [f64; 3] {
        let TexelPlace { first, share } = self.pictures.place(towards);
        let side = self.pictures.side as usize;
        let corners = [first, first + 1, first + side, first + side + 1].map(|at| light_of(self.texels[at]));
        [0, 1, 2].map(|c| {
            let [a, b, d, e] = corners.map(|corner| corner[c]);
            let (upper, lower) = (a + (b - a) * share.x, d + (e - d) * share.x);
            TEXEL_UNIT_CD_M2 * (upper + (lower - upper) * share.y)
        })
    }

    /// Mean luminance of the whole sky, cd/m^2.
    pub fn mean_cd_m2(&self) -> f64 {
        self.mean_cd_m2
    }

    /// The mean over directions that are spread evenly on a spiral.
    fn mean(&self) -> f64 {
        const PLACES: u32 = 20_000;
        let golden = std::f64::consts::PI * (3.0 - 5_f64.sqrt());
        let at = |i: u32| {
            let z = 1.0 - 2.0 * (f64::from(i) + 0.5) / f64::from(PLACES);
            let (sin, cos) = (f64::from(i) * golden).sin_cos();
            let across = (1.0 - z * z).sqrt();
            rec709::luminance(self.luminance_cd_m2(DVec3::new(across * cos, across * sin, z)))
        };
        (0..PLACES).map(at).sum::<f64>() / f64::from(PLACES)
    }
}

/// See `texel_of` in `shaders/shared/sky_texel.wgsl`.
fn texel_of(light: [f64; 3]) -> u32 {
    let most = light.into_iter().fold(0.0, f64::max).min(65408.0);
    let least = f64::from(EXPONENTS.0).exp2();
    let mut exponent = if most > least { (most.log2().floor() as i32 + 1).max(EXPONENTS.0) } else { EXPONENTS.0 };
    if (most * f64::from(9 - exponent).exp2()).round() > 511.0 {
        exponent = (exponent + 1).min(EXPONENTS.1);
    }
    let scale = f64::from(9 - exponent).exp2();
    let [r, g, b] = light.map(|c| (c.max(0.0) * scale).round().min(511.0) as u32);
    r | g << 9 | b << 18 | ((exponent - EXPONENTS.0) as u32) << 27
}

fn light_of(texel: u32) -> [f64; 3] {
    let scale = f64::from((texel >> 27) as i32 + EXPONENTS.0 - 9).exp2();
    [0, 9, 18].map(|shift| f64::from(texel >> shift & 511) * scale)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texels_keep_nine_bits_of_what_they_are_given() {
        for i in 0..2000 {
            let most = f64::from(i - 1200) * 0.02;
            let light = [most.exp2(), 0.3 * most.exp2(), 0.77 * most.exp2()];
            let kept = light_of(texel_of(light));
            if most > -15.0 && most < 15.9 {
                for c in 0..3 {
                    assert!((kept[c] - light[c]).abs() <= light[0] / 511.0, "{light:?} {kept:?}");
                }
            }
        }
        assert_eq!(light_of(texel_of([0.0; 3])), [0.0; 3]);
    }

    #[test]
    fn the_light_of_a_smooth_sky_is_read_back() {
        let at =
            |towards: DVec3| [1.0 + 0.5 * towards.x, 0.8 + 0.3 * towards.y, 0.5 - 0.4 * towards.z].map(|c| 1e-4 * c);
        let sky = DiffuseSky::new(0.01, at);
        for i in 0..5000 {
            let z = 1.0 - 2.0 * (f64::from(i) + 0.5) / 5000.0;
            let (sin, cos) = (f64::from(i) * 2.399_963).sin_cos();
            let towards = DVec3::new(cos, sin, 0.0) * (1.0 - z * z).sqrt() + DVec3::Z * z;
            let (read, expected) = (sky.luminance_cd_m2(3.0 * towards), at(towards));
            for c in 0..3 {
                // Of the brightest channel, which the others share their exponent with.
                let most = expected.into_iter().fold(0.0, f64::max);
                assert!((read[c] - expected[c]).abs() < 2.5e-3 * most, "{towards}: {read:?} {expected:?}");
            }
        }
        let mean = rec709::luminance([1e-4, 0.8e-4, 0.5e-4]);
        assert!((sky.mean_cd_m2() / mean - 1.0).abs() < 1e-3, "{}", sky.mean_cd_m2());
    }
}
