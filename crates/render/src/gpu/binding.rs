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

/// A bind group of a compute pipeline that binds whole buffers to 0, 1, 2 and so on.
pub(crate) fn bind_in_order(
    gpu: &Gpu,
    pipeline: &wgpu::ComputePipeline,
    group: u32,
    buffers: &[&wgpu::Buffer],
) -> wgpu::BindGroup {
    let bindings: Vec<_> = (0..).zip(buffers).map(|(binding, buffer)| (binding, buffer.as_entire_binding())).collect();
    bind_buffers(gpu, pipeline, group, &bindings)
}

/// Columns and rows of a dispatch of at least `workgroups`, each within the adapter's limit.
pub(crate) fn dispatch_rows(gpu: &Gpu, workgroups: u32) -> [u32; 2] {
    let columns = workgroups.clamp(1, gpu.max_workgroups);
    [columns, workgroups.div_ceil(columns)]
}

/// The last of the groups that every adapter has: passes number their own ones from 0 on.
const TABLES_GROUP: u32 = 3;

impl Gpu {
    /// Buffers with tables that all passes share, or none: their shaders read as many.
    pub(crate) fn table_buffers(&self) -> usize {
        self.tables.len()
    }

    /// Has passes read these tables from now on, or none. Pipelines that were made for another number of buffers cannot be used then.
    pub(crate) fn set_tables(&mut self, tables: Vec<wgpu::Buffer>) {
        self.tables = tables;
    }

    /// Binds the tables, where there are any, for a pipeline whose shader reads them.
    pub(crate) fn bind_tables(&self, pass: &mut wgpu::ComputePass<'_>, pipeline: &wgpu::ComputePipeline) {
        if !self.tables.is_empty() {
            self.bind_as_tables(pass, pipeline, &self.tables);
        }
    }

    /// Binds buffers in their place.
    pub(crate) fn bind_as_tables(
        &self,
        pass: &mut wgpu::ComputePass<'_>,
        pipeline: &wgpu::ComputePipeline,
        tables: &[wgpu::Buffer],
    ) {
        let tables: Vec<&wgpu::Buffer> = tables.iter().collect();
        let group = bind_in_order(self, pipeline, TABLES_GROUP, &tables);
        pass.set_bind_group(TABLES_GROUP, &group, &[]);
    }
}
