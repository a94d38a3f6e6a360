//! Every example configuration loads and gives a rig; every section is parsed as written; every mistake is refused with
//! a message that names the file, the key and the valid values.

mod cluster;
mod rendering;
mod view_tables;

use std::path::{Path, PathBuf};

use steradian::catalogue::epoch::Epoch;
use steradian::catalogue::galaxy::GalaxyParameters;
use steradian::config::{CatalogueConfig, Config, ConfigError};
use steradian::photometry::glare::{EyeColour, GlareKernelName};
use steradian::plan::settings::{
    AfterExit, ExposureMode, ExposureSettings, ExposureValues, GlareMethod, HeadsetSettings, Meter, Metering,
    ReferenceSpace, RenderSettings, StarMethod, SwapchainFormat, SwapchainLayout, ToneMapOperator, ToneMapSettings,
};
use steradian::plan::view_settings::{ExposureGroup, ViewSettings};
use steradian::scene::loader::{StarSource, load_stars};
use steradian::view::{Part, ViewKind};

fn examples() -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs");
    let mut files: Vec<PathBuf> = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.sort();
    files
}

fn parse(text: &str) -> Result<Config, ConfigError> {
    Config::from_text(text, "test.toml", Path::new("/sky"), &[])
}

fn parse_with(text: &str, overrides: &[&str]) -> Result<Config, ConfigError> {
    let overrides: Vec<String> = overrides.iter().map(|&text| text.to_owned()).collect();
    Config::from_text(text, "test.toml", Path::new("/sky"), &overrides)
}

/// Returns a view with these keys in addition to its name.
fn view(keys: &str) -> String {
    format!("[[views]]\nname = \"v\"\n{keys}\n")
}

/// Asserts that the text is refused with a message that contains all of these parts.
#[track_caller]
fn refused(text: &str, parts: &[&str]) {
    let message = parse(text).expect_err("the configuration is refused").to_string();
    for part in parts.iter().chain(&["test.toml"]) {
        assert!(message.contains(part), "`{part}` is not in: {message}");
    }
}

#[test]
fn every_example_loads_and_makes_a_rig_with_pixels() {
    let examples = examples();
    let names: Vec<&str> = examples.iter().map(|path| path.file_stem().unwrap().to_str().unwrap()).collect();
    for expected in [
        "asteroids",
        "calibrated",
        "cubemap",
        "demo",
        "dome",
        "equirectangular",
        "headset",
        "mission-control",
        "perspective",
        "stereo",
    ] {
        assert!(names.contains(&expected), "configs/{expected}.toml");
    }
    for path in &examples {
        assert_eq!(path.extension().unwrap(), "toml", "{}", path.display());
        let config = Config::load(path, &[]).unwrap_or_else(|error| panic!("{error}"));
        let rig = config.rig().unwrap();
        assert!(!rig.views().is_empty(), "{}", path.display());
        let camera = config.camera().unwrap();
        let pixels: u64 = rig
            .viewports(camera.world_from_camera)
            .iter()
            .map(|viewport| u64::from(viewport.size()[0]) * u64::from(viewport.size()[1]))
            .sum();
        assert!(pixels > 0 && pixels < 8_000_000, "{}: {pixels} pixels", path.display());
        assert!(!config.star_sources().is_empty());
    }
}

#[test]
fn the_demo_shows_the_four_kinds_of_views_and_the_southern_cross() {
    let path = examples().into_iter().find(|path| path.ends_with("demo.toml")).unwrap();
    let config = Config::load(&path, &[]).unwrap();
    let rig = config.rig().unwrap();
    let kinds: Vec<&str> = rig.views().iter().map(|view| view.kind.type_name()).collect();
    assert_eq!(kinds, ["dome_master", "stereo", "cubemap", "equirectangular"]);
    // Acrux and Hadar are in the picture of every view (for a cubemap, on one of its faces).
    let camera = config.camera().unwrap();
    for (ra_deg, dec_deg) in [(186.650f64, -63.099f64), (210.956, -60.373)] {
        let (sin_ra, cos_ra) = ra_deg.to_radians().sin_cos();
        let (sin_dec, cos_dec) = dec_deg.to_radians().sin_cos();
        let star = glam::DVec3::new(cos_dec * cos_ra, cos_dec * sin_ra, sin_dec);
        for (index, view) in rig.views().iter().enumerate() {
            let seen = rig.viewports(camera.world_from_camera).iter().filter(|v| v.view == index).any(|viewport| {
                let mapping = viewport.projection.mapping();
                let pixel = mapping.pixel_from_direction(viewport.world_from_view.inverse() * star);
                pixel.is_some_and(|p| p.x >= 0.0 && p.y >= 0.0 && mapping.contains(p.x as u32, p.y as u32))
            });
            assert!(seen, "{} shows no star at {ra_deg}, {dec_deg}", view.name);
        }
    }
}

