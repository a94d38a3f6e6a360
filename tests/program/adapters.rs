//! Adapters with fewer features, and a second, independent driver, draw the same pictures.

use std::{
    fs::{self, File},
    io::BufReader,
    path::{Path, PathBuf},
    process::{Command, Stdio},
};

use testkit::exr_file::channels;

/// Driver in Debian's package of the browser.
const SECOND_DRIVER: &str = "/usr/lib/chromium/vk_swiftshader_icd.json";

/// A configuration, and overrides that make its views small.
type Picture = (&'static str, &'static [&'static str]);

/// Configurations with all kinds of objects. The second driver draws only the first of them, because compiling shaders takes it minutes.
const PICTURES: [Picture; 3] = [
    ("overlay", &["views.window.size=[320,200]", "views.dome.size=[192,192]", "views.cube.face_size=64"]),
    ("tonight", &["views.dome.size=[192,192]", "views.south.size=[256,144]"]),
    ("asteroids", &["views.window.size=[240,136]", "views.headset.size=[96,96]", "views.dome.size=[128,128]"]),
];

fn steradian(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_steradian"));
    command.args(arguments).current_dir(env!("CARGO_MANIFEST_DIR")).stdin(Stdio::null());
    command.env_remove("STERADIAN_LOG").env_remove("STERADIAN_SHADERS");
    command
}

/// Runs a command that must end with `code`; returns its standard output and standard error.
fn run(mut command: Command, code: i32) -> [String; 2] {
    let output = command.output().unwrap();
    let texts = [&output.stdout, &output.stderr].map(|text| String::from_utf8_lossy(text).into_owned());
    assert_eq!(output.status.code(), Some(code), "{command:?}\n{}\n{}", texts[0], texts[1]);
    texts
}

#[test]
fn an_adapter_with_too_little_is_refused_with_what_it_lacks() {
    let [out, error] = run(steradian(&["info", "--adapter-limits", "storage-buffers=4"]), 69);
    assert!(out.is_empty(), "{out}");
    assert!(error.contains("offers too little: 4 storage buffers per stage: at least 8 needed"), "{error}");
    let [_, error] = run(steradian(&["info", "--adapter-limits", "binding-mib=0"]), 64);
    assert!(error.contains("`binding-mib=0` is not a restriction"), "{error}");
    if cfg!(feature = "xr") {
        let [_, error] = run(steradian(&["xr", "--adapter-limits", "webgpu"]), 64);
        assert!(error.contains("--adapter-limits: a headset"), "{error}");
    }
}

#[test]
fn info_lists_needs_offers_and_what_is_done_instead() {
    let report = |limits: &str| -> serde_json::Value {
        let [out, _] = run(steradian(&["info", "--json", "--adapter-limits", limits]), 0);
        serde_json::from_str(&out).unwrap()
    };
    let webgpu = report("webgpu");
    let needs = webgpu["needs"].as_array().unwrap();
    let buffers = needs.iter().find(|need| need["name"] == "storage buffers per stage").unwrap();
    assert_eq!((&buffers["needed"], &buffers["offered"]), (&8.into(), &8.into()), "{buffers}");
    let instead = webgpu["fallbacks"].to_string();
    for part in ["32-bit words", "not measured", "16-bit floats", "in a texture", "separate pass", "without a map"] {
        assert!(instead.contains(part), "{part}: {instead}");
    }
    let timestamps = report("no-timestamps")["fallbacks"].to_string();
    assert!(timestamps.contains("not measured") && !timestamps.contains("in a texture"), "{timestamps}");
    assert!(report("storage-buffers=9")["fallbacks"].to_string().contains("separate pass"));
}

/// Renders the pictures, with the arguments and the environment for one adapter. Returns the names of the files.
fn render(pictures: &[Picture], folder: &Path, limits: Option<&str>, driver: Option<&str>) -> Vec<PathBuf> {
    for (name, overrides) in pictures {
        let (config, out) = (format!("configs/{name}.toml"), folder.join(name).display().to_string());
        let mut command = steradian(&["render", "--config", &config, "--out", &out]);
        command.args(overrides.iter().flat_map(|entry| ["--set", entry]));
        command.args(limits.iter().flat_map(|limits| ["--adapter-limits", limits]));
        if let Some(driver) = driver {
            command.env("VK_DRIVER_FILES", driver);
        }
        run(command, 0);
    }
    let files = pictures.iter().flat_map(|(name, _)| fs::read_dir(folder.join(name)).unwrap());
    let mut files: Vec<PathBuf> = files.map(|file| file.unwrap().path()).collect();
    files.retain(|file| file.extension().is_some_and(|of| of == "exr" || of == "png"));
    files.sort();
    files.iter().map(|file| file.strip_prefix(folder).unwrap().to_owned()).collect()
}

/// Returns the illuminance of an HDR picture, lx.
fn light_lx(file: &Path) -> f64 {
    let [red, green, blue, omega] = channels(&fs::read(file).unwrap(), ["R", "G", "B", "omega"]);
    let weighted = |i: usize| 0.2126 * f64::from(red[i]) + 0.7152 * f64::from(green[i]) + 0.0722 * f64::from(blue[i]);
    (0..omega.len()).map(|i| weighted(i) * f64::from(omega[i])).sum()
}

fn codes(file: &Path) -> Vec<u8> {
    let mut reader = png::Decoder::new(BufReader::new(File::open(file).unwrap())).read_info().unwrap();
    let mut codes = vec![0; reader.output_buffer_size().unwrap()];
    reader.next_frame(&mut codes).unwrap();
    codes
}

/// Returns the largest difference between the codes of two pictures, and the 99.9 % quantile of the differences.
fn code_differences(one: &[u8], other: &[u8]) -> [u8; 2] {
    assert_eq!(one.len(), other.len());
    let mut differences: Vec<u8> = one.iter().zip(other).map(|(a, b)| a.abs_diff(*b)).collect();
    differences.sort_unstable();
    [differences[differences.len() - 1], differences[(differences.len() - 1) * 999 / 1000]]
}

/// Compares all pictures of two adapters. Returns the largest value over all pictures of each of these: the relative difference of light, the largest
/// difference of codes, and the 99.9 % quantile of the differences of codes.
fn differences(one: &Path, other: &Path, files: &[PathBuf]) -> (f64, u8, u8) {
    let (mut light, mut most, mut usual) = (0.0_f64, 0, 0);
    for file in files {
        if file.extension().is_some_and(|of| of == "exr") {
            light = light.max((light_lx(&one.join(file)) / light_lx(&other.join(file)) - 1.0).abs());
        } else {
            let [largest, of_most] = code_differences(&codes(&one.join(file)), &codes(&other.join(file)));
            println!(
                "{}: largest difference {largest} codes, 99.9 % of the differences are at most {of_most}",
                file.display()
            );
            (most, usual) = (most.max(largest), usual.max(of_most));
        }
    }
    (light, most, usual)
}

/// Draws pictures on this machine's adapter, and again with the given limits or driver, and compares them.
fn compare(pictures: &[Picture], least: usize, limits: Option<&str>, driver: Option<&str>) {
    let folder = tempfile::tempdir().unwrap();
    let [own, other] = ["own", "other"].map(|name| folder.path().join(name));
    let files = render(pictures, &own, None, None);
    assert!(files.len() >= least, "{files:?}");
    assert_eq!(render(pictures, &other, limits, driver), files);
    let (light, most, usual) = differences(&own, &other, &files);
    let found = format!("relative difference of light {light:.1e}, of codes {most}, 99.9 % of them at most {usual}");
    println!("{}: {found}", limits.or(driver).unwrap_or_default());
    assert!(light < 2e-7 && most <= 4 && usual == 0, "{found}");
}

#[test]
fn an_adapter_with_the_limits_of_webgpu_draws_the_same_pictures() {
    compare(&PICTURES, 16, Some("webgpu"), None);
}

#[test]
#[ignore = "long: make test-all"]
fn a_second_driver_draws_the_same_pictures() {
    if Path::new(SECOND_DRIVER).exists() {
        compare(&PICTURES[..1], 6, None, Some(SECOND_DRIVER));
    } else {
        assert!(std::env::var_os("STERADIAN_REQUIRE_PAGE").is_none(), "{SECOND_DRIVER} is missing");
        println!("skipped: {SECOND_DRIVER} is missing");
    }
}

#[test]
fn different_pictures_are_found() {
    assert_eq!(code_differences(&[10, 20, 30], &[10, 26, 30]), [6, 0]);
    let mut wrong = vec![0; 1000];
    wrong[..5].fill(9);
    assert_eq!(code_differences(&vec![0; 1000], &wrong), [9, 9]);
}
