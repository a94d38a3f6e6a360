//! Tests of every form of catalogue, with files in `tests/data/catalogues`, and of the errors for invalid files.

use std::io::Read;

use glam::DVec3;

use super::*;

pub(super) fn path(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/data/catalogues").join(name)
}

pub(super) fn read(name: &str) -> CatalogueRead {
    read_file(&path(name), 0.0).unwrap_or_else(|e| panic!("{e}"))
}

fn csv(text: &str) -> Result<CatalogueRead, CatalogueError> {
    read_csv_from(text.as_bytes(), "test.csv", 0.0)
}

fn json(text: &str) -> Result<CatalogueRead, CatalogueError> {
    read_json_from(text.as_bytes(), "test.json", 0.0)
}

/// Returns the only star of a file with one row.
fn one(text: &str) -> StarRecord {
    let read = csv(text).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(read.stars.len(), 1, "{}", read.report);
    read.stars[0]
}

pub(super) fn direction(ra_deg: f64, dec_deg: f64) -> DVec3 {
    let (ra, dec) = (ra_deg.to_radians(), dec_deg.to_radians());
    DVec3::new(dec.cos() * ra.cos(), dec.cos() * ra.sin(), dec.sin())
}

#[track_caller]
fn assert_towards(star: &StarRecord, ra_deg: f64, dec_deg: f64, tolerance_deg: f64) {
    let angle = star.position.normalize().cross(direction(ra_deg, dec_deg)).length().asin().to_degrees();
    assert!(angle < tolerance_deg && star.position.dot(direction(ra_deg, dec_deg)) > 0.0, "{angle} degrees off");
}

#[test]
fn columns_with_this_programs_names() {
    let CatalogueRead { stars, report, .. } = read("own_columns.csv");
    assert_eq!((report.rows, report.used, report.rejected), (3, 3, 0));
    assert_eq!((report.without_distance, report.without_colour), (1, 1));
    assert_towards(&stars[0], 101.2872, -16.7161, 1e-9);
    assert!((stars[0].position.length() - 1000.0 / 379.21).abs() < 1e-12);
    assert!((stars[0].apparent_magnitude() + 1.46).abs() < 1e-6);
    assert!((f64::from(stars[0].magnitude) - 1.435).abs() < 0.01, "absolute magnitude of Sirius");
    assert_eq!(stars[0].temperature_k, 9940.0);
    assert_eq!((stars[2].distance_known, stars[2].magnitude, stars[2].temperature_k), (false, 12.5, 5772.0));
    assert!((stars[2].position.length() - 1.0).abs() < 1e-12);
}

#[test]
fn hyg() {
    let CatalogueRead { stars, report, .. } = read("hyg.csv");
    assert_eq!((report.rows, report.used, report.without_distance, report.without_colour), (4, 3, 1, 1));
    assert_eq!(report.first_rejected.len(), 1);
    assert_eq!(report.first_rejected[0].line, 2, "the Sun");
    assert!(report.first_rejected[0].reason.contains("origin"), "{}", report.first_rejected[0].reason);
    // The x, y, z columns of the file are independent of its ra in hours.
    assert!(stars[0].position.distance(DVec3::new(-0.494323, 2.476731, -0.758485)) < 1e-4);
    assert!(stars[1].position.distance(DVec3::new(219.740502, 0.003449, 4.177065)) < 1e-3);
    assert!((f64::from(stars[0].magnitude) - 1.454).abs() < 1e-3, "its own absolute magnitude");
    assert!((9_000.0..10_500.0).contains(&stars[0].temperature_k));
    assert!(!stars[2].distance_known && stars[2].magnitude == 8.25);
    assert_towards(&stars[2], 7.5, -45.0, 1e-9);
}

#[test]
fn hyg_by_position_only() {
    let header = "id,hip,mag,absmag,ci,x,y,z\n";
    let near = one(&format!("{header}1,71683,-0.01,4.38,0.71,-0.495203,-0.41408,-1.157,\n").replace(",\n", "\n"));
    assert!(near.distance_known && (near.apparent_magnitude() + 0.01).abs() < 1e-5);
    let unknown = one(&format!("{header}9,77,8.25,-11.75,,70105.7,9229.6,-70710.7\n"));
    assert!(!unknown.distance_known && unknown.magnitude == 8.25);
}