#[test]
fn the_built_in_configuration_has_a_dome_and_a_window() {
    let config = Config::built_in(&["server.listen=127.0.0.1:0".to_owned()]).unwrap();
    let rig = config.rig().unwrap();
    assert!(matches!(rig.views()[0].kind, ViewKind::DomeMaster { size: 1024, .. }));
    assert!(matches!(rig.views()[1].kind, ViewKind::Perspective { .. }));
    assert_eq!(config.star_sources().len(), 2);
    assert_eq!(config.server.listen, "127.0.0.1:0");
}

#[test]
fn an_empty_file_gives_the_defaults() {
    let config = parse("").unwrap();
    assert_eq!(config.render_settings(), RenderSettings::default());
    assert_eq!(config.star_sources(), [StarSource::Bright]);
    assert_eq!(config.camera().unwrap(), steradian::scene::Camera::default());
    assert_eq!(config.server.listen, "127.0.0.1:7143");
    assert_eq!(config.scene.time.to_string(), "2026-01-01T00:00:00Z");
    assert_eq!(config.glare.inner_deg, 0.1);
    assert!(config.rig().unwrap().views().is_empty());
}

#[test]
fn an_observer_on_the_earth_sees_the_zodiacal_light() {
    let observer = "[scene.observer]\nlatitude_deg = 50\nlongitude_deg = 8\n";
    let drawn = |text: &str| parse(text).unwrap().objects().unwrap().zodiacal_light;
    assert!(drawn(observer));
    assert!(!drawn(""), "without an observer");
    assert!(!drawn(&format!("[scene]\nzodiacal_light = false\n{observer}")), "switched off");
    assert!(!drawn(&format!("[scene]\nsolar_system = false\n{observer}")), "without the Sun");
    for text in
        ["[scene]\nzodiacal_light = true", &format!("[scene]\nzodiacal_light = true\nsolar_system = false\n{observer}")]
    {
        let error = parse(text).unwrap_err().to_string();
        assert!(error.contains("scene.zodiacal_light: has no effect"), "{error}");
    }
}

#[test]
fn variable_stars_need_the_table_that_has_them() {
    let config = parse("[scene]\nvariable_stars = true").unwrap();
    assert_eq!(config.star_sources(), [StarSource::BrightVariable]);
    let error = parse("[scene]\nvariable_stars = true\ncatalogues = ['x.csv']").unwrap_err().to_string();
    assert!(error.contains("scene.variable_stars: has no effect") && error.contains("builtin:bright"), "{error}");
}

