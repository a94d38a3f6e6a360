//! The geometry pass: finds the surfaces of bodies and asteroids that the pixels of a tile show. A separate shader draws those pixels again in which
//! the limb of a body crosses another body.
//!
//! Shaders: `shaders/bodies/rays.wgsl` and `shaders/bodies/crossed.wgsl`; the f64 twin of its bodies is `crate::reference::bodies::rays`.

use crate::render::constants::workgroups::RAY_SIDE;
use crate::{
    gpu::{Gpu, Variants, bind_buffers, bind_in_order},
    plan::bodies::blocks::BLOCK_PX,
    render::{bodies::layout, shader::rolled_loops, tabulated::projecting, targets::RasterLayers},
};

/// Pipelines of the geometry pass.
pub(crate) struct GeometryPass {
    /// One pipeline per form.
    pipelines: Variants<RayForm, wgpu::ComputePipeline>,
    /// Pipelines of the pixels with crossing limbs, indexed by [`RayForm::has_circle`].
    crossed: Variants<bool, wgpu::ComputePipeline>,
    /// Placeholders for missing layers.
    no_layers: [wgpu::TextureView; 4],
}

/// Form of the pass.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct RayForm {
    /// Whether there are layers of asteroids.
    pub has_layers: bool,
    /// Whether blocks with surfaces are marked as not plain.
    pub has_plain: bool,
    /// Whether the eye of the picture is on a viewing circle.
    pub has_circle: bool,
}

/// Buffers of a frame and of the tile's batch.
pub(crate) struct GeometryTarget<'a> {
    pub viewports: &'a wgpu::Buffer,
    pub tiles: &'a wgpu::Buffer,
    pub geometry: &'a wgpu::Buffer,
    pub view_bodies: &'a wgpu::Buffer,
    pub body_runs: &'a wgpu::Buffer,
    pub suns: &'a wgpu::Buffer,
    pub texels: &'a wgpu::Buffer,
    /// Blocks of the tile that are drawn.
    pub blocks: &'a wgpu::Buffer,
    /// Number of blocks.
    pub block_count: u32,
    pub counters: &'a wgpu::Buffer,
    /// Grids of plain blocks, or a placeholder.
    pub plain_list: &'a wgpu::Buffer,
    /// Whether the frame has plain blocks.
    pub has_plain: bool,
}

/// Tile to draw.
#[derive(Clone, Copy)]
pub(crate) struct RayTile<'a> {
    /// Index of the tile in its batch.
    pub index: u32,
    /// Layers of asteroids drawn before, if any.
    pub layers: Option<&'a RasterLayers>,
    /// Whether the eye of the picture is on a viewing circle.
    pub has_circle: bool,
    /// See [`crate::plan::bodies::seen::BodyPlan::crosses`].
    pub may_cross: bool,
}

fn pipeline(gpu: &Gpu, form: RayForm) -> impl FnOnce() -> wgpu::ComputePipeline + Send + 'static {
    let constants = [("HAS_LAYERS", form.has_layers), ("HAS_PLAIN", form.has_plain), ("HAS_CIRCLE", form.has_circle)];
    create(gpu, "bodies/rays", constants)
}

fn crossed_pipeline(gpu: &Gpu, has_circle: bool) -> impl FnOnce() -> wgpu::ComputePipeline + Send + 'static {
    create(gpu, "bodies/crossed", [("HAS_CIRCLE", has_circle)])
}

