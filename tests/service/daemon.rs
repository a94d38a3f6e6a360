//! Runs a daemon in this process, with a test engine that writes the number of the frame into its images.

use std::{
    collections::VecDeque,
    net::SocketAddr,
    sync::{
        Arc, Condvar, Mutex,
        atomic::{AtomicBool, AtomicU64, Ordering::SeqCst},
    },
    time::Duration,
};

use glam::{DQuat, DVec3};
use steradian::{
    gpu::AdapterReport,
    plan::{
        FramePlan,
        settings::{AsteroidSettings, ExposureSettings, ExposureValues, RenderSettings, StarMethod},
    },
    render::{AsteroidCounts, Frame, FrameImage, FrameRequest, FrameTimes, ViewStatistics},
    scene::{Camera, SceneObjects, SceneSnapshot, asteroids::ShapeSet},
    service::{
        Address, BesideEngine, Client, Engine, EngineError, OpenBeside, ServeError, ServeOptions, Shutdown, run,
    },
    verify::{Check, CheckResult, Figure, Outcome},
    view::{Fov, Rig, View, ViewKind},
};
use tokio::{sync::oneshot, task::JoinHandle};
use tonic::transport::{Channel, Endpoint};

/// Time limit of a wait, so that a test fails instead of hanging. It is far longer than any test takes.
pub const PATIENCE: Duration = Duration::from_secs(60);

/// Function that returns the frame time for these settings, ms.
pub type TookMs = fn(&RenderSettings) -> f64;

/// State shared by the test and the engine.
#[derive(Default)]
pub struct Controls {
    closed: Mutex<bool>,
    checks_closed: Mutex<bool>,
    opened: Condvar,
    /// Number of frames begun.
    pub started: AtomicU64,
    /// Number of frames finished or failed.
    pub finished: AtomicU64,
    /// Frames fail.
    pub failing: AtomicBool,
    /// Makes the engine panic at the end of the next frame.
    pub panicking: AtomicBool,
    /// Makes frames lose the device, which then cannot be reopened.
    pub lost: AtomicBool,
    /// Number of further frames that lose the device.
    pub losses: AtomicU64,
    /// Number of times that the device was reopened.
    pub reopened: AtomicU64,
    /// Exposure that frames meter at x = 0, EV.
    pub metered_ev100: Mutex<f64>,
    /// Change of the metered exposure with the camera's x, EV/m.
    pub metered_ev100_per_m: Mutex<f64>,
    /// Star method and magnitude limit of each frame, and the number of checks that were run before the frame.
    pub drawn: Mutex<Vec<(StarMethod, f64, u64)>>,
    /// Objects and asteroid settings of the last frame.
    pub shown: Mutex<Option<(Arc<SceneObjects>, AsteroidSettings)>>,
    /// Names and settings of the views of each frame.
    pub framed: Mutex<Vec<(Vec<String>, RenderSettings)>>,
    /// Reported frame time for these settings, ms.
    pub took_ms: Mutex<Option<TookMs>>,
    /// Number of open second devices.
    pub beside_open: AtomicU64,
    /// Number of checks begun.
    pub checks_started: AtomicU64,
    /// Number of calls to bake shapes, and of baked shape sets.
    pub bakes_started: AtomicU64,
    pub baked: AtomicU64,
    /// Methods of the checks.
    pub checked: Mutex<Vec<StarMethod>>,
}

impl Controls {
    /// Makes checks and baking wait.
    pub fn close_checks(&self) {
        *self.checks_closed.lock().unwrap() = true;
    }

    /// Lets checks and baking continue.
    pub fn open_checks(&self) {
        *self.checks_closed.lock().unwrap() = false;
        self.opened.notify_all();
    }

    /// Blocks frames.
    pub fn close_gate(&self) {
        *self.closed.lock().unwrap() = true;
    }

    /// Unblocks frames.
    pub fn open_gate(&self) {
        *self.closed.lock().unwrap() = false;
        self.opened.notify_all();
    }
}

