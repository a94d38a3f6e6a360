//! Views that are changed, created, deleted and saved.

#![allow(clippy::unwrap_used, reason = "a test may panic on unexpected values")]

use super::*;
use crate::{
    config::ViewKindSpec,
    plan::{
        settings::{ExposureMode, ExposureSettings, ExposureValues, Metering, StarMethod, StarSettings},
        view_settings::ExposureGroup,
    },
};

fn limit(limiting_magnitude: f64) -> ExposureSettings {
    ExposureValues { limiting_magnitude, ..ExposureValues::default() }.into()
}

fn exposure(text: &str) -> ExposureKeys {
    toml::from_str(text).unwrap()
}

fn exposed(text: &str) -> ViewUpdate {
    ViewUpdate { exposure: SettingsChange::set(exposure(text)), ..ViewUpdate::default() }
}

fn fraction(fraction: f64) -> GlareKeys {
    GlareKeys { fraction: Some(fraction), ..GlareKeys::default() }
}

fn given(text: &str) -> (ViewSpec, View) {
    ViewSpec::from_toml(text).unwrap()
}

fn fisheye(name: &str, fov_deg: f64) -> (ViewSpec, View) {
    given(&format!("name = '{name}'\ntype = 'fisheye'\nsize = [8, 8]\nfov_deg = {fov_deg:?}"))
}

/// Returns three views with these groups and exposures.
fn views(own: &[(Option<&str>, &str)]) -> ViewSet {
    let view = |(index, name): (usize, &str)| {
        let (spec, view) = fisheye(name, 180.0);
        let (group, keys) = own.get(index).copied().unwrap_or_default();
        let exposure = (!keys.is_empty()).then(|| exposure(keys));
        (ViewSpec { exposure_group: group.map(str::to_owned), exposure, ..spec }, view)
    };
    let views = ["a", "b", "c"].into_iter().enumerate().map(view).collect();
    ViewSet::new(&RenderSettings::default(), views, Path::new("")).unwrap()
}

fn changed(views: &ViewSet, view: usize, update: ViewUpdate) -> Result<ViewSet, String> {
    views.changed(&RenderSettings::default(), view, &update)
}

fn with(views: &ViewSet, (spec, view): (ViewSpec, View)) -> Result<ViewSet, String> {
    views.with(&RenderSettings::default(), spec, view)
}

#[test]
fn a_change_affects_one_view_and_other_keys_are_inherited() {
    let before = views(&[]);
    assert!(before.settings.iter().all(|view| view.group == ExposureGroup::General));
    let update = ViewUpdate { glare: SettingsChange::set(fraction(0.25)), ..exposed("limiting_magnitude = 8.0") };
    let after = changed(&before, 1, update).unwrap();
    assert_eq!(after.settings[1].glare.fraction, 0.25);
    assert_eq!(after.settings[1].exposure, limit(8.0));
    assert_eq!(after.settings[1].group, ExposureGroup::OfView("b".to_owned()));
    assert_eq!([&after.settings[0], &after.settings[2]], [&before.settings[0], &before.settings[2]]);
    assert_eq!(after.own_keys(1), ["exposure.limiting_magnitude", "glare.fraction"]);
    // Both ways to restore the general settings.
    let reset = ViewUpdate {
        exposure: SettingsChange::Replace(ExposureKeys::default()),
        glare: SettingsChange::Edit { set: GlareKeys::default(), clear: vec!["fraction".to_owned()] },
        ..Default::default()
    };
    assert_eq!(changed(&after, 1, reset).unwrap().settings, before.settings);
}

#[test]
fn any_view_of_a_group_changes_the_shared_exposure() {
    let join = |group: &str| ViewUpdate { exposure_group: Some(group.to_owned()), ..Default::default() };
    let before = views(&[]);
    let manual = ViewUpdate { exposure: exposed("mode = 'manual'\nev100 = 2.0").exposure, ..join("g") };
    let named = changed(&before, 0, manual).unwrap();
    let both = changed(&named, 2, join("g")).unwrap();
    assert_eq!((both.settings[2].exposure, both.group_of(2)), (both.settings[0].exposure, "g"));
    let brighter = changed(&both, 2, exposed("ev100 = 1.0")).unwrap();
    assert_eq!([0, 2].map(|view| brighter.settings[view].exposure), [ExposureSettings::manual(1.0); 2]);
    assert_eq!(brighter.settings[1], before.settings[1]);
    // A view that leaves a group loses the exposure of the group, and the group stays unchanged.
    let left = changed(&brighter, 0, join("")).unwrap();
    assert_eq!(left.settings[0], before.settings[0]);
    assert_eq!(left.settings[2].exposure, ExposureSettings::manual(1.0));
    assert_eq!(changed(&left, 2, join("")).unwrap().settings, before.settings);
    assert!(changed(&before, 0, join("a b")).unwrap_err().contains("exposure_group"));
}

