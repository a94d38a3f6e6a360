//! Tests of the forms in which services and programs deliver tables: units, frames, heads, alignment, incomplete files.

use super::tests::direction;
use super::*;
use crate::units::ARCSECOND_RAD;

fn csv(text: &str) -> Result<CatalogueRead, CatalogueError> {
    read_csv_from(text.as_bytes(), "test.csv", 0.0)
}

/// Angle between the first star and a direction, arcseconds.
fn off_arcsec(read: &CatalogueRead, ra_deg: f64, dec_deg: f64) -> f64 {
    let towards = direction(ra_deg, dec_deg);
    read.stars[0].position.normalize().cross(towards).length().asin() / ARCSECOND_RAD
}

fn votable(head: &str, fields: &str, row: &str) -> String {
    format!(
        "<VOTABLE>{head}<RESOURCE><TABLE>{fields}<FIELD name=\"Vmag\" datatype=\"float\"/><DATA><TABLEDATA><TR>{row}<TD>9.5</TD></TR>\
         </TABLEDATA></DATA></TABLE></RESOURCE></VOTABLE>"
    )
}

/// VizieR quotes the units of sexagesimal columns.
#[test]
fn sexagesimal_columns_of_vizier_are_read() {
    for separator in ["\t", ";"] {
        let text = "#\n_RAJ2000\t_DEJ2000\tVmag\n\"h:m:s\"\t\"d:m:s\"\tmag\n------------\t------------\t-----\n06 45 08.9\t-16 42 58\t-1.46\n";
        let read = csv(&text.replace('\t', separator)).unwrap();
        assert!(off_arcsec(&read, 101.287_083, -16.716_111) < 0.01, "{}", read.report);
    }
    let read =
        csv("RAJ2000\tDEJ2000\tVmag\ndeg\t\"d:m:s\"\tmag\n---\t---\t---\n101.287083\t-16 42 58\t-1.46\n").unwrap();
    assert!(off_arcsec(&read, 101.287_083, -16.716_111) < 0.01, "{}", read.report);
}

#[test]
fn an_incomplete_votable_is_refused() {
    let fields =
        "<FIELD name=\"ra\" unit=\"deg\" datatype=\"double\"/><FIELD name=\"dec\" unit=\"deg\" datatype=\"double\"/>";
    let whole = votable("", fields, "<TD>101.287</TD><TD>-16.716</TD>");
    let read = |text: &str| read_votable_from(text.as_bytes(), "test.vot", 0.0);
    assert_eq!(read(&whole).unwrap().stars.len(), 1);
    let end = whole.find("</TABLEDATA>").unwrap();
    for cut in [end, end - 5, end - 12, whole.len() - 10] {
        let error = read(&whole[..cut]).unwrap_err().to_string();
        assert!(error.contains("incomplete") || error.contains("not XML"), "{cut}: {error}");
    }
}

/// Barnard's star moves by 10.36 arcseconds per year.
#[test]
fn frames_of_votable_and_fits_are_believed_or_refused() {
    let fields = "<FIELD name=\"ra\" unit=\"deg\" datatype=\"double\" ref=\"f\"/><FIELD name=\"dec\" unit=\"deg\" datatype=\"double\" ref=\"f\"/>\
                  <FIELD name=\"pmra\" unit=\"mas/yr\" datatype=\"float\"/><FIELD name=\"pmdec\" unit=\"mas/yr\" datatype=\"float\"/>";
    let row = "<TD>269.4</TD><TD>4.69</TD><TD>0</TD><TD>10360</TD>";
    let read = |head: &str| read_votable_from(votable(head, fields, row).as_bytes(), "test.vot", 0.0);
    let moved = |head: &str| off_arcsec(&read(head).unwrap(), 269.4, 4.69);
    assert!(moved("<COOSYS ID=\"f\" system=\"ICRS\"/>") < 1e-6);
    assert!((moved("<COOSYS ID=\"f\" system=\"ICRS\" epoch=\"J1991.25\"/>") - 8.75 * 10.36).abs() < 0.01);
    // The frame of another column is ignored, unless it is the only one.
    let two =
        "<COOSYS ID=\"g\" system=\"eq_FK4\" equinox=\"B1950\"/><COOSYS ID=\"f\" system=\"eq_FK5\" equinox=\"J2000\"/>";
    assert!(moved(two) < 1e-6);
    for head in ["<COOSYS ID=\"f\" system=\"eq_FK4\" equinox=\"B1950\"/>", "<COOSYS ID=\"h\" system=\"galactic\"/>"] {
        let error = read(head).unwrap_err().to_string();
        assert!(error.contains("must be in the ICRS"), "{error}");
    }
    // A row may also state its equinox.
    let CatalogueRead { stars, report, .. } =
        csv("ra_deg,dec_deg,v_mag,equinox\n10,20,5,J2000\n11,20,5,B1950\n").unwrap();
    assert_eq!((stars.len(), report.rejected), (1, 1), "{report}");
    assert!(report.first_rejected[0].reason.contains("equinox = \"B1950\" is not J2000"), "{report}");
}

