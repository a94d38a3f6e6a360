//! Structures that the shaders of stars read.

use crate::gpu::gpu_structs;
pub(crate) use crate::render::layout::{AirAbove, Viewport};

gpu_structs! {
    /// A run of stars for one workgroup.
    struct StarItem {
        /// Chunk origin minus camera, pc; for stars of a page its centre, a unit vector.
        origin: [f32; 3],
        /// Index of the first star in its buffer.
        first: u32,
        /// Number of stars.
        count: u32,
        /// Bit i: tile i of the batch may see these stars.
        tiles: u32,
        /// Index of the first star among all stars of the scene; the dither depends on it.
        first_number: u32,
        /// Form of the stars: `STARS_IN_SPACE` and the other constants.
        form: u32,
    }
    /// Motion of the camera. All zero: the camera is at rest. Computed in f64.
    struct CameraMotion {
        /// Unit vector of the velocity, world axes.
        direction: [f32; 3],
        /// Lorentz factor.
        gamma: f32,
        /// Lorentz factor times the speed in units of the speed of light; 0 at rest.
        gamma_beta: f32,
        /// Doppler factor straight behind: gamma * (1 - beta).
        doppler_behind: f32,
        unused_0: u32,
        unused_1: u32,
    }
    /// Parameters of the star pass.
    struct StarParameters {
        /// Fixed-point units per lux.
        units_per_lx: f32,
        /// Illuminance of the faintest stars that are drawn, lx.
        faintest_lx: f32,
        /// Stars of at least this illuminance belong to another pass with a coarser unit, lx.
        brightest_lx: f32,
        /// Number of items.
        item_count: u32,
        /// ICRS position of the camera, pc, for stars of pages.
        camera: [f32; 3],
        /// Workgroups per row of the dispatch.
        items_per_row: u32,
        camera_motion: CameraMotion,
        /// The air around the camera.
        air: AirAbove,
        /// Edges of the caps in which stars are drawn with a share of their light (shaders/shared/map_caps.wgsl); 0: with all of it.
        caps: [f32; 2],
        unused_0: u32,
        unused_1: u32,
    }
    /// A star for the published methods.
    struct CatalogueStar {
        /// ICRS position from the barycentre, pc.
        x: f32,
        y: f32,
        z: f32,
        /// Absolute V magnitude.
        absolute_magnitude: f32,
        /// Effective temperature, K.
        temperature: f32,
    }
    /// Parameters of the published passes over the whole catalogue.
    struct CatalogueParameters {
        /// ICRS position of the camera, pc.
        camera: [f32; 3],
        /// Number of stars in the buffer.
        star_count: u32,
        /// Illuminance of the faintest stars that are drawn, lx.
        faintest_lx: f32,
        /// Index of the target tile; for passes without tiles, of the viewport.
        tile: u32,
        /// Threads per row of the dispatch.
        row_threads: u32,
        unused_0: u32,
    }
    /// Parameters of the methods that blend.
    struct BillboardParameters {
        /// Rows of the rotation from the axes of the plane to view axes; they differ only for the faces of a cube.
        view_from_plane_x: [f32; 4],
        view_from_plane_y: [f32; 4],
        view_from_plane_z: [f32; 4],
        /// ICRS position of the camera, pc.
        camera: [f32; 3],
        /// Illuminance of the faintest stars that are drawn, lx.
        faintest_lx: f32,
        /// Discs and sprites: radius, rad.
        radius_rad: f32,
        /// Discs and sprites: solid angle, sr.
        solid_angle_sr: f32,
        /// Stars of this magnitude or brighter have the largest size.
        brightest_magnitude: f32,
        /// Stars of this magnitude or fainter have the smallest size.
        faintest_magnitude: f32,
        /// `screen_billboard`: half the side, pixels.
        half_side_px: f32,
        /// Gaussians, named as in the publication: faintest visible magnitude.
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
        /// `psf_texture`: half the angle of the stored function, rad.
        half_width_rad: f32,
        /// `psf_texture`: angle of a texel, rad.
        texel_rad: f32,
        /// Half the angle to which a star of 1 lx is cropped, rad per sqrt(lx). The angle is proportional to the square root of illuminance.
        crop_rad: f32,
        /// Smallest such angle, rad.
        least_crop_rad: f32,
        /// Added to the squared angle by which the stored function is divided, rad^2.
        softening_rad2: f32,
    }
    /// Parameters of the published rasteriser on culled stars.
    struct PackedParameters {
        /// Illuminance below which stars are not drawn, lx.
        faintest_lx: f32,
        /// Number of items.
        item_count: u32,
        /// Workgroups per row of the dispatch.
        items_per_row: u32,
        unused_0: u32,
    }
    /// Parameters of the resolve pass of methods that write luminance.
    struct LuminanceParameters {
        /// Number of pixels of the batch. It is the offset of the second plane, which holds blue and the solid angles.
        plane_pixels: u32,
        /// cd/m^2 per unit of the method's result.
        scale: f32,
        /// Parameters of the source of luminance (`shaders/stars/luminance_*.wgsl`).
        source_0: u32,
        source_1: u32,
    }
    /// Parameters of the procedural sky.
    struct CellSkyParameters {
        /// Angle of a pixel in the centre of the view, rad.
        pixel_rad: f32,
        /// Radius of a star, in pixels of that angle.
        radius_px: f32,
        /// Cells along an edge of a cube face.
        cells: u32,
        /// Number of layers of stars.
        layers: u32,
        /// Seed of the random stars.
        seed: u32,
        unused_0: u32,
        unused_1: u32,
        unused_2: u32,
    }
}