#[test]
fn a_new_mode_drops_useless_keys_but_refuses_requested_ones() {
    let before = views(&[(None, "limiting_magnitude = 5.0\nadaptation_s = 0.0")]);
    let mean = changed(&before, 0, exposed("metering = 'mean'")).unwrap();
    assert_eq!(mean.settings[0].exposure.auto_or_default().metering(), Metering::Mean);
    assert_eq!(mean.own_keys(0), ["exposure.adaptation_s", "exposure.metering"]);
    let manual = changed(&mean, 0, exposed("mode = 'manual'")).unwrap();
    assert_eq!(manual.settings[0].exposure.mode(), ExposureMode::Manual);
    let problem = changed(&before, 0, exposed("mode = 'manual'\nkey = 0.2")).unwrap_err();
    assert!(problem.starts_with("exposure.key: has no effect with mode = \"manual\""), "{problem}");
    let problem = changed(&before, 0, exposed("spot_deg = 5.0")).unwrap_err();
    assert!(problem.starts_with("exposure.spot_deg: has no effect"), "{problem}");
    let glaring = ViewUpdate { glare: SettingsChange::set(fraction(2.0)), ..Default::default() };
    let problem = changed(&before, 0, glaring).unwrap_err();
    assert!(problem.starts_with("glare.fraction: 2: must be between 0 and 1"), "{problem}");
}

fn clear<K: PartialSettings>(key: &str) -> SettingsChange<K> {
    SettingsChange::Edit { set: K::default(), clear: vec![key.to_owned()] }
}

#[test]
fn a_new_method_drops_useless_keys_but_refuses_requested_ones() {
    let before = views(&[]);
    let glare =
        |text: &str| ViewUpdate { glare: SettingsChange::set(toml::from_str(text).unwrap()), ..ViewUpdate::default() };
    let tone_map = |text: &str| ViewUpdate {
        tone_map: SettingsChange::set(toml::from_str(text).unwrap()),
        ..ViewUpdate::default()
    };
    let cie = changed(&before, 0, glare("kernel = 'cie'\nage_years = 60.0\nfraction = 0.2")).unwrap();
    let gaussians = changed(&cie, 0, glare("kernel = 'gaussians'")).unwrap();
    assert_eq!(gaussians.own_keys(0), ["glare.fraction", "glare.kernel"]);
    assert_eq!(changed(&cie, 0, glare("method = 'none'")).unwrap().own_keys(0), ["glare.method"]);
    // The general kernel applies again, and the keys that belonged to the view's own kernel lose their effect.
    let update = ViewUpdate { glare: clear("kernel"), ..ViewUpdate::default() };
    assert_eq!(changed(&cie, 0, update).unwrap().own_keys(0), ["glare.fraction"]);
    let absolute = changed(&cie, 0, glare("absolute = true")).unwrap();
    assert_eq!(absolute.own_keys(0), ["glare.absolute", "glare.age_years", "glare.kernel"]);
    let display = changed(&before, 1, tone_map("operator = 'calibrated'\npeak_cd_m2 = 12.0")).unwrap();
    assert_eq!(changed(&display, 1, tone_map("operator = 'aces'")).unwrap().own_keys(1), ["tone_map.operator"]);
    let update = ViewUpdate { tone_map: clear("operator"), ..ViewUpdate::default() };
    assert_eq!(changed(&display, 1, update).unwrap().settings, before.settings);
    for (update, expected) in [
        (tone_map("peak_cd_m2 = 12.0"), "tone_map.peak_cd_m2: has no effect with operator = \"filmic\""),
        (tone_map("operator = 'aces'\nwhite = 4.0"), "tone_map.white: has no effect with operator = \"aces\""),
        (glare("method = 'none'\nfraction = 0.2"), "glare.fraction: has no effect with method = \"none\""),
        (glare("age_years = 20.0"), "glare.age_years: has no effect with kernel = \"inverse_square\""),
    ] {
        let problem = changed(&before, 0, update).unwrap_err();
        assert!(problem.starts_with(expected), "{problem}");
    }
    // Keys that have lost their effect since they were saved must be left out.
    let mut kept: Vec<ViewSpec> = before.kept().collect();
    kept[0].tone_map = Some(toml::from_str("white = 4.0\nscotopic = 0.5").unwrap());
    let restored = before.restored(&RenderSettings::default(), kept, &[]).unwrap();
    assert_eq!(restored.own_keys(0), ["tone_map.scotopic"]);
}

