//! Sets of projectors in each format, compared with directions in closed form, and the errors of invalid sets.
//!
//! Grids are evaluated by cubics through four samples in each direction, so the errors come from the sampling and from the rounding of the numbers in
//! the files.

use std::path::{Path, PathBuf};

use steradian::{
    glam::{DVec2, DVec3},
    theatre::{
        Axes, Calibration, Grid, Interpolation, Placement, ReadOptions, Region, RowOrder, TheatreError, read,
        upright_and_mirrored_cells,
    },
    view::projection::PlaneMapping as _,
};

use crate::common::theatre::{
    Mpcdi, Pfm, Projector, bourke, centre, csv, exr, obj, png_grey, projectors, projectors_of, sgc, sgct, sgct_frustum,
    towards, zipped,
};

/// Files in a temporary folder, removed when the value is dropped.
struct Files(tempfile::TempDir);

impl Files {
    fn new(files: &[(&str, &[u8])]) -> Self {
        let folder = tempfile::tempdir().unwrap();
        for (name, bytes) in files {
            std::fs::write(folder.path().join(name), bytes).unwrap();
        }
        Self(folder)
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }
}

fn read_bytes(bytes: &[u8], options: &ReadOptions) -> Result<Calibration, TheatreError> {
    // The file has no extension, because formats are recognised by their content.
    let files = Files::new(&[("set", bytes)]);
    read(&files.path("set"), options)
}

/// Reads files that must be refused; returns the text of the error.
fn refusal(bytes: &[u8], options: &ReadOptions) -> String {
    read_bytes(bytes, options).expect_err("the set must be refused").to_string()
}

fn sized(projector: &Projector) -> ReadOptions {
    ReadOptions { size_px: Some(projector.size_px), ..ReadOptions::default() }
}

/// Returns the weights of the cubic through four samples at -1, 0, 1 and 2.
fn cubic(t: f64) -> [f64; 4] {
    [
        -t * (t - 1.0) * (t - 2.0) / 6.0,
        (t + 1.0) * (t - 1.0) * (t - 2.0) / 2.0,
        -(t + 1.0) * t * (t - 2.0) / 2.0,
        (t + 1.0) * t * (t - 1.0) / 6.0,
    ]
}

/// Returns the direction at a position of the raster, or `None` if a neighbouring sample is `None`.
fn evaluate(grid: &Grid, x: f64, y: f64) -> Option<DVec3> {
    let along = |share: f64, count: usize| {
        let position = match grid.placement {
            Placement::Corners => share * (count - 1) as f64,
            Placement::Centres => share * count as f64 - 0.5,
        };
        if grid.interpolation == Interpolation::Linear {
            let first = position.floor().clamp(0.0, (count - 2) as f64);
            return (first as usize, vec![1.0 - (position - first), position - first]);
        }
        let first = (position.floor() - 1.0).clamp(0.0, (count - 4) as f64);
        (first as usize, cubic(position - first - 1.0).to_vec())
    };
    let ((column, across), (row, down)) = (along(x, grid.columns), along(y, grid.rows));
    let mut sum = DVec3::ZERO;
    for (j, wy) in down.iter().enumerate() {
        for (i, wx) in across.iter().enumerate() {
            sum += grid.samples[(row + j) * grid.columns + column + i]? * (wx * wy);
        }
    }
    Some(sum.normalize())
}

/// Returns the centres of 1,000 pixels, which are the same in every run.
fn pixels(size: [u32; 2]) -> Vec<DVec2> {
    let mut state = 0x1234_5678_9abc_def1_u64;
    let mut random = |count: u32| {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state % u64::from(count)) as usize
    };
    (0..1000)
        .map(|_| DVec2::new(centre(random(size[0]), size[0] as usize), centre(random(size[1]), size[1] as usize)))
        .collect()
}

/// Returns the largest angle between a region's directions and the analytic ones, in units of a pixel at the centre.
fn error_px(region: &Region, projector: &Projector) -> f64 {
    let mut worst = 0.0_f64;
    for place in pixels(projector.size_px) {
        let found = evaluate(&region.grid, place.x, place.y).expect("every pixel has a direction");
        worst = worst.max(found.angle_between(projector.direction(place.x, place.y)));
    }
    worst / projector.pixel_rad()
}

/// Asserts that the error is within the bound, and not far below it: a bound that is too wide would prove little.
#[track_caller]
fn assert_error(what: &str, found: f64, most: f64) {
    println!("{what}: {found:.6} px, at most {most}");
    assert!(found <= most, "{what}: {found} px off, must be at most {most}");
    assert!(found >= most / 50.0, "{what}: {found} px off, the bound of {most} is too wide");
}

