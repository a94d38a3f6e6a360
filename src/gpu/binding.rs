//! Bind groups of passes, and the grids of workgroups.

use super::{Gpu, LayoutOf};

/// A bind group of a compute pipeline.
pub(crate) fn bind_buffers(
    gpu: &Gpu,
    pipeline: &wgpu::ComputePipeline,
    group: u32,
    resources: &[(u32, wgpu::BindingResource<'_>)],
) -> wgpu::BindGroup {
    gpu.bind(LayoutOf::Compute(pipeline, group), resources)
}

/// Columns and rows of a dispatch of at least `workgroups`, each within the adapter's limit.
pub(crate) fn dispatch_rows(gpu: &Gpu, workgroups: u32) -> [u32; 2] {
    let columns = workgroups.clamp(1, gpu.max_workgroups);
    [columns, workgroups.div_ceil(columns)]
}
