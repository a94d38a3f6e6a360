//! The search for the sprites of every block of pixels. Shaders: `shaders/glare/sky_cube/sprites_*.wgsl`.
//!
//! No twin: reference/glare/sky_cube.rs, which adds the glare source by source.

use crate::render::constants::{
    glare_sprites::{BLOCK_SIDE, SQUARE_BLOCKS},
    workgroups::SPRITE_SQUARES,
};
use crate::{
    gpu::{Gpu, bind_in_order},
    render::{
        tabulated::projecting,
        targets::{COLUMNS, ROWS},
    },
};

/// Pipelines of the sprite search.
pub(super) struct SpritePasses {
    find: wgpu::ComputePipeline,
    assign: wgpu::ComputePipeline,
}

impl SpritePasses {
    pub(super) fn new(gpu: &Gpu) -> Self {
        Self {
            find: gpu.compute_pipeline(&projecting(gpu, "glare/sky_cube/sprites_find").source()),
            assign: gpu.compute_pipeline(&projecting(gpu, "glare/sky_cube/sprites_assign").source()),
        }
    }

    /// Records the search for the sprites of every block, on a grid of blocks (columns, rows, tiles).
    pub(super) fn find(
        &self,
        gpu: &Gpu,
        pass: &mut wgpu::ComputePass<'_>,
        buffers: &SpriteBuffers<'_>,
        grid: [u32; 3],
    ) {
        let [columns, rows, tiles] = square_grid(grid);
        let SpriteBuffers { parameters, viewports, tiles: tile_buffer, views, cells, sprites, lists } = *buffers;
        pass.set_pipeline(&self.find);
        gpu.bind_tables(pass, &self.find);
        let group =
            bind_in_order(gpu, &self.find, 0, &[parameters, viewports, tile_buffer, views, cells, sprites, lists]);
        pass.set_bind_group(0, &group, &[]);
        pass.dispatch_workgroups(columns.div_ceil(SPRITE_SQUARES), rows, tiles);
        pass.set_pipeline(&self.assign);
        gpu.bind_tables(pass, &self.assign);
        let group = bind_in_order(gpu, &self.assign, 0, &[parameters, viewports, tile_buffer, views, sprites, lists]);
        pass.set_bind_group(0, &group, &[]);
        pass.dispatch_workgroups(columns, rows, tiles);
    }
}

/// Inputs and results of the sprite search.
#[derive(Clone, Copy)]
pub(super) struct SpriteBuffers<'a> {
    pub parameters: &'a wgpu::Buffer,
    pub viewports: &'a wgpu::Buffer,
    pub tiles: &'a wgpu::Buffer,
    pub views: &'a wgpu::Buffer,
    pub cells: &'a wgpu::Buffer,
    pub sprites: &'a wgpu::Buffer,
    pub lists: &'a wgpu::Buffer,
}

/// Returns the number of blocks (columns, rows, tiles) for a grid of workgroups over pixels.
pub(super) fn block_grid([columns, rows, tiles]: [u32; 3]) -> [u32; 3] {
    [columns * (COLUMNS / BLOCK_SIDE), rows * (ROWS / BLOCK_SIDE), tiles]
}

/// Returns the number of squares for a grid of blocks.
pub(super) fn square_grid([columns, rows, tiles]: [u32; 3]) -> [u32; 3] {
    [columns.div_ceil(SQUARE_BLOCKS), rows.div_ceil(SQUARE_BLOCKS), tiles]
}
