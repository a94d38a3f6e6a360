//! Tests that read files of every source as they are delivered, and compare them with independent values.

use std::io::Write;

use super::tests::{direction, path, read};
use super::*;
use crate::catalogue::names;
use crate::units::ARCSECOND_RAD;

/// Angle between a star and a direction, arcseconds.
fn off_arcsec(star: &StarRecord, ra_deg: f64, dec_deg: f64) -> f64 {
    let towards = direction(ra_deg, dec_deg);
    star.position.normalize().cross(towards).length().asin() / ARCSECOND_RAD
}

/// Reads a file with stars placed a century after J2000.0.
fn in_2100(name: &str) -> CatalogueRead {
    read_file(&path(name), 100.0).unwrap_or_else(|e| panic!("{e}"))
}

#[test]
fn the_sun_of_hyg_and_athyg_is_left_out() {
    for (name, source, used) in
        [("hyg41.csv", Source::Hyg, 3), ("athyg32.csv", Source::AtHyg, 2), ("hyg2.csv", Source::Hyg, 1)]
    {
        let CatalogueRead { stars, report, .. } = read(name);
        assert_eq!((report.source, stars.len(), report.rejected), (source, used, 1), "{report}");
        assert!(report.first_rejected[0].reason.contains("it is the Sun"), "{report}");
        assert!(report.to_string().contains(source.name()), "{report}");
    }
    // A star that is as near as the Sun but far fainter is not the Sun; nor is a star like the Sun at another distance.
    let text = "ra_deg,dec_deg,abs_mag,distance_pc\n10,20,15,0.0005\n10,20,4.83,1.3\n10,20,4.83,0.0005\n";
    let CatalogueRead { stars, report, .. } = read_csv_from(text.as_bytes(), "test.csv", 0.0).unwrap();
    assert_eq!((stars.len(), report.rejected), (2, 1), "{report}");
}

/// Barnard's star in 2100: the expected motion was computed by hand from Gaia's values, including perspective.
#[test]
fn proper_motions_of_every_source_move_barnards_star() {
    for name in ["athyg32.csv", "hyg41.csv", "gaia_vizier.tsv", "gaia.ecsv"] {
        let years: f64 = if name.starts_with("gaia") { 84.0 } else { 100.0 };
        let CatalogueRead { stars, report, .. } = in_2100(name);
        let star = stars.iter().find(|star| star.position.z > 0.0 && star.position.y < 0.0).unwrap();
        // Positions in 2000 (HYG, AT-HYG) and in 2016 (Gaia).
        let (ra_deg, dec_deg) = if years == 84.0 { (269.448_502_5, 4.739_420_1) } else { (269.452_076, 4.693_365) };
        let north_arcsec = 10.362_4 * years;
        let west_arcsec = 0.8015 * years;
        let moved = off_arcsec(star, ra_deg, dec_deg);
        assert!((moved - north_arcsec.hypot(west_arcsec)).abs() < 10.0, "{name}: {moved} arcsec; {report}");
        assert!(star.position.z.atan2(star.position.truncate().length()).to_degrees() > dec_deg + 0.2, "{name}");
    }
}

