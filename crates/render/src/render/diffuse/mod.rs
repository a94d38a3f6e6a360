//! Diffuse light from the whole sky (`crate::catalogue::diffuse`), such as the Milky Way and the zodiacal light. Its pictures stay on the adapter. To
//! the light of the stars in each pixel, the resolve pass adds the diffuse light from the direction of the pixel.
//!
//! Shader: `shaders/shared/diffuse_light.wgsl`.

pub(crate) mod layout;
mod points;

use std::sync::{Arc, Weak};

use glam::DMat3;

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

/// Pictures on the adapter, and the skies that they show.
pub(super) struct Diffuse {
    /// Texels of the sky beyond the Solar System, then those of the zodiacal light.
    texels: GrowingBuffer,
    roughness: GrowingBuffer,
    /// The skies of these texels, in their order.
    held: Vec<Weak<DiffuseSky>>,
    points: DiffusePoints,
}

impl Diffuse {
    pub(super) fn new() -> Self {
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST;
        Self {
            texels: GrowingBuffer::new("diffuse light", usage),
            roughness: GrowingBuffer::new("roughness of diffuse light", usage),
            held: Vec::new(),
            points: DiffusePoints::new(),
        }
    }

    /// Whether the stored texels belong to these skies.
    fn holds(&self, skies: &[&Arc<DiffuseSky>]) -> bool {
        let same = |(held, sky): (&Weak<DiffuseSky>, &&Arc<DiffuseSky>)| {
            held.upgrade().is_some_and(|held| Arc::ptr_eq(&held, sky))
        };
        self.held.len() == skies.len() && self.held.iter().zip(skies).all(same)
    }
}

/// Returns the layout of a map. Its unit is multiplied by the share of the light that glare does not scatter.
fn map_of(sky: &DiffuseSky, plan: &Plan) -> SkyMap {
    let pictures = sky.pictures();
    SkyMap {
        unit_cd_m2: (TEXEL_UNIT_CD_M2 * plan.glare.share_of_smooth_light()) as f32,
        texels_per_rad: (1.0 / pictures.texel_rad()) as f32,
        side: pictures.side,
        pieces_per_edge: 0,
    }
}

fn encode(diffuse: &DiffusePlan, plan: &Plan) -> DiffuseLight {
    let map = |sky: Option<&DiffuseSky>| sky.map(|sky| map_of(sky, plan)).unwrap_or_default();
    let zodiacal = diffuse.zodiacal.as_ref();
    let rows = zodiacal.map_or(DMat3::ZERO, |light| light.sky_from_icrs.transpose());
    DiffuseLight {
        map: map(diffuse.sky.as_deref()),
        velocity: plan.views.motion.map_or([0.0; 3], |motion| motion.direction.as_vec3().to_array()),
        beta: plan.views.motion.map_or(0.0, |motion| motion.beta as f32),
        zodiacal: map(zodiacal.map(|light| light.sky.as_ref())),
        zodiacal_x: rows.x_axis.as_vec3().to_array(),
        first_zodiacal: diffuse.sky.as_ref().map_or(0, |sky| sky.texels().len() as u32),
        zodiacal_y: rows.y_axis.as_vec3().to_array(),
        zodiacal_z: rows.z_axis.as_vec3().to_array(),
        ..Default::default()
    }
}

impl Technique for Diffuse {
    fn pipelines<'a>(&'a self, wish: &Wish<'a>) -> Vec<PipelineJob<'a>> {
        let (gpu, points) = (wish.gpu, &self.points);
        let job = || PipelineJob::new("points of diffuse light", move || points.pipeline(gpu).clone());
        wish.forecast.draws_outputs_apart.then(job).into_iter().collect()
    }

    fn encode(&mut self, gpu: &Gpu, frame: &FrameInputs<'_>, targets: &mut Targets) {
        let Some(diffuse) = &frame.plan.diffuse else { return };
        let skies: Vec<&Arc<DiffuseSky>> =
            diffuse.sky.iter().chain(diffuse.zodiacal.as_ref().map(|light| &light.sky)).collect();
        if !self.holds(&skies) {
            let texels: Vec<u32> = skies.iter().flat_map(|sky| sky.texels()).copied().collect();
            self.texels.upload(gpu, &texels);
            self.roughness.upload(gpu, diffuse.sky.as_ref().map_or(&[0.0][..], |sky| sky.roughness_cd_m2()));
            self.held = skies.into_iter().map(Arc::downgrade).collect();
        }
        if let Some(texels) = self.texels.held() {
            let grids = diffuse.step_cd_m2.map(|_| points::grids(frame.plan, diffuse.sky.as_deref()));
            let rough_grids = grids.clone().filter(|_| frame.plan.plain_blocks.is_some() && diffuse.sky.is_some());
            let smooth = grids.map(|grids| targets.reserve_points(gpu, "diffuse grids", grids));
            let rough = rough_grids.map(|grids| targets.reserve_points(gpu, "grids of rough light", grids));
            targets.diffuse =
                Some(DiffuseTexels { light: encode(diffuse, frame.plan), texels: texels.clone(), smooth, rough });
        }
    }

    fn record(&mut self, phase: Phase, recording: &mut Recording<'_>) {
        let plan = recording.frame.plan;
        let (Phase::Points, Some(DiffusePlan { sky, step_cd_m2: Some(step_cd_m2), .. })) = (phase, &plan.diffuse)
        else {
            return;
        };
        let (Some(texels), Some(roughness)) = (self.texels.held(), self.roughness.held()) else { return };
        let Some(DiffuseTexels { light, smooth: Some(grid), rough, .. }) = recording.targets.diffuse.clone() else {
            return;
        };
        let grids = (&grid, rough.as_ref());
        self.points.record(recording, (sky.as_deref(), light, *step_cd_m2), grids, [texels, roughness]);
    }

    fn release(&mut self) {
        self.texels.release();
        self.roughness.release();
        self.held.clear();
    }
}
