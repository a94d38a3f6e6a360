//! The map of faint light (`crate::plan::smooth_light`): pictures of the sky are drawn in separate frames and stored as
//! texels of 32 bits. The resolve pass of frames that read the map adds it to the light of their pixels.
//!
//! Shaders: `shaders/smooth_light/`, `shaders/shared/sky_map.wgsl`, `shaders/shared/sky_pieces.wgsl`.
//!
//! No twin: tests/gpu/smooth_light.rs compares frames with those that draw every star.

pub(crate) mod layout;
mod pieces;

use std::sync::{Arc, OnceLock};

use bytemuck::Zeroable;

use self::pieces::Pieces;
use super::{
    RenderError,
    layout::SkyMap as SkyMapLayout,
    shader::Shader,
    targets::{SkyTexels, Targets},
    technique::{FrameInputs, Holding, MapState, Phase, Recording, Series, Technique, begin_pass},
};
use crate::{
    catalogue::chunks::StarSet,
    gpu::{Gpu, GrowingBuffer, bind_in_order},
    plan::{
        Plan,
        smooth_light::{PIECE_WORDS, SkyLayout, SkyMap, SkyPart, SkyPlan, caps::Caps, pieces::WantedPicture},
        stars::{
            cull::MAX_VIEWPORTS,
            deep::{DeepPlan, Lack, Residual},
        },
    },
    scene::SceneSnapshot,
};

/// The pictures of a map that have been drawn.
enum Drawn {
    /// Bit i: picture i of the whole sky.
    Whole(u32),
    /// Pieces.
    Pieces(Pieces),
}

/// A complete or incomplete map.
struct Held {
    stars: Arc<StarSet>,
    map: SkyMap,
    drawn: Drawn,
}

impl Held {
    fn is(&self, map: &SkyMap, stars: &Arc<StarSet>) -> bool {
        self.map == *map && Arc::ptr_eq(&self.stars, stars)
    }
}

/// Map of one series of frames.
struct SeriesMap {
    held: Option<Held>,
    /// The map that the last frame could have read.
    last: Option<SkyMap>,
    texels: GrowingBuffer,
    /// Storage locations of the pictures that are being drawn, by viewport.
    packed: Vec<layout::PackedPicture>,
}

impl SeriesMap {
    fn new() -> Self {
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST;
        Self { held: None, last: None, texels: GrowingBuffer::new("smooth light", usage), packed: Vec::new() }
    }

