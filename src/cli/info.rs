//! `info`: prints the adapter, its driver, the features and limits used, and the fallbacks in use.

use clap::Args;

use super::{CliError, results};
use crate::gpu::{Gpu, GpuOptions};

/// Arguments of `info`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  steradian info\n  steradian info --json --adapter llvmpipe")]
pub struct InfoArguments {
    /// Print JSON.
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
