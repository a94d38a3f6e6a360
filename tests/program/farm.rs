//! Runs the Slurm scripts in `scripts/farm/` without Slurm, but with the variables that it sets. The tasks of a job must give the same bytes as one
//! program.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::process::{Command, Output, Stdio};

/// Runs a script as a task of an array, checks the exit code, and returns all output.
#[track_caller]
fn task(folder: &Path, script: &str, task: Option<u32>, arguments: &[&str], code: i32) -> String {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("scripts/farm").join(script);
    let mut command = Command::new(script);
    command.args(arguments).current_dir(folder).stdin(Stdio::null()).env_remove("SLURM_ARRAY_TASK_ID");
    command.env("STERADIAN", env!("CARGO_BIN_EXE_steradian")).env("STERADIAN_MEMORY", "64MiB");
    task.inspect(|task| _ = command.env("SLURM_ARRAY_TASK_ID", task.to_string()));
    let Output { status, stdout, stderr } = command.output().unwrap();
    let said = String::from_utf8([stdout, stderr].concat()).unwrap();
    assert_eq!(status.code(), Some(code), "{arguments:?}\n{said}");
    said
}

fn steradian(folder: &Path, arguments: &[&str]) {
    let output = Command::new(env!("CARGO_BIN_EXE_steradian")).args(arguments).current_dir(folder).output().unwrap();
    assert!(output.status.success(), "{arguments:?}\n{}", String::from_utf8_lossy(&output.stderr));
}

/// Returns the names and bytes of the files in a folder, except the lock.
fn contents(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let names = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap());
    names.filter(|name| name != ".film.lock").map(|name| (name.clone(), fs::read(folder.join(name)).unwrap())).collect()
}

#[test]
fn an_import_by_tasks_has_the_bytes_of_one_program() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    fs::write(path.join("my stars.csv"), "ra_deg,dec_deg,v_mag\n10,20,14\n200,-70,15\n266,-29,3\n").unwrap();
    let import =
        |number| task(path, "import.sbatch", Some(number), &["3", "parts", "builtin:bright", "my stars.csv"], 0);
    for number in [3, 1] {
        import(number);
    }
    // An unfinished part does not count as a part.
    fs::create_dir(path.join("parts/2.partial")).unwrap();
    let said = task(path, "merge.sbatch", None, &["parts", "merged"], 64);
    assert!(said.contains("the cells 1024..2048 of 0..3072 are in none of the parts"), "{said}");
    import(2);
    let said = task(path, "merge.sbatch", None, &["parts", "merged"], 0);
    assert!(said.contains("all checksums are right"), "{said}");
    let import = ["catalogue", "import", "builtin:bright", "my stars.csv", "--memory", "64MiB", "--out", "whole"];
    steradian(path, &import);
    assert!(contents(&path.join("merged")) == contents(&path.join("whole")));

    for (script, number, arguments) in [
        ("import.sbatch", Some(4), &["3", "parts", "builtin:bright"][..]),
        ("import.sbatch", None, &["3", "parts", "builtin:bright"]),
        ("import.sbatch", Some(1), &["3", "parts"]),
        ("film.sbatch", Some(1), &["3", "sky.toml"]),
        ("merge.sbatch", None, &["parts"]),
    ] {
        task(path, script, number, arguments, 64);
    }
    fs::create_dir(path.join("empty")).unwrap();
    assert!(task(path, "merge.sbatch", None, &["empty", "merged"], 65).contains("empty has no parts"));
}

#[test]
fn a_film_by_tasks_has_the_bytes_of_one_program() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    let scene =
        "[scene]\ncatalogues = ['builtin:bright']\n[[views]]\nname = 'v'\ntype = 'dome_master'\nsize = [32, 32]\n";
    fs::write(path.join("sky.toml"), scene).unwrap();
    fs::write(path.join("path.toml"), "[[keyframes]]\nframe = 0\nlook = { ra_deg = 84, dec_deg = -1 }\n").unwrap();
    let draw = |number, code| {
        task(
            path,
            "film.sbatch",
            Some(number),
            &["2", "sky.toml", "path.toml", "0..3", "film", "--format", "exr16"],
            code,
        )
    };
    draw(2, 0);
    draw(1, 0);
    assert!(draw(3, 64).contains("must be 1/N to N/N"));
    let whole = [
        "film",
        "--config",
        "sky.toml",
        "--path",
        "path.toml",
        "--frames",
        "0..3",
        "--out",
        "whole",
        "--format",
        "exr16",
    ];
    steradian(path, &whole);
    assert_eq!(contents(&path.join("whole")).len(), 5);
    assert!(contents(&path.join("film")) == contents(&path.join("whole")));
}
