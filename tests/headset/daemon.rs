//! Tests `serve` with a headset: the runtime starts late, ends, and returns, while the other views continue.

use std::time::Duration;

use steradian::{
    output::Encoding,
    service::{
        CameraUpdate, ReceivedFrame,
        proto::{HeadsetStats, ViewImage},
    },
};
use tonic::Code;

use crate::{
    monado::{Monado, Service, harness::Test},
    program::{Daemon, Resources, executable, until},
};

pub const TESTS: &[Test] = &[
    Test::Long("daemon_survives_ten_kills_of_the_runtime", killed_ten_times),
    Test::WithMonado("runtime_may_end_while_the_daemon_connects", runtime_dies_early),
    Test::WithMonado("daemon_connects_to_a_runtime_started_later", runtime_comes_later),
    Test::WithMonado("mirror_and_another_view_stream_together", mirror_streams),
    Test::WithMonado("recentring_is_counted", recentring_is_counted),
];

/// Configuration with bright stars in a flat view and in the headset.
const SCENE: &str = r#"
[scene]
catalogues = ["builtin:bright"]
[[views]]
name = "flat"
type = "perspective"
size = [64, 48]
fov_y_deg = 60.0
[headset]
enabled = true
name = "eyes"
resolution_scale = 0.5
"#;

fn is_connected(headset: &HeadsetStats) -> bool {
    headset.status.as_ref().unwrap().connected
}

/// The runtime is killed ten times while one daemon runs. The daemon survives, the stream of the flat view never stops,
/// and the stream of the mirror continues whenever the runtime is back. The daemon releases the resources of lost
/// sessions.
fn killed_ten_times(monado: &'static Monado) {
    const ROUNDS: u64 = 10;
    let mut service = Service::remote(monado);
    let mut command = service.command(executable());
    // Return free memory to the system at once, so that the resident memory is the memory in use.
    command.env("MALLOC_ARENA_MAX", "1").env("MALLOC_TRIM_THRESHOLD_", "131072");
    let mut daemon = Daemon::of(command, SCENE);
    daemon.wait_for_focus();
    let flat = daemon.stream("flat", Encoding::Rgba8, 0.0);
    let mirror = daemon.stream("eyes", Encoding::Rgba8, 0.0);
    mirror.wait_beyond(0);

    let mut resources: Vec<Resources> = vec![daemon.program.resources()];
    for round in 1..=ROUNDS {
        let before = daemon.headset();
        service.kill();
        let lost = daemon.wait_for_headset(|headset| headset.losses == round && !is_connected(headset));
        let status = lost.status.as_ref().unwrap();
        assert!(status.retrying, "{lost:?}");
        let without = daemon.program.resources();
        let frames = flat.count();
        for step in 0..3 {
            let position = Some([1e9 * round as f64, f64::from(step), 0.0]);
            let update = CameraUpdate { position_m: position, ..CameraUpdate::default() };
            let camera = daemon.call(async |client| client.set_camera(&update).await).unwrap();
            let shows =
                || flat.received().last.is_some_and(|frame| frame.camera_revision >= camera.revision).then_some(());
            until(shows, || format!("no frame of {camera:?}"));
        }
        let meanwhile = flat.count() - frames;
        assert!(meanwhile >= 3, "{meanwhile}");
        let mirrored = mirror.count();
        service.restart();
        let returned = daemon.wait_for_headset(is_connected);
        mirror.wait_beyond(mirrored + 2);
        assert_eq!((returned.sessions, returned.losses), (round + 1, round), "{returned:?}");
        assert!(returned.frames >= before.frames, "counts continue: {before:?}, {returned:?}");
        let now = daemon.program.resources();
        println!("loss {round}: {}; {meanwhile} frames of the flat view until then", status.reason);
        println!("without: {without:?}, back: {now:?}");
        assert!(
            without.threads < now.threads && without.files < now.files,
            "the daemon releases the resources of a lost session"
        );
        resources.push(now);
    }
    // A session with its device uses some 10 MiB, 10 threads, 3 files and 100 mappings: even a single leaked session
    // exceeds the limits.
    let (second, tenth) = (resources[2], resources[10]);
    println!("after the second return: {second:?}, after the tenth: {tenth:?}");
    assert!(tenth.resident_kib < second.resident_kib + 8 * 1024, "{second:?}, {tenth:?}");
    for (before, after, more) in
        [(second.files, tenth.files, 2), (second.threads, tenth.threads, 4), (second.mappings, tenth.mappings, 60)]
    {
        assert!(after <= before + more, "{second:?}, {tenth:?}");
    }
    let last = daemon.headset();
    println!("{} sessions, {} losses, {} frames rendered", last.sessions, last.losses, last.rendered);
    assert_eq!((last.sessions, last.losses), (ROUNDS + 1, ROUNDS));
    println!("flat view: {} frames, mirror: {} frames, each in one stream", flat.count(), mirror.count());

    let ended = daemon.terminate();
    assert_eq!(ended.code, Some(0), "{}", ended.err);
}

