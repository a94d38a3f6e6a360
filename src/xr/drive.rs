//! Driving a headset for as long as its host wants it: connecting, frames, and connecting again.

use std::{
    mem, thread,
    time::{Duration, Instant},
};

use super::{
    error::XrError,
    headset::{Headset, Step},
    host::{Host, Status},
    statistics::Recorder,
};
use crate::plan::settings::{AfterExit, HeadsetSettings};

/// Wait before the first attempt to connect again; each that fails doubles it.
const FIRST_WAIT: Duration = Duration::from_millis(250);
/// The longest wait between two attempts.
const LONGEST_WAIT: Duration = Duration::from_secs(10);
/// How often a host is asked whether it still wants the headset, while there is none.
const HOST_INTERVAL: Duration = Duration::from_millis(50);
/// How long the runtime may take to end the session when it is asked to.
const FAREWELL: Duration = Duration::from_secs(2);

/// What it means that the first connection fails, or that the scene cannot be drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FirstFailure {
    /// It is told.
    Fails,
    /// It is tried again, as after a loss: the runtime may be started later, the scene may change.
    Retries,
}

/// Connects to the runtime's headset and shows frames until the host ends it, or the wearer does. When the runtime, the session
/// or the device is lost, it connects again, and waits longer after each attempt that fails. Blocks: for a thread of its own.
///
/// # Errors
///
/// The first connection failed, or the scene cannot be drawn, where `first` says that this is an error.
pub fn drive(host: &dyn Host, settings: &HeadsetSettings, first: FirstFailure) -> Result<(), XrError> {
    let mut recorder = Recorder::default();
    let mut wait = FIRST_WAIT;
    let mut connected_before = false;
    let mut told = None;
    while host.shown().is_some() {
        let reason = match Headset::connect(settings, recorder.clone()) {
            Ok(mut headset) => {
                headset.fails = first == FirstFailure::Fails;
                connected_before = true;
                let end = frames(&mut headset, host);
                let before = mem::replace(&mut recorder, headset.close());
                // A runtime that takes every session and shows nothing is asked less and less often too.
                if recorder.figures().rendered > before.figures().rendered {
                    (wait, told) = (FIRST_WAIT, None);
                }
                match end {
                    Ok(End::Host) => return Ok(()),
                    Ok(End::Exit) => {
                        let retrying = settings.after_exit == AfterExit::Reconnect;
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
        if told.as_ref() != Some(&reason) {
            tracing::warn!("headset: {reason}; trying again");
            told = Some(reason.clone());
        }
        host.status(Status::Disconnected { reason, retrying: true });
        let until = Instant::now() + wait;
        while host.shown().is_some() && Instant::now() < until {
            thread::sleep(HOST_INTERVAL.min(until.saturating_duration_since(Instant::now())));
        }
        wait = (2 * wait).min(LONGEST_WAIT);
    }
    Ok(())
}

enum End {
    Host,
    Exit,
}

/// Shows frames to the end of the session.
fn frames(headset: &mut Headset, host: &dyn Host) -> Result<End, XrError> {
    let mut status = headset.status();
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
                take_leave(headset, host);
                return Ok(End::Host);
            }
            Step::Exited => return Ok(End::Exit),
        }
    }
}

/// Ends the session as the runtime wants it, if it does so in time: otherwise it finds the session gone.
fn take_leave(headset: &mut Headset, host: &dyn Host) {
    let until = Instant::now() + FAREWELL;
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
    tracing::warn!("headset: the runtime has not ended the session within {} s", FAREWELL.as_secs());
}
