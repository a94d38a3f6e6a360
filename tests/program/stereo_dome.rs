//! Tests omni-directional stereo of domes: directions of near bodies, occlusion, light of stars, and packing.

use std::f64::consts::PI;
use std::fs;
use std::path::Path;
use std::process::Command;

use glam::DVec3;
use steradian::photometry::rec709::luminance;
use steradian::view::projection::{Fisheye, FisheyeMapping, PlaneMapping, pixel_centre};

use crate::exr_file::channels;

const SIDE: u32 = 512;
/// Half the distance between the eyes, m.
const RADIUS_M: f64 = 0.032;
/// Positions of bodies: azimuth from the front to the right and angle from the zenith, degrees; distance, m.
const PLACES: [[f64; 3]; 5] =
    [[12.0, 88.0, 2.0], [85.0, 60.0, 1.0], [152.0, 40.0, 3.0], [231.0, 20.0, 1.5], [300.0, 75.0, 8.0]];

fn steradian(folder: &Path, arguments: &[&str], code: i32) -> String {
    let mut command = Command::new(env!("CARGO_BIN_EXE_steradian"));
    let output = command.args(arguments).current_dir(folder).output().unwrap();
    let log = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(code), "{arguments:?}: {log}");
    log
}

/// Returns a position in world axes, which are those of the dome before its tilt: +y zenith, -z front.
fn place(polar: [f64; 3]) -> DVec3 {
    let [azimuth, zenith] = [polar[0], polar[1]].map(f64::to_radians);
    DVec3::new(zenith.sin() * azimuth.sin(), zenith.cos(), -zenith.sin() * azimuth.cos()) * polar[2]
}

/// Returns the viewing direction in which an eye sees a place. It is perpendicular to the eye's position on the circle.
/// `side` is -1 for the left eye and 1 for the right one.
fn seen_in(place_m: DVec3, side: f64) -> DVec3 {
    let mut direction = place_m.normalize();
    for _ in 0..60 {
        direction = (place_m - side * RADIUS_M * direction.cross(DVec3::Y)).normalize();
    }
    direction
}

/// Converts a vector to the axes of the picture, whose centre is the zenith and whose bottom is the front.
fn in_picture(world: DVec3) -> DVec3 {
    DVec3::new(world.x, world.z, -world.y)
}

/// Returns the pixels of an OpenEXR file: luminance, cd/m^2, and solid angle, sr.
fn pixels(file: &Path) -> Vec<[f64; 2]> {
    let [red, green, blue, omega_sr] = channels(&fs::read(file).unwrap(), ["R", "G", "B", "omega"]);
    let light = |index: usize| luminance([red[index], green[index], blue[index]].map(f64::from));
    (0..omega_sr.len()).map(|index| [light(index), f64::from(omega_sr[index])]).collect()
}

/// Returns the mean direction of the light within an angle of a direction, in the picture's axes, and the sum of this
/// light, lx.
fn mean_direction(pixels: &[[f64; 2]], around: DVec3, radius_deg: f64) -> (DVec3, f64) {
    let mapping = Fisheye::new([SIDE; 2], FisheyeMapping::Equidistant, PI).unwrap();
    let (mut sum, mut total_lx) = (DVec3::ZERO, 0.0);
    for (index, [light, omega_sr]) in pixels.iter().enumerate().filter(|(_, [light, _])| *light > 0.0) {
        let direction = mapping.direction_from_pixel(pixel_centre(index as u32 % SIDE, index as u32 / SIDE)).unwrap();
        if direction.angle_between(around) < radius_deg.to_radians() {
            sum += direction * (light * omega_sr);
            total_lx += light * omega_sr;
        }
    }
    (sum.normalize(), total_lx)
}

fn write_scene(folder: &Path, catalogues: &str, dome: &str, bodies: &str) {
    let scene = format!(
        "[scene]\ncatalogues = {catalogues}\n[glare]\nmethod = 'none'\n[stars]\nmethod = 'bspline'\n\
         [[views]]\nname = 'dome'\ntype = 'dome_master'\nsize = [{SIDE}, {SIDE}]\n{dome}\n{bodies}"
    );
    fs::write(folder.join("dome.toml"), scene).unwrap();
}

