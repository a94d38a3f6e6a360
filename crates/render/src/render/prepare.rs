//! Pipelines before the first frame: those that a scene's objects, a rig and settings can ask for, on all cores.
//!
//! Drivers of GPUs compile a shader when its pipeline is made, on the thread that makes it. Software drivers compile it when it first runs, one
//! after the other on the queue's own thread; there compute shaders are compiled ahead on devices of their own (`gpu/compile_ahead.rs`), and
//! it takes a frame ([`Renderer::warm_up`]) to have the others compiled.

use std::sync::{Mutex, PoisonError};

use super::{
    FrameRequest, RenderError, Renderer, Wanted,
    technique::{PipelineJob, Wish},
};
use crate::{
    plan::{
        PlanError,
        settings::{Metering, RenderSettings},
        view_settings::{meter_settings, spot_rig},
    },
    scene::{SceneObjects, SceneSnapshot},
    view::Rig,
};

/// How far [`Renderer::prepare`] is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PrepareStep {
    /// What has been made last.
    pub name: &'static str,
    /// How much is done.
    pub done: usize,
    /// How much there is to do.
    pub of: usize,
}

/// Runs jobs on as many threads as there are cores, the first ones first.
fn run(jobs: Vec<PipelineJob<'_>>, progress: &mut (dyn FnMut(PrepareStep) + Send)) {
    let of = jobs.len();
    let threads = std::thread::available_parallelism().map_or(1, usize::from).min(of);
    let waiting = Mutex::new(jobs.into_iter());
    let told = Mutex::new((0, progress));
    std::thread::scope(|scope| {
        for _ in 0..threads {
            scope.spawn(|| {
                loop {
                    let job = waiting.lock().unwrap_or_else(PoisonError::into_inner).next();
                    let Some(PipelineJob { name, make }) = job else { return };
                    make();
                    let mut told = told.lock().unwrap_or_else(PoisonError::into_inner);
                    let (done, progress) = &mut *told;
                    *done += 1;
                    progress(PrepareStep { name, done: *done, of });
                }
            });
        }
    });
}

impl Renderer {
    /// Makes the pipelines that frames of these objects, views and settings take, on all cores. `wanted` says what is going to be
    /// read back of any view, `formats` what textures images are going to be drawn into. Frames make what they need and does not
    /// exist yet; after this there is nothing of that kind.
    ///
    /// # Errors
    ///
    /// The driver has refused a shader.
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
        // A meter of its own draws a picture that nobody sees.
        let spot = match settings.exposure.goes_by(Metering::Spot) {
            true => spot_rig(rig, &settings.exposure).map_err(PlanError::from)?,
            false => None,
        };
        let spot_viewports = spot.map(|spot| spot.viewports(glam::DQuat::IDENTITY));
        let of_meter = meter_settings(settings);
        let wish = Wish { gpu: &self.gpu, objects, settings, viewports: &viewports, made: wanted, formats };
        let mut jobs: Vec<PipelineJob<'_>> =
            self.techniques.iter().flat_map(|technique| technique.pipelines(&wish)).collect();
        let meter_wish = spot_viewports.as_ref().map(|viewports| Wish {
            settings: &of_meter,
            viewports,
            made: Wanted::default(),
            formats: &[],
            ..wish
        });
        if let Some(wish) = &meter_wish {
            jobs.extend(self.techniques.iter().flat_map(|technique| technique.pipelines(wish)));
        }
        self.gpu.compiling_ahead(|| run(jobs, progress));
        self.gpu.take_failure()?;
        Ok(())
    }

    /// Draws a frame that nobody sees, so that everything that the first frame takes is there and compiled.
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
