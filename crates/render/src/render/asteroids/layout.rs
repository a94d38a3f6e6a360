//! Structures that the shaders of asteroids read.

use crate::gpu::gpu_structs;
pub(crate) use crate::render::layout::Viewport;

gpu_structs! {
    /// A group of asteroids; see `shaders/asteroids/instance.wgsl`.
    AsteroidItem {
        /// Its middle minus camera, world axes, m.
        origin: [f32; 3],
        /// First asteroid in the buffer of all fields.
        first: u32,
        /// What the rounding of `origin` left, m.
        origin_low: [f32; 3],
        /// Number of asteroids.
        count: u32,
        /// To the sun, unit vector, world axes.
        sun: [f32; 3],
        /// Index of the field.
        field: u32,
        /// Illuminance of a surface that faces the sun, lx.
        illuminance: [f32; 3],
        /// Bit 0: may hold points; bit 1: may hold shapes.
        flags: u32,
        /// Bit set of the viewports that may see it.
        viewports: [u32; 2],
        /// First link to a plane that it may be drawn on.
        first_link: u32,
        /// Number of links.
        link_count: u32,
    }
    /// A plane that a group may be drawn on.
    AsteroidLink {
        /// Index of the plane.
        plane: u32,
        /// The group's number among those of the plane.
        column: u32,
        /// Of a picture itself: the faces of its cube that the group is linked to, by bits.
        faces: u32,
        /// Padding.
        unused_0: u32,
    }
    /// What a list of asteroids goes onto: a picture, or a face of the cube behind it.
    AsteroidPlane {
        /// Index of the viewport.
        view: u32,
        /// Number of the face; 6: the picture itself.
        face: u32,
        /// First count.
        first_count: u32,
        /// Groups that are linked to it.
        columns: u32,
    }
    /// A field of asteroids.
    AsteroidField {
        /// First row of the rotation from the field's axes to world axes; w: m per part of a radius.
        world_from_field_x: [f32; 4],
        /// Second row.
        world_from_field_y: [f32; 4],
        /// Third row.
        world_from_field_z: [f32; 4],
        /// Geometric albedo.
        albedo: [f32; 3],
        /// 0: Lambert; 1: Lommel-Seeliger.
        law: u32,
        /// The moment, in 2^32 parts of the base period.
        time_parts: u32,
        /// First shape.
        first_shape: u32,
        /// Number of shapes.
        shape_count: u32,
        /// First of the kinds of its meshes.
        first_kind: u32,
        /// Number of its meshes.
        kinds: u32,
        /// Kind of its impostors.
        impostor_kind: u32,
        /// Padding.
        unused_0: u32,
        /// Padding.
        unused_1: u32,
    }
    /// A shape of a field.
    AsteroidShape {
        /// Kind of its finest mesh; the others follow.
        first_kind: u32,
        /// Levels of detail.
        levels: u32,
        /// Radius of the sphere that holds it, mean radii.
        bound: f32,
        /// Padding.
        unused_0: u32,
    }
    /// A picture as culling and detail see it; see `src/plan/asteroids/views.rs`.
    AsteroidView {
        /// First row of the rotation from world to view axes; w: eye minus camera along world x, m.
        view_from_world_x: [f32; 4],
        /// Second row.
        view_from_world_y: [f32; 4],
        /// Third row.
        view_from_world_z: [f32; 4],
        /// Normals of the left and right edge's planes: x and z of each.
        edges_x: [f32; 4],
        /// Normals of the lower and upper edge's planes: y and z of each.
        edges_y: [f32; 4],
        /// Sine of half the angle of the cone that holds the picture.
        cone_sine: f32,
        /// Its cosine.
        cone_cosine: f32,
        /// 0: flat; 1: round; 2: longitude and latitude.
        kind: u32,
        /// First entry of its table.
        first_entry: u32,
        /// Distance of the eyes, m.
        impostor_eyes: f32,
        /// Where impostors begin; negative: nowhere.
        impostor_linear: f32,
        /// See there.
        impostor_exponent: f32,
        /// Factor on distances.
        quality: f32,
        /// 1: only the finest mesh.
        finest_only: u32,
        /// The view whose classes hold for this one: the other eye's, or this one itself.
        class_view: u32,
        /// Padding.
        unused_0: u32,
        /// Padding.
        unused_1: u32,
    }
    /// An asteroid in a list.
    AsteroidEntry {
        /// Index in the buffer of all fields.
        instance: u32,
        /// Its group; bit 31: on the other side of the seam.
        item: u32,
        /// How it fades; see `faded` in `shaders/asteroids/listed.wgsl`.
        fade: f32,
    }
    /// Parameters of culling asteroids.
    AsteroidCullParameters {
        /// Number of groups.
        items: u32,
        /// Workgroups per row of the dispatch.
        row: u32,
        /// Kinds of lists per plane.
        kinds: u32,
        /// Number of lists.
        buckets: u32,
        /// Entries that the lists have room for.
        capacity: u32,
        /// Kinds that are meshes.
        mesh_kinds: u32,
        /// Workgroups along a row where impostors are splatted; 0: they are drawn.
        splat_row: u32,
        /// Impostors per workgroup there.
        splats_per_workgroup: u32,
    }
    /// Samples that impostors are splatted onto at once; see `shaders/asteroids/impostors/splat_band.wgsl`.
    SplatBand {
        /// Samples in a row.
        width: u32,
        /// First of the rows.
        first_row: u32,
        /// Their number.
        rows: u32,
        /// Blocks of samples in a row of them.
        blocks: u32,
    }
    /// What impostors are splatted onto; see `shaders/asteroids/impostors/footprint.wgsl`.
    SplatTarget {
        /// The samples.
        band: SplatBand,
        /// First word of the list's arguments.
        arguments: u32,
        /// 0: depths are found; 1: whose they are; 2: samples are lit.
        stage: u32,
        /// Factor on distances of detail.
        quality: f32,
        /// Greatest error of the direction of the nearest tile, rad.
        tile_error_rad: f32,
    }
    /// Parameters of the pass over asteroids that are points.
    AsteroidPointParameters {
        /// Fixed-point units per lux.
        units_per_lx: f32,
        /// Number of groups.
        items: u32,
        /// Workgroups per row of the dispatch.
        row: u32,
        /// Tiles of the batch.
        tiles: u32,
    }
    /// What asteroids are drawn onto; see `shaders/asteroids/listed.wgsl`.
    AsteroidTarget {
        /// The picture, or the face.
        viewport: Viewport,
        /// Eye minus camera, world axes, m.
        eye: [f32; 3],
        /// Distance of depth 1, m.
        near: f32,
        /// First row of the window, pixels.
        first_row: u32,
        /// Its rows, pixels.
        rows: u32,
        /// Samples along each side of a pixel.
        samples: u32,
        /// Index of the plane.
        plane: u32,
        /// Units of the target per cd/m^2.
        units_per_cd_m2: f32,
        /// Kinds of lists per plane.
        kinds: u32,
        /// Padding.
        unused_0: u32,
        /// Padding.
        unused_1: u32,
    }
    /// Which list a draw takes.
    AsteroidBucket {
        /// Its kind.
        kind: u32,
        /// Padding.
        unused_0: u32,
        /// Padding.
        unused_1: u32,
        /// Padding.
        unused_2: u32,
    }
    /// What given asteroids are drawn onto; see `shaders/asteroids/impostors/given.wgsl`.
    GivenTarget {
        /// The picture.
        viewport: Viewport,
        /// Distance of depth 1, m.
        near: f32,
        /// Padding.
        unused_0: u32,
        /// Padding.
        unused_1: u32,
        /// Padding.
        unused_2: u32,
    }
    /// An asteroid that is given by itself.
    GivenAsteroid {
        /// Its middle relative to the eye, view axes, m.
        centre: [f32; 3],
        /// Mean radius, m.
        radius: f32,
        /// First column of the rotation from the shape's axes to view axes.
        view_from_shape_x: [f32; 3],
        /// Index of the shape.
        shape: u32,
        /// Second column.
        view_from_shape_y: [f32; 3],
        /// 0: Lambert; 1: Lommel-Seeliger.
        law: u32,
        /// Third column.
        view_from_shape_z: [f32; 3],
        /// Padding.
        unused_0: u32,
        /// To the sun, unit vector, view axes.
        sun: [f32; 3],
        /// Padding.
        unused_1: u32,
        /// Geometric albedo times illuminance over pi, units of the target.
        luminance: [f32; 3],
        /// Padding.
        unused_2: u32,
    }
    /// An atlas of impostors; see `shaders/asteroids/impostors/atlas.wgsl`.
    ImpostorAtlas {
        /// Tiles along a side.
        tiles: u32,
        /// Texels along a side of a tile.
        tile_px: u32,
        /// Mip levels.
        levels: u32,
        /// Factor on the albedo that is stored as 1.
        albedo_scale: f32,
    }
    /// Parameters of baking a block of an atlas; see `shaders/asteroids/impostors/bake_block.wgsl`.
    ImpostorBakeParameters {
        /// Samples along the side of the block.
        side: f32,
        /// Samples per bounding radius.
        scale: f32,
        /// Radius of the bounding sphere, mean radii.
        bound: f32,
        /// Factor on the albedo that is stored as 1.
        albedo_scale: f32,
    }
    /// A tile of the block.
    ImpostorBakeTile {
        /// To the right of the picture, shape's axes.
        right: [f32; 3],
        /// Padding.
        unused_0: f32,
        /// To its top.
        up: [f32; 3],
        /// Padding.
        unused_1: f32,
        /// Towards the eye.
        direction: [f32; 3],
        /// Padding.
        unused_2: f32,
        /// Its middle on the block, samples.
        middle: [f32; 2],
        /// Padding.
        unused_3: [f32; 2],
    }
    /// Parameters of filtering a block of an atlas.
    ImpostorFilterParameters {
        /// Texels along the side of the block.
        side: u32,
        /// Samples along the side of a texel.
        samples: u32,
        /// Padding.
        unused_0: u32,
        /// Padding.
        unused_1: u32,
    }
}
