//! Structures that the shaders of stars read.

use crate::gpu::gpu_structs;
pub(crate) use crate::render::layout::{AirAbove, Viewport};

gpu_structs! {
    /// A run of stars for one workgroup; see `shaders/stars/splat.wgsl`.
    StarItem {
        /// Chunk origin minus camera, pc.
        origin: [f32; 3],
        /// First star in its buffer.
        first: u32,
        /// Number of stars.
        count: u32,
        /// Bit set of tiles.
        tiles: u32,
        /// Number of the first star in the scene.
        first_number: u32,
        /// 1: directions instead of places.
        at_infinity: u32,
    }
    /// How the camera moves; see `shaders/stars/relativity.wgsl`. All zero: it rests.
    CameraMotion {
        /// Unit vector of the velocity, world axes.
        direction: [f32; 3],
        /// Lorentz factor.
        gamma: f32,
        /// Lorentz factor times speed; 0 at rest.
        gamma_beta: f32,
        /// Doppler factor straight behind.
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
        /// Fainter stars are not drawn, lx.
        faintest_lx: f32,
        /// Stars as bright or brighter are not drawn, lx.
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
        /// How the camera moves.
        camera_motion: CameraMotion,
        /// The air around it.
        air: AirAbove,
    }
    /// A star as the published methods read it; see `shaders/stars/catalogue_star.wgsl`.
    CatalogueStar {
        /// ICRS, from the barycentre, pc.
        x: f32,
        /// See `x`.
        y: f32,
        /// See `x`.
        z: f32,
        /// Absolute V magnitude.
        absolute_magnitude: f32,
        /// Effective temperature, K.
        temperature: f32,
    }
    /// Parameters of the published passes over the whole catalogue.
    CatalogueParameters {
        /// Place of the camera, ICRS, pc.
        camera: [f32; 3],
        /// Stars of the buffer.
        star_count: u32,
        /// Fainter stars are not drawn, lx.
        faintest_lx: f32,
        /// The tile drawn into; where there are no tiles, the viewport.
        tile: u32,
        /// Threads per row of the dispatch.
        row_threads: u32,
        /// Padding.
        unused_0: u32,
    }
    /// Parameters of the methods that blend; see `shaders/stars/billboards/billboard.wgsl`.
    BillboardParameters {
        /// First row of the rotation from the axes of the plane to those of the view.
        view_from_plane_x: [f32; 4],
        /// Second row.
        view_from_plane_y: [f32; 4],
        /// Third row.
        view_from_plane_z: [f32; 4],
        /// Place of the camera, ICRS, pc.
        camera: [f32; 3],
        /// Fainter stars are not drawn, lx.
        faintest_lx: f32,
        /// Radius of discs and sprites, rad.
        radius_rad: f32,
        /// Their solid angle, sr.
        solid_angle_sr: f32,
        /// Stars of this magnitude or brighter are drawn largest.
        brightest_magnitude: f32,
        /// Stars of this magnitude or fainter are drawn smallest.
        faintest_magnitude: f32,
        /// Half of the side of a square on the screen, pixels.
        half_side_px: f32,
        /// Faintest magnitude that is seen.
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
        /// Half of the angle of the point-spread function, rad.
        half_width_rad: f32,
        /// Angle of a texel, rad.
        texel_rad: f32,
        /// Half of the angle that a star is cropped to, rad per sqrt(lx).
        crop_rad: f32,
        /// The least such angle, rad.
        least_crop_rad: f32,
        /// Added to the square of the angle that the stored function is divided by, rad^2.
        softening_rad2: f32,
    }
    /// Parameters of the published rasteriser on culled stars.
    PackedParameters {
        /// Fainter stars are not drawn, lx.
        faintest_lx: f32,
        /// Number of items.
        item_count: u32,
        /// Workgroups per row of the dispatch.
        items_per_row: u32,
        /// Padding.
        unused_0: u32,
    }
    /// Parameters of the resolve pass of methods that leave luminance.
    LuminanceParameters {
        /// Pixels of the batch.
        plane_pixels: u32,
        /// cd/m^2 per unit of what the method left.
        scale: f32,
        /// For the source of luminance.
        source_0: u32,
        /// For the source of luminance.
        source_1: u32,
    }
    /// The procedural sky; see `shaders/stars/luminance_cell_sky.wgsl`.
    CellSkyParameters {
        /// Angle of a pixel in the middle of the view, rad.
        pixel_rad: f32,
        /// Radius of a star, such pixels.
        radius_px: f32,
        /// Cells along an edge of a cube face.
        cells: u32,
        /// Layers of stars.
        layers: u32,
        /// Seed of the sky.
        seed: u32,
        /// Padding.
        unused_0: u32,
        /// Padding.
        unused_1: u32,
        /// Padding.
        unused_2: u32,
    }
}
