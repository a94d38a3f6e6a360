//! Tests the messages for a missing display and for wrong configurations. Most of these tests need no X server.

use steradian::service::Client;

use crate::{
    Test,
    desktop::Desktop,
    program::{Scene, describe, steradian},
};

pub const TESTS: &[Test] = &[
    ("absent::show_reports_a_missing_display", no_display),
    ("absent::serve_runs_without_a_display", serve_without),
    ("absent::daemon_survives_the_end_of_its_display", outlives),
    ("absent::wrong_windows_are_refused_with_key_and_valid_values", wrong_windows),
];

const SCENE: &str = r#"
[scene]
catalogues = ["builtin:bright"]
[[views]]
name = "ahead"
type = "perspective"
size = [64, 48]
fov_y_deg = 50.0
[[views]]
name = "pair"
type = "stereo"
size = [64, 48]
ipd_m = 0.064
fov = { left_deg = -40.0, right_deg = 40.0, up_deg = 35.0, down_deg = -35.0 }
"#;

fn no_display() -> Result<(), String> {
    let scene = Scene::new(SCENE);
    let path = scene.path();
    for (display, expected) in [
        (None, "neither WAYLAND_DISPLAY nor DISPLAY is set"),
        (Some(":4711"), "DISPLAY is :4711, which does not answer"),
    ] {
        for arguments in [&["show", "--config", &path][..], &["show", "--monitors"]] {
            let output = steradian(arguments, display).output().unwrap();
            assert_eq!(output.status.code(), Some(69), "{}", describe(&output));
            let errors = String::from_utf8(output.stderr).unwrap();
            assert_eq!(errors.lines().count(), 1, "{errors}");
            assert!(errors.starts_with("error: no display: ") && errors.contains(expected), "{errors}");
        }
    }
    Ok(())
}

fn serve_without() -> Result<(), String> {
    let scene = Scene::new(&format!("{SCENE}[[windows]]\nview = 'ahead'\n"));
    let mut serve = scene.serve(None);
    let address = format!("http://{}", serve.address());
    serve.wait_for_log("cannot open windows: neither WAYLAND_DISPLAY nor DISPLAY is set");
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
    runtime.block_on(async {
        let mut client = Client::connect(&address).await.unwrap();
        let frame = client.render_frame("ahead", steradian::output::Encoding::Rgba8).await.unwrap();
        assert_eq!(frame.images.len(), 1);
        let stats = client.watch_stats(None).await.unwrap().next().await.unwrap().unwrap();
        let [window] = &stats.windows[..] else { panic!("{:?}", stats.windows) };
        assert_eq!((window.name.as_str(), window.state.as_str(), window.frames), ("ahead", "no_display", 0));
        assert!(window.reason.contains("DISPLAY"), "{}", window.reason);
    });
    assert!(serve.is_running());
    assert!(serve.terminate().success(), "{}", serve.log());
    Ok(())
}

/// The daemon survives when its X server is killed.
fn outlives() -> Result<(), String> {
    let desktop = Desktop::virtual_frame_buffer()?;
    let scene = Scene::new(&format!("{SCENE}[[windows]]\nview = 'ahead'\n"));
    let mut serve = scene.serve(Some(&desktop.display));
    let address = format!("http://{}", serve.address());
    serve.wait_for_log("TRACE ahead ");
    drop(desktop);
    serve.wait_for_log("the X server has ended");
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
    runtime.block_on(async {
        let mut client = Client::connect(&address).await.unwrap();
        for _ in 0..3 {
            let frame = client.render_frame("ahead", steradian::output::Encoding::Rgba8).await.unwrap();
            assert_eq!(frame.images.len(), 1);
        }
    });
    assert!(serve.is_running());
    assert!(serve.terminate().success(), "{}", serve.log());
    Ok(())
}

fn wrong_windows() -> Result<(), String> {
    for (window, key, expected) in [
        ("view = 'astern'", "windows[0].view", "must be one of ahead, pair"),
        ("view = 'pair'", "windows[0].part", "must be one of left, right"),
        ("view = 'pair'\npart = 'middle'", "windows[0].part", "must be one of left, right"),
        ("view = 'ahead'\npart = 'left'", "windows[0].part", "leave it out"),
        ("view = 'ahead'\nmonitor = 0", "windows[0].monitor", "numbers of monitors begin at 1"),
        ("view = 'ahead'\nmonitor = ''", "windows[0].monitor", "such as \"DP-1\""),
        ("view = 'ahead'\nmonitor = { serial = 'x' }", "windows[0].monitor.serial", "expected `edid`"),
        ("view = 'ahead'\nmonitor = true", "windows[0].monitor", "{ edid ="),
        ("view = 'ahead'\nformat = 'rgb12'", "windows[0].format", "`srgb8`, `rgb10`, `hdr`"),
        ("view = 'ahead'\nfull_screen = true", "windows[0].full_screen", "`fullscreen`"),
        ("view = 'ahead'\nfullscreen = true\nsize = [3, 4]", "windows[0].size", "leave it out"),
        ("view = 'ahead'\nsize = [0, 4]", "windows[0].size", "must be between 1 and 32767"),
        ("view = 'ahead'\nposition = [0, 40000]", "windows[0].position", "between -32767 and 32767"),
        ("view = 'ahead'\nname = 'a b'", "windows[0].name", "letters, digits"),
        ("view = 'ahead'\n[[windows]]\nview = 'ahead'", "windows[1].name", "names must be unique"),
        (
            "view = 'ahead'\nmonitor = 1\nfullscreen = true\n[[windows]]\nview = 'pair'\npart = 'left'\nmonitor = 1\nfullscreen = true",
            "windows[1].monitor",
            "also fills monitor number 1",
        ),
        ("view = 'ahead'\nformat = 'hdr'\n[overlay]\ngrids = [{ kind = 'galactic' }]", "windows[0].format", "srgb8"),
    ] {
        let scene = Scene::new(&format!("{SCENE}[[windows]]\n{window}\n"));
        let output = steradian(&["show", "--config", &scene.path()], None).output().unwrap();
        let errors = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(64), "{window}: {errors}");
        assert!(errors.contains(key) && errors.contains(expected), "{window}: {errors}");
    }
    Ok(())
}
