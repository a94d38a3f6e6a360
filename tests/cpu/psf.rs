//! `steradian psf`: point-spread functions from apertures and from files of other programs.

use std::path::Path;
use std::process::{Command, Stdio};

use glam::DVec2;
use steradian::{
    photometry::{
        psf::{ARCSECOND_RAD, Loaded, Psf, PsfError, read, write_exr},
        rec709::luminance,
    },
    plan::settings::PsfTextureSettings,
};

/// Runs the command, checks the exit code, and returns standard output and standard error.
#[track_caller]
fn run(folder: &Path, arguments: &[&str], code: i32) -> (String, String) {
    let output = Command::new(env!("CARGO_BIN_EXE_steradian"))
        .args(arguments)
        .current_dir(folder)
        .env_remove("STERADIAN_LOG")
        .stdin(Stdio::null())
        .output()
        .unwrap();
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    let (out, err) = (text(output.stdout), text(output.stderr));
    assert_eq!(output.status.code(), Some(code), "{arguments:?}\nstdout: {out}\nstderr: {err}");
    (out, err)
}

/// Returns a FITS unit: padded cards, followed by padded data.
fn unit(cards: &[&str], data: &[u8]) -> Vec<u8> {
    let mut bytes: Vec<u8> = cards.iter().chain(&["END"]).flat_map(|card| format!("{card:<80}").into_bytes()).collect();
    bytes.resize(bytes.len().next_multiple_of(2880), b' ');
    bytes.extend_from_slice(data);
    bytes.resize(bytes.len().next_multiple_of(2880), 0);
    bytes
}

/// Returns a picture of 4 x 4 pixels with the values 1 to 16, beginning at the lower left, in the encoding of `bitpix`.
fn picture(bitpix: &str, extra: &[&str], encode: impl Fn(i32) -> Vec<u8>) -> Vec<u8> {
    let bitpix = format!("BITPIX  = {bitpix:>20} / bits");
    let mut cards = vec![
        "SIMPLE  =                    T / a comment",
        &bitpix,
        "NAXIS   =                    2",
        "NAXIS1  =                    4",
        "NAXIS2  =                    4",
        "COMMENT = no value",
        "OBJECT  = 'it''s / no star'",
    ];
    cards.extend_from_slice(extra);
    unit(&cards, &(1..=16).flat_map(encode).collect::<Vec<u8>>())
}

const SCALE: &str = "PIXELSCL=                 0.25 / arcsec";

fn float(value: i32) -> Vec<u8> {
    (value as f32).to_be_bytes().to_vec()
}

fn load(bytes: &[u8], pixel_arcsec: Option<f64>) -> Result<Loaded, PsfError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("picture");
    std::fs::write(&path, bytes).unwrap();
    read(&path, pixel_arcsec)
}

/// Returns the largest difference from the picture with the values 1 to 16.
fn error_of(psf: &Psf) -> f64 {
    (0..16u32)
        .map(|i| {
            let expected = f64::from((3 - i / 4) * 4 + i % 4 + 1) / 136.0;
            psf.pixel(i % 4, i / 4).into_iter().fold(0.0, |worst: f64, c| worst.max((c - expected).abs()))
        })
        .fold(0.0, f64::max)
}

#[test]
fn fits_of_every_encoding_is_read_the_right_way_up() {
    let ints = |scale: i32| move |v: i32| (v * scale).to_be_bytes().to_vec();
    for (name, bytes) in [
        ("-32", picture("-32", &[SCALE], float)),
        ("-64", picture("-64", &[SCALE], |v| f64::from(v).to_be_bytes().to_vec())),
        ("8", picture("8", &[SCALE], |v| vec![v as u8])),
        ("16", picture("16", &[SCALE], |v| (v as i16).to_be_bytes().to_vec())),
        ("32", picture("32", &[SCALE], ints(1))),
        ("64", picture("64", &[SCALE], |v| i64::from(v).to_be_bytes().to_vec())),
        // Test unsigned 16-bit values as FITS encodes them, and a scale.
        (
            "16 with BZERO",
            picture("16", &[SCALE, "BZERO   =              32768.0"], |v| ((v - 32768) as i16).to_be_bytes().to_vec()),
        ),
        ("32 with BSCALE", picture("32", &[SCALE, "BSCALE  =                5.D-1"], ints(2))),
    ] {
        let loaded = load(&bytes, None).unwrap_or_else(|error| panic!("{name}: {error}"));
        assert!(error_of(&loaded.psf) < 1.4e-8, "{name}: {:?}", loaded.psf.rgb);
        assert!((loaded.psf.pixel_rad / ARCSECOND_RAD - 0.25).abs() < 1e-15, "{name}");
        assert_eq!(loaded.peak_offset_px, DVec2::new(1.5, 1.5), "{name}");
    }
    // The comparison must fail for wrongly decoded bytes.
    let wrong = load(&picture("32", &[SCALE, "BZERO   =                 -0.5"], ints(1)), None).unwrap();
    assert!(error_of(&wrong.psf) > 1e-4);
}

