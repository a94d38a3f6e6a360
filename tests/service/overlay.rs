//! Overlays: changed as a whole and in parts, shown in the next frame; invalid ones are refused.

use glam::DVec3;
use steradian::{
    output::Encoding,
    scene::overlay::{Anchor, Colour, Grid, GridKind, Label, Overlay, Trajectory},
    service::{Change, Client, ClientError, OverlayChange, SceneForm, SceneUpdate},
};
use tonic::Code;

use crate::daemon::{Daemon, small_rig};

fn grid(divisions: u32) -> Grid {
    Grid::new(GridKind::Galactic, divisions, Grid::STYLE)
}

fn way(name: &str) -> Trajectory {
    Trajectory::new(name, vec![DVec3::ZERO, DVec3::X * 1e9], Trajectory::STYLE)
}

fn label(name: &str, text: &str) -> Label {
    let anchor = Anchor::Direction(DVec3::Y);
    Label {
        name: name.to_owned(),
        text: text.to_owned(),
        anchor,
        colour: Colour([1, 2, 3]),
        size_px: 9.0,
        opacity: 0.5,
    }
}

async fn change(client: &mut Client, overlay: OverlayChange) -> Result<SceneForm, ClientError> {
    client.update_scene(&SceneUpdate { overlay, ..SceneUpdate::default() }, None).await
}

#[tokio::test]
async fn frames_show_an_overlay_that_is_changed_in_parts() {
    let daemon = Daemon::start(small_rig()).await;
    let mut client = daemon.client().await;
    assert!(client.scene().await.unwrap().overlay.is_empty());
    let mut expected = Overlay {
        cardinal_points: false,
        pictures: Vec::new(),
        grids: vec![grid(6)],
        trajectories: vec![way("a"), way("b")],
        labels: vec![label("here", "α")],
        test_patterns: vec!["eyes".to_owned()],
    };
    let scene = change(&mut client, OverlayChange::all(expected.clone())).await.unwrap();
    assert_eq!((scene.revision, &scene.overlay), (8, &expected));
    client.render_frame("flat", Encoding::Rgba8).await.unwrap();
    let shown = daemon.controls.shown.lock().unwrap().clone().expect("a frame").0;
    assert_eq!(*shown.overlay, expected);
    assert!(shown.is_empty(), "an overlay is not an object");

    // Remove one trajectory, add one label, and keep the rest.
    let parts = OverlayChange {
        trajectories: Change::remove("a"),
        labels: Change::put("there", label("there", "x")),
        ..OverlayChange::default()
    };
    expected.trajectories.remove(0);
    expected.labels.push(label("there", "x"));
    assert_eq!(change(&mut client, parts).await.unwrap().overlay, expected);
    let parts = OverlayChange { grids: Some(vec![]), test_patterns: Some(vec![]), ..OverlayChange::default() };
    (expected.grids, expected.test_patterns) = (vec![], vec![]);
    assert_eq!(change(&mut client, parts).await.unwrap().overlay, expected);
    // Other changes keep the overlay.
    let fainter = SceneUpdate { magnitude_limit: Some(6.0), ..SceneUpdate::default() };
    assert_eq!(client.update_scene(&fainter, None).await.unwrap().overlay, expected);
    let none = OverlayChange::all(Overlay::default());
    assert!(change(&mut client, none).await.unwrap().overlay.is_empty());
    daemon.shutdown().await.unwrap();
}

#[tokio::test]
async fn invalid_changes_are_refused_and_keep_the_overlay() {
    let daemon = Daemon::start(small_rig()).await;
    let mut client = daemon.client().await;
    let before =
        change(&mut client, OverlayChange::all(Overlay { labels: vec![label("here", "x")], ..Default::default() }));
    let before = before.await.unwrap();
    let trajectories = |list| OverlayChange { trajectories: Change::All(list), ..OverlayChange::default() };
    let labels = |list| OverlayChange { labels: Change::All(list), ..OverlayChange::default() };
    let patterns =
        |name: &str| OverlayChange { test_patterns: Some(vec![name.to_owned()]), ..OverlayChange::default() };
    for (update, parts) in [
        (
            OverlayChange { grids: Some(vec![grid(91)]), ..OverlayChange::default() },
            &["overlay.grids[0].spacing_deg", "between 1 and 90"][..],
        ),
        (
            OverlayChange { grids: Some(vec![Grid { spacing_deg: 91.0, ..grid(1) }]), ..OverlayChange::default() },
            &["overlay.grids[0].spacing_deg: 91: must be between 1 and 90 degrees and divide 90"],
        ),
        (
            OverlayChange {
                grids: Some(vec![Grid { kind: GridKind::Constellations, ..grid(9) }]),
                ..OverlayChange::default()
            },
            &["overlay.grids[0].spacing_deg: 10: ", "omit the key"],
        ),
        (patterns("dome"), &["overlay.test_patterns", "`dome`", "flat, eyes"]),
        (
            trajectories(vec![Trajectory { points_m: vec![DVec3::X], ..way("a") }]),
            &["overlay.trajectories.a", "points_m", "between 2 and 32768"],
        ),
        (trajectories(vec![way("a"), way("a")]), &["overlay.trajectories", "unique"]),
        (labels(vec![label("l", "a\nb")]), &["overlay.labels.l", "text", "one line"]),
        (
            labels(vec![Label { size_px: 1.0, ..label("l", "x") }]),
            &["overlay.labels.l", "size_px", "between 6 and 200"],
        ),
        (
            OverlayChange { labels: Change::remove("gone"), ..OverlayChange::default() },
            &["overlay.labels.gone", "the existing ones are: here"],
        ),
    ] {
        match change(&mut client, update).await {
            Err(ClientError::Status { code: Code::InvalidArgument, message }) => {
                assert!(parts.iter().all(|part| message.contains(part)), "{parts:?}: {message}");
            }
            other => panic!("{parts:?}: {other:?}"),
        }
        assert_eq!(client.scene().await.unwrap(), before);
    }
    daemon.shutdown().await.unwrap();
}
