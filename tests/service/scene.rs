//! The scene is read, changed and watched.

use std::sync::Arc;

use steradian::{
    catalogue::{
        bright::{bright_stars, named_bright_stars},
        chunks::StarSet,
    },
    output::Encoding,
    plan::settings::StarMethod,
    scene::bodies::{Body, SolarBody},
    service::{ClientError, SceneCatalogue, SceneUpdate, SeenKind},
};
use tonic::Code;

use crate::daemon::{Daemon, small_rig, within};

fn with_method(method: StarMethod) -> SceneUpdate {
    SceneUpdate { star_method: Some(method), ..SceneUpdate::default() }
}

#[tokio::test]
async fn a_change_makes_a_revision_and_affects_the_next_frame_of_every_view() {
    let catalogue = SceneCatalogue { name: "builtin:bright".to_owned(), stars: 286 };
    let daemon = Daemon::start_with(small_rig(), |options| options.scene.catalogues = vec![catalogue.clone()]).await;
    let mut client = daemon.client().await;
    let scene = client.scene().await.unwrap();
    assert_eq!((scene.revision, scene.star_method.as_str(), scene.magnitude_limit), (7, "auto", 99.0));
    assert_eq!(scene.catalogues, [catalogue]);
    assert_eq!(client.render_frame("flat", Encoding::Rgba8).await.unwrap().scene_revision, 7);

    let changed = client.update_scene(&with_method(StarMethod::Tent), Some(7)).await.unwrap();
    assert_eq!((changed.revision, changed.star_method.as_str(), changed.magnitude_limit), (8, "tent", 99.0));
    let fainter = SceneUpdate { magnitude_limit: Some(6.5), ..SceneUpdate::default() };
    let changed = client.update_scene(&fainter, None).await.unwrap();
    assert_eq!((changed.revision, changed.star_method.as_str(), changed.magnitude_limit), (9, "tent", 6.5));
    assert_eq!(client.scene().await.unwrap(), changed);
    for view in ["flat", "eyes"] {
        assert_eq!(client.render_frame(view, Encoding::Rgba8).await.unwrap().scene_revision, 9);
    }
    let drawn: Vec<_> = daemon.controls.drawn.lock().unwrap().iter().map(|frame| (frame.0, frame.1)).collect();
    assert_eq!(drawn, [(StarMethod::Auto, 99.0), (StarMethod::Tent, 6.5), (StarMethod::Tent, 6.5)]);
    assert_eq!(client.info().await.unwrap().scene_revision, 9);
    daemon.shutdown().await.unwrap();
}

#[tokio::test]
async fn changes_for_another_revision_and_empty_ones_are_refused() {
    let daemon = Daemon::start(small_rig()).await;
    let mut client = daemon.client().await;
    let before = client.scene().await.unwrap();
    for (update, expected, code, reason) in [
        (with_method(StarMethod::Tent), Some(6), Code::Aborted, "revision 7, not 6"),
        (SceneUpdate::default(), None, Code::InvalidArgument, "stars.method"),
        (
            SceneUpdate { magnitude_limit: Some(f64::INFINITY), ..with_method(StarMethod::Tent) },
            None,
            Code::InvalidArgument,
            "between -100 and 100",
        ),
    ] {
        match client.update_scene(&update, expected).await {
            Err(ClientError::Status { code: found, message }) => {
                assert!(found == code && message.contains(reason), "{found:?} {message}");
            }
            other => panic!("{update:?} gave {other:?}"),
        }
        assert_eq!(client.scene().await.unwrap(), before);
    }
    daemon.shutdown().await.unwrap();
}

#[tokio::test]
async fn watchers_receive_every_change_and_the_end() {
    let daemon = Daemon::start(small_rig()).await;
    let (mut client, mut other) = (daemon.client().await, daemon.client().await);
    let mut watch = client.watch_scene().await.unwrap();
    assert_eq!(within(watch.next()).await.unwrap().expect("the scene as it is").revision, 7);
    // An image at rest is drawn again when the scene changes.
    let mut frames = client.stream_frames("flat", Encoding::Rgba8, 0.0).await.unwrap();
    assert_eq!(within(frames.next()).await.unwrap().expect("a frame").scene_revision, 7);
    for (revision, method) in [(8, StarMethod::BSpline), (9, StarMethod::Tent), (10, StarMethod::Auto)] {
        other.update_scene(&with_method(method), None).await.unwrap();
        let scene = within(watch.next()).await.unwrap().expect("a change");
        assert_eq!((scene.revision, scene.star_method.as_str()), (revision, method.name()));
        while within(frames.next()).await.unwrap().expect("a frame").scene_revision < revision {}
    }
    daemon.shutdown().await.unwrap();
    assert!(within(watch.next()).await.expect("a clean end").is_none());
}

#[tokio::test]
async fn the_number_of_scene_streams_is_limited() {
    let daemon = Daemon::start_with(small_rig(), |options| options.limits.subscribers = 1).await;
    let mut client = daemon.client().await;
    let first = client.watch_scene().await.unwrap();
    assert_eq!(client.watch_scene().await.unwrap_err().code(), Some(Code::ResourceExhausted));
    drop(first);
    // The daemon detects the dropped stream a little later.
    within(async { while client.watch_scene().await.is_err() {} }).await;
    daemon.shutdown().await.unwrap();
}

#[tokio::test]
async fn objects_in_a_direction_are_identified() {
    let daemon = Daemon::start_with(small_rig(), |options| {
        options.scene.snapshot.stars = Arc::new(StarSet::from_records(bright_stars(0.0)));
    })
    .await;
    let mut client = daemon.client().await;
    let sirius = named_bright_stars(0.0).into_iter().find(|star| star.name == "Sirius").unwrap();
    let direction = sirius.star.position.normalize();
    let near = (direction + 1e-3 * direction.any_orthonormal_vector()).normalize();
    let found = client.identify(3.0 * near, 0.0, 0).await.unwrap();
    let first = &found[0];
    assert_eq!((first.name.as_str(), first.designation.as_str(), first.kind), ("Sirius", "alf CMa", SeenKind::Star));
    assert!((first.separation_deg - 1e-3_f64.to_degrees()).abs() < 1e-4, "{}", first.separation_deg);
    assert!((first.v_mag.unwrap() - sirius.star.apparent_magnitude()).abs() < 1e-3);
    let distance_m = sirius.star.position.length() * steradian::units::PARSEC_M;
    assert!((first.distance_m.unwrap() / distance_m - 1.0).abs() < 1e-4);
    // Stars fainter than the scene's limit are not found.
    let none = SceneUpdate { magnitude_limit: Some(-2.0), ..SceneUpdate::default() };
    client.update_scene(&none, None).await.unwrap();
    assert_eq!(client.identify(near, 0.0, 0).await.unwrap(), []);
    // Put a body in front of the star.
    client.put_body(Body::preset(SolarBody::Mars, "mars", direction * 1e9), None).await.unwrap();
    let found = client.identify(near, 0.0, 0).await.unwrap();
    assert!(found.len() == 1 && found[0].name == "mars" && found[0].kind == SeenKind::Body, "{found:?}");
    let error = client.identify(direction, 11.0, 0).await.unwrap_err();
    assert_eq!(error.code(), Some(Code::InvalidArgument));
    drop(client);
    daemon.shutdown().await.unwrap();
}
