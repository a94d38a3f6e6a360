//! Divides viewports into tiles that fit the adapter: a tile is a run of rows of one viewport, a batch contains as many tiles as
//! fit into one buffer. The stars are read once per batch.

/// Maximum number of tiles in a batch: a star item has a bit set of 32 bits.
pub const MAX_TILES: usize = 32;

/// Bytes per pixel of the sums, and of the HDR image that replaces them.
pub const BYTES_PER_PIXEL: u64 = 16;

/// A run of rows of one viewport.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Tile {
    /// Index of the viewport.
    pub viewport: usize,
    /// First row.
    pub first_row: u32,
    /// Number of rows.
    pub rows: u32,
    /// Index of the first pixel in the batch's buffer.
    pub first_pixel: u32,
}

/// Tiles that are drawn together.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Batch {
    /// The tiles.
    pub tiles: Vec<Tile>,
    /// Number of pixels of all tiles.
    pub pixels: u64,
}

/// Divides viewports of the given sizes into batches of at most `max_pixels` pixels. A row is never divided, so `max_pixels` must
/// be at least the width of the widest viewport.
pub fn batches(sizes: &[[u32; 2]], max_pixels: u64) -> Vec<Batch> {
    let mut batches = vec![];
    let mut batch = Batch::default();
    for (viewport, &[width, height]) in sizes.iter().enumerate() {
        let mut first_row = 0;
        while first_row < height {
            let fitting_rows = (max_pixels - batch.pixels) / u64::from(width);
            if fitting_rows == 0 || batch.tiles.len() == MAX_TILES {
                batches.push(std::mem::take(&mut batch));
                continue;
            }
            let rows = u64::from(height - first_row).min(fitting_rows) as u32;
            batch.tiles.push(Tile { viewport, first_row, rows, first_pixel: batch.pixels as u32 });
            batch.pixels += u64::from(rows) * u64::from(width);
            first_row += rows;
        }
    }
    if !batch.tiles.is_empty() {
        batches.push(batch);
    }
    batches
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_row_is_drawn_once_and_nothing_exceeds_the_limit() {
        let sizes = [[100, 50], [30, 7], [64, 64], [1, 1]];
        for max_pixels in [100, 101, 999, 5000, 1_000_000] {
            let batches = batches(&sizes, max_pixels);
            let mut rows = vec![vec![0; 64]; sizes.len()];
            for batch in &batches {
                let mut end = 0;
                for tile in &batch.tiles {
                    assert_eq!(u64::from(tile.first_pixel), end);
                    end += u64::from(tile.rows) * u64::from(sizes[tile.viewport][0]);
                    for row in tile.first_row..tile.first_row + tile.rows {
                        rows[tile.viewport][row as usize] += 1;
                    }
                }
                assert_eq!(end, batch.pixels);
                assert!(batch.pixels <= max_pixels && batch.tiles.len() <= MAX_TILES);
            }
            for (viewport, [_, height]) in sizes.iter().enumerate() {
                assert!(rows[viewport][..*height as usize].iter().all(|count| *count == 1));
            }
        }
    }

    #[test]
    fn no_views_give_no_batches_and_many_small_views_give_several() {
        assert!(batches(&[], 100).is_empty());
        assert_eq!(batches(&[[1, 1]; 70], 1000).len(), 3);
    }
}
