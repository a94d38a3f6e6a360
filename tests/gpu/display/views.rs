//! Views with their own exposure, glare and tone mapping: each equals the view drawn alone, and a group shares one exposure.

use std::f64::consts::PI;

use crate::common::*;
use glam::DVec3;
use steradian::{
    catalogue::StarRecord,
    plan::{
        settings::{ExposureSettings, ExposureValues, GlareSettings, Metering, RenderSettings, ToneMapOperator},
        view_settings::{ExposureGroup, FrameGroup, ViewSettings, frame_groups},
    },
    render::{Frame, FrameRequest, Renderer, Wanted},
    scene::SceneSnapshot,
    view::{Rig, ViewKind},
};

fn scene() -> SceneSnapshot {
    let crowded = |(i, d): (usize, DVec3)| StarRecord {
        temperature_k: 2500.0 + 13.0 * i as f32,
        ..star(d + DVec3::X * 0.8, (i % 9) as f32)
    };
    snapshot(spiral(3000).enumerate().map(crowded).collect())
}

fn rig_of_three() -> Rig {
    rig(vec![
        ("dome", ViewKind::DomeMaster { size: 160, fov_rad: PI, tilt_rad: 0.0 }),
        ("ahead", ViewKind::Perspective { size: [160, 120], fov_y_rad: PI / 3.0 }),
        ("sky", ViewKind::Equirectangular { size: [128, 64] }),
    ])
}

fn own_settings(name: &str, change: impl FnOnce(&mut ViewSettings)) -> ViewSettings {
    let mut settings = ViewSettings::general(&RenderSettings::default());
    settings.group = ExposureGroup::OfView(name.to_owned());
    change(&mut settings);
    settings
}

fn draw(renderer: &mut Renderer, scene: &SceneSnapshot, groups: &[FrameGroup], number: usize) -> Frame {
    let request = FrameRequest::for_group(scene, groups, number).wanted(Wanted::both());
    renderer.render(request).unwrap().with_views(&groups[number].views)
}

#[test]
fn each_view_equals_the_view_drawn_alone_with_its_settings() {
    let (scene, rig) = (scene(), rig_of_three());
    let views = [
        own_settings("dome", |view| {
            view.exposure = ExposureValues { limiting_magnitude: 5.0, ..Default::default() }.into()
        }),
        own_settings("ahead", |view| {
            view.exposure = ExposureSettings::auto(Metering::Mean);
            view.glare = GlareSettings { fraction: 0.4, ..GlareSettings::default() };
        }),
        own_settings("sky", |view| {
            view.exposure = ExposureSettings::manual(-6.0);
            view.glare = GlareSettings::none();
            view.tone_map.operator = ToneMapOperator::Reinhard;
        }),
    ];
    let groups = frame_groups(&rig, &RenderSettings::default(), &views);
    assert_eq!(groups.len(), 3);
    let mut one_renderer = renderer();
    // Draw two rounds, because the state that is kept for one group must not affect another one.
    for round in 0..2 {
        for (number, group) in groups.iter().enumerate() {
            let frame = draw(&mut one_renderer, &scene, &groups, number);
            assert!(frame.images.iter().all(|image| image.view == number));
            let alone = rig.of_views(&[number]);
            let request = FrameRequest::new(&scene, &alone).settings(&group.settings).wanted(Wanted::both());
            let expected = new_renderer().render(request).unwrap();
            assert_eq!(frame.exposure_ev100.to_bits(), expected.exposure_ev100.to_bits(), "round {round}");
            for (image, expected) in frame.images.iter().zip(&expected.images) {
                assert_eq!(image.display, expected.display, "round {round}, view {number}");
                assert_eq!(image.hdr, expected.hdr, "round {round}, view {number}");
            }
            // With the settings of another view, the picture differs.
            let other = &groups[(number + 1) % 3].settings;
            let request = FrameRequest::new(&scene, &alone).settings(other).wanted(Wanted::display());
            assert_ne!(renderer().render(request).unwrap().images[0].display, frame.images[0].display);
        }
    }
}

#[test]
fn alternating_groups_create_no_gpu_objects_once_warm() {
    let (scene, rig) = (scene(), rig_of_three());
    let views = [
        own_settings("dome", |view| {
            view.exposure = ExposureValues { limiting_magnitude: 5.0, ..Default::default() }.into()
        }),
        own_settings("ahead", |view| view.exposure = ExposureSettings::auto(Metering::Spot)),
        own_settings("sky", |view| view.glare.fraction = 0.3),
    ];
    let groups = frame_groups(&rig, &RenderSettings::default(), &views);
    let mut renderer = new_renderer();
    let mut made = Vec::new();
    for _ in 0..6 {
        for number in 0..groups.len() {
            let request = FrameRequest::for_group(&scene, &groups, number).adapted_ev100(-5.0);
            made.push(renderer.render(request).unwrap().times.objects_made);
        }
    }
    assert!(made[0] > 0 && made[9..].iter().all(|made| *made == 0), "{made:?}");
}

/// One view has the general settings. A group consists of two views, one of them without glare.
fn group_of_two(metering: Metering) -> [ViewSettings; 3] {
    let in_group = |glare: GlareSettings| {
        let mut settings = own_settings("", |view| view.glare = glare);
        settings.group = ExposureGroup::Named("two".to_owned());
        settings.exposure = ExposureValues { metering, spot_deg: 20.0, ..Default::default() }.into();
        settings
    };
    let general = ViewSettings::general(&RenderSettings::default());
    [in_group(GlareSettings::default()), general, in_group(GlareSettings::none())]
}

#[test]
fn views_of_a_group_share_one_exposure() {
    let (scene, rig) = (scene(), rig_of_three());
    for metering in [Metering::LimitingMagnitude, Metering::Mean, Metering::Spot] {
        let groups = frame_groups(&rig, &RenderSettings::default(), &group_of_two(metering));
        let mut renderer = renderer();
        let [general, first, second] = [0, 1, 2].map(|number| draw(&mut renderer, &scene, &groups, number));
        assert_eq!([&groups[0].views[..], &groups[1].views, &groups[2].views], [&[1][..], &[0], &[2]]);
        assert_eq!(first.exposure_ev100.to_bits(), second.exposure_ev100.to_bits(), "{metering:?}");
        assert_ne!(first.exposure_ev100, general.exposure_ev100, "{metering:?}");
        // It equals the exposure of the group's views drawn alone, with the settings of the first of them.
        let both = rig.of_views(&[0, 2]);
        let request = FrameRequest::new(&scene, &both).settings(&groups[1].settings).wanted(Wanted::hdr());
        let expected = renderer.render(request).unwrap().exposure_ev100;
        assert!((first.exposure_ev100 - expected).abs() < 2e-5, "{metering:?}: {} {expected}", first.exposure_ev100);
        // It differs from the exposure for all views, and from that for each single view.
        if metering == Metering::Mean {
            for wrong in [&[0, 1, 2][..], &[0], &[2]] {
                let request_rig = rig.of_views(wrong);
                let request = FrameRequest::new(&scene, &request_rig).settings(&groups[1].settings);
                let wrong_ev100 = renderer.render(request.wanted(Wanted::hdr())).unwrap().exposure_ev100;
                assert!((wrong_ev100 - expected).abs() > 3e-4, "{wrong:?}: {wrong_ev100} {expected}");
            }
        }
    }
}
