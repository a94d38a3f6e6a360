//! Audits of frames: honest ones pass, and what is wrong with others is found, with its place.

use steradian::{
    audit::{AuditedScene, MOST_PIXELS, audit},
    plan::{
        audit::{Audit, AuditedOutput, ImageAudit},
        settings::RenderSettings,
    },
    render::{Frame, FrameRequest, Renderer, Wanted},
    scene::SceneSnapshot,
    view::Rig,
};

use crate::common::{configured, renderer};

type Case = (SceneSnapshot, Rig, RenderSettings);

/// The scene of `configs/demo.toml` with fewer stars and smaller pictures.
fn demo() -> Case {
    let small = [
        "scene.catalogues=[\"builtin:bright\", { galaxy = { stars = 600000, seed = 1, fainter_than = 6.5 } }]",
        "views.dome.size=[512,512]",
        "views.stereo.size=[320,320]",
        "views.cubemap.face_size=256",
        "views.equirectangular.size=[768,384]",
    ];
    configured("demo.toml", &small)
}

/// Two round pictures of 1.2 million stars; where a map of faint stars fits it holds more than a third of them.
fn domes(set: &[&str]) -> Case {
    let small: &[&str] = &[
        "scene.catalogues=[{ galaxy = { stars = 1200000, seed = 1, fainter_than = 3.5 } }]",
        "exposure={ mode = \"manual\", ev100 = -5.4 }",
        "views.dome.size=[512,512]",
        "views.lens.size=[512,512]",
    ];
    configured("dome.toml", &[small, set].concat())
}

/// A small dome of the bright stars.
fn small(set: &[&str]) -> Case {
    let small: &[&str] = &[
        "scene.catalogues=[\"builtin:bright\"]",
        "exposure={ mode = \"manual\", ev100 = -5.4 }",
        "views.dome.size=[256,256]",
        "views.lens.size=[256,256]",
    ];
    configured("dome.toml", &[small, set].concat())
}

fn of((scene, rig, settings): &Case) -> AuditedScene<'_> {
    AuditedScene { scene, rig, settings, exposure_known: true, most_pixels: MOST_PIXELS, numbers: None }
}

fn draw(renderer: &mut Renderer, (scene, rig, settings): &Case, wanted: Wanted) -> Frame {
    renderer.render(FrameRequest::new(scene, rig).settings(settings).wanted(wanted)).unwrap()
}

fn found(renderer: &Renderer, of: &AuditedScene<'_>, frame: &Frame) -> [Audit; 2] {
    let found = audit(of, frame, renderer.limits()).unwrap();
    for image in found.iter().flat_map(|audit| &audit.images) {
        println!("{}", image.in_words());
    }
    found
}

/// Images that break their budgets, display or HDR.
fn broken(audits: &[Audit; 2], output: AuditedOutput) -> Vec<ImageAudit> {
    audits.iter().flat_map(Audit::broken).filter(|image| image.output == output).cloned().collect()
}

#[test]
fn honest_frames_of_every_kind_of_view_pass() {
    let (demo, mut renderer) = (demo(), renderer());
    let frame = draw(&mut renderer, &demo, Wanted::both());
    let audits = found(&renderer, &of(&demo), &frame);
    for (audit, output) in audits.iter().zip([AuditedOutput::Display, AuditedOutput::Hdr]) {
        assert_eq!(audit.images.len(), 10);
        // Of about two hundred pixels of an image the 99.9 % are the worst but one fifth of a step: one beyond the budget breaks it, and of two thousand pixels two may be. Measured:
        // 0.88 and 0.72 of 0.6 codes, the second worst of each image 0.52 at most.
        let beyond: Vec<f64> = audit.broken().map(|image| image.largest).collect();
        assert!(beyond.len() <= 2 && beyond.iter().all(|largest| *largest < 1.2), "{beyond:?}");
        assert!(audit.not_audited.is_empty());
        assert!(audit.images.iter().all(|image| image.output == output && image.pixels > 150 && image.left_out < 20));
    }
    // The same again: an audit is a function of what was drawn.
    assert_eq!(audits, found(&renderer, &of(&demo), &frame));
}

