//! A frame in two halves: [`Renderer::submit`] plans, records and hands the commands over, [`Renderer::finish`] waits for them and
//! reads back. [`Renderer::render`] does both at once.
//!
//! Two frames may be in flight: the next one is planned and recorded while the device draws the last one. Buffers on the device are
//! shared by both: what is written to them, and what is submitted, happens in the order of the calls, and each frame copies what is
//! read back of it in its own submission. What the host keeps of a frame until it is finished is its own (`FrameSlot`).

use std::{
    mem,
    sync::Arc,
    time::{Duration, Instant},
};

use super::{
    Frame, FrameRequest, RenderError, Renderer, SkyMapUse, Wanted,
    meter::Metered,
    presentation::check_presentations,
    read::{self, Places},
    sequence,
    targets::Targets,
    technique::{FrameInputs, Outputs, Recording, Series},
};
use crate::{
    gpu::{Gpu, GpuError, GpuTimer, ReadbackBuffer, SUBMISSION_TIMEOUT},
    plan::{Output, Plan, PlanError, PlanOutputs, SkyUse, settings::RenderSettings, smooth_light::SkyFace},
    scene::{Camera, SceneSnapshot},
    view::projector::ProjectorOutput,
};

/// Frames that may be in flight.
const MOST_IN_FLIGHT: usize = 2;

/// A frame that the device has been given. [`Renderer::finish`] takes it back; one that is dropped instead is thrown away by the
/// renderer's next frames, which wait for it.
#[must_use = "a frame that is not finished is thrown away"]
pub struct SubmittedFrame {
    /// Which of all frames it is.
    token: Arc<()>,
}

/// What the host keeps of one frame in flight: used again by a later frame when this one is finished.
pub(super) struct FrameSlot {
    pub(super) timer: GpuTimer,
    pub(super) readback: ReadbackBuffer,
}

impl FrameSlot {
    pub(super) fn new(gpu: &Gpu) -> Self {
        Self { timer: GpuTimer::new(gpu), readback: ReadbackBuffer::new("readback") }
    }
}

/// A frame that the device is at work on.
pub(super) struct InFlight {
    token: Arc<()>,
    submission: wgpu::SubmissionIndex,
    pub(super) slot: FrameSlot,
    pub(super) plan: Plan,
    pub(super) places: Places,
    /// Names of the views.
    pub(super) views: Vec<String>,
    /// Their shares of light.
    pub(super) projectors: Vec<Option<Arc<ProjectorOutput>>>,
    scene_revision: u64,
    camera_revision: u64,
    plan_ms: f64,
    submit_ms: f64,
    objects_made: u64,
    /// How long it was waited for so far.
    waited: Duration,
    /// How the wait has ended. After an error the device is not asked again.
    done: Option<Result<(), GpuError>>,
}

impl InFlight {
    /// Waits for at most `timeout`, and all in all no longer than any frame takes; whether the wait has ended.
    fn wait(&mut self, gpu: &Gpu, timeout: Duration) -> bool {
        if self.done.is_none() {
            let start = Instant::now();
            let timeout = timeout.min(SUBMISSION_TIMEOUT.saturating_sub(self.waited));
            let done = gpu.done_within(self.submission.clone(), timeout);
            self.waited += start.elapsed();
            self.done = match done {
                Ok(true) => Some(gpu.take_failure()),
                Ok(false) if self.waited < SUBMISSION_TIMEOUT => None,
                Ok(false) => Some(Err(GpuError::Lost(format!("a frame takes longer than {SUBMISSION_TIMEOUT:?}")))),
                Err(error) => Some(Err(error)),
            };
        }
        self.done.is_some()
    }

    /// Waits for the frame; what the device has complained of meanwhile is the error.
    fn wait_to_the_end(&mut self, gpu: &Gpu) -> Result<(), RenderError> {
        while !self.wait(gpu, SUBMISSION_TIMEOUT) {}
        Ok(self.done.take().unwrap_or(Ok(()))?)
    }
}

