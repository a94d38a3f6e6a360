//! Structures that the shaders of diffuse light read.

use crate::{
    gpu::gpu_structs,
    render::layout::{AirAbove, DiffuseLight},
};

gpu_structs! {
    /// Parameters of the pass that evaluates diffuse light at the grid points of the pictures.
    struct DiffusePointParameters {
        /// The diffuse light.
        light: DiffuseLight,
        /// The air in front of it.
        air: AirAbove,
        /// Greatest error of the light between points, in cd/m^2 as the pictures hold it, times the square of the spacing of the roughness values,
        /// rad^2.
        most_rough: f32,
        /// Offset, in entries, from a point of the sum of diffuse light to the same point of its rough part; 0: that part is not needed.
        rough_points: u32,
        /// Added to `most_rough` for each cd/m^2 of the light there, rad^2.
        most_rough_per_cd_m2: f32,
        unused_0: u32,
    }
}
