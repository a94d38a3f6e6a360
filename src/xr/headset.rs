//! A headset: one session of the runtime, from its creation to its loss, and its frames.

use std::{
    mem, thread,
    time::{Duration, Instant, SystemTime},
};

use glam::{DQuat, DVec3};
use openxr as xr;

use super::{
    capture::{CapturedImage, capture},
    error::{During, XrError},
    eyes::{eye_from_view, fov_of, head, rig_of},
    flight::flight,
    host::{Host, MirroredFrame, Shown, Status},
    input::Input,
    recorder::{FrameTimings, Recorder},
    runtime::{Runtime, STEREO},
    swapchain::Swapchains,
};
use crate::{
    gpu::GpuError,
    plan::{
        adaptation::Adaptation,
        settings::{HeadsetSettings, ReferenceSpace},
    },
    render::{FrameRequest, Presentation, RenderError, Renderer, SkyMapUse, SubmittedFrame, Wanted},
    scene::Camera,
    view::{Eye, Fov},
};

/// Interval at which the events of a session that shows nothing are polled.
const IDLE_INTERVAL: Duration = Duration::from_millis(5);

/// Maximum time that the device may take to finish when the connection ends.
const LAST_WORK: Duration = Duration::from_secs(10);
/// Typical field of view of an eye in a headset.
const USUAL_FOV: Fov = Fov { left_rad: -0.8, right_rad: 0.8, up_rad: 0.8, down_rad: -0.8 };

/// Result of a step.
#[derive(Clone, Debug)]
pub enum Step {
    /// The session currently shows nothing.
    Idle,
    /// The runtime requested a frame and has received it.
    Frame(Box<HeadsetFrame>),
    /// The host wants no more frames.
    HostEnded,
    /// The session was ended by the wearer, or on request.
    Exited,
}

/// A frame as submitted to the runtime.
#[derive(Clone, Debug)]
pub struct HeadsetFrame {
    /// Time at which the runtime expects to show it, ns of its clock.
    pub display_time_ns: i64,
    /// Left and right eye as drawn; `None`: the runtime did not want the frame or did not know the pose of the head, or
    /// the scene could not be drawn.
    pub eyes: Option<[Eye; 2]>,
    /// Contents of the swapchain images on release, if requested.
    pub captured: Option<[CapturedImage; 2]>,
}

/// A frame that the device is working on.
struct InFlight {
    submitted: SubmittedFrame,
    wanted: Wanted,
    pose_time: SystemTime,
    camera: Camera,
}

/// A session with a headset. Fields are dropped in this order, so each one precedes those that it depends on.
pub struct Headset {
    swapchains: Swapchains,
    input: Input,
    space: xr::Space,
    stream: xr::FrameStream<xr::Vulkan>,
    waiter: xr::FrameWaiter,
    session: xr::Session<xr::Vulkan>,
    in_flight: Option<InFlight>,
    renderer: Renderer,
    runtime: Runtime,

    settings: HeadsetSettings,
    blend_mode: xr::EnvironmentBlendMode,
    state: xr::SessionState,
    running: bool,
    recorder: Recorder,
    adaptation: Adaptation,
    /// Pose of the head in the room at the last frame.
    head: (DVec3, DQuat),
    /// Reason why frames are left out.
    problem: Option<String>,
    /// Display time of the last drawn frame, ns of the runtime's clock.
    last_drawn_ns: Option<i64>,
    /// Whether a scene that cannot be drawn makes the step fail; otherwise frames are left out until the scene can be drawn.
    pub fails: bool,
    /// Whether frames are read back from the swapchain before their release: for tests, because it is slow.
    pub captures: bool,
}

