//! Constants shared by Rust and the shaders, in tables that shaders import as `constants/...`. A constant that belongs to `plan`, `photometry` or the
//! catalogue is defined there; this file only refers to it.

use crate::gpu::shared_constants;
use crate::view::projection::Face;

/// For every face of a cube, one of its axes: the viewing direction (0) or the up direction (1).
const fn face_axes(axis: usize) -> [[f32; 3]; 6] {
    let mut axes = [[0.0; 3]; 6];
    let mut face = 0;
    while face < 6 {
        let direction = Face::ALL[face].forward_and_up()[axis];
        axes[face] = [direction.x as f32, direction.y as f32, direction.z as f32];
        face += 1;
    }
    axes
}

const fn f32s(values: [f64; 5]) -> [f32; 5] {
    let [a, b, c, d, e] = values;
    [a as f32, b as f32, c as f32, d as f32, e as f32]
}

/// Returns the zones of Saturn's rings: outer radius, optical depth, albedo.
const fn ring_zones() -> [[f32; 3]; 4] {
    let mut zones = [[0.0; 3]; 4];
    let mut zone = 0;
    while zone < 4 {
        let source = crate::photometry::rings::ZONES[zone];
        zones[zone] = [source.outer as f32, source.depth as f32, source.albedo as f32];
        zone += 1;
    }
    zones
}

