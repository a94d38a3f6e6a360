//! Fields of asteroids in a frame: what the adapter holds of them, culling for all pictures at once, and the layers of meshes and impostors
//! that the compositing pass reads, tile by tile.
//!
//! In order: [`Asteroids::hold`], [`Asteroids::plan`], [`Asteroids::record_cull`] once, [`Asteroids::record_layers`] per tile,
//! [`Asteroids::copy_counts`], and after the frame [`Asteroids::read_counts`].

mod held;
mod layers;
mod lists;
mod plan;
#[cfg(test)]
mod tests;

use glam::DVec3;
use serde::Serialize;

pub(crate) use self::plan::AsteroidPlan;
use self::{held::Held, layers::LayerTargets, plan::Tables};
use super::RenderError;
use crate::{
    gpu::{Gpu, GpuTimer, GrowingBuffer, ReadbackBuffer, ReadbackPlace, filled_buffer, layout},
    passes::{
        asteroid_cull::{AsteroidCullPass, CullBuffers, CullNumbers},
        asteroid_impostor::{AsteroidImpostorPass, AsteroidSource},
        asteroid_mesh::AsteroidMeshPass,
        asteroid_points::{AsteroidPointPass, AsteroidPoints},
        impostor_bake::ImpostorBakePass,
        shared::{ASTEROID_ARGUMENT_BYTES, Occlusion, StarTarget, asteroid_layout},
    },
    plan::{
        cull::MAX_VIEWPORTS,
        range::FixedPoint,
        settings::{AsteroidSettings, ImpostorMethod},
    },
    scene::{SceneObjects, bodies::Sun},
    view::Viewport,
};

/// Asteroids of a view, by what they are drawn as. One that is between two classes counts in both.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct AsteroidCounts {
    /// Drawn as meshes, by level of detail, the finest first; on faces of a cube behind the picture once per face.
    pub meshes: Vec<u64>,
    /// Drawn as impostors, likewise.
    pub impostors: u64,
    /// Drawn as points.
    pub points: u64,
    /// Part of points of light that stand for whole groups.
    pub unresolved: u64,
    /// Not seen: outside of every picture of the view, and of the margin around it that points reach over.
    pub culled: u64,
}

/// Passes and what they need.
struct Passes {
    cull: AsteroidCullPass,
    mesh: AsteroidMeshPass,
    points: AsteroidPointPass,
    /// Of one method.
    impostors: Option<(ImpostorMethod, AsteroidImpostorPass)>,
    bake: Option<ImpostorBakePass>,
    layout: wgpu::BindGroupLayout,
}

/// Buffers that are filled anew every frame.
struct FrameBuffers {
    items: GrowingBuffer,
    links: GrowingBuffer,
    planes: GrowingBuffer,
    views: GrowingBuffer,
    tables: GrowingBuffer,
    fields: GrowingBuffer,
    counts: GrowingBuffer,
    totals: GrowingBuffer,
    bases: GrowingBuffer,
    entries: GrowingBuffer,
    arguments: GrowingBuffer,
    drawn_points: GrowingBuffer,
    /// One uniform per kind of list.
    kinds: Option<(wgpu::Buffer, u32)>,
}

/// See the module.
pub(crate) struct Asteroids {
    held: Option<Held>,
    passes: Option<Passes>,
    tables: Tables,
    buffers: FrameBuffers,
    targets: LayerTargets,
}

/// Where the counts of a frame will lie in the readback buffer.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CountPlaces {
    totals: ReadbackPlace,
    count: usize,
    points: ReadbackPlace,
}

impl FrameBuffers {
    fn new() -> Self {
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::COPY_SRC;
        let buffer = |label: &'static str| GrowingBuffer::new(label, usage);
        Self {
            items: buffer("asteroid groups"),
            links: buffer("asteroid links"),
            planes: buffer("asteroid planes"),
            views: buffer("asteroid views"),
            tables: buffer("asteroid tables"),
            fields: buffer("asteroid fields"),
            counts: buffer("asteroid counts"),
            totals: buffer("asteroid totals"),
            bases: buffer("asteroid bases"),
            entries: buffer("asteroid lists"),
            arguments: GrowingBuffer::new("asteroid arguments", usage | wgpu::BufferUsages::INDIRECT),
            drawn_points: buffer("asteroid points drawn"),
            kinds: None,
        }
    }
}

impl Asteroids {
    pub(crate) fn new() -> Self {
        Self {
            held: None,
            passes: None,
            tables: Vec::new(),
            buffers: FrameBuffers::new(),
            targets: LayerTargets::new(),
        }
    }

