//! Views that are changed, created, deleted and saved.

#![allow(clippy::unwrap_used, reason = "a test may panic on unexpected values")]

use super::*;
use crate::plan::{
    settings::{ExposureMode, Metering},
    view_settings::ExposureGroup,
};

fn table(text: &str) -> Table {
    text.parse().unwrap()
}

fn keys(text: &str) -> TableChange {
    TableChange::Keys(table(text).into_iter().map(|(key, value)| (key, Some(value))).collect())
}

fn given(text: &str) -> GivenView {
    GivenView::read(table(text)).unwrap().0
}

fn views(tables: &[ViewTables]) -> ViewSet {
    let view = |(index, name): (usize, &str)| GivenView {
        tables: tables.get(index).cloned().unwrap_or_default(),
        ..given(&format!("name = '{name}'\ntype = 'fisheye'\nsize = [8, 8]\nfov_deg = 180.0"))
    };
    let views = ["a", "b", "c"].into_iter().enumerate().map(view).collect();
    ViewSet::new(&RenderSettings::default(), views, Path::new("")).unwrap()
}

fn changed(views: &ViewSet, view: usize, update: ViewUpdate) -> Result<ViewSet, String> {
    views.changed(&RenderSettings::default(), view, &update)
}

#[test]
fn a_change_affects_one_view_and_other_keys_are_inherited() {
    let before = views(&[]);
    assert!(before.settings.iter().all(|view| view.group == ExposureGroup::General));
    let update =
        ViewUpdate { glare: keys("fraction = 0.25"), exposure: keys("limiting_magnitude = 8.0"), ..Default::default() };
    let after = changed(&before, 1, update).unwrap();
    assert_eq!(after.settings[1].glare.fraction, 0.25);
    assert_eq!(after.settings[1].exposure.limiting_magnitude, 8.0);
    assert_eq!(after.settings[1].group, ExposureGroup::OfView("b".to_owned()));
    assert_eq!([&after.settings[0], &after.settings[2]], [&before.settings[0], &before.settings[2]]);
    assert_eq!(after.own_keys(1), ["exposure.limiting_magnitude", "glare.fraction"]);
    // Empty tables restore the general settings.
    let reset = ViewUpdate {
        exposure: TableChange::All(Table::new()),
        glare: TableChange::Keys(vec![("fraction".to_owned(), None)]),
        ..Default::default()
    };
    assert_eq!(changed(&after, 1, reset).unwrap().settings, before.settings);
}

#[test]
fn any_view_of_a_group_changes_the_shared_exposure() {
    let join = |group: &str| ViewUpdate { exposure_group: Some(group.to_owned()), ..Default::default() };
    let before = views(&[]);
    let named =
        changed(&before, 0, ViewUpdate { exposure: keys("mode = 'manual'\nev100 = 2.0"), ..join("g") }).unwrap();
    let both = changed(&named, 2, join("g")).unwrap();
    assert_eq!((both.settings[2].exposure, both.group_of(2)), (both.settings[0].exposure, "g"));
    let brighter = changed(&both, 2, ViewUpdate { exposure: keys("ev100 = 1.0"), ..Default::default() }).unwrap();
    assert_eq!([0, 2].map(|view| brighter.settings[view].exposure.ev100), [1.0; 2]);
    assert_eq!(brighter.settings[1], before.settings[1]);
    // A view that leaves takes nothing along, and the group stays as it is.
    let left = changed(&brighter, 0, join("")).unwrap();
    assert_eq!(left.settings[0], before.settings[0]);
    assert_eq!(left.settings[2].exposure.ev100, 1.0);
    assert_eq!(changed(&left, 2, join("")).unwrap().settings, before.settings);
    assert!(changed(&before, 0, join("a b")).unwrap_err().contains("exposure_group"));
}

