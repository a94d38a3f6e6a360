//! The sections that define how frames are drawn.

use super::*;

#[test]
fn sections_of_rendering() {
    let config = parse(
        "[stars]\nmethod = 'tent'\nmagnitude_limit = 8\n[glare]\nmethod = 'sky_cube'\nkernel = 'cie'\ninner_deg = 0.5\nfraction = 0.2\n\
         [exposure]\nmode = 'manual'\nev100 = 2\n[tone_map]\noperator = 'calibrated'\n\
         peak_cd_m2 = 12\nblack_cd_m2 = 0.01\ndesaturation = 0.5\nscotopic = 0.25\ndither = false\n[accuracy]\nflux = 1e-2\ncentroid_px = 0.1\nflicker = 0.5\n\
         [server]\nlisten = '[::1]:99'\n",
    )
    .unwrap();
    let settings = config.render_settings();
    assert_eq!((settings.stars.method, settings.stars.magnitude_limit), (StarMethod::Tent, 8.0));
    assert_eq!(settings.glare.method, GlareMethod::SkyCube);
    assert_eq!((config.glare.kernel, config.glare.inner_deg, config.glare.fraction), (GlareKernelName::Cie, 0.5, 0.2));
    assert_eq!(settings.exposure, ExposureSettings::manual(2.0));
    let expected = ToneMapSettings {
        operator: ToneMapOperator::Calibrated,
        peak_cd_m2: 12.0,
        black_cd_m2: 0.01,
        desaturation: 0.5,
        scotopic: 0.25,
        dither: false,
        ..ToneMapSettings::default()
    };
    assert_eq!(settings.tone_map, expected);
    for operator in ToneMapOperator::ALL {
        let config = parse(&format!("[tone_map]\noperator = '{}'", operator.name())).unwrap();
        assert_eq!(config.tone_map, ToneMapSettings::of(operator));
    }
    assert_eq!((settings.accuracy.flux, settings.accuracy.centroid_px, settings.accuracy.flicker), (1e-2, 0.1, 0.5));
    assert_eq!(config.server.listen, "[::1]:99");
}

#[test]
fn the_eye_and_the_table_of_glare() {
    let glare =
        parse("[glare]\nkernel = 'cie'\nage_years = 20\neye_colour = 'very_light'\nabsolute = true").unwrap().glare;
    assert_eq!((glare.age_years, glare.eye_colour, glare.absolute), (20.0, EyeColour::VeryLight, true));
    assert!((glare.fraction_scattered() - glare.fraction).abs() > 0.1);
    // A path is relative to the folder of the file, unless it is absolute.
    let file = |path| parse(&format!("[glare]\nkernel = 'psf'\npsf_file = '{path}'")).unwrap().glare.psf_file.unwrap();
    assert_eq!(file("eyes/mine.csv"), Path::new("/sky/eyes/mine.csv"));
    assert_eq!(file("/eyes/mine.csv"), Path::new("/eyes/mine.csv"));
}

