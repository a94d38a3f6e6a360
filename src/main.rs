//! The program: arguments in, exit code out.

use std::io::{self, Write};
use std::process::ExitCode;

use clap::Parser;
use steradian::cli::{self, BAD_USAGE, Cli, CliError, FAILED};

fn main() -> ExitCode {
    let arguments = match Cli::try_parse_from(cli::with_joined_eye(std::env::args_os())) {
        Ok(arguments) => arguments,
        // Help and version also arrive as `Err`, and are printed to standard output.
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

/// Prints an error. No other code prints errors.
fn report(error: &CliError) -> ExitCode {
    // If standard error is closed, the exit code still reports the failure.
    match writeln!(io::stderr(), "error: {error}") {
        Ok(()) | Err(_) => ExitCode::from(error.exit_code()),
    }
}
