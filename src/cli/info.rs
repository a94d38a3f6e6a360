//! `info`: the adapter, its driver, what is used of it, and the fallbacks taken.

use clap::Args;

use super::{CliError, results};
use crate::gpu::{Gpu, GpuOptions};

/// Arguments of `info`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  steradian info\n  steradian info --json --adapter llvmpipe")]
pub struct InfoArguments {
    /// As JSON.
    #[arg(long)]
    json: bool,
}

/// Runs the command.
pub fn run(arguments: &InfoArguments, adapter: Option<String>) -> Result<(), CliError> {
    let gpu = Gpu::open(&GpuOptions { adapter, ..GpuOptions::default() })?;
    let report = gpu.report();
    if arguments.json {
        results::line(serde_json::to_string_pretty(report).map_err(CliError::Json)?)
    } else {
        results::line(report)
    }
}
