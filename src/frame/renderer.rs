//! The renderer: plans, records and reads back one frame.

use std::{
    sync::Arc,
    time::{Duration, Instant},
};

use super::{
    Frame, FrameImage, FrameTimes, ViewStatistics, Wanted,
    star_buffers::{ItemBuffers, Items, StarBuffers, build_items},
};
use crate::{
    catalogue::chunks::StarSet,
    gpu::{
        AdapterReport, Gpu, GpuError, GpuTimer, GrowingBuffer, ReadbackBuffer, encode_viewport, layout, storage_buffer,
    },
    passes::{
        exposure::ExposurePass,
        resolve::{ResolvePass, ResolveTarget},
        shared::{partial_sums, pixel_grid},
        stars::{FIRST_VIEW_COUNTER, OVERFLOW_COUNTER, StarDraw, StarPass, StarTarget},
        tone_map::{ToneMapPass, ToneMapTarget},
    },
    plan::{
        cull::{CullSettings, MAX_VIEWPORTS, VisibleChunk, visible_chunks},
        plan_stars,
        range::{self, Ranges},
        settings::{ExposureMode, RenderSettings},
        tiles::{BYTES_PER_PIXEL, Batch, batches},
    },
    scene::SceneSnapshot,
    units::{PARSEC_M, illuminance_lx_from_magnitude},
    view::{Rig, Viewport},
};

/// Why a frame could not be rendered.
#[derive(Debug, thiserror::Error)]
pub enum RenderError {
    /// A view is larger than the adapter allows.
    #[error("view `{view}`: {width} x {height} pixels: this adapter's views have at most {limit} pixels a side")]
    TooLarge {
        /// The view's name.
        view: String,
        /// Width, pixels.
        width: u32,
        /// Height, pixels.
        height: u32,
        /// The limit.
        limit: u32,
    },
    /// The rig has more images than one frame can have.
    #[error("the views have {images} images in all: one frame has at most {limit}")]
    TooManyImages {
        /// How many.
        images: usize,
        /// The limit.
        limit: usize,
    },
    /// A chunk of stars does not fit the adapter's limits, or a frame's images do not.
    #[error(
        "view `{view}`: {bytes} bytes of pixels in all exceed what one frame may take ({limit} bytes): make the views smaller or fewer"
    )]
    TooManyPixels {
        /// The view that went over the limit.
        view: String,
        /// Bytes needed.
        bytes: u64,
        /// The limit.
        limit: u64,
    },
    /// Fixed-point sums overflowed. Units are chosen so that this cannot happen; it is reported, never shown.
    #[error("{0} fixed-point sums overflowed")]
    Overflow(u32),
    /// The settings name one of several images only where there are as many as views.
    #[error("{given} choices of buffers for {views} views")]
    WantedCount {
        /// How many were given.
        given: usize,
        /// How many views there are.
        views: usize,
    },
    /// The device failed.
    #[error(transparent)]
    Gpu(#[from] GpuError),
}

/// Memory that the pixels of one frame may take on the adapter: sums or HDR image, display image.
const MAX_FRAME_BYTES: u64 = 6 << 30;
/// How long the device may take for a frame before it counts as lost.
const FRAME_TIMEOUT: Duration = Duration::from_secs(600);
/// Bytes of a pixel of the display image.
const DISPLAY_BYTES: u64 = 4;

/// Buffers of one batch of tiles, kept from frame to frame.
struct BatchBuffers {
    pixels: GrowingBuffer,
    bright_pixels: GrowingBuffer,
    display: GrowingBuffer,
}

impl BatchBuffers {
    fn new() -> Self {
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::COPY_SRC;
        Self {
            pixels: GrowingBuffer::new("pixels", usage),
            bright_pixels: GrowingBuffer::new("bright pixels", usage),
            display: GrowingBuffer::new("display", usage),
        }
    }
}

/// Draws frames on one GPU.
pub struct Renderer {
    gpu: Gpu,
    star_pass: StarPass,
    resolve_pass: ResolvePass,
    exposure_pass: ExposurePass,
    tone_map_pass: ToneMapPass,
    timer: GpuTimer,
    stars: Option<StarBuffers>,
    item_buffers: ItemBuffers,
    batch_buffers: Vec<BatchBuffers>,
    partial_sums: GrowingBuffer,
    readback: ReadbackBuffer,
    frames: u64,
    /// Whether chunks outside of every view are left out; false only to measure what that saves.
    pub culling: bool,
    /// Factor on the fixed-point units: 1. Tests raise it to provoke an overflow.
    #[doc(hidden)]
    pub unit_factor: f64,
}

