//! Workgroups over the pixels of tiles, and how tiles are encoded.

use crate::{
    gpu::Gpu,
    plan::{
        Plan,
        tiles::{Batch, Tile},
    },
    render::{
        constants::pixel_grid::{BLOCK_COLUMNS, COLUMNS, ROWS},
        layout,
    },
    view::Viewport,
};

/// Number of row runs per workgroup on a GPU.
const ROW_GROUPS: u32 = 8;

/// Returns the number of row runs per workgroup on this adapter.
pub(crate) fn row_groups(gpu: &Gpu) -> u32 {
    if gpu.software { 1 } else { ROW_GROUPS }
}

/// Returns the number of workgroups for the pixels of a batch, computed from its grid of blocks.
pub(crate) fn workgroups([columns, rows, tiles]: [u32; 3], row_groups: u32) -> [u32; 3] {
    [columns * (COLUMNS / BLOCK_COLUMNS), rows.div_ceil(row_groups), tiles]
}

/// Returns the number of flags of a tile: one per block of pixels of the grid, row by row.
fn flags_of(width: u32, rows: u32) -> u32 {
    width.div_ceil(COLUMNS) * rows.div_ceil(ROWS)
}

/// Returns the numbers of workgroups over all pixels of a batch's tiles: columns, rows, tiles. `widths` are the widths of the tiles.
pub(crate) fn pixel_grid(tiles: &[Tile], widths: &[u32]) -> [u32; 3] {
    let columns = widths.iter().max().copied().unwrap_or(0).div_ceil(COLUMNS);
    let rows = tiles.iter().map(|tile| tile.rows).max().unwrap_or(0).div_ceil(ROWS);
    [columns, rows, tiles.len() as u32]
}

/// Returns the numbers of workgroups over all pixels of a single tile: columns, rows, 1.
pub(crate) fn tile_grid(tile: &Tile, viewport: &Viewport) -> [u32; 3] {
    pixel_grid(std::slice::from_ref(tile), &[viewport.size()[0]])
}

/// Returns the numbers of workgroups over all pixels of a batch: columns, rows, tiles.
pub(super) fn grid_of(plan: &Plan, batch: &Batch) -> [u32; 3] {
    let widths: Vec<u32> = batch.tiles.iter().map(|tile| plan.views.viewports[tile.viewport].size()[0]).collect();
    pixel_grid(&batch.tiles, &widths)
}

/// Returns the number of partial sums that a tile's workgroups write: one per column of pixels and row of workgroups.
pub(crate) fn partial_sums(width: u32, rows: u32) -> u32 {
    width * rows.div_ceil(ROWS)
}

/// Encodes the tiles of every batch. Also returns the total number of partial sums, and the number of counters. That number includes the flags of all
/// tiles, which follow the first `counters` counters.
pub(super) fn encoded_tiles(plan: &Plan, counters: u32) -> (Vec<Vec<layout::Tile>>, u32, u32) {
    let mut first_flag = counters;
    let mut first_partial = 0;
    let tiles = plan
        .views
        .batches
        .iter()
        .map(|batch| {
            let tiles = batch.tiles.iter().map(|tile| {
                let encoded = layout::Tile {
                    viewport: tile.viewport as u32,
                    first_row: tile.first_row,
                    rows: tile.rows,
                    first_pixel: tile.first_pixel,
                    first_partial,
                    first_flag,
                    ..Default::default()
                };
                let width = plan.views.viewports[tile.viewport].size()[0];
                first_partial += partial_sums(width, tile.rows);
                first_flag += flags_of(width, tile.rows);
                encoded
            });
            tiles.collect()
        })
        .collect();
    (tiles, first_partial, first_flag)
}
