//! Priority of threads, memory and open files of this process.
#![cfg_attr(
    target_os = "linux",
    expect(
        unsafe_code,
        reason = "neither the standard library nor `rustix` has `malloc_trim` and `sched_setscheduler`"
    )
)]

use std::io;

/// Lowers the priority of the calling thread and of the threads that it starts afterwards.
///
/// # Errors
///
/// The system refuses, or has no priorities of threads.
pub(crate) fn lower_thread_priority() -> io::Result<()> {
    /// Difference in the steps of the system's `nice` value.
    #[cfg(target_os = "linux")]
    const STEPS: i32 = 10;
    // Elsewhere this call concerns the whole process.
    #[cfg(target_os = "linux")]
    return Ok(rustix::process::setpriority_process(None, STEPS)?);
    #[cfg(not(target_os = "linux"))]
    Err(io::Error::new(io::ErrorKind::Unsupported, "this system has no priorities of single threads"))
}

/// Gives the calling thread, and the threads that it starts afterwards, real-time scheduling (`SCHED_RR`) with a low priority.
///
/// # Errors
///
/// The system refuses: `LimitRTPRIO=` of the unit, or `ulimit -r`, is too low.
pub(crate) fn real_time_thread() -> io::Result<()> {
    #[cfg(feature = "cluster")]
    return round_robin();
    #[cfg(not(feature = "cluster"))]
    Err(io::Error::new(io::ErrorKind::Unsupported, "the program was built without the feature `cluster`"))
}

/// Gives the calling thread alone real-time scheduling, with a priority below that of [`real_time_thread`]. Threads that it starts have none.
///
/// # Errors
///
/// The system refuses: `LimitRTPRIO=` of the unit, or `ulimit -r`, is too low. Only Linux can exclude the threads that it starts.
pub(crate) fn real_time_thread_alone() -> io::Result<()> {
    #[cfg(target_os = "linux")]
    {
        let parameters = libc::sched_param { sched_priority: 9 };
        // SAFETY: 0 is the calling thread, and `parameters` outlives the call.
        let done =
            unsafe { libc::sched_setscheduler(0, libc::SCHED_RR | libc::SCHED_RESET_ON_FORK, &raw const parameters) };
        if done == 0 { Ok(()) } else { Err(io::Error::last_os_error()) }
    }
    #[cfg(not(target_os = "linux"))]
    Err(io::Error::new(io::ErrorKind::Unsupported, "this system has no real-time scheduling of a thread alone"))
}

#[cfg(feature = "cluster")]
fn round_robin() -> io::Result<()> {
    use thread_priority::{
        RealtimeThreadSchedulePolicy::RoundRobin, ThreadPriority, ThreadSchedulePolicy::Realtime,
        set_thread_priority_and_policy, thread_native_id,
    };
    let refused = |error: &dyn std::fmt::Debug| io::Error::other(format!("{error:?}"));
    let priority = ThreadPriority::try_from(10_u8).map_err(|error| refused(&error))?;
    set_thread_priority_and_policy(thread_native_id(), priority, Realtime(RoundRobin)).map_err(|error| match error {
        thread_priority::Error::OS(code) => io::Error::from_raw_os_error(code),
        error => refused(&error),
    })
}

/// Returns freed memory to the system. The allocator of glibc keeps it for each thread; others return it by themselves.
pub(crate) fn return_freed_memory() {
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    // SAFETY: the function may be called at any time on any thread.
    unsafe {
        libc::malloc_trim(0);
    }
}

/// Returns the resident memory of the process, bytes; `None` if the system does not report it.
pub(crate) fn resident_bytes() -> Option<u64> {
    let text = std::fs::read_to_string("/proc/self/statm").ok()?;
    let pages: u64 = text.split_whitespace().nth(1)?.parse().ok()?;
    Some(pages * rustix::param::page_size() as u64)
}

/// Returns the maximum number of open files and sockets of the process; `None`: no limit.
pub(crate) fn open_files_limit() -> Option<u64> {
    rustix::process::getrlimit(rustix::process::Resource::Nofile).current
}
