//! Tests of the Python package in `python/` with the built program: its tests by pytest, its types by mypy. Without
//! Python or a required package, they are shown as ignored, with the reason; with `STERADIAN_REQUIRE_PYTHON=1` they
//! fail. The protocol description is compared with `proto/` without Python. The job templates in `scripts/farm/` are run by
//! Python programs, too; `STERADIAN_REQUIRE_FARM=1` requires these. So are imports of catalogues; `STERADIAN_REQUIRE_HATS=1` requires the one that needs
//! hats-import. The arguments are those of libtest.
#![allow(clippy::unwrap_used, reason = "a test may panic on unexpected values")]

use testkit::trials;

mod catalogues;
mod farm;
mod protocol;
mod suites;

use std::process::ExitCode;

pub use trials::Test;

fn main() -> ExitCode {
    let python = "STERADIAN_REQUIRE_PYTHON";
    trials::main_of(&[
        (python, protocol::TESTS),
        (python, suites::TESTS),
        (python, catalogues::TESTS),
        ("STERADIAN_REQUIRE_FARM", farm::TESTS),
        ("STERADIAN_REQUIRE_HATS", catalogues::HATS_TESTS),
    ])
}