/// A flat window with fine pixels and few stars, where many veils of single sources end just above what hides them.
#[test]
fn a_flat_window_of_single_stars_passes() {
    let (window, mut renderer) = (configured("perspective.toml", &[]), renderer());
    let frame = draw(&mut renderer, &window, Wanted::hdr());
    let [audit, _] = found(&renderer, &of(&window), &frame);
    assert!(audit.images.len() == 2 && audit.not_audited.is_empty());
    // 0.61 and 0.67. With a whole tolerance for every source they were 4.6 and 4.9.
    assert!(audit.images.iter().all(|image| image.error_999 < 0.9 && image.largest < 1.5));
}

fn assert_domes_pass(cases: &[(&[&str], bool)]) {
    for &(set, has_map) in cases {
        let (domes, mut renderer) = (domes(set), renderer());
        let frame = draw(&mut renderer, &domes, Wanted::both());
        assert_eq!(frame.views[0].stars_in_map > 200_000, has_map, "{set:?}");
        let [shown, exact] = found(&renderer, &of(&domes), &frame);
        assert!(!shown.is_broken() && !exact.is_broken(), "{set:?}");
        assert_eq!(shown.images.len() + exact.images.len(), 4);
    }
}

const NO_GLARE: &str = "glare.method=none";
const EXACT: &str = "accuracy.display_codes=0";

#[test]
fn domes_pass_with_a_map_of_faint_stars_and_without_glare_and_exactly() {
    assert_domes_pass(&[(&[], true), (&[NO_GLARE, EXACT], false)]);
}

#[test]
#[ignore = "long: make test-all"]
fn domes_pass_with_either_alone() {
    assert_domes_pass(&[(&[EXACT], false), (&[NO_GLARE], true)]);
}

/// A frame that is drawn with a coarser budget than the one that it is judged by.
#[test]
fn a_plan_with_a_wrong_budget_is_caught() {
    let honest = domes(&[]);
    let mut wrong = honest.clone();
    wrong.2.accuracy.display_codes = 8.0;
    let mut renderer = renderer();
    let frame = draw(&mut renderer, &wrong, Wanted::display());
    let [shown, _] = found(&renderer, &of(&honest), &frame);
    assert_eq!(shown.broken().count(), 2);
    // By its own it is in order.
    assert!(!found(&renderer, &of(&wrong), &frame)[0].is_broken());
}

/// A frame that is drawn with other kernels than those that belong to the picture, with less glare, or without the faint stars.
#[test]
fn other_thresholds_other_glare_and_missing_stars_are_caught() {
    let (honest, mut renderer) = (small(&[]), renderer());
    let [mut tents, mut dim, mut bright_alone] = [honest.clone(), honest.clone(), honest.clone()];
    tents.2.accuracy.flicker = 1.0;
    dim.2.glare.fraction = 0.07;
    bright_alone.2.stars.magnitude_limit = 3.0;
    for (name, wrong) in [("tents", tents), ("glare", dim), ("missing stars", bright_alone)] {
        let frame = draw(&mut renderer, &wrong, Wanted::both());
        println!("{name}");
        let audits = found(&renderer, &of(&honest), &frame);
        for output in [AuditedOutput::Display, AuditedOutput::Hdr] {
            assert!(!broken(&audits, output).is_empty(), "{name} {output:?}");
        }
    }
}

