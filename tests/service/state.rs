//! What was acknowledged is there again.

use std::path::Path;

use glam::DVec3;
use steradian::{
    plan::settings::{ImpostorMethod, StarMethod},
    scene::bodies::Preset,
    service::{
        BodyForm, CameraUpdate, Change, Client, Lease, SceneForm, SceneUpdate, TableChange, ViewForm, ViewUpdate,
    },
};
use tonic::Code;

use crate::{
    daemon::{Daemon, small_rig},
    objects::swarm,
};

async fn start(path: &Path) -> Daemon {
    Daemon::start_with(small_rig(), |options| options.state = Some(path.to_owned())).await
}

/// Changes something of everything that clients can change.
async fn change_all(client: &mut Client) {
    let mars = BodyForm::from(Preset::Mars.body("mars", DVec3::X * 2e11));
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
        exposure: TableChange::All("limiting_magnitude = 8.5".parse().unwrap()),
        glare: TableChange::All("fraction = 0.25".parse().unwrap()),
        ..ViewUpdate::default()
    };
    client.update_view("flat", &group, None).await.unwrap();
    let pose = CameraUpdate { position_m: Some([1.0, -2.0, 3.5]), ..CameraUpdate::default() };
    client.set_camera(&pose).await.unwrap();
}

async fn seen(client: &mut Client) -> (SceneForm, Vec<ViewForm>) {
    (client.scene().await.unwrap(), client.views().await.unwrap())
}

#[tokio::test]
async fn a_daemon_goes_on_with_what_was_acknowledged() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("state.redb");
    let daemon = start(&path).await;
    let mut client = daemon.client().await;
    let begun = seen(&mut client).await;
    change_all(&mut client).await;
    let (scene, views) = seen(&mut client).await;
    assert!(scene.revision > begun.0.revision && views != begun.1);
    let camera = client.camera().await.unwrap();
    drop(client);
    daemon.shutdown().await.unwrap();

    for _ in 0..2 {
        let daemon = start(&path).await;
        let mut client = daemon.client().await;
        assert_eq!(seen(&mut client).await, (scene.clone(), views.clone()));
        assert_eq!(client.camera().await.unwrap(), camera);
        drop(client);
        daemon.shutdown().await.unwrap();
    }
    // What is changed then goes on from there.
    let daemon = start(&path).await;
    let mut client = daemon.client().await;
    let after = client.remove_body("mars", Some(scene.revision)).await.unwrap();
    assert_eq!((after.revision, after.bodies.len()), (scene.revision + 1, 0));
    drop(client);
    daemon.shutdown().await.unwrap();
}

#[tokio::test]
async fn snapshots_bring_everything_back() {
    let folder = tempfile::tempdir().unwrap();
    let daemon = start(&folder.path().join("state.redb")).await;
    let mut client = daemon.client().await;
    client.save_snapshot("before").await.unwrap();
    let (before, views_before) = seen(&mut client).await;
    change_all(&mut client).await;
    client.save_snapshot("after").await.unwrap();
    let (after, views_after) = seen(&mut client).await;
    assert_eq!(client.snapshots().await.unwrap(), ["after", "before"]);

    let loaded = client.load_snapshot("before", Some(after.revision)).await.unwrap();
    assert_eq!(SceneForm { revision: before.revision, ..loaded }, before);
    let same = |views: Vec<ViewForm>, revision: u64| -> Vec<ViewForm> {
        views.into_iter().map(|view| ViewForm { revision, ..view }).collect()
    };
    assert_eq!(same(seen(&mut client).await.1, 0), same(views_before, 0));
    assert_eq!(client.camera().await.unwrap().position_m, DVec3::ZERO);
    let loaded = client.load_snapshot("after", None).await.unwrap();
    assert_eq!(SceneForm { revision: after.revision, ..loaded }, after);
    assert_eq!(same(seen(&mut client).await.1, 0), same(views_after, 0));
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

    // While somebody else steers, a snapshot that has a camera changes nothing.
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
async fn a_daemon_without_a_file_says_so_and_one_with_another_s_file_does_not_start() {
    let daemon = Daemon::start(small_rig()).await;
    let mut client = daemon.client().await;
    let error = client.save_snapshot("a").await.unwrap_err();
    assert!(error.code() == Some(Code::FailedPrecondition) && error.to_string().contains("--state"), "{error}");
    drop(client);
    daemon.shutdown().await.unwrap();
}
