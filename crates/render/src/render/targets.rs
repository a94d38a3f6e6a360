//! Data that techniques share in a frame: the buffers of every batch of tiles, surfaces that hide stars, and their bindings.
//!
//! The buffer `pixels` of a batch has two planes of half a pixel each: first sums of light, then, after the resolve
//! pass, luminance and solid angle. The display image has a separate buffer. [`Targets::begin`] allocates the buffers
//! of a frame; [`Targets::enter`] clears those that a phase fills.

mod bindings;
mod grid;

use super::{
    frame::Wanted,
    layout,
    tabulated::MappingTables,
    technique::{FrameInputs, Phase},
    viewport::encode_viewport,
};
use crate::{
    gpu::{Gpu, GrowingBuffer, filled_buffer},
    plan::{
        DISPLAY_BYTES, KernelPlan,
        plain_blocks::PLAIN_BLOCK_PX,
        stars::cull::MAX_VIEWPORTS,
        tiles::{BYTES_PER_PIXEL, MAX_TILES},
    },
    render::constants::{counters, plain_blocks::NO_POINTS},
    view::Viewport,
};

pub(crate) use crate::render::constants::pixel_grid::{COLUMNS, ROWS};
pub(crate) use bindings::{
    Occlusion, PictureTarget, Sums, bind_occlusion, bind_picture, bind_sums, splatting, splatting_shader,
};
use grid::{encoded_tiles, grid_of};
#[cfg(test)]
pub(crate) use grid::{partial_sums, pixel_grid};
pub(crate) use grid::{row_groups, tile_grid, workgroups};

/// Counters of asteroids drawn as points: visible points per viewport, then visible asteroids of groups that contain only points.
pub(crate) const POINT_COUNTERS: u32 = 2 * MAX_VIEWPORTS as u32;
/// Every adapter binds parts of buffers at multiples of this number of bytes.
const BINDING_ALIGNMENT: u64 = 256;
/// Size of a partial sum, bytes: metered illuminance, and solid angle excluded from metering.
pub(crate) const PARTIAL_SUM_BYTES: u64 = 8;
/// Index of the counter of overflowed sums.
pub(crate) const OVERFLOW_COUNTER: usize = counters::COUNTER_OVERFLOWS as usize;
/// Index of the first counter of drawn stars, one per view.
pub(crate) const VIEW_COUNTERS: usize = counters::FIRST_VIEW_COUNTER as usize;

/// Buffers of one batch of tiles, kept from frame to frame.
struct BatchBuffers {
    tiles: GrowingBuffer,
    pixels: GrowingBuffer,
    high_words: GrowingBuffer,
    bright: GrowingBuffer,
    display: GrowingBuffer,
}

impl BatchBuffers {
    fn new() -> Self {
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::COPY_SRC;
        Self {
            tiles: GrowingBuffer::for_list("tiles"),
            pixels: GrowingBuffer::new("pixels", usage),
            high_words: GrowingBuffer::new("high words", usage),
            bright: GrowingBuffer::new("bright sums", usage),
            display: GrowingBuffer::new("display", usage),
        }
    }
}

/// Buffers of one batch in a frame.
pub(crate) struct BatchTargets {
    /// Encoded tiles on the adapter.
    pub tiles: wgpu::Buffer,
    /// Encoded tiles on the host.
    pub encoded_tiles: Vec<layout::Tile>,
    /// Low words of the sums, then the picture.
    pub pixels: wgpu::Buffer,
    /// High words of the sums.
    pub high_words: wgpu::Buffer,
    /// Separate sums of the brightest stars: the low words, then the high words, which begin at [`BatchTargets::bright_high_bytes`].
    pub bright: Option<wgpu::Buffer>,
    /// Display image, if one is made.
    pub display: Option<wgpu::Buffer>,
    /// Result of the geometry pass per pixel; `None` without bodies and asteroids.
    pub geometry: Option<wgpu::Buffer>,
    /// Pixels of the batch.
    pub plane_pixels: u32,
    /// Offset of the high words of the brightest stars, bytes.
    pub bright_high_bytes: u64,
    /// Workgroups of the passes over its pixels: columns, rows, tiles.
    pub grid: [u32; 3],
    /// Images that are made of the batch.
    pub made: Wanted,
}