#[test]
fn the_theatre_covers_most_of_the_dome_and_its_rasters_overlap() {
    let all = projectors();
    let (mut covered, mut overlapped, mut count) = (0, 0, 0);
    for i in 0..200 {
        for j in 0..50 {
            let direction = towards(std::f64::consts::TAU * centre(i, 200), centre(j, 50).asin());
            let seen = all.iter().filter(|projector| projector.place(direction).is_some()).count();
            count += 1;
            covered += usize::from(seen > 0);
            overlapped += usize::from(seen > 1);
        }
    }
    let share = |n: usize| n as f64 / f64::from(count);
    println!("covered {}, more than once {}", share(covered), share(overlapped));
    assert!(share(covered) > 0.8 && share(overlapped) > 0.4);
    // Check that the writers of the test kit agree with the closed form.
    let projector = &all[2];
    for place in pixels(projector.size_px) {
        let back = projector.place(projector.direction(place.x, place.y)).unwrap();
        assert!(back.abs_diff_eq(place, 1e-9));
    }
}

#[test]
fn mpcdi_a3_in_a_tilted_room_has_the_analytic_directions() {
    let all = projectors();
    let set = Mpcdi::a3(65, 65).bytes(&all);
    let calibration = read_bytes(&set, &ReadOptions::default()).unwrap();
    assert_eq!((calibration.format, calibration.regions.len()), ("MPCDI", 6));
    let mut worst = 0.0_f64;
    for (region, projector) in calibration.regions.iter().zip(&all) {
        assert_eq!(region.name, format!("b{0}/{0}", projector.name));
        assert_eq!((region.size_px, region.grid.placement), (projector.size_px, Placement::Centres));
        worst = worst.max(error_px(region, projector));
        assert_eq!(upright_and_mirrored_cells(&region.grid), [64 * 64, 0]);
    }
    assert_error("MPCDI a3, 65 x 65", worst, A3_PX);
    assert!(calibration.notes.iter().any(|note| note.contains("bottom row comes first, as the format specifies")));

    // If the rows are upside down, the error is large, and this is reported.
    let wrong = ReadOptions { rows: RowOrder::TopFirst, ..ReadOptions::default() };
    let flipped = read_bytes(&set, &wrong).unwrap();
    assert!(error_px(&flipped.regions[0], &all[0]) > 100.0);
    assert!(flipped.notes.iter().any(|note| note.contains("mirrored in 4096 of 4096")), "{:?}", flipped.notes);
    // With another eye point, the error is large too.
    let elsewhere = ReadOptions { eye_m: DVec3::new(0.0, 0.0, 0.1), ..ReadOptions::default() };
    assert!(error_px(&read_bytes(&set, &elsewhere).unwrap().regions[0], &all[0]) > 5.0);
    // A map of offsets from a plane instead of points is read without an error, so the directions are wrong.
    let mut offsets = Mpcdi::a3(65, 65);
    offsets.shift = DVec3::new(0.0, 0.0, -8.0);
    let offsets = read_bytes(&offsets.bytes(&all[..1]), &ReadOptions::default()).unwrap();
    assert!(error_px(&offsets.regions[0], &all[0]) > 100.0);
    // If the options replace the frame of the file by the axes of the room, the dome is tilted, and the error is large.
    let axes = ReadOptions { axes: Axes::parse("x=x,y=y,z=z").unwrap(), ..ReadOptions::default() };
    assert!(error_px(&read_bytes(&set, &axes).unwrap().regions[0], &all[0]) > 100.0);
}

/// The bounds, in pixels, are about four times the measured errors.
const A3_PX: f64 = 3.3e-3;
const SL_PX: f64 = 3e-3;
const FRUSTUM_PX: f64 = 8.5e-4;
const PFM_PX: f64 = 3.2e-5;
const LATTICE_PX: f64 = 7e-4;
/// This error comes from numbers of seven decimals for a frustum of 2 x 78 degrees.
const DECIMALS_PX: f64 = 2e-3;
const DRAWN_PX: f64 = 0.4;
const PLAIN_PX: f64 = 7e-5;

