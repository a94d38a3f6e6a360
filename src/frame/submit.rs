//! A frame in two halves: [`Renderer::submit`] plans, records and hands the commands over, [`Renderer::finish`] waits for them and
//! reads back. [`Renderer::render`] does both at once.

use std::{sync::Arc, time::Instant};

use glam::DVec3;

use super::{
    Frame, Wanted,
    error::RenderError,
    glare_sky::SkyScene,
    presentation::{Outputs, Presentation, check_presentations},
    record::Places,
    renderer::{Prepared, Renderer},
};
use crate::{
    plan::settings::{Accumulator, GlareMethod, RenderSettings, StarMethod},
    scene::SceneSnapshot,
    view::Rig,
};

/// A frame that the device has been given. [`Renderer::finish`] takes it back; one that is dropped instead is thrown away by the
/// renderer's next frame, which waits for it.
#[must_use = "a frame that is not finished is thrown away"]
pub struct SubmittedFrame {
    /// Which of all frames it is.
    token: Arc<()>,
    pub(super) prepared: Prepared,
    pub(super) places: Places,
    /// Names of the views.
    pub(super) views: Vec<String>,
    scene_revision: u64,
    camera_revision: u64,
    plan_ms: f64,
    submit_ms: f64,
}

/// The frame that the device is at work on.
pub(super) struct InFlight {
    token: Arc<()>,
    submission: wgpu::SubmissionIndex,
}

impl Renderer {
    /// Draws all views of `rig`. `wanted` says per view what to read back. With automatic exposure, `adapted_ev100` is
    /// the exposure to show the frame with; without it the frame is shown as fully adapted.
    pub fn render(
        &mut self,
        snapshot: &SceneSnapshot,
        rig: &Rig,
        settings: &RenderSettings,
        wanted: &[Wanted],
        adapted_ev100: Option<f64>,
    ) -> Result<Frame, RenderError> {
        let submitted = self.submit(snapshot, rig, settings, wanted, adapted_ev100, &[])?;
        self.finish(submitted)
    }

    /// Checks and holds all that a frame takes and that does not depend on where eyes stand and look: stars, fields of asteroids,
    /// kernels and point-spread functions, and the map of the glaring sky for views like those of the last frame.
    /// [`Renderer::submit`] does it too; what is held already takes no time there, so call this before the poses of a headset are
    /// asked for.
    ///
    /// A frame in flight is thrown away, as by [`Renderer::submit`].
    pub fn hold(&mut self, snapshot: &SceneSnapshot, settings: &RenderSettings) -> Result<(), RenderError> {
        self.hold_scene(snapshot, settings)?;
        if settings.glare.chosen(settings.stars.method) == GlareMethod::SkyCube {
            self.glare.hold_map(&self.gpu, &settings.glare, &SkyScene::of(snapshot, settings));
        }
        Ok(())
    }

    fn hold_scene(&mut self, snapshot: &SceneSnapshot, settings: &RenderSettings) -> Result<(), RenderError> {
        self.abandon()?;
        let method = settings.stars.method;
        if snapshot.camera.velocity_c != DVec3::ZERO && method.accumulator() != Accumulator::FixedPoint {
            return Err(RenderError::AtRestOnly(method.name()));
        }
        self.check_objects(snapshot, method)?;
        if method == StarMethod::PsfTexture {
            self.blended.hold_psf(&settings.stars.psf_texture)?;
        }
        if settings.glare.chosen(method) == GlareMethod::SkyCube {
            if !method.draws_catalogue() {
                return Err(RenderError::GlareOfCatalogue(method.name()));
            }
            self.glare.hold_kernel(&settings.glare)?;
        }
        self.hold_stars(method, &snapshot.stars);
        self.hold_asteroids(&snapshot.objects, &settings.asteroids).inspect_err(|_| self.forget_buffers())
    }

