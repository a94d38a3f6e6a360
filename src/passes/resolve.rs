//! The resolve pass: fixed-point illuminance becomes luminance by the pixel's solid angle, and display values where the
//! exposure is known before. Shader: `shaders/display/resolve.wgsl`; the f64 twin is `crate::reference::stars`, which divides at
//! its end.

use super::shared::{DisplayVariant, Occlusion, bind_buffers, encode_display};
use crate::{
    gpu::{self, Gpu, Shader, ShaderSource, layout},
    photometry::exposure::white_luminance_cd_m2,
    plan::{range::Ranges, settings::ToneMapSettings},
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
}

/// The pass.
pub(crate) struct ResolvePass {
    source: ShaderSource,
    /// One for every combination of outputs and variant of the display image asked for so far.
    pipelines: Vec<(ResolveOutputs, DisplayVariant, wgpu::ComputePipeline)>,
    /// Stands in for the bright sums where there are none.
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

/// Buffers of one batch.
pub(crate) struct ResolveTarget<'a> {
    pub viewports: &'a wgpu::Buffer,
    pub tiles: &'a wgpu::Buffer,
    pub pixels: &'a wgpu::Buffer,
    /// First and second words of the stars that outshine the rest.
    pub bright: Option<[&'a wgpu::Buffer; 2]>,
    pub high_words: &'a wgpu::Buffer,
    pub counters: &'a wgpu::Buffer,
    pub partial_sums: &'a wgpu::Buffer,
    pub display: Option<&'a wgpu::Buffer>,
    pub occlusion: &'a Occlusion<'a>,
    /// Pixels of the batch.
    pub plane_pixels: u32,
}

impl ResolvePass {
    pub(crate) fn new(gpu: &Gpu) -> Self {
        let decode = if gpu.wide_accumulator { "display/decode_u64" } else { "display/decode_u32" };
        let mut pass = Self {
            source: Shader::new("display/resolve").with("decode", decode).source(),
            pipelines: Vec::new(),
            no_bright: gpu::storage_buffer(gpu, "no bright sums", &[[0_u32; 4]]),
            no_display: gpu::storage_buffer(gpu, "no display", &[0_u32]),
        };
        for i in 0..6 {
            let outputs = ResolveOutputs { hdr: i >= 2, dark: i >= 4, display: i % 2 == 1, geometry: false };
            pass.prepare(gpu, outputs, DisplayVariant::default());
        }
        pass
    }

    /// Index of the pipeline, which is made if it is the first time.
    fn prepare(&mut self, gpu: &Gpu, outputs: ResolveOutputs, variant: DisplayVariant) -> usize {
        let held = self.pipelines.iter().position(|(of, shown, _)| (*of, *shown) == (outputs, variant));
        held.unwrap_or_else(|| {
            let written = [
                ("WRITE_HDR", outputs.hdr),
                ("WRITE_DISPLAY", outputs.display),
                ("WRITE_DARK", outputs.dark),
                ("HAS_GEOMETRY", outputs.geometry),
            ]
            .map(|(name, value)| (name, f64::from(u8::from(value))));
            let constants = [&written[..], &variant.constants()].concat();
            self.pipelines.push((outputs, variant, gpu.compute_pipeline_with(&self.source, &constants)));
            self.pipelines.len() - 1
        })
    }

    /// Records the pass. `known_ev100` is the exposure of the display image, which is written if it is given together with
    /// its buffer.
    #[expect(clippy::too_many_arguments, reason = "a pass takes its settings and its buffers")]
    pub(crate) fn record(
        &mut self,
        gpu: &Gpu,
        pass: &mut wgpu::ComputePass<'_>,
        ranges: &Ranges,
        hdr: HdrImage,
        known_ev100: Option<f64>,
        tone_map: &ToneMapSettings,
        target: &ResolveTarget<'_>,
        grid: [u32; 3],
    ) {
        let outputs = ResolveOutputs {
            hdr: hdr != HdrImage::None,
            dark: hdr == HdrImage::Whole,
            display: known_ev100.is_some() && target.display.is_some(),
            geometry: target.occlusion.present,
        };
        let parameters = layout::ResolveParameters {
            lx_per_unit: (1.0 / ranges.main.units_per_lx) as f32,
            lx_per_bright_unit: ranges.bright.map_or(0.0, |bright| (1.0 / bright.units_per_lx) as f32),
            display_per_cd_m2: known_ev100.map_or(0.0, |ev100| (1.0 / white_luminance_cd_m2(ev100)) as f32),
            plane_pixels: target.plane_pixels,
            shown: encode_display(tone_map),
        };
        let parameters = gpu::uniform_buffer(gpu, "resolve parameters", &parameters);
        let variant = if outputs.display { DisplayVariant::of(tone_map) } else { DisplayVariant::default() };
        let index = self.prepare(gpu, outputs, variant);
        let pipeline = &self.pipelines[index].2;
        let [bright, bright_high] = target.bright.unwrap_or([&self.no_bright; 2]);
        let buffers = [
            (0, parameters.as_entire_binding()),
            (1, target.viewports.as_entire_binding()),
            (2, target.tiles.as_entire_binding()),
            (3, target.pixels.as_entire_binding()),
            (4, target.partial_sums.as_entire_binding()),
            (5, bright.as_entire_binding()),
            (6, target.display.unwrap_or(&self.no_display).as_entire_binding()),
            (7, target.high_words.as_entire_binding()),
            (8, target.counters.as_entire_binding()),
            (9, bright_high.as_entire_binding()),
            (10, target.occlusion.geometry.as_entire_binding()),
        ];
        let group = bind_buffers(gpu, pipeline, 0, &buffers);
        pass.set_pipeline(pipeline);
        pass.set_bind_group(0, &group, &[]);
        pass.dispatch_workgroups(grid[0], grid[1], grid[2]);
    }
}