#[test]
fn mpcdi_sl_has_its_own_units_eye_and_axes() {
    let all = projectors();
    let eye_m = DVec3::new(0.25, 1.5, -2.0);
    let mut set = Mpcdi::new("sl", 65, 65);
    set.version = "1.0";
    set.per_metre = 1000.0;
    set.shift = eye_m;
    set.warp = "<interpolation>linear</interpolation><geometricUnit>mm</geometricUnit><originOf3DData>floorCenter</originOf3DData>".into();
    set.pfm.little_endian = false;
    let options = ReadOptions { eye_m, region: Some("p3".into()), ..ReadOptions::default() };
    let mut calibration = read_bytes(&set.bytes(&all), &options).unwrap();
    assert_eq!((calibration.regions.len(), calibration.regions[0].name.as_str()), (1, "bp3/p3"));
    let region = &mut calibration.regions[0];
    assert_eq!(region.grid.interpolation, Interpolation::Linear);
    region.grid.interpolation = Interpolation::Smooth;
    assert_error("MPCDI sl, 65 x 65", error_px(region, &all[3]), SL_PX);
    assert!(calibration.notes.iter().any(|note| note.contains("floorCenter")), "{:?}", calibration.notes);
    // If they were read as metres, the points would be 8 km from the eye.
    set.warp = String::new();
    let metres = read_bytes(&set.bytes(&all), &options).unwrap();
    assert!(error_px(&metres.regions[0], &all[3]) > 100.0);
    set.warp = "<geometricUnit>unknown</geometricUnit>".into();
    assert!(refusal(&set.bytes(&all), &options).contains("unit of the points is unknown"));

    // The file has z up; the option for axes converts it back.
    let projector = &all[1];
    let mut z_up = Mpcdi::new("a3", 65, 65);
    z_up.pfm.size = [65, 65];
    let map = z_up.pfm.bytes(|i, j| {
        let p = projector.point_m(centre(i, 65), centre(j, 65));
        [p.x, -p.z, p.y]
    });
    let xml = z_up.xml(std::slice::from_ref(projector));
    let bytes = zipped(&[("MPCDI.XML", xml.into_bytes()), ("p1.pfm", map)], false);
    let options = ReadOptions { axes: Axes::parse("x=x,y=z,z=-y").unwrap(), ..ReadOptions::default() };
    assert_error("MPCDI a3, z up", error_px(&read_bytes(&bytes, &options).unwrap().regions[0], projector), A3_PX);
    assert!(error_px(&read_bytes(&bytes, &ReadOptions::default()).unwrap().regions[0], projector) > 100.0);
}

#[test]
fn mpcdi_2d_and_3d_use_the_frustum() {
    let all = projectors();
    for profile in ["2d", "3d"] {
        let calibration = read_bytes(&Mpcdi::new(profile, 129, 129).bytes(&all), &ReadOptions::default()).unwrap();
        let worst = calibration.regions.iter().zip(&all).map(|(region, projector)| error_px(region, projector));
        assert_error(profile, worst.fold(0.0, f64::max), FRUSTUM_PX);
    }
    // A map of offsets instead of absolute coordinates is refused.
    let set = Mpcdi::new("2d", 33, 33);
    let projector = &all[0];
    let offsets = set.pfm.bytes(|i, j| {
        let place = projector.in_frustum(centre(i, 33), centre(j, 33));
        [place.x - centre(i, 33), place.y - (1.0 - centre(j, 33)), 0.0]
    });
    let xml = set.xml(&all[..1]).into_bytes();
    let bytes = zipped(&[("mpcdi.xml", xml.clone()), ("p0.pfm", offsets)], true);
    let text = refusal(&bytes, &ReadOptions::default());
    assert!(
        text.contains("lie outside of 0 to 1") && text.contains("not offsets") && text.contains("p0.pfm"),
        "{text}"
    );
    // Pixels whose points are unknown or invalid are dark.
    let holes = set.pfm.bytes(|i, j| match (i, j) {
        (0, 0) => [f64::NAN; 3],
        (1, 0) => [0.5, 0.5, 1.0],
        (2, 0) => [0.5, 0.5, f64::NAN],
        _ => [0.5, 0.5, 0.2],
    });
    let bytes = zipped(&[("mpcdi.xml", xml.clone()), ("p0.pfm", holes)], true);
    let samples = read_bytes(&bytes, &ReadOptions::default()).unwrap().regions.remove(0).grid.samples;
    assert_eq!(samples.iter().map(Option::is_some).take(4).collect::<Vec<_>>(), [false, false, true, true]);
    let [yaw, pitch] = projector.yaw_pitch_rad;
    assert!(samples[3].unwrap().abs_diff_eq(towards(yaw, pitch), 1e-6));
    assert!(samples[1].is_none());
    let infinite = zipped(&[("mpcdi.xml", xml), ("p0.pfm", set.pfm.bytes(|_, _| [f64::INFINITY, 0.0, 0.0]))], true);
    assert!(refusal(&infinite, &ReadOptions::default()).contains("column 0 of row 0"));
}

#[test]
fn masks_and_tables_of_mpcdi_are_decoded() {
    let all = projectors();
    let mut set = Mpcdi::a3(9, 9);
    set.masks = true;
    let region = read_bytes(&set.bytes(&all[..1]), &ReadOptions::default()).unwrap().regions.remove(0);
    let (alpha, beta, lut) = (region.alpha.unwrap(), region.beta.unwrap(), region.lut.unwrap());
    assert_eq!((alpha.width, alpha.height, alpha.levels), (64, 40, 255));
    let light = |code: f32| (code / 255.0).powf(2.2);
    assert!((alpha.values[32] - light(128.0)).abs() < 1e-6 && (alpha.values[32] - 128.0 / 255.0).abs() > 0.2);
    assert!(beta.values[0] == 0.0 && (beta.values[2] - light(10.0)).abs() < 1e-7);
    assert_eq!((lut.size, lut.values[1]), (2, [1.0, 1.0, 0.5]));
    // The picture must match the options that describe it.
    let files = set.files(&all[..1]);
    let xml = String::from_utf8(files[0].1.clone()).unwrap().replace("<bitDepth>8", "<bitDepth>16");
    let mut wrong: Vec<(&str, Vec<u8>)> = files.iter().map(|(name, bytes)| (name.as_str(), bytes.clone())).collect();
    wrong[0].1 = xml.into_bytes();
    let text = refusal(&zipped(&wrong, true), &ReadOptions::default());
    assert!(text.contains("bitDepth = 16") && text.contains("the picture has 8"), "{text}");
}

