//! Priority of threads, memory and open files of this process.
#![expect(
    unsafe_code,
    reason = "neither the standard library nor `rustix` has `malloc_trim` and `pthread_setschedparam`"
)]

use std::io;

/// Lowers the priority of the calling thread and of the threads that it starts afterwards.
///
/// # Errors
///
/// The system refuses, or has no priorities of threads.
pub(crate) fn lower_thread_priority() -> io::Result<()> {
    /// Increase of the system's `nice` value.
    #[cfg(target_os = "linux")]
    const STEPS: i32 = 10;
    // On other systems, this call would affect the whole process.
    #[cfg(target_os = "linux")]
    return Ok(rustix::process::setpriority_process(None, STEPS)?);
    #[cfg(not(target_os = "linux"))]
    Err(io::Error::new(io::ErrorKind::Unsupported, "this system cannot set the priority of a single thread"))
}

/// Gives the calling thread, and the threads that it starts afterwards, real-time scheduling (`SCHED_RR`) with a low priority.
///
/// # Errors
///
/// The system refuses: `LimitRTPRIO=` of the unit, or `ulimit -r`, is too low.
pub(crate) fn real_time_thread() -> io::Result<()> {
    round_robin(10, 0)
}

/// Gives the calling thread alone real-time scheduling, with a priority below that of [`real_time_thread`]. Threads that it starts do not inherit it.
///
/// # Errors
///
/// The system refuses: `LimitRTPRIO=` of the unit, or `ulimit -r`, is too low. Only Linux can exclude the threads that it starts.
pub(crate) fn real_time_thread_alone() -> io::Result<()> {
    #[cfg(target_os = "linux")]
    return round_robin(9, libc::SCHED_RESET_ON_FORK);
    #[cfg(not(target_os = "linux"))]
    Err(io::Error::new(io::ErrorKind::Unsupported, "this system cannot give real-time scheduling to a single thread"))
}

/// Replaces this process by a new run of the same program, with the same arguments and one more variable in its environment. Returns only if the
/// system refuses.
#[cfg(feature = "cluster")]
pub(crate) fn run_again_with(name: &str, value: &str) -> io::Error {
    use std::os::unix::process::CommandExt as _;
    let program = match std::env::current_exe() {
        Ok(program) => program,
        Err(error) => return error,
    };
    let mut arguments = std::env::args_os();
    let mut command = std::process::Command::new(program);
    if let Some(own) = arguments.next() {
        command.arg0(own);
    }
    command.args(arguments).env(name, value).exec()
}

/// Sets the scheduling policy of the calling thread to `SCHED_RR`, with a priority and flags.
fn round_robin(priority: libc::c_int, flags: libc::c_int) -> io::Result<()> {
    // SAFETY: every field is a number or an array of bytes. Some systems have fields that this code cannot name.
    let mut parameters: libc::sched_param = unsafe { std::mem::zeroed() };
    parameters.sched_priority = priority;
    // SAFETY: the thread is the calling one, and `parameters` outlives the call.
    let code =
        unsafe { libc::pthread_setschedparam(libc::pthread_self(), libc::SCHED_RR | flags, &raw const parameters) };
    if code == 0 { Ok(()) } else { Err(io::Error::from_raw_os_error(code)) }
}

/// Returns freed memory to the system. The allocator of glibc keeps it for each thread; other allocators return it by themselves.
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
