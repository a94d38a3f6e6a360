//! Creates, on all cores and before the first frame, the pipelines that the scene's objects, the rig and the settings
//! may need.
//!
//! GPU drivers compile a shader when its pipeline is created, on the creating thread. Software drivers compile shaders when they first run, one after
//! the other, on the thread of the queue. For software drivers, compute shaders are compiled in advance on separate devices (`gpu/compile_ahead.rs`),
//! and the other shaders need a warm-up frame ([`Renderer::warm_up`]).

use std::{
    sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError},
    thread::{self, JoinHandle},
    time::{Duration, Instant},
};

use super::{
    FrameRequest, RenderError, Renderer, Wanted,
    technique::{PipelineJob, PipelineWork, Wish},
};
use crate::{
    gpu::CollectedShaders,
    plan::{Forecast, Limits, exposure::origin::ExposureOrigin, settings::RenderSettings, view_settings::FrameGroup},
    scene::{SceneObjects, SceneSnapshot},
    view::{Rig, Viewport},
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

/// The views of a frame, or those of its meter.
struct Picture {
    viewports: Vec<Viewport>,
    forecast: Forecast,
    /// Images to make of these views.
    made: Wanted,
    is_metered: bool,
}

/// Returns the pictures of a frame: its own picture, then that of its meter if the meter draws one.
fn pictures(
    objects: &SceneObjects,
    rig: &Rig,
    settings: &RenderSettings,
    made: Wanted,
    limits: &Limits,
) -> Result<Vec<Picture>, RenderError> {
    let picture = |rig: &Rig, settings: &RenderSettings, made, is_metered| {
        let viewports = rig.viewports(glam::DQuat::IDENTITY);
        let forecast = Forecast::new(settings, objects, &viewports, limits);
        Picture { viewports, forecast, made, is_metered }
    };
    let mut pictures = vec![picture(rig, settings, made, false)];
    match ExposureOrigin::new(rig, settings, false)? {
        ExposureOrigin::Picture { rig, settings } => pictures.push(picture(&rig, &settings, Wanted::default(), true)),
        ExposureOrigin::Own | ExposureOrigin::Plan => {}
    }
    Ok(pictures)
}

/// Names of the jobs that take a software driver longest. They come first, so that no core waits for them at the end.
const LONGEST: [&str; 5] = ["bodies", "bodies and asteroids", "resolve", "plain blocks", "stars"];

/// Runs jobs on as many threads as there are cores, those of [`LONGEST`] first.
fn run(mut jobs: Vec<PipelineJob<'_>>, progress: &mut (dyn FnMut(PrepareStep) + Send)) {
    jobs.sort_by_key(|job| LONGEST.iter().position(|name| *name == job.name).unwrap_or(LONGEST.len()));
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
                    match make {
                        PipelineWork::Apart(make) => make(),
                        PipelineWork::Beside(make) => make(),
                    }
                    let mut progress = progress.lock().unwrap_or_else(PoisonError::into_inner);
                    let (done, progress) = &mut *progress;
                    *done += 1;
                    progress(PrepareStep { name, done: *done, total });
                }
            });
        }
    });
}

/// Time that a frame may spend on creating pipelines of a later scene. Once this time is exceeded, the frame creates no more of them.
const SLICE: Duration = Duration::from_millis(2);
/// If no frame has begun this long after the request, no frames are being drawn.
const FIRST_FRAME: Duration = Duration::from_millis(200);
/// The same limit once a frame has begun. It is longer, because a frame that creates a large pipeline takes more than half a second.
const IDLE: Duration = Duration::from_secs(2);

/// Time without a new frame after which frames are considered at rest.
const REST: Duration = Duration::from_secs(1);
/// Longest time to wait until frames are at rest.
const LONGEST_DELAY: Duration = Duration::from_secs(30);

/// Pipelines that a later scene needs. The renderer creates a few of them with each earlier frame, and creates those that take long on another
/// thread. Clones share the content.
#[derive(Clone)]
pub struct PipelinesAhead(Arc<dyn Opaque>);

impl Default for PipelinesAhead {
    fn default() -> Self {
        Self(Arc::new(AheadShared::default()))
    }
}

/// Shaders of pipelines that a later scene needs.
pub struct ShadersAhead(CollectedShaders);