#[test]
fn scene_time_camera_and_catalogues() {
    let config = parse(
        "[scene]\ncatalogues = ['builtin:bright', 'near/x.csv', '/far/y.stars', { galaxy = { stars = 5, seed = 7, fainter_than = 6.5 } }, { galaxy = { stars = 6 } }]\n\
         time = 2031-05-06T07:08:09.5+02:00\n[scene.camera]\nposition_m = [1, 2.5, -3e20]\norientation = [0.0, 0.0, 0.70712, 0.70712]\nvelocity_c = [0, 0.5, -0.25]\n",
    )
    .unwrap();
    let galaxy = |stars, seed, fainter_than| {
        StarSource::Galaxy(GalaxyParameters { stars, seed, fainter_than, unresolved_light: true })
    };
    assert_eq!(
        config.star_sources(),
        [
            StarSource::Bright,
            StarSource::File("/sky/near/x.csv".into()),
            StarSource::File("/far/y.stars".into()),
            galaxy(5, 7, Some(6.5)),
            galaxy(6, 1, None)
        ]
    );
    assert!(matches!(&config.scene.catalogues[1], CatalogueConfig::Named(name) if name == "near/x.csv"));
    let camera = config.camera().unwrap();
    assert_eq!(camera.position_m, glam::DVec3::new(1.0, 2.5, -3e20));
    assert_eq!(camera.velocity_c, glam::DVec3::new(0.0, 0.5, -0.25));
    assert!((camera.world_from_camera.length() - 1.0).abs() < 1e-15, "normalised");
    assert_eq!(config.scene.time.to_string(), "2031-05-06T07:08:09.5+02:00");
    for (set, jd) in [
        ("scene.time=-0567-07-04T12:00:00Z julian", 1_514_146.0),
        ("scene.time=+10000-01-01T00:00:00Z", 5_373_484.5),
        ("scene.time=JD 2451545.25", 2_451_545.25),
        ("scene.time=\"JD 2451545.25\"", 2_451_545.25),
    ] {
        let config = parse_with("", &[set]).unwrap();
        assert_eq!(config.scene.time_s(), (jd - 2_451_545.0) * 86_400.0, "{set}");
        // A configuration that has been used can be used again.
        assert_eq!(parse(&config.pictured).unwrap().scene.time_s(), config.scene.time_s(), "{}", config.pictured);
    }
}

#[test]
fn mistakes_in_the_scene() {
    refused("[scene]\ncatalogs = []", &["scene.catalogs", "unknown key", "catalogues"]);
    refused("[scene]\ncatalogues = 'x.csv'", &["scene.catalogues", "a list in brackets"]);
    refused("[scene]\ncatalogues = [3]", &["scene.catalogues[0]", "builtin:bright", "galaxy"]);
    refused("[scene]\ncatalogues = ['builtin:hyg']", &["scene.catalogues[0]", "builtin:hyg", "builtin:bright"]);
    refused("[scene]\ncatalogues = ['builtin:galaxy']", &["scene.catalogues[0]", "galaxy = {"]);
    refused("[scene]\ncatalogues = ['']", &["scene.catalogues[0]", "empty"]);
    refused(
        "[scene]\ncatalogues = [{ galaxy = { stars = 'x' } }]",
        &["scene.catalogues[0].galaxy.stars", "invalid type"],
    );
    refused(
        "[scene]\ncatalogues = [{ galaxy = { seed = 1 } }]",
        &["scene.catalogues[0].galaxy", "missing key `stars`"],
    );
    refused(
        "[scene]\ncatalogues = [{ galaxy = { stars = 0 } }]",
        &["scene.catalogues[0].galaxy.stars", "0: must be between 1"],
    );
    refused(
        "[scene]\ncatalogues = [{ galaxy = { stars = 1, star = 1 } }]",
        &["scene.catalogues[0].galaxy.star", "unknown key"],
    );
    refused(
        "[scene]\ncatalogues = [{ galaxy = { stars = 1, fainter_than = nan } }]",
        &["galaxy.fainter_than", "finite"],
    );
    refused("[scene]\ncatalogues = [{ nebula = { } }]", &["scene.catalogues[0].nebula", "unknown key", "galaxy"]);
    refused("[scene]\ntime = 2026-01-01", &["scene.time", "offset", "2026-01-01T00:00:00Z"]);
    refused("[scene]\ntime = 'noon'", &["scene.time", "must be a date with time and offset", "JD 2451545.0"]);
    refused("[scene]\ntime = '2026-02-30T00:00:00Z'", &["scene.time", "day 30", "01 to 28"]);
    refused("[scene]\ntime = '-6001-01-01T00:00:00Z'", &["scene.time", "years -6000 to 10000"]);
    refused("[scene.camera]\nposition_m = [nan, 0, 0]", &["scene.camera.position_m", "finite"]);
    refused("[scene.camera]\nposition_m = [0, 0]", &["scene.camera.position_m", "invalid length 2"]);
    refused("[scene.camera]\norientation = [0, 0, 0, 1.01]", &["scene.camera.orientation", "unit quaternion"]);
    refused("[scene.camera]\norientation = [0, 0, inf, 1]", &["scene.camera.orientation", "finite"]);
    refused("[scene.camera]\nposition_m = [0, 1e26, 0]", &["scene.camera.position_m", "at most 1e25 m"]);
    refused(
        "[scene.camera]\nvelocity_c = [0.99991, 0, 0]",
        &["scene.camera.velocity_c[0]", "0.99991", "between -0.9999 and 0.9999"],
    );
    refused("[scene.camera]\nvelocity_c = [0.6, 0.8, 0]", &["scene.camera.velocity_c", "between 0 and 0.9999"]);
    refused("[scene.camera]\nvelocity_c = [nan, 0, 0]", &["scene.camera.velocity_c", "finite"]);
    refused("[scene.camera]\nheading = 3", &["scene.camera.heading", "unknown key", "orientation"]);
}

