//! Exposure, glare and tone mapping of single views and groups.

use super::*;

fn map(name: &str, keys: &str) -> String {
    format!("[[views]]\nname = '{name}'\ntype = 'equirectangular'\nsize = [8, 4]\n{keys}\n")
}

#[test]
fn views_inherit_keys_missing_from_their_tables() {
    let general = "[exposure]\nlimiting_magnitude = 5\nadaptation_s = 2\n[glare]\nfraction = 0.2\ninner_deg = 0.3\n";
    let own =
        "exposure = { limiting_magnitude = 8 }\n[views.glare]\nfraction = 0.4\n[views.tone_map]\noperator = 'srgb'";
    let text = format!("{general}{}{}{}", map("a", ""), map("b", own), map("c", "[views.tone_map]\nscotopic = 0.5\n"));
    let config = parse(&text).unwrap();
    let views = config.view_settings().unwrap();
    assert_eq!(views[0], ViewSettings::general(&config.render_settings()));
    let exposure = ExposureValues { limiting_magnitude: 8.0, adaptation_s: 2.0, ..ExposureValues::default() };
    assert_eq!(views[1].exposure, exposure.into());
    assert_eq!((views[1].glare.fraction, views[1].glare.inner_deg), (0.4, 0.3));
    assert_eq!(views[1].tone_map.operator, ToneMapOperator::Srgb);
    assert_eq!(views[1].group, ExposureGroup::OfView("b".to_owned()));
    assert_eq!((&views[2].group, views[2].tone_map.scotopic), (&ExposureGroup::General, 0.5));
    let groups = config.frame_groups().unwrap();
    assert_eq!(groups.iter().map(|group| group.views.clone()).collect::<Vec<_>>(), [[0], [2], [1]]);
    // Views without tables share one frame, which has the general settings.
    let groups = parse(&format!("{}{}", map("a", ""), map("b", ""))).unwrap().frame_groups().unwrap();
    assert_eq!((groups.len(), groups[0].rig.views().len()), (1, 2));
    // An override changes a table of a view, and creates one.
    let config = parse_with(&text, &["views.a.exposure.mode=manual", "views.b.exposure.limiting_magnitude=7"]).unwrap();
    let views = config.view_settings().unwrap();
    assert_eq!(views[0].exposure.mode(), ExposureMode::Manual);
    assert_eq!(
        views[1].exposure.auto_or_default().meter,
        Meter::LimitingMagnitude { limiting_magnitude: 7.0, reference_arcmin: None }
    );
}

#[test]
fn views_of_a_group_share_one_exposure() {
    let two = |a: &str, b: &str| {
        let in_group = |keys: &str| format!("exposure_group = 'g'\n{keys}");
        format!("{}{}{}", map("a", &in_group(a)), map("b", &in_group(b)), map("c", "exposure_group = 'h'"))
    };
    let (five, same, six) = (
        "exposure = { limiting_magnitude = 5 }",
        "exposure = { limiting_magnitude = 5.0 }",
        "exposure = { limiting_magnitude = 6 }",
    );
    for text in [two(five, ""), two("", five), two(five, same)] {
        let views = parse(&text).unwrap().view_settings().unwrap();
        let limit = |limiting_magnitude| Meter::LimitingMagnitude { limiting_magnitude, reference_arcmin: None };
        assert_eq!([0, 1].map(|view| views[view].exposure.auto_or_default().meter), [limit(5.0); 2], "{text}");
        assert_eq!([0, 1].map(|view| views[view].group.clone()), [0, 1].map(|_| ExposureGroup::Named("g".to_owned())));
        assert_eq!(views[2].group, ExposureGroup::Named("h".to_owned()));
        assert_eq!(views[2].exposure.auto_or_default().meter, limit(6.5));
    }
    let both = ["views[1].exposure (view `b`)", "`g`", "views[0] (view `a`)", "another exposure_group"];
    refused(&two(five, six), &both);
    refused(&map("a", "exposure_group = 'a b'"), &["views[0].exposure_group (view `a`)", "letters, digits"]);
}

