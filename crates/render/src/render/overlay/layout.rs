//! Structures that the overlay pass reads.

use crate::gpu::gpu_structs;

gpu_structs! {
    /// Parameters of the overlay pass.
    struct OverlayParameters {
        /// Number of blocks.
        blocks: u32,
        unused_0: u32,
        unused_1: u32,
        unused_2: u32,
    }
    /// A shape of the overlay.
    struct OverlayItem {
        /// Line: its first end. Other shapes: the first corner, whole pixels.
        begin: [f32; 2],
        /// Line: its other end. Other shapes: the corner after the last pixel, whole pixels.
        end: [f32; 2],
        /// Inverse distance at both ends, 1/m.
        nearness: [f32; 2],
        /// Line: half its width, pixels.
        half_width_px: f32,
        /// Opacity, 0 to 1.
        opacity: f32,
        /// sRGB codes, red in the lowest byte.
        colour: u32,
        /// Index of the stroke; the items of a stroke are consecutive.
        stroke: u32,
        /// One of `SHAPE_...`.
        shape: u32,
        /// Glyph: index of the coverage of its first pixel, bytes. Picture: index of its header, 32-bit words.
        first_texel: u32,
    }
    /// A block of pixels of a tile.
    struct OverlayBlock {
        /// First column and row.
        corner: [u32; 2],
        /// Index of the tile.
        tile: u32,
        /// Index of its first entry in the list of items.
        first_entry: u32,
        /// Number of entries.
        entries: u32,
        unused_0: u32,
    }
}
