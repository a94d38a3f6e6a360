//! Structures that the shaders from light to display read.

use crate::gpu::gpu_structs;
pub(crate) use crate::render::layout::{AirAbove, DiffuseLight, SkyMap};

gpu_structs! {
    /// The numbers of the tone mapping; see `shaders/display/encode.wgsl`.
    Display {
        /// Luminance over display white that Reinhard's operator shows white.
        white: f32,
        /// White of a calibrated display, cd/m^2.
        peak_cd_m2: f32,
        /// Its black, cd/m^2.
        black_cd_m2: f32,
        /// How much of the hue is kept where the display's range ends.
        desaturation: f32,
        /// How much dim light is seen as rods see it.
        scotopic: f32,
        /// 1: rounding is spread over neighbouring pixels.
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
        /// The same for the sums of the brightest stars; 0 without them.
        lx_per_bright_unit: f32,
        /// Display values per cd/m^2, where the display image is written by this pass.
        display_per_cd_m2: f32,
        /// Pixels of the batch.
        plane_pixels: u32,
        /// How the display image is made there.
        shown: Display,
        /// The map of faint light.
        sky: SkyMap,
        /// Light of no single star.
        diffuse: DiffuseLight,
        /// The air around the camera.
        air: AirAbove,
        /// 1: that light is read between points where it is smooth.
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
        /// Added to what the meter reads: compensation and key.
        offset_ev: f32,
        /// The exposure if `fixed`.
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
        /// How the display image is made.
        shown: Display,
    }
    /// Parameters of the present pass, for one tile.
    PresentParameters {
        /// Pixels of the batch.
        plane_pixels: u32,
        /// The tile's first pixel in the batch.
        first_pixel: u32,
        /// Its first row in the picture.
        first_row: u32,
        /// Width of the picture, pixels.
        width: u32,
        /// How light is shown.
        shown: Display,
    }
}
