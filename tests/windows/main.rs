//! Windows on X servers that need no monitor: Xvfb, and Xorg with its dummy driver, whose monitors can be taken away. Pixels are read back from the
//! server, keys are pressed there. Where a server is missing, the tests are shown as ignored, with the reason; with `STERADIAN_REQUIRE_WINDOWS=1` they
//! fail. The arguments are those of libtest.
#![allow(clippy::unwrap_used, reason = "what must not happen in a test may panic")]

#[path = "../common/theatre.rs"]
mod theatre;

mod absent;
mod desktop;
mod frames;
mod keys;
mod monitors;
mod pictures;
mod program;

use std::process::ExitCode;

use libtest_mimic::{Arguments, Completion, Failed, Trial};

/// If set, and neither empty nor 0, a test that cannot run is a failure.
const REQUIRE_VARIABLE: &str = "STERADIAN_REQUIRE_WINDOWS";

/// A test: it fails by a panic. What it returns as an error is what is missing to run it.
pub type Test = (&'static str, fn() -> Result<(), String>);

fn complete(run: fn() -> Result<(), String>) -> Result<Completion, Failed> {
    let required = std::env::var_os(REQUIRE_VARIABLE).is_some_and(|value| !value.is_empty() && value != "0");
    match run() {
        Ok(()) => Ok(Completion::Completed),
        Err(missing) if required => Err(format!("{REQUIRE_VARIABLE} is set, and {missing}").into()),
        Err(missing) => Ok(Completion::ignored_with(missing)),
    }
}

fn main() -> ExitCode {
    let mut arguments = Arguments::from_args();
    // Each draws with a software driver, which takes all cores.
    arguments.test_threads = Some(1);
    let tests = [absent::TESTS, pictures::TESTS, frames::TESTS, keys::TESTS, monitors::TESTS].concat();
    let trials = tests.into_iter().map(|(name, run)| Trial::ignorable_test(name, move || complete(run)));
    libtest_mimic::run(&arguments, trials.collect()).exit_code()
}