/// Returns a function that creates a pipeline for a shader that uses the projection.
fn create<const N: usize>(
    gpu: &Gpu,
    file: &str,
    constants: [(&'static str, bool); N],
) -> impl FnOnce() -> wgpu::ComputePipeline + Send + 'static {
    let mut constants: Vec<_> = constants.map(|(name, value)| (name, f64::from(u8::from(value)))).into();
    constants.push(rolled_loops(gpu));
    let (pipelines, shader) = (gpu.compute_pipelines(), projecting(gpu, file));
    move || pipelines.create(&shader.source(), &constants)
}

/// Returns an empty texture of one texel, as a placeholder.
fn stand_in(gpu: &Gpu, format: wgpu::TextureFormat, dimension: wgpu::TextureViewDimension) -> wgpu::TextureView {
    let texture = gpu.device.create_texture(&wgpu::TextureDescriptor {
        label: Some("no layer"),
        size: wgpu::Extent3d { width: 1, height: 1, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format,
        usage: wgpu::TextureUsages::TEXTURE_BINDING,
        view_formats: &[],
    });
    texture.create_view(&wgpu::TextureViewDescriptor { dimension: Some(dimension), ..Default::default() })
}

impl GeometryPass {
    pub(crate) fn new(gpu: &Gpu) -> Self {
        use wgpu::{
            TextureFormat::{Depth32Float, Rgba16Float},
            TextureViewDimension::{D2, D2Array},
        };
        Self {
            pipelines: Variants::new(),
            crossed: Variants::new(),
            no_layers: [(Rgba16Float, D2), (Depth32Float, D2), (Rgba16Float, D2Array), (Depth32Float, D2Array)]
                .map(|(format, dimension)| stand_in(gpu, format, dimension)),
        }
    }

    /// Returns the pipeline of a form.
    pub(crate) fn pipeline(&self, gpu: &Gpu, form: RayForm) -> wgpu::ComputePipeline {
        self.pipelines.get(form, || pipeline(gpu, form)())
    }

    /// Returns a job that creates the pipeline of a form.
    pub(crate) fn pipeline_job(&self, gpu: &Gpu, form: RayForm) -> impl FnOnce() + Send + 'static {
        self.pipelines.job(form, pipeline(gpu, form))
    }

    /// Returns a job that creates the pipeline for pixels with crossing limbs.
    pub(crate) fn crossed_job(&self, gpu: &Gpu, has_circle: bool) -> impl FnOnce() + Send + 'static {
        self.crossed.job(has_circle, crossed_pipeline(gpu, has_circle))
    }

    /// Records one tile.
    pub(crate) fn record(
        &self,
        gpu: &Gpu,
        pass: &mut wgpu::ComputePass<'_>,
        tile: &RayTile<'_>,
        target: &GeometryTarget<'_>,
    ) {
        let RayTile { index, layers, has_circle, may_cross } = *tile;
        let form = RayForm { has_layers: layers.is_some(), has_plain: target.has_plain, has_circle };
        let pipeline = &self.pipeline(gpu, form);
        let mut parameters = layout::GeometryParameters { tile: index, ..Default::default() };
        if let Some(layers) = layers {
            parameters.samples = layers.samples;
            parameters.faces = layers.faces;
            parameters.face_size = layers.face_size_px;
            parameters.near_m = layers.near_m;
            parameters.luminance_scale = layers.luminance_scale;
        }
        let parameters = gpu.frame_uniform("geometry parameters", &parameters);
        let buffers = [
            &parameters,
            target.viewports,
            target.tiles,
            target.geometry,
            target.view_bodies,
            target.body_runs,
            target.suns,
            target.texels,
            target.blocks,
            target.counters,
            target.plain_list,
        ];
        pass.set_pipeline(pipeline);
        gpu.bind_tables(pass, pipeline);
        pass.set_bind_group(0, &bind_in_order(gpu, pipeline, 0, &buffers), &[]);
        let [colour, depth, faces_colour, faces_depth] = &self.no_layers;
        let views = match layers {
            Some(layers) if layers.faces != 0 => {
                [&layers.colour, &layers.depth, &layers.faces_colour, &layers.faces_depth]
            }
            Some(layers) => [&layers.colour, &layers.depth, faces_colour, faces_depth],
            None => [colour, depth, faces_colour, faces_depth],
        };
        let views: Vec<_> =
            (0..).zip(views).map(|(binding, view)| (binding, wgpu::BindingResource::TextureView(view))).collect();
        pass.set_bind_group(1, &bind_buffers(gpu, pipeline, 1, &views), &[]);
        let groups = BLOCK_PX / RAY_SIDE;
        pass.dispatch_workgroups(groups, groups, target.block_count);
        if may_cross {
            let pipeline = &self.crossed.get(has_circle, || crossed_pipeline(gpu, has_circle)());
            pass.set_pipeline(pipeline);
            gpu.bind_tables(pass, pipeline);
            pass.set_bind_group(0, &bind_in_order(gpu, pipeline, 0, &buffers[..9]), &[]);
            pass.dispatch_workgroups(groups, groups, target.block_count);
        }
    }
}
