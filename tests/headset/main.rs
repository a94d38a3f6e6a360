//! The headset, on a real OpenXR runtime that needs none: Monado, with the null compositor. See `monado`.
#![allow(clippy::unwrap_used, reason = "what must not happen in a test may panic")]

mod monado;
mod pixels;
mod runtime;

use std::process::ExitCode;

fn main() -> ExitCode {
    let tests = [runtime::TESTS, pixels::TESTS].concat();
    let inners = [runtime::INNERS, pixels::INNERS].concat();
    monado::harness::main(&tests, &inners)
}
