//! Structures that the shaders of plain blocks read.

use crate::gpu::gpu_structs;

gpu_structs! {
    /// Parameters of the passes that add up smooth light and mark blocks.
    struct PlainParameters {
        /// Greatest error of interpolated light, cd/m^2.
        most_error: f32,
        /// Sine of the altitude from which on a point shows neither ground nor the air near the horizon.
        least_sine: f32,
        unused_0: u32,
        unused_1: u32,
    }
}
