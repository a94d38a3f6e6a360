//! Clocks of the machine: monotonic time, International Atomic Time (TAI), and whether the system clock is disciplined.
#![expect(unsafe_code, reason = "neither the standard library nor `rustix` has `adjtimex`")]

use std::io;

use crate::platform::ClockState;

/// Reads a clock of the system, ns.
fn read(clock: libc::clockid_t) -> io::Result<i64> {
    let mut time = libc::timespec { tv_sec: 0, tv_nsec: 0 };
    // SAFETY: `time` is valid for the whole call.
    if unsafe { libc::clock_gettime(clock, &raw mut time) } != 0 {
        return Err(io::Error::last_os_error());
    }
    // On some systems the fields are narrower.
    #[allow(clippy::unnecessary_cast, clippy::useless_conversion, reason = "the types differ between systems")]
    Ok(i64::from(time.tv_sec) * 1_000_000_000 + i64::from(time.tv_nsec))
}

/// Returns monotonic time, ns. Its origin is the same in all processes of the machine.
///
/// # Errors
///
/// The system has no such clock.
pub(crate) fn monotonic_ns() -> io::Result<u64> {
    Ok(u64::try_from(read(libc::CLOCK_MONOTONIC)?).unwrap_or(0))
}

/// Returns International Atomic Time, ns since 1970. It is right only if [`clock_state`] says so.
///
/// # Errors
///
/// The system has no such clock.
pub(crate) fn tai_ns() -> io::Result<i64> {
    #[cfg(target_os = "linux")]
    return read(libc::CLOCK_TAI);
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
