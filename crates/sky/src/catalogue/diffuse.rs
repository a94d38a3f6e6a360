//! Light of the whole sky that is not drawn as individual stars. It is stored as the luminance on six faces ([`crate::sky_pictures`]), as seen from
//! the barycentre, and is at infinity.
//!
//! A texel has three 9-bit mantissas with a shared exponent, like those of the map of faint stars
//! (`shaders/shared/sky_texel.wgsl`); the error is at most 1/512 of its brightest channel. Between texels light is
//! interpolated bilinearly. Units: cd/m^2, linear Rec. 709.

use glam::DVec3;
use rayon::prelude::*;

use crate::{
    cache,
    photometry::rec709,
    sky_pictures::{SKY_FACES, SkyPictures, TexelPlace},
};

/// Luminance of a texel's unit, cd/m^2.
pub const TEXEL_UNIT_CD_M2: f64 = 1e-4;
/// For a moving observer, the light is treated as that of a black body of this temperature, kelvin. A star with B-V = 0.8 has this temperature.
const TEMPERATURE_K: f64 = 5200.0;
/// Wavelengths of that light for R, G and B, m.
const WAVELENGTHS_M: [f64; 3] = [612e-9, 549e-9, 465e-9];
/// Second radiation constant, m K (CODATA 2018).
const SECOND_RADIATION_M_K: f64 = 1.438_776_877e-2;
/// hc / (lambda k T) of R, G and B.
pub const EXPONENTS_AT_REST: [f64; 3] = [
    SECOND_RADIATION_M_K / (WAVELENGTHS_M[0] * TEMPERATURE_K),
    SECOND_RADIATION_M_K / (WAVELENGTHS_M[1] * TEMPERATURE_K),
    SECOND_RADIATION_M_K / (WAVELENGTHS_M[2] * TEMPERATURE_K),
];
/// Side of the blocks for which roughness is given, texels.
pub const ROUGHNESS_BLOCK: u32 = 2;
/// Roughness is the error of interpolating between two points on opposite sides, each this many texels away.
pub const ROUGHNESS_TEXELS: u32 = 2;
/// Margin around a block in which its roughness is also searched, texels. A cell of points with a corner in the block extends this far.
const ROUGHNESS_MARGIN: usize = 4;
/// Lowest and highest exponent that a texel's five bits can hold.
const EXPONENTS: (i32, i32) = (-15, 16);

/// The six faces.
#[derive(Clone, Debug, PartialEq)]
pub struct DiffuseSky {
    pictures: SkyPictures,
    texels: Vec<u32>,
    mean_cd_m2: f64,
    roughness_cd_m2: Vec<f32>,
}

impl DiffuseSky {
    /// Builds the faces, with texels of at most `texel_rad`, from the luminance (at least 0) towards a unit vector in
    /// world axes.
    pub fn new(texel_rad: f64, luminance_cd_m2: impl Fn(DVec3) -> [f64; 3] + Sync) -> Self {
        let pictures = SkyPictures::of_texels(texel_rad);
        let texel = |index: usize| texel_of(luminance_cd_m2(pictures.direction(index)).map(|c| c / TEXEL_UNIT_CD_M2));
        let texels = (0..pictures.texels() as usize).into_par_iter().map(texel).collect();
        let mut sky = Self { pictures, texels, mean_cd_m2: 0.0, roughness_cd_m2: Vec::new() };
        sky.mean_cd_m2 = sky.mean();
        sky.roughness_cd_m2 = sky.roughness();
        sky
    }

    /// The bytes of the faces: side and mean, then texels, then roughness.
    pub(super) fn to_bytes(&self) -> Vec<u8> {
        let mut bytes = self.pictures.side.to_le_bytes().to_vec();
        bytes.extend(self.mean_cd_m2.to_le_bytes());
        bytes.extend_from_slice(bytemuck::cast_slice(&self.texels));
        bytes.extend_from_slice(bytemuck::cast_slice(&self.roughness_cd_m2));
        bytes
    }