#[test]
fn every_type_of_view() {
    let text = "
        [[views]]
        name = 'flat'
        type = 'perspective'
        size = [16, 9]
        fov_y_deg = 60
        orientation = [0, 1, 0, 0]
        position_m = [1, 2, 3]
        [[views]]
        name = 'off'
        type = 'perspective'
        size = [10, 10]
        fov = { left_deg = -10, right_deg = 20, up_deg = 30, down_deg = -40 }
        [[views]]
        name = 'eyes'
        type = 'stereo'
        size = [10, 10]
        ipd_m = 0.064
        fov = { left_deg = -50, right_deg = 40, up_deg = 45, down_deg = -45 }
        [[views]]
        name = 'eyes2'
        type = 'stereo'
        size = [10, 10]
        ipd_m = 0
        fov_left = { left_deg = -50, right_deg = 40, up_deg = 45, down_deg = -45 }
        fov_right = { left_deg = -41, right_deg = 51, up_deg = 44, down_deg = -44 }
        [[views]]
        name = 'cube'
        type = 'cubemap'
        face_size = 8
        [[views]]
        name = 'some'
        type = 'cubemap'
        face_size = 8
        faces = ['up', 'front']
        [[views]]
        name = 'fish'
        type = 'fisheye'
        mapping = 'stereographic'
        fov_deg = 300
        size = [20, 10]
        [[views]]
        name = 'dome'
        type = 'dome_master'
        size = [10, 10]
        [[views]]
        name = 'map'
        type = 'equirectangular'
        size = [20, 10]
    ";
    let rig = parse(text).unwrap().rig().unwrap();
    let parts: Vec<usize> = rig.views().iter().map(|view| view.images.len()).collect();
    assert_eq!(parts, [1, 1, 2, 2, 6, 2, 1, 1, 1]);
    let view = |name: &str| &rig.views()[rig.index_of(name).unwrap()];
    assert_eq!(view("flat").images[0].eye_position_m, glam::DVec3::new(1.0, 2.0, 3.0));
    assert!(
        matches!(&view("flat").kind, ViewKind::Perspective { size: [16, 9], fov_y_rad } if (fov_y_rad - 60f64.to_radians()).abs() < 1e-15)
    );
    assert!(
        matches!(&view("off").kind, ViewKind::OffAxis { fov, .. } if (fov.down_rad + 40f64.to_radians()).abs() < 1e-15)
    );
    let ViewKind::Stereo { fov_left, fov_right, ipd_m, .. } = &view("eyes").kind else { panic!("stereo") };
    assert_eq!(*fov_right, fov_left.mirrored());
    assert_eq!(*ipd_m, 0.064);
    let ViewKind::Stereo { fov_right, .. } = &view("eyes2").kind else { panic!("stereo") };
    assert!((fov_right.right_rad - 51f64.to_radians()).abs() < 1e-15);
    assert!(matches!(view("some").images[0].part, Part::Face(face) if face.name() == "up"));
    assert!(matches!(&view("fish").kind, ViewKind::Fisheye { mapping, .. } if mapping.name() == "stereographic"));
    assert!(
        matches!(&view("dome").kind, ViewKind::DomeMaster { fov_rad, tilt_rad, .. } if *fov_rad == std::f64::consts::PI && *tilt_rad == 0.0)
    );
}

