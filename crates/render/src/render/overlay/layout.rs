//! Structures that the overlay pass reads.

use crate::gpu::gpu_structs;

gpu_structs! {
    /// Parameters of the overlay pass; see `shaders/overlay/draw.wgsl`.
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
    /// Shape to draw; see `shaders/overlay/draw.wgsl`.
    OverlayItem {
        /// First end of a line, or first corner of a box.
        begin: [f32; 2],
        /// Other end of a line, or the corner after the last pixel of a box.
        end: [f32; 2],
        /// Inverse distance at both ends, 1/m.
        nearness: [f32; 2],
        /// Half width of a line, pixels.
        half_width_px: f32,
        /// Opacity, 0 to 1.
        opacity: f32,
        /// sRGB codes, red in the lowest byte.
        colour: u32,
        /// Stroke of the item; the items of one stroke are consecutive.
        stroke: u32,
        /// Kind of the shape.
        shape: u32,
        /// Glyph: index of the first byte of coverage.
        first_texel: u32,
    }
    /// Block of pixels of a tile; see `shaders/overlay/draw.wgsl`.
    OverlayBlock {
        /// First column and first row.
        corner: [u32; 2],
        /// Index of the tile.
        tile: u32,
        /// Index of its first entry.
        first_entry: u32,
        /// Number of entries.
        entries: u32,
        /// Padding.
        unused_0: u32,
    }
}
