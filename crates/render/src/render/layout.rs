//! Structures that the shaders of several techniques read.

use crate::{gpu::gpu_structs, scene::surroundings::LocalSky};

gpu_structs! {
    /// Viewport; see `shaders/shared/viewport.wgsl`.
    Viewport {
        /// First row of the rotation from world to view axes; w: eye offset along world x, pc.
        view_from_world_x: [f32; 4],
        /// Second row; w: eye offset along world y, pc.
        view_from_world_y: [f32; 4],
        /// Third row; w: eye offset along world z, pc.
        view_from_world_z: [f32; 4],
        /// Pixels per unit of the plane.
        plane_scale: [f32; 2],
        /// Pixel coordinates of the plane's origin.
        plane_offset: [f32; 2],
        /// Width and height, pixels.
        size: [u32; 2],
        /// Number of the projection.
        kind: u32,
        /// Cube face: number of the face. Tabulated projection: start of the table.
        face: u32,
        /// Fisheye: radius of the rim before normalisation.
        rim: f32,
        /// pi - F/2 or cos^2(F/2).
        rim_complement: f32,
        /// 1: the picture shows the full sphere.
        full_sphere: u32,
        /// 1: the solid angle of a pixel is integrated with nine points.
        quadrature: u32,
        /// Stars below this luminance use the tent kernel, cd/m^2.
        tent_below_cd_m2: f32,
        /// Index of the view.
        view: u32,
        /// Stars from this luminance on use the Gaussian kernel, cd/m^2.
        gaussian_from_cd_m2: f32,
        /// Standard deviation of the Gaussian as an angle, rad.
        gaussian_sigma_rad: f32,
        /// Standard deviation of the Gaussian, pixels.
        gaussian_sigma_px: f32,
        /// Reach of the Gaussian beyond a border, pixels.
        gaussian_reach_px: f32,
        /// 1: the Gaussian is on the image plane; 0: it is round in view space.
        gaussian_on_plane: u32,
        /// Omnidirectional stereo: radius of the circle on which the eye moves, m; 0: the eye is fixed.
        viewing_circle_m: f32,
    }
    /// Run of rows of a viewport; see `shaders/shared/viewport.wgsl`.
    Tile {
        /// Index of the viewport.
        viewport: u32,
        /// First row.
        first_row: u32,
        /// Number of rows.
        rows: u32,
        /// Index of the first pixel in the batch's buffer.
        first_pixel: u32,
        /// Index of the first partial sum.
        first_partial: u32,
        /// Index of the counter that is the flag of its first block.
        first_flag: u32,
        /// Padding.
        unused_0: u32,
        /// Padding.
        unused_1: u32,
    }
    /// Grid of points over the picture of a viewport; see `shaders/shared/point_grid.wgsl`.
    PointGrid {
        /// Index of its first point.
        first: u32,
        /// Number of points in a row.
        columns: u32,
        /// Number of rows of points.
        rows: u32,
        /// Distance between points, pixels.
        spacing: u32,
    }
    /// Map of faint light; see `shaders/shared/sky_map.wgsl`.
    SkyMap {
        /// Luminance of one texel unit, cd/m^2.
        unit_cd_m2: f32,
        /// Texels per rad.
        texels_per_rad: f32,
        /// Side of a picture, texels.
        side: u32,
        /// Padding.
        unused_0: u32,
    }
    /// Air around an eye; see `shaders/shared/air_mass.wgsl`.
    AirAbove {
        /// Unit vector towards the zenith, world axes.
        zenith: [f32; 3],
        /// 1: there is air.
        present: u32,
        /// Extinction per air mass, as a power of two.
        extinction: [f32; 3],
        /// Density of the air, relative to the density for which the refraction coefficients hold.
        density: f32,
    }
    /// Diffuse light; see `shaders/shared/diffuse_light.wgsl`.
    DiffuseLight {
        /// Scale of its texels.
        map: SkyMap,
        /// Unit vector of the observer's velocity, world axes.
        velocity: [f32; 3],
        /// Observer's speed, as a fraction of the speed of light.
        beta: f32,
    }
    /// Results of the exposure pass.
    Exposure {
        /// Exposure of the frame, EV at ISO 100.
        ev100: f32,
        /// Metered exposure, EV at ISO 100.
        metered_ev100: f32,
        /// Mean luminance of all views, cd/m^2.
        mean_luminance_cd_m2: f32,
        /// Display values per cd/m^2.
        display_per_cd_m2: f32,
    }
    /// Input of the projection probe; see `shaders/probe.wgsl`.
    ProbeInput {
        /// Direction in view space.
        direction: [f32; 3],
        /// Padding.
        unused_0: f32,
        /// Column and row of the pixel.
        pixel: [i32; 2],
        /// Padding.
        unused_1: [i32; 2],
    }
    /// Result of the projection probe.
    ProbeOutput {
        /// Pixel coordinates of the direction's image, 1 if the image exists, solid angle of the pixel in sr.
        image: [f32; 4],
        /// Direction of the pixel's centre, 1 if it is in the picture.
        direction: [f32; 4],
    }
}

impl AirAbove {
    /// Air around a camera; absent without a local sky or without air.
    pub(crate) fn from_sky(sky: Option<&LocalSky>) -> Self {
        let Some((sky, air)) = sky.and_then(|sky| Some((sky, sky.air.as_ref()?))) else { return Self::default() };
        Self {
            zenith: sky.zenith().as_vec3().to_array(),
            present: 1,
            extinction: air.extinction_log2().map(|log2| log2 as f32),
            density: sky.refraction.map_or(0.0, |refraction| refraction.density as f32),
        }
    }
}
