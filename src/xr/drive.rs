//! Drives a headset as long as its host wants: connects, renders frames, and reconnects.

use std::{
    mem, thread,
    time::{Duration, Instant},
};

use super::{
    error::XrError,
    headset::{Headset, Step},
    host::{Host, Status},
    recorder::Recorder,
    statistics::HeadsetStatistics,
};
use crate::plan::settings::{AfterExit, HeadsetSettings};

/// Wait before the first attempt to reconnect. Each failure doubles the wait.
const FIRST_WAIT: Duration = Duration::from_millis(250);
/// Maximum wait between two attempts.
const LONGEST_WAIT: Duration = Duration::from_secs(10);
/// Interval at which the host is asked whether it still wants the headset, while there is no session.
const HOST_INTERVAL: Duration = Duration::from_millis(50);
/// Maximum time that the runtime may take to end the session on request.
const END_TIMEOUT: Duration = Duration::from_secs(2);

/// Handling of a failed first connection, and of a scene that cannot be drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FirstFailure {
    /// [`drive`] returns the error.
    Fails,
    /// It is tried again, as after a loss: the runtime may start later, and the scene may change.
    Retries,
}

/// Connects to the runtime's headset and shows frames until the host or the wearer ends it. If the runtime, the session
/// or the device is lost, it reconnects, and waits longer after each failed attempt. Blocks, so it needs a dedicated
/// thread.
///
/// # Errors
///
/// The first connection failed, or the scene cannot be drawn, if `first` makes this an error.
pub fn drive(host: &dyn Host, settings: &HeadsetSettings, first: FirstFailure) -> Result<(), XrError> {
    drive_with(host, settings.after_exit, first, |recorder| {
        let mut headset = Headset::connect(settings, recorder)?;
        headset.fails = first == FirstFailure::Fails;
        Ok(headset)
    })
}

/// Interface of the driven session: [`Headset`], or a script in tests.
trait Connection {
    fn status(&self) -> Status;
    fn figures(&self) -> HeadsetStatistics;
    fn request_exit(&self) -> Result<(), XrError>;
    fn step(&mut self, host: &dyn Host) -> Result<Step, XrError>;
    fn close(self) -> Recorder;
}

impl Connection for Headset {
    fn status(&self) -> Status {
        Headset::status(self)
    }

    fn figures(&self) -> HeadsetStatistics {
        self.recorder().figures()
    }

    fn request_exit(&self) -> Result<(), XrError> {
        Headset::request_exit(self)
    }

    fn step(&mut self, host: &dyn Host) -> Result<Step, XrError> {
        Headset::step(self, host)
    }

    fn close(self) -> Recorder {
        Headset::close(self)
    }
}

fn drive_with<C: Connection>(
    host: &dyn Host,
    after_exit: AfterExit,
    first: FirstFailure,
    mut connect: impl FnMut(Recorder) -> Result<C, XrError>,
) -> Result<(), XrError> {
    let mut recorder = Recorder::default();
    let mut pauses = Pauses::new();
    let mut connected_before = false;
    let mut last_reason = None;
    while host.shown().is_some() {
        let reason = match connect(recorder.clone()) {
            Ok(mut headset) => {
                connected_before = true;
                let end = frames(&mut headset, host);
                let before = mem::replace(&mut recorder, headset.close());
                // A runtime that accepts every session but shows nothing counts as a failure too, so that attempts become less frequent.
                if recorder.figures().rendered > before.figures().rendered {
                    (pauses, last_reason) = (Pauses::new(), None);
                }
                match end {
                    Ok(End::Host) => return Ok(()),
                    Ok(End::Exit) => {
                        let retrying = after_exit == AfterExit::Reconnect;
                        let reason = "the session was ended in the headset".to_owned();
                        tracing::info!("headset: {reason}");
                        host.status(Status::Disconnected { reason: reason.clone(), retrying });
                        if !retrying {
                            return Ok(());
                        }
                        reason
                    }
                    Err(error @ XrError::Render(_)) if first == FirstFailure::Fails => return Err(error),
                    Err(error) => {
                        recorder.loss();
                        host.statistics(&recorder.figures());
                        error.to_string()
                    }
                }
            }
            Err(error) if first == FirstFailure::Fails && !connected_before => return Err(error),
            Err(error) => error.to_string(),
        };
        if last_reason.as_ref() != Some(&reason) {
            tracing::warn!("headset: {reason}; trying again");
            last_reason = Some(reason.clone());
        }
        host.status(Status::Disconnected { reason, retrying: true });
        let until = Instant::now() + pauses.next();
        while host.shown().is_some() && Instant::now() < until {
            thread::sleep(HOST_INTERVAL.min(until.saturating_duration_since(Instant::now())));
        }
    }
    Ok(())
}

/// Pauses between failed attempts. Each pause is twice as long as the previous one, up to a maximum.
struct Pauses(Duration);