#[test]
fn mistakes_in_views() {
    refused("[[views]]\ntype = 'cubemap'", &["views[0].name", "missing key"]);
    refused("[[views]]\nname = 'v'", &["views[0].type", "view `v`", "missing key", "fisheye", "equirectangular"]);
    refused(&view("type = 'panorama'"), &["views[0].type", "panorama", "dome_master"]);
    refused(&view("type = 7"), &["views[0].type", "perspective"]);
    refused(&view("type = 'perspective'\nsize = [4, 4]\nfov_y_deg = 180"), &["views[0].fov_y_deg", "view `v`", "178"]);
    refused(&view("type = 'perspective'\nsize = [4, 4]\nfov_y_deg = nan"), &["views[0].fov_y_deg", "finite"]);
    refused(&view("type = 'perspective'\nsize = [4, 4]"), &["views[0].fov_y_deg", "exactly one"]);
    let both = "type = 'perspective'\nsize = [4, 4]\nfov_y_deg = 60\nfov = { left_deg = -1, right_deg = 1, up_deg = 1, down_deg = -1 }";
    refused(&view(both), &["views[0].fov", "exactly one of fov and fov_y_deg"]);
    refused(
        &view("type = 'perspective'\nsize = [0, 4]\nfov_y_deg = 60"),
        &["views[0].size[0]", "0: must be at least 1"],
    );
    refused(&view("type = 'perspective'\nsize = [-3, 4]\nfov_y_deg = 60"), &["views[0].size[0]", "-3"]);
    refused(&view("type = 'perspective'\nsize = 4\nfov_y_deg = 60"), &["views[0].size", "invalid type"]);
    refused(
        &view("type = 'perspective'\nsize = [4, 4]\nfov_y_deg = 60\nmapping = 'equisolid'"),
        &["views[0].mapping", "unknown key"],
    );
    // The listed keys are those of the view's type and those that all views have.
    for (kind, wrong) in [
        ("type = 'perspective'\nsize = [4, 4]\nfov_y_deg = 60", "orientaton = 1"),
        ("type = 'projector'", "test_patern = 1"),
    ] {
        let key = wrong.split(' ').next().unwrap();
        let expected = if kind.contains("projector") { "`test_pattern`" } else { "`orientation`" };
        refused(
            &view(&format!("{kind}\n{wrong}")),
            &[&format!("views[0].{key}"), "unknown key", expected, "`exposure`", "`name`"],
        );
    }
    refused(
        &view("type = 'perspective'\nsize = [4, 4]\nfov_y_deg = '60'"),
        &["views[0].fov_y_deg", "expected a number without quotation marks"],
    );
    let crossed =
        "type = 'perspective'\nsize = [4, 4]\nfov = { left_deg = 2, right_deg = 1, up_deg = 1, down_deg = -1 }";
    refused(&view(crossed), &["views[0].fov.left_deg", "smaller"]);
    refused(&view("type = 'stereo'\nsize = [4, 4]\nipd_m = 0.06"), &["views[0].fov", "fov_left and fov_right"]);
    let eyes = "type = 'stereo'\nsize = [4, 4]\nfov = { left_deg = -9, right_deg = 9, up_deg = 9, down_deg = -9 }";
    refused(&view(eyes), &["views[0]", "missing key `ipd_m`"]);
    refused(&view(&format!("{eyes}\nipd_m = -1")), &["views[0].ipd_m", "-1", "between 0 and 2e9 m"]);
    refused(&view("type = 'cubemap'\nface_size = 0"), &["views[0].face_size", "at least 1"]);
    refused(&view("type = 'cubemap'\nface_size = 4\nfaces = ['top']"), &["views[0].faces[0]", "top", "front, right"]);
    refused(&view("type = 'cubemap'\nface_size = 4\nfaces = []"), &["views[0]", "faces", "at least one"]);
    refused(&view("type = 'cubemap'\nface_size = 4\nfaces = ['up', 'up']"), &["views[0]", "faces", "twice"]);
    refused(&view("type = 'fisheye'\nsize = [4, 4]\nfov_deg = 400"), &["views[0].fov_deg", "400", "360"]);
    refused(
        &view("type = 'fisheye'\nmapping = 'orthographic'\nsize = [4, 4]\nfov_deg = 200"),
        &["views[0].fov_deg", "200", "180"],
    );
    refused(
        &view("type = 'fisheye'\nmapping = 'stereographic'\nsize = [4, 4]\nfov_deg = 360"),
        &["views[0].fov_deg", "360"],
    );
    refused(
        &view("type = 'fisheye'\nmapping = 'round'\nsize = [4, 4]\nfov_deg = 180"),
        &["views[0].mapping", "round", "equisolid"],
    );
    refused(&view("type = 'dome_master'\nsize = [4, 5]"), &["views[0].size", "square"]);
    refused(&view("type = 'dome_master'\nsize = [4, 4]\ntilt_deg = inf"), &["views[0].tilt_deg", "finite"]);
    refused(
        &view("type = 'dome_master'\nsize = [4, 4]\ntilt_deg = 1e300"),
        &["views[0].tilt_deg", "between -360 and 360"],
    );
    refused(&view("type = 'dome_master'\nsize = [4, 4, 4]"), &["views[0].size", "must be [width, height]"]);
    refused(
        &view("type = 'fisheye'\nsize = [4, 4]\nfov_deg = 9\nmapping = false"),
        &["views[0].mapping", "`equisolid`"],
    );
    let long = "a".repeat(65);
    refused(
        &format!("[[views]]\nname = '{long}'\ntype = 'equirectangular'\nsize = [4, 2]"),
        &["views[0].name", "65 characters: must have at most 64"],
    );
    refused(&view("type = 'equirectangular'\nsize = [5, 4]"), &["views[0].size[0]", "even"]);
    let map = "type = 'equirectangular'\nsize = [4, 2]";
    refused(&view(&format!("{map}\norientation = [0, 0, 0, 2]")), &["views[0].orientation", "unit quaternion"]);
    refused(&view(&format!("{map}\nposition_m = [0, nan, 0]")), &["views[0].position_m", "finite"]);
    refused(&view(&format!("{map}\nposition_m = 'here'")), &["views[0].position_m", "invalid type"]);
    refused(&format!("[[views]]\nname = 'a b'\n{map}"), &["views[0].name", "letters, digits"]);
    refused(&format!("{}{}", view(map), view(map)), &["views[1].name", "views[0]", "unique"]);
    refused("views = 3", &["views", "invalid type"]);
}

