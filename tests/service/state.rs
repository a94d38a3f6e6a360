//! Acknowledged changes survive a restart.

use std::{path::Path, sync::Arc};

use glam::DVec3;
use steradian::{
    config::ViewSpec,
    plan::settings::{ImpostorMethod, RenderSettings, StarMethod},
    scene::{
        Camera, SceneSnapshot,
        bodies::{Body, SolarBody},
    },
    service::{
        BodyForm, CameraUpdate, Change, Client, HeadsetOptions, Lease, SceneForm, SceneUpdate, ServeOptions,
        SettingsChange, ViewForm, ViewUpdate, run,
    },
};
use tonic::Code;

use crate::{
    daemon::{Daemon, TestEngine, small_rig},
    objects::swarm,
    rig::{fisheye, geometry, round},
};

async fn start(path: &Path) -> Daemon {
    Daemon::start_with(small_rig(), |options| options.state = Some(path.to_owned())).await
}

/// Makes at least one change to everything that clients can change.
async fn change_all(client: &mut Client) {
    let mars = BodyForm::from(Body::preset(SolarBody::Mars, "mars", DVec3::X * 2e11));
    let update = SceneUpdate {
        star_method: Some(StarMethod::Tent),
        magnitude_limit: Some(7.25),
        time_s: Some(1e9),
        impostor: Some(ImpostorMethod::Octahedral),
        quality: Some(0.5),
        bodies: Change::All(vec![mars]),
        asteroid_fields: Change::put("swarm", swarm("swarm")),
        ..SceneUpdate::default()
    };
    client.update_scene(&update, None).await.unwrap();
    let group = ViewUpdate {
        exposure_group: Some("desk".to_owned()),
        exposure: SettingsChange::Replace(toml::from_str("limiting_magnitude = 8.5").unwrap()),
        glare: SettingsChange::Replace(toml::from_str("fraction = 0.25").unwrap()),
        ..ViewUpdate::default()
    };
    client.update_view("flat", &group, None).await.unwrap();
    client.delete_view("eyes", None).await.unwrap();
    let dome = ViewSpec { exposure_group: Some("desk".to_owned()), test_pattern: true, ..round("dome", 16) };
    client.create_view(&dome, None).await.unwrap();
    client.update_view("dome", &geometry(fisheye("dome", [16; 2], 0.1)), None).await.unwrap();
    let pose = CameraUpdate { position_m: Some([1.0, -2.0, 3.5]), ..CameraUpdate::default() };
    client.set_camera(&pose).await.unwrap();
}

async fn scene_and_views(client: &mut Client) -> (SceneForm, Vec<ViewForm>) {
    (client.scene().await.unwrap(), client.views().await.unwrap())
}

#[tokio::test]
async fn acknowledged_changes_survive_a_restart() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("state.redb");
    let daemon = start(&path).await;
    let mut client = daemon.client().await;
    let begun = scene_and_views(&mut client).await;
    change_all(&mut client).await;
    let (scene, views) = scene_and_views(&mut client).await;
    assert!(scene.revision > begun.0.revision && views != begun.1);
    let camera = client.camera().await.unwrap();
    drop(client);
    daemon.shutdown().await.unwrap();

    for _ in 0..2 {
        let daemon = start(&path).await;
        let mut client = daemon.client().await;
        assert_eq!(scene_and_views(&mut client).await, (scene.clone(), views.clone()));
        assert_eq!(client.camera().await.unwrap(), camera);
        drop(client);
        daemon.shutdown().await.unwrap();
    }
    // Later changes continue from the restored revision.
    let daemon = start(&path).await;
    let mut client = daemon.client().await;
    let after = client.remove_body("mars", Some(scene.revision)).await.unwrap();
    assert_eq!((after.revision, after.bodies.len()), (scene.revision + 1, 0));
    drop(client);
    daemon.shutdown().await.unwrap();
}

#[tokio::test]
async fn snapshots_restore_everything() {
    let folder = tempfile::tempdir().unwrap();
    let daemon = start(&folder.path().join("state.redb")).await;
    let mut client = daemon.client().await;
    client.save_snapshot("before").await.unwrap();
    let (before, views_before) = scene_and_views(&mut client).await;
    change_all(&mut client).await;
    client.save_snapshot("after").await.unwrap();
    let (after, views_after) = scene_and_views(&mut client).await;
    assert_eq!(client.snapshots().await.unwrap(), ["after", "before"]);

    let loaded = client.load_snapshot("before", Some(after.revision)).await.unwrap();
    assert_eq!(SceneForm { revision: before.revision, ..loaded }, before);
    let same = |views: Vec<ViewForm>, revision: u64| -> Vec<ViewForm> {
        views.into_iter().map(|view| ViewForm { revision, ..view }).collect()
    };
    assert_eq!(same(scene_and_views(&mut client).await.1, 0), same(views_before, 0));
    assert_eq!(client.camera().await.unwrap().position_m, DVec3::ZERO);
    let loaded = client.load_snapshot("after", None).await.unwrap();
    assert_eq!(SceneForm { revision: after.revision, ..loaded }, after);
    assert_eq!(same(scene_and_views(&mut client).await.1, 0), same(views_after, 0));
    assert_eq!(client.camera().await.unwrap().position_m.z, 3.5);

    for (answer, code, part) in [
        (client.load_snapshot("before", Some(1)).await.map(drop), Code::Aborted, "revision"),
        (client.load_snapshot("none", None).await.map(drop), Code::NotFound, "after, before"),
        (client.save_snapshot("a b").await, Code::InvalidArgument, "a b"),
        (client.save_snapshot(&"x".repeat(65)).await, Code::InvalidArgument, "64"),
    ] {
        let error = answer.unwrap_err();
        assert!(error.code() == Some(code) && error.to_string().contains(part), "{error}");
    }

    // While another client holds the lease, loading a snapshot with a camera changes nothing.
    let mut other = daemon.client().await;
    let mut steering = other.steer(Lease::Take, "desk").await.unwrap();
    assert!(steering.send(&CameraUpdate { position_m: Some([5.0; 3]), ..CameraUpdate::default() }).await);
    let mut cameras = client.watch_camera().await.unwrap();
    while cameras.next().await.unwrap().expect("a camera").position_m.x != 5.0 {}
    let scene = client.scene().await.unwrap();
    let error = client.load_snapshot("before", None).await.unwrap_err();
    assert!(error.code() == Some(Code::FailedPrecondition) && error.to_string().contains("`desk`"), "{error}");
    assert_eq!(client.scene().await.unwrap(), scene);
    drop((steering, other));
    drop(client);
    daemon.shutdown().await.unwrap();
}