/// What the plan of a frame decides before anything is recorded.
struct Prepared {
    viewports: Vec<Viewport>,
    batches: Vec<Batch>,
    visible: Vec<VisibleChunk>,
    ranges: Ranges,
    encoded: Vec<layout::Viewport>,
    plan: crate::plan::FramePlan,
    total_solid_angle_sr: f64,
}

impl Renderer {
    /// A renderer on an open device.
    pub fn new(gpu: Gpu) -> Self {
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST;
        Self {
            star_pass: StarPass::new(&gpu),
            resolve_pass: ResolvePass::new(&gpu),
            exposure_pass: ExposurePass::new(&gpu),
            tone_map_pass: ToneMapPass::new(&gpu),
            timer: GpuTimer::new(&gpu),
            stars: None,
            item_buffers: ItemBuffers::new(),
            batch_buffers: Vec::new(),
            partial_sums: GrowingBuffer::new("partial sums", usage),
            readback: ReadbackBuffer::new("readback"),
            frames: 0,
            culling: true,
            unit_factor: 1.0,
            gpu,
        }
    }

    /// The adapter in use.
    pub fn adapter(&self) -> &AdapterReport {
        self.gpu.report()
    }

    /// Whether the adapter can hold the images of a rig.
    pub fn check(&self, rig: &Rig) -> Result<(), RenderError> {
        let limit = self.gpu.max_view_side_px();
        let mut bytes = 0;
        let mut images = 0;
        for view in rig.views() {
            for image in &view.images {
                let [width, height] = image.projection.mapping().size();
                let name = || view.name.clone();
                if width > limit || height > limit {
                    return Err(RenderError::TooLarge { view: name(), width, height, limit });
                }
                bytes += u64::from(width) * u64::from(height) * (BYTES_PER_PIXEL + DISPLAY_BYTES);
                if bytes > MAX_FRAME_BYTES {
                    return Err(RenderError::TooManyPixels { view: name(), bytes, limit: MAX_FRAME_BYTES });
                }
                images += 1;
            }
        }
        if images > MAX_VIEWPORTS {
            return Err(RenderError::TooManyImages { images, limit: MAX_VIEWPORTS });
        }
        Ok(())
    }

    /// Draws all views of `rig`. `wanted` says per view what to read back. With automatic exposure, `adapted_ev100` is
    /// the exposure to show the frame with; without it the frame is shown as fully adapted.
    pub fn render(
        &mut self,
        snapshot: &SceneSnapshot,
        rig: &Rig,
        settings: &RenderSettings,
        wanted: &[Wanted],
        adapted_ev100: Option<f64>,
    ) -> Result<Frame, RenderError> {
        let start = Instant::now();
        self.check(rig)?;
        if wanted.len() != rig.views().len() {
            return Err(RenderError::WantedCount { given: wanted.len(), views: rig.views().len() });
        }
        self.hold_stars(&snapshot.stars);
        let prepared = self.prepare(snapshot, rig, settings, adapted_ev100);
        if std::env::var("PROF").is_ok() {
            eprintln!("prepare {:?}", start.elapsed());
        }
        let recorded = self.record(&prepared, rig, settings, wanted, adapted_ev100);
        let plan_ms = start.elapsed().as_secs_f64() * 1e3;
        self.gpu.queue.submit([recorded.commands]);
        self.readback.map(&self.gpu);
        let wait = wgpu::PollType::Wait { submission_index: None, timeout: Some(FRAME_TIMEOUT) };
        self.gpu.device.poll(wait).map_err(GpuError::Lost)?;
        let read = self.read(&prepared, rig, &recorded.places);
        self.readback.unmap(&self.gpu);
        let mut frame = read?;
        self.frames += 1;
        frame.number = self.frames;
        frame.scene_revision = snapshot.revision;
        frame.camera_revision = snapshot.camera.revision;
        frame.times.plan_ms = plan_ms;
        frame.times.total_ms = start.elapsed().as_secs_f64() * 1e3;
        frame.times.gpu_and_readback_ms = frame.times.total_ms - plan_ms;
        Ok(frame)
    }

    fn hold_stars(&mut self, set: &Arc<StarSet>) {
        if self.stars.as_ref().is_none_or(|stars| !stars.holds(set)) {
            self.stars = None;
            self.stars = Some(StarBuffers::new(&self.gpu, set.clone()));
        }
    }

