//! Culls asteroids and selects their level of detail on the adapter, for all planes at once, in three steps: count per
//! group, plane and list; turn counts into offsets; write the lists.
//!
//! Shaders: `shaders/asteroids/cull*.wgsl`; the f64 twin is `crate::plan::asteroids::cpu_cull`.
//!
//! No twin: plan/asteroids/cpu_cull.rs.

use crate::render::shader::{Shader, workgroup_constant};
use crate::{
    gpu::{Gpu, bind_in_order, dispatch_rows},
    render::asteroids::layout,
};

/// Pipelines of the culling pass.
pub(crate) struct AsteroidCullPass {
    count: wgpu::ComputePipeline,
    write: wgpu::ComputePipeline,
    scan: wgpu::ComputePipeline,
    place: wgpu::ComputePipeline,
}

/// Sizes of the culling work.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CullNumbers {
    /// Number of groups.
    pub items: u32,
    /// Number of planes.
    pub planes: u32,
    /// Lists per plane, including the one that counts visible asteroids.
    pub kinds: u32,
    /// Number of mesh lists among them.
    pub mesh_kinds: u32,
    /// Capacity of the lists, entries.
    pub capacity: u32,
    /// Impostors per workgroup if they are splatted; 0 if they are drawn as squares.
    pub splats_per_workgroup: u32,
}

/// Buffers that culling reads and writes.
pub(crate) struct CullBuffers<'a> {
    pub views: &'a wgpu::Buffer,
    pub tables: &'a wgpu::Buffer,
    pub planes: &'a wgpu::Buffer,
    pub links: &'a wgpu::Buffer,
    pub items: &'a wgpu::Buffer,
    pub instances: &'a wgpu::Buffer,
    pub fields: &'a wgpu::Buffer,
    /// Per mesh: number of indices, first index, first vertex.
    pub meshes: &'a wgpu::Buffer,
    /// One count per list and per group linked to the list's plane.
    pub counts: &'a wgpu::Buffer,
    /// Total length of all lists, then the length of each list.
    pub totals: &'a wgpu::Buffer,
    /// Index of the first entry of each list.
    pub bases: &'a wgpu::Buffer,
    pub entries: &'a wgpu::Buffer,
    /// Indirect draw arguments of each list.
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

    /// Records all culling dispatches. `counts` must be zeroed before.
    pub(crate) fn record(
        &self,
        gpu: &Gpu,
        pass: &mut wgpu::ComputePass<'_>,
        numbers: CullNumbers,
        buffers: &CullBuffers<'_>,
    ) {
        // Uniforms of the dispatches over groups and over lists.
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
        let item_parameters = uniform(row);
        let [list_row, list_rows] = dispatch_rows(gpu, lists);
        let list_parameters = uniform(list_row);
        // The shader that counts in its first run and writes entries in its second.
        let cull = |pass: &mut wgpu::ComputePass<'_>, pipeline: &wgpu::ComputePipeline| {
            pass.set_pipeline(pipeline);
            let first = [
                &item_parameters,
                buffers.views,
                buffers.tables,
                buffers.planes,
                buffers.links,
                buffers.items,
                buffers.counts,
            ];
            let second = [buffers.instances, buffers.fields, buffers.entries, buffers.bases];
            pass.set_bind_group(0, &bind_in_order(gpu, pipeline, 0, &first), &[]);
            pass.set_bind_group(1, &bind_in_order(gpu, pipeline, 1, &second), &[]);
            pass.dispatch_workgroups(row, rows, 1);
        };
        if numbers.items > 0 {
            cull(pass, &self.count);
        }
        // Offsets within each list, then the start of each list and its draw arguments.
        pass.set_pipeline(&self.scan);
        let scanned = [&list_parameters, buffers.planes, buffers.counts, buffers.totals];
        pass.set_bind_group(0, &bind_in_order(gpu, &self.scan, 0, &scanned), &[]);
        pass.dispatch_workgroups(list_row, list_rows, 1);
        pass.set_pipeline(&self.place);
        let placed = [&list_parameters, buffers.totals, buffers.meshes, buffers.bases, buffers.arguments];
        pass.set_bind_group(0, &bind_in_order(gpu, &self.place, 0, &placed), &[]);
        pass.dispatch_workgroups(1, 1, 1);
        if numbers.items > 0 {
            cull(pass, &self.write);
        }
    }
}
