//! From light to display images: the resolve pass, the exposure of all views, tone mapping, and the drawing of images into textures that other code
//! owns, for example a headset's swapchain.
//!
//! No twin: photometry/exposure.rs, photometry/tone_map.rs.

pub(crate) mod exposure;
pub(crate) mod layout;
pub(crate) mod present;
pub(crate) mod resolve;
pub(crate) mod tone_map;

use self::{
    exposure::{ExposureInputs, ExposurePass},
    present::{PresentPass, PresentTile},
    resolve::{HdrImage, ResolveInputs, ResolveOutputs, ResolvePass},
    tone_map::ToneMapPass,
};
use super::{
    frame::Wanted,
    layout::AirAbove,
    presentation::{PresentSource, present_source},
    technique::{Phase, PipelineJob, Recording, Technique, Wish},
};
use crate::gpu::Gpu;

/// Passes of this technique.
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
            exposure: ExposurePass::new(),
            tone_map: ToneMapPass::new(),
            present: PresentPass::new(),
        }
    }

    fn resolve(&mut self, recording: &mut Recording<'_>, number: usize) {
        let frame = recording.frame;
        let made = recording.targets.batches[number].made;
        let known_ev100 = frame.plan.exposure.known_ev100;
        let hdr = hdr_image(
            frame.plan.display.is_scattered_after,
            [made.display, made.hdr, made.hdr_stays],
            frame.plan.display.resolves_to_display,
        );
        let inputs = ResolveInputs {
            ranges: &frame.plan.stars.ranges,
            hdr,
            known_ev100,
            tone_map: &frame.plan.display.tone_map,
            shows: frame.plan.display.resolves_to_display && made.display,
            has_short_codes: frame.plan.display.has_short_codes(),
            air: AirAbove::from_sky(frame.plan.air.sky.as_deref()),
        };
        let gpu = recording.gpu;
        let mut pass = super::technique::begin_pass(recording.encoder, recording.timer, "resolve");
        self.resolve.record(gpu, &mut pass, &inputs, recording.targets, number);
    }

    fn meter(&self, recording: &mut Recording<'_>) {
        let frame = recording.frame;
        if let Some(metered) = frame.metered {
            let (exposure, bytes) = (&recording.targets.exposure, size_of::<super::layout::Exposure>() as u64);
            recording.encoder.copy_buffer_to_buffer(metered, 0, exposure, 0, bytes);
            return;
        }
        let inputs = ExposureInputs {
            metering: &frame.plan.exposure.metering,
            known_ev100: frame.plan.exposure.known_ev100,
            total_solid_angle_sr: frame.plan.views.total_solid_angle_sr,
            partial_count: recording.targets.partial_count,
        };
        let gpu = recording.gpu;
        let mut pass = super::technique::begin_pass(recording.encoder, recording.timer, "exposure");
        let (partial_sums, exposure) = (&recording.targets.partial_sums, &recording.targets.exposure);
        self.exposure.record(gpu, &mut pass, &inputs, partial_sums, exposure);
    }

    fn tone_map(&mut self, recording: &mut Recording<'_>) {
        if recording.frame.plan.display.resolves_to_display {
            return;
        }
        let (gpu, plan) = (recording.gpu, &recording.frame.plan.display);
        for number in 0..recording.targets.batches.len() {
            let batch = &recording.targets.batches[number];
            let Some(display) = &batch.display else { continue };
            let mut pass = super::technique::begin_pass(recording.encoder, recording.timer, "tone map");
            let picture = recording.targets.picture(number);
            self.tone_map.record(
                gpu,
                &mut pass,
                (&plan.tone_map, plan.has_short_codes()),
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
                    // Every pixel is overwritten, so the old contents need not be loaded.
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
            let width = frame.plan.views.viewports[presentation.viewport].size()[0];
            for (batch, buffers) in frame.plan.views.batches.iter().zip(&targets.batches) {
                let pixels = match &buffers.display {
                    Some(display) if presentation.shows_codes() => display,
                    _ => &buffers.pixels,
                };
                for tile in batch.tiles.iter().filter(|tile| tile.viewport == presentation.viewport) {
                    let plane_pixels = buffers.plane_pixels;
                    let target = PresentTile { tile, width, plane_pixels, pixels, exposure: &targets.exposure };
                    self.present.record(gpu, &mut pass, &frame.plan.display.tone_map, presentation.format, &target);
                }
            }
        }
    }
}

