//! Structures that the shaders of the air and ground pass read.

use crate::gpu::gpu_structs;

gpu_structs! {
    /// A source of light that the air scatters.
    struct AirSource {
        /// Unit vector towards the source, world axes.
        direction: [f32; 3],
        unused_0: u32,
        /// Illuminance outside the air, linear Rec. 709, lx.
        light: [f32; 3],
        unused_1: u32,
        /// Unit vector of the source's azimuth: north, east.
        heading: [f32; 2],
        unused_2: u32,
        unused_3: u32,
    }
    /// Parameters of the pass that adds the light of air and ground.
    struct AirParameters {
        /// Index of the tile.
        tile: u32,
        /// 1: the sky has air.
        has_air: u32,
        /// 1: the sky has ground.
        has_ground: u32,
        /// Number of entries of `sources` in use.
        source_count: u32,
        /// Axes of the horizon, in world axes: east, zenith, south.
        east: [f32; 3],
        /// Factor on the light of sky and ground. Below 1 if a glare pass follows: the glare pass adds scattered light from all directions, and this
        /// factor subtracts that light in advance.
        light_share: f32,
        zenith: [f32; 3],
        /// 1: the ground ends at the same altitude in all directions.
        is_flat: u32,
        south: [f32; 3],
        /// Sine of the altitude above which no ground is visible.
        above_ground: f32,
        /// Attenuation per air mass as a power of two, linear Rec. 709.
        extinction: [f32; 3],
        /// Altitude of the first row of the tables, rad.
        lowest: f32,
        /// Luminance of the night sky in the zenith, cd/m^2.
        glow: [f32; 3],
        /// Reciprocal of the range of altitudes of the tables, 1/rad.
        per_rad: f32,
        /// Luminance of the ground, cd/m^2.
        ground: [f32; 3],
        /// Azimuth of the centre of the landscape picture, rad.
        landscape_azimuth: f32,
        /// Luminance of a white surface, cd/m^2.
        white: [f32; 3],
        /// Sine of the altitude at which flat ground ends.
        level_sine: f32,
        /// Size of the landscape picture, texels; 0: there is none.
        landscape_size: [u32; 2],
        unused_4: u32,
        unused_5: u32,
        sources: [AirSource; 2],
    }
}
