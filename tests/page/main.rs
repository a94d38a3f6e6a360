//! Tests of the page in Debian's Chromium, served by the built program, with real clicks, drags and keys. Without a
//! browser, or without npm for the test of the bundle, the tests are shown as ignored, with the reason; with
//! `STERADIAN_REQUIRE_PAGE=1` they fail. The arguments are those of libtest.
#![allow(clippy::unwrap_used, reason = "a test may panic on unexpected values")]

use testkit::trials;

mod browser;
mod bundle;
mod daemon;
mod forms;
mod panels;
mod pictures;
mod session;
mod sky;

use std::process::ExitCode;

pub use trials::Test;

fn main() -> ExitCode {
    trials::main(
        "STERADIAN_REQUIRE_PAGE",
        &[bundle::TESTS, pictures::TESTS, panels::TESTS, forms::TESTS, session::TESTS, sky::TESTS],
    )
}
