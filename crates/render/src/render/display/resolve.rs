//! The resolve pass: divides fixed-point illuminance by the pixel's solid angle to get luminance, and computes display
//! values if the exposure is known in advance.
//!
//! Shader: `shaders/display/resolve.wgsl`; the f64 twin is the final division of `crate::reference::stars`.
//!
//! No twin: reference/stars/splat.rs, which divides by the solid angle at its end.

use crate::plan::stars::cull::MAX_VIEWPORTS;
use crate::render::display_variant::{DisplayVariant, encode_display};
use crate::{
    gpu::{self, Gpu, ShaderSource, Variants, bind_buffers},
    photometry::exposure::white_luminance_cd_m2,
    plan::{Limits, settings::ToneMapSettings, stars::range::Ranges},
    render::{
        display::layout,
        layout::AirAbove,
        tabulated::projecting,
        targets::{Targets, row_groups, workgroups},
    },
};

/// Returns the number of runs of rows per invocation on this adapter.
fn runs(gpu: &Gpu) -> u32 {
    if gpu.software { SOFTWARE_RUNS } else { 1 }
}

/// Outputs and inputs of the resolve pass of a batch, compiled into its pipeline.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct ResolveOutputs {
    /// Overwrite the sums with luminance and solid angle.
    pub hdr: bool,
    /// Write the display image.
    pub display: bool,
    /// Write dark pixels too.
    pub dark: bool,
    /// Whether the scene has surfaces that hide stars.
    pub geometry: bool,
    /// Whether the smooth part of scattered light is added.
    pub veil: bool,
    /// Whether the map of faint light is added.
    pub sky: bool,
    /// Whether the camera is in air.
    pub air: bool,
    /// Whether the camera moves, which shifts diffuse light.
    pub moves: bool,
    /// Whether the frame has plain blocks.
    pub plain: bool,
    /// See [`DisplayVariant::with_short_codes`].
    pub has_short_codes: bool,
}

/// Number of runs of rows per invocation on a software driver, which spends a microsecond on each workgroup.
const SOFTWARE_RUNS: u32 = 4;

/// Pipelines of the resolve pass.
pub(crate) struct ResolvePass {
    source: ShaderSource,
    /// See [`Limits::fuses_display`] and [`Limits::reads_faint_map`]: whether the shader has these bindings.
    fuses_display: bool,
    reads_faint_map: bool,
    /// One pipeline per set of outputs and tone-mapping variant.
    pipelines: Variants<(ResolveOutputs, DisplayVariant), wgpu::ComputePipeline>,
    /// Placeholder for missing bright sums and smooth light.
    nothing: wgpu::Buffer,
    /// Placeholder for the display image if it is not written.
    no_display: wgpu::Buffer,
}

/// Which part of the HDR image is made.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum HdrImage {
    /// No part.
    None,
    /// Only the lit pixels. The second plane of a dark pixel may contain data of another frame.
    Lit,
    /// Every pixel, with its solid angle.
    Whole,
}

/// Inputs that determine the outputs.
pub(crate) struct ResolveInputs<'a> {
    pub ranges: &'a Ranges,
    pub hdr: HdrImage,
    /// Exposure of the display image, if it is known in advance.
    pub known_ev100: Option<f64>,
    pub tone_map: &'a ToneMapSettings,
    /// Whether to write the display image. The exposure must be known.
    pub shows: bool,
    /// See [`DisplayVariant::with_short_codes`].
    pub has_short_codes: bool,
    /// Air around the camera.
    pub air: AirAbove,
}

impl ResolveOutputs {
    /// Returns the outputs for a part of the HDR image, if no light is added to the sums.
    pub(crate) fn new(hdr: HdrImage, display: bool) -> Self {
        let (hdr, dark) = (hdr != HdrImage::None, hdr == HdrImage::Whole);
        Self { hdr, dark, display, ..Self::default() }
    }

    /// The same outputs with short codes or without them; see [`DisplayVariant::with_short_codes`]. Without a display image there are none.
    pub(crate) fn with_short_codes(self, has_short_codes: bool) -> Self {
        Self { has_short_codes: has_short_codes && self.display, ..self }
    }
}

impl ResolvePass {
    pub(crate) fn new(gpu: &Gpu) -> Self {
        let Limits { fuses_display, reads_faint_map, .. } = gpu.limits();
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::UNIFORM;
        let decode = if gpu.wide_accumulator { "display/decode_u64" } else { "display/decode_u32" };
        Self {
            source: projecting(gpu, "display/resolve")
                .with("decode", decode)
                .with("faint", if reads_faint_map { "display/faint_map" } else { "display/faint_map_off" })
                .with("shown", if fuses_display { "display/shown" } else { "display/shown_off" })
                .source(),
            fuses_display,
            reads_faint_map,
            pipelines: Variants::new(),
            nothing: gpu::filled_buffer(
                gpu,
                "no light",
                &[crate::render::layout::PointGrid::default(); MAX_VIEWPORTS],
                usage,
            ),
            no_display: gpu::storage_buffer(gpu, "no display", &[0_u32]),
        }
    }