#[test]
fn sentinels_are_missing_values() {
    let CatalogueRead { stars, report, .. } = read("gaia_sentinels.csv");
    assert_eq!(
        (stars.len(), report.colour_ignored, report.without_colour, report.g_taken_as_v),
        (4, 3, 3, 3),
        "{report}"
    );
    for star in &stars[1..] {
        assert_eq!(star.temperature_k, 5772.0);
        assert!((star.apparent_magnitude() - 12.0).abs() < 1e-5, "{}", star.apparent_magnitude());
    }
    // A missing V falls back to G; a row with a missing motion or temperature is not refused.
    let text = "source_id,ra_deg,dec_deg,v_mag,phot_g_mean_mag,bp_rp,teff_val,pmra,radial_velocity\n\
                1,10,20,99.999,12.0,0.8,-9999,-9999,9999\n2,10,21,9.99,12.0,0.8,5000,10,20\n";
    let CatalogueRead { stars, report, .. } = read_csv_from(text.as_bytes(), "test.csv", 50.0).unwrap();
    assert_eq!((stars.len(), report.motion_ignored, report.moving), (2, 1, 1), "{report}");
    assert!(report.to_string().contains("1 with a motion of nines"), "{report}");
    assert!((stars[0].apparent_magnitude() - 12.16).abs() < 0.1, "{}", stars[0].apparent_magnitude());
    assert!(off_arcsec(&stars[0], 10.0, 20.0) < 1e-6, "a sentinel is not a motion");
    assert!((stars[1].apparent_magnitude() - 9.99).abs() < 1e-5, "9.99 is a magnitude");
    // Distances, parallaxes and temperatures may also be such marks. But 9999 K is a possible temperature, and 990 mas a possible parallax.
    let text = "source_id,ra_deg,dec_deg,v_mag,distance_pc,parallax,teff_val\n\
                1,10,20,5,-9999.0,10,5000\n2,10,21,5,,9999.99,99999\n3,10,22,5,-9999,,9999\n4,10,23,5,,990,5000\n5,10,24,5,-9998,,5000\n";
    let CatalogueRead { stars, report, .. } = read_csv_from(text.as_bytes(), "test.csv", 0.0).unwrap();
    assert_eq!(
        (report.used, report.without_distance, report.without_colour, report.rejected),
        (4, 2, 1, 1),
        "{report}"
    );
    assert!(
        (stars[0].position.length() - 100.0).abs() < 1e-9 && (stars[3].position.length() - 1000.0 / 990.0).abs() < 1e-9
    );
    assert_eq!([stars[1].temperature_k, stars[2].temperature_k], [5772.0, 9999.0]);
    assert!(report.first_rejected[0].reason.contains("is below 0"), "{report}");
}

#[test]
fn a_row_that_repeats_another_is_drawn_once() {
    let CatalogueRead { stars, report, .. } = read("repeated.csv");
    assert_eq!((stars.len(), report.rows, report.used, report.repeated), (1, 2, 1, 1), "{report}");
    assert!(report.to_string().contains("1 repeated (drawn once)"), "{report}");
    // A double star does not count as a repetition.
    let text = "hr,ra_deg,dec_deg,v_mag\n1,10,20,3.5\n2,10,20,3.5\n3,10,20,3.6\n";
    assert_eq!(read_csv_from(text.as_bytes(), "test.csv", 0.0).unwrap().stars.len(), 3);
}

#[test]
fn the_distance_of_a_cone_search_is_an_angle() {
    let CatalogueRead { stars, report, .. } = read("gaia_cone.csv");
    assert!(report.unused[0].contains("dist: the angle"), "{report}");
    assert!((stars[1].position.length() - 1000.0 / 2.0969).abs() < 1e-6, "{}", stars[1].position.length());
    // In other files it is a distance.
    let text = "ra_deg,dec_deg,v_mag,dist\n10,20,3.5,12\n";
    assert_eq!(read_csv_from(text.as_bytes(), "test.csv", 0.0).unwrap().stars[0].position.length().round(), 12.0);
}

/// V and B-V of Sirius and Vega from Tycho: -1.41 and 0.06 in Tycho's own system, -1.44 and 0.03 in Johnson's (Hipparcos catalogue).
#[test]
fn magnitudes_of_tycho_become_those_of_johnson() {
    let CatalogueRead { stars, report, .. } = read("tycho2.tsv");
    assert_eq!((report.source, stars.len(), report.rows), (Source::Tycho2, 3, 3), "{report}");
    for (star, v_mag, ra_deg, dec_deg) in
        [(&stars[0], -1.413, 101.287_155, -16.716_116), (&stars[1], 0.062, 279.234_735, 38.783_689)]
    {
        assert!((star.apparent_magnitude() - v_mag).abs() < 0.002, "{}", star.apparent_magnitude());
        assert!(off_arcsec(star, ra_deg, dec_deg) < 0.01);
    }
    assert!((8_500.0..11_000.0).contains(&stars[1].temperature_k), "{}", stars[1].temperature_k);
}

