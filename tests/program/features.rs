//! The features of the library: what is compiled without them.

use std::{path::Path, process::Command};

/// What each feature brings: crates that are compiled with it and with no other one.
const BROUGHT: &[(&str, &[&str])] = &[
    ("service", &["prost", "tokio", "tonic"]),
    ("windows", &["winit", "x11-dl", "x11rb"]),
    ("xr", &["openxr"]),
    ("chart", &["svg"]),
    ("cli", &["clap", "indicatif", "tracing-subscriber"]),
];

/// Names of all crates that are linked into the library with these features.
fn crates(features: &str) -> Vec<String> {
    let output = Command::new(env!("CARGO"))
        .args(["tree", "--offline", "--locked", "--edges", "normal", "--prefix", "none", "--format", "{lib}"])
        .args(["--no-default-features", "--features", features])
        .current_dir(Path::new(env!("CARGO_MANIFEST_DIR")))
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let names: Vec<String> = String::from_utf8(output.stdout).unwrap().lines().map(str::to_owned).collect();
    assert!(names.iter().any(|name| name == "wgpu"), "a tree without wgpu is not this library's: {names:?}");
    names
}

/// The crates of `BROUGHT` that are there with these features.
fn brought_by(features: &str) -> Vec<&'static str> {
    let names = crates(features);
    let all = BROUGHT.iter().flat_map(|(_, brought)| brought.iter().copied());
    all.filter(|brought| names.contains(&brought.replace('-', "_"))).collect()
}

#[test]
fn each_feature_brings_its_crates_and_no_others() {
    assert_eq!(brought_by(""), [""; 0]);
    for (feature, brought) in BROUGHT.iter().filter(|(feature, _)| *feature != "cli") {
        assert_eq!(&brought_by(feature), brought, "{feature}");
    }
    // The program has all of its subcommands.
    let all: Vec<&str> = BROUGHT.iter().flat_map(|(_, brought)| brought.iter().copied()).collect();
    assert_eq!(brought_by("cli"), all);
    assert_eq!(brought_by("default"), all);
}
