//! Keeps the machine's clock marked as synchronised, as a time service would, and sets it forward or back. Needs root, and a machine without a time
//! service.

#![allow(unsafe_code, reason = "neither the standard library nor `rustix` has `adjtimex`")]
#![allow(clippy::print_stderr, reason = "drop cannot return an error that occurs while it restores the clock")]

use std::{
    error::Error,
    io,
    sync::{
        Arc,
        atomic::{AtomicBool, AtomicI64, Ordering},
    },
    thread::{self, JoinHandle},
    time::Duration,
};

use rustix::time::{ClockId, Timespec, clock_gettime, clock_settime};

type Outcome<T> = Result<T, Box<dyn Error>>;

/// TAI minus UTC since 2017, seconds.
const TAI_OFFSET_S: i64 = 37;
/// Maximum error of the clock, as reported to the kernel, us.
const LARGEST_ERROR_US: i64 = 100;
/// Interval between two reports that the clock is synchronised. After a step, the kernel treats its clock as unsynchronised until the next report.
const CORRECTION: Duration = Duration::from_millis(200);

/// Changes the state of the kernel's clock.
fn adjust(modes: libc::c_uint, status: libc::c_int, constant: i64, largest_error_us: i64) -> io::Result<libc::timex> {
    // SAFETY: all bytes zero are a valid `timex`.
    let mut state: libc::timex = unsafe { std::mem::zeroed() };
    (state.modes, state.status, state.constant, state.maxerror) = (modes, status, constant, largest_error_us);
    // SAFETY: `state` is valid for the whole call.
    if unsafe { libc::adjtimex(&raw mut state) } < 0 {
        return Err(io::Error::last_os_error());
    }
    Ok(state)
}

/// Reports to the kernel that the clock is synchronised within [`LARGEST_ERROR_US`].
fn discipline() -> io::Result<()> {
    adjust(libc::ADJ_STATUS | libc::ADJ_MAXERROR, libc::STA_PLL, 0, LARGEST_ERROR_US)?;
    adjust(libc::ADJ_TAI, 0, TAI_OFFSET_S, 0).map(drop)
}

/// While this value exists, the kernel treats the machine's clock as synchronised.
pub struct Disciplined {
    is_needed: Arc<AtomicBool>,
    corrections: Option<JoinHandle<io::Result<()>>>,
    /// Sum of all steps, ns.
    set_by_ns: AtomicI64,
}

impl Disciplined {
    /// Begins to report the clock to the kernel as synchronised, until the value is dropped.
    pub fn begin() -> Outcome<Self> {
        let state = adjust(0, 0, 0, 0)?;
        if state.status & libc::STA_UNSYNC == 0 {
            return Err("a time service controls the clock of this machine: stop the service first".into());
        }
        discipline().map_err(|error| format!("cannot change the clock of this machine: {error}"))?;
        let is_needed = Arc::new(AtomicBool::new(true));
        let is_still = Arc::clone(&is_needed);
        let corrections = thread::spawn(move || {
            while is_still.load(Ordering::Relaxed) {
                discipline()?;
                thread::sleep(CORRECTION);
            }
            Ok(())
        });
        Ok(Self { is_needed, corrections: Some(corrections), set_by_ns: AtomicI64::new(0) })
    }

    /// Sets the clock forward by `ns`, or back if `ns` is negative.
    pub fn step(&self, ns: i64) -> Outcome<()> {
        let now = clock_gettime(ClockId::Realtime);
        let sum = i128::from(now.tv_sec) * 1_000_000_000 + i128::from(now.tv_nsec) + i128::from(ns);
        let time = Timespec {
            tv_sec: i64::try_from(sum.div_euclid(1_000_000_000))?,
            tv_nsec: i64::try_from(sum.rem_euclid(1_000_000_000))?,
        };
        clock_settime(ClockId::Realtime, time)?;
        self.set_by_ns.fetch_add(ns, Ordering::Relaxed);
        Ok(())
    }
}

impl Drop for Disciplined {
    fn drop(&mut self) {
        self.is_needed.store(false, Ordering::Relaxed);
        if let Some(Ok(Err(error))) = self.corrections.take().map(JoinHandle::join) {
            eprintln!("cannot report the clock as synchronised: {error}");
        }
        let undone = self.step(-self.set_by_ns.load(Ordering::Relaxed)).and_then(|()| {
            adjust(libc::ADJ_STATUS, libc::STA_UNSYNC, 0, 0)?;
            Ok(adjust(libc::ADJ_TAI, 0, 0, 0).map(drop)?)
        });
        if let Err(error) = undone {
            eprintln!("cannot restore the clock: {error}");
        }
    }
}
