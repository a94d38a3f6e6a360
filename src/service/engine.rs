//! What the service asks of a renderer, so that it can be run on the GPU, and tested without one.

use std::time::Duration;

use crate::{
    gpu::{AdapterReport, GpuError},
    plan::{Limits, settings::RenderSettings},
    render::{Frame, FrameRequest, RenderError, Renderer},
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
    /// An error concerns this frame alone, which is then not to be finished, unless the renderer is lost; that, and a panic, end the
    /// daemon.
    fn submit(&mut self, request: FrameRequest<'_>) -> Result<(), EngineError>;

    /// Waits for the oldest frame that was begun and not finished, for at most `timeout` ([`Duration::MAX`]: as long as it takes).
    /// Whether [`Self::finish`] needs no more waiting: the frame is drawn, or cannot be.
    fn is_drawn_within(&mut self, timeout: Duration) -> bool;

    /// Waits for the oldest frame that was begun and not finished, and gives it.
    ///
    /// Errors are as those of [`Self::submit`].
    fn finish(&mut self) -> Result<Frame, EngineError>;

    /// Runs a failure test with the methods of `settings`, while no frame is in flight. What it renders for that is no frame.
    fn verify(&mut self, check: &'static Check, settings: &RenderSettings) -> CheckResult;

    /// What plans may ask of it: changes are checked against these before they are made. Asked once, before the first frame.
    fn limits(&self) -> Limits {
        Limits::default()
    }

    /// What it runs on. Asked once, before the first frame.
    fn info(&self) -> AdapterReport;
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

    fn verify(&mut self, check: &'static Check, settings: &RenderSettings) -> CheckResult {
        verify::run(check, self, settings)
    }

    fn limits(&self) -> Limits {
        *Self::limits(self)
    }

    fn info(&self) -> AdapterReport {
        self.adapter().clone()
    }
}
