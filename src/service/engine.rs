//! What the service asks of a renderer, so that it can be run on the GPU, and tested without one.

use crate::{
    frame::{Frame, Renderer, Wanted},
    gpu::AdapterReport,
    plan::settings::RenderSettings,
    scene::SceneSnapshot,
    view::Rig,
};

/// A frame could not be rendered; the renderer can be asked again.
#[derive(Debug, thiserror::Error)]
#[error(transparent)]
pub struct EngineError(#[from] Box<dyn std::error::Error + Send + Sync>);

impl EngineError {
    /// Wraps a renderer's own error, or a plain message.
    pub fn new(error: impl Into<Box<dyn std::error::Error + Send + Sync>>) -> Self {
        Self(error.into())
    }
}

/// A renderer. It moves to the render thread, which is then the only one that touches it.
pub trait Engine: Send + 'static {
    /// Renders one frame of all views of `rig`: `wanted` has one entry per view. `adapted_ev100` is the exposure (EV at ISO
    /// 100) of an eye that adapts over time; `None` asks for the fully adapted value. The frame's images are those wanted,
    /// its camera and scene revisions those of the snapshot.
    ///
    /// An error concerns this frame alone. A panic ends the daemon.
    fn render(
        &mut self,
        snapshot: &SceneSnapshot,
        rig: &Rig,
        settings: &RenderSettings,
        wanted: &[Wanted],
        adapted_ev100: Option<f64>,
    ) -> Result<Frame, EngineError>;

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
        Renderer::render(self, snapshot, rig, settings, wanted, adapted_ev100).map_err(EngineError::new)
    }

    fn info(&self) -> AdapterReport {
        self.adapter().clone()
    }
}