#[test]
fn directions_per_pixel_come_as_pfm_of_both_byte_orders_and_as_openexr() {
    let mut projector = projectors().remove(4);
    projector.size_px = [480, 300];
    let [columns, rows] = [480, 300];
    let value = |i: usize, j: usize| projector.direction(centre(i, columns), centre(j, rows)).to_array();
    let as_format = ReadOptions::default();
    let order = |rows: RowOrder| ReadOptions { rows, ..ReadOptions::default() };
    for little_endian in [true, false] {
        for bottom_first in [true, false] {
            let pfm = Pfm { size: [columns, rows], little_endian, bottom_first };
            let bytes = pfm.bytes(value);
            let (right, wrong) = if bottom_first {
                (as_format.clone(), order(RowOrder::TopFirst))
            } else {
                (order(RowOrder::TopFirst), as_format.clone())
            };
            let calibration = read_bytes(&bytes, &right).unwrap();
            assert_eq!(calibration.regions[0].size_px, [480, 300]);
            assert_error("PFM per pixel", error_px(&calibration.regions[0], &projector), PFM_PX);
            assert!(error_px(&read_bytes(&bytes, &wrong).unwrap().regions[0], &projector) > 50.0);
        }
    }
    for names in [["R", "G", "B"], ["x", "y", "z"]] {
        let bytes = exr(names, [columns, rows], value);
        let calibration = read_bytes(&bytes, &as_format).unwrap();
        assert_error("OpenEXR per pixel", error_px(&calibration.regions[0], &projector), PFM_PX);
        let wrong = read_bytes(&bytes, &order(RowOrder::BottomFirst)).unwrap();
        assert!(error_px(&wrong.regions[0], &projector) > 50.0);
    }
    assert!(refusal(&exr(["R", "G", "A"], [4, 4], |_, _| [1.0, 0.0, 0.0]), &as_format).contains("channels"));
    // Pixels with NaN are dark. Points and offsets are refused, because they are not directions.
    let pfm = Pfm::of(columns, rows);
    let holed = pfm.bytes(|i, j| if i == 7 { [f64::NAN; 3] } else { value(i, j) });
    let samples = read_bytes(&holed, &as_format).unwrap().regions.remove(0).grid.samples;
    assert!(samples.iter().enumerate().all(|(index, sample)| sample.is_some() == (index % columns != 7)));
    let points = pfm.bytes(|i, j| projector.point_m(centre(i, columns), centre(j, rows)).to_array());
    assert!(refusal(&points, &as_format).contains("has the length"));
    let text = refusal(&pfm.bytes(|i, j| [centre(i, columns) / 50.0, centre(j, rows) / 50.0, 0.0]), &as_format);
    assert!(text.contains("column 0 of row 0 (from the top, from 0)"), "{text}");
}

#[test]
fn a_paul_bourke_mesh_of_a_fisheye_has_the_analytic_directions() {
    let projector = &projectors()[5];
    let text = bourke(projector, 129, 97, |_, _| 1.0);
    let options = sized(projector);
    let calibration = read_bytes(text.as_bytes(), &options).unwrap();
    let region = &calibration.regions[0];
    assert_eq!((region.grid.columns, region.grid.rows, region.grid.placement), (129, 97, Placement::Corners));
    assert!(region.alpha.is_none());
    assert_error("Paul Bourke, 129 x 97", error_px(region, projector), LATTICE_PX);
    // Read the mesh with a wrong field of view, tilt or aspect.
    let wrong = ReadOptions { fov_deg: 170.0, ..options.clone() };
    assert!(error_px(&read_bytes(text.as_bytes(), &wrong).unwrap().regions[0], projector) > 50.0);
    let wrong = ReadOptions { tilt_deg: 20.0, ..options.clone() };
    assert!(error_px(&read_bytes(text.as_bytes(), &wrong).unwrap().regions[0], projector) > 100.0);
    let wrong = ReadOptions { size_px: Some([1920, 1080]), ..options.clone() };
    let notes = read_bytes(text.as_bytes(), &wrong).unwrap().notes;
    assert!(notes.iter().any(|note| note.contains("of the raster's width")), "{notes:?}");
    assert!(refusal(text.as_bytes(), &ReadOptions::default()).contains("--size 1920x1080"));

    // Intensities form a mask. Cells with negative intensities are not drawn.
    let shaded = bourke(projector, 33, 33, |column, _| if column == 0 { -1.0 } else { 0.5 });
    let region = read_bytes(shaded.as_bytes(), &options).unwrap().regions.remove(0);
    assert_eq!(region.grid.samples.iter().filter(|sample| sample.is_none()).count(), 33);
    let mask = region.alpha.unwrap();
    assert_eq!((mask.width, mask.height), (1920, 1200));
    assert_eq!(mask.values[10], 0.0);
    assert!((mask.values[1000] - 0.5f32.powf(2.2)).abs() < 1e-5, "{}", mask.values[1000]);

    for mapping in ["1", "3", "5"] {
        let text = text.replacen('2', mapping, 1);
        assert!(refusal(text.as_bytes(), &options).contains("is refused"), "{mapping}");
    }
}

