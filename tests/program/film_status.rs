//! `film status` and `film repair`: every kind of fault is found, and a repaired film has the same bytes.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::process::{Command, Output, Stdio};

const SCENE: &str = "[scene]\ncatalogues = ['builtin:bright', 'more.csv']\n\
    [[views]]\nname = 'eyes'\ntype = 'stereo'\nipd_m = 0.06\nsize = [48, 32]\nfov = { left_deg = -40, right_deg = 40, up_deg = 30, down_deg = -30 }\n";
const PATH: &str = "[[keyframes]]\nframe = 0\nlook = { ra_deg = 84, dec_deg = -1 }\n\
    [[keyframes]]\nframe = 6\nlook = { ra_deg = 95, dec_deg = -20 }\n";

/// Runs `film`, checks the exit code, and returns both outputs.
#[track_caller]
fn film(folder: &Path, arguments: &[&str], code: i32) -> (String, String) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_steradian"));
    command.arg("film").args(arguments).current_dir(folder).env_remove("STERADIAN_LOG").stdin(Stdio::null());
    let Output { status, stderr, stdout } = command.output().unwrap();
    let [out, err] = [stdout, stderr].map(|bytes| String::from_utf8(bytes).unwrap());
    assert_eq!(status.code(), Some(code), "{arguments:?}\n{out}\n{err}");
    (out, err)
}

fn draw<'a>(frames: &'a str, out: &'a str, more: &[&'a str]) -> Vec<&'a str> {
    [&["--config", "sky.toml", "--path", "path.toml", "--frames", frames, "--out", out][..], more].concat()
}

fn new_folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for (name, text) in [("sky.toml", SCENE), ("path.toml", PATH), ("more.csv", "ra_deg,dec_deg,v_mag\n84,-2,4\n")] {
        fs::write(folder.path().join(name), text).unwrap();
    }
    folder
}

/// Names and bytes of all files in a folder, except the lock.
fn contents(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let names = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap());
    names.filter(|name| name != ".film.lock").map(|name| (name.clone(), fs::read(folder.join(name)).unwrap())).collect()
}

fn changed(path: &Path, change: impl Fn(&mut Vec<u8>)) {
    let mut bytes = fs::read(path).unwrap();
    change(&mut bytes);
    fs::write(path, bytes).unwrap();
}

#[test]
fn faults_are_found_and_a_repaired_film_has_the_same_bytes() {
    let folder = new_folder();
    film(folder.path(), &draw("0..6", "film", &[]), 0);
    let dir = folder.path().join("film");
    let whole = contents(&dir);
    assert_eq!(whole.len(), 2 * 6 + 2);
    let file = |eye: &str, frame: u32| dir.join(format!("eyes.{eye}_{frame:05}.png"));
    let (out, _) = film(folder.path(), &["status", "film"], 0);
    assert_eq!(out, "film: frames 0..6, 12 files: 12 verified, 0 missing, 0 damaged, 0 foreign\n");
    let (out, _) = film(folder.path(), &["status", "film", "--frames", "4..8"], 1);
    assert!(out.contains("missing eyes.right_00007.png") && out.contains("4 verified, 4 missing"), "{out}");

    fs::remove_file(file("left", 0)).unwrap();
    changed(&file("right", 1), |bytes| bytes.truncate(bytes.len() - 20));
    changed(&file("left", 2), |bytes| {
        let middle = bytes.len() / 2;
        bytes[middle] ^= 4;
    });
    fs::copy(file("left", 4), file("left", 3)).unwrap();
    fs::copy(file("left", 4), file("left", 9)).unwrap();
    let (out, err) = film(folder.path(), &["status", "film", "--json", "status.json"], 1);
    for line in [
        "missing eyes.left_00000.png: it does not exist",
        "damaged eyes.right_00001.png: it ends before the end of its picture",
        "damaged eyes.left_00002.png: the checksum of its part IDAT is wrong",
        "foreign eyes.left_00003.png: it is a whole picture, but not the one",
        "foreign eyes.left_00009.png: no run of this film drew this frame",
        "film: frames 0..6, 12 files: 8 verified, 1 missing, 2 damaged, 2 foreign",
    ] {
        assert!(out.contains(line), "`{line}` is not in:\n{out}");
    }
    assert!(err.contains("1 files are missing, 2 damaged, 2 foreign; `film repair`"), "{err}");
    let json: serde_json::Value =
        serde_json::from_slice(&fs::read(folder.path().join("status.json")).unwrap()).unwrap();
    assert_eq!(
        (&json["verified"], &json["faults"][1]["fault"], &json["faults"][4]["belongs"]),
        (&8.into(), &"damaged".into(), &false.into())
    );

    // After the configuration file has changed, the film continues with the configuration with which it was begun.
    fs::write(folder.path().join("sky.toml"), SCENE.replace("[48, 32]", "[64, 32]")).unwrap();
    let (out, err) = film(folder.path(), &["repair", "film"], 0);
    assert!(
        out.contains(
            "sky.toml changed since the film was begun; the film continues with the version recorded in film.json"
        ),
        "{out}"
    );
    assert!(
        out.contains("removed eyes.left_00009.png") && out.contains("4 frames drawn again, 1 files removed"),
        "{out}"
    );
    assert!(!err.contains("other bytes"), "{err}");
    assert!(contents(&dir) == whole);
    let (out, _) = film(folder.path(), &["repair", "film"], 0);
    assert!(out.contains("0 frames drawn again, 0 files removed"), "{out}");

    // A file that pictures depend on must be the one with which the film was begun.
    fs::remove_file(file("left", 0)).unwrap();
    fs::write(folder.path().join("more.csv"), "ra_deg,dec_deg,v_mag\n84,-2,3\n").unwrap();
    let (_, err) = film(folder.path(), &["repair", "film"], 65);
    assert!(err.contains("more.csv"), "{err}");
    let (_, err) = film(folder.path(), &["status", "."], 64);
    assert!(err.contains("it has no film.json"), "{err}");
}