#[test]
fn the_scale_comes_from_the_header_or_from_the_caller() {
    for (cards, arcsec) in [
        (&["CDELT1  =               -1E-4", "CDELT2  =                1E-4"][..], 0.36),
        (&["CDELT1  =                 0.5", "CDELT2  =                 0.5", "CUNIT1  = 'arcsec  '"], 0.5),
        (&["CD1_1   =                 0.0", "CD1_2   =                2E-4", "CD2_1   =    -2E-4"], 0.72),
        (&["PIXSCALE=                 1.5"], 1.5),
    ] {
        let bytes = picture("-32", cards, float);
        let found = load(&bytes, None).unwrap().psf.pixel_rad / ARCSECOND_RAD;
        assert!((found / arcsec - 1.0).abs() < 1e-15, "{cards:?}: {found}");
        assert_eq!(load(&bytes, Some(7.0)).unwrap().psf.pixel_rad, 7.0 * ARCSECOND_RAD);
    }
    let bare = picture("-32", &[], float);
    assert!(matches!(load(&bare, None), Err(PsfError::NoScale { .. })));
    assert!(load(&bare, Some(0.1)).is_ok());
}

#[test]
fn an_image_after_a_table_and_an_empty_first_unit_is_found() {
    let mut bytes = unit(&["SIMPLE  =                    T", "BITPIX  =  8", "NAXIS   =  0"], &[]);
    bytes.extend(unit(
        &["XTENSION= 'BINTABLE'", "BITPIX  = 8", "NAXIS   = 2", "NAXIS1  = 10", "NAXIS2  = 300", "PCOUNT  = 7"],
        &[1; 3007],
    ));
    let mut image = picture("-32", &[SCALE], float);
    image[..80].copy_from_slice(format!("{:<80}", "XTENSION= 'IMAGE   '").as_bytes());
    bytes.extend(image);
    assert!(error_of(&load(&bytes, None).unwrap().psf) < 1.4e-8);
}

#[test]
fn errors_of_broken_files_name_the_problem() {
    let good = picture("-32", &[SCALE], float);
    let with = |from: &str, to: &str| {
        let offset = good.windows(from.len()).position(|w| w == from.as_bytes()).unwrap();
        let mut bytes = good.clone();
        bytes[offset..offset + to.len()].copy_from_slice(to.as_bytes());
        bytes
    };
    let mut nan = good.clone();
    nan[2880..2884].copy_from_slice(&f32::NAN.to_be_bytes());
    for (bytes, part) in [
        (Vec::new(), "neither"),
        (b"SIMPLE  = T".to_vec(), "no END"),
        (b"hello".to_vec(), "neither"),
        (good[..2900].to_vec(), "bytes are"),
        (good[..600].to_vec(), "END"),
        (with("NAXIS1  =                    4", "NAXIS1  =                    3"), "3 x 4"),
        (with("NAXIS   =                    2", "NAXIS   =                    1"), "no image of two axes"),
        (with("NAXIS   =                    2", "NAXIS   =                    x"), "NAXIS"),
        (with("                 -32", "                 -31"), "BITPIX is -31"),
        (with("NAXIS1  =                    4", "NAXIS1  = 9999999999999999999"), "NAXIS1"),
        (with("NAXIS1  =                    4", "NAXIS1  =  9999999999999999999"), "many"),
        (with("0.25 / arcsec", "-0.2 / arcsec"), "arcseconds"),
        (nan, "row 3 (from 0) is not finite"),
        (picture("-32", &[SCALE], |_| vec![0; 4]), "sum"),
        (
            picture("16", &[SCALE, "BLANK   =                    5"], |v| (v as i16).to_be_bytes().to_vec()),
            "not finite",
        ),
        (picture("-32", &["CDELT1  = 1E-4", "CDELT2  = 2E-4"], float), "not square"),
        ([&[0x76, 0x2f, 0x31, 0x01][..], &[0; 40]].concat(), "OpenEXR"),
    ] {
        let error = load(&bytes, None).unwrap_err().to_string();
        assert!(error.contains(part) && error.contains("picture"), "`{part}` is not in: {error}");
    }
}

