//! Standard output, in one place: results of commands, line by line.

use std::fmt::Display;
use std::io::{self, Write};

use super::CliError;

/// Writes one line to standard output and sends it off at once, so that a script that waits for it gets it.
pub fn line(text: impl Display) -> Result<(), CliError> {
    let mut out = io::stdout().lock();
    writeln!(out, "{text}")?;
    out.flush()?;
    Ok(())
}