impl Headset {
    /// Finds the runtime and its headset, has the runtime open a device, and creates a session. The statistics continue those of `recorder`.
    ///
    /// # Errors
    ///
    /// A requirement is missing, or a call fails.
    pub fn connect(settings: &HeadsetSettings, recorder: Recorder) -> Result<Self, XrError> {
        let runtime = Runtime::find()?;
        // Choose the blend mode: opaque if the runtime supports it.
        let modes = runtime.instance.enumerate_environment_blend_modes(runtime.system, STEREO);
        let modes = modes.during("xrEnumerateEnvironmentBlendModes")?;
        let opaque = xr::EnvironmentBlendMode::OPAQUE;
        let blend_mode = modes.iter().copied().find(|mode| *mode == opaque).or(modes.first().copied());
        let blend_mode = blend_mode.ok_or_else(|| XrError::Unsuitable {
            runtime: runtime.name.clone(),
            problem: "it has no blend mode to show an image with".to_owned(),
        })?;
        // Open the device, the session and its reference space.
        let (gpu, handles) = runtime.open_gpu()?;
        let renderer = Renderer::new(gpu);
        let (session, waiter, stream) = runtime.open_session(&handles)?;
        let kind = match settings.reference_space {
            ReferenceSpace::Local => xr::ReferenceSpaceType::LOCAL,
            ReferenceSpace::Stage => xr::ReferenceSpaceType::STAGE,
        };
        let kinds = session.enumerate_reference_spaces().during("xrEnumerateReferenceSpaces")?;
        if !kinds.contains(&kind) {
            let problem = format!("it has no reference space {kind:?}, only {kinds:?}: see headset.reference_space");
            return Err(XrError::Unsuitable { runtime: runtime.name, problem });
        }
        let space = session.create_reference_space(kind, xr::Posef::IDENTITY).during("xrCreateReferenceSpace")?;
        // Create the actions and the swapchains.
        let input = Input::attach(&session)?;
        let swapchains = Swapchains::new(&runtime, &session, renderer.gpu(), settings)?;
        let mut recorder = recorder;
        recorder.session();
        tracing::info!(
            "headset: {} of {}, on {}; {} of {:?} px, {:?}",
            runtime.system_name,
            runtime.name,
            renderer.adapter().adapter,
            if swapchains.is_array() { "a swapchain with two layers" } else { "two swapchains" },
            swapchains.sizes,
            swapchains.format,
        );
        Ok(Self {
            swapchains,
            input,
            space,
            stream,
            waiter,
            session,
            in_flight: None,
            renderer,
            runtime,
            settings: settings.clone(),
            blend_mode,
            state: xr::SessionState::UNKNOWN,
            running: false,
            recorder,
            adaptation: Adaptation::default(),
            head: (DVec3::ZERO, DQuat::IDENTITY),
            problem: None,
            last_drawn_ns: None,
            fails: false,
            captures: false,
        })
    }

    /// Returns the current status.
    pub fn status(&self) -> Status {
        Status::Connected {
            runtime: self.runtime.name.clone(),
            system: self.runtime.system_name.clone(),
            state: state_name(self.state),
            sizes: self.swapchains.sizes,
            adapter: self.renderer.adapter().adapter.clone(),
            problem: self.problem.clone(),
        }
    }

    /// Returns the statistics so far.
    pub fn recorder(&self) -> &Recorder {
        &self.recorder
    }

    /// Ends the connection and returns the statistics.
    pub fn close(mut self) -> Recorder {
        mem::take(&mut self.recorder)
    }

    /// Asks the runtime to end the session; the next steps continue until one returns [`Step::Exited`].
    ///
    /// # Errors
    ///
    /// The call fails, for instance if the session is not running.
    pub fn request_exit(&self) -> Result<(), XrError> {
        self.session.request_exit().during("xrRequestExitSession")
    }

    /// Carries out the runtime's next request: follows the states of the session, and renders a frame if one is due. Blocks while the runtime paces
    /// the frames.
    ///
    /// # Errors
    ///
    /// The runtime, the session or the device is lost: reconnect.
    pub fn step(&mut self, host: &dyn Host) -> Result<Step, XrError> {
        if self.follow_events(host)? {
            return Ok(Step::Exited);
        }
        if !self.running {
            // Finish a frame in flight now, because no other frame follows it.
            self.finish(host)?;
            thread::sleep(IDLE_INTERVAL);
            return Ok(Step::Idle);
        }
        self.frame(host)
    }

