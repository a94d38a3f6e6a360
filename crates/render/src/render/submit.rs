//! Frames in two halves: [`Renderer::submit`] plans, records and submits the commands; [`Renderer::finish`] waits for them and reads the results
//! back. [`Renderer::render`] does both.
//!
//! Two frames may be in flight: the next one is planned and recorded while the device draws the previous one. They
//! share buffers on the device: writes and submissions are executed in the order of the calls, and each frame copies
//! its results for readback in its own submission. The host keeps separate data for each frame until it is finished
//! (`FrameSlot`).

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
    plan::{
        Limits, Output, Plan, PlanError, PlanOutputs, Planner, SkyUse,
        settings::RenderSettings,
        smooth_light::{PICTURES_AT_ONCE, SkyLayout, SkyPart},
        stars::deep::Residual,
    },
    scene::{Camera, SceneSnapshot},
    view::projector::ProjectorOutput,
};

/// Maximum number of frames in flight.
const MOST_IN_FLIGHT: usize = 2;
/// Maximum number of times that a frame is planned again after stars have been read for it. Damaged stars stay missing.
const MOST_PLANS: usize = 3;

/// A frame submitted to the device. Pass it to [`Renderer::finish`] to get its result. If it is dropped, later frames
/// of the renderer wait for it and discard it.
#[must_use = "a frame that is not finished is discarded"]
pub struct SubmittedFrame {
    /// Identity of the frame.
    token: Arc<()>,
}

/// Host data of one frame in flight. A later frame reuses it.
pub(super) struct FrameSlot {
    pub(super) timer: GpuTimer,
    pub(super) readback: ReadbackBuffer,
}

impl FrameSlot {
    pub(super) fn new(gpu: &Gpu) -> Self {
        Self { timer: GpuTimer::new(gpu), readback: ReadbackBuffer::new("readback") }
    }
}

/// A frame that the device is drawing.
pub(super) struct InFlight {
    token: Arc<()>,
    submission: wgpu::SubmissionIndex,
    pub(super) slot: FrameSlot,
    pub(super) plan: Plan,
    pub(super) places: Places,
    /// Names of the views.
    pub(super) views: Vec<String>,
    /// Projector corrections of the views.
    pub(super) projectors: Vec<Option<Arc<ProjectorOutput>>>,
    scene_revision: u64,
    camera_revision: u64,
    plan_ms: f64,
    submit_ms: f64,
    objects_made: u64,
    /// Time for which the caller has waited so far.
    waited: Duration,
    /// Result of the wait. After an error the device is not polled again.
    done: Option<Result<(), GpuError>>,
}

impl InFlight {
    /// Waits for at most `timeout`, and for at most [`SUBMISSION_TIMEOUT`] in total. Returns whether the wait has ended.
    fn wait(&mut self, gpu: &Gpu, timeout: Duration) -> bool {
        if self.done.is_none() {
            let start = Instant::now();
            let timeout = timeout.min(SUBMISSION_TIMEOUT.saturating_sub(self.waited));
            let done = gpu.done_within(self.submission.clone(), timeout);
            self.waited += start.elapsed();
            self.done = match done {
                Ok(true) => Some(gpu.take_failure()),
                Ok(false) if self.waited < SUBMISSION_TIMEOUT => None,
                Ok(false) => Some(Err(GpuError::Lost(format!("a frame takes more than {SUBMISSION_TIMEOUT:?}")))),
                Err(error) => Some(Err(error)),
            };
        }
        self.done.is_some()
    }

    /// Waits for the frame. If the device has reported an error meanwhile, returns that error.
    fn wait_to_the_end(&mut self, gpu: &Gpu) -> Result<(), RenderError> {
        while !self.wait(gpu, SUBMISSION_TIMEOUT) {}
        Ok(self.done.take().unwrap_or(Ok(()))?)
    }
}

