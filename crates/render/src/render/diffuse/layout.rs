//! Structures that the shaders of diffuse light read.

use crate::{
    gpu::gpu_structs,
    render::layout::{AirAbove, DiffuseLight},
};

gpu_structs! {
    /// Parameters of the pass over grid points; see `shaders/diffuse/points.wgsl`.
    DiffusePointParameters {
        /// The diffuse light.
        light: DiffuseLight,
        /// The air in front of it.
        air: AirAbove,
        /// Maximum roughness at which light is interpolated between points, cd/m^2.
        most_rough: f32,
        /// Padding.
        unused_0: u32,
        /// Padding.
        unused_1: u32,
        /// Padding.
        unused_2: u32,
    }
}
