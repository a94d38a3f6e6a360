//! Priority of threads, memory and open files of this process.
#![expect(unsafe_code, reason = "the standard library has none of these functions")]

use std::io;

use windows_sys::Win32::System::{
    ProcessStatus::{GetProcessMemoryInfo, PROCESS_MEMORY_COUNTERS},
    Threading::{GetCurrentProcess, GetCurrentThread, SetThreadPriority, THREAD_PRIORITY_BELOW_NORMAL},
};

/// Returns an error: a process cannot be replaced.
#[cfg(feature = "cluster")]
pub(crate) fn run_again_with(_: &str, _: &str) -> io::Error {
    io::Error::new(io::ErrorKind::Unsupported, "this system cannot replace a process")
}

/// Lowers the priority of the calling thread. Threads that it starts afterwards do not inherit it, so the threads of a software driver
/// keep the normal one.
///
/// # Errors
///
/// The system refuses.
pub(crate) fn lower_thread_priority() -> io::Result<()> {
    // SAFETY: the handle denotes the calling thread and needs no closing.
    let done = unsafe { SetThreadPriority(GetCurrentThread(), THREAD_PRIORITY_BELOW_NORMAL) };
    if done == 0 { Err(io::Error::last_os_error()) } else { Ok(()) }
}

/// Real-time scheduling of threads is not implemented on Windows.
///
/// # Errors
///
/// Always.
pub(crate) fn real_time_thread() -> io::Result<()> {
    Err(io::Error::new(io::ErrorKind::Unsupported, "not implemented on Windows"))
}

/// Real-time scheduling of threads is not implemented on Windows.
///
/// # Errors
///
/// Always.
pub(crate) fn real_time_thread_alone() -> io::Result<()> {
    real_time_thread()
}

/// Windows returns freed memory by itself.
pub(crate) fn return_freed_memory() {}

/// Returns the working set of the process, bytes; `None` if the system does not report it.
pub(crate) fn resident_bytes() -> Option<u64> {
    let size = size_of::<PROCESS_MEMORY_COUNTERS>() as u32;
    let mut counters = PROCESS_MEMORY_COUNTERS { cb: size, ..Default::default() };
    // SAFETY: the handle denotes this process and needs no closing; `counters` has the given size.
    let done = unsafe { GetProcessMemoryInfo(GetCurrentProcess(), &raw mut counters, size) };
    (done != 0).then_some(counters.WorkingSetSize as u64)
}

/// Returns the maximum number of open files and sockets of the process: Windows has no limit.
pub(crate) fn open_files_limit() -> Option<u64> {
    None
}