#[test]
fn a_key_that_another_star_method_made_useless_stops_no_other_change() {
    let relative = RenderSettings {
        stars: StarSettings { method: StarMethod::GaussianPsf, ..Default::default() },
        ..RenderSettings::default()
    };
    let before = views(&[]).changed(&relative, 0, &exposed("ev100 = -5.0")).unwrap();
    let update = ViewUpdate { glare: SettingsChange::set(fraction(0.2)), ..ViewUpdate::default() };
    let after = changed(&before, 1, update).unwrap();
    assert_eq!((after.own_keys(0).len(), after.own_keys(1)), (0, vec!["glare.fraction".to_owned()]));
}

const FLAT: &str = "name = 'flat'\ntype = 'perspective'\nsize = [8, 6]\nfov_y_deg = 60.0";

#[test]
fn views_keep_their_identity_when_others_are_added_or_deleted() {
    let general = RenderSettings::default();
    let before = views(&[]);
    let ids = before.ids().to_vec();
    let after = with(&before.without(&general, 0).unwrap(), given(FLAT)).unwrap();
    assert_eq!(after.names().collect::<Vec<_>>(), ["b", "c", "flat"]);
    assert_eq!(after.ids()[..2], ids[1..]);
    assert_eq!((after.index_of(ids[0]), after.index_of(ids[1])), (None, Some(0)));
    assert_eq!([after.settings.len(), after.rig().views().len()], [3, 3]);
    assert_eq!((after.pixels_of(2), after.pixels()), (48, 48 + 2 * 64));
    // A new view of the same name has a new identity.
    let again = with(&after, given("name = 'a'\ntype = 'equirectangular'\nsize = [4, 2]")).unwrap();
    assert!(!ids.contains(&again.named("a").unwrap().0));
    assert!(with(&again, given(FLAT)).unwrap_err().contains("used twice"));
    let none = (0..3).fold(before, |views, _| views.without(&general, 0).unwrap());
    assert_eq!((none.ids().len(), none.pixels(), none.frame_groups(&general).len()), (0, 0, 0));
}

#[test]
fn a_group_keeps_its_exposure_without_its_first_view_and_ends_with_its_last() {
    let general = RenderSettings::default();
    let before = views(&[(Some("g"), "limiting_magnitude = 8.0"), (Some("g"), "")]);
    let after = before.without(&general, 0).unwrap();
    assert_eq!(after.settings[0].exposure, limit(8.0));
    assert_eq!(after.spec(0).exposure, Some(exposure("limiting_magnitude = 8.0")));
    let joined = |keys: Option<&str>| {
        let (spec, view) = given(FLAT);
        (ViewSpec { exposure_group: Some("g".to_owned()), exposure: keys.map(exposure), ..spec }, view)
    };
    let three = with(&after, joined(None)).unwrap();
    assert_eq!(three.settings[2].exposure, limit(8.0));
    let problem = with(&after, joined(Some("limiting_magnitude = 5.0"))).unwrap_err();
    assert!(problem.starts_with("definition.exposure: exposure_group `g` already has the exposure of"), "{problem}");
    let without =
        (0..2).fold(three, |views, _| views.without(&general, views.named("b").map_or(1, |(_, b)| b)).unwrap());
    assert!(without.groups.is_empty());
    assert_eq!(with(&without, joined(None)).unwrap().settings[1].exposure, limit(6.5));
}

