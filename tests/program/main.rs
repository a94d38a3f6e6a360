//! The built program as users and scripts see it, and its documentation.
#![allow(clippy::unwrap_used, reason = "a failed precondition of a test may panic")]

use testkit::exr_file;
use testkit::figures;

mod adapters;
mod cache;
mod command_line;
mod configuration_reference;
#[cfg(unix)]
mod daemon;
mod documentation;
mod dome;
#[cfg(unix)]
mod farm;
mod features;
mod film;
mod film_blur;
#[cfg(unix)]
mod film_record;
mod film_status;
#[cfg(target_os = "linux")]
mod local_daemon;
mod measured;
#[cfg(unix)]
mod small_pictures;
mod stereo_dome;