#[test]
fn the_headset_is_off_by_default_and_every_key_is_read() {
    assert_eq!(parse("").unwrap().headset, HeadsetSettings::default());
    assert!(!parse("[headset]\n").unwrap().headset.enabled);
    assert!(parse_with("", &["headset.enabled=true"]).unwrap().headset.enabled);
    let all = "[headset]\nenabled = true\nname = 'visor-1'\nswapchains = 'two'\nformat = 'rgba16f'\nresolution_scale = 4\n\
               reference_space = 'stage'\nflight_m_s = 1e12\nturn_deg_s = 0\nafter_exit = 'reconnect'\n";
    let expected = HeadsetSettings {
        enabled: true,
        name: "visor-1".to_owned(),
        swapchains: SwapchainLayout::Two,
        format: SwapchainFormat::Rgba16f,
        resolution_scale: 4.0,
        reference_space: ReferenceSpace::Stage,
        flight_m_s: 1e12,
        turn_deg_s: 0.0,
        after_exit: AfterExit::Reconnect,
    };
    assert_eq!(parse(all).unwrap().headset, expected);
    for (key, value) in [("resolution_scale", "0.1"), ("turn_deg_s", "360"), ("flight_m_s", "1e-3")] {
        assert!(parse(&format!("[headset]\n{key} = {value}")).is_ok(), "{key} = {value}");
    }
}

