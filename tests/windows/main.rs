//! Tests windows on X servers that need no monitor: Xvfb, and Xorg with its dummy driver, whose monitors can be
//! disconnected. Pixels are read back from the server, and keys are pressed there. If a server is missing, the tests
//! are reported as ignored with the reason; with `STERADIAN_REQUIRE_WINDOWS=1` they fail. The arguments are those of
//! libtest.
#![allow(clippy::unwrap_used, reason = "a failed precondition of a test may panic")]

use testkit::theatre;
use testkit::trials;

mod absent;
#[cfg(feature = "cluster")]
mod cluster;
mod desktop;
mod frames;
mod keys;
mod monitors;
mod pictures;
mod program;
#[cfg(feature = "cluster")]
mod stamps;

use std::process::ExitCode;

pub use trials::Test;

fn main() -> ExitCode {
    let mut tests = vec![absent::TESTS, pictures::TESTS, frames::TESTS, keys::TESTS, monitors::TESTS];
    #[cfg(feature = "cluster")]
    tests.push(cluster::TESTS);
    trials::main("STERADIAN_REQUIRE_WINDOWS", &tests)
}
