//! The structs that shaders read, with the same field names as in WGSL. `tests/cpu/shaders.rs` compares names, offsets and
//! sizes with what naga reads from the shaders.

use bytemuck::{Pod, Zeroable};

/// Describes a struct to the test that compares it with WGSL.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StructLayout {
    /// Name in WGSL.
    pub name: &'static str,
    /// Size in bytes.
    pub size: usize,
    /// Name and offset of every field.
    pub fields: Vec<(&'static str, usize)>,
}

macro_rules! gpu_structs {
    ($($(#[$doc:meta])* $name:ident { $($(#[$field_doc:meta])* $field:ident : $type:ty),+ $(,)? })+) => {
        $(
            $(#[$doc])*
            #[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
            #[repr(C)]
            pub struct $name { $($(#[$field_doc])* pub $field: $type),+ }
        )+

        /// The layout of every struct that is shared with the shaders.
        pub fn struct_layouts() -> Vec<StructLayout> {
            vec![$(StructLayout {
                name: stringify!($name),
                size: size_of::<$name>(),
                fields: vec![$((stringify!($field), std::mem::offset_of!($name, $field))),+],
            }),+]
        }
    };
}

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
        /// Number of the cube face.
        face: u32,
        /// Fisheye: radius of the rim before normalisation.
        rim: f32,
        /// pi - F/2 or cos^2(F/2).
        rim_complement: f32,
        /// 1: the picture shows the full sphere.
        full_sphere: u32,
        /// 1: nine points per pixel for the solid angle.
        quadrature: u32,
        /// Fainter stars take the tent, lx.
        tent_below_lx: f32,
        /// Index of the view.
        view: u32,
        /// Brighter stars take the Gaussian, lx.
        gaussian_from_lx: f32,
        /// Its standard deviation as an angle, rad.
        gaussian_sigma_rad: f32,
        /// The same in pixels.
        gaussian_sigma_px: f32,
        /// How far it reaches over a border, pixels.
        gaussian_reach_px: f32,
        /// 1: the Gaussian lies on the image plane; 0: it is round in view space.
        gaussian_on_plane: u32,
        /// Padding.
        unused_0: u32,
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
    /// A run of stars for one workgroup; see `shaders/stars/splat.wgsl`.
    StarItem {
        /// Chunk origin minus camera, pc.
        origin: [f32; 3],
        /// First star in its buffer.
        first: u32,
        /// Number of stars.
        count: u32,
        /// Bit set of tiles.
        tiles: u32,
        /// Number of the first star in the scene.
        first_number: u32,
        /// 1: directions instead of places.
        at_infinity: u32,
    }
    /// How the camera moves; see `shaders/stars/relativity.wgsl`. All zero: it rests.
    Traveller {
        /// Unit vector of the velocity, world axes.
        direction: [f32; 3],
        /// Lorentz factor.
        gamma: f32,
        /// Lorentz factor times speed; 0 at rest.
        gamma_beta: f32,
        /// Doppler factor straight behind.
        doppler_behind: f32,
        /// Padding.
        unused_0: u32,
        /// Padding.
        unused_1: u32,
    }
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
    }
    /// Light that falls on a body; see `shaders/bodies/rays.wgsl`.
    BodySun {
        /// Unit vector towards it, view axes.
        direction: [f32; 3],
        /// Padding.
        unused_0: u32,
        /// Illuminance, lx.
        illuminance: [f32; 3],
        /// Padding.
        unused_1: u32,
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
    /// Parameters of the star pass.
    StarParameters {
        /// Fixed-point units per lux.
        units_per_lx: f32,
        /// Fainter stars are not drawn, lx.
        faintest_lx: f32,
        /// Stars as bright or brighter are not drawn, lx.
        brightest_lx: f32,
        /// Number of items.
        item_count: u32,
        /// Workgroups per row of the dispatch.
        items_per_row: u32,
        /// Padding.
        unused_0: u32,
        /// Padding.
        unused_1: u32,
        /// Padding.
        unused_2: u32,
        /// How the camera moves.
        traveller: Traveller,
    }
    /// A star as the published methods read it; see `shaders/stars/catalogue_star.wgsl`.
    CatalogueStar {
        /// ICRS, from the barycentre, pc.
        x: f32,
        /// See `x`.
        y: f32,
        /// See `x`.
        z: f32,
        /// Absolute V magnitude.
        absolute_magnitude: f32,
        /// Effective temperature, K.
        temperature: f32,
    }
    /// Parameters of the published passes over the whole catalogue.
    CatalogueParameters {
        /// Place of the camera, ICRS, pc.
        camera: [f32; 3],
        /// Stars of the buffer.
        star_count: u32,
        /// Fainter stars are not drawn, lx.
        faintest_lx: f32,
        /// The tile drawn into; where there are no tiles, the viewport.
        tile: u32,
        /// Threads per row of the dispatch.
        row_threads: u32,
        /// Padding.
        unused_0: u32,
    }
    /// Parameters of the methods that blend; see `shaders/stars/billboards/billboard.wgsl`.
    BillboardParameters {
        /// First row of the rotation from the axes of the plane to those of the view.
        view_from_plane_x: [f32; 4],
        /// Second row.
        view_from_plane_y: [f32; 4],
        /// Third row.
        view_from_plane_z: [f32; 4],
        /// Place of the camera, ICRS, pc.
        camera: [f32; 3],
        /// Fainter stars are not drawn, lx.
        faintest_lx: f32,
        /// Radius of discs and sprites, rad.
        radius_rad: f32,
        /// Their solid angle, sr.
        solid_angle_sr: f32,
        /// Stars of this magnitude or brighter are drawn largest.
        brightest_magnitude: f32,
        /// Stars of this magnitude or fainter are drawn smallest.
        faintest_magnitude: f32,
        /// Half of the side of a square on the screen, pixels.
        half_side_px: f32,
        /// Faintest magnitude that is seen.
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
        /// Half of the angle of the point-spread function, rad.
        half_width_rad: f32,
        /// Angle of a texel, rad.
        texel_rad: f32,
        /// Half of the angle that a star is cropped to, rad per sqrt(lx).
        crop_rad: f32,
        /// The least such angle, rad.
        least_crop_rad: f32,
        /// Added to the square of the angle that the stored function is divided by, rad^2.
        softening_rad2: f32,
    }
    /// Parameters of the published rasteriser on culled stars.
    PackedParameters {
        /// Fainter stars are not drawn, lx.
        faintest_lx: f32,
        /// Number of items.
        item_count: u32,
        /// Workgroups per row of the dispatch.
        items_per_row: u32,
        /// Padding.
        unused_0: u32,
    }
    /// Parameters of the resolve pass of methods that leave luminance.
    LuminanceParameters {
        /// Pixels of the batch.
        plane_pixels: u32,
        /// cd/m^2 per unit of what the method left.
        scale: f32,
        /// For the source of luminance.
        source_0: u32,
        /// For the source of luminance.
        source_1: u32,
    }
    /// The procedural sky; see `shaders/stars/luminance_cell_sky.wgsl`.
    CellSkyParameters {
        /// Angle of a pixel in the middle of the view, rad.
        pixel_rad: f32,
        /// Radius of a star, such pixels.
        radius_px: f32,
        /// Cells along an edge of a cube face.
        cells: u32,
        /// Layers of stars.
        layers: u32,
        /// Seed of the sky.
        seed: u32,
        /// Padding.
        unused_0: u32,
        /// Padding.
        unused_1: u32,
        /// Padding.
        unused_2: u32,
    }
    /// The numbers of the tone mapping; see `shaders/display/encode.wgsl`.
    Display {
        /// Luminance over display white that Reinhard's operator shows white.
        white: f32,
        /// White of a calibrated display, cd/m^2.
        peak_cd_m2: f32,
        /// Its black, cd/m^2.
        black_cd_m2: f32,
        /// How much of the hue is kept where the display's range ends.
        desaturation: f32,
        /// How much dim light is seen as rods see it.
        scotopic: f32,
        /// 1: rounding is spread over neighbouring pixels.
        dither: u32,
        /// Padding.
        unused_0: u32,
        /// Padding.
        unused_1: u32,
    }
    /// Parameters of the resolve pass.
    ResolveParameters {
        /// Lux per fixed-point unit.
        lx_per_unit: f32,
        /// The same for the sums of the brightest stars; 0 without them.
        lx_per_bright_unit: f32,
        /// Display values per cd/m^2, where the display image is written by this pass.
        display_per_cd_m2: f32,
        /// Pixels of the batch.
        plane_pixels: u32,
        /// How the display image is made there.
        shown: Display,
    }
    /// Parameters of the glare pass over pixels.
    GlareParameters {
        /// Share of the light that is scattered.
        fraction: f32,
        /// Pixels of the batch.
        plane_pixels: u32,
        /// Padding.
        unused_0: u32,
        /// Padding.
        unused_1: u32,
    }
    /// A cell of the sky; see `shaders/glare/sky_cube/map_gather.wgsl`.
    GlareCell {
        /// Unit vector to the middle of its light.
        direction: [f32; 3],
        /// Padding.
        unused_0: f32,
        /// Linear Rec. 709, lx.
        light: [f32; 3],
        /// Padding.
        unused_1: f32,
    }
    /// Parameters of a level of the map of glare.
    GlareLevelParameters {
        /// Cells along an edge of a face.
        edge_cells: u32,
        /// The same of the coarser level.
        coarser_cells: u32,
        /// Square of the chord at which the kernel ends.
        end_squared: f32,
        /// Sine of that angle, or 2.
        end_sine: f32,
        /// Entries of the table per unit of a chord's square.
        entries: f32,
        /// 1 over the square of the radius of bumps, or 0.
        bump_inverse: f32,
        /// Padding.
        unused_0: u32,
        /// Padding.
        unused_1: u32,
    }
    /// Parameters of sharpening a level.
    GlareSharpenParameters {
        /// Cells along an edge of a face.
        edge_cells: u32,
        /// Where the result begins.
        first_point: u32,
        /// Padding.
        unused_0: u32,
        /// Padding.
        unused_1: u32,
    }
    /// A source that is drawn by itself; see `shaders/glare/sky_cube/sprites.wgsl`.
    GlareSprite {
        /// Unit vector, world axes.
        direction: [f32; 3],
        /// 1 over the square of the chord at which it ends.
        inverse_squared: f32,
        /// Linear Rec. 709, lx.
        light: [f32; 3],
        /// 1: it is what the map's kernel leaves.
        whole: u32,
    }
    /// Sprites of a part of the sky.
    GlareSpriteCell {
        /// Unit vector to its middle.
        direction: [f32; 3],
        /// Greatest chord to what its sprites reach.
        reach: f32,
        /// First sprite.
        first: u32,
        /// Number of sprites.
        count: u32,
        /// Padding.
        unused_0: u32,
        /// Padding.
        unused_1: u32,
    }
    /// How a viewport sees the sky that glares.
    GlareView {
        /// Coefficients of the kernel's core, 1/sr.
        core: [f32; 3],
        /// Square of the chord at which it ends.
        core_squared: f32,
        /// Greatest inverse square of a sprite.
        greatest_inverse: f32,
        /// First point of its map.
        first_point: u32,
        /// First of its own sources.
        first_near: u32,
        /// Their number.
        near_count: u32,
    }
    /// Parameters of finding and drawing sprites.
    GlareSkyParameters {
        /// Coefficients of the map's kernel, 1/sr.
        soft: [f32; 3],
        /// 1 over the square of the chord within which they hold.
        soft_inverse: f32,
        /// Cells along an edge of a face of the map.
        edge_cells: u32,
        /// Number of regions with sprites.
        regions: u32,
        /// Inverse square: its constant.
        constant: f32,
        /// Inverse square: square of the inner angle, rad^2.
        inner_squared: f32,
        /// Table: logarithm to base 2 of its first square of a chord.
        first_octave: f32,
        /// Table: entries per octave.
        entries_per_octave: f32,
        /// Table: number of entries.
        entries: u32,
        /// Words of a block's list.
        list_words: u32,
        /// Words of a square's list.
        square_words: u32,
        /// Columns of blocks.
        columns: u32,
        /// Rows of blocks.
        rows: u32,
        /// Tiles of the batch.
        tiles: u32,
        /// How sprites end.
        flatness: f32,
        /// Padding.
        unused_0: u32,
        /// Padding.
        unused_1: u32,
        /// Padding.
        unused_2: u32,
    }
    /// A source of an eye's own.
    GlareNear {
        /// Unit vector, world axes.
        direction: [f32; 3],
        /// Chord within which its parts are taken in its place; without parts the square of the chord by which it is softened.
        reach: f32,
        /// Linear Rec. 709, lx.
        light: [f32; 3],
        /// So many parts follow.
        parts: u32,
    }
    /// Parameters of the search for the brightest channel of a frame.
    GlareMaximumParameters {
        /// Pixels of the batch.
        plane_pixels: u32,
        /// Padding.
        unused_0: u32,
        /// Padding.
        unused_1: u32,
        /// Padding.
        unused_2: u32,
    }
    /// Parameters of the base of a glare pyramid.
    GlareBaseParameters {
        /// The tile in which the upper pixels lie.
        upper: Tile,
        /// The tile that goes on below, or the same again.
        lower: Tile,
        /// Pixels of the batch of the first.
        upper_plane_pixels: u32,
        /// Pixels of the batch of the second.
        lower_plane_pixels: u32,
        /// Padding.
        unused_0: u32,
        /// Padding.
        unused_1: u32,
    }
    /// Parameters of a blur of a glare pyramid.
    GlareBlurParameters {
        /// Weights of the taps: the middle one, and those on either side.
        weights: [f32; 4],
        /// Cosines of the taps' angles.
        cosines: [f32; 4],
        /// Sines of the taps' angles.
        sines: [f32; 4],
        /// Index of the viewport.
        viewport: u32,
        /// 0 or 1: the first axis or the second.
        axis: u32,
        /// Padding.
        unused_0: u32,
        /// Padding.
        unused_1: u32,
    }
    /// Parameters of the sum over the levels of a glare pyramid.
    GlareCombineParameters {
        /// Weight of level 0.
        first_weight: f32,
        /// Weight of every level relative to the one before.
        ratio: f32,
        /// Number of levels.
        levels: u32,
        /// Padding.
        unused_0: u32,
    }
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
        /// Padding.
        unused_0: u32,
        /// Padding.
        unused_1: u32,
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
    /// Parameters of the exposure pass.
    ExposureParameters {
        /// Solid angle of all pixels, sr.
        total_solid_angle_sr: f32,
        /// Lowest exposure.
        min_ev100: f32,
        /// Highest exposure.
        max_ev100: f32,
        /// Added to what the meter reads: compensation and key.
        offset_ev: f32,
        /// The exposure if `fixed`.
        fixed_ev100: f32,
        /// 1: use `fixed_ev100`.
        fixed: u32,
        /// Number of partial sums.
        partial_count: u32,
        /// Padding.
        unused_0: u32,
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
    /// Parameters of the tone-mapping pass.
    ToneMapParameters {
        /// Pixels of the batch.
        plane_pixels: u32,
        /// Padding.
        unused_0: u32,
        /// Padding.
        unused_1: u32,
        /// Padding.
        unused_2: u32,
        /// How the display image is made.
        shown: Display,
    }
    /// Parameters of the present pass, for one tile.
    PresentParameters {
        /// Pixels of the batch.
        plane_pixels: u32,
        /// The tile's first pixel in the batch.
        first_pixel: u32,
        /// Its first row in the picture.
        first_row: u32,
        /// Width of the picture, pixels.
        width: u32,
        /// How light is shown.
        shown: Display,
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
    /// How much the overlay pass draws; see `shaders/overlay/draw.wgsl`.
    OverlayParameters {
        /// Number of blocks.
        blocks: u32,
        /// Padding.
        unused_0: u32,
        /// Padding.
        unused_1: u32,
        /// Padding.
        unused_2: u32,
    }
    /// Something to draw; see `shaders/overlay/draw.wgsl`.
    OverlayItem {
        /// First end of a line, or first corner.
        begin: [f32; 2],
        /// Other end, or the corner after the last.
        end: [f32; 2],
        /// 1 over the distance at both ends, 1/m.
        nearness: [f32; 2],
        /// Of a line.
        half_width_px: f32,
        /// 0 to 1.
        opacity: f32,
        /// sRGB codes, red in the lowest byte.
        colour: u32,
        /// Items of one stroke follow each other.
        stroke: u32,
        /// Number of the shape.
        shape: u32,
        /// Of glyphs: first byte of coverage.
        first_texel: u32,
    }
    /// A block of pixels of a tile; see `shaders/overlay/draw.wgsl`.
    OverlayBlock {
        /// First column and row.
        corner: [u32; 2],
        /// Number of the tile.
        tile: u32,
        /// First of its entries.
        first_entry: u32,
        /// Number of its entries.
        entries: u32,
        /// Padding.
        unused_0: u32,
    }
}
