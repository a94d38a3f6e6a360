//! Bind groups, and the grids of workgroups.

use super::Gpu;

/// A bind group of buffers, in the order of their bindings.
pub(crate) fn bind_buffers(
    gpu: &Gpu,
    pipeline: &wgpu::ComputePipeline,
    group: u32,
    buffers: &[(u32, wgpu::BindingResource<'_>)],
) -> wgpu::BindGroup {
    bind_to(gpu, &pipeline.get_bind_group_layout(group), buffers)
}

/// A bind group of a layout, in the order of its bindings.
pub(crate) fn bind_to(
    gpu: &Gpu,
    layout: &wgpu::BindGroupLayout,
    resources: &[(u32, wgpu::BindingResource<'_>)],
) -> wgpu::BindGroup {
    let entries: Vec<wgpu::BindGroupEntry<'_>> = resources
        .iter()
        .map(|(binding, resource)| wgpu::BindGroupEntry { binding: *binding, resource: resource.clone() })
        .collect();
    gpu.device.create_bind_group(&wgpu::BindGroupDescriptor { label: Some("pass"), layout, entries: &entries })
}

/// Columns and rows of a dispatch of at least `workgroups`, each within the adapter's limit.
pub(crate) fn dispatch_rows(gpu: &Gpu, workgroups: u32) -> [u32; 2] {
    let columns = workgroups.clamp(1, gpu.device.limits().max_compute_workgroups_per_dimension);
    [columns, workgroups.div_ceil(columns)]
}
