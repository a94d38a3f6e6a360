//! Tests that need something that a machine may lack: without it they are reported as ignored with the reason, unless
//! an environment variable requires them.

use std::process::ExitCode;

use libtest_mimic::{Arguments, Completion, Failed, Trial};

/// A test, which fails by a panic. It returns an error if it cannot run, which names the missing prerequisite.
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

/// The arguments, which are those of libtest. Unless they say otherwise, two tests run at once: each draws with a software
/// driver that uses all cores, and waits for other processes half of its time.
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

/// The same with a variable for each group of tests.
pub fn main_of(groups: &[(&'static str, &[Test])]) -> ExitCode {
    let tests = groups.iter().flat_map(|(variable, tests)| tests.iter().map(|test| (*variable, *test)));
    let trials = tests.map(|(variable, (name, run))| {
        Trial::ignorable_test(name, move || complete(run, variable)).with_ignored_flag(name.contains(LONG))
    });
    libtest_mimic::run(&arguments(), trials.collect()).exit_code()
}