/// A table in degrees with `mag` and `dist` is not HYG. If a row cannot be in hours, the file is not in the units of HYG.
#[test]
fn right_ascensions_are_not_multiplied_by_fifteen_on_weak_evidence() {
    let rows = "A,1.5,29.1,2.06,30\nB,9.8,56.5,2.24,70\n";
    let error = csv(&format!("name,ra,dec,mag,dist\n{rows}")).unwrap_err().to_string();
    assert!(error.contains("may be hours or degrees"), "{error}");
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("stars.csv");
    for head in ["name,ra,dec,mag,dist", "proper,ra,dec,mag,ci"] {
        std::fs::write(&path, format!("{head}\n{rows}Aldebaran,68.98,16.509,0.87,20\n")).unwrap();
        let read = read_file(&path, 0.0).unwrap();
        assert!(off_arcsec(&read, 1.5, 29.1) < 1e-6, "{}", read.report);
        assert!(read.report.to_string().contains("right ascensions are in degrees"), "{}", read.report);
    }
    // A file of HYG itself, and one with a value that is neither hours nor degrees.
    let read = csv("proper,ra,dec,mag,ci\nA,1.5,29.1,2.06,0.3\n").unwrap();
    assert!(off_arcsec(&read, 22.5, 29.1) < 1e-6, "{}", read.report);
    let read = csv("proper,ra,dec,mag,ci\nA,1.5,29.1,2.06,0.3\nB,123000.5,29.1,2.06,0.3\n").unwrap();
    assert!(read.report.first_rejected[0].reason.contains("outside -180 to 360 degrees"), "{}", read.report);
    // A right ascension that is in hours according to its name.
    assert!(off_arcsec(&csv("ra_hours,dec_deg,v_mag\n6.5,10,3\n").unwrap(), 97.5, 10.0) < 1e-6);
}

#[test]
fn the_sun_without_a_distance_is_left_out_and_planets_are_counted() {
    let CatalogueRead { stars, report, .. } =
        csv("name,ra_deg,dec_deg,v_mag\nSol,0,0,-26.74\nMoon,10,0,-12.7\nSirius,101.287,-16.716,-1.46\n").unwrap();
    assert_eq!((stars.len(), report.rejected, report.very_bright), (2, 1, 1), "{report}");
    assert!(report.first_rejected[0].reason.contains("it is the Sun"), "{report}");
    assert!(report.to_string().contains("1 brighter than any star"), "{report}");
    let error = csv("ra_deg,dec_deg,v_mag\n0,0,58\n").unwrap_err().to_string();
    assert!(error.contains("V = 58") && !error.contains("do not match"), "{error}");
}

