//! Compares the files of theatres, as programs and installers write them, with directions in closed form.

use std::io::Write as _;

use steradian::{
    glam::{DMat3, DVec3},
    theatre::{Axes, Calibration, ReadOptions, Region, RowOrder, TheatreError, read},
    view::projection::PlaneMapping as _,
};

use crate::common::theatre::{png_grey, sgct};

const SIZE: [u32; 2] = [96, 54];
const PLANAR: &str = r#"{"type":"PlanarProjection","fov":{"left":30,"right":30,"up":20,"down":20},"orientation":{"yaw":0,"pitch":0,"roll":0}}"#;

fn read_files(files: &[(&str, &[u8])], options: &ReadOptions) -> Result<Calibration, TheatreError> {
    let folder = tempfile::tempdir().unwrap();
    for (name, bytes) in files {
        std::fs::write(folder.path().join(name), bytes).unwrap();
    }
    read(&folder.path().join(files[0].0), options)
}

fn one(files: &[(&str, &[u8])]) -> Region {
    read_files(files, &sized()).unwrap().regions.remove(0)
}

fn sized() -> ReadOptions {
    ReadOptions { size_px: Some(SIZE), ..ReadOptions::default() }
}

/// Returns the direction of a point (x to the right, y downwards) of a frustum of 60 x 40 degrees that is turned to the right by `yaw_deg` and up by
/// `pitch_deg`.
fn planar(x: f64, y: f64, yaw_deg: f64, pitch_deg: f64) -> DVec3 {
    let (wide, high) = (30f64.to_radians().tan(), 20f64.to_radians().tan());
    let turn = DMat3::from_rotation_y(-yaw_deg.to_radians()) * DMat3::from_rotation_x(pitch_deg.to_radians());
    (turn * DVec3::new((2.0 * x - 1.0) * wide, (1.0 - 2.0 * y) * high, -1.0)).normalize()
}

/// Asserts that all samples of a lattice, which extends from edge to edge, have the directions of the frustum.
#[track_caller]
fn assert_planar(region: &Region, yaw_deg: f64, pitch_deg: f64) {
    let grid = &region.grid;
    assert_eq!(region.size_px, SIZE);
    for (i, sample) in grid.samples.iter().enumerate() {
        let x = (i % grid.columns) as f64 / (grid.columns - 1) as f64;
        let y = (i / grid.columns) as f64 / (grid.rows - 1) as f64;
        let expected = planar(x, y, yaw_deg, pitch_deg);
        assert!(sample.unwrap().abs_diff_eq(expected, 1e-6), "{i}: {sample:?}, not {expected}");
    }
}

fn open_mesh() -> String {
    let mut text = "OPENMESH Version 1.1\nVERTICES 9\nFACES 8\nMAPPING NORMALIZED\nPROJECTION PERSPECTIVE\nPERSPECTIVE_PITCH 20\n\
                    PERSPECTIVE_YAW -30\nPERSPECTIVE_LEFT -30\nPERSPECTIVE_RIGHT 30\nPERSPECTIVE_TOP 20\nPERSPECTIVE_BOTTOM -20\n\
                    NATIVEXRES 96\nNATIVEYRES 54\n"
        .to_owned();
    for i in 0..9 {
        let (x, y) = (f64::from(i % 3) / 2.0, f64::from(i / 3) / 2.0);
        text += &format!("{} {} 255 {} {}\n", 96.0 * x, 54.0 * y, 1.0 - y, 1.0 - x);
    }
    for low in [0, 1, 3, 4] {
        text += &format!("[ {low} {} {} ]\n[ {low} {} {} ]\n", low + 1, low + 4, low + 4, low + 3);
    }
    text
}

fn sky_skan() -> String {
    let mut text = "Dome Azimuth=30\nDome Elevation=20\nHorizontal FOV=60\nVertical FOV=40\n3 3\n".to_owned();
    for i in 0..9 {
        let (x, y) = (f64::from(i % 3) / 2.0, f64::from(i / 3) / 2.0);
        text += &format!("{x} {y} {x} {y}\n");
    }
    text
}

