//! Views that are created, changed and deleted while the daemon runs.

use std::{sync::atomic::Ordering::SeqCst, time::Duration};

use steradian::{
    config::{FisheyeSpec, MappingConfig, ViewGeometry, ViewKindSpec, ViewSpec},
    output::Encoding,
    plan::settings::{ExposureKeys, GlareKeys, ToneMapKeys},
    service::{CameraUpdate, Client, ClientError, FrameReceiver, ReceivedFrame, SceneUpdate, ViewUpdate},
};
use tonic::Code;

use crate::daemon::{Daemon, LARGE, small_rig, until, within};

fn spec(text: &str) -> ViewSpec {
    ViewSpec::from_toml(text).unwrap().0
}

pub fn fisheye(name: &str, size: [u32; 2], fov_deg: f64) -> ViewSpec {
    let kind = ViewKindSpec::Fisheye(FisheyeSpec { size, mapping: MappingConfig::Equidistant, fov_deg });
    ViewSpec { geometry: ViewGeometry { kind, ..ViewGeometry::default() }, ..ViewSpec::custom(name) }
}

/// Returns a round view with this diameter, pixels.
pub fn round(name: &str, size: u32) -> ViewSpec {
    fisheye(name, [size; 2], 180.0)
}

/// Returns a change to the geometry in a specification.
pub fn geometry(spec: ViewSpec) -> ViewUpdate {
    ViewUpdate { geometry: Some(spec.geometry), ..ViewUpdate::default() }
}

fn at_x(x: f64) -> CameraUpdate {
    CameraUpdate { position_m: Some([x, 0.0, 0.0]), ..CameraUpdate::default() }
}

async fn next(stream: &mut FrameReceiver) -> ReceivedFrame {
    within(stream.next()).await.unwrap().expect("a frame")
}

/// Returns the first frame of a stream that shows a revision of the scene.
async fn showing(stream: &mut FrameReceiver, revision: u64) -> ReceivedFrame {
    loop {
        let frame = next(stream).await;
        if frame.scene_revision >= revision {
            return frame;
        }
    }
}

fn assert_refused<T>(answer: Result<T, ClientError>, code: Code, part: &str) {
    match answer.map(drop) {
        Err(ClientError::Status { code: found, message }) => {
            assert!(found == code && message.contains(part), "{found:?} {message}, expected {code:?} {part}");
        }
        other => panic!("{other:?}, expected {code:?} {part}"),
    }
}