#[test]
fn units_of_all_columns_are_converted_or_refused() {
    let table = |unit: &str, column: &str, value: &str| {
        csv(&format!(
            "RAJ2000\tDEJ2000\tVmag\tpmRA\t{column}\ndeg\tdeg\tmag\tmas/yr\t{unit}\n---\t---\t---\t---\t---\n10\t20\t3\t0\t{value}\n"
        ))
    };
    // The second component of a motion has a separate unit.
    let later = |unit: &str| {
        let text = format!(
            "RAJ2000\tDEJ2000\tVmag\tpmRA\tpmDE\ndeg\tdeg\tmag\tmas/yr\t{unit}\n---\t---\t---\t---\t---\n10\t20\t3\t0\t-1.223\n"
        );
        off_arcsec(&read_csv_from(text.as_bytes(), "test.tsv", 100.0).unwrap(), 10.0, 20.0)
    };
    assert!((later("arcsec/yr") - 122.3).abs() < 0.1 && (later("mas/yr") - 0.1223).abs() < 1e-4);
    let kelvin = |unit: &str, value: &str| table(unit, "Teff", value).unwrap().stars[0].temperature_k;
    assert!(
        (kelvin("[K]", "3.99") - 9772.4).abs() < 0.1
            && kelvin("10+3K", "9.9") == 9900.0
            && kelvin("K", "9900") == 9900.0
    );
    let read = table("arcsec", "Plx", "0.379").unwrap();
    assert!((read.stars[0].position.length() - 1000.0 / 379.0).abs() < 1e-9, "{}", read.report);
    let error = table("eV", "Teff", "0.5").unwrap_err().to_string();
    assert!(error.contains("teff is in ev; it must be in K"), "{error}");
    let magnitude = csv("RAJ2000\tDEJ2000\tVmag\ndeg\tdeg\t0.01mag\n---\t---\t---\n10\t20\t512\n").unwrap();
    assert!((magnitude.stars[0].apparent_magnitude() - 5.12).abs() < 1e-6, "{}", magnitude.report);
}

/// numpy (`savetxt`), TOPCAT (ASCII), pandas (`to_string`) and astropy (`fixed_width_two_line`, `commented_header`).
#[test]
fn aligned_text_and_commented_heads_are_read() {
    for (text, name) in [
        ("# ra_deg dec_deg v_mag\n   101.2870   -16.7160    -1.4600\n    88.7900     7.4000     0.5000\n", None),
        (
            "# ra_deg  dec_deg   v_mag  name\n  101.287  -16.716   -1.46  \"Sirius A\"\n  88.79 7.4 0.5 Betelgeuse\n",
            Some("Sirius A"),
        ),
        ("    ra_deg  dec_deg  v_mag\n0  101.287  -16.716  -1.46\n1   88.790    7.400   0.50\n", None),
        (" ra_deg dec_deg v_mag\n------- ------- -----\n101.287 -16.716 -1.46\n  88.79     7.4   0.5\n", None),
        ("#ra_deg,dec_deg,v_mag,name\n101.287,-16.716,-1.46,Sirius\n88.79,7.4,0.5,Betelgeuse\n", Some("Sirius")),
        ("#_RAJ2000|_DEJ2000|Name|Vmag\n101.287|-16.716|Sirius|-1.46\n88.79|7.4|Betelgeuse|0.5\n", Some("Sirius")),
        ("% ra_deg dec_deg v_mag\n101.287 -16.716 -1.46\n88.79 7.4 0.5\n", None),
        ("sep=;\nra_deg;dec_deg;v_mag\n101.287;-16.716;-1.46\n88.79;7.4;0.5\n", None),
        ("ra_deg,dec_deg,v_mag\n101.287,-16.716,-1.46,\n88.79,7.4,0.5,\n", None),
        ("ra_deg,dec_deg,v_mag\n1.01287D+02,\u{2212}16.716,-1.46\n88.79,7.4,0.5\n", None),
        ("ra_deg;dec_deg;v_mag\n101,287;-16,716;-1,46\n100;-10;2\n", None),
    ] {
        let read = csv(text).unwrap_or_else(|error| panic!("{text}: {error}"));
        assert_eq!((read.stars.len(), read.report.rejected), (2, 0), "{text}: {}", read.report);
        assert!(off_arcsec(&read, 101.287, -16.716) < 1e-6, "{text}");
        assert!((read.stars[0].apparent_magnitude() + 1.46).abs() < 1e-6, "{text}");
        assert_eq!(read.named().first().map(|star| star.name.as_ref()), name, "{text}");
    }
    // The commas are recognised as decimal although the first rows have whole numbers.
    let read = csv("ra_deg;dec_deg;v_mag\n101;-16;-1\n100;-10;2\n88,79;7,4;0,5\n").unwrap();
    assert_eq!((read.stars.len(), read.report.rejected), (3, 0), "{}", read.report);
    // A comment that only looks like a head does not replace one.
    let read = csv("# a,b,c\nra_deg,dec_deg,v_mag\n10,20,5\n").unwrap();
    assert!(off_arcsec(&read, 10.0, 20.0) < 1e-6);
}