/// Sample layers with the asteroids of one tile.
#[derive(Clone)]
pub(crate) struct RasterLayers {
    /// Luminance in units of `luminance_scale`, `samples` times as wide and high as the tile.
    pub colour: wgpu::TextureView,
    /// Reversed depth of the same size: `near_m` divided by the distance; 0: empty.
    pub depth: wgpu::TextureView,
    /// Colours of the six cube faces, as an array.
    pub faces_colour: wgpu::TextureView,
    /// Depths of the six cube faces, as an array.
    pub faces_depth: wgpu::TextureView,
    /// Bit set of the drawn faces; 0: the views of faces are placeholders.
    pub faces: u32,
    /// Side of a face, samples.
    pub face_size_px: u32,
    /// Samples along a side of a pixel.
    pub samples: u32,
    /// Distance at depth 1, m.
    pub near_m: f32,
    /// cd/m^2 per unit of luminance.
    pub luminance_scale: f32,
}

/// Encoded bodies for the splatting passes.
#[derive(Clone)]
pub(crate) struct SeenBodies {
    pub view_bodies: wgpu::Buffer,
    pub body_runs: wgpu::Buffer,
}

/// Grid of points over every picture, for light that is smooth from pixel to pixel: see
/// `shaders/shared/point_grid.wgsl`.
#[derive(Clone)]
pub(crate) struct SmoothGrid {
    /// One grid per viewport. Their points are in [`Targets::grid_points`].
    pub grids: Vec<layout::PointGrid>,
    /// The same grids on the adapter.
    pub list: wgpu::Buffer,
}

/// Grids of plain blocks: see `shaders/plain_blocks/`.
#[derive(Clone)]
pub(crate) struct PlainGrids {
    /// One grid per viewport.
    pub grids: Vec<layout::PlainGrid>,
    /// Points of the sums of smooth light.
    pub own: SmoothGrid,
    /// The grids on the adapter.
    pub list: wgpu::Buffer,
}

/// The map of faint light: see `shaders/shared/sky_map.wgsl`.
#[derive(Clone)]
pub(crate) struct SkyTexels {
    /// Scale of its texels.
    pub map: layout::SkyMap,
    /// Edges of the caps that do not read it: [`crate::plan::smooth_light::caps::Caps::edges`].
    pub caps: [f32; 2],
    /// The texels.
    pub texels: wgpu::Buffer,
}

/// Diffuse light: see `shaders/shared/diffuse_light.wgsl`.
#[derive(Clone)]
pub(crate) struct DiffuseTexels {
    /// Parameters for reading it.
    pub light: layout::DiffuseLight,
    /// The texels.
    pub texels: wgpu::Buffer,
    /// Grid for its smooth parts; `None`: every pixel reads the texels.
    pub smooth: Option<SmoothGrid>,
    /// Grid of the part that may be rough, in frames with plain blocks.
    pub rough: Option<SmoothGrid>,
}

