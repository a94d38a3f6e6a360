//! What the service asks of a renderer, so that it can be run on the GPU, and tested without one.

use crate::{
    gpu::{AdapterReport, GpuError},
    plan::settings::RenderSettings,
    render::{Frame, RenderError, Renderer, Wanted},
    scene::SceneSnapshot,
    verify::{self, Check, CheckResult},
    view::Rig,
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
pub trait Engine: Send + 'static {
    /// Renders one frame of all views of `rig`: `wanted` has one entry per view. `adapted_ev100` is the exposure (EV at ISO
    /// 100) of an eye that adapts over time; `None` asks for the fully adapted value. The frame's images are those wanted,
    /// its camera and scene revisions those of the snapshot.
    ///
    /// An error concerns this frame alone, unless the renderer is lost; that, and a panic, end the daemon.
    fn render(
        &mut self,
        snapshot: &SceneSnapshot,
        rig: &Rig,
        settings: &RenderSettings,
        wanted: &[Wanted],
        adapted_ev100: Option<f64>,
    ) -> Result<Frame, EngineError>;

    /// Runs a failure test with the methods of `settings`. What it renders for that is no frame.
    fn verify(&mut self, check: &'static Check, settings: &RenderSettings) -> CheckResult;

    /// What it runs on. Asked once, before the first frame.
    fn info(&self) -> AdapterReport;
}

impl Engine for Renderer {
    fn render(
        &mut self,
        snapshot: &SceneSnapshot,
        rig: &Rig,
        settings: &RenderSettings,
        wanted: &[Wanted],
        adapted_ev100: Option<f64>,
    ) -> Result<Frame, EngineError> {
        Renderer::render(self, snapshot, rig, settings, wanted, adapted_ev100).map_err(|error| match error {
            RenderError::Gpu(GpuError::Lost(_)) => EngineError::lost(error),
            error => EngineError::new(error),
        })
    }

    fn verify(&mut self, check: &'static Check, settings: &RenderSettings) -> CheckResult {
        verify::run(check, self, settings)
    }

    fn info(&self) -> AdapterReport {
        self.adapter().clone()
    }
}
