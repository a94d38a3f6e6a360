//! Tests the job templates of `scripts/farm/`: `openjd-cli` runs the film as the render manager of a studio does, and the Kubernetes job conforms to
//! its schema. Both programs are in a virtual environment that `scripts/ensure-python.sh farm` makes; `STERADIAN_FARM_PYTHON` names another Python
//! that has them.

use std::{
    fs,
    path::{Path, PathBuf},
    process::Command,
};

use crate::{Test, suites::text};

pub const TESTS: &[Test] = &[
    ("farm::openjd_template_draws_the_film_and_notices_a_missing_frame", openjd),
    ("farm::kubernetes_job_fits_its_schema", kubernetes),
];

const SCENE: &str =
    "[scene]\ncatalogues = ['builtin:bright']\n[[views]]\nname = 'v'\ntype = 'dome_master'\nsize = [32, 32]\n";
const PATH: &str = "[[keyframes]]\nframe = 0\nlook = { ra_deg = 84, dec_deg = -1 }\n";

fn template(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("scripts/farm").join(name)
}

/// Runs a Python module; returns whether it succeeded, and its output.
fn module(python: &Path, arguments: &[&str]) -> (bool, String) {
    let output = Command::new(python).arg("-m").args(arguments).env("PYTHONDONTWRITEBYTECODE", "1").output().unwrap();
    (output.status.success(), text(&output))
}

/// Finds the Python that has a module.
fn python(module: &str) -> Result<PathBuf, String> {
    let named = std::env::var_os("STERADIAN_FARM_PYTHON").map(PathBuf::from);
    let cache = std::env::var_os("XDG_CACHE_HOME").map(PathBuf::from);
    let cache = cache.or_else(|| Some(PathBuf::from(std::env::var_os("HOME")?).join(".cache")));
    let python = named.or_else(|| Some(cache?.join("steradian/farm/bin/python")));
    let python = python.ok_or("HOME is not set")?;
    let found = Command::new(&python).args(["-c", &format!("import {module}")]).output();
    match found {
        Ok(output) if output.status.success() => Ok(python),
        _ => Err(format!("{} does not have {module}: `scripts/ensure-python.sh farm` installs it", python.display())),
    }
}

fn openjd() -> Result<(), String> {
    let python = python("openjd.cli")?;
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str| folder.path().join(name).display().to_string();
    fs::write(file("sky.toml"), SCENE).unwrap();
    fs::write(file("path.toml"), PATH).unwrap();
    let program = env!("CARGO_BIN_EXE_steradian");
    let template = template("film.openjd.yaml").display().to_string();
    let run = |step: &str, dependencies: &str, frames: &str| {
        let parameters = [
            format!("Frames={frames}"),
            "FramesPerTask=2".to_owned(),
            format!("Configuration={}", file("sky.toml")),
            format!("CameraPath={}", file("path.toml")),
            format!("Folder={}", file("film")),
            format!("Steradian={program}"),
        ];
        let mut arguments = vec!["openjd", "run", template.as_str(), "--step", step, dependencies];
        parameters.iter().for_each(|parameter| arguments.extend(["-p", parameter.as_str()]));
        module(&python, &arguments)
    };
    // The job runs two chunks, of which the second has one frame, and then the check.
    let (succeeded, said) = run("Check", "--run-dependencies", "3-5");
    assert!(succeeded && said.contains("frames 3..6, 3 files: 3 verified"), "{said}");
    let drawn = Command::new(program)
        .args(["film", "--config", "sky.toml", "--path", "path.toml", "--frames", "3..6", "--out", "alone"])
        .current_dir(folder.path())
        .output()
        .unwrap();
    assert!(drawn.status.success(), "{}", text(&drawn));
    for name in ["v_00003.png", "v_00004.png", "v_00005.png", "film.json", "film.sha256"] {
        let [of_job, alone] = ["film", "alone"].map(|out| fs::read(Path::new(&file(out)).join(name)).unwrap());
        assert!(of_job == alone, "{name}");
    }
    // The check must fail if a frame of the film was replaced by another one.
    let (succeeded, said) = run("Check", "--no-run-dependencies", "3-6");
    assert!(!succeeded && said.contains("missing v_00006.png"), "{said}");
    Ok(())
}

fn kubernetes() -> Result<(), String> {
    let python = python("kubernetes_validate")?;
    let validate = |path: &Path| {
        let path = path.display().to_string();
        let bin = python.with_file_name("kubernetes-validate").display().to_string();
        let output = Command::new(bin).args(["--strict", "--kubernetes-version", "1.31", &path]).output().unwrap();
        (output.status.success(), text(&output))
    };
    let job = template("film.kubernetes.yaml");
    let (fits, said) = validate(&job);
    assert!(fits, "{said}");
    let whole = fs::read_to_string(job).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let wrong = folder.path().join("wrong.yaml");
    for (from, to) in [("completions: 8", "completions: many"), ("completionMode:", "completionModus:")] {
        assert!(whole.contains(from));
        fs::write(&wrong, whole.replace(from, to)).unwrap();
        let (fits, said) = validate(&wrong);
        assert!(!fits, "{to}: {said}");
    }
    Ok(())
}
