//! From light to display images: the resolve pass, the exposure of all views, tone mapping, and images in textures that leave the
//! renderer, those of a headset's swapchain for example.

pub(crate) mod exposure;
pub(crate) mod layout;
pub(crate) mod present;
pub(crate) mod resolve;
pub(crate) mod tone_map;
mod variant;

use self::{
    exposure::{ExposureInputs, ExposurePass},
    present::{PresentPass, PresentTile},
    resolve::{HdrImage, ResolveInputs, ResolvePass},
    tone_map::ToneMapPass,
};
use super::{
    targets::{adds_up, resolves_to_display},
    technique::{Phase, Recording, Technique},
};
use crate::{gpu::Gpu, plan::settings::GlareMethod};

/// The passes.
pub(super) struct Display {
    resolve: ResolvePass,
    exposure: ExposurePass,
    tone_map: ToneMapPass,
    present: PresentPass,
}

impl Display {
    pub(super) fn new(gpu: &Gpu) -> Self {
        Self {
            resolve: ResolvePass::new(gpu),
            exposure: ExposurePass::new(gpu),
            tone_map: ToneMapPass::new(gpu),
            present: PresentPass::new(),
        }
    }

    fn resolve(&mut self, recording: &mut Recording<'_>, number: usize) {
        let frame = recording.frame;
        let made = recording.targets.batches[number].made;
        let known_ev100 = frame.plan.known_ev100;
        let hdr = if frame.plan.glare.method != GlareMethod::None || made.hdr {
            HdrImage::Whole
        } else if made.hdr_stays || (made.display && known_ev100.is_none()) {
            HdrImage::Lit
        } else {
            HdrImage::None
        };
        let inputs = ResolveInputs {
            ranges: &frame.plan.ranges,
            hdr,
            known_ev100,
            tone_map: &frame.settings.tone_map,
            shows: resolves_to_display(&frame) && made.display,
        };
        let gpu = recording.gpu;
        let mut pass = super::technique::begin_pass(recording.encoder, recording.timer, "resolve");
        self.resolve.record(gpu, &mut pass, &inputs, recording.targets, number);
    }

    fn meter(&self, recording: &mut Recording<'_>) {
        let frame = recording.frame;
        let inputs = ExposureInputs {
            settings: &frame.settings.exposure,
            known_ev100: frame.plan.known_ev100,
            total_solid_angle_sr: frame.plan.total_solid_angle_sr,
            partial_count: recording.targets.partial_count,
        };
        let gpu = recording.gpu;
        let mut pass = super::technique::begin_pass(recording.encoder, recording.timer, "exposure");
        let (partial_sums, exposure) = (&recording.targets.partial_sums, &recording.targets.exposure);
        self.exposure.record(gpu, &mut pass, &inputs, partial_sums, exposure);
    }

    fn tone_map(&mut self, recording: &mut Recording<'_>) {
        if resolves_to_display(&recording.frame) {
            return;
        }
        let (gpu, settings) = (recording.gpu, &recording.frame.settings.tone_map);
        for number in 0..recording.targets.batches.len() {
            let batch = &recording.targets.batches[number];
            let Some(display) = &batch.display else { continue };
            let mut pass = super::technique::begin_pass(recording.encoder, recording.timer, "tone map");
            let picture = recording.targets.picture(number);
            self.tone_map.record(
                gpu,
                &mut pass,
                settings,
                &picture,
                (&recording.targets.exposure, display),
                batch.grid,
            );
        }
    }

    fn present(&mut self, recording: &mut Recording<'_>) {
        let Recording { gpu, encoder, timer, frame, targets, .. } = recording;
        for presentation in frame.outputs.presentations {
            let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some("present"),
                color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                    view: presentation.target,
                    depth_slice: None,
                    resolve_target: None,
                    // Every pixel is written: what was there is not wanted.
                    ops: wgpu::Operations {
                        load: wgpu::LoadOp::Clear(wgpu::Color::BLACK),
                        store: wgpu::StoreOp::Store,
                    },
                })],
                depth_stencil_attachment: None,
                timestamp_writes: timer.render_pass("present"),
                occlusion_query_set: None,
                multiview_mask: None,
            });
            let width = frame.plan.viewports[presentation.viewport].size()[0];
            for (batch, buffers) in frame.plan.batches.iter().zip(&targets.batches) {
                let pixels = match &buffers.display {
                    Some(display) if presentation.shows_codes() => display,
                    _ => &buffers.pixels,
                };
                for tile in batch.tiles.iter().filter(|tile| tile.viewport == presentation.viewport) {
                    let plane_pixels = buffers.plane_pixels;
                    let target = PresentTile { tile, width, plane_pixels, pixels, exposure: &targets.exposure };
                    self.present.record(gpu, &mut pass, &frame.settings.tone_map, presentation.format, &target);
                }
            }
        }
    }
}

impl Technique for Display {
    fn record(&mut self, phase: Phase, recording: &mut Recording<'_>) {
        match phase {
            Phase::Resolve(batch) if adds_up(&recording.frame) => self.resolve(recording, batch),
            Phase::Meter => self.meter(recording),
            Phase::Display => self.tone_map(recording),
            Phase::Present => self.present(recording),
            _ => {}
        }
    }

    fn release(&mut self) {}
}