pub struct TestEngine {
    pub controls: Arc<Controls>,
    /// Returns the number of frames in flight.
    begun: VecDeque<Frame>,
}

impl TestEngine {
    pub fn new(controls: Arc<Controls>) -> Self {
        Self { controls, begun: VecDeque::new() }
    }
}

/// Second engine for background jobs.
struct TestBeside {
    controls: Arc<Controls>,
}

impl Drop for TestBeside {
    fn drop(&mut self) {
        self.controls.beside_open.fetch_sub(1, SeqCst);
    }
}

impl BesideEngine for TestBeside {
    fn verify(&mut self, check: &'static Check, settings: &RenderSettings) -> Result<CheckResult, EngineError> {
        let controls = &self.controls;
        controls.checks_started.fetch_add(1, SeqCst);
        let closed = controls.checks_closed.lock().unwrap();
        drop(controls.opened.wait_while(closed, |closed| *closed).unwrap());
        controls.checked.lock().unwrap().push(settings.stars.method);
        Ok(match check.number {
            // One result of each kind.
            Some(1) => CheckResult::judge(check, vec![Figure::at_most("wrong", 0.5, 0.25, "px")]),
            Some(2) => CheckResult::without_figures(check, Outcome::NotApplicable, "no stars"),
            _ => CheckResult::judge(
                check,
                vec![Figure::at_most("right", 0.125, 0.25, "px"), Figure::informative("seen", 3.0, "")],
            ),
        })
    }

    fn bake(&mut self, sets: &[Arc<ShapeSet>], _: &AsteroidSettings) -> Result<(), EngineError> {
        let controls = &self.controls;
        controls.bakes_started.fetch_add(1, SeqCst);
        let closed = controls.checks_closed.lock().unwrap();
        drop(controls.opened.wait_while(closed, |closed| *closed).unwrap());
        controls.baked.fetch_add(sets.len() as u64, SeqCst);
        Ok(())
    }
}

/// Returns the luminance of pixel `index` of view `view`, and the solid angle.
pub fn hdr_pixel(camera_x_m: f64, frame: u64, view: usize, index: usize) -> [f32; 4] {
    [camera_x_m as f32, frame as f32 + 0.25, (view * 10_000 + index) as f32, 1e-6]
}

/// Returns the display value of pixel `index` of view `view`.
pub fn display_pixel(camera_revision: u64, view: usize, index: usize) -> [u8; 4] {
    [camera_revision as u8, view as u8, index as u8, 255]
}

impl Engine for TestEngine {
    fn submit(&mut self, request: FrameRequest<'_>) -> Result<(), EngineError> {
        let (snapshot, rig, settings) = (request.get_scene(), request.get_rig(), request.get_settings());
        let wanted = request.wanted_views();
        let controls = &self.controls;
        let number = controls.started.fetch_add(1, SeqCst);
        let (stars, checks) = (&settings.stars, controls.checked.lock().unwrap().len() as u64);
        controls.drawn.lock().unwrap().push((stars.method, stars.magnitude_limit, checks));
        *controls.shown.lock().unwrap() = Some((Arc::clone(&snapshot.objects), settings.asteroids.clone()));
        let names = rig.views().iter().map(|view| view.name.clone()).collect();
        controls.framed.lock().unwrap().push((names, settings.clone()));
        let mut images = Vec::new();
        for viewport in rig.viewports(snapshot.camera.world_from_camera) {
            let [width, height] = viewport.size();
            let (view, want) = (viewport.view, wanted[viewport.view]);
            let pixels = 0..(width * height) as usize;
            let display =
                pixels.clone().flat_map(|i| display_pixel(snapshot.camera.revision, view, i)).collect::<Vec<u8>>();
            let hdr = pixels.map(|i| hdr_pixel(snapshot.camera.position_m.x, number, view, i)).collect();
            images.push(FrameImage {
                view,
                part: viewport.part,
                width,
                height,
                display: want.display.then_some(display),
                hdr: want.hdr.then_some(hdr),
                projector: None,
            });
        }
        let metered_ev100 = *controls.metered_ev100.lock().unwrap()
            + *controls.metered_ev100_per_m.lock().unwrap() * snapshot.camera.position_m.x;
        let statistics = |view: &View| ViewStatistics {
            name: view.name.clone(),
            stars_drawn: 0,
            stars_in_map: 0,
            limiting_magnitude: Some(6.5),
            asteroids: AsteroidCounts::default(),
            gpu_ms: None,
        };
        self.begun.push_back(Frame {
            number,
            scene_revision: snapshot.revision,
            camera_revision: snapshot.camera.revision,
            exposure_ev100: request.get_adapted_ev100().unwrap_or(metered_ev100),
            metered_ev100,
            mean_luminance_cd_m2: 0.0,
            times: FrameTimes {
                total_ms: controls.took_ms.lock().unwrap().map_or(0.0, |took_ms| took_ms(settings)),
                ..FrameTimes::default()
            },
            images,
            views: rig.views().iter().map(statistics).collect(),
            plan: FramePlan::default(),
            hdr_plan: None,
        });
        assert!(self.begun.len() <= 2, "more than two frames at a time");
        Ok(())
    }