    /// Handles the runtime's events; returns whether the session has ended.
    fn follow_events(&mut self, host: &dyn Host) -> Result<bool, XrError> {
        let mut buffer = xr::EventDataBuffer::new();
        while let Some(event) = self.runtime.instance.poll_event(&mut buffer).during("xrPollEvent")? {
            match event {
                xr::Event::SessionStateChanged(changed) => {
                    self.state = changed.state();
                    tracing::info!("headset: the session is {}", state_name(self.state));
                    match self.state {
                        xr::SessionState::READY => {
                            self.warm_up(host)?;
                            self.session.begin(STEREO).during("xrBeginSession")?;
                            self.running = true;
                        }
                        xr::SessionState::STOPPING => {
                            self.session.end().during("xrEndSession")?;
                            self.running = false;
                            self.recorder.pause();
                        }
                        xr::SessionState::EXITING => return Ok(true),
                        xr::SessionState::LOSS_PENDING => return Err(XrError::LossPending),
                        _ => {}
                    }
                }
                xr::Event::InstanceLossPending(_) => return Err(XrError::LossPending),
                xr::Event::ReferenceSpaceChangePending(_) => {
                    tracing::info!("headset: the room's origin moves");
                    self.recorder.recentred();
                }
                xr::Event::EventsLost(lost) => {
                    tracing::warn!("headset: {} events of the runtime were lost", lost.lost_event_count());
                }
                _ => {}
            }
        }
        Ok(false)
    }

    /// Draws an invisible frame, so that shaders are compiled, stars uploaded and impostors baked before the session
    /// begins: until then the runtime shows its own environment instead of a frozen picture.
    fn warm_up(&mut self, host: &dyn Host) -> Result<(), XrError> {
        self.finish(host)?;
        let Some(shown) = host.shown() else { return Ok(()) };
        let usual = |size| Eye { size, fov: USUAL_FOV, room_from_eye: DQuat::IDENTITY, position_m: DVec3::ZERO };
        // If the runtime already reports the fields of view, the map of glare is computed for them, and the first frame need not compute it again.
        let now = self.runtime.now()?;
        let located = now.and_then(|now| self.session.locate_views(STEREO, now, &self.space).ok());
        let located_rig = located
            .filter(|(_, views)| views.len() == 2)
            .map(|(_, views)| [0, 1].map(|eye| Eye { fov: fov_of(&views[eye]), ..usual(self.swapchains.sizes[eye]) }));
        let located_rig = located_rig.and_then(|eyes| rig_of(&self.settings.name, eyes).ok());
        let rig = match located_rig {
            Some(rig) => rig,
            None => {
                rig_of(&self.settings.name, self.swapchains.sizes.map(usual)).map_err(|error| self.unsuitable(error))?
            }
        };
        let format = self.swapchains.format;
        let gpu = self.renderer.gpu();
        let targets = self.swapchains.sizes.map(|[width, height]| {
            let texture = gpu.device.create_texture(&wgpu::TextureDescriptor {
                label: Some("warm-up"),
                size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
                mip_level_count: 1,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D2,
                format,
                usage: wgpu::TextureUsages::RENDER_ATTACHMENT,
                view_formats: &[],
            });
            texture.create_view(&wgpu::TextureViewDescriptor::default())
        });
        let presentation = |viewport| Presentation { viewport, target: &targets[viewport], format };
        let presentations = [presentation(0), presentation(1)];
        let submitted = self.renderer.submit(
            FrameRequest::new(&shown.snapshot, &rig)
                .settings(&shown.settings)
                .wanted(Wanted::default())
                .sky_map(SkyMapUse::Off)
                .presentations(&presentations),
        );
        match submitted.and_then(|submitted| self.renderer.finish(submitted)) {
            Ok(_) => Ok(()),
            Err(error) => self.skip_or_fail(error),
        }
    }

    fn unsuitable(&self, problem: impl ToString) -> XrError {
        XrError::Unsuitable { runtime: self.runtime.name.clone(), problem: problem.to_string() }
    }

    /// Finishes the frame in flight, if there is one, and publishes it to the host.
    fn finish(&mut self, host: &dyn Host) -> Result<(), XrError> {
        let Some(InFlight { submitted, wanted, pose_time, camera }) = self.in_flight.take() else { return Ok(()) };
        match self.renderer.finish(submitted) {
            Ok(frame) => {
                self.problem = None;
                self.adaptation.observe(frame.exposure_ev100, frame.metered_ev100);
                frame.times.gpu_ms.into_iter().for_each(|ms| self.recorder.stage("gpu", ms));
                if wanted.display || wanted.hdr {
                    let render_time = SystemTime::now();
                    host.publish(MirroredFrame { frame: frame.into(), camera, pose_time, render_time });
                }
                Ok(())
            }
            Err(error) => self.skip_or_fail(error),
        }
    }

