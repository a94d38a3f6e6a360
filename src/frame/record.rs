//! Recording a frame: uploads, all passes of all batches, and the copies of what leaves the GPU.

use super::{
    Wanted,
    asteroids::{Asteroids, CountPlaces},
    blended::{self, BlendedFrame},
    geometry::encode_points,
    glare::{GlareBatch, GlareFrame},
    glare_sky::SkyScene,
    presentation::{Outputs, record_presentation},
    published::PackedFrame,
    renderer::{BatchBuffers, DISPLAY_BYTES, Prepared, Renderer},
    star_buffers::{Items, build_items},
};
use crate::{
    gpu::{GpuTimer, GrowingBuffer, ReadbackPlace, layout, storage_buffer},
    passes::{
        resolve::{HdrImage, ResolveTarget},
        shared::{PARTIAL_SUM_BYTES, PictureTarget, StarDraw, StarTarget, flags_of, partial_sums, pixel_grid},
        stars::VIEW_COUNTERS,
        tone_map::ToneMapTarget,
    },
    plan::{
        range::FixedPoint,
        settings::{Accumulator, GlareMethod, RenderSettings},
        tiles::{BYTES_PER_PIXEL, Batch},
    },
    scene::SceneSnapshot,
    view::Rig,
};

/// Where the results of a frame will lie in the readback buffer.
pub(super) struct Places {
    pub(super) counters: ReadbackPlace,
    pub(super) counter_count: usize,
    pub(super) exposure: ReadbackPlace,
    pub(super) asteroids: Option<CountPlaces>,
    pub(super) ticks: Option<ReadbackPlace>,
    /// Per viewport and tile of it, in order of rows: place of the display rows and of the HDR rows.
    pub(super) tiles: Vec<TilePlace>,
}

pub(super) struct TilePlace {
    pub(super) viewport: usize,
    pub(super) pixels: usize,
    pub(super) display: Option<ReadbackPlace>,
    /// The planes of R and G, and of B and the solid angle.
    pub(super) hdr: Option<[ReadbackPlace; 2]>,
}

pub(super) struct Recorded {
    pub(super) commands: wgpu::CommandBuffer,
    pub(super) places: Places,
}