#[test]
fn mistakes_in_the_headset() {
    for (key, wrong, expected) in [
        ("enabled", "1", "invalid type"),
        ("name", "''", "letters, digits, `_` and `-`"),
        ("name", "'a b'", "`a b` is not a valid name"),
        ("swapchains", "'three'", "`auto`, `array`, `two`"),
        ("format", "'rgb565'", "`rgba8_srgb`"),
        ("reference_space", "'floor'", "`stage`"),
        ("after_exit", "'sleep'", "`reconnect`"),
        ("resolution_scale", "0.09", "between 0.1 and 4"),
        ("resolution_scale", "4.1", "between 0.1 and 4"),
        ("resolution_scale", "nan", "finite"),
        ("flight_m_s", "0", "above 0 and at most 1e12 m/s"),
        ("flight_m_s", "1.1e12", "above 0 and at most 1e12 m/s"),
        ("flight_m_s", "inf", "finite"),
        ("turn_deg_s", "-1", "between 0 and 360 deg/s"),
        ("turn_deg_s", "361", "between 0 and 360 deg/s"),
        ("turn_deg_s", "nan", "finite"),
        ("fov_deg", "90", "unknown key"),
    ] {
        refused(&format!("[headset]\n{key} = {wrong}"), &[&format!("headset.{key}"), expected]);
    }
}

#[test]
fn an_enabled_headset_needs_a_unique_name() {
    let twin = view("type = 'cubemap'\nface_size = 4");
    refused(
        &format!("[headset]\nenabled = true\nname = 'v'\n{twin}"),
        &["headset.name", "views[0] also has the name `v`"],
    );
    // A view may have the headset's name while the headset is disabled.
    assert!(parse(&format!("[headset]\nname = 'v'\n{twin}")).is_ok());
    let message = parse_with(&format!("[headset]\nname = 'v'\n{twin}"), &["headset.enabled=true"]).unwrap_err();
    assert!(message.to_string().contains("headset.name"), "{message}");
}

#[test]
fn syntax_errors_name_line_and_column() {
    refused("[scene]\n\ncatalogues = [\n'x' 'y']\n", &["test.toml:4:"]);
    refused("[stars]\nmethod = 'auto'\nmethod = 'tent'\n", &["test.toml:3:1", "duplicate key `method`"]);
    refused("[stars]\nmethod = auto\n", &["test.toml:2:"]);
}

#[test]
fn a_missing_file_is_named() {
    let error = Config::load(Path::new("no/such/sky.toml"), &[]).unwrap_err();
    assert!(matches!(error, ConfigError::Read { .. }));
    assert!(error.to_string().contains("no/such/sky.toml"), "{error}");
}

