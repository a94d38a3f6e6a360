//! Diffuse light from the whole sky (`crate::catalogue::diffuse`), such as the Milky Way. Its pictures stay on the
//! adapter, and the resolve pass adds the light from each pixel's direction to that of the stars.
//!
//! Shader: `shaders/shared/diffuse_light.wgsl`.

pub(crate) mod layout;
mod points;

use std::sync::{Arc, Weak};

use self::points::DiffusePoints;
use super::{
    layout::{DiffuseLight, SkyMap},
    targets::{DiffuseTexels, Targets},
    technique::{FrameInputs, Phase, PipelineJob, Recording, Technique, Wish},
};
use crate::{
    catalogue::diffuse::{DiffuseSky, TEXEL_UNIT_CD_M2},
    gpu::{Gpu, GrowingBuffer},
    plan::{DiffusePlan, Plan},
};

/// Pictures on the adapter, and the sky that they show.
pub(super) struct Diffuse {
    texels: GrowingBuffer,
    roughness: GrowingBuffer,
    held: Weak<DiffuseSky>,
    points: DiffusePoints,
}

impl Diffuse {
    pub(super) fn new() -> Self {
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST;
        Self {
            texels: GrowingBuffer::new("diffuse light", usage),
            roughness: GrowingBuffer::new("roughness of diffuse light", usage),
            held: Weak::new(),
            points: DiffusePoints::new(),
        }
    }
}

fn encode(sky: &DiffuseSky, plan: &Plan) -> DiffuseLight {
    let pictures = sky.pictures();
    DiffuseLight {
        map: SkyMap {
            unit_cd_m2: (TEXEL_UNIT_CD_M2 * plan.glare.share_of_smooth_light()) as f32,
            texels_per_rad: (1.0 / pictures.texel_rad()) as f32,
            side: pictures.side,
            unused_0: 0,
        },
        velocity: plan.views.motion.map_or([0.0; 3], |motion| motion.direction.as_vec3().to_array()),
        beta: plan.views.motion.map_or(0.0, |motion| motion.beta as f32),
    }
}

impl Technique for Diffuse {
    fn pipelines<'a>(&'a self, wish: &Wish<'a>) -> Vec<PipelineJob<'a>> {
        let (gpu, points) = (wish.gpu, &self.points);
        let job = || PipelineJob::new("points of diffuse light", move || points.pipeline(gpu).clone());
        wish.forecast.draws_outputs_apart.then(job).into_iter().collect()
    }

    fn encode(&mut self, gpu: &Gpu, frame: &FrameInputs<'_>, targets: &mut Targets) {
        let Some(DiffusePlan { sky, .. }) = &frame.plan.diffuse else { return };
        if !self.held.upgrade().is_some_and(|held| Arc::ptr_eq(&held, sky)) {
            self.texels.upload(gpu, sky.texels());
            self.roughness.upload(gpu, sky.roughness_cd_m2());
            self.held = Arc::downgrade(sky);
        }
        if let Some(texels) = self.texels.held() {
            targets.diffuse =
                Some(DiffuseTexels { light: encode(sky, frame.plan), texels: texels.clone(), smooth: None });
        }
    }

    fn record(&mut self, phase: Phase, recording: &mut Recording<'_>) {
        let plan = recording.frame.plan;
        let (Phase::Splat(0), Some(DiffusePlan { sky, step_cd_m2: Some(step_cd_m2) })) = (phase, &plan.diffuse) else {
            return;
        };
        let (Some(texels), Some(roughness)) = (self.texels.held(), self.roughness.held()) else { return };
        let Some(light) = recording.targets.diffuse.as_ref().map(|diffuse| diffuse.light) else { return };
        let smooth = self.points.record(recording, (sky, light, *step_cd_m2), [texels, roughness]);
        if let Some(diffuse) = &mut recording.targets.diffuse {
            diffuse.smooth = Some(smooth);
        }
    }

    fn release(&mut self) {
        self.texels.release();
        self.roughness.release();
        self.points.release();
        self.held = Weak::new();
    }
}
