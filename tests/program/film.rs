//! `film`: frames that depend only on their number, continued films, and refused arguments.

use std::fs;
use std::path::Path;
use std::process::{Command, Output, Stdio};

const SCENE: &str = "[scene]\ncatalogues = [{ galaxy = { stars = 60000, seed = 1, fainter_than = 3.5 } }]\n\
    [[views]]\nname = 'dome'\ntype = 'dome_master'\nsize = [96, 96]\n\
    [[views]]\nname = 'cube'\ntype = 'cubemap'\nface_size = 32\nfaces = ['up', 'front']\n";
const PATH: &str = "fps = 10\naround_m = [0, 0, 0]\n\
    [[keyframes]]\nframe = 0\nposition_m = [1e11, 0, 0]\nlook = { ra_deg = 266, dec_deg = -29 }\n\
    [[keyframes]]\nframe = 3\nposition_m = [1e15, 1e15, 0]\nmagnitude_limit = 9\n\
    [[keyframes]]\nframe = 6\nposition_m = [0, 3e17, 1e16]\nlook = { ra_deg = 84, dec_deg = -1 }\ntime = 2026-01-01T00:00:00Z\n";

fn command(folder: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_steradian"));
    command.args(["film", "--config", "sky.toml", "--path", "path.toml"]).args(arguments).current_dir(folder);
    command.env_remove("STERADIAN_LOG").stdin(Stdio::null());
    command
}

/// Runs the program, checks the exit code, and returns standard error.
#[track_caller]
fn film(folder: &Path, arguments: &[&str], code: i32) -> String {
    let Output { status, stderr, stdout } = command(folder, arguments).output().unwrap();
    let stderr = String::from_utf8(stderr).unwrap();
    assert_eq!(status.code(), Some(code), "{arguments:?}\n{}\n{stderr}", String::from_utf8_lossy(&stdout));
    stderr
}

fn folder_with(scene: &str, path: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("sky.toml"), scene).unwrap();
    fs::write(folder.path().join("path.toml"), path).unwrap();
    folder
}

/// Returns names and bytes of the images in a folder.
fn images(folder: &Path) -> Vec<(String, Vec<u8>)> {
    let mut names: Vec<String> =
        fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.retain(|name| name.ends_with(".png") || name.ends_with(".exr"));
    names.sort();
    names.into_iter().map(|name| (name.clone(), fs::read(folder.join(name)).unwrap())).collect()
}

#[test]
fn frame_bytes_do_not_depend_on_runs_or_shards() {
    let folder = folder_with(SCENE, PATH);
    let path_of = |name: &str| folder.path().join(name);
    for format in ["png8", "exr16"] {
        let run = |frames: &str, out: &str, more: &[&str]| {
            let out = format!("{format}/{out}");
            let arguments = [&["--frames", frames, "--out", &out, "--format", format], more].concat();
            film(folder.path(), &arguments, 0)
        };
        let log = run("0..6", "whole", &[]);
        assert!(log.contains("6 frames") && log.contains("3 images"), "{log}");
        run("0..6", "shards", &["--shard", "2/2"]);
        run("0..6", "shards", &["--shard", "1/2"]);
        run("4..5", "alone", &[]);
        let [whole, shards, alone] = ["whole", "shards", "alone"].map(|out| images(&path_of(format).join(out)));
        let extension = &format[..3];
        assert_eq!(whole.len(), 18);
        assert_eq!(whole[0].0, format!("cube.front_00000.{extension}"));
        assert!(whole == shards, "{format}");
        let names: Vec<&str> = alone.iter().map(|(name, _)| name.as_str()).collect();
        let expected = ["cube.front", "cube.up", "dome"].map(|stem| format!("{stem}_00004.{extension}"));
        assert_eq!(names, expected);
        assert!(alone.iter().all(|image| whole.contains(image)), "{format}");
        // The frames must differ from each other, so that the comparison is meaningful.
        assert!(whole[2].1 != whole[3].1, "{format}");
    }
}