#[test]
fn errors_of_exposure_keys_without_effect_name_the_required_setting() {
    let config = parse("").unwrap();
    assert_eq!(config.exposure, ExposureSettings::default());
    let limiting_magnitude = 6.5;
    assert_eq!(
        config.exposure.auto_or_default().meter,
        Meter::LimitingMagnitude { limiting_magnitude, reference_arcmin: None }
    );
    let auto = "compensation_ev = 1\nmin_ev100 = -9\nmax_ev100 = 9\nadaptation_s = 1\n";
    let taken = [
        format!("mode = 'auto'\nlimiting_magnitude = 5\n{auto}"),
        format!("metering = 'limiting_magnitude'\n{auto}"),
        format!("metering = 'mean'\nkey = 0.2\n{auto}"),
        format!("metering = 'spot'\nkey = 0.2\nspot_deg = 5\n{auto}"),
        "mode = 'manual'\nev100 = -5".to_owned(),
    ];
    for text in taken {
        parse(&format!("[exposure]\n{text}")).unwrap_or_else(|error| panic!("{text}: {error}"));
    }
    // `ev100` defines the unit of the methods with relative brightness, so it has an effect.
    parse("[exposure]\nev100 = -5\n[stars]\nmethod = 'gaussian_psf'").unwrap();
    for (text, key, expected) in [
        ("ev100 = -5", "ev100", "has no effect with mode = \"auto\": leave it out, or set mode = \"manual\""),
        ("key = 0.2", "key", "metering = \"limiting_magnitude\": leave it out, or set metering = \"mean\" or \"spot\""),
        ("spot_deg = 3", "spot_deg", "metering = \"limiting_magnitude\": leave it out, or set metering = \"spot\""),
        ("metering = 'mean'\nspot_deg = 3", "spot_deg", "with metering = \"mean\""),
        ("metering = 'spot'\nlimiting_magnitude = 6", "limiting_magnitude", "with metering = \"spot\""),
        ("mode = 'manual'\nspot_deg = 3", "spot_deg", "with mode = \"manual\""),
        ("metering = 'mean'\nlimiting_magnitude = 6", "limiting_magnitude", "with metering = \"mean\""),
        ("mode = 'manual'\nmetering = 'mean'", "metering", "with mode = \"manual\""),
        ("mode = 'manual'\nlimiting_magnitude = 6", "limiting_magnitude", "with mode = \"manual\""),
        ("mode = 'manual'\nkey = 0.2", "key", "with mode = \"manual\""),
        ("mode = 'manual'\ncompensation_ev = 0", "compensation_ev", "or set mode = \"auto\""),
        ("mode = 'manual'\nmin_ev100 = 0", "min_ev100", "mode = \"manual\""),
        ("mode = 'manual'\nmax_ev100 = 0", "max_ev100", "mode = \"manual\""),
        ("mode = 'manual'\nadaptation_s = 0", "adaptation_s", "mode = \"manual\""),
    ] {
        refused(&format!("[exposure]\n{text}"), &[&format!("exposure.{key}"), expected]);
    }
    // A wrong override is refused like a wrong key in the file, and the message names it.
    let message = parse_with("", &["exposure.ev100=-5"]).unwrap_err().to_string();
    assert!(message.contains("--set exposure.ev100=-5") && message.contains("no effect"), "{message}");
}

#[test]
fn overrides_change_the_file_and_are_checked_like_it() {
    let text = view("type = 'fisheye'\nsize = [4, 4]\nfov_deg = 180");
    let overrides = ["views.v.fov_deg=210", "views.0.mapping=equisolid", "exposure.mode=manual", "exposure.ev100=4"];
    let config = parse_with(&text, &overrides).unwrap();
    assert!(matches!(&config.rig().unwrap().views()[0].kind,
        ViewKind::Fisheye { fov_rad, mapping, .. } if (fov_rad.to_degrees() - 210.0).abs() < 1e-9 && mapping.name() == "equisolid"));
    assert_eq!(config.render_settings().exposure, ExposureSettings::manual(4.0));

    for (argument, parts) in [
        ("views.v.fov_deg=400", ["views[0].fov_deg", "360"]),
        ("views.w.fov_deg=40", ["no `w`", "by name v"]),
        ("views.3.fov_deg=40", ["no `3`", "0 to 0"]),
        ("exposure.mood=dark", ["exposure.mood", "unknown key"]),
        ("exposure.ev100=dark", ["exposure.ev100", "invalid type"]),
        ("moons.io=1", ["moons", "unknown key"]),
        ("exposure.ev100", ["key=value", "exposure.ev100=2"]),
        ("scene.catalogues=[1", ["not a TOML value", "numbers"]),
    ] {
        let message = parse_with(&text, &[argument]).unwrap_err().to_string();
        for part in parts.into_iter().chain(["--set", argument]) {
            assert!(message.contains(part), "`{part}` is not in: {message}");
        }
    }
}

#[test]
fn paths_are_relative_to_the_folder_of_the_file() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("one.csv"), "ra_deg,dec_deg,v_mag\n10,20,3.0\n").unwrap();
    let path = folder.path().join("sky.toml");
    std::fs::write(&path, "[scene]\ncatalogues = ['one.csv']\n").unwrap();
    let sources = Config::load(&path, &[]).unwrap().star_sources();
    let (stars, report) = load_stars(&sources, &Epoch::default(), &mut |_| ()).unwrap();
    assert_eq!(stars.stars.len(), 1);
    assert_eq!(report.catalogues[0].rows.as_ref().unwrap().used, 1);
}