    /// Reads the faces from such bytes; `None` if their length does not match.
    pub(super) fn from_bytes(bytes: &[u8]) -> Option<Self> {
        let (side, bytes) = bytes.split_first_chunk()?;
        let (mean, bytes) = bytes.split_first_chunk()?;
        let pictures = SkyPictures { side: u32::from_le_bytes(*side) };
        let blocks =
            u64::from(pictures.side.div_ceil(ROUGHNESS_BLOCK)).checked_pow(2)?.checked_mul(u64::from(SKY_FACES))?;
        let of_texels = usize::try_from(pictures.texels()).ok()?.checked_mul(size_of::<u32>())?;
        let (texels, roughness) = bytes.split_at_checked(of_texels)?;
        let (texels, roughness_cd_m2) = (cache::values(texels)?, cache::values(roughness)?);
        let complete = roughness_cd_m2.len() as u64 == blocks;
        complete.then(|| Self { pictures, texels, mean_cd_m2: f64::from_le_bytes(*mean), roughness_cd_m2 })
    }

    /// Size of the faces.
    pub fn pictures(&self) -> SkyPictures {
        self.pictures
    }

    /// All texels. From the lowest bit on, a texel has nine bits each for R, G and B, then the exponent.
    pub fn texels(&self) -> &[u32] {
        &self.texels
    }