fn body(number: usize, place_m: DVec3, radius_m: f64, more: &str) -> String {
    let [x, y, z] = place_m.to_array();
    format!(
        "[[bodies]]\nname = 'b{number}'\nposition_m = [{x}, {y}, {z}]\nradius_m = {radius_m}\ngeometric_albedo = 0.0\n{more}\n"
    )
}

#[test]
fn near_bodies_have_the_directions_of_the_eye_circle_at_every_azimuth() {
    let folder = tempfile::tempdir().unwrap();
    // On the horizon, the angle between the directions of both eyes has a closed form.
    let ahead = DVec3::new(0.0, 0.0, -2.0);
    let apart_rad = seen_in(ahead, -1.0).angle_between(seen_in(ahead, 1.0));
    assert!((apart_rad - 2.0 * (RADIUS_M / 2.0).asin()).abs() < 1e-12);
    let pixel_rad = PI / f64::from(SIDE);
    // Draw the bodies as discs of about ten pixels, and as points of light.
    for (kind, radius_m) in [("discs", 0.03), ("points", 0.0015)] {
        let lit = "emission = { absolute_magnitude = 50, temperature_k = 6000 }";
        let bodies: String = PLACES
            .into_iter()
            .enumerate()
            .map(|(number, polar)| body(number, place(polar), radius_m * polar[2], lit))
            .collect();
        write_scene(folder.path(), "[]", "ipd_m = 0.064", &bodies);
        steradian(folder.path(), &["render", "--config", "dome.toml", "--out", kind, "--files", "exr"], 0);
        let [left, right] = ["left", "right"].map(|eye| pixels(&folder.path().join(format!("{kind}/dome.{eye}.exr"))));
        let mut worst_px = 0.0_f64;
        for polar in PLACES {
            let expected = [-1.0, 1.0].map(|side| in_picture(seen_in(place(polar), side)));
            let found = [&left, &right].map(|eye| mean_direction(eye, in_picture(place(polar).normalize()), 8.0).0);
            let disparity_px = expected[0].angle_between(expected[1]) / pixel_rad;
            assert!(disparity_px > 0.8, "{polar:?}: {disparity_px}");
            for (found, expected) in found.into_iter().zip(expected) {
                worst_px = worst_px.max(found.angle_between(expected) / pixel_rad);
            }
        }
        println!("{kind}: error of position {worst_px:.1e} pixels");
        // Measured for discs: 3.1e-3.
        assert!(worst_px < 0.012, "{kind}: {worst_px}");
    }
}

#[test]
fn stars_equal_those_of_a_mono_dome_and_near_bodies_hide_them_from_one_eye() {
    let folder = tempfile::tempdir().unwrap();
    let render = |out: &str| {
        steradian(folder.path(), &["render", "--config", "dome.toml", "--out", out, "--files", "exr"], 0);
    };
    write_scene(folder.path(), "['builtin:bright']", "", "");
    render("one");
    write_scene(folder.path(), "['builtin:bright']", "ipd_m = 0.064", "");
    render("two");
    let read = |name: &str| pixels(&folder.path().join(name));
    let one = read("one/dome.exr");
    assert!(
        read("two/dome.left.exr") == one && read("two/dome.right.exr") == one,
        "the picture of an eye differs from the mono picture"
    );

    // Put stars at the directions in which the left eye sees the centres of black bodies, which are some four pixels
    // wide.
    let places = PLACES.into_iter().filter(|polar| polar[2] <= 3.0);
    let places: Vec<([f64; 3], DVec3)> = places.map(|polar| (polar, seen_in(place(polar), -1.0))).collect();
    let mut stars = "ra_deg,dec_deg,v_mag\n".to_owned();
    for (_, direction) in &places {
        let (ra_deg, dec_deg) =
            (direction.y.atan2(direction.x).to_degrees().rem_euclid(360.0), direction.z.asin().to_degrees());
        stars.push_str(&format!("{ra_deg},{dec_deg},2.0\n"));
    }
    fs::write(folder.path().join("stars.csv"), stars).unwrap();
    let lights = |bodies: &str| -> Vec<[f64; 2]> {
        write_scene(folder.path(), "['stars.csv']", "ipd_m = 0.064", bodies);
        render("stars");
        let eyes = ["left", "right"].map(|eye| read(&format!("stars/dome.{eye}.exr")));
        let of_star = |direction: DVec3| [0, 1].map(|eye| mean_direction(&eyes[eye], in_picture(direction), 3.0).1);
        places.iter().map(|(_, direction)| of_star(*direction)).collect()
    };
    let open = lights("");
    let bodies = places.iter().enumerate();
    let covered = lights(
        &bodies.map(|(number, (polar, _))| body(number, place(*polar), 0.0127 * polar[2], "")).collect::<String>(),
    );
    for (((polar, _), open), covered) in places.iter().zip(open).zip(covered) {
        assert!(open[0] > 0.0 && open[0] == open[1]);
        assert!(covered[0] == 0.0 && (covered[1] / open[1] - 1.0).abs() < 1e-3, "{polar:?}: {covered:?} {open:?}");
    }
}

