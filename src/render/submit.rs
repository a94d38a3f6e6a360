//! A frame in two halves: [`Renderer::submit`] plans, records and hands the commands over, [`Renderer::finish`] waits for them and
//! reads back. [`Renderer::render`] does both at once.

use std::{sync::Arc, time::Instant};

use super::{
    Frame, FrameRequest, RenderError, Renderer,
    presentation::check_presentations,
    read::{self, Places},
    sequence,
    technique::{FrameInputs, Outputs, Recording},
};
use crate::{
    gpu::GpuTimer,
    plan::{Plan, settings::RenderSettings},
    scene::SceneSnapshot,
};

/// A frame that the device has been given. [`Renderer::finish`] takes it back; one that is dropped instead is thrown away by the
/// renderer's next frame, which waits for it.
#[must_use = "a frame that is not finished is thrown away"]
pub struct SubmittedFrame {
    /// Which of all frames it is.
    token: Arc<()>,
    pub(super) plan: Plan,
    pub(super) places: Places,
    /// Names of the views.
    pub(super) views: Vec<String>,
    scene_revision: u64,
    camera_revision: u64,
    plan_ms: f64,
    submit_ms: f64,
    objects_made: u64,
}

/// The frame that the device is at work on.
pub(super) struct InFlight {
    token: Arc<()>,
    submission: wgpu::SubmissionIndex,
}

impl Renderer {
    /// Draws all views of a rig and waits for them.
    pub fn render(&mut self, request: FrameRequest<'_>) -> Result<Frame, RenderError> {
        let submitted = self.submit(request)?;
        self.finish(submitted)
    }

    /// Checks and holds all that a frame takes and that does not depend on where eyes stand and look: stars, fields of asteroids,
    /// kernels and point-spread functions, and the map of the glaring sky for views like those of the last frame.
    /// [`Renderer::submit`] does it too; what is held already takes no time there, so call this before the poses of a headset are
    /// asked for.
    ///
    /// A frame in flight is thrown away, as by [`Renderer::submit`].
    pub fn hold(&mut self, snapshot: &SceneSnapshot, settings: &RenderSettings) -> Result<(), RenderError> {
        self.abandon()?;
        self.planner.check(snapshot, settings, &self.limits)?;
        self.hold_scene(snapshot, settings)?;
        self.holding(snapshot, settings, |technique, holding| {
            technique.warm(holding);
            Ok(())
        })
    }

    fn hold_scene(&mut self, snapshot: &SceneSnapshot, settings: &RenderSettings) -> Result<(), RenderError> {
        let held = self.holding(snapshot, settings, |technique, holding| technique.hold(holding));
        // Whatever could not be made or filled must not be used again.
        held.inspect_err(|_| self.forget_buffers())
    }

    /// The first half of [`Renderer::render`]: hands the frame to the device and does not wait for it.
    ///
    /// One frame may be in flight: if the last one was not finished, this waits for it and throws it away, and finishing it later is
    /// [`RenderError::Abandoned`]. Had the device failed in it, that is the error here.
    pub fn submit(&mut self, request: FrameRequest<'_>) -> Result<SubmittedFrame, RenderError> {
        let start = Instant::now();
        let made = self.gpu.made();
        let FrameRequest { scene: snapshot, rig, settings, adapted_ev100, presentations, .. } = request;
        let wanted = request.wanted_views();
        self.limits.check(rig)?;
        if wanted.len() != rig.views().len() {
            return Err(RenderError::WantedCount { given: wanted.len(), views: rig.views().len() });
        }
        check_presentations(rig, presentations)?;
        self.abandon()?;
        (self.planner.culling, self.planner.unit_factor) = (self.culling, self.unit_factor);
        let plan = self.planner.plan(snapshot, rig, settings, adapted_ev100, &self.limits)?;
        self.hold_tables(&plan.viewports)?;
        self.hold_scene(snapshot, settings)?;
        let outputs = Outputs { wanted: &wanted, presentations };
        let inputs =
            FrameInputs { plan: &plan, scene: snapshot, settings, outputs, catalogue_order: self.catalogue_order };
        let (commands, places) = self.record(&inputs, rig.views().len());
        let plan_ms = start.elapsed().as_secs_f64() * 1e3;
        let submission = self.gpu.queue.submit([commands]);
        self.readback.map(&self.gpu);
        let token = Arc::new(());
        self.in_flight = Some(InFlight { token: token.clone(), submission });
        Ok(SubmittedFrame {
            token,
            plan,
            places,
            views: rig.views().iter().map(|view| view.name.clone()).collect(),
            scene_revision: snapshot.revision,
            camera_revision: snapshot.camera.revision,
            plan_ms,
            submit_ms: start.elapsed().as_secs_f64() * 1e3,
            objects_made: self.gpu.made().since(&made).all(),
        })
    }

    /// Uploads what changes from frame to frame, and records all phases and the copies of what leaves the GPU.
    fn record(&mut self, inputs: &FrameInputs<'_>, views: usize) -> (wgpu::CommandBuffer, Places) {
        let Self { gpu, techniques, targets, tables, timer, readback, .. } = self;
        let gpu = &*gpu;
        let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("frame") });
        gpu.begin_frame();
        timer.begin();
        targets.begin(gpu, &mut encoder, inputs, views, tables);
        for technique in techniques.iter_mut() {
            technique.encode(gpu, inputs, targets);
        }
        let counted: u64 = techniques.iter().map(|technique| technique.readback_bytes(inputs.plan)).sum();
        readback.begin(read::bytes(inputs, targets) + counted + GpuTimer::readback_bytes());
        let mut places = Places::default();
        let mut recording =
            Recording { gpu, encoder: &mut encoder, timer, frame: *inputs, targets, readback, places: &mut places };
        sequence::record(techniques, &mut recording);
        read::copy(&mut recording);
        (encoder.finish(), places)
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
        frame.times.objects_made = submitted.objects_made;
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
    pub(super) fn abandon(&mut self) -> Result<(), RenderError> {
        let Some(in_flight) = self.in_flight.take() else { return Ok(()) };
        let waited = self.wait_for(in_flight);
        self.readback.unmap(&self.gpu);
        waited.inspect_err(|_| self.forget_buffers())
    }
}
