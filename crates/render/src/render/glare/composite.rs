//! The glare pass over pixels: keeps the unscattered part of each pixel's light and adds the light scattered towards
//! it. Shader: `shaders/glare/composite.wgsl`.
//!
//! No twin: reference/glare/sky_cube.rs and pyramid.rs.

use crate::render::shader::Shader;
use crate::{
    gpu::{Gpu, bind_buffers},
    render::{
        glare::layout,
        tabulated::projecting,
        targets::{PictureTarget, bind_picture, row_groups, workgroups},
    },
};

/// Source of the scattered light.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum GlareSource {
    /// On the sky: a map of the whole sky, and the brightest sources individually.
    Sky,
    /// In the picture: a pyramid of blurred images.
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

/// The pass for one source of glare. Clones share its pipeline.
#[derive(Clone)]
pub(crate) struct GlareCompositePass {
    pipeline: wgpu::ComputePipeline,
    /// Number of row runs per workgroup.
    row_groups: u32,
    /// Whether its shader uses the projection.
    projects: bool,
}

impl GlareCompositePass {
    /// Creates the pass with values for the constants of its source.
    pub(crate) fn new(gpu: &Gpu, source: GlareSource, constants: &[(&str, f64)]) -> Self {
        let row_groups = row_groups(gpu);
        let row_constant = ("ROW_GROUPS", f64::from(row_groups));
        let constants: Vec<_> = constants.iter().copied().chain([row_constant]).collect();
        Self {
            pipeline: gpu.compute_pipeline_with(&source.shader(gpu).source(), &constants),
            row_groups,
            projects: source == GlareSource::Sky,
        }
    }

    /// Records the pass. `source_bindings` are the bindings of group 1, which belong to the source of glare.
    pub(crate) fn record(
        &self,
        gpu: &Gpu,
        pass: &mut wgpu::ComputePass<'_>,
        fraction: f64,
        target: &PictureTarget<'_>,
        source_bindings: &[(u32, wgpu::BindingResource<'_>)],
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
        pass.set_bind_group(1, &bind_buffers(gpu, &self.pipeline, 1, source_bindings), &[]);
        let [columns, rows, tiles] = workgroups(grid, self.row_groups);
        pass.dispatch_workgroups(columns, rows, tiles);
    }
}
