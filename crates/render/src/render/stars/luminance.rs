//! The resolve pass of methods that output luminance instead of illuminance: writes the luminance and the solid angle of each pixel to the buffer
//! that the exposure and tone-mapping passes read. Shader: `shaders/stars/luminance.wgsl`.
//!
//! No twin: the twins of the methods return luminance, so there is no division.

use crate::render::shader::Shader;
use crate::{
    gpu::{Gpu, bind_buffers},
    render::{
        stars::layout,
        tabulated::projecting,
        targets::{PictureTarget, bind_picture},
    },
};

/// Source of the luminance.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum LuminanceSource {
    /// Two half floats per word: the published rasteriser.
    Packed,
    /// A texture of the picture itself.
    Texture,
    /// Six textures: the faces of a cube around the view's axes.
    Cube,
    /// No stored source: the procedural sky is computed in this pass.
    CellSky,
}

impl LuminanceSource {
    fn shader(self, gpu: &Gpu) -> Shader {
        let luminance = match self {
            Self::Packed => "stars/luminance_packed",
            Self::Texture => "stars/luminance_texture",
            Self::Cube => "stars/luminance_cube",
            Self::CellSky => "stars/luminance_cell_sky",
        };
        projecting(gpu, "stars/luminance").with("luminance", luminance)
    }
}

/// Inputs of the resolve pass.
pub(crate) struct LuminanceInputs<'a> {
    /// cd/m^2 per unit of the method's output.
    pub scale: f32,
    /// Parameters of the source of luminance.
    pub numbers: [u32; 2],
    /// Bindings of the source, in group 1.
    pub source_bindings: &'a [(u32, wgpu::BindingResource<'a>)],
}

/// The pass for one source of luminance.
pub(crate) struct LuminancePass {
    pipeline: wgpu::ComputePipeline,
}

impl LuminancePass {
    pub(crate) fn new(gpu: &Gpu, source: LuminanceSource) -> Self {
        Self { pipeline: gpu.compute_pipeline(&source.shader(gpu).source()) }
    }

    /// Records the pass over a picture.
    pub(crate) fn record(
        &self,
        gpu: &Gpu,
        pass: &mut wgpu::ComputePass<'_>,
        inputs: &LuminanceInputs<'_>,
        target: &PictureTarget<'_>,
        grid: [u32; 3],
    ) {
        let LuminanceInputs { scale, numbers, source_bindings } = *inputs;
        let parameters = layout::LuminanceParameters {
            plane_pixels: target.plane_pixels,
            scale,
            source_0: numbers[0],
            source_1: numbers[1],
        };
        let parameters = gpu.frame_uniform("luminance parameters", &parameters);
        let group = bind_picture(gpu, &self.pipeline, &parameters, target);
        pass.set_pipeline(&self.pipeline);
        gpu.bind_tables(pass, &self.pipeline);
        pass.set_bind_group(0, &group, &[]);
        if !source_bindings.is_empty() {
            pass.set_bind_group(1, &bind_buffers(gpu, &self.pipeline, 1, source_bindings), &[]);
        }
        pass.dispatch_workgroups(grid[0], grid[1], grid[2]);
    }
}
