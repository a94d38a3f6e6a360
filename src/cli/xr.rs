//! `xr`: drives a headset without a daemon.

use crate::gpu::GpuOptions;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::SystemTime;

use clap::Args;

use super::{CliError, load, lock, results};
use crate::config::Config;
use crate::plan::settings::{AfterExit, HeadsetSettings};
use crate::render::Wanted;
use crate::scene::{EndNotice, SceneClock, SceneSnapshot, SeenStars};
use crate::service;
use crate::xr::{self, Distribution, FirstFailure, Flight, HeadsetStatistics, Host, MirroredFrame, Shown, Status};

/// Arguments of `xr`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    steradian xr\n  \
    steradian xr --config configs/headset.toml\n  \
    steradian xr --config configs/headset.toml --set headset.resolution_scale=0.7 --frames 900\n\n\
    Shows the scene of a configuration in the headset of the system's OpenXR runtime until the user ends the session, or\n\
    SIGINT or SIGTERM; then prints pose ages, missed frames and the time of each stage. The runtime chooses the\n\
    adapter. The views of the configuration are not drawn: `serve` draws views and a headset together, with headset.enabled = true.\n\
    Requirements and troubleshooting: docs/headset.md.")]
pub struct XrArguments {
    /// Configuration file. Default: bright and synthetic stars.
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Override a key of the configuration; can be repeated.
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Exit after this many frames.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..), allow_negative_numbers = true)]
    frames: Option<u64>,
}

/// Runs the command.
pub fn run(arguments: XrArguments, gpu: &GpuOptions) -> Result<(), CliError> {
    if let Some(adapter) = &gpu.adapter {
        return Err(CliError::Usage(format!("--adapter {adapter}: the headset's runtime chooses the adapter")));
    }
    if *gpu != GpuOptions::default() {
        return Err(CliError::Usage("--adapter-limits: a headset always uses all features of its adapter".to_owned()));
    }
    let config = Config::load_or_built_in(arguments.config.as_deref(), &arguments.set)?;
    // The scene's clock starts when the configuration is read.
    let clock = config.clock();
    let camera = config.camera()?;
    // Check everything that can be refused before loading the stars, which takes longest.
    xr::check_set_up()?;
    let objects = Arc::new(config.objects()?);
    let (stars, _) = load::stars(&config.star_sources(), &config.epoch(), &config.origin, None)?;
    let stars = Arc::new(stars);
    let of_observer = SeenStars::new(Arc::clone(&stars), objects.observer.as_ref(), config.star_sources());
    let snapshot = SceneSnapshot { revision: 1, stars, objects, camera };
    let host = Arc::new(Wearer {
        shown: Mutex::new(Shown { snapshot, settings: config.render_settings(), camera_time: SystemTime::now() }),
        statistics: Mutex::default(),
        clock,
        end_notice: EndNotice::default(),
        stars: of_observer,
        frames: arguments.frames,
        ended: AtomicBool::new(false),
        refusing: AtomicBool::new(false),
    });

    let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(1).enable_all().build();
    let runtime = runtime.map_err(CliError::Runtime)?;
    let signals = {
        // The runtime's own thread receives signals.
        let _inside = runtime.enter();
        service::signals().map_err(CliError::Runtime)?
    };
    let signalled = Arc::clone(&host);
    runtime.spawn(async move {
        signals.await;
        signalled.ended.store(true, Ordering::Relaxed);
    });
    // The program ends when the wearer exits the application.
    let settings = HeadsetSettings { after_exit: AfterExit::Stop, ..config.headset.clone() };
    let driven = xr::drive(host.as_ref(), &settings, FirstFailure::Fails);
    runtime.shutdown_background();
    driven?;
    report(&lock(&host.statistics))
}

/// Host of the headset of `xr`. Nothing changes its scene except the wearer's flight.
struct Wearer {
    shown: Mutex<Shown>,
    clock: SceneClock,
    end_notice: EndNotice,
    stars: Arc<SeenStars>,
    statistics: Mutex<HeadsetStatistics>,
    /// Number of frames after which to end.
    frames: Option<u64>,
    ended: AtomicBool,
    /// Whether the last flight was refused.
    refusing: AtomicBool,
}

impl Host for Wearer {
    fn shown(&self) -> Option<Shown> {
        let enough = self.frames.is_some_and(|most| lock(&self.statistics).rendered >= most);
        (!enough && !self.ended.load(Ordering::Relaxed)).then(|| {
            let mut shown = lock(&self.shown);
            let now = SystemTime::now();
            self.end_notice.look(&self.clock, now);
            let time_s = self.clock.time_s(now);
            shown.snapshot = self.stars.scene_at(&shown.snapshot, time_s);
            shown.clone()
        })
    }

    fn fly(&self, flight: &Flight) {
        let mut shown = lock(&self.shown);
        match flight.moved(&shown.snapshot.camera) {
            Ok(camera) => {
                self.refusing.store(false, Ordering::Relaxed);
                shown.snapshot.camera = camera;
                shown.camera_time = SystemTime::now();
            }
            // A controller repeats its input every frame: one warning is enough.
            Err(error) if !self.refusing.swap(true, Ordering::Relaxed) => {
                tracing::warn!("the flight ends here: {error}")
            }
            Err(_) => {}
        }
    }

    fn mirror(&self) -> Wanted {
        Wanted::default()
    }

    fn publish(&self, _: MirroredFrame) {}

    fn status(&self, status: Status) {
        tracing::debug!("{status:?}");
    }

    fn statistics(&self, statistics: &HeadsetStatistics) {
        lock(&self.statistics).clone_from(statistics);
    }
}

/// Prints the figures.
fn report(statistics: &HeadsetStatistics) -> Result<(), CliError> {
    let HeadsetStatistics {
        sessions,
        losses,
        frames,
        rendered,
        not_wanted,
        left_out,
        missed,
        recentred,
        period_ms,
        ..
    } = statistics;
    results::line(format!("sessions    {sessions}, {losses} lost, {recentred} recentred"))?;
    results::line(format!(
        "frames      {frames}: {rendered} rendered, {not_wanted} not wanted, {left_out} skipped; {missed} refreshes missed, each of {period_ms:.2} ms"
    ))?;
    let spread = |times: &Distribution| {
        format!("median {:.2} ms, 95 % below {:.2}, at most {:.2}", times.median_ms, times.p95_ms, times.max_ms)
    };
    results::line(format!("pose age    at submission {}", spread(&statistics.pose_age_at_submission)))?;
    if let Some(at_display) = &statistics.pose_age_at_display {
        results::line(format!("pose age    at display {}", spread(at_display)))?;
    }
    for (name, times) in &statistics.stages {
        results::line(format!("{name:<12}{}", spread(times)))?;
    }
    Ok(())
}