impl Renderer {
    /// Draws all views of a rig and waits for them. Display images and HDR images are drawn separately, each within its own error budget. So neither
    /// changes if both are requested at once.
    pub fn render(&mut self, request: FrameRequest<'_>) -> Result<Frame, RenderError> {
        let Some([display, exact]) = request.outputs() else { return self.render_at_once(request) };
        let display = self.render_at_once(request.wanted_per_view(&display))?;
        let exact = self.render_at_once(request.wanted_per_view(&exact))?;
        // For the caller, the two count as one frame.
        self.frames -= 1;
        Ok(display.with_hdr_of(exact))
    }

    fn render_at_once(&mut self, request: FrameRequest<'_>) -> Result<Frame, RenderError> {
        let submitted = self.submit(request)?;
        self.finish(submitted)
    }

    /// Checks and uploads everything for a frame that does not depend on the positions and directions of the eyes: stars, asteroid fields, kernels
    /// and point-spread functions, and the glare map for views like those of the last frame. [`Renderer::submit`] does the same, but takes no time
    /// for data that is already uploaded. Therefore call this before you request the poses of a headset.
    ///
    /// Frames in flight are not disturbed.
    pub fn hold(&mut self, snapshot: &SceneSnapshot, settings: &RenderSettings) -> Result<(), RenderError> {
        self.planners[0].check(snapshot, settings, &self.limits)?;
        self.hold_scene(0, snapshot, settings)?;
        self.holding(0, snapshot, settings, |technique, holding| {
            technique.warm(holding);
            Ok(())
        })?;
        self.check_driver_errors()
    }

    pub(super) fn hold_scene(
        &mut self,
        slot: usize,
        snapshot: &SceneSnapshot,
        settings: &RenderSettings,
    ) -> Result<(), RenderError> {
        let held = self.holding(slot, snapshot, settings, |technique, holding| technique.hold(holding));
        // Buffers that could not be created or filled must not be used again.
        held.inspect_err(|_| self.forget_buffers())
    }

    /// Returns an error that the driver has reported since the last call. In that case, buffers that could not be
    /// created or filled are released.
    pub(super) fn check_driver_errors(&mut self) -> Result<(), RenderError> {
        self.gpu.take_failure().inspect_err(|_| self.forget_buffers())?;
        Ok(())
    }

