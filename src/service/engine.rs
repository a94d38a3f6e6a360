//! What the service asks of a renderer, so that it can be run on the GPU, and tested without one.

use std::{sync::Arc, time::Duration};

use crate::{
    gpu::{AdapterReport, Gpu, GpuError, GpuOptions},
    plan::{
        Limits,
        settings::{AsteroidSettings, RenderSettings},
    },
    render::{BakedImpostors, Frame, FrameRequest, ImpostorAtlasError, RenderError, Renderer},
    scene::asteroids::ShapeSet,
    verify::{self, Check, CheckResult},
};

/// A frame could not be rendered.
#[derive(Debug, thiserror::Error)]
#[error("{source}")]
pub struct EngineError {
    source: Box<dyn std::error::Error + Send + Sync>,
    /// Whether the renderer is of no use any more; otherwise it can be asked again.
    pub lost: bool,
}

impl EngineError {
    /// Wraps a renderer's own error, or a plain message, that concerns one frame.
    pub fn new(error: impl Into<Box<dyn std::error::Error + Send + Sync>>) -> Self {
        Self { source: error.into(), lost: false }
    }

    /// The same where the renderer is of no use any more, as when its device is lost.
    pub fn lost(error: impl Into<Box<dyn std::error::Error + Send + Sync>>) -> Self {
        Self { source: error.into(), lost: true }
    }
}

/// A renderer. It moves to the render thread, which is then the only one that touches it.
///
/// A frame comes in two halves, [`Self::submit`] and [`Self::finish`], so that the next one can be planned while this one is drawn.
/// At most two are in flight, and they are finished in the order of their submission.
pub trait Engine: Send + 'static {
    /// Begins a frame and does not wait for it. The frame's images are those wanted, its camera and scene revisions those of the
    /// scene.
    ///
    /// An error concerns this frame alone, which is then not to be finished, unless the renderer is lost: then no frame that was begun is to be finished,
    /// and [`Self::reopen`] is called. A panic ends the daemon.
    fn submit(&mut self, request: FrameRequest<'_>) -> Result<(), EngineError>;

    /// Waits for the oldest frame that was begun and not finished, for at most `timeout` ([`Duration::MAX`]: as long as it takes).
    /// Whether [`Self::finish`] needs no more waiting: the frame is drawn, or cannot be.
    fn is_drawn_within(&mut self, timeout: Duration) -> bool;

    /// Waits for the oldest frame that was begun and not finished, and gives it.
    ///
    /// Errors are as those of [`Self::submit`].
    fn finish(&mut self) -> Result<Frame, EngineError>;

    /// Makes the renderer anew in place of one that is lost. Frames that were begun are gone; numbers of frames go on.
    ///
    /// # Errors
    ///
    /// It cannot be made at present.
    fn reopen(&mut self) -> Result<(), EngineError>;

    /// What opens a second renderer for work beside the frames, on the thread that calls it. Asked for once, before the first frame.
    fn beside(&self) -> OpenBeside;

    /// What plans may ask of it: changes are checked against these before they are made. Asked once, before the first frame.
    fn limits(&self) -> Limits {
        Limits::default()
    }

    /// What it runs on. Asked once, before the first frame.
    fn info(&self) -> AdapterReport;
}

/// What long work is done by, beside the frames: a renderer of its own, on a thread that stands back behind the one of the frames.
pub trait BesideEngine: Send {
    /// Runs a failure test with the methods of `settings`.
    fn verify(&mut self, check: &'static Check, settings: &RenderSettings) -> CheckResult;

    /// Makes what frames of these sets of shapes are going to need and what takes long.
    ///
    /// # Errors
    ///
    /// What cannot be made, or the device failed.
    fn bake(&mut self, sets: &[Arc<ShapeSet>], settings: &AsteroidSettings) -> Result<(), EngineError>;
}

/// Opens a [`BesideEngine`]; again where the last one was lost.
pub type OpenBeside = Box<dyn FnMut() -> Result<Box<dyn BesideEngine>, EngineError> + Send>;

/// See [`BesideEngine`].
struct BesideRenderer {
    renderer: Renderer,
    baked: BakedImpostors,
}

impl BesideEngine for BesideRenderer {
    fn verify(&mut self, check: &'static Check, settings: &RenderSettings) -> CheckResult {
        verify::run(check, &mut self.renderer, settings)
    }

    fn bake(&mut self, sets: &[Arc<ShapeSet>], settings: &AsteroidSettings) -> Result<(), EngineError> {
        self.baked.bake(self.renderer.gpu(), sets, settings).map_err(|error| match error {
            ImpostorAtlasError::Gpu(GpuError::Lost(_)) => EngineError::lost(error),
            error => EngineError::new(error),
        })
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
        // It is the oldest one when its turn to be finished comes.
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
        let options = GpuOptions { adapter: Some(self.adapter().adapter.clone()), ..GpuOptions::default() };
        let baked = self.baked_impostors().clone();
        Box::new(move || {
            let gpu = Gpu::open(&options).map_err(EngineError::new)?;
            Ok(Box::new(BesideRenderer { renderer: Renderer::new(gpu), baked: baked.clone() }))
        })
    }

    fn limits(&self) -> Limits {
        *Self::limits(self)
    }

    fn info(&self) -> AdapterReport {
        self.adapter().clone()
    }
}
