//! Structures that the shaders of the map of faint light read.

use crate::gpu::gpu_structs;

gpu_structs! {
    /// Parameters of the pass that stores pictures as texels.
    struct PackParameters {
        /// Number of pixels of the batch. It is the offset of the second plane, which holds blue and the solid angles.
        plane_pixels: u32,
        /// Texel units per cd/m^2.
        units_per_cd_m2: f32,
        /// Weights of the neighbours at distances of one and two texels, along each axis.
        blur: [f32; 2],
    }
    /// Storage location of a picture.
    struct PackedPicture {
        /// Index of its first texel.
        first_texel: u32,
        /// Its width, texels.
        width: u32,
        unused_0: u32,
        unused_1: u32,
    }
}
