//! Structures that the shaders of bodies read.

use crate::gpu::gpu_structs;

gpu_structs! {
    /// Ellipsoid in the frame of a view; see `shaders/shared/ellipsoid.wgsl`.
    ViewBody {
        /// First row of the map from view axes, in units of `distance_m`, to the body's axes, in semi-axes.
        unit_from_view_x: [f32; 3],
        /// Distance of the centre, m per length of `centre`.
        distance_m: f32,
        /// Second row.
        unit_from_view_y: [f32; 3],
        /// 1: `centre` is a point on the plane of a flat picture; 0: a unit vector.
        on_plane: u32,
        /// Third row.
        unit_from_view_z: [f32; 3],
        /// 1 / smallest semi-axis, 1/m.
        inverse_smallest: f32,
        /// Direction of the body's centre, view axes.
        centre: [f32; 3],
        /// Share of the body's light that is drawn as a disc.
        part: f32,
        /// `centre` in the body's axes.
        unit_centre: [f32; 3],
        /// Number of the law of reflection.
        law: u32,
        /// Geometric albedo over pi.
        reflectance: [f32; 3],
        /// Linear limb darkening.
        limb_darkening: f32,
        /// Emitted luminance, cd/m^2.
        emission: [f32; 3],
        /// First of the suns that illuminate the body.
        first_sun: u32,
        /// Number of those suns.
        sun_count: u32,
        /// First word of the body's texture, or `NO_TEXTURE`.
        texture: u32,
        /// Width and height of the texture.
        texture_size: [u32; 2],
        /// Rings: luminance divided by their reflectance. Corona: mean luminance of the disc that scales it. In cd/m^2.
        around_light: [f32; 3],
        /// Surroundings of the body: one of `AROUND_...`.
        around: u32,
        /// Unit vector towards the first sun, body's axes.
        to_sun: [f32; 3],
        /// Polar semi-axis divided by the equatorial one.
        flattening: f32,
        /// Unit vector towards the body's centre, view axes.
        towards: [f32; 3],
        /// Chord beyond which no pixel shows any part of the body.
        reach: f32,
    }
    /// Light of one sun on a body; see `shaders/bodies/rays.wgsl`.
    BodySun {
        /// Unit vector towards the sun, view axes.
        direction: [f32; 3],
        /// Radius of the shadow caster, in units of the body's largest semi-axis; 0: no shadow.
        occluder_radius: f32,
        /// Illuminance, lx.
        illuminance: [f32; 3],
        /// Angular radius of the sun, rad.
        sun_radius: f32,
        /// Centre of the shadow caster, body's axes, in units of the body's largest semi-axis.
        occluder: [f32; 3],
        /// Padding.
        unused_0: u32,
        /// Unit vector towards the sun, body's axes.
        to_sun: [f32; 3],
        /// Padding.
        unused_1: u32,
        /// The body's semi-axes divided by the largest one.
        shape: [f32; 3],
        /// Padding.
        unused_2: u32,
        /// Share of the light that refraction brings into the umbra.
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
        /// Faintest light in these sums, lx; other sums take fainter light.
        faintest_lx: f32,
        /// Limit above which other sums take the light, lx.
        brightest_lx: f32,
        /// Padding.
        unused_0: u32,
        /// Padding.
        unused_1: u32,
        /// Padding.
        unused_2: u32,
    }
    /// Point of light other than a star; see `shaders/bodies/points.wgsl`.
    Point {
        /// Position relative to the camera, world axes, m.
        offset: [f32; 3],
        /// Bit set of tiles.
        tiles: u32,
        /// Intensity, linear Rec. 709, cd.
        intensity: [f32; 3],
        /// Distance by which the source's surface is nearer than its position, m.
        radius: f32,
    }
}