    fn prepare(
        &self,
        snapshot: &SceneSnapshot,
        rig: &Rig,
        settings: &RenderSettings,
        adapted_ev100: Option<f64>,
    ) -> Prepared {
        let camera = &snapshot.camera;
        let viewports = rig.viewports(camera.world_from_camera);
        let sizes: Vec<[u32; 2]> = viewports.iter().map(Viewport::size).collect();
        let batches = batches(&sizes, self.gpu.max_binding_bytes() / BYTES_PER_PIXEL);
        let faintest_lx = illuminance_lx_from_magnitude(settings.stars.magnitude_limit);
        let cull = CullSettings { faintest_lx, enabled: self.culling };
        let visible = visible_chunks(&snapshot.stars, camera.position_m / PARSEC_M, &viewports, cull);
        let t1 = Instant::now();
        let mut ranges = range::choose(&snapshot.stars, &visible, faintest_lx);
        if std::env::var("PROF").is_ok() {
            eprintln!("choose {} {:?}", visible.len(), t1.elapsed());
        }
        ranges.main.units_per_lx *= self.unit_factor;
        let total_solid_angle_sr = viewports.iter().map(|v| v.projection.picture_solid_angle_sr()).sum();
        let expected_ev100 = adapted_ev100.or_else(|| expected_ev100(&visible, total_solid_angle_sr, settings));
        let accumulator =
            if self.gpu.wide_accumulator { "fixed point, 2 x 64 bits" } else { "fixed point, 4 x 32 bits" };
        let plan = plan_stars(settings, &viewports, &ranges, expected_ev100, accumulator);
        let encoded = viewports.iter().zip(&plan.tent_below_lx).map(|(v, tent)| encode_viewport(v, *tent)).collect();
        Prepared { viewports, batches, visible, ranges, encoded, plan: plan.report, total_solid_angle_sr }
    }
}

/// The exposure that a frame will be metered at, as far as the stars' positions tell: good to a fraction of a stop.
fn expected_ev100(visible: &[VisibleChunk], total_solid_angle_sr: f64, settings: &RenderSettings) -> Option<f64> {
    if settings.exposure.mode == ExposureMode::Manual || total_solid_angle_sr <= 0.0 {
        return None;
    }
    let light_lx: f64 = visible.iter().map(|chunk| chunk.total_lx * f64::from(chunk.viewports.count_ones())).sum();
    let metered = crate::photometry::exposure::ev100_from_mean_luminance(light_lx / total_solid_angle_sr);
    let exposure = &settings.exposure;
    Some((metered + exposure.compensation_ev).clamp(exposure.min_ev100, exposure.max_ev100))
}

/// Where the results of a frame will lie in the readback buffer.
struct Places {
    counters: u64,
    counter_count: usize,
    exposure: u64,
    ticks: Option<u64>,
    /// Per viewport and tile of it, in order of rows: place of the display rows and of the HDR rows.
    tiles: Vec<TilePlace>,
}

struct TilePlace {
    viewport: usize,
    pixels: usize,
    display: Option<u64>,
    /// The planes of R and G, and of B and the solid angle.
    hdr: Option<[u64; 2]>,
}

struct Recorded {
    commands: wgpu::CommandBuffer,
    places: Places,
}

