//! What every technique of drawing does, and what it is given to do it.
//!
//! A technique has a folder of its own, with its passes, its GPU structures and their encoding; it knows no other technique. What two
//! of them share lies in [`super::targets`]. In the life of a frame: [`Technique::hold`], [`Technique::encode`], then
//! [`Technique::record`] phase by phase, and [`Technique::read`] once the device is through with it.

use std::sync::Arc;

use super::{Presentation, RenderError, ViewStatistics, Wanted, read::Places, targets::Targets};
use crate::{
    gpu::{Gpu, GpuTimer, ReadbackBuffer},
    photometry::glare::GlareKernel,
    plan::{
        Plan,
        budget::{draws_outputs_apart, may_have_veil_in_sums},
        settings::RenderSettings,
        smooth_light::SkyFace,
    },
    scene::{SceneObjects, SceneSnapshot},
    view::Viewport,
};

/// A step of a frame. What is recorded in one has been finished before the next one reads it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Phase {
    /// What may be seen is found on the adapter.
    Cull,
    /// Surfaces, into what stands before the stars of one tile: number of the batch, number of the tile in it.
    Geometry(usize, usize),
    /// Light adds up in the pixels of a batch.
    Splat(usize),
    /// Sums of a batch become luminance.
    Resolve(usize),
    /// Scattered light is added.
    Glare,
    /// The exposure is found.
    Meter,
    /// Display images are made.
    Display,
    /// Lines and text are drawn onto display images.
    Overlay,
    /// Images are drawn into textures that leave the renderer.
    Present,
    /// What is only counted, after everything that is timed, and what is read back besides images.
    Count,
}

/// What a frame is made from.
#[derive(Clone, Copy)]
pub(crate) struct FrameInputs<'a> {
    pub plan: &'a Plan,
    pub scene: &'a SceneSnapshot,
    pub settings: &'a RenderSettings,
    pub outputs: Outputs<'a>,
    /// See [`super::Renderer::catalogue_order`].
    pub catalogue_order: Option<u64>,
    /// Which frames it shares maps with.
    pub series: Series,
    /// What a meter has found that looked for this frame; `None`: the frame's own light tells.
    pub metered: Option<&'a wgpu::Buffer>,
}

/// Frames that are drawn in turn with different settings: each series keeps maps of its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Series {
    /// Number of the series.
    pub slot: usize,
    /// How many series there are.
    pub slots: usize,
}

/// Whom a frame is made for: what is read back, and what is drawn into textures.
#[derive(Clone, Copy)]
pub(crate) struct Outputs<'a> {
    /// One per view.
    pub wanted: &'a [Wanted],
    pub presentations: &'a [Presentation<'a>],
}

impl Outputs<'_> {
    /// What is made of each viewport, whether it is read back or not.
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

/// What a technique holds for a scene.
#[derive(Clone, Copy)]
pub(crate) struct Holding<'a> {
    pub gpu: &'a Gpu,
    pub scene: &'a SceneSnapshot,
    pub settings: &'a RenderSettings,
    /// The kernel of glare, where the method has one.
    pub kernel: Option<&'a Arc<dyn GlareKernel>>,
    /// See [`super::Renderer::catalogue_order`].
    pub catalogue_order: Option<u64>,
}

/// What frames are going to be asked for, as far as it tells which pipelines they take.
#[derive(Clone, Copy)]
pub(crate) struct Wish<'a> {
    pub gpu: &'a Gpu,
    pub objects: &'a SceneObjects,
    pub settings: &'a RenderSettings,
    pub viewports: &'a [Viewport],
    /// What is made of any view.
    pub made: Wanted,
    /// Formats of the textures that images are drawn into.
    pub formats: &'a [wgpu::TextureFormat],
}

impl Wish<'_> {
    /// Whether display and HDR images are frames of their own.
    pub(crate) fn draws_outputs_apart(&self) -> bool {
        draws_outputs_apart(self.settings, self.objects, self.viewports)
    }

    /// Whether frames that have display images alone may have the veil of single sources in their sums of light: see
    /// [`crate::plan::GlarePlan::in_sums`].
    pub(crate) fn may_have_veil_in_sums(&self) -> bool {
        may_have_veil_in_sums(self.settings, self.objects, self.viewports)
    }
}

/// Pipelines that are made ahead, in one go on one thread.
pub(crate) struct PipelineJob<'a> {
    pub name: &'static str,
    pub make: Box<dyn FnOnce() + Send + 'a>,
}

impl<'a> PipelineJob<'a> {
    /// `make` makes and keeps pipelines. What it returns is what is kept, or a handle to it.
    pub(crate) fn new<P>(name: &'static str, make: impl FnOnce() -> P + Send + 'a) -> Self {
        Self { name, make: Box::new(move || drop(make())) }
    }
}

/// Where a technique records.
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

/// A way of drawing something.
pub(crate) trait Technique {
    /// Holds what does not depend on where eyes stand and look, until the scene or the settings are others. What is held already takes
    /// no time.
    fn hold(&mut self, _holding: &Holding<'_>) -> Result<(), RenderError> {
        Ok(())
    }

    /// Makes ahead what a frame like the last one would make, after [`Technique::hold`].
    fn warm(&mut self, _holding: &Holding<'_>) {}

    /// The pipelines that such frames take, to be made ahead. What is made already takes no time; what is not made ahead is made by the
    /// first frame that needs it.
    fn pipelines<'a>(&'a self, _wish: &Wish<'a>) -> Vec<PipelineJob<'a>> {
        Vec::new()
    }

    /// Pictures of the map of faint light that the frame of a plan reads and that are not there yet.
    fn missing(&self, _plan: &Plan, _scene: &SceneSnapshot, _series: Series) -> Vec<SkyFace> {
        Vec::new()
    }

    /// Uploads what the plan of a frame says, and leaves in `targets` what others read.
    fn encode(&mut self, _gpu: &Gpu, _frame: &FrameInputs<'_>, _targets: &mut Targets) {}

    /// Records what belongs into a phase.
    fn record(&mut self, phase: Phase, recording: &mut Recording<'_>);

    /// Bytes that it reads back besides images, alignment of 16 included.
    fn readback_bytes(&self, _plan: &Plan) -> u64 {
        0
    }

    /// Takes back what was recorded to be read, besides images.
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

    /// Lets go of everything that belongs to a scene or a size.
    fn release(&mut self);
}