shared_constants! {
    /// Units of length.
    mod units {
        /// Metres in a parsec.
        PARSEC_M: f32 = crate::units::PARSEC_M as f32;
    }
    /// Linear Rec. 709.
    mod rec709 {
        /// Weights of red, green and blue in the luminance.
        LUMINANCE_WEIGHTS: [f32; 3] = {
            let [r, g, b] = crate::photometry::rec709::LUMINANCE_WEIGHTS;
            [r as f32, g as f32, b as f32]
        };
    }
    /// Lengths of lists in uniform buffers.
    mod frame_lists {
        /// Maximum number of viewports of a frame.
        MAX_VIEWPORTS: u32 = crate::plan::stars::cull::MAX_VIEWPORTS as u32;
        /// Maximum number of tiles of a batch.
        MAX_TILES: u32 = crate::plan::tiles::MAX_TILES as u32;
        /// Maximum number of asteroid fields.
        MAX_FIELDS: u32 = crate::plan::asteroids::kinds::MAX_FIELDS as u32;
        /// Maximum number of pictures and faces that asteroids are drawn on.
        MAX_PLANES: u32 = crate::plan::asteroids::kinds::MAX_PLANES as u32;
    }
    /// Projections of a viewport.
    mod projections {
        KIND_PERSPECTIVE: u32 = 0;
        KIND_CUBE_FACE: u32 = 1;
        KIND_EQUIDISTANT: u32 = 2;
        KIND_EQUISOLID: u32 = 3;
        KIND_ORTHOGRAPHIC: u32 = 4;
        KIND_STEREOGRAPHIC: u32 = 5;
        KIND_EQUIRECTANGULAR: u32 = 6;
    }
    /// Projection tables in a texture.
    mod tables {
        /// Groups of four words in a row of the texture: a power of two.
        TABLE_COLUMNS: u32 = crate::plan::tables::TABLE_COLUMNS;
    }
    /// Tabulated projections.
    mod tabulated {
        KIND_TABULATED: u32 = 7;
        /// Groups of words before the directions of a table.
        TABLE_HEADER: u32 = crate::view::projection::HEADER;
        /// Nodes beyond the picture on each side.
        TABLE_FRINGE: i32 = crate::view::projection::FRINGE as i32;
        /// Value of the start node of a search if there is none.
        NO_START: u32 = crate::view::projection::NO_START;
        /// Bit in a cell's word: the word is the index of a patch.
        PATCH_BIT: u32 = crate::view::projection::PATCH_BIT;
        /// Intervals along a side of a patch.
        PATCH_STEPS: u32 = crate::view::projection::PATCH_STEPS;
        /// Maximum number of steps of the search.
        MOST_STEPS: u32 = crate::view::projection::MOST_STEPS;
        /// Maximum step length, pixels.
        LONGEST_STEP_PX: f32 = crate::view::projection::LONGEST_STEP_PX;
        /// After a step shorter than this, directions are taken from the cubic, pixels.
        NEAR_PX: f32 = crate::view::projection::NEAR_PX;
        /// The search ends after a step shorter than this, pixels.
        DONE_PX: f32 = crate::view::projection::DONE_PX;
    }
    /// Diffuse light, which does not come from individual stars.
    mod diffuse {
        /// Side of a block of texels that share one roughness value.
        ROUGHNESS_BLOCK: u32 = crate::catalogue::diffuse::ROUGHNESS_BLOCK;
        /// hc / (lambda k T) of R, G and B for a black body at the mean temperature.
        DIFFUSE_EXPONENTS: [f32; 3] = {
            let [r, g, b] = crate::catalogue::diffuse::EXPONENTS_AT_REST;
            [r as f32, g as f32, b as f32]
        };
    }
    /// Axes of the faces of a cube, by face number.
    mod faces {
        /// Viewing direction of each face.
        FACE_FORWARD: [[f32; 3]; 6] = super::face_axes(0);
        /// Up direction of each face.
        FACE_UP: [[f32; 3]; 6] = super::face_axes(1);
    }
    /// Constants of the passes over pixels. All pixels of a block of COLUMNS by ROWS share a flag.
    mod pixel_grid {
        COLUMNS: u32 = 64;
        ROWS: u32 = 16;
        /// Columns per workgroup. They are few, so that one decision suits all pixels of a workgroup.
        BLOCK_COLUMNS: u32 = 8;
    }
    /// Plain blocks of display images.
    mod plain_blocks {
        /// Side of a block, pixels.
        PLAIN_BLOCK: u32 = crate::plan::plain_blocks::PLAIN_BLOCK_PX;
        /// Flag of a block: its pixels are computed one by one.
        BLOCK_IS_MIXED: u32 = 1;
        /// Flag of a block: the light of the air is computed for each pixel.
        BLOCK_HAS_STEEP_AIR: u32 = 2;
        /// Flag of a block: it is outside of a round picture.
        BLOCK_IS_OUTSIDE: u32 = 4;
        /// Flag of a mixed block: the light that bodies scatter in the eye is interpolated.
        BLOCK_HAS_SMOOTH_GLARE: u32 = 8;
        /// First bit of the last field in the flags of a block. The field is the number of times that the spacing of the grid must be halved to read
        /// the map of diffuse light. 0: the grid is fine enough.
        BLOCK_HALVINGS_SHIFT: u32 = 4;
        /// Greatest number of halvings: every row of pixels reads the map.
        MOST_HALVINGS: u32 = 3;
        /// Entries of a cell of the grid: its place in the map of faint light.
        SKY_CELL_ENTRIES: u32 = 3;
        /// Marks a part that a frame does not have; used instead of the index of its first point.
        NO_POINTS: u32 = u32::MAX;
    }
    /// Workgroup sizes: the number of invocations of linear workgroups, or the number along each side of square ones.
    mod workgroups {
        /// Passes over a catalogue, star by star.
        CATALOGUE_THREADS: u32 = 64;
        /// Pass over points of light other than stars.
        POINT_THREADS: u32 = 64;
        /// Projection probe.
        PROBE_THREADS: u32 = 64;
        /// Rays towards bodies.
        RAY_SIDE: u32 = 8;
        /// Rows per invocation of the air pass.
        AIR_ROWS: u32 = 8;
        /// Passes over the texels of a glare pyramid.
        PYRAMID_SIDE: u32 = 8;
        /// Passes over the points of a glare map.
        MAP_SIDE: u32 = 8;
        /// Invocations along a column of points of a glare map. Each computes four points.
        MAP_ROWS: u32 = 2;
        /// Pass over the points of a veil.
        VEIL_SIDE: u32 = 8;
        /// Squares in a row for which one workgroup finds sprites.
        SPRITE_SQUARES: u32 = 8;
    }
    /// Indices in the buffer of counters.
    mod counters {
        /// Number of overflowed sums.
        COUNTER_OVERFLOWS: u32 = 0;
        /// First of the counters of drawn stars, one per view.
        FIRST_VIEW_COUNTER: u32 = 1;
    }
    /// Fixed-point sums.
    mod fixed_point {
        /// Smallest sum that a channel cannot hold, units.
        CHANNEL_UNITS: f32 = (1_u64 << crate::plan::stars::range::CHANNEL_BITS) as f32;
    }
    /// Kernels of bright stars.
    mod kernels {
        /// Cut-off radius of round Gaussians, in standard deviations.
        GAUSSIAN_CUT: f32 = crate::photometry::kernel::GAUSSIAN_CUT as f32;
        /// Pixels along a side of the kernel on the image plane.
        PLANE_GAUSSIAN_PIXELS: i32 = crate::photometry::kernel::BRIGHT_KERNEL_PIXELS as i32;
        /// Brightness ratio over which the B-spline is blended out: from the faintest star with this kernel to the faintest whose kernel has no
        /// B-spline part.
        PLANE_GAUSSIAN_GROWTH: f32 = crate::photometry::kernel::BRIGHT_KERNEL_GROWTH as f32;
    }
    /// Pieces of the map of faint light.
    mod sky_pieces {
        /// Words of a piece before its texels.
        PIECE_WORDS: u32 = crate::plan::smooth_light::PIECE_WORDS;
        /// Parameter that makes pieces nearly equally large.
        PIECE_EVENNESS: f32 = crate::plan::smooth_light::pieces::PIECE_EVENNESS as f32;
    }
    /// Forms of the stars of an item.
    mod star_forms {
        /// Offsets in pc from the origin of a chunk.
        STARS_IN_SPACE: u32 = 0;
        /// Unit vectors: the position of the eye does not matter.
        STARS_AT_INFINITY: u32 = 1;
        /// Stars of a page of a deep store.
        STARS_OF_PAGE: u32 = 2;
        /// Composite stars of a page.
        COMPOSITES_OF_PAGE: u32 = 3;
        /// Exponent of two of the unit of a composite star's light at exponent 0, lx.
        COMPOSITE_UNIT_LOG2: i32 = crate::catalogue::deep::composite::UNIT_LOG2;
    }
    /// Light word of a packed star.
    mod star_light {
        /// Number of temperature bits, which are the lowest bits.
        TEMPERATURE_BITS: u32 = crate::catalogue::packed::TEMPERATURE_STEPS.ilog2();
        /// Last temperature step; also the bit mask.
        LAST_TEMPERATURE_STEP: u32 = crate::catalogue::packed::TEMPERATURE_STEPS - 1;
        /// f32 exponent that corresponds to exponent 0 of the illuminance.
        EXPONENT_BIAS: u32 = crate::catalogue::packed::EXPONENT_BIAS;
    }
    /// Scale of temperatures.
    mod temperatures {
        /// Temperature of step 0, kelvin.
        COLDEST_K: f32 = crate::catalogue::packed::MIN_TEMPERATURE_K as f32;
        /// Number of the last step of stars at rest.
        LAST_STEP: f32 = (crate::catalogue::packed::TEMPERATURE_STEPS - 1) as f32;
        /// Number of octaves between the two ends of the scale.
        TEMPERATURE_OCTAVES: f32 = crate::catalogue::packed::TEMPERATURE_OCTAVES as f32;
    }
    /// Table of colours that moving observers see.
    mod shifted_temperatures {
        /// Number of entries.
        TABLE_STEPS: i32 = crate::plan::stars::travel::TABLE_STEPS as i32;
        /// Step of its coldest entry.
        COLDEST_STEP: i32 = -(crate::plan::stars::travel::SHIFTED_STEPS as i32);
        /// Steps per octave of temperature.
        STEPS_PER_OCTAVE: f32 = ((crate::catalogue::packed::TEMPERATURE_STEPS - 1) as f64
            / crate::catalogue::packed::TEMPERATURE_OCTAVES) as f32;
    }
    /// Law by which the size and light of a billboard follow from the star's brightness.
    mod billboards {
        LAW_POINT: u32 = 0;
        LAW_SMOOTH_POINT: u32 = 1;
        LAW_CONSTANT: u32 = 2;
        LAW_SCALED: u32 = 3;
        LAW_GLARE: u32 = 4;
        LAW_GAUSSIAN: u32 = 5;
        LAW_SCREEN: u32 = 6;
        LAW_PSF: u32 = 7;
    }
    /// Procedural sky of cells.
    mod cell_sky {
        /// A star's position deviates from the centre of its cell by at most this fraction of the cell's half side.
        CELL_SKY_JITTER: f32 = crate::plan::stars::cell_sky::JITTER as f32;
        /// Brightness of the faintest star; the brightest has 1.
        CELL_SKY_FAINTEST: f32 = crate::plan::stars::cell_sky::FAINTEST as f32;
        /// Share of cells that contain a star, far from the galactic equator.
        CELL_SKY_EVEN_DENSITY: f32 = crate::plan::stars::cell_sky::EVEN_DENSITY as f32;
        /// Sine of the latitude at which the density of the band drops to 1/e.
        CELL_SKY_BAND_SINE: f32 = crate::plan::stars::cell_sky::BAND_SINE as f32;
    }
    /// Lines and text over display images.
    mod overlay {
        /// Side of a block of pixels.
        OVERLAY_BLOCK_PX: u32 = crate::plan::overlay::blocks::BLOCK_PX;
        SHAPE_LINE: u32 = 0;
        SHAPE_BOX: u32 = 1;
        SHAPE_CHECKERS: u32 = 2;
        SHAPE_GLYPH: u32 = 3;
        SHAPE_PICTURE: u32 = 4;
        /// Inverse distance of shapes that no surface hides, 1/m.
        NEAREST: f32 = 3e38;
    }
    /// Laws of reflection.
    mod reflection {
        LAW_LAMBERT: u32 = 0;
        LAW_LOMMEL_SEELIGER: u32 = 1;
    }
    /// Atmospheric refraction.
    mod refraction {
        /// Coefficients as a function of the sine of the apparent altitude.
        REFRACTION_OF_SEEN: [f32; 5] = super::f32s(crate::observer::refraction::OF_SEEN);
        /// Coefficients as a function of the sine of the true altitude (without air).
        REFRACTION_OF_ARRIVING: [f32; 5] = super::f32s(crate::observer::refraction::OF_ARRIVING);
        /// Lowest sines; below them refraction is constant.
        REFRACTION_LOWEST_SEEN: f32 = crate::observer::refraction::LOWEST_SEEN as f32;
        REFRACTION_LOWEST_ARRIVING: f32 = crate::observer::refraction::LOWEST_ARRIVING as f32;
        /// Sine below which refraction is zero, and sine above which refraction is not reduced.
        REFRACTION_GONE: f32 = crate::observer::refraction::FADING[0] as f32;
        REFRACTION_WHOLE: f32 = crate::observer::refraction::FADING[1] as f32;
    }
    /// Air and ground.
    mod air {
        /// Number of altitudes of a horizon.
        HORIZON_STEPS: u32 = crate::scene::surroundings::HORIZON_STEPS as u32;
        /// Altitude nodes of a table of sky light.
        SKY_ALTITUDES: u32 = crate::photometry::sky_light::TABLE_NODES[0] as u32;
        /// Azimuth nodes, measured from the source.
        SKY_AZIMUTHS: u32 = crate::photometry::sky_light::TABLE_NODES[1] as u32;
        /// Sine of the altitude below which the light added by the air is too curved for interpolation.
        GRID_FROM: f32 = crate::plan::GRID_FROM_SINE as f32;
        /// Asymmetry of the phase function of aerosol.
        AEROSOL_ASYMMETRY: f32 = crate::photometry::sky_light::ASYMMETRY as f32;
    }
    /// Bodies.
    mod bodies {
        /// Texture index of a body without a texture.
        NO_TEXTURE: u32 = u32::MAX;
        /// A body without drawn surroundings.
        AROUND_NOTHING: u32 = 0;
        /// A body with the rings of Saturn.
        AROUND_RINGS: u32 = 1;
        /// A sun with a corona.
        AROUND_CORONA: u32 = 2;
    }
    /// Solar corona.
    mod corona {
        /// Luminance of its terms at the limb, relative to the mean luminance of the disc. They fall with the powers
        /// 2.5, 7 and 17 of the distance.
        CORONA_PARTS: [f32; 3] = {
            let [[a, _], [b, _], [c, _]] = crate::photometry::corona::TERMS;
            [a as f32, b as f32, c as f32]
        };
        /// Distance at which the fade-out begins, radii.
        CORONA_FADES: f32 = crate::photometry::corona::FADES as f32;
        /// Outer end, radii.
        CORONA_OUTER: f32 = crate::photometry::corona::OUTER as f32;
    }
    /// Saturn's rings.
    mod rings {
        /// Inner radius, in equatorial radii.
        RING_INNER: f32 = crate::photometry::rings::INNER as f32;
        /// Outer radius, in equatorial radii.
        RING_OUTER: f32 = crate::photometry::rings::OUTER as f32;
        /// Outer radius, optical depth and albedo of each zone.
        RING_ZONES: [[f32; 3]; 4] = super::ring_zones();
    }
    /// Display of light.
    mod display {
        OPERATOR_FILMIC: u32 = 0;
        OPERATOR_SRGB: u32 = 1;
        OPERATOR_REINHARD: u32 = 2;
        OPERATOR_ACES: u32 = 3;
        OPERATOR_CALIBRATED: u32 = 4;
        /// Limit of displayed light, cd/m^2 and units of display white. With it, sums of three channels stay finite.
        BRIGHTEST: f32 = crate::photometry::tone_map::BRIGHTEST as f32;
    }
    /// Glare map.
    mod glare_map {
        /// Width of the rim of extra points around each face at which a level is computed. Sharpening leaves half of it.
        RIM: u32 = 2;
    }
    /// Grid of glare sprites.
    mod glare_sprites {
        /// Pixels along a side of a block.
        BLOCK_SIDE: u32 = 8;
        /// Blocks along a side of a square.
        SQUARE_BLOCKS: u32 = 4;
    }
    /// Extended sources among the sources of one eye.
    mod extended_sources {
        /// Flag of an extended source.
        IS_EXTENDED: u32 = 1 << 31;
        /// Number of steps and bit mask of the fraction of its light that its softened kernel omits.
        SHARE_PARTS: u32 = 65_535;
    }
    /// Veil of single sources.
    mod veil {
        /// Value of `viewport` for sources that every viewport sees.
        EVERY_VIEWPORT: u32 = u32::MAX;
    }
    /// Groups of asteroids and their instances.
    mod asteroid_instances {
        /// Flag of a group that may contain points.
        ITEM_HOLDS_POINTS: u32 = 1;
        /// Flag of a group that may contain more than points.
        ITEM_HOLDS_SHAPES: u32 = 2;
        /// Number of words of an instance.
        INSTANCE_WORDS: u32 = (size_of::<crate::scene::asteroids::PackedAsteroid>() / 4) as u32;
        /// Largest component of a packed axis.
        AXIS_PARTS: i32 = crate::scene::asteroids::packed::AXIS_PARTS;
    }
    /// Classes of asteroids by distance, and the picture tables from which they are computed.
    mod asteroid_classes {
        VIEW_FLAT: u32 = 0;
        VIEW_ROUND: u32 = 1;
        VIEW_LONGITUDE: u32 = 2;
        /// Number of steps of a picture's table.
        TABLE_STEPS: u32 = crate::plan::asteroids::views::TABLE_STEPS as u32;
        /// Index of the first entry of the shapes, which follow the room for the tables of all pictures.
        FIRST_SHAPE: u32 =
            (crate::plan::stars::cull::MAX_VIEWPORTS * (crate::plan::asteroids::views::TABLE_STEPS + 1)) as u32;
        /// Fraction of a class's range over which it fades in.
        BAND: f32 = crate::plan::asteroids::classes::BAND as f32;
    }
    /// Culling of asteroids.
    mod asteroid_culling {
        /// Maximum number of asteroids of a group.
        GROUP: u32 = crate::scene::asteroids::GROUP as u32;
        /// Face index of a whole picture.
        WHOLE_PICTURE: u32 = crate::plan::asteroids::cpu_cull::WHOLE_PICTURE as u32;
        /// Maximum number of kinds of a field: meshes, impostors, and the count of visible asteroids.
        MAX_LOCAL: u32 = crate::plan::asteroids::kinds::MAX_SET_MESHES as u32 + 2;
        /// Fade of an asteroid that is drawn in full. Other values: w if it fades in with the share w; -w if it is drawn in the pixels outside the
        /// share w.
        WHOLE: f32 = crate::plan::asteroids::cpu_cull::WHOLE;
        /// Least absolute value of a fade, so that its sign is kept.
        LEAST_SHARE: f32 = crate::plan::asteroids::cpu_cull::LEAST_SHARE as f32;
    }
    /// Lists of asteroids.
    mod asteroid_lists {
        /// Flag of an entry that is drawn on the other side of the seam of an equirectangular picture.
        SEAM_BIT: u32 = 1 << 31;
        /// Number of vertices of an impostor's square.
        IMPOSTOR_VERTICES: u32 = 4;
    }
    /// Asteroids drawn as points.
    mod asteroid_points {
        /// Nodes along a side of the octahedral table of a shape's projected areas.
        AREA_NODES: u32 = crate::plan::asteroids::areas::AREA_NODES as u32;
    }
    /// Impostor methods.
    mod impostors {
        METHOD_EULER: u32 = 0;
        METHOD_OCTAHEDRAL: u32 = 1;
        METHOD_BLEND: u32 = 2;
        /// Number of threads that splat one impostor together.
        SPLAT_LANES: u32 = 8;
        /// Side of the blocks in which samples are stored while impostors are splatted.
        SPLAT_BLOCK: u32 = 8;
        /// Greatest number of threads of a workgroup, whose footprints fit into 16 KiB.
        SPLAT_THREADS: u32 = 32;
    }
}