    /// Luminance towards a direction (not 0, world axes), cd/m^2.
    pub fn luminance_cd_m2(&self, towards: DVec3) -> [f64; 3] {
        let TexelPlace { first, share } = self.pictures.place(towards);
        let side = self.pictures.side as usize;
        let corners = [first, first + 1, first + side, first + side + 1].map(|index| light_of(self.texels[index]));
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

    /// Roughness, cd/m^2: the error of light that is interpolated between points 2 [`ROUGHNESS_TEXELS`] apart. Returns the largest error of any
    /// channel for each block with a side of [`ROUGHNESS_BLOCK`] texels, face by face.
    pub fn roughness_cd_m2(&self) -> &[f32] {
        &self.roughness_cd_m2
    }

    fn roughness(&self) -> Vec<f32> {
        let side = self.pictures.side as usize;
        let blocks = side.div_ceil(ROUGHNESS_BLOCK as usize);
        let reach = ROUGHNESS_TEXELS as isize;
        let light: Vec<[f32; 3]> = self.texels.par_iter().map(|texel| light_of(*texel).map(|c| c as f32)).collect();
        // Error at each texel along rows, columns and both diagonals.
        let of_texel = |index: usize| {
            let (face, row, column) = (index / (side * side), index / side % side, index % side);
            let neighbour = |down: isize, right: isize| {
                let (row, column) = (row.checked_add_signed(down)?, column.checked_add_signed(right)?);
                (row < side && column < side).then(|| light[(face * side + row) * side + column])
            };
            let steps = [(0, reach), (reach, 0), (reach, reach), (reach, -reach)];
            let bends = steps.into_iter().filter_map(|(down, right)| {
                let (before, after) = (neighbour(-down, -right)?, neighbour(down, right)?);
                let off = |c: usize| (light[index][c] - 0.5 * (before[c] + after[c])).abs();
                Some(off(0).max(off(1)).max(off(2)))
            });
            bends.fold(0.0, f32::max)
        };
        let bends: Vec<f32> = (0..light.len()).into_par_iter().map(of_texel).collect();
        let of_block = |index: usize| {
            let (face, row, column) = (index / (blocks * blocks), index / blocks % blocks, index % blocks);
            let span = |block: usize| {
                let first = block * ROUGHNESS_BLOCK as usize;
                first.saturating_sub(ROUGHNESS_MARGIN)..(first + ROUGHNESS_BLOCK as usize + ROUGHNESS_MARGIN).min(side)
            };
            let rows = span(row).map(|row| {
                let of_row = &bends[(face * side + row) * side..][..side];
                of_row[span(column)].iter().copied().fold(0.0, f32::max)
            });
            rows.fold(0.0, f32::max) * TEXEL_UNIT_CD_M2 as f32
        };
        (0..crate::sky_pictures::SKY_FACES as usize * blocks * blocks).into_par_iter().map(of_block).collect()
    }

    /// Mean over directions that are spread evenly along a spiral.
    fn mean(&self) -> f64 {
        const PLACES: u32 = 20_000;
        let golden = std::f64::consts::PI * (3.0 - 5_f64.sqrt());
        let sample = |i: u32| {
            let z = 1.0 - 2.0 * (f64::from(i) + 0.5) / f64::from(PLACES);
            let (sin, cos) = (f64::from(i) * golden).sin_cos();
            let across = (1.0 - z * z).sqrt();
            rec709::luminance(self.luminance_cd_m2(DVec3::new(across * cos, across * sin, z)))
        };
        (0..PLACES).map(sample).sum::<f64>() / f64::from(PLACES)
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
    fn roughness_is_the_interpolation_error_between_points() {
        // One half of the sky is uniform; the other has waves with a wavelength of three texels along y.
        let texel_rad = 0.01;
        let waves = |towards: DVec3| {
            if towards.x > 0.1 { (towards.y / (3.0 * texel_rad) * std::f64::consts::PI).sin() } else { 0.0 }
        };
        let sky = DiffuseSky::new(texel_rad, |towards| [0.0, 3e-4 * (1.0 + 0.5 * waves(towards)), 1e-5]);
        let pictures = sky.pictures();
        let side = pictures.side as usize;
        let blocks = side.div_ceil(ROUGHNESS_BLOCK as usize);
        let roughness = |towards: DVec3| {
            let first = pictures.place(towards).first;
            let (face, row, column) = (first / (side * side), first / side % side, first % side);
            let block = ROUGHNESS_BLOCK as usize;
            f64::from(sky.roughness_cd_m2()[(face * blocks + row / block) * blocks + column / block])
        };
        assert_eq!(sky.roughness_cd_m2().len(), 6 * blocks * blocks);
        // The resolution of nine bits is 6e-7 here.
        assert!(
            roughness(DVec3::NEG_X) < 2e-6 && roughness(DVec3::new(-1.0, 0.5, 0.5)) < 2e-6,
            "{}",
            roughness(DVec3::NEG_X)
        );
        // Two texels are two thirds of a wavelength away: the error is 1 - cos(120 degrees) times the amplitude.
        let found = roughness(DVec3::new(1.0, 0.2, 0.1)) / (1.5 * 1.5e-4);
        assert!((0.9..1.1).contains(&found), "{found}");
    }

    #[test]
    fn texels_keep_nine_bits_of_each_channel() {
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
        let expected_light =
            |towards: DVec3| [1.0 + 0.5 * towards.x, 0.8 + 0.3 * towards.y, 0.5 - 0.4 * towards.z].map(|c| 1e-4 * c);
        let sky = DiffuseSky::new(0.01, expected_light);
        for i in 0..5000 {
            let z = 1.0 - 2.0 * (f64::from(i) + 0.5) / 5000.0;
            let (sin, cos) = (f64::from(i) * 2.399_963).sin_cos();
            let towards = DVec3::new(cos, sin, 0.0) * (1.0 - z * z).sqrt() + DVec3::Z * z;
            let (read, expected) = (sky.luminance_cd_m2(3.0 * towards), expected_light(towards));
            for c in 0..3 {
                // Relative to the brightest channel, because all channels share its exponent.
                let most = expected.into_iter().fold(0.0, f64::max);
                assert!((read[c] - expected[c]).abs() < 2.5e-3 * most, "{towards}: {read:?} {expected:?}");
            }
        }
        let mean = rec709::luminance([1e-4, 0.8e-4, 0.5e-4]);
        assert!((sky.mean_cd_m2() / mean - 1.0).abs() < 1e-3, "{}", sky.mean_cd_m2());
    }
}