    /// Returns the pipeline with the given outputs.
    pub(crate) fn pipeline(
        &self,
        gpu: &Gpu,
        outputs: ResolveOutputs,
        tone_map: &ToneMapSettings,
    ) -> wgpu::ComputePipeline {
        let shown = || DisplayVariant::from_settings(tone_map).with_short_codes(outputs.has_short_codes);
        let variant = if outputs.display { shown() } else { DisplayVariant::default() };
        self.pipelines.get((outputs, variant), || {
            let written = [
                ("WRITE_HDR", outputs.hdr),
                ("WRITE_DISPLAY", outputs.display),
                ("WRITE_DARK", outputs.dark),
                ("HAS_GEOMETRY", outputs.geometry),
                ("HAS_VEIL", outputs.veil),
                ("HAS_SKY", outputs.sky),
                ("HAS_AIR", outputs.air),
                ("MOVES", outputs.moves),
                ("HAS_PLAIN", outputs.plain),
            ]
            .map(|(name, value)| (name, f64::from(u8::from(value))));
            let row_constants = [("ROW_GROUPS", f64::from(row_groups(gpu))), ("RUNS", f64::from(runs(gpu)))];
            let constants = [&written[..], &row_constants, &variant.constants()].concat();
            gpu.compute_pipeline_with(&self.source, &constants)
        })
    }

    /// Records the pass over a batch.
    pub(crate) fn record(
        &self,
        gpu: &Gpu,
        pass: &mut wgpu::ComputePass<'_>,
        inputs: &ResolveInputs<'_>,
        targets: &Targets,
        number: usize,
    ) {
        // Outputs and inputs that select the pipeline.
        let ResolveInputs { ranges, hdr, known_ev100, tone_map, shows, has_short_codes, air } = *inputs;
        let batch = &targets.batches[number];
        let occlusion = targets.occlusion(number);
        let display = batch.display.as_ref().filter(|_| shows);
        let diffuse = targets.diffuse.as_ref();
        let (faint_map, faint_texels) = targets.faint_map();
        let outputs = ResolveOutputs {
            geometry: occlusion.present,
            veil: targets.veil.is_some(),
            sky: targets.sky.is_some(),
            air: air.present != 0,
            moves: diffuse.is_some_and(|diffuse| diffuse.light.beta > 0.0),
            plain: targets.plain.is_some(),
            ..ResolveOutputs::new(hdr, display.is_some()).with_short_codes(has_short_codes)
        };
        // Parameters.
        let parameters = layout::ResolveParameters {
            lx_per_unit: (1.0 / ranges.main.units_per_lx) as f32,
            lx_per_bright_unit: ranges.bright.map_or(0.0, |bright| (1.0 / bright.units_per_lx) as f32),
            display_per_cd_m2: known_ev100.map_or(0.0, |ev100| (1.0 / white_luminance_cd_m2(ev100)) as f32),
            plane_pixels: batch.plane_pixels,
            first_bright_high: (batch.bright_high_bytes / 8) as u32,
            shown: encode_display(tone_map),
            sky: faint_map,
            caps: targets.sky.as_ref().map_or([0.0; 2], |sky| sky.caps),
            diffuse: diffuse.map(|diffuse| diffuse.light).unwrap_or_default(),
            air,
            diffuse_is_smooth: u32::from(diffuse.is_some_and(|diffuse| diffuse.smooth.is_some())),
        };
        let parameters = gpu.frame_uniform("resolve parameters", &parameters);
        let pipeline = &self.pipeline(gpu, outputs, tone_map);
        // Buffers, or placeholders for missing ones.
        let nothing = &self.nothing;
        let smooth = diffuse.and_then(|diffuse| diffuse.smooth.as_ref());
        let mut bindings = vec![
            (0, &parameters),
            (1, &targets.viewports),
            (2, &batch.tiles),
            (3, &batch.pixels),
            (4, &targets.partial_sums),
            (5, batch.bright.as_ref().unwrap_or(nothing)),
            (7, &batch.high_words),
            (8, &targets.counters),
            (10, occlusion.geometry),
            (11, targets.veil.as_ref().map_or(nothing, |veil| &veil.list)),
            (12, targets.held_points().unwrap_or(nothing)),
            (14, diffuse.map_or(nothing, |diffuse| &diffuse.texels)),
            (15, smooth.map_or(nothing, |smooth| &smooth.list)),
            (16, targets.plain_list()),
        ];
        if self.fuses_display {
            bindings.push((6, display.unwrap_or(&self.no_display)));
        }
        if self.reads_faint_map {
            bindings.push((13, faint_texels));
        }
        let bindings: Vec<_> =
            bindings.into_iter().map(|(binding, buffer)| (binding, buffer.as_entire_binding())).collect();
        pass.set_pipeline(pipeline);
        gpu.bind_tables(pass, pipeline);
        pass.set_bind_group(0, &bind_buffers(gpu, pipeline, 0, &bindings), &[]);
        let [columns, rows, tiles] = workgroups(batch.grid, row_groups(gpu) * runs(gpu));
        pass.dispatch_workgroups(columns, rows, tiles);
    }
}