/// Buffers shared by techniques in a frame.
pub(crate) struct Targets {
    batch_buffers: Vec<BatchBuffers>,
    viewport_buffer: GrowingBuffer,
    counter_buffer: GrowingBuffer,
    partial_buffer: GrowingBuffer,
    point_buffer: GrowingBuffer,
    /// Number of points of all grids of the frame.
    point_count: u32,
    stand_in: wgpu::Buffer,
    /// Exposure of the frame.
    pub exposure: wgpu::Buffer,
    /// One entry per batch.
    pub batches: Vec<BatchTargets>,
    /// All encoded viewports.
    pub viewports: wgpu::Buffer,
    /// Counters of overflows and stars, counters of asteroids, then the flags of the blocks of all tiles.
    pub counters: wgpu::Buffer,
    /// Number of counters of overflows and stars.
    pub counter_count: usize,
    /// Partial sums for the exposure.
    pub partial_sums: wgpu::Buffer,
    /// Number of partial sums.
    pub partial_count: u32,
    /// Encoded bodies; `None` without bodies and asteroids.
    pub bodies: Option<SeenBodies>,
    /// Asteroid layers of the tile whose geometry is being recorded.
    pub layers: Option<RasterLayers>,
    /// Smooth part of scattered light, if the resolve pass adds it.
    pub veil: Option<SmoothGrid>,
    /// Light added by the air, if it is interpolated.
    pub air: Option<SmoothGrid>,
    /// Glare of bodies in plain blocks.
    pub near: Option<SmoothGrid>,
    /// Plain blocks; `None`: the frame has none.
    pub plain: Option<PlainGrids>,
    /// Index of the counter that is the flag of the first plain block of each viewport.
    pub plain_flags: Vec<u32>,
    /// Map of faint light, if the resolve pass adds it.
    pub sky: Option<SkyTexels>,
    /// Diffuse light, if the resolve pass adds it.
    pub diffuse: Option<DiffuseTexels>,
}

impl Targets {
    pub(crate) fn new(gpu: &Gpu) -> Self {
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::COPY_SRC;
        // The placeholder is as large as the largest structure or list of an unused binding.
        let nothing = [layout::PlainGrid { first: NO_POINTS, ..Default::default() }; MAX_VIEWPORTS];
        let stand_in = filled_buffer(gpu, "nothing", &nothing, usage | wgpu::BufferUsages::UNIFORM);
        let exposure = gpu.create_buffer(&wgpu::BufferDescriptor {
            label: Some("exposure"),
            size: size_of::<layout::Exposure>() as u64,
            usage,
            mapped_at_creation: false,
        });
        Self {
            batch_buffers: Vec::new(),
            viewport_buffer: GrowingBuffer::for_list("viewports"),
            counter_buffer: GrowingBuffer::new("counters", usage),
            partial_buffer: GrowingBuffer::new("partial sums", usage),
            point_buffer: GrowingBuffer::new("grid points", wgpu::BufferUsages::STORAGE),
            point_count: 0,
            exposure,
            batches: Vec::new(),
            viewports: stand_in.clone(),
            counters: stand_in.clone(),
            counter_count: 0,
            partial_sums: stand_in.clone(),
            partial_count: 0,
            bodies: None,
            layers: None,
            veil: None,
            air: None,
            near: None,
            plain: None,
            plain_flags: Vec::new(),
            sky: None,
            diffuse: None,
            stand_in,
        }
    }

    /// Releases everything that depends on the size of images.
    pub(crate) fn release(&mut self) {
        self.batch_buffers.clear();
        self.batches.clear();
        let own =
            [&mut self.viewport_buffer, &mut self.counter_buffer, &mut self.partial_buffer, &mut self.point_buffer];
        own.into_iter().for_each(GrowingBuffer::release);
        for buffer in [&mut self.viewports, &mut self.counters, &mut self.partial_sums] {
            *buffer = self.stand_in.clone();
        }
        self.forget_frame();
    }

    /// Forgets what techniques store for a frame.
    fn forget_frame(&mut self) {
        self.bodies = None;
        self.layers = None;
        self.veil = None;
        self.air = None;
        self.near = None;
        self.plain = None;
        self.sky = None;
        self.diffuse = None;
    }

    /// Returns the grids of plain blocks, or grids without points.
    pub(crate) fn plain_list(&self) -> &wgpu::Buffer {
        self.plain.as_ref().map_or(&self.stand_in, |plain| &plain.list)
    }

    /// Returns the map of faint light, or a placeholder.
    pub(crate) fn faint_map(&self) -> (layout::SkyMap, &wgpu::Buffer) {
        self.sky.as_ref().map_or((layout::SkyMap::default(), &self.stand_in), |sky| (sky.map, &sky.texels))
    }

