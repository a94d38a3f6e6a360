//! Audits of frames: correct frames pass, and errors in wrong frames are found and located.

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

/// Loads `configs/demo.toml` with fewer stars and smaller pictures.
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

/// Loads two round pictures of 1.2 million stars. If the map of faint stars is used, it contains more than a third of the stars.
fn domes(set: &[&str]) -> Case {
    let small: &[&str] = &[
        "scene.catalogues=[{ galaxy = { stars = 1200000, seed = 1, fainter_than = 3.5 } }]",
        "exposure={ mode = \"manual\", ev100 = -5.4 }",
        "views.dome.size=[512,512]",
        "views.lens.size=[512,512]",
    ];
    configured("dome.toml", &[small, set].concat())
}

/// Loads a small dome with the bright stars.
fn small(set: &[&str]) -> Case {
    let small: &[&str] = &[
        "scene.catalogues=[\"builtin:bright\"]",
        "exposure={ mode = \"manual\", ev100 = -5.4 }",
        "views.dome.size=[256,256]",
        "views.lens.size=[256,256]",
    ];
    configured("dome.toml", &[small, set].concat())
}

fn audited((scene, rig, settings): &Case) -> AuditedScene<'_> {
    AuditedScene { scene, rig, settings, exposure_known: true, most_pixels: MOST_PIXELS, numbers: None }
}

fn draw(renderer: &mut Renderer, (scene, rig, settings): &Case, wanted: Wanted) -> Frame {
    renderer.render(FrameRequest::new(scene, rig).settings(settings).wanted(wanted)).unwrap()
}

fn run_audits(renderer: &Renderer, scene: &AuditedScene<'_>, frame: &Frame) -> [Audit; 2] {
    let audits = audit(scene, frame, renderer.limits()).unwrap();
    for image in audits.iter().flat_map(|audit| &audit.images) {
        println!("{}", image.in_words());
    }
    audits
}

/// Returns the display or HDR images that break their budgets.
fn broken(audits: &[Audit; 2], output: AuditedOutput) -> Vec<ImageAudit> {
    audits.iter().flat_map(Audit::broken).filter(|image| image.output == output).cloned().collect()
}

#[test]
fn correct_frames_of_every_view_type_pass() {
    let (demo, mut renderer) = (demo(), renderer());
    let frame = draw(&mut renderer, &demo, Wanted::both());
    let audits = run_audits(&renderer, &audited(&demo), &frame);
    for (audit, output) in audits.iter().zip([AuditedOutput::Display, AuditedOutput::Hdr]) {
        assert_eq!(audit.images.len(), 10);
        // An image contributes about two hundred pixels, so its 99.9 % quantile is a fifth of the way from the largest error to the second largest
        // one: one pixel in excess of the budget breaks the budget. Of about two thousand pixels in all images, two may exceed it. Measured: 0.88 and
        // 0.72 codes, with a budget of 0.6. The second largest error of each image is at most 0.52 codes.
        let beyond: Vec<f64> = audit.broken().map(|image| image.largest).collect();
        assert!(beyond.len() <= 2 && beyond.iter().all(|largest| *largest < 1.2), "{beyond:?}");
        assert!(audit.not_audited.is_empty());
        assert!(audit.images.iter().all(|image| image.output == output && image.pixels > 150 && image.left_out < 20));
    }
    // A second run gives the same result, because an audit depends only on the frame.
    assert_eq!(audits, run_audits(&renderer, &audited(&demo), &frame));
}

/// A flat window with fine pixels and few stars has many edges of the veils of single sources.
#[test]
fn a_flat_window_of_single_stars_passes() {
    let (window, mut renderer) = (configured("perspective.toml", &[]), renderer());
    let frame = draw(&mut renderer, &window, Wanted::hdr());
    let [audit, _] = run_audits(&renderer, &audited(&window), &frame);
    assert!(audit.images.len() == 2 && audit.not_audited.is_empty());
    // Measured: 0.61 and 0.67. When the veil of each source had the full tolerance, the values were 4.6 and 4.9.
    assert!(audit.images.iter().all(|image| image.error_999 < 0.9 && image.largest < 1.5));
}

fn assert_domes_pass(cases: &[(&[&str], bool)]) {
    for &(set, has_map) in cases {
        let (domes, mut renderer) = (domes(set), renderer());
        let frame = draw(&mut renderer, &domes, Wanted::both());
        assert_eq!(frame.views[0].stars_in_map > 200_000, has_map, "{set:?}");
        let [display, hdr] = run_audits(&renderer, &audited(&domes), &frame);
        assert!(!display.is_broken() && !hdr.is_broken(), "{set:?}");
        assert_eq!(display.images.len() + hdr.images.len(), 4);
    }
}

const NO_GLARE: &str = "glare.method=none";
const EXACT: &str = "accuracy.display_codes=0";

#[test]
fn domes_pass_with_the_faint_star_map_and_exactly_without_glare() {
    assert_domes_pass(&[(&[], true), (&[NO_GLARE, EXACT], false)]);
}

#[test]
#[ignore = "long: make test-all"]
fn domes_pass_exactly_or_without_glare() {
    assert_domes_pass(&[(&[EXACT], false), (&[NO_GLARE], true)]);
}

