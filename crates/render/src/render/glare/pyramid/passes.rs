//! Passes of the published glare pyramids: the brightest channel of a frame, the base, the blurs, and the sum over the
//! levels.
//!
//! Shaders: `shaders/glare/pyramid/`; the f64 twin is `crate::reference::glare::pyramid`.
//!
//! Levels are half floats, as published. The light is scaled by the brightest channel of the frame, so that light 2^28 times fainter (21 magnitudes)
//! still has all eleven bits. This is sufficient if values are rounded to the nearest before they are stored: compared with the twin, which does not
//! round, at most 1.4e-4 of the scattered light is lost, and 1.6e-3 of it in the worst pixel (twelve projections, and 1920 x 1080 pixels with stars
//! 17 magnitudes apart). If the driver truncates instead, as the software driver does, these losses are 3e-3 and 5.6e-3.
//!
//! No shader: the passes of shaders/glare/pyramid.
//! No twin: reference/glare/pyramid.rs.

use crate::render::{constants::workgroups::PYRAMID_SIDE, shader::Shader};
use crate::{
    gpu::{Gpu, bind_buffers},
    plan::{
        glare::pyramid::{PyramidAxes, PyramidPlan, level_ratio, tap_weights, texel_px},
        settings::PyramidWeights,
    },
    render::{glare::layout, tabulated::projecting, targets::BatchTargets},
};

/// Passes for one pair of axes.
pub(crate) struct GlarePyramidPass {
    maximum: wgpu::ComputePipeline,
    base: wgpu::ComputePipeline,
    blur: wgpu::ComputePipeline,
    combine: wgpu::ComputePipeline,
    bilinear: wgpu::Sampler,
    /// Whether the blur's shader uses the projection.
    projects: bool,
}

/// Textures of one pyramid, used by every viewport of this size in turn.
pub(crate) struct PyramidTextures {
    pub plan: PyramidPlan,
    /// A view of each level, and a view of all levels.
    levels: Vec<wgpu::TextureView>,
    all_levels: wgpu::TextureView,
    /// Every level after the blur along the first axis. In the end, level 0 holds the sum over all levels.
    between: Vec<wgpu::TextureView>,
}

/// A tile, with the picture that contains it.
#[derive(Clone, Copy)]
pub(crate) struct PyramidTile<'a> {
    pub tile: layout::Tile,
    pub pixels: &'a wgpu::Buffer,
    /// Pixels of the batch.
    pub plane_pixels: u32,
}

impl PyramidTextures {
    /// Creates textures for pictures of the given size, pixels.
    pub(crate) fn new(gpu: &Gpu, picture: [u32; 2]) -> Self {
        let plan = PyramidPlan::new(picture);
        let [width, height] = plan.sizes[0];
        let texture = |label| {
            gpu.device.create_texture(&wgpu::TextureDescriptor {
                label: Some(label),
                size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
                mip_level_count: plan.sizes.len() as u32,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D2,
                format: wgpu::TextureFormat::Rgba16Float,
                usage: wgpu::TextureUsages::STORAGE_BINDING | wgpu::TextureUsages::TEXTURE_BINDING,
                view_formats: &[],
            })
        };
        let (blurred, between) = (texture("glare levels"), texture("glare between axes"));
        let views = |texture: &wgpu::Texture| -> Vec<wgpu::TextureView> {
            let level = |level: usize| {
                texture.create_view(&wgpu::TextureViewDescriptor {
                    base_mip_level: level as u32,
                    mip_level_count: Some(1),
                    ..Default::default()
                })
            };
            (0..plan.sizes.len()).map(level).collect()
        };
        Self {
            levels: views(&blurred),
            all_levels: blurred.create_view(&wgpu::TextureViewDescriptor::default()),
            between: views(&between),
            plan,
        }
    }

    /// Returns the result of the passes: scattered light at half the picture's resolution, scaled.
    pub(crate) fn combined(&self) -> &wgpu::TextureView {
        &self.between[0]
    }
}

impl GlarePyramidPass {
    pub(crate) fn new(gpu: &Gpu, axes: PyramidAxes) -> Self {
        let blur = match axes {
            PyramidAxes::Screen => Shader::new("glare/pyramid/blur").with("taps", "glare/pyramid/taps_screen"),
            PyramidAxes::View => projecting(gpu, "glare/pyramid/blur").with("taps", "glare/pyramid/taps_view"),
        };
        Self {
            maximum: gpu.compute_pipeline(&Shader::new("glare/pyramid/maximum").source()),
            base: gpu.compute_pipeline(&Shader::new("glare/pyramid/base").source()),
            blur: gpu.compute_pipeline(&blur.source()),
            combine: gpu.compute_pipeline(&Shader::new("glare/pyramid/combine").source()),
            bilinear: gpu.device.create_sampler(&wgpu::SamplerDescriptor {
                label: Some("glare"),
                mag_filter: wgpu::FilterMode::Linear,
                min_filter: wgpu::FilterMode::Linear,
                ..Default::default()
            }),
            projects: axes == PyramidAxes::View,
        }
    }

    /// Returns the sampler that interpolates between texels and clamps to the edge.
    pub(crate) fn bilinear(&self) -> &wgpu::Sampler {
        &self.bilinear
    }

