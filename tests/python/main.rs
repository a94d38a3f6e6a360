//! Tests of the Python package in `python/` with the built program: its tests by pytest, its types by mypy. Without
//! Python or a required package, they are shown as ignored, with the reason; with `STERADIAN_REQUIRE_PYTHON=1` they
//! fail. The protocol description is compared with `proto/` without Python. Python programs also run the job templates in `scripts/farm/`;
//! `STERADIAN_REQUIRE_FARM=1` makes these tests fail if they cannot run. Imports of catalogues are checked by Python programs too;
//! `STERADIAN_REQUIRE_HATS=1` does the same for the test that needs hats-import. The arguments are those of libtest.
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