#[test]
fn tables_of_vizier_have_units_and_dashes_below_their_head() {
    let CatalogueRead { stars, report, .. } = read("vizier_hip2.tsv");
    assert_eq!((report.rows, report.rejected, report.hp_taken_as_v), (2, 0, 2), "{report}");
    assert!(stars.iter().all(|star| star.distance_known), "{report}");
    // Wrong units are refused, and those of the Bright Star Catalogue are converted.
    let table = |unit: &str, pm: &str| {
        format!(
            "_RAJ2000\t_DEJ2000\tVmag\tPlx\tpmRA\tpmDE\ndeg\tdeg\tmag\t{unit}\t{pm}\t{pm}\n---\t---\t---\t---\t---\t---\n10\t20\t3\t5\t1\t0\n"
        )
    };
    let read = |text: String| read_csv_from(text.as_bytes(), "test.tsv", 100.0);
    let moved = |pm: &str| off_arcsec(&read(table("mas", pm)).unwrap().stars[0], 10.0, 20.0);
    assert!((moved("arcsec/yr") - 100.0).abs() < 0.1 && (moved("mas/yr") - 0.1).abs() < 1e-4);
    for (unit, pm, part) in [
        ("pc", "mas/yr", "plx is in pc; it must be in mas"),
        ("mas", "mas/d", "pmra is in mas/d; it must be in mas/yr"),
    ] {
        let error = read(table(unit, pm)).unwrap_err().to_string();
        assert!(error.contains(part), "{error}");
    }
}

#[test]
fn heads_in_comments_and_units_of_ecsv_are_read() {
    let CatalogueRead { stars, report, .. } = read("savetxt.csv");
    assert_eq!((stars.len(), report.without_colour), (1, 0), "{report}");
    assert!((stars[0].apparent_magnitude() + 1.46).abs() < 1e-6);
    let CatalogueRead { stars, report, .. } = read("gaia.ecsv");
    assert_eq!((report.source, stars.len()), (Source::Gaia, 1), "{report}");
    let other = std::fs::read_to_string(path("gaia.ecsv")).unwrap().replace("unit: mas,", "unit: pc,");
    let error = read_csv_from(other.as_bytes(), "test.ecsv", 0.0).unwrap_err().to_string();
    assert!(error.contains("parallax is in pc"), "{error}");
    // A comment that is not a head is not taken as one.
    let error = read_csv_from(&b"# made on 3 May\n10,20,3\n"[..], "test.csv", 0.0).unwrap_err().to_string();
    assert!(error.contains("no direction"), "{error}");
}

#[test]
fn compressed_files_are_read_and_other_formats_named() {
    let folder = tempfile::tempdir().unwrap();
    let written = |name: &str, bytes: &[u8]| {
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        path
    };
    let mut zipped = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    zipped.write_all(&std::fs::read(path("gaia.csv")).unwrap()).unwrap();
    let zipped = zipped.finish().unwrap();
    let whole = read_file(&written("gaia.csv.gz", &zipped), 0.0).unwrap();
    assert_eq!(whole.stars, read("gaia.csv").stars);
    // The file name does not matter; a damaged end is an error.
    assert_eq!(read_file(&written("gaia", &zipped), 0.0).unwrap().stars, whole.stars);
    let error = read_file(&written("short.csv.gz", &zipped[..zipped.len() / 2]), 0.0).unwrap_err();
    assert!(matches!(error, CatalogueError::Io { .. }), "{error}");
    for (bytes, part) in [(&b"PK\x03\x04...."[..], "ZIP"), (b"\x89HDF", "HDF5"), (b"\x00\x01\x02\x03", "not text")] {
        let error = read_file(&written("stars.csv", bytes), 0.0).unwrap_err().to_string();
        assert!(error.contains(part) && error.contains("CSV, TSV, ECSV, JSON, VOTable"), "{error}");
    }
}

