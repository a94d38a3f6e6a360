//! Structures that the shaders of several techniques read.

use crate::{gpu::gpu_structs, scene::surroundings::LocalSky};

gpu_structs! {
    /// A viewport; see `shaders/shared/viewport.wgsl`.
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
        /// Number of the cube face; where the table of a tabulated projection begins.
        face: u32,
        /// Fisheye: radius of the rim before normalisation.
        rim: f32,
        /// pi - F/2 or cos^2(F/2).
        rim_complement: f32,
        /// 1: the picture shows the full sphere.
        full_sphere: u32,
        /// 1: nine points per pixel for the solid angle.
        quadrature: u32,
        /// Stars below this take the tent, cd/m^2.
        tent_below_cd_m2: f32,
        /// Index of the view.
        view: u32,
        /// Stars from this on take the Gaussian, cd/m^2.
        gaussian_from_cd_m2: f32,
        /// Its standard deviation as an angle, rad.
        gaussian_sigma_rad: f32,
        /// The same in pixels.
        gaussian_sigma_px: f32,
        /// How far it reaches over a border, pixels.
        gaussian_reach_px: f32,
        /// 1: the Gaussian lies on the image plane; 0: it is round in view space.
        gaussian_on_plane: u32,
        /// Omni-directional stereo: radius of the circle on which the eye goes round, m; 0: it stays.
        viewing_circle_m: f32,
    }
    /// A run of rows of a viewport; see `shaders/shared/viewport.wgsl`.
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
        /// Counter that is the flag of its first block.
        first_flag: u32,
        /// Padding.
        unused_0: u32,
        /// Padding.
        unused_1: u32,
    }
    /// A grid of points over the picture of a viewport; see `shaders/shared/point_grid.wgsl`.
    PointGrid {
        /// Index of its first point.
        first: u32,
        /// Points of a row.
        columns: u32,
        /// Rows of points.
        rows: u32,
        /// Pixels from point to point.
        spacing: u32,
    }
    /// The map of faint light; see `shaders/shared/sky_map.wgsl`.
    SkyMap {
        /// Luminance of a texel's unit, cd/m^2.
        unit_cd_m2: f32,
        /// Texels per rad.
        texels_per_rad: f32,
        /// Side of a picture, texels.
        side: u32,
        /// Padding.
        unused_0: u32,
    }
    /// The air around an eye; see `shaders/shared/air_mass.wgsl`.
    AirAbove {
        /// Unit vector to the zenith, world axes.
        zenith: [f32; 3],
        /// 1: there is air.
        present: u32,
        /// Power of two by which light becomes less for each air mass.
        extinction: [f32; 3],
        /// Density over that for which refraction is told.
        density: f32,
    }
    /// Light of no single star; see `shaders/shared/diffuse_light.wgsl`.
    DiffuseLight {
        /// Where its texels lie.
        map: SkyMap,
        /// Unit vector of the observer's velocity, world axes.
        velocity: [f32; 3],
        /// Speed over that of light.
        beta: f32,
    }
    /// What the exposure pass found.
    Exposure {
        /// Exposure of the frame.
        ev100: f32,
        /// What the meter reads.
        metered_ev100: f32,
        /// Mean luminance of all views, cd/m^2.
        mean_luminance_cd_m2: f32,
        /// Display values per cd/m^2.
        display_per_cd_m2: f32,
    }
    /// A point at which a projection is evaluated; see `shaders/probe.wgsl`.
    ProbeInput {
        /// Direction in view space.
        direction: [f32; 3],
        /// Padding.
        unused_0: f32,
        /// Pixel.
        pixel: [i32; 2],
        /// Padding.
        unused_1: [i32; 2],
    }
    /// What a projection gives there.
    ProbeOutput {
        /// Pixel coordinates of the direction's image, whether there is one, solid angle of the pixel in sr.
        image: [f32; 4],
        /// Direction of the pixel's centre, whether it lies in the picture.
        direction: [f32; 4],
    }
}

impl AirAbove {
    /// The air of what is around a camera, if there is any.
    pub(crate) fn of(sky: Option<&LocalSky>) -> Self {
        let Some((sky, air)) = sky.and_then(|sky| Some((sky, sky.air.as_ref()?))) else { return Self::default() };
        Self {
            zenith: sky.zenith().as_vec3().to_array(),
            present: 1,
            extinction: air.extinction_log2().map(|log2| log2 as f32),
            density: sky.refraction.map_or(0.0, |refraction| refraction.density as f32),
        }
    }
}