impl ShadersAhead {
    /// Compiles them; see [`PipelinesAhead::compile`].
    pub fn compile(&self) {
        self.0.compile();
    }
}

/// Hides the content from the compiler. Otherwise, in each asynchronous call that holds the pipelines, the compiler would search all types of the GPU
/// library to see whether threads may share them. That made the check of the daemon's crate 90 s longer.
trait Opaque: Send + Sync {
    fn content(&self) -> &AheadShared;
}

impl Opaque for AheadShared {
    fn content(&self) -> &AheadShared {
        self
    }
}

#[derive(Default)]
struct AheadShared {
    state: Mutex<AheadState>,
    /// Signalled after each frame with progress.
    created: Condvar,
}

#[derive(Default)]
struct AheadState {
    wanted: Option<WantedPipelines>,
    /// Thread that creates one of the pipelines while frames are drawn.
    beside: Option<JoinHandle<()>>,
    /// Start of the last frame.
    last_frame: Option<Instant>,
    /// Shaders of the pipelines that were created.
    shaders: Option<CollectedShaders>,
}

impl Drop for AheadState {
    fn drop(&mut self) {
        // When the program ends, it unloads the driver, which must not be compiling at that time.
        self.join_beside();
    }
}

impl AheadState {
    /// Waits for the thread, if there is one. If it could not create a pipeline, the frame that needs the pipeline creates it.
    fn join_beside(&mut self) {
        if let Some(thread) = self.beside.take()
            && thread.join().is_err()
        {
            tracing::error!("the thread that creates pipelines has panicked");
        }
    }
}

#[derive(Clone)]
struct WantedPipelines {
    objects: Arc<SceneObjects>,
    groups: Arc<[FrameGroup]>,
    since: Instant,
    /// Number of finished jobs.
    done: usize,
}

impl PipelinesAhead {
    fn state(&self) -> MutexGuard<'_, AheadState> {
        // No code panics while it holds the lock.
        self.0.content().state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Requests the pipelines of frames with these objects. An earlier request is dropped.
    pub fn begin(&self, objects: Arc<SceneObjects>, groups: Vec<FrameGroup>) {
        self.state().wanted = Some(WantedPipelines { objects, groups: groups.into(), since: Instant::now(), done: 0 });
    }

    /// Starts again, because the renderer lost its device and the pipelines with it.
    pub(super) fn begin_again(&self) {
        if let Some(wanted) = &mut self.state().wanted {
            wanted.done = 0;
        }
    }

    /// Whether all requested pipelines exist.
    pub fn is_done(&self) -> bool {
        self.state().wanted.is_none()
    }

    /// Compiles the shaders of the pipelines that frames have created, if the driver compiles shaders when they first run. If the cache of the driver
    /// is empty, this takes up to a minute. Frames continue meanwhile.
    pub fn compile(&self) {
        if let Some(shaders) = self.take_shaders() {
            shaders.compile();
        }
    }

    /// Takes these shaders out, to compile them later; `None` if there are none.
    pub fn take_shaders(&self) -> Option<ShadersAhead> {
        self.state().shaders.take().map(ShadersAhead)
    }

    /// Waits until no frame has begun for a second, but at most for half a minute. On a software driver, frames and compiling share the cores.
    pub fn wait_for_rest(&self) {
        let begun = Instant::now();
        let rests = || self.state().last_frame.is_none_or(|frame| frame.elapsed() > REST);
        while begun.elapsed() < LONGEST_DELAY && !rests() {
            thread::sleep(REST / 4);
        }
    }

    /// Waits until the pipelines exist. Returns earlier if no frame creates them.
    pub fn wait(&self) {
        let mut state = self.state();
        while let Some(wanted) = &state.wanted {
            let frame = state.last_frame.filter(|frame| *frame > wanted.since);
            if frame.map_or(wanted.since.elapsed() > FIRST_FRAME, |frame| frame.elapsed() > IDLE) {
                return;
            }
            state = self.0.content().created.wait_timeout(state, FIRST_FRAME).unwrap_or_else(PoisonError::into_inner).0;
        }
    }
}

/// Runs `make` on another thread. If no thread can be started, the frame that needs the pipeline creates it.
fn beside_frames(make: Box<dyn FnOnce() + Send>) -> Option<JoinHandle<()>> {
    let thread = thread::Builder::new().name("pipelines".to_owned()).spawn(make);
    thread.inspect_err(|error| tracing::warn!(%error, "no thread can be started to create a pipeline")).ok()
}