#[test]
fn films_without_checksums_are_read_and_said_to_be_unverified() {
    let folder = new_folder();
    film(folder.path(), &draw("3..5", "film", &[]), 0);
    let dir = folder.path().join("film");
    // Change the folder so that it is like one from an earlier version.
    fs::remove_file(dir.join("film.sha256")).unwrap();
    let mut record: serde_json::Value = serde_json::from_slice(&fs::read(dir.join("film.json")).unwrap()).unwrap();
    for key in ["frames", "sources", "shutter"] {
        record.as_object_mut().unwrap().remove(key).unwrap();
    }
    fs::write(dir.join("film.json"), serde_json::to_vec(&record).unwrap()).unwrap();
    let (out, _) = film(folder.path(), &["status", "film"], 0);
    assert!(out.contains("no film.sha256: an earlier version drew these frames"), "{out}");
    assert!(out.contains("film.json does not contain the range of frames"), "{out}");
    assert!(out.contains("frames 3..5, 4 files: 0 verified, 4 can be read but have no checksum, 0 missing"), "{out}");
    let before = contents(&dir);
    changed(&dir.join("eyes.left_00004.png"), |bytes| bytes[60] ^= 1);
    film(folder.path(), &["status", "film"], 1);
    film(folder.path(), &["repair", "film"], 0);
    assert!(contents(&dir)["eyes.left_00004.png"] == before["eyes.left_00004.png"]);
    let (out, _) = film(folder.path(), &["status", "film"], 0);
    assert!(out.contains("2 verified, 2 can be read but have no checksum"), "{out}");
}

#[test]
fn frames_in_openexr_name_the_film_that_they_are_of() {
    let folder = new_folder();
    let blur = ["--shutter", "0.5", "--sub-frames", "2"];
    film(folder.path(), &draw("0..2", "film", &[&["--format", "exr16"][..], &blur].concat()), 0);
    film(folder.path(), &draw("0..1", "other", &["--format", "exr16"]), 0);
    let [dir, other] = ["film", "other"].map(|name| folder.path().join(name));
    let whole = contents(&dir);
    fs::copy(other.join("eyes.left_00000.exr"), dir.join("eyes.left_00000.exr")).unwrap();
    changed(&dir.join("eyes.right_00001.exr"), |bytes| {
        let last = bytes.len() - 1;
        bytes[last] ^= 1;
    });
    let (out, _) = film(folder.path(), &["status", "film"], 1);
    let digest = serde_json::from_slice::<serde_json::Value>(&contents(&other)["film.json"]).unwrap()["digest"].clone();
    let foreign = format!("foreign eyes.left_00000.exr: it is a frame of the film {}", &digest.as_str().unwrap()[..12]);
    assert!(out.contains(&foreign) && out.contains("damaged eyes.right_00001.exr"), "{out}");
    film(folder.path(), &["repair", "film"], 0);
    assert!(contents(&dir) == whole);
}