    /// Finds places for the pictures of a part that is about to be drawn.
    fn place(&mut self, gpu: &Gpu, part: &SkyPart, deep: &DeepPlan) {
        let Some(Held { drawn, .. }) = &mut self.held else { return };
        self.packed.clear();
        for (viewport, picture) in part.pictures().iter().enumerate() {
            let number = picture.number;
            let (first_texel, width) = match (&mut *drawn, part.map.layout) {
                (Drawn::Whole(pictures), SkyLayout::Whole { side }) => {
                    *pictures |= 1 << number;
                    (number * side * side, side)
                }
                (Drawn::Pieces(pieces), _) => {
                    let lack = deep.lacks.get(viewport).filter(|lack| lack.residual != Residual::default()).cloned();
                    let (first, lost) = pieces.draw(*picture, lack);
                    let (width, words) = pieces.words(*picture);
                    if let Some(texels) = self.texels.held() {
                        let at = |word: u32| u64::from(word) * 4;
                        gpu.queue.write_buffer(texels, at(first), bytemuck::cast_slice(&words));
                        gpu.queue.write_buffer(texels, at(number), &first.to_le_bytes());
                        for lost in lost {
                            gpu.queue.write_buffer(texels, at(lost), &0_u32.to_le_bytes());
                        }
                    }
                    (first + PIECE_WORDS, width)
                }
                (Drawn::Whole(_), SkyLayout::Pieces(_)) => unreachable!("a map keeps its layout"),
            };
            self.packed.push(layout::PackedPicture { first_texel, width, unused_0: 0, unused_1: 0 });
        }
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

    fn pack(&self, recording: &mut Recording<'_>, part: &SkyPart, batch: usize) {
        let gpu = recording.gpu;
        let map = &self.maps[recording.frame.series.slot];
        let Some(texels) = map.texels.held() else {
            unreachable!("the texels of a map are allocated before it is drawn")
        };
        let picture = recording.targets.picture(batch);
        let parameters = layout::PackParameters {
            plane_pixels: picture.plane_pixels,
            units_per_cd_m2: (1.0 / part.map.unit_cd_m2) as f32,
            blur: part.map.blur().map(|weight| weight as f32),
        };
        let mut packed = [layout::PackedPicture::zeroed(); MAX_VIEWPORTS];
        packed[..map.packed.len()].copy_from_slice(&map.packed);
        let parameters = gpu.frame_uniform("smooth light parameters", &parameters);
        let packed = gpu.frame_uniform("smooth light pictures", &packed);
        let pipeline = self.pack.get_or_init(|| gpu.compute_pipeline(&Shader::new("smooth_light/pack").source()));
        let buffers = [&parameters, picture.tiles, picture.pixels, texels, &packed];
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
        // Release maps that were made from other stars: they would keep the old star set in memory.
        let is_of_other_stars =
            |map: &SeriesMap| map.held.as_ref().is_some_and(|held| !Arc::ptr_eq(&held.stars, &holding.scene.stars));
        if self.maps.iter().any(is_of_other_stars) {
            self.release();
        }
        Ok(())
    }

    fn map_parts(&mut self, gpu: &Gpu, plan: &Plan, scene: &SceneSnapshot, series: Series) -> Vec<SkyPart> {
        self.maps.resize_with(series.slots, SeriesMap::new);
        let own = &mut self.maps[series.slot];
        let Some(SkyPlan { map, read, .. }) = &plan.smooth_light.map else {
            own.last = None;
            return Vec::new();
        };
        own.last = Some(*map);
        let has_room = |drawn: &Drawn| match drawn {
            Drawn::Whole(_) => true,
            Drawn::Pieces(pieces) => pieces.have_room(read),
        };
        if own.held.as_ref().is_none_or(|held| !held.is(map, &scene.stars) || !has_room(&held.drawn)) {
            let (drawn, bytes) = match map.layout {
                SkyLayout::Whole { side } => {
                    (Drawn::Whole(0), 4 * u64::from(side) * u64::from(side) * read.len() as u64)
                }
                SkyLayout::Pieces(grid) => {
                    let pieces = Pieces::new(grid, read, gpu.max_binding_bytes());
                    let bytes = pieces.bytes();
                    (Drawn::Pieces(pieces), bytes)
                }
            };
            own.texels.with_room(gpu, bytes);
            own.held = Some(Held { stars: Arc::clone(&scene.stars), map: *map, drawn });
        }
        let to_draw = match own.held.as_mut().map(|held| &mut held.drawn) {
            Some(Drawn::Whole(drawn)) => {
                let pictures = read.iter().map(WantedPicture::drawn);
                pictures.filter(|picture| *drawn & 1 << picture.number == 0).collect()
            }
            Some(Drawn::Pieces(pieces)) => pieces.missing(read, |lack| are_read(scene, lack)),
            None => Vec::new(),
        };
        SkyPart::of(*map, &to_draw)
    }

    fn map_state(&self, plan: &Plan, series: Series) -> MapState {
        let held = self.maps.get(series.slot).and_then(|own| own.held.as_ref());
        match (&plan.smooth_light.map, held.map(|held| &held.drawn)) {
            (None, _) => MapState { is_drawn: true, lack: Residual::default() },
            (Some(SkyPlan { read, .. }), Some(Drawn::Whole(drawn))) => MapState {
                is_drawn: read.iter().all(|wanted| drawn & 1 << wanted.number != 0),
                lack: Residual::default(),
            },
            (Some(SkyPlan { read, .. }), Some(Drawn::Pieces(pieces))) => {
                MapState { is_drawn: pieces.are_drawn(read), lack: pieces.lack(read) }
            }
            (Some(_), None) => MapState { is_drawn: false, lack: Residual::default() },
        }
    }

    fn is_new_map(&self, plan: &Plan, series: Series) -> bool {
        let map = plan.smooth_light.map.as_ref().map(|sky| sky.map);
        map.is_some() && self.maps.get(series.slot).is_none_or(|own| own.last != map)
    }

    fn encode(&mut self, gpu: &Gpu, frame: &FrameInputs<'_>, targets: &mut Targets) {
        self.maps.resize_with(frame.series.slots, SeriesMap::new);
        let own = &mut self.maps[frame.series.slot];
        if let (Some(SkyPlan { map, caps, .. }), Some(texels)) = (&frame.plan.smooth_light.map, own.texels.held()) {
            let unit_cd_m2 = map.unit_cd_m2 * frame.plan.glare.share_in_sums();
            let (side, pieces_per_edge) = match map.layout {
                SkyLayout::Whole { side } => (side, 0),
                SkyLayout::Pieces(grid) => (0, grid.per_edge),
            };
            let sky_map = SkyMapLayout {
                unit_cd_m2: unit_cd_m2 as f32,
                texels_per_rad: (1.0 / map.texel_rad()) as f32,
                side,
                pieces_per_edge,
            };
            let caps = Caps::edges(caps.as_ref());
            targets.sky = Some(SkyTexels { map: sky_map, caps, texels: texels.clone() });
        }
        if let Some(part) = &frame.plan.smooth_light.part {
            own.place(gpu, part, &frame.plan.stars.deep);
        }
    }

    fn record(&mut self, phase: Phase, recording: &mut Recording<'_>) {
        // This phase packs the pictures after the resolve pass, which comes earlier in the order of techniques.
        if let (Phase::Resolve(batch), Some(part)) = (phase, recording.frame.plan.smooth_light.part) {
            self.pack(recording, &part, batch);
        }
    }

    fn release(&mut self) {
        self.maps.clear();
    }
}

/// Whether the stars that were missing are in memory now. If they are not, this requests them again.
fn are_read(scene: &SceneSnapshot, lack: &Lack) -> bool {
    // If there are no keys, the missing stars do not fit into the memory.
    let Some(sky) = scene.stars.deep.as_ref().filter(|_| !lack.keys.is_empty()) else { return false };
    let absent = lack.keys.iter().zip(sky.pages_of(&lack.keys)).filter(|(_, page)| page.is_none());
    let wants: Vec<_> = absent.map(|(key, _)| (*key, lack.residual.cd_m2)).collect();
    if !wants.is_empty() {
        sky.ask(&wants);
    }
    wants.is_empty()
}
