//! Long work beside the frames, one after the other on a thread and a device of its own: failure tests, and what new shapes of asteroids need
//! before they can be drawn. The thread stands back behind the one of the frames.

use std::{
    io,
    panic::{AssertUnwindSafe, catch_unwind},
    sync::{Arc, mpsc},
    thread,
};

use tokio::sync::oneshot;

use super::{
    background,
    engine::{BesideEngine, EngineError, OpenBeside},
    headset::panic_message,
    render::Refused,
};
use crate::{
    plan::settings::{AsteroidSettings, RenderSettings},
    scene::asteroids::ShapeSet,
    verify::{Check, CheckResult},
};

type Reply<T> = oneshot::Sender<Result<T, String>>;

enum Job {
    Verify { check: &'static Check, settings: Box<RenderSettings>, reply: Reply<CheckResult> },
    Bake { sets: Vec<Arc<ShapeSet>>, settings: AsteroidSettings, reply: Reply<()> },
}

/// The thread. It ends when the last clone is gone.
#[derive(Clone)]
pub(super) struct Workshop {
    jobs: mpsc::Sender<Job>,
}

impl Workshop {
    /// Starts it; the device is opened with the first job.
    pub(super) fn spawn(open: OpenBeside) -> io::Result<Self> {
        let (jobs, given) = mpsc::channel();
        thread::Builder::new().name("workshop".to_owned()).spawn(move || {
            background::stand_back();
            work(&given, open);
        })?;
        Ok(Self { jobs })
    }

    /// Runs a failure test.
    pub(super) async fn verify(
        &self,
        check: &'static Check,
        settings: RenderSettings,
    ) -> Result<Result<CheckResult, String>, Refused> {
        let (reply, result) = oneshot::channel();
        self.give(Job::Verify { check, settings: Box::new(settings), reply }, result).await
    }

    /// Makes what frames of these shapes need.
    pub(super) async fn bake(
        &self,
        sets: Vec<Arc<ShapeSet>>,
        settings: AsteroidSettings,
    ) -> Result<Result<(), String>, Refused> {
        let (reply, result) = oneshot::channel();
        self.give(Job::Bake { sets, settings, reply }, result).await
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

fn work(given: &mpsc::Receiver<Job>, mut open: OpenBeside) {
    let mut engine = None;
    for job in given {
        // A caller that went away meanwhile needs no answer, and no work.
        match job {
            Job::Verify { reply, .. } if reply.is_closed() => {}
            Job::Bake { reply, .. } if reply.is_closed() => {}
            Job::Verify { check, settings, reply } => {
                let _ = reply.send(with(&mut engine, &mut open, |engine| Ok(engine.verify(check, &settings))));
            }
            Job::Bake { sets, settings, reply } => {
                let _ = reply.send(with(&mut engine, &mut open, |engine| engine.bake(&sets, &settings)));
            }
        }
    }
}

/// Does something with the engine. One that is lost, or has panicked, is opened anew the next time.
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
        None => open().map_err(|error| format!("no second device can be opened: {error}"))?,
    };
    match catch_unwind(AssertUnwindSafe(|| background::on_own_cores(|| job(engine.as_mut())))) {
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
        Err(payload) => Err(format!("the work panicked: {}", panic_message(payload.as_ref()))),
    }
}