#[tokio::test]
async fn a_view_is_created_streamed_changed_and_deleted_while_others_continue() {
    let daemon = Daemon::start(small_rig()).await;
    let mut client = daemon.client().await;
    let mut others = client.stream_frames("flat", Encoding::Rgba8, 0.0).await.unwrap();
    let mut last = next(&mut others).await.number;

    let definition = spec(
        "name = 'scope'\ntype = 'perspective'\nsize = [8, 5]\nfov_y_deg = 20.0\norientation = [0.0, 0.6, 0.0, 0.8]\n\
         position_m = [0.0, 1.5, 0.0]\nexposure_group = 'optics'\nexposure = { mode = 'manual', ev100 = 2.0 }\n\
         glare = { fraction = 0.25 }\ntest_pattern = true",
    );
    let made = client.create_view(&definition, Some(7)).await.unwrap();
    assert_eq!((made.name.as_str(), made.kind.as_str(), made.revision), ("scope", "perspective", 8));
    assert_eq!((made.images[0].width, made.images[0].height), (8, 5));
    assert_eq!(made.definition.as_ref(), Some(&definition));
    assert_eq!(made.own_keys, ["exposure.ev100", "exposure.mode", "glare.fraction"]);
    assert_eq!(client.view("scope").await.unwrap(), made);
    let names: Vec<String> = client.views().await.unwrap().into_iter().map(|view| view.name).collect();
    assert_eq!(names, ["flat", "eyes", "scope"]);
    assert_eq!(client.scene().await.unwrap().overlay.test_patterns, ["scope"]);
    assert_eq!(client.view("flat").await.unwrap().definition, None, "the test made it without one");

    let mut stream = client.stream_frames("scope", Encoding::Rgba8, 0.0).await.unwrap();
    let frame = next(&mut stream).await;
    assert_eq!((frame.view.as_str(), frame.exposure_ev100, frame.scene_revision), ("scope", frame.exposure_ev100, 8));
    assert_eq!(frame.images[0].data.len(), 8 * 5 * 4);
    // The view has a separate frame, because its settings differ.
    assert!(daemon.controls.framed.lock().unwrap().iter().any(|(names, _)| names == &["scope"]));

    // The stream continues with the new size.
    let mut wider = definition.clone();
    let ViewKindSpec::Perspective(perspective) = &mut wider.geometry.kind else { panic!("a perspective view") };
    (perspective.size, perspective.fov_y_deg) = ([12, 6], Some(10.0));
    let changed = client.update_view("scope", &geometry(wider), Some(8)).await.unwrap();
    assert_eq!((changed.revision, changed.images[0].width, &changed.own_keys), (9, 12, &made.own_keys));
    let frame = showing(&mut stream, 9).await;
    assert_eq!((frame.images[0].width, frame.images[0].height, frame.images[0].data.len()), (12, 6, 12 * 6 * 4));
    // A definition replaces the type and all keys.
    let whole = spec("name = 'scope'\ntype = 'cubemap'\nface_size = 4\nfaces = ['front', 'up']");
    let cube = client.replace_view(&whole, None).await.unwrap();
    assert_eq!((cube.kind.as_str(), cube.own_keys.len(), cube.exposure_group.as_str()), ("cubemap", 0, ""));
    assert!(client.scene().await.unwrap().overlay.test_patterns.is_empty());
    assert_eq!(showing(&mut stream, 10).await.images.len(), 2);
    // Sending back the unchanged definition has no effect.
    let same = client.replace_view(cube.definition.as_ref().unwrap(), None).await.unwrap();
    assert_eq!((same.definition, same.images, same.revision), (cube.definition, cube.images, 11));

    // When earlier views are deleted, the view and its stream stay the same.
    assert_eq!(client.delete_view("eyes", Some(11)).await.unwrap(), 12);
    assert_eq!(showing(&mut stream, 12).await.images.len(), 2);
    assert_eq!(client.delete_view("scope", None).await.unwrap(), 13);
    let end = loop {
        match within(stream.next()).await {
            Ok(Some(_)) => {}
            end => break end,
        }
    };
    assert_refused(end, Code::NotFound, "view `scope` was deleted");
    assert_refused(client.view("scope").await, Code::NotFound, "the views are: flat");
    assert_refused(client.stream_frames("scope", Encoding::Png, 0.0).await, Code::NotFound, "no view `scope`");
    client.set_camera(&at_x(1.0)).await.unwrap();
    loop {
        let frame = next(&mut others).await;
        assert!(frame.number > last, "{} after {last}", frame.number);
        last = frame.number;
        if frame.scene_revision == 13 && frame.camera_revision == 1 {
            break;
        }
    }
    // The last view can be deleted too.
    client.delete_view("flat", None).await.unwrap();
    assert!(client.views().await.unwrap().is_empty());
    assert_refused(client.render_frame("flat", Encoding::Png).await, Code::NotFound, "the views are: none");
    client.create_view(&round("flat", 4), None).await.unwrap();
    assert_eq!(client.render_frame("flat", Encoding::Rgba8).await.unwrap().images[0].width, 4);
    daemon.shutdown().await.unwrap();
}

#[tokio::test]
async fn deleting_a_view_ends_waiting_calls() {
    let daemon = Daemon::start(small_rig()).await;
    let mut client = daemon.client().await;
    let seen = client.next_frame("eyes", Encoding::Rgba8, 0, 0).await.unwrap().number;
    // Begin a frame that is not finished, so that no other frame begins.
    daemon.controls.close_gate();
    let begun = daemon.controls.started.load(SeqCst);
    let mut first = daemon.client().await;
    let first = tokio::spawn(async move { first.render_frame("flat", Encoding::Rgba8).await });
    until(|| daemon.controls.started.load(SeqCst) > begun).await;
    let mut pulling = daemon.client().await;
    let pulls = tokio::spawn(async move { pulling.next_frame("eyes", Encoding::Rgba8, seen, 0).await });
    let mut pulling = daemon.client().await;
    let both = tokio::spawn(async move {
        pulling.next_frames(&[("flat", Encoding::Rgba8, seen), ("eyes", Encoding::Rgba8, seen)]).await
    });
    let mut rendering = daemon.client().await;
    let renders = tokio::spawn(async move { rendering.render_frame("eyes", Encoding::Rgba8).await });
    let mut figures = client.watch_stats(Some(0.1)).await.unwrap();
    while within(figures.next()).await.unwrap().unwrap().streams < 3 {}
    tokio::time::sleep(Duration::from_millis(100)).await;
    client.delete_view("eyes", None).await.unwrap();
    for end in [within(pulls).await.unwrap().map(drop), within(both).await.unwrap().map(drop)] {
        assert_refused(end, Code::NotFound, "view `eyes` was deleted");
    }
    // The call waits for another frame, and is refused unless this frame had begun, in which case it is delivered.
    daemon.controls.open_gate();
    let end = within(renders).await.unwrap();
    if end.is_err() {
        assert_refused(end, Code::NotFound, "view `eyes` was deleted");
    }
    within(first).await.unwrap().unwrap();
    while within(figures.next()).await.unwrap().unwrap().streams > 0 {}
    daemon.shutdown().await.unwrap();
}

