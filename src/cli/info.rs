//! `info`: prints the adapter, its driver, the features and limits used, and the fallbacks in use.

use clap::Args;
use serde::Serialize;

use super::{CliError, results};
use crate::{
    gpu::{AdapterReport, Gpu, GpuOptions, Need},
    render::{SHADER_FOLDER_VARIABLE, checked_shader_folder},
};

/// Arguments of `info`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  steradian info\n  steradian info --json --adapter llvmpipe")]
pub struct InfoArguments {
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

/// The report as JSON.
#[derive(Serialize)]
struct Report<'a> {
    #[serde(flatten)]
    adapter: &'a AdapterReport,
    /// The requirements of all passes, each with the adapter's limit.
    needs: &'a [Need],
    /// Folder of the shaders, if they are not those built into the program.
    #[serde(skip_serializing_if = "Option::is_none")]
    shaders: Option<String>,
}

/// Runs the command.
pub fn run(arguments: &InfoArguments, options: &GpuOptions) -> Result<(), CliError> {
    let gpu = Gpu::open(options)?;
    let report = Report {
        adapter: gpu.report(),
        needs: gpu.needs(),
        shaders: checked_shader_folder()?.map(|folder| folder.display().to_string()),
    };
    if arguments.json {
        return results::line(serde_json::to_string_pretty(&report).map_err(CliError::Json)?);
    }
    results::line(report.adapter)?;
    match report.shaders {
        Some(folder) => results::line(format_args!("shaders    {folder} ({SHADER_FOLDER_VARIABLE})")),
        None => Ok(()),
    }
}