#[test]
fn at_hyg() {
    let CatalogueRead { stars, report, .. } = read("athyg.csv");
    assert_eq!((report.used, report.rejected, report.without_distance, report.without_colour), (2, 0, 1, 1));
    assert!(stars[0].position.distance(DVec3::new(-0.4943, 2.4767, -0.7585)) < 2e-4);
    assert_towards(&stars[1], 0.0154 * 15.0, 2.2712, 1e-9);
    assert_eq!(stars[1].magnitude, 12.146);
}

#[test]
fn gaia_archive() {
    let CatalogueRead { stars, report, .. } = read("gaia.csv");
    assert_eq!((report.used, report.rejected, report.without_distance), (3, 0, 1));
    assert_eq!((report.without_colour, report.g_taken_as_v), (1, 1));
    // Proxima Centauri: V = 11.13, 1.30 pc, 2900 to 3050 K. For such a red dwarf the relation for V is accurate to 0.2 mag.
    assert_towards(&stars[0], 217.392_321, -62.676_075, 1e-5);
    assert!((stars[0].position.length() - 1.302).abs() < 1e-3);
    assert!((stars[0].apparent_magnitude() - 11.13).abs() < 0.2, "V {}", stars[0].apparent_magnitude());
    assert!((2_850.0..3_050.0).contains(&stars[0].temperature_k));
    assert_eq!((stars[1].magnitude, stars[1].distance_known), (15.0, false));
    assert_eq!(stars[2].temperature_k, 4750.5);
}

#[test]
fn absolute_magnitude_and_position() {
    let CatalogueRead { stars, report, .. } = read("position_seed.txt");
    assert_eq!((report.used, report.rejected, report.without_colour), (2, 0, 0));
    assert_eq!(stars[0].position, DVec3::new(-0.494, 2.477, -0.758).normalize() * stars[0].position.length());
    assert!(stars[0].position.distance(DVec3::new(-0.494, 2.477, -0.758)) < 1e-12);
    assert!((stars[0].apparent_magnitude() + 1.44).abs() < 0.01);
    assert_eq!((stars[1].magnitude, stars[1].temperature_k), (-5.5, 3600.0));
}

#[test]
fn sexagesimal_positions() {
    let stars = read("sexagesimal.csv").stars;
    assert_towards(&stars[0], 101.287_083_333, -16.716_111_111, 1e-8);
    assert_towards(&stars[1], 83.001_666_667, -0.299_166_667, 1e-8);
    assert!(stars[1].position.z < 0.0, "minus zero degrees");
    assert_towards(&stars[2], 37.954_583_333, 89.264_166_667, 1e-8);
}

#[test]
fn sexagesimal_right_ascension_is_hours_under_any_name() {
    let star = one("ra_deg,dec_deg,v_mag\n06 45 08.9,-16.7,0\n");
    assert_towards(&star, 101.287_083_333, -16.7, 1e-8);
    let marked = one("ra_deg,dec_deg,v_mag\n101d17m13.5s,-16.7,0\n");
    assert_towards(&marked, 101.287_083_333, -16.7, 1e-8);
}

#[test]
fn a_right_ascension_that_may_be_hours_is_refused() {
    let error = read_file(&path("ambiguous.csv"), 0.0).unwrap_err().to_string();
    for part in ["ambiguous.csv", "line 3", "6.75", "hours or degrees", "ra_deg"] {
        assert!(error.contains(part), "{part} is not in: {error}");
    }
}

