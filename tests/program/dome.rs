//! Tests projectors end to end: calibration files, light in OpenEXR and PNG, and the results of `dome check`.

use std::{
    f64::consts::PI,
    fs,
    path::Path,
    process::{Command, Output, Stdio},
};

use glam::DVec3;
use steradian::units::illuminance_lx_from_magnitude;

use crate::exr_file::channels;

const SIZE: [usize; 2] = [110, 200];
/// Number of samples along a side of the grids.
const SAMPLES: usize = 49;
const STARS: usize = 40;

/// Returns the direction at a point (0 to 1) of the left or right raster. The rasters show the halves of a dome of 120
/// degrees around -z, which overlap by 10 degrees.
fn direction(right: bool, [u, v]: [f64; 2]) -> DVec3 {
    let across = (70.0 * u - if right { 5.0 } else { 65.0 }).to_radians();
    let along = (65.0 - 130.0 * v).to_radians();
    // Add a smooth distortion that the program has no formula for.
    let along = along + 0.03 * (2.0 * across).sin() * along.cos();
    DVec3::new(across.sin() * along.cos(), along.sin(), -across.cos() * along.cos())
}

/// Returns the solid angle of a pixel, from the closed form of the directions.
fn pixel_sr(right: bool, x: usize, y: usize) -> f64 {
    let ray_direction = |dx: f64, dy: f64| {
        let place = [(x as f64 + 0.5 + dx) / SIZE[0] as f64, (y as f64 + 0.5 + dy) / SIZE[1] as f64];
        direction(right, place)
    };
    let h = 1e-3;
    (ray_direction(h, 0.0) - ray_direction(-h, 0.0)).cross(ray_direction(0.0, h) - ray_direction(0.0, -h)).length()
        / (4.0 * h * h)
}

/// Encodes directions as PFM. The first row is the bottom row, as in Netpbm, or the top row.
fn pfm(right: bool, bottom_first: bool) -> Vec<u8> {
    let mut bytes = format!("PF\n{SAMPLES} {SAMPLES}\n-1.0\n").into_bytes();
    let rows: Vec<usize> = if bottom_first { (0..SAMPLES).rev().collect() } else { (0..SAMPLES).collect() };
    for (row, column) in rows.into_iter().flat_map(|row| (0..SAMPLES).map(move |column| (row, column))) {
        let place = [column, row].map(|index| (index as f64 + 0.5) / SAMPLES as f64);
        let towards = direction(right, place);
        bytes.extend(towards.as_vec3().to_array().iter().flat_map(|value| value.to_le_bytes()));
    }
    bytes
}

/// Returns a catalogue of stars that are away from the borders of the dome, and the light of each star, lx.
fn catalogue() -> (String, Vec<f64>) {
    let mut text = "x,y,z,v_mag,teff_k\n".to_owned();
    let mut light = Vec::new();
    for star in 0..STARS {
        let [u, v] = [7.0_f64, 13.0].map(|prime| (star as f64 * prime.sqrt()).fract());
        let [across, along] = [(100.0 * u - 50.0).to_radians(), (100.0 * v - 50.0).to_radians()];
        let position = DVec3::new(across.sin() * along.cos(), along.sin(), -across.cos() * along.cos()) * 1e4;
        let magnitude = 1.0 + 3.0 * u;
        text += &format!("{},{},{},{magnitude},6500\n", position.x, position.y, position.z);
        light.push(illuminance_lx_from_magnitude(magnitude));
    }
    (text, light)
}

fn configuration(second: &str) -> String {
    let view = |name: &str, file: &str| {
        format!("[[views]]\nname = '{name}'\ntype = 'projector'\nfile = '{file}'\nsize = [{}, {}]\n", SIZE[0], SIZE[1])
    };
    format!(
        "[scene]\ncatalogues = ['stars.csv']\n[glare]\nmethod = 'none'\n{}{}{second}",
        view("left", "left.pfm"),
        view("right", "right.pfm")
    )
}

fn run(folder: &Path, arguments: &[&str]) -> (i32, String, String) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_steradian"));
    command.args(arguments).current_dir(folder).env_remove("STERADIAN_LOG").stdin(Stdio::null());
    let Output { status, stdout, stderr } = command.output().unwrap();
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    (status.code().unwrap(), text(stdout), text(stderr))
}