#[test]
fn mistakes_in_the_tables_of_views_are_refused_like_general_ones() {
    for (keys, parts) in [
        ("exposure = { iso = 100 }", &["views[0].exposure.iso (view `a`)", "unknown key", "spot_deg"][..]),
        ("exposure = { key = 0.2 }", &["views[0].exposure.key (view `a`)", "has no effect with metering"]),
        ("exposure = { mode = 'manual', adaptation_s = 1 }", &["views[0].exposure.adaptation_s", "mode = \"manual\""]),
        ("exposure = { limiting_magnitude = 31 }", &["views[0].exposure.limiting_magnitude", "between -10 and 30"]),
        ("exposure = { min_ev100 = 30 }", &["views[0].exposure.min_ev100", "max_ev100 = 24"]),
        ("exposure = 3", &["views[0].exposure", "invalid type"]),
        ("glare = { fraction = 2 }", &["views[0].glare.fraction", "between 0 and 1"]),
        ("glare = { kernel = 'psf' }", &["views[0].glare.psf_file", "missing key"]),
        (
            "tone_map = { operator = 'calibrated', black_cd_m2 = 60 }",
            &["views[0].tone_map.black_cd_m2", "half of peak_cd_m2"],
        ),
        (
            "tone_map = { white = 4 }",
            &["views[0].tone_map.white (view `a`)", "has no effect with operator = \"filmic\""],
        ),
        ("glare = { method = 'none', fraction = 0.2 }", &["views[0].glare.fraction", "method = \"none\""]),
        ("glare = { age_years = 20 }", &["views[0].glare.age_years", "set kernel = \"cie\""]),
        ("tone_map = { gamma = 2 }", &["views[0].tone_map.gamma", "unknown key"]),
        ("stars = { method = 'tent' }", &["views[0].stars", "unknown key"]),
    ] {
        refused(&map("a", keys), parts);
    }
    // An inherited key without effect is not an error of the view.
    let manual = map("a", "exposure = { mode = 'manual', ev100 = 1 }");
    assert!(parse(&format!("[exposure]\nlimiting_magnitude = 5\n{manual}")).is_ok());
    // A path in a view's table is relative to the folder, and so is a path that the view inherits.
    let file = map("a", "glare = { kernel = 'psf', psf_file = 'eye.csv' }");
    let inherited =
        format!("[glare]\nkernel = 'psf'\npsf_file = 'eye.csv'\n{}", map("a", "glare = { fraction = 0.3 }"));
    for text in [file, inherited] {
        let views = parse(&text).unwrap().view_settings().unwrap();
        assert_eq!(views[0].glare.psf_file.as_deref(), Some(Path::new("/sky/eye.csv")), "{text}");
    }
}

