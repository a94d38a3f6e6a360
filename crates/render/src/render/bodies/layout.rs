//! Structures that the shaders of bodies read.

use crate::gpu::gpu_structs;

gpu_structs! {
    /// An ellipsoid as an eye sees it; see `shaders/shared/ellipsoid.wgsl`.
    ViewBody {
        /// First row of the map from view axes, in units of `distance_m`, to the body's axes, in semi-axes.
        unit_from_view_x: [f32; 3],
        /// How far the middle is, m over the length of `centre`.
        distance_m: f32,
        /// Second row.
        unit_from_view_y: [f32; 3],
        /// 1: `centre` is a tangent of a flat picture; 0: a unit vector.
        on_plane: u32,
        /// Third row.
        unit_from_view_z: [f32; 3],
        /// 1 / smallest semi-axis, 1/m.
        inverse_smallest: f32,
        /// Direction of the middle, view axes.
        centre: [f32; 3],
        /// Share of its light that is drawn as a disc.
        part: f32,
        /// `centre` in the body's axes.
        unit_centre: [f32; 3],
        /// Number of the law of reflection.
        law: u32,
        /// Geometric albedo over pi.
        reflectance: [f32; 3],
        /// Linear limb darkening.
        limb_darkening: f32,
        /// Luminance of its own, cd/m^2.
        emission: [f32; 3],
        /// First of the suns that shine on it.
        first_sun: u32,
        /// How many do.
        sun_count: u32,
        /// First word of its texture, or the greatest number.
        texture: u32,
        /// Width and height of the texture.
        texture_size: [u32; 2],
        /// Luminance of its rings over what they reflect, or mean luminance of the disc by which its corona is measured, cd/m^2.
        around_light: [f32; 3],
        /// What is around it: one of `AROUND_...`.
        around: u32,
        /// Unit vector to the first sun, body's axes.
        to_sun: [f32; 3],
        /// Semi-axis along the pole over that of the equator.
        flattening: f32,
        /// Unit vector to the middle, view axes.
        towards: [f32; 3],
        /// Chord beyond which no pixel shows anything of it.
        reach: f32,
    }
    /// Light that falls on a body; see `shaders/bodies/rays.wgsl`.
    BodySun {
        /// Unit vector towards it, view axes.
        direction: [f32; 3],
        /// Radius of what casts a shadow, in the body's largest semi-axis; 0: nothing does.
        occluder_radius: f32,
        /// Illuminance, lx.
        illuminance: [f32; 3],
        /// Angular radius of the sun, rad.
        sun_radius: f32,
        /// Middle of what casts the shadow, body's axes, in its largest semi-axis.
        occluder: [f32; 3],
        /// Padding.
        unused_0: u32,
        /// Unit vector towards the sun, body's axes.
        to_sun: [f32; 3],
        /// Padding.
        unused_1: u32,
        /// Semi-axes in the largest one.
        shape: [f32; 3],
        /// Padding.
        unused_2: u32,
        /// Share of light that arrives in the umbra.
        refracted: [f32; 3],
        /// Padding.
        unused_3: u32,
    }
    /// Parameters of the geometry pass.
    GeometryParameters {
        /// Number of the tile.
        tile: u32,
        /// Samples of the layers along a side of a pixel.
        samples: u32,
        /// Bit set of cube faces.
        faces: u32,
        /// Side of a face, samples.
        face_size: u32,
        /// Distance at depth 1, m.
        near_m: f32,
        /// cd/m^2 per unit of the layers.
        luminance_scale: f32,
        /// Padding.
        unused_0: u32,
        /// Padding.
        unused_1: u32,
    }
    /// Parameters of the point pass.
    PointParameters {
        /// Fixed-point units per lux.
        units_per_lx: f32,
        /// Number of points.
        count: u32,
        /// Invocations per row of the dispatch.
        per_row: u32,
        /// Fainter light is left to other sums, lx.
        faintest_lx: f32,
        /// Brighter light too, lx.
        brightest_lx: f32,
        /// Padding.
        unused_0: u32,
        /// Padding.
        unused_1: u32,
        /// Padding.
        unused_2: u32,
    }
    /// A point of light that is no star; see `shaders/bodies/points.wgsl`.
    Point {
        /// Place relative to the camera, world axes, m.
        offset: [f32; 3],
        /// Bit set of tiles.
        tiles: u32,
        /// Intensity, linear Rec. 709, cd.
        intensity: [f32; 3],
        /// How much nearer than its place it begins, m.
        radius: f32,
    }
}