#[test]
fn bad_rows_are_reported_by_line() {
    let CatalogueRead { stars, report, .. } = read("broken_rows.csv");
    let expected = [
        (3, "ra_deg = \"361\" is outside"),
        (4, "dec_deg = \"-90.5\" is outside"),
        (6, "no brightness"),
        (8, "4 fields instead of 5"),
        (9, "teff_k = \"six thousand\" is not a number"),
        (10, "teff_k = \"0\" is not above 0"),
        (11, "distance_pc = \"0\" puts the star at the origin"),
        (12, "distance_pc = \"-3\" is below 0"),
        (13, "v_mag = \"99\" is not a magnitude: no brightness"),
        (14, "ra_deg is missing"),
    ];
    assert_eq!(report.rejected, 11);
    assert_eq!(report.first_rejected.len(), REJECTED_ROWS_KEPT);
    for (row, (line, reason)) in report.first_rejected.iter().zip(expected) {
        assert_eq!(row.line, line, "{}", row.reason);
        assert!(row.reason.starts_with(reason), "line {line}: {}", row.reason);
    }
    assert_eq!((report.rows, report.used, report.temperature_clamped, report.without_distance), (14, 3, 1, 1));
    assert_eq!(stars[1].temperature_k, 500.0);
    let summary = report.to_string();
    for part in ["broken_rows.csv: 3 of 14 rows used", "1 without distance", "11 rejected", "line 3: ", "and 1 more"] {
        assert!(summary.contains(part), "{part} is not in: {summary}");
    }
}

#[test]
fn rows_too_near_to_be_stars_are_refused() {
    let spherical = "ra_deg,dec_deg,v_mag,distance_pc";
    let parallax = "ra_deg,dec_deg,v_mag,parallax_mas";
    let cartesian = "x,y,z,v_mag";
    for (header, row, parts) in [
        (spherical, "10,20,5.0,1e-20", &["distance_pc = \"1e-20\" is too near", "at least 1e-6 pc"][..]),
        (spherical, "10,20,5.0,9.9e-7", &["distance_pc = \"9.9e-7\" is too near", "9.9e-7 pc"]),
        (parallax, "10,20,5.0,1e12", &["parallax_mas = \"1e12\" is too large", "1.0e-9 pc"]),
        (cartesian, "1e-20,0,0,5.0", &["1.0e-20 pc", "at least 1e-6 pc"]),
        (cartesian, "5e-7,5e-7,5e-7,5.0", &["8.7e-7 pc"]),
    ] {
        let report = csv(&format!("{header}\n10,20,5.0,3\n{row}\n")).unwrap_or_else(|e| panic!("{e}")).report;
        assert_eq!((report.used, report.rejected, report.first_rejected[0].line), (1, 1, 3), "{row}");
        for part in parts {
            assert!(report.first_rejected[0].reason.contains(part), "{row}: {}", report.first_rejected[0].reason);
        }
    }
    // A faint body at the position of the Sun in HYG, and one at the nearest valid position.
    for (distance, v_mag) in [("0.000005", "-16.7"), ("1e-6", "-16.7")] {
        let star = one(&format!("{spherical}\n10,20,{v_mag},{distance}\n"));
        assert!((star.apparent_magnitude() + 16.7).abs() < 1e-5, "{distance}");
        assert!(one(&format!("{cartesian}\n{distance},0,0,{v_mag}\n")).distance_known);
    }
}

#[test]
fn light_outside_the_storable_range_is_refused_and_the_rest_is_kept() {
    use crate::catalogue::chunks::StarSet;
    use crate::units::illuminance_lx_from_magnitude;

    for (header, row) in [
        // Absolute magnitudes of at least 55, and of about -57.
        ("x,y,z,abs_mag", "1,0,0,55"),
        ("ra_deg,dec_deg,v_mag,distance_pc", "10,20,30,1e-6"),
        ("ra_deg,dec_deg,v_mag,distance_pc", "10,20,-40,3e4"),
        ("x,y,z,v_mag", "30000,0,0,-40"),
        // At infinity.
        ("ra_deg,dec_deg,v_mag", "10,20,50"),
    ] {
        let good = if header.ends_with("v_mag") && header.starts_with('r') { "10,20,5" } else { "10,20,5,3" };
        let report = csv(&format!("{header}\n{good}\n{row}\n")).unwrap_or_else(|e| panic!("{e}")).report;
        assert_eq!((report.used, report.rejected, report.first_rejected[0].line), (1, 1, 3), "{header}: {row}");
        let reason = &report.first_rejected[0].reason;
        assert!(reason.contains("lx at 1 pc is outside the range") && reason.contains("1.1e15"), "{reason}");
    }
    // In the packed set, every accepted star has the illuminance of its apparent magnitude.
    let rows = ["1e-6,-26.7", "1e-6,5", "0.000005,10", "1,40", "1e4,-30", "5e7,10", ",44", ",-39"];
    for row in rows {
        let (distance, v_mag) = row.split_once(',').unwrap();
        let star = one(&format!("ra_deg,dec_deg,distance_pc,v_mag\n10,20,{row}\n"));
        let set = StarSet::from_records(vec![star]);
        let distance_pc = if distance.is_empty() { 1.0 } else { star.position.length() };
        let shown_lx = set.stars[0].illuminance_at_1_pc_lx() / (distance_pc * distance_pc);
        let wanted_lx = illuminance_lx_from_magnitude(v_mag.parse().unwrap());
        assert!((shown_lx / wanted_lx - 1.0).abs() < 1e-4, "{row}: {shown_lx} lx instead of {wanted_lx}");
    }
}

