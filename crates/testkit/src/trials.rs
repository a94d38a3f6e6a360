//! Tests that need something a machine may not have: where it is missing they are shown as ignored, with the reason, unless a variable of the environment
//! requires them.

use std::process::ExitCode;

use libtest_mimic::{Arguments, Completion, Failed, Trial};

/// A test: it fails by a panic. What it returns as an error is what is missing to run it.
pub type Test = (&'static str, fn() -> Result<(), String>);

fn complete(run: fn() -> Result<(), String>, variable: &str) -> Result<Completion, Failed> {
    let required = std::env::var_os(variable).is_some_and(|value| !value.is_empty() && value != "0");
    match run() {
        Ok(()) => Ok(Completion::Completed),
        Err(missing) if required => Err(format!("{variable} is set, and {missing}").into()),
        Err(missing) => Ok(Completion::ignored_with(missing)),
    }
}

/// Runs them one after the other, since each draws with a software driver, which takes all cores. The arguments are those of libtest. With `variable` set, and
/// neither empty nor 0, a test that cannot run is a failure.
pub fn main(variable: &'static str, tests: &[&[Test]]) -> ExitCode {
    let mut arguments = Arguments::from_args();
    arguments.test_threads = Some(1);
    let tests = tests.concat().into_iter();
    let trials = tests.map(|(name, run)| Trial::ignorable_test(name, move || complete(run, variable)));
    libtest_mimic::run(&arguments, trials.collect()).exit_code()
}
