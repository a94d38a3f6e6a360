//! Structures that the shaders of stars read.

use crate::gpu::gpu_structs;
pub(crate) use crate::render::layout::{AirAbove, Viewport};

gpu_structs! {
    /// Run of stars for one workgroup; see `shaders/stars/splat.wgsl`.
    StarItem {
        /// Chunk origin minus camera, pc.
        origin: [f32; 3],
        /// Index of the first star in its buffer.
        first: u32,
        /// Number of stars.
        count: u32,
        /// Bit set of tiles.
        tiles: u32,
        /// Number of the first star within the scene.
        first_number: u32,
        /// 1: the stars are at infinity, given by directions instead of positions.
        at_infinity: u32,
    }
    /// Motion of the camera; see `shaders/stars/relativity.wgsl`. All zero: at rest.
    CameraMotion {
        /// Unit vector of the velocity, world axes.
        direction: [f32; 3],
        /// Lorentz factor.
        gamma: f32,
        /// Lorentz factor times speed (fraction of the speed of light); 0 at rest.
        gamma_beta: f32,
        /// Doppler factor in the backward direction.
        doppler_behind: f32,
        /// Padding.
        unused_0: u32,
        /// Padding.
        unused_1: u32,
    }
    /// Parameters of the star pass.
    StarParameters {
        /// Fixed-point units per lux.
        units_per_lx: f32,
        /// Illuminance of the faintest stars that are drawn, lx.
        faintest_lx: f32,
        /// Exclusive upper limit of the illuminance of stars that are drawn, lx.
        brightest_lx: f32,
        /// Number of items.
        item_count: u32,
        /// Workgroups per row of the dispatch.
        items_per_row: u32,
        /// Padding.
        unused_0: u32,
        /// Padding.
        unused_1: u32,
        /// Padding.
        unused_2: u32,
        /// Motion of the camera.
        camera_motion: CameraMotion,
        /// Air around the camera.
        air: AirAbove,
    }
    /// Star as the published methods read it; see `shaders/stars/catalogue_star.wgsl`.
    CatalogueStar {
        /// Position x, ICRS, from the barycentre, pc.
        x: f32,
        /// Position y.
        y: f32,
        /// Position z.
        z: f32,
        /// Absolute V magnitude.
        absolute_magnitude: f32,
        /// Effective temperature, K.
        temperature: f32,
    }
    /// Parameters of the published passes over the whole catalogue.
    CatalogueParameters {
        /// Position of the camera, ICRS, pc.
        camera: [f32; 3],
        /// Number of stars in the buffer.
        star_count: u32,
        /// Illuminance of the faintest stars that are drawn, lx.
        faintest_lx: f32,
        /// Index of the target tile; of the viewport if the pass does not use tiles.
        tile: u32,
        /// Threads per row of the dispatch.
        row_threads: u32,
        /// Padding.
        unused_0: u32,
    }
    /// Parameters of the blending methods; see `shaders/stars/billboards/billboard.wgsl`.
    BillboardParameters {
        /// First row of the rotation from the axes of the plane to those of the view.
        view_from_plane_x: [f32; 4],
        /// Second row.
        view_from_plane_y: [f32; 4],
        /// Third row.
        view_from_plane_z: [f32; 4],
        /// Position of the camera, ICRS, pc.
        camera: [f32; 3],
        /// Illuminance of the faintest stars that are drawn, lx.
        faintest_lx: f32,
        /// Radius of discs and sprites, rad.
        radius_rad: f32,
        /// Solid angle of discs and sprites, sr.
        solid_angle_sr: f32,
        /// Magnitude from which brighter stars have the largest size.
        brightest_magnitude: f32,
        /// Magnitude from which fainter stars have the smallest size.
        faintest_magnitude: f32,
        /// Half side of a square on the screen, pixels.
        half_side_px: f32,
        /// Magnitude of the faintest visible stars.
        limiting_magnitude: f32,
        /// Magnitude of display white.
        saturation_magnitude: f32,
        /// Variance of the core, pixels^2.
        sigma2_px2: f32,
        /// Variance of the glare, pixels^2.
        glare_sigma2_px2: f32,
        /// Brightness of the glare.
        glare_brightness: f32,
        /// cd/m^2 per unit of relative brightness.
        white_cd_m2: f32,
        /// Half of the angular width of the point-spread function, rad.
        half_width_rad: f32,
        /// Angle of a texel, rad.
        texel_rad: f32,
        /// Half of the angular width to which a star is cropped, rad per sqrt(lx).
        crop_rad: f32,
        /// Minimum of that half width, rad.
        least_crop_rad: f32,
        /// Softening term added to the squared angle by which the stored function is divided, rad^2.
        softening_rad2: f32,
    }
    /// Parameters of the published rasteriser for culled stars.
    PackedParameters {
        /// Illuminance of the faintest stars that are drawn, lx.
        faintest_lx: f32,
        /// Number of items.
        item_count: u32,
        /// Workgroups per row of the dispatch.
        items_per_row: u32,
        /// Padding.
        unused_0: u32,
    }
    /// Parameters of the resolve pass of methods that output luminance.
    LuminanceParameters {
        /// Pixels of the batch.
        plane_pixels: u32,
        /// cd/m^2 per unit of the method's output.
        scale: f32,
        /// First parameter of the luminance source.
        source_0: u32,
        /// Second parameter of the luminance source.
        source_1: u32,
    }
    /// Parameters of the procedural sky; see `shaders/stars/luminance_cell_sky.wgsl`.
    CellSkyParameters {
        /// Angle of a pixel at the centre of the view, rad.
        pixel_rad: f32,
        /// Radius of a star, in these pixels.
        radius_px: f32,
        /// Cells along an edge of a cube face.
        cells: u32,
        /// Number of layers of stars.
        layers: u32,
        /// Seed of the random stars.
        seed: u32,
        /// Padding.
        unused_0: u32,
        /// Padding.
        unused_1: u32,
        /// Padding.
        unused_2: u32,
    }
}