fn folder() -> (tempfile::TempDir, Vec<f64>) {
    let folder = tempfile::tempdir().unwrap();
    let (text, light) = catalogue();
    let write = |name: &str, bytes: &[u8]| fs::write(folder.path().join(name), bytes).unwrap();
    write("stars.csv", text.as_bytes());
    write("left.pfm", &pfm(false, true));
    write("right.pfm", &pfm(true, true));
    write("dome.toml", configuration("").as_bytes());
    (folder, light)
}

/// The rasters together have all light of the stars. Light is weighted with solid angles in closed form. Stars that
/// both projectors show are counted twice.
#[test]
fn projectors_show_the_complete_light_of_stars() {
    let (folder, light) = folder();
    let (code, _, log) = run(folder.path(), &["render", "--config", "dome.toml", "--out", "out", "--files", "exr"]);
    assert_eq!(code, 0, "{log}");
    let (mut sum, mut covered_sr, mut twice) = (0.0, 0.0, 0.0);
    for right in [false, true] {
        let name = if right { "right" } else { "left" };
        let bytes = fs::read(folder.path().join(format!("out/{name}.exr"))).unwrap();
        let [red, green, blue, omega] = channels(&bytes, ["R", "G", "B", "omega"]);
        for pixel in 0..SIZE[0] * SIZE[1] {
            let luminance =
                0.2126 * f64::from(red[pixel]) + 0.7152 * f64::from(green[pixel]) + 0.0722 * f64::from(blue[pixel]);
            let exact = pixel_sr(right, pixel % SIZE[0], pixel / SIZE[0]);
            sum += luminance * exact;
            covered_sr += f64::from(omega[pixel]);
            twice += exact;
        }
    }
    assert!((covered_sr / twice - 1.0).abs() < 1e-4 && twice < 4.0 * PI, "{covered_sr} {twice}");
    // Count stars twice if both projectors show them. Blends would divide their light, but PFM files have no blends.
    let both = |star: usize| {
        let u = (star as f64 * 7.0_f64.sqrt()).fract();
        (100.0 * u - 50.0).abs() < 5.0
    };
    let whole: f64 = light.iter().enumerate().map(|(star, lx)| if both(star) { 2.0 * lx } else { *lx }).sum();
    println!("light of {STARS} stars: relative error {:.1e}", sum / whole - 1.0);
    assert!((sum / whole - 1.0).abs() < 1e-3, "{sum} {whole}");
}

#[test]
fn dome_check_reports_faults_and_exits_1() {
    let (folder, _) = folder();
    let check = |more: &[&str]| {
        let dome = ["--dome-fov-deg", "110", "--dome-tilt-deg", "90"];
        run(folder.path(), &[&["dome", "check", "--config", "dome.toml"], &dome[..], more].concat())
    };
    let (code, lines, log) = check(&["--json", "dome.json", "--html", "dome.html"]);
    assert_eq!(code, 1, "{lines}{log}");
    let failed = |lines: &str| {
        lines
            .lines()
            .filter(|line| line.contains(" FAIL "))
            .map(|line| line.split(' ').next().unwrap().to_owned())
            .collect::<Vec<_>>()
    };
    // The only problem is that the blend masks are missing.
    assert_eq!(failed(&lines), ["blend"], "{lines}");
    assert!(lines.contains("no projector has a blend mask") && lines.contains("right"), "{lines}");
    let json: serde_json::Value =
        serde_json::from_str(&fs::read_to_string(folder.path().join("dome.json")).unwrap()).unwrap();
    assert!(
        json["coverage"][0].as_f64().unwrap() > 0.995 && json["projectors"].as_array().unwrap().len() == 2,
        "{json}"
    );
    let page = fs::read_to_string(folder.path().join("dome.html")).unwrap();
    assert!(page.matches("<img").count() == 3 && page.contains("class=FAIL"), "the page has three maps");

    fs::write(folder.path().join("right.pfm"), pfm(true, false)).unwrap();
    let (code, lines, _) = check(&[]);
    assert!(code == 1 && lines.contains("rows upside down"), "{lines}");
    // A key of the configuration corrects this.
    let (_, lines, _) = check(&["--set", "views.right.rows=top_first"]);
    assert_eq!(failed(&lines), ["blend"], "{lines}");
    let one = configuration("").replace("right.pfm", "left.pfm");
    fs::write(folder.path().join("dome.toml"), one).unwrap();
    let (_, lines, _) = check(&[]);
    assert_eq!(failed(&lines), ["coverage", "blend", "tilt", "twice"], "{lines}");
}

