//! The features of the library and their dependencies.

use std::{path::Path, process::Command};

/// Crates that each feature adds and that no other feature adds.
const FEATURE_CRATES: &[(&str, &[&str])] = &[
    ("service", &["prost", "tokio", "tonic"]),
    ("cluster", &["zenoh"]),
    ("windows", &["winit", "x11-dl", "x11rb"]),
    ("xr", &["openxr"]),
    ("chart", &["svg"]),
    ("cli", &["clap", "indicatif", "tracing-subscriber"]),
];

/// Returns the names of all crates linked into the library with these features.
fn crates(features: &str) -> Vec<String> {
    let output = Command::new(env!("CARGO"))
        .args([
            "tree",
            "--offline",
            "--locked",
            "--package",
            "steradian",
            "--edges",
            "normal",
            "--prefix",
            "none",
            "--format",
            "{lib}",
        ])
        .args(["--no-default-features", "--features", features])
        .current_dir(Path::new(env!("CARGO_MANIFEST_DIR")))
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let names: Vec<String> = String::from_utf8(output.stdout).unwrap().lines().map(str::to_owned).collect();
    assert!(names.iter().any(|name| name == "wgpu"), "the tree of this library must contain wgpu: {names:?}");
    names
}

/// Returns the crates of `FEATURE_CRATES` that are present with these features.
fn crates_added_by(features: &str) -> Vec<&'static str> {
    let names = crates(features);
    let all = FEATURE_CRATES.iter().flat_map(|(_, crates_of_feature)| crates_of_feature.iter().copied());
    all.filter(|crates_of_feature| names.contains(&crates_of_feature.replace('-', "_"))).collect()
}

#[test]
fn features_add_only_their_crates() {
    assert_eq!(crates_added_by(""), [""; 0]);
    for (feature, crates_of_feature) in
        FEATURE_CRATES.iter().filter(|(feature, _)| !["cli", "cluster"].contains(feature))
    {
        assert_eq!(&crates_added_by(feature), crates_of_feature, "{feature}");
    }
    // The feature for clusters includes the daemon, because a cluster consists of daemons. The last crate is a
    // dependency of the network.
    assert_eq!(crates_added_by("cluster"), ["prost", "tokio", "tonic", "zenoh", "tracing-subscriber"]);
    // The program has all subcommands, so it needs all crates except those of the network between daemons.
    let all: Vec<&str> =
        FEATURE_CRATES.iter().flat_map(|(_, crates_of_feature)| crates_of_feature.iter().copied()).collect();
    assert_eq!(crates_added_by("default"), all);
    let without_cluster: Vec<&str> = all.into_iter().filter(|name| *name != "zenoh").collect();
    assert_eq!(crates_added_by("cli"), without_cluster);
}