#[test]
fn geometry_changes_alone_or_with_the_whole_view_and_errors_name_the_key() {
    let general = RenderSettings::default();
    let before = views(&[(None, "limiting_magnitude = 8.0")]);
    let geometry = |spec: &ViewSpec| ViewUpdate { geometry: Some(spec.geometry.clone()), ..ViewUpdate::default() };
    let wide = given("name = 'b'\ntype = 'fisheye'\nsize = [16, 8]\nfov_deg = 200.0").0;
    let after = changed(&before, 1, geometry(&wide)).unwrap();
    assert_eq!((after.pixels_of(1), after.ids()), (128, before.ids()));
    assert_eq!(after.spec(1), wide);
    assert_eq!(
        [&after.rig().views()[0], &after.rig().views()[2]],
        [&before.rig().views()[0], &before.rig().views()[2]]
    );
    // A whole definition removes the settings that it does not contain.
    let flat = ViewSpec { name: "a".to_owned(), ..given(FLAT).0 };
    let replaced = before.replaced(&general, 0, &flat).unwrap();
    assert_eq!((replaced.rig().views()[0].kind.type_name(), replaced.own_keys(0).len()), ("perspective", 0));
    let mut wrong = wide;
    let ViewKindSpec::Fisheye(fisheye) = &mut wrong.geometry.kind else { panic!("a fisheye") };
    fisheye.fov_deg = 400.0;
    let problem = changed(&before, 0, geometry(&wrong)).unwrap_err();
    assert!(problem.starts_with("definition.fov_deg: 400: "), "{problem}");
    let problem = changed(&before, 0, geometry(&ViewSpec::custom("a"))).unwrap_err();
    assert!(problem.starts_with("definition.type: missing key"), "{problem}");
}

#[test]
fn saved_views_restore_client_changes_and_keep_other_configuration() {
    let general = RenderSettings::default();
    let started = views(&[]);
    let shown = with(&started.without(&general, 0).unwrap(), given(FLAT)).unwrap();
    let narrow = ViewUpdate { geometry: Some(fisheye("b", 90.0).0.geometry), ..ViewUpdate::default() };
    let shown = changed(&shown, 0, narrow).unwrap();
    let deleted: Vec<String> = shown.deleted().map(str::to_owned).collect();
    assert_eq!(deleted, ["a"]);
    assert_eq!(shown.kept().map(|kept| kept.geometry.has_keys()).collect::<Vec<_>>(), [true, false, true]);
    // If the views are restored into the same daemon, as from a snapshot, their identities stay.
    let same = shown.restored(&general, shown.kept().collect(), &deleted).unwrap();
    assert_eq!((same.rig(), same.ids(), &same.settings), (shown.rig(), shown.ids(), &shown.settings));
    // Restore them with a changed configuration: `c` is larger, `b` is removed, `d` is new.
    let others = ["a", "c", "d"].map(|name| {
        let size = if name == "c" { 32 } else { 8 };
        given(&format!("name = '{name}'\ntype = 'fisheye'\nsize = [{size}, {size}]\nfov_deg = 180.0"))
    });
    let other = ViewSet::new(&general, others.to_vec(), Path::new("")).unwrap();
    let there = other.restored(&general, shown.kept().collect(), &deleted).unwrap();
    assert_eq!(there.names().collect::<Vec<_>>(), ["c", "d", "b", "flat"]);
    assert_eq!([0, 1, 2, 3].map(|view| there.pixels_of(view)), [32 * 32, 64, 64, 48]);
    assert_eq!(there.spec(2), shown.spec(0));
    assert_eq!(there.deleted().collect::<Vec<_>>(), ["a"]);
    // Older programs saved no geometry, so that of the configuration applies.
    let settings = shown.kept().map(|kept| ViewSpec { geometry: ViewGeometry::default(), ..kept }).collect();
    assert_eq!(other.restored(&general, settings, &[]).unwrap().rig(), other.rig());
    let mut broken = fisheye("x", 90.0).0;
    broken.geometry.orientation = [2.0, 0.0, 0.0, 0.0];
    let problem = other.restored(&general, vec![broken], &[]).unwrap_err();
    assert!(problem.starts_with("view `x`: definition.orientation"), "{problem}");
}