/// The runtime dies just after a daemon has created its instance, which counts as a failed attempt, or just after the
/// daemon has created its session, which counts as a loss.
fn runtime_dies_early(monado: &'static Monado) {
    let mut service = Service::remote(monado);
    // The runtime's library logs the first event, and the program logs the second.
    for (made, sessions) in [("Instance created", 0), ("headset: Monado", 1)] {
        let mut daemon = Daemon::start(&service, SCENE);
        daemon.program.wait_for_log(made, 1);
        service.kill();
        let tried = daemon.wait_for_headset(|headset| !is_connected(headset) && headset.losses == sessions);
        daemon.program.wait_for_log("no OpenXR runtime answers", 1);
        service.restart();
        let back = daemon.wait_for_focus();
        println!(
            "after `{made}`: {} sessions, {} losses; then {}, {}",
            tried.sessions, tried.losses, back.sessions, back.losses
        );
        println!("  {}", daemon.program.log().lines().find(|line| line.contains("trying again")).unwrap());
        assert_eq!((back.sessions, back.losses), (sessions + 1, sessions), "{back:?}");
        assert_eq!(daemon.terminate().code, Some(0));
    }
}

/// Size of the eyes in `SCENE`: half of the size that the runtime recommends.
const EYES: [(&str, [u32; 2]); 2] = [("left", [160, 120]), ("right", [160, 120])];

fn assert_eyes(frame: &ReceivedFrame) {
    assert_eq!(frame.view, "eyes");
    let eyes: Vec<(&str, [u32; 2])> =
        frame.images.iter().map(|image| (image.part.as_str(), [image.width, image.height])).collect();
    assert_eq!(eyes, EYES);
    assert!(frame.images.iter().all(|image| image.data.len() == 160 * 120 * 4), "four bytes per pixel");
    assert!(frame.pose_time <= frame.render_time, "{:?}, {:?}", frame.pose_time, frame.render_time);
}

/// A daemon that starts before the runtime has no frames of the headset and reports the reason; frames appear when the
/// runtime starts.
fn runtime_comes_later(monado: &'static Monado) {
    let mut service = Service::remote(monado);
    service.kill();
    let mut daemon = Daemon::start(&service, SCENE);
    let tried = |headset: &HeadsetStats| {
        headset
            .status
            .as_ref()
            .is_some_and(|status| !status.connected && status.retrying && status.reason.contains("no OpenXR runtime"))
    };
    println!("{:?}", daemon.wait_for_headset(tried).status);
    let refused = daemon.frame("eyes", Encoding::Rgba8).unwrap_err();
    println!("{refused}");
    assert_eq!(refused.code(), Some(Code::Unavailable));
    assert!(refused.to_string().contains("no OpenXR runtime answers"), "{refused}");
    let views = daemon.call(async |client| client.views().await).unwrap();
    let forms = |name: &str| views.iter().find(|view| view.name == name).unwrap().images.clone();
    assert_eq!((forms("eyes"), forms("flat").len()), (vec![], 1));
    let mirror = daemon.stream("eyes", Encoding::Rgba8, 0.0);
    assert_eq!(mirror.count(), 0);

    service.restart();
    let connected = daemon.wait_for_focus();
    println!("{:?}", connected.status);
    assert_eq!((connected.sessions, connected.losses), (1, 0), "{connected:?}");
    assert_eyes(&mirror.wait_beyond(0));
    assert_eyes(&daemon.frame("eyes", Encoding::Rgba8).unwrap());
    let views = daemon.call(async |client| client.views().await).unwrap();
    let eyes = views.into_iter().find(|view| view.name == "eyes").unwrap();
    let sizes = |images: &[ViewImage]| -> Vec<(String, [u32; 2])> {
        images.iter().map(|image| (image.part.clone(), [image.width, image.height])).collect()
    };
    let expected = EYES.map(|(part, size)| (part.to_owned(), size));
    assert_eq!((eyes.kind.as_str(), sizes(&eyes.images)), ("headset", expected.to_vec()));
    assert_eq!(daemon.terminate().code, Some(0));
}