/// The frame is drawn with a coarser budget than the one with which it is audited.
#[test]
fn a_plan_with_a_wrong_budget_is_caught() {
    let honest = domes(&[]);
    let mut wrong = honest.clone();
    wrong.2.accuracy.display_codes = 8.0;
    let mut renderer = renderer();
    let frame = draw(&mut renderer, &wrong, Wanted::display());
    let [display, _] = run_audits(&renderer, &audited(&honest), &frame);
    assert_eq!(display.broken().count(), 2);
    // With its own budget, the frame passes.
    assert!(!run_audits(&renderer, &audited(&wrong), &frame)[0].is_broken());
}

/// The frames are drawn with other kernels, with less glare, or without the faint stars.
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
        let audits = run_audits(&renderer, &audited(&honest), &frame);
        for output in [AuditedOutput::Display, AuditedOutput::Hdr] {
            assert!(!broken(&audits, output).is_empty(), "{name} {output:?}");
        }
    }
}

/// Pixels are wrong by a few codes or a few per cent, in a part of the picture that the audit samples.
#[test]
fn a_corrupted_image_is_caught_and_located() {
    let (case, mut renderer) = (small(&[]), renderer());
    let honest = draw(&mut renderer, &case, Wanted::both());
    let scene = audited(&case);
    assert!(run_audits(&renderer, &scene, &honest).iter().all(|audit| !audit.is_broken()));
    let width = honest.images[0].width as usize;
    // Change a square with sides of 24 pixels, which contains some of the sampled pixels.
    let (left, top) = (100, 140);
    let square = || (top..top + 24).flat_map(|y| (left..left + 24).map(move |x| y * width + x));
    let is_inside = |audits: &[Audit; 2], output: AuditedOutput| {
        let broken = broken(audits, output);
        let worst = broken.first().and_then(|image| image.worst.clone()).expect("the audit finds it");
        let offset = [worst.x as usize - left, worst.y as usize - top];
        broken.len() == 1 && broken[0].view == "dome" && offset.iter().all(|offset| *offset < 24)
    };
    let mut display = honest.clone();
    let codes = display.images[0].display.as_mut().unwrap();
    square().for_each(|pixel| {
        (0..3).for_each(|channel| codes[4 * pixel + channel] = codes[4 * pixel + channel].wrapping_add(6))
    });
    assert!(is_inside(&run_audits(&renderer, &scene, &display), AuditedOutput::Display));
    let mut hdr = honest.clone();
    let light = hdr.images[0].hdr.as_mut().unwrap();
    square().for_each(|pixel| light[pixel][1] *= 1.5);
    assert!(is_inside(&run_audits(&renderer, &scene, &hdr), AuditedOutput::Hdr));
    let mut none = honest;
    let light = none.images[0].hdr.as_mut().unwrap();
    square().for_each(|pixel| light[pixel][2] = f32::NAN);
    assert!(is_inside(&run_audits(&renderer, &scene, &none), AuditedOutput::Hdr), "NaN fails");
}

/// The picture is rotated by a tenth of a pixel, or has a wrong exposure.
#[test]
fn another_direction_and_another_exposure_are_caught() {
    let (case, mut renderer) = (small(&[]), renderer());
    let mut turned = case.clone();
    turned.0.camera.world_from_camera *= glam::DQuat::from_rotation_y(0.0012);
    let frame = draw(&mut renderer, &turned, Wanted::both());
    let audits = run_audits(&renderer, &audited(&case), &frame);
    assert_eq!((broken(&audits, AuditedOutput::Display).len(), broken(&audits, AuditedOutput::Hdr).len()), (2, 2));
    let mut brighter = draw(&mut renderer, &case, Wanted::display());
    brighter.exposure_ev100 += 0.1;
    assert!(run_audits(&renderer, &audited(&case), &brighter)[0].is_broken());
}

#[test]
fn content_without_a_reference_is_reported_as_not_audited() {
    let mut renderer = renderer();
    for (set, reason) in [
        (&["stars.method=disc", "glare.method=none"][..], "star method disc"),
        (&["stars.method=pixel_gaussian"], "star method pixel_gaussian"),
        (&["glare.method=view_pyramid"], "glare method view_pyramid"),
    ] {
        let case = small(set);
        let frame = draw(&mut renderer, &case, Wanted::display());
        let [display, _] = audit(&audited(&case), &frame, renderer.limits()).unwrap();
        assert!(display.images.is_empty() && display.not_audited.len() == 1, "{display:?}");
        assert!(display.not_audited[0].contains(reason), "{display:?}");
    }
    let fields = configured("asteroids.toml", &["views.0.size=[64,48]"]);
    let frame = draw(&mut renderer, &fields, Wanted::display());
    let [display, _] = audit(&audited(&fields), &frame, renderer.limits()).unwrap();
    assert!(display.images.is_empty());
    assert!(display.not_audited.iter().any(|reason| reason.contains("asteroid field")), "{display:?}");
}

/// Lines and text are not audited.
#[test]
fn overlays_are_left_out() {
    let set = ["overlay.grids=[{ kind = \"equatorial\", colour = \"#ff0000\", opacity = 1.0 }]"];
    let (case, mut renderer) = (small(&set), renderer());
    let frame = draw(&mut renderer, &case, Wanted::display());
    let [display, _] = run_audits(&renderer, &audited(&case), &frame);
    assert!(!display.is_broken());
    assert!(display.images.iter().all(|image| image.left_out > 10 && image.pixels > 200));
}