impl Renderer {
    /// Draws all views of a rig and waits for them. Display images and HDR images are drawn apart, each within its own budget: which of
    /// them are asked for together changes neither.
    pub fn render(&mut self, request: FrameRequest<'_>) -> Result<Frame, RenderError> {
        let Some([shown, exact]) = request.outputs() else { return self.render_at_once(request) };
        let shown = self.render_at_once(request.wanted_of_each(&shown))?;
        let exact = self.render_at_once(request.wanted_of_each(&exact))?;
        // They are one frame to whoever asked.
        self.frames -= 1;
        Ok(shown.with_hdr_of(exact))
    }

    fn render_at_once(&mut self, request: FrameRequest<'_>) -> Result<Frame, RenderError> {
        let submitted = self.submit(request)?;
        self.finish(submitted)
    }

    /// Checks and holds all that a frame takes and that does not depend on where eyes stand and look: stars, fields of asteroids,
    /// kernels and point-spread functions, and the map of the glaring sky for views like those of the last frame.
    /// [`Renderer::submit`] does it too; what is held already takes no time there, so call this before the poses of a headset are
    /// asked for.
    ///
    /// Frames in flight are not disturbed.
    pub fn hold(&mut self, snapshot: &SceneSnapshot, settings: &RenderSettings) -> Result<(), RenderError> {
        self.planners[0].check(snapshot, settings, &self.limits)?;
        self.hold_scene(0, snapshot, settings)?;
        self.holding(0, snapshot, settings, |technique, holding| {
            technique.warm(holding);
            Ok(())
        })?;
        self.forget_what_failed()
    }

    pub(super) fn hold_scene(
        &mut self,
        slot: usize,
        snapshot: &SceneSnapshot,
        settings: &RenderSettings,
    ) -> Result<(), RenderError> {
        let held = self.holding(slot, snapshot, settings, |technique, holding| technique.hold(holding));
        // Whatever could not be made or filled must not be used again.
        held.inspect_err(|_| self.forget_buffers())
    }

    /// What the driver has refused since it was last asked is the error; then whatever could not be made or filled must not be used
    /// again.
    pub(super) fn forget_what_failed(&mut self) -> Result<(), RenderError> {
        self.gpu.take_failure().inspect_err(|_| self.forget_buffers())?;
        Ok(())
    }

