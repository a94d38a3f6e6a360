//! The interface of drawing techniques, and its inputs.
//!
//! A technique has its own folder with its passes, GPU structures and their encoding, and does not depend on other techniques. Shared buffers are in
//! [`super::targets`]. For a frame, the calls are in this order: [`Technique::hold`], [`Technique::encode`], then [`Technique::record`] phase by
//! phase, and [`Technique::read`] after the device has finished.

use std::sync::Arc;

use super::{Presentation, RenderError, ViewStatistics, Wanted, read::Places, targets::Targets};
use crate::{
    gpu::{Gpu, GpuTimer, ReadbackBuffer},
    photometry::glare::GlareKernel,
    plan::{Forecast, Methods, Plan, settings::AsteroidSettings, smooth_light::SkyPart, stars::deep::Residual},
    scene::{SceneObjects, SceneSnapshot},
    view::Viewport,
};

/// Step of a frame. The results of one step are complete before the next one reads them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Phase {
    /// Find visible objects on the adapter.
    Cull,
    /// Evaluate smooth light at the points of grids over the pictures.
    Points,
    /// Draw the surfaces of one tile that hide stars. Fields: index of the batch, index of the tile in the batch.
    Geometry(usize, usize),
    /// Add light to the sums of a batch.
    Splat(usize),
    /// Convert the sums of a batch to luminance.
    Resolve(usize),
    /// Add scattered light.
    Glare,
    /// Compute the exposure.
    Meter,
    /// Make display images.
    Display,
    /// Draw lines and text onto display images.
    Overlay,
    /// Draw images into textures that leave the renderer.
    Present,
    /// Count drawn objects, after all timed passes, and copy counts for readback.
    Count,
}

/// Inputs of a frame.
#[derive(Clone, Copy)]
pub(crate) struct FrameInputs<'a> {
    pub plan: &'a Plan,
    pub scene: &'a SceneSnapshot,
    pub outputs: Outputs<'a>,
    /// See [`super::Renderer::catalogue_order`].
    pub catalogue_order: Option<u64>,
    /// Series of frames with shared maps.
    pub series: Series,
    /// Result of a separate meter for this frame; `None`: the frame is metered by its own light.
    pub metered: Option<&'a wgpu::Buffer>,
}

/// Series of frames, drawn in turn with different settings. Each series has separate maps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Series {
    /// Index of the series.
    pub slot: usize,
    /// Number of series.
    pub slots: usize,
}

/// State of the map of faint light for a frame.
#[derive(Clone, Copy, Debug)]
pub(crate) struct MapState {
    /// Whether all pictures that the frame reads have been drawn.
    pub is_drawn: bool,
    /// Error that missing pages cause in these pictures, and number of these pages.
    pub lack: Residual,
}

impl Default for MapState {
    fn default() -> Self {
        Self { is_drawn: true, lack: Residual::default() }
    }
}

/// Outputs of a frame: images to read back, and textures to draw into.
#[derive(Clone, Copy)]
pub(crate) struct Outputs<'a> {
    /// Buffers to read back, one entry per view.
    pub wanted: &'a [Wanted],
    pub presentations: &'a [Presentation<'a>],
}

impl Outputs<'_> {
    /// Returns the images to make for each viewport, whether they are read back or not.
    pub(crate) fn made(&self, viewports: &[Viewport]) -> Vec<Wanted> {
        let mut made: Vec<Wanted> = viewports.iter().map(|viewport| self.wanted[viewport.view]).collect();
        for presentation in self.presentations {
            let made = &mut made[presentation.viewport];
            made.display |= presentation.shows_codes();
            made.hdr_stays |= presentation.shows_light();
        }
        made
    }
}

/// Inputs for holding a scene: data that stays on the adapter from frame to frame.
#[derive(Clone, Copy)]
pub(crate) struct Holding<'a> {
    pub gpu: &'a Gpu,
    pub scene: &'a SceneSnapshot,
    pub methods: &'a Methods,
    /// Sizes and cache of impostor atlases.
    pub asteroids: &'a AsteroidSettings,
    /// Glare kernel, if the method has one.
    pub kernel: Option<&'a Arc<dyn GlareKernel>>,
    /// See [`super::Renderer::catalogue_order`].
    pub catalogue_order: Option<u64>,
}

/// Properties of future frames that determine the pipelines they need.
#[derive(Clone, Copy)]
pub(crate) struct Wish<'a> {
    pub gpu: &'a Gpu,
    pub objects: &'a SceneObjects,
    pub viewports: &'a [Viewport],
    /// Decisions in the plans of these frames.
    pub forecast: &'a Forecast,
    /// Images to make of at least one view.
    pub made: Wanted,
    /// Formats of the textures that images are drawn into.
    pub formats: &'a [wgpu::TextureFormat],
}

