//! In a steady state no GPU objects are created, because frames reuse the buffers, bind groups and pipelines of earlier ones.

use std::collections::VecDeque;

use glam::DQuat;
use steradian::{
    gpu::{GpuError, GpuOptions},
    render::{Frame, FrameRequest, RenderError, Renderer},
};

use crate::common::{configured, renderer_with};

/// Number of frames after which all objects exist. It is more than one, because a rotated view can need more objects if its tiles contain more items.
const WARM_FRAMES: usize = 4;

/// Draws frames of a configuration while the camera turns, `in_flight` at a time.
fn drawn(renderer: &mut Renderer, file: &str, overrides: &[&str], frames: usize, in_flight: usize) -> Vec<Frame> {
    let (mut scene, rig, settings) = configured(file, overrides);
    let from = scene.camera.world_from_camera;
    let mut submitted = VecDeque::new();
    let mut drawn = Vec::new();
    for frame in 0..frames {
        // Turn back and forth, so that the contents of the views do not grow.
        let angle_rad = [0.0, 1e-3][frame % 2];
        scene.camera.world_from_camera = from * DQuat::from_rotation_y(angle_rad);
        submitted.push_back(renderer.submit(FrameRequest::new(&scene, &rig).settings(&settings)).unwrap());
        if submitted.len() == in_flight {
            drawn.push(renderer.finish(submitted.pop_front().unwrap()).unwrap());
        }
    }
    drawn.extend(submitted.into_iter().map(|submitted| renderer.finish(submitted).unwrap()));
    drawn
}

/// Number of GPU objects that each frame creates.
fn made(frames: &[Frame]) -> Vec<u64> {
    frames.iter().map(|frame| frame.times.objects_made).collect()
}

const DOME: &str = "views.dome.size=[96,96]";
const FACE: &str = "views.0.face_size=48";
const FEW_STARS: &str = "scene.catalogues=[\"builtin:bright\"]";

/// Asserts equal passes, counts and display images of two frames. The images are not compared bit by bit for the method that is not deterministic.
fn assert_same(one: &Frame, two: &Frame, case: &str) {
    let counts = |frame: &Frame| -> Vec<_> {
        frame.views.iter().map(|view| (view.stars_drawn, view.asteroids.clone())).collect()
    };
    assert_eq!(counts(one), counts(two), "{case}");
    let passes = |frame: &Frame| -> Vec<_> { frame.times.passes_ms.iter().map(|(name, _)| *name).collect() };
    assert_eq!(passes(one), passes(two), "{case}");
    // Which stars this method loses depends on the order of the threads.
    if case.contains("packed_cas") {
        return;
    }
    assert_eq!(one.exposure_ev100, two.exposure_ev100, "{case}");
    let same = one.images.iter().zip(&two.images).all(|(one, two)| one.display == two.display);
    assert!(same && !one.images.is_empty() && one.images.len() == two.images.len(), "{case}");
}

/// Asserts that two renderers, one with two frames in flight, create nothing after `WARM_FRAMES` frames and draw the same
/// pictures.
fn assert_steady(cases: &[(&str, &[&str])]) {
    for (file, overrides) in cases {
        // Use a small binding limit, so that there are several tiles and batches.
        let options = GpuOptions { binding_limit_bytes: Some(1 << 20), ..GpuOptions::default() };
        let frames = [1, 2].map(|in_flight| {
            let mut renderer = renderer_with(&options);
            let frames = drawn(&mut renderer, file, overrides, WARM_FRAMES + 4, in_flight);
            let made = made(&frames);
            println!("{file} {overrides:?}, {in_flight} frames at a time: objects created by each frame {made:?}");
            let has_earlier_objects = in_flight == 2;
            assert!(
                has_earlier_objects || made[0] > 0,
                "{file} {overrides:?}: the first frame creates objects: {made:?}"
            );
            assert!(made[WARM_FRAMES..].iter().all(|made| *made == 0), "{file} {overrides:?}: {made:?}");
            frames
        });
        for (one, two) in frames[0].iter().zip(&frames[1]) {
            assert_same(one, two, &format!("{file} {overrides:?}"));
        }
    }
}

#[test]
fn a_steady_frame_creates_no_gpu_objects() {
    assert_steady(&[
        ("dome.toml", &[DOME, FEW_STARS]),
        ("dome.toml", &[DOME, FEW_STARS, "glare.method=none", "exposure.mode=manual"]),
        ("cubemap.toml", &[FEW_STARS, FACE]),
        ("asteroids.toml", &[FEW_STARS, DOME, "views.window.size=[96,54]", "views.headset.size=[48,48]"]),
    ]);
}

#[test]
#[ignore = "long: make test-all"]
fn a_steady_frame_of_any_method_creates_no_gpu_objects() {
    assert_steady(&[
        ("dome.toml", &[DOME, FEW_STARS, "glare.method=view_pyramid"]),
        ("dome.toml", &[DOME, FEW_STARS, "stars.method=packed_cas"]),
        // Views of different sizes share one blending texture, which is recreated for each; so the views have equal sizes here.
        ("cubemap.toml", &[FEW_STARS, FACE, "views.1.face_size=48", "stars.method=psf_texture", "glare.method=none"]),
        ("dome.toml", &[DOME, FEW_STARS, "stars.method=cell_sky", "glare.method=none"]),
        ("perspective.toml", &[FEW_STARS]),
    ]);
}

#[test]
fn another_view_size_creates_gpu_objects() {
    let mut renderer = renderer_with(&GpuOptions::default());
    let steady = drawn(&mut renderer, "dome.toml", &[DOME, FEW_STARS], WARM_FRAMES + 1, 1);
    assert_eq!(made(&steady)[WARM_FRAMES], 0);
    let other = drawn(&mut renderer, "dome.toml", &["views.dome.size=[128,128]", FEW_STARS], 1, 1);
    assert!(made(&other)[0] > 0);
}

/// A lost device is reported as an error, and the reopened renderer draws the same picture.
#[test]
fn a_renderer_recovers_from_a_lost_device() {
    let (scene, rig, settings) = configured("dome.toml", &[FEW_STARS, DOME, "views.lens.size=[96,96]"]);
    let mut renderer = renderer_with(&GpuOptions::default());
    let draw = |renderer: &mut Renderer| renderer.render(FrameRequest::new(&scene, &rig).settings(&settings));
    let before = draw(&mut renderer).unwrap();
    for number in 1..=3 {
        renderer.destroy_device();
        let error = draw(&mut renderer).expect_err("the device is gone");
        assert!(matches!(error, RenderError::Gpu(GpuError::Lost(_))), "{error:?}");
        renderer.reopen().unwrap();
        let after = draw(&mut renderer).unwrap();
        assert!(after.number > before.number, "{number}: {} {}", after.number, before.number);
        assert_same(&before, &after, "reopened renderer");
    }
}