impl Renderer {
    fn record(
        &mut self,
        prepared: &Prepared,
        rig: &Rig,
        settings: &RenderSettings,
        wanted: &[Wanted],
        adapted_ev100: Option<f64>,
    ) -> Recorded {
        while self.batch_buffers.len() < prepared.batches.len() {
            self.batch_buffers.push(BatchBuffers::new());
        }
        self.batch_buffers.truncate(prepared.batches.len().max(1));
        let Self { gpu, timer, batch_buffers, readback, item_buffers, .. } = self;
        let gpu = &*gpu;
        timer.begin();

        // Upload what changes from frame to frame.
        let star_buffers = self.stars.as_ref().expect("stars are held before anything is recorded");
        let Items { items, runs, near } = build_items(star_buffers, &prepared.visible, &prepared.batches);
        let t0 = Instant::now();
        let item_buffer = item_buffers.items.upload(gpu, &items).clone();
        let near_buffer = item_buffers.near.upload(gpu, &near).clone();
        if std::env::var("PROF").is_ok() {
            eprintln!("upload {} items {:?}", items.len(), t0.elapsed());
        }
        let viewports = storage_buffer(gpu, "viewports", &prepared.encoded);
        let counter_count = FIRST_VIEW_COUNTER + rig.views().len();
        let counters = gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("counters"),
            size: (4 * counter_count as u64).next_multiple_of(16),
            usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC,
            mapped_at_creation: false,
        });
        let exposure = gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("exposure"),
            size: size_of::<layout::Exposure>() as u64,
            usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC,
            mapped_at_creation: false,
        });
        let (tile_buffers, partial_count) = tile_buffers(gpu, prepared);
        let partials = self.partial_sums.with_room(gpu, u64::from(partial_count) * 4).clone();
        let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("frame") });
        encoder.clear_buffer(&partials, 0, None);

        // Where the exposure is known before the pixels are, the resolve pass writes the display image itself.
        let known_ev100 = match settings.exposure.mode {
            ExposureMode::Manual => Some(settings.exposure.ev100),
            ExposureMode::Auto => adapted_ev100,
        };
        let any = |batch: &Batch, what: &dyn Fn(Wanted) -> bool| {
            batch.tiles.iter().any(|tile| what(wanted[prepared.viewports[tile.viewport].view]))
        };
        for (index, batch) in prepared.batches.iter().enumerate() {
            let buffers = &mut batch_buffers[index];
            let bytes = batch.pixels * BYTES_PER_PIXEL;
            let plane_pixels = batch.pixels as u32;
            let pixels = buffers.pixels.with_room(gpu, bytes).clone();
            let bright_pixels = prepared.ranges.bright.map(|_| buffers.bright_pixels.with_room(gpu, bytes).clone());
            if bright_pixels.is_none() {
                buffers.bright_pixels.release();
            }
            encoder.clear_buffer(&pixels, 0, Some(bytes));
            let draws: Vec<StarDraw<'_>> = runs
                .iter()
                .filter(|run| run.batch == index)
                .map(|run| StarDraw {
                    stars: run.segment.map_or(&near_buffer, |segment| star_buffers.buffer(segment)),
                    items: &item_buffer,
                    first_item: run.first_item,
                    item_count: run.item_count,
                })
                .collect();
            let star_target = |pixels| StarTarget {
                viewports: &viewports,
                tiles: &tile_buffers[index],
                counters: &counters,
                pixels,
                plane_pixels,
            };
            {
                let mut pass = begin_pass(&mut encoder, timer, "stars");
                let target = star_target(&pixels);
                self.star_pass.record(gpu, &mut pass, &prepared.ranges.main, &target, &draws);
            }
            if let (Some(range), Some(bright_pixels)) = (&prepared.ranges.bright, &bright_pixels) {
                encoder.clear_buffer(bright_pixels, 0, Some(bytes));
                let mut pass = begin_pass(&mut encoder, timer, "stars");
                self.star_pass.record(gpu, &mut pass, range, &star_target(bright_pixels), &draws);
            }
            let display_here = known_ev100.is_some() && any(batch, &|wanted: Wanted| wanted.display);
            let display = display_here.then(|| buffers.display.with_room(gpu, batch.pixels * DISPLAY_BYTES).clone());
            let hdr = any(batch, &|wanted: Wanted| wanted.hdr || (wanted.display && known_ev100.is_none()));
            let mut pass = begin_pass(&mut encoder, timer, "resolve");
            let target = ResolveTarget {
                viewports: &viewports,
                tiles: &tile_buffers[index],
                pixels: &pixels,
                bright_pixels: bright_pixels.as_ref(),
                partial_sums: &partials,
                display: display.as_ref(),
                plane_pixels,
            };
            let grid = grid_of(prepared, batch);
            let operator = settings.tone_map.operator;
            self.resolve_pass.record(gpu, &mut pass, &prepared.ranges, hdr, known_ev100, operator, &target, grid);
        }
        {
            let mut pass = begin_pass(&mut encoder, timer, "exposure");
            self.exposure_pass.record(
                gpu,
                &mut pass,
                &settings.exposure,
                known_ev100,
                prepared.total_solid_angle_sr,
                partial_count,
                &partials,
                &exposure,
            );
        }
        let tone_mapped = |batch: &Batch| known_ev100.is_none() && any(batch, &|wanted: Wanted| wanted.display);
        for (index, batch) in prepared.batches.iter().enumerate().filter(|(_, batch)| tone_mapped(batch)) {
            let buffers = &mut batch_buffers[index];
            let pixels = buffers.pixels.with_room(gpu, batch.pixels * BYTES_PER_PIXEL).clone();
            let display = buffers.display.with_room(gpu, batch.pixels * DISPLAY_BYTES);
            let mut pass = begin_pass(&mut encoder, timer, "tone map");
            let target = ToneMapTarget {
                viewports: &viewports,
                tiles: &tile_buffers[index],
                luminances: &pixels,
                exposure: &exposure,
                display,
                plane_pixels: batch.pixels as u32,
            };
            self.tone_map_pass.record(gpu, &mut pass, &settings.tone_map, &target, grid_of(prepared, batch));
        }

        // Everything that leaves the GPU goes into one host buffer.
        let mut needed = 1024 + GpuTimer::readback_bytes() + 16 * counter_count as u64;
        for viewport in &prepared.viewports {
            let pixels = viewport.size().map(u64::from).iter().product::<u64>() + 64;
            let Wanted { display, hdr } = wanted[viewport.view];
            needed += pixels * (u64::from(display) * DISPLAY_BYTES + u64::from(hdr) * BYTES_PER_PIXEL) + 4096;
        }
        readback.begin(gpu, needed);
        let mut tiles = Vec::new();
        for (batch, buffers) in prepared.batches.iter().zip(batch_buffers.iter_mut()) {
            for tile in &batch.tiles {
                let viewport = &prepared.viewports[tile.viewport];
                let count = u64::from(tile.rows) * u64::from(viewport.size()[0]);
                let first = u64::from(tile.first_pixel);
                let Wanted { display, hdr } = wanted[viewport.view];
                let mut copy = |buffer: &mut GrowingBuffer, room: u64, first_byte: u64, bytes: u64| {
                    let source = buffer.with_room(gpu, room).clone();
                    readback.copy(gpu, &mut encoder, &source, first_byte, bytes)
                };
                let room = batch.pixels * BYTES_PER_PIXEL;
                // The image lies in two planes of half a pixel each.
                let mut copy_plane = |plane: u64| {
                    let half = BYTES_PER_PIXEL / 2;
                    copy(&mut buffers.pixels, room, (plane * batch.pixels + first) * half, count * half)
                };
                let hdr = hdr.then(|| [copy_plane(0), copy_plane(1)]);
                tiles.push(TilePlace {
                    viewport: tile.viewport,
                    pixels: count as usize,
                    display: display.then(|| {
                        let room = batch.pixels * DISPLAY_BYTES;
                        copy(&mut buffers.display, room, first * DISPLAY_BYTES, count * DISPLAY_BYTES)
                    }),
                    hdr,
                });
            }
        }
        let places = Places {
            counters: readback.copy(gpu, &mut encoder, &counters, 0, 4 * counter_count as u64),
            counter_count,
            exposure: readback.copy(gpu, &mut encoder, &exposure, 0, size_of::<layout::Exposure>() as u64),
            ticks: timer.resolve(gpu, &mut encoder, readback),
            tiles,
        };
        Recorded { commands: encoder.finish(), places }
    }

    fn read(&mut self, prepared: &Prepared, rig: &Rig, places: &Places) -> Result<Frame, RenderError> {
        let Self { gpu, readback, timer, .. } = self;
        let gpu = &*gpu;
        let counters: Vec<u32> = readback.read(gpu, places.counters, places.counter_count)?;
        if counters[OVERFLOW_COUNTER] > 0 {
            return Err(RenderError::Overflow(counters[OVERFLOW_COUNTER]));
        }
        let exposure: Vec<layout::Exposure> = readback.read(gpu, places.exposure, 1)?;
        let passes_ms = match places.ticks {
            Some(place) => timer.times_ms(&readback.read(gpu, place, 2 * timer.passes())?),
            None => Vec::new(),
        };
        let mut images: Vec<FrameImage> = Vec::new();
        let mut image_of_viewport: Vec<Option<usize>> = vec![None; prepared.viewports.len()];
        for tile in &places.tiles {
            if tile.display.is_none() && tile.hdr.is_none() {
                continue;
            }
            let viewport = &prepared.viewports[tile.viewport];
            let [width, height] = viewport.size();
            let index = *image_of_viewport[tile.viewport].get_or_insert_with(|| {
                let pixels = width as usize * height as usize;
                images.push(FrameImage {
                    view: viewport.view,
                    part: viewport.part,
                    width,
                    height,
                    display: tile.display.map(|_| Vec::with_capacity(pixels * DISPLAY_BYTES as usize)),
                    hdr: tile.hdr.map(|_| Vec::with_capacity(pixels)),
                });
                images.len() - 1
            });
            if let (Some(place), Some(display)) = (tile.display, &mut images[index].display) {
                readback.append(gpu, place, tile.pixels * DISPLAY_BYTES as usize, display)?;
            }
            if let (Some([first, second]), Some(hdr)) = (tile.hdr, &mut images[index].hdr) {
                let red_green: Vec<[f32; 2]> = readback.read(gpu, first, tile.pixels)?;
                let blue_omega: Vec<[f32; 2]> = readback.read(gpu, second, tile.pixels)?;
                hdr.extend(red_green.iter().zip(&blue_omega).map(|([r, g], [b, omega])| [*r, *g, *b, *omega]));
            }
        }
        let views = statistics(prepared, rig, &counters, &passes_ms);
        Ok(Frame {
            number: 0,
            scene_revision: 0,
            camera_revision: 0,
            exposure_ev100: f64::from(exposure[0].ev100),
            metered_ev100: f64::from(exposure[0].metered_ev100),
            mean_luminance_cd_m2: f64::from(exposure[0].mean_luminance_cd_m2),
            images,
            views,
            plan: prepared.plan.clone(),
            times: FrameTimes { passes_ms, ..Default::default() },
        })
    }
}

