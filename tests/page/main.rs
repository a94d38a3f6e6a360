//! The page in Debian's Chromium, served by the built program: real clicks, drags and keys. Where there is no browser, or for the bundle no npm, the tests
//! are shown as ignored, with the reason; with `STERADIAN_REQUIRE_PAGE=1` they fail. The arguments are those of libtest.
#![allow(clippy::unwrap_used, reason = "what must not happen in a test may panic")]

use testkit::trials;

mod browser;
mod bundle;
mod daemon;
mod forms;
mod panels;
mod pictures;
mod session;

use std::process::ExitCode;

pub use trials::Test;

fn main() -> ExitCode {
    trials::main(
        "STERADIAN_REQUIRE_PAGE",
        &[bundle::TESTS, pictures::TESTS, panels::TESTS, forms::TESTS, session::TESTS],
    )
}