    /// Holds the fields of a scene on the adapter, until their instances or shapes are others.
    pub(crate) fn hold(
        &mut self,
        gpu: &Gpu,
        objects: &SceneObjects,
        settings: &AsteroidSettings,
    ) -> Result<(), RenderError> {
        if self.held.as_ref().is_none_or(|held| !held.holds(objects)) {
            // Gone before its successor is made, so that both never exist at once.
            self.held = None;
            self.held = Some(Held::new(gpu, objects)?);
        }
        let passes = self.passes.get_or_insert_with(|| {
            let layout = asteroid_layout(gpu);
            Passes {
                cull: AsteroidCullPass::new(gpu),
                mesh: AsteroidMeshPass::new(gpu, &layout),
                points: AsteroidPointPass::new(gpu),
                impostors: None,
                bake: None,
                layout,
            }
        });
        let method = settings.impostor.chosen();
        if settings.finest_only || method == ImpostorMethod::None {
            return Ok(());
        }
        if passes.impostors.as_ref().is_none_or(|(of, _)| *of != method) {
            passes.impostors = AsteroidImpostorPass::new(gpu, AsteroidSource::Lists, &passes.layout, method)
                .map(|pass| (method, pass));
        }
        let bake = passes.bake.get_or_insert_with(|| ImpostorBakePass::new(gpu));
        if let (Some(held), Some((_, pass))) = (&mut self.held, &passes.impostors) {
            held.hold_atlases(gpu, bake, pass, settings)?;
        }
        Ok(())
    }

    /// Gives back everything that belongs to a scene or a size.
    pub(crate) fn release(&mut self) {
        self.held = None;
        self.tables.clear();
        self.buffers = FrameBuffers::new();
        self.targets = LayerTargets::new();
    }

    /// Plans the fields that are held, for a camera at `camera_m` (ICRS, barycentric, m); points reach `margin_px` over borders. `None` if
    /// nothing is held or there are none.
    #[expect(clippy::too_many_arguments, reason = "a plan takes the scene, the pictures and the settings")]
    pub(crate) fn plan(
        &mut self,
        gpu: &Gpu,
        objects: &SceneObjects,
        settings: &AsteroidSettings,
        viewports: &[Viewport],
        margin_px: f64,
        camera_m: DVec3,
        suns: &[Sun],
    ) -> Result<Option<AsteroidPlan>, RenderError> {
        let Self { held, tables, .. } = self;
        match held {
            Some(held) if !objects.fields.is_empty() && !viewports.is_empty() => {
                AsteroidPlan::new(gpu, held, tables, objects, settings, viewports, margin_px, camera_m, suns).map(Some)
            }
            _ => Ok(None),
        }
    }