    /// Leaves out frames that cannot be drawn. Only the loss of the device ends the session.
    fn skip_or_fail(&mut self, error: RenderError) -> Result<(), XrError> {
        if self.fails || matches!(error, RenderError::Gpu(GpuError::Lost(_))) {
            return Err(error.into());
        }
        self.leave_out(error.to_string());
        Ok(())
    }

    /// Logs once why frames are left out.
    fn leave_out(&mut self, problem: String) {
        if self.problem.as_ref() != Some(&problem) {
            tracing::error!("headset: frames are left out: {problem}");
            self.problem = Some(problem);
        }
    }

    /// Renders one frame. Everything that does not depend on the pose of the head precedes the query of the poses, so
    /// that they are recent when the frame is drawn and shown.
    fn frame(&mut self, host: &dyn Host) -> Result<Step, XrError> {
        let mut stages = Stages::begin();
        // Wait for the runtime's pace, then finish the previous frame.
        let state = self.waiter.wait().during("xrWaitFrame")?;
        stages.end("wait");
        let display_ns = state.predicted_display_time.as_nanos();
        let since_last_s =
            self.recorder.frame(display_ns, state.predicted_display_period.as_nanos(), state.should_render);
        self.finish(host)?;
        stages.end("finish_last");
        // Begin the frame and load everything that does not depend on the poses.
        self.stream.begin().during("xrBeginFrame")?;
        let mut made = HeadsetFrame { display_time_ns: display_ns, eyes: None, captured: None };
        let Some(shown) = self.shown(host, since_last_s)? else {
            self.end(state.predicted_display_time, None)?;
            return Ok(Step::HostEnded);
        };
        let held = state.should_render && self.hold(&shown)?;
        stages.end("hold");
        let mut layers = None;
        let mut timings = FrameTimings::default();
        // Query the poses as late as possible and draw both eyes.
        if held {
            self.swapchains.acquire()?;
            stages.end("acquire");
            let wanted = host.mirror();
            let asked = (Instant::now(), SystemTime::now());
            let now = self.runtime.now()?;
            if let Some(views) = self.locate(state.predicted_display_time)? {
                let eyes = [0, 1].map(|eye| eye_from_view(&views[eye], self.swapchains.sizes[eye]));
                let drawn = self.submit(&shown, eyes, wanted, asked.1, display_ns)?;
                timings.pose_age_at_submission_ms = asked.0.elapsed().as_secs_f64() * 1e3;
                timings.pose_age_at_display_ms = now.map(|now| (display_ns - now.as_nanos()) as f64 * 1e-6);
                stages.end("draw");
                if drawn {
                    self.head = head(&eyes);
                    made.eyes = Some(eyes);
                    if self.captures {
                        made.captured = Some(capture(self.renderer.gpu(), &self.swapchains)?);
                    }
                    layers = Some(views);
                }
            }
            self.swapchains.release()?;
        }
        // Submit the layers and record the statistics.
        self.end(state.predicted_display_time, layers.as_ref())?;
        stages.end("end");
        if made.eyes.is_some() {
            timings.stages = stages.times_ms;
            self.recorder.rendered(&timings);
        } else if state.should_render {
            self.recorder.left_out();
        }
        host.statistics(&self.recorder.figures());
        Ok(Step::Frame(Box::new(made)))
    }

    /// Moves the camera as the controllers command, and returns the scene to show; `None` if the host wants no more frames.
    fn shown(&mut self, host: &dyn Host, since_last_s: Option<f64>) -> Result<Option<Shown>, XrError> {
        let Some(shown) = host.shown() else { return Ok(None) };
        let controls = self.input.read(&self.session)?;
        let world_from_room = shown.snapshot.camera.world_from_camera;
        match flight(&controls, since_last_s.unwrap_or(0.0), &self.settings, world_from_room, self.head) {
            Some(flight) => {
                host.fly(&flight);
                Ok(host.shown())
            }
            None => Ok(Some(shown)),
        }
    }

    /// Loads the data that the frame needs; returns false if it cannot be drawn.
    fn hold(&mut self, shown: &Shown) -> Result<bool, XrError> {
        match self.renderer.hold(&shown.snapshot, &shown.settings) {
            Ok(()) => Ok(true),
            Err(error) => self.skip_or_fail(error).map(|()| false),
        }
    }