#[test]
fn invalid_projectors_are_refused_with_file_and_key() {
    let (folder, _) = folder();
    let refused = |configuration: String, parts: &[&str]| {
        fs::write(folder.path().join("dome.toml"), configuration).unwrap();
        let (code, _, log) = run(folder.path(), &["render", "--config", "dome.toml", "--out", "out"]);
        assert!(code == 64 && parts.iter().all(|part| log.contains(part)), "{code} {log}");
    };
    let right = configuration("");
    refused(right.replace("right.pfm", "none.pfm"), &["views", "right", "file", "none.pfm"]);
    refused(right.replace("file = 'right.pfm'", "file = 'stars.csv'"), &["right", "stars.csv"]);
    let with = |keys: &str| right.replace("file = 'right.pfm'", &format!("file = 'right.pfm'\n{keys}"));
    refused(with("method = 'bent'"), &["method", "direct", "resampled"]);
    refused(with("source_scale = 2.0"), &["source_scale", "method = \"resampled\""]);
    refused(with("method = 'resampled'\nsource_scale = 9.0"), &["source_scale", "between 0.25 and 4"]);
    refused(with("gamma = 0.0"), &["gamma", "between 1 and 4"]);
    refused(with("lut = 'stars.csv'"), &["lut", "stars.csv"]);
    refused(with("blend = 'computed'"), &["left", "blend", "computed"]);
    refused(with("white_cd_m2 = 100.0"), &["left", "white_cd_m2", "missing key"]);
    refused(with("black_cd_m2 = 0.1"), &["right", "black_cd_m2", "computed"]);
    refused(right.replace("file = 'right.pfm'", "file = 'right.pfm'\naxes = 'x=x'"), &["axes", "every axis once"]);
    let mut folded = pfm(true, true);
    let header = folded.len() - 12 * SAMPLES * SAMPLES;
    let (first, rest) = folded[header..].split_at_mut(12 * SAMPLES * (SAMPLES - 6));
    // Repeat the last rows, so that the warp folds over itself.
    for row in 0..6 {
        let from = first.len() - 12 * SAMPLES * (row + 2);
        rest[12 * SAMPLES * row..][..12 * SAMPLES].copy_from_slice(&first[from..][..12 * SAMPLES]);
    }
    fs::write(folder.path().join("right.pfm"), folded).unwrap();
    refused(right.clone(), &["right", "right.pfm", "folds", "pixel ("]);
    // `dome check` continues and reports it.
    fs::write(folder.path().join("dome.toml"), right).unwrap();
    let (code, lines, _) = run(folder.path(), &["dome", "check", "--config", "dome.toml"]);
    assert!(code == 1 && lines.contains("folds      FAIL right") && lines.contains("coverage"), "{lines}");
}

/// Installers' files are converted to a configuration with computed blends, which can be drawn and checked.
#[test]
fn import_writes_a_configuration_with_all_projectors() {
    let (folder, light) = folder();
    let import = |more: &[&str]| {
        let files = ["projectors", "import", "left.pfm", "right.pfm", "--out", "imported.toml", "--overwrite"];
        run(folder.path(), &[&files[..], more].concat())
    };
    let (code, lines, log) = import(&["--size", "110x200", "--blend", "computed"]);
    assert!(code == 0 && lines.contains("left: 110 x 200 pixels") && lines.contains("2 projectors"), "{lines}{log}");
    let text = fs::read_to_string(folder.path().join("imported.toml")).unwrap();
    for part in ["name = \"right\"", "file = \"right.pfm\"", "rows = \"as_format\"", "# - "] {
        assert!(text.contains(part), "{part}: {text}");
    }
    let dome = ["--dome-fov-deg", "110", "--dome-tilt-deg", "90"];
    let (code, lines, _) = run(folder.path(), &[&["dome", "check", "--config", "imported.toml"], &dome[..]].concat());
    assert_eq!(code, 0, "{lines}");
    // With the shares of the computed blends, the light of every star is counted exactly once.
    let set = ["--set", "scene.catalogues=['stars.csv']", "--set", "glare.method=none"];
    let render = ["render", "--config", "imported.toml", "--out", "out", "--files", "exr"];
    let (code, _, log) = run(folder.path(), &[&render[..], &set].concat());
    assert_eq!(code, 0, "{log}");
    let mut sum = 0.0;
    for right in [false, true] {
        let name = if right { "right" } else { "left" };
        let bytes = fs::read(folder.path().join(format!("out/{name}.exr"))).unwrap();
        let [red, green, blue, alpha] = channels(&bytes, ["R", "G", "B", "alpha"]);
        for pixel in 0..SIZE[0] * SIZE[1] {
            let luminance =
                0.2126 * f64::from(red[pixel]) + 0.7152 * f64::from(green[pixel]) + 0.0722 * f64::from(blue[pixel]);
            sum += luminance * f64::from(alpha[pixel]) * pixel_sr(right, pixel % SIZE[0], pixel / SIZE[0]);
        }
    }
    let whole: f64 = light.iter().sum();
    println!("light of {STARS} stars through computed blends: relative error {:.1e}", sum / whole - 1.0);
    assert!((sum / whole - 1.0).abs() < 4e-4, "{sum} {whole}");

    fs::remove_file(folder.path().join("right.pfm")).unwrap();
    let (code, _, log) = import(&[]);
    assert!(code == 65 && log.contains("right.pfm"), "{code} {log}");
    let (code, _, log) = import(&["--size", "200"]);
    assert!(code == 64 && log.contains("1920x1080"), "{code} {log}");
}

