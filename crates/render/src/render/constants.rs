//! Constants that shaders and Rust share, in tables that shaders import as `constants/...`. What belongs to a rule of
//! `plan`, `photometry` or the catalogue stands there, and is only named here.

use crate::gpu::shared_constants;
use crate::view::projection::Face;

/// Axis `axis` of every face of a cube: 0, where it looks; 1, up.
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

/// The zones of Saturn's rings: outer radius, depth, albedo.
const fn ring_zones() -> [[f32; 3]; 4] {
    let mut zones = [[0.0; 3]; 4];
    let mut zone = 0;
    while zone < 4 {
        let of = crate::photometry::rings::ZONES[zone];
        zones[zone] = [of.outer as f32, of.depth as f32, of.albedo as f32];
        zone += 1;
    }
    zones
}

shared_constants! {
    /// Lengths.
    mod units {
        /// Metres in a parsec.
        PARSEC_M: f32 = crate::units::PARSEC_M as f32;
    }
    /// Linear Rec. 709.
    mod rec709 {
        /// Luminance of red, green and blue.
        LUMINANCE_WEIGHTS: [f32; 3] = {
            let [r, g, b] = crate::photometry::rec709::LUMINANCE_WEIGHTS;
            [r as f32, g as f32, b as f32]
        };
    }
    /// Kinds of projections in a viewport.
    mod projections {
        KIND_PERSPECTIVE: u32 = 0;
        KIND_CUBE_FACE: u32 = 1;
        KIND_EQUIDISTANT: u32 = 2;
        KIND_EQUISOLID: u32 = 3;
        KIND_ORTHOGRAPHIC: u32 = 4;
        KIND_STEREOGRAPHIC: u32 = 5;
        KIND_EQUIRECTANGULAR: u32 = 6;
    }
    /// Tables of tabulated projections in several buffers.
    mod tables {
        /// Set in the number of a group of words of the second buffer.
        SECOND_TABLE_BUFFER: u32 = crate::render::tabulated::SECOND_BUFFER;
    }
    /// Tabulated projections.
    mod tabulated {
        KIND_TABULATED: u32 = 7;
        /// Groups of words before a table's directions.
        TABLE_HEADER: u32 = crate::view::projection::HEADER;
        /// Nodes around the picture on every side.
        TABLE_FRINGE: i32 = crate::view::projection::FRINGE as i32;
        /// In place of a node at which the search begins: there is none.
        NO_START: u32 = crate::view::projection::NO_START;
        /// Set in a cell's word that names a patch.
        PATCH_BIT: u32 = crate::view::projection::PATCH_BIT;
        /// Intervals along a side of a patch.
        PATCH_STEPS: u32 = crate::view::projection::PATCH_STEPS;
        /// Steps of the search, at most.
        MOST_STEPS: u32 = crate::view::projection::MOST_STEPS;
        /// The longest step, pixels.
        LONGEST_STEP_PX: f32 = crate::view::projection::LONGEST_STEP_PX;
        /// After a shorter step directions are taken from the cubic, pixels.
        NEAR_PX: f32 = crate::view::projection::NEAR_PX;
        /// After a shorter step the place is found, pixels.
        DONE_PX: f32 = crate::view::projection::DONE_PX;
    }
    /// Light of no single star.
    mod diffuse {
        /// Side of a block of texels whose roughness is told together.
        ROUGHNESS_BLOCK: u32 = crate::catalogue::diffuse::ROUGHNESS_BLOCK;
        /// hc / (lambda k T) of R, G and B for a black body of its mean temperature.
        DIFFUSE_EXPONENTS: [f32; 3] = {
            let [r, g, b] = crate::catalogue::diffuse::EXPONENTS_AT_REST;
            [r as f32, g as f32, b as f32]
        };
    }
    /// Axes of the faces of a cube, by their numbers.
    mod faces {
        /// Where a face looks.
        FACE_FORWARD: [[f32; 3]; 6] = super::face_axes(0);
        /// Upwards in its picture.
        FACE_UP: [[f32; 3]; 6] = super::face_axes(1);
    }
    /// Pixels of one workgroup of the passes over pixels.
    mod pixel_grid {
        COLUMNS: u32 = 64;
        ROWS: u32 = 16;
    }
    /// Sizes of workgroups: invocations of those in a row, or along each side of square ones.
    mod workgroups {
        /// Of the passes over a catalogue, star by star.
        CATALOGUE_THREADS: u32 = 64;
        /// Of the pass over points of light that are no stars.
        POINT_THREADS: u32 = 64;
        /// Of the probe of projections.
        PROBE_THREADS: u32 = 64;
        /// Of the rays towards bodies.
        RAY_SIDE: u32 = 8;
        /// Rows that an invocation of the pass of air takes.
        AIR_ROWS: u32 = 8;
        /// Of the passes over the texels of a glare pyramid.
        PYRAMID_SIDE: u32 = 8;
        /// Of the passes over the points of a map of glare.
        MAP_SIDE: u32 = 8;
        /// Of the pass over the points of a veil.
        VEIL_SIDE: u32 = 8;
        /// Squares of a row that one workgroup finds sprites for.
        SPRITE_SQUARES: u32 = 8;
        /// Of the filter of an atlas.
        FILTER_SIDE: u32 = 8;
    }
    /// Places in the buffer of counters.
    mod counters {
        /// Sums that overflowed.
        COUNTER_OVERFLOWS: u32 = 0;
        /// First of the counters of stars drawn, one per view.
        FIRST_VIEW_COUNTER: u32 = 1;
    }
    /// Sums in fixed point.
    mod fixed_point {
        /// What a channel cannot hold any more, units.
        CHANNEL_UNITS: f32 = (1_u64 << crate::plan::stars::range::CHANNEL_BITS) as f32;
    }
    /// The kernels of bright stars.
    mod kernels {
        /// Where round Gaussians are cut off, in standard deviations.
        GAUSSIAN_CUT: f32 = crate::photometry::kernel::GAUSSIAN_CUT as f32;
        /// Pixels along a side of the kernel on the image plane.
        PLANE_GAUSSIAN_PIXELS: i32 = crate::photometry::kernel::BRIGHT_KERNEL_PIXELS as i32;
        /// How many times brighter than the first star that takes it a star is that has nothing of the B-spline left.
        PLANE_GAUSSIAN_GROWTH: f32 = crate::photometry::kernel::BRIGHT_KERNEL_GROWTH as f32;
    }
    /// The word of light of a packed star.
    mod star_light {
        /// Bits of its temperature, which are the lowest ones.
        TEMPERATURE_BITS: u32 = crate::catalogue::packed::TEMPERATURE_STEPS.ilog2();
        /// The temperature's last step, and its mask.
        LAST_TEMPERATURE_STEP: u32 = crate::catalogue::packed::TEMPERATURE_STEPS - 1;
        /// Exponent of f32 that the exponent 0 of its illuminance stands for.
        EXPONENT_BIAS: u32 = crate::catalogue::packed::EXPONENT_BIAS;
    }
    /// The scale of temperatures.
    mod temperatures {
        /// Temperature of step 0, kelvin.
        COLDEST_K: f32 = crate::catalogue::packed::MIN_TEMPERATURE_K as f32;
        /// Number of the last step of stars at rest.
        LAST_STEP: f32 = (crate::catalogue::packed::TEMPERATURE_STEPS - 1) as f32;
        /// Octaves between the two ends.
        TEMPERATURE_OCTAVES: f32 = crate::catalogue::packed::TEMPERATURE_OCTAVES as f32;
    }
    /// The table of colours that moving observers see.
    mod shifted_temperatures {
        /// Its entries.
        TABLE_STEPS: i32 = crate::plan::stars::travel::TABLE_STEPS as i32;
        /// Its coldest step.
        COLDEST_STEP: i32 = -(crate::plan::stars::travel::SHIFTED_STEPS as i32);
        /// Steps per octave of temperature.
        STEPS_PER_OCTAVE: f32 = ((crate::catalogue::packed::TEMPERATURE_STEPS - 1) as f64
            / crate::catalogue::packed::TEMPERATURE_OCTAVES) as f32;
    }
    /// How size and light of billboards follow from a star's brightness.
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
    /// The procedural sky.
    mod cell_sky {
        /// A star's place lies within this part of the cell's half side from the cell's middle.
        CELL_SKY_JITTER: f32 = crate::plan::stars::cell_sky::JITTER as f32;
        /// Faintest star; the brightest is 1.
        CELL_SKY_FAINTEST: f32 = crate::plan::stars::cell_sky::FAINTEST as f32;
        /// Share of the cells that have a star far from the galactic equator.
        CELL_SKY_EVEN_DENSITY: f32 = crate::plan::stars::cell_sky::EVEN_DENSITY as f32;
        /// Sine of the latitude at which the band has sunk to 1/e.
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
        /// Nearness of what nothing hides, 1/m.
        NEAREST: f32 = 3e38;
    }
    /// How surfaces reflect.
    mod reflection {
        LAW_LAMBERT: u32 = 0;
        LAW_LOMMEL_SEELIGER: u32 = 1;
    }
    /// Refraction.
    mod refraction {
        /// Coefficients by the sine of the altitude as it is seen.
        REFRACTION_OF_SEEN: [f32; 5] = super::f32s(crate::observer::refraction::OF_SEEN);
        /// The same by that without air.
        REFRACTION_OF_ARRIVING: [f32; 5] = super::f32s(crate::observer::refraction::OF_ARRIVING);
        /// Below these sines as at them.
        REFRACTION_LOWEST_SEEN: f32 = crate::observer::refraction::LOWEST_SEEN as f32;
        REFRACTION_LOWEST_ARRIVING: f32 = crate::observer::refraction::LOWEST_ARRIVING as f32;
        /// Sine at which it has faded away, and from which on it does not fade.
        REFRACTION_GONE: f32 = crate::observer::refraction::FADING[0] as f32;
        REFRACTION_WHOLE: f32 = crate::observer::refraction::FADING[1] as f32;
    }
    /// Air and ground.
    mod air {
        /// Altitudes of a horizon.
        HORIZON_STEPS: u32 = crate::scene::surroundings::HORIZON_STEPS as u32;
        /// Nodes of a table of the sky: altitudes.
        SKY_ALTITUDES: u32 = crate::photometry::sky_light::TABLE_NODES[0] as u32;
        /// Azimuths from the source.
        SKY_AZIMUTHS: u32 = crate::photometry::sky_light::TABLE_NODES[1] as u32;
        /// Of the phase function of aerosol.
        AEROSOL_ASYMMETRY: f32 = crate::photometry::sky_light::ASYMMETRY as f32;
    }
    /// Bodies.
    mod bodies {
        /// In place of the first word of a texture: there is none.
        NO_TEXTURE: u32 = u32::MAX;
        /// What is around a body: nothing that is drawn.
        AROUND_NOTHING: u32 = 0;
        /// The rings of Saturn.
        AROUND_RINGS: u32 = 1;
        /// The corona of a sun.
        AROUND_CORONA: u32 = 2;
    }
    /// The corona.
    mod corona {
        /// Luminance of its parts beside the limb over the mean one of the disc; they fall with the powers 2.5, 7 and 17 of the distance.
        CORONA_PARTS: [f32; 3] = {
            let [[a, _], [b, _], [c, _]] = crate::photometry::corona::TERMS;
            [a as f32, b as f32, c as f32]
        };
        /// From here on it fades away, radii.
        CORONA_FADES: f32 = crate::photometry::corona::FADES as f32;
        /// Where it ends.
        CORONA_OUTER: f32 = crate::photometry::corona::OUTER as f32;
    }
    /// Saturn's rings.
    mod rings {
        /// Where they begin, in equatorial radii.
        RING_INNER: f32 = crate::photometry::rings::INNER as f32;
        /// Where they end.
        RING_OUTER: f32 = crate::photometry::rings::OUTER as f32;
        /// Where each zone ends, its optical depth, and its albedo.
        RING_ZONES: [[f32; 3]; 4] = super::ring_zones();
    }
    /// How light is shown on a display.
    mod display {
        OPERATOR_FILMIC: u32 = 0;
        OPERATOR_SRGB: u32 = 1;
        OPERATOR_REINHARD: u32 = 2;
        OPERATOR_ACES: u32 = 3;
        OPERATOR_CALIBRATED: u32 = 4;
        /// Brighter light is shown as this, cd/m^2 and units of display white: sums of three stay finite.
        BRIGHTEST: f32 = crate::photometry::tone_map::BRIGHTEST as f32;
    }
    /// The map of glare.
    mod glare_map {
        /// Points around each face that a level is computed at, beyond the face, and what sharpening leaves of them.
        RIM: u32 = 2;
    }
    /// The grid of sprites of glare.
    mod glare_sprites {
        /// Pixels along a side of a block.
        BLOCK_SIDE: u32 = 8;
        /// Blocks along a side of a square.
        SQUARE_BLOCKS: u32 = 4;
    }
    /// Extended sources among those of an eye's own.
    mod extended_sources {
        /// Says that a source is an extended one.
        IS_EXTENDED: u32 = 1 << 31;
        /// Parts of the share of its light that its softened kernel leaves out, and their mask.
        SHARE_PARTS: u32 = 65_535;
    }
    /// The veil of single sources.
    mod veil {
        /// In place of a viewport's number: all see them.
        EVERY_VIEWPORT: u32 = u32::MAX;
    }
    /// The glare pass over pixels.
    mod glare_composite {
        /// Columns of one workgroup: so few that what concerns a workgroup concerns each of its pixels.
        BLOCK_COLUMNS: u32 = 8;
    }
    /// Groups of asteroids and their instances.
    mod asteroid_instances {
        /// Flag of a group: it may hold points.
        ITEM_HOLDS_POINTS: u32 = 1;
        /// Flag of a group: it may hold more than points.
        ITEM_HOLDS_SHAPES: u32 = 2;
        /// Words of an instance.
        INSTANCE_WORDS: u32 = (size_of::<crate::scene::asteroids::PackedAsteroid>() / 4) as u32;
        /// Largest component of a packed axis.
        AXIS_PARTS: i32 = crate::scene::asteroids::packed::AXIS_PARTS;
    }
    /// Classes of asteroids by their distance, and the tables of pictures that they follow from.
    mod asteroid_classes {
        VIEW_FLAT: u32 = 0;
        VIEW_ROUND: u32 = 1;
        VIEW_LONGITUDE: u32 = 2;
        /// Steps of a picture's table.
        TABLE_STEPS: u32 = crate::plan::asteroids::views::TABLE_STEPS as u32;
        /// Part of a class's range over which it fades in.
        BAND: f32 = crate::plan::asteroids::classes::BAND as f32;
    }
    /// Culling asteroids.
    mod asteroid_culling {
        /// Asteroids of a group at most.
        GROUP: u32 = crate::scene::asteroids::GROUP as u32;
        /// In place of a face's number: the picture itself.
        WHOLE_PICTURE: u32 = crate::plan::asteroids::cpu_cull::WHOLE_PICTURE as u32;
        /// Kinds of a field at most: meshes, impostors, and those seen at all.
        MAX_LOCAL: u32 = crate::plan::asteroids::kinds::MAX_SET_MESHES as u32 + 2;
        /// A fade: all of it. Others are w, the share that takes over, and -w, what it leaves.
        WHOLE: f32 = crate::plan::asteroids::cpu_cull::WHOLE;
        /// Share below which a fade is held, so that it keeps its sign.
        LEAST_SHARE: f32 = crate::plan::asteroids::cpu_cull::LEAST_SHARE as f32;
    }
    /// Lists of asteroids.
    mod asteroid_lists {
        /// Says that an entry stands on the other side of the seam of an equirectangular picture.
        SEAM_BIT: u32 = 1 << 31;
        /// Vertices of an impostor's square.
        IMPOSTOR_VERTICES: u32 = 4;
    }
    /// Asteroids that are points.
    mod asteroid_points {
        /// Viewports of a frame at most.
        MAX_VIEWPORTS: u32 = crate::plan::stars::cull::MAX_VIEWPORTS as u32;
        /// Nodes along a side of the octahedral table of a shape's projected areas.
        AREA_NODES: u32 = crate::plan::asteroids::areas::AREA_NODES as u32;
    }
    /// Methods of impostors.
    mod impostors {
        METHOD_EULER: u32 = 0;
        METHOD_OCTAHEDRAL: u32 = 1;
        METHOD_BLEND: u32 = 2;
        /// Threads that splat an impostor together.
        SPLAT_LANES: u32 = 8;
        /// Samples along a side of the blocks that samples stand in while impostors are splatted.
        SPLAT_BLOCK: u32 = 8;
        /// Pictures and faces of a frame at most.
        MAX_PLANES: u32 = crate::plan::asteroids::kinds::MAX_PLANES as u32;
    }
}
