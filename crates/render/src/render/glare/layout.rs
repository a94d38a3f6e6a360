//! Structures that the shaders of glare read.

use crate::gpu::gpu_structs;
pub(crate) use crate::render::layout::Tile;

gpu_structs! {
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
    SkyCubeParameters {
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
    }
    /// Parameters of the pass over the points of veils.
    VeilParameters {
        /// Share of the light that is scattered.
        fraction: f32,
        /// Padding.
        unused_0: u32,
        /// Padding.
        unused_1: u32,
        /// Padding.
        unused_2: u32,
    }
    /// Parameters of the pass that adds the veil of single sources to sums.
    VeilSplatParameters {
        /// Fixed-point units per lux of all light, scattered or not.
        units_per_lx: f32,
        /// Brightness of the faintest source, lx.
        faintest_lx: f32,
        /// What every source is fainter than, lx.
        brightest_lx: f32,
        /// First source.
        first: u32,
        /// Number of sources.
        count: u32,
        /// Sources per row of the dispatch.
        per_row: u32,
        /// The viewport that sees them.
        viewport: u32,
        /// Invocations that share a source.
        shared_by: u32,
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
    /// Parameters of the pass over what surfaces show.
    ObjectGlareParameters {
        /// Share of the light that is scattered.
        fraction: f32,
        /// Padding.
        unused_0: u32,
        /// Padding.
        unused_1: u32,
        /// Padding.
        unused_2: u32,
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
}
