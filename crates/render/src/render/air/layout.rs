//! Structures that the shader of air and ground reads.

use crate::gpu::gpu_structs;

gpu_structs! {
    /// A source whose light air scatters; see `shaders/air/light.wgsl`.
    AirSource {
        /// Unit vector towards it, world axes.
        direction: [f32; 3],
        /// Padding.
        unused_0: u32,
        /// What it gives outside of the air, lx.
        light: [f32; 3],
        /// Padding.
        unused_1: u32,
        /// Unit vector of its azimuth: north, east.
        heading: [f32; 2],
        /// Padding.
        unused_2: u32,
        /// Padding.
        unused_3: u32,
    }
    /// Parameters of the pass.
    AirParameters {
        /// Number of the tile.
        tile: u32,
        /// 1: there is air.
        has_air: u32,
        /// 1: there is ground.
        has_ground: u32,
        /// Sources.
        source_count: u32,
        /// First axis of the horizon, world axes.
        east: [f32; 3],
        /// Factor on the light of sky and ground.
        light_share: f32,
        /// Second axis.
        zenith: [f32; 3],
        /// 1: the horizon is at altitude 0.
        is_flat: u32,
        /// Third axis.
        south: [f32; 3],
        /// Sine of the altitude above which there is no ground.
        above_ground: f32,
        /// Power of two by which light becomes less for each air mass.
        extinction: [f32; 3],
        /// Padding.
        unused_1: u32,
        /// The air's own glow, cd/m^2.
        glow: [f32; 3],
        /// Padding.
        unused_2: u32,
        /// Luminance of the ground, cd/m^2.
        ground: [f32; 3],
        /// Azimuth of the middle of its picture, rad.
        landscape_azimuth: f32,
        /// Luminance of a white surface, cd/m^2.
        white: [f32; 3],
        /// Padding.
        unused_3: u32,
        /// Size of the picture of the ground, texels; 0: there is none.
        landscape_size: [u32; 2],
        /// Padding.
        unused_4: u32,
        /// Padding.
        unused_5: u32,
        /// The sources.
        sources: [AirSource; 2],
    }
}
