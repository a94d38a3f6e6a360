//! Imports of catalogues, checked by Python scripts that share no code with the program. The scripts write tables, import them with the program, and
//! read the stores according to the description of their format. `hats-import` is in a virtual environment that `scripts/ensure-python.sh hats`
//! makes; `STERADIAN_HATS_PYTHON` names another Python that has it.

use std::{
    ffi::OsString,
    path::{Path, PathBuf},
    process::Command,
};

use crate::{
    Test,
    suites::{self, text},
};

pub const TESTS: &[Test] = &[
    ("catalogues::bulk_files_of_the_gaia_archive_are_imported", || checked("archive.py")),
    ("catalogues::an_adversarial_table_is_imported_and_refused_by_reason", || checked("adversarial.py")),
    ("catalogues::light_of_a_store_is_that_of_its_table", || checked("light_sums.py")),
];

/// Tests that need hundreds of megabytes of packages.
pub const HATS_TESTS: &[Test] =
    &[("catalogues::long::a_collection_of_hats_import_is_imported_without_its_margin", hats)];

/// Runs a script with the program and an empty folder as arguments; panics with its output if it fails.
fn run(python: &OsString, script: &str) {
    let folder = tempfile::tempdir().unwrap();
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/python/catalogues").join(script);
    let mut command = Command::new(python);
    command.arg(&script).arg(env!("CARGO_BIN_EXE_steradian")).arg(folder.path());
    let output = command.env("PYTHONDONTWRITEBYTECODE", "1").output().unwrap();
    assert!(output.status.success(), "{} fails with {}:\n{}", script.display(), output.status, text(&output));
}

fn checked(script: &str) -> Result<(), String> {
    run(&suites::python(&["numpy"])?, script);
    Ok(())
}

fn hats() -> Result<(), String> {
    let named = std::env::var_os("STERADIAN_HATS_PYTHON").map(PathBuf::from);
    let cache = std::env::var_os("XDG_CACHE_HOME").map(PathBuf::from);
    let cache = cache.or_else(|| Some(PathBuf::from(std::env::var_os("HOME")?).join(".cache")));
    let python = named.or_else(|| Some(cache?.join("steradian/hats/bin/python"))).ok_or("HOME is not set")?;
    match Command::new(&python).args(["-c", "import hats_import"]).output() {
        Ok(output) if output.status.success() => {
            run(&python.into_os_string(), "collection.py");
            Ok(())
        }
        _ => {
            Err(format!("{} does not have hats_import: `scripts/ensure-python.sh hats` installs it", python.display()))
        }
    }
}