impl Pauses {
    fn new() -> Self {
        Self(FIRST_WAIT)
    }

    fn next(&mut self) -> Duration {
        let longer = (2 * self.0).min(LONGEST_WAIT);
        mem::replace(&mut self.0, longer)
    }
}

enum End {
    Host,
    Exit,
}

/// Shows frames until the end of the session.
fn frames(headset: &mut impl Connection, host: &dyn Host) -> Result<End, XrError> {
    let mut status = headset.status();
    // Report the new session in the statistics.
    host.statistics(&headset.figures());
    host.status(status.clone());
    loop {
        let step = headset.step(host)?;
        let now = headset.status();
        if now != status {
            status = now;
            host.status(status.clone());
        }
        match step {
            Step::Idle if host.shown().is_none() => return Ok(End::Host),
            Step::Idle | Step::Frame(_) => {}
            Step::HostEnded => {
                end_session(headset, host);
                return Ok(End::Host);
            }
            Step::Exited => return Ok(End::Exit),
        }
    }
}

/// Requests the end of the session and waits for the runtime to end it, up to a limit; after that the session is
/// dropped.
fn end_session(headset: &mut impl Connection, host: &dyn Host) {
    let until = Instant::now() + END_TIMEOUT;
    let mut step = headset.request_exit().map(|()| Step::Idle);
    while Instant::now() < until {
        match step {
            Ok(Step::Exited) => return,
            Ok(_) => step = headset.step(host),
            Err(error) => {
                tracing::info!("headset: {error}");
                return;
            }
        }
    }
    tracing::warn!("headset: the runtime did not end the session within {} s", END_TIMEOUT.as_secs());
}

#[cfg(test)]
mod tests {
    use std::{
        cell::{Cell, RefCell},
        collections::VecDeque,
        sync::{
            Mutex,
            atomic::{AtomicBool, Ordering::Relaxed},
        },
        time::SystemTime,
    };

    use openxr::sys;

    use super::*;
    use crate::{
        plan::settings::RenderSettings,
        render::Wanted,
        verify::scenes,
        xr::{Flight, MirroredFrame, Shown},
    };

    /// Host that records all reports.
    #[derive(Default)]
    struct RecordingHost {
        ended: AtomicBool,
        /// Whether the host ends the headset when a disconnection is reported.
        ends_when_disconnected: bool,
        statuses: Mutex<Vec<Status>>,
        statistics: Mutex<HeadsetStatistics>,
    }

    impl Host for RecordingHost {
        fn shown(&self) -> Option<Shown> {
            (!self.ended.load(Relaxed)).then(|| Shown {
                snapshot: scenes::snapshot(Vec::new()),
                settings: RenderSettings::default(),
                camera_time: SystemTime::now(),
            })
        }

        fn fly(&self, _: &Flight) {}

        fn mirror(&self) -> Wanted {
            Wanted::default()
        }

        fn publish(&self, _: MirroredFrame) {}

        fn status(&self, status: Status) {
            let disconnected = matches!(status, Status::Disconnected { .. });
            self.ended.fetch_or(disconnected && self.ends_when_disconnected, Relaxed);
            let mut statuses = self.statuses.lock().unwrap();
            if statuses.last() != Some(&status) {
                statuses.push(status);
            }
        }

        fn statistics(&self, statistics: &HeadsetStatistics) {
            self.statistics.lock().unwrap().clone_from(statistics);
        }
    }

    impl RecordingHost {
        /// Summarises the statuses: C for connected, otherwise the reason of a disconnection, with ` again` if it is
        /// retried.
        fn statuses(&self) -> Vec<String> {
            let text = |status: &Status| match status {
                Status::Connected { .. } => "C".to_owned(),
                Status::Disconnected { reason, retrying } => {
                    format!("{reason}{}", if *retrying { " again" } else { "" })
                }
            };
            self.statuses.lock().unwrap().iter().map(text).collect()
        }
    }

    type Steps = Vec<Result<Step, XrError>>;

