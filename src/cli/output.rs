//! Checks that the files that commands write are not files that they read.

use std::path::Path;

use super::CliError;
use crate::files;

/// Refuses to write to a file that the same command reads, even under another name: the input would be lost.
pub fn refuse_own_input<'a>(out: &Path, inputs: impl IntoIterator<Item = &'a Path>) -> Result<(), CliError> {
    match inputs.into_iter().find(|input| files::is_same_file(out, input)) {
        None => Ok(()),
        Some(input) if input == out => Err(CliError::Usage(format!(
            "{}: this file is an input, which the output would replace: choose another file for the output",
            out.display()
        ))),
        Some(input) => Err(CliError::Usage(format!(
            "{}: this is the file of the input {}, which the output would replace: choose another file for the output",
            out.display(),
            input.display()
        ))),
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failed assumption of a test panics")]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn an_input_is_no_output_under_any_name() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        fs::write(path("in"), "x").unwrap();
        fs::write(path("other"), "x").unwrap();
        fs::hard_link(path("in"), path("linked")).unwrap();
        let refused = |out: &Path| refuse_own_input(out, [&*path("none"), &*path("in")]);
        let detour = folder.path().join(".").join("in");
        for out in [path("in"), detour, path("linked")] {
            let error = refused(&out).unwrap_err();
            assert!(matches!(&error, CliError::Usage(text) if text.contains("choose another file")), "{error}");
        }
        // Paths that lead to no existing file are accepted.
        for out in ["other", "new", "none"] {
            assert!(refused(&path(out)).is_ok(), "{out}");
        }
    }
}