#[test]
fn sgct_with_each_mesh_has_the_analytic_directions() {
    let projector = &projectors()[1];
    let frustum = |x: f64, y: f64| projector.in_frustum(x, y);
    let fisheye = r#"{"type":"FisheyeProjection","fov":180,"tilt":0}"#;
    let planar = sgct_frustum("PlanarProjection", projector);
    let textured = sgct_frustum("TextureMappedProjection", projector);
    let mut pfm = Pfm::of(129, 129);
    pfm.bottom_first = false;
    let pfm = pfm.bytes(|i, j| {
        let place = frustum(i as f64 / 128.0, j as f64 / 128.0);
        [place.x, place.y, 0.0]
    });
    let cases: [(&str, &str, Vec<u8>, f64); 6] = [
        ("Bourke", fisheye, bourke(projector, 129, 129, |_, _| 1.0).into_bytes(), LATTICE_PX),
        ("OBJ", &planar, obj(129, 129, 0.0, frustum).into_bytes(), DECIMALS_PX),
        ("CSV", &planar, csv(129, 129, frustum).into_bytes(), DECIMALS_PX),
        ("SGC", &planar, sgc(projector, 129, 129), LATTICE_PX),
        ("PFM", &textured, pfm, LATTICE_PX),
        // If nodes are not on a lattice, the mesh is interpolated linearly in triangles, as programs draw such meshes.
        ("drawn OBJ", &textured, obj(129, 129, 0.4, frustum).into_bytes(), DRAWN_PX),
    ];
    for (name, projection, mesh, most) in cases {
        let json = sgct(projector.size_px, projection, r#","mesh":"warp""#);
        let files = Files::new(&[("set.json", json.as_bytes()), ("warp", &mesh)]);
        let calibration = read(&files.path("set.json"), &ReadOptions::default()).unwrap();
        let region = &calibration.regions[0];
        assert_eq!((region.name.as_str(), region.size_px), ("0/0/0", projector.size_px));
        assert_error(&format!("SGCT, {name}"), error_px(region, projector), most);
        let drawn = name.starts_with("drawn");
        assert_eq!(region.grid.interpolation == Interpolation::Linear, drawn, "{name}");
        // With another projection, the error is large.
        let turned = projection.replace(r#""tilt":0"#, r#""tilt":9"#).replace(r#""roll":0"#, r#""roll":9"#);
        std::fs::write(files.path("set.json"), sgct(projector.size_px, &turned, r#","mesh":"warp""#)).unwrap();
        let wrong = read(&files.path("set.json"), &ReadOptions::default()).unwrap();
        assert!(name == "SGC" || error_px(&wrong.regions[0], projector) > 50.0, "{name}");
    }
    // A PFM that is read from the bottom gives an upside-down picture.
    let mut pfm = Pfm::of(129, 129);
    pfm.bottom_first = true;
    let pfm = pfm.bytes(|i, j| frustum(i as f64 / 128.0, j as f64 / 128.0).extend(0.0).to_array());
    let files =
        Files::new(&[("set.json", sgct(projector.size_px, &textured, r#","mesh":"warp""#).as_bytes()), ("warp", &pfm)]);
    let as_format = read(&files.path("set.json"), &ReadOptions::default()).unwrap();
    assert!(error_px(&as_format.regions[0], projector) > 100.0);
    let from_the_bottom = ReadOptions { rows: RowOrder::BottomFirst, ..ReadOptions::default() };
    let right = read(&files.path("set.json"), &from_the_bottom).unwrap();
    assert!(error_px(&right.regions[0], projector) < LATTICE_PX);
}

#[test]
fn sgct_without_meshes_and_its_masks() {
    let projector = &projectors()[0];
    // Give the frustum by angles, and the same frustum by corners and another position of the eye.
    let planar = sgct(
        [800, 600],
        r#"{"type":"PlanarProjection","fov":{"left":20,"right":30,"up":25,"down":15},"orientation":{"yaw":40,"pitch":10,"roll":5}}"#,
        r#","blendmask":"mask.png","blacklevelmask":"mask.png""#,
    );
    let mask = png_grey([4, 4], |x, _| (80 * x) as u8);
    let files = Files::new(&[("set.json", planar.as_bytes()), ("mask.png", &mask)]);
    let region = read(&files.path("set.json"), &ReadOptions::default()).unwrap().regions.remove(0);
    let turn = steradian::glam::DMat3::from_rotation_y(-40f64.to_radians())
        * steradian::glam::DMat3::from_rotation_x(10f64.to_radians())
        * steradian::glam::DMat3::from_rotation_z(-5f64.to_radians());
    let expected = |x: f64, y: f64| {
        let tan = |degrees: f64| degrees.to_radians().tan();
        let across = -tan(20.0) + x * (tan(20.0) + tan(30.0));
        let up = tan(25.0) - y * (tan(15.0) + tan(25.0));
        (turn * DVec3::new(across, up, -1.0)).normalize()
    };
    let mut worst = 0.0_f64;
    for place in pixels([800, 600]) {
        worst = worst.max(evaluate(&region.grid, place.x, place.y).unwrap().angle_between(expected(place.x, place.y)));
    }
    assert_error("SGCT planar", worst * 800.0, PLAIN_PX);
    // The codes are multiplied by both masks.
    assert!(region.beta.is_none());
    let alpha = region.alpha.unwrap();
    assert!((alpha.values[1] - (80f32 / 255.0).powf(4.4)).abs() < 1e-6);

    let eye = DVec3::new(0.5, -0.25, 1.0);
    let corner = |x: f64, y: f64| {
        let p = eye + expected(x, y) * (4.0 / (turn.transpose() * expected(x, y)).z.abs());
        format!(r#"{{"x":{},"y":{},"z":{}}}"#, p.x, p.y, p.z)
    };
    let plane = format!(
        r#"{{"type":"ProjectionPlane","lowerleft":{},"upperleft":{},"upperright":{}}}"#,
        corner(0.0, 1.0),
        corner(0.0, 0.0),
        corner(1.0, 0.0)
    );
    let eye_position = format!(r#""pos":{{"x":{},"y":{},"z":{}}}}}]"#, eye.x, eye.y, eye.z);
    let plane = sgct([800, 600], &plane, "").replace(r#""pos":{"x":0,"y":0,"z":0}}]"#, &eye_position);
    let by_corners = read_bytes(plane.as_bytes(), &ReadOptions::default()).unwrap();
    for (a, b) in by_corners.regions[0].grid.samples.iter().zip(&region.grid.samples) {
        assert!(a.unwrap().abs_diff_eq(b.unwrap(), 1e-9));
    }
    let wrong = ReadOptions { eye_m: DVec3::X, ..ReadOptions::default() };
    assert!(refusal(plane.as_bytes(), &wrong).contains("the eye is at"));

    // A fisheye fills a circle.
    let fisheye = sgct([400, 200], r#"{"type":"FisheyeProjection","fov":180,"tilt":30}"#, "");
    let region = read_bytes(fisheye.as_bytes(), &ReadOptions::default()).unwrap().regions.remove(0);
    let apex = evaluate(&region.grid, 0.5, 0.5).unwrap();
    assert!(apex.abs_diff_eq(towards(0.0, 60f64.to_radians()), 1e-9), "{apex}");
    assert!(region.alpha.is_none());
    let warp = region.warp().unwrap();
    let lit = (0..400 * 200).filter(|i| warp.contains(i % 400, i / 400)).count() as f64;
    assert!((lit / (std::f64::consts::PI * 1e4) - 1.0).abs() < 0.01, "{lit}");

    let text = |projection: &str, more: &str| sgct(projector.size_px, projection, more);
    let planar = sgct_frustum("PlanarProjection", projector);
    for (json, expected) in [
        (text(r#"{"type":"SphericalMirrorProjection"}"#, ""), "spherical mirror is refused"),
        (text(r#"{"type":"CubemapProjection"}"#, ""), "cubemap"),
        (text(r#"{"type":"Other"}"#, ""), "one of planar, projectionplane, fisheye, texturemapped and spoutflat"),
        (text(r#"{"type":"PlanarProjection","fov":{"hfov":40}}"#, ""), "neither `down` nor `vfov`"),
        (text(&planar, r#","mesh":"../warp""#), "leads out of the folder"),
        (text(&planar, r#","mesh":"C:\\warp""#), "leads out of the folder"),
        (text(&planar, r#","mesh":"none""#), "nodes[0].windows[0].viewports[0].mesh = `none`"),
        (text(&planar, r#","user":"nobody""#), "no user `nobody`"),
        (text(&planar, "").replace(r#""x":1920"#, r#""x":0"#), "numbers of pixels"),
        ("{".to_owned(), "a configuration of SGCT"),
        (r#"{"version":1}"#.to_owned(), "`nodes` is missing"),
    ] {
        let found = refusal(json.as_bytes(), &ReadOptions::default());
        assert!(found.contains(expected), "{found}");
    }
}

#[test]
fn words_and_paths_of_mpcdi_may_have_capitals_and_comments() {
    let all = &projectors()[..1];
    let mut set = Mpcdi::a3(65, 65);
    set.masks = true;
    set.per_metre = 1000.0;
    set.warp = "<interpolation>SMOOTH</interpolation><geometricUnit>MM</geometricUnit>\
                <originOf3DData>IdealEyepoint</originOf3DData>"
        .into();
    let files = set.files(all);
    // The frame's position is in the unit of the file too, so compare the directions with those of the same set in small letters.
    let with = |change: &dyn Fn(String) -> String| {
        let mut files: Vec<(&str, Vec<u8>)> =
            files.iter().map(|(name, bytes)| (name.as_str(), bytes.clone())).collect();
        files[0].1 = change(String::from_utf8(files[0].1.clone()).unwrap()).into_bytes();
        read_bytes(&zipped(&files, true), &ReadOptions::default()).unwrap()
    };
    let plain =
        with(&|xml| xml.replace("SMOOTH", "smooth").replace(">MM<", ">mm<").replace("IdealEyepoint", "idealEyePoint"));
    let capitals = with(&|xml| xml.replace(r#"profile="a3""#, r#"profile="A3""#));
    assert_eq!(capitals.regions, plain.regions);
    // In an earlier version, a comment before the path caused the warp map and the masks to be dropped.
    let comments = with(&|xml| xml.replace("<path>", "<path><!-- p1 -->"));
    assert_eq!(comments.regions, plain.regions);
    assert!(plain.regions[0].alpha.is_some() && plain.regions[0].beta.is_some());
    // A misspelled element causes a note.
    let misspelled = with(&|xml| xml.replace("alphaMap>", "alfaMap>"));
    assert!(misspelled.regions[0].alpha.is_none());
    assert!(misspelled.notes.iter().any(|note| note.contains("<alfaMap>: this element is not known")));
}

#[test]
fn errors_of_damaged_and_contradictory_sets_name_their_position() {
    let all = &projectors()[..1];
    let set = Mpcdi::a3(9, 9);
    let options = ReadOptions::default();
    let whole = set.bytes(all);
    assert!(read_bytes(&whole, &options).is_ok());
    assert!(refusal(&whole[..whole.len() - 40], &options).contains("archive: not readable"));

    let xml = set.xml(all);
    let map = set.map(&all[0]);
    let with =
        |xml: &str, map: &[u8]| zipped(&[("mpcdi.xml", xml.as_bytes().to_vec()), ("p0.pfm", map.to_vec())], true);
    assert!(refusal(&zipped(&[("p0.pfm", map.clone())], true), &options).contains("no mpcdi.xml"));
    assert!(
        refusal(&zipped(&[("mpcdi.xml", xml.clone().into_bytes())], true), &options)
            .contains("`p0.pfm`: it is missing")
    );
    for name in ["../mpcdi.xml", "/etc/mpcdi.xml", "a\\..\\b", "C:x"] {
        let bytes = zipped(&[("mpcdi.xml", xml.clone().into_bytes()), (name, vec![])], false);
        assert!(refusal(&bytes, &options).contains("without absolute paths"), "{name}");
    }
    for (from, to, expected) in [
        (r#"profile="a3""#, r#"profile="b4""#, "profile `b4`"),
        (r#"version="2.0""#, r#"version="3.0""#, "version `3.0`"),
        (r#"version="2.0""#, r#"version="2.0" geometry="3""#, "geometry = 3"),
        (r#"<fileSet region="p0">"#, r#"<fileSet region="p9">"#, "<fileset region=p0>: it is missing"),
        (r#"xResolution="1920""#, r#"xResolution="many""#, "must be a finite number"),
        (r#"xsize="1""#, r#"xsize="2""#, "between 0 and 1 of its buffer"),
        ("<rollx>", "<rollx>1", "must be a finite number"),
        ("<yawy>-", "<yawy>", "roll x pitch = yaw"),
        ("<interpolation>smooth", "<interpolation>keystone", "is refused"),
        ("<interpolation>smooth", "<interpolation>rough", "one of linear, smooth and unknown"),
        ("</interpolation>", "</interpolation><geometricUnit>mile</geometricUnit>", "geometricUnit `mile`"),
        ("</interpolation>", "</interpolation><originOf3DData>here</originOf3DData>", "originOf3DData `here`"),
        ("</geometryWarpFile>", "</geometryWarpFile><distortionMap/>", "is refused"),
        ("</geometryWarpFile>", "</geometryWarpFile><alphaMap/>", "<path> is missing"),
        ("<display>", "<display><x>", "XML"),
        ("<MPCDI", "<!DOCTYPE x [<!ENTITY a 'b'>]><MPCDI", "XML"),
    ] {
        assert!(xml.contains(from), "{from}");
        let found = refusal(&with(&xml.replacen(from, to, 1), &map), &options);
        assert!(found.contains(expected) && found.contains("mpcdi.xml"), "{to}: {found}");
    }
    let header = map.iter().position(|byte| *byte == b'\n').unwrap();
    let text = |head: &str, samples: usize| [head.as_bytes(), &vec![0x3f; samples * 12]].concat();
    for (wrong, expected) in [
        (map[..map.len() - 1].to_vec(), "samples of three floats must have"),
        ([&map[..], b"x"].concat(), "samples of three floats must have"),
        ([b"Pf", &map[header..]].concat(), "one float per sample"),
        (text("PF\n1 9\n-1\n", 9), "2 to 8192"),
        (text("PF\n8193 9\n-1\n", 9), "1 to 8192"),
        (text("PF\n3 3\n0\n", 9), "scale `0`"),
        (text("PF\n3 -3\n-1\n", 9), "height `-3`"),
        (Pfm::of(3, 3).bytes(|_, _| [0.0, f64::INFINITY, 0.0]), "finite points"),
        (Pfm::of(3, 3).bytes(|_, _| [0.5, 1.25, -0.25]), "is the eye point"),
        (Pfm::of(3, 3).bytes(|_, _| [f64::NAN; 3]), "no point of the raster has a direction"),
    ] {
        let found = refusal(&with(&xml, &wrong), &options);
        assert!(found.contains(expected), "{expected}: {found}");
    }
    // The scale has the wrong sign: it states the byte order that the samples do not have.
    let swapped = Pfm { size: [9, 9], little_endian: false, bottom_first: true };
    let swapped = swapped.bytes(|i, j| [centre(i, 9), centre(j, 9), -2.5]);
    let wrong = [b"PF\n9 9\n-1.0\n", &swapped[swapped.len() - 9 * 9 * 12..]].concat();
    let found = refusal(&with(&xml, &wrong), &options);
    assert!(found.contains("the scale must be 1 if the samples are big-endian"), "{found}");
    let missing = ReadOptions { region: Some("p7".into()), ..ReadOptions::default() };
    assert!(refusal(&whole, &missing).contains("must be one of bp0/p0"));
    let other = ReadOptions { size_px: Some([640, 480]), ..ReadOptions::default() };
    assert!(refusal(&whole, &other).contains("1920 x 1200 pixels in the file, but 640 x 480"));
    for options in [
        ReadOptions { fov_deg: 0.0, ..ReadOptions::default() },
        ReadOptions { tilt_deg: f64::NAN, ..ReadOptions::default() },
        ReadOptions { eye_m: DVec3::INFINITY, ..ReadOptions::default() },
    ] {
        assert!(refusal(&whole, &options).contains("options"));
    }
}

#[test]
fn formats_of_closed_software_are_refused_with_the_reason() {
    let options = ReadOptions::default();
    assert!(refusal(b"vwf1 and more", &options).contains("only be opened in the OEM's software"));
    let files = Files::new(&[("warp.pol", b"\x01\x02\x03"), ("warp.vwf", b"x"), ("warp.cube", b"LUT_1D_SIZE 2\n")]);
    let text = |name: &str| read(&files.path(name), &options).unwrap_err().to_string();
    assert!(text("warp.pol").contains("closed SDK") && text("warp.pol").contains("warp.pol"));
    assert!(text("warp.vwf").contains("MPCDI 2"));
    assert!(text("warp.cube").contains("a look-up table (.cube) by itself"));
    assert!(text("none").contains("cannot read"));
    assert!(refusal(b"nothing known", &options).contains("must be one of MPCDI"));
    assert!(refusal(b"<MPCDI/>", &options).contains(".mpcdi file"));
    assert!(matches!(read(Path::new("/dev/zero"), &options), Err(TheatreError::Read { .. })));
}

/// The set that the documents use, with six projectors of 320 x 200 pixels on a tilted dome, is up to date. `STERADIAN_WRITE_REFERENCE=1` writes it
/// again.
#[test]
fn the_example_matches_the_writers() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("calibrations/six_projectors.mpcdi");
    let bytes = Mpcdi::a3(33, 33).bytes(&projectors_of([320, 200]));
    if std::env::var_os("STERADIAN_WRITE_REFERENCE").is_some() {
        std::fs::write(&path, &bytes).unwrap();
    }
    let (found, expected) =
        (read(&path, &ReadOptions::default()).unwrap(), read_bytes(&bytes, &ReadOptions::default()));
    assert_eq!(found, expected.unwrap());
}
