//! Tests keys, which are pressed through the X server.

use steradian::service::Client;

use crate::{
    Test,
    desktop::{Desktop, Pixels, until},
    program::{Running, Scene},
};

pub const TESTS: &[Test] = &[
    ("keys::blackout_test_pattern_and_names_toggle", all_of_show),
    ("keys::daemon_keys_do_not_quit_and_blackout_does_not_affect_clients", of_serve),
];

const SCENE: &str = r#"
[scene]
catalogues = ["builtin:bright"]
[[views]]
name = "ahead"
type = "perspective"
size = [320, 200]
fov_y_deg = 50.0
[[windows]]
view = "ahead"
position = [0, 0]
"#;

const SIZE: [u16; 2] = [320, 200];

/// Waits until a window has the keyboard focus and shows the expected picture. The desktop has no window manager.
fn ready(desktop: &Desktop, running: &Running, expected: &Pixels) {
    desktop.until_seen([0, 0], expected, "picture");
    until(|| desktop.has_focus().then_some(()), || format!("no keyboard:\n{}", running.log()));
}

fn all_of_show() -> Result<(), String> {
    let desktop = Desktop::virtual_frame_buffer()?;
    let scene = Scene::new(SCENE);
    let picture = Pixels::of_png(&scene.render(&[]).join("ahead.png"));
    let pattern = Pixels::of_png(&scene.render(&["views.ahead.test_pattern=true"]).join("ahead.png"));
    assert!(picture.differences(&pattern).0 > 500);
    desktop.park_pointer([1500, 850]);
    let mut show = scene.show(&desktop.display, &[]);
    ready(&desktop, &show, &picture);
    let pixels = || desktop.pixels([0, 0], SIZE);
    desktop.press('b');
    until(|| pixels().is_black().then_some(()), || format!("not black: {}", pixels().brightest()));
    desktop.press('b');
    desktop.until_seen([0, 0], &picture, "after blackout");
    desktop.press('t');
    desktop.until_seen([0, 0], &pattern, "test pattern");
    desktop.press('t');
    desktop.until_seen([0, 0], &picture, "after test pattern");
    desktop.press('i');
    // The overlay has white letters on a black plate at the centre.
    let middle = || desktop.pixels([110, 70], [100, 60]);
    let white = || middle().codes.iter().filter(|code| **code == [255; 3]).count();
    until(|| (white() > 100).then_some(()), || format!("{} white pixels", white()));
    assert!(middle().codes.iter().filter(|code| **code == [0; 3]).count() > 1000);
    desktop.press('i');
    desktop.until_seen([0, 0], &picture, "after names");
    // Switch to full screen and back. On the full screen, the picture is at the centre of the monitor, magnified to the
    // monitor's height.
    desktop.press('f');
    let corner = || desktop.pixels([1590, 890], [10, 10]);
    let magnified = || desktop.pixels([80, 0], [1440, 900]);
    until(|| (magnified().brightest() > 100).then_some(()), || "not magnified".to_owned());
    assert!(corner().is_black());
    desktop.press('f');
    desktop.until_seen([0, 0], &picture, "after full screen");
    assert!(show.is_running());
    desktop.press_escape();
    assert!(show.wait().success(), "{}", show.log());
    assert!(show.out().starts_with("ahead on screen: "), "{}", show.out());
    Ok(())
}

fn of_serve() -> Result<(), String> {
    let desktop = Desktop::virtual_frame_buffer()?;
    let scene = Scene::new(SCENE);
    let picture = Pixels::of_png(&scene.render(&[]).join("ahead.png"));
    let pattern = Pixels::of_png(&scene.render(&["views.ahead.test_pattern=true"]).join("ahead.png"));
    desktop.park_pointer([1500, 850]);
    let mut serve = scene.serve(Some(&desktop.display));
    let address = format!("http://{}", serve.address());
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
    let mut client = runtime.block_on(Client::connect(&address)).unwrap();
    let mut frame = || {
        let frame = client.render_frame("ahead", steradian::output::Encoding::Rgba8);
        runtime.block_on(frame).unwrap().images.remove(0).data.to_vec()
    };
    ready(&desktop, &serve, &picture);
    let before = frame();
    desktop.press('b');
    until(|| desktop.pixels([0, 0], SIZE).is_black().then_some(()), || "not black".to_owned());
    assert!(frame() == before, "the blackout of windows must not affect clients");
    desktop.press('b');
    desktop.until_seen([0, 0], &picture, "after blackout");
    // A test pattern is a change of the scene, like a client's change.
    desktop.press('t');
    desktop.until_seen([0, 0], &pattern, "test pattern");
    assert!(frame() != before);
    desktop.press('t');
    desktop.until_seen([0, 0], &picture, "after test pattern");
    desktop.press('q');
    desktop.press_escape();
    serve.wait_for_log("do not end the daemon");
    assert!(serve.is_running());
    assert!(frame() == before);
    assert!(serve.terminate().success(), "{}", serve.log());
    Ok(())
}
