//! The resolve pass: fixed-point illuminance becomes luminance by the pixel's solid angle, and display values where the
//! exposure is known before. Shader: `shaders/display/resolve.wgsl`; the f64 twin is `crate::reference::stars`, which divides at
//! its end.

use super::variant::{DisplayVariant, encode_display};
use crate::{
    gpu::{self, Gpu, ShaderSource, Variants, bind_in_order},
    photometry::exposure::white_luminance_cd_m2,
    plan::{settings::ToneMapSettings, stars::range::Ranges},
    render::{display::layout, layout::AirAbove, tabulated::projecting, targets::Targets},
};

/// What a batch's resolve pass writes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct ResolveOutputs {
    /// Luminance and solid angle, in the place of the sums.
    pub hdr: bool,
    /// The display image.
    pub display: bool,
    /// Dark pixels too.
    pub dark: bool,
    /// Whether there is anything but stars.
    pub geometry: bool,
    /// Whether the smooth part of scattered light is added.
    pub veil: bool,
    /// Whether the map of faint light is added.
    pub sky: bool,
    /// Whether there is air around the camera.
    pub air: bool,
    /// Whether the camera moves, which counts for light of no single star.
    pub moves: bool,
}

/// The pass.
pub(crate) struct ResolvePass {
    source: ShaderSource,
    /// By outputs and variant of the display image.
    pipelines: Variants<(ResolveOutputs, DisplayVariant), wgpu::ComputePipeline>,
    /// Stands in for the bright sums, for smooth light and for pictures of the sky where there are none.
    no_bright: wgpu::Buffer,
    /// Stands in for the display image where it is not written.
    no_display: wgpu::Buffer,
}

/// How much of the HDR image is made.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum HdrImage {
    /// Nothing.
    None,
    /// Where there is light; what a dark pixel has in the second plane may be left from another frame.
    Lit,
    /// Every pixel, with its solid angle.
    Whole,
}

/// What decides what is written.
pub(crate) struct ResolveInputs<'a> {
    pub ranges: &'a Ranges,
    pub hdr: HdrImage,
    /// Exposure of the display image, as far as it is known before.
    pub known_ev100: Option<f64>,
    pub tone_map: &'a ToneMapSettings,
    /// Whether the display image is written: the exposure is known then.
    pub shows: bool,
    /// The air around the camera.
    pub air: AirAbove,
}

impl ResolveOutputs {
    /// What is written where that much of the HDR image is made; with nothing added to the sums.
    pub(crate) fn new(hdr: HdrImage, display: bool) -> Self {
        let (hdr, dark) = (hdr != HdrImage::None, hdr == HdrImage::Whole);
        Self { hdr, dark, display, geometry: false, veil: false, sky: false, air: false, moves: false }
    }
}

impl ResolvePass {
    pub(crate) fn new(gpu: &Gpu) -> Self {
        let decode = if gpu.wide_accumulator { "display/decode_u64" } else { "display/decode_u32" };
        Self {
            source: projecting(gpu, "display/resolve").with("decode", decode).source(),
            pipelines: Variants::new(),
            no_bright: gpu::storage_buffer(gpu, "no bright sums", &[[0_u32; 4]]),
            no_display: gpu::storage_buffer(gpu, "no display", &[0_u32]),
        }
    }

    /// The pipeline that writes that.
    pub(crate) fn pipeline(
        &self,
        gpu: &Gpu,
        outputs: ResolveOutputs,
        tone_map: &ToneMapSettings,
    ) -> wgpu::ComputePipeline {
        let variant = if outputs.display { DisplayVariant::of(tone_map) } else { DisplayVariant::default() };
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
            ]
            .map(|(name, value)| (name, f64::from(u8::from(value))));
            let constants = [&written[..], &variant.constants()].concat();
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
        let ResolveInputs { ranges, hdr, known_ev100, tone_map, shows, air } = *inputs;
        let batch = &targets.batches[number];
        let occlusion = targets.occlusion(number);
        let display = batch.display.as_ref().filter(|_| shows);
        let (sky, diffuse) = (targets.sky.as_ref(), targets.diffuse.as_ref());
        let outputs = ResolveOutputs {
            geometry: occlusion.present,
            veil: targets.veil.is_some(),
            sky: sky.is_some(),
            air: air.present != 0,
            moves: diffuse.is_some_and(|diffuse| diffuse.light.beta > 0.0),
            ..ResolveOutputs::new(hdr, display.is_some())
        };
        let parameters = layout::ResolveParameters {
            lx_per_unit: (1.0 / ranges.main.units_per_lx) as f32,
            lx_per_bright_unit: ranges.bright.map_or(0.0, |bright| (1.0 / bright.units_per_lx) as f32),
            display_per_cd_m2: known_ev100.map_or(0.0, |ev100| (1.0 / white_luminance_cd_m2(ev100)) as f32),
            plane_pixels: batch.plane_pixels,
            shown: encode_display(tone_map),
            sky: sky.map(|sky| sky.map).unwrap_or_default(),
            diffuse: diffuse.map(|diffuse| diffuse.light).unwrap_or_default(),
            air,
            diffuse_is_smooth: u32::from(diffuse.is_some_and(|diffuse| diffuse.smooth.is_some())),
            ..Default::default()
        };
        let parameters = gpu.frame_uniform("resolve parameters", &parameters);
        let pipeline = &self.pipeline(gpu, outputs, tone_map);
        let [bright, bright_high] = batch.bright.as_ref().map_or([&self.no_bright; 2], |[low, high]| [low, high]);
        let [veil_grids, veil_points] =
            targets.veil.as_ref().map_or([&self.no_bright; 2], |veil| [&veil.grids, &veil.points]);
        let smooth = diffuse.and_then(|diffuse| diffuse.smooth.as_ref());
        let [diffuse_grids, diffuse_points] =
            smooth.map_or([&self.no_bright; 2], |smooth| [&smooth.grids, &smooth.points]);
        let buffers = [
            &parameters,
            &targets.viewports,
            &batch.tiles,
            &batch.pixels,
            &targets.partial_sums,
            bright,
            display.unwrap_or(&self.no_display),
            &batch.high_words,
            &targets.counters,
            bright_high,
            occlusion.geometry,
            veil_grids,
            veil_points,
            sky.map_or(&self.no_bright, |sky| &sky.texels),
            diffuse.map_or(&self.no_bright, |diffuse| &diffuse.texels),
            diffuse_grids,
            diffuse_points,
        ];
        pass.set_pipeline(pipeline);
        gpu.bind_tables(pass, pipeline);
        pass.set_bind_group(0, &bind_in_order(gpu, pipeline, 0, &buffers), &[]);
        let [columns, rows, tiles] = batch.grid;
        pass.dispatch_workgroups(columns, rows, tiles);
    }
}