    /// A session with a script of steps.
    struct Scripted<'a> {
        steps: RefCell<VecDeque<Result<Step, XrError>>>,
        recorder: Recorder,
        exits_requested: &'a Cell<u32>,
    }

    impl Connection for Scripted<'_> {
        fn status(&self) -> Status {
            Status::Connected {
                runtime: String::new(),
                system: String::new(),
                state: "focused",
                sizes: [[1, 1]; 2],
                adapter: String::new(),
                problem: None,
            }
        }

        fn figures(&self) -> HeadsetStatistics {
            self.recorder.figures()
        }

        fn request_exit(&self) -> Result<(), XrError> {
            self.exits_requested.set(self.exits_requested.get() + 1);
            Ok(())
        }

        fn step(&mut self, _: &dyn Host) -> Result<Step, XrError> {
            let step = self.steps.borrow_mut().pop_front();
            step.expect("no step after the end of the session")
        }

        fn close(self) -> Recorder {
            assert!(self.steps.borrow().is_empty(), "all steps were taken");
            self.recorder
        }
    }

    fn lost() -> XrError {
        XrError::Call { call: "xrWaitFrame", result: sys::Result::ERROR_INSTANCE_LOST }
    }

    fn absent() -> XrError {
        XrError::NoRuntime { call: "xrCreateInstance", result: sys::Result::ERROR_RUNTIME_FAILURE }
    }

    /// Drives sessions with scripted steps or connection errors; returns the result and how often an exit was
    /// requested.
    fn driven(
        host: &RecordingHost,
        after_exit: AfterExit,
        first: FirstFailure,
        sessions: Vec<Result<Steps, XrError>>,
    ) -> (Result<(), XrError>, u32) {
        let mut sessions = VecDeque::from(sessions);
        let exits_requested = Cell::new(0);
        let end = drive_with(host, after_exit, first, |mut recorder| {
            let steps = sessions.pop_front().expect("no connection after the end")?;
            recorder.session();
            let steps = RefCell::new(steps.into());
            Ok(Scripted { steps, recorder, exits_requested: &exits_requested })
        });
        assert!(sessions.is_empty(), "all connections were made");
        (end, exits_requested.get())
    }

    #[test]
    fn pauses_grow_to_the_longest() {
        let mut pauses = Pauses::new();
        let seconds: Vec<f64> = (0..8).map(|_| pauses.next().as_secs_f64()).collect();
        assert_eq!(seconds, [0.25, 0.5, 1.0, 2.0, 4.0, 8.0, 10.0, 10.0]);
    }

    #[test]
    fn session_ended_by_wearer_stays_ended_or_restarts() {
        let host = RecordingHost::default();
        let stopped =
            driven(&host, AfterExit::Stop, FirstFailure::Retries, vec![Ok(vec![Ok(Step::Idle), Ok(Step::Exited)])]);
        assert!(matches!(stopped, (Ok(()), 0)), "{stopped:?}");
        assert_eq!(host.statuses(), ["C", "the session was ended in the headset"]);

        let host = RecordingHost::default();
        let sessions = vec![Ok(vec![Ok(Step::Exited)]), Ok(vec![Ok(Step::HostEnded), Ok(Step::Exited)])];
        let again = driven(&host, AfterExit::Reconnect, FirstFailure::Retries, sessions);
        assert!(matches!(again, (Ok(()), 1)), "the host's end is requested from the runtime: {again:?}");
        assert_eq!(host.statuses(), ["C", "the session was ended in the headset again", "C"]);
        let figures = host.statistics.lock().unwrap().clone();
        assert_eq!((figures.sessions, figures.losses), (2, 0), "an exit is not a loss");
    }

    #[test]
    fn lost_session_is_counted_and_restored_for_either_first_failure() {
        let host = RecordingHost::default();
        let last = vec![Ok(Step::HostEnded), Err(lost())];
        let sessions = vec![Ok(vec![Ok(Step::Idle), Err(lost())]), Err(absent()), Ok(last)];
        let end = driven(&host, AfterExit::Stop, FirstFailure::Fails, sessions);
        assert!(matches!(end, (Ok(()), 1)), "a runtime that is lost at the end is not waited for: {end:?}");
        assert_eq!(
            host.statuses(),
            ["C".to_owned(), format!("{} again", lost()), format!("{} again", absent()), "C".to_owned()]
        );
        let figures = host.statistics.lock().unwrap().clone();
        assert_eq!((figures.sessions, figures.losses), (2, 1));
    }

    #[test]
    fn first_failure_is_returned_or_retried() {
        let host = RecordingHost::default();
        let (end, _) = driven(&host, AfterExit::Stop, FirstFailure::Fails, vec![Err(absent())]);
        assert_eq!(end.unwrap_err().to_string(), absent().to_string());
        assert_eq!(host.statuses(), Vec::<String>::new(), "the caller reports the returned error");

        let sessions = vec![Err(absent()), Ok(vec![Ok(Step::HostEnded), Ok(Step::Exited)])];
        let (end, _) = driven(&host, AfterExit::Stop, FirstFailure::Retries, sessions);
        assert!(end.is_ok(), "{end:?}");
        assert_eq!(host.statuses(), [format!("{} again", absent()), "C".to_owned()]);
    }

    #[test]
    fn host_that_ends_while_waiting_causes_no_further_attempt() {
        let host = RecordingHost { ends_when_disconnected: true, ..RecordingHost::default() };
        let (end, _) = driven(&host, AfterExit::Stop, FirstFailure::Retries, vec![Err(absent())]);
        assert!(end.is_ok(), "{end:?}");
        assert_eq!(host.statuses(), [format!("{} again", absent())]);
    }
}
