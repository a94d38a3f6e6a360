//! The map of faint light (`crate::plan::smooth_light`): pictures of the sky are drawn in separate frames and stored as
//! texels of 32 bits. The resolve pass of frames that read the map adds it to the light of their pixels.
//!
//! Shaders: `shaders/smooth_light/`, `shaders/shared/sky_map.wgsl`.
//!
//! No twin: compared with frames that draw every star: tests/gpu/smooth_light.rs.

pub(crate) mod layout;

use std::sync::{Arc, OnceLock};

use super::{
    RenderError,
    layout::SkyMap as SkyMapLayout,
    shader::Shader,
    targets::{SkyTexels, Targets},
    technique::{FrameInputs, Holding, Phase, Recording, Series, Technique, begin_pass},
};
use crate::{
    catalogue::chunks::StarSet,
    gpu::{Gpu, GrowingBuffer, bind_in_order},
    plan::{
        Plan,
        smooth_light::{SkyFace, SkyMap, SkyPlan},
    },
    scene::SceneSnapshot,
    sky_pictures::SKY_FACES,
};

/// A complete or incomplete map.
struct Held {
    stars: Arc<StarSet>,
    map: SkyMap,
    /// Bit i: picture i has been drawn.
    faces: u32,
}

/// Map of one series of frames.
struct SeriesMap {
    held: Option<Held>,
    texels: GrowingBuffer,
}

impl SeriesMap {
    fn new() -> Self {
        Self { held: None, texels: GrowingBuffer::new("smooth light", wgpu::BufferUsages::STORAGE) }
    }
}

/// Lazily created pipeline, and buffers.
pub(super) struct SmoothLight {
    pack: OnceLock<wgpu::ComputePipeline>,
    /// One map per series of frames.
    maps: Vec<SeriesMap>,
}

impl SmoothLight {
    pub(super) fn new() -> Self {
        Self { pack: OnceLock::new(), maps: Vec::new() }
    }

    fn pack(&self, recording: &mut Recording<'_>, face: &SkyFace, batch: usize) {
        let gpu = recording.gpu;
        let map = &self.maps[recording.frame.series.slot];
        let Some(texels) = map.texels.held() else {
            unreachable!("the texels of a map are allocated before it is drawn")
        };
        let picture = recording.targets.picture(batch);
        let parameters = layout::PackParameters {
            plane_pixels: picture.plane_pixels,
            side: face.map.side,
            first_texel: face.number * face.map.side * face.map.side,
            units_per_cd_m2: (1.0 / face.map.unit_cd_m2) as f32,
        };
        let parameters = gpu.frame_uniform("smooth light parameters", &parameters);
        let pipeline = self.pack.get_or_init(|| gpu.compute_pipeline(&Shader::new("smooth_light/pack").source()));
        let buffers = [&parameters, picture.tiles, picture.pixels, texels];
        let group = bind_in_order(gpu, pipeline, 0, &buffers);
        let [columns, rows, tiles] = recording.targets.batches[batch].grid;
        let mut pass = begin_pass(recording.encoder, recording.timer, "smooth light");
        pass.set_pipeline(pipeline);
        pass.set_bind_group(0, &group, &[]);
        pass.dispatch_workgroups(columns, rows, tiles);
    }
}

impl Technique for SmoothLight {
    fn hold(&mut self, holding: &Holding<'_>) -> Result<(), RenderError> {
        // A map of other stars would keep the old star set alive.
        let is_of_other_stars =
            |map: &SeriesMap| map.held.as_ref().is_some_and(|held| !Arc::ptr_eq(&held.stars, &holding.scene.stars));
        if self.maps.iter().any(is_of_other_stars) {
            self.release();
        }
        Ok(())
    }

    fn missing(&self, plan: &Plan, scene: &SceneSnapshot, series: Series) -> Vec<SkyFace> {
        let Some(map) = plan.smooth_light.map.as_ref().map(|sky| sky.map) else { return Vec::new() };
        let held = self.maps.get(series.slot).and_then(|map| map.held.as_ref());
        let held = held.filter(|held| held.map == map && Arc::ptr_eq(&held.stars, &scene.stars));
        let present = held.map_or(0, |held| held.faces);
        (0..SKY_FACES).filter(|number| present & 1 << number == 0).map(|number| SkyFace { map, number }).collect()
    }

    fn encode(&mut self, gpu: &Gpu, frame: &FrameInputs<'_>, targets: &mut Targets) {
        self.maps.resize_with(frame.series.slots, SeriesMap::new);
        let own = &mut self.maps[frame.series.slot];
        if let (Some(SkyPlan { map, .. }), Some(texels)) = (&frame.plan.smooth_light.map, own.texels.held()) {
            let unit_cd_m2 = map.unit_cd_m2 * frame.plan.glare.share_in_sums();
            let sky_map = SkyMapLayout {
                unit_cd_m2: unit_cd_m2 as f32,
                texels_per_rad: (1.0 / map.texel_rad()) as f32,
                side: map.side,
                unused_0: 0,
            };
            targets.sky = Some(SkyTexels { map: sky_map, texels: texels.clone() });
        }
        let Some(SkyFace { map, number }) = frame.plan.smooth_light.face else { return };
        let stars = &frame.scene.stars;
        if own.held.as_ref().is_none_or(|held| held.map != map || !Arc::ptr_eq(&held.stars, stars)) {
            own.texels.with_room(gpu, 4 * map.texels());
            own.held = Some(Held { stars: Arc::clone(stars), map, faces: 0 });
        }
        if let Some(held) = &mut own.held {
            held.faces |= 1 << number;
        }
    }

    fn record(&mut self, phase: Phase, recording: &mut Recording<'_>) {
        // Pack the picture after the resolve pass of the same phase, which comes earlier in the order of techniques.
        if let (Phase::Resolve(batch), Some(face)) = (phase, recording.frame.plan.smooth_light.face) {
            self.pack(recording, &face, batch);
        }
    }

    fn release(&mut self) {
        self.maps.clear();
    }
}
