//! Asteroid fields in a frame: resident buffers, culling for all pictures at once, and the layers of meshes and
//! impostors that the geometry pass reads tile by tile.
//!
//! Culling is recorded once per frame, layers once per tile, points once per batch. The counts are read back after the
//! frame.

mod cull;
mod encode;
mod held;
pub(crate) mod impostors;
mod layers;
pub(crate) mod layout;
mod lists;
mod mesh;
mod points;
mod raster;
#[cfg(test)]
mod tests;

use std::sync::OnceLock;

use serde::Serialize;

use self::{
    cull::{AsteroidCullPass, CullBuffers, CullNumbers},
    encode::Encoded,
    held::Held,
    impostors::{
        atlas::BakedImpostors,
        draw::{AsteroidImpostorPass, AsteroidSource},
        splat::AsteroidSplatPass,
    },
    layers::LayerTargets,
    lists::{counts_of, upload_lists},
    mesh::AsteroidMeshPass,
    points::{AsteroidPointPass, AsteroidPoints},
    raster::{ASTEROID_ARGUMENT_BYTES, asteroid_layout},
};
use super::{
    RenderError, ViewStatistics,
    read::Places,
    targets::{POINT_COUNTERS, Sums, Targets},
    technique::{FrameInputs, Holding, Phase, PipelineJob, Recording, Technique, Wish, begin_pass},
};
use crate::{
    gpu::{Gpu, GpuTimer, GrowingBuffer, ReadbackBuffer, Variants, filled_buffer},
    plan::{
        Plan, PlanError,
        asteroids::{
            AsteroidPlan,
            frame::ENTRY_BYTES,
            kinds::{MAX_FIELDS, MAX_PLANES},
        },
        settings::{AsteroidSettings, ImpostorMethod},
        stars::{cull::MAX_VIEWPORTS, range::FixedPoint},
    },
    scene::SceneObjects,
};

/// Names of the counts read back: totals of the lists, points, and hidden impostors.
const TOTALS: &str = "asteroid totals";
const POINTS: &str = "asteroid points";
const HIDDEN: &str = "asteroids hidden";

/// Asteroids of a view, by the form they are drawn in. An asteroid that fades between two forms counts in both.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct AsteroidCounts {
    /// Drawn as meshes, by level of detail, the finest first. A mesh on faces of the cube behind the picture counts
    /// once per face.
    pub meshes: Vec<u64>,
    /// Drawn as impostors, counted like meshes.
    pub impostors: u64,
    /// Impostors with their centre in the picture and no visible sample: nearer asteroids hide them, or they lie between samples. They are not lit.
    /// They are counted only for `octahedral_splat`.
    pub hidden: u64,
    /// Drawn as points.
    pub points: u64,
    /// Represented by points of light that combine whole groups.
    pub unresolved: u64,
    /// Asteroids outside every picture of the view and its margin for points.
    pub culled: u64,
}

/// Lazily created passes and their shared layout.
struct Passes {
    cull: OnceLock<AsteroidCullPass>,
    mesh: OnceLock<AsteroidMeshPass>,
    /// Without and with a round kernel.
    points: Variants<bool, AsteroidPointPass>,
    impostors: Variants<ImpostorMethod, Option<AsteroidImpostorPass>>,
    splats: OnceLock<AsteroidSplatPass>,
    layout: OnceLock<wgpu::BindGroupLayout>,
}

impl Passes {
    fn new() -> Self {
        Self {
            cull: OnceLock::new(),
            mesh: OnceLock::new(),
            points: Variants::new(),
            impostors: Variants::new(),
            splats: OnceLock::new(),
            layout: OnceLock::new(),
        }
    }

    fn layout(&self, gpu: &Gpu) -> &wgpu::BindGroupLayout {
        self.layout.get_or_init(|| asteroid_layout(gpu))
    }

    fn cull(&self, gpu: &Gpu) -> &AsteroidCullPass {
        self.cull.get_or_init(|| AsteroidCullPass::new(gpu))
    }

