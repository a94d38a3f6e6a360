//! The resolve pass of methods that leave luminance instead of illuminance: what a pixel holds goes, with its solid angle,
//! where the exposure and tone-mapping passes read it. Shader: `shaders/display/resolve_luminance.wgsl`.

use super::shared::{PictureTarget, bind_buffers, bind_picture};
use crate::gpu::{self, Gpu, Shader, layout};

/// Where a method that leaves luminance instead of illuminance has left it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum LuminanceSource {
    /// Halves of a word: the published rasteriser.
    Packed,
    /// A texture of the picture itself.
    Texture,
    /// Six textures: the faces of a cube around the view's axes.
    Cube,
    /// Nowhere: the procedural sky is computed here.
    CellSky,
}

impl LuminanceSource {
    fn shader(self) -> Shader {
        let luminance = match self {
            Self::Packed => "display/luminance_packed",
            Self::Texture => "display/luminance_texture",
            Self::Cube => "display/luminance_cube",
            Self::CellSky => "display/luminance_cell_sky",
        };
        Shader::new("display/resolve_luminance").with("luminance", luminance)
    }
}

/// The pass for one source of luminance.
pub(crate) struct LuminancePass {
    pipeline: wgpu::ComputePipeline,
}

impl LuminancePass {
    pub(crate) fn new(gpu: &Gpu, source: LuminanceSource) -> Self {
        Self { pipeline: gpu.compute_pipeline(&source.shader().source()) }
    }

    /// Records the pass. `scale` is in cd/m^2 per unit of what the method left, `of_source` what the source of luminance
    /// binds in group 1, `numbers` its two parameters.
    #[expect(clippy::too_many_arguments, reason = "a pass takes its settings and its buffers")]
    pub(crate) fn record(
        &self,
        gpu: &Gpu,
        pass: &mut wgpu::ComputePass<'_>,
        scale: f32,
        numbers: [u32; 2],
        target: &PictureTarget<'_>,
        of_source: &[(u32, wgpu::BindingResource<'_>)],
        grid: [u32; 3],
    ) {
        let parameters = layout::LuminanceParameters {
            plane_pixels: target.plane_pixels,
            scale,
            source_0: numbers[0],
            source_1: numbers[1],
        };
        let parameters = gpu::uniform_buffer(gpu, "luminance parameters", &parameters);
        let group = bind_picture(gpu, &self.pipeline, &parameters, target);
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &group, &[]);
        if !of_source.is_empty() {
            pass.set_bind_group(1, &bind_buffers(gpu, &self.pipeline, 1, of_source), &[]);
        }
        pass.dispatch_workgroups(grid[0], grid[1], grid[2]);
    }
}