fn begin_pass<'a>(
    encoder: &'a mut wgpu::CommandEncoder,
    timer: &mut GpuTimer,
    name: &'static str,
) -> wgpu::ComputePass<'a> {
    let timestamp_writes = timer.pass(name);
    encoder.begin_compute_pass(&wgpu::ComputePassDescriptor { label: Some(name), timestamp_writes })
}

fn grid_of(prepared: &Prepared, batch: &Batch) -> [u32; 3] {
    let widths: Vec<u32> = batch.tiles.iter().map(|tile| prepared.viewports[tile.viewport].size()[0]).collect();
    pixel_grid(&batch.tiles, &widths)
}

/// One buffer of tiles per batch, and the number of partial sums of all.
fn tile_buffers(gpu: &Gpu, prepared: &Prepared) -> (Vec<wgpu::Buffer>, u32) {
    let mut first_partial = 0;
    let buffers = prepared
        .batches
        .iter()
        .map(|batch| {
            let tiles: Vec<layout::Tile> = batch
                .tiles
                .iter()
                .map(|tile| {
                    let encoded = layout::Tile {
                        viewport: tile.viewport as u32,
                        first_row: tile.first_row,
                        rows: tile.rows,
                        first_pixel: tile.first_pixel,
                        first_partial,
                        ..Default::default()
                    };
                    first_partial += partial_sums(prepared.viewports[tile.viewport].size()[0], tile.rows);
                    encoded
                })
                .collect();
            storage_buffer(gpu, "tiles", &tiles)
        })
        .collect();
    (buffers, first_partial)
}