    /// Records the search for the brightest channel of one batch. `maximum` must be zero before the first batch.
    pub(crate) fn find_maximum(
        &self,
        gpu: &Gpu,
        pass: &mut wgpu::ComputePass<'_>,
        viewports: &wgpu::Buffer,
        batch: &BatchTargets,
        maximum: &wgpu::Buffer,
    ) {
        let parameters = layout::GlareMaximumParameters { plane_pixels: batch.plane_pixels, ..Default::default() };
        let parameters = gpu.frame_uniform("glare maximum parameters", &parameters);
        let resources = [
            (0, parameters.as_entire_binding()),
            (1, viewports.as_entire_binding()),
            (2, batch.tiles.as_entire_binding()),
            (3, batch.pixels.as_entire_binding()),
            (4, maximum.as_entire_binding()),
        ];
        dispatch(gpu, pass, &self.maximum, &resources, batch.grid);
    }

    /// Records the base of each tile, then the blurs and the sum over the levels.
    pub(crate) fn record(
        &self,
        gpu: &Gpu,
        pass: &mut wgpu::ComputePass<'_>,
        frame: &PyramidFrame<'_>,
        textures: &PyramidTextures,
        tiles: &[PyramidTile<'_>],
    ) {
        // Base of the pyramid, tile by tile.
        let [width, _] = textures.plan.sizes[0];
        for (index, upper) in tiles.iter().enumerate() {
            let lower = tiles.get(index + 1).unwrap_or(upper);
            let parameters = layout::GlareBaseParameters {
                upper: upper.tile,
                lower: lower.tile,
                upper_plane_pixels: upper.plane_pixels,
                lower_plane_pixels: lower.plane_pixels,
                ..Default::default()
            };
            let parameters = gpu.frame_uniform("glare base parameters", &parameters);
            let resources = [
                (0, parameters.as_entire_binding()),
                (1, frame.viewports.as_entire_binding()),
                (2, upper.pixels.as_entire_binding()),
                (3, lower.pixels.as_entire_binding()),
                (4, frame.maximum.as_entire_binding()),
                (5, view(&textures.levels[0])),
            ];
            // If a tile begins at an odd row, it needs one row more than half of its rows.
            dispatch(gpu, pass, &self.base, &resources, grid_of([width, upper.tile.rows / 2 + 1]));
        }
        // Blurs of each level along both axes.
        for (level, size) in textures.plan.sizes.iter().enumerate() {
            for axis in 0..2 {
                let (from, to) = match axis {
                    0 => (&textures.levels[level.saturating_sub(1)], &textures.between[level]),
                    _ => (&textures.between[level], &textures.levels[level]),
                };
                let parameters = blur_parameters(frame, level, axis);
                let parameters = gpu.frame_uniform("glare blur parameters", &parameters);
                let resources = [
                    (0, parameters.as_entire_binding()),
                    (1, frame.viewports.as_entire_binding()),
                    (2, view(from)),
                    (3, wgpu::BindingResource::Sampler(&self.bilinear)),
                    (4, view(to)),
                ];
                pass.set_pipeline(&self.blur);
                if self.projects {
                    gpu.bind_tables(pass, &self.blur);
                }
                dispatch(gpu, pass, &self.blur, &resources, grid_of(*size));
            }
        }
        // Weighted sum over the levels.
        let parameters = layout::GlareCombineParameters {
            first_weight: textures.plan.level_weights(frame.weights)[0] as f32,
            ratio: level_ratio(frame.weights) as f32,
            levels: textures.plan.sizes.len() as u32,
            ..Default::default()
        };
        let parameters = gpu.frame_uniform("glare combine parameters", &parameters);
        let resources = [
            (0, parameters.as_entire_binding()),
            (1, view(&textures.all_levels)),
            (2, wgpu::BindingResource::Sampler(&self.bilinear)),
            (3, view(&textures.between[0])),
        ];
        dispatch(gpu, pass, &self.combine, &resources, grid_of(textures.plan.sizes[0]));
    }
}

/// Inputs of a viewport's pyramid.
pub(crate) struct PyramidFrame<'a> {
    pub weights: PyramidWeights,
    pub viewports: &'a wgpu::Buffer,
    /// The brightest channel of the frame.
    pub maximum: &'a wgpu::Buffer,
    /// Index of the viewport.
    pub viewport: u32,
    /// Angle of a pixel at the centre of the picture, rad.
    pub pixel_rad: f64,
}

fn blur_parameters(frame: &PyramidFrame<'_>, level: usize, axis: u32) -> layout::GlareBlurParameters {
    let step_rad = frame.pixel_rad * texel_px(level);
    let angle = |k: usize| k as f64 * step_rad;
    layout::GlareBlurParameters {
        weights: tap_weights().map(|weight| weight as f32),
        cosines: std::array::from_fn(|k| angle(k).cos() as f32),
        sines: std::array::from_fn(|k| angle(k).sin() as f32),
        viewport: frame.viewport,
        axis,
        ..Default::default()
    }
}

fn view(view: &wgpu::TextureView) -> wgpu::BindingResource<'_> {
    wgpu::BindingResource::TextureView(view)
}

fn grid_of([width, height]: [u32; 2]) -> [u32; 3] {
    [width.div_ceil(PYRAMID_SIDE), height.div_ceil(PYRAMID_SIDE), 1]
}

fn dispatch(
    gpu: &Gpu,
    pass: &mut wgpu::ComputePass<'_>,
    pipeline: &wgpu::ComputePipeline,
    resources: &[(u32, wgpu::BindingResource<'_>)],
    grid: [u32; 3],
) {
    pass.set_pipeline(pipeline);
    pass.set_bind_group(0, &bind_buffers(gpu, pipeline, 0, resources), &[]);
    pass.dispatch_workgroups(grid[0], grid[1], grid[2]);
}
