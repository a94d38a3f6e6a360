//! What is wanted of a frame decides what is drawn, and changes no image of it.

use std::f64::consts::PI;

use crate::common::*;
use glam::DVec3;
use steradian::{
    plan::settings::{ExposureMode, ExposureSettings, Metering, RenderSettings, StarMethod},
    render::{Frame, FrameRequest, Wanted},
    scene::SceneSnapshot,
    view::{Rig, ViewKind},
};

const NOTHING: Wanted = Wanted { display: false, hdr: false, hdr_stays: false };

fn scene() -> SceneSnapshot {
    let placed = |i: u8| {
        let (turn, height) = (f64::from(i) * 2.399_963, 1.0 - f64::from(i) / 125.0);
        let across = (1.0 - height * height).max(0.0).sqrt();
        star(DVec3::new(across * turn.cos(), height, across * turn.sin()), f32::from(i % 8))
    };
    snapshot((0..250).map(placed).collect())
}

fn rig_of_two() -> Rig {
    rig(vec![
        ("dome", ViewKind::DomeMaster { size: 320, fov_rad: PI, tilt_rad: 0.0 }),
        ("ahead", ViewKind::Perspective { size: [160, 120], fov_y_rad: PI / 3.0 }),
    ])
}

fn draw(settings: &RenderSettings, wanted: [Wanted; 2]) -> Frame {
    let (scene, rig) = (scene(), rig_of_two());
    let request = FrameRequest::new(&scene, &rig).settings(settings).wanted_of_each(&wanted);
    renderer().render(request).unwrap()
}

#[test]
fn a_view_that_nobody_wants_is_not_drawn() {
    let settings = settings(StarMethod::Auto);
    let both = draw(&settings, [Wanted::display(); 2]);
    let one = draw(&settings, [NOTHING, Wanted::display()]);
    assert_eq!(one.images.len(), 1);
    assert!(both.views[0].stars_drawn > 0 && one.views[0].stars_drawn == 0);
    assert_eq!(one.views[1].stars_drawn, both.views[1].stars_drawn);
    // The exposure is that of the first view, drawn or not.
    assert_eq!(one.exposure_ev100, both.exposure_ev100);
    assert_eq!(one.images[0].display, both.images[1].display);
}

#[test]
fn the_meter_looks_at_views_that_nobody_wants() {
    let exposure = ExposureSettings { mode: ExposureMode::Auto, metering: Metering::Mean, ..Default::default() };
    let settings = RenderSettings { exposure, ..settings(StarMethod::Auto) };
    let both = draw(&settings, [Wanted::display(); 2]);
    let one = draw(&settings, [NOTHING, Wanted::display()]);
    assert_eq!(one.exposure_ev100, both.exposure_ev100);
    assert!(one.views[0].stars_drawn > 0);
}

#[test]
fn hdr_images_beside_them_change_no_display_image() {
    let settings = RenderSettings::default();
    let shown = draw(&settings, [Wanted::display(); 2]);
    let both = draw(&settings, [Wanted::both(); 2]);
    let exact = draw(&settings, [Wanted::hdr(); 2]);
    for ((shown, both), exact) in shown.images.iter().zip(&both.images).zip(&exact.images) {
        assert_eq!(shown.display, both.display);
        assert_eq!(exact.hdr, both.hdr);
        assert!(shown.hdr.is_none() && exact.display.is_none());
    }
}
