//! VOTable, FITS and Parquet. The files in `tests/data` were written by astropy 8.0 and pyarrow 26.0 from the rows of `gaia.csv`.

use std::io::Write;

use super::tests::{direction, path, read};
use super::*;
use crate::catalogue::names;

fn zipped(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

#[test]
fn every_format_gives_the_stars_of_csv() {
    let expected = read("gaia.csv");
    let folder = tempfile::tempdir().unwrap();
    for name in [
        "gaia_tabledata.vot",
        "gaia_binary.vot",
        "gaia_binary2.vot",
        "gaia.fits",
        "gaia.parquet",
        "gaia_gzip.parquet",
        "gaia_zstd.parquet",
    ] {
        // The name of the compressed copy does not indicate either format.
        let copy = folder.path().join("stars.csv");
        std::fs::write(&copy, zipped(&std::fs::read(path(name)).unwrap())).unwrap();
        for file in [path(name), copy] {
            let read = read_file(&file, 0.0).unwrap_or_else(|e| panic!("{name}: {e}"));
            let (named, CatalogueRead { stars, report, .. }) = (read.named(), read);
            assert_eq!(stars, expected.stars, "{name}");
            assert_eq!((report.rows, report.used, report.source), (3, 3, Source::Gaia), "{name}: {report}");
            assert_eq!(report.without_colour, expected.report.without_colour, "{name}: {report}");
            assert!(names::find(named.iter(), "Gaia 5853498713190525696").is_some(), "{name}");
            let has_hip = name != "gaia_binary.vot";
            assert_eq!(names::find(named.iter(), "HIP 70890").is_some(), has_hip, "{name}");
            assert!(names::find(named.iter(), "HIP -99").is_none(), "{name}: a missing number");
            let lists_vector = report.notes.iter().any(|note| note.contains("spectrum"));
            assert_eq!(lists_vector, !name.ends_with("vot"), "{name}: {report}");
        }
    }
}

#[test]
fn compressions_of_parquet_that_are_not_read_are_named() {
    let error = read_file(&path("gaia_brotli.parquet"), 0.0).unwrap_err().to_string();
    assert!(error.contains("BROTLI") && error.contains("snappy, gzip or zstd"), "{error}");
    let whole = std::fs::read(path("gaia.parquet")).unwrap();
    for length in [4, 8, whole.len() / 2, whole.len() - 1] {
        let error = read_parquet_from(whole[..length].to_vec(), "cut.parquet", 0.0).unwrap_err();
        assert!(error.to_string().contains("cut.parquet: head: not Parquet"), "{length}: {error}");
    }
}

fn votable(text: &str) -> Result<CatalogueRead, CatalogueError> {
    read_votable_from(text.as_bytes(), "test.vot", 0.0)
}

const FIELDS: &str = "<FIELD name='RA_ICRS' datatype='double' unit='deg'/><FIELD name='DE_ICRS' datatype='double' unit='deg'/>\
     <FIELD name='Vmag' datatype='float'><VALUES null='-1'/></FIELD><FIELD name='Name' datatype='char' arraysize='*'/>";

#[test]
fn votables_are_read_with_prefixes_nulls_and_entities() {
    let text = format!(
        "<?xml version='1.0'?>\n<v:VOTABLE xmlns:v='x'><v:RESOURCE><v:INFO name='QUERY_STATUS' value='OVERFLOW'/>\
         <v:TABLE><v:FIELD name='a' datatype='int'/><v:DATA><v:TABLEDATA><v:TR><v:TD>1</v:TD></v:TR></v:TABLEDATA></v:DATA>\
         </v:TABLE><v:TABLE>{}<v:DATA><v:TABLEDATA>\
         <v:TR><v:TD>10</v:TD><v:TD> -20 </v:TD><v:TD>3</v:TD><v:TD>A &amp; <![CDATA[B]]>&#x43;</v:TD></v:TR>\
         <v:TR><v:TD>10</v:TD><v:TD>20</v:TD><v:TD>-1</v:TD><v:TD/></v:TR>\
         <v:TR><v:TD>10</v:TD></v:TR></v:TABLEDATA></v:DATA></v:TABLE>\
         <v:TABLE>{}<v:DATA><v:TABLEDATA/></v:DATA></v:TABLE></v:RESOURCE></v:VOTABLE>",
        FIELDS.replace('<', "<v:").replace("<v:/", "</v:"),
        FIELDS.replace('<', "<v:").replace("<v:/", "</v:"),
    );
    let read = votable(&text).unwrap();
    let (named, CatalogueRead { stars, report, .. }) = (read.named(), read);
    assert_eq!((stars.len(), report.rejected), (1, 2), "{report}");
    assert!((stars[0].position - direction(10.0, -20.0)).length() < 1e-12);
    assert_eq!(named[0].name, "A & BC");
    let text = report.to_string();
    for part in ["row 2: no brightness", "row 3: 1 fields instead of 4", "OVERFLOW", "not read: 1"] {
        assert!(text.contains(part), "{part}: {text}");
    }
}

/// Columns with custom names, which the UCDs explain; right ascension in radians.
#[test]
fn ucds_and_units_explain_columns_with_unknown_names() {
    let row = "<DATA><TABLEDATA><TR><TD>1.5</TD><TD>0.5</TD><TD>50</TD><TD>2</TD><TD>9</TD></TR></TABLEDATA></DATA>";
    let text = |ra_unit: &str, dec_unit: &str, parallax_unit: &str| {
        format!(
            "<VOTABLE><TABLE><FIELD name='alpha' ucd='pos.eq.ra;meta.main' unit='{ra_unit}' datatype='double'/>\
             <FIELD name='delta' ucd='pos.eq.dec;meta.main' unit='{dec_unit}' datatype='double'/>\
             <FIELD name='varpi' ucd='pos.parallax.trig' unit='{parallax_unit}' datatype='double'/>\
             <FIELD name='m' ucd='phot.mag;em.opt.V' unit='mag' datatype='float'/>\
             <FIELD name='e' ucd='stat.error;pos.eq.ra' datatype='float'/>{row}</TABLE></VOTABLE>"
        )
    };
    for (units, [ra_deg, dec_deg]) in [
        (["deg", "deg"], [1.5, 0.5]),
        (["rad", "rad"], [1.5_f64, 0.5].map(f64::to_degrees)),
        (["h", "deg"], [22.5, 0.5]),
    ] {
        let CatalogueRead { stars, .. } = votable(&text(units[0], units[1], "mas")).unwrap();
        assert!((stars[0].position - direction(ra_deg, dec_deg) * 20.0).length() < 1e-9, "{units:?}");
        assert!((stars[0].apparent_magnitude() - 2.0).abs() < 1e-6);
    }
    for ([ra, dec, parallax], part) in [
        (["gon", "deg", "mas"], "ra_deg is in gon"),
        (["rad", "deg", "mas"], "dec_deg is in deg, but the right ascension is in radians"),
        (["deg", "rad", "mas"], "dec_deg is in rad; it must be in degrees"),
        (["deg", "deg", "pc"], "parallax_mas is in pc"),
    ] {
        let error = votable(&text(ra, dec, parallax)).unwrap_err().to_string();
        assert!(error.contains(part) && error.contains("alpha, delta"), "{error}");
    }
    let error = votable(&text("deg", "deg", "mas").replace("0.5", "95")).unwrap_err().to_string();
    assert!(error.contains("delta = \"95\" is outside"), "{error}");
}

#[test]
fn votables_that_cannot_be_read_say_why() {
    let table = |data: &str| format!("<VOTABLE><TABLE>{FIELDS}<DATA>{data}</DATA></TABLE></VOTABLE>");
    for (text, part) in [
        (
            "<VOTABLE><INFO name='QUERY_STATUS' value='ERROR'>no such\n table &amp; so on</INFO></VOTABLE>".to_owned(),
            "reports an error, not a table: `no such table & so on`",
        ),
        ("<VOTABLE><INFO name='QUERY_STATUS' value='ERROR'/></VOTABLE>".to_owned(), "not a table: no reason"),
        ("<html><body/></html>".to_owned(), "not a VOTable"),
        ("<VOTABLE/>".to_owned(), "no table with data"),
        ("<VOTABLE><TABLE>".to_owned(), "incomplete"),
        ("<VOTABLE></TABLE>".to_owned(), "not XML"),
        (table("<TABLEDATA></TABLEDATA>"), "no row of data"),
        (table("<BINARY><STREAM href='x.bin'/></BINARY>"), "in another file"),
        (table("<BINARY><STREAM encoding='gzip'>AA</STREAM></BINARY>"), "must be base64"),
        (table("<BINARY><STREAM encoding='base64'>A*</STREAM></BINARY>"), "not base64"),
        (table("<BINARY><STREAM encoding='base64'>AAAA</STREAM></BINARY>"), "end within a row"),
        (table("<FITS><STREAM href='x.fits'/></FITS>"), "TABLEDATA, BINARY or BINARY2"),
        (table("<TABLEDATA><TR><TD>&unknown;</TD></TR></TABLEDATA>"), "entity"),
        (table("").replace("unit='deg'", "unit='deg' arraysize='x'"), "is not a size"),
        (
            "<VOTABLE><TABLE><FIELD name='a' datatype='int'/><DATA><TABLEDATA/></DATA></TABLE></VOTABLE>".to_owned(),
            "no direction; columns found: a",
        ),
    ] {
        let error = votable(&text).unwrap_err().to_string();
        assert!(error.contains(part) && error.contains("test.vot"), "{part}: {error}");
    }
}

/// A unit of a FITS file.
fn unit(cards: &[String], data: &[u8]) -> Vec<u8> {
    let end = "END".to_owned();
    let mut bytes: Vec<u8> = cards.iter().chain([&end]).flat_map(|card| format!("{card:<80}").into_bytes()).collect();
    bytes.resize(bytes.len().next_multiple_of(2880), b' ');
    bytes.extend_from_slice(data);
    bytes.resize(bytes.len().next_multiple_of(2880), 0);
    bytes
}

fn cards(entries: &[(&str, &str)]) -> Vec<String> {
    entries.iter().map(|(key, value)| format!("{key:<8}= {value:>20}")).collect()
}

/// A file with a picture, followed by a table of two stars and more cards.
fn fits_file(more: &[(&str, &str)]) -> Vec<u8> {
    let picture = cards(&[("SIMPLE", "T"), ("BITPIX", "16"), ("NAXIS", "2"), ("NAXIS1", "2"), ("NAXIS2", "3")]);
    let table = cards(
        &[
            ("XTENSION", "'BINTABLE'"),
            ("BITPIX", "8"),
            ("NAXIS", "2"),
            ("NAXIS1", "34"),
            ("NAXIS2", "2"),
            ("PCOUNT", "0"),
            ("GCOUNT", "1"),
            ("TFIELDS", "6"),
            ("TTYPE1", "'ra_deg'"),
            ("TFORM1", "'J'"),
            ("TSCAL1", "0.001"),
            ("TTYPE2", "'dec_deg'"),
            ("TFORM2", "'1D'"),
            ("TTYPE3", "'v_mag'"),
            ("TFORM3", "'E'"),
            ("TTYPE4", "'source_id'"),
            ("TFORM4", "'K'"),
            ("TZERO4", "9223372036854775808"),
            ("TTYPE5", "'b_v'"),
            ("TFORM5", "'I'"),
            ("TSCAL5", "0.01"),
            ("TNULL5", "-32768"),
            ("TTYPE6", "'name'"),
            ("TFORM6", "'8A'"),
        ]
        .iter()
        .chain(more)
        .copied()
        .collect::<Vec<_>>(),
    );
    let mut data = Vec::new();
    for (ra, dec, v, id, b_v, name) in [
        (10_500, -20.0_f64, 3.0_f32, i64::MIN + 7, 65_i16, b"Alpha\0xx"),
        (360_000, 5.0, 4.0, -1, i16::MIN, b"        "),
    ] {
        data.extend_from_slice(&i32::to_be_bytes(ra));
        data.extend_from_slice(&dec.to_be_bytes());
        data.extend_from_slice(&v.to_be_bytes());
        data.extend_from_slice(&id.to_be_bytes());
        data.extend_from_slice(&b_v.to_be_bytes());
        data.extend_from_slice(name);
    }
    [unit(&picture, &[0; 12]), unit(&table, &data)].concat()
}

fn fits(bytes: &[u8]) -> Result<CatalogueRead, CatalogueError> {
    read_fits_from(bytes, "test.fits", 0.0)
}

#[test]
fn scaled_unsigned_and_missing_values_of_fits_are_read() {
    let read = fits(&fits_file(&[])).unwrap();
    let (named, CatalogueRead { stars, report, .. }) = (read.named(), read);
    assert_eq!((stars.len(), report.rejected, report.without_colour), (2, 0, 1), "{report}");
    assert!((stars[0].position - direction(10.5, -20.0)).length() < 1e-12);
    assert!((stars[1].position - direction(0.0, 5.0)).length() < 1e-12);
    assert!((stars[0].temperature_k - 5772.0).abs() < 200.0, "B-V 0.65: {}", stars[0].temperature_k);
    assert_eq!((named.len(), named[0].name.as_ref()), (1, "Alpha"));
    // Unsigned numbers beyond the precision of an f64 are kept. The test file has such numbers, in the columns of Gaia.
    let mut gaia = fits_file(&[]);
    for (from, to) in [("'ra_deg'", "'ra'    "), ("'dec_deg'", "'dec'    "), ("'v_mag'", "'gmag' ")] {
        let place = gaia.windows(from.len()).position(|window| window == from.as_bytes()).unwrap();
        gaia[place..place + to.len()].copy_from_slice(to.as_bytes());
    }
    let named = fits(&gaia).unwrap().named();
    assert!(named[0].others.iter().chain([&named[0].designation]).any(|name| name == "Gaia DR3 7"), "{named:?}");
    let last = &named[1].designation;
    assert_eq!(last, "Gaia DR3 9223372036854775807");
}

#[test]
fn fits_files_that_cannot_be_read_say_why() {
    let whole = fits_file(&[]);
    let image_bytes = 2 * 2880;
    let replaced = |from: &str, to: &str| {
        let mut bytes = whole.clone();
        let place = bytes.windows(from.len()).position(|window| window == from.as_bytes()).unwrap();
        bytes[place..place + from.len()].copy_from_slice(to.as_bytes());
        bytes
    };
    for (bytes, part) in [
        (whole[..image_bytes].to_vec(), "no binary table; units of the file: primary"),
        (whole[..image_bytes + 2880 + 40].to_vec(), "row 2: the file ends here, but its header announces 2 rows"),
        (whole[..100].to_vec(), "no binary table"),
        (replaced("'1D'", "'9D'"), "column 2 ends beyond the row of 34 bytes"),
        (replaced("'1D'", "'1P'"), "no direction"),
        (replaced("'1D'", "'1S'"), "TFORM2 is `1S`"),
        (replaced("'8A'", "'8'8"), "TFORM6 is `8`"),
        (replaced("'v_mag'", "'speed'"), "no brightness; columns found: ra_deg, dec_deg, speed"),
        (fits_file(&[("ZTABLE", "T")]), "ZTABLE"),
        (fits_file(&[("PIXTYPE", "'HEALPIX'")]), "{ light = "),
    ] {
        let error = fits(&bytes).map(|read| read.report.to_string()).unwrap_err().to_string();
        assert!(error.contains(part) && error.contains("test.fits"), "{part}: {error}");
    }
}
