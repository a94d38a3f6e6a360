//! Structures that the shaders of the map of faint light read.

use crate::gpu::gpu_structs;

gpu_structs! {
    /// Parameters of the pass that stores a picture as texels.
    struct PackParameters {
        /// Pixels of the batch: offset of the plane of B and solid angles.
        plane_pixels: u32,
        /// Side of a picture, texels.
        side: u32,
        /// Index of the picture's first texel.
        first_texel: u32,
        /// Texel units per cd/m^2.
        units_per_cd_m2: f32,
    }
}