/// No command overwrites a file that it reads, and an import replaces an existing file only on request.
#[test]
fn inputs_and_edited_configurations_are_not_overwritten() {
    let (folder, _) = folder();
    let content = |name: &str| fs::read(folder.path().join(name)).unwrap();
    let (before, configuration) = (content("left.pfm"), content("dome.toml"));
    fs::hard_link(folder.path().join("left.pfm"), folder.path().join("linked.toml")).unwrap();
    for out in ["left.pfm", "./left.pfm", "linked.toml"] {
        let import = ["projectors", "import", "left.pfm", "--out", out, "--overwrite"];
        let (code, _, log) = run(folder.path(), &import);
        assert!(code == 64 && log.contains("choose another file"), "{out}: {code} {log}");
    }
    let import = ["projectors", "import", "left.pfm", "--out", "dome.toml"];
    let (code, _, log) = run(folder.path(), &import);
    assert!(code == 64 && log.contains("the file exists") && log.contains("--overwrite"), "{code} {log}");
    let check = |more: &[&str]| run(folder.path(), &[&["dome", "check", "--config", "dome.toml"], more].concat());
    for out in [["--json", "dome.toml"], ["--html", "dome.toml"], ["--json", "left.pfm"], ["--html", "./right.pfm"]] {
        let (code, lines, log) = check(&out);
        assert!(code == 64 && lines.is_empty() && log.contains("choose another file"), "{out:?}: {code} {log}");
    }
    let (code, _, log) = check(&["--json", "report", "--html", "report"]);
    assert!(code == 64 && log.contains("give each its own file"), "{code} {log}");
    assert!(content("left.pfm") == before && content("dome.toml") == configuration);
}

#[test]
fn faults_of_calibrations_at_an_import_name_their_file() {
    let (folder, _) = folder();
    let import = |file: &str, more: &[&str]| {
        run(folder.path(), &[&["projectors", "import", file, "--out", "new.toml"], more].concat())
    };
    // Mirror half of the columns, so that the warp folds over itself.
    let mut folded = pfm(false, true);
    let header = folded.len() - 12 * SAMPLES * SAMPLES;
    for row in folded[header..].chunks_mut(12 * SAMPLES) {
        for column in SAMPLES / 2..SAMPLES {
            let from = 12 * (SAMPLES - 1 - column);
            row.copy_within(from..from + 12, 12 * column);
        }
    }
    fs::write(folder.path().join("folded.pfm"), folded).unwrap();
    let (code, _, log) = import("folded.pfm", &[]);
    assert!(
        code == 65 && log.contains("folded.pfm") && log.contains("folds") && !log.contains("new.toml"),
        "{code} {log}"
    );
    // In an earlier version, a raster of one pixel caused a panic.
    for size in ["1x1", "1x48", "48x1"] {
        let (code, _, log) = import("left.pfm", &["--size", size]);
        assert!(code == 65 && log.contains("must be 2 to 16384 pixels per side"), "{size}: {code} {log}");
    }
    // These options have no effect in this format.
    let (code, _, log) = import("left.pfm", &["--eye-m", "0,1,0"]);
    assert!(code == 65 && log.contains("eye_m = [0, 1, 0] has no effect"), "{code} {log}");
    let check = |set: &str| run(folder.path(), &["dome", "check", "--config", "dome.toml", "--set", set]);
    let (code, _, log) = check("views.left.blend=false");
    assert!(code == 64 && log.contains("expected one of `file`, `computed`, `none`"), "{code} {log}");
    let (_, lines, _) = check("views.left.file=''");
    assert!(lines.contains("it is empty: must be the name of a file"), "{lines}");
    assert!(!folder.path().join("new.toml").exists());
}
