//! Only the requested images of a frame are drawn, and the request changes no image.

use std::{f64::consts::PI, sync::Arc};

use crate::common::*;
use glam::DVec3;
use steradian::{
    plan::settings::{ExposureSettings, Metering, RenderSettings, StarMethod},
    render::{Frame, FrameRequest, Wanted},
    scene::{
        SceneObjects, SceneSnapshot,
        bodies::{Body, SolarBody},
    },
    view::{Rig, ViewKind},
};

const NOTHING: Wanted = Wanted { display: false, hdr: false, hdr_streamed: false, hdr_stays: false };

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
    let request = FrameRequest::new(&scene, &rig).settings(settings).wanted_per_view(&wanted);
    renderer().render(request).unwrap()
}

#[test]
fn an_unrequested_view_is_not_drawn() {
    let settings = settings(StarMethod::Auto);
    let both = draw(&settings, [Wanted::display(); 2]);
    let one = draw(&settings, [NOTHING, Wanted::display()]);
    assert_eq!(one.images.len(), 1);
    assert!(both.views[0].stars_drawn > 0 && one.views[0].stars_drawn == 0);
    assert_eq!(one.views[1].stars_drawn, both.views[1].stars_drawn);
    // The exposure is that of the first view, whether this view is drawn or not.
    assert_eq!(one.exposure_ev100, both.exposure_ev100);
    assert_eq!(one.images[0].display, both.images[1].display);
}

/// A lit body fills a part of the first view only. The exposure takes it into account although the first view is not
/// drawn.
#[test]
fn a_lit_body_in_an_unrequested_view_affects_exposure() {
    let settings = settings(StarMethod::Auto);
    let sun = Body::preset(SolarBody::Sun, "sun", DVec3::X * 1.496e11);
    let lit =
        Body { radii_m: DVec3::splat(2e6), ..Body::preset(SolarBody::Moon, "moon", DVec3::Y * 1e7 + DVec3::X * 2e6) };
    let mut scene = scene();
    let bodies = vec![Arc::new(sun), Arc::new(lit)];
    scene.objects = Arc::new(SceneObjects { bodies, ..Default::default() });
    // The body is near the zenith of the dome; the other view looks ahead.
    let rig = rig_of_two();
    let mut renderer = renderer();
    let mut draw = |scene: &SceneSnapshot, wanted: [Wanted; 2]| {
        renderer.render(FrameRequest::new(scene, &rig).settings(&settings).wanted_per_view(&wanted)).unwrap()
    };
    let both = draw(&scene, [Wanted::display(); 2]);
    let one = draw(&scene, [NOTHING, Wanted::display()]);
    assert_eq!(one.images.len(), 1);
    assert_eq!(one.exposure_ev100, both.exposure_ev100);
    assert_eq!(one.images[0].display, both.images[1].display);
    assert!(both.views[0].stars_drawn > 0 && one.views[0].stars_drawn == 0);
    // Without the body, the exposure is the one of the night sky.
    scene.objects = Arc::default();
    let night = draw(&scene, [NOTHING, Wanted::display()]);
    assert!(one.exposure_ev100 > night.exposure_ev100 + 3.0, "{} {}", one.exposure_ev100, night.exposure_ev100);
}

#[test]
fn mean_metering_includes_unrequested_views() {
    let exposure = ExposureSettings::auto(Metering::Mean);
    let settings = RenderSettings { exposure, ..settings(StarMethod::Auto) };
    let both = draw(&settings, [Wanted::display(); 2]);
    let one = draw(&settings, [NOTHING, Wanted::display()]);
    assert_eq!(one.exposure_ev100, both.exposure_ev100);
    assert!(one.views[0].stars_drawn > 0);
}

#[test]
fn requesting_hdr_images_changes_no_display_image() {
    let settings = RenderSettings::default();
    let display = draw(&settings, [Wanted::display(); 2]);
    let both = draw(&settings, [Wanted::both(); 2]);
    let exact = draw(&settings, [Wanted::hdr(); 2]);
    for ((display, both), exact) in display.images.iter().zip(&both.images).zip(&exact.images) {
        assert_eq!(display.display, both.display);
        assert_eq!(exact.hdr, both.hdr);
        assert!(display.hdr.is_none() && exact.display.is_none());
    }
}
