//! Structures that the asteroid shaders read.

use crate::gpu::gpu_structs;
pub(crate) use crate::render::layout::Viewport;

gpu_structs! {
    /// A group of asteroids.
    struct AsteroidItem {
        /// Centre of the group minus camera, world axes, m.
        origin: [f32; 3],
        /// Index of its first asteroid in the buffer of all fields.
        first: u32,
        /// Rounding error of `origin`, m.
        origin_low: [f32; 3],
        /// Number of asteroids.
        count: u32,
        /// Unit vector to the sun, world axes.
        sun: [f32; 3],
        /// Index of the field.
        field: u32,
        /// Illuminance of a surface that faces the sun, linear Rec. 709, lx.
        illuminance: [f32; 3],
        /// Bit 0: the group may hold points. Bit 1: it may hold shapes.
        flags: u32,
        /// Bit set of the viewports that may see the group.
        viewports: [u32; 2],
        /// Index of the first link to a plane that the group may be drawn on.
        first_link: u32,
        /// Number of links.
        link_count: u32,
    }
    /// A plane that a group may be drawn on.
    struct AsteroidLink {
        /// Index of the plane.
        plane: u32,
        /// Index of the group among the groups of the plane.
        column: u32,
        /// If the plane is a picture: bit set of the faces of its cube that the group is linked to.
        faces: u32,
        unused_0: u32,
    }
    /// Target of a list of asteroids: a picture, or a face of the cube behind a picture.
    struct AsteroidPlane {
        /// Index of the viewport.
        view: u32,
        /// Number of the face; 6: the picture itself.
        face: u32,
        /// Index of the plane's first count.
        first_count: u32,
        /// Number of groups linked to the plane.
        columns: u32,
    }
    /// A field of asteroids.
    struct AsteroidField {
        /// Rows of the rotation from the field's axes to world axes. `world_from_field_x.w`: metres per part of a radius.
        world_from_field_x: [f32; 4],
        world_from_field_y: [f32; 4],
        world_from_field_z: [f32; 4],
        /// Geometric albedo, linear Rec. 709.
        albedo: [f32; 3],
        /// Law of reflection: 0 Lambert, 1 Lommel-Seeliger.
        law: u32,
        /// Time in 2^-32 of the base period.
        time_parts: u32,
        /// Index of the first shape.
        first_shape: u32,
        /// Number of shapes.
        shape_count: u32,
        /// First kind of list of its meshes.
        first_kind: u32,
        /// Number of kinds of its meshes.
        kinds: u32,
        /// Kind of list of its impostors.
        impostor_kind: u32,
        unused_0: u32,
        unused_1: u32,
    }
    /// A picture for culling and the choice of detail; made by `crates/render/src/plan/asteroids/views.rs`.
    struct AsteroidView {
        /// Rows of the rotation from world to view axes; w: eye minus camera along world x, y, z, m.
        view_from_world_x: [f32; 4],
        view_from_world_y: [f32; 4],
        view_from_world_z: [f32; 4],
        /// Inward normals of the planes through the left and right edge: x and z of each.
        edges_x: [f32; 4],
        /// Inward normals of the planes through the lower and upper edge: y and z of each.
        edges_y: [f32; 4],
        /// Sine of half the opening angle of the cone around the picture.
        cone_sine: f32,
        /// Cosine of half the opening angle.
        cone_cosine: f32,
        /// Kind of picture: 0 flat, 1 round, 2 longitude and latitude.
        kind: u32,
        /// Index of the first entry of the picture's table.
        first_entry: u32,
        /// Distance between the eyes, m.
        impostor_eyes: f32,
        /// Factor in the distance at which impostors begin; negative: no impostors.
        impostor_linear: f32,
        /// Exponent in the distance at which impostors begin.
        impostor_exponent: f32,
        /// Factor on the distances at which the levels of detail change.
        quality: f32,
        /// 1: only the finest mesh is used.
        finest_only: u32,
        /// Index of the view whose classes are used: the view of the other eye, or this view.
        class_view: u32,
        unused_0: u32,
        unused_1: u32,
    }
    /// An asteroid in a list.
    struct AsteroidEntry {
        /// Index in the buffer of all fields.
        instance: u32,
        /// Index of its group; bit 31: the asteroid is drawn on the other side of the seam.
        item: u32,
        /// Fade between two lists; see `faded` in `shaders/asteroids/listed.wgsl`.
        fade: f32,
    }
    /// Parameters of culling asteroids.
    struct AsteroidCullParameters {
        /// Number of groups.
        items: u32,
        /// Workgroups per row of the dispatch.
        row: u32,
        /// Number of lists per plane.
        kinds: u32,
        /// Number of lists.
        buckets: u32,
        /// Number of entries that fit into the lists.
        capacity: u32,
        /// Number of kinds that are meshes.
        mesh_kinds: u32,
        /// Workgroups per row of the dispatch that splats impostors; 0: impostors are drawn.
        splat_row: u32,
        /// Impostors per workgroup of that dispatch.
        splats_per_workgroup: u32,
    }
    /// The samples that impostors are splatted onto in one pass.
    struct SplatBand {
        /// Samples per row.
        width: u32,
        /// First row of the band in the target.
        first_row: u32,
        /// Number of rows.
        rows: u32,
        /// Blocks of samples per row of blocks.
        blocks: u32,
    }
    /// Target of splatted impostors.
    struct SplatTarget {
        band: SplatBand,
        /// First word of the list's arguments: workgroups along x, y and z, number of entries, first entry.
        arguments: u32,
        /// 0: finds the greatest depth of each sample. 1: finds the asteroid at that depth. 2: lights the samples.
        stage: u32,
        /// Factor on the distances at which the levels of detail change.
        quality: f32,
        /// Greatest angle between the direction and that of the nearest tile, rad.
        tile_error_rad: f32,
    }
    /// Parameters of the pass that draws asteroids as points.
    struct AsteroidPointParameters {
        /// Fixed-point units per lux.
        units_per_lx: f32,
        /// Number of groups.
        items: u32,
        /// Workgroups per row of the dispatch.
        row: u32,
        /// Number of tiles of the batch.
        tiles: u32,
        /// First of the counters of visible points.
        first_drawn: u32,
        unused_0: u32,
        unused_1: u32,
        unused_2: u32,
    }
    /// Target of drawn asteroids.
    struct AsteroidTarget {
        /// The picture, or the face of its cube.
        viewport: Viewport,
        /// Eye minus camera, world axes, m.
        eye: [f32; 3],
        /// Distance at depth 1, m.
        near: f32,
        /// The window is the rows `first_row .. first_row + rows` of the viewport.
        first_row: u32,
        rows: u32,
        /// Samples along each side of a pixel.
        samples: u32,
        /// Index of the plane.
        plane: u32,
        /// Units of the target per cd/m^2.
        units_per_cd_m2: f32,
        /// Number of lists per plane.
        kinds: u32,
        unused_0: u32,
        unused_1: u32,
    }
    /// The list of a draw.
    struct AsteroidBucket {
        /// Its kind.
        kind: u32,
        unused_0: u32,
        unused_1: u32,
        unused_2: u32,
    }
    /// Target of individually given asteroids, which tests and probes draw.
    struct GivenTarget {
        viewport: Viewport,
        /// Distance at depth 1 along the axis, m.
        near: f32,
        unused_0: u32,
        unused_1: u32,
        unused_2: u32,
    }
    /// An individually given asteroid.
    struct GivenAsteroid {
        /// Centre relative to the eye, view axes, m.
        centre: [f32; 3],
        /// Mean radius, m.
        radius: f32,
        /// Columns of the rotation from the shape's axes to view axes.
        view_from_shape_x: [f32; 3],
        /// Index of the shape.
        shape: u32,
        view_from_shape_y: [f32; 3],
        /// Law of reflection: 0 Lambert, 1 Lommel-Seeliger.
        law: u32,
        view_from_shape_z: [f32; 3],
        unused_0: u32,
        /// Unit vector to the sun, view axes.
        sun: [f32; 3],
        unused_1: u32,
        /// Geometric albedo times illuminance divided by pi, units of the target.
        luminance: [f32; 3],
        unused_2: u32,
    }
    /// An atlas of impostors.
    struct ImpostorAtlas {
        /// Tiles along a side.
        tiles: u32,
        /// Texels along a side of a tile.
        tile_px: u32,
        /// Number of mip levels.
        levels: u32,
        /// Factor on the albedo that the atlas stores as 1.
        albedo_scale: f32,
    }
}
