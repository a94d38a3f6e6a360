//! The `main` function of a test binary for tests that need Monado: libtest cannot ignore a test at run time, so such a
//! binary has `harness = false`. If Monado cannot run, its tests are reported as ignored with the reason; with
//! `STERADIAN_REQUIRE_XR=1` they fail. The arguments are those of libtest.

use std::process::ExitCode;

use libtest_mimic::{Completion, Failed, Trial};
use testkit::trials;

use super::Monado;

/// Environment variable with the name of the function to run instead of the tests: see [`super::Service::run_inner`].
pub const INNER_VARIABLE: &str = "STERADIAN_TEST_INNER";
/// Environment variable that makes tests fail if they cannot run. It must be set, and neither empty nor 0.
pub const REQUIRE_VARIABLE: &str = "STERADIAN_REQUIRE_XR";

/// A test, which fails by a panic.
#[derive(Clone, Copy)]
pub enum Test {
    /// Needs Monado.
    WithMonado(&'static str, fn(&'static Monado)),
    /// Needs Monado and takes long: `make test-long`.
    Long(&'static str, fn(&'static Monado)),
    /// Runs anywhere.
    Anywhere(&'static str, fn()),
}

/// A function that runs in a separate process, which is started through Monado's dynamic linker. Its result is what it
/// prints.
pub type Inner = (&'static str, fn());

/// Runs the inner function named in the environment, or the tests.
pub fn main(tests: &[Test], inners: &[Inner]) -> ExitCode {
    if let Some(wanted) = std::env::var_os(INNER_VARIABLE) {
        let (_, inner) = inners
            .iter()
            .find(|(name, _)| *name == wanted)
            .unwrap_or_else(|| panic!("no inner function is named {}", wanted.display()));
        inner();
        return ExitCode::SUCCESS;
    }
    let tests = tests.iter().map(|&test| match test {
        Test::WithMonado(name, run) => Trial::ignorable_test(name, move || with_monado(run)),
        Test::Long(name, run) => Trial::ignorable_test(name, move || with_monado(run)).with_ignored_flag(true),
        Test::Anywhere(name, run) => Trial::test(name, move || {
            run();
            Ok::<(), Failed>(())
        }),
    });
    libtest_mimic::run(&trials::arguments(), tests.collect()).exit_code()
}

fn with_monado(run: fn(&'static Monado)) -> Result<Completion, Failed> {
    match Monado::find() {
        Ok(monado) => {
            run(monado);
            Ok(Completion::Completed)
        }
        Err(reason) if required() => {
            Err(format!("{REQUIRE_VARIABLE} is set, and Monado is not available: {reason}").into())
        }
        Err(reason) => Ok(Completion::ignored_with(format!("no Monado: {reason}"))),
    }
}

fn required() -> bool {
    std::env::var_os(REQUIRE_VARIABLE).is_some_and(|value| !value.is_empty() && value != "0")
}