    /// Uploads a plan and records culling for all pictures.
    pub(crate) fn record_cull(
        &mut self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        timer: &mut GpuTimer,
        plan: &AsteroidPlan,
    ) {
        self.targets.begin();
        let (Some(held), Some(passes)) = (&self.held, &self.passes) else { return };
        let buffers = &mut self.buffers;
        buffers.items.upload(gpu, &plan.items);
        buffers.fields.upload(gpu, &plan.fields);
        let lists = plan.planes.len() as u64 * u64::from(plan.kinds);
        buffers.totals.with_room(gpu, 4 * (1 + lists));
        buffers.bases.with_room(gpu, 4 * lists);
        buffers.arguments.with_room(gpu, ASTEROID_ARGUMENT_BYTES * lists);
        buffers.entries.with_room(gpu, plan.capacity * size_of::<layout::AsteroidEntry>() as u64);
        let stride = kind_stride(gpu);
        if buffers.kinds.as_ref().is_none_or(|(_, kinds)| *kinds != plan.kinds) {
            let mut uniforms = vec![0_u32; (plan.kinds * stride / 4) as usize];
            for kind in 0..plan.kinds {
                uniforms[(kind * stride / 4) as usize] = kind;
            }
            let buffer = filled_buffer(gpu, "asteroid kinds", &uniforms, wgpu::BufferUsages::UNIFORM);
            buffers.kinds = Some((buffer, plan.kinds));
        }
        let drawn_points = buffers.drawn_points.with_room(gpu, 4 * POINT_COUNTS as u64).clone();
        encoder.clear_buffer(&drawn_points, 0, None);
        buffers.views.upload(gpu, &plan.views);
        buffers.tables.upload(gpu, &plan.tables);
        if let Some(lists) = &plan.lists {
            plan.upload_lists(gpu, held, buffers, lists);
            return;
        }
        let counts = buffers.counts.with_room(gpu, 4 * plan.counts).clone();
        encoder.clear_buffer(&counts, 0, None);
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
            label: Some("asteroid cull"),
            timestamp_writes: timer.pass("asteroid cull"),
        });
        let numbers = CullNumbers {
            items: plan.cut.shape_items as u32,
            planes: plan.planes.len() as u32,
            kinds: plan.kinds,
            mesh_kinds: held.kinds.meshes as u32,
            capacity: plan.capacity as u32,
        };
        let cull = CullBuffers {
            views: buffers.views.with_room(gpu, 0),
            tables: buffers.tables.with_room(gpu, 0),
            planes: buffers.planes.upload(gpu, &plan.encoded_planes),
            links: buffers.links.upload(gpu, &plan.links),
            items: buffers.items.with_room(gpu, 0),
            instances: &held.instances,
            fields: buffers.fields.with_room(gpu, 0),
            shapes: &held.shapes,
            lods: &held.lods,
            meshes: &held.meshes,
            counts: &counts,
            totals: buffers.totals.with_room(gpu, 0),
            bases: buffers.bases.with_room(gpu, 0),
            entries: buffers.entries.with_room(gpu, 0),
            arguments: buffers.arguments.with_room(gpu, 0),
        };
        passes.cull.record(gpu, &mut pass, numbers, &cull);
    }

    /// Records asteroids that are points into the sums of one batch of `tiles` tiles, whose viewports have the numbers of the plan's.
    #[expect(clippy::too_many_arguments, reason = "a pass takes its settings and its buffers")]
    pub(crate) fn record_points(
        &mut self,
        gpu: &Gpu,
        pass: &mut wgpu::ComputePass<'_>,
        plan: &AsteroidPlan,
        range: &FixedPoint,
        target: &StarTarget<'_>,
        tiles: u32,
        high_words: &wgpu::Buffer,
        occlusion: &Occlusion<'_>,
    ) {
        let (Some(held), Some(passes)) = (&self.held, &self.passes) else { return };
        if !plan.cut.items.iter().any(|item| item.holds_points) {
            return;
        }
        let buffers = &mut self.buffers;
        let points = AsteroidPoints {
            items: buffers.items.with_room(gpu, 0),
            count: plan.items.len() as u32,
            instances: &held.instances,
            fields: buffers.fields.with_room(gpu, 0),
            shapes: &held.shapes,
            lods: &held.lods,
            views: buffers.views.with_room(gpu, 0),
            tables: buffers.tables.with_room(gpu, 0),
            areas: &held.areas,
            drawn: buffers.drawn_points.with_room(gpu, 0),
        };
        passes.points.record(gpu, pass, range, target, tiles, high_words, occlusion, &points);
    }

    /// Records the copy of the counts; call it once per frame.
    pub(crate) fn copy_counts(
        &mut self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        readback: &mut ReadbackBuffer,
        plan: &AsteroidPlan,
    ) -> CountPlaces {
        let count = 1 + plan.planes.len() * plan.kinds as usize;
        let bytes = 4 * count as u64;
        let totals = readback.copy(gpu, encoder, self.buffers.totals.with_room(gpu, bytes), 0, bytes);
        let points = self.buffers.drawn_points.with_room(gpu, 4 * POINT_COUNTS as u64);
        let points = readback.copy(gpu, encoder, points, 0, 4 * POINT_COUNTS as u64);
        CountPlaces { totals, count, points }
    }

    /// Bytes that the counts need in the readback buffer.
    pub(crate) fn count_bytes(plan: &AsteroidPlan) -> u64 {
        4 * (1 + plan.planes.len() as u64 * u64::from(plan.kinds)) + 4 * POINT_COUNTS as u64 + 64
    }

    /// The counts of each of `views` views.
    pub(crate) fn read_counts(
        &self,
        gpu: &Gpu,
        readback: &mut ReadbackBuffer,
        places: CountPlaces,
        plan: &AsteroidPlan,
        views: usize,
    ) -> Result<Vec<AsteroidCounts>, RenderError> {
        let totals: Vec<u32> = readback.read(gpu, places.totals, places.count)?;
        if u64::from(totals[0]) > plan.capacity {
            return Err(RenderError::AsteroidLists { needed: u64::from(totals[0]), limit: plan.capacity });
        }
        let points: Vec<u32> = readback.read(gpu, places.points, POINT_COUNTS)?;
        Ok(self.held.as_ref().map_or_else(Vec::new, |held| plan.counts_of(held, &totals[1..], &points, views)))
    }
}

/// Counts of the pass over points: per viewport points, and those of groups that hold nothing else.
const POINT_COUNTS: usize = 2 * MAX_VIEWPORTS;

/// Bytes between the uniforms of two kinds.
fn kind_stride(gpu: &Gpu) -> u32 {
    gpu.device.limits().min_uniform_buffer_offset_alignment.max(size_of::<layout::AsteroidBucket>() as u32)
}
