//! The Python package in `python/`, against the built program: its tests by pytest, its types by mypy. Where Python or a package of it is absent, these are
//! shown as ignored, with the reason; with `STERADIAN_REQUIRE_PYTHON=1` they fail. Its description of the protocol needs no Python to be compared with
//! `proto/`. The arguments are those of libtest.
#![allow(clippy::unwrap_used, reason = "what must not happen in a test may panic")]

use testkit::trials;

mod protocol;
mod suites;

use std::process::ExitCode;

pub use trials::Test;

fn main() -> ExitCode {
    trials::main("STERADIAN_REQUIRE_PYTHON", &[protocol::TESTS, suites::TESTS])
}