    fn mesh(&self, gpu: &Gpu) -> &AsteroidMeshPass {
        self.mesh.get_or_init(|| AsteroidMeshPass::new(gpu, self.layout(gpu)))
    }

    fn points(&self, gpu: &Gpu, has_round_kernel: bool) -> AsteroidPointPass {
        self.points.get(has_round_kernel, || AsteroidPointPass::make(gpu, has_round_kernel)())
    }

    fn splats(&self, gpu: &Gpu) -> &AsteroidSplatPass {
        self.splats.get_or_init(|| AsteroidSplatPass::new(gpu))
    }

    /// Returns the pass of a method that draws squares; `None` for other methods.
    fn impostors(&self, gpu: &Gpu, method: ImpostorMethod) -> Option<AsteroidImpostorPass> {
        if method == ImpostorMethod::OctahedralSplat {
            return None;
        }
        let make = || AsteroidImpostorPass::new(gpu, AsteroidSource::Lists, self.layout(gpu), method);
        self.impostors.get(method, make)
    }
}

/// Buffers that are refilled every frame.
struct FrameBuffers {
    items: GrowingBuffer,
    links: GrowingBuffer,
    planes: GrowingBuffer,
    views: GrowingBuffer,
    fields: GrowingBuffer,
    counts: GrowingBuffer,
    totals: GrowingBuffer,
    bases: GrowingBuffer,
    entries: GrowingBuffer,
    arguments: GrowingBuffer,
    /// Number of impostors hidden by nearer ones, per plane; then, for every entry of the current list, whether any of
    /// its samples may be visible.
    still_seen: GrowingBuffer,
    /// Sample buffer of splatted impostors.
    samples: GrowingBuffer,
    /// One uniform per kind of list.
    kinds: Option<(wgpu::Buffer, u32)>,
}

/// Asteroid technique.
pub(super) struct Asteroids {
    held: Option<Held>,
    /// Atlases baked in advance.
    ahead: BakedImpostors,
    /// Each pass is created on first use.
    passes: Passes,
    /// Pass of the current method, if it draws squares.
    impostors: Option<AsteroidImpostorPass>,
    buffers: FrameBuffers,
    targets: LayerTargets,
}

impl FrameBuffers {
    fn new() -> Self {
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::COPY_SRC;
        let buffer = |label: &'static str| GrowingBuffer::new(label, usage);
        Self {
            items: buffer("asteroid groups"),
            links: buffer("asteroid links"),
            planes: GrowingBuffer::for_list("asteroid planes"),
            views: GrowingBuffer::for_list("asteroid views"),
            fields: GrowingBuffer::for_list("asteroid fields"),
            counts: buffer("asteroid counts"),
            totals: buffer("asteroid totals"),
            bases: buffer("asteroid bases"),
            entries: buffer("asteroid lists"),
            arguments: GrowingBuffer::new("asteroid arguments", usage | wgpu::BufferUsages::INDIRECT),
            still_seen: buffer("asteroids still seen"),
            samples: buffer("asteroid samples"),
            kinds: None,
        }
    }
}

impl Asteroids {
    pub(super) fn new(ahead: BakedImpostors) -> Self {
        Self {
            held: None,
            ahead,
            passes: Passes::new(),
            impostors: None,
            buffers: FrameBuffers::new(),
            targets: LayerTargets::new(),
        }
    }

    /// Uploads the fields of a scene, unless their instances and shapes are already on the adapter.
    fn hold_fields(
        &mut self,
        gpu: &Gpu,
        objects: &SceneObjects,
        settings: &AsteroidSettings,
        impostors: Option<ImpostorMethod>,
    ) -> Result<(), RenderError> {
        if self.held.as_ref().is_none_or(|held| !held.holds(objects)) {
            // Drop the old buffers before the new ones are made, so that both never exist at once; keep only the reusable parts.
            let spare = self.held.take().map(Held::into_spare);
            self.held = Some(Held::new(gpu, objects, spare, &self.ahead));
        }
        let Some(method) = impostors else { return Ok(()) };
        self.impostors = self.passes.impostors(gpu, method);
        if let Some(held) = &mut self.held {
            held.hold_atlases(gpu, &self.ahead, self.impostors.as_ref(), (settings, method))?;
        }
        Ok(())
    }

