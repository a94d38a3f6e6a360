//! The program: arguments in, exit code out.

use std::io::{self, Write};
use std::process::ExitCode;

use clap::Parser;
use steradian::cli::{self, BAD_USAGE, Cli, CliError, FAILED};

fn main() -> ExitCode {
    let arguments = match Cli::try_parse() {
        Ok(arguments) => arguments,
        // Help and version come this way too, and go to standard output.
        Err(message) => {
            let code = if message.use_stderr() { BAD_USAGE } else { 0 };
            return if message.print().is_ok() { ExitCode::from(code) } else { ExitCode::from(code.max(FAILED)) };
        }
    };
    match cli::run(arguments) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) if error.is_broken_pipe() => ExitCode::SUCCESS,
        Err(error) => report(&error),
    }
}

/// The one place where errors are told.
fn report(error: &CliError) -> ExitCode {
    // Where standard error is gone too, the exit code still says it.
    match writeln!(io::stderr(), "error: {error}") {
        Ok(()) | Err(_) => ExitCode::from(error.exit_code()),
    }
}
