//! Reads a frame back: images, exposure, counters and times.

use super::{
    AsteroidCounts, Frame, FrameImage, FrameTimes, RenderError, Renderer, ViewStatistics, Wanted, layout,
    submit::{FrameSlot, InFlight},
    targets::{OVERFLOW_COUNTER, Targets, VIEW_COUNTERS},
    technique::{FrameInputs, Recording},
};
use crate::{
    gpu::{Gpu, ReadbackBuffer, ReadbackPlace},
    plan::{DISPLAY_BYTES, Plan, tiles::BYTES_PER_PIXEL},
};

/// Positions of a frame's results in the readback buffer.
#[derive(Default)]
pub(crate) struct Places {
    counters: Option<(ReadbackPlace, usize)>,
    exposure: Option<ReadbackPlace>,
    /// Counts of techniques: name, position and number of words.
    pub counts: Vec<(&'static str, ReadbackPlace, usize)>,
    ticks: Option<ReadbackPlace>,
    /// Tiles of all viewports in order of rows, with the positions of their rows of the display image and the HDR image.
    tiles: Vec<TilePlace>,
}

struct TilePlace {
    viewport: usize,
    pixels: usize,
    display: Option<ReadbackPlace>,
    /// The two planes of a row: R and G, and B and the solid angle.
    hdr: Option<[ReadbackPlace; 2]>,
}

impl Places {
    /// Reads the metered exposure of a frame without other outputs.
    pub(super) fn metered_ev100(&self, gpu: &Gpu, readback: &mut ReadbackBuffer) -> Result<f64, RenderError> {
        let (Some((counters, count)), Some(exposure)) = (self.counters, self.exposure) else {
            unreachable!("every frame has counters and an exposure")
        };
        let counters: Vec<u32> = readback.read(gpu, counters, count)?;
        if counters[OVERFLOW_COUNTER] > 0 {
            return Err(RenderError::Overflow(counters[OVERFLOW_COUNTER]));
        }
        let exposure: Vec<layout::Exposure> = readback.read(gpu, exposure, 1)?;
        Ok(f64::from(exposure[0].metered_ev100))
    }
}

/// Returns the size of images, counters and exposure in the readback buffer, including alignment.
pub(super) fn bytes(frame: &FrameInputs<'_>, targets: &Targets) -> u64 {
    let mut needed = 1024 + 16 * targets.counter_count as u64;
    for viewport in &frame.plan.views.viewports {
        let pixels = viewport.size().map(u64::from).iter().product::<u64>() + 64;
        let Wanted { display, hdr, .. } = frame.outputs.wanted[viewport.view];
        needed += pixels * (u64::from(display) * DISPLAY_BYTES + u64::from(hdr) * BYTES_PER_PIXEL) + 4096;
    }
    needed
}

/// Records the copies of all results into the readback buffer.
pub(super) fn copy(recording: &mut Recording<'_>) {
    let Recording { gpu, encoder, timer, frame, targets, readback, places } = recording;
    for (batch, buffers) in frame.plan.views.batches.iter().zip(&targets.batches) {
        for tile in &batch.tiles {
            let viewport = &frame.plan.views.viewports[tile.viewport];
            let count = u64::from(tile.rows) * u64::from(viewport.size()[0]);
            let first = u64::from(tile.first_pixel);
            let Wanted { display, hdr, .. } = frame.outputs.wanted[viewport.view];
            // The HDR image is stored in two planes of half a pixel each.
            let mut copy_plane = |plane: u64| {
                let half = BYTES_PER_PIXEL / 2;
                readback.copy(gpu, encoder, &buffers.pixels, (plane * batch.pixels + first) * half, count * half)
            };
            let hdr = hdr.then(|| [copy_plane(0), copy_plane(1)]);
            let display = buffers
                .display
                .as_ref()
                .filter(|_| display)
                .map(|buffer| readback.copy(gpu, encoder, buffer, first * DISPLAY_BYTES, count * DISPLAY_BYTES));
            places.tiles.push(TilePlace { viewport: tile.viewport, pixels: count as usize, display, hdr });
        }
    }
    let count = targets.counter_count;
    places.counters = Some((readback.copy(gpu, encoder, &targets.counters, 0, 4 * count as u64), count));
    let exposure_bytes = size_of::<layout::Exposure>() as u64;
    places.exposure = Some(readback.copy(gpu, encoder, &targets.exposure, 0, exposure_bytes));
    places.ticks = timer.resolve(gpu, encoder, readback);
}

impl Renderer {
    pub(super) fn read(&self, in_flight: &mut InFlight) -> Result<Frame, RenderError> {
        let InFlight { plan, places, views: names, projectors, slot: FrameSlot { timer, readback }, .. } = in_flight;
        let Self { gpu, techniques, .. } = self;
        let plan = &*plan;
        // Counters and exposure.
        let (Some((counters, count)), Some(exposure)) = (places.counters, places.exposure) else {
            unreachable!("every frame has counters and an exposure")
        };
        let counters: Vec<u32> = readback.read(gpu, counters, count)?;
        if counters[OVERFLOW_COUNTER] > 0 {
            return Err(RenderError::Overflow(counters[OVERFLOW_COUNTER]));
        }
        let exposure: Vec<layout::Exposure> = readback.read(gpu, exposure, 1)?;
        // GPU times of the passes.
        let (passes_ms, gpu_ms) = match places.ticks {
            Some(place) => {
                let ticks: Vec<u64> = readback.read(gpu, place, 2 * timer.passes())?;
                (timer.times_ms(&ticks), timer.whole_ms(&ticks))
            }
            None => (Vec::new(), None),
        };
        // Images, put together tile by tile.
        let mut images: Vec<FrameImage> = Vec::new();
        let mut image_of_viewport: Vec<Option<usize>> = vec![None; plan.views.viewports.len()];
        for tile in &places.tiles {
            if tile.display.is_none() && tile.hdr.is_none() {
                continue;
            }
            let viewport = &plan.views.viewports[tile.viewport];
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
                    projector: projectors[viewport.view].clone(),
                });
                images.len() - 1
            });
            if let (Some(place), Some(display)) = (tile.display, &mut images[index].display) {
                readback.append(gpu, place, tile.pixels * DISPLAY_BYTES as usize, display)?;
            }
            if let (Some(planes), Some(hdr)) = (tile.hdr, &mut images[index].hdr) {
                let join = |[r, g]: &[f32; 2], [b, omega]: &[f32; 2]| [*r, *g, *b, *omega];
                readback.append_joined(gpu, planes, tile.pixels, join, hdr)?;
            }
        }
        // Corrections of projectors.
        for image in &mut images {
            if let Some(projector) = image.projector.clone() {
                [image.width, image.height] = projector.size();
                image.display = image.display.take().map(|picture| projector.display(picture));
                image.hdr = image.hdr.take().map(|picture| projector.hdr(picture));
            }
        }
        // Statistics of the views.
        let exposure_ev100 = f64::from(exposure[0].ev100);
        let mut views = statistics(plan, names, exposure_ev100, &counters, &passes_ms);
        for technique in techniques.iter() {
            technique.read(gpu, readback, places, plan, &mut views)?;
        }
        Ok(Frame {
            number: 0,
            scene_revision: 0,
            camera_revision: 0,
            exposure_ev100,
            metered_ev100: plan.exposure.planned_ev100.unwrap_or_else(|| f64::from(exposure[0].metered_ev100)),
            mean_luminance_cd_m2: f64::from(exposure[0].mean_luminance_cd_m2),
            images,
            views,
            plan: plan.report.clone(),
            hdr_plan: None,
            times: FrameTimes { passes_ms, gpu_ms, cull_ms: plan.stars.cull_ms, ..Default::default() },
        })
    }
}