#[test]
fn eyes_are_packed_by_render_and_film_and_other_views_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let out = |name: &str| folder.path().join(name);
    let size = |name: &str| {
        let png = std::io::BufReader::new(fs::File::open(out(name)).unwrap());
        png::Decoder::new(png).read_info().unwrap().info().size()
    };
    fs::write(out("path.toml"), "[[keyframes]]\nframe = 0\nmagnitude_limit = 6\n").unwrap();
    let eyes = "[[views]]\nname = 'eyes'\ntype = 'stereo'\nsize = [60, 40]\nipd_m = 0.06\npacking = 'side_by_side'\n\
                fov = { left_deg = -40, right_deg = 30, up_deg = 30, down_deg = -30 }\n";
    write_scene(folder.path(), "['builtin:bright']", "ipd_m = 0.064\npacking = 'top_bottom'", eyes);
    steradian(folder.path(), &["render", "--config", "dome.toml", "--out", "render"], 0);
    assert_eq!((size("render/dome.png"), size("render/eyes.png")), ((SIDE, 2 * SIDE), (120, 40)));
    assert!(!out("render/dome.left.png").exists());
    let film = ["film", "--config", "dome.toml", "--path", "path.toml", "--frames", "0..1", "--out", "film"];
    steradian(folder.path(), &film, 0);
    assert_eq!((size("film/dome_00000.png"), size("film/eyes_00000.png")), ((SIDE, 2 * SIDE), (120, 40)));
    // The halves of the packed picture are the pictures of the eyes.
    let packed = pixels(&out("render/eyes.exr"));
    let scene = fs::read_to_string(out("dome.toml")).unwrap();
    fs::write(out("dome.toml"), scene.replace("packing = 'side_by_side'\n", "")).unwrap();
    steradian(folder.path(), &["render", "--config", "dome.toml", "--out", "apart", "--files", "exr"], 0);
    let [left, right] = ["left", "right"].map(|eye| pixels(&out(&format!("apart/eyes.{eye}.exr"))));
    for (row, (left, right)) in packed.chunks(120).zip(left.chunks(60).zip(right.chunks(60))) {
        assert!(row[..60] == *left && row[60..] == *right);
    }
    write_scene(folder.path(), "['builtin:bright']", "packing = 'top_bottom'", "");
    let log = steradian(folder.path(), &["render", "--config", "dome.toml", "--out", "none"], 64);
    assert!(log.contains("packing") && log.contains("ipd_m"), "{log}");
    write_scene(folder.path(), "['builtin:bright']", "ipd_m = -1.0", "");
    let log = steradian(folder.path(), &["render", "--config", "dome.toml", "--out", "none"], 64);
    assert!(log.contains("ipd_m"), "{log}");
}
