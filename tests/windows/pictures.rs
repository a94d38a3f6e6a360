//! Tests the contents of windows, pixel by pixel.

use crate::{
    Test,
    desktop::{Desktop, Pixels},
    program::Scene,
};

pub const TESTS: &[Test] = &[
    ("pictures::windows_show_the_pixels_of_render", same_as_render),
    ("pictures::scaled_window_shows_means_of_linear_light_with_the_same_aspect", scaled),
    ("pictures::each_image_gets_a_window_by_default", one_for_each_image),
    ("pictures::uncovered_parts_of_windows_are_redrawn", uncovered),
];

/// Configuration with stars, a body, two projections, two eyes, and labels.
const VIEWS: &str = r#"
[scene]
catalogues = ["builtin:bright", { galaxy = { stars = 20000, seed = 1, fainter_than = 6.5 } }]
[scene.camera]
orientation = [0.1714987, 0.193844, 0.7234357, 0.6400418]
[overlay]
grids = [{ kind = "equatorial" }]
[[views]]
name = "ahead"
type = "perspective"
size = [321, 200]
fov_y_deg = 50.0
[[views]]
name = "dome"
type = "dome_master"
size = [256, 256]
[[views]]
name = "pair"
type = "stereo"
size = [160, 120]
ipd_m = 0.064
fov = { left_deg = -40.0, right_deg = 40.0, up_deg = 35.0, down_deg = -35.0 }
"#;

fn same_as_render() -> Result<(), String> {
    let desktop = Desktop::virtual_frame_buffer()?;
    // Two windows show the same image, one of them to the right of all other windows.
    let windows = r#"
[[windows]]
view = "ahead"
position = [0, 0]
[[windows]]
view = "dome"
position = [400, 10]
[[windows]]
view = "pair"
part = "right"
position = [700, 33]
[[windows]]
name = "again"
view = "ahead"
position = [900, 300]
vsync = false
"#;
    let scene = Scene::new(&format!("{VIEWS}{windows}"));
    let out = scene.render(&[]);
    desktop.park_pointer([1500, 850]);
    let mut show = scene.show(&desktop.display, &[]);
    let expect = |file: &str| {
        let png = Pixels::of_png(&out.join(file));
        assert!(png.brightest() > 200, "{file} is too dark for a comparison");
        png
    };
    for (file, corner) in
        [("ahead.png", [0, 0]), ("dome.png", [400, 10]), ("pair.right.png", [700, 33]), ("ahead.png", [900, 300])]
    {
        let expected = expect(file);
        desktop.until_seen(corner, &expected, file);
        // The comparison detects a shift by one pixel.
        let size = expected.size.map(|side| side as u16);
        assert!(desktop.pixels([corner[0] + 1, corner[1]], size).differences(&expected).0 > 10, "{file}");
    }
    // Statistics have intervals only after a second frame.
    std::thread::sleep(std::time::Duration::from_secs(2));
    assert!(show.terminate().success(), "{}", show.log());
    let report = show.out();
    assert_eq!(report.lines().count(), 4, "{report}");
    assert!(report.contains("again on screen: ") && report.contains("intervals median"), "{report}");
    Ok(())
}

/// Returns the light of an sRGB code.
fn light(code: u8) -> f64 {
    let value = f64::from(code) / 255.0;
    if value <= 0.040_45 { value / 12.92 } else { ((value + 0.055) / 1.055).powf(2.4) }
}

fn code(light: f64) -> u8 {
    let value = if light <= 0.003_130_8 { light * 12.92 } else { 1.055 * light.powf(1.0 / 2.4) - 0.055 };
    (value * 255.0).round() as u8
}