#[test]
fn a_new_mode_drops_useless_keys_but_refuses_requested_ones() {
    let tables =
        ViewTables { exposure: Some(table("limiting_magnitude = 5.0\nadaptation_s = 0.0")), ..Default::default() };
    let before = views(&[tables]);
    let mean = changed(&before, 0, ViewUpdate { exposure: keys("metering = 'mean'"), ..Default::default() }).unwrap();
    assert_eq!(mean.settings[0].exposure.metering, Metering::Mean);
    assert_eq!(mean.own_keys(0), ["exposure.adaptation_s", "exposure.metering"]);
    let manual = changed(&mean, 0, ViewUpdate { exposure: keys("mode = 'manual'"), ..Default::default() }).unwrap();
    assert_eq!(manual.settings[0].exposure.mode, ExposureMode::Manual);
    let wrong = ViewUpdate { exposure: keys("mode = 'manual'\nkey = 0.2"), ..Default::default() };
    assert!(changed(&before, 0, wrong).unwrap_err().starts_with("exposure.key: has no effect with mode = \"manual\""));
    for (update, expected) in [
        (ViewUpdate { exposure: keys("spot_deg = 5.0"), ..Default::default() }, "exposure.spot_deg: has no effect"),
        (ViewUpdate { glare: keys("fraction = 2.0"), ..Default::default() }, "glare.fraction: 2: allowed are 0 to 1"),
        (ViewUpdate { tone_map: keys("gamma = 2.0"), ..Default::default() }, "tone_map.gamma: unknown key"),
    ] {
        let problem = changed(&before, 0, update).unwrap_err();
        assert!(problem.starts_with(expected), "{problem}");
    }
}

const FLAT: &str = "name = 'flat'\ntype = 'perspective'\nsize = [8, 6]\nfov_y_deg = 60.0";

fn defined(text: &str) -> ViewUpdate {
    ViewUpdate { definition: TableChange::All(table(text)), ..ViewUpdate::default() }
}

#[test]
fn views_keep_their_identity_when_others_are_added_or_deleted() {
    let general = RenderSettings::default();
    let before = views(&[]);
    let ids = before.ids().to_vec();
    let after = before.without(&general, 0).unwrap().with(&general, given(FLAT)).unwrap();
    assert_eq!(after.names().collect::<Vec<_>>(), ["b", "c", "flat"]);
    assert_eq!(after.ids()[..2], ids[1..]);
    assert_eq!((after.index_of(ids[0]), after.index_of(ids[1])), (None, Some(0)));
    assert_eq!([after.settings.len(), after.rig().views().len()], [3, 3]);
    assert_eq!((after.pixels_of(2), after.pixels()), (48, 48 + 2 * 64));
    // A new view of the same name has a new identity.
    let again = after.with(&general, given("name = 'a'\ntype = 'equirectangular'\nsize = [4, 2]")).unwrap();
    assert!(!ids.contains(&again.named("a").unwrap().0));
    assert!(again.with(&general, given(FLAT)).unwrap_err().contains("used twice"));
    let none = (0..3).fold(before, |views, _| views.without(&general, 0).unwrap());
    assert_eq!((none.ids().len(), none.pixels(), none.frame_groups(&general).len()), (0, 0, 0));
}

#[test]
fn a_group_keeps_its_exposure_without_its_first_view_and_ends_with_its_last() {
    let general = RenderSettings::default();
    let own = |exposure: &str| ViewTables {
        exposure_group: Some("g".to_owned()),
        exposure: Some(table(exposure)).filter(|table| !table.is_empty()),
        ..ViewTables::default()
    };
    let before = views(&[own("limiting_magnitude = 8.0"), own("")]);
    let after = before.without(&general, 0).unwrap();
    assert_eq!(after.settings[0].exposure.limiting_magnitude, 8.0);
    assert_eq!(after.tables(0), own("limiting_magnitude = 8.0"));
    let joined = |exposure: &str| GivenView { tables: own(exposure), ..given(FLAT) };
    let three = after.with(&general, joined("")).unwrap();
    assert_eq!(three.settings[2].exposure.limiting_magnitude, 8.0);
    let problem = after.with(&general, joined("limiting_magnitude = 5.0")).unwrap_err();
    assert!(problem.starts_with("definition.exposure: exposure_group `g` has the exposure of"), "{problem}");
    let without =
        (0..2).fold(three, |views, _| views.without(&general, views.named("b").map_or(1, |(_, b)| b)).unwrap());
    assert!(without.groups.is_empty());
    assert_eq!(without.with(&general, joined("")).unwrap().settings[1].exposure.limiting_magnitude, 6.5);
}

