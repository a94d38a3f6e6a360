//! Runs tests that need something that a machine may lack. Without it they are reported as ignored, with the reason; if an environment variable
//! requires them, they fail.

use std::process::ExitCode;

use libtest_mimic::{Arguments, Completion, Failed, Trial};

/// Name and function of a test. The test fails by a panic; if it cannot run, it returns an error that names the missing prerequisite.
pub type Test = (&'static str, fn() -> Result<(), String>);

/// Part of the names of long tests, which run with `--ignored` only (`make test-long`).
const LONG: &str = "::long::";

fn complete(run: fn() -> Result<(), String>, variable: &str) -> Result<Completion, Failed> {
    let required = std::env::var_os(variable).is_some_and(|value| !value.is_empty() && value != "0");
    match run() {
        Ok(()) => Ok(Completion::Completed),
        Err(missing) if required => Err(format!("{variable} is set, and {missing}").into()),
        Err(missing) => Ok(Completion::ignored_with(missing)),
    }
}

/// Reads the arguments, which are those of libtest. By default, two tests run at once: each draws with a software driver that uses all cores, but
/// waits for other processes half of the time.
pub fn arguments() -> Arguments {
    let mut arguments = Arguments::from_args();
    arguments.test_threads = arguments.test_threads.or(Some(2));
    arguments
}

/// Runs the tests. If `variable` is set and neither empty nor 0, a test that cannot run fails.
pub fn main(variable: &'static str, tests: &[&[Test]]) -> ExitCode {
    let groups: Vec<(&'static str, &[Test])> = tests.iter().map(|tests| (variable, *tests)).collect();
    main_of(&groups)
}

/// Like [`main`], with a variable for each group of tests.
pub fn main_of(groups: &[(&'static str, &[Test])]) -> ExitCode {
    let tests = groups.iter().flat_map(|(variable, tests)| tests.iter().map(|test| (*variable, *test)));
    let trials = tests.map(|(variable, (name, run))| {
        Trial::ignorable_test(name, move || complete(run, variable)).with_ignored_flag(name.contains(LONG))
    });
    libtest_mimic::run(&arguments(), trials.collect()).exit_code()
}
