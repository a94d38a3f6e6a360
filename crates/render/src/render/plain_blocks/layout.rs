//! Structures that the shaders of plain blocks read.

use crate::{
    gpu::gpu_structs,
    render::layout::{AirAbove, Display},
};

gpu_structs! {
    /// Parameters of the passes that add up smooth light and mark blocks.
    struct PlainParameters {
        /// The air around the camera.
        air: AirAbove,
        /// Tone mapping of the display image.
        shown: Display,
        /// Display value 1 per cd/m^2.
        display_per_cd_m2: f32,
        /// Greatest error of interpolated light, codes of 8 bits.
        most_error_codes: f32,
        /// Sine of the altitude of the highest ground.
        ground_sine: f32,
        /// 1: pixels read the map of faint light.
        reads_faint_map: u32,
    }
}
