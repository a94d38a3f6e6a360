//! Clocks of the machine: monotonic time; International Atomic Time (TAI) is not implemented on Windows.

use std::{io, sync::LazyLock, time::Instant};

use crate::platform::ClockState;

/// Origin of [`monotonic_ns`].
static START: LazyLock<Instant> = LazyLock::new(Instant::now);

/// Returns monotonic time, ns. Its origin is the first call in this process.
pub(crate) fn monotonic_ns() -> u64 {
    u64::try_from(START.elapsed().as_nanos()).unwrap_or(u64::MAX)
}

/// International Atomic Time is not implemented on Windows.
///
/// # Errors
///
/// Always.
pub(crate) fn tai_ns() -> io::Result<i64> {
    Err(io::Error::new(io::ErrorKind::Unsupported, "not implemented on Windows"))
}

/// The state of the clock is not implemented on Windows.
///
/// # Errors
///
/// Always.
pub(crate) fn clock_state() -> io::Result<ClockState> {
    Err(io::Error::new(io::ErrorKind::Unsupported, "not implemented on Windows"))
}
