//! Reading a frame back: images, exposure, counters and times.

use super::{
    AsteroidCounts, Frame, FrameImage, FrameTimes, ViewStatistics,
    error::RenderError,
    renderer::{DISPLAY_BYTES, Prepared, Renderer},
    submit::SubmittedFrame,
};
use crate::{
    gpu::layout,
    passes::stars::{OVERFLOW_COUNTER, VIEW_COUNTERS},
};

impl Renderer {
    pub(super) fn read(&mut self, submitted: &SubmittedFrame) -> Result<Frame, RenderError> {
        let SubmittedFrame { prepared, places, views: names, .. } = submitted;
        let Self { gpu, readback, timer, asteroids, .. } = self;
        let gpu = &*gpu;
        let counters: Vec<u32> = readback.read(gpu, places.counters, places.counter_count)?;
        if counters[OVERFLOW_COUNTER] > 0 {
            return Err(RenderError::Overflow(counters[OVERFLOW_COUNTER]));
        }
        let exposure: Vec<layout::Exposure> = readback.read(gpu, places.exposure, 1)?;
        let (passes_ms, gpu_ms) = match places.ticks {
            Some(place) => {
                let ticks: Vec<u64> = readback.read(gpu, place, 2 * timer.passes())?;
                (timer.times_ms(&ticks), timer.whole_ms(&ticks))
            }
            None => (Vec::new(), None),
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
        let mut views = statistics(prepared, names, &counters, &passes_ms);
        if let (Some(plan), Some(places)) = (&prepared.asteroids, places.asteroids) {
            let counts = asteroids.read_counts(gpu, readback, places, plan, views.len())?;
            views.iter_mut().zip(counts).for_each(|(view, counts)| view.asteroids = counts);
        }
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
            times: FrameTimes { passes_ms, gpu_ms, cull_ms: prepared.cull_ms, ..Default::default() },
        })
    }
}

/// Stars drawn and GPU time of each view: the star pass is shared by stars drawn, the passes over pixels by pixels.
fn statistics(
    prepared: &Prepared,
    names: &[String],
    counters: &[u32],
    passes_ms: &[(&'static str, f64)],
) -> Vec<ViewStatistics> {
    let time_of =
        |stars: bool| passes_ms.iter().filter(|(name, _)| (*name == "stars") == stars).map(|(_, ms)| ms).sum::<f64>();
    let drawn = &counters[VIEW_COUNTERS..];
    let all_drawn: f64 = drawn.iter().map(|count| f64::from(*count)).sum::<f64>().max(1.0);
    let pixels_of = |view: usize| -> f64 {
        let of_view = prepared.viewports.iter().filter(|viewport| viewport.view == view);
        of_view.map(|viewport| viewport.size().map(f64::from).iter().product::<f64>()).sum()
    };
    let all_pixels: f64 = (0..names.len()).map(pixels_of).sum::<f64>().max(1.0);
    names
        .iter()
        .enumerate()
        .map(|(index, name)| ViewStatistics {
            name: name.clone(),
            stars_drawn: u64::from(drawn[index]),
            stars_in_map: 0,
            asteroids: AsteroidCounts::default(),
            gpu_ms: (!passes_ms.is_empty()).then(|| {
                time_of(true) * f64::from(drawn[index]) / all_drawn + time_of(false) * pixels_of(index) / all_pixels
            }),
        })
        .collect()
}
