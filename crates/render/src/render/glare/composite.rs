//! The glare pass over pixels: keeps what is not scattered of every pixel's light and adds what is scattered towards it.
//! Shader: `shaders/glare/composite.wgsl`.

use crate::render::{constants::glare_composite::BLOCK_COLUMNS, shader::Shader};
use crate::{
    gpu::{Gpu, bind_buffers},
    render::{
        glare::layout,
        tabulated::projecting,
        targets::{COLUMNS, PictureTarget, bind_picture},
    },
};

/// Runs of rows of one workgroup on a GPU.
const ROW_GROUPS: u32 = 8;

/// Runs of rows of one workgroup on this adapter.
pub(crate) fn row_groups(gpu: &Gpu) -> u32 {
    if gpu.software { 1 } else { ROW_GROUPS }
}

/// Workgroups over the pixels of a batch, of which a grid tells the blocks.
pub(crate) fn workgroups([columns, rows, tiles]: [u32; 3], row_groups: u32) -> [u32; 3] {
    [columns * (COLUMNS / BLOCK_COLUMNS), rows.div_ceil(row_groups), tiles]
}

/// Where the pass finds what is scattered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum GlareSource {
    /// On the sky: a map of the whole sky, and the brightest sources one by one.
    Sky,
    /// On the picture: a pyramid of blurred images.
    Pyramid,
}

impl GlareSource {
    fn shader(self, gpu: &Gpu) -> Shader {
        match self {
            Self::Sky => projecting(gpu, "glare/composite").with("scattered", "glare/sky_cube/scattered"),
            Self::Pyramid => Shader::new("glare/composite").with("scattered", "glare/pyramid/scattered"),
        }
    }
}

/// The pass for one source of glare. Copies share its pipeline.
#[derive(Clone)]
pub(crate) struct GlareCompositePass {
    pipeline: wgpu::ComputePipeline,
    /// Runs of rows of one workgroup.
    row_groups: u32,
    /// Whether its shader projects.
    projects: bool,
}

impl GlareCompositePass {
    /// The pass with values for the constants of its source.
    pub(crate) fn new(gpu: &Gpu, source: GlareSource, constants: &[(&str, f64)]) -> Self {
        let row_groups = row_groups(gpu);
        let of_groups = ("ROW_GROUPS", f64::from(row_groups));
        let constants: Vec<_> = constants.iter().copied().chain([of_groups]).collect();
        Self {
            pipeline: gpu.compute_pipeline_with(&source.shader(gpu).source(), &constants),
            row_groups,
            projects: source == GlareSource::Sky,
        }
    }

    /// Records the pass. `of_source` is what the source of glare binds in group 1.
    pub(crate) fn record(
        &self,
        gpu: &Gpu,
        pass: &mut wgpu::ComputePass<'_>,
        fraction: f64,
        target: &PictureTarget<'_>,
        of_source: &[(u32, wgpu::BindingResource<'_>)],
        grid: [u32; 3],
    ) {
        let parameters = layout::GlareParameters {
            fraction: fraction as f32,
            plane_pixels: target.plane_pixels,
            ..Default::default()
        };
        let parameters = gpu.frame_uniform("glare parameters", &parameters);
        let group = bind_picture(gpu, &self.pipeline, &parameters, target);
        pass.set_pipeline(&self.pipeline);
        if self.projects {
            gpu.bind_tables(pass, &self.pipeline);
        }
        pass.set_bind_group(0, &group, &[]);
        pass.set_bind_group(1, &bind_buffers(gpu, &self.pipeline, 1, of_source), &[]);
        let [columns, rows, tiles] = workgroups(grid, self.row_groups);
        pass.dispatch_workgroups(columns, rows, tiles);
    }
}