#[test]
fn mistakes_in_the_sections() {
    refused("[[moons]]\nname = 'Io'", &["moons", "unknown key", "bodies"]);
    refused("[stars]\nmethod = 'dots'", &["stars.method", "dots", "bspline"]);
    refused("[stars]\nmagnitude_limit = inf", &["stars.magnitude_limit", "finite"]);
    refused("[stars]\nmagnitude_limit = 'all'", &["stars.magnitude_limit", "invalid type"]);
    for (table, key, wrong, expected) in [
        ("billboard", "diameter_arcmin", "0", "above 0 and at most 1800"),
        ("billboard", "diameter_arcmin", "1801", "above 0 and at most 1800"),
        ("billboard", "screen_size_px", "-3", "above 0 and at most 1024"),
        ("billboard", "brightest_magnitude", "15", "faintest_magnitude"),
        ("billboard", "faintest_magnitude", "101", "between -100 and 100"),
        ("gaussian_psf", "saturation_magnitude", "7", "limiting_magnitude"),
        ("gaussian_psf", "limiting_magnitude", "nan", "finite"),
        ("gaussian_psf", "sigma2_px2", "0.001", "between 0.01 and 10000"),
        ("gaussian_psf", "glare_sigma2_px2", "20000", "between 0.01 and 10000"),
        ("gaussian_psf", "glare_brightness", "1.5", "between 0 and 1"),
        ("pixel_gaussian", "sigma_px", "0.69", "between 0.7 and 64"),
        ("pixel_gaussian", "sigma_px", "-1", "between 0.7 and 64"),
        ("pixel_gaussian", "sigma_px", "64.1", "between 0.7 and 64"),
        ("pixel_gaussian", "sigma_px", "nan", "finite"),
        ("pixel_gaussian", "sigma_arcmin", "0", "above 0 and at most 600"),
        ("pixel_gaussian", "sigma_arcmin", "601", "above 0 and at most 600"),
        ("pixel_gaussian", "sigma_arcmin", "inf", "finite"),
        ("psf_texture", "width_arcmin", "0", "above 0 and at most 1200"),
        ("psf_texture", "width_arcmin", "1201", "above 0 and at most 1200"),
        ("psf_texture", "aperture", "'square'", "circle, hexagon, curved_blades, jwst, hubble"),
        ("psf_texture", "diameter_mm", "0", "between 0.01 and 100000"),
        ("psf_texture", "diameter_mm", "nan", "finite"),
        ("psf_texture", "diameter_mm", "500", "mm at width_arcmin = 240"),
        ("psf_texture", "file", "3", "invalid type"),
        ("cell_sky", "cells", "0", "between 1 and 65535"),
        ("cell_sky", "cells", "65536", "between 1 and 65535"),
        ("cell_sky", "layers", "0", "between 1 and 64"),
        ("cell_sky", "layers", "65", "between 1 and 64"),
        ("cell_sky", "radius_px", "0", "above 0 and at most 1024"),
        ("cell_sky", "radius_px", "inf", "finite"),
        ("cell_sky", "seed", "-1", "invalid value"),
        ("cell_sky", "seed", "4294967296", "expected a whole number from 0 to 4294967295"),
    ] {
        refused(&format!("[stars.{table}]\n{key} = {wrong}"), &[&format!("stars.{table}.{key}"), expected]);
    }
    assert!(parse("[stars.gaussian_psf]\nglare_brightness = 0\n[stars.billboard]\ndiameter_arcmin = 1800").is_ok());
    assert!(parse("[stars.pixel_gaussian]\nsigma_px = 64\nsigma_arcmin = 600").is_ok());
    assert!(parse("[stars.cell_sky]\ncells = 65535\nlayers = 64\nradius_px = 1024").is_ok());
    assert!(parse("[stars.psf_texture]\naperture = 'jwst'\ndiameter_mm = 0.5\nwidth_arcmin = 1200").is_ok());
    // Keys of the computed texture are not checked if a file is given.
    assert!(parse("[stars.psf_texture]\nfile = 'star.exr'\ndiameter_mm = 500").is_ok());
    refused("[glare]\nmethod = 'pyramid'", &["glare.method", "pyramid", "none"]);
    refused("[glare]\nkernel = 'wide'", &["glare.kernel", "inverse_square"]);
    refused("[glare]\ninner_deg = 0", &["glare.inner_deg", "above 0"]);
    refused("[glare]\nfraction = 1.5", &["glare.fraction", "between 0 and 1"]);
    refused("[glare]\nfraction = nan", &["glare.fraction"]);
    refused("[glare]\nage_years = 121", &["glare.age_years", "between 0 and 120"]);
    refused("[glare]\nage_years = 60", &["glare.age_years", "has no effect with kernel = \"inverse_square\""]);
    refused("[glare]\nmethod = 'none'\nfraction = 0.2", &["glare.fraction", "has no effect with method = \"none\""]);
    refused("[glare]\nkernel = false", &["glare.kernel", "false", "`inverse_square`, `gaussians`, `cie`, `psf`"]);
    refused("[glare]\nage_years = -1", &["glare.age_years", "between 0 and 120"]);
    refused("[glare]\nage_years = nan", &["glare.age_years", "finite"]);
    refused("[glare]\neye_colour = 'green'", &["glare.eye_colour", "green", "very_light"]);
    refused("[glare]\nkernel = 'psf'", &["glare.psf_file", "missing key", "theta_deg,per_sr"]);
    refused("[glare]\nkernel = 'psf'\npsf_file = 3", &["glare.psf_file", "invalid type"]);
    refused("[glare]\nabsolute = 1", &["glare.absolute", "invalid type"]);
    refused("[glare]\nabsolute = true", &["glare.absolute", "cie"]);
    let old = "[glare]\nkernel = 'cie'\nage_years = 120\n";
    refused(&format!("{old}absolute = true"), &["glare.absolute", "age_years = 120", "at most 1"]);
    assert!(parse(old).is_ok() && parse(&format!("{old}absolute = true\ninner_deg = 30")).is_ok());
    refused("[exposure]\nmode = 'night'", &["exposure.mode", "manual"]);
    refused("[exposure]\nev100 = nan", &["exposure.ev100", "finite"]);
    refused("[exposure]\nev100 = 300", &["exposure.ev100", "between -100 and 100"]);
    refused("[exposure]\nmin_ev100 = 5\nmax_ev100 = 4", &["exposure.min_ev100", "max_ev100 = 4"]);
    refused("[exposure]\nadaptation_s = -1", &["exposure.adaptation_s", "at least 0 s"]);
    refused("[exposure]\niso = 100", &["exposure.iso", "unknown key", "ev100"]);
    for key in ["0", "1e-7", "1.01", "-0.1"] {
        refused(&format!("[exposure]\nkey = {key}"), &["exposure.key", "between 0.000001 and 1 of display white"]);
    }
    refused("[exposure]\nkey = nan", &["exposure.key", "finite"]);
    for key in ["1", "1e-6"] {
        let config = parse(&format!("[exposure]\nmetering = 'mean'\nkey = {key}\n")).unwrap();
        assert_eq!(config.exposure.auto_or_default().key(), key.parse::<f64>().unwrap());
    }
    refused("[exposure]\nmetering = 'median'", &["exposure.metering", "limiting_magnitude", "mean", "spot"]);
    refused("[exposure]\nmetering = 'spot'\nspot_deg = 0.04", &["exposure.spot_deg", "between 0.05 and 90 degrees"]);
    refused("[exposure]\nlimiting_magnitude = 31", &["exposure.limiting_magnitude", "between -10 and 30"]);
    refused("[tone_map]\noperator = 'hable'", &["tone_map.operator", "filmic", "reinhard", "calibrated"]);
    refused("[tone_map]\ngamma = 2.2", &["tone_map.gamma", "unknown key", "peak_cd_m2"]);
    refused("[tone_map]\ndither = 1", &["tone_map.dither", "invalid type"]);
    for (key, wrong, expected) in [
        ("white", "0.99", "between 1 and 1000000 times display white"),
        ("white", "inf", "finite"),
        ("peak_cd_m2", "0", "above 0 and at most 1000000 cd/m^2"),
        ("peak_cd_m2", "1e7", "above 0 and at most 1000000 cd/m^2"),
        ("black_cd_m2", "-0.1", "between 0 and 500000 cd/m^2"),
        (
            "black_cd_m2",
            "0.1",
            "has no effect with operator = \"filmic\": leave it out, or set operator = \"calibrated\"",
        ),
        ("peak_cd_m2", "12", "has no effect with operator = \"filmic\""),
        ("white", "4", "has no effect with operator = \"filmic\": leave it out, or set operator = \"reinhard\""),
        ("black_cd_m2", "nan", "finite"),
        ("desaturation", "1.1", "between 0 and 1"),
        ("desaturation", "-0.1", "between 0 and 1"),
        ("scotopic", "2", "between 0 and 1"),
        ("scotopic", "nan", "finite"),
    ] {
        refused(&format!("[tone_map]\n{key} = {wrong}"), &[&format!("tone_map.{key}"), expected]);
    }
    let calibrated = "[tone_map]\noperator = 'calibrated'\n";
    refused(&format!("{calibrated}black_cd_m2 = 50.1"), &["tone_map.black_cd_m2", "half of peak_cd_m2 = 100"]);
    let widest = "peak_cd_m2 = 1e6\nblack_cd_m2 = 5e5\ndesaturation = 1\nscotopic = 1\ndither = false";
    assert!(parse(&format!("{calibrated}{widest}")).is_ok());
    assert!(parse("[tone_map]\noperator = 'reinhard'\nwhite = 1").is_ok());
    let place = "[scene.observer]\nlatitude_deg = 50\nlongitude_deg = 8\n[scene.observer.ground]\n";
    refused(
        &format!("{place}landscape_azimuth_deg = 90"),
        &["scene.observer.ground.landscape_azimuth_deg", "has no effect without a landscape"],
    );
    assert!(parse(&format!("{place}landscape_azimuth_deg = 90\nlandscape = 'hills.png'")).is_ok());
    for value in ["1e300", "30.1", "-31"] {
        refused(&format!("[exposure]\ncompensation_ev = {value}"), &["exposure.compensation_ev", "between -30 and 30"]);
    }
    refused("[accuracy]\nflux = 0", &["accuracy.flux", "above 0"]);
    refused("[accuracy]\nhdr_floor_cd_m2 = 1e-3", &["accuracy.hdr_floor_cd_m2", "has no effect with hdr = 0"]);
    assert!(parse("[accuracy]\nhdr = 0.01\nhdr_floor_cd_m2 = 1e-3").is_ok());
    for (key, most) in [("flux", "1"), ("centroid_px", "10"), ("flicker", "1")] {
        let allowed = format!("above 0 and at most {most}");
        for value in ["1e30", "-1", &format!("{most}.001")] {
            refused(&format!("[accuracy]\n{key} = {value}"), &[&format!("accuracy.{key}"), &allowed]);
        }
        assert!(parse(&format!("[accuracy]\n{key} = {most}")).is_ok());
    }
    for value in [-30, 30] {
        assert!(parse(&format!("[exposure]\ncompensation_ev = {value}")).is_ok());
    }
    for listen in ["everywhere", ":7143", "localhost:http", "localhost:70000", "::1:7143"] {
        refused(&format!("[server]\nlisten = '{listen}'"), &["server.listen", listen, "127.0.0.1:7143"]);
    }
}
