//! Structures that the asteroid shaders read.

use crate::gpu::gpu_structs;
pub(crate) use crate::render::layout::Viewport;

gpu_structs! {
    /// A group of asteroids; see `shaders/asteroids/instance.wgsl`.
    AsteroidItem {
        /// Centre minus camera, world axes, m.
        origin: [f32; 3],
        /// First asteroid in the buffer of all fields.
        first: u32,
        /// Rounding error of `origin`, m.
        origin_low: [f32; 3],
        /// Number of asteroids.
        count: u32,
        /// Unit vector towards the sun, world axes.
        sun: [f32; 3],
        /// Index of the field.
        field: u32,
        /// Illuminance of a surface that faces the sun, lx.
        illuminance: [f32; 3],
        /// Bit 0: may contain points; bit 1: may contain shapes.
        flags: u32,
        /// Bit set of the viewports that may show the group.
        viewports: [u32; 2],
        /// First link to a plane on which the group may be drawn.
        first_link: u32,
        /// Number of links.
        link_count: u32,
    }
    /// Link between a group and a plane on which the group may be drawn.
    AsteroidLink {
        /// Index of the plane.
        plane: u32,
        /// Index of the group among the groups of the plane.
        column: u32,
        /// For the plane of a whole picture: bit set of the cube faces that the group is linked to.
        faces: u32,
        /// Padding.
        unused_0: u32,
    }
    /// Plane that lists of asteroids are drawn on: a picture, or a face of the cube behind it.
    AsteroidPlane {
        /// Index of the viewport.
        view: u32,
        /// Number of the face; 6: the picture itself.
        face: u32,
        /// Index of its first count.
        first_count: u32,
        /// Number of groups linked to it.
        columns: u32,
    }
    /// A field of asteroids.
    AsteroidField {
        /// First row of the rotation from the field's axes to world axes; w: metres per radius step.
        world_from_field_x: [f32; 4],
        /// Second row.
        world_from_field_y: [f32; 4],
        /// Third row.
        world_from_field_z: [f32; 4],
        /// Geometric albedo.
        albedo: [f32; 3],
        /// 0: Lambert; 1: Lommel-Seeliger.
        law: u32,
        /// Scene time, in units of 2^-32 of the base period.
        time_parts: u32,
        /// First shape.
        first_shape: u32,
        /// Number of shapes.
        shape_count: u32,
        /// Kind of its first mesh.
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
        /// Kind of its finest mesh; coarser levels follow.
        first_kind: u32,
        /// Number of levels of detail.
        levels: u32,
        /// Radius of the bounding sphere, mean radii.
        bound: f32,
        /// Padding.
        unused_0: u32,
    }
    /// Picture parameters for culling and level of detail; see `src/plan/asteroids/views.rs`.
    AsteroidView {
        /// First row of the rotation from world to view axes; w: eye minus camera along world x, m.
        view_from_world_x: [f32; 4],
        /// Second row.
        view_from_world_y: [f32; 4],
        /// Third row.
        view_from_world_z: [f32; 4],
        /// Normals of the planes of the left and right edges: x and z of each.
        edges_x: [f32; 4],
        /// Normals of the planes of the lower and upper edges: y and z of each.
        edges_y: [f32; 4],
        /// Sine of the half-angle of the cone that contains the picture.
        cone_sine: f32,
        /// Cosine of the half-angle.
        cone_cosine: f32,
        /// 0: flat; 1: round; 2: longitude and latitude.
        kind: u32,
        /// Index of the first entry of its table.
        first_entry: u32,
        /// Distance between the eyes, m.
        impostor_eyes: f32,
        /// Linear coefficient of the distance at which impostors begin; negative: no impostors.
        impostor_linear: f32,
        /// Exponent of that distance.
        impostor_exponent: f32,
        /// Quality factor on distances.
        quality: f32,
        /// 1: use only the finest mesh.
        finest_only: u32,
        /// View whose class decisions apply to this view: the other eye's, or this view itself.
        class_view: u32,
        /// Padding.
        unused_0: u32,
        /// Padding.
        unused_1: u32,
    }
    /// Entry of a list of asteroids.
    AsteroidEntry {
        /// Index in the buffer of all fields.
        instance: u32,
        /// Its group; bit 31: beyond the seam.
        item: u32,
        /// Cross-fade; see `faded` in `shaders/asteroids/listed.wgsl`.
        fade: f32,
    }
    /// Parameters of asteroid culling.
    AsteroidCullParameters {
        /// Number of groups.
        items: u32,
        /// Workgroups per row of the dispatch.
        row: u32,
        /// Number of lists per plane.
        kinds: u32,
        /// Number of lists.
        buckets: u32,
        /// Capacity of the lists, entries.
        capacity: u32,
        /// Number of lists per plane that hold meshes.
        mesh_kinds: u32,
        /// Workgroups per row of the dispatch if impostors are splatted; 0: they are drawn as squares.
        splat_row: u32,
        /// Impostors per workgroup if they are splatted.
        splats_per_workgroup: u32,
    }
    /// Band of samples that impostors are splatted onto at once; see `shaders/asteroids/impostors/splat_band.wgsl`.
    SplatBand {
        /// Samples in a row.
        width: u32,
        /// First row.
        first_row: u32,
        /// Number of rows.
        rows: u32,
        /// Blocks of samples per row.
        blocks: u32,
    }
    /// Target of splatted impostors; see `shaders/asteroids/impostors/footprint.wgsl`.
    SplatTarget {
        /// Band of samples.
        band: SplatBand,
        /// Index of the first word of the list's arguments.
        arguments: u32,
        /// 0: find depths; 1: find owners; 2: light samples.
        stage: u32,
        /// Quality factor on distances of detail.
        quality: f32,
        /// Greatest angle between the view direction and the direction of the nearest tile, rad.
        tile_error_rad: f32,
    }
    /// Parameters of the pass over asteroids drawn as points.
    AsteroidPointParameters {
        /// Fixed-point units per lux.
        units_per_lx: f32,
        /// Number of groups.
        items: u32,
        /// Workgroups per row of the dispatch.
        row: u32,
        /// Number of tiles of the batch.
        tiles: u32,
    }
    /// Target that asteroids are drawn onto; see `shaders/asteroids/listed.wgsl`.
    AsteroidTarget {
        /// Viewport of the picture or of the cube face.
        viewport: Viewport,
        /// Eye minus camera, world axes, m.
        eye: [f32; 3],
        /// Distance at depth 1, m.
        near: f32,
        /// First row of the window, pixels.
        first_row: u32,
        /// Number of rows of the window, pixels.
        rows: u32,
        /// Samples along each side of a pixel.
        samples: u32,
        /// Index of the plane.
        plane: u32,
        /// Units of the target per cd/m^2.
        units_per_cd_m2: f32,
        /// Number of lists per plane.
        kinds: u32,
        /// Padding.
        unused_0: u32,
        /// Padding.
        unused_1: u32,
    }
    /// List that a draw reads.
    AsteroidBucket {
        /// Kind of the list.
        kind: u32,
        /// Padding.
        unused_0: u32,
        /// Padding.
        unused_1: u32,
        /// Padding.
        unused_2: u32,
    }
    /// Target of the impostor probe; see `shaders/asteroids/impostors/given.wgsl`.
    GivenTarget {
        /// Viewport of the picture.
        viewport: Viewport,
        /// Distance at depth 1, m.
        near: f32,
        /// Padding.
        unused_0: u32,
        /// Padding.
        unused_1: u32,
        /// Padding.
        unused_2: u32,
    }
    /// Single asteroid of the impostor probe.
    GivenAsteroid {
        /// Centre relative to the eye, view axes, m.
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
        /// Unit vector towards the sun, view axes.
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
        /// Number of mip levels.
        levels: u32,
        /// Albedo factor that is stored as 1.
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
        /// Albedo factor that is stored as 1.
        albedo_scale: f32,
    }
    /// Tile of the block.
    ImpostorBakeTile {
        /// Right direction of the picture, shape's axes.
        right: [f32; 3],
        /// Padding.
        unused_0: f32,
        /// Up direction of the picture.
        up: [f32; 3],
        /// Padding.
        unused_1: f32,
        /// Direction towards the eye.
        direction: [f32; 3],
        /// Padding.
        unused_2: f32,
        /// Centre on the block, samples.
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
