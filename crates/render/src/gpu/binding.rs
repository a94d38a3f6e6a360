//! Bind groups of passes, and the sizes of dispatches.

use super::{Gpu, LayoutOf, storage_buffer};
use crate::plan::tables::{TABLE_COLUMNS, TableForm, table_rows};

/// Returns a bind group of a compute pipeline.
pub(crate) fn bind_buffers(
    gpu: &Gpu,
    pipeline: &wgpu::ComputePipeline,
    group: u32,
    resources: &[(u32, wgpu::BindingResource<'_>)],
) -> wgpu::BindGroup {
    gpu.bind(LayoutOf::Compute(pipeline, group), resources)
}

/// Returns a bind group of a compute pipeline that binds whole buffers to the bindings 0, 1, 2 and so on.
pub(crate) fn bind_in_order(
    gpu: &Gpu,
    pipeline: &wgpu::ComputePipeline,
    group: u32,
    buffers: &[&wgpu::Buffer],
) -> wgpu::BindGroup {
    let bindings: Vec<_> = (0..).zip(buffers).map(|(binding, buffer)| (binding, buffer.as_entire_binding())).collect();
    bind_buffers(gpu, pipeline, group, &bindings)
}

/// Returns the columns and rows of a dispatch of at least `workgroups` workgroups. Both numbers are within the adapter's limit.
pub(crate) fn dispatch_rows(gpu: &Gpu, workgroups: u32) -> [u32; 2] {
    let columns = workgroups.clamp(1, gpu.max_workgroups);
    [columns, workgroups.div_ceil(columns)]
}

/// Bind group of the tables: the last one that every adapter supports. The other bind groups of passes are numbered from 0.
const TABLES_GROUP: u32 = 3;

/// Tables that passes bind in addition to their own buffers.
#[derive(Clone, Default)]
pub(crate) enum Tables {
    /// No tables.
    #[default]
    None,
    /// In a storage buffer.
    Buffer(wgpu::Buffer),
    /// In a texture of four words per texel, with [`TABLE_COLUMNS`] texels in a row.
    Texture(wgpu::TextureView),
}

impl Tables {
    /// Uploads groups of words.
    pub(crate) fn new(gpu: &Gpu, form: TableForm, groups: &[[u32; 4]]) -> Self {
        match form {
            TableForm::None => Self::None,
            TableForm::Buffer => Self::Buffer(storage_buffer(gpu, "mapping tables", groups)),
            TableForm::Texture => Self::Texture(table_texture(gpu, groups)),
        }
    }

    pub(crate) fn form(&self) -> TableForm {
        match self {
            Self::None => TableForm::None,
            Self::Buffer(_) => TableForm::Buffer,
            Self::Texture(_) => TableForm::Texture,
        }
    }
}

/// Creates a texture for tables with a number of rows.
fn empty_table_texture(device: &wgpu::Device, rows: u32) -> wgpu::Texture {
    device.create_texture(&wgpu::TextureDescriptor {
        label: Some("mapping tables"),
        size: wgpu::Extent3d { width: TABLE_COLUMNS, height: rows, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: wgpu::TextureFormat::Rgba32Uint,
        usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
        view_formats: &[],
    })
}

fn table_texture(gpu: &Gpu, groups: &[[u32; 4]]) -> wgpu::TextureView {
    let texture = empty_table_texture(&gpu.device, table_rows(groups.len()));
    // Upload all full rows, then the last one.
    let full = groups.len() / TABLE_COLUMNS as usize;
    let (rows, last) = groups.split_at(full * TABLE_COLUMNS as usize);
    for (row, height, part) in [(0, full as u32, rows), (full as u32, 1, last)] {
        if part.is_empty() {
            continue;
        }
        let width = part.len() as u32 / height;
        let mut target = texture.as_image_copy();
        target.origin.y = row;
        let layout = wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(16 * width), rows_per_image: None };
        let extent = wgpu::Extent3d { width, height, depth_or_array_layers: 1 };
        gpu.queue.write_texture(target, bytemuck::cast_slice(part), layout, extent);
    }
    texture.create_view(&wgpu::TextureViewDescriptor::default())
}

impl Gpu {
    /// How the tables that all passes share are stored. Shaders that read tables declare them in the same form.
    pub(crate) fn table_form(&self) -> TableForm {
        self.tables.form()
    }

    /// Sets the tables that passes read from now on. Pipelines for another form become unusable.
    pub(crate) fn set_tables(&mut self, tables: Tables) {
        self.tables = tables;
    }

    /// Binds the tables, if any, for a pipeline whose shader reads them.
    pub(crate) fn bind_tables(&self, pass: &mut wgpu::ComputePass<'_>, pipeline: &wgpu::ComputePipeline) {
        self.bind_as_tables(pass, pipeline, &self.tables);
    }

    /// Binds the given tables.
    pub(crate) fn bind_as_tables(
        &self,
        pass: &mut wgpu::ComputePass<'_>,
        pipeline: &wgpu::ComputePipeline,
        tables: &Tables,
    ) {
        let resource = match tables {
            Tables::None => return,
            Tables::Buffer(buffer) => buffer.as_entire_binding(),
            Tables::Texture(view) => wgpu::BindingResource::TextureView(view),
        };
        pass.set_bind_group(TABLES_GROUP, &bind_buffers(self, pipeline, TABLES_GROUP, &[(0, resource)]), &[]);
    }
}
