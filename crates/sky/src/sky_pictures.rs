//! Six fisheye faces that cover the whole sky: mapping between directions and texels. Shaders:
//! `shaders/shared/sky_map.wgsl`.
//!
//! Each face is an equidistant fisheye around an axis of the world (+x, +y, +z, -x, -y, -z), slightly wider than the
//! corresponding face of a cube. Texels therefore have nearly the same size everywhere, and the four texels around a
//! position are in one face.

use glam::{DMat3, DVec2, DVec3};

/// Number of faces.
pub const SKY_FACES: u32 = 6;
/// Margin of a face beyond the cube's corners, texels: the reach of bilinear and B-spline interpolation, plus
/// rounding.
const MARGIN_TEXELS: f64 = 4.0;
/// Limit of half the side of a face, texels: the bytes of all faces are below 2^64.
const MOST_HALF_SIDE: f64 = 268_435_456.0;
/// Angle from the centre of a cube's face to its corner, rad.
const CORNER_RAD: f64 = 0.955_316_618_124_509_3;

/// Six faces of one size.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SkyPictures {
    /// Side of each face, texels.
    pub side: u32,
}

/// A position between four texels of a face.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TexelPlace {
    /// Index of the upper left texel among those of all faces, row by row, face by face.
    pub first: usize,
    /// Weight of the right texels and of the lower ones.
    pub share: DVec2,
}

impl SkyPictures {
    /// The smallest faces with texels of at most this size, rad. Their side is limited to a length that no adapter
    /// supports.
    pub fn of_texels(texel_rad: f64) -> Self {
        Self { side: 2 * ((CORNER_RAD / texel_rad).ceil() + MARGIN_TEXELS).min(MOST_HALF_SIDE) as u32 }
    }

    /// Angle of a texel along the radius, rad.
    pub fn texel_rad(self) -> f64 {
        2.0 * CORNER_RAD / (f64::from(self.side) - 2.0 * MARGIN_TEXELS)
    }

    /// Number of texels of all faces.
    pub fn texels(self) -> u64 {
        u64::from(SKY_FACES) * u64::from(self.side) * u64::from(self.side)
    }

    /// Unit vector towards the centre of a texel by its index, world axes.
    pub fn direction(self, index: usize) -> DVec3 {
        let side = self.side as usize;
        let (face, row, column) = (index / (side * side), index / side % side, index % side);
        let off = DVec2::new(column as f64 + 0.5, row as f64 + 0.5) - 0.5 * f64::from(self.side);
        let angle = off.length() * self.texel_rad();
        let across = off.normalize_or_zero() * angle.sin();
        world_from_face(face as u32) * DVec3::new(across.x, -across.y, -angle.cos())
    }

    /// Position of a direction (not 0) in the faces.
    pub fn place(self, towards: DVec3) -> TexelPlace {
        let axis = towards.abs().max_position();
        let sign = 1_f64.copysign(towards[axis]);
        let off = DVec2::new(sign * towards[(axis + 2) % 3], -towards[(axis + 1) % 3]);
        let across = off.length();
        let angle = across.atan2(towards[axis].abs());
        let place =
            DVec2::splat(0.5 * f64::from(self.side) - 0.5) + off.normalize_or_zero() * (angle / self.texel_rad());
        let corner = place.floor();
        let side = self.side as usize;
        let face = axis + if sign < 0.0 { 3 } else { 0 };
        TexelPlace { first: (face * side + corner.y as usize) * side + corner.x as usize, share: place - corner }
    }
}

/// Right, up and backward vectors of a face, in world axes; shaders use the same rule.
pub fn world_from_face(number: u32) -> DMat3 {
    let axis = number as usize % 3;
    let sign = if number < 3 { 1.0 } else { -1.0 };
    let right = sign * DVec3::AXES[(axis + 2) % 3];
    let up = DVec3::AXES[(axis + 1) % 3];
    DMat3::from_cols(right, up, -sign * DVec3::AXES[axis])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texels_of_any_size_have_a_number_of_bytes() {
        for texel_rad in [0.0, f64::MIN_POSITIVE, 1e-30, 1e-9, 1.0, f64::MAX] {
            let pictures = SkyPictures::of_texels(texel_rad);
            assert!(pictures.texels().checked_mul(4).is_some(), "{texel_rad}: {}", pictures.side);
            assert!(texel_rad < 1e-6 || pictures.texel_rad() <= texel_rad, "{texel_rad}");
        }
    }

    #[test]
    fn place_finds_each_texel_at_its_direction() {
        for side in [64, 300] {
            let pictures = SkyPictures { side };
            assert_eq!(SkyPictures::of_texels(pictures.texel_rad() * (1.0 + 1e-9)), pictures);
            let mut found = 0;
            for index in (0..pictures.texels() as usize).step_by(7) {
                let TexelPlace { first, share } = pictures.place(pictures.direction(index));
                // A texel beyond the cube's face is in another face too, and is looked up there.
                if first / (side * side) as usize != index / (side * side) as usize {
                    continue;
                }
                found += 1;
                let nearest = first + share.x.round() as usize + side as usize * share.y.round() as usize;
                assert_eq!(nearest, index);
                assert!((share - share.round()).length() < 1e-6, "{index}: {share}");
            }
            // Two of five texels are tested: the faces are squares around the cube's corners.
            assert!(found > pictures.texels() as usize / 7 / 3, "{found}");
        }
    }
}