    /// Allocates the buffers of a frame, and uploads its viewports and tiles.
    pub(crate) fn begin(
        &mut self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        frame: &FrameInputs<'_>,
        views: usize,
        tables: &MappingTables,
    ) {
        let plan = frame.plan;
        // Viewports, counters and partial sums.
        let encoded: Vec<layout::Viewport> = plan
            .views
            .viewports
            .iter()
            .zip(&plan.stars.kernels)
            .map(|(v, kernels)| encode(v, kernels, tables))
            .collect();
        self.viewports = self.viewport_buffer.upload_list(gpu, &encoded, MAX_VIEWPORTS).clone();
        // The flags of all batches follow the counters.
        self.counter_count = VIEW_COUNTERS + views;
        let first_flag = self.first_point_counter() + POINT_COUNTERS;
        let (tiles, partials, mut counters_and_flags) = encoded_tiles(plan, first_flag);
        // Then come the flags of plain blocks.
        self.plain_flags.clear();
        if plan.plain_blocks.is_some() {
            for viewport in &plan.views.viewports {
                self.plain_flags.push(counters_and_flags);
                counters_and_flags += viewport.size().map(|side| side.div_ceil(PLAIN_BLOCK_PX)).iter().product::<u32>();
            }
        }
        self.partial_count = partials;
        self.partial_sums = self.partial_buffer.with_room(gpu, u64::from(partials) * PARTIAL_SUM_BYTES).clone();
        self.counters = self.counter_buffer.with_room(gpu, 4 * u64::from(counters_and_flags)).clone();
        encoder.clear_buffer(&self.counters, 0, None);
        self.point_count = 0;
        self.forget_frame();

        // Buffers of each batch, depending on the images made of it.
        self.batch_buffers.truncate(plan.views.batches.len().max(1));
        self.batch_buffers.resize_with(plan.views.batches.len(), BatchBuffers::new);
        let made = frame.outputs.made(&plan.views.viewports);
        self.batches = plan
            .views
            .batches
            .iter()
            .zip(&mut self.batch_buffers)
            .zip(tiles)
            .map(|((batch, buffers), encoded_tiles)| {
                let mut made_of_batch = Wanted::default();
                batch.tiles.iter().for_each(|tile| made_of_batch |= made[tile.viewport]);
                let bytes = batch.pixels * BYTES_PER_PIXEL;
                let bright_high_bytes = (bytes / 2).next_multiple_of(BINDING_ALIGNMENT);
                let bright = plan
                    .stars
                    .ranges
                    .bright
                    .map(|_| buffers.bright.with_room(gpu, bright_high_bytes + bytes / 2).clone());
                if bright.is_none() {
                    buffers.bright.release();
                }
                BatchTargets {
                    tiles: buffers.tiles.upload_list(gpu, &encoded_tiles, MAX_TILES).clone(),
                    encoded_tiles,
                    pixels: buffers.pixels.with_room(gpu, bytes).clone(),
                    high_words: buffers.high_words.with_room(gpu, bytes / 2).clone(),
                    bright,
                    display: made_of_batch
                        .display
                        .then(|| buffers.display.with_room(gpu, batch.pixels * DISPLAY_BYTES).clone()),
                    geometry: None,
                    plane_pixels: batch.pixels as u32,
                    bright_high_bytes,
                    grid: grid_of(plan, batch),
                    made: made_of_batch,
                }
            })
            .collect();
    }

    /// Returns the first of the counters of asteroids drawn as points, which follow those of stars: see [`POINT_COUNTERS`].
    pub(crate) fn first_point_counter(&self) -> u32 {
        self.counter_count as u32
    }

    /// Reserves room for the points of grids (all points of the frame are in one buffer), and uploads the grids.
    pub(crate) fn reserve_points(
        &mut self,
        gpu: &Gpu,
        label: &'static str,
        (mut grids, count): (Vec<layout::PointGrid>, u32),
    ) -> SmoothGrid {
        grids.iter_mut().for_each(|grid| grid.first += self.point_count);
        self.point_count += count;
        let list = gpu.frame_uniform_list(label, &grids, MAX_VIEWPORTS);
        SmoothGrid { grids, list }
    }

