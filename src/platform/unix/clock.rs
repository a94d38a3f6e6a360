//! Clocks of the machine: monotonic time, International Atomic Time (TAI), and whether the system clock is disciplined.
#![cfg_attr(
    target_os = "linux",
    expect(unsafe_code, reason = "neither the standard library nor `rustix` has `adjtimex`")
)]

use std::io;

use rustix::time::{ClockId, Timespec, clock_gettime};

use crate::platform::ClockState;

/// A time, ns.
fn ns(time: Timespec) -> i64 {
    // On some systems, the fields have fewer bits.
    #[allow(clippy::useless_conversion, reason = "the types differ between systems")]
    let (seconds, rest_ns) = (i64::from(time.tv_sec), i64::from(time.tv_nsec));
    seconds * 1_000_000_000 + rest_ns
}

/// Returns monotonic time, ns. Its origin is the same in all processes of the machine.
pub(crate) fn monotonic_ns() -> u64 {
    u64::try_from(ns(clock_gettime(ClockId::Monotonic))).unwrap_or(0)
}

/// Returns International Atomic Time, ns since 1970. It is right only if [`clock_state`] says so.
///
/// # Errors
///
/// The system has no such clock.
pub(crate) fn tai_ns() -> io::Result<i64> {
    #[cfg(target_os = "linux")]
    return Ok(ns(rustix::time::clock_gettime_dynamic(rustix::time::DynamicClockId::Tai)?));
    #[cfg(not(target_os = "linux"))]
    Err(io::Error::new(io::ErrorKind::Unsupported, "this system has no clock of International Atomic Time"))
}

/// Returns whether and how well the system clock is disciplined.
///
/// # Errors
///
/// The system does not report it.
pub(crate) fn clock_state() -> io::Result<ClockState> {
    #[cfg(target_os = "linux")]
    {
        // SAFETY: all bytes zero are a valid `timex`, and with `modes` 0 nothing is changed.
        let mut state: libc::timex = unsafe { std::mem::zeroed() };
        // SAFETY: `state` is valid for the whole call.
        let status = unsafe { libc::adjtimex(&raw mut state) };
        if status < 0 {
            return Err(io::Error::last_os_error());
        }
        #[allow(clippy::useless_conversion, reason = "the type differs between systems")]
        Ok(ClockState {
            tai_offset_s: state.tai,
            is_synchronised: status != libc::TIME_ERROR && state.status & libc::STA_UNSYNC == 0,
            largest_error_us: i64::from(state.maxerror),
        })
    }
    #[cfg(not(target_os = "linux"))]
    Err(io::Error::new(io::ErrorKind::Unsupported, "this system does not report the state of its clock"))
}
