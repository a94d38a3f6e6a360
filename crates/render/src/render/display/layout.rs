//! Structures that the shaders from light to display read.

use crate::gpu::gpu_structs;
pub(crate) use crate::render::layout::{AirAbove, DiffuseLight, Display, SkyMap};

gpu_structs! {
    /// Parameters of the resolve pass.
    struct ResolveParameters {
        /// Lux per fixed-point unit.
        lx_per_unit: f32,
        /// The same for the separate sums of the few brightest stars; 0: there are no such sums.
        lx_per_bright_unit: f32,
        /// Display values per cd/m^2, if this pass writes the display image.
        display_per_cd_m2: f32,
        /// Number of pixels of the batch. It is the offset of the second plane, which holds blue and the solid angles.
        plane_pixels: u32,
        /// Tone mapping, if this pass writes the display image.
        shown: Display,
        /// Map of faint light.
        sky: SkyMap,
        /// The diffuse light.
        diffuse: DiffuseLight,
        /// Air around the camera.
        air: AirAbove,
        /// 1: diffuse light is interpolated between grid points where it is smooth.
        diffuse_is_smooth: u32,
        /// Index of the first high word of the brightest stars in their buffer, in pairs of words.
        first_bright_high: u32,
        /// Edges of the caps that do not read the map of faint light (shaders/shared/map_caps.wgsl); 0: there are none.
        caps: [f32; 2],
    }
    /// Parameters of the exposure pass.
    struct ExposureParameters {
        /// Solid angle of all pixels of the rig, sr.
        total_solid_angle_sr: f32,
        /// Lowest exposure.
        min_ev100: f32,
        /// Highest exposure.
        max_ev100: f32,
        /// Sum of compensation and key, added to the metered exposure.
        offset_ev: f32,
        /// Exposure that replaces the metered one if `fixed` is 1.
        fixed_ev100: f32,
        /// 1: use `fixed_ev100`.
        fixed: u32,
        /// Number of partial sums.
        partial_count: u32,
        unused_0: u32,
    }
    /// Parameters of the tone-mapping pass.
    struct ToneMapParameters {
        /// Number of pixels of the batch. It is the offset of the second plane, which holds blue and the solid angles.
        plane_pixels: u32,
        unused_0: u32,
        unused_1: u32,
        unused_2: u32,
        /// Tone mapping.
        shown: Display,
    }
    /// Parameters of the present pass for one tile.
    struct PresentParameters {
        /// Number of pixels of the batch. It is the offset of the second plane, which holds blue and the solid angles.
        plane_pixels: u32,
        /// Index of the tile's first pixel in the batch.
        first_pixel: u32,
        /// First row of the tile in the picture.
        first_row: u32,
        /// Width of the picture, pixels.
        width: u32,
        /// Tone mapping.
        shown: Display,
    }
}
