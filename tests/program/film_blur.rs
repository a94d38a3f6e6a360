//! Motion blur of films: the light of a star's trail, its length, and what is refused.

use std::fs;
use std::path::Path;
use std::process::Command;

use steradian::photometry::rec709::luminance;

use crate::exr_file::channels;

/// Width of the picture, pixels, and its vertical field of view; it is square.
const SIDE: usize = 128;
const FOV_Y_DEG: f64 = 10.0;
/// By how much the camera turns from frame to frame, degrees.
const TURN_DEG: f64 = 0.8;

fn film(folder: &Path, out: &str, arguments: &[&str], code: i32) -> String {
    let output = Command::new(env!("CARGO_BIN_EXE_steradian"))
        .args(["film", "--config", "star.toml", "--path", "path.toml", "--out", out])
        .args(arguments)
        .current_dir(folder)
        .output()
        .unwrap();
    let told = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(code), "{arguments:?}: {told}");
    told
}

/// One star, and a camera that turns past it at a constant rate: in frame 10 it looks at it.
fn turning(scene: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| fs::write(folder.path().join(name), text).unwrap();
    write("star.csv", "ra_deg,dec_deg,v_mag,teff_k\n80.0,0.0,3.0,6500\n");
    write(
        "star.toml",
        &format!(
            "[scene]\ncatalogues = ['star.csv']\n[glare]\nmethod = 'none'\n[stars]\nmethod = 'bspline'\n\
             [[views]]\nname = 'eye'\ntype = 'perspective'\nsize = [{SIDE}, {SIDE}]\nfov_y_deg = {FOV_Y_DEG}\n{scene}"
        ),
    );
    let key = |frame: i32| {
        let ra_deg = 80.0 + TURN_DEG * f64::from(frame - 10);
        format!("[[keyframes]]\nframe = {frame}\nlook = {{ ra_deg = {ra_deg}, dec_deg = 0 }}\neasing = 'linear'\n")
    };
    write("path.toml", &(key(0) + &key(20)));
    folder
}

/// Light of an image, lx; its mean place and its variance along the rows, pixels.
fn moments(file: &Path) -> [f64; 3] {
    let [red, green, blue, omega_sr] = channels(&fs::read(file).unwrap(), ["R", "G", "B", "omega"]);
    let light = |at: usize| luminance([red[at], green[at], blue[at]].map(f64::from)) * f64::from(omega_sr[at]);
    let sum =
        |of: &dyn Fn(f64) -> f64| -> f64 { (0..SIDE * SIDE).map(|at| light(at) * of((at % SIDE) as f64 + 0.5)).sum() };
    let total_lx = sum(&|_| 1.0);
    let mean_px = sum(&|x| x) / total_lx;
    [total_lx, mean_px, sum(&|x| (x - mean_px).powi(2)) / total_lx]
}

#[test]
fn the_trail_of_a_star_has_its_light_and_the_length_that_the_shutter_gives() {
    let folder = turning("");
    let one = ["--frames", "10..11", "--format", "exr32"];
    film(folder.path(), "sharp", &one, 0);
    let at = |out: &str| folder.path().join(out).join("eye_00010.exr");
    let [still_lx, still_px, own_px2] = moments(&at("sharp"));
    let px_per_rad = SIDE as f64 / 2.0 / (FOV_Y_DEG.to_radians() / 2.0).tan();
    for (open, sub_frames) in [(0.5, 16), (1.0, 5), (0.25, 2)] {
        let out = format!("{open}-{sub_frames}");
        let [open_text, number] = [open.to_string(), sub_frames.to_string()];
        let blurred = ["--shutter", &open_text, "--sub-frames", &number];
        film(folder.path(), &out, &[&one[..], &blurred].concat(), 0);
        let [trail_lx, trail_px, px2] = moments(&at(&out));
        // Evenly spaced places have a variance of step^2 (N^2 - 1) / 12.
        let n = f64::from(sub_frames);
        let length_px = ((px2 - own_px2) * 12.0 / (n * n - 1.0)).sqrt() * n;
        let expected_px = px_per_rad * (open * TURN_DEG.to_radians());
        let [light, length] = [trail_lx / still_lx - 1.0, length_px / expected_px - 1.0];
        println!("open {open}, {sub_frames} moments: light {light:.1e}, length {length:.1e}, {length_px:.3} pixels");
        // Measured: 2.8e-8, 1.8e-5.
        assert!(light.abs() < 1.2e-7 && length.abs() < 8e-5, "{light} {length}");
        assert!((trail_px - still_px).abs() < 2e-3, "{trail_px} {still_px}");
    }
}

#[test]
fn one_moment_and_a_closed_shutter_are_no_blur_and_sub_frames_share_the_exposure() {
    let folder = turning("[exposure]\nmetering = 'mean'\n");
    for format in ["png8", "png16"] {
        let one = ["--frames", "10..11", "--format", format];
        let read = |out: &str| fs::read(folder.path().join(out).join("eye_00010.png")).unwrap();
        let run = |name: &str, arguments: &[&str]| {
            let out = format!("{format}-{name}");
            film(folder.path(), &out, &[&one[..], arguments].concat(), 0);
            read(&out)
        };
        let sharp = run("sharp", &[]);
        assert!(run("one", &["--shutter", "0.5", "--sub-frames", "1"]) == sharp);
        assert!(run("closed", &["--shutter", "0", "--sub-frames", "8"]) == sharp);
        let blurred = run("blurred", &["--shutter", "0.5", "--sub-frames", "4"]);
        assert!(blurred != sharp);
        // Alone and in another folder: the same bytes.
        assert!(run("again", &["--shutter", "0.5", "--sub-frames", "4"]) == blurred);
    }
    // Another film than the sharp one.
    let other = ["--frames", "10..11", "--shutter", "0.5", "--sub-frames", "4"];
    let told = film(folder.path(), "png8-sharp", &other, 64);
    assert!(told.contains("motion blur"), "{told}");
}

#[test]
fn shutters_and_overlays_that_cannot_be_are_64() {
    let folder = turning("test_pattern = true\n");
    for (arguments, part) in [
        (&["--shutter", "0.5", "--sub-frames", "4"][..], "test patterns"),
        (&["--shutter", "1.5", "--sub-frames", "4"], "0 to 1"),
        (&["--shutter", "0.5", "--sub-frames", "65"], "64"),
        (&["--shutter", "0.5"], "--sub-frames"),
        (&["--sub-frames", "5"], "--shutter"),
    ] {
        let told = film(folder.path(), "film", &[&["--frames", "0..1"], arguments].concat(), 64);
        assert!(told.contains(part), "{part}: {told}");
    }
}