#[test]
fn exr_keeps_every_bit_and_the_scale() {
    let folder = tempfile::tempdir().unwrap();
    let mut psf = load(&picture("-32", &[], float), Some(0.123_456_789)).unwrap().psf;
    psf.rgb[3] = [psf.rgb[3][0] * 0.5, psf.rgb[3][1], psf.rgb[3][2] * 1.5];
    psf.covered = 0.875;
    // Reading scales the sum of Y to 1, so scale the expected picture in the same way first.
    let total: f64 = psf.rgb.iter().map(|pixel| luminance(pixel.map(f64::from))).sum();
    psf.rgb.iter_mut().flatten().for_each(|channel| *channel = (f64::from(*channel) / total) as f32);
    let path = folder.path().join("psf.exr");
    write_exr(&path, &psf).unwrap();
    let bytes = std::fs::read(&path).unwrap();
    let back = read(&path, None).unwrap();
    let same = |a: &Psf, b: &Psf| {
        a.size == b.size
            && (a.pixel_rad / b.pixel_rad - 1.0).abs() < 1e-15
            && a.covered == b.covered
            && a.rgb.iter().flatten().zip(b.rgb.iter().flatten()).all(|(a, b)| (a - b).abs() <= 1e-7 * b)
    };
    assert!(same(&back.psf, &psf), "{back:?}");
    for _ in 0..8 {
        write_exr(&path, &psf).unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), bytes, "the same texture gives the same bytes");
    }
    let mut other = psf.clone();
    other.rgb[5][1] *= 1.001;
    write_exr(&path, &other).unwrap();
    assert!(!same(&read(&path, None).unwrap().psf, &psf));
    assert!(matches!(write_exr(&folder.path().join("no/such/folder.exr"), &psf), Err(PsfError::Write { .. })));
}

#[test]
fn the_command_makes_and_converts_textures() {
    let folder = tempfile::tempdir().unwrap();
    let small = ["--size", "48", "--wavelengths", "6"];
    for aperture in ["circle", "hexagon", "curved_blades", "jwst", "hubble"] {
        let arguments = [&["psf", "--aperture", aperture, "--diameter-mm", "2", "--out", "a.exr"][..], &small].concat();
        let (out, err) = run(folder.path(), &arguments, 0);
        assert!(
            out.starts_with("wrote a.exr: 48 x 48 pixels of 14.1807 arcseconds, sums R 1.0000 G 1.0000 B 1.0000"),
            "{out}"
        );
        assert!(err.contains("6 of 6 wavelengths"), "{err}");
        let psf = read(&folder.path().join("a.exr"), None).unwrap().psf;
        assert!(psf.sum().iter().all(|sum| (sum - 1.0).abs() < 1e-5) && psf.covered < 1.0);
        let (again, _) = run(folder.path(), &["psf", "--from", "a.exr", "--out", "b.exr"], 0);
        assert_eq!(again.replace("b.exr", "a.exr"), out);
    }
    let warm =
        [&["psf", "--aperture", "circle", "--diameter-mm", "2", "--temperature", "3000", "--out", "w.exr"][..], &small]
            .concat();
    run(folder.path(), &warm, 0);
    let [red, _, blue] = read(&folder.path().join("w.exr"), None).unwrap().psf.sum();
    assert!(red > 2.0 * blue, "{red} {blue}");

    std::fs::write(folder.path().join("m.fits"), picture("-32", &[SCALE], |v| float(v - 2))).unwrap();
    let (out, err) = run(folder.path(), &["psf", "--from", "m.fits", "--out", "m.exr"], 0);
    assert!(out.contains("4 x 4 pixels of 0.2500 arcseconds"), "{out}");
    assert!(err.contains("1 negative pixels") && err.contains("1.5 px above"), "{err}");
}

