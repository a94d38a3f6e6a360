//! Bodies and points of light on the adapter: the inputs of the geometry pass and of the point pass, and their results for other techniques.

pub(crate) mod layout;
pub(crate) mod points;
mod rays;

use std::{
    f64::consts::PI,
    sync::{Arc, OnceLock},
};

use self::{
    points::PointPass,
    rays::{GeometryPass, GeometryTarget, RayForm, RayTile},
};
use glam::DVec3;

use super::{
    targets::{SeenBodies, Targets},
    technique::{FrameInputs, Phase, PipelineJob, Recording, Technique, Wish, begin_pass},
};
use crate::plan::stars::cull::MAX_VIEWPORTS;
use crate::render::constants::{
    bodies::{AROUND_CORONA, AROUND_NOTHING, AROUND_RINGS, NO_TEXTURE},
    reflection::{LAW_LAMBERT, LAW_LOMMEL_SEELIGER},
};
use crate::{
    gpu::{Gpu, GrowingBuffer, Variants, storage_buffer},
    plan::{
        bodies::{
            blocks::{all_blocks, reached_blocks},
            seen::{Around, BodyDisc, DiscSun, PointSource},
            textures::distinct_textures,
        },
        stars::range::FixedPoint,
        tiles::{BYTES_PER_PIXEL, Tile},
    },
    scene::{
        SceneObjects,
        bodies::{ReflectionLaw, Texture},
    },
    view::Viewport,
};

/// Lazily created passes, and buffers.
pub(super) struct Bodies {
    rays: OnceLock<GeometryPass>,
    /// Passes without and with a round kernel.
    points: Variants<bool, PointPass>,
    /// Visible surfaces of the pixels of each batch.
    batches: Vec<GrowingBuffer>,
    view_bodies: GrowingBuffer,
    body_runs: GrowingBuffer,
    suns: GrowingBuffer,
    /// Points of each batch.
    point_buffers: Vec<GrowingBuffer>,
    point_counts: Vec<u32>,
    textures: Option<Textures>,
    stand_in: wgpu::Buffer,
}

/// Textures of a scene's bodies, with all levels, in one buffer.
struct Textures {
    held: Vec<Arc<Texture>>,
    /// First word of each texture.
    first: Vec<u32>,
    words: wgpu::Buffer,
}

/// Returns the words of a texture: three channels of 10 bits that hold the square root; all levels, the finest first.
pub(super) fn texture_words(texture: &Texture) -> Vec<u32> {
    let mut words = Vec::new();
    let [mut width, mut height] = texture.size.map(|side| side as usize);
    let mut level: Vec<[f32; 3]> = texture.rgb.clone();
    loop {
        words.extend(level.iter().map(|rgb| {
            let channel = |value: f32| (value.clamp(0.0, 1.0).sqrt() * 1023.0).round() as u32;
            channel(rgb[0]) | channel(rgb[1]) << 10 | channel(rgb[2]) << 20
        }));
        if width * height == 1 {
            return words;
        }
        let (half_width, half_height) = ((width / 2).max(1), (height / 2).max(1));
        // An odd side is divided into bins of two or three rows or columns.
        let mut coarser = Vec::with_capacity(half_width * half_height);
        for y in 0..half_height {
            let rows = y * height / half_height..(y + 1) * height / half_height;
            for x in 0..half_width {
                let columns = x * width / half_width..(x + 1) * width / half_width;
                let mut sum = [0.0; 3];
                for row in rows.clone() {
                    for column in columns.clone() {
                        let rgb = level[row * width + column];
                        sum = [sum[0] + rgb[0], sum[1] + rgb[1], sum[2] + rgb[2]];
                    }
                }
                let count = (rows.len() * columns.len()) as f32;
                coarser.push(sum.map(|channel| channel / count));
            }
        }
        (level, width, height) = (coarser, half_width, half_height);
    }
}

impl Textures {
    fn new(gpu: &Gpu, held: Vec<Arc<Texture>>) -> Self {
        let mut words = Vec::new();
        let first = held
            .iter()
            .map(|texture| {
                let first = words.len() as u32;
                words.extend(texture_words(texture));
                first
            })
            .collect();
        Self { held, first, words: storage_buffer(gpu, "body textures", &words) }
    }

    fn first_of(&self, texture: &Arc<Texture>) -> u32 {
        let index = self.held.iter().position(|held| Arc::ptr_eq(held, texture));
        index.map_or(NO_TEXTURE, |index| self.first[index])
    }
}

