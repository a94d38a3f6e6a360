//! Bind groups of passes, and the sizes of dispatches.

use super::{Gpu, LayoutOf};

/// Returns a bind group of a compute pipeline.
pub(crate) fn bind_buffers(
    gpu: &Gpu,
    pipeline: &wgpu::ComputePipeline,
    group: u32,
    resources: &[(u32, wgpu::BindingResource<'_>)],
) -> wgpu::BindGroup {
    gpu.bind(LayoutOf::Compute(pipeline, group), resources)
}

/// Returns a bind group of a compute pipeline that binds whole buffers to 0, 1, 2 and so on.
pub(crate) fn bind_in_order(
    gpu: &Gpu,
    pipeline: &wgpu::ComputePipeline,
    group: u32,
    buffers: &[&wgpu::Buffer],
) -> wgpu::BindGroup {
    let bindings: Vec<_> = (0..).zip(buffers).map(|(binding, buffer)| (binding, buffer.as_entire_binding())).collect();
    bind_buffers(gpu, pipeline, group, &bindings)
}

/// Returns the columns and rows of a dispatch of at least `workgroups`, both within the adapter's limit.
pub(crate) fn dispatch_rows(gpu: &Gpu, workgroups: u32) -> [u32; 2] {
    let columns = workgroups.clamp(1, gpu.max_workgroups);
    [columns, workgroups.div_ceil(columns)]
}

/// The last bind group that every adapter supports. The other bind groups of passes count from 0.
const TABLES_GROUP: u32 = 3;

impl Gpu {
    /// Number of buffers of tables that all passes share. Shaders that read tables declare the same number.
    pub(crate) fn table_buffers(&self) -> usize {
        self.tables.len()
    }

    /// Sets the tables that passes read from now on. Pipelines for a different number of buffers become unusable.
    pub(crate) fn set_tables(&mut self, tables: Vec<wgpu::Buffer>) {
        self.tables = tables;
    }

    /// Binds the tables, if any, for a pipeline whose shader reads them.
    pub(crate) fn bind_tables(&self, pass: &mut wgpu::ComputePass<'_>, pipeline: &wgpu::ComputePipeline) {
        if !self.tables.is_empty() {
            self.bind_as_tables(pass, pipeline, &self.tables);
        }
    }

    /// Binds the given buffers as tables.
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