/// Job that creates pipelines in advance, on one thread.
pub(crate) struct PipelineJob<'a> {
    pub name: &'static str,
    pub make: PipelineWork<'a>,
}

/// Work of a job.
pub(crate) enum PipelineWork<'a> {
    /// No frame is drawn in the meantime.
    Apart(Box<dyn FnOnce() + Send + 'a>),
    /// Frames may be drawn in the meantime.
    Beside(Box<dyn FnOnce() + Send + 'static>),
}

impl<'a> PipelineJob<'a> {
    /// Creates a job. `make` creates and stores pipelines; its return value is dropped.
    pub(crate) fn new<P>(name: &'static str, make: impl FnOnce() -> P + Send + 'a) -> Self {
        Self { name, make: PipelineWork::Apart(Box::new(move || drop(make()))) }
    }

    /// Creates a job that takes longer than a frame should wait.
    pub(crate) fn beside(name: &'static str, make: impl FnOnce() + Send + 'static) -> Self {
        Self { name, make: PipelineWork::Beside(Box::new(make)) }
    }
}

/// Recording state passed to techniques.
pub(crate) struct Recording<'a> {
    pub gpu: &'a Gpu,
    pub encoder: &'a mut wgpu::CommandEncoder,
    pub timer: &'a mut GpuTimer,
    pub frame: FrameInputs<'a>,
    pub targets: &'a mut Targets,
    pub readback: &'a mut ReadbackBuffer,
    pub places: &'a mut Places,
}

impl Recording<'_> {
    /// Begins a timed compute pass.
    pub(crate) fn compute_pass(&mut self, name: &'static str) -> wgpu::ComputePass<'_> {
        begin_pass(self.encoder, self.timer, name)
    }
}

/// Begins a timed compute pass.
pub(crate) fn begin_pass<'a>(
    encoder: &'a mut wgpu::CommandEncoder,
    timer: &mut GpuTimer,
    name: &'static str,
) -> wgpu::ComputePass<'a> {
    let timestamp_writes = timer.pass(name);
    encoder.begin_compute_pass(&wgpu::ComputePassDescriptor { label: Some(name), timestamp_writes })
}

/// Drawing technique.
pub(crate) trait Technique {
    /// Uploads the data that does not depend on the positions and directions of the eyes. The data stays resident until the scene or the settings
    /// change. Data that is already resident takes no time.
    fn hold(&mut self, _holding: &Holding<'_>) -> Result<(), RenderError> {
        Ok(())
    }

    /// Computes in advance, after [`Technique::hold`], data for a frame like the last one.
    fn warm(&mut self, _holding: &Holding<'_>) {}

    /// Returns jobs that create the pipelines of such frames in advance. Existing pipelines take no time. If a pipeline is missing, the first frame
    /// that needs it creates it.
    fn pipelines<'a>(&'a self, _wish: &Wish<'a>) -> Vec<PipelineJob<'a>> {
        Vec::new()
    }

    /// Whether the previous frame could not read the map of faint light that this plan's frame reads.
    fn is_new_map(&self, _plan: &Plan, _series: Series) -> bool {
        false
    }

    /// Returns the parts of the map of faint light that a plan's frame reads and that have not been drawn yet, or were drawn without some of their
    /// stars.
    fn map_parts(&mut self, _gpu: &Gpu, _plan: &Plan, _scene: &SceneSnapshot, _series: Series) -> Vec<SkyPart> {
        Vec::new()
    }

    /// Returns the state of the map of faint light that a plan's frame reads.
    fn map_state(&self, _plan: &Plan, _series: Series) -> MapState {
        MapState::default()
    }

    /// Uploads the data of a planned frame, and stores in `targets` the data that other techniques read.
    fn encode(&mut self, _gpu: &Gpu, _frame: &FrameInputs<'_>, _targets: &mut Targets) {}

    /// Records the work of a phase.
    fn record(&mut self, phase: Phase, recording: &mut Recording<'_>);

    /// Returns the size of the technique's readback besides images, bytes, including alignment to 16.
    fn readback_bytes(&self, _plan: &Plan) -> u64 {
        0
    }

    /// Reads the technique's results besides images.
    fn read(
        &self,
        _gpu: &Gpu,
        _readback: &mut ReadbackBuffer,
        _places: &Places,
        _plan: &Plan,
        _views: &mut [ViewStatistics],
    ) -> Result<(), RenderError> {
        Ok(())
    }

    /// Releases everything that depends on the scene or on the size of images.
    fn release(&mut self);
}