#[tokio::test]
async fn refused_changes_keep_the_views() {
    let daemon = Daemon::start(small_rig()).await;
    let mut client = daemon.client().await;
    client.create_view(&round("dome", 8), Some(7)).await.unwrap();
    let good = client.views().await.unwrap();
    let new = || round("new", 8);
    let exposure = Some(ExposureKeys { key: Some(0.2), ..ExposureKeys::default() });
    let glare = |fraction, psf_file: Option<&str>| {
        Some(GlareKeys { fraction, psf_file: psf_file.map(Into::into), ..GlareKeys::default() })
    };
    let far = ViewGeometry { position_m: [1e300, 0.0, 0.0], ..new().geometry };
    let long = "x".repeat(65);
    for (definition, expected, code, reason) in [
        (round("dome", 8), None, Code::AlreadyExists, "view `dome` exists already; the views are: flat, eyes, dome"),
        (round("flat", 8), None, Code::AlreadyExists, "view `flat`"),
        (round("new", 8), Some(7), Code::Aborted, "revision 8, not 7"),
        (round("", 8), None, Code::InvalidArgument, "definition.name: "),
        (
            round("a b", 8),
            None,
            Code::InvalidArgument,
            "definition.name: `a b` is not a valid name: must be one or more letters",
        ),
        (round(&long, 8), None, Code::InvalidArgument, "definition.name: 65 characters: must have at most 64"),
        (fisheye("new", [8; 2], 400.0), None, Code::InvalidArgument, "definition.fov_deg: 400"),
        (fisheye("new", [8; 2], f64::NAN), None, Code::InvalidArgument, "definition.fov_deg"),
        (fisheye("new", [0, 8], 180.0), None, Code::InvalidArgument, "definition.size"),
        (fisheye("new", [20_000, 8], 180.0), None, Code::InvalidArgument, "16384"),
        (ViewSpec { geometry: far, ..new() }, None, Code::InvalidArgument, "definition.position_m[0]: 1e300"),
        (ViewSpec { exposure, ..new() }, None, Code::InvalidArgument, "definition.exposure.key: has no effect"),
        (
            ViewSpec { glare: glare(Some(2.0), None), ..new() },
            None,
            Code::InvalidArgument,
            "definition.glare.fraction: 2",
        ),
        (
            ViewSpec { tone_map: Some(ToneMapKeys { white: Some(4.0), ..ToneMapKeys::default() }), ..new() },
            None,
            Code::InvalidArgument,
            "definition.tone_map.white: has no effect with operator",
        ),
        (
            ViewSpec { glare: glare(None, Some("/etc/passwd")), ..new() },
            None,
            Code::InvalidArgument,
            "definition.glare.psf_file: files come only from the configuration",
        ),
        (
            ViewSpec { exposure_group: Some("a b".to_owned()), ..new() },
            None,
            Code::InvalidArgument,
            "definition.exposure_group",
        ),
        (fisheye("new", [9000; 2], 180.0), None, Code::ResourceExhausted, "at most 67108864 are allowed"),
    ] {
        assert_refused(client.create_view(&definition, expected).await, code, reason);
        assert_eq!(client.views().await.unwrap(), good);
    }
    for (view, update, expected, code, reason) in [
        ("dome", fisheye("dome", [8; 2], 400.0), None, Code::InvalidArgument, "definition.fov_deg: 400"),
        ("dome", fisheye("dome", [20_000, 8], 180.0), None, Code::InvalidArgument, "16384"),
        ("dome", fisheye("dome", [9000; 2], 180.0), None, Code::ResourceExhausted, "at most 67108864"),
        ("dome", fisheye("dome", [8; 2], 90.0), Some(7), Code::Aborted, "revision 8, not 7"),
        ("roof", fisheye("roof", [8; 2], 90.0), None, Code::NotFound, "the views are: flat, eyes, dome"),
        (
            "flat",
            fisheye("flat", [8; 2], 90.0),
            None,
            Code::InvalidArgument,
            "`flat` does not come from a configuration",
        ),
    ] {
        assert_refused(client.update_view(view, &geometry(update), expected).await, code, reason);
    }
    assert_refused(client.delete_view("roof", None).await, Code::NotFound, "the views are: flat, eyes, dome");
    assert_refused(client.delete_view("dome", Some(7)).await, Code::Aborted, "revision 8, not 7");
    assert_eq!(client.views().await.unwrap(), good);

    // The maximum number of views is accepted, and one more is refused.
    for number in 3..32 {
        client.create_view(&round(&format!("v{number}"), 4), None).await.unwrap();
    }
    assert_refused(
        client.create_view(&round("new", 4), None).await,
        Code::ResourceExhausted,
        "there must be at most 32",
    );
    client.delete_view("v3", None).await.unwrap();
    client.create_view(&round("new", 4), None).await.unwrap();
    // A test pattern of an unknown view is refused.
    let pattern = steradian::service::OverlayChange {
        test_patterns: Some(vec!["v3".to_owned()]),
        ..steradian::service::OverlayChange::default()
    };
    let pattern = SceneUpdate { overlay: pattern, ..SceneUpdate::default() };
    assert_refused(client.update_scene(&pattern, None).await, Code::InvalidArgument, "no view `v3`");
    daemon.shutdown().await.unwrap();
}

