//! `verify`: runs the failure tests on this machine's adapter.

use std::path::{Path, PathBuf};
use std::{fs, io};

use clap::Args;
use serde::Serialize;

use super::{CliError, results};
use crate::config::Config;
use crate::files;
use crate::gpu::{Gpu, GpuOptions};
use crate::output::OutputError;
use crate::render::Renderer;
use crate::verify::{self, CheckResult, Outcome};

/// Arguments of `verify`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    steradian verify\n  \
    steradian verify --filter slow-pan-flicker --set stars.method=tent\n  \
    steradian verify --filter sums --json verify.json --set stars.method=packed_cas\n\n\
    Prints one line per check: its number in the list of failure cases, its name, pass, FAIL or n/a, and each figure with\n\
    its limit. Exit code 0 if every check that applies to the method passes, otherwise 1.")]
pub struct VerifyArguments {
    /// Write the results to a file as JSON.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Run only these checks: a name, part of a name, a group, or a number.
    #[arg(long, value_name = "NAME")]
    filter: Option<String>,
    /// Override a key of the configuration, such as stars.method; can be repeated.
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
}

/// Contents of the file of `--json`.
#[derive(Serialize)]
struct Report<'a> {
    adapter: &'a str,
    method: &'a str,
    checks: &'a [CheckResult],
}

/// Runs the command.
pub fn run(arguments: VerifyArguments, options: &GpuOptions) -> Result<(), CliError> {
    let checks =
        verify::select(arguments.filter.as_deref()).map_err(|error| CliError::Usage(format!("--filter: {error}")))?;
    let settings = Config::from_text("", "default configuration", Path::new(""), &arguments.set)?.render_settings();
    if let Some(path) = &arguments.json {
        let folder = files::folder_of(path);
        if !folder.is_dir() {
            let problem = format!("the folder {} does not exist", folder.display());
            let source = io::Error::new(io::ErrorKind::NotFound, problem);
            return Err(OutputError::Write { path: path.clone(), source }.into());
        }
    }
    let mut renderer = Renderer::new(Gpu::open(options)?);
    let mut done = Vec::with_capacity(checks.len());
    for (index, check) in checks.iter().enumerate() {
        tracing::info!("{} ({} of {}): {}", check.name, index + 1, checks.len(), check.proves);
        let result = verify::run(check, &mut renderer, &settings);
        results::line(&result)?;
        done.push(result);
    }
    if let Some(path) = &arguments.json {
        let (adapter, method) = (&renderer.adapter().adapter, settings.stars.method.name());
        let report = Report { adapter, method, checks: &done };
        let text = serde_json::to_string_pretty(&report).map_err(CliError::Json)?;
        fs::write(path, text + "\n").map_err(|source| CliError::WriteFile { path: path.clone(), source })?;
    }
    let count = |outcome: Outcome| done.iter().filter(|result| result.outcome == outcome).count();
    let (passed, failed) = (count(Outcome::Pass), count(Outcome::Fail));
    tracing::info!(
        "{}: {passed} passed, {failed} failed, {} do not apply",
        settings.stars.method.name(),
        done.len() - passed - failed
    );
    if failed > 0 || passed == 0 { Err(CliError::Checks { failed, total: passed + failed }) } else { Ok(()) }
}
