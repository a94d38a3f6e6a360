//! Windows of one frame show the same frame.

use std::collections::HashMap;

use steradian::service::{CameraUpdate, Client, ReceivedStats};

use crate::{
    Test,
    desktop::{Desktop, Pixels, until},
    program::{Running, Scene},
    theatre,
};

pub const TESTS: &[Test] = &[
    ("frames::three_windows_show_the_same_frames_all_the_time", three_windows),
    ("frames::windows_of_a_daemon_follow_its_camera_together_and_tell_their_figures", of_a_daemon),
];

/// A flat view, a dome, and a projector of two that share the light.
pub const THREE: &str = r#"
[scene]
catalogues = ["builtin:bright"]
[[views]]
name = "ahead"
type = "perspective"
size = [160, 90]
fov_y_deg = 50.0
[[views]]
name = "dome"
type = "dome_master"
size = [128, 128]
[[views]]
name = "projector"
type = "projector"
file = "projector.data"
size = [160, 100]
[[windows]]
view = "ahead"
position = [0, 0]
[[windows]]
view = "dome"
position = [200, 0]
[[windows]]
view = "projector"
position = [400, 0]
"#;

/// The mesh of a projector; its share of the light falls from left to right.
fn mesh() -> String {
    let shares = |column: usize, _| 1.0 - 0.1 * column as f64;
    theatre::bourke(&theatre::projectors()[0], 9, 7, shares)
}

const FRAMES: usize = 300;

/// Numbers of frames as they were presented: for each frame its numbers by windows.
fn presented(log: &str) -> Vec<HashMap<String, u64>> {
    let of_line = |line: &str| {
        let (_, told) = line.split_once("TRACE ")?;
        told.split(", ")
            .map(|one| {
                one.rsplit_once(' ').and_then(|(name, number)| Some((name.trim().to_owned(), number.parse().ok()?)))
            })
            .collect::<Option<HashMap<String, u64>>>()
    };
    log.lines().filter_map(of_line).collect()
}

/// Where windows did not show the same frame at the same time, each with a new frame.
fn breaches(presented: &[HashMap<String, u64>], windows: usize) -> Vec<String> {
    let mut found = Vec::new();
    let mut last = 0;
    for (index, numbers) in presented.iter().enumerate() {
        let first = numbers.values().next().copied().unwrap_or(0);
        if numbers.len() != windows || numbers.values().any(|number| *number != first) || first <= last {
            found.push(format!("{index}: {numbers:?} after {last}"));
        }
        last = first;
    }
    found
}

fn three_windows() -> Result<(), String> {
    let desktop = Desktop::virtual_frame_buffer()?;
    let scene = Scene::new(THREE);
    scene.write("projector.data", &mesh());
    let out = scene.render(&[]);
    desktop.park_pointer([1500, 850]);
    let mut show = scene.show(&desktop.display, &["--frames", &FRAMES.to_string()]);
    // The projector's share of the light is in its window.
    desktop.until_seen([400, 0], &Pixels::of_png(&out.join("projector.png")), "projector");
    assert!(show.wait().success(), "{}", show.log());
    let presented = presented(&show.log());
    assert_eq!(presented.len(), FRAMES, "{}", show.log());
    assert_eq!(breaches(&presented, 3), [""; 0]);
    // What is not the same is found.
    let mut wrong = presented.clone();
    *wrong[7].get_mut("dome").unwrap() += 1;
    wrong[9].remove("ahead");
    // One number too many may be that of the next frame too.
    assert!(breaches(&wrong, 3).len() >= 2);
    let report = show.out();
    assert!(report.lines().all(|line| line.contains(": 300 frames")), "{report}");
    Ok(())
}

/// A daemon, its client, and a runtime for that.
struct Controlled {
    serve: Running,
    client: Client,
    runtime: tokio::runtime::Runtime,
}

impl Controlled {
    fn new(serve: Running) -> Self {
        let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(1).enable_all().build().unwrap();
        let address = format!("http://{}", serve.address());
        let client = runtime.block_on(Client::connect(&address)).unwrap();
        Self { serve, client, runtime }
    }

    fn stats(&mut self) -> ReceivedStats {
        self.runtime.block_on(async {
            let mut stats = self.client.watch_stats(None).await.unwrap();
            stats.next().await.unwrap().unwrap()
        })
    }
}

fn of_a_daemon() -> Result<(), String> {
    let desktop = Desktop::virtual_frame_buffer()?;
    let scene = Scene::new(THREE);
    scene.write("projector.data", &mesh());
    let mut daemon = Controlled::new(scene.serve(Some(&desktop.display)));
    until(|| daemon.stats().windows.iter().all(|window| window.frames > 0).then_some(()), || "no frames".to_owned());
    // A camera that moves: every frame is another one.
    for step in 1..=100 {
        let angle = f64::from(step) * 0.01;
        let update = CameraUpdate {
            orientation: Some([0.0, (angle / 2.0).sin(), 0.0, (angle / 2.0).cos()]),
            ..CameraUpdate::default()
        };
        daemon.runtime.block_on(daemon.client.set_camera(&update)).unwrap();
        std::thread::sleep(std::time::Duration::from_millis(10));
    }
    let shown = |daemon: &Controlled| presented(&daemon.serve.log());
    let before = shown(&daemon).len();
    assert!(before >= 10, "{before} frames of a camera that moves");
    assert_eq!(breaches(&shown(&daemon), 3), [""; 0]);
    let stats = daemon.stats();
    let names: Vec<&str> = stats.windows.iter().map(|window| window.name.as_str()).collect();
    assert_eq!(names, ["ahead", "dome", "projector"]);
    for window in &stats.windows {
        assert_eq!((window.state.as_str(), window.monitor.as_str()), ("shown", "screen"), "{window:?}");
        assert!(window.frames >= 10 && window.intervals.is_some(), "{window:?}");
        // This server tells no refresh rate, so none is missed.
        assert_eq!((window.refresh_hz, window.missed), (None, None), "{window:?}");
    }
    // A scene that rests is drawn once a second at most.
    std::thread::sleep(std::time::Duration::from_secs(1));
    let rested = shown(&daemon).len();
    std::thread::sleep(std::time::Duration::from_secs(2));
    assert!(shown(&daemon).len() <= rested + 4, "{} frames in two seconds of rest", shown(&daemon).len() - rested);
    assert!(daemon.serve.terminate().success(), "{}", daemon.serve.log());
    Ok(())
}
