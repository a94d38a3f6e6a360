//! Structures that the glare shaders read.

use crate::gpu::gpu_structs;
pub(crate) use crate::render::layout::Tile;

gpu_structs! {
    /// Parameters of the glare pass over pixels.
    struct GlareParameters {
        /// Fraction of the light that is scattered.
        fraction: f32,
        /// Number of pixels of the batch. It is the offset of the second plane, which holds blue and the solid angles.
        plane_pixels: u32,
        unused_0: u32,
        unused_1: u32,
    }
    /// Light of a cell of the sky cube.
    struct GlareCell {
        /// Unit vector to the centroid of the light.
        direction: [f32; 3],
        unused_0: f32,
        /// Illuminance, linear Rec. 709, lx.
        light: [f32; 3],
        unused_1: f32,
    }
    /// Parameters of a level of the glare map.
    struct GlareLevelParameters {
        /// Cells along an edge of a face.
        edge_cells: u32,
        /// Cells along an edge of the next coarser level; 0: there is none.
        coarser_cells: u32,
        /// Squared chord at which the kernel ends.
        end_squared: f32,
        /// Sine of the angle from the centre of a workgroup's points beyond which the kernel is zero for all of them; 2: no such angle.
        group_end_sine: f32,
        /// Entries of the table per unit of a squared chord.
        entries: f32,
        unused_0: u32,
        unused_1: u32,
        unused_2: u32,
    }
    /// Parameters of adding bumps to the finest level of the glare map.
    struct GlareBumpParameters {
        /// Cells along an edge of a face.
        edge_cells: u32,
        /// 1 over the squared radius of a bump.
        inverse_squared: f32,
        /// Sine of the angle from the centre of a workgroup's points beyond which no bump reaches any of them; 2: no such angle.
        group_end_sine: f32,
        unused_0: u32,
    }
    /// Parameters of sharpening a level of the glare map.
    struct GlareSharpenParameters {
        /// Cells along an edge of a face.
        edge_cells: u32,
        /// Index of the first point of the result.
        first_point: u32,
        unused_0: u32,
        unused_1: u32,
    }
    /// A source of glare that is drawn individually.
    struct GlareSprite {
        /// Unit vector, world axes.
        direction: [f32; 3],
        /// 1 over the square of the chord at which the sprite ends.
        inverse_squared: f32,
        /// Illuminance, linear Rec. 709, lx.
        light: [f32; 3],
        /// 1: the sprite has the largest reach and holds the remainder of the map's kernel.
        whole: u32,
    }
    /// Sprites of a part of the sky, or cells of a region of it.
    struct GlareSpriteCell {
        /// Unit vector to the centre.
        direction: [f32; 3],
        /// Greatest chord from the centre to a direction that one of its sprites reaches.
        reach: f32,
        /// Index of the first sprite or cell.
        first: u32,
        /// Number of sprites or cells.
        count: u32,
        unused_0: u32,
        unused_1: u32,
    }
    /// Glare parameters of a viewport.
    struct GlareView {
        /// The kernel inside the chord of `core_squared`: coefficients of 1, u and u^2, 1/sr. u is the squared chord divided by `core_squared`.
        core: [f32; 3],
        /// Square of the chord at which the core ends.
        core_squared: f32,
        /// Sprites with a greater inverse square are too narrow for the view.
        greatest_inverse: f32,
        /// Index of the first point of the view's map.
        first_point: u32,
        /// Index of the first source that only this eye has.
        first_near: u32,
        /// Number of sources that only this eye has.
        near_count: u32,
    }
    /// Parameters of finding and drawing sprites.
    struct SkyCubeParameters {
        /// The map's kernel inside a chord: coefficients of 1, u and u^2, 1/sr. u is the squared chord times `soft_inverse`.
        soft: [f32; 3],
        /// 1 over the square of that chord.
        soft_inverse: f32,
        /// Cells along an edge of a face of the map.
        edge_cells: u32,
        /// Number of regions with sprites.
        regions: u32,
        /// Inverse-square kernel: its constant, 1/sr.
        constant: f32,
        /// Inverse-square kernel: square of the angle inside which it is constant, rad^2.
        inner_squared: f32,
        /// Table of the kernel times the squared chord: log2 of the squared chord of its first entry.
        first_octave: f32,
        /// Kernel table: entries per octave.
        entries_per_octave: f32,
        /// Kernel table: number of entries.
        entries: u32,
        /// Words of the list of a block; the first word is the number of its sprites.
        list_words: u32,
        /// Words of the list of a square of blocks; the first word is the number of its sprites.
        square_words: u32,
        /// Columns of blocks of the batch.
        columns: u32,
        /// Rows of blocks of the batch.
        rows: u32,
        /// Number of tiles of the batch.
        tiles: u32,
        /// First word of the lists of blocks, which follow those of the squares.
        first_list: u32,
        unused_0: u32,
        unused_1: u32,
        unused_2: u32,
    }
    /// Parameters of the pass that evaluates veils at grid points.
    struct VeilParameters {
        /// Fraction of the light that is scattered.
        fraction: f32,
        unused_0: u32,
        unused_1: u32,
        unused_2: u32,
    }
    /// Parameters of the pass that evaluates the glare of bodies at grid points.
    struct NearPointParameters {
        /// Fraction of the light that is scattered.
        fraction: f32,
        /// Distance from a source, in grid spacings, within which its glare is too steep for interpolation.
        spacings_beside: f32,
        unused_0: u32,
        unused_1: u32,
    }
    /// Parameters of the pass that adds the veil of single sources to the sums.
    struct VeilSplatParameters {
        /// Fixed-point units per lux of scattered light, times the fraction that is scattered.
        units_per_lx: f32,
        /// Sources of these sums are at least this bright, lx.
        faintest_lx: f32,
        /// Sources of these sums are fainter than this, lx.
        brightest_lx: f32,
        /// Index of the first source.
        first: u32,
        /// Number of sources.
        count: u32,
        /// Sources per row of the dispatch.
        per_row: u32,
        /// The viewport that sees these sources, or `EVERY_VIEWPORT`.
        viewport: u32,
        /// Invocations per source.
        shared_by: u32,
    }
    /// A source of glare whose direction differs between eyes.
    struct GlareNear {
        /// Unit vector, world axes.
        direction: [f32; 3],
        /// Source with parts: chord inside which the parts replace it. Without parts: square of the chord that softens its kernel.
        reach: f32,
        /// Illuminance, linear Rec. 709, lx.
        light: [f32; 3],
        /// Number of parts, which follow the source. Extended source: `IS_EXTENDED`, and in the low 16 bits the fraction of its light that the
        /// softened kernel omits.
        parts: u32,
    }
    /// Parameters of the glare pass over surfaces.
    struct ObjectGlareParameters {
        /// Fraction of the light that is scattered.
        fraction: f32,
        unused_0: u32,
        unused_1: u32,
        unused_2: u32,
    }
    /// Parameters of the search for the brightest channel of a frame.
    struct GlareMaximumParameters {
        /// Number of pixels of the batch. It is the offset of the second plane, which holds blue and the solid angles.
        plane_pixels: u32,
        unused_0: u32,
        unused_1: u32,
        unused_2: u32,
    }
    /// Parameters of the base of a glare pyramid.
    struct GlareBaseParameters {
        /// The tile of the upper pixels.
        upper: Tile,
        /// The tile of the lower pixels: the next tile, or the same.
        lower: Tile,
        /// Number of pixels of the batch of `upper`. It is the offset of the second plane, which holds blue and the solid angles.
        upper_plane_pixels: u32,
        /// The same for `lower`.
        lower_plane_pixels: u32,
        unused_0: u32,
        unused_1: u32,
    }
    /// Parameters of a blur of a glare pyramid.
    struct GlareBlurParameters {
        /// Weights of the taps: the centre, then those on either side.
        weights: [f32; 4],
        /// Cosines of the taps' angles, for axes in view space.
        cosines: [f32; 4],
        /// Sines of the taps' angles, for axes in view space.
        sines: [f32; 4],
        /// Index of the viewport.
        viewport: u32,
        /// 0: the first axis. 1: the second axis.
        axis: u32,
        unused_0: u32,
        unused_1: u32,
    }
    /// Parameters of the sum over the levels of a glare pyramid.
    struct GlareCombineParameters {
        /// Weight of level 0.
        first_weight: f32,
        /// Weight of each level relative to that of the previous level.
        ratio: f32,
        /// Number of levels.
        levels: u32,
        unused_0: u32,
    }
}
