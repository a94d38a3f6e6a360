//! Evaluates a projection on the adapter, to compare its f32 arithmetic with f64.

use glam::DVec3;

use super::{layout, tabulated, viewport::encode_viewport};
use crate::gpu::{Gpu, GpuError, ReadbackBuffer, Tables, storage_buffer, uniform_list};
use crate::plan::KernelPlan;
use crate::plan::stars::cull::MAX_VIEWPORTS;
use crate::render::{constants::workgroups::PROBE_THREADS, shader::Shader};
use crate::view::{Viewport, projection::Projection};

/// Direction to project, in view space, and pixel whose solid angle and direction are computed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Probe {
    /// Direction in view space.
    pub direction: DVec3,
    /// Column and row.
    pub pixel: [u32; 2],
}

/// Result for a [`Probe`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Probed {
    /// Continuous pixel coordinates of the direction's image, if it exists.
    pub image: Option<[f32; 2]>,
    /// Solid angle of the pixel, sr.
    pub solid_angle_sr: f32,
    /// Unit direction of the pixel's centre, if it is in the picture.
    pub direction: Option<[f32; 3]>,
}

/// Evaluates the projection of `viewport` for every probe.
pub fn probe(gpu: &Gpu, viewport: &Viewport, probes: &[Probe]) -> Result<Vec<Probed>, GpuError> {
    // Inputs, pipeline and buffers.
    let inputs: Vec<layout::ProbeInput> = probes
        .iter()
        .map(|probe| layout::ProbeInput {
            direction: probe.direction.as_vec3().to_array(),
            pixel: probe.pixel.map(|v| v as i32),
            ..Default::default()
        })
        .collect();
    let table = match &viewport.projection {
        Projection::Tabulated(table) => Tables::new(gpu, tabulated::form_of(gpu, &[table]), &table.words()),
        _ => Tables::None,
    };
    let shader = tabulated::with_tables(Shader::new("probe"), table.form());
    let pipeline = gpu.compute_pipeline(&shader.source());
    let viewports = uniform_list(gpu, "viewports", &[encode_viewport(viewport, &KernelPlan::bspline())], MAX_VIEWPORTS);
    let input_buffer = storage_buffer(gpu, "probe inputs", &inputs);
    let bytes = (probes.len() * size_of::<layout::ProbeOutput>()) as u64;
    let outputs = gpu.create_buffer(&wgpu::BufferDescriptor {
        label: Some("probe outputs"),
        size: bytes,
        usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC,
        mapped_at_creation: false,
    });
    let group = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: Some("projection probe"),
        layout: &pipeline.get_bind_group_layout(0),
        entries: &[(0, &viewports), (1, &input_buffer), (2, &outputs)]
            .map(|(binding, buffer)| wgpu::BindGroupEntry { binding, resource: buffer.as_entire_binding() }),
    });
    // Dispatch and read the results back.
    let mut readback = ReadbackBuffer::new("probe readback");
    readback.begin(bytes);
    let mut encoder =
        gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("projection probe") });
    {
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        pass.set_pipeline(&pipeline);
        pass.set_bind_group(0, &group, &[]);
        gpu.bind_as_tables(&mut pass, &pipeline, &table);
        pass.dispatch_workgroups(probes.len().div_ceil(PROBE_THREADS as usize) as u32, 1, 1);
    }
    let place = readback.copy(gpu, &mut encoder, &outputs, 0, bytes);
    gpu.queue.submit([encoder.finish()]);
    readback.map(gpu);
    gpu.wait(None)?;
    let results: Vec<layout::ProbeOutput> = readback.read(gpu, place, probes.len())?;
    readback.unmap(gpu);
    Ok(results
        .into_iter()
        .map(|output| Probed {
            image: (output.image[2] > 0.0).then_some([output.image[0], output.image[1]]),
            solid_angle_sr: output.image[3],
            direction: (output.direction[3] > 0.0).then_some([
                output.direction[0],
                output.direction[1],
                output.direction[2],
            ]),
        })
        .collect())
}