#[test]
fn western_right_ascensions_may_be_negative() {
    let text = "ra_deg,dec_deg,v_mag\n-90,20,3\n-180,0,3\n180,0,3.1\n-180.5,0,3\n";
    let CatalogueRead { stars, report, .. } = read_csv_from(text.as_bytes(), "test.csv", 0.0).unwrap();
    assert_eq!((stars.len(), report.rejected), (3, 1), "{report}");
    assert!(off_arcsec(&stars[0], 270.0, 20.0) < 1e-6 && stars[0].position.y < 0.0);
    assert!(report.first_rejected[0].reason.contains("-180 to 360"), "{report}");
}

#[test]
fn names_and_numbers_of_files_are_kept() {
    let named = read("athyg32.csv").named();
    let designation = |name: &str| names::find(named.iter(), name).map(|star| star.designation.as_ref());
    for (name, expected) in [
        ("Aldebaran", "alf Tau"),
        ("alpha tauri", "alf Tau"),
        ("87 Tau", "alf Tau"),
        ("HIP 21421", "alf Tau"),
        ("HR 1457", "alf Tau"),
        ("hd29139", "alf Tau"),
        ("Barnard's Star", "HIP 87937"),
    ] {
        assert_eq!(designation(name), Some(expected), "{name}");
    }
    assert_eq!(designation("Sol"), None, "the Sun is not a star of the file");
    let named = read("gaia.ecsv").named();
    assert!(names::find(named.iter(), "Gaia 4472832130942575872").is_some());
}

/// One star of an excerpt: the file, the name of the star in it, V and position from another source, their tolerances, and the motion to the east and
/// to the north in 100 years, arcseconds.
struct Known {
    file: &'static str,
    star: &'static str,
    v_mag: (f64, f64),
    ra_dec_deg: [f64; 2],
    within_arcsec: f64,
    motion_arcsec: [f64; 2],
    within_motion: f64,
}

/// The values of Sirius, Canopus, Vega and Aldebaran are from the Bright Star Catalogue, which rounds to 1 arcsec. Those of Barnard's star are from
/// Gaia for HYG and AT-HYG, and from HYG for Gaia, Hipparcos and TOPCAT. The plain file has no motion. The table of docs/catalogues.md has the same
/// rows.
const KNOWN: [Known; 15] = {
    const fn known(
        file: &'static str,
        star: &'static str,
        v_mag: (f64, f64),
        ra_dec_deg: [f64; 2],
        motion_arcsec: [f64; 2],
        within_motion: f64,
    ) -> Known {
        Known { file, star, v_mag, ra_dec_deg, within_arcsec: 1.5, motion_arcsec, within_motion }
    }
    [
        known("hyg41_bright.csv", "Sirius", (-1.46, 0.03), [101.287_08, -16.716_11], [-55.3, -120.5], 3.0),
        known("hyg41_bright.csv", "Canopus", (-0.72, 0.11), [95.987_92, -52.695_56], [2.2, 2.1], 0.5),
        known("hyg41_bright.csv", "Vega", (0.03, 0.01), [279.234_58, 38.783_61], [20.2, 28.6], 0.3),
        known("athyg40.csv", "Aldebaran", (0.85, 0.15), [68.98, 16.509_17], [6.3, -19.0], 0.3),
        known("athyg40.csv", "Barnard's Star", (9.54, 0.02), [269.452_075, 4.693_391], [-79.86, 1032.81], 11.0),
        known("vizier_hip2.tsv", "HIP 32349", (-1.46, 0.4), [101.287_08, -16.716_11], [-55.3, -120.5], 3.0),
        known("vizier_hip2.tsv", "HIP 87937", (9.54, 0.06), [269.452_08, 4.693_391], [-79.784, 1032.693], 11.0),
        known("tycho2.tsv", "HIP 32349", (-1.46, 0.06), [101.287_08, -16.716_11], [-55.3, -120.5], 3.0),
        known("tycho2.tsv", "HIP 91262", (0.03, 0.04), [279.234_58, 38.783_61], [20.2, 28.6], 0.3),
        known("topcat.vot", "HIP 32349", (-1.46, 0.4), [101.287_08, -16.716_11], [-55.3, -120.5], 3.0),
        known("topcat.vot", "HIP 87937", (9.54, 0.06), [269.452_08, 4.693_391], [-79.784, 1032.693], 11.0),
        known("own_columns.csv", "Sirius", (-1.46, 0.01), [101.287_08, -16.716_11], [0.0, 0.0], 0.01),
        known("own_columns.csv", "Betelgeuse", (0.5, 0.08), [88.792_92, 7.406_94], [0.0, 0.0], 0.01),
        known("gaia.ecsv", "Gaia 4472832130942575872", (9.54, 0.2), [269.452_08, 4.693_391], [-79.784, 1032.693], 11.0),
        known(
            "gaia_vizier.tsv",
            "Gaia 4472832130942575872",
            (9.54, 0.2),
            [269.452_08, 4.693_391],
            [-79.784, 1032.693],
            11.0,
        ),
    ]
};