#[test]
fn first_frame_equals_render_and_png16_shows_the_same_picture() {
    let exact = format!("{SCENE}[accuracy]\ndisplay_codes = 0\n[tone_map]\ndither = false\n");
    let folder = folder_with(&exact, "[[keyframes]]\nframe = 0\nmagnitude_limit = 99\n");
    film(folder.path(), &["--frames", "0..1", "--out", "film"], 0);
    film(folder.path(), &["--frames", "0..1", "--out", "deep", "--format", "png16"], 0);
    let render = Command::new(env!("CARGO_BIN_EXE_steradian"))
        .args(["render", "--config", "sky.toml", "--out", "render"])
        .current_dir(folder.path())
        .output()
        .unwrap();
    assert!(render.status.success());
    let read = |name: &str| fs::read(folder.path().join(name)).unwrap();
    assert!(read("film/dome_00000.png") == read("render/dome.png"));
    let decoded = |name: &str| {
        let bytes = read(name);
        let mut reader = png::Decoder::new(std::io::Cursor::new(&bytes)).read_info().unwrap();
        let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
        reader.next_frame(&mut pixels).unwrap();
        pixels
    };
    let (shallow, deep) = (decoded("film/dome_00000.png"), decoded("deep/dome_00000.png"));
    let mut lit = 0;
    for (pixel, fine) in shallow.chunks_exact(4).zip(deep.chunks_exact(6)) {
        for (code, fine) in pixel.iter().zip(fine.chunks_exact(2)) {
            let fine = f64::from(u16::from_be_bytes([fine[0], fine[1]])) / 257.0;
            assert!((fine - f64::from(*code)).abs() < 0.6, "{fine} {code}");
            lit += usize::from(*code > 20);
        }
    }
    assert!(lit > 50, "{lit}");
}

#[test]
fn only_missing_frames_are_drawn() {
    let folder = folder_with(SCENE, PATH);
    let arguments = ["--frames", "0..3", "--out", "film"];
    film(folder.path(), &arguments, 0);
    let film_folder = folder.path().join("film");
    let before = images(&film_folder);
    let modified = |name: &str| fs::metadata(film_folder.join(name)).unwrap().modified().unwrap();
    let kept = modified("dome_00002.png");
    fs::remove_file(film_folder.join("cube.up_00001.png")).unwrap();
    let log = film(folder.path(), &arguments, 0);
    assert!(log.contains("1 of them to draw"), "{log}");
    assert!(images(&film_folder) == before);
    assert_eq!(modified("dome_00002.png"), kept);
    let log = film(folder.path(), &arguments, 0);
    assert!(log.contains("0 of them to draw") && !log.contains("loading"), "{log}");
}

#[test]
fn folder_of_another_film_is_refused_without_overwrite() {
    let folder = folder_with(SCENE, PATH);
    film(folder.path(), &["--frames", "0..2", "--out", "film"], 0);
    let before = images(&folder.path().join("film"));
    let brighter = ["--frames", "0..1", "--out", "film", "--set", "exposure.limiting_magnitude=8"];
    for arguments in [&brighter[..], &["--frames", "0..1", "--out", "film", "--format", "png16"]] {
        let log = film(folder.path(), arguments, 64);
        assert!(log.contains("film:") && log.contains("another folder") && log.contains("--overwrite"), "{log}");
    }
    assert!(images(&folder.path().join("film")) == before, "the images are unchanged");
    film(folder.path(), &[&brighter[..], &["--overwrite"]].concat(), 0);
    let after = images(&folder.path().join("film"));
    assert_eq!(after.len(), 3, "frames of the other film are removed");
    assert!(after[0].1 != before[0].1);
}

#[test]
fn film_json_has_the_provenance_and_a_changed_catalogue_is_another_film() {
    let scene = SCENE.replace("catalogues = [", "catalogues = ['stars.csv', ");
    let folder = folder_with(&scene, PATH);
    let stars = |magnitude: f64| {
        let rows = format!("ra_deg,dec_deg,v_mag\n266,-29,{magnitude}\nx,2,3\n");
        fs::write(folder.path().join("stars.csv"), rows).unwrap();
    };
    stars(1.0);
    film(folder.path(), &["--frames", "0..2", "--out", "film", "--shard", "2/2"], 0);
    let read = || fs::read_to_string(folder.path().join("film/film.json")).unwrap();
    let first = read();
    film(folder.path(), &["--frames", "0..2", "--out", "film", "--shard", "1/2"], 0);
    film(folder.path(), &["--frames", "0..2", "--out", "film"], 0);
    assert_eq!(read(), first, "film.json is the same for every run");
    let record: serde_json::Value = serde_json::from_str(&first).unwrap();
    assert_eq!(record["catalogues"][0]["rejected_rows"], 1);
    assert_eq!((&record["files"][0]["file"], &record["files"][0]["bytes"]), (&"stars.csv".into(), &37.into()));
    assert!(record["configuration"]["toml"].as_str().unwrap().contains("dome_master"));
    assert!(record["path_toml"].as_str().unwrap().contains("magnitude_limit"));
    stars(2.0);
    let log = film(folder.path(), &["--frames", "0..2", "--out", "film"], 64);
    assert!(log.contains("the contents of stars.csv") && log.contains("--overwrite"), "{log}");
}