/// Stars drawn and GPU time of each view: the star pass is shared by stars drawn, the passes over pixels by pixels.
fn statistics(
    prepared: &Prepared,
    rig: &Rig,
    counters: &[u32],
    passes_ms: &[(&'static str, f64)],
) -> Vec<ViewStatistics> {
    let time_of =
        |stars: bool| passes_ms.iter().filter(|(name, _)| (*name == "stars") == stars).map(|(_, ms)| ms).sum::<f64>();
    let drawn = &counters[FIRST_VIEW_COUNTER..];
    let all_drawn: f64 = drawn.iter().map(|count| f64::from(*count)).sum::<f64>().max(1.0);
    let pixels_of = |view: usize| -> f64 {
        let of_view = prepared.viewports.iter().filter(|viewport| viewport.view == view);
        of_view.map(|viewport| viewport.size().map(f64::from).iter().product::<f64>()).sum()
    };
    let all_pixels: f64 = (0..rig.views().len()).map(pixels_of).sum::<f64>().max(1.0);
    rig.views()
        .iter()
        .enumerate()
        .map(|(index, view)| ViewStatistics {
            name: view.name.clone(),
            stars_drawn: u64::from(drawn[index]),
            stars_in_map: 0,
            gpu_ms: (!passes_ms.is_empty()).then(|| {
                time_of(true) * f64::from(drawn[index]) / all_drawn + time_of(false) * pixels_of(index) / all_pixels
            }),
        })
        .collect()
}