#[test]
fn wrong_use_is_64_and_wrong_data_65() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("bare.fits"), picture("-32", &[], float)).unwrap();
    std::fs::write(folder.path().join("text.exr"), "not a picture").unwrap();
    let make = ["psf", "--out", "o.exr", "--aperture", "circle", "--diameter-mm", "2"];
    for (arguments, code, part) in [
        (&["psf", "--out", "o.exr"][..], 64, "--aperture"),
        (&["psf", "--aperture", "circle", "--out", "o.exr"], 64, "--diameter-mm"),
        (&["psf", "--aperture", "square", "--diameter-mm", "2", "--out", "o.exr"], 64, "hubble"),
        (&["psf", "--aperture", "circle", "--diameter-mm", "-2", "--out", "o.exr"], 64, "-2"),
        (&["psf", "--aperture", "circle", "--diameter-mm", "0", "--out", "o.exr"], 64, "diameter"),
        (&["psf", "--aperture", "circle", "--from", "x.exr", "--out", "o.exr"], 64, "cannot be used with"),
        (&["psf", "--from", "x.exr", "--size", "32", "--out", "o.exr"], 64, "cannot be used with"),
        (&[&make[..], &["--size", "1"]].concat(), 64, "size"),
        (&[&make[..], &["--pixel-arcsec", "nan"]].concat(), 64, "--pixel-arcsec"),
        (&[&make[..], &["--pixel-arcsec", "1e5"]].concat(), 64, "at most"),
        (&[&make[..], &["--wavelengths", "0"]].concat(), 64, "between 1 and 400"),
        (&[&make[..], &["--temperature", "1"]].concat(), 64, "between 500 and"),
        (&[&make[..], &["--blades", "two"]].concat(), 64, "blades"),
        (&["psf", "--from", "missing.fits", "--out", "o.exr"], 65, "missing.fits"),
        (&["psf", "--from", "text.exr", "--out", "o.exr"], 65, "neither"),
        (&["psf", "--from", "bare.fits", "--out", "o.exr"], 65, "PIXELSCL"),
        (&["psf", "--from", "bare.fits", "--pixel-arcsec", "1", "--out", "no/o.exr"], 1, "no/o.exr"),
    ] {
        let (out, err) = run(folder.path(), arguments, code);
        assert!(out.is_empty(), "{out}");
        assert!(err.contains(part), "`{part}` is not in: {err}");
    }
    assert!(!folder.path().join("o.exr").exists());
    let (help, _) = run(folder.path(), &["psf", "--help"], 0);
    assert!(help.contains("Examples") && help.contains("\n  steradian psf --from"), "{help}");
}

#[test]
fn settings_make_a_texture() {
    let white = |psf: &Psf| psf.sum().iter().all(|sum| (sum - 1.0).abs() < 1e-5);
    let settings = PsfTextureSettings::default();
    let psf = settings.texture().unwrap();
    println!("the default texture: {} pixels, {:.2} % of the light", psf.size, 100.0 * psf.covered);
    assert!(white(&psf) && psf.covered > 0.98);
    assert!((2.0 * psf.half_width_rad() / f64::to_radians(4.0) - 1.0).abs() < 1e-15);
    let unknown = PsfTextureSettings { aperture: "square".to_owned(), ..settings.clone() }.texture().unwrap_err();
    assert!(unknown.to_string().contains("square") && unknown.to_string().contains("hexagon"), "{unknown}");
    let flat = PsfTextureSettings { width_arcmin: 0.0, ..settings.clone() }.texture().unwrap_err();
    assert!(flat.to_string().contains("pixel"), "{flat}");

    // The scale in a file is used, or the configured width if the file has no scale.
    let folder = tempfile::tempdir().unwrap();
    for (cards, arcsec) in [(&[SCALE][..], 0.25), (&[], 4.0 * 3600.0 / 4.0)] {
        let file = folder.path().join("picture.fits");
        std::fs::write(&file, picture("-32", cards, float)).unwrap();
        let psf = PsfTextureSettings { file: Some(file), ..settings.clone() }.texture().unwrap();
        assert!(white(&psf) && (psf.pixel_rad / ARCSECOND_RAD / arcsec - 1.0).abs() < 1e-15, "{arcsec}");
    }
    let missing = PsfTextureSettings { file: Some("missing.fits".into()), ..settings }.texture().unwrap_err();
    assert!(matches!(missing, PsfError::Read { .. }));
}