/// Returns which part of the HDR image of a batch is made. The flags say whether the display image, the HDR image for readback, and an HDR image that
/// stays on the adapter are wanted.
fn hdr_image(is_scattered_after: bool, [display, hdr, hdr_stays]: [bool; 3], resolves_to_display: bool) -> HdrImage {
    if is_scattered_after || hdr {
        HdrImage::Whole
    } else if hdr_stays || (display && !resolves_to_display) {
        HdrImage::Lit
    } else {
        HdrImage::None
    }
}

impl Technique for Display {
    /// With metered exposure, the first frame uses the metered value, and later frames may use an adapted exposure, which is known in advance. If no
    /// light is scattered, the resolve pass then writes the display images. So both forms are created in advance.
    fn pipelines<'a>(&'a self, wish: &Wish<'a>) -> Vec<PipelineJob<'a>> {
        let Wish { gpu, objects, forecast, made, formats, .. } = *wish;
        let tone_map = &forecast.tone_map;
        let presents = |source| formats.iter().any(|format| present_source(*format) == Some(source));
        let (presents_codes, presents_light) = (presents(PresentSource::Codes), presents(PresentSource::Light));
        let exact = Wanted {
            display: made.display || presents_codes,
            hdr: made.reads_hdr(),
            hdr_streamed: false,
            hdr_stays: made.hdr_stays || presents_light,
        };
        let display_only = Wanted { hdr: false, hdr_stays: presents_light, ..exact };
        // For each kind of frame: its outputs, whether glare is part of the sums, and whether its codes are short.
        let (veil, short) = (forecast.may_have_veil_in_sums, forecast.has_short_codes);
        let kinds = match forecast.draws_outputs_apart {
            false => vec![(exact, false, false)],
            true if made.reads_hdr() || made.hdr_stays => {
                vec![
                    (display_only, veil, short),
                    (exact, false, false),
                    (Wanted { display: false, ..exact }, false, false),
                ]
            }
            true => vec![(display_only, veil, short)],
        };
        // Forms of the resolve pass, for known and unknown exposure.
        let known = forecast.known_exposures();
        let mut resolves: Vec<ResolveOutputs> = Vec::new();
        // Forms of the tone-mapping pass: with short codes or not.
        let mut tone_maps: Vec<bool> = Vec::new();
        for (known, (made, veil, short)) in known.iter().flat_map(|&known| kinds.iter().map(move |&kind| (known, kind)))
        {
            let Wanted { display, hdr, hdr_stays, .. } = made;
            let resolves_to_display = forecast.resolves_to_display(known, veil);
            let hdr_made = hdr_image(forecast.is_scattered_after(veil), [display, hdr, hdr_stays], resolves_to_display);
            // The first frame that needs one of these two forms creates it: the form with a map, which depends on the stars, and the form for a
            // moving camera.
            let outputs = ResolveOutputs {
                geometry: !objects.is_empty(),
                air: objects.has_air(),
                veil,
                ..ResolveOutputs::new(hdr_made, resolves_to_display && display).with_short_codes(short)
            };
            let is_within_budget = resolves_to_display && hdr_made == HdrImage::None;
            for &plain in if is_within_budget { forecast.plain_forms() } else { &[false] } {
                let outputs = ResolveOutputs { plain, ..outputs };
                if forecast.methods.adds_up() && !resolves.contains(&outputs) {
                    resolves.push(outputs);
                }
            }
            if display && !resolves_to_display && !tone_maps.contains(&short) {
                tone_maps.push(short);
            }
        }
        // Jobs for these forms.
        let mut jobs: Vec<PipelineJob<'a>> = resolves
            .into_iter()
            .map(|outputs| PipelineJob::new("resolve", move || self.resolve.pipeline(gpu, outputs, tone_map)))
            .collect();
        jobs.push(PipelineJob::new("exposure", move || {
            self.exposure.pipeline(gpu);
        }));
        let map_tones = |short| PipelineJob::new("tone map", move || self.tone_map.pipeline(gpu, tone_map, short));
        jobs.extend(tone_maps.into_iter().map(map_tones));
        let present = |format: wgpu::TextureFormat| {
            PipelineJob::new("present", move || self.present.pipeline(gpu, format, tone_map))
        };
        jobs.extend(formats.iter().copied().map(present));
        jobs
    }

    fn record(&mut self, phase: Phase, recording: &mut Recording<'_>) {
        match phase {
            Phase::Resolve(batch) if recording.frame.plan.display.adds_up => self.resolve(recording, batch),
            Phase::Meter => self.meter(recording),
            Phase::Display => self.tone_map(recording),
            Phase::Present => self.present(recording),
            _ => {}
        }
    }

    fn release(&mut self) {}
}