#[test]
fn line_ends_and_a_byte_order_mark_are_ignored() {
    let read = csv("\u{feff}ra_deg,dec_deg,v_mag\r\n\r\n1,2,3\r\nx,2,3\r\n1,2,3").unwrap();
    assert_eq!((read.report.used, read.report.repeated, read.report.first_rejected[0].line), (1, 1, 4));
    assert_eq!(read.stars[0].magnitude, 3.0);
}

#[test]
fn lines_are_counted_through_comments_blank_lines_and_line_ends() {
    for end in ["\n", "\r\n"] {
        let lines = [
            "\u{feff}# exported",
            "",
            "ra_deg,dec_deg,v_mag,name",
            "",
            "# \"a comment, with a mark",
            "x,2,3,first",
            "1,2,3,\"a, \"\"b\"\"\"",
            "x,2,3,\"second\"",
            "   ",
            "  # indented",
            "",
            "x,2,3,third",
            "1,2,3,\"#1\"",
            "x,2,3,fourth",
        ];
        for last in ["", end] {
            let read = csv(&(lines.join(end) + last)).unwrap();
            assert_eq!((read.report.rows, read.report.used + read.report.repeated), (6, 2), "{}", read.report);
            let found: Vec<usize> = read.report.first_rejected.iter().map(|r| r.line).collect();
            assert_eq!(found, [6, 8, 12, 14], "lines end in {end:?}, the last in {last:?}");
        }
    }
}

#[test]
fn fields_are_split_by_the_rules_of_csv() {
    let header = "name,ra_deg,dec_deg,v_mag\n";
    for row in
        ["\"a, b\",1,2,3", "\"\"\"a\"\", b\",\"1\",\"2\",\"3\"\r", "5\" star, 1 ,\" 2 \",\t3", ",1,2,3", "a\rb,1,2,3"]
    {
        let CatalogueRead { stars, report, .. } = csv(&format!("{header}{row}\n")).unwrap();
        assert_eq!((report.rows, report.used), (1, 1), "{row:?}: {report}");
        assert_towards(&stars[0], 1.0, 2.0, 1e-9);
        assert_eq!(stars[0].magnitude, 3.0, "{row:?}");
    }
    for (row, reason) in [
        (",,,", "ra_deg is missing"),
        ("a,1,2,3,4", "5 fields instead of 4"),
        ("a,1,2,3,,", "6 fields instead of 4"),
        ("a", "1 fields instead of 4"),
        // A quotation mark after a blank is text.
        ("a, \"1\",2,3", "ra_deg = \"\\\"1\\\"\" is neither"),
    ] {
        let error = csv(&format!("{header}{row}\n")).unwrap_err().to_string();
        assert!(error.contains(&format!("line 2: {reason}")), "{row}: {error}");
    }
}

#[test]
fn rows_of_any_width_are_read_whole() {
    // Test widths around the sizes at which the parser's buffers are full or grow.
    for width in (0..300).chain(4080..4110).chain(8170..8210).chain([100_000]) {
        for filler in [",".repeat(width), "a".repeat(width), format!("\"{}\"", "a".repeat(width))] {
            let header = format!("ra_deg,dec_deg,v_mag,{}", filler.replace('a', ""));
            let read = csv(&format!("{header}\n1,2,3,{filler}\n\nx,2,3,{filler}\r\n1,2,3,{filler}")).unwrap();
            assert_eq!((read.report.rows, read.report.used + read.report.repeated), (3, 2), "{width}: {}", read.report);
            assert_eq!(read.report.first_rejected[0].line, 4, "{width}");
            assert!(read.report.first_rejected[0].reason.starts_with("ra_deg"), "{width}: {}", read.report);
        }
    }
}