    /// Records culling for all pictures, unless the CPU has made the lists.
    fn record_cull(
        &mut self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        timer: &mut GpuTimer,
        plan: &AsteroidPlan,
    ) {
        let Some(held) = &self.held else { return };
        let per_workgroup = self.splats_per_workgroup(gpu, plan);
        let buffers = &mut self.buffers;
        let seen_words = if plan.splats.is_some() { plan.capacity } else { 0 };
        let still_seen = buffers.still_seen.with_room(gpu, 4 * (MAX_PLANES as u64 + seen_words));
        encoder.clear_buffer(still_seen, 0, Some(4 * MAX_PLANES as u64));
        if plan.lists.is_some() {
            return;
        }
        let counts = buffers.counts.with_room(gpu, 4 * plan.counts).clone();
        encoder.clear_buffer(&counts, 0, None);
        let mut pass = begin_pass(encoder, timer, "asteroid cull");
        let numbers = CullNumbers {
            items: plan.cut.shape_items as u32,
            planes: plan.planes.len() as u32,
            kinds: plan.kinds,
            mesh_kinds: plan.numbers.meshes as u32,
            capacity: plan.capacity as u32,
            splats_per_workgroup: per_workgroup,
        };
        let cull = CullBuffers {
            views: buffers.views.with_room(gpu, 0),
            tables: &held.tables,
            planes: buffers.planes.with_room(gpu, 0),
            links: buffers.links.with_room(gpu, 0),
            items: buffers.items.with_room(gpu, 0),
            instances: &held.instances,
            fields: buffers.fields.with_room(gpu, 0),
            meshes: &held.meshes,
            counts: &counts,
            totals: buffers.totals.with_room(gpu, 0),
            bases: buffers.bases.with_room(gpu, 0),
            entries: buffers.entries.with_room(gpu, 0),
            arguments: buffers.arguments.with_room(gpu, 0),
        };
        self.passes.cull(gpu).record(gpu, &mut pass, numbers, &cull);
    }

    /// Returns the number of impostors per workgroup if they are splatted; 0 otherwise.
    fn splats_per_workgroup(&self, gpu: &Gpu, plan: &AsteroidPlan) -> u32 {
        plan.splats.map_or(0, |_| self.passes.splats(gpu).per_workgroup)
    }

    /// Uploads the encoded plan.
    fn upload(&mut self, gpu: &Gpu, plan: &AsteroidPlan, objects: &SceneObjects) {
        let per_workgroup = self.splats_per_workgroup(gpu, plan);
        let Some(held) = &self.held else { return };
        let encoded = Encoded::new(plan, objects);
        let buffers = &mut self.buffers;
        buffers.items.upload(gpu, &encoded.items);
        buffers.fields.upload_list(gpu, &encoded.fields, MAX_FIELDS);
        let lists = plan.planes.len() as u64 * u64::from(plan.kinds);
        buffers.totals.with_room(gpu, 4 * (1 + lists));
        buffers.bases.with_room(gpu, 4 * lists);
        buffers.arguments.with_room(gpu, ASTEROID_ARGUMENT_BYTES * lists);
        buffers.entries.with_room(gpu, plan.capacity * ENTRY_BYTES);
        let stride = kind_stride(gpu);
        if buffers.kinds.as_ref().is_none_or(|(_, kinds)| *kinds != plan.kinds) {
            let mut uniforms = vec![0_u32; (plan.kinds * stride / 4) as usize];
            for kind in 0..plan.kinds {
                uniforms[(kind * stride / 4) as usize] = kind;
            }
            let buffer = filled_buffer(gpu, "asteroid kinds", &uniforms, wgpu::BufferUsages::UNIFORM);
            buffers.kinds = Some((buffer, plan.kinds));
        }
        buffers.views.upload_list(gpu, &encoded.views, MAX_VIEWPORTS);
        gpu.queue.write_buffer(&held.tables, 0, bytemuck::cast_slice(&encoded.tables));
        if let Some(lists) = &plan.lists {
            upload_lists(gpu, plan, held, buffers, lists, per_workgroup);
        } else {
            buffers.planes.upload_list(gpu, &encoded.planes, MAX_PLANES);
            buffers.links.upload(gpu, &encoded.links);
        }
    }