#[test]
fn bad_paths_ranges_and_shards_exit_64_with_file_and_key() {
    let folder = folder_with(SCENE, PATH);
    let path = |text: &str| fs::write(folder.path().join("path.toml"), text).unwrap();
    for (text, part) in [
        ("speed = 1\n[[keyframes]]\nframe = 0\n", "speed"),
        ("fps = 30\n", "keyframes"),
        ("[[keyframes]]\nframe = 0\nlok = { ra_deg = 1, dec_deg = 2 }\n", "keyframes[0].lok"),
        ("[[keyframes]]\nframe = 2\n[[keyframes]]\nframe = 1\n", "keyframes[1].frame"),
        ("[[keyframes]]\nframe = 0\nfov_y_deg = 40\n", "fov_y_deg"),
        ("[[keyframes]]\nframe = 0\nvelocity_c = [1, 1, 0]\n", "velocity_c"),
    ] {
        path(text);
        let log = film(folder.path(), &["--frames", "0..2", "--out", "film"], 64);
        assert!(log.contains("path.toml") && log.contains(part), "{log}");
    }
    path(PATH);
    for arguments in [
        &["--frames", "3..3"][..],
        &["--frames", "0..1000001"],
        &["--frames", "0..2", "--shard", "3/2"],
        &["--frames", "0..2", "--shard", "1/2", "--video", "a.mp4"],
        &["--frames", "0..2", "--format", "png16", "--video", "a.mp4", "--video-view", "dome"],
        &["--frames", "0..2", "--video", "a.mp4"],
        &["--frames", "0..2", "--video", "a.mp4", "--video-view", "cube"],
        &["--frames", "0..2", "--video", "a.txt", "--video-view", "dome"],
    ] {
        film(folder.path(), &[arguments, &["--out", "film"]].concat(), 64);
    }
    assert!(!folder.path().join("film").exists(), "no file is written");
}

#[cfg(unix)]
#[test]
fn video_without_ffmpeg_fails_before_drawing() {
    use std::os::unix::fs::PermissionsExt;
    let folder = folder_with(SCENE, PATH);
    let arguments = ["--frames", "0..2", "--out", "film", "--video", "a.mp4", "--video-view", "dome"];
    let output = command(folder.path(), &arguments).env("PATH", folder.path()).output().unwrap();
    let log = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(69), "{log}");
    assert!(log.contains("apt install ffmpeg") && !folder.path().join("film").exists(), "{log}");
    // A fake ffmpeg that lists the encoder and then writes its arguments to the output file.
    let script = "#!/bin/sh\ncase \"$*\" in *-encoders*) echo libx264;; *) for last; do :; done; echo \"$*\" > \"$last\";; esac\n";
    fs::create_dir(folder.path().join("bin")).unwrap();
    let ffmpeg = folder.path().join("bin/ffmpeg");
    fs::write(&ffmpeg, script).unwrap();
    fs::set_permissions(&ffmpeg, fs::Permissions::from_mode(0o755)).unwrap();
    let places = format!("{}:{}", folder.path().join("bin").display(), std::env::var("PATH").unwrap());
    let output = command(folder.path(), &arguments).env("PATH", places).output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    let asked = fs::read_to_string(folder.path().join("a.mp4")).unwrap();
    for part in ["-framerate 10", "-start_number 0", "dome_%05d.png", "-frames:v 2", "libx264", "yuv420p", "bt709"] {
        assert!(asked.contains(part), "{part}: {asked}");
    }
}

#[cfg(unix)]
#[test]
fn interrupted_film_leaves_complete_frames_and_continues() {
    use std::time::{Duration, Instant};
    let folder = folder_with(SCENE, PATH);
    let arguments = ["--frames", "0..100000", "--out", "film"];
    let mut child = command(folder.path(), &arguments).stderr(Stdio::null()).stdout(Stdio::null()).spawn().unwrap();
    let out = folder.path().join("film");
    let start = Instant::now();
    while !out.join("dome_00002.png").exists() {
        assert!(start.elapsed() < Duration::from_secs(300) && child.try_wait().unwrap().is_none());
        std::thread::sleep(Duration::from_millis(20));
    }
    let kill = Command::new("kill").args(["-s", "INT", &child.id().to_string()]).status().unwrap();
    assert!(kill.success());
    assert_eq!(child.wait().unwrap().code(), Some(1));
    let found = images(&out);
    assert_eq!(found.len() % 3, 0, "only complete frames are written");
    assert!(found.iter().all(|(_, bytes)| bytes.ends_with(b"IEND\xaeB`\x82")));
    let names: Vec<_> = fs::read_dir(&out).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    assert_eq!(
        names.len(),
        found.len() + 3,
        "besides images only film.json, film.sha256 and the lock exist: {names:?}"
    );
}