#[tokio::test]
async fn a_missing_or_locked_state_file_is_an_error() {
    let daemon = Daemon::start(small_rig()).await;
    let mut client = daemon.client().await;
    let error = client.save_snapshot("a").await.unwrap_err();
    assert!(error.code() == Some(Code::FailedPrecondition) && error.to_string().contains("--state"), "{error}");
    drop(client);
    daemon.shutdown().await.unwrap();
}

#[tokio::test]
async fn views_of_clients_and_of_a_changed_configuration_are_merged() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("state.redb");
    let names = |views: Vec<ViewForm>| views.into_iter().map(|view| view.name).collect::<Vec<_>>();
    let with_eyes = |eyes: bool| {
        let rig = small_rig();
        let numbers: &[usize] = if eyes { &[0, 1] } else { &[0] };
        let path = path.clone();
        async move { Daemon::start_with(rig.of_views(numbers), |options| options.state = Some(path)).await }
    };
    let daemon = with_eyes(false).await;
    let mut client = daemon.client().await;
    client.create_view(&round("dome", 16), None).await.unwrap();
    drop(client);
    daemon.shutdown().await.unwrap();
    // A new view of the configuration comes before those of clients.
    let daemon = with_eyes(true).await;
    let mut client = daemon.client().await;
    assert_eq!(names(client.views().await.unwrap()), ["flat", "eyes", "dome"]);
    client.delete_view("flat", None).await.unwrap();
    client.create_view(&round("flat", 4), None).await.unwrap();
    client.delete_view("eyes", None).await.unwrap();
    drop(client);
    daemon.shutdown().await.unwrap();
    // Changes that clients made take precedence over the configuration, and deleted views stay deleted.
    let daemon = with_eyes(true).await;
    let mut client = daemon.client().await;
    assert_eq!(names(client.views().await.unwrap()), ["flat", "dome"]);
    assert_eq!(client.view("flat").await.unwrap().images[0].width, 4);
    drop(client);
    daemon.shutdown().await.unwrap();
    // A view cannot have the name of the headset.
    let engine = Box::new(TestEngine::new(Arc::default()));
    let scene =
        SceneSnapshot { revision: 7, stars: Arc::default(), objects: Arc::default(), camera: Camera::default() };
    let never = |_| unreachable!("it does not start");
    let mut options = ServeOptions::new("127.0.0.1:0", engine, scene, small_rig(), RenderSettings::default(), never);
    options.state = Some(path);
    options.headset = Some(HeadsetOptions { name: "dome".to_owned(), drive: Box::new(|_| Ok(())) });
    let error = run(options).await.unwrap_err().to_string();
    assert!(error.contains("headset") && error.contains("`dome` is used twice"), "{error}");
}

/// `tests/data/state-format-3.redb` comes from a program with views as TOML text: `flat` is in the group `desk` and has its own glare, `dome` has
/// another size, `made` was created, and `gone` was deleted.
#[tokio::test]
async fn a_file_of_format_3_is_read() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("state.redb");
    std::fs::copy(Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/state-format-3.redb"), &path).unwrap();
    for _ in 0..2 {
        // At the second start, the file already has the current format.
        let daemon = start(&path).await;
        let mut client = daemon.client().await;
        let views = client.views().await.unwrap();
        assert_eq!(views.iter().map(|view| view.name.as_str()).collect::<Vec<_>>(), ["flat", "eyes", "dome", "made"]);
        assert_eq!(views[0].own_keys, ["exposure.limiting_magnitude", "glare.fraction"]);
        assert_eq!((views[0].exposure.limiting_magnitude, views[0].glare.fraction), (Some(8.5), Some(0.25)));
        assert_eq!(views[2].definition, Some(fisheye("dome", [24; 2], 180.0)));
        let made = views[3].definition.clone().unwrap();
        assert_eq!((made.exposure_group.as_deref(), made.test_pattern), (Some("desk"), true));
        assert_eq!(made.geometry.orientation, [0.0, 0.6, 0.0, 0.8]);
        assert_eq!(made.geometry.kind, fisheye("made", [16; 2], 90.0).geometry.kind);
        let pose = CameraUpdate { position_m: Some([1.0, 0.0, 0.0]), ..CameraUpdate::default() };
        client.set_camera(&pose).await.unwrap();
        client.load_snapshot("evening", None).await.unwrap();
        drop(client);
        daemon.shutdown().await.unwrap();
    }
}
