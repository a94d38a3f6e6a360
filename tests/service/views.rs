//! Views have their own exposure, glare and tone mapping, which are read, changed and refused.

use serde::de::DeserializeOwned;
use steradian::{
    config::ViewSpec,
    output::Encoding,
    plan::settings::{ExposureKeys, ExposureMode, GlareKeys, Meter, StarMethod},
    service::{ClientError, SceneUpdate, SettingsChange, ViewUpdate},
};
use tonic::Code;

use crate::daemon::{Daemon, adapting, small_rig, within};

/// Returns partial settings with these keys.
fn keys<K: DeserializeOwned>(text: &str) -> K {
    toml::from_str(text).unwrap()
}

fn exposed(text: &str) -> ViewUpdate {
    ViewUpdate { exposure: SettingsChange::set(keys(text)), ..ViewUpdate::default() }
}

fn glaring(text: &str) -> ViewUpdate {
    ViewUpdate { glare: SettingsChange::set(keys(text)), ..ViewUpdate::default() }
}

#[tokio::test]
async fn a_change_affects_only_the_next_frame_of_its_view() {
    let daemon = Daemon::start(small_rig()).await;
    let mut client = daemon.client().await;
    let before = client.view("flat").await.unwrap();
    assert_eq!((before.revision, before.exposure_group.as_str(), before.own_keys.len()), (7, "", 0));
    assert_eq!((before.exposure.limiting_magnitude, before.exposure.ev100), (Some(6.5), None));
    for view in ["flat", "eyes"] {
        client.render_frame(view, Encoding::Rgba8).await.unwrap();
    }

    let update = ViewUpdate { glare: glaring("fraction = 0.25").glare, ..exposed("mode = 'manual'\nev100 = -4.0") };
    let after = client.update_view("eyes", &update, Some(7)).await.unwrap();
    assert_eq!((after.name.as_str(), after.revision), ("eyes", 8));
    assert_eq!(after.exposure, keys("mode = 'manual'\nev100 = -4.0"));
    assert_eq!(after.glare.fraction, Some(0.25));
    assert_eq!(after.own_keys, ["exposure.ev100", "exposure.mode", "glare.fraction"]);
    assert_eq!(client.view("eyes").await.unwrap(), after);
    assert_eq!(client.views().await.unwrap()[1], after);
    assert_eq!(client.view("flat").await.unwrap().exposure, before.exposure);
    assert_eq!(client.scene().await.unwrap().revision, 8);

    daemon.controls.framed.lock().unwrap().clear();
    for (view, parts) in [("flat", 1), ("eyes", 2)] {
        let frame = client.render_frame(view, Encoding::Rgba8).await.unwrap();
        assert_eq!((frame.scene_revision, frame.images.len()), (8, parts), "{view}");
        assert_eq!(frame.limiting_magnitude, Some(6.5), "the view is found in its frame");
    }
    let framed = daemon.controls.framed.lock().unwrap().clone();
    let drawn: Vec<_> =
        framed.iter().map(|(names, s)| (names.join(","), s.exposure.mode(), s.glare.fraction)).collect();
    let expected = [("flat".to_owned(), ExposureMode::Auto, 0.1), ("eyes".to_owned(), ExposureMode::Manual, 0.25)];
    assert_eq!(drawn, expected);

    // The settings are restored, so all views share one frame again.
    let reset = ViewUpdate {
        exposure: SettingsChange::Replace(ExposureKeys::default()),
        glare: SettingsChange::Replace(GlareKeys::default()),
        ..ViewUpdate::default()
    };
    assert!(client.update_view("eyes", &reset, None).await.unwrap().own_keys.is_empty());
    client.render_frame("eyes", Encoding::Rgba8).await.unwrap();
    assert_eq!(daemon.controls.framed.lock().unwrap().last().unwrap().0, ["flat", "eyes"]);
    daemon.shutdown().await.unwrap();
}

