//! HDR images drawn within `accuracy.hdr`, compared with exact ones: the error of every pixel, and the light of single stars.

use glam::DVec3;
use steradian::{
    output::Encoding,
    photometry::rec709::luminance,
    plan::budget::ErrorBudget,
    render::{Frame, FrameRequest, Renderer, Wanted},
};

use crate::{
    common::{configured, renderer},
    display_poses::by_brightness,
};

/// Allowed relative error of a pixel's light, and absolute error, cd/m^2, that every pixel may have.
const RELATIVE: f64 = 0.01;
const FLOOR_CD_M2: f64 = 2e-6;
const BUDGET: &str = "accuracy.hdr=0.01";
/// Number of stars whose light is compared.
const STARS: usize = 200;

/// Returns the exact images of a configuration's views, and those drawn within the budget.
fn draw(renderer: &mut Renderer, name: &str, set: &[&str]) -> [Frame; 2] {
    let (scene, rig, settings) = configured(name, set);
    [Wanted::hdr(), Wanted::hdr_streamed()]
        .map(|wanted| renderer.render(FrameRequest::new(&scene, &rig).settings(&settings).wanted(wanted)).unwrap())
}

/// Returns the 99.9 % quantile and the maximum of the errors of all pixels, as multiples of the budget.
fn errors([exact, drawn]: &[Frame; 2], image: usize) -> [f64; 2] {
    let [exact, drawn] = [exact, drawn].map(|frame| frame.images[image].hdr.as_ref().unwrap());
    let mut errors: Vec<f64> = exact
        .iter()
        .zip(drawn)
        .filter(|(exact, _)| exact[3] > 0.0)
        .flat_map(|(exact, drawn)| {
            let [red, green, blue] = [0, 1, 2].map(|channel| f64::from(exact[channel]));
            let allowed = (RELATIVE * luminance([red, green, blue])).max(FLOOR_CD_M2);
            [0, 1, 2].map(|c| f64::from((drawn[c] - exact[c]).abs()) / allowed)
        })
        .collect();
    errors.sort_by(f64::total_cmp);
    [errors[(errors.len() - 1) * 999 / 1000], *errors.last().unwrap()]
}

/// Returns the light of an image, lx.
fn light_lx(frame: &Frame, image: usize) -> f64 {
    let pixels = frame.images[image].hdr.as_ref().unwrap();
    pixels.iter().map(|pixel| f64::from(pixel[1]) * f64::from(pixel[3])).sum()
}

#[test]
fn streamed_light_is_within_its_budget() {
    let mut renderer = renderer();
    let small = "views=[{ name = 'dome', type = 'dome_master', size = [512, 512] }, { name = 'flat', type = 'perspective', size = [640, 360], fov_y_deg = 60 }]";
    // The scenes are a night, nights far from lamps and in a town, a night with the Moon, and dusk at a place on the Earth, and then space.
    for (name, set) in [
        ("tonight.toml", "scene.time='2026-01-03T22:00:00Z'"),
        ("tonight.toml", "scene.observer.air.night_sky_mag=22"),
        ("tonight.toml", "scene.observer.air.night_sky_mag=17"),
        ("tonight.toml", "scene.time='2026-11-20T20:00:00Z'"),
        ("tonight.toml", "scene.time='2026-11-20T16:10:00Z'"),
        ("dome.toml", "exposure={ mode = 'manual', ev100 = -5.4 }"),
    ] {
        let frames = draw(&mut renderer, name, &[small, BUDGET, set]);
        assert_eq!(frames[0].plan.budget, None, "a file is exact");
        assert!(matches!(frames[1].plan.budget, Some(ErrorBudget::Hdr { .. })));
        for image in 0..2 {
            let [most, largest] = errors(&frames, image);
            let [exact, drawn] = [0, 1].map(|frame| light_lx(&frames[frame], image));
            let all = (drawn / exact - 1.0).abs();
            println!(
                "{name}, {set}, {}: 99.9 % {most:.3}, largest {largest:.3} of the budget, all light {all:.1e}",
                ["dome", "flat"][image]
            );
            assert!(most <= 1.0 && largest <= 4.0, "{name} {set}: {most} {largest}");
            assert!(all < 1e-3, "{name} {set}: {all}");
        }
    }
}

#[test]
fn a_coarser_budget_fails_the_finer_one() {
    // The floor first, and then the error relative to the glow of the sky.
    for coarser in ["accuracy.hdr_floor_cd_m2=1e-3", "scene.observer.air.night_sky_mag=22"] {
        let views = "views=[{ name = 'dome', type = 'dome_master', size = [512, 512] }]";
        let [most, _] = errors(&draw(&mut renderer(), "tonight.toml", &[views, "accuracy.hdr=0.5", coarser]), 0);
        println!("{coarser}: {most:.3}");
        assert!(most > 1.5, "{coarser}: {most}");
    }
}