/// Whether the eye of a picture is on a viewing circle.
fn has_circle(viewport: &Viewport) -> bool {
    viewport.viewing_circle_m != 0.0
}

impl Bodies {
    pub(super) fn new(gpu: &Gpu) -> Self {
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST;
        Self {
            rays: OnceLock::new(),
            points: Variants::new(),
            batches: Vec::new(),
            view_bodies: GrowingBuffer::new("view bodies", usage),
            body_runs: GrowingBuffer::for_list("body runs"),
            suns: GrowingBuffer::new("body suns", usage),
            point_buffers: Vec::new(),
            point_counts: Vec::new(),
            textures: None,
            stand_in: storage_buffer(gpu, "no geometry", &[[0_u32; 64]]),
        }
    }

    fn rays(&self, gpu: &Gpu) -> &GeometryPass {
        self.rays.get_or_init(|| GeometryPass::new(gpu))
    }

    fn points(&self, gpu: &Gpu, has_round_kernel: bool) -> PointPass {
        self.points.get(has_round_kernel, || PointPass::new(gpu, has_round_kernel))
    }

    /// Uploads the textures of a scene, unless they are already on the adapter.
    fn hold_textures(&mut self, gpu: &Gpu, objects: &SceneObjects) -> &Textures {
        let textures = distinct_textures(objects);
        let same = |held: &Textures| {
            held.held.len() == textures.len() && held.held.iter().zip(&textures).all(|(a, b)| Arc::ptr_eq(a, b))
        };
        let held = self.textures.take().filter(same);
        self.textures.insert(held.unwrap_or_else(|| Textures::new(gpu, textures)))
    }

    /// Returns the points of light of a batch and their number; `None` if the batch has no points.
    fn points_of(&self, batch: usize) -> Option<(&wgpu::Buffer, u32)> {
        let count = *self.point_counts.get(batch)?;
        self.point_buffers.get(batch)?.held().filter(|_| count > 0).map(|buffer| (buffer, count))
    }

    fn record_rays(&self, recording: &mut Recording<'_>, batch: usize, index: usize) {
        let (gpu, plan) = (recording.gpu, recording.frame.plan);
        let targets = &*recording.targets;
        let (Some(bodies), Some(geometry)) = (&targets.bodies, &targets.batches[batch].geometry) else { return };
        let tile = &plan.views.batches[batch].tiles[index];
        if index == 0 {
            recording.encoder.clear_buffer(geometry, 0, Some(plan.views.batches[batch].pixels * BYTES_PER_PIXEL));
        }
        let viewport = &plan.views.viewports[tile.viewport];
        let layers = targets.layers.as_ref();
        let seen = plan.bodies.as_ref().map_or(&[][..], |plan| &plan.seen[tile.viewport]);
        let blocks = match layers {
            Some(_) => all_blocks(viewport.size()[0], tile),
            None => reached_blocks(viewport, tile, seen),
        };
        if blocks.is_empty() {
            return;
        }
        let target = GeometryTarget {
            blocks: &gpu.frame_storage("blocks", &blocks),
            block_count: blocks.len() as u32,
            counters: &targets.counters,
            plain_list: targets.plain_list(),
            has_plain: targets.plain.is_some(),
            viewports: &targets.viewports,
            tiles: &targets.batches[batch].tiles,
            geometry,
            view_bodies: &bodies.view_bodies,
            body_runs: &bodies.body_runs,
            suns: self.suns.held().unwrap_or(&self.stand_in),
            texels: self.textures.as_ref().map_or(&self.stand_in, |textures| &textures.words),
        };
        let has_circle = has_circle(viewport);
        let may_cross = plan.bodies.as_ref().is_some_and(|plan| plan.crosses[tile.viewport]);
        let ray_tile = RayTile { index: index as u32, layers, has_circle, may_cross };
        let rays = self.rays(gpu);
        let mut pass = begin_pass(recording.encoder, recording.timer, "geometry");
        rays.record(gpu, &mut pass, &ray_tile, &target);
    }

