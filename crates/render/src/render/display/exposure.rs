//! The exposure pass: computes one exposure for all views from the mean luminance, weighted by solid angle. Shader:
//! `shaders/display/exposure.wgsl`; the f64 twin is `crate::photometry::exposure`.
//!
//! No twin: photometry/exposure.rs.

use std::sync::OnceLock;

use crate::render::shader::Shader;
use crate::{
    gpu::{Gpu, bind_buffers},
    plan::MeteringPlan,
    render::display::layout,
};

/// Pipeline of the exposure pass.
pub(crate) struct ExposurePass {
    pipeline: OnceLock<wgpu::ComputePipeline>,
}

/// Inputs of the exposure.
pub(crate) struct ExposureInputs<'a> {
    pub metering: &'a MeteringPlan,
    /// Exposure to use instead of the metered one.
    pub known_ev100: Option<f64>,
    pub total_solid_angle_sr: f64,
    pub partial_count: u32,
}

impl ExposurePass {
    pub(crate) fn new() -> Self {
        Self { pipeline: OnceLock::new() }
    }

    /// Returns the pipeline, which is created at the first call.
    pub(crate) fn pipeline(&self, gpu: &Gpu) -> &wgpu::ComputePipeline {
        self.pipeline.get_or_init(|| gpu.compute_pipeline(&Shader::new("display/exposure").source()))
    }

    /// Records the pass.
    pub(crate) fn record(
        &self,
        gpu: &Gpu,
        pass: &mut wgpu::ComputePass<'_>,
        inputs: &ExposureInputs<'_>,
        partial_sums: &wgpu::Buffer,
        exposure: &wgpu::Buffer,
    ) {
        let ExposureInputs { metering, known_ev100, total_solid_angle_sr, partial_count } = *inputs;
        let parameters = layout::ExposureParameters {
            total_solid_angle_sr: total_solid_angle_sr as f32,
            min_ev100: metering.min_ev100 as f32,
            max_ev100: metering.max_ev100 as f32,
            offset_ev: metering.offset_ev as f32,
            fixed_ev100: known_ev100.unwrap_or(0.0) as f32,
            fixed: u32::from(known_ev100.is_some()),
            partial_count,
            ..Default::default()
        };
        let parameters = gpu.frame_uniform("exposure parameters", &parameters);
        let pipeline = self.pipeline(gpu);
        let group = bind_buffers(
            gpu,
            pipeline,
            0,
            &[
                (0, parameters.as_entire_binding()),
                (1, partial_sums.as_entire_binding()),
                (2, exposure.as_entire_binding()),
            ],
        );
        pass.set_pipeline(pipeline);
        pass.set_bind_group(0, &group, &[]);
        pass.dispatch_workgroups(1, 1, 1);
    }
}
