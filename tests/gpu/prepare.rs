//! Preparation of a renderer: it makes all pipelines that a configuration needs before the first frame.

use std::{
    sync::Arc,
    time::{Duration, Instant},
};

use steradian::{
    Wanted,
    plan::{
        settings::RenderSettings,
        view_settings::{ExposureGroup, FrameGroup},
    },
    scene::SceneSnapshot,
    view::Rig,
};

use crate::common::{configured, new_renderer};

/// A test that waits longer than this has failed.
const HANGS: Duration = Duration::from_secs(300);

const SMALL_CATALOGUE: &str = "scene.catalogues=[\"builtin:bright\"]";

/// Returns the number of pipelines that `prepare` creates for the wanted images of a configuration, and the number of pipelines that the first frame
/// creates afterwards.
fn made(file: &str, set: &[&str], wanted: Wanted) -> [u64; 2] {
    let (scene, rig, settings) = configured(file, &[&[SMALL_CATALOGUE], set].concat());
    let mut renderer = new_renderer();
    assert_eq!(renderer.gpu().made().pipelines, 0, "a new renderer has no pipelines");
    let mut steps = Vec::new();
    renderer.prepare(&scene.objects, &rig, &settings, wanted, &[], &mut |step| steps.push(step)).unwrap();
    let total = steps.len();
    assert!(steps.iter().enumerate().all(|(index, step)| (step.done, step.total) == (index + 1, total)), "{steps:?}");
    let prepared = renderer.gpu().made().pipelines;
    renderer.warm_up(&scene, &rig, &settings, wanted).unwrap();
    [prepared, renderer.gpu().made().pipelines - prepared]
}

#[test]
fn the_first_frame_creates_no_further_pipelines() {
    let small = "views.dome.size=[64,64]";
    let cases: [(&str, &[&str]); 12] = [
        ("perspective.toml", &["views.0.size=[64,48]"]),
        ("dome.toml", &[small]),
        ("dome.toml", &[small, "glare.method=none"]),
        ("dome.toml", &[small, "glare.method=none", "exposure.mode=manual", "exposure.ev100=-5.4"]),
        ("dome.toml", &[small, "glare.method=view_pyramid"]),
        ("dome.toml", &[small, "glare.kernel=cie"]),
        ("dome.toml", &[small, "stars.method=packed_cas", "glare.method=none"]),
        ("dome.toml", &[small, "stars.method=packed_cas_sorted", "glare.method=none"]),
        ("dome.toml", &[small, "stars.method=disc", "glare.method=none"]),
        ("dome.toml", &[small, "exposure.metering=spot"]),
        ("asteroids.toml", &["views.0.size=[64,48]"]),
        ("tonight.toml", &["views.dome.size=[64,64]", "views.south.size=[64,48]"]),
    ];
    for (file, set) in cases {
        for wanted in [Wanted::both(), Wanted::display()] {
            let [prepared, late] = made(file, set, wanted);
            assert!(
                prepared > 0 && late == 0,
                "{file} {set:?} {wanted:?}: {prepared} prepared, {late} more by the frame"
            );
        }
    }
}

#[test]
fn a_frame_creates_pipelines_that_were_not_prepared() {
    // Check that the counter works.
    let (scene, rig, settings) = configured("dome.toml", &[SMALL_CATALOGUE, "views.dome.size=[64,64]"]);
    let mut renderer = new_renderer();
    let wanted = Wanted { display: true, ..Wanted::default() };
    renderer.warm_up(&scene, &rig, &settings, wanted).unwrap();
    assert!(renderer.gpu().made().pipelines > 0);
}

#[test]
fn exact_images_have_their_pipelines_after_the_first_frame() {
    // The pictures must not be even smaller, because display images and exact ones would then be the same.
    let cases: [(&str, &[&str]); 2] = [
        ("dome.toml", &["views.dome.size=[256,256]"]),
        ("tonight.toml", &["views.dome.size=[256,256]", "views.south.size=[256,144]"]),
    ];
    for (file, small) in cases {
        let (scene, rig, settings) = configured(file, &[&[SMALL_CATALOGUE], small].concat());
        let mut renderer = new_renderer();
        let display = Wanted::display();
        renderer.prepare(&scene.objects, &rig, &settings, display, &[], &mut |_| ()).unwrap();
        renderer.warm_up(&scene, &rig, &settings, display).unwrap();
        let of_display = renderer.gpu().made().pipelines;
        renderer.prepare_later(&scene.objects, &[group(&rig, &settings)], Wanted::both()).unwrap();
        let prepared = renderer.gpu().made().pipelines;
        renderer.pipelines_ahead().compile();
        renderer.warm_up(&scene, &rig, &settings, Wanted::both()).unwrap();
        renderer.warm_up(&scene, &rig, &settings, Wanted::hdr()).unwrap();
        let all = renderer.gpu().made().pipelines;
        assert!(prepared > of_display && all == prepared, "{file}: {of_display}, then {prepared}, then {all}");
    }
}

/// Returns the frame group of a rig with one view.
fn group(rig: &Rig, settings: &RenderSettings) -> FrameGroup {
    FrameGroup {
        views: vec![0],
        rig: rig.clone(),
        settings: settings.clone(),
        exposure_group: ExposureGroup::General,
        exposed_as: None,
    }
}

#[test]
fn frames_create_the_pipelines_of_a_later_scene() {
    let (later, rig, settings) = configured("asteroids.toml", &[SMALL_CATALOGUE, "views.0.size=[64,48]"]);
    let now = SceneSnapshot { objects: Arc::default(), ..later.clone() };
    let mut renderer = new_renderer();
    let wanted = Wanted::both();
    renderer.warm_up(&now, &rig, &settings, wanted).unwrap();
    let of_now = renderer.gpu().made().pipelines;
    let ahead = renderer.pipelines_ahead().clone();
    ahead.begin(Arc::clone(&later.objects), vec![group(&rig, &settings)]);
    assert!(!ahead.is_done());
    let mut frames = 0;
    let begun = Instant::now();
    while !ahead.is_done() {
        renderer.warm_up(&now, &rig, &settings, wanted).unwrap();
        frames += 1;
        assert!(begun.elapsed() < HANGS, "the pipelines are never complete");
    }
    assert!(frames > 1, "one frame created all of them");
    // All pipelines exist, so there is nothing left to wait for.
    ahead.wait();
    let prepared = renderer.gpu().made().pipelines;
    renderer.warm_up(&later, &rig, &settings, wanted).unwrap();
    let all = renderer.gpu().made().pipelines;
    assert!(prepared > of_now && all == prepared, "{of_now}, then {prepared}, then {all}");
}