#[test]
fn geometry_changes_as_a_whole_or_by_key_and_errors_name_the_key() {
    let before = views(&[]);
    let keys = |text: &str| ViewUpdate { definition: keys(text), ..ViewUpdate::default() };
    let wide = changed(&before, 1, keys("fov_deg = 200.0\nsize = [16, 8]")).unwrap();
    assert_eq!((wide.pixels_of(1), wide.ids()), (128, before.ids()));
    assert_eq!(wide.definition(1).unwrap(), &table("type = 'fisheye'\nsize = [16, 8]\nfov_deg = 200.0"));
    assert_eq!([&wide.rig().views()[0], &wide.rig().views()[2]], [&before.rig().views()[0], &before.rig().views()[2]]);
    let flat = changed(&wide, 1, defined("type = 'perspective'\nsize = [8, 6]\nfov_y_deg = 60.0")).unwrap();
    assert_eq!((flat.rig().views()[1].kind.type_name(), flat.rig().views()[1].name.as_str()), ("perspective", "b"));
    for (update, expected) in [
        (keys("fov_deg = 400.0"), "definition.fov_deg: 400: "),
        (keys("fov_y_deg = 40.0"), "definition.fov_y_deg: unknown key `fov_y_deg`"),
        (keys("type = 'dome'"), "definition.type: unknown type `dome`: allowed are perspective, stereo"),
        (keys("size = [0, 8]"), "definition.size: "),
        (keys("size = [8]"), "definition.size"),
        (keys("orientation = [0.0, 0.0, 0.0, 2.0]"), "definition.orientation: "),
        (defined("type = 'fisheye'\nsize = [8, 8]"), "definition: missing key `fov_deg`"),
        (defined(""), "definition.type: missing key"),
    ] {
        let problem = changed(&before, 0, update).unwrap_err();
        assert!(problem.starts_with(expected), "{problem}");
    }
    let mut made = before.members().map(|member| member.given).collect::<Vec<_>>();
    made[0].definition = None;
    let made = ViewSet::new(&RenderSettings::default(), made, Path::new("")).unwrap();
    assert!(changed(&made, 0, keys("fov_deg = 90.0")).unwrap_err().contains("`a` does not come from a configuration"));
    changed(&made, 0, defined("type = 'fisheye'\nsize = [8, 8]\nfov_deg = 90.0")).unwrap();
}

#[test]
fn saved_views_restore_client_changes_and_keep_other_configuration() {
    let general = RenderSettings::default();
    let started = views(&[]);
    let shown = started.without(&general, 0).unwrap().with(&general, given(FLAT)).unwrap();
    let shown = changed(&shown, 0, ViewUpdate { definition: keys("fov_deg = 90.0"), ..ViewUpdate::default() }).unwrap();
    let deleted: Vec<String> = shown.deleted().map(str::to_owned).collect();
    assert_eq!(deleted, ["a"]);
    assert_eq!(shown.kept().map(|kept| kept.definition.is_some()).collect::<Vec<_>>(), [true, false, true]);
    // Restored into the same daemon, as a snapshot: identities stay.
    let same = shown.restored(&general, shown.kept().collect(), &deleted).unwrap();
    assert_eq!((same.rig(), same.ids(), &same.settings), (shown.rig(), shown.ids(), &shown.settings));
    // Restored with a changed configuration: `c` is larger, `b` is removed, `d` is new.
    let others = ["a", "c", "d"].map(|name| {
        let size = if name == "c" { 32 } else { 8 };
        given(&format!("name = '{name}'\ntype = 'fisheye'\nsize = [{size}, {size}]\nfov_deg = 180.0"))
    });
    let other = ViewSet::new(&general, others.to_vec(), Path::new("")).unwrap();
    let there = other.restored(&general, shown.kept().collect(), &deleted).unwrap();
    assert_eq!(there.names().collect::<Vec<_>>(), ["c", "d", "b", "flat"]);
    assert_eq!([0, 1, 2, 3].map(|view| there.pixels_of(view)), [32 * 32, 64, 64, 48]);
    assert_eq!(there.definition(2), shown.definition(0));
    assert_eq!(there.deleted().collect::<Vec<_>>(), ["a"]);
    // Older programs saved no geometry: the configuration's applies.
    let old = shown.kept().map(|kept| KeptView { definition: None, ..kept }).collect();
    assert_eq!(other.restored(&general, old, &[]).unwrap().rig(), other.rig());
    let broken =
        KeptView { name: "x".to_owned(), definition: Some(table("type = 'dome'")), tables: ViewTables::default() };
    assert!(other.restored(&general, vec![broken], &[]).unwrap_err().starts_with("view `x`: definition.type"));
}