    /// The first half of [`Renderer::render`]: hands the frame to the device and does not wait for it. Besides what is read back,
    /// images are drawn into the textures of `presentations`, in the same submission.
    ///
    /// One frame may be in flight: if the last one was not finished, this waits for it and throws it away, and finishing it later is
    /// [`RenderError::Abandoned`]. Had the device failed in it, that is the error here.
    pub fn submit(
        &mut self,
        snapshot: &SceneSnapshot,
        rig: &Rig,
        settings: &RenderSettings,
        wanted: &[Wanted],
        adapted_ev100: Option<f64>,
        presentations: &[Presentation<'_>],
    ) -> Result<SubmittedFrame, RenderError> {
        let start = Instant::now();
        self.check(rig)?;
        if wanted.len() != rig.views().len() {
            return Err(RenderError::WantedCount { given: wanted.len(), views: rig.views().len() });
        }
        check_presentations(rig, presentations)?;
        if settings.stars.method.accumulator() == Accumulator::Blending {
            self.check_blended(rig)?;
        }
        self.hold_scene(snapshot, settings)?;
        // Whatever could not be made or filled must not be used again.
        let prepared = self.prepare(snapshot, rig, settings, adapted_ev100).inspect_err(|_| self.forget_buffers())?;
        let outputs = Outputs { wanted, presentations };
        let recorded = self.record(&prepared, snapshot, rig, settings, &outputs, adapted_ev100);
        let plan_ms = start.elapsed().as_secs_f64() * 1e3;
        let submission = self.gpu.queue.submit([recorded.commands]);
        self.readback.map(&self.gpu);
        let token = Arc::new(());
        self.in_flight = Some(InFlight { token: token.clone(), submission });
        Ok(SubmittedFrame {
            token,
            prepared,
            places: recorded.places,
            views: rig.views().iter().map(|view| view.name.clone()).collect(),
            scene_revision: snapshot.revision,
            camera_revision: snapshot.camera.revision,
            plan_ms,
            submit_ms: start.elapsed().as_secs_f64() * 1e3,
        })
    }

    /// The second half of [`Renderer::render`]: waits for the frame and reads back what was wanted of it.
    pub fn finish(&mut self, submitted: SubmittedFrame) -> Result<Frame, RenderError> {
        let start = Instant::now();
        let in_flight = self.in_flight.take_if(|in_flight| Arc::ptr_eq(&in_flight.token, &submitted.token));
        let in_flight = in_flight.ok_or(RenderError::Abandoned)?;
        let waited = self.wait_for(in_flight);
        let read = waited.and_then(|()| self.read(&submitted));
        self.readback.unmap(&self.gpu);
        if let Err(RenderError::Gpu(_)) = &read {
            // Whatever could not be made or filled must not be used again.
            self.forget_buffers();
        }
        let mut frame = read?;
        self.frames += 1;
        frame.number = self.frames;
        frame.scene_revision = submitted.scene_revision;
        frame.camera_revision = submitted.camera_revision;
        frame.times.plan_ms = submitted.plan_ms;
        frame.times.total_ms = submitted.submit_ms + start.elapsed().as_secs_f64() * 1e3;
        frame.times.gpu_and_readback_ms = frame.times.total_ms - submitted.plan_ms;
        Ok(frame)
    }

    /// Waits for a frame; what the device has complained of meanwhile is the error.
    fn wait_for(&self, in_flight: InFlight) -> Result<(), RenderError> {
        let waited = self.gpu.wait(Some(in_flight.submission));
        // A refused frame was never submitted: what was refused says more than that it cannot be waited for.
        self.gpu.take_failure()?;
        waited?;
        Ok(())
    }

    /// Waits for the frame in flight, if there is one, and throws it away.
    fn abandon(&mut self) -> Result<(), RenderError> {
        let Some(in_flight) = self.in_flight.take() else { return Ok(()) };
        let waited = self.wait_for(in_flight);
        self.readback.unmap(&self.gpu);
        waited.inspect_err(|_| self.forget_buffers())
    }
}