#[test]
fn an_override_of_the_mode_drops_the_files_keys_for_the_other_mode() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/mission-control.toml");
    let load = |set: &[&str]| Config::load(&path, &set.iter().map(|set| (*set).to_owned()).collect::<Vec<_>>());
    for (set, mode, metering) in [
        (&["exposure.mode=manual"][..], ExposureMode::Manual, Metering::LimitingMagnitude),
        (&["exposure.mode=manual", "exposure.ev100=-4"], ExposureMode::Manual, Metering::LimitingMagnitude),
        (&["exposure.metering=mean", "exposure.key=0.2"], ExposureMode::Auto, Metering::Mean),
        (&["exposure.metering=spot"], ExposureMode::Auto, Metering::Spot),
    ] {
        let exposure = load(set).unwrap_or_else(|error| panic!("{set:?}: {error}")).exposure;
        assert_eq!((exposure.mode(), exposure.auto_or_default().metering()), (mode, metering), "{set:?}");
    }
    // A key of an override that has no effect is refused.
    for (set, parts) in [
        (&["exposure.mode=manual", "exposure.limiting_magnitude=5"][..], ["exposure.limiting_magnitude", "--set"]),
        (&["exposure.metering=mean", "exposure.spot_deg=5"], ["exposure.spot_deg", "--set"]),
        (&["exposure.ev100=-4"], ["exposure.ev100", "has no effect with mode = \"auto\""]),
    ] {
        let message = load(set).unwrap_err().to_string();
        assert!(parts.iter().all(|part| message.contains(part)), "{message}");
    }
    // Overrides of the mode also drop keys in the tables of views, even if the general mode changes. A file without
    // overrides is refused as before.
    let text = map("a", "exposure = { limiting_magnitude = 5 }");
    for set in ["views.a.exposure.mode=manual", "exposure.mode=manual", "views.a.exposure.metering=mean"] {
        assert!(parse_with(&text, &[set]).is_ok(), "{set}");
    }
    refused(&format!("[exposure]\nmode = 'manual'\n{text}"), &["views[0].exposure.limiting_magnitude", "no effect"]);
}

#[test]
fn general_keys_have_an_effect_if_a_view_uses_them() {
    let general = "[tone_map]\npeak_cd_m2 = 12\n[glare]\nmethod = 'none'\nfraction = 0.2\n";
    let own = "[views.tone_map]\noperator = 'calibrated'\n[views.glare]\nmethod = 'auto'";
    let views = parse(&format!("{general}{}{}", map("a", ""), map("b", own))).unwrap().view_settings().unwrap();
    assert_eq!((views[1].tone_map.peak_cd_m2, views[1].glare.fraction), (12.0, 0.2));
    refused(&format!("{general}{}", map("a", "")), &["glare.fraction", "has no effect"]);
    // The key has no effect, because the only view that would use it sets its own value.
    let own = "[views.tone_map]\noperator = 'calibrated'\npeak_cd_m2 = 5";
    refused(&format!("[tone_map]\npeak_cd_m2 = 12\n{}", map("a", own)), &["tone_map.peak_cd_m2", "has no effect"]);
}

#[test]
fn an_override_of_operator_or_method_drops_the_files_keys_for_the_other_one() {
    let general = "[tone_map]\noperator = 'calibrated'\npeak_cd_m2 = 12\n[glare]\nkernel = 'cie'\nage_years = 60\n";
    let text = format!("{general}{}", map("a", "glare = { eye_colour = 'light' }\ntone_map = { black_cd_m2 = 1 }"));
    parse(&text).unwrap();
    for set in [
        &["tone_map.operator=srgb"][..],
        &["glare.method=none", "tone_map.operator=reinhard", "tone_map.white=4"],
        &["glare.kernel=gaussians"],
        &["views.a.glare.kernel=gaussians", "views.a.tone_map.operator=srgb"],
    ] {
        let views = parse_with(&text, set).unwrap_or_else(|error| panic!("{set:?}: {error}")).view_settings().unwrap();
        assert_eq!(views.len(), 1);
    }
    for (set, parts) in [
        (&["tone_map.operator=srgb", "tone_map.peak_cd_m2=5"][..], ["tone_map.peak_cd_m2: has no effect", "--set"]),
        (&["glare.method=none", "glare.fraction=0.3"], ["glare.fraction: has no effect", "--set"]),
        (&["tone_map.white=4"], ["tone_map.white: has no effect with operator = \"calibrated\"", "--set"]),
    ] {
        let message = parse_with(&text, set).unwrap_err().to_string();
        assert!(parts.iter().all(|part| message.contains(part)), "{message}");
    }
    // The peak that README sets has an effect in the example.
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/calibrated.toml");
    assert_eq!(Config::load(&path, &["tone_map.peak_cd_m2=12.0".to_owned()]).unwrap().tone_map.peak_cd_m2, 12.0);
}