/// Computes the statistics of each view. The GPU time of the star pass is divided in proportion to the stars drawn, that of passes over pixels in
/// proportion to the pixels.
fn statistics(
    plan: &Plan,
    names: &[String],
    exposure_ev100: f64,
    counters: &[u32],
    passes_ms: &[(&'static str, f64)],
) -> Vec<ViewStatistics> {
    let time_of =
        |stars: bool| passes_ms.iter().filter(|(name, _)| (*name == "stars") == stars).map(|(_, ms)| ms).sum::<f64>();
    let drawn = &counters[VIEW_COUNTERS..];
    let all_drawn: f64 = drawn.iter().map(|count| f64::from(*count)).sum::<f64>().max(1.0);
    let pixels_of = |view: usize| -> f64 {
        let viewports_of_view = plan.views.viewports.iter().filter(|viewport| viewport.view == view);
        viewports_of_view.map(|viewport| viewport.size().map(f64::from).iter().product::<f64>()).sum()
    };
    let all_pixels: f64 = (0..names.len()).map(pixels_of).sum::<f64>().max(1.0);
    names
        .iter()
        .enumerate()
        .map(|(index, name)| ViewStatistics {
            name: name.clone(),
            stars_drawn: u64::from(drawn[index]),
            stars_in_map: plan.smooth_light.map.as_ref().map_or(0, |sky| sky.in_map),
            limiting_magnitude: plan.exposure.displayed_stars.limiting_magnitude(index, exposure_ev100),
            asteroids: AsteroidCounts::default(),
            gpu_ms: (!passes_ms.is_empty()).then(|| {
                time_of(true) * f64::from(drawn[index]) / all_drawn + time_of(false) * pixels_of(index) / all_pixels
            }),
        })
        .collect()
}
