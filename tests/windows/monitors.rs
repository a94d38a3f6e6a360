//! Monitors that are disconnected and reconnected, and the ways to name them in a configuration.

use steradian::service::{Client, proto::WindowStats};

use crate::{
    Test,
    desktop::{Desktop, Pixels},
    program::{Scene, describe, steradian},
};

pub const TESTS: &[Test] = &[
    ("monitors::window_disappears_and_returns_with_its_monitor", away_and_back),
    ("monitors::monitors_are_chosen_by_name_number_and_edid", found),
];

const VIEWS: &str = r#"
[scene]
catalogues = ["builtin:bright"]
[[views]]
name = "ahead"
type = "perspective"
size = [320, 200]
fov_y_deg = 50.0
[[views]]
name = "dome"
type = "dome_master"
size = [768, 768]
[overlay]
grids = [{ kind = "altitude" }]
"#;

fn away_and_back() -> Result<(), String> {
    let desktop = Desktop::dummy_monitors()?;
    let windows = r#"
[[windows]]
view = "ahead"
monitor = "DUMMY0"
position = [10, 20]
[[windows]]
view = "dome"
monitor = "DUMMY1"
fullscreen = true
"#;
    let scene = Scene::new(&format!("{VIEWS}{windows}"));
    let out = scene.render(&[]);
    let [ahead, dome] = ["ahead.png", "dome.png"].map(|file| Pixels::of_png(&out.join(file)));
    desktop.park_pointer([1000, 700]);
    let mut serve = scene.serve(Some(&desktop.display));
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
    let mut client = runtime.block_on(Client::connect(&format!("http://{}", serve.address()))).unwrap();
    let mut windows = || -> Vec<WindowStats> {
        runtime.block_on(async { client.watch_stats(None).await.unwrap().next().await.unwrap().unwrap().windows })
    };
    let mut state = |wanted: [&str; 2]| {
        let mut last = Vec::new();
        for _ in 0..600 {
            last = windows();
            if last.iter().map(|window| window.state.as_str()).eq(wanted) {
                return last;
            }
            std::thread::sleep(std::time::Duration::from_millis(50));
        }
        panic!("not {wanted:?}: {last:?}");
    };
    // The second monitor is not connected yet, but the first window does not wait for it.
    let without = state(["shown", "monitor_missing"]);
    assert!(without[1].reason.contains("no monitor `DUMMY1`; there are: 1 DUMMY0 1024x768"), "{}", without[1].reason);
    desktop.until_seen([10, 20], &ahead, "the first window alone");
    for round in 0..2 {
        desktop.connect_second();
        let both = state(["shown", "shown"]);
        assert_eq!((both[0].monitor.as_str(), both[1].monitor.as_str()), ("DUMMY0", "DUMMY1"));
        assert!(both[0].refresh_hz.is_some_and(|rate| (50.0..100.0).contains(&rate)), "{both:?}");
        // The picture is as high as the monitor, and at its centre.
        desktop.until_seen([1024 + 128, 0], &dome, "on the second monitor");
        assert!(desktop.pixels([1024, 0], [128, 768]).is_black());
        desktop.until_seen([10, 20], &ahead, "the first window with both monitors");
        desktop.disconnect_second();
        let one = state(["shown", "monitor_missing"]);
        assert_eq!(one[1].monitor, "", "round {round}");
        desktop.until_seen([10, 20], &ahead, "the first window after the second monitor was disconnected");
        assert!(desktop.pixels([1024, 0], [1024, 768]).is_black(), "the window still exists");
    }
    assert!(serve.terminate().success(), "{}", serve.log());
    Ok(())
}

/// Returns an EDID with vendor `DEL`, product 0x40f1 and serial number 0x123.
fn edid() -> [u8; 128] {
    let mut edid = [0_u8; 128];
    edid[1..7].fill(255);
    edid[8..10].copy_from_slice(&((4_u16 << 10) | (5 << 5) | 12).to_be_bytes());
    edid[10..12].copy_from_slice(&0x40f1_u16.to_le_bytes());
    edid[12..16].copy_from_slice(&0x123_u32.to_le_bytes());
    edid
}

fn found() -> Result<(), String> {
    let desktop = Desktop::dummy_monitors()?;
    desktop.connect_second();
    desktop.set_edid("DUMMY1", &edid());
    let listed = steradian(&["show", "--monitors"], Some(&desktop.display)).output().unwrap();
    let lines: Vec<String> = String::from_utf8(listed.stdout.clone()).unwrap().lines().map(str::to_owned).collect();
    assert_eq!(lines.len(), 2, "{}", describe(&listed));
    assert!(lines[0].starts_with("1 DUMMY0 1024x768 at 0,0 "), "{lines:?}");
    assert!(
        lines[1].starts_with("2 DUMMY1 1024x768 at 1024,0 ") && lines[1].ends_with("edid DEL-40F1-00000123"),
        "{lines:?}"
    );
    desktop.park_pointer([1000, 700]);
    for monitor in ["2", "'DUMMY1'", "{ edid = 'DEL-40F1-00000123' }"] {
        let window = format!("[[windows]]\nview = 'ahead'\nposition = [30, 40]\nmonitor = {monitor}\n");
        let scene = Scene::new(&format!("{VIEWS}{window}"));
        let ahead = Pixels::of_png(&scene.render(&[]).join("ahead.png"));
        let mut show = scene.show(&desktop.display, &[]);
        desktop.until_seen([1024 + 30, 40], &ahead, monitor);
        assert!(show.terminate().success(), "{}", show.log());
        assert!(show.out().starts_with("ahead on DUMMY1: "), "{}", show.out());
    }
    // A window without a position is centred. If a second window would fill the same monitor, it reports why it does
    // not.
    let windows = "[[windows]]\nview = 'dome'\nmonitor = 2\nfullscreen = true\n\
                   [[windows]]\nview = 'ahead'\nmonitor = 'DUMMY1'\nfullscreen = true\n\
                   [[windows]]\nname = 'third'\nview = 'ahead'\nmonitor = 1\n";
    let scene = Scene::new(&format!("{VIEWS}{windows}"));
    let out = scene.render(&[]);
    let mut show = scene.show(&desktop.display, &[]);
    desktop.until_seen([352, 284], &Pixels::of_png(&out.join("ahead.png")), "in the middle");
    desktop.until_seen([1024 + 128, 0], &Pixels::of_png(&out.join("dome.png")), "full screen");
    show.wait_for_log("window `dome` already fills monitor `DUMMY1`");
    assert!(show.terminate().success(), "{}", show.log());
    Ok(())
}