    fn record_points(&self, recording: &mut Recording<'_>, batch: usize) {
        let Some(points) = self.points_of(batch) else { return };
        let gpu = recording.gpu;
        let ranges = recording.frame.plan.stars.ranges;
        let share = recording.frame.plan.glare.share_in_sums();
        // The limit of the faintest magnitude applies only to stars.
        let main = FixedPoint { faintest_lx: 0.0, ..ranges.main };
        for (range, bright) in [(Some(main), false), (ranges.bright, true)] {
            let (Some(range), Some(sums)) = (range, recording.targets.sums(batch, bright)) else { continue };
            let pass = self.points(gpu, recording.frame.plan.stars.method.has_round_kernel());
            let range = FixedPoint { units_per_lx: range.units_per_lx * share, ..range };
            let mut recorded = begin_pass(recording.encoder, recording.timer, "stars");
            pass.record(gpu, &mut recorded, &range, &sums, points);
        }
    }
}

impl Technique for Bodies {
    fn pipelines<'a>(&'a self, wish: &Wish<'a>) -> Vec<PipelineJob<'a>> {
        let Wish { gpu, objects, .. } = *wish;
        if objects.is_empty() {
            return Vec::new();
        }
        let rays = self.rays(gpu);
        let mut jobs = Vec::new();
        for has_circle in [false, true] {
            if !wish.viewports.iter().any(|viewport| self::has_circle(viewport) == has_circle) {
                continue;
            }
            // In a scene with asteroid fields, pictures that no field reaches are drawn without layers.
            for &has_plain in wish.forecast.plain_forms() {
                let form = RayForm { has_layers: false, has_plain, has_circle };
                jobs.push(PipelineJob::beside("bodies", rays.pipeline_job(gpu, form)));
            }
            if !objects.fields.is_empty() {
                let form = RayForm { has_layers: true, has_plain: false, has_circle };
                jobs.push(PipelineJob::beside("bodies and asteroids", rays.pipeline_job(gpu, form)));
            }
            if objects.bodies.len() > 1 || objects.bodies.iter().any(|body| body.emission.is_some()) {
                jobs.push(PipelineJob::beside("crossing limbs", rays.crossed_job(gpu, has_circle)));
            }
        }
        let has_round_kernel = wish.forecast.methods.stars.has_round_kernel();
        jobs.push(PipelineJob::new("points of light", move || {
            self.points(gpu, has_round_kernel);
        }));
        jobs
    }

    fn encode(&mut self, gpu: &Gpu, frame: &FrameInputs<'_>, targets: &mut Targets) {
        let Some(plan) = &frame.plan.bodies else {
            self.release();
            return;
        };
        let objects = &frame.scene.objects;
        let textures = self.hold_textures(gpu, objects);
        let mut view_bodies: Vec<layout::ViewBody> = Vec::new();
        let mut suns: Vec<layout::BodySun> = Vec::new();
        let mut runs: Vec<[u32; 4]> = Vec::new();
        for seen in &plan.seen {
            runs.push([view_bodies.len() as u32, seen.len() as u32, 0, 0]);
            for body in seen {
                view_bodies.push(encode_body(objects, body, suns.len() as u32, textures));
                suns.extend(body.suns.iter().map(|sun| encode_sun(sun, objects.bodies[body.body].radii_m)));
            }
        }
        // A binding must hold at least one item.
        if view_bodies.is_empty() {
            view_bodies.push(layout::ViewBody::default());
        }
        if suns.is_empty() {
            suns.push(layout::BodySun::default());
        }
        targets.bodies = Some(SeenBodies {
            view_bodies: self.view_bodies.upload(gpu, &view_bodies).clone(),
            body_runs: self.body_runs.upload_list(gpu, &runs, MAX_VIEWPORTS).clone(),
        });
        self.suns.upload(gpu, &suns);

        let batches = &frame.plan.views.batches;
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST;
        self.batches.resize_with(batches.len(), || GrowingBuffer::new("geometry", usage));
        self.point_buffers.resize_with(batches.len(), || GrowingBuffer::new("points", usage));
        self.point_counts.clear();
        for (index, batch) in batches.iter().enumerate() {
            let geometry = self.batches[index].with_room(gpu, batch.pixels * BYTES_PER_PIXEL);
            targets.batches[index].geometry = Some(geometry.clone());
            let points = encode_points(&plan.points, &batch.tiles);
            self.point_counts.push(points.len() as u32);
            if !points.is_empty() {
                self.point_buffers[index].upload(gpu, &points);
            }
        }
    }

    fn record(&mut self, phase: Phase, recording: &mut Recording<'_>) {
        if recording.frame.plan.bodies.is_none() {
            return;
        }
        match phase {
            Phase::Geometry(batch, tile) => self.record_rays(recording, batch, tile),
            Phase::Splat(batch) => self.record_points(recording, batch),
            _ => {}
        }
    }

