//! Finds ports for servers that a test starts later.

use std::{
    fs,
    io::ErrorKind,
    net::TcpListener,
    process,
    sync::atomic::{AtomicU16, Ordering::Relaxed},
};

/// First port that tests use.
const FIRST: u16 = 10_000;

/// Returns the first of the ports from which the system chooses if a socket does not name one. On systems other than Linux, this is the first dynamic
/// port of RFC 6335.
fn first_of_system() -> u16 {
    let range = fs::read_to_string("/proc/sys/net/ipv4/ip_local_port_range");
    range.ok().and_then(|text| text.split_whitespace().next()?.parse().ok()).unwrap_or(49_152)
}

/// Returns whether a port is free at the loopback addresses of IPv4 and, if the system has it, IPv6.
fn is_free(port: u16) -> bool {
    let in_use =
        |address: &str| TcpListener::bind((address, port)).is_err_and(|error| error.kind() == ErrorKind::AddrInUse);
    !in_use("127.0.0.1") && !in_use("::1")
}

/// Returns a port that is free at both loopback addresses. Each call in a process returns another port.
///
/// The system never assigns it to a socket of another test, so a server can open it seconds later, and again after a restart.
pub fn free_port() -> u16 {
    static CALLS: AtomicU16 = AtomicU16::new(0);
    let ports = first_of_system().checked_sub(FIRST).filter(|count| *count >= 1000).expect("ports below the system's");
    // Processes that run at the same time begin at distant ports.
    let first = (process::id() % 199) as u16 * (ports / 199);
    let next = || FIRST + (first + CALLS.fetch_add(1, Relaxed)) % ports;
    (0..ports).map(|_| next()).find(|port| is_free(*port)).expect("a free port")
}
