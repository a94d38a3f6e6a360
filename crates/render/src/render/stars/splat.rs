//! The star pass: splats the illuminance of every visible star in fixed point. Shader: `shaders/stars/splat.wgsl`; the
//! f64 twin is `crate::reference::stars`.

use super::items::{StarDraw, StarKind, bind_items};
use crate::{
    gpu::{self, Gpu, Variants, dispatch_rows},
    plan::{
        Plan, SmoothLightPlan,
        smooth_light::caps::Caps,
        stars::{
            range::FixedPoint,
            travel::{SHIFTED_STEPS, TABLE_STEPS, colour_of_step, ln_luminance_of_step},
        },
    },
    relativity::Motion,
    render::{
        layout::AirAbove,
        shader::{kernel_constant, rolled_loops, workgroup_constant},
        stars::layout,
        targets::{Sums, bind_occlusion, bind_sums, splatting},
    },
};

/// Form of the star pass.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct StarForm {
    /// Whether the brightest kernel is round in view space.
    pub has_round_kernel: bool,
    /// Whether surfaces may hide stars.
    pub has_geometry: bool,
    /// Whether the camera is in air.
    pub has_air: bool,
    /// Whether the stars are those of pages of a deep store.
    pub from_pages: bool,
}

/// Pipelines and colour table of the star pass.
pub(crate) struct StarPass {
    pipelines: Variants<StarForm, wgpu::ComputePipeline>,
    colours: wgpu::Buffer,
}

/// Returns the table of colours with Y = 1 and of the logarithm of the luminance, for all temperature steps. The steps from 0 on come first, then the
/// negative ones, which only a moving camera uses.
fn colour_table() -> Vec<[f32; 4]> {
    let above = (TABLE_STEPS as u32 - SHIFTED_STEPS) as i32;
    (0..above)
        .chain(-(SHIFTED_STEPS as i32)..0)
        .map(|step| {
            let [r, g, b] = colour_of_step(step);
            [r, g, b, ln_luminance_of_step(step) as f32]
        })
        .collect()
}

fn encode_motion(motion: Motion) -> layout::CameraMotion {
    layout::CameraMotion {
        direction: motion.direction.as_vec3().to_array(),
        gamma: motion.gamma() as f32,
        gamma_beta: (motion.gamma() * motion.beta) as f32,
        doppler_behind: motion.doppler_behind() as f32,
        ..Default::default()
    }
}

fn star_pipeline(gpu: &Gpu, form: StarForm) -> wgpu::ComputePipeline {
    let flag = |name: &'static str, value: bool| (name, f64::from(u8::from(value)));
    let constants = [
        workgroup_constant(gpu),
        flag("HAS_GEOMETRY", form.has_geometry),
        flag("HAS_AIR", form.has_air),
        flag("FROM_PAGES", form.from_pages),
        kernel_constant(form.has_round_kernel),
        rolled_loops(gpu),
    ];
    gpu.compute_pipeline_with(&splatting(gpu, "stars/splat"), &constants)
}

impl StarPass {
    pub(crate) fn new(gpu: &Gpu) -> Self {
        Self { pipelines: Variants::new(), colours: gpu::storage_buffer(gpu, "star colours", &colour_table()) }
    }

    /// Returns the pipeline of a form.
    pub(crate) fn pipeline(&self, gpu: &Gpu, form: StarForm) -> wgpu::ComputePipeline {
        self.pipelines.get(form, || star_pipeline(gpu, form))
    }

    /// Returns the colours with luminance 1 for every temperature step.
    pub(crate) fn colours(&self) -> &wgpu::Buffer {
        &self.colours
    }

    /// Records the draws of one brightness range into one batch, including the effects of camera motion and air.
    pub(crate) fn record(
        &self,
        gpu: &Gpu,
        pass: &mut wgpu::ComputePass<'_>,
        (range, is_bright): (&FixedPoint, bool),
        plan: &Plan,
        sums: &Sums<'_>,
        draws: &[StarDraw<'_>],
    ) {
        let occlusion = &sums.occlusion;
        let units_per_lx = range.units_per_lx * plan.glare.share_in_sums();
        let air = AirAbove::from_sky(plan.air.sky.as_deref());
        let mut last = None;
        // Limits for stars of pages: a map that the frame reads contains the stars below `read_lx`; a picture of the map draws the stars below
        // `drawn_lx`.
        let SmoothLightPlan { map, part } = &plan.smooth_light;
        let read_lx = map.as_ref().map(|sky| sky.map.below_lx);
        let drawn_lx = part.as_ref().map(|part| part.map.below_lx);
        let caps = map.as_ref().and_then(|sky| sky.caps.as_ref());
        // Stars of pages and of caps are too faint for the separate sums of bright ones.
        for draw in draws.iter().filter(|draw| draw.kind == StarKind::Chunks || !is_bright) {
            let from_pages = draw.kind == StarKind::Pages;
            let form = StarForm {
                has_round_kernel: plan.stars.method.has_round_kernel(),
                has_geometry: occlusion.present,
                has_air: air.present != 0,
                from_pages,
            };
            let pipeline = &self.pipeline(gpu, form);
            if last != Some(from_pages) {
                last = Some(from_pages);
                pass.set_pipeline(pipeline);
                pass.set_bind_group(2, &bind_occlusion(gpu, pipeline, occlusion), &[]);
                gpu.bind_tables(pass, pipeline);
            }
            let [items_per_row, rows] = dispatch_rows(gpu, draw.item_count);
            let limits_lx = match draw.kind {
                StarKind::Chunks => [range.faintest_lx, range.brightest_lx],
                StarKind::Caps => [plan.stars.faintest_lx, read_lx.unwrap_or(f64::INFINITY)],
                StarKind::Pages => [read_lx.unwrap_or(range.faintest_lx), drawn_lx.unwrap_or(f64::INFINITY)],
            };
            let [faintest_lx, brightest_lx] = limits_lx.map(|lx| lx as f32);
            let parameters = layout::StarParameters {
                units_per_lx: units_per_lx as f32,
                faintest_lx,
                brightest_lx,
                item_count: draw.item_count,
                items_per_row,
                camera: plan.views.camera_pc.as_vec3().to_array(),
                camera_motion: plan.views.motion.map(encode_motion).unwrap_or_default(),
                air,
                caps: Caps::edges(caps.filter(|_| draw.kind == StarKind::Caps)),
                ..Default::default()
            };
            let parameters = gpu.frame_uniform("star parameters", &parameters);
            let colours = [(5, self.colours.as_entire_binding())];
            pass.set_bind_group(0, &bind_sums(gpu, pipeline, &parameters, sums, &colours), &[]);
            pass.set_bind_group(1, &bind_items(gpu, pipeline, draw), &[]);
            pass.dispatch_workgroups(items_per_row, rows, 1);
        }
    }
}
