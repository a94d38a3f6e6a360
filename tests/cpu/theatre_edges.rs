//! The light of a raster ends exactly at the edge of the content, as in the programs that calibrations are made for. Also tests triangle meshes
//! adjusted by hand, and fisheyes up to 360 degrees.

use std::f64::consts::PI;

use steradian::{
    glam::{DVec2, DVec3},
    theatre::{Calibration, ReadOptions, Region, TheatreError, read},
    view::projection::{PlaneMapping as _, TabulatedMapping, TabulationError},
};

use crate::common::theatre::{Pfm, centre, csv, sgct, zipped};

const PLANAR: &str = r#"{"type":"PlanarProjection","fov":{"left":30,"right":30,"up":20,"down":20},"orientation":{"yaw":0,"pitch":0,"roll":0}}"#;

fn read_files(files: &[(&str, &[u8])], options: &ReadOptions) -> Result<Calibration, TheatreError> {
    let folder = tempfile::tempdir().unwrap();
    for (name, bytes) in files {
        std::fs::write(folder.path().join(name), bytes).unwrap();
    }
    read(&folder.path().join(files[0].0), options)
}

/// Reads an SGCT configuration with a mesh; returns its only region, and the notes.
fn with_mesh(size: [u32; 2], projection: &str, mesh: &str) -> (Region, Vec<String>) {
    let json = sgct(size, projection, r#","mesh":"mesh""#);
    let mut found =
        read_files(&[("set", json.as_bytes()), ("mesh", mesh.as_bytes())], &ReadOptions::default()).unwrap();
    (found.regions.remove(0), found.notes)
}

fn fisheye(fov_deg: f64) -> String {
    format!(r#"{{"type":"FisheyeProjection","fov":{fov_deg},"tilt":0}}"#)
}

/// Counts the pixels that are lit although they should be dark, or the reverse. `is_lit` receives a position, 0 to 1 to the right and up.
fn wrong_pixels(region: &Region, is_lit: impl Fn(DVec2) -> bool) -> usize {
    let warp = region.warp().unwrap();
    let [width, height] = region.size_px;
    let wrong = |(x, y): &(u32, u32)| {
        let place = DVec2::new(centre(*x as usize, width as usize), 1.0 - centre(*y as usize, height as usize));
        warp.contains(*x, *y) != is_lit(place)
    };
    (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).filter(wrong).count()
}

fn in_circle(place: DVec2) -> bool {
    (2.0 * place - 1.0).length() <= 1.0
}

fn in_square(place: DVec2) -> bool {
    place.min_element() >= 0.0 && place.max_element() <= 1.0
}

/// Returns the identity mesh in Paul Bourke's format for a square raster. `intensity` receives column and row.
fn bourke(columns: usize, rows: usize, intensity: impl Fn(usize, usize) -> f64) -> String {
    let mut text = format!("2\n{columns} {rows}\n");
    for row in 0..rows {
        for column in 0..columns {
            let (u, v) = (column as f64 / (columns - 1) as f64, row as f64 / (rows - 1) as f64);
            text += &format!("{} {} {u} {v} {}\n", 2.0 * u - 1.0, 2.0 * v - 1.0, intensity(column, row));
        }
    }
    text
}

#[test]
fn a_fisheye_behind_a_mesh_ends_at_its_circle_for_every_number_of_nodes() {
    let identity = |x: f64, y: f64| DVec2::new(x, 1.0 - y);
    for [columns, rows] in [[17, 9], [33, 17], [129, 97]] {
        let (region, notes) = with_mesh([270, 270], &fisheye(180.0), &csv(columns, rows, identity));
        assert_eq!(wrong_pixels(&region, in_circle), 0, "{columns} x {rows}");
        assert!(
            notes.iter().any(|note| note.contains("pixels are dark where their own place is outside")),
            "{notes:?}"
        );
        let options = ReadOptions { size_px: Some([270, 270]), ..ReadOptions::default() };
        let text = bourke(columns, rows, |_, _| 1.0);
        let alone = read_files(&[("mesh", text.as_bytes())], &options).unwrap().regions.remove(0);
        assert_eq!(wrong_pixels(&alone, in_circle), 0, "{columns} x {rows}, alone");
    }
    // The picture has all light of the hemisphere.
    let (region, _) = with_mesh([270, 270], &fisheye(180.0), &csv(17, 9, identity));
    let table = TabulatedMapping::new(region.warp().unwrap()).unwrap();
    let sum_sr = table.picture_solid_angle_sr();
    assert!((sum_sr / (2.0 * PI) - 1.0).abs() < 5e-4, "{sum_sr}");
}

#[test]
fn a_flat_picture_ends_at_0_and_1() {
    for (beyond, mesh) in [(1e-4, [17, 9]), (0.1, [17, 9]), (0.1, [2, 2])] {
        let place = |x: f64, y: f64| DVec2::new(x, 1.0 - y) * (1.0 + 2.0 * beyond) - beyond;
        let (region, _) = with_mesh([96, 54], PLANAR, &csv(mesh[0], mesh[1], place));
        let is_lit = |at: DVec2| in_square(place(at.x, 1.0 - at.y));
        assert_eq!(wrong_pixels(&region, is_lit), 0, "{beyond} {mesh:?}");
    }
    // Shift one node, so that the mesh is not a lattice.
    let place = |x: f64, y: f64| DVec2::new(x, 1.0 - y) * 1.2 - 0.1;
    let shifted = csv(17, 9, place).replacen("0.5000000;0.5000000;0.5000000", "0.5020000;0.5000000;0.5024000", 1);
    let (region, notes) = with_mesh([96, 54], PLANAR, &shifted);
    assert!(notes.iter().any(|note| note.contains("not a regular lattice")), "{notes:?}");
    let wrong = wrong_pixels(&region, |at| in_square(place(at.x, 1.0 - at.y)));
    assert_eq!(wrong, 0);
}

/// Returns an MPCDI set of the profile 3d, with coordinates from `low` to `high`.
fn mpcdi(low: f64, high: f64, geometry: &str) -> Vec<u8> {
    let xml = format!(
        r#"<MPCDI profile="3d" geometry="1" color="1" version="2.0"><display><buffer id="b" xResolution="96" yResolution="54">
        <region id="r" xResolution="96" yResolution="54" x="0" y="0" xsize="1" ysize="1"><frustum><yaw>0</yaw><pitch>0</pitch><roll>0</roll>
        <leftAngle>-30</leftAngle><rightAngle>30</rightAngle><upAngle>20</upAngle><downAngle>-20</downAngle></frustum></region></buffer></display>
        <files><fileset region="r"><geometryWarpFile><path>p.pfm</path>{geometry}</geometryWarpFile></fileset></files></MPCDI>"#
    );
    let map = Pfm::of(33, 17)
        .bytes(|i, j| [low + (high - low) * centre(i, 33), low + (high - low) * (1.0 - centre(j, 17)), 0.0]);
    zipped(&[("mpcdi.xml", xml.into_bytes()), ("p.pfm", map)], true)
}

#[test]
fn a_warp_map_of_mpcdi_ends_at_its_frustum() {
    for geometry in ["", "<interpolation>linear</interpolation>"] {
        let set = mpcdi(-0.1, 1.1, geometry);
        let region = read_files(&[("set", &set)], &ReadOptions::default()).unwrap().regions.remove(0);
        let is_lit = |at: DVec2| in_square(at * 1.2 - 0.1);
        assert_eq!(wrong_pixels(&region, is_lit), 0, "{geometry}");
    }
}

#[test]
fn the_misspelled_unknown_of_scalable_is_read() {
    let geometry = "<interpolation>unkown</interpolation><geometricUnit>unkown</geometricUnit><originOf3DData>unkown</originOf3DData>";
    let set = mpcdi(0.0, 1.0, geometry);
    assert!(read_files(&[("set", &set)], &ReadOptions::default()).is_ok());
    let other = mpcdi(0.0, 1.0, "<interpolation>unknwn</interpolation>");
    let error = read_files(&[("set", &other)], &ReadOptions::default()).unwrap_err().to_string();
    assert!(error.contains("interpolation `unknwn`"), "{error}");
}

#[test]
fn nodes_marked_unlit_darken_their_cells_and_marks_outside_too() {
    let options = ReadOptions { size_px: Some([64, 64]), ..ReadOptions::default() };
    let dark = |column: usize, row: usize| if column == 8 && row == 8 { -1.0 } else { 1.0 };
    let text = bourke(17, 17, dark);
    let region = read_files(&[("mesh", text.as_bytes())], &options).unwrap().regions.remove(0);
    // The four cells around the middle, each four pixels wide and high, are dark.
    let is_lit = |at: DVec2| in_circle(at) && (at - 0.5).abs().max_element() > 4.0 / 64.0;
    assert_eq!(wrong_pixels(&region, is_lit), 0);
    // A lattice may have -1 instead of coordinates as a mark. Then the cells around the mark are dark, and other cells are not distorted.
    let marked = csv(17, 9, |x, y| if x == 0.5 && y == 0.5 { DVec2::splat(-1.0) } else { DVec2::new(x, 1.0 - y) });
    let (region, notes) = with_mesh([64, 32], PLANAR, &marked);
    assert!(notes.iter().any(|note| note.contains("do not continue their neighbours")), "{notes:?}");
    let is_lit = |at: DVec2| (at.x - 0.5).abs() > 1.0 / 16.0 || (at.y - 0.5).abs() > 1.0 / 8.0;
    assert_eq!(wrong_pixels(&region, is_lit), 0);
    // A mesh with coordinates in pixels is refused.
    let json = sgct([64, 32], PLANAR, r#","mesh":"mesh""#);
    let pixels = csv(17, 9, |x, y| DVec2::new(64.0 * x + 2.0, 32.0 * y + 2.0));
    let error = read_files(&[("set", json.as_bytes()), ("mesh", pixels.as_bytes())], &ReadOptions::default());
    assert!(error.unwrap_err().to_string().contains("u and v must be between 0 and 1"));
}

/// Returns an identity OBJ mesh. Its inner nodes are moved at random by up to a share of a cell.
fn adjusted(columns: usize, rows: usize, share: f64) -> String {
    let mut state = 0x9e37_79b9_7f4a_7c15_u64;
    let mut random = || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state % 20_001) as f64 / 10_000.0 - 1.0
    };
    let mut text = String::new();
    for row in 0..rows {
        for column in 0..columns {
            let (u, v) = (column as f64 / (columns - 1) as f64, row as f64 / (rows - 1) as f64);
            let is_inner = column > 0 && row > 0 && column + 1 < columns && row + 1 < rows;
            let by = if is_inner { share } else { 0.0 };
            let (x, y) = (u + by * random() / (columns - 1) as f64, v + by * random() / (rows - 1) as f64);
            text += &format!("v {} {} 0\nvt {u} {v}\n", 2.0 * x - 1.0, 2.0 * y - 1.0);
        }
    }
    for row in 1..rows {
        for column in 1..columns {
            let low = (row - 1) * columns + column;
            text += &format!("f {0}/{0} {1}/{1} {2}/{2} {3}/{3}\n", low, low + 1, low + 1 + columns, low + columns);
        }
    }
    text
}

/// Compare with the solid angle of the frustum, computed from its edges.
fn frustum_sr() -> f64 {
    let (x, y) = (30f64.to_radians().tan(), 20f64.to_radians().tan());
    4.0 * (x * y / (1.0 + x * x + y * y).sqrt()).atan()
}

#[test]
fn a_triangle_mesh_adjusted_by_hand_is_read_and_keeps_all_light() {
    for (size, share) in [([96, 54], 0.05), ([192, 108], 0.05), ([192, 108], 0.2), ([192, 108], 0.3)] {
        let (region, _) = with_mesh(size, PLANAR, &adjusted(33, 17, share));
        let table = TabulatedMapping::new(region.warp().unwrap()).unwrap();
        assert_eq!(table.pixels(), u64::from(size[0] * size[1]));
        let found = table.picture_solid_angle_sr() / frustum_sr() - 1.0;
        assert!(found.abs() < 3e-4, "{size:?} {share}: {found}");
        assert!(table.accuracy().kink_px < 1.0, "{:?}", table.accuracy());
    }
}

#[test]
fn a_triangle_mesh_that_folds_is_refused() {
    let (region, _) = with_mesh([192, 108], PLANAR, &adjusted(33, 17, 0.9));
    let error = TabulatedMapping::new(region.warp().unwrap()).unwrap_err();
    assert!(matches!(error, TabulationError::Folded { .. } | TabulationError::NotInverse { .. }), "{error}");
}

#[test]
fn fisheyes_of_up_to_360_degrees_are_read() {
    for (fov_deg, side) in [(270.0, 300_u32), (271.0, 200), (300.0, 301), (330.0, 200), (350.0, 200), (360.0, 200)] {
        let json = sgct([side, side], &fisheye(fov_deg), "");
        let region = read_files(&[("set", json.as_bytes())], &ReadOptions::default()).unwrap().regions.remove(0);
        assert_eq!(wrong_pixels(&region, in_circle), 0, "{fov_deg}");
        let table = TabulatedMapping::new(region.warp().unwrap());
        let table = table.unwrap_or_else(|error| panic!("{fov_deg} degrees, {side} pixels: {error}"));
        let expected = 4.0 * PI * (fov_deg.to_radians() / 4.0).sin().powi(2);
        let found = table.picture_solid_angle_sr() / expected - 1.0;
        assert!(found.abs() < 1e-3, "{fov_deg}: {found}");
        // The centre of the picture is the apex, and directions lead back to their pixels.
        let middle = f64::from(side) / 2.0;
        let apex = table.lookup(DVec3::Y).unwrap();
        assert!(apex.distance(DVec2::splat(middle)) < 0.01, "{apex}");
        for angle in [0.2, 0.5, 0.9, 0.98] {
            let theta = angle * fov_deg.to_radians() / 2.0;
            // A direction to the right of the apex is on the right side of the picture.
            let found = table.lookup(DVec3::new(theta.sin(), theta.cos(), 0.0)).unwrap();
            let expected = DVec2::new(middle * (1.0 + angle), middle);
            assert!(found.distance(expected) < 0.05, "{fov_deg} {angle}: {found}, not {expected}");
        }
    }
    let json = sgct([64, 64], &fisheye(361.0), "");
    assert!(read_files(&[("set", json.as_bytes())], &ReadOptions::default()).is_err());
}

#[test]
fn a_bourke_mesh_of_360_degrees_is_read() {
    let options = ReadOptions { size_px: Some([200, 200]), fov_deg: 360.0, ..ReadOptions::default() };
    let text = bourke(129, 129, |_, _| 1.0);
    let region = read_files(&[("mesh", text.as_bytes())], &options).unwrap().regions.remove(0);
    let table = TabulatedMapping::new(region.warp().unwrap()).unwrap();
    let sum_sr = table.picture_solid_angle_sr();
    assert!((sum_sr / (4.0 * PI) - 1.0).abs() < 1e-3, "{sum_sr}");
}