impl Renderer {
    pub(super) fn record(
        &mut self,
        prepared: &Prepared,
        snapshot: &SceneSnapshot,
        rig: &Rig,
        settings: &RenderSettings,
        outputs: &Outputs<'_>,
        adapted_ev100: Option<f64>,
    ) -> Recorded {
        while self.batch_buffers.len() < prepared.batches.len() {
            self.batch_buffers.push(BatchBuffers::new());
        }
        self.batch_buffers.truncate(prepared.batches.len().max(1));
        let order = self.catalogue_order;
        let Self { gpu, timer, batch_buffers, readback, item_buffers, blended, geometry, asteroids, glare, .. } = self;
        let gpu = &*gpu;
        timer.begin();

        // Upload what changes from frame to frame.
        let method = settings.stars.method;
        let star_buffers = self.stars.as_ref().filter(|_| method.reads_visible());
        let Items { items, runs, near } = star_buffers
            .map(|buffers| build_items(buffers, &prepared.visible, &prepared.batches, order))
            .unwrap_or_default();
        let item_buffer = item_buffers.items.upload(gpu, &items).clone();
        let near_buffer = item_buffers.near.upload(gpu, &near).clone();
        let viewports = storage_buffer(gpu, "viewports", &prepared.encoded);
        // The flags of all batches follow the counters that are read back.
        let counter_count = VIEW_COUNTERS + rig.views().len();
        let (tiles, partial_count, counters_and_flags) = encoded_tiles(prepared, counter_count as u32);
        let tile_buffers: Vec<_> = tiles.iter().map(|tiles| storage_buffer(gpu, "tiles", tiles)).collect();
        let counters = gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("counters"),
            size: (4 * u64::from(counters_and_flags)).next_multiple_of(16),
            usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC,
            mapped_at_creation: false,
        });
        let exposure = gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("exposure"),
            size: size_of::<layout::Exposure>() as u64,
            usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC,
            mapped_at_creation: false,
        });
        let partials = self.partial_sums.with_room(gpu, u64::from(partial_count) * PARTIAL_SUM_BYTES).clone();
        let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("frame") });

        // An empty pass, for the time at which the GPU begins.
        drop(begin_pass(&mut encoder, timer, "begin"));

        let blends = method.accumulator() == Accumulator::Blending;
        let blended_frame = blends.then(|| {
            let catalogue = self.published.catalogue.as_ref();
            let shown = blended::shown_ev100(settings, adapted_ev100, prepared.camera_pc, catalogue);
            let plan = blended.begin(gpu, settings, shown);
            let camera_pc = prepared.camera_pc.as_vec3().to_array();
            let segments = catalogue.map(|catalogue| catalogue.segments.clone()).unwrap_or_default();
            BlendedFrame { plan, camera_pc, colours: self.star_pass.colours(), segments }
        });

        let geometry_frame =
            prepared.bodies.as_ref().map(|plan| geometry.begin(gpu, &snapshot.objects, plan, &prepared.batches));
        if let Some(frame) = &geometry_frame {
            let asteroid_plan = prepared.asteroids.as_ref();
            if let Some(plan) = asteroid_plan {
                asteroids.record_cull(gpu, &mut encoder, timer, plan);
            }
            for (index, batch) in prepared.batches.iter().enumerate() {
                for (number, tile) in batch.tiles.iter().enumerate() {
                    let width = prepared.viewports[tile.viewport].size()[0];
                    let buffers = (&viewports, &tile_buffers[index]);
                    let drawn = asteroid_plan.filter(|plan| plan.draws(tile.viewport));
                    let layers = drawn.and_then(|plan| asteroids.record_layers(gpu, &mut encoder, timer, plan, tile));
                    let mut pass = begin_pass(&mut encoder, timer, "geometry");
                    let place = (index, number as u32);
                    geometry.record_tile(gpu, &mut pass, frame, place, tile, width, layers.as_ref(), buffers);
                }
            }
        } else {
            geometry.release();
        }
        let geometry = &*geometry;

        // Where the exposure is known before the pixels are, the resolve pass writes the display image itself.
        let known_ev100 = settings.exposure.known_ev100(adapted_ev100);
        let glare_method = settings.glare.chosen(method);
        let glares = glare_method != GlareMethod::None;
        let made = outputs.made(&prepared.viewports);
        let any =
            |batch: &Batch, what: &dyn Fn(Wanted) -> bool| batch.tiles.iter().any(|tile| what(made[tile.viewport]));
        for (index, batch) in prepared.batches.iter().enumerate() {
            let buffers = &mut batch_buffers[index];
            let bytes = batch.pixels * BYTES_PER_PIXEL;
            let plane_pixels = batch.pixels as u32;
            let pixels = buffers.pixels.with_room(gpu, bytes).clone();
            let plane_bytes = bytes / 2;
            let high_words = buffers.high_words.with_room(gpu, plane_bytes).clone();
            let bright = prepared.ranges.bright.map(|range| {
                let low = buffers.bright_pixels.with_room(gpu, plane_bytes).clone();
                (range, low, buffers.bright_high_words.with_room(gpu, plane_bytes).clone())
            });
            if bright.is_none() {
                buffers.bright_pixels.release();
                buffers.bright_high_words.release();
            }
            if blends || method.accumulator() == Accumulator::PerPixel {
                for (tile, encoded) in batch.tiles.iter().zip(&tiles[index]) {
                    let encoded = storage_buffer(gpu, "tile", std::slice::from_ref(encoded));
                    let target = PictureTarget {
                        viewports: &viewports,
                        tiles: &encoded,
                        pixels: &pixels,
                        partial_sums: &partials,
                        plane_pixels,
                    };
                    let viewport = &prepared.viewports[tile.viewport];
                    if let Some(frame) = &blended_frame {
                        blended.record_tile(gpu, &mut encoder, timer, frame, viewport, tile, &target);
                    } else {
                        let grid = pixel_grid(std::slice::from_ref(tile), &[viewport.size()[0]]);
                        let mut pass = begin_pass(&mut encoder, timer, "stars");
                        self.published.resolve_cell_sky(gpu, &mut pass, settings, viewport, &target, grid);
                    }
                }
                continue;
            }
            let draws: Vec<StarDraw<'_>> = runs
                .iter()
                .filter(|run| run.batch == index)
                .map(|run| StarDraw {
                    stars: run.segment.zip(star_buffers).map_or(&near_buffer, |(segment, stars)| stars.buffer(segment)),
                    items: &item_buffer,
                    first_item: run.first_item,
                    item_count: run.item_count,
                })
                .collect();
            let star_target =
                |pixels| StarTarget { viewports: &viewports, tiles: &tile_buffers[index], counters: &counters, pixels };
            let grid = grid_of(prepared, batch);
            let occlusion = geometry.occlusion(geometry_frame.as_ref(), index);
            let points = prepared.bodies.as_ref().map(|plan| encode_points(&plan.points, &batch.tiles));
            let points = points.filter(|points| !points.is_empty());
            let points = points.map(|points| (storage_buffer(gpu, "points", &points), points.len() as u32));
            if method.accumulator() == Accumulator::PackedCompareExchange {
                let frame = PackedFrame {
                    method,
                    camera_pc: prepared.camera_pc.as_vec3().to_array(),
                    faintest_lx: prepared.faintest_lx,
                    tiles: batch.tiles.len() as u32,
                    draws: &draws,
                    colours: self.star_pass.colours(),
                    grid,
                };
                let words = self.published.packed_words(gpu, &mut encoder, batch.pixels);
                let mut pass = begin_pass(&mut encoder, timer, "stars");
                self.published.record_packed(gpu, &mut pass, &frame, &star_target(&words));
                drop(pass);
                let mut pass = begin_pass(&mut encoder, timer, "resolve");
                let target = PictureTarget {
                    viewports: &viewports,
                    tiles: &tile_buffers[index],
                    pixels: &pixels,
                    partial_sums: &partials,
                    plane_pixels,
                };
                self.published.resolve_packed(gpu, &mut pass, &frame, &words, &target);
                continue;
            }
            let hdr = if glares || any(batch, &|wanted: Wanted| wanted.hdr) {
                HdrImage::Whole
            } else if any(batch, &|wanted: Wanted| wanted.hdr_stays || (wanted.display && known_ev100.is_none())) {
                HdrImage::Lit
            } else {
                HdrImage::None
            };
            // The second plane needs no clearing: what stands there beside a dark pixel is not read.
            encoder.clear_buffer(&pixels, 0, Some(plane_bytes));
            if !gpu.wide_accumulator {
                encoder.clear_buffer(&high_words, 0, Some(plane_bytes));
            }
            {
                let mut pass = begin_pass(&mut encoder, timer, "stars");
                let target = star_target(&pixels);
                self.star_pass.record(
                    gpu,
                    &mut pass,
                    &prepared.ranges.main,
                    prepared.motion,
                    &target,
                    &high_words,
                    &occlusion,
                    &draws,
                );
                if let Some((buffer, count)) = &points {
                    // The faintest magnitude is one of stars.
                    let range = &FixedPoint { faintest_lx: 0.0, ..prepared.ranges.main };
                    let point_pass = geometry.point_pass(gpu);
                    point_pass.record(gpu, &mut pass, range, &target, &high_words, &occlusion, (buffer, *count));
                }
                if let Some(plan) = &prepared.asteroids {
                    let tiles = batch.tiles.len() as u32;
                    let range = &prepared.ranges.main;
                    asteroids.record_points(gpu, &mut pass, plan, range, &target, tiles, &high_words, &occlusion);
                }
            }
            if let Some((range, low, bright_high)) = &bright {
                encoder.clear_buffer(low, 0, Some(plane_bytes));
                encoder.clear_buffer(bright_high, 0, Some(plane_bytes));
                let mut pass = begin_pass(&mut encoder, timer, "stars");
                let target = star_target(low);
                self.star_pass.record(gpu, &mut pass, range, prepared.motion, &target, bright_high, &occlusion, &draws);
                if let Some((buffer, count)) = &points {
                    let point_pass = geometry.point_pass(gpu);
                    point_pass.record(gpu, &mut pass, range, &target, bright_high, &occlusion, (buffer, *count));
                }
            }
            let display_here = known_ev100.is_some() && !glares && any(batch, &|wanted: Wanted| wanted.display);
            let display = display_here.then(|| buffers.display.with_room(gpu, batch.pixels * DISPLAY_BYTES).clone());
            let mut pass = begin_pass(&mut encoder, timer, "resolve");
            let target = ResolveTarget {
                viewports: &viewports,
                tiles: &tile_buffers[index],
                pixels: &pixels,
                bright: bright.as_ref().map(|(_, low, high)| [low, high]),
                high_words: &high_words,
                counters: &counters,
                partial_sums: &partials,
                display: display.as_ref(),
                occlusion: &occlusion,
                plane_pixels,
            };
            let tone_map = &settings.tone_map;
            self.resolve_pass.record(gpu, &mut pass, &prepared.ranges, hdr, known_ev100, tone_map, &target, grid);
        }
        if glares {
            let batches = prepared.batches.iter().enumerate().map(|(index, batch)| GlareBatch {
                batch,
                tiles: &tile_buffers[index],
                encoded_tiles: &tiles[index],
                pixels: batch_buffers[index].pixels.with_room(gpu, batch.pixels * BYTES_PER_PIXEL).clone(),
                grid: grid_of(prepared, batch),
            });
            let frame = GlareFrame {
                settings: &settings.glare,
                fraction: settings.glare.fraction_scattered(),
                method: glare_method,
                viewports: &prepared.viewports,
                encoded_viewports: &viewports,
                partial_sums: &partials,
                object_sources: prepared.bodies.as_ref().map_or(&[], |plan| &plan.glare),
                clouds: &prepared.clouds,
                batches: batches.collect(),
            };
            let scene = SkyScene::of(snapshot, settings);
            glare.record(gpu, &mut encoder, timer, &frame, &scene);
        } else {
            glare.release();
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
        let fused = known_ev100.is_some() && !glares && method.accumulator() == Accumulator::FixedPoint;
        let tone_mapped = |batch: &Batch| !fused && any(batch, &|wanted: Wanted| wanted.display);
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

        for presentation in outputs.presentations {
            record_presentation(
                gpu,
                &mut encoder,
                timer,
                &mut self.present_pass,
                prepared,
                batch_buffers,
                &exposure,
                &settings.tone_map,
                presentation,
            );
        }

        if let Some(frame) = &blended_frame {
            let count = prepared.viewports.len() as u32;
            blended.record_count(gpu, &mut encoder, frame, (&viewports, count), &counters);
        }

        // Everything that leaves the GPU goes into host buffers, whose size is wanted beforehand: alignment included.
        let mut needed = 1024 + GpuTimer::readback_bytes() + 16 * counter_count as u64;
        for viewport in &prepared.viewports {
            let pixels = viewport.size().map(u64::from).iter().product::<u64>() + 64;
            let Wanted { display, hdr, .. } = outputs.wanted[viewport.view];
            needed += pixels * (u64::from(display) * DISPLAY_BYTES + u64::from(hdr) * BYTES_PER_PIXEL) + 4096;
        }
        needed += prepared.asteroids.as_ref().map_or(0, Asteroids::count_bytes);
        readback.begin(needed);
        let mut tiles = Vec::new();
        for (batch, buffers) in prepared.batches.iter().zip(batch_buffers.iter_mut()) {
            for tile in &batch.tiles {
                let viewport = &prepared.viewports[tile.viewport];
                let count = u64::from(tile.rows) * u64::from(viewport.size()[0]);
                let first = u64::from(tile.first_pixel);
                let Wanted { display, hdr, .. } = outputs.wanted[viewport.view];
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
            asteroids: prepared.asteroids.as_ref().map(|plan| asteroids.copy_counts(gpu, &mut encoder, readback, plan)),
            ticks: timer.resolve(gpu, &mut encoder, readback),
            tiles,
        };
        Recorded { commands: encoder.finish(), places }
    }
}

pub(super) fn begin_pass<'a>(
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

/// The tiles of every batch as shaders read them, the number of partial sums of all, and the number of counters with the
/// flags of all tiles, which follow the first `counters`.
fn encoded_tiles(prepared: &Prepared, counters: u32) -> (Vec<Vec<layout::Tile>>, u32, u32) {
    let mut first_flag = counters;
    let mut first_partial = 0;
    let tiles = prepared
        .batches
        .iter()
        .map(|batch| {
            let tiles = batch.tiles.iter().map(|tile| {
                let encoded = layout::Tile {
                    viewport: tile.viewport as u32,
                    first_row: tile.first_row,
                    rows: tile.rows,
                    first_pixel: tile.first_pixel,
                    first_partial,
                    first_flag,
                    ..Default::default()
                };
                let width = prepared.viewports[tile.viewport].size()[0];
                first_partial += partial_sums(width, tile.rows);
                first_flag += flags_of(width, tile.rows);
                encoded
            });
            tiles.collect()
        })
        .collect();
    (tiles, first_partial, first_flag)
}
