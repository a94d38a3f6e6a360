//! Structures that the shaders of plain blocks read.

use crate::{
    gpu::gpu_structs,
    render::layout::{AirAbove, Display, SkyMap},
};

gpu_structs! {
    /// Parameters of the passes that add up smooth light and mark blocks.
    struct PlainParameters {
        /// The air around the camera.
        air: AirAbove,
        /// Tone mapping of the display image.
        shown: Display,
        /// The map of faint light.
        faint_map: SkyMap,
        /// Display values per cd/m^2.
        display_per_cd_m2: f32,
        /// Greatest error of interpolated light: in 8-bit codes for display images, relative to the luminance for HDR images.
        most_error: f32,
        /// Error of interpolated light that is always allowed in HDR images, cd/m^2.
        floor_cd_m2: f32,
        /// Relative error of the inverse solid angle that a plain block may have.
        most_solid_angle_error: f32,
        /// Sine of the altitude of the highest ground.
        ground_sine: f32,
        /// 1: pixels read the map of faint light.
        reads_faint_map: u32,
        unused_0: u32,
        unused_1: u32,
    }
}
