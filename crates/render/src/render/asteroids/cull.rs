//! Culling and detail of asteroids on the adapter, for all planes at once: counts per group, plane and list, places from counts, lists.
//! Shaders: `shaders/asteroids/cull*.wgsl`; the f64 twin is `crate::plan::asteroids::cpu_cull`.

use crate::render::shader::{Shader, workgroup_constant};
use crate::{
    gpu::{Gpu, bind_in_order, dispatch_rows},
    render::asteroids::layout,
};

/// The pass.
pub(crate) struct AsteroidCullPass {
    count: wgpu::ComputePipeline,
    write: wgpu::ComputePipeline,
    scan: wgpu::ComputePipeline,
    place: wgpu::ComputePipeline,
}

/// How much there is to do.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CullNumbers {
    /// Groups.
    pub items: u32,
    /// Planes.
    pub planes: u32,
    /// Lists per plane, the count of those seen included.
    pub kinds: u32,
    /// Lists of meshes among them.
    pub mesh_kinds: u32,
    /// Entries that there is room for.
    pub capacity: u32,
    /// Impostors per workgroup where they are splatted; 0: they are drawn as squares.
    pub splats_per_workgroup: u32,
}

/// What it reads and writes.
pub(crate) struct CullBuffers<'a> {
    pub views: &'a wgpu::Buffer,
    pub tables: &'a wgpu::Buffer,
    pub planes: &'a wgpu::Buffer,
    pub links: &'a wgpu::Buffer,
    pub items: &'a wgpu::Buffer,
    pub instances: &'a wgpu::Buffer,
    pub fields: &'a wgpu::Buffer,
    pub shapes: &'a wgpu::Buffer,
    pub lods: &'a wgpu::Buffer,
    /// Per mesh: number of indices, first index, first vertex.
    pub meshes: &'a wgpu::Buffer,
    /// One per list and group linked to its plane.
    pub counts: &'a wgpu::Buffer,
    /// The length of all lists, then of each.
    pub totals: &'a wgpu::Buffer,
    /// First entry of each list.
    pub bases: &'a wgpu::Buffer,
    pub entries: &'a wgpu::Buffer,
    /// Arguments of each list's draw.
    pub arguments: &'a wgpu::Buffer,
}

impl AsteroidCullPass {
    pub(crate) fn new(gpu: &Gpu) -> Self {
        let workgroup = workgroup_constant(gpu);
        let cull = Shader::new("asteroids/cull").source();
        Self {
            count: gpu.compute_pipeline_with(&cull, &[workgroup, ("WRITES", 0.0)]),
            write: gpu.compute_pipeline_with(&cull, &[workgroup, ("WRITES", 1.0)]),
            scan: gpu.compute_pipeline(&Shader::new("asteroids/cull_scan").source()),
            place: gpu.compute_pipeline(&Shader::new("asteroids/cull_offsets").source()),
        }
    }

    /// Records everything; `counts` holds zeros before.
    pub(crate) fn record(
        &self,
        gpu: &Gpu,
        pass: &mut wgpu::ComputePass<'_>,
        numbers: CullNumbers,
        buffers: &CullBuffers<'_>,
    ) {
        let lists = numbers.planes * numbers.kinds;
        let parameters = |row: u32| layout::AsteroidCullParameters {
            items: numbers.items,
            row,
            kinds: numbers.kinds,
            buckets: lists,
            capacity: numbers.capacity,
            mesh_kinds: numbers.mesh_kinds,
            splat_row: if numbers.splats_per_workgroup > 0 { gpu.max_workgroups() } else { 0 },
            splats_per_workgroup: numbers.splats_per_workgroup,
        };
        let uniform = |row: u32| gpu.frame_uniform("asteroid culling", &parameters(row));
        let [row, rows] = dispatch_rows(gpu, numbers.items);
        let of_items = uniform(row);
        let [list_row, list_rows] = dispatch_rows(gpu, lists);
        let of_lists = uniform(list_row);
        let cull = |pass: &mut wgpu::ComputePass<'_>, pipeline: &wgpu::ComputePipeline| {
            pass.set_pipeline(pipeline);
            let first = [
                &of_items,
                buffers.views,
                buffers.tables,
                buffers.planes,
                buffers.links,
                buffers.items,
                buffers.counts,
            ];
            let second =
                [buffers.instances, buffers.fields, buffers.shapes, buffers.lods, buffers.entries, buffers.bases];
            pass.set_bind_group(0, &bind_in_order(gpu, pipeline, 0, &first), &[]);
            pass.set_bind_group(1, &bind_in_order(gpu, pipeline, 1, &second), &[]);
            pass.dispatch_workgroups(row, rows, 1);
        };
        if numbers.items > 0 {
            cull(pass, &self.count);
        }
        pass.set_pipeline(&self.scan);
        let scanned = [&of_lists, buffers.planes, buffers.counts, buffers.totals];
        pass.set_bind_group(0, &bind_in_order(gpu, &self.scan, 0, &scanned), &[]);
        pass.dispatch_workgroups(list_row, list_rows, 1);
        pass.set_pipeline(&self.place);
        let placed = [&of_lists, buffers.totals, buffers.meshes, buffers.bases, buffers.arguments];
        pass.set_bind_group(0, &bind_in_order(gpu, &self.place, 0, &placed), &[]);
        pass.dispatch_workgroups(1, 1, 1);
        if numbers.items > 0 {
            cull(pass, &self.write);
        }
    }
}