    /// Records asteroids drawn as points into the sums of one batch of `tiles` tiles; their counters begin at `first_drawn`.
    fn record_points(
        &mut self,
        gpu: &Gpu,
        pass: &mut wgpu::ComputePass<'_>,
        plan: &AsteroidPlan,
        (has_round_kernel, range): (bool, &FixedPoint),
        sums: &Sums<'_>,
        (tiles, first_drawn): (u32, u32),
    ) {
        let Some(held) = &self.held else { return };
        let buffers = &mut self.buffers;
        let points = AsteroidPoints {
            items: buffers.items.with_room(gpu, 0),
            count: plan.cut.items.len() as u32,
            instances: &held.instances,
            fields: buffers.fields.with_room(gpu, 0),
            views: buffers.views.with_room(gpu, 0),
            tables: &held.tables,
            first_drawn,
        };
        self.passes.points(gpu, has_round_kernel).record(gpu, pass, range, sums, tiles, &points);
    }

    /// Records the copy of the counts into the readback buffer.
    fn copy_counts(
        &mut self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        readback: &mut ReadbackBuffer,
        places: &mut Places,
        plan: &AsteroidPlan,
        (counters, first_drawn): (&wgpu::Buffer, u32),
    ) {
        let count = totals_of(plan);
        let bytes = 4 * count as u64;
        let totals = readback.copy(gpu, encoder, self.buffers.totals.with_room(gpu, bytes), 0, bytes);
        let points = readback.copy(gpu, encoder, counters, 4 * u64::from(first_drawn), 4 * POINT_COUNTS as u64);
        let planes = plan.planes.len();
        let hidden = self.buffers.still_seen.with_room(gpu, 4 * MAX_PLANES as u64);
        let hidden = readback.copy(gpu, encoder, hidden, 0, 4 * planes as u64);
        places.counts.extend([(TOTALS, totals, count), (POINTS, points, POINT_COUNTS), (HIDDEN, hidden, planes)]);
    }
}

impl Technique for Asteroids {
    fn pipelines<'a>(&'a self, wish: &Wish<'a>) -> Vec<PipelineJob<'a>> {
        let (gpu, forecast, passes) = (wish.gpu, wish.forecast, &self.passes);
        if wish.objects.fields.is_empty() {
            return Vec::new();
        }
        let has_round_kernel = forecast.methods.stars.has_round_kernel();
        let mut jobs = vec![
            PipelineJob::new("asteroids", move || {
                passes.mesh(gpu);
            }),
            PipelineJob::beside(
                "asteroid points",
                passes.points.job(has_round_kernel, AsteroidPointPass::make(gpu, has_round_kernel)),
            ),
        ];
        if forecast.culls_on_gpu {
            jobs.push(PipelineJob::new("asteroid culling", move || {
                passes.cull(gpu);
            }));
        }
        if let Some(method) = forecast.methods.impostors {
            jobs.push(match method {
                ImpostorMethod::OctahedralSplat => PipelineJob::new("impostor splats", move || passes.splats(gpu)),
                squares => PipelineJob::new("impostors", move || passes.impostors(gpu, squares)),
            });
        }
        jobs
    }

    fn hold(&mut self, holding: &Holding<'_>) -> Result<(), RenderError> {
        if holding.scene.objects.fields.is_empty() {
            self.release();
            return Ok(());
        }
        self.hold_fields(holding.gpu, &holding.scene.objects, holding.asteroids, holding.methods.impostors)
    }

    fn encode(&mut self, gpu: &Gpu, frame: &FrameInputs<'_>, _targets: &mut Targets) {
        self.targets.begin();
        if let Some(plan) = &frame.plan.asteroids {
            self.upload(gpu, plan, &frame.scene.objects);
        }
    }

