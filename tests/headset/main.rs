//! The headset on a real OpenXR runtime that needs no hardware: Monado with the null compositor. See `monado`.
#![allow(clippy::unwrap_used, reason = "a failed precondition of a test may panic")]

use testkit::figures;

mod absent;
mod daemon;
mod flying;
mod monado;
mod pixels;
mod program;
mod runtime;
mod sessions;
mod wearer;

use std::process::ExitCode;

fn main() -> ExitCode {
    let tests = [runtime::TESTS, pixels::TESTS, sessions::TESTS, daemon::TESTS, flying::TESTS, absent::TESTS].concat();
    let inners = [runtime::INNERS, pixels::INNERS, wearer::INNERS].concat();
    monado::harness::main(&tests, &inners)
}
