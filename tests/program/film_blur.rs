//! Motion blur of films: light and length of a star's trail, and refused arguments.

use std::fs;
use std::path::Path;
use std::process::Command;

use steradian::photometry::rec709::luminance;

use crate::exr_file::channels;

/// Width and height of the picture, pixels, and its vertical field of view.
const SIDE: usize = 128;
const FOV_Y_DEG: f64 = 10.0;
/// Turn of the camera per frame, degrees.
const TURN_DEG: f64 = 0.8;

fn film(folder: &Path, out: &str, arguments: &[&str], code: i32) -> String {
    let output = Command::new(env!("CARGO_BIN_EXE_steradian"))
        .args(["film", "--config", "star.toml", "--path", "path.toml", "--out", out])
        .args(arguments)
        .current_dir(folder)
        .output()
        .unwrap();
    let log = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(code), "{arguments:?}: {log}");
    log
}

/// Writes a scene with one star, and a path on which the camera turns at a constant rate and looks at the star in frame
/// 10.
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

/// Returns the light of an image, lx, and the mean (pixels) and the variance (square pixels) of its position along the
/// rows.
fn moments(file: &Path) -> [f64; 3] {
    let [red, green, blue, omega_sr] = channels(&fs::read(file).unwrap(), ["R", "G", "B", "omega"]);
    let light =
        |index: usize| luminance([red[index], green[index], blue[index]].map(f64::from)) * f64::from(omega_sr[index]);
    let sum = |weight: &dyn Fn(f64) -> f64| -> f64 {
        (0..SIDE * SIDE).map(|index| light(index) * weight((index % SIDE) as f64 + 0.5)).sum()
    };
    let total_lx = sum(&|_| 1.0);
    let mean_px = sum(&|x| x) / total_lx;
    [total_lx, mean_px, sum(&|x| (x - mean_px).powi(2)) / total_lx]
}

#[test]
fn star_trail_has_the_light_of_the_star_and_the_length_of_the_shutter() {
    let folder = turning("");
    let one = ["--frames", "10..11", "--format", "exr32"];
    film(folder.path(), "sharp", &one, 0);
    let frame_file = |out: &str| folder.path().join(out).join("eye_00010.exr");
    let [still_lx, still_px, own_px2] = moments(&frame_file("sharp"));
    let px_per_rad = SIDE as f64 / 2.0 / (FOV_Y_DEG.to_radians() / 2.0).tan();
    for (open, sub_frames) in [(0.5, 16), (1.0, 5), (0.25, 2)] {
        let out = format!("{open}-{sub_frames}");
        let [open_text, number] = [open.to_string(), sub_frames.to_string()];
        let blurred = ["--shutter", &open_text, "--sub-frames", &number];
        film(folder.path(), &out, &[&one[..], &blurred].concat(), 0);
        let [trail_lx, trail_px, px2] = moments(&frame_file(&out));
        // Evenly spaced positions have a variance of step^2 (N^2 - 1) / 12.
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
fn single_moment_or_closed_shutter_gives_no_blur_and_sub_frames_share_the_exposure() {
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
        // Another run, into another folder, gives the same bytes.
        assert!(run("again", &["--shutter", "0.5", "--sub-frames", "4"]) == blurred);
    }
    // The blurred film differs from the sharp one.
    let other = ["--frames", "10..11", "--shutter", "0.5", "--sub-frames", "4"];
    let log = film(folder.path(), "png8-sharp", &other, 64);
    assert!(log.contains("motion blur"), "{log}");
}

#[test]
fn invalid_shutters_and_overlays_exit_64() {
    let folder = turning("test_pattern = true\n");
    for (arguments, part) in [
        (&["--shutter", "0.5", "--sub-frames", "4"][..], "test patterns"),
        (&["--shutter", "1.5", "--sub-frames", "4"], "between 0 and 1"),
        (&["--shutter", "0.5", "--sub-frames", "65"], "64"),
        (&["--shutter", "0.5"], "--sub-frames"),
        (&["--sub-frames", "5"], "--shutter"),
    ] {
        let log = film(folder.path(), "film", &[&["--frames", "0..1"], arguments].concat(), 64);
        assert!(log.contains(part), "{part}: {log}");
    }
}