#[tokio::test]
async fn refused_changes_keep_the_last_valid_state() {
    let daemon = Daemon::start(small_rig()).await;
    let mut client = daemon.client().await;
    let cell_sky = SceneUpdate { star_method: Some(StarMethod::CellSky), ..SceneUpdate::default() };
    client.update_scene(&cell_sky, None).await.unwrap();
    let good = client.update_view("flat", &exposed("limiting_magnitude = 8.0"), Some(8)).await.unwrap();
    assert_eq!(good.revision, 9);
    let toned = |text: &str| ViewUpdate { tone_map: SettingsChange::set(keys(text)), ..ViewUpdate::default() };
    for (view, update, expected, code, reason) in [
        ("flat", exposed("limiting_magnitude = 5.0"), Some(8), Code::Aborted, "revision 9, not 8"),
        ("roof", exposed("limiting_magnitude = 5.0"), None, Code::NotFound, "the views are: flat, eyes"),
        ("flat", ViewUpdate::default(), None, Code::InvalidArgument, "names no field"),
        ("flat", exposed("limiting_magnitude = 31.0"), None, Code::InvalidArgument, "between -10 and 30"),
        ("flat", exposed("key = 0.2"), None, Code::InvalidArgument, "exposure.key: has no effect"),
        (
            "flat",
            exposed("metering = 'spot'\nspot_deg = 0.0"),
            None,
            Code::InvalidArgument,
            "between 0.05 and 90 degrees",
        ),
        (
            "flat",
            toned("operator = 'calibrated'\nblack_cd_m2 = 60.0"),
            None,
            Code::InvalidArgument,
            "half of peak_cd_m2",
        ),
        (
            "flat",
            toned("peak_cd_m2 = 12.0"),
            None,
            Code::InvalidArgument,
            "tone_map.peak_cd_m2: has no effect with operator",
        ),
        (
            "flat",
            glaring("age_years = 60.0"),
            None,
            Code::InvalidArgument,
            "glare.age_years: has no effect with kernel",
        ),
        ("flat", glaring("kernel = 'psf'"), None, Code::InvalidArgument, "psf_file"),
        (
            "flat",
            glaring("psf_file = '/etc/passwd'"),
            None,
            Code::InvalidArgument,
            "files come only from the configuration",
        ),
        // Only the plan of a frame detects this error, which does not depend on a single key: this sky draws no stars
        // that could cause glare.
        ("flat", glaring("method = 'sky_cube'"), None, Code::InvalidArgument, "cell_sky"),
    ] {
        match client.update_view(view, &update, expected).await {
            Err(ClientError::Status { code: found, message }) => {
                assert!(found == code && message.contains(reason), "{update:?}: {found:?} {message}");
            }
            other => panic!("{update:?} gave {other:?}"),
        }
        assert_eq!(client.view("flat").await.unwrap(), good);
    }
    let frame = client.render_frame("flat", Encoding::Rgba8).await.unwrap();
    assert_eq!(frame.scene_revision, 9);
    let framed = daemon.controls.framed.lock().unwrap().last().unwrap().clone();
    assert_eq!(
        framed.1.exposure.auto_or_default().meter,
        Meter::LimitingMagnitude { limiting_magnitude: 8.0, reference_arcmin: None }
    );
    daemon.shutdown().await.unwrap();
}

#[tokio::test]
async fn streams_receive_changes_and_groups_adapt_separately() {
    let daemon = Daemon::start_with(small_rig(), |options| options.views.settings.exposure = adapting(3600.0)).await;
    let mut client = daemon.client().await;
    let mut frames = client.stream_frames("flat", Encoding::Rgba8, 0.0).await.unwrap();
    assert_eq!(within(frames.next()).await.unwrap().expect("a frame").scene_revision, 7);
    *daemon.controls.metered_ev100.lock().unwrap() = 5.0;
    // With its own exposure, the view begins a new adaptation, so its first frame is adapted at once. The other view
    // continues.
    client.update_view("flat", &exposed("compensation_ev = 1.0"), None).await.unwrap();
    let changed = loop {
        let frame = within(frames.next()).await.unwrap().expect("a frame");
        if frame.scene_revision == 8 {
            break frame;
        }
    };
    assert_eq!(changed.exposure_ev100, 5.0);
    let other = client.render_frame("eyes", Encoding::Rgba8).await.unwrap().exposure_ev100;
    assert!(other < 1.0, "{other}");
    // Views of a group share one exposure.
    let join = ViewUpdate { exposure_group: Some("both".to_owned()), ..ViewUpdate::default() };
    for view in ["flat", "eyes"] {
        client.update_view(view, &join, None).await.unwrap();
    }
    let view = client.view("eyes").await.unwrap();
    assert_eq!((view.exposure_group.as_str(), view.exposure.compensation_ev), ("both", Some(1.0)));
    client.render_frame("eyes", Encoding::Rgba8).await.unwrap();
    assert_eq!(daemon.controls.framed.lock().unwrap().last().unwrap().0, ["flat", "eyes"]);
    daemon.shutdown().await.unwrap();
}

#[tokio::test]
async fn a_daemon_starts_with_the_views_own_settings() {
    let own = ViewSpec {
        exposure_group: Some("calibrated".to_owned()),
        tone_map: Some(keys("operator = 'calibrated'\npeak_cd_m2 = 400.0")),
        ..ViewSpec::custom("eyes")
    };
    let daemon =
        Daemon::start_with(small_rig(), |options| options.views.specs = vec![ViewSpec::custom("flat"), own]).await;
    let mut client = daemon.client().await;
    let view = client.view("eyes").await.unwrap();
    assert_eq!(view.exposure_group, "calibrated");
    assert_eq!(view.tone_map.peak_cd_m2, Some(400.0));
    assert_eq!(view.own_keys, ["tone_map.operator", "tone_map.peak_cd_m2"]);
    client.render_frame("eyes", Encoding::Png).await.unwrap();
    assert_eq!(daemon.controls.framed.lock().unwrap().last().unwrap().0, ["eyes"]);
    daemon.shutdown().await.unwrap();
}
