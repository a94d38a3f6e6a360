//! Splats asteroid impostors: compute passes find the nearest impostor of every sample of a target, and light each
//! sample once.
//!
//! Shaders: `shaders/asteroids/impostors/{footprint,splat*}.wgsl`.
//!
//! Most impostors are a few pixels wide. On a software driver a square in the rasteriser costs microseconds even if it
//! is tiny, and it is lit before its visibility is known.
//!
//! No twin: reference/asteroids/impostors/picture.rs.

use super::atlas::ImpostorAtlas;
use crate::render::constants::impostors::SPLAT_THREADS;
use crate::{
    gpu::{Gpu, GpuTimer, GrowingBuffer, LayoutOf, bind_buffers},
    plan::asteroids::frame::Splats,
    render::{
        asteroids::{
            layout,
            raster::{ASTEROID_ARGUMENT_BYTES, AsteroidPipeline},
        },
        constants::impostors::SPLAT_BLOCK,
        shader::{Shader, workgroup},
        technique::begin_pass,
    },
};

/// Bytes of a sample: depth and entry.
const SAMPLE_BYTES: u64 = 8;
/// Maximum size of the sample buffer. Larger targets are splatted in bands.
const BAND_BYTES: u64 = 128 << 20;
/// Corners of the triangle that covers a target.
const TARGET_CORNERS: u32 = 3;

/// Pipelines of the splat pass.
pub(crate) struct AsteroidSplatPass {
    begin: wgpu::ComputePipeline,
    /// Pipelines that find depth and owner of each sample: for impostors without and with parallax.
    nearest: [wgpu::ComputePipeline; 2],
    /// Pipelines that light the samples: for impostors without and with parallax.
    light: [wgpu::ComputePipeline; 2],
    depth: wgpu::RenderPipeline,
    /// Impostors per workgroup.
    pub per_workgroup: u32,
}

/// Buffers read by the shaders of `shaders/asteroids/listed.wgsl`, and those of the splats.
pub(crate) struct SplatLists<'a> {
    /// `layout::AsteroidTarget`.
    pub target: &'a wgpu::Buffer,
    pub items: &'a wgpu::Buffer,
    pub fields: &'a wgpu::Buffer,
    pub instances: &'a wgpu::Buffer,
    pub entries: &'a wgpu::Buffer,
    pub tables: &'a wgpu::Buffer,
    /// Indirect arguments of each list: see `shaders/asteroids/cull_offsets.wgsl`.
    pub arguments: &'a wgpu::Buffer,
    /// Number of impostors hidden by nearer ones, per plane; then one word per entry of the current list.
    pub still_seen: &'a wgpu::Buffer,
}

/// List to splat.
pub(crate) struct SplatList<'a> {
    /// Index among the lists of all planes.
    pub list: u64,
    /// Atlas of its impostors.
    pub atlas: &'a ImpostorAtlas,
    /// Buffers that contain the list.
    pub lists: &'a SplatLists<'a>,
}

/// Target of the splats: colour and depth, which already contain the meshes.
#[derive(Clone, Copy)]
pub(crate) struct SplatLayers<'a> {
    pub colour: &'a wgpu::TextureView,
    pub depth: &'a wgpu::TextureView,
    /// Columns and rows, samples.
    pub size: [u32; 2],
}

impl AsteroidSplatPass {
    pub(crate) fn new(gpu: &Gpu) -> Self {
        let threads = workgroup(gpu).min(SPLAT_THREADS);
        let source = |name: &str| Shader::new(name).source();
        let samples = if gpu.wide_accumulator { "samples_u64" } else { "samples_u32" };
        let samples = format!("asteroids/impostors/{samples}");
        let task = |task: &str, parallax: f64| {
            let shader = Shader::new("asteroids/impostors/splat").with("samples", &samples).with("task", task).source();
            gpu.compute_pipeline_with(&shader, &[("WORKGROUP", f64::from(threads)), ("PARALLAX", parallax)])
        };
        let shaders = [&source("shared/whole_target"), &source("asteroids/impostors/splat_depth")];
        let depth = AsteroidPipeline {
            shaders,
            constants: &[],
            groups: None,
            buffers: &[],
            primitive: wgpu::PrimitiveState::default(),
            colour: false,
        };
        Self {
            begin: gpu.compute_pipeline(&source("asteroids/impostors/splat_begin")),
            nearest: [0.0, 1.0].map(|parallax| task("asteroids/impostors/splat_nearest", parallax)),
            light: [0.0, 1.0].map(|parallax| task("asteroids/impostors/splat_light", parallax)),
            depth: depth.make(gpu),
            per_workgroup: threads,
        }
    }