impl Renderer {
    /// Returns the pipelines that a later scene needs; see [`PipelinesAhead`].
    pub fn pipelines_ahead(&self) -> &PipelinesAhead {
        &self.pipelines_ahead
    }

    /// Returns the jobs that create the pipelines of pictures. `formats`: formats of the textures that the images of frames will be drawn into.
    fn jobs<'a>(
        &'a self,
        objects: &'a SceneObjects,
        pictures: &'a [Picture],
        formats: &'a [wgpu::TextureFormat],
    ) -> Vec<PipelineJob<'a>> {
        let of_picture = |Picture { viewports, forecast, made, is_metered }: &'a Picture| {
            let formats = if *is_metered { &[] } else { formats };
            let wish = Wish { gpu: &self.gpu, objects, viewports, forecast, made: *made, formats };
            self.techniques.iter().flat_map(move |technique| technique.pipelines(&wish))
        };
        pictures.iter().flat_map(of_picture).collect()
    }

    /// Creates some of the pipelines that a later scene needs.
    pub(super) fn create_some_ahead(&self) {
        let begun = Instant::now();
        let wanted = {
            let mut state = self.pipelines_ahead.state();
            state.last_frame = Some(begun);
            if state.beside.as_ref().is_some_and(|thread| !thread.is_finished()) {
                return;
            }
            state.join_beside();
            state.wanted.clone()
        };
        let Some(WantedPipelines { objects, groups, mut done, .. }) = wanted else { return };
        let of_group = |group: &FrameGroup| {
            let drawn = pictures(&objects, &group.rig, &group.settings, Wanted::both(), &self.limits);
            // A later frame reports the error.
            drawn.unwrap_or_default()
        };
        let pictures: Vec<Picture> = groups.iter().flat_map(of_group).collect();
        let jobs = self.jobs(&objects, &pictures, &[]);
        let all = jobs.len();
        self.gpu.collect_shaders();
        let mut beside = None;
        for job in jobs.into_iter().skip(done) {
            done += 1;
            match job.make {
                PipelineWork::Apart(make) => make(),
                PipelineWork::Beside(make) => {
                    beside = beside_frames(make);
                    break;
                }
            }
            if begun.elapsed() > SLICE {
                break;
            }
        }
        let mut state = self.pipelines_ahead.state();
        let is_busy = beside.is_some();
        state.beside = beside;
        if let Some(wanted) = state.wanted.as_mut().filter(|wanted| Arc::ptr_eq(&wanted.groups, &groups)) {
            wanted.done = done;
            if done >= all && !is_busy {
                state.wanted = None;
                state.shaders = self.gpu.collected_shaders();
            }
        }
        self.pipelines_ahead.0.content().created.notify_all();
    }

    /// Creates, on all cores, the pipelines for frames of these objects, views and settings. `wanted` states which images of any view will be read
    /// back, `formats` the formats of textures that images will be drawn into. A frame creates missing pipelines itself; after this call none are
    /// missing.
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
        self.hold_tables(&rig.viewports(glam::DQuat::IDENTITY))?;
        let pictures = pictures(objects, rig, settings, wanted, &self.limits)?;
        let jobs = self.jobs(objects, &pictures, formats);
        self.gpu.compiling_ahead(|| run(jobs, progress));
        self.gpu.take_failure()?;
        Ok(())
    }

    /// Creates the pipelines for further images of these views, in addition to those of the first frame. A software driver compiles their shaders in
    /// [`PipelinesAhead::compile`], which may run while frames are drawn.
    ///
    /// # Errors
    ///
    /// Those of [`Renderer::prepare`].
    pub fn prepare_later(
        &mut self,
        objects: &SceneObjects,
        groups: &[FrameGroup],
        wanted: Wanted,
    ) -> Result<(), RenderError> {
        let mut all = Vec::new();
        for FrameGroup { rig, settings, .. } in groups {
            all.extend(pictures(objects, rig, settings, wanted, &self.limits)?);
        }
        self.gpu.collect_shaders();
        run(self.jobs(objects, &all, &[]), &mut |_| ());
        self.pipelines_ahead.state().shaders = self.gpu.collected_shaders();
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
