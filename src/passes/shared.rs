//! What the passes share: binding whole buffers, and the grid over the pixels of a batch.

use crate::{
    gpu::Gpu,
    plan::{settings::ToneMapOperator, tiles::Tile},
};

/// Pixels of one workgroup of the passes over pixels: 64 columns, 16 rows.
pub(crate) const COLUMNS: u32 = 64;
/// See [`COLUMNS`].
pub(crate) const ROWS: u32 = 16;

/// A bind group of buffers, in the order of their bindings.
pub(crate) fn bind_buffers(
    gpu: &Gpu,
    pipeline: &wgpu::ComputePipeline,
    group: u32,
    buffers: &[(u32, wgpu::BindingResource<'_>)],
) -> wgpu::BindGroup {
    let entries: Vec<wgpu::BindGroupEntry<'_>> = buffers
        .iter()
        .map(|(binding, resource)| wgpu::BindGroupEntry { binding: *binding, resource: resource.clone() })
        .collect();
    gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: Some("pass"),
        layout: &pipeline.get_bind_group_layout(group),
        entries: &entries,
    })
}

/// Workgroups over all pixels of a batch's tiles: columns, rows, tiles. `widths` are those of the tiles.
pub(crate) fn pixel_grid(tiles: &[Tile], widths: &[u32]) -> [u32; 3] {
    let columns = widths.iter().max().copied().unwrap_or(0).div_ceil(COLUMNS);
    let rows = tiles.iter().map(|tile| tile.rows).max().unwrap_or(0).div_ceil(ROWS);
    [columns, rows, tiles.len() as u32]
}

/// Partial sums that a tile's workgroups write: one per column of pixels and row of workgroups.
pub(crate) fn partial_sums(width: u32, rows: u32) -> u32 {
    width * rows.div_ceil(ROWS)
}

/// Number of a tone-mapping operator in the shaders.
pub(crate) fn operator_number(operator: ToneMapOperator) -> u32 {
    match operator {
        ToneMapOperator::Filmic => 0,
        ToneMapOperator::Srgb => 1,
    }
}