#[tokio::test]
async fn a_stream_ends_if_its_view_outgrows_the_clients_limit() {
    let daemon = Daemon::start(small_rig()).await;
    let mut client = daemon.client().await;
    client.create_view(&round("dome", 8), None).await.unwrap();
    client.create_view(&round("wide", 16), None).await.unwrap();
    let mut first = client.stream_frames("dome", Encoding::Rgba8, 0.0).await.unwrap();
    let mut large = client.stream_frames("wide", Encoding::Rgb32f, 0.0).await.unwrap();
    next(&mut first).await;
    next(&mut large).await;
    let grown = client.update_view("dome", &geometry(round("dome", LARGE)), None).await.unwrap();
    assert_eq!(showing(&mut first, grown.revision).await.images[0].width, LARGE);
    // Two images with 12 bytes per pixel exceed 512 MiB together with the other stream.
    let grown = client.update_view("wide", &geometry(round("wide", 4800)), None).await.unwrap();
    let end = loop {
        match within(large.next()).await {
            Ok(Some(frame)) => assert!(frame.scene_revision < grown.revision),
            end => break end,
        }
    };
    assert_refused(end, Code::ResourceExhausted, "512 MiB for one client");
    client.update_view("wide", &geometry(round("wide", 16)), None).await.unwrap();
    let revision = client.scene().await.unwrap().revision;
    assert_eq!(showing(&mut first, revision).await.images[0].width, LARGE);
    daemon.shutdown().await.unwrap();
}

async fn streams(client: &mut Client) -> u32 {
    let mut figures = client.watch_stats(Some(0.1)).await.unwrap();
    within(figures.next()).await.unwrap().unwrap().streams
}

#[tokio::test]
async fn two_hundred_views_are_created_and_deleted_during_streams() {
    let daemon = Daemon::start(small_rig()).await;
    let mut client = daemon.client().await;
    let mut others = client.stream_frames("flat", Encoding::Rgba8, 0.0).await.unwrap();
    let mut last = next(&mut others).await.number;
    for cycle in 0..200 {
        let exposure = Some(ExposureKeys { compensation_ev: Some(1.0), ..ExposureKeys::default() });
        let definition = ViewSpec { exposure, ..round("guest", 4 + cycle % 5) };
        let made = client.create_view(&definition, None).await.unwrap();
        let mut guest = client.stream_frames("guest", Encoding::Rgba8, 0.0).await.unwrap();
        let frame = next(&mut guest).await;
        assert_eq!((frame.scene_revision, frame.images[0].width), (made.revision, 4 + cycle % 5));
        client.delete_view("guest", Some(made.revision)).await.unwrap();
        let end = loop {
            match within(guest.next()).await {
                Ok(Some(_)) => {}
                end => break end,
            }
        };
        assert_refused(end, Code::NotFound, "view `guest` was deleted");
        let number = showing(&mut others, made.revision + 1).await.number;
        assert!(number > last, "cycle {cycle}: {number} after {last}");
        last = number;
    }
    assert_eq!(client.scene().await.unwrap().revision, 7 + 400);
    assert_eq!(streams(&mut client).await, 1);
    drop(others);
    let mut left = streams(&mut client).await;
    while left > 0 {
        left = streams(&mut client).await;
    }
    daemon.shutdown().await.unwrap();
}