/// Pixels that are off by a few codes, or by a few per cent, anywhere that the sample looks.
#[test]
fn a_corrupted_image_is_caught_and_the_place_is_named() {
    let (case, mut renderer) = (small(&[]), renderer());
    let honest = draw(&mut renderer, &case, Wanted::both());
    let of = of(&case);
    assert!(found(&renderer, &of, &honest).iter().all(|audit| !audit.is_broken()));
    let width = honest.images[0].width as usize;
    // A square of 24 pixels, which holds some of the sample.
    let (left, top) = (100, 140);
    let square = || (top..top + 24).flat_map(|y| (left..left + 24).map(move |x| y * width + x));
    let is_inside = |audits: &[Audit; 2], output: AuditedOutput| {
        let broken = broken(audits, output);
        let worst = broken.first().and_then(|image| image.worst.clone()).expect("the audit has found it");
        let off = [worst.x as usize - left, worst.y as usize - top];
        broken.len() == 1 && broken[0].view == "dome" && off.iter().all(|off| *off < 24)
    };
    let mut display = honest.clone();
    let codes = display.images[0].display.as_mut().unwrap();
    square().for_each(|pixel| {
        (0..3).for_each(|channel| codes[4 * pixel + channel] = codes[4 * pixel + channel].wrapping_add(6))
    });
    assert!(is_inside(&found(&renderer, &of, &display), AuditedOutput::Display));
    let mut hdr = honest.clone();
    let light = hdr.images[0].hdr.as_mut().unwrap();
    square().for_each(|pixel| light[pixel][1] *= 1.5);
    assert!(is_inside(&found(&renderer, &of, &hdr), AuditedOutput::Hdr));
    let mut none = honest;
    let light = none.images[0].hdr.as_mut().unwrap();
    square().for_each(|pixel| light[pixel][2] = f32::NAN);
    assert!(is_inside(&found(&renderer, &of, &none), AuditedOutput::Hdr), "what is no number is no success");
}

/// A picture that is turned by a tenth of a pixel, or shown a twentieth of a stop too bright.
#[test]
fn another_direction_and_another_exposure_are_caught() {
    let (case, mut renderer) = (small(&[]), renderer());
    let mut turned = case.clone();
    turned.0.camera.world_from_camera *= glam::DQuat::from_rotation_y(0.0012);
    let frame = draw(&mut renderer, &turned, Wanted::both());
    let audits = found(&renderer, &of(&case), &frame);
    assert_eq!((broken(&audits, AuditedOutput::Display).len(), broken(&audits, AuditedOutput::Hdr).len()), (2, 2));
    let mut brighter = draw(&mut renderer, &case, Wanted::display());
    brighter.exposure_ev100 += 0.1;
    assert!(found(&renderer, &of(&case), &brighter)[0].is_broken());
}

#[test]
fn what_has_no_twin_is_told_and_never_called_good() {
    let mut renderer = renderer();
    for (set, said) in [
        (&["stars.method=disc", "glare.method=none"][..], "star method disc"),
        (&["stars.method=pixel_gaussian"], "star method pixel_gaussian"),
        (&["glare.method=view_pyramid"], "glare method view_pyramid"),
    ] {
        let case = small(set);
        let frame = draw(&mut renderer, &case, Wanted::display());
        let [shown, _] = audit(&of(&case), &frame, renderer.limits()).unwrap();
        assert!(shown.images.is_empty() && shown.not_audited.len() == 1, "{shown:?}");
        assert!(shown.not_audited[0].contains(said), "{shown:?}");
    }
    let fields = configured("asteroids.toml", &["views.0.size=[64,48]"]);
    let frame = draw(&mut renderer, &fields, Wanted::display());
    let [shown, _] = audit(&of(&fields), &frame, renderer.limits()).unwrap();
    assert!(shown.images.is_empty());
    assert!(shown.not_audited.iter().any(|what| what.contains("asteroid field")), "{shown:?}");
}

/// Lines and text are no part of what is audited.
#[test]
fn overlays_are_left_out() {
    let set = ["overlay.grids=[{ kind = \"equatorial\", colour = \"#ff0000\", opacity = 1.0 }]"];
    let (case, mut renderer) = (small(&set), renderer());
    let frame = draw(&mut renderer, &case, Wanted::display());
    let [shown, _] = found(&renderer, &of(&case), &frame);
    assert!(!shown.is_broken());
    assert!(shown.images.iter().all(|image| image.left_out > 10 && image.pixels > 200));
}