    fn is_drawn_within(&mut self, timeout: Duration) -> bool {
        let closed = self.controls.closed.lock().unwrap();
        !*self.controls.opened.wait_timeout_while(closed, timeout, |closed| *closed).unwrap().0
    }

    fn finish(&mut self) -> Result<Frame, EngineError> {
        let controls = &self.controls;
        let closed = controls.closed.lock().unwrap();
        drop(controls.opened.wait_while(closed, |closed| *closed).unwrap());
        assert!(!controls.panicking.load(SeqCst), "the test engine was requested to panic");
        if controls.lost.load(SeqCst) {
            return Err(EngineError::lost("the test engine was requested to lose its device"));
        }
        if controls.losses.fetch_update(SeqCst, SeqCst, |losses| losses.checked_sub(1)).is_ok() {
            return Err(EngineError::lost("the test engine was requested to lose its device temporarily"));
        }
        let frame = self.begun.pop_front().expect("a frame was begun");
        controls.finished.fetch_add(1, SeqCst);
        if controls.failing.load(SeqCst) {
            return Err(EngineError::new("the test engine was requested to fail"));
        }
        Ok(frame)
    }

    fn reopen(&mut self) -> Result<(), EngineError> {
        if self.controls.lost.load(SeqCst) {
            return Err(EngineError::lost("the test engine was requested to stay without its device"));
        }
        self.begun.clear();
        self.controls.reopened.fetch_add(1, SeqCst);
        Ok(())
    }

    fn beside(&self) -> OpenBeside {
        let controls = Arc::clone(&self.controls);
        Box::new(move || {
            controls.beside_open.fetch_add(1, SeqCst);
            Box::new(TestBeside { controls: Arc::clone(&controls) })
        })
    }

    fn info(&self) -> AdapterReport {
        AdapterReport {
            adapter: "test adapter".to_owned(),
            driver: "test driver 1.0".to_owned(),
            backend: "none".to_owned(),
            device_type: "test".to_owned(),
            features: vec!["f1".to_owned()],
            limits: vec![("max_size_px".to_owned(), 64)],
            fallbacks: vec!["no timestamps".to_owned()],
        }
    }
}

/// Side of the large view, pixels. Its display image has 4 MiB, more than fits in the buffers of a connection.
pub const LARGE: u32 = 1024;