    fn release(&mut self) {
        self.batches.clear();
        self.point_buffers.clear();
        self.point_counts.clear();
        self.textures = None;
        for buffer in [&mut self.view_bodies, &mut self.body_runs, &mut self.suns] {
            buffer.release();
        }
    }
}

fn encode_body(objects: &SceneObjects, seen: &BodyDisc, first_sun: u32, textures: &Textures) -> layout::ViewBody {
    let body = &objects.bodies[seen.body];
    let unit_from_view = seen.unit_from_view * seen.distance_m;
    let row = |index: usize| unit_from_view.row(index).as_vec3().to_array();
    let texture = body.surface.texture.as_ref();
    let emission = body.emission.as_ref();
    layout::ViewBody {
        unit_from_view_x: row(0),
        unit_from_view_y: row(1),
        unit_from_view_z: row(2),
        distance_m: seen.distance_m as f32,
        on_plane: u32::from(seen.on_plane),
        inverse_smallest: (1.0 / body.radii_m.min_element()) as f32,
        centre: seen.centre.as_vec3().to_array(),
        part: seen.part as f32,
        unit_centre: (unit_from_view * seen.centre).as_vec3().to_array(),
        law: match body.surface.law {
            ReflectionLaw::Lambert => LAW_LAMBERT,
            ReflectionLaw::LommelSeeliger => LAW_LOMMEL_SEELIGER,
        },
        reflectance: body.surface.geometric_albedo.map(|albedo| (seen.kept * albedo / PI) as f32),
        limb_darkening: emission.map_or(0.0, |emission| emission.limb_darkening as f32),
        emission: emission
            .map_or([0.0; 3], |emission| emission.luminance_cd_m2.map(|channel| (seen.kept * channel) as f32)),
        first_sun,
        sun_count: seen.suns.len() as u32,
        texture: texture.map_or(NO_TEXTURE, |texture| textures.first_of(texture)),
        texture_size: texture.map_or([0; 2], |texture| texture.size),
        around_light: seen.around.light_cd_m2().map(|channel| (seen.kept * channel) as f32),
        around: match seen.around {
            Around::Nothing => AROUND_NOTHING,
            Around::Rings(_) => AROUND_RINGS,
            Around::Corona(_) => AROUND_CORONA,
        },
        to_sun: seen.suns.first().map_or([0.0; 3], |sun| sun.in_body.direction.as_vec3().to_array()),
        flattening: (body.radii_m.z / body.radii_m.x) as f32,
        towards: seen.centre.normalize().as_vec3().to_array(),
        // Margin for the rounding of both directions.
        reach: (1.001 * 2.0 * (0.5 * seen.reach_rad.min(PI)).sin() + 1e-6) as f32,
    }
}

fn encode_sun(sun: &DiscSun, radii_m: DVec3) -> layout::BodySun {
    let f32s = |values: [f64; 3]| values.map(|value| value as f32);
    let lit = layout::BodySun {
        direction: f32s(sun.direction.to_array()),
        illuminance: f32s(sun.in_body.illuminance_lx),
        ..Default::default()
    };
    let Some(shadow) = sun.in_body.shadow else { return lit };
    // In units of the body's size, f32 is precise enough for its surface.
    let unit_m = radii_m.max_element();
    layout::BodySun {
        occluder_radius: (shadow.radius_m / unit_m) as f32,
        sun_radius: shadow.sun_rad as f32,
        occluder: f32s((shadow.offset_m / unit_m).to_array()),
        to_sun: f32s(sun.in_body.direction.to_array()),
        shape: f32s((radii_m / unit_m).to_array()),
        refracted: f32s(shadow.refracted),
        oblate: shadow.oblate as f32,
        pole: f32s(shadow.pole.to_array()),
        ..lit
    }
}

/// Encodes the points that tiles of a batch may show.
pub(super) fn encode_points(points: &[PointSource], tiles: &[Tile]) -> Vec<layout::Point> {
    points
        .iter()
        .filter_map(|point| {
            let seen_by = |tile: &Tile| point.viewports & 1 << tile.viewport != 0;
            let tiles: u32 =
                tiles.iter().enumerate().filter(|(_, tile)| seen_by(tile)).fold(0, |set, (i, _)| set | 1 << i);
            (tiles != 0).then(|| layout::Point {
                offset: point.offset_m.as_vec3().to_array(),
                tiles,
                intensity: point.intensity_cd.map(|cd| cd as f32),
                radius: point.radius_m as f32,
            })
        })
        .collect()
}