#[test]
fn stars_of_excerpts_have_the_values_of_another_source() {
    for Known { file, star, v_mag, ra_dec_deg: [ra, dec], within_arcsec, motion_arcsec, within_motion } in KNOWN {
        let [now, later] = [0.0, 100.0].map(|years| {
            let named = read_file(&path(file), years).unwrap_or_else(|e| panic!("{e}")).named();
            names::find(named.iter(), star).unwrap_or_else(|| panic!("{file}: {star}")).star
        });
        let v = now.apparent_magnitude();
        let place = off_arcsec(&now, ra, dec);
        let [from, to] = [now, later].map(|star| star.position.normalize());
        let east = glam::DVec3::Z.cross(from).normalize();
        let moved = (to - from) / ARCSECOND_RAD;
        let motion = [moved.dot(east), moved.dot(from.cross(east))];
        println!(
            "| {file} | {star} | {v:.3} | {:.0} K | {place:.2} | {:.1}, {:.1} |",
            now.temperature_k, motion[0], motion[1]
        );
        assert!((v - v_mag.0).abs() <= v_mag.1, "{file}: {star}: V = {v}");
        assert!(place <= within_arcsec, "{file}: {star}: {place} arcsec");
        for (found, expected) in motion.into_iter().zip(motion_arcsec) {
            assert!((found - expected).abs() <= within_motion, "{file}: {star}: {motion:?}");
        }
    }
}

/// Ten of the columns of a cone search in the Gaia archive, with the values and the head as delivered. `dist` is an angle, and two stars have no
/// parallax.
#[test]
fn a_cone_search_of_the_gaia_archive_is_read() {
    let CatalogueRead { stars, report, .. } = read("gaia_archive.ecsv");
    assert_eq!(
        (report.used, report.without_distance, report.moving, report.source),
        (5, 2, 3, Source::Gaia),
        "{report}"
    );
    assert!(report.unused.iter().any(|column| column.starts_with("dist:")), "{report}");
    // 1000 / 2.0969.
    assert!((stars[2].position.length() - 476.89).abs() < 0.01, "{}", stars[2].position.length());
    // G = 16.610226, BP-RP = 1.9089565; G - V = -0.68633, computed by hand with the cubic of Riello et al. 2021.
    assert!((stars[2].apparent_magnitude() - 17.296_555).abs() < 1e-4, "{}", stars[2].apparent_magnitude());
}