/// Twin of `shaders/windows/picture.wgsl`: draws an image in a window of another size. Each pixel is the mean of the
/// image over a square that is at least one image pixel wide.
fn fitted(image: &Pixels, window: [usize; 2]) -> Pixels {
    let [width, height] = image.size.map(|side| side as f64);
    let scale = (window[0] as f64 / width).min(window[1] as f64 / height);
    let corner = [(window[0] as f64 - width * scale) / 2.0, (window[1] as f64 - height * scale) / 2.0];
    let reach = 0.5 * (1.0 / scale).max(1.0);
    let mut codes = Vec::new();
    for y in 0..window[1] {
        for x in 0..window[0] {
            let centre = [(x as f64 + 0.5 - corner[0]) / scale, (y as f64 + 0.5 - corner[1]) / scale];
            if centre[0] < 0.0 || centre[1] < 0.0 || centre[0] >= width || centre[1] >= height {
                codes.push([0; 3]);
                continue;
            }
            let covered = |axis: usize, pixel: i64| {
                let (low, high) = (centre[axis] - reach, centre[axis] + reach);
                ((pixel as f64 + 1.0).min(high) - (pixel as f64).max(low)).max(0.0)
            };
            let range = |axis: usize| ((centre[axis] - reach).floor() as i64)..=((centre[axis] + reach).ceil() as i64);
            let (mut sum, mut weight) = ([0.0; 3], 0.0);
            for row in range(1) {
                for column in range(0) {
                    let share = covered(0, column) * covered(1, row);
                    let start = row.clamp(0, height as i64 - 1) as usize * image.size[0]
                        + column.clamp(0, width as i64 - 1) as usize;
                    for (sum, code) in sum.iter_mut().zip(image.codes[start]) {
                        *sum += share * light(code);
                    }
                    weight += share;
                }
            }
            codes.push(sum.map(|sum| code(sum / weight)));
        }
    }
    Pixels { size: window, codes }
}

fn scaled() -> Result<(), String> {
    let desktop = Desktop::virtual_frame_buffer()?;
    let windows = r#"
[[windows]]
view = "ahead"
position = [0, 0]
size = [500, 500]
[[windows]]
view = "dome"
position = [600, 0]
size = [100, 90]
"#;
    let scene = Scene::new(&format!("{VIEWS}{windows}"));
    let out = scene.render(&[]);
    desktop.park_pointer([1500, 850]);
    let mut show = scene.show(&desktop.display, &[]);
    for (file, corner, window) in [("ahead.png", [0, 0], [500, 500]), ("dome.png", [600, 0], [100, 90])] {
        let expected = fitted(&Pixels::of_png(&out.join(file)), window);
        assert!(expected.brightest() > 100, "{file}");
        let differences = || desktop.pixels(corner, window.map(|side| side as u16)).differences(&expected);
        // Allow a difference of one code, because the shader uses f32.
        crate::desktop::until(|| (differences().1 <= 1).then_some(()), || format!("{file}: {:?}", differences()));
        let (pixels, _) = differences();
        println!("{file} in {window:?}: {pixels} pixels differ by one code");
        assert!(pixels * 100 < expected.codes.len(), "{file}: {pixels} pixels differ by one code");
    }
    assert!(show.terminate().success(), "{}", show.log());
    Ok(())
}

fn one_for_each_image() -> Result<(), String> {
    let desktop = Desktop::virtual_frame_buffer()?;
    let scene = Scene::new(VIEWS);
    let mut show = scene.show(&desktop.display, &["--frames", "3"]);
    assert!(show.wait().success(), "{}", show.log());
    let report = show.out();
    let names: Vec<&str> = report.lines().filter_map(|line| line.split(' ').next()).collect();
    assert_eq!(names, ["ahead", "dome", "pair-left", "pair-right"], "{report}");
    assert!(report.lines().all(|line| line.contains(": 3 frames")), "{report}");
    Ok(())
}

/// The scene of a daemon is at rest. The window of another program covers the daemon's window, and is then closed.
fn uncovered() -> Result<(), String> {
    use x11rb::{
        connection::Connection,
        protocol::xproto::{ConnectionExt, CreateWindowAux, WindowClass},
        wrapper::ConnectionExt as _,
    };
    let desktop = Desktop::virtual_frame_buffer()?;
    let scene = Scene::new(&format!("{VIEWS}[[windows]]\nview = 'dome'\nposition = [0, 0]\n"));
    let expected = Pixels::of_png(&scene.render(&[]).join("dome.png"));
    desktop.park_pointer([1500, 850]);
    let mut serve = scene.serve(Some(&desktop.display));
    desktop.until_seen([0, 0], &expected, "before");
    let connection = &desktop.connection;
    let other = connection.generate_id().unwrap();
    let root = connection.setup().roots[0].root;
    let look = CreateWindowAux::new().background_pixel(0x00ff_00ff).override_redirect(1);
    connection.create_window(24, other, root, 50, 50, 100, 100, 0, WindowClass::INPUT_OUTPUT, 0, &look).unwrap();
    connection.map_window(other).unwrap();
    connection.sync().unwrap();
    assert!(desktop.pixels([0, 0], [256, 256]).differences(&expected).0 >= 9000);
    connection.destroy_window(other).unwrap();
    connection.sync().unwrap();
    desktop.until_seen([0, 0], &expected, "after");
    assert!(serve.terminate().success(), "{}", serve.log());
    Ok(())
}
