//! The error of display images, compared with exact ones, must not jump between frames, because a jump would be visible as flicker.

use glam::{DQuat, DVec3};
use steradian::{
    chart::code_errors,
    plan::{Output, settings::RenderSettings},
    render::{Frame, FrameRequest, Renderer, Wanted},
    scene::SceneSnapshot,
    units::PARSEC_M,
    view::{Rig, ViewKind, projection::FisheyeMapping},
};

use crate::common::{configured, renderer, rig};

/// Error budget of display images, codes.
const BUDGET: f64 = 0.5;
/// Number of frames of a whole turn, flight or zoom. Of every 40 frames, the long test draws a run of 10.
const PATH_FRAMES: u32 = 600;
const RUN_EVERY: u32 = 40;
const RUN_FRAMES: u32 = 10;

fn fisheye(fov_deg: f64, size: u32) -> Rig {
    let fov_rad = fov_deg.to_radians();
    rig(vec![("dome", ViewKind::Fisheye { size: [size; 2], mapping: FisheyeMapping::Equidistant, fov_rad })])
}

fn scene_and_settings(stars: u32) -> (SceneSnapshot, RenderSettings) {
    let galaxy = format!(
        "scene.catalogues=[\"builtin:bright\", {{ galaxy = {{ stars = {stars}, seed = 1, fainter_than = 6.5 }} }}]"
    );
    let exposure = "exposure={ mode = \"manual\", ev100 = -5.4 }";
    let (scene, _, settings) = configured("dome.toml", &[&galaxy, exposure]);
    (scene, settings)
}

/// Returns the errors of display values, in the order of pixels and channels, and the number of stars in the map.
fn errors(renderer: &mut Renderer, scene: &SceneSnapshot, rig: &Rig, settings: &RenderSettings) -> (Vec<f32>, u64) {
    let mut draw = |output: Output| -> Frame {
        let request = FrameRequest::new(scene, rig).settings(settings).wanted(Wanted::hdr());
        renderer.render(request.drawn_for(output)).unwrap()
    };
    let (exact, display) = (draw(Output::Hdr), draw(Output::Display));
    let [errors] = &code_errors(&exact, &display, settings)[..] else { panic!("there is one image") };
    (errors.iter().flatten().map(|error| *error as f32).collect(), display.views[0].stars_in_map)
}

/// Returns the drawn frames of a path of 600 frames: runs of consecutive ones, spread evenly over it. A change of the error concerns two consecutive
/// frames, so runs detect the same changes as the whole path, in a quarter of the time.
fn runs() -> impl Iterator<Item = u32> {
    (0..PATH_FRAMES).filter(|frame| frame % RUN_EVERY < RUN_FRAMES)
}

/// Returns the changes of the error between consecutive frames: the largest 99.9 % quantile, and the largest change of all. Also returns the smallest
/// number of stars in the map. Frames are given with their numbers.
fn changes(frames: impl Iterator<Item = (u32, (Vec<f32>, u64))>) -> ([f64; 2], u64) {
    let mut before: Option<(u32, Vec<f32>)> = None;
    let (mut most, mut least_in_map) = ([0.0_f64; 2], u64::MAX);
    for (number, (errors, in_map)) in frames {
        least_in_map = least_in_map.min(in_map);
        if let Some((_, before)) = before.filter(|(of, before)| of + 1 == number && before.len() == errors.len()) {
            let mut changes: Vec<f32> = errors.iter().zip(&before).map(|(now, before)| (now - before).abs()).collect();
            changes.sort_by(f32::total_cmp);
            let of_frame = [0.999, 1.0].map(|share| changes[((changes.len() - 1) as f64 * share) as usize]);
            most = std::array::from_fn(|index| most[index].max(f64::from(of_frame[index])));
        }
        before = Some((number, errors));
    }
    (most, least_in_map)
}

fn check(name: &str, (most, in_map): ([f64; 2], u64)) {
    println!(
        "{name}: change of the error 99.9 % {:.3}, largest {:.3}; at least {in_map} stars in the map",
        most[0], most[1]
    );
    assert!(most[0] <= 2.0 * BUDGET && most[1] <= 4.0 * BUDGET, "{name}: {most:?}");
}

/// The pixels are 0.7 degrees wide, which is the widest for which there is an error budget.
fn a_turn(frames: impl Iterator<Item = u32>) {
    let ((mut scene, settings), rig) = (scene_and_settings(300_000), fisheye(90.0, 128));
    let from = scene.camera.world_from_camera;
    let mut renderer = renderer();
    let turned = frames.map(|frame| {
        // Turn by a third of a pixel per frame.
        scene.camera.world_from_camera = from * DQuat::from_rotation_y(f64::from(frame) * 0.004);
        (frame, errors(&mut renderer, &scene, &rig, &settings))
    });
    let changes = changes(turned);
    assert!(changes.1 > 100_000, "all frames use the map: {changes:?}");
    check("turn", changes);
}

fn a_flight(frames: impl Iterator<Item = u32>) {
    let ((mut scene, settings), rig) = (scene_and_settings(300_000), fisheye(90.0, 128));
    let mut renderer = renderer();
    let flown = frames.map(|frame| {
        scene.camera.position_m =
            DVec3::new(0.6, -0.7, 0.3).normalize() * PARSEC_M * f64::from(frame) / f64::from(PATH_FRAMES);
        (frame, errors(&mut renderer, &scene, &rig, &settings))
    });
    check("flight", changes(flown));
}

fn a_zoom(frames: impl Iterator<Item = u32>) {
    let (scene, settings) = scene_and_settings(300_000);
    let mut renderer = renderer();
    let zoomed = frames.map(|frame| {
        let fov_deg = 180.0 * (1.0_f64 / 180.0).powf(f64::from(frame) / f64::from(PATH_FRAMES - 1));
        (frame, errors(&mut renderer, &scene, &fisheye(fov_deg, 256), &settings))
    });
    check("zoom", changes(zoomed));
}

#[test]
fn the_error_does_not_jump_while_the_camera_turns() {
    a_turn(0..12);
}

#[test]
#[ignore = "long: make test-all"]
fn the_error_does_not_jump_in_turns_flights_and_zooms() {
    a_turn(runs());
    a_flight(runs());
    a_zoom(runs());
}

/// An error that changes with the light between two frames must be detected.
#[test]
fn an_error_that_jumps_is_detected() {
    let ((mut scene, settings), rig) = (scene_and_settings(50_000), fisheye(180.0, 128));
    let mut renderer = renderer();
    let steady = errors(&mut renderer, &scene, &rig, &settings);
    let mut jumped = steady.clone();
    scene.camera.world_from_camera *= DQuat::from_rotation_y(0.01);
    let exact = |renderer: &mut Renderer, scene: &SceneSnapshot| {
        let request = FrameRequest::new(scene, &rig).settings(&settings).wanted(Wanted::hdr());
        renderer.render(request).unwrap().images[0].hdr.clone().unwrap()
    };
    let turned = exact(&mut renderer, &scene);
    jumped.0.iter_mut().zip(turned.iter().flatten()).for_each(|(error, light)| *error += 1e3 * light);
    let (most, _) = changes((0..).zip([steady, jumped]));
    assert!(most[1] > 4.0 * BUDGET, "{most:?}");
}
