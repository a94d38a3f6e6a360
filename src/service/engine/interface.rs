//! The interface of a renderer, implemented by the GPU renderer and by small ones in tests.

use std::{sync::Arc, time::Duration};

use crate::{
    gpu::{AdapterReport, Gpu, GpuError, GpuOptions},
    plan::{
        Limits,
        settings::{AsteroidSettings, RenderSettings},
    },
    render::{BakedImpostors, Frame, FrameRequest, PipelinesAhead, RenderError, Renderer},
    scene::asteroids::ShapeSet,
    verify::{self, Check, CheckResult},
};

/// A frame could not be rendered.
#[derive(Debug, thiserror::Error)]
#[error("{source}")]
pub struct EngineError {
    source: Box<dyn std::error::Error + Send + Sync>,
    /// Whether the renderer is lost; otherwise it can continue.
    pub lost: bool,
}

impl EngineError {
    /// Wraps a renderer's error, or a plain message, that affects one frame.
    pub fn new(error: impl Into<Box<dyn std::error::Error + Send + Sync>>) -> Self {
        Self { source: error.into(), lost: false }
    }

    /// Wraps the same for a renderer that is lost, such as after the loss of its device.
    pub fn lost(error: impl Into<Box<dyn std::error::Error + Send + Sync>>) -> Self {
        Self { source: error.into(), lost: true }
    }
}

/// A renderer. It moves to the render thread, which has exclusive access.
///
/// A frame has two halves, [`Self::submit`] and [`Self::finish`], so that the next one can be planned while this one is
/// drawn. At most two frames are in flight, and they are finished in the order of their submission.
pub trait Engine: Send + 'static {
    /// Begins a frame without waiting for it. The frame has the requested images, and the camera and scene revisions of
    /// the scene.
    ///
    /// An error affects this frame only, which must then not be finished. If the renderer is lost, no frame in flight
    /// may be finished, and [`Self::reopen`] is called. A panic ends the daemon.
    fn submit(&mut self, request: FrameRequest<'_>) -> Result<(), EngineError>;

    /// Waits at most `timeout` for the oldest frame in flight ([`Duration::MAX`]: without limit). Returns whether
    /// [`Self::finish`] returns without waiting: the frame is drawn, or has failed.
    fn is_drawn_within(&mut self, timeout: Duration) -> bool;

    /// Waits for the oldest frame in flight and returns it.
    ///
    /// Errors are as for [`Self::submit`].
    fn finish(&mut self) -> Result<Frame, EngineError>;

    /// Replaces a lost renderer. Frames in flight are gone; frame numbers continue.
    ///
    /// # Errors
    ///
    /// The renderer cannot be created at present.
    fn reopen(&mut self) -> Result<(), EngineError>;

    /// Returns a function that opens a second renderer for background jobs, on the calling thread. Called once, before
    /// the first frame.
    fn beside(&self) -> OpenBeside;

    /// Returns the pipelines that frames create for a later scene. Called once, before the first frame.
    fn pipelines_ahead(&self) -> PipelinesAhead {
        PipelinesAhead::default()
    }

    /// Returns the limits for plans, by which changes are checked. Called once, before the first frame.
    fn limits(&self) -> Limits {
        Limits::default()
    }

    /// Returns a description of the adapter. Called once, before the first frame.
    fn info(&self) -> AdapterReport;
}

/// A second renderer for long jobs, on a low-priority thread.
pub trait BesideEngine: Send {
    /// Runs a failure test with the methods of `settings`.
    ///
    /// # Errors
    ///
    /// No device can be opened for it.
    fn verify(&mut self, check: &'static Check, settings: &RenderSettings) -> Result<CheckResult, EngineError>;

    /// Prepares data of these shape sets that take long to compute.
    ///
    /// # Errors
    ///
    /// Names the data that cannot be computed.
    fn bake(&mut self, sets: &[Arc<ShapeSet>], settings: &AsteroidSettings) -> Result<(), EngineError>;
}

/// Opens a [`BesideEngine`]. It is called again after the loss of that engine.
pub type OpenBeside = Box<dyn FnMut() -> Box<dyn BesideEngine> + Send>;

/// Has a separate renderer for failure tests. Bakes data for the renderer that draws.
struct BesideRenderer {
    options: GpuOptions,
    /// Opened for the first failure test.
    renderer: Option<Renderer>,
    baked: BakedImpostors,
}

impl BesideEngine for BesideRenderer {
    fn verify(&mut self, check: &'static Check, settings: &RenderSettings) -> Result<CheckResult, EngineError> {
        let renderer = match self.renderer.take() {
            Some(renderer) => renderer,
            None => {
                let gpu = Gpu::open(&self.options);
                Renderer::new(gpu.map_err(|error| EngineError::lost(format!("cannot open a second device: {error}")))?)
            }
        };
        Ok(verify::run(check, self.renderer.insert(renderer), settings))
    }

    fn bake(&mut self, sets: &[Arc<ShapeSet>], settings: &AsteroidSettings) -> Result<(), EngineError> {
        self.baked.bake(sets, settings).map_err(EngineError::new)
    }
}

impl From<RenderError> for EngineError {
    fn from(error: RenderError) -> Self {
        match error {
            RenderError::Gpu(GpuError::Lost(_)) => Self::lost(error),
            error => Self::new(error),
        }
    }
}

impl Engine for Renderer {
    fn submit(&mut self, request: FrameRequest<'_>) -> Result<(), EngineError> {
        // When this frame is finished, it is the oldest one in flight.
        let _submitted = Self::submit(self, request)?;
        Ok(())
    }

    fn is_drawn_within(&mut self, timeout: Duration) -> bool {
        self.oldest_done_within(timeout)
    }

    fn finish(&mut self) -> Result<Frame, EngineError> {
        Ok(self.finish_oldest()?)
    }

    fn reopen(&mut self) -> Result<(), EngineError> {
        Self::reopen(self).map_err(EngineError::lost)
    }

    fn beside(&self) -> OpenBeside {
        let options = self.gpu_options().clone();
        let baked = self.baked_impostors().clone();
        Box::new(move || Box::new(BesideRenderer { options: options.clone(), renderer: None, baked: baked.clone() }))
    }

    fn pipelines_ahead(&self) -> PipelinesAhead {
        Self::pipelines_ahead(self).clone()
    }

    fn limits(&self) -> Limits {
        *Self::limits(self)
    }

    fn info(&self) -> AdapterReport {
        self.adapter().clone()
    }
}