    /// Records the splats of one list onto a target. `samples` holds the samples of one band at a time.
    #[expect(clippy::too_many_arguments, reason = "a list, its buffers and its target")]
    pub(crate) fn record(
        &self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        timer: &mut GpuTimer,
        splats: &Splats,
        list: &SplatList<'_>,
        layers: SplatLayers<'_>,
        samples: &mut GrowingBuffer,
    ) {
        let [width, height] = layers.size;
        let band_bytes = BAND_BYTES.min(gpu.max_binding_bytes());
        let blocks = width.div_ceil(SPLAT_BLOCK);
        let block_row_bytes = SAMPLE_BYTES * u64::from(blocks * SPLAT_BLOCK * SPLAT_BLOCK);
        let block_rows = ((band_bytes / block_row_bytes) as u32).clamp(1, height.div_ceil(SPLAT_BLOCK));
        let samples = samples.with_room(gpu, block_row_bytes * u64::from(block_rows)).clone();
        let band_rows = block_rows * SPLAT_BLOCK;
        for first_row in (0..height).step_by(band_rows as usize) {
            let band = layout::SplatBand { width, first_row, rows: band_rows.min(height - first_row), blocks };
            let band_uniform = gpu.frame_uniform("asteroid splat band", &band);
            {
                let mut pass = begin_pass(encoder, timer, "asteroid splats");
                self.begin(gpu, &mut pass, &band, &band_uniform, layers, &samples);
                self.splat(gpu, &mut pass, splats, list, &band, layers, &samples);
            }
            let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some("asteroid splats"),
                depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                    view: layers.depth,
                    depth_ops: Some(wgpu::Operations { load: wgpu::LoadOp::Load, store: wgpu::StoreOp::Store }),
                    stencil_ops: None,
                }),
                timestamp_writes: timer.render_pass("asteroid splats"),
                ..Default::default()
            });
            pass.set_viewport(0.0, 0.0, width as f32, height as f32, 0.0, 1.0);
            pass.set_scissor_rect(0, first_row, width, band.rows);
            pass.set_pipeline(&self.depth);
            let bindings = [(0, band_uniform.as_entire_binding()), (1, samples.as_entire_binding())];
            pass.set_bind_group(0, &gpu.bind(LayoutOf::Render(&self.depth, 0), &bindings), &[]);
            pass.draw(0..TARGET_CORNERS, 0..1);
        }
    }

    /// Initialises every sample of a band with the depth already drawn.
    fn begin(
        &self,
        gpu: &Gpu,
        pass: &mut wgpu::ComputePass<'_>,
        band: &layout::SplatBand,
        band_uniform: &wgpu::Buffer,
        layers: SplatLayers<'_>,
        samples: &wgpu::Buffer,
    ) {
        let bindings = [
            (0, band_uniform.as_entire_binding()),
            (1, wgpu::BindingResource::TextureView(layers.depth)),
            (2, samples.as_entire_binding()),
        ];
        pass.set_pipeline(&self.begin);
        pass.set_bind_group(0, &bind_buffers(gpu, &self.begin, 0, &bindings), &[]);
        pass.dispatch_workgroups(band.width.div_ceil(SPLAT_BLOCK), band.rows.div_ceil(SPLAT_BLOCK), 1);
    }

    /// Finds the depth and the owner of every sample, and lights the samples.
    #[expect(clippy::too_many_arguments, reason = "a list, its buffers and its target")]
    fn splat(
        &self,
        gpu: &Gpu,
        pass: &mut wgpu::ComputePass<'_>,
        splats: &Splats,
        SplatList { list, atlas, lists }: &SplatList<'_>,
        band: &layout::SplatBand,
        layers: SplatLayers<'_>,
        samples: &wgpu::Buffer,
    ) {
        let target = |stage: u32| {
            let target = layout::SplatTarget {
                band: *band,
                arguments: (list * ASTEROID_ARGUMENT_BYTES / 4) as u32,
                stage,
                quality: splats.quality as f32,
                tile_error_rad: splats.tile_error_rad as f32,
            };
            gpu.frame_uniform("asteroid splats", &target)
        };
        let targets = [0, 1, 2].map(target);
        let steps = [&self.nearest, &self.nearest, &self.light];
        for ((stage, pipelines), target) in (0..).zip(steps).zip(&targets) {
            // If one 64-bit word holds both depth and entry, the second stage is unnecessary.
            if stage == 1 && gpu.wide_accumulator {
                continue;
            }
            for pipeline in pipelines {
                pass.set_pipeline(pipeline);
                lists.bind(gpu, pass, pipeline, atlas);
                let mut bindings = vec![
                    (0, target.as_entire_binding()),
                    (1, samples.as_entire_binding()),
                    (2, lists.arguments.as_entire_binding()),
                    (3, lists.still_seen.as_entire_binding()),
                ];
                if stage == 2 {
                    bindings.push((4, wgpu::BindingResource::TextureView(layers.colour)));
                }
                pass.set_bind_group(2, &bind_buffers(gpu, pipeline, 2, &bindings), &[]);
                pass.dispatch_workgroups_indirect(lists.arguments, list * ASTEROID_ARGUMENT_BYTES);
            }
        }
    }
}

impl SplatLists<'_> {
    /// Binds group 0 (the lists) and group 1 (the atlas, whose bounds are read from the shapes of the lists).
    fn bind(
        &self,
        gpu: &Gpu,
        pass: &mut wgpu::ComputePass<'_>,
        pipeline: &wgpu::ComputePipeline,
        atlas: &ImpostorAtlas,
    ) {
        let bindings = [
            (0, self.target.as_entire_binding()),
            (2, self.items.as_entire_binding()),
            (3, self.fields.as_entire_binding()),
            (4, self.instances.as_entire_binding()),
            (5, self.entries.as_entire_binding()),
            (7, self.tables.as_entire_binding()),
        ];
        pass.set_bind_group(0, &bind_buffers(gpu, pipeline, 0, &bindings), &[]);
        let [parameters, _bounds, normals, surfaces, sampler] = atlas.bindings();
        pass.set_bind_group(1, &bind_buffers(gpu, pipeline, 1, &[parameters, normals, surfaces, sampler]), &[]);
    }
}
