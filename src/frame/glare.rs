//! Recording the glare of a frame: after every batch has left its picture, whole, in its pixels.

use std::sync::OnceLock;

use super::record::begin_pass;
use crate::{
    gpu::{GlareSource, Gpu, GpuTimer, storage_buffer},
    passes::glare_composite::{GlareCompositePass, GlareTarget},
    plan::{
        settings::{GlareMethod, GlareSettings},
        tiles::Batch,
    },
    view::Viewport,
};

/// Passes and buffers of glare, made when they are first asked for.
pub(super) struct Glare {
    from_sky: OnceLock<GlareCompositePass>,
}

/// A batch whose picture is finished but for its glare.
pub(super) struct GlareBatch<'a> {
    pub batch: &'a Batch,
    /// The batch's tiles as shaders read them.
    pub tiles: &'a wgpu::Buffer,
    /// The picture.
    pub pixels: wgpu::Buffer,
    /// Workgroups of the passes over pixels.
    pub grid: [u32; 3],
}

/// All pictures of a frame.
pub(super) struct GlareFrame<'a> {
    pub settings: &'a GlareSettings,
    /// What draws the glare, neither `auto` nor `none`.
    pub method: GlareMethod,
    pub viewports: &'a [Viewport],
    /// The same as shaders read them.
    pub encoded_viewports: &'a wgpu::Buffer,
    pub partial_sums: &'a wgpu::Buffer,
    pub batches: Vec<GlareBatch<'a>>,
}

impl Glare {
    pub(super) fn new() -> Self {
        Self { from_sky: OnceLock::new() }
    }

    /// Records everything that glare takes.
    pub(super) fn record(
        &mut self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        timer: &mut GpuTimer,
        frame: &GlareFrame<'_>,
    ) {
        let veil = storage_buffer(gpu, "veil", &[[0.0_f32; 4]]);
        let composite = self.from_sky.get_or_init(|| GlareCompositePass::new(gpu, GlareSource::Sky));
        for batch in &frame.batches {
            let mut pass = begin_pass(encoder, timer, "glare");
            let target = GlareTarget {
                viewports: frame.encoded_viewports,
                tiles: batch.tiles,
                pixels: &batch.pixels,
                partial_sums: frame.partial_sums,
                plane_pixels: batch.batch.pixels as u32,
            };
            let fraction = frame.settings.fraction;
            composite.record(gpu, &mut pass, fraction, &target, &[(0, veil.as_entire_binding())], batch.grid);
        }
    }
}