#[test]
fn each_encoding_gets_its_own_budget() {
    let views = "views=[{ name = 'a', type = 'perspective', size = [64, 64], fov_y_deg = 40 }, { name = 'b', type = 'perspective', size = [64, 64], fov_y_deg = 40 }]";
    let mut renderer = renderer();
    let mut drawn = |set: &[&str], encodings: [Encoding; 2]| {
        let (scene, rig, settings) = configured("dome.toml", set);
        let wanted = encodings.map(Encoding::wanted);
        let request = FrameRequest::new(&scene, &rig).settings(&settings).wanted_per_view(&wanted);
        let frame = renderer.render(request).unwrap();
        (frame.plan.budget, frame.hdr_plan.map(|plan| plan.budget))
    };
    let set = [views, BUDGET, "accuracy.hdr_floor_cd_m2=3e-6"];
    let hdr = Some(ErrorBudget::Hdr { relative: RELATIVE, floor_cd_m2: 3e-6 });
    let codes = Some(ErrorBudget::Codes(0.5));
    assert_eq!(drawn(&set, [Encoding::Rgb32f; 2]), (hdr, None));
    assert_eq!(drawn(&set, [Encoding::Rgb32f, Encoding::Rgba8]), (codes, Some(hdr)));
    assert_eq!(drawn(&set, [Encoding::Rgb32f, Encoding::Exr]), (None, None), "a file is exact");
    assert_eq!(drawn(&[views], [Encoding::Rgb32f; 2]), (None, None), "streams are exact by default");
}

/// Returns the largest relative error of the light of the brightest stars in a flat view. The pixels of each star are weighted by the profile of its
/// image.
fn worst_light(renderer: &mut Renderer, set: &[&str]) -> f64 {
    let frames = draw(renderer, "perspective.toml", set);
    assert!(frames[1].plan.budget.is_some(), "the streamed image is not exact");
    let (scene, rig, _) = configured("perspective.toml", set);
    let viewport = &rig.viewports(scene.camera.world_from_camera)[0];
    let mapping = viewport.projection.mapping();
    let [width, height] = mapping.size().map(i64::from);
    let pixel_of = |direction: DVec3| {
        let pixel = mapping.pixel_from_direction(viewport.world_from_view.inverse() * direction)?;
        let (x, y) = (pixel.x.floor() as i64, pixel.y.floor() as i64);
        ((4..width - 4).contains(&x) && (4..height - 4).contains(&y)).then_some((x, y))
    };
    let brightest: Vec<(i64, i64)> = by_brightness(&scene.stars).into_iter().filter_map(pixel_of).take(STARS).collect();
    assert_eq!(brightest.len(), STARS);
    let [exact, drawn] = [0, 1].map(|frame: usize| frames[frame].images[0].hdr.as_ref().unwrap());
    let errors = brightest.into_iter().map(|(x, y)| {
        let light = |image: &[[f32; 4]]| -> f64 {
            let square = (-4..=4).flat_map(|dy| (-4..=4).map(move |dx| ((y + dy) * width + x + dx) as usize));
            square.map(|at| f64::from(exact[at][1]) * f64::from(image[at][1]) * f64::from(image[at][3])).sum()
        };
        (light(drawn) / light(exact) - 1.0).abs()
    });
    errors.fold(0.0, f64::max)
}

#[test]
fn the_light_of_stars_is_exact_within_the_budget() {
    let mut renderer = renderer();
    let view = "views=[{ name = 'flat', type = 'perspective', size = [1280, 720], fov_y_deg = 60 }]";
    let set = [view, "stars.method='auto'", "exposure={ mode = 'manual', ev100 = -5.4 }", BUDGET];
    let worst = worst_light(&mut renderer, &[&set[..], &["glare.fraction=1e-6"]].concat());
    println!("{STARS} stars: largest relative error of their light {worst:.1e}");
    assert!(worst < 1e-4, "{worst}");
    // The budget allows an error of the veil behind the faintest of these stars, which is counted as their light.
    let veiled = worst_light(&mut renderer, &set);
    println!("{STARS} stars with glare: largest relative error of their light {veiled:.1e}");
    assert!(veiled < 7e-4, "{veiled}");
    // A map that contains brighter stars too would change their light.
    let coarse = worst_light(&mut renderer, &[&set[..], &["accuracy.hdr_floor_cd_m2=0.01"]].concat());
    assert!(coarse > 1e-3, "{coarse}");
}
