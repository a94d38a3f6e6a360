//! Overlays are changed as a whole and in parts, and shown in the next frame; invalid ones are refused.

use glam::DVec3;
use steradian::{
    output::Encoding,
    scene::overlay::{Anchor, Colour, Grid, GridKind, Label, MOST_PICTURE_TEXELS, Overlay, Picture, Trajectory},
    service::{Change, Client, ClientError, OverlayChange, PictureChange, SceneForm, SceneUpdate},
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

    // Remove one trajectory, add one label, and keep everything else.
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

/// Returns a PNG with a single colour.
fn png(size: [u32; 2], rgba: [u8; 4]) -> Vec<u8> {
    let mut file = Vec::new();
    let mut encoder = png::Encoder::new(&mut file, size[0], size[1]);
    encoder.set_color(png::ColorType::Rgba);
    let mut writer = encoder.write_header().unwrap();
    writer.write_image_data(&rgba.repeat((size[0] * size[1]) as usize)).unwrap();
    drop(writer);
    file
}

/// Returns the header of a PNG, without texels.
fn head_of_png(size: [u32; 2]) -> Vec<u8> {
    let mut file = Vec::new();
    drop(png::Encoder::new(&mut file, size[0], size[1]).write_header().unwrap());
    file
}

fn shown_pictures(daemon: &Daemon) -> Vec<Picture> {
    daemon.controls.shown.lock().unwrap().clone().expect("a frame").0.overlay.pictures.clone()
}

#[tokio::test]
async fn pictures_are_sent_moved_kept_and_removed() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("state.redb");
    let start = async || Daemon::start_with(small_rig(), |options| options.state = Some(path.clone())).await;
    let daemon = start().await;
    let mut client = daemon.client().await;
    let picture = |name: &str, png: Option<Vec<u8>>, direction: DVec3| {
        PictureChange::new(name, png, Anchor::Direction(direction), 0.5)
    };
    let changed = |mut picture: PictureChange, change: fn(&mut PictureChange)| {
        change(&mut picture);
        picture
    };
    let put = |picture: PictureChange| OverlayChange {
        pictures: Change::put(&picture.name.clone(), picture),
        ..OverlayChange::default()
    };
    let red = png([3, 2], [255, 0, 0, 128]);
    change(&mut client, put(picture("title", Some(red.clone()), DVec3::X))).await.unwrap();
    change(&mut client, put(picture("other", Some(png([1, 1], [9; 4])), DVec3::Z))).await.unwrap();
    client.render_frame("flat", Encoding::Rgba8).await.unwrap();
    let shown = shown_pictures(&daemon);
    assert_eq!(shown.iter().map(|picture| picture.name.as_str()).collect::<Vec<_>>(), ["title", "other"]);
    assert_eq!((shown[0].levels.size(), shown[0].levels.levels()[0].rgba[5]), ([3, 2], [255, 0, 0, 128]));
    // A change without a file moves the picture.
    let moved = changed(picture("title", None, DVec3::Y), |picture| picture.opacity = 0.25);
    change(&mut client, put(moved)).await.unwrap();
    let removed = OverlayChange { pictures: Change::remove("other"), ..OverlayChange::default() };
    change(&mut client, removed).await.unwrap();
    client.save_snapshot("with").await.unwrap();

    let before = client.scene().await.unwrap().revision;
    let many = |bytes: usize| {
        let large = |name: &str| picture(name, Some([&red[..], &vec![0; bytes][..]].concat()), DVec3::X);
        OverlayChange { pictures: Change::All(vec![large("a"), large("b")]), ..OverlayChange::default() }
    };
    let half = MOST_PICTURE_TEXELS as u32 / 4096;
    let bombs = ["a", "b"].map(|name| picture(name, Some(head_of_png([4096, half / 2 + 1])), DVec3::X));
    for (update, part) in [
        (
            put(picture("new", None, DVec3::X)),
            "overlay.pictures.new.png: missing; the scene has no picture of this name",
        ),
        (put(picture("new", Some(b"no picture".to_vec()), DVec3::X)), "overlay.pictures.new.png"),
        (
            put(changed(picture("title", None, DVec3::X), |picture| picture.width_rad = 3.0)),
            "overlay.pictures.title: width_deg",
        ),
        (put(changed(picture("title", None, DVec3::X), |picture| picture.opacity = 1.5)), "opacity"),
        (
            put(changed(picture("title", None, DVec3::X), |picture| picture.anchor = Anchor::Horizon([0.0; 2]))),
            "no observer",
        ),
        (put(picture("../title", Some(red.clone()), DVec3::X)), "overlay.pictures"),
        (many(1 << 20), "bytes in all PNG files: there must be at most 2097152"),
        (
            OverlayChange { pictures: Change::All(bombs.to_vec()), ..OverlayChange::default() },
            "there must be at most 16777216",
        ),
        (
            OverlayChange { pictures: Change::remove("other"), ..OverlayChange::default() },
            "the existing ones are: title",
        ),
    ] {
        match change(&mut client, update).await {
            Err(ClientError::Status { code: Code::InvalidArgument, message }) => {
                assert!(message.contains(part), "{part}: {message}");
            }
            other => panic!("{part}: {other:?}"),
        }
    }
    assert_eq!(client.scene().await.unwrap().revision, before);
    daemon.shutdown().await.unwrap();

    // A restart keeps the picture, and so does a snapshot.
    let daemon = start().await;
    let mut client = daemon.client().await;
    let is_kept = async |client: &mut Client| {
        client.render_frame("flat", Encoding::Rgba8).await.unwrap();
        let shown = shown_pictures(&daemon);
        shown.len() == 1
            && (shown[0].anchor, shown[0].opacity) == (Anchor::Direction(DVec3::Y), 0.25)
            && shown[0].levels.levels()[0].rgba[5] == [255, 0, 0, 128]
    };
    assert!(is_kept(&mut client).await);
    let none = OverlayChange { pictures: Change::All(Vec::new()), ..OverlayChange::default() };
    change(&mut client, none).await.unwrap();
    assert!(!is_kept(&mut client).await);
    client.load_snapshot("with", None).await.unwrap();
    assert!(is_kept(&mut client).await);
    daemon.shutdown().await.unwrap();
}
