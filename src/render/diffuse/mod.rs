//! Light of no single star from all over the sky (`crate::catalogue::diffuse`): its pictures lie on the adapter, and the resolve pass adds what a pixel's direction has of it to the light of the stars.
//! Shader: `shaders/shared/diffuse_light.wgsl`.

use std::sync::{Arc, Weak};

use super::{
    layout::{DiffuseLight, SkyMap},
    targets::{DiffuseTexels, Targets},
    technique::{FrameInputs, Phase, Recording, Technique},
};
use crate::{
    catalogue::diffuse::{DiffuseSky, TEXEL_UNIT_CD_M2},
    gpu::{Gpu, GrowingBuffer},
    plan::Plan,
};

/// The pictures, and of which sky they are.
pub(super) struct Diffuse {
    texels: GrowingBuffer,
    held: Weak<DiffuseSky>,
}

impl Diffuse {
    pub(super) fn new() -> Self {
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST;
        Self { texels: GrowingBuffer::new("diffuse light", usage), held: Weak::new() }
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
        velocity: plan.motion.map_or([0.0; 3], |motion| motion.direction.as_vec3().to_array()),
        beta: plan.motion.map_or(0.0, |motion| motion.beta as f32),
    }
}

impl Technique for Diffuse {
    fn encode(&mut self, gpu: &Gpu, frame: &FrameInputs<'_>, targets: &mut Targets) {
        let Some(sky) = &frame.plan.diffuse else { return };
        if !self.held.upgrade().is_some_and(|held| Arc::ptr_eq(&held, sky)) {
            self.texels.upload(gpu, sky.texels());
            self.held = Arc::downgrade(sky);
        }
        if let Some(texels) = self.texels.held() {
            targets.diffuse = Some(DiffuseTexels { light: encode(sky, frame.plan), texels: texels.clone() });
        }
    }

    fn record(&mut self, _phase: Phase, _recording: &mut Recording<'_>) {}

    fn release(&mut self) {
        self.texels.release();
        self.held = Weak::new();
    }
}
