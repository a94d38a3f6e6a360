//! Structures that the shaders of the air and ground pass read.

use crate::gpu::gpu_structs;

gpu_structs! {
    /// A light source whose light the air scatters; see `shaders/air/light.wgsl`.
    AirSource {
        /// Unit vector towards the source, world axes.
        direction: [f32; 3],
        /// Padding.
        unused_0: u32,
        /// Illuminance outside the atmosphere, lx.
        light: [f32; 3],
        /// Padding.
        unused_1: u32,
        /// Unit vector of the source's azimuth: north, east.
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
        /// 1: the sky has air.
        has_air: u32,
        /// 1: the sky has ground.
        has_ground: u32,
        /// Number of sources.
        source_count: u32,
        /// First axis of the horizontal frame (east), in world axes.
        east: [f32; 3],
        /// Factor on the light of sky and ground.
        light_share: f32,
        /// Second axis (zenith).
        zenith: [f32; 3],
        /// 1: the horizon is at altitude 0 in every direction.
        is_flat: u32,
        /// Third axis (south).
        south: [f32; 3],
        /// Sine of the altitude above which no ground is visible.
        above_ground: f32,
        /// Extinction per air mass, as a power of two.
        extinction: [f32; 3],
        /// Padding.
        unused_1: u32,
        /// Airglow, cd/m^2.
        glow: [f32; 3],
        /// Padding.
        unused_2: u32,
        /// Luminance of the ground, cd/m^2.
        ground: [f32; 3],
        /// Azimuth of the middle of the ground picture, rad.
        landscape_azimuth: f32,
        /// Luminance of a white surface, cd/m^2.
        white: [f32; 3],
        /// Padding.
        unused_3: u32,
        /// Size of the ground picture, texels; 0: no picture.
        landscape_size: [u32; 2],
        /// Padding.
        unused_4: u32,
        /// Padding.
        unused_5: u32,
        /// The sources.
        sources: [AirSource; 2],
    }
}