    /// Returns the predicted views of the eyes; `None`: the runtime does not know the pose of the head.
    fn locate(&mut self, time: xr::Time) -> Result<Option<[xr::View; 2]>, XrError> {
        let (flags, views) = self.session.locate_views(STEREO, time, &self.space).during("xrLocateViews")?;
        // Without positions both eyes would be drawn from one point.
        if !flags.contains(xr::ViewStateFlags::ORIENTATION_VALID | xr::ViewStateFlags::POSITION_VALID) {
            self.leave_out("the runtime does not know where the head is".to_owned());
            return Ok(None);
        }
        match views.as_slice() {
            [left, right] => Ok(Some([*left, *right])),
            _ => Err(self.unsuitable(format!("it locates {} views instead of 2", views.len()))),
        }
    }

    /// Draws both eyes into the acquired images; returns false if they cannot be drawn.
    fn submit(
        &mut self,
        shown: &Shown,
        eyes: [Eye; 2],
        wanted: Wanted,
        pose_time: SystemTime,
        display_ns: i64,
    ) -> Result<bool, XrError> {
        let rig = match rig_of(&self.settings.name, eyes) {
            Ok(rig) => rig,
            Err(error) => {
                self.leave_out(format!("the runtime's fields of view cannot be drawn: {error}"));
                return Ok(false);
            }
        };
        let format = self.swapchains.format;
        let presentation = |eye| Some(Presentation { viewport: eye, target: self.swapchains.target(eye)?, format });
        let presentations: Vec<Presentation<'_>> = [0, 1].into_iter().filter_map(presentation).collect();
        let since_drawn_s = self.last_drawn_ns.map_or(0.0, |last| (display_ns - last) as f64 * 1e-9);
        let adapted = self.adaptation.exposure(since_drawn_s, since_drawn_s, &shown.settings.exposure);
        let submitted = self.renderer.submit(
            FrameRequest::new(&shown.snapshot, &rig)
                .settings(&shown.settings)
                .wanted(wanted)
                .sky_map(SkyMapUse::Off)
                .adapted_ev100(adapted)
                .presentations(&presentations),
        );
        match submitted {
            Ok(submitted) => {
                let camera = shown.snapshot.camera;
                self.in_flight = Some(InFlight { submitted, wanted, pose_time, camera });
                self.last_drawn_ns = Some(display_ns);
                Ok(true)
            }
            Err(error) => self.skip_or_fail(error).map(|()| false),
        }
    }

    /// Submits the frame: a projection layer with the poses and fields of view used for drawing, or nothing.
    fn end(&mut self, time: xr::Time, views: Option<&[xr::View; 2]>) -> Result<(), XrError> {
        let Self { stream, swapchains, space, blend_mode, .. } = self;
        let call = "xrEndFrame";
        let Some(views) = views else { return stream.end(time, *blend_mode, &[]).during(call) };
        let view = |eye: usize| {
            xr::CompositionLayerProjectionView::new()
                .pose(views[eye].pose)
                .fov(views[eye].fov)
                .sub_image(swapchains.sub_image(eye))
        };
        let views = [view(0), view(1)];
        let layer = xr::CompositionLayerProjection::new().space(space).views(&views);
        stream.end(time, *blend_mode, &[&layer]).during(call)
    }
}

impl Drop for Headset {
    fn drop(&mut self) {
        // Images and session must not be dropped while the device uses them. A lost device no longer works on anything.
        if let Err(error) = self.renderer.gpu().wait_at_most(None, LAST_WORK) {
            tracing::warn!("headset: {error}");
        }
    }
}

/// Measures the stages of a frame.
struct Stages {
    last: Instant,
    times_ms: Vec<(&'static str, f64)>,
}

impl Stages {
    fn begin() -> Self {
        Self { last: Instant::now(), times_ms: Vec::new() }
    }

    /// Ends a stage: assigns the time since the end of the previous stage to this name.
    fn end(&mut self, name: &'static str) {
        let now = Instant::now();
        self.times_ms.push((name, (now - self.last).as_secs_f64() * 1e3));
        self.last = now;
    }
}

fn state_name(state: xr::SessionState) -> &'static str {
    match state {
        xr::SessionState::IDLE => "idle",
        xr::SessionState::READY => "ready",
        xr::SessionState::SYNCHRONIZED => "synchronized",
        xr::SessionState::VISIBLE => "visible",
        xr::SessionState::FOCUSED => "focused",
        xr::SessionState::STOPPING => "stopping",
        xr::SessionState::LOSS_PENDING => "about to be lost",
        xr::SessionState::EXITING => "exiting",
        _ => "new",
    }
}
