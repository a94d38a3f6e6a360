//! The headset, on a real OpenXR runtime that needs none: Monado, with the null compositor. See `monado`.
#![allow(clippy::unwrap_used, reason = "what must not happen in a test may panic")]

mod monado;
mod runtime;

use std::process::ExitCode;

fn main() -> ExitCode {
    monado::harness::main(runtime::TESTS, runtime::INNERS)
}
