//! Code that depends on the operating system. There is one file per subject and system, and the interface is the same on every system.
//!
//! | subject | Unix | Windows |
//! |---|---|---|
//! | `clock`: monotonic time, International Atomic Time and whether it is disciplined | `clock_gettime`, `adjtimex` (Linux only) | monotonic time only |
//! | `files`: identity of a file | device and number | none: an open file keeps its name |
//! | `openxr_clock`: extension that reads the clock of a headset's runtime | `timespec` | performance counter |
//! | `process`: priority of threads, resident and freed memory, open files, the same program again | `nice` and `/proc` (Linux only), `malloc_trim` (glibc only), `getrlimit`, `exec` | thread priority, working set, no limit, refused |
//! | `signals`: end, and reload of the access rules | SIGINT, SIGTERM; SIGHUP | Ctrl-C, Ctrl-Break, console closed, logoff, shutdown; no reload |
//! | `sockets`: local sockets with a path | Unix sockets | refused |
//! | `supervisor`: readiness and end for the supervisor | systemd | none |
//!
//! The crates `steradian-sky` and `steradian-render` also have modules of this name, for the permissions of new files and for the graphics
//! interfaces, and `windows` has one for display servers. The test `tests/cpu/platform.rs` fails if there is such code elsewhere.

#[cfg(unix)]
mod unix;
#[cfg(unix)]
use self::unix as system;

#[cfg(windows)]
mod windows;
#[cfg(windows)]
use self::windows as system;

#[cfg(not(any(unix, windows)))]
compile_error!("`platform` has code for Unix and for Windows only");

#[cfg(feature = "xr")]
pub(crate) use self::system::openxr_clock;
#[cfg(feature = "cli")]
pub(crate) use self::system::supervisor;
#[cfg(feature = "service")]
pub(crate) use self::system::{clock, files, process, signals, sockets};

/// How well the system clock is disciplined.
#[cfg(feature = "service")]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(not(target_os = "linux"), allow(dead_code, reason = "only Linux reports it"))]
pub(crate) struct ClockState {
    /// TAI minus UTC, s; 0 if it was not set.
    pub(crate) tai_offset_s: i32,
    /// Whether a time service steers the clock.
    pub(crate) is_synchronised: bool,
    /// Bound of its error, us.
    pub(crate) largest_error_us: i64,
}