    fn record(&mut self, phase: Phase, recording: &mut Recording<'_>) {
        let frame = recording.frame;
        let Some(plan) = &frame.plan.asteroids else { return };
        let gpu = recording.gpu;
        match phase {
            Phase::Cull => self.record_cull(gpu, recording.encoder, recording.timer, plan),
            Phase::Geometry(batch, tile) => {
                let tile = &frame.plan.views.batches[batch].tiles[tile];
                if plan.draws(tile.viewport) {
                    recording.targets.layers = self.record_layers(gpu, recording.encoder, recording.timer, plan, tile);
                }
            }
            Phase::Splat(batch) if plan.cut.items.iter().any(|item| item.holds_points) => {
                let Some(sums) = recording.targets.sums(batch, false) else { return };
                let mut pass = begin_pass(recording.encoder, recording.timer, "stars");
                let tiles = frame.plan.views.batches[batch].tiles.len() as u32;
                let numbers = (tiles, recording.targets.first_point_counter());
                let stars = &frame.plan.stars;
                self.record_points(
                    gpu,
                    &mut pass,
                    plan,
                    (stars.method.has_round_kernel(), &stars.ranges.main),
                    &sums,
                    numbers,
                );
            }
            Phase::Count => {
                let Recording { encoder, readback, places, targets, .. } = recording;
                let counters = (&targets.counters, targets.first_point_counter());
                self.copy_counts(gpu, encoder, readback, places, plan, counters);
            }
            _ => {}
        }
    }

    fn readback_bytes(&self, plan: &Plan) -> u64 {
        plan.asteroids.as_ref().map_or(0, count_bytes)
    }

    fn read(
        &self,
        gpu: &Gpu,
        readback: &mut ReadbackBuffer,
        places: &Places,
        plan: &Plan,
        views: &mut [ViewStatistics],
    ) -> Result<(), RenderError> {
        let Some(plan) = &plan.asteroids else { return Ok(()) };
        let counts = read_counts(gpu, readback, places, plan, views.len())?;
        views.iter_mut().zip(counts).for_each(|(view, counts)| view.asteroids = counts);
        Ok(())
    }

    fn release(&mut self) {
        self.held = None;
        self.buffers = FrameBuffers::new();
        self.targets = LayerTargets::new();
    }
}

/// Reads the counts of each of `views` views.
fn read_counts(
    gpu: &Gpu,
    readback: &mut ReadbackBuffer,
    places: &Places,
    plan: &AsteroidPlan,
    views: usize,
) -> Result<Vec<AsteroidCounts>, RenderError> {
    let mut words = |name: &str| match places.counts.iter().find(|(count_name, ..)| *count_name == name) {
        Some((_, place, count)) => readback.read::<u32>(gpu, *place, *count).map_err(RenderError::from),
        None => unreachable!("every frame with asteroids has counted them"),
    };
    let (totals, points, hidden) = (words(TOTALS)?, words(POINTS)?, words(HIDDEN)?);
    if u64::from(totals[0]) > plan.capacity {
        let (needed, limit) = (u64::from(totals[0]), plan.capacity);
        return Err(PlanError::AsteroidLists { needed, limit }.into());
    }
    Ok(counts_of(plan, &totals[1..], &points, &hidden, views))
}

/// Returns the size of the counts in the readback buffer, bytes.
fn count_bytes(plan: &AsteroidPlan) -> u64 {
    4 * (totals_of(plan) + POINT_COUNTS + plan.planes.len()) as u64 + 64
}

/// Returns the number of words of the totals of all lists.
fn totals_of(plan: &AsteroidPlan) -> usize {
    1 + plan.planes.len() * plan.kinds as usize
}

/// Number of counts of the point pass: points per viewport, then asteroids per viewport in groups that contain only points.
const POINT_COUNTS: usize = POINT_COUNTERS as usize;

/// Returns the stride between the uniforms of two kinds, bytes.
fn kind_stride(gpu: &Gpu) -> u32 {
    gpu.device.limits().min_uniform_buffer_offset_alignment.max(size_of::<layout::AsteroidBucket>() as u32)
}