#[test]
fn an_open_quotation_rejects_only_its_own_row() {
    let header = "ra_deg,dec_deg,v_mag,name\n";
    // The open quotation is in an unused column of otherwise valid rows: in one row, in another row before a blank line, and on the last line.
    let rows = "1,2,3,\"a\n1,2,3,b\n1,2,3,c\r\n1,2,3,\"d\r\n\n1,2,3,e\n1,2,3,\"";
    let read = csv(&format!("{header}{rows}")).unwrap();
    assert_eq!((read.report.rows, read.report.used + read.report.repeated, read.report.rejected), (6, 3, 3));
    let found: Vec<usize> = read.report.first_rejected.iter().map(|r| r.line).collect();
    assert_eq!(found, [2, 5, 8]);
    assert!(read.report.first_rejected.iter().all(|r| r.reason.contains("not closed")), "{}", read.report);
    let error = csv("# head\nra_deg,dec_deg,v_mag,\"name\n1,2,3,a\n").unwrap_err().to_string();
    assert!(error.contains("line 2: a quotation mark is not closed"), "{error}");
}

#[test]
fn text_in_another_encoding_is_harmless() {
    let bytes = b"name,ra_deg,dec_deg,v_mag\nH\xf6rn,1,2,3\nx,\xff,2,3\n";
    let read = read_csv_from(&bytes[..], "latin1.csv", 0.0).unwrap();
    assert_eq!((read.report.used, read.report.rejected, read.report.first_rejected[0].line), (1, 1, 3));
}

#[test]
fn parallax_and_distance() {
    let header = "ra_deg,dec_deg,v_mag,parallax_mas,distance_pc\n";
    for (values, distance_pc) in [
        ("100,", Some(10.0)),
        (",25", Some(25.0)),
        ("100,25", Some(25.0)),
        ("100,nan", Some(10.0)),
        ("100,inf", Some(10.0)),
        ("0,", None),
        ("-4.5,", None),
        ("null,", None),
        ("inf,", None),
        ("1e-9,", None),
        (",", None),
    ] {
        let star = one(&format!("{header}10,20,5,{values}\n"));
        assert_eq!(star.distance_known, distance_pc.is_some(), "{values}");
        assert!((star.position.length() - distance_pc.unwrap_or(1.0)).abs() < 1e-9, "{values}");
        assert!((star.apparent_magnitude() - 5.0).abs() < 1e-6, "{values}");
    }
}

#[test]
fn an_absolute_magnitude_needs_a_distance() {
    let read = csv("ra_deg,dec_deg,abs_mag,parallax_mas\n1,2,4.83,100\n1,2,4.83,-1\n").unwrap();
    assert_eq!((read.stars.len(), read.stars[0].magnitude), (1, 4.83));
    assert_eq!(read.report.first_rejected[0].line, 3);
    assert!(read.report.first_rejected[0].reason.contains("needs a distance"));
    let error = csv("ra_deg,dec_deg,abs_mag\n1,2,3\n").unwrap_err().to_string();
    assert!(error.contains("no distance"), "{error}");
}

#[test]
fn json_array() {
    let CatalogueRead { stars, report, .. } = read("stars.json");
    assert_eq!((report.rows, report.used, report.without_distance, report.without_colour), (4, 2, 1, 1));
    assert_towards(&stars[0], 101.2872, -16.7161, 1e-9);
    assert!((stars[0].position.length() - 2.637).abs() < 1e-12);
    assert_towards(&stars[1], 101.287_083_333, -16.716_111_111, 1e-8);
    assert_eq!(stars[1].magnitude, 8.44);
    assert_eq!(report.first_rejected.iter().map(|r| r.line).collect::<Vec<_>>(), [4, 5]);
    assert!(report.first_rejected[0].reason.starts_with("entry 3: dec_deg = \"95\" is outside"));
}

