//! Structures that the shaders of diffuse light read.

use crate::{
    gpu::gpu_structs,
    render::layout::{AirAbove, DiffuseLight},
};

gpu_structs! {
    /// How points of the grids over pictures read the light; see `shaders/diffuse/points.wgsl`.
    DiffusePointParameters {
        /// The light.
        light: DiffuseLight,
        /// The air before it.
        air: AirAbove,
        /// What it may err by between points, cd/m^2.
        most_rough: f32,
        /// Padding.
        unused_0: u32,
        /// Padding.
        unused_1: u32,
        /// Padding.
        unused_2: u32,
    }
}