    /// The first half of [`Renderer::render`]: hands the frame to the device and does not wait for it. Where HDR images are asked for, display
    /// images of the same frame are drawn as exactly. With metering by `spot`, and no exposure to adapt from, the meter's small picture is waited
    /// for.
    ///
    /// Two frames may be in flight, and are finished in the order of their submission. If two are in flight already, this waits for
    /// the older one and throws it away, and finishing it later is [`RenderError::Abandoned`]. Had the device failed in it, that is
    /// the error here.
    ///
    /// # Errors
    ///
    /// The request cannot be drawn, or the driver refuses its commands. Frames in flight are not concerned.
    pub fn submit(&mut self, request: FrameRequest<'_>) -> Result<SubmittedFrame, RenderError> {
        let start = Instant::now();
        let made = self.gpu.made();
        let FrameRequest { scene: snapshot, rig, settings, presentations, .. } = request;
        let wanted = request.wanted_views();
        self.limits.check(rig)?;
        if wanted.len() != rig.views().len() {
            return Err(RenderError::WantedCount { given: wanted.len(), views: rig.views().len() });
        }
        check_presentations(rig, presentations)?;
        if self.in_flight.len() >= MOST_IN_FLIGHT {
            self.abandon_oldest()?;
        }
        let series = self.keep_series(&request);
        let views: Vec<bool> = wanted.iter().map(|wanted| *wanted != Wanted::default()).collect();
        // Presentations name viewports of the whole rig.
        let some = presentations.is_empty() && views.contains(&true);
        let sky = if request.sky_map == SkyMapUse::Off { SkyUse::StarByStar } else { SkyUse::Map };
        let Metered { exposure, adapted_ev100, buffer: metered } = self.meter_for(&request, series)?;
        let outputs = PlanOutputs { output: request.output(), views: some.then_some(&views[..]), sky, exposure };
        let planner = &mut self.planners[series.slot];
        let mut plan = planner.plan(snapshot, rig, settings, adapted_ev100, outputs, &self.limits)?;
        self.hold_tables(&plan.viewports)?;
        self.hold_scene(series.slot, snapshot, settings)?;
        if !self.draw_sky(&plan, snapshot, settings, request.sky_map, series)? {
            let outputs = PlanOutputs { sky: SkyUse::StarByStar, ..outputs };
            let planner = &mut self.planners[series.slot];
            plan = planner.plan(snapshot, rig, settings, adapted_ev100, outputs, &self.limits)?;
        }
        let outputs = Outputs { wanted: &wanted, presentations };
        let inputs = FrameInputs {
            plan: &plan,
            scene: snapshot,
            settings,
            outputs,
            catalogue_order: self.catalogue_order,
            series,
            metered: metered.as_ref(),
        };
        let mut slot = self.spare_slots.pop().unwrap_or_else(|| FrameSlot::new(&self.gpu));
        let (commands, places) = self.record(&inputs, rig.views().len(), &mut slot);
        let plan_ms = start.elapsed().as_secs_f64() * 1e3;
        let submission = self.gpu.queue.submit([commands]);
        slot.readback.map(&self.gpu);
        // The driver complains at once, so the complaint is about this frame and none that is still being drawn.
        self.forget_what_failed()?;
        let token = Arc::new(());
        self.in_flight.push_back(InFlight {
            token: Arc::clone(&token),
            submission,
            slot,
            plan,
            places,
            views: rig.views().iter().map(|view| view.name.clone()).collect(),
            projectors: rig.views().iter().map(|view| view.kind.projector().cloned()).collect(),
            scene_revision: snapshot.revision,
            camera_revision: snapshot.camera.revision,
            plan_ms,
            submit_ms: start.elapsed().as_secs_f64() * 1e3,
            objects_made: self.gpu.made().since(&made).all(),
            waited: Duration::ZERO,
            done: None,
        });
        Ok(SubmittedFrame { token })
    }

    /// Draws what is missing of the map of faint light that a plan reads, or a part of it; whether all of it is there now.
    fn draw_sky(
        &mut self,
        plan: &Plan,
        snapshot: &SceneSnapshot,
        settings: &RenderSettings,
        sky_map: SkyMapUse,
        series: Series,
    ) -> Result<bool, RenderError> {
        let missing: Vec<SkyFace> =
            self.techniques.iter().flat_map(|technique| technique.missing(plan, snapshot, series)).collect();
        let most = if sky_map == SkyMapUse::InTurn { 1 } else { usize::MAX };
        for face in missing.iter().take(most) {
            self.draw_sky_face(face, snapshot, settings, series)?;
        }
        let is_whole = missing.len() <= most;
        if is_whole {
            self.sky_targets = None;
        }
        Ok(is_whole)
    }

    fn draw_sky_face(
        &mut self,
        face: &SkyFace,
        snapshot: &SceneSnapshot,
        settings: &RenderSettings,
        series: Series,
    ) -> Result<(), RenderError> {
        let camera = Camera { position_m: face.map.camera_m(), ..Camera::default() };
        let sky = SceneSnapshot { objects: Arc::default(), camera, ..snapshot.clone() };
        let rig = face.rig().map_err(PlanError::from)?;
        let settings = face.settings(settings);
        let outputs = PlanOutputs { sky: SkyUse::Face(*face), ..PlanOutputs::new(Output::Hdr) };
        let plan = self.planners[series.slot].plan(&sky, &rig, &settings, None, outputs, &self.limits)?;
        let wanted = [Wanted { hdr_stays: true, ..Wanted::default() }];
        let outputs = Outputs { wanted: &wanted, presentations: &[] };
        let inputs = FrameInputs {
            plan: &plan,
            scene: &sky,
            settings: &settings,
            outputs,
            catalogue_order: None,
            series,
            metered: None,
        };
        // Nothing is read back of it.
        let mut slot = FrameSlot::new(&self.gpu);
        let targets = self.sky_targets.take().unwrap_or_else(|| Targets::new(&self.gpu));
        let of_frames = mem::replace(&mut self.targets, targets);
        let (commands, _) = self.record(&inputs, 1, &mut slot);
        self.sky_targets = Some(mem::replace(&mut self.targets, of_frames));
        self.gpu.queue.submit([commands]);
        self.forget_what_failed()
    }