#[test]
fn a_right_ascension_that_cannot_be_hours_decides_for_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let (plain, zipped) = (folder.path().join("stars.csv"), folder.path().join("stars.csv.gz"));
    let write = |text: &str| {
        std::fs::write(&plain, text).unwrap();
        let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
        std::io::Write::write_all(&mut encoder, text.as_bytes()).unwrap();
        std::fs::write(&zipped, encoder.finish().unwrap()).unwrap();
    };
    // The decisive value is in the last row; right ascensions above 180 degrees may be negative.
    for (text, ra_deg) in [
        ("ra,dec,mag\n10.5,20,1\n101.287,-16.716,-1.46\n", [10.5_f64, 101.287]),
        ("ra,dec,mag\n10.5,20,1\n-78.713,-16.716,-1.46\n", [10.5, 281.287]),
    ] {
        write(text);
        for file in [&plain, &zipped] {
            let CatalogueRead { stars, report, .. } = read_file(file, 0.0).unwrap();
            assert!(report.to_string().contains("right ascensions are in degrees"), "{report}");
            for (star, ra_deg) in stars.iter().zip(ra_deg) {
                let found = star.position.y.atan2(star.position.x).to_degrees().rem_euclid(360.0);
                assert!((found - ra_deg).abs() < 1e-9, "{found} for {ra_deg}");
            }
            let (stream, sent) = std::sync::mpsc::sync_channel(4);
            stream_file(file, 0.0, stream).unwrap();
            assert_eq!(sent.iter().map(|batch| batch.len()).sum::<usize>(), 2);
        }
    }
    // A file without such a row is refused, and so is a file that also has hours, minutes and seconds.
    for (text, part) in [
        ("ra,dec,mag\n10.5,20,1\n24.0,-16.716,-1.46\n", "line 2: ra = \"10.5\" may be hours or degrees"),
        ("ra,dec,mag\n6 45 8.9,-16.716,-1.46\n101.287,-16.716,-1.46\n", "line 3: ra = \"101.287\" can only be degrees"),
    ] {
        write(text);
        let error = read_file(&plain, 0.0).unwrap_err().to_string();
        assert!(error.contains(part), "{error}");
    }
}

#[test]
fn motions_with_both_halves_are_read_and_others_are_named() {
    let csv = |text: &str| read_csv_from(text.as_bytes(), "test.csv", 100.0).unwrap();
    let whole = csv("ra_deg,dec_deg,v_mag,pmRA*,pmDE\n10,20,1,3600,-1800\n");
    assert_eq!(whole.report.moving, 1, "{}", whole.report);
    assert!(off_arcsec(&whole.stars[0], 10.0, 20.0) > 350.0);
    for (text, half) in [("pmDE\n10,20,1,-1800\n", "pmde"), ("pm_ra_cosdec\n10,20,1,3600\n", "pm_ra_cosdec")] {
        let read = csv(&format!("ra_deg,dec_deg,v_mag,{text}"));
        let part = format!("{half}: the other component of the proper motion is missing");
        assert!(read.report.moving == 0 && read.report.to_string().contains(&part), "{}", read.report);
        assert!(off_arcsec(&read.stars[0], 10.0, 20.0) < 1e-6);
    }
}

#[test]
fn answers_of_simbad_are_in_degrees_with_v_beside_the_identifier() {
    let csv = |text: &str| read_csv_from(text.as_bytes(), "test.csv", 0.0);
    let read = csv("main_id,ra,dec,V\n* alf CMa,10.5,-16.716,-1.46\n").unwrap();
    assert!(off_arcsec(&read.stars[0], 10.5, -16.716) < 1e-6);
    assert!((read.stars[0].apparent_magnitude() + 1.46).abs() < 1e-5);
    // In other files `v` may have any meaning.
    let error = csv("id,ra_deg,dec_deg,V\n1,10.5,-16.716,-1.46\n").unwrap_err().to_string();
    assert!(error.contains("no brightness"), "{error}");
}

#[test]
fn stars_nearer_than_any_are_counted() {
    let csv = |distance: &str| {
        let text = format!("ra_deg,dec_deg,v_mag,distance_pc\n10,20,1,{distance}\n");
        read_csv_from(text.as_bytes(), "test.csv", 0.0).unwrap().report
    };
    let near = csv("0.003");
    assert!(near.very_near == 1 && near.to_string().contains("1 nearer than 1 pc"), "{near}");
    assert!(csv("1.3").very_near == 0);
}