#[test]
fn rows_of_dr2_and_their_numbers_are_those_of_dr2() {
    let table = |release: &str| {
        let text = format!(
            "designation,source_id,ra,dec,pmra,pmdec,phot_g_mean_mag\nGaia {release} 4472832130942575872,4472832130942575872,269.4,4.69,0,10360,8.2\n"
        );
        csv(&text).unwrap()
    };
    let (second, third) = (table("DR2"), table("DR3"));
    assert_eq!((second.report.source, third.report.source), (Source::Gaia2, Source::Gaia));
    for (read, year, number) in
        [(&second, 2015.5, "Gaia DR2 4472832130942575872"), (&third, 2016.0, "Gaia DR3 4472832130942575872")]
    {
        assert!((off_arcsec(read, 269.4, 4.69) - 10.36 * (year - 2000.0)).abs() < 0.1, "{}", read.report);
        assert_eq!(read.names[0].names.designations, [number]);
    }
}

/// For some stars Tycho-2 has no mean position, only the observed one.
#[test]
fn a_second_pair_of_columns_serves_where_the_first_is_empty() {
    let read = csv(
        "TYC1\tRAmdeg\tDEmdeg\tBTmag\tVTmag\tRA(ICRS)\tDE(ICRS)\n\tdeg\tdeg\tmag\tmag\tdeg\tdeg\n---\t---\t---\t---\t---\t---\t---\n\
         1\t10.0\t20.0\t9.1\t9.0\t10.1\t20.1\n2\t\t\t9.1\t9.0\t30.0\t40.0\n",
    )
    .unwrap();
    assert_eq!((read.stars.len(), read.report.rejected), (2, 0), "{}", read.report);
    assert!(off_arcsec(&read, 10.0, 20.0) < 1e-6);
    assert!((read.stars[1].position.normalize() - direction(30.0, 40.0)).length() < 1e-12);
}

#[test]
fn answers_of_simbad_have_names_colours_and_velocities() {
    let read = csv("main_id,ra,dec,B,V,rvz_radvel\n* alf CMa,101.287,-16.716,-1.46,-1.46,-5.5\n").unwrap();
    assert_eq!((read.report.without_colour, read.names[0].names.name.as_str()), (0, "* alf CMa"), "{}", read.report);
    assert!(read.report.moving == 1 && (read.stars[0].temperature_k - 10_000.0).abs() < 1000.0, "{}", read.report);
}

#[test]
fn other_compressions_and_encodings_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("stars");
    for (bytes, part) in [
        (&b"\xfd7zXZ\0...."[..], "compressed with xz"),
        (b"BZh91AY", "compressed with bzip2"),
        (b"\xff\xfer\0a\0", "UTF-16"),
        (b"ra_deg,dec_deg,v_mag\r10,20,5\r", "carriage returns alone"),
    ] {
        std::fs::write(&path, bytes).unwrap();
        let error = read_file(&path, 0.0).unwrap_err().to_string();
        assert!(error.contains(part), "{error}");
    }
}

/// Programs that write CSV drop the line of units: the units of the source apply then.
#[test]
fn files_without_units_have_those_of_their_source() {
    let in_2100 = |text: &str| read_csv_from(text.as_bytes(), "test.csv", 100.0).unwrap();
    // The Bright Star Catalogue uses arcseconds. The values are those of Sirius.
    let bsc = "HR,Name,HD,RAJ2000,DEJ2000,Vmag,B-V,SpType,pmRA,pmDE,Parallax,RadVel\n\
               2491,9Alp CMa,48915,06 45 08.9,-16 42 58,-1.46,0.00,A1Vm,-0.553,-1.205,0.375,-8\n";
    let read = in_2100(bsc);
    assert!((read.stars[0].position.length() - 1.0 / 0.375).abs() < 0.01, "{}", read.report);
    let moved = off_arcsec(&read, 101.287_083, -16.716_111);
    assert!((moved - 132.6).abs() < 0.3, "{moved}");
    let lspm = "LSPM,RAJ2000,DEJ2000,Vmag,pmRA,pmDE\nJ1757+0441,269.45,4.69,9.5,-0.8,10.3\n";
    let moved = off_arcsec(&in_2100(lspm), 269.45, 4.69);
    assert!((moved - 1033.0).abs() < 2.0, "{moved}");
    // Another table with HR numbers is in milliarcseconds, as its column `Plx` indicates.
    let other = bsc.replace("Parallax", "Plx").replace("0.375", "375").replace("-0.553,-1.205", "-553,-1205");
    let read = in_2100(&other);
    assert!((off_arcsec(&read, 101.287_083, -16.716_111) - 132.6).abs() < 0.3, "{}", read.report);
    // Seconds of time are not angles.
    let fk5 = "FK5,RAJ2000,DEJ2000,Vmag,pmRA,pmDE\n257,101.287,-16.716,-1.46,-3.847,-120.53\n";
    let read = in_2100(fk5);
    assert!(read.report.unused.iter().any(|unused| unused.contains("seconds of time")), "{}", read.report);
    assert!(off_arcsec(&read, 101.287, -16.716) < 0.01);
}

