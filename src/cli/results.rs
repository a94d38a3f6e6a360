//! Standard output in one place: writes the results of commands line by line.

use std::fmt::Display;
use std::io::{self, Write};

use super::CliError;

/// Writes one line to standard output and flushes it, so that a waiting script receives it at once.
pub fn line(text: impl Display) -> Result<(), CliError> {
    let mut out = io::stdout().lock();
    writeln!(out, "{text}")?;
    out.flush()?;
    Ok(())
}
