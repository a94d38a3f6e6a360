//! `serve`: the daemon.

use std::net::SocketAddr;
use std::path::PathBuf;
use std::sync::Arc;

use clap::Args;

use super::{CliError, load, results};
use crate::config::{Config, parse_listen};
use crate::frame::Renderer;
use crate::gpu::{Gpu, GpuOptions};
use crate::scene::SceneSnapshot;
use crate::service::{self, ServeOptions};

/// Arguments of `serve`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    steradian serve\n  \
    steradian serve --config configs/mission-control.toml --listen 0.0.0.0:7143\n  \
    steradian serve --listen 127.0.0.1:0     # takes a free port and prints it\n\n\
    Prints `listening on ADDR` when clients can connect. SIGINT and SIGTERM drain and end it.")]
pub struct ServeArguments {
    /// The configuration; without it a dome and a flat view of bright and synthetic stars.
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Address to listen on, before the configuration's.
    #[arg(long, value_name = "ADDR", value_parser = parse_listen)]
    listen: Option<String>,
    /// Change a key of the configuration; may be given several times.
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
}

/// Runs the command.
pub fn run(arguments: ServeArguments, adapter: Option<String>) -> Result<(), CliError> {
    let config = match &arguments.config {
        Some(path) => Config::load(path, &arguments.set)?,
        None => Config::built_in(&arguments.set)?,
    };
    let (rig, camera) = (config.rig()?, config.camera()?);
    let renderer = Renderer::new(Gpu::open(&GpuOptions { adapter, ..GpuOptions::default() })?);
    renderer.check(&rig).map_err(|error| CliError::render(error, &config.origin))?;
    let (stars, _) = load::stars(&config.star_sources(), &config.origin)?;
    let scene = SceneSnapshot { revision: 1, stars: Arc::new(stars), camera };

    let listen = arguments.listen.unwrap_or_else(|| config.server.listen.clone());
    let options = ServeOptions::new(listen, Box::new(renderer), scene, rig, config.render_settings(), announce);
    let runtime = tokio::runtime::Builder::new_multi_thread().enable_all().build().map_err(CliError::Runtime)?;
    runtime.block_on(service::run(options)).map_err(CliError::Serve)
}

/// The line that scripts wait for.
fn announce(address: SocketAddr) {
    if let Err(error) = results::line(format!("listening on {address}")) {
        // The daemon is of use without a reader of its output.
        tracing::warn!("{error}");
    }
}
