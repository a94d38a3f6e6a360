//! Long jobs other than rendering, which run one at a time on a low-priority thread: failure tests, which use a separate device, and the preparation
//! of new asteroid shapes and of shaders, which uses the device that draws.

use std::{
    any::Any,
    io,
    panic::{AssertUnwindSafe, catch_unwind},
    sync::{
        Arc,
        mpsc::{self, RecvTimeoutError},
    },
    thread,
    time::Duration,
};

use tokio::sync::oneshot;

use super::interface::{BesideEngine, EngineError, OpenBeside};
use crate::{
    plan::settings::{AsteroidSettings, RenderSettings},
    platform::process,
    render::PipelinesAhead,
    scene::asteroids::ShapeSet,
    service::{
        frames::errors::Refused,
        threads::{self, panic_message},
    },
    verify::{Check, CheckResult},
};

/// A second device without work for this time is closed: a run of all failure tests needs a gigabyte of memory on a software driver.
const IDLE: Duration = Duration::from_secs(5);

type Reply<T> = oneshot::Sender<Result<T, String>>;

enum Job {
    Verify { check: &'static Check, settings: Box<RenderSettings>, reply: Reply<CheckResult> },
    Bake { sets: Vec<Arc<ShapeSet>>, settings: AsteroidSettings, reply: Reply<()> },
    Compile { reply: Reply<()> },
}

/// Handle of the thread, which ends with the last clone.
#[derive(Clone)]
pub(crate) struct BackgroundJobs {
    jobs: mpsc::Sender<Job>,
    /// Pipelines that frames create for a later scene.
    pub(crate) pipelines: PipelinesAhead,
}

impl BackgroundJobs {
    /// Starts the thread, which opens the device for the first failure test. Another thread compiles the shaders that the renderer has prepared for
    /// later images, while no frames are drawn.
    pub(crate) fn spawn(open: OpenBeside, pipelines: PipelinesAhead) -> io::Result<Self> {
        let (jobs, given) = mpsc::channel();
        let ahead = pipelines.clone();
        thread::Builder::new().name("background_jobs".to_owned()).spawn(move || {
            threads::stand_back();
            work(&given, open, &ahead);
        })?;
        // Use a separate thread: otherwise the jobs would wait for this work, which takes up to a minute when the driver's cache is empty.
        let later = pipelines.clone();
        thread::Builder::new().name("later_shaders".to_owned()).spawn(move || {
            threads::stand_back();
            let Some(shaders) = later.take_shaders() else { return };
            later.wait_for_rest();
            if let Err(problem) = compile(|| shaders.compile()) {
                tracing::error!("cannot compile the shaders for exact images in advance, so they are compiled when they are first needed: {problem}");
            }
        })?;
        Ok(Self { jobs, pipelines })
    }

    /// Runs a failure test.
    pub(crate) async fn verify(
        &self,
        check: &'static Check,
        settings: RenderSettings,
    ) -> Result<Result<CheckResult, String>, Refused> {
        let (reply, result) = oneshot::channel();
        self.give(Job::Verify { check, settings: Box::new(settings), reply }, result).await
    }

    /// Prepares the data that frames with these shapes need.
    pub(crate) async fn bake(
        &self,
        sets: Vec<Arc<ShapeSet>>,
        settings: AsteroidSettings,
    ) -> Result<Result<(), String>, Refused> {
        let (reply, result) = oneshot::channel();
        self.give(Job::Bake { sets, settings, reply }, result).await
    }

    /// Compiles the shaders of the pipelines that frames have created for a later scene. This takes little time if the driver's cache contains them.
    pub(crate) async fn compile(&self) -> Result<Result<(), String>, Refused> {
        let (reply, result) = oneshot::channel();
        self.give(Job::Compile { reply }, result).await
    }

    async fn give<T>(
        &self,
        job: Job,
        result: oneshot::Receiver<Result<T, String>>,
    ) -> Result<Result<T, String>, Refused> {
        self.jobs.send(job).map_err(|_| Refused::Ending)?;
        result.await.map_err(|_| Refused::Ending)
    }
}

fn work(given: &mpsc::Receiver<Job>, mut open: OpenBeside, pipelines: &PipelinesAhead) {
    let mut engine = None;
    loop {
        let next = match &engine {
            Some(_) => given.recv_timeout(IDLE),
            None => given.recv().map_err(|_| RecvTimeoutError::Disconnected),
        };
        let job = match next {
            Ok(job) => job,
            Err(RecvTimeoutError::Timeout) => {
                engine = None;
                continue;
            }
            Err(RecvTimeoutError::Disconnected) => return,
        };
        // The caller may have disconnected; then it needs no answer and no work.
        match job {
            Job::Verify { reply, .. } if reply.is_closed() => {}
            Job::Bake { reply, .. } if reply.is_closed() => {}
            // Run this even if the caller has disconnected: the same change may be requested again.
            Job::Compile { reply } => {
                let _ = reply.send(compile(|| pipelines.compile()));
            }
            Job::Verify { check, settings, reply } => {
                let _ = reply.send(with(&mut engine, &mut open, |engine| engine.verify(check, &settings)));
            }
            Job::Bake { sets, settings, reply } => {
                let done = with(&mut engine, &mut open, |engine| engine.bake(&sets, &settings));
                // Atlases are the largest data that are created and dropped.
                process::return_freed_memory();
                let _ = reply.send(done);
            }
        }
    }
}

/// Runs `work`, which compiles the shaders of pipelines that were created for later frames.
fn compile(work: impl FnOnce() + Send) -> Result<(), String> {
    let compiled = catch_unwind(AssertUnwindSafe(|| threads::on_own_cores(work)));
    compiled.map_err(|payload| panicked(payload.as_ref()))
}

/// Runs work with the engine. An engine that was lost or has panicked is opened again for the next job.
fn with<T>(
    held: &mut Option<Box<dyn BesideEngine>>,
    open: &mut OpenBeside,
    job: impl FnOnce(&mut dyn BesideEngine) -> Result<T, EngineError> + Send,
) -> Result<T, String>
where
    T: Send,
{
    let mut engine = match held.take() {
        Some(engine) => engine,
        None => open(),
    };
    match catch_unwind(AssertUnwindSafe(|| threads::on_own_cores(|| job(engine.as_mut())))) {
        Ok(Ok(done)) => {
            *held = Some(engine);
            Ok(done)
        }
        Ok(Err(error)) => {
            if !error.lost {
                *held = Some(engine);
            }
            Err(error.to_string())
        }
        Err(payload) => Err(panicked(payload.as_ref())),
    }
}

fn panicked(payload: &(dyn Any + Send)) -> String {
    format!("the background job panicked: {}", panic_message(payload))
}