#[test]
fn openmesh_and_sky_skan_have_their_own_frustum() {
    for text in [open_mesh(), sky_skan()] {
        assert_planar(&one(&[("mesh", text.as_bytes())]), 30.0, 20.0);
        let json = sgct(SIZE, PLANAR, r#","mesh":"mesh""#);
        assert_planar(&one(&[("set", json.as_bytes()), ("mesh", text.as_bytes())]), 30.0, 20.0);
    }
    for (from, to, expected) in [
        ("VERTICES 9", "VERTICES 8", "8, but there are 9"),
        ("PERSPECTIVE_TOP 20", "PERSPECTIVE_TOP x", "not a number"),
        ("NATIVEXRES 96\n", "", "no NATIVEXRES"),
        ("[ 0 1 4 ]", "[ 0 1 ]", "not a face"),
        ("NATIVEXRES", "FRUSTUM_EULER_ANGLES 1\nNATIVEXRES", "not documented"),
    ] {
        let error = read_files(&[("mesh", open_mesh().replacen(from, to, 1).as_bytes())], &sized()).unwrap_err();
        assert!(error.to_string().contains(expected), "{error}");
    }
    for (from, to) in [("3 3\n", "3 4\n"), ("Dome Azimuth=30", "Dome Azimuth=x"), ("Dome Elevation=20\n", "")] {
        assert!(read_files(&[("mesh", sky_skan().replacen(from, to, 1).as_bytes())], &sized()).is_err(), "{to}");
    }
}

#[test]
fn openmesh_has_the_size_of_its_raster_and_unknown_keys_are_noted() {
    let text = open_mesh();
    let without_size = ReadOptions::default();
    let found = read_files(&[("p1.ol", text.as_bytes())], &without_size).unwrap();
    assert_planar(&found.regions[0], 30.0, 20.0);
    assert!(!found.notes.iter().any(|note| note.contains("not known")), "{:?}", found.notes);
    let other = ReadOptions { size_px: Some([48, 27]), ..ReadOptions::default() };
    let found = read_files(&[("p1.ol", text.as_bytes())], &other).unwrap();
    assert_eq!(found.regions[0].size_px, [48, 27]);
    assert!(found.notes.iter().any(|note| note.contains("from the options and not that of the file, 96 x 54")));
    let more = text.replacen("NATIVEXRES", "FANCY 3\nDO_NO_WARP 1\nGAMMA 2.2\nNATIVEXRES", 1);
    let notes = read_files(&[("p1.ol", more.as_bytes())], &without_size).unwrap().notes;
    for part in ["the key FANCY is not known", "the key DO_NO_WARP is not known", "GAMMA 2.2 is not applied"] {
        assert!(notes.iter().any(|note| note.contains(part)), "{part}: {notes:?}");
    }
    // The size is not a whole number of pixels.
    let half = text.replacen("NATIVEXRES 96", "NATIVEXRES 96.5", 1);
    assert!(read_files(&[("p1.ol", half.as_bytes())], &without_size).is_err());
}

#[test]
fn names_that_no_view_can_have_are_replaced_with_a_note() {
    let named =
        |name: &str| sgct(SIZE, PLANAR, "").replace(r#""viewports""#, &format!(r#""name":"{name}","viewports""#));
    let found = |name: &str| read_files(&[("set", named(name).as_bytes())], &ReadOptions::default()).unwrap();
    let long = found(&"projector-".repeat(8));
    let title = long.regions[0].title.clone().unwrap();
    assert!(title.len() <= 64 && title.starts_with("projector-projector-"), "{title}");
    assert!(long.notes.iter().any(|note| note.contains("is `projector-")), "{:?}", long.notes);
    let other = found("\u{5de6}");
    assert_eq!(other.regions[0].title.as_deref(), Some("0_0_0"));
    assert!(other.notes.iter().any(|note| note.contains("the view 0_0_0 is `\u{5de6}`")), "{:?}", other.notes);
    assert!(!found("Left one").notes.iter().any(|note| note.contains("in the file: a view's name")));
}

#[test]
fn a_projection_plane_must_be_a_rectangle() {
    let plane = |x: f64| {
        let corner = |x: f64, y: f64| format!(r#"{{"x":{x},"y":{y},"z":-3}}"#);
        let (lower_left, upper_left, upper_right) = (corner(-1.0, -1.0), corner(x, 1.0), corner(1.0, 1.0));
        let projection = format!(
            r#"{{"type":"ProjectionPlane","lowerleft":{lower_left},"upperleft":{upper_left},"upperright":{upper_right}}}"#
        );
        read_files(&[("set", sgct(SIZE, &projection, "").as_bytes())], &ReadOptions::default())
    };
    assert!(plane(-1.0).is_ok() && plane(-1.003).is_ok());
    let error = plane(-0.8).unwrap_err().to_string();
    assert!(error.contains("84.28") && error.contains("a rectangle: 90 degrees within 0.1"), "{error}");
}

#[test]
fn shifts_of_simcad_move_the_points_of_the_picture() {
    let zeros = "0 ".repeat(9);
    let mesh = |x: &str| {
        format!(
            "<GeometryFile><GeometryDefinition><X-FlatParameters range=\"10\">{x}</X-FlatParameters>\
             <Y-FlatParameters range=\"10\">{zeros}</Y-FlatParameters></GeometryDefinition></GeometryFile>"
        )
    };
    let json = sgct(SIZE, PLANAR, r#","mesh":"mesh""#);
    assert_planar(&one(&[("set", json.as_bytes()), ("mesh", mesh(&zeros).as_bytes())]), 0.0, 0.0);
    // The middle column is moved to the right by a tenth of the raster, so the middle shows the content that was to its left.
    let moved = one(&[("set", json.as_bytes()), ("mesh", mesh("0 1 0 0 1 0 0 1 0").as_bytes())]);
    let middle = moved.grid.samples[(moved.grid.rows / 2) * moved.grid.columns + moved.grid.columns / 2].unwrap();
    let x = (moved.grid.columns / 2) as f64 + 0.5;
    let share = 0.5 * (x / moved.grid.columns as f64) / 0.6;
    let expected = planar(share, ((moved.grid.rows / 2) as f64 + 0.5) / moved.grid.rows as f64, 0.0, 0.0);
    assert!(middle.abs_diff_eq(expected, 1e-9), "{middle}, not {expected}");
    let alone = read_files(&[("mesh", mesh(&zeros).as_bytes())], &sized()).unwrap_err().to_string();
    assert!(alone.contains("SimCAD") && !alone.contains("MPCDI"), "{alone}");
    let old = read_files(&[("old.xml", b"<Cluster masterAddress=\"localhost\"/>")], &sized()).unwrap_err().to_string();
    assert!(old.contains("a configuration of SGCT in XML"), "{old}");
}

#[test]
fn sgc_meshes_of_version_2_are_triangles_or_a_strip() {
    let mesh = |version: u8, mode: u32, indices: &[u32]| {
        let mut bytes = b"SGC".to_vec();
        bytes.push(version);
        bytes.extend(0_u32.to_le_bytes());
        let head = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 20.0, -20.0, -30.0, 30.0_f32];
        bytes.extend(head.iter().flat_map(|value| value.to_le_bytes()));
        bytes.extend([mode, 4].iter().flat_map(|count| count.to_le_bytes()));
        for (x, y) in [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0_f32)] {
            bytes.extend([x, y, 0.0, x, 1.0 - y, 0.0].iter().flat_map(|value| value.to_le_bytes()));
        }
        bytes.extend((indices.len() as u32).to_le_bytes());
        bytes.extend(indices.iter().flat_map(|index| index.to_le_bytes()));
        bytes
    };
    for version in [2, b'2'] {
        assert_planar(&one(&[("mesh", &mesh(version, 4, &[0, 1, 2, 2, 1, 3]))]), 0.0, 0.0);
        assert_planar(&one(&[("mesh", &mesh(version, 5, &[0, 1, 2, 3]))]), 0.0, 0.0);
        let whole = mesh(version, 4, &[0, 1, 2, 2, 1, 3]);
        assert!(read_files(&[("mesh", &whole[..whole.len() - 4])], &sized()).is_err());
        let longer = read_files(&[("mesh", &[&whole[..], &[0; 4]].concat())], &sized()).unwrap_err().to_string();
        assert!(longer.contains("6 indices in 28 bytes"), "{longer}");
    }
    let third = read_files(&[("mesh", &mesh(b'3', 4, &[0, 1, 2]))], &sized()).unwrap_err().to_string();
    assert!(third.contains("version: 3; must be 1 or 2"), "{third}");
}

#[test]
fn meshes_without_light_say_so() {
    let mesh = |intensity: f64| {
        let nodes = (0..9).map(|i| {
            let (x, y) = (f64::from(i % 3), f64::from(i / 3));
            format!("{} {} {} {} {intensity}\n", (x - 1.0) * 16.0 / 9.0, y - 1.0, 0.25 + x / 4.0, 0.25 + y / 4.0)
        });
        format!("2\n3 3\n{}", nodes.collect::<String>())
    };
    let read = |text: &str| read_files(&[("mesh.data", text.as_bytes())], &sized());
    assert!(read(&mesh(1.0)).is_ok());
    let dark = read(&mesh(0.0)).unwrap_err().to_string();
    assert!(dark.contains("no node has an intensity above 0"), "{dark}");
}

#[test]
fn masks_of_sgct_multiply_the_codes() {
    let json = |masks: &str| sgct(SIZE, PLANAR, masks);
    let grey = |code: u8| png_grey([4, 4], move |_, _| code);
    let with = |masks: &str, code: u8| one(&[("set", json(masks).as_bytes()), ("m.png", &grey(code))]);
    let black = r#","blacklevelmask":"m.png""#;
    let white = with(black, 255);
    assert!(
        white.multiplies_codes && white.beta.is_none() && white.alpha.unwrap().values.iter().all(|value| *value == 1.0)
    );
    let half = with(black, 128);
    let expected = (128f32 / 255.0).powf(2.2);
    assert!(half.beta.is_none() && half.alpha.unwrap().values.iter().all(|value| (value - expected).abs() < 1e-6));
    // Use masks from a system whose file names ignore case.
    let files = |name: &'static str| {
        let set = json(r#","blendmask":"M.PNG","overlay":"o.png""#);
        read_files(&[("set", set.as_bytes()), (name, &grey(128))], &sized())
    };
    let set = files("m.png").unwrap();
    for part in ["m.png, whose name differs in upper and lower case", "overlay: its picture is not imported"] {
        assert!(set.notes.iter().any(|note| note.contains(part)), "{part}: {:?}", set.notes);
    }
    assert!(set.regions[0].alpha.as_ref().unwrap().values.iter().all(|value| (value - expected).abs() < 1e-6));
    assert!(files("n.png").is_err());
    let both = with(r#","blendmask":"m.png","blacklevelmask":"m.png""#, 128);
    assert!(both.alpha.unwrap().values.iter().all(|value| (value - expected * expected).abs() < 1e-6));
}

#[test]
fn viewports_of_sgct_for_one_eye_are_read_and_stereo_windows_say_why_not() {
    let user = |pos: &str, more: &str| format!(r#""users":[{{"eyeseparation":0.08,"pos":{pos}{more}}}]}}"#);
    let json = |eye: &str, user: &str| {
        let text = sgct(SIZE, PLANAR, &format!(r#","eye":"{eye}""#));
        format!("{}{user}", text.split_once(r#""users""#).unwrap().0)
    };
    let grid = |json: &str| one(&[("set", json.as_bytes())]).grid.samples;
    let origin = user(r#"{"x":0,"y":1,"z":0}"#, "");
    // The position of an eye is that of the user, moved sideways by half the separation of the eyes.
    for (eye, x) in [("left", "-0.04"), ("Right", "0.04"), ("center", "0")] {
        let beside = user(&format!(r#"{{"x":{x},"y":1,"z":0}}"#), "");
        assert_eq!(grid(&json(eye, &origin)), grid(&json("center", &beside)), "{eye}");
    }
    assert_ne!(grid(&json("left", &origin)), grid(&json("right", &origin)));
    let notes = read_files(&[("set", json("left", &origin).as_bytes())], &sized()).unwrap().notes;
    assert!(notes.iter().any(|note| note.contains("for one eye, at [-0.04, 1, 0] m")), "{notes:?}");

    let refused = |json: &str| read_files(&[("set", json.as_bytes())], &sized()).unwrap_err().to_string();
    assert!(refused(&json("both", &origin)).contains("must be one of center, left and right"));
    // SGCT rotates the position of the user, but not the line between the eyes.
    let turned = user(r#"{"x":0,"y":1,"z":0}"#, r#","orientation":{"yaw":10,"pitch":0,"roll":0}"#);
    assert_eq!(grid(&json("left", &turned)), grid(&json("left", &origin)));
    let window = |stereo: &str| {
        sgct(SIZE, PLANAR, "").replacen(r#""viewports""#, &format!(r#""stereo":"{stereo}","viewports""#), 1)
    };
    assert_eq!(grid(&window("none")), grid(&sgct(SIZE, PLANAR, "")));
    for mode in ["active", "side_by_side", "TOP_BOTTOM", "anaglyph_red_cyan"] {
        let problem = refused(&window(mode));
        assert!(problem.contains("two pictures, one for each eye") && problem.contains("eye `left`"), "{problem}");
    }
    let unknown = refused(&window("3d"));
    assert!(unknown.contains("`3d`") && unknown.contains("must be none; SGCT also knows active"), "{unknown}");
}

#[test]
fn the_raster_of_sgct_is_the_window_and_not_the_internal_picture() {
    let json =
        sgct(SIZE, PLANAR, "").replace(r#""viewports""#, r#""res":{"x":128,"y":128},"name":"Left one","viewports""#);
    let region = one(&[("set", json.as_bytes())]);
    assert_planar(&region, 0.0, 0.0);
    assert_eq!(region.title.as_deref(), Some("Left one"));
    // A window that draws no scene.
    let no_scene = |json: &str| json.replace(r#""viewports""#, r#""draw3D":false,"viewports""#);
    let refused = read_files(&[("set", no_scene(&json).as_bytes())], &sized()).unwrap_err().to_string();
    assert!(refused.contains("no window draws the 3D scene"), "{refused}");
    let window = r#"{"name":"Panel","draw3D":false,"viewports":[{}]},{"res""#;
    let two = json.replacen(r#"{"size""#, &format!("{}{}", window.replace(r#"{"res""#, ""), r#"{"size""#), 1);
    let both = read_files(&[("set", two.as_bytes())], &sized()).unwrap();
    assert_eq!((both.regions.len(), both.regions[0].name.as_str()), (1, "0/1/0"));
    assert!(both.notes.iter().any(|note| note.contains("`Panel`")), "{:?}", both.notes);
}

#[test]
fn the_orientation_of_the_scene_turns_the_directions_back() {
    let scene = |pitch: f64| {
        sgct(SIZE, PLANAR, "").replace(
            r#""users""#,
            &format!(r#""scene":{{"orientation":{{"yaw":0,"pitch":{pitch},"roll":0}}}},"users""#),
        )
    };
    // If the scene is rotated downwards, the picture shows the part of the sky above.
    assert_planar(&one(&[("set", scene(-27.0).as_bytes())]), 0.0, 27.0);
    assert_planar(&one(&[("set", scene(0.0).as_bytes())]), 0.0, 0.0);
    let yaw = scene(0.0).replace(r#""yaw":0,"pitch":0,"roll":0}},"users"#, r#""yaw":15,"pitch":0,"roll":0}},"users"#);
    assert_planar(&one(&[("set", yaw.as_bytes())]), -15.0, 0.0);
}

#[test]
fn a_cropped_fisheye_fills_the_raster_with_the_rest_of_its_square() {
    let fisheye =
        |more: &str| sgct([64, 64], &format!(r#"{{"type":"FisheyeProjection","fov":180,"tilt":0{more}}}"#), "");
    let options = ReadOptions::default();
    let read = |json: &str| read_files(&[("set", json.as_bytes())], &options).map(|mut found| found.regions.remove(0));
    let region = read(&fisheye(r#","crop":{"left":0,"right":0,"bottom":0.2,"top":0.1}"#)).unwrap();
    // SGCT computes the ratio of the sides as ((1 - 2 x 0.2) + (1 - 2 x 0.1)) / 2 = 0.7, so the height of the picture is 0.7 of that of the raster.
    let grid = &region.grid;
    let sample =
        |x: usize, y: usize| grid.samples[y * (grid.columns - 1) / 64 * grid.columns + x * (grid.columns - 1) / 64];
    let at = |v: f64| {
        let theta = v * std::f64::consts::FRAC_PI_2;
        DVec3::new(0.0, theta.cos(), theta.sin())
    };
    let ratio = 0.7;
    for y in [16, 32, 48] {
        let s = (1.0 - 2.0 * y as f64 / 64.0) / ratio;
        let expected = at(0.1 + 0.7 * s);
        assert!(sample(32, y).unwrap().abs_diff_eq(expected, 1e-6), "{y}: {:?}, not {expected}", sample(32, y));
    }
    let warp = region.warp().unwrap();
    let rows: Vec<bool> = (0..64).map(|row| warp.contains(32, row)).collect();
    assert_eq!((rows[9], rows[10], rows[53], rows[54]), (false, true, true, false));
    let offset = read(&fisheye(r#","offset":{"x":0.5,"y":0,"z":0}"#)).unwrap().grid;
    let centre = offset.samples[32 * offset.columns + 32].unwrap();
    assert!(centre.abs_diff_eq(DVec3::new(-0.5, 1.0, 0.0).normalize(), 1e-9), "{centre}");
    for wrong in [r#","crop":{"left":0.5,"right":0.5}"#, r#","crop":{"top":-0.1}"#, r#","offset":{"x":1.5}"#] {
        assert!(read(&fisheye(wrong)).is_err(), "{wrong}");
    }
}

#[test]
fn a_fisheye_that_no_file_asks_for_is_refused() {
    let json = sgct(SIZE, PLANAR, "");
    for options in [ReadOptions { tilt_deg: 20.0, ..sized() }, ReadOptions { fov_deg: 170.0, ..sized() }] {
        let error = read_files(&[("set", json.as_bytes())], &options).unwrap_err().to_string();
        assert!(error.contains("has no effect"), "{error}");
    }
    let bourke = "2\n2 2\n-1 -1 0.2 0.2 1\n1 -1 0.8 0.2 1\n-1 1 0.2 0.8 1\n1 1 0.8 0.8 1\n";
    let options = ReadOptions { tilt_deg: 20.0, size_px: Some([64, 64]), ..ReadOptions::default() };
    assert!(read_files(&[("mesh", bourke.as_bytes())], &options).unwrap().regions[0].uses.fisheye);
}

/// A picture of directions with 2 x 2 samples.
fn directions() -> Vec<u8> {
    let mut bytes = b"PF\n2 2\n-1.0\n".to_vec();
    for (x, y) in [(0.25, 0.75), (0.75, 0.75), (0.25, 0.25), (0.75, 0.25)] {
        bytes.extend(planar(x, y, 0.0, 0.0).as_vec3().to_array().iter().flat_map(|value| value.to_le_bytes()));
    }
    bytes
}

#[test]
fn options_are_refused_where_they_have_no_effect() {
    let without_user = |projection: &str| sgct(SIZE, projection, "").replace(r#","pos":{"x":0,"y":0,"z":0}}]"#, "}]");
    let (sgct_planar, pfm) = (without_user(PLANAR), directions());
    let sgct_fisheye = without_user(r#"{"type":"FisheyeProjection","fov":180,"tilt":0}"#);
    let bourke = "2\n2 2\n-1 -1 0.2 0.2 1\n1 -1 0.8 0.2 1\n-1 1 0.2 0.8 1\n1 1 0.8 0.8 1\n".to_owned();
    let open = open_mesh();
    let rows = ReadOptions { rows: RowOrder::TopFirst, ..sized() };
    let axes = ReadOptions { axes: Axes::parse("x=x,y=z,z=-y").unwrap(), ..sized() };
    let eye = ReadOptions { eye_m: DVec3::new(0.0, 0.5, 0.0), ..sized() };
    let fisheye = ReadOptions { tilt_deg: 20.0, ..sized() };
    // Test for each option whether it has an effect.
    for (name, bytes, effects) in [
        ("planar", sgct_planar.as_bytes(), [false, false, true, false]),
        ("fisheye of SGCT", sgct_fisheye.as_bytes(), [false; 4]),
        ("Paul Bourke's mesh", bourke.as_bytes(), [false, false, false, true]),
        ("OPENMESH", open.as_bytes(), [false; 4]),
        ("directions", &pfm[..], [true, true, false, false]),
    ] {
        let given = [
            (&rows, "rows = top_first"),
            (&axes, "axes = x=x,y=z,z=-y"),
            (&eye, "eye_m = [0, 0.5, 0]"),
            (&fisheye, "tilt_deg = 20"),
        ];
        for ((options, key), effect) in given.into_iter().zip(effects) {
            match read_files(&[("set", bytes)], options) {
                Ok(_) => assert!(effect, "{name}: {key} has no effect"),
                Err(error) => {
                    let text = error.to_string();
                    assert!(!effect && text.contains(&format!("{key} has no effect")), "{name}: {text}");
                }
            }
        }
    }
}

#[test]
fn rasters_of_one_pixel_or_one_line_are_refused() {
    let small = sgct(SIZE, PLANAR, "").replace(r#""size":{"x":1,"y":1}"#, r#""size":{"x":0.001,"y":0.001}"#);
    let error = read_files(&[("set", small.as_bytes())], &ReadOptions::default()).unwrap_err().to_string();
    assert!(error.contains("a raster of 1 x 1 pixels; must be 2 to 16384 pixels per side"), "{error}");
    for size in [[1, 48], [48, 1], [1, 1]] {
        let options = ReadOptions { size_px: Some(size), ..ReadOptions::default() };
        assert!(read_files(&[("set", &directions())], &options).is_err(), "{size:?}");
    }
}

#[test]
fn the_matrix_or_orientation_of_a_user_moves_the_eye() {
    let json = |user: &str| {
        let text = sgct(SIZE, PLANAR, "");
        format!(r#"{}"users":[{{"eyeseparation":0.06{user}}}]}}"#, text.split_once(r#""users""#).unwrap().0)
    };
    let read = |user: &str| read_files(&[("set", json(user).as_bytes())], &sized()).unwrap();
    let grid = |user: &str| read(user).regions.remove(0).grid;
    // The matrix is stored column by column; the last column is the shift.
    let matrix = r#","matrix":[1,0,0,0,0,1,0,0,0,0,1,0,0,0,5,1]"#;
    assert_eq!(grid(matrix), grid(r#","pos":{"x":0,"y":0,"z":5}"#));
    assert_ne!(grid(matrix), grid(""));
    let notes = read(matrix).notes;
    assert!(
        notes.iter().any(|note| note.contains("eye: from users[0].matrix in the file, at [0, 0, 5] m")),
        "{notes:?}"
    );
    assert!(!notes.iter().any(|note| note.contains("does not specify it")), "{notes:?}");
    let both = format!(r#","pos":{{"x":1,"y":0,"z":0}}{matrix}"#);
    assert_eq!(grid(&both), grid(r#","pos":{"x":1,"y":0,"z":5}"#));
    // A quarter turn to the right moves the front to the right.
    let turned = r#","pos":{"x":0,"y":0,"z":-1},"orientation":{"yaw":90,"pitch":0,"roll":0}"#;
    for (found, expected) in grid(turned).samples.iter().zip(&grid(r#","pos":{"x":1,"y":0,"z":0}"#).samples) {
        assert!(found.unwrap().abs_diff_eq(expected.unwrap(), 1e-12));
    }
    let error = read_files(&[("set", json(r#","matrix":[1,0,0]"#).as_bytes())], &sized()).unwrap_err().to_string();
    assert!(error.contains("3 numbers; must be a matrix of 16 numbers"), "{error}");
    let tracked = read(r#","pos":{"x":0,"y":0,"z":0},"tracking":{"tracker":"a","device":"b"}"#).notes;
    assert!(tracked.iter().any(|note| note.contains("users[0].tracking: it has no effect")), "{tracked:?}");
}

#[test]
fn old_names_of_sgct_are_read() {
    let turned = |orientation: &str| sgct(SIZE, &PLANAR.replace(r#""yaw":0,"pitch":0,"roll":0"#, orientation), "");
    for orientation in [r#""heading":30,"pitch":20,"roll":0"#, r#""azimuth":30,"elevation":20,"bank":0"#] {
        assert_planar(&one(&[("set", turned(orientation).as_bytes())]), 30.0, 20.0);
    }
    let flat =
        format!(r#"{{"type":"SpoutFlatProjection","PlanarProjection":{PLANAR},"width":"1920","height":"1080"}}"#);
    assert_planar(&one(&[("set", sgct(SIZE, &flat, "").as_bytes())]), 0.0, 0.0);
    let error = |json: String| read_files(&[("set", json.as_bytes())], &sized()).unwrap_err().to_string();
    let missing = error(turned(r#""pitch":20,"roll":0"#));
    assert!(missing.contains("yaw is missing; must have all of yaw, pitch, roll"), "{missing}");
    assert!(error(turned(r#""yaw":1,"heading":1,"pitch":0,"roll":0"#)).contains("it occurs twice"));
    let both = error(turned(r#""yaw":1,"pitch":0,"roll":0,"x":0,"y":0,"z":0,"w":1"#));
    assert!(both.contains("yaw, pitch and roll and also a quaternion; must have either"), "{both}");
}

#[test]
fn contradictory_fields_of_view_are_refused() {
    let fov = |more: &str| sgct(SIZE, &PLANAR.replace(r#""up":20"#, &format!(r#"{more},"up":20"#)), "");
    assert_planar(&one(&[("set", fov(r#""hfov":60"#).as_bytes())]), 0.0, 0.0);
    let error = read_files(&[("set", fov(r#""hfov":10"#).as_bytes())], &sized()).unwrap_err().to_string();
    assert!(error.contains("left 30 and right 30 in addition to hfov 10"), "{error}");
}

#[test]
fn unknown_keys_and_unusual_masks_are_noted() {
    let notes = |json: &str, mask: &[u8]| {
        read_files(&[("set", json.as_bytes()), ("m.png", mask)], &ReadOptions::default()).unwrap().notes
    };
    let json = sgct([64, 48], PLANAR, r#","blend_mask":"m.png""#).replace(r#""version":1"#, r#""version":9"#);
    let found = notes(&json, b"");
    for part in ["viewports[0].blend_mask: the key is not known", "version 9: only version 1 is known"] {
        assert!(found.iter().any(|note| note.contains(part)), "{part}: {found:?}");
    }
    let json = sgct([64, 48], PLANAR, r#","blendmask":"m.png""#);
    let portrait = notes(&json, &png_grey([48, 64], |_, _| 200));
    let stretched = "the mask has 48 x 64 pixels, which are stretched over a raster of 64 x 48";
    assert!(portrait.iter().any(|note| note.contains(stretched)), "{portrait:?}");
    let black = notes(&json, &png_grey([64, 48], |_, _| 0));
    assert!(black.iter().any(|note| note.contains("black everywhere")), "{black:?}");
    let usual = notes(&json, &png_grey([32, 24], |x, _| 8 * x as u8));
    assert!(!usual.iter().any(|note| note.contains("stretched") || note.contains("black everywhere")), "{usual:?}");
}

#[test]
fn messages_say_what_is_wrong_with_other_content() {
    let refused = |bytes: &[u8]| read_files(&[("set", bytes)], &sized()).unwrap_err().to_string();
    let in_pixels = "2\n2 2\n-1 -1 20 20 1\n1 -1 800 20 1\n-1 1 20 600 1\n1 1 800 600 1\n";
    let text = refused(in_pixels.as_bytes());
    assert!(text.contains("[20, 20] to [800, 600]") && text.contains("u and v must be between 0 and 1"), "{text}");
    let json = sgct(SIZE, PLANAR, "");
    let utf16: Vec<u8> = "\u{feff}".chars().chain(json.chars()).flat_map(|c| (c as u16).to_le_bytes()).collect();
    assert!(refused(&utf16).contains("text in UTF-16; must be text in UTF-8"));
    assert!(refused(format!("// my dome\n{json}").as_bytes()).contains("JSON has no comments"));
    assert!(refused(json.replacen('{', "{ // my dome\n", 1).as_bytes()).contains("which has no comments"));
    assert!(refused(br#"{"nodes":[{"address":"a"}]}"#).contains("no node has a window"));
    let inverted = PLANAR.replace(r#""right":30"#, r#""right":-40"#);
    let text = refused(sgct(SIZE, &inverted, "").as_bytes());
    assert!(text.contains("left, right, down and up are [30, -40, 20, 20] degrees"), "{text}");
    let negative = PLANAR.replace(r#""left":30"#, r#""left":-30"#);
    let text = refused(sgct(SIZE, &negative, "").as_bytes());
    assert!(text.contains("[-30, 30, 20, 20]") && text.contains("all four are positive"), "{text}");
    assert!(!text.contains("are negative"), "{text}");
    assert!(refused(b"").contains("the file is empty") && refused(b" \n").contains("only white space"));
}

#[test]
fn names_in_archives_may_differ_in_separators_capitals_and_folders() {
    let frustum = "<frustum><yaw>30</yaw><pitch>20</pitch><roll>0</roll><leftAngle>-30</leftAngle><rightAngle>30</rightAngle>\
                   <upAngle>20</upAngle><downAngle>-20</downAngle></frustum>";
    let head = format!(
        r#"<MPCDI profile="2d" geometry="1" color="1" version="2.0"><display><buffer id="b" xResolution="96" yResolution="54"><region id="r" xResolution="96" yResolution="54" x="0" y="0" xsize="1" ysize="1">{frustum}</region></buffer></display>"#
    );
    let set = |description: &str, path: &str, entry: &str, zeros: bool| {
        let files = format!(
            r#"<files><fileset region="r"><geometryWarpFile><path>{path}</path></geometryWarpFile></fileset></files></MPCDI>"#
        );
        let mut map = b"PF\n4 4\n-1.0\n".to_vec();
        for i in 0..16 {
            let coordinate = |at: i32| (at as f32 + 0.5) / 4.0;
            let sample = if zeros && i < 4 { [0.0; 3] } else { [coordinate(i % 4), coordinate(i / 4), 0.0] };
            map.extend(sample.iter().flat_map(|value| value.to_le_bytes()));
        }
        let mut zip = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
        let options = zip::write::SimpleFileOptions::default();
        for (name, bytes) in [(description, format!("{head}{files}").into_bytes()), (entry, map)] {
            zip.start_file(name, options).unwrap();
            zip.write_all(&bytes).unwrap();
        }
        zip.finish().unwrap().into_inner()
    };
    for (description, path, entry) in [
        ("mpcdi.xml", "dome/p1.pfm", "dome/p1.pfm"),
        ("mpcdi.xml", "dome\\p1.pfm", "dome/p1.pfm"),
        ("mpcdi.xml", "Dome/P1.PFM", "dome/p1.pfm"),
        ("mpcdi.xml", "./p1.pfm", "p1.pfm"),
        ("show/MPCDI.xml", "dome/p1.pfm", "show/dome/p1.pfm"),
    ] {
        let bytes = set(description, path, entry, false);
        let found = read_files(&[("set", &bytes)], &ReadOptions::default()).unwrap();
        let expected = planar(0.125, 0.125, 30.0, 20.0);
        assert!(found.regions[0].grid.samples[0].unwrap().abs_diff_eq(expected, 1e-6), "{path}");
    }
    assert!(read_files(&[("set", &set("mpcdi.xml", "p2.pfm", "p1.pfm", false))], &ReadOptions::default()).is_err());
    // Zeros in several samples mean that these samples have no position.
    let found = read_files(&[("set", &set("mpcdi.xml", "p1.pfm", "p1.pfm", true))], &ReadOptions::default()).unwrap();
    assert_eq!(found.regions[0].grid.samples.iter().filter(|sample| sample.is_none()).count(), 4);
    // A frustum alone.
    let described = |rest: &str| {
        let mut zip = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
        zip.start_file("mpcdi.xml", zip::write::SimpleFileOptions::default()).unwrap();
        zip.write_all(format!("{head}{rest}</MPCDI>").as_bytes()).unwrap();
        zip.finish().unwrap().into_inner()
    };
    assert_planar(&one(&[("set", &described(""))]), 30.0, 20.0);
    // The set has a frustum, and a <fileset> next to <files>; the elements of <files> have empty paths.
    let empty = r#"<files></files><fileset region="r"><geometryWarpFile><path></path></geometryWarpFile><alphaMap>
        <gammaEmbedded>1.0</gammaEmbedded><path></path></alphaMap><distortionMap><path></path></distortionMap></fileset>"#;
    assert_planar(&one(&[("set", &described(empty))]), 30.0, 20.0);
    // The lens is not planar, so no frustum describes it.
    let lens = |region: &str| {
        described(&format!(
            r#"<extensionSet><extension Name="BufferExtension"><buffer id="b"><region id="{region}"><fisheye>
            <f1>75</f1></fisheye></region></buffer></extension></extensionSet>"#
        ))
    };
    let error = read_files(&[("set", &lens("r"))], &sized()).unwrap_err().to_string();
    assert!(error.contains("<fisheye>") && error.contains("a3 or sl"), "{error}");
    assert_planar(&one(&[("set", &lens("other"))]), 30.0, 20.0);
}