    /// Uploads what changes from frame to frame, and records all phases and the copies of what leaves the GPU.
    pub(super) fn record(
        &mut self,
        inputs: &FrameInputs<'_>,
        views: usize,
        slot: &mut FrameSlot,
    ) -> (wgpu::CommandBuffer, Places) {
        let Self { gpu, techniques, targets, tables, .. } = self;
        let FrameSlot { timer, readback } = slot;
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
        let found = self.in_flight.iter().position(|in_flight| Arc::ptr_eq(&in_flight.token, &submitted.token));
        let in_flight = found.and_then(|index| self.in_flight.remove(index)).ok_or(RenderError::Abandoned)?;
        self.take_back(in_flight)
    }

    /// [`Renderer::finish`] for the frame that was submitted first.
    pub fn finish_oldest(&mut self) -> Result<Frame, RenderError> {
        let in_flight = self.in_flight.pop_front().ok_or(RenderError::Abandoned)?;
        self.take_back(in_flight)
    }

    /// Waits for the frame that was submitted first, for at most `timeout`; whether finishing it takes no more waiting.
    pub fn oldest_done_within(&mut self, timeout: Duration) -> bool {
        self.in_flight.front_mut().is_none_or(|in_flight| in_flight.wait(&self.gpu, timeout))
    }

    fn take_back(&mut self, mut in_flight: InFlight) -> Result<Frame, RenderError> {
        let waited_before = in_flight.waited;
        let start = Instant::now();
        let read = in_flight.wait_to_the_end(&self.gpu).and_then(|()| self.read(&mut in_flight));
        let InFlight { plan_ms, submit_ms, .. } = in_flight;
        let mut frame = self.end(in_flight.slot, read)?;
        self.frames += 1;
        frame.number = self.frames;
        frame.scene_revision = in_flight.scene_revision;
        frame.camera_revision = in_flight.camera_revision;
        frame.times.plan_ms = plan_ms;
        frame.times.objects_made = in_flight.objects_made;
        frame.times.total_ms = submit_ms + (waited_before + start.elapsed()).as_secs_f64() * 1e3;
        frame.times.gpu_and_readback_ms = frame.times.total_ms - plan_ms;
        Ok(frame)
    }

    /// Waits for the oldest frame in flight, if there is one, and throws it away.
    pub(super) fn abandon_oldest(&mut self) -> Result<(), RenderError> {
        let Some(mut in_flight) = self.in_flight.pop_front() else { return Ok(()) };
        let waited = in_flight.wait_to_the_end(&self.gpu);
        self.end(in_flight.slot, waited)
    }

    /// Keeps the slot of a frame for later ones, unless the device has failed in it.
    fn end<T>(&mut self, mut slot: FrameSlot, result: Result<T, RenderError>) -> Result<T, RenderError> {
        if let Err(RenderError::Gpu(error)) = &result {
            if matches!(error, GpuError::Lost(_)) {
                // Nor will the others ever be done.
                self.in_flight.clear();
            }
            // Whatever could not be made or filled must not be used again.
            self.forget_buffers();
        } else {
            slot.readback.unmap(&self.gpu);
            self.spare_slots.push(slot);
        }
        result
    }
}
