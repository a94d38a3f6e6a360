//! Structures that the overlay pass reads.

use crate::gpu::gpu_structs;

gpu_structs! {
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
