//! Structures that the shaders of several techniques read.

use crate::{gpu::gpu_structs, scene::surroundings::LocalSky};

gpu_structs! {
    /// A viewport.
    struct Viewport {
        /// Rows of the rotation from world axes to view axes; w: eye minus camera along world x, y, z, pc.
        view_from_world_x: [f32; 4],
        view_from_world_y: [f32; 4],
        view_from_world_z: [f32; 4],
        /// Flat planes: pixels per unit of tangent (y negative). Fisheye: the circle's radius in pixels, twice.
        plane_scale: [f32; 2],
        /// Pixel coordinates of the principal ray or of the circle's centre.
        plane_offset: [f32; 2],
        /// Width and height, pixels.
        size: [u32; 2],
        /// Projection: one of `KIND_...`.
        kind: u32,
        /// Cube faces: number of the face. Tabulated: first word of the table, in groups of four words.
        face: u32,
        /// Fisheye: the rim's radius before normalisation, F/2, sin(F/4), sin(F/2) or tan(F/4), F being the field of view.
        rim: f32,
        /// Equidistant: pi - F/2. Orthographic: cos^2(F/2). Both are computed in f64, because in f32 the leading digits would cancel.
        rim_complement: f32,
        /// Fisheye and tabulated: 1 if the picture shows the full sphere, so that its rim is not a border.
        full_sphere: u32,
        /// 1: the solid angle is averaged over nine points per pixel, because its value at the pixel's centre is not accurate enough.
        quadrature: u32,
        /// Stars fainter than this use the tent kernel, others the B-spline. The unit is illuminance divided by the solid angle of the star's pixel,
        /// cd/m^2.
        tent_below_cd_m2: f32,
        /// Index of the view, for counting stars.
        view: u32,
        /// Stars of at least this luminance use the Gaussian kernel; defined like `tent_below_cd_m2`.
        gaussian_from_cd_m2: f32,
        /// Standard deviation of the Gaussian: the larger of this angle, rad, and `gaussian_sigma_px`.
        gaussian_sigma_rad: f32,
        gaussian_sigma_px: f32,
        /// Greatest distance beyond a border from which a star's Gaussian reaches into the picture, pixels.
        gaussian_reach_px: f32,
        /// Omni-directional stereo: radius of the circle on which the eye moves with the direction of sight, m; positive for the right
        /// eye. 0: the eye does not move.
        viewing_circle_m: f32,
        unused_0: u32,
    }
    /// A run of rows of a viewport.
    struct Tile {
        /// Index of the viewport.
        viewport: u32,
        /// The tile is the rows `first_row .. first_row + rows` of the viewport.
        first_row: u32,
        rows: u32,
        /// Index of its first pixel in the buffer of the batch.
        first_pixel: u32,
        /// Index of its first partial sum of illuminance.
        first_partial: u32,
        /// Index of the counter that is the flag of its first block of pixels.
        first_flag: u32,
        unused_0: u32,
        unused_1: u32,
    }
    /// A grid of points over the picture of a viewport.
    struct PointGrid {
        /// Index of its first point; points are stored row by row.
        first: u32,
        /// Points per row.
        columns: u32,
        /// Number of rows.
        rows: u32,
        /// Number of pixels from point to point. The first point lies on the top left corner of the picture.
        spacing: u32,
        /// The greatest angle from point to point, rad.
        spacing_rad: f32,
        /// `spacing` is 2 to this power. A shift replaces a division, which CPUs compute one lane at a time.
        spacing_log2: u32,
        unused_0: u32,
        unused_1: u32,
    }
    /// The grid over the picture of a viewport with plain blocks: the sum of all smooth light, and the positions of its parts.
    struct PlainGrid {
        /// Index of its first point: the sum of all smooth light, and the inverse of the solid angle of a pixel, 1/sr.
        first: u32,
        /// Points per row, and number of rows.
        columns: u32,
        rows: u32,
        /// Pixels from point to point.
        spacing: u32,
        /// Index of the first point of the veil, of the light of the air, of diffuse light, and of the glare of bodies.
        veil: u32,
        air: u32,
        diffuse: u32,
        near: u32,
        /// Index of the counter that is the flag of its first block.
        first_flag: u32,
        /// Blocks per row, and number of rows of blocks.
        block_columns: u32,
        block_rows: u32,
        /// Index of the first point of the part of diffuse light that may be rough.
        rough: u32,
        /// Index of the first point of directions: two entries each, the place in a picture of the sky and the share of light that passes the
        /// air.
        sky: u32,
        /// The greatest angle from point to point, rad.
        spacing_rad: f32,
        /// `spacing` is 2 to this power.
        spacing_log2: u32,
        /// Index of the first entry for the positions of its cells in the map of faint light. Each cell has three entries; cells are numbered by
        /// their first points.
        faint: u32,
    }
    /// Parameters of the tone mapping.
    struct Display {
        /// Luminance that Reinhard's operator maps to white, relative to display white.
        white: f32,
        /// White of a calibrated display, cd/m^2.
        peak_cd_m2: f32,
        /// Black of a calibrated display, cd/m^2.
        black_cd_m2: f32,
        /// Fraction of the hue that is kept at the end of the display's range, 0 to 1.
        desaturation: f32,
        /// Weight of scotopic vision for dim light, 0 to 1.
        scotopic: f32,
        /// 1: rounding errors are dithered.
        dither: u32,
        unused_0: u32,
        unused_1: u32,
    }
    /// Layout of the texels of a map of the sky.
    struct SkyMap {
        /// Luminance of a texel's unit, cd/m^2.
        unit_cd_m2: f32,
        /// Texels per rad.
        texels_per_rad: f32,
        /// Side of a picture of the whole sky, texels.
        side: u32,
        /// Pieces along the edge of a face; 0: the map has pictures of the whole sky.
        pieces_per_edge: u32,
    }
    /// The air around an eye.
    struct AirAbove {
        /// Unit vector to the zenith, world axes.
        zenith: [f32; 3],
        /// 1: there is air above ground; 2: there is air on all sides, without ground.
        present: u32,
        /// Attenuation per air mass as a power of two, linear Rec. 709.
        extinction: [f32; 3],
        /// Air density relative to the reference density of refraction; 0: no refraction.
        density: f32,
    }
    /// Diffuse light: the light of the sky without individual stars.
    struct DiffuseLight {
        /// Layout of the texels of light from beyond the Solar System; side 0: there is none.
        map: SkyMap,
        /// Unit vector of the observer's velocity, world axes.
        velocity: [f32; 3],
        /// Speed in units of the speed of light.
        beta: f32,
        /// Layout of the zodiacal light; side 0: it is not drawn.
        zodiacal: SkyMap,
        /// Rows of the rotation from world axes to those of the zodiacal light.
        zodiacal_x: [f32; 3],
        /// Index of the first texel of the zodiacal light.
        first_zodiacal: u32,
        zodiacal_y: [f32; 3],
        unused_0: u32,
        zodiacal_z: [f32; 3],
        unused_1: u32,
    }
    /// Result of the exposure pass.
    struct Exposure {
        /// Exposure of the frame.
        ev100: f32,
        /// Metered exposure.
        metered_ev100: f32,
        /// Mean luminance of all views, cd/m^2.
        mean_luminance_cd_m2: f32,
        /// Display values per cd/m^2.
        display_per_cd_m2: f32,
    }
    /// A point at which a projection is evaluated.
    struct ProbeInput {
        /// Direction in view space.
        direction: [f32; 3],
        unused_0: f32,
        /// Pixel whose solid angle and centre direction are evaluated.
        pixel: [i32; 2],
        unused_1: [i32; 2],
    }
    /// Result of a projection at a point.
    struct ProbeOutput {
        /// Continuous pixel coordinates of the direction's image; z: 1 if the image exists; w: solid angle of the pixel, sr.
        image: [f32; 4],
        /// Direction of the pixel's centre; w: 1 if the pixel is inside the picture.
        direction: [f32; 4],
    }
}

impl AirAbove {
    /// Encodes the air around a camera. It is absent without a local sky or without air.
    pub(crate) fn from_sky(sky: Option<&LocalSky>) -> Self {
        let Some((sky, air)) = sky.and_then(|sky| Some((sky, sky.air.as_ref()?))) else { return Self::default() };
        Self {
            zenith: sky.zenith().as_vec3().to_array(),
            present: if sky.horizon.is_some() { 1 } else { 2 },
            extinction: air.extinction_log2().map(|log2| log2 as f32),
            density: sky.refraction.map_or(0.0, |refraction| refraction.density as f32),
        }
    }
}