/// Returns a rig with a flat view `flat` of 6 x 4 pixels and a stereo view `eyes` of 3 x 2 pixels.
pub fn small_rig() -> Rig {
    let fov = Fov { left_rad: -0.9, right_rad: 0.7, up_rad: 0.8, down_rad: -0.8 };
    let kinds = [
        ("flat", ViewKind::Perspective { size: [6, 4], fov_y_rad: 1.0 }),
        ("eyes", ViewKind::Stereo { size: [3, 2], ipd_m: 0.064, fov_left: fov, fov_right: fov.mirrored() }),
    ];
    rig(&kinds)
}

/// One view `large`.
pub fn large_rig() -> Rig {
    rig(&[("large", ViewKind::Perspective { size: [LARGE, LARGE], fov_y_rad: 1.0 })])
}

fn rig(kinds: &[(&str, ViewKind)]) -> Rig {
    let view = |(name, kind): &(&str, ViewKind)| View::new(name, kind.clone(), DQuat::IDENTITY, DVec3::ZERO).unwrap();
    Rig::new(kinds.iter().map(view).collect()).unwrap()
}

/// Returns automatic exposure with this time constant of adaptation.
pub fn adapting(adaptation_s: f64) -> ExposureSettings {
    ExposureValues { adaptation_s, ..ExposureValues::default() }.into()
}

/// A running daemon.
pub struct Daemon {
    /// Unset for a Unix socket.
    pub address: SocketAddr,
    pub listening: Address,
    pub controls: Arc<Controls>,
    stop: Option<oneshot::Sender<()>>,
    end: JoinHandle<Result<(), ServeError>>,
}

impl Daemon {
    /// Starts a daemon on a free port.
    pub async fn start(rig: Rig) -> Self {
        Self::start_with(rig, |_| {}).await
    }

    pub async fn start_with(rig: Rig, change: impl FnOnce(&mut ServeOptions)) -> Self {
        let controls = Arc::new(Controls::default());
        let (ready, is_ready) = oneshot::channel();
        let (stop, stopped) = oneshot::channel::<()>();
        let scene = SceneSnapshot {
            revision: 7,
            stars: Arc::default(),
            objects: Default::default(),
            camera: Camera::default(),
        };
        let engine = Box::new(TestEngine::new(Arc::clone(&controls)));
        let settings = RenderSettings::default();
        let ready = move |address| ready.send(address).unwrap();
        let mut options = ServeOptions::new("127.0.0.1:0", engine, scene, rig, settings, ready);
        options.shutdown = Shutdown::When(Box::pin(async move {
            let _ = stopped.await;
        }));
        change(&mut options);
        let end = tokio::spawn(run(options));
        let listening = within(is_ready).await.expect("the daemon is ready");
        let address = match &listening {
            Address::Tcp(address) => *address,
            Address::Unix(_) => SocketAddr::from(([0; 4], 0)),
        };
        Self { address, listening, controls, stop: Some(stop), end }
    }

    pub fn uri(&self) -> String {
        format!("http://{}", self.address)
    }

    /// Returns a plain channel, for services for which the client has no methods.
    pub async fn channel(&self) -> Channel {
        Endpoint::from_shared(self.uri()).unwrap().connect().await.unwrap()
    }

    pub async fn client(&self) -> Client {
        Client::connect(&self.uri()).await.unwrap()
    }

    /// Requests the end.
    pub fn begin_shutdown(&mut self) {
        drop(self.stop.take());
    }

    /// Waits for the end.
    pub async fn end(self) -> Result<(), ServeError> {
        within(self.end).await.expect("run does not panic")
    }

    /// Requests the end, and waits.
    pub async fn shutdown(mut self) -> Result<(), ServeError> {
        self.begin_shutdown();
        self.end().await
    }
}

/// Returns the value of a future; fails the test if it does not resolve in time.
pub async fn within<F: Future>(future: F) -> F::Output {
    tokio::time::timeout(PATIENCE, future).await.expect("the future resolves in time")
}

/// Waits for a condition.
pub async fn until(condition: impl Fn() -> bool) {
    within(async {
        while !condition() {
            tokio::time::sleep(Duration::from_millis(1)).await;
        }
    })
    .await;
}