/// Two streams of the eyes and one of the flat view run at the same time, each with its own encoding and rate.
fn mirror_streams(monado: &'static Monado) {
    const SLOW_HZ: f64 = 1.0;
    let service = Service::remote(monado);
    let mut daemon = Daemon::start(&service, SCENE);
    daemon.wait_for_focus();
    let every = daemon.stream("eyes", Encoding::Rgba8, 0.0);
    let slow = daemon.stream("eyes", Encoding::Rgb32f, SLOW_HZ);
    let flat = daemon.stream("flat", Encoding::Png, 0.0);
    while slow.count() < 3 {
        let update = CameraUpdate { position_m: Some([0.0, 0.0, flat.count() as f64]), ..CameraUpdate::default() };
        let camera = daemon.call(async |client| client.set_camera(&update).await).unwrap();
        let shows = || flat.received().last.is_some_and(|frame| frame.camera_revision >= camera.revision).then_some(());
        until(shows, || format!("no frame of {camera:?}"));
    }
    let [every, slow, flat] = [every, slow, flat].map(|stream| stream.received());
    println!("frames: {} of the eyes, {} at {SLOW_HZ} Hz, {} of the flat view", every.frames, slow.frames, flat.frames);
    assert!(every.frames > slow.frames && flat.frames > slow.frames, "each stream has its rate");
    // The rate limits the times at which frames are requested; the poses are queried a moment later.
    let shortest = Duration::from_secs_f64(0.9 / SLOW_HZ);
    for received in [&every, &slow] {
        let between = received.pose_times.windows(2).map(|two| two[1].duration_since(two[0]).unwrap());
        assert!(
            between.clone().all(|between| between > Duration::ZERO),
            "every frame must have a new pose: {received:?}"
        );
        assert_eq!(between.clone().all(|between| between >= shortest), std::ptr::eq(received, &slow), "{received:?}");
    }
    assert_eyes(&every.last.unwrap());
    let slow = slow.last.unwrap();
    let bytes: Vec<usize> = slow.images.iter().map(|image| image.data.len()).collect();
    assert_eq!((slow.images[0].encoding, bytes), (Encoding::Rgb32f, vec![160 * 120 * 12; 2]));
    let flat = flat.last.unwrap();
    assert_eq!((flat.view.as_str(), flat.images.len()), ("flat", 1));
    let image = &flat.images[0];
    assert_eq!((image.part.as_str(), image.width, image.height, &image.data[1..4]), ("", 64, 48, &b"PNG"[..]));
    assert_eq!(daemon.terminate().code, Some(0));
}

/// Clients are informed how often the origin of the room was moved.
fn recentring_is_counted(monado: &'static Monado) {
    let service = Service::remote(monado);
    let mut daemon = Daemon::start(&service, SCENE);
    assert_eq!(daemon.wait_for_focus().recentred, 0);
    for times in 1..=2 {
        service.control(&["-c"]);
        let headset = daemon.wait_for_headset(|headset| headset.recentred >= times);
        println!("recentred {} times, {} session", headset.recentred, headset.sessions);
        assert_eq!((headset.recentred, headset.sessions), (times, 1));
    }
    assert_eq!(daemon.terminate().code, Some(0));
}
