//! Structures that the shaders of bodies read.

use crate::gpu::gpu_structs;

gpu_structs! {
    /// An ellipsoid seen from an eye. `shaders/shared/ellipsoid.wgsl` explains the coordinates.
    struct ViewBody {
        /// Rows of the map from view axes, in units of `distance_m`, to the body's axes, in semi-axes. These units keep the numbers near 1 for bodies
        /// of any size.
        unit_from_view_x: [f32; 3],
        /// Distance of the centre divided by the length of `centre`, m.
        distance_m: f32,
        unit_from_view_y: [f32; 3],
        /// 1: `centre` is a tangent on a flat picture, with z = -1. 0: `centre` is a unit vector.
        on_plane: u32,
        unit_from_view_z: [f32; 3],
        /// 1 / smallest semi-axis, 1/m.
        inverse_smallest: f32,
        /// Direction of the centre, view axes.
        centre: [f32; 3],
        /// Fraction of the body's light that is drawn as a disc.
        part: f32,
        /// `centre` in the body's axes.
        unit_centre: [f32; 3],
        /// Law of reflection: 0 Lambert, 1 Lommel-Seeliger.
        law: u32,
        /// Geometric albedo divided by pi, linear Rec. 709.
        reflectance: [f32; 3],
        /// Coefficient of linear limb darkening.
        limb_darkening: f32,
        /// Emitted luminance, cd/m^2.
        emission: [f32; 3],
        /// Index of the first sun that shines on the body.
        first_sun: u32,
        /// Number of suns that shine on the body.
        sun_count: u32,
        /// First word of the texture; `NO_TEXTURE`: none.
        texture: u32,
        /// Width and height of the texture.
        texture_size: [u32; 2],
        /// Rings: their luminance divided by their reflectance. Corona: mean luminance of the disc. cd/m^2.
        around_light: [f32; 3],
        /// Kind of surroundings of the body: one of `AROUND_...`.
        around: u32,
        /// Unit vector towards the first sun, body's axes.
        to_sun: [f32; 3],
        /// Polar semi-axis divided by equatorial semi-axis.
        flattening: f32,
        /// Unit vector to the centre, view axes.
        towards: [f32; 3],
        /// Chord beyond which no pixel shows the body or its surroundings.
        reach: f32,
    }
    /// Light of one sun on a body.
    struct BodySun {
        /// Unit vector to the sun, view axes.
        direction: [f32; 3],
        /// Radius of the occluder of the sun, in the body's largest semi-axis; 0: none.
        occluder_radius: f32,
        /// Illuminance, linear Rec. 709, lx.
        illuminance: [f32; 3],
        /// Angular radius of the sun, rad.
        sun_radius: f32,
        /// Centre of the occluder, body's axes, in the body's largest semi-axis.
        occluder: [f32; 3],
        unused_0: u32,
        /// Unit vector to the sun, body's axes.
        to_sun: [f32; 3],
        unused_1: u32,
        /// Semi-axes relative to the largest one.
        shape: [f32; 3],
        unused_2: u32,
        /// Fraction of the light that reaches the umbra.
        refracted: [f32; 3],
        /// Square of the ratio of the occluder's equatorial and polar radii, minus 1; 0: a sphere.
        oblate: f32,
        /// Pole of the occluder, unit vector, body's axes.
        pole: [f32; 3],
        unused_3: u32,
    }
    /// Parameters of the geometry pass.
    struct GeometryParameters {
        /// Index of the tile.
        tile: u32,
        /// Samples of the layers along a side of a pixel.
        samples: u32,
        /// Bit set of cube faces; 0: none.
        faces: u32,
        /// Side of a face, samples.
        face_size: u32,
        /// Distance at depth 1, m.
        near_m: f32,
        /// cd/m^2 per unit of the layers.
        luminance_scale: f32,
        unused_0: u32,
        unused_1: u32,
    }
    /// Parameters of the point pass.
    struct PointParameters {
        /// Fixed-point units per lux.
        units_per_lx: f32,
        /// Number of points.
        count: u32,
        /// Invocations per row of the dispatch.
        per_row: u32,
        /// Fainter light belongs to other sums. Illuminance, lx.
        faintest_lx: f32,
        /// Brighter light belongs to other sums. Illuminance, lx.
        brightest_lx: f32,
        unused_0: u32,
        unused_1: u32,
        unused_2: u32,
    }
    /// A point of light other than a star: a distant body or a group of asteroids.
    struct Point {
        /// Position relative to the camera, world axes, m.
        offset: [f32; 3],
        /// Bit set of tiles.
        tiles: u32,
        /// Luminous intensity, linear Rec. 709, cd.
        intensity: [f32; 3],
        /// Distance by which its near side is closer than its position, m.
        radius: f32,
    }
}