/// Both tables of I/239 give `RAhms` and `DEdms` at J1991.25.
#[test]
fn positions_of_hipparcos_and_tycho_1_are_those_of_1991() {
    for (number, id) in [("HIP", "87937"), ("TYC", "425 2502 1")] {
        let text = format!(
            "{number},RAhms,DEdms,Vmag,Plx,pmRA,pmDE,B-V\n{id},17 57 48.97,+04 40 05.8,9.54,549.01,-797.84,10326.93,1.57\n"
        );
        let read = csv(&text).unwrap();
        assert!(off_arcsec(&read, 269.452_07, 4.693_39) < 1.0, "{number}: {}", read.report);
    }
}

#[test]
fn a_distance_without_a_unit_does_not_replace_a_parallax() {
    for (text, distance_pc, reason) in [
        ("main_id,ra,dec,V,plx_value,dist\n* alf CMa,101.287,-16.716,-1.46,379.21,0.01\n", 2.637, "cone search"),
        ("ra_deg,dec_deg,v_mag,parallax_mas,distance\n10,20,5,10,326.2\n", 100.0, "the parallax is read"),
        ("ra_deg,dec_deg,v_mag,dist\n10,20,5,7\n", 7.0, ""),
        ("ra_deg,dec_deg,v_mag,parallax_mas,distance_pc\n10,20,5,10,101\n", 101.0, ""),
    ] {
        let read = csv(text).unwrap();
        let found_pc = read.stars[0].position.length();
        assert!((found_pc / distance_pc - 1.0).abs() < 1e-3, "{text}: {found_pc}");
        assert_eq!(read.report.unused.iter().any(|unused| unused.contains(reason)), !reason.is_empty(), "{text}");
    }
    // The file states that the column is an angle.
    let fields = "<FIELD name='ra' unit='deg' datatype='double'/><FIELD name='dec' unit='deg' datatype='double'/>\
                  <FIELD name='dist' unit='deg' datatype='double'/>";
    let text = votable("", fields, "<TD>10</TD><TD>20</TD><TD>0.3</TD>");
    let read = read_votable_from(text.as_bytes(), "test.vot", 0.0).unwrap();
    assert!(!read.stars[0].distance_known && read.report.unused[0].contains("an angle"), "{}", read.report);
}

/// The columns of the second table are in another order.
#[test]
fn a_second_table_of_vizier_is_not_read_with_the_first_head() {
    let table = |name: &str, head: &str, row: &str| {
        format!("#Table\t{name}:\n{head}\ndeg\tdeg\tmag\n----\t----\t----\n{row}\n\n")
    };
    let first = table("I_1_a", "RAJ2000\tDEJ2000\tVmag", "10\t20\t3");
    let text = format!("#RESOURCE=x\n{first}{}", table("I_1_b", "DEJ2000\tRAJ2000\tVmag", "-20\t40\t4"));
    let read = csv(&text).unwrap();
    assert_eq!((read.stars.len(), read.report.rejected), (1, 0), "{}", read.report);
    assert!(read.report.to_string().contains("tables of the file that are not read: 1"), "{}", read.report);
    assert!(!csv(&first).unwrap().report.to_string().contains("not read"));
    // A comment that begins with another word does not begin a table.
    assert_eq!(csv(&format!("{first}#Tables end here\n11\t21\t4\n")).unwrap().stars.len(), 2);
}

#[test]
fn columns_that_drawing_could_use_and_that_are_not_read_are_listed() {
    let read =
        csv("ra_deg,dec_deg,v_mag,distance_ly,r_med_geo,mu_alpha,e_plx,dist_err,color\n10,20,5,1,1,1,1,1,1\n").unwrap();
    assert_eq!(read.report.unused, ["distance_ly", "r_med_geo", "mu_alpha"], "{}", read.report);
}
