//! The command line: one file per subcommand.
//!
//! Results go to standard output through `results`; logs and progress go to standard error. Every error returns to
//! `main` as a [`CliError`], which knows its exit code.

mod audits;
mod cache;
mod catalogue;
mod chart;
mod cluster;
mod daemon_access;
mod dome;
mod ending;
mod error;
mod explain;
mod film;
mod info;
mod inputs;
mod load;
mod logging;
mod numbers;
mod output;
mod progress;
mod projectors;
mod psf;
mod render;
mod results;
mod serve;
mod show;
mod telemetry;
mod token;
mod verify;
mod xr;

use std::sync::{Mutex, MutexGuard, PoisonError};

pub use chart::Daemons;
use clap::{Parser, Subcommand};
pub use error::{BAD_DATA, BAD_USAGE, CliError, FAILED, NO_ADAPTER};
pub use projectors::with_joined_eye;

use crate::{
    gpu::{GpuOptions, RestrictionError},
    render::{SHADER_FOLDER_VARIABLE, checked_shader_folder},
};

/// Locks a mutex whose holders never panic, so that poisoned data is still consistent.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Arguments of the program.
#[derive(Debug, Parser)]
#[command(
    name = "steradian",
    version,
    about = "Renders a space scene in many views at once, each pixel with the correct luminance for its solid angle.",
    after_help = "Examples:\n  \
        steradian render --config configs/demo.toml --out out\n  \
        steradian film --config configs/dome.toml --path paths/flight.toml --frames 0..240 --out film\n  \
        steradian serve --config configs/demo.toml --listen 127.0.0.1:7143\n  \
        steradian show --config configs/windows.toml\n  \
        steradian info --json\n  \
        steradian projectors import dome.mpcdi --out dome.toml\n  \
        steradian dome check --config dome.toml\n  \
        steradian verify --set stars.method=auto\n  \
        steradian chart --out chart --quick\n  \
        steradian catalogue synth --stars 1000000 --seed 1 --out galaxy.stars\n  \
        steradian catalogue info galaxy.stars\n  \
        steradian xr --config configs/headset.toml\n  \
        steradian cluster check --config configs/cluster.toml\n  \
        steradian token --name desk-1 --role steer\n  \
        steradian psf --aperture hexagon --diameter-mm 2 --out hexagon.exr\n\n\
        Exit codes: 0 done, 1 a check or job failed, 64 bad usage or configuration, 65 bad input data, 69 no usable adapter (or no display for windows, no ffmpeg for a video)."
)]
pub struct Cli {
    /// Graphics adapter to use: part of its name, case-insensitive.
    #[arg(long, global = true, value_name = "NAME")]
    pub adapter: Option<String>,
    /// Restrict the adapter, to test the program as if on a less capable adapter: a list of webgpu (the default limits of WebGPU), no-64-bit-atomics,
    /// no-float-blending, no-timestamps, storage-buffers=N, binding-mib=N.
    #[arg(long, global = true, value_name = "LIST", value_parser = restrictions)]
    pub adapter_limits: Option<GpuOptions>,
    /// Log messages on standard error: a level (error, warn, info, debug, trace) or filters per module.
    /// Default: the environment variable STERADIAN_LOG, otherwise info.
    #[arg(long, global = true, value_name = "FILTER")]
    pub log: Option<String>,
    /// Compute everything again, and keep nothing for later runs; see `steradian cache --help`.
    #[arg(long, global = true)]
    pub no_cache: bool,
    /// Command to run.
    #[command(subcommand)]
    pub command: Command,
}

fn restrictions(text: &str) -> Result<GpuOptions, RestrictionError> {
    GpuOptions::default().restricted(text)
}

/// The subcommands.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Render every view of a configuration once into files.
    Render(render::RenderArguments),
    /// Render numbered frames along a path; a frame depends only on its number.
    Film(film::FilmArguments),
    /// Run the daemon: renders views for clients over gRPC until SIGINT or SIGTERM.
    Serve(serve::ServeArguments),
    /// Show views in windows on the monitors of this machine.
    Show(show::ShowArguments),
    /// Run the failure tests on the adapter of this machine, each with figures and limits.
    Verify(verify::VerifyArguments),
    /// Show the adapter, its driver, the features and limits used, and the fallbacks in use.
    Info(info::InfoArguments),
    /// Compare speed and accuracy of every method.
    Chart(chart::ChartArguments),
    /// Work with the projectors of a dome.
    Dome(dome::DomeArguments),
    /// Convert the files of projector installers to configurations.
    Projectors(projectors::ProjectorsArguments),
    /// Work with star catalogues.
    Catalogue(catalogue::CatalogueArguments),
    /// Compute the point-spread function of an aperture, or convert one.
    Psf(psf::PsfArguments),
    /// Show or remove data kept between runs: synthetic stars, tables of projectors, atlases of asteroids.
    Cache(cache::CacheArguments),
    /// Work with a cluster of daemons.
    Cluster(cluster::ClusterArguments),
    /// Make an access token for a client, and the configuration lines that accept it.
    Token(token::TokenArguments),
    /// Show a scene in the headset of the system's OpenXR runtime.
    Xr(xr::XrArguments),
}

/// Runs a parsed command line.
pub fn run(arguments: Cli) -> Result<(), CliError> {
    let _exporting = logging::start(arguments.log.as_deref())?;
    if let Some(folder) = checked_shader_folder()? {
        tracing::warn!("shaders are read from {} ({SHADER_FOLDER_VARIABLE})", folder.display());
    }
    cache::set(arguments.no_cache)?;
    let gpu = GpuOptions { adapter: arguments.adapter, ..arguments.adapter_limits.unwrap_or_default() };
    match arguments.command {
        Command::Render(command) => render::run(command, &gpu),
        Command::Film(command) => film::run(command, &gpu),
        Command::Serve(command) => serve::run(command, &gpu),
        Command::Show(command) => show::run(command, &gpu),
        Command::Verify(command) => verify::run(command, &gpu),
        Command::Info(command) => info::run(&command, &gpu),
        Command::Chart(command) => chart::run(&command, &gpu, arguments.no_cache),
        Command::Dome(command) => dome::run(&command),
        Command::Projectors(command) => projectors::run(&command),
        Command::Catalogue(command) => catalogue::run(command),
        Command::Psf(command) => psf::run(&command),
        Command::Cache(command) => cache::run(&command),
        Command::Cluster(command) => cluster::run(&command),
        Command::Token(command) => token::run(&command),
        Command::Xr(command) => xr::run(command, &gpu),
    }
}
