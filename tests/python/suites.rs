//! Runs pytest and mypy on the package. `STERADIAN_PYTHON` names the interpreter; otherwise `/usr/bin/python3` and
//! `python3` are tried in this order, because the first Python in PATH may lack the packages.

use std::{
    ffi::OsString,
    path::{Path, PathBuf},
    process::{Command, Output},
};

use crate::Test;

pub const TESTS: &[Test] = &[("suites::pytest", pytest), ("suites::mypy", mypy)];

fn package() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("python")
}

pub fn text(output: &Output) -> String {
    String::from_utf8_lossy(&[&output.stdout[..], &output.stderr].concat()).into_owned()
}

/// Finds a Python that has these modules.
pub fn python(modules: &[&str]) -> Result<OsString, String> {
    let named = std::env::var_os("STERADIAN_PYTHON");
    let candidates = named.map_or_else(|| vec!["/usr/bin/python3".into(), "python3".into()], |named| vec![named]);
    let program = format!("import {}", modules.join(", "));
    let mut reasons = Vec::new();
    for candidate in candidates {
        match Command::new(&candidate).args(["-c", &program]).output() {
            Ok(output) if output.status.success() => return Ok(candidate),
            Ok(output) => {
                reasons.push(format!("{}: {}", candidate.display(), text(&output).lines().last().unwrap_or("fails")))
            }
            Err(error) => reasons.push(format!("{}: {error}", candidate.display())),
        }
    }
    Err(format!("no Python has all of {modules:?} ({}): scripts/ensure-python.sh installs them", reasons.join("; ")))
}

/// Runs a Python module in `python/`; panics with its output if it fails.
fn run(python: &OsString, arguments: &[&str]) {
    let output = Command::new(python)
        .arg("-m")
        .args(arguments)
        .current_dir(package())
        .env("PYTHONDONTWRITEBYTECODE", "1")
        .env("STERADIAN_BINARY", env!("CARGO_BIN_EXE_steradian"))
        .output()
        .unwrap();
    let said = text(&output);
    assert!(output.status.success(), "{arguments:?} fails with {}:\n{said}", output.status);
}

fn pytest() -> Result<(), String> {
    let python = python(&["pytest", "grpc", "google.protobuf", "numpy"])?;
    run(&python, &["pytest", "-q", "-p", "no:cacheprovider"]);
    Ok(())
}

fn mypy() -> Result<(), String> {
    let python = python(&["mypy", "numpy", "pytest"])?;
    let cache = tempfile::tempdir().unwrap();
    run(&python, &["mypy", "--strict", "--cache-dir", cache.path().to_str().unwrap()]);
    Ok(())
}
