//! Compares `web/dist`, which is checked in and embedded in the program, byte by byte with a build of its sources.

use std::{
    fs,
    path::{Path, PathBuf},
    process::{Command, Output},
};

use crate::Test;

pub const TESTS: &[Test] =
    &[("bundle::matches_its_sources", matches_its_sources), ("bundle::differences_are_found", differences_are_found)];

fn web() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("web")
}

fn npm(arguments: &[&str]) -> Result<Output, String> {
    let run = Command::new("npm").args(arguments).current_dir(web()).output();
    run.map_err(|error| format!("cannot run npm ({error}): scripts/ensure-page.sh installs it"))
}

fn text(output: &Output) -> String {
    String::from_utf8_lossy(&[&output.stdout[..], &output.stderr].concat()).into_owned()
}

/// Returns the names of files that differ between the folders.
fn differences(a: &Path, b: &Path) -> Vec<String> {
    let names = |folder: &Path| {
        let names = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap());
        names.collect::<Vec<_>>()
    };
    let mut all = [names(a), names(b)].concat();
    all.sort();
    all.dedup();
    all.retain(|name| fs::read(a.join(name)).ok() != fs::read(b.join(name)).ok());
    all
}

fn matches_its_sources() -> Result<(), String> {
    // Reinstall the locked versions if the lock file is newer than the installation.
    let written = |path: &str| fs::metadata(web().join(path)).and_then(|file| file.modified()).ok();
    if written("node_modules/.package-lock.json") < written("package-lock.json") {
        let installed = npm(&["ci", "--no-fund", "--no-audit"])?;
        if !installed.status.success() {
            return Err(format!("npm ci has failed: {}", text(&installed)));
        }
    }
    let folder = tempfile::tempdir().unwrap();
    let built = npm(&["run", "--silent", "build", "--", folder.path().to_str().unwrap()])?;
    assert!(built.status.success(), "the page does not build: {}", text(&built));
    let other = differences(&web().join("dist"), folder.path());
    assert!(
        other.is_empty(),
        "web/dist differs from a build of web/src in {other:?}: run make page, and check in the result"
    );
    Ok(())
}

fn differences_are_found() -> Result<(), String> {
    let (a, b) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    for (folder, name, contents) in [
        (&a, "same", "1"),
        (&b, "same", "1"),
        (&a, "other", "1"),
        (&b, "other", "2"),
        (&a, "left", ""),
        (&b, "right", ""),
    ] {
        fs::write(folder.path().join(name), contents).unwrap();
    }
    assert_eq!(differences(a.path(), b.path()), ["left", "other", "right"]);
    Ok(())
}