    /// Returns the luminance at the points of all grids, cd/m^2. Every technique must have reserved its points.
    pub(crate) fn grid_points(&mut self, gpu: &Gpu) -> wgpu::Buffer {
        self.point_buffer.with_room(gpu, 16 * u64::from(self.point_count)).clone()
    }

    /// Returns the buffer of [`Targets::grid_points`], if it was created.
    pub(crate) fn held_points(&self) -> Option<&wgpu::Buffer> {
        self.point_buffer.held()
    }

    /// Clears the buffers that a phase fills.
    pub(crate) fn enter(
        &mut self,
        phase: Phase,
        encoder: &mut wgpu::CommandEncoder,
        gpu: &Gpu,
        frame: &FrameInputs<'_>,
    ) {
        match phase {
            Phase::Geometry(..) => self.layers = None,
            Phase::Splat(number) if frame.plan.display.adds_up => {
                let batch = &self.batches[number];
                let plane_bytes = frame.plan.views.batches[number].pixels * BYTES_PER_PIXEL / 2;
                // The second plane needs no clearing: its entry for a dark pixel is not read.
                encoder.clear_buffer(&batch.pixels, 0, Some(plane_bytes));
                if !gpu.wide_accumulator {
                    encoder.clear_buffer(&batch.high_words, 0, Some(plane_bytes));
                }
                if let Some(bright) = &batch.bright {
                    encoder.clear_buffer(bright, 0, Some(batch.bright_high_bytes + plane_bytes));
                }
            }
            _ => {}
        }
    }

    /// Returns the sums of a batch: those of the brightest stars if `bright` is true, otherwise those of everything else.
    pub(crate) fn sums(&self, batch: usize, bright: bool) -> Option<Sums<'_>> {
        let batch_targets = &self.batches[batch];
        let [low_words, high_words] = if bright {
            let (buffer, high) = (batch_targets.bright.as_ref()?, batch_targets.bright_high_bytes);
            let part = |offset, size| wgpu::BufferBinding { buffer, offset, size };
            [part(0, wgpu::BufferSize::new(high)), part(high, None)]
        } else {
            [batch_targets.pixels.as_entire_buffer_binding(), batch_targets.high_words.as_entire_buffer_binding()]
        };
        Some(Sums {
            viewports: &self.viewports,
            tiles: &batch_targets.tiles,
            counters: &self.counters,
            low_words,
            high_words,
            occlusion: self.occlusion(batch),
        })
    }

    /// Returns the picture of a batch.
    pub(crate) fn picture(&self, batch: usize) -> PictureTarget<'_> {
        let batch_targets = &self.batches[batch];
        PictureTarget {
            viewports: &self.viewports,
            tiles: &batch_targets.tiles,
            pixels: &batch_targets.pixels,
            partial_sums: &self.partial_sums,
            plane_pixels: batch_targets.plane_pixels,
        }
    }

    /// Returns the surfaces that hide the stars of a batch.
    pub(crate) fn occlusion(&self, batch: usize) -> Occlusion<'_> {
        match (&self.bodies, &self.batches[batch].geometry) {
            (Some(bodies), Some(geometry)) => Occlusion {
                present: true,
                geometry,
                view_bodies: &bodies.view_bodies,
                body_runs: &bodies.body_runs,
                plain_grids: self.plain_list(),
            },
            _ => Occlusion {
                present: false,
                geometry: &self.stand_in,
                view_bodies: &self.stand_in,
                body_runs: &self.stand_in,
                plain_grids: &self.stand_in,
            },
        }
    }
}

/// Encodes a viewport, including the position of its table if it is tabulated.
fn encode(viewport: &Viewport, kernels: &KernelPlan, tables: &MappingTables) -> layout::Viewport {
    let mut encoded = encode_viewport(viewport, kernels);
    if let Some(first) = tables.first_group(viewport) {
        encoded.face = first;
    }
    encoded
}