    /// The first half of [`Renderer::render`]: submits the frame to the device without waiting for it. If HDR images
    /// are requested, the display images of the same frame are drawn with the same accuracy. With `spot` metering and
    /// without an exposure to adapt from, this waits for the meter's small picture.
    ///
    /// Two frames may be in flight; finish them in the order of their submission. If two are in flight already, this waits for the older one and
    /// discards it. A later call of `finish` for that frame returns [`RenderError::Abandoned`]. If the device failed while it drew that frame, this
    /// returns the error.
    ///
    /// # Errors
    ///
    /// The request cannot be drawn, or the driver rejects its commands. Frames in flight are not affected.
    pub fn submit(&mut self, request: FrameRequest<'_>) -> Result<SubmittedFrame, RenderError> {
        let start = Instant::now();
        let made = self.gpu.made();
        let FrameRequest { scene: snapshot, rig, settings, presentations, .. } = request;
        let wanted = request.wanted_views();
        // Check the request and make room in the queue of frames.
        self.limits.check(rig)?;
        if wanted.len() != rig.views().len() {
            return Err(RenderError::WantedCount { given: wanted.len(), views: rig.views().len() });
        }
        check_presentations(rig, presentations)?;
        if self.in_flight.len() >= MOST_IN_FLIGHT {
            self.abandon_oldest()?;
        }
        // Work for a later scene: upload a layer of an atlas, and create a few pipelines.
        self.baked.upload_one(&self.gpu);
        self.create_some_ahead();
        // Plan the frame. Its exposure may need a meter.
        let series = self.keep_series(&request);
        let views: Vec<bool> = wanted.iter().map(|wanted| *wanted != Wanted::default()).collect();
        // Presentations refer to viewports of the whole rig, so all views are drawn if there are presentations.
        let some = presentations.is_empty() && views.contains(&true);
        let sky = if request.sky_map == SkyMapUse::Off { SkyUse::StarByStar } else { SkyUse::Map };
        let Metered { exposure, adapted_ev100, buffer: metered } = self.meter_for(&request, series)?;
        let outputs = PlanOutputs { output: request.output(), views: some.then_some(&views[..]), sky, exposure };
        let slot = series.slot;
        let waits = request.sky_map != SkyMapUse::InTurn;
        let plan_frame = |own: &mut Self, outputs| {
            own.planners[slot].streams_stars = waits;
            plan_with_stars((&mut own.planners[slot], &own.limits), waits, |planner, limits| {
                planner.plan(snapshot, rig, settings, adapted_ev100, outputs, limits)
            })
        };
        let mut plan = plan_frame(self, outputs)?;
        // Upload resident data. If the map of faint light is incomplete, plan again without it.
        self.hold_tables(&plan.views.viewports)?;
        self.hold_scene(series.slot, snapshot, settings)?;
        if !self.draw_sky(&mut plan, snapshot, settings, request.sky_map, series)? {
            let outputs = PlanOutputs { sky: SkyUse::StarByStar, ..outputs };
            plan = plan_frame(self, outputs)?;
        }
        // Record and submit.
        let outputs = Outputs { wanted: &wanted, presentations };
        let inputs = FrameInputs {
            plan: &plan,
            scene: snapshot,
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
        // The driver reports errors of a submission at once, so the error belongs to this frame and not to an earlier one that is in flight.
        self.check_driver_errors()?;
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

    /// Draws the missing pictures of the map of faint light, or some of them, and records in the plan which stars they lack. Returns whether the map
    /// is complete.
    fn draw_sky(
        &mut self,
        plan: &mut Plan,
        snapshot: &SceneSnapshot,
        settings: &RenderSettings,
        sky_map: SkyMapUse,
        series: Series,
    ) -> Result<bool, RenderError> {
        let in_turn = sky_map == SkyMapUse::InTurn;
        let is_new = self.techniques.iter().any(|technique| technique.is_new_map(plan, series));
        let Self { techniques, gpu, .. } = self;
        let parts: Vec<SkyPart> =
            techniques.iter_mut().flat_map(|technique| technique.map_parts(gpu, plan, snapshot, series)).collect();
        let Some(map) = &plan.smooth_light.map else {
            self.sky_targets = None;
            return Ok(true);
        };
        let is_whole = matches!(map.map.layout, SkyLayout::Whole { .. });
        let most = match map.map.layout {
            SkyLayout::Whole { .. } if in_turn => 1,
            // A new map is not begun if the next frame may no longer read it, as in a zoom.
            SkyLayout::Pieces(_) if in_turn && is_new => 0,
            // Drawing the pieces in view takes hardly longer than drawing their stars in the frame.
            SkyLayout::Whole { .. } | SkyLayout::Pieces(_) => usize::MAX,
        };
        for part in parts.iter().take(most) {
            self.draw_sky_part(part, snapshot, settings, sky_map, series)?;
        }
        let mut is_drawn = true;
        for technique in &self.techniques {
            let state = technique.map_state(plan, series);
            is_drawn &= state.is_drawn;
            if state.lack != Residual::default() {
                plan.state_missing_stars(state.lack);
            }
        }
        // New pieces come into view continually.
        if is_whole && is_drawn {
            self.sky_targets = None;
        }
        Ok(is_drawn)
    }

    /// Draws pictures of the map. Pictures of the whole sky are drawn only after all of their stars have been read.
    fn draw_sky_part(
        &mut self,
        part: &SkyPart,
        snapshot: &SceneSnapshot,
        settings: &RenderSettings,
        sky_map: SkyMapUse,
        series: Series,
    ) -> Result<(), RenderError> {
        let camera = Camera { position_m: part.map.camera_m(), ..Camera::default() };
        let sky = SceneSnapshot { objects: Arc::default(), camera, ..snapshot.clone() };
        let rig = part.rig().map_err(PlanError::from)?;
        let settings = part.settings(settings);
        let outputs = PlanOutputs { sky: SkyUse::Part(*part), ..PlanOutputs::new(Output::Hdr) };
        let waits = sky_map != SkyMapUse::InTurn;
        (self.map_planner.culling, self.map_planner.unit_factor) = (self.culling, self.unit_factor);
        let planned = plan_with_stars((&mut self.map_planner, &self.limits), waits, |planner, limits| {
            planner.plan(&sky, &rig, &settings, None, outputs, limits)
        });
        let plan = match planned {
            // The frame draws coarser stars itself.
            Err(PlanError::DeepMemory { .. }) => return Ok(()),
            planned => planned?,
        };
        if !plan.stars.deep.missing.is_empty() && matches!(part.map.layout, SkyLayout::Whole { .. }) {
            return Ok(());
        }
        let wanted = [Wanted { hdr_stays: true, ..Wanted::default() }; PICTURES_AT_ONCE];
        let wanted = &wanted[..part.pictures().len()];
        let outputs = Outputs { wanted, presentations: &[] };
        let inputs = FrameInputs { plan: &plan, scene: &sky, outputs, catalogue_order: None, series, metered: None };
        // No data is read back.
        let mut slot = FrameSlot::new(&self.gpu);
        let targets = self.sky_targets.take().unwrap_or_else(|| Targets::new(&self.gpu));
        let frame_targets = mem::replace(&mut self.targets, targets);
        let (commands, _) = self.record(&inputs, wanted.len(), &mut slot);
        self.sky_targets = Some(mem::replace(&mut self.targets, frame_targets));
        self.gpu.queue.submit([commands]);
        self.check_driver_errors()
    }

    /// Uploads the data of a frame, and records all phases and the copies for readback.
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

    /// The second half of [`Renderer::render`]: waits for the frame and reads back the requested images.
    pub fn finish(&mut self, submitted: SubmittedFrame) -> Result<Frame, RenderError> {
        let found = self.in_flight.iter().position(|in_flight| Arc::ptr_eq(&in_flight.token, &submitted.token));
        let in_flight = found.and_then(|index| self.in_flight.remove(index)).ok_or(RenderError::Abandoned)?;
        self.take_back(in_flight)
    }

    /// Same as [`Renderer::finish`], for the frame that was submitted first.
    pub fn finish_oldest(&mut self) -> Result<Frame, RenderError> {
        let in_flight = self.in_flight.pop_front().ok_or(RenderError::Abandoned)?;
        self.take_back(in_flight)
    }

    /// Waits for at most `timeout` for the frame that was submitted first. Returns whether it can be finished without
    /// waiting.
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

    /// Waits for the oldest frame in flight, if any, and discards it.
    pub(super) fn abandon_oldest(&mut self) -> Result<(), RenderError> {
        let Some(mut in_flight) = self.in_flight.pop_front() else { return Ok(()) };
        let waited = in_flight.wait_to_the_end(&self.gpu);
        self.end(in_flight.slot, waited)
    }

    /// Keeps the slot of a frame for reuse, unless the device failed.
    fn end<T>(&mut self, mut slot: FrameSlot, result: Result<T, RenderError>) -> Result<T, RenderError> {
        if let Err(RenderError::Gpu(error)) = &result {
            if matches!(error, GpuError::Lost(_)) {
                // The other frames will never finish either.
                self.in_flight.clear();
            }
            // Buffers that could not be created or filled must not be used again.
            self.forget_buffers();
        } else {
            slot.readback.unmap(&self.gpu);
            self.spare_slots.push(slot);
        }
        result
    }
}

/// Plans a frame. If the frame waits for the stars of a deep store, this reads the missing ones and plans the frame again. The new plan may need
/// other stars: once all bright stars are in memory, a map of faint light may turn out not to be worth its cost.
fn plan_with_stars(
    (planner, limits): (&mut Planner, &Limits),
    waits: bool,
    make: impl Fn(&mut Planner, &Limits) -> Result<Plan, PlanError>,
) -> Result<Plan, PlanError> {
    let mut plan = make(planner, limits)?;
    for _ in 0..MOST_PLANS {
        let deep = &plan.stars.deep;
        let Some(sky) = deep.sky.as_ref().filter(|_| waits && !deep.missing.is_empty()) else { break };
        // The next plan reports damaged pages as an error, unless the settings skip them.
        if let Err(error) = sky.load(&deep.missing) {
            tracing::debug!("the frame lacks stars: {error}");
        }
        plan = make(planner, limits)?;
    }
    Ok(plan)
}
