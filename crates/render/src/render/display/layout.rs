//! Structures that the shaders from light to display read.

use crate::gpu::gpu_structs;
pub(crate) use crate::render::layout::{AirAbove, DiffuseLight, SkyMap};

gpu_structs! {
    /// Parameters of the tone mapping; see `shaders/display/encode.wgsl`.
    Display {
        /// Luminance, relative to display white, that Reinhard's operator maps to white.
        white: f32,
        /// White of a calibrated display, cd/m^2.
        peak_cd_m2: f32,
        /// Black of a calibrated display, cd/m^2.
        black_cd_m2: f32,
        /// Share of the hue that is kept at the limit of the display's range.
        desaturation: f32,
        /// Strength of scotopic (rod) vision for dim light.
        scotopic: f32,
        /// 1: dither, which spreads the rounding over neighbouring pixels.
        dither: u32,
        /// Padding.
        unused_0: u32,
        /// Padding.
        unused_1: u32,
    }
    /// Parameters of the resolve pass.
    ResolveParameters {
        /// Lux per fixed-point unit.
        lx_per_unit: f32,
        /// Lux per unit of the sums of the brightest stars; 0: no such sums.
        lx_per_bright_unit: f32,
        /// Display values per cd/m^2, if this pass writes the display image.
        display_per_cd_m2: f32,
        /// Pixels of the batch.
        plane_pixels: u32,
        /// Tone mapping of that display image.
        shown: Display,
        /// Map of faint light.
        sky: SkyMap,
        /// Diffuse light.
        diffuse: DiffuseLight,
        /// Air around the camera.
        air: AirAbove,
        /// 1: smooth parts of the diffuse light are interpolated between grid points.
        diffuse_is_smooth: u32,
        /// Padding.
        unused_0: u32,
        /// Padding.
        unused_1: u32,
        /// Padding.
        unused_2: u32,
    }
    /// Parameters of the exposure pass.
    ExposureParameters {
        /// Solid angle of all pixels, sr.
        total_solid_angle_sr: f32,
        /// Lowest exposure.
        min_ev100: f32,
        /// Highest exposure.
        max_ev100: f32,
        /// Offset added to the metered exposure: compensation and key, EV.
        offset_ev: f32,
        /// Exposure used if `fixed` is 1.
        fixed_ev100: f32,
        /// 1: use `fixed_ev100`.
        fixed: u32,
        /// Number of partial sums.
        partial_count: u32,
        /// Padding.
        unused_0: u32,
    }
    /// Parameters of the tone-mapping pass.
    ToneMapParameters {
        /// Pixels of the batch.
        plane_pixels: u32,
        /// Padding.
        unused_0: u32,
        /// Padding.
        unused_1: u32,
        /// Padding.
        unused_2: u32,
        /// Tone mapping of the display image.
        shown: Display,
    }
    /// Parameters of the present pass, for one tile.
    PresentParameters {
        /// Pixels of the batch.
        plane_pixels: u32,
        /// Index of the tile's first pixel in the batch.
        first_pixel: u32,
        /// Row of the picture at which the tile begins.
        first_row: u32,
        /// Width of the picture, pixels.
        width: u32,
        /// Tone mapping.
        shown: Display,
    }
}
