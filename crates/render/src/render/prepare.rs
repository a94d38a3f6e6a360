//! Creates pipelines before the first frame: those that the scene's objects, the rig and the settings can need, on all
//! cores.
//!
//! GPU drivers compile a shader when its pipeline is created, on the creating thread. Software drivers compile it when
//! it first runs, one after the other on the thread of the queue. For these, compute shaders are compiled in advance on
//! separate devices (`gpu/compile_ahead.rs`), and the others need a warm-up frame ([`Renderer::warm_up`]).

use std::sync::{Mutex, PoisonError};

use super::{
    FrameRequest, RenderError, Renderer, Wanted,
    technique::{PipelineJob, Wish},
};
use crate::{
    plan::{Forecast, exposure::origin::ExposureOrigin, settings::RenderSettings},
    scene::{SceneObjects, SceneSnapshot},
    view::Rig,
};

/// Progress of [`Renderer::prepare`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PrepareStep {
    /// Name of the pipelines created last.
    pub name: &'static str,
    /// Number of finished jobs.
    pub done: usize,
    /// Total number of jobs.
    pub total: usize,
}

/// Runs jobs on as many threads as there are cores, in order.
fn run(jobs: Vec<PipelineJob<'_>>, progress: &mut (dyn FnMut(PrepareStep) + Send)) {
    let total = jobs.len();
    let threads = std::thread::available_parallelism().map_or(1, usize::from).min(total);
    let waiting = Mutex::new(jobs.into_iter());
    let progress = Mutex::new((0, progress));
    std::thread::scope(|scope| {
        for _ in 0..threads {
            scope.spawn(|| {
                loop {
                    let job = waiting.lock().unwrap_or_else(PoisonError::into_inner).next();
                    let Some(PipelineJob { name, make }) = job else { return };
                    make();
                    let mut progress = progress.lock().unwrap_or_else(PoisonError::into_inner);
                    let (done, progress) = &mut *progress;
                    *done += 1;
                    progress(PrepareStep { name, done: *done, total });
                }
            });
        }
    });
}

impl Renderer {
    /// Creates, on all cores, the pipelines for frames of these objects, views and settings. `wanted` states which
    /// images of any view will be read back, `formats` the formats of textures that images will be drawn into. Frames
    /// create missing pipelines themselves; after this call none are missing.
    ///
    /// # Errors
    ///
    /// The driver rejected a shader.
    pub fn prepare(
        &mut self,
        objects: &SceneObjects,
        rig: &Rig,
        settings: &RenderSettings,
        wanted: Wanted,
        formats: &[wgpu::TextureFormat],
        progress: &mut (dyn FnMut(PrepareStep) + Send),
    ) -> Result<(), RenderError> {
        let viewports = rig.viewports(glam::DQuat::IDENTITY);
        self.hold_tables(&viewports)?;
        let limits = &self.limits;
        // Picture of the meter, if it draws one.
        let metered = match ExposureOrigin::new(rig, settings, false)? {
            ExposureOrigin::Picture { rig, settings } => {
                let viewports = rig.viewports(glam::DQuat::IDENTITY);
                Some((Forecast::new(&settings, objects, &viewports, limits), viewports))
            }
            ExposureOrigin::Own | ExposureOrigin::Plan => None,
        };
        // Pipelines of the frames, and those of the meter.
        let forecast = &Forecast::new(settings, objects, &viewports, limits);
        let wish = Wish { gpu: &self.gpu, objects, viewports: &viewports, forecast, made: wanted, formats };
        let mut jobs: Vec<PipelineJob<'_>> =
            self.techniques.iter().flat_map(|technique| technique.pipelines(&wish)).collect();
        if let Some((forecast, viewports)) = &metered {
            let wish = Wish { viewports, forecast, made: Wanted::default(), formats: &[], ..wish };
            jobs.extend(self.techniques.iter().flat_map(|technique| technique.pipelines(&wish)));
        }
        self.gpu.compiling_ahead(|| run(jobs, progress));
        self.gpu.take_failure()?;
        Ok(())
    }

    /// Draws a frame and discards it, so that everything that the first frame needs exists and is compiled.
    ///
    /// # Errors
    ///
    /// Those of [`Renderer::render`].
    pub fn warm_up(
        &mut self,
        scene: &SceneSnapshot,
        rig: &Rig,
        settings: &RenderSettings,
        wanted: Wanted,
    ) -> Result<(), RenderError> {
        self.render(FrameRequest::new(scene, rig).settings(settings).wanted(wanted)).map(drop)
    }
}