#[test]
fn json_object_with_stars() {
    let CatalogueRead { stars, report, .. } = read("stars_object.json");
    assert_eq!((stars.len(), stars[0].position), (1, DVec3::new(0.0, 0.0, 10.0)));
    assert_eq!(report.first_rejected.iter().map(|r| r.line).collect::<Vec<_>>(), [5, 7]);
    assert!(report.first_rejected[0].reason.contains("entry 2: is not an object"));
}

/// A key that an entry lacks is a missing value, even if the previous entry has it. A document with as many keys as entries must not take quadratic
/// time.
#[test]
fn json_entries_do_not_inherit_values_of_the_previous_entry() {
    let stars =
        json(r#"[{"ra_deg": 1, "dec_deg": 2, "v_mag": 3, "b_v": 1.5}, {"ra_deg": 1, "dec_deg": 2, "v_mag": 3}]"#)
            .unwrap();
    assert_eq!((stars.report.used, stars.report.without_colour), (2, 1));
    let entry =
        |i: usize| format!(r#"{{"ra_deg": 1, "dec_deg": 2, "v_mag": {}, "own {i}": 0}}"#, 3.0 + 1e-4 * i as f64);
    let many: Vec<String> = (0..20_000).map(entry).collect();
    assert_eq!(json(&format!("[{}]", many.join(","))).unwrap().report.used, 20_000);
}

#[test]
fn json_and_csv_give_the_same_star() {
    let row = one("ra_deg,dec_deg,phot_g_mean_mag,bp_rp,parallax_mas\n12.5,-7.25,11.125,0.875,3.5\n");
    let entry =
        r#"[{"RA_DEG": 12.5, "dec_deg": -7.25, "phot_g_mean_mag": 11.125, "bp_rp": 0.875, "parallax_mas": 3.5}]"#;
    assert_eq!(json(entry).unwrap().stars, [row]);
}

#[test]
fn wrong_json_is_refused_with_its_line() {
    let error = read_file(&path("syntax_error.json"), 0.0).unwrap_err().to_string();
    assert!(error.contains("syntax_error.json: line 3: not JSON"), "{error}");
    for (text, part) in [
        ("{\"planets\": []}", "must be an array of stars"),
        ("5", "must be an array of stars"),
        ("[]", "no row of data"),
        ("", "not JSON"),
        ("[{\"a\": 1}]", "no direction"),
        ("[1, 2]", "no direction"),
        ("\n\n[{\"ra\": 5.5, \"dec\": 3, \"v_mag\": 1}]", "line 3: entry 1: ra = \"5.5\" may be hours or degrees"),
        (
            "\n[{\"ra_deg\": true, \"dec_deg\": 3, \"v_mag\": 1}]",
            "1 rows rejected, first: line 2: entry 1: ra_deg = \"true\"",
        ),
    ] {
        let error = json(text).unwrap_err().to_string();
        assert!(error.contains(part) && error.contains("test.json"), "{part} is not in: {error}");
    }
}

#[test]
fn the_error_of_an_incomplete_header_lists_its_columns() {
    let error = read_file(&path("no_brightness.csv"), 0.0).unwrap_err().to_string();
    for part in ["no_brightness.csv", "line 2", "no brightness", "columns found: ra_deg, dec_deg, colour", "v_mag"] {
        assert!(error.contains(part), "{part} is not in: {error}");
    }
    let error = csv("10.5,20.5,3.2\n").unwrap_err().to_string();
    assert!(error.contains("line 1: no direction; columns found: 10.5, 20.5, 3.2; needed: "), "{error}");
}

#[test]
fn files_that_are_missing_empty_or_of_another_kind_are_refused() {
    let error = read_file(&path("absent.csv"), 0.0).unwrap_err();
    assert!(matches!(error, CatalogueError::Open { .. }) && error.to_string().contains("absent.csv"), "{error}");
    let directory = tempfile::tempdir().unwrap();
    let named_csv = directory.path().join("folder.CSV");
    std::fs::create_dir(&named_csv).unwrap();
    assert!(matches!(read_file(&named_csv, 0.0), Err(CatalogueError::Open { .. })));
    for text in ["", "\n\n", "# nothing\n", "ra_deg,dec_deg,v_mag\n", "ra_deg,dec_deg,v_mag\n\n#\n"] {
        assert!(matches!(csv(text), Err(CatalogueError::NoRow { .. })), "{text:?}");
    }
}

/// A header followed by endless copies of one row, generated while it is read.
struct Repeated {
    header: &'static [u8],
    row: &'static [u8],
    position: usize,
    end: usize,
}

impl Read for Repeated {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        let count = buffer.len().min(self.end - self.position);
        for (i, byte) in buffer[..count].iter_mut().enumerate() {
            let position = self.position + i;
            *byte = *self
                .header
                .get(position)
                .unwrap_or_else(|| &self.row[(position - self.header.len()) % self.row.len()]);
        }
        self.position += count;
        Ok(count)
    }
}

#[test]
fn a_million_broken_rows_end_in_one_error() {
    let header = b"ra_deg,dec_deg,v_mag\n";
    // A quotation mark that is never closed must not swallow the following rows.
    let row = b"\"abc,2,3\n";
    let source = Repeated { header, row, position: 0, end: header.len() + row.len() * 1_000_000 };
    let error = read_csv_from(source, "broken.csv", 0.0).unwrap_err().to_string();
    assert_eq!(
        error,
        "file broken.csv: no usable row; 1000000 rows rejected, first: line 2: a quotation mark is not closed on its line"
    );
}

#[test]
fn an_endless_line_is_refused_early() {
    let source = Repeated { header: b"ra_deg,dec_deg,v_mag\n", row: b"7", position: 0, end: usize::MAX };
    let error = read_csv_from(source, "zeros.csv", 0.0).unwrap_err();
    assert!(matches!(&error, CatalogueError::Malformed { place: RowPlace::Line(2), .. }), "{error}");
}

#[test]
fn a_source_that_breaks_off_is_an_error() {
    struct Broken;
    impl Read for Broken {
        fn read(&mut self, _: &mut [u8]) -> std::io::Result<usize> {
            Err(std::io::Error::other("the disk is gone"))
        }
    }
    let source = (&b"ra_deg,dec_deg,v_mag\n1,2,3\n"[..]).chain(Broken);
    let error = read_csv_from(source, "half.csv", 0.0).unwrap_err();
    assert!(error.to_string().contains("half.csv") && error.to_string().contains("the disk is gone"), "{error}");
    let error = read_json_from((&b"[1"[..]).chain(Broken), "half.json", 0.0).unwrap_err();
    assert!(matches!(error, CatalogueError::Io { .. }));
}

#[test]
fn refused_rows_are_counted_by_reason() {
    let mut text = String::from("ra_deg,dec_deg,v_mag,parallax_mas\n10,20,3,\n");
    for row in 0..12 {
        text += &format!("10,{},3,\n{},20,3,\n10,20,,\n10,20,3,{}e9\n", 91 + row, 361 + row, 9 + row);
    }
    let CatalogueRead { report, .. } = read_csv_from(text.as_bytes(), "test.csv", 0.0).unwrap();
    let found: Vec<_> = report.rejected_kinds.iter().map(|of| (of.kind.as_str(), of.rows, of.first.line)).collect();
    assert_eq!(
        found,
        [
            ("dec_deg is outside -90 to 90 degrees", 12, 3),
            ("ra_deg is outside -180 to 360 degrees", 12, 4),
            ("no brightness", 12, 5),
            ("parallax_mas is too large", 12, 6),
        ],
        "{report}"
    );
    assert_eq!(report.rejected_kinds.iter().map(|of| of.rows).sum::<usize>(), report.rejected);
    assert!(report.to_string().contains("and 38 more; of all 48:\n  12 rows: dec_deg is outside"), "{report}");
    // Kinds of problems beyond the first 20 are counted together, so that the report stays short.
    let fields = |count: usize| ",".repeat(count);
    let text: String = (10..50).map(|count| format!("10,20,3{}\n", fields(count))).collect();
    let text = format!("ra_deg,dec_deg,v_mag\n10,20,3\n{text}");
    let CatalogueRead { report, .. } = read_csv_from(text.as_bytes(), "test.csv", 0.0).unwrap();
    let [.., last] = &report.rejected_kinds[..] else { panic!("{report}") };
    assert_eq!((report.rejected_kinds.len(), last.kind.as_str(), last.rows), (21, "other reasons", 20), "{report}");
}
