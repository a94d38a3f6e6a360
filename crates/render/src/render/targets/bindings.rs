//! Buffers of a batch that passes write to, as they bind them: sums of light, the picture, and the surfaces that hide stars.

use crate::{
    gpu::{Gpu, ShaderSource, bind_buffers, bind_in_order},
    render::{shader::Shader, tabulated::projecting},
};

/// Surfaces of bodies and asteroids that hide lights behind them: see `shaders/shared/occlusion.wgsl`.
#[derive(Clone, Copy)]
pub(crate) struct Occlusion<'a> {
    /// Whether there are surfaces. If not, the buffers are placeholders.
    pub present: bool,
    /// Result of the geometry pass for the pixels of the batch.
    pub geometry: &'a wgpu::Buffer,
    pub view_bodies: &'a wgpu::Buffer,
    pub body_runs: &'a wgpu::Buffer,
    /// Grids of plain blocks, or grids without points.
    pub plain_grids: &'a wgpu::Buffer,
}

/// Buffers for the sums of light of a batch.
#[derive(Clone)]
pub(crate) struct Sums<'a> {
    pub viewports: &'a wgpu::Buffer,
    pub tiles: &'a wgpu::Buffer,
    pub counters: &'a wgpu::Buffer,
    pub low_words: wgpu::BufferBinding<'a>,
    pub high_words: wgpu::BufferBinding<'a>,
    pub occlusion: Occlusion<'a>,
}

/// Buffers of a batch whose picture is written or modified as luminance, with partial sums for the exposure.
#[derive(Clone, Copy)]
pub(crate) struct PictureTarget<'a> {
    pub viewports: &'a wgpu::Buffer,
    pub tiles: &'a wgpu::Buffer,
    pub pixels: &'a wgpu::Buffer,
    pub partial_sums: &'a wgpu::Buffer,
    /// Pixels of the batch.
    pub plane_pixels: u32,
}

/// Returns the bind group 2 of every splatting pass: the surfaces that hide stars.
pub(crate) fn bind_occlusion(
    gpu: &Gpu,
    pipeline: &wgpu::ComputePipeline,
    occlusion: &Occlusion<'_>,
) -> wgpu::BindGroup {
    let buffers = [occlusion.geometry, occlusion.view_bodies, occlusion.body_runs, occlusion.plain_grids];
    bind_in_order(gpu, pipeline, 2, &buffers)
}

/// Resolves a shader that splats in fixed point, with the accumulator that the adapter supports.
pub(crate) fn splatting(gpu: &Gpu, file: &str) -> ShaderSource {
    splatting_shader(gpu, file).source()
}

/// The same shader, not yet joined with its imports.
pub(crate) fn splatting_shader(gpu: &Gpu, file: &str) -> Shader {
    let accumulate = if gpu.wide_accumulator { "shared/accumulate_u64" } else { "shared/accumulate_u32" };
    projecting(gpu, file).with("accumulate", accumulate)
}

/// Returns the bind group 0 of every pass that splats in fixed point: parameters, sums, and `others`.
pub(crate) fn bind_sums(
    gpu: &Gpu,
    pipeline: &wgpu::ComputePipeline,
    parameters: &wgpu::Buffer,
    sums: &Sums<'_>,
    others: &[(u32, wgpu::BindingResource<'_>)],
) -> wgpu::BindGroup {
    let sum_bindings = [
        (0, parameters.as_entire_binding()),
        (1, sums.viewports.as_entire_binding()),
        (2, sums.tiles.as_entire_binding()),
        (3, sums.counters.as_entire_binding()),
        (4, wgpu::BindingResource::Buffer(sums.low_words.clone())),
        (6, wgpu::BindingResource::Buffer(sums.high_words.clone())),
    ];
    bind_buffers(gpu, pipeline, 0, &[&sum_bindings[..], others].concat())
}

/// Returns the bind group 0 of every pass over luminance pictures: parameters and picture.
pub(crate) fn bind_picture(
    gpu: &Gpu,
    pipeline: &wgpu::ComputePipeline,
    parameters: &wgpu::Buffer,
    target: &PictureTarget<'_>,
) -> wgpu::BindGroup {
    let buffers = [parameters, target.viewports, target.tiles, target.pixels, target.partial_sums];
    bind_in_order(gpu, pipeline, 0, &buffers)
}
