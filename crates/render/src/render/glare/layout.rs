//! Structures that the glare shaders read.

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
    /// Cell of the sky; see `shaders/glare/sky_cube/map_gather.wgsl`.
    GlareCell {
        /// Unit vector towards the centroid of its light.
        direction: [f32; 3],
        /// Padding.
        unused_0: f32,
        /// Illuminance, linear Rec. 709, lx.
        light: [f32; 3],
        /// Padding.
        unused_1: f32,
    }
    /// Parameters of a level of the glare map.
    GlareLevelParameters {
        /// Cells along an edge of a face.
        edge_cells: u32,
        /// Cells along an edge of a face of the coarser level.
        coarser_cells: u32,
        /// Squared chord at which the kernel ends.
        end_squared: f32,
        /// Sine of the angle at which the kernel ends, or 2.
        end_sine: f32,
        /// Entries of the kernel table per unit of squared chord.
        entries: f32,
        /// Inverse square of the radius of bumps, or 0.
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
        /// Index of the first point of the result.
        first_point: u32,
        /// Padding.
        unused_0: u32,
        /// Padding.
        unused_1: u32,
    }
    /// Source that is drawn individually; see `shaders/glare/sky_cube/sprites.wgsl`.
    GlareSprite {
        /// Unit vector, world axes.
        direction: [f32; 3],
        /// Inverse square of the chord at which it ends.
        inverse_squared: f32,
        /// Illuminance, linear Rec. 709, lx.
        light: [f32; 3],
        /// 1: the sprite adds the whole part that the map's kernel omits.
        whole: u32,
    }
    /// Sprites of a region of the sky.
    GlareSpriteCell {
        /// Unit vector towards the centre of the region.
        direction: [f32; 3],
        /// Greatest chord that its sprites reach.
        reach: f32,
        /// Index of the first sprite.
        first: u32,
        /// Number of sprites.
        count: u32,
        /// Padding.
        unused_0: u32,
        /// Padding.
        unused_1: u32,
    }
    /// Glare parameters of a viewport.
    GlareView {
        /// Coefficients of the kernel's core, 1/sr.
        core: [f32; 3],
        /// Squared chord at which the core ends.
        core_squared: f32,
        /// Greatest inverse square of a sprite.
        greatest_inverse: f32,
        /// Index of the first point of its map.
        first_point: u32,
        /// Index of the first of the viewport's own sources.
        first_near: u32,
        /// Number of those sources.
        near_count: u32,
    }
    /// Parameters of finding and drawing sprites.
    SkyCubeParameters {
        /// Coefficients of the map's kernel, 1/sr.
        soft: [f32; 3],
        /// Inverse square of the chord within which the coefficients hold.
        soft_inverse: f32,
        /// Cells along an edge of a face of the map.
        edge_cells: u32,
        /// Number of regions with sprites.
        regions: u32,
        /// Inverse-square kernel: its constant.
        constant: f32,
        /// Inverse-square kernel: square of the inner angle, rad^2.
        inner_squared: f32,
        /// Kernel table: log2 of the squared chord of its first entry.
        first_octave: f32,
        /// Kernel table: entries per octave.
        entries_per_octave: f32,
        /// Kernel table: number of entries.
        entries: u32,
        /// Number of words of a block's list.
        list_words: u32,
        /// Number of words of a square's list.
        square_words: u32,
        /// Number of columns of blocks.
        columns: u32,
        /// Number of rows of blocks.
        rows: u32,
        /// Number of tiles of the batch.
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
        /// Fixed-point units per lux of total light, scattered or not.
        units_per_lx: f32,
        /// Brightness of the faintest source, lx.
        faintest_lx: f32,
        /// Upper limit of the brightness of the sources, lx.
        brightest_lx: f32,
        /// Index of the first source.
        first: u32,
        /// Number of sources.
        count: u32,
        /// Sources per row of the dispatch.
        per_row: u32,
        /// Viewport that sees the sources, or `EVERY_VIEWPORT`.
        viewport: u32,
        /// Number of invocations that share a source.
        shared_by: u32,
    }
    /// Source of light that belongs to one eye.
    GlareNear {
        /// Unit vector, world axes.
        direction: [f32; 3],
        /// With parts: chord within which the parts replace the source. Without parts: squared softening chord.
        reach: f32,
        /// Illuminance, linear Rec. 709, lx.
        light: [f32; 3],
        /// Number of parts that follow.
        parts: u32,
    }
    /// Parameters of the pass over the light of surfaces.
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
        /// Tile that contains the upper pixels.
        upper: Tile,
        /// Tile that continues below, or the same tile again.
        lower: Tile,
        /// Pixels of the batch of the upper tile.
        upper_plane_pixels: u32,
        /// Pixels of the batch of the lower tile.
        lower_plane_pixels: u32,
        /// Padding.
        unused_0: u32,
        /// Padding.
        unused_1: u32,
    }
    /// Parameters of a blur of a glare pyramid.
    GlareBlurParameters {
        /// Weights of the taps: the middle one first, then those on either side.
        weights: [f32; 4],
        /// Cosines of the taps' angles.
        cosines: [f32; 4],
        /// Sines of the taps' angles.
        sines: [f32; 4],
        /// Index of the viewport.
        viewport: u32,
        /// Axis of the blur: 0 or 1.
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
        /// Weight of each level relative to the previous one.
        ratio: f32,
        /// Number of levels.
        levels: u32,
        /// Padding.
        unused_0: u32,
    }
}
