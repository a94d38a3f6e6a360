//! Tests that all windows show the same frame at the same time.

use std::{
    collections::HashMap,
    time::{Duration, Instant},
};

use steradian::service::{CameraUpdate, Client, proto::Stats};

use crate::{
    Test,
    desktop::{Desktop, Pixels, until},
    program::{Running, Scene},
    theatre,
};

pub const TESTS: &[Test] = &[
    ("frames::three_windows_always_show_the_same_frames", three_windows),
    ("frames::daemon_windows_follow_the_camera_together_and_report_statistics", of_a_daemon),
];

/// Configuration with windows for a flat view, a dome, and a projector that shares the light with others.
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

/// Returns the mesh of a projector whose share of the light decreases from left to right.
fn mesh() -> String {
    let shares = |column: usize, _| 1.0 - 0.1 * column as f64;
    theatre::bourke(&theatre::projectors()[0], 9, 7, shares)
}

const FRAMES: usize = 300;

/// Returns the frame number that each window showed, for each presentation in the log.
fn presented(log: &str) -> Vec<HashMap<String, u64>> {
    let of_line = |line: &str| {
        let (_, numbers) = line.split_once("TRACE ")?;
        numbers
            .split(", ")
            .map(|one| {
                one.rsplit_once(' ').and_then(|(name, number)| Some((name.trim().to_owned(), number.parse().ok()?)))
            })
            .collect::<Option<HashMap<String, u64>>>()
    };
    log.lines().filter_map(of_line).collect()
}

/// Lists the presentations in which windows did not show the same new frame.
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
    // The window of the projector shows its share of the light.
    desktop.until_seen([400, 0], &Pixels::of_png(&out.join("projector.png")), "projector");
    assert!(show.wait().success(), "{}", show.log());
    let presented = presented(&show.log());
    assert_eq!(presented.len(), FRAMES, "{}", show.log());
    assert_eq!(breaches(&presented, 3), [""; 0]);
    // Errors must be detected.
    let mut wrong = presented.clone();
    *wrong[7].get_mut("dome").unwrap() += 1;
    wrong[9].remove("ahead");
    // There can be more than two breaches, because a wrong number can be taken for that of the next frame.
    assert!(breaches(&wrong, 3).len() >= 2);
    let report = show.out();
    assert!(report.lines().all(|line| line.contains(": 300 frames")), "{report}");
    Ok(())
}

/// A daemon with its client and a runtime.
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

    fn stats(&mut self) -> Stats {
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
    let presented_frames = |daemon: &Controlled| presented(&daemon.serve.log());
    // Move the camera, so that every frame is different, for a second, or for longer on a busy machine.
    let start = Instant::now();
    let mut step = 0;
    while step < 100 || presented_frames(&daemon).len() < 10 {
        assert!(start.elapsed() < Duration::from_secs(60), "fewer than 10 frames of a moving camera");
        step += 1;
        let angle = f64::from(step) * 0.01;
        let update = CameraUpdate {
            orientation: Some([0.0, (angle / 2.0).sin(), 0.0, (angle / 2.0).cos()]),
            ..CameraUpdate::default()
        };
        daemon.runtime.block_on(daemon.client.set_camera(&update)).unwrap();
        std::thread::sleep(Duration::from_millis(10));
    }
    assert_eq!(breaches(&presented_frames(&daemon), 3), [""; 0]);
    let stats = daemon.stats();
    let names: Vec<&str> = stats.windows.iter().map(|window| window.name.as_str()).collect();
    assert_eq!(names, ["ahead", "dome", "projector"]);
    for window in &stats.windows {
        assert_eq!((window.state.as_str(), window.monitor.as_str()), ("shown", "screen"), "{window:?}");
        assert!(window.frames >= 10 && window.intervals.is_some(), "{window:?}");
        // This server reports no refresh rate, so no missed refreshes are counted.
        assert_eq!((window.refresh_hz, window.missed), (None, None), "{window:?}");
    }
    // A scene at rest is drawn at most once per second.
    std::thread::sleep(std::time::Duration::from_secs(1));
    let rested = presented_frames(&daemon).len();
    std::thread::sleep(std::time::Duration::from_secs(2));
    assert!(
        presented_frames(&daemon).len() <= rested + 4,
        "{} frames in two seconds at rest",
        presented_frames(&daemon).len() - rested
    );
    assert!(daemon.serve.terminate().success(), "{}", daemon.serve.log());
    Ok(())
}
