//! The published star methods that blend: their light compared with closed forms, their shape in the sky, the GPU
//! compared with the f64 reference, cube faces, strips, and the fallback to 16-bit floats.

use std::{
    f64::consts::{FRAC_PI_4, PI},
    path::PathBuf,
};

use crate::common::*;
use glam::{DVec2, DVec3};
use steradian::{
    catalogue::StarRecord,
    gpu::GpuOptions,
    metrics::{HdrView, illuminance_near_direction_lx, illuminance_near_pixel_lx, relative_variation, shape_rad},
    photometry::{
        psf::{PsfError, write_exr},
        rec709::luminance,
        star_image::{SPRITE_SIZE, sprite},
    },
    plan::PlanError,
    plan::{
        settings::{Accumulator, ExposureSettings, RenderSettings, StarMethod},
        stars::billboards::{BillboardPlan, DrawnPsf},
    },
    reference::stars::{
        billboards::{self, Images},
        splat::Eye,
    },
    render::{Frame, FrameRequest, RenderError, Renderer, Wanted},
    scene::SceneSnapshot,
    units::{illuminance_lx_from_magnitude, magnitude_from_illuminance_lx},
    view::{
        Rig, ViewKind,
        projection::{FisheyeMapping, PlaneMapping},
    },
};

/// Exposure of all tests. It is so dark that `psf_texture` is hardly cropped. It is set manually, so that the f64 reference can use it.
const EV100: f64 = -14.0;
/// Light of a star that is drawn as the published disc with glare, relative to the light of the star. The cone gives 0.8. The glare gives 0.2 times a
/// half times the mean of max(0, 0.5 / (r + 0.1)^2 - 0.5) over the disc.
const GLARE_DISC_LIGHT: f64 = 0.8 + 0.2 * 0.5 * 0.997_585;

fn blending() -> impl Iterator<Item = StarMethod> {
    StarMethod::ALL.into_iter().filter(|method| method.accumulator() == Accumulator::Blending)
}

fn manual(method: StarMethod) -> RenderSettings {
    let mut settings = settings(method);
    settings.exposure = ExposureSettings::manual(EV100);
    settings
}

fn white() -> f64 {
    1.2 * EV100.exp2()
}

fn mapping(rig: &Rig, view: usize) -> &dyn PlaneMapping {
    rig.views()[view].images[0].projection.mapping()
}

/// Draws the picture of the f64 reference.
fn twin(scene: &SceneSnapshot, rig: &Rig, view: usize, settings: &RenderSettings) -> Vec<[f64; 3]> {
    let image = sprite(SPRITE_SIZE);
    let psf = psf_of(settings);
    let plan = BillboardPlan::new(&settings.stars, EV100, EV100, psf.as_ref());
    let eye = Eye::default();
    let images: Images<'_> = Images { sprite: Some(&image), psf: psf.as_ref() };
    let limit = renderer_side_limit();
    billboards::draw(&scene.stars, eye, &rig.views()[view].images[0].projection, limit, &plan, images)
}

fn psf_of(settings: &RenderSettings) -> Option<DrawnPsf> {
    let texture = || settings.stars.psf_texture.texture().expect("valid optics");
    (settings.stars.method == StarMethod::PsfTexture).then(|| DrawnPsf::new(&texture()))
}

/// This limit exceeds the sides of all textures in these tests, and every adapter supports it.
fn renderer_side_limit() -> u32 {
    8192
}

/// Returns the sum of the absolute differences divided by the sum of the expected light.
fn difference(frame: &Frame, view: usize, expected: &[[f64; 3]]) -> f64 {
    let hdr = frame.images[view].hdr.as_ref().expect("asked for");
    let total: f64 = expected.iter().map(|rgb| luminance(*rgb)).sum();
    let sum: f64 = hdr
        .iter()
        .zip(expected)
        .map(|([r, g, b, _], rgb)| {
            [r, g, b].into_iter().zip(rgb).map(|(found, expected)| (f64::from(*found) - expected).abs()).sum::<f64>()
        })
        .sum();
    sum / (3.0 * total)
}

/// Returns stars of several magnitudes and colours in all directions.
fn sky() -> Vec<StarRecord> {
    spiral(400)
        .enumerate()
        .map(|(i, direction)| StarRecord {
            temperature_k: 3000.0 + 40.0 * i as f32,
            ..star(direction, (i % 7) as f32 * 0.6 - 1.0)
        })
        .collect()
}

fn limit_of(method: StarMethod) -> f64 {
    match method {
        // If a pixel centre is within the precision of f32 from the edge of a disc, it can be inside for one renderer and outside for the other.
        StarMethod::Disc => 5e-3,
        _ => 1e-3,
    }
}

#[test]
fn the_gpu_equals_the_reference_on_a_plane_and_in_a_fisheye() {
    let mut renderer = renderer();
    let rig = rig(vec![
        ("flat", ViewKind::Perspective { size: [320, 200], fov_y_rad: 1.4 }),
        ("lens", ViewKind::Fisheye { size: [220, 200], mapping: FisheyeMapping::Equidistant, fov_rad: 3.6 }),
    ]);
    let scene = snapshot(sky());
    for method in blending() {
        let mut settings = manual(method);
        settings.stars.billboard.diameter_arcmin = 150.0;
        settings.stars.psf_texture.width_arcmin = 1200.0;
        settings.stars.psf_texture.diameter_mm = 0.2;
        let frame = render_hdr(&mut renderer, &scene, &rig, &settings);
        let found = [0, 1].map(|view| difference(&frame, view, &twin(&scene, &rig, view, &settings)));
        println!("{}: GPU against twin, flat {:.1e}, fisheye {:.1e}", method.name(), found[0], found[1]);
        assert!(found.iter().all(|found| *found < limit_of(method)), "{}: {found:?}", method.name());
        assert!(frame.plan.stars.contains("cube faces") && frame.plan.accumulator.contains("blending"));
        assert!(frame.views.iter().all(|view| view.stars_drawn > 0));
    }
}

/// The comparison above must fail for the picture of another method, and for one with a missing star.
#[test]
fn another_method_or_a_missing_star_fails_the_comparison() {
    let mut renderer = renderer();
    let rig = rig(vec![("flat", ViewKind::Perspective { size: [320, 200], fov_y_rad: 1.4 })]);
    let scene = snapshot(sky());
    let mut settings = manual(StarMethod::SmoothDisc);
    settings.stars.billboard.diameter_arcmin = 150.0;
    let frame = render_hdr(&mut renderer, &scene, &rig, &settings);
    let limit = limit_of(StarMethod::Disc);
    settings.stars.method = StarMethod::Disc;
    assert!(difference(&frame, 0, &twin(&scene, &rig, 0, &settings)) > 0.1);
    settings.stars.method = StarMethod::SmoothDisc;
    let mut short = sky();
    let ahead = short.iter().position(|star| star.position.dot(DVec3::NEG_Z) > 0.9).expect("a star in view");
    short.remove(ahead);
    assert!(difference(&frame, 0, &twin(&snapshot(short), &rig, 0, &settings)) > limit);
}

/// Returns the light of one star of magnitude -1 in a view of 110 degrees, divided by `expected_lx(mapping, pixel)`: the mean over sub-pixel
/// positions near the centre, and that near 45 degrees off the axis.
fn light_over(
    renderer: &mut Renderer,
    settings: &RenderSettings,
    expected_lx: impl Fn(&dyn PlaneMapping, DVec2) -> f64,
) -> [f64; 2] {
    let rig = rig(vec![("flat", ViewKind::Perspective { size: [600, 600], fov_y_rad: 110f64.to_radians() })]);
    let mapping = mapping(&rig, 0);
    let off_axis = mapping.pixel_from_direction(DVec3::new(0.6, 0.8, -1.0)).expect("in view");
    [DVec2::splat(300.0), off_axis].map(|place| {
        let ratios = (0..8).map(|i| {
            let pixel = place.floor() + DVec2::new(0.06 + 0.125 * f64::from(i), (0.31 + 0.618 * f64::from(i)).fract());
            let scene = snapshot(vec![star(mapping.direction_from_pixel(pixel).expect("in view"), -1.0)]);
            let frame = render_hdr(renderer, &scene, &rig, settings);
            illuminance_lx(&frame.images[0], mapping) / expected_lx(mapping, pixel)
        });
        ratios.sum::<f64>() / 8.0
    })
}

/// The light of every method equals the closed form of the published formula, which is not always the light of the star.
#[test]
fn the_light_of_a_star_equals_the_published_formula() {
    let mut renderer = renderer();
    let star_lx = illuminance_lx_from_magnitude(-1.0);
    let pixel_sr = |mapping: &dyn PlaneMapping, at: DVec2| mapping.solid_angle_sr(at.x as u32, at.y as u32);
    // The tolerances have three reasons. The sum over the pixel centres of a disc with a radius of about 7 pixels approximates an integral, within 1
    // % if the edge is sharp. The solid angle varies across a footprint, by 1 % at 45 degrees. The solid angles of points are computed from triangles
    // in f32.
    for (method, light, tolerance) in [
        (StarMethod::HardwarePoint, 1.0, 2e-3),
        (StarMethod::Disc, 1.0, 1e-2),
        (StarMethod::SmoothDisc, 1.0, 5e-3),
        (StarMethod::ScaledDisc, 1.0, 5e-3),
        (StarMethod::GlareDisc, GLARE_DISC_LIGHT, 2e-2),
        (StarMethod::Sprite, 4.0 / PI, 2e-2),
    ] {
        let mut settings = manual(method);
        settings.stars.billboard.diameter_arcmin = 240.0;
        let found = light_over(&mut renderer, &settings, |_, _| star_lx * light);
        println!(
            "{}: light relative to {light:.4} times the light of the star: {:.4} in the centre, {:.4} at 45 degrees",
            method.name(),
            found[0],
            found[1]
        );
        assert!(found.iter().all(|found| (found - 1.0).abs() < tolerance), "{}: {found:?}", method.name());
    }

    // This method is not normalised: the shares of a disc with a diameter of one pixel sum to 1 if the star is on the centre
    // or on an edge of a pixel, and to more in between.
    let found = light_over(&mut renderer, &manual(StarMethod::HardwareSmoothPoint), |_, _| star_lx);
    println!(
        "hardware_smooth_point: light relative to that of the star: {:.4} in the centre, {:.4} at 45 degrees",
        found[0], found[1]
    );
    assert!(found.iter().all(|found| (1.0..1.2).contains(found)), "{found:?}");

    // For methods with relative brightness, the light is in units of display white times a number of pixels.
    let mut settings = manual(StarMethod::ScreenBillboard);
    settings.stars.billboard.screen_size_px = 12.0;
    let brightness = 10f64.powf(0.4 * (1.0 + 1.0));
    let spot = |mapping: &dyn PlaneMapping, at: DVec2| brightness * white() * PI * 36.0 / 3.0 * pixel_sr(mapping, at);
    let found = light_over(&mut renderer, &settings, spot);
    println!(
        "screen_billboard: light relative to the closed form: {:.4} in the centre, {:.4} at 45 degrees",
        found[0], found[1]
    );
    assert!(found.iter().all(|found| (found - 1.0).abs() < 5e-3), "{found:?}");

    for method in [StarMethod::GaussianPsf, StarMethod::GaussianPsfIntegrated] {
        let settings = manual(method);
        let brightness = 2.512f64.powf((7.0 - 1.0) * (1.0 + 1.0));
        let area = 2.0 * PI * (0.49 + 0.01 * 9.0);
        let found =
            light_over(&mut renderer, &settings, |mapping, at| brightness * white() * area * pixel_sr(mapping, at));
        println!(
            "{}: light relative to the closed form: {:.4} in the centre, {:.4} at 45 degrees",
            method.name(),
            found[0],
            found[1]
        );
        assert!(found.iter().all(|found| (found - 1.0).abs() < 5e-3), "{}: {found:?}", method.name());
    }
}

/// If the core of a point-spread function is resolved, the picture has all light of the star.
#[test]
fn a_resolved_point_spread_function_keeps_the_light() {
    let mut renderer = renderer();
    let mut settings = manual(StarMethod::PsfTexture);
    settings.exposure = ExposureSettings::manual(-40.0);
    settings.stars.psf_texture.width_arcmin = 1200.0;
    settings.stars.psf_texture.diameter_mm = 0.2;
    let rig = rig(vec![("flat", ViewKind::Perspective { size: [900, 900], fov_y_rad: 24f64.to_radians() })]);
    let mapping = mapping(&rig, 0);
    for at in [DVec2::new(450.3, 450.6), DVec2::new(451.0, 449.5)] {
        let scene = snapshot(vec![star(mapping.direction_from_pixel(at).expect("in view"), 0.0)]);
        let frame = render_hdr(&mut renderer, &scene, &rig, &settings);
        let error = illuminance_lx(&frame.images[0], mapping) / illuminance_lx_from_magnitude(0.0) - 1.0;
        println!("psf_texture, pixels of {:.2} texels: error of the light {error:.4}", 24.0 / 900.0 * 512.0 / 20.0);
        // The core is about two texels wide and is sampled at pixel centres.
        assert!(error.abs() < 0.05);
    }
}

fn ellipticity(image: &HdrView<'_>, direction: DVec3, radius_rad: f64) -> f64 {
    shape_rad(&[*image], direction, radius_rad).expect("light").ellipticity().expect("no point")
}

/// At 45 degrees off the axis, discs that are drawn in the sky are round, and screen-space squares have an ellipticity of 1 - cos 45 degrees.
#[test]
fn discs_are_round_off_axis_and_screen_billboards_are_not() {
    let mut renderer = renderer();
    let rig = rig(vec![("flat", ViewKind::Perspective { size: [1000, 1000], fov_y_rad: 110f64.to_radians() })]);
    let direction = DVec3::new(0.6, 0.8, -1.0).normalize();
    let scene = snapshot(vec![star(direction, -1.0)]);
    let mut found = |method: StarMethod| {
        let mut settings = manual(method);
        settings.stars.billboard.diameter_arcmin = 360.0;
        settings.stars.billboard.screen_size_px = 60.0;
        settings.stars.gaussian_psf.sigma2_px2 = 25.0;
        settings.stars.gaussian_psf.glare_sigma2_px2 = 100.0;
        let frame = render_hdr(&mut renderer, &scene, &rig, &settings);
        let found = ellipticity(&hdr_view(&frame.images[0], mapping(&rig, 0)), direction, 0.3);
        println!("{}: ellipticity at 45 degrees {found:.4}", method.name());
        found
    };
    for method in [StarMethod::Disc, StarMethod::SmoothDisc, StarMethod::ScaledDisc, StarMethod::GlareDisc] {
        assert!(found(method) < 8.7e-3);
    }
    for method in [StarMethod::ScreenBillboard, StarMethod::GaussianPsf, StarMethod::GaussianPsfIntegrated] {
        assert!((found(method) - (1.0 - FRAC_PI_4.cos())).abs() < 3.7e-3);
    }
}

fn mean_and_std(values: &[f64]) -> (f64, f64) {
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    (mean, (values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / values.len() as f64).sqrt())
}

/// Returns the light of many equal stars at different sub-pixel positions.
fn sub_pixel_light(renderer: &mut Renderer, method: StarMethod) -> Vec<f64> {
    let rig = rig(vec![("flat", ViewKind::Perspective { size: [640, 640], fov_y_rad: 0.01 })]);
    let mapping = mapping(&rig, 0);
    let mut settings = manual(method);
    settings.stars.gaussian_psf.sigma2_px2 = 0.25;
    settings.stars.gaussian_psf.glare_brightness = 0.0;
    let places: Vec<DVec2> = (0..1600)
        .map(|i| {
            let cell = DVec2::new(f64::from(i % 40), f64::from(i / 40)) * 16.0 + 7.0;
            cell + DVec2::new((0.5 + 0.754_878 * f64::from(i)).fract(), (0.5 + 0.569_840 * f64::from(i)).fract())
        })
        .collect();
    let stars = places.iter().map(|at| star(mapping.direction_from_pixel(*at).expect("in view"), 0.0)).collect();
    let frame = render_hdr(renderer, &snapshot(stars), &rig, &settings);
    let view = hdr_view(&frame.images[0], mapping);
    places.iter().map(|at| illuminance_near_pixel_lx(&view, *at, 7.0).expect("light")).collect()
}

#[test]
fn a_sampled_gaussian_flickers_and_an_integrated_one_does_not() {
    let mut renderer = renderer();
    let mut std = |method| {
        let (mean, std) = mean_and_std(&sub_pixel_light(&mut renderer, method));
        std / mean
    };
    let (sampled, integrated) = (std(StarMethod::GaussianPsf), std(StarMethod::GaussianPsfIntegrated));
    println!("std of the light of a star at sigma 0.5 px: sampled {sampled:.5}, integrated {integrated:.5}");
    assert!((sampled - 0.014).abs() < 0.002 && integrated < 6.4e-5);
}

/// The point-spread function covers the same solid angle in views of any shape and projection: the lit pixels of a star that is not cropped are
/// compared with a square of angles, which is integrated numerically.
#[test]
fn a_point_spread_function_has_the_same_size_in_every_view() {
    let mut renderer = renderer();
    let mut settings = manual(StarMethod::PsfTexture);
    settings.exposure = ExposureSettings::manual(-60.0);
    settings.stars.psf_texture.width_arcmin = 1160.0;
    settings.stars.psf_texture.diameter_mm = 0.2;
    let rig = rig(vec![
        ("wide", ViewKind::Perspective { size: [800, 450], fov_y_rad: 0.9 }),
        ("tall", ViewKind::Perspective { size: [450, 800], fov_y_rad: 1.4 }),
        ("lens", ViewKind::Fisheye { size: [900, 900], mapping: FisheyeMapping::Equidistant, fov_rad: 2.2 }),
    ]);
    let half = (10f64 * 1160.0 / 1200.0).to_radians();
    let step = half / 500.0;
    let cells = (0..1_000_000).map(|i| (f64::from(i % 1000) - 499.5, f64::from(i / 1000) - 499.5));
    let expected: f64 = cells.map(|(x, y)| step * step * (x.hypot(y) * step).sin() / (x.hypot(y) * step)).sum();
    let scene = snapshot(vec![star(DVec3::new(0.13, -0.11, -1.0), 0.0)]);
    let mut lit = |settings: &RenderSettings| {
        let frame = render_hdr(&mut renderer, &scene, &rig, settings);
        [0, 1, 2].map(|view| {
            let image = &frame.images[view];
            let lit = (0..image.width * image.height)
                .filter(|i| image.hdr.as_ref().expect("asked for")[*i as usize][1] > 0.0);
            lit.map(|i| mapping(&rig, view).solid_angle_sr(i % image.width, i / image.width)).sum::<f64>() / expected
        })
    };
    let found = lit(&settings);
    println!("psf_texture: solid angle relative to the expected one in 16:9, 9:16 and a fisheye: {found:.4?}");
    // Along an edge of 110 to 170 pixels, a partly covered pixel can be lit or not. Interpolation between the texels of a cube lights up to one
    // additional pixel.
    let limits = [0.01, 0.01, 0.03];
    let within = |found: [f64; 3]| (0..3).map(|view| (found[view] - 1.0).abs() < limits[view]).collect::<Vec<_>>();
    assert_eq!(within(found), [true; 3]);
    settings.stars.psf_texture.width_arcmin = 1200.0;
    settings.stars.psf_texture.diameter_mm = 0.2;
    assert_eq!(within(lit(&settings)), [false; 3]);
}

/// A disc and a sprite move across the edges and corners of the cube behind a fisheye view.
#[test]
fn no_seam_is_visible_between_cube_faces() {
    let mut renderer = renderer();
    let rig = rig(vec![(
        "lens",
        ViewKind::Fisheye { size: [500, 500], mapping: FisheyeMapping::Equisolid, fov_rad: 200f64.to_radians() },
    )]);
    let variation = |renderer: &mut Renderer, method: StarMethod, lines: [(DVec3, DVec3); 2]| -> f64 {
        let mut settings = manual(method);
        settings.stars.billboard.diameter_arcmin = 480.0;
        let light: Vec<f64> = lines
            .into_iter()
            .flat_map(|(from, to)| (0..24).map(move |i| from.lerp(to, f64::from(i) / 23.0)))
            .map(|direction| {
                let frame = render_hdr(renderer, &snapshot(vec![star(direction, 0.0)]), &rig, &settings);
                let view = hdr_view(&frame.images[0], mapping(&rig, 0));
                illuminance_near_direction_lx(&[view], direction.normalize(), 0.3).expect("light")
            })
            .collect();
        relative_variation(&light).expect("light")
    };
    let edge = (DVec3::new(0.9, 0.31, -1.0), DVec3::new(1.1, 0.31, -1.0));
    let corner = (DVec3::new(0.93, 0.9, -1.0), DVec3::new(1.1, 1.13, -1.0));
    let inside = (DVec3::new(0.3, 0.31, -1.0), DVec3::new(0.5, 0.31, -1.0));
    for method in [StarMethod::SmoothDisc, StarMethod::Sprite] {
        let across = variation(&mut renderer, method, [edge, corner]);
        let within = variation(&mut renderer, method, [inside, inside]);
        println!(
            "{}: the light varies by {across:.2e} across edge and corner, by {within:.2e} within a face",
            method.name()
        );
        // The light varies only with the position of the pixel centres on the profile.
        assert!(across < 1.5 * within);
    }
    // Compare with the variation if a quarter of the light is lost at one of 48 positions, as at a corner without a guard band.
    let mut light = vec![1.0; 48];
    light[30] = 0.75;
    assert!(relative_variation(&light).expect("light") > 1.5 * 1.7e-3);
}

/// Resampling from cube faces keeps the mean light of points, but not the light of each one.
#[test]
fn points_through_cube_faces_keep_only_their_mean_light() {
    let mut renderer = renderer();
    let kind = ViewKind::Fisheye { size: [400, 400], mapping: FisheyeMapping::Equidistant, fov_rad: PI };
    let rig = rig(vec![("lens", kind)]);
    let directions: Vec<DVec3> = spiral(500).filter(|direction| direction.z < -0.05).collect();
    let scene = snapshot(directions.iter().map(|direction| star(*direction, 0.0)).collect());
    for method in [StarMethod::HardwarePoint, StarMethod::HardwareSmoothPoint] {
        let frame = render_hdr(&mut renderer, &scene, &rig, &manual(method));
        let view = hdr_view(&frame.images[0], mapping(&rig, 0));
        let light: Vec<f64> = directions
            .iter()
            .map(|direction| {
                let light = illuminance_near_direction_lx(&[view], *direction, 0.04).expect("light");
                light / illuminance_lx_from_magnitude(0.0)
            })
            .collect();
        let (mean, std) = mean_and_std(&light);
        let least = light.iter().copied().fold(f64::INFINITY, f64::min);
        let most = light.iter().copied().fold(0.0, f64::max);
        println!(
            "{} through cube faces: mean light {mean:.3} of the catalogue's, std {std:.3}, {least:.2} to {most:.2}",
            method.name()
        );
        assert!((mean - 1.0).abs() < 0.1 && std > 0.05);
    }
}

/// Strips of a few rows give the same bits as the whole picture, and the star counts equal those of our methods.
#[test]
fn billboards_in_strips_give_the_same_bits_and_counts() {
    let kinds = || {
        vec![
            ("flat", ViewKind::Perspective { size: [160, 120], fov_y_rad: 1.2 }),
            ("lens", ViewKind::Fisheye { size: [120, 120], mapping: FisheyeMapping::Stereographic, fov_rad: 3.5 }),
        ]
    };
    let scene = snapshot(sky());
    let rig = rig(kinds());
    let mut whole = renderer();
    let mut strips = renderer_with(&GpuOptions { binding_limit_bytes: Some(160 * 16 * 25), ..Default::default() });
    let ours = render_hdr(&mut whole, &scene, &rig, &manual(StarMethod::BSpline));
    for method in [StarMethod::HardwarePoint, StarMethod::GlareDisc] {
        let expected = render_hdr(&mut whole, &scene, &rig, &manual(method));
        let found = render_hdr(&mut strips, &scene, &rig, &manual(method));
        for (found, expected) in found.images.iter().zip(&expected.images) {
            assert!(found.hdr == expected.hdr, "{}", method.name());
        }
        let counts = |frame: &Frame| frame.views.iter().map(|view| view.stars_drawn).collect::<Vec<_>>();
        assert_eq!(counts(&expected), counts(&ours));
        assert_eq!(counts(&found), counts(&ours));
    }
}

/// A narrow picture needs only one face of the cube, with the resolution of the picture. If faces exceed the memory limit of a frame, they are
/// refused before anything is allocated.
#[test]
fn a_narrow_fisheye_is_drawn_on_one_face_and_vast_faces_are_refused() {
    let lens = |side: u32, degrees: f64| {
        let mapping = FisheyeMapping::Equidistant;
        rig(vec![("lens", ViewKind::Fisheye { size: [side; 2], mapping, fov_rad: degrees.to_radians() })])
    };
    let mut renderer = renderer();
    let narrow = lens(128, 8.0);
    let scene = snapshot(vec![star(DVec3::new(0.02, 0.01, -1.0), 2.0)]);
    let mut settings = manual(StarMethod::SmoothDisc);
    settings.stars.billboard.diameter_arcmin = 60.0;
    let frame = render_hdr(&mut renderer, &scene, &narrow, &settings);
    let light = illuminance_lx(&frame.images[0], mapping(&narrow, 0)) / illuminance_lx_from_magnitude(2.0);
    println!("a disc of a degree in a fisheye of 8 degrees: light relative to that of the star {light:.4}");
    assert!((light - 1.0).abs() < 6e-3);
    assert!(difference(&frame, 0, &twin(&scene, &narrow, 0, &settings)) < 4.2e-5);

    let vast = lens(10_900, 95.0);
    assert!(renderer.check(&vast).is_ok(), "the picture itself fits");
    let error = renderer
        .render(
            FrameRequest::new(&scene, &vast)
                .settings(&settings)
                .wanted(Wanted { hdr_stays: true, ..Wanted::default() }),
        )
        .expect_err("six faces do not fit");
    assert!(matches!(&error, RenderError::Plan(PlanError::TooManyPixels { view, .. }) if view == "lens"), "{error}");
}

#[test]
fn the_fallback_to_16_bit_blending_is_reported() {
    let mut halves = renderer_with(&GpuOptions { force_half_blending: true, ..Default::default() });
    assert!(halves.adapter().fallbacks.iter().any(|fallback| fallback.contains("16-bit")));
    let rig = rig(vec![("flat", ViewKind::Perspective { size: [200, 200], fov_y_rad: 1.2 })]);
    let mut settings = manual(StarMethod::SmoothDisc);
    settings.stars.billboard.diameter_arcmin = 240.0;
    let scene = snapshot(vec![star(DVec3::NEG_Z, -4.0)]);
    let frame = render_hdr(&mut halves, &scene, &rig, &settings);
    assert_eq!(frame.plan.accumulator, "additive blending, 16-bit floats");
    let error = illuminance_lx(&frame.images[0], mapping(&rig, 0)) / illuminance_lx_from_magnitude(-4.0) - 1.0;
    println!("smooth_disc blended in halves: relative error of the light {error:.1e}");
    assert!(error.abs() < 1.9e-4);
}

/// All values are finite for stars at the camera, next to it and behind it, and for a star far too bright for the published
/// exponent.
#[test]
fn stars_at_the_camera_and_the_sun_stay_finite() {
    let mut renderer = renderer();
    let rig = rig(vec![
        ("flat", ViewKind::Perspective { size: [64, 64], fov_y_rad: 2.8 }),
        ("all", ViewKind::Equirectangular { size: [64, 32] }),
    ]);
    let placed = |position: DVec3| StarRecord { position, magnitude: 4.8, temperature_k: 5772.0, distance_known: true };
    let near = [DVec3::ZERO, DVec3::Z, DVec3::NEG_Z * 1e-6, DVec3::X * 1e-6, DVec3::new(1e-6, -1e-6, 0.0)];
    let scene = snapshot(near.map(placed).into_iter().chain([star(DVec3::new(0.1, 0.2, -1.0), -26.7)]).collect());
    for method in blending() {
        let mut settings = manual(method);
        settings.stars.psf_texture.width_arcmin = 1200.0;
        settings.stars.psf_texture.diameter_mm = 0.2;
        let frame = render_hdr(&mut renderer, &scene, &rig, &settings);
        for image in &frame.images {
            let finite = image.hdr.as_ref().expect("asked for").iter().flatten().all(|value| value.is_finite());
            assert!(finite, "{}", method.name());
        }
    }
}

/// The published exponent is a product of two ranges of magnitudes. It hides stars that are far brighter than the method's own limit.
#[test]
fn the_published_exponent_hides_stars_brighter_than_the_limiting_magnitude() {
    let plan = BillboardPlan::new(&manual(StarMethod::GaussianPsf).stars, EV100, EV100, None);
    let last = magnitude_from_illuminance_lx(plan.faintest_lx);
    println!(
        "gaussian_psf with limiting magnitude 7 and saturation magnitude 1: the faintest visible star has {last:.2}"
    );
    assert!(last < 3.0);
}

/// A point-spread function from a file is drawn like the computed one. A missing file fails one frame only, and changed settings take effect.
#[test]
fn a_point_spread_function_comes_from_a_file_or_fails_one_frame() {
    let mut renderer = renderer();
    let rig = rig(vec![("flat", ViewKind::Perspective { size: [200, 200], fov_y_rad: 0.2 })]);
    let scene = snapshot(vec![star(DVec3::new(0.01, 0.02, -1.0), 0.0)]);
    let folder = tempfile::tempdir().expect("a folder");
    let computed = manual(StarMethod::PsfTexture);
    let path = folder.path().join("hexagon.exr");
    write_exr(&path, &computed.stars.psf_texture.texture().expect("valid optics")).expect("written");
    let with_file = |path: PathBuf| {
        let mut settings = computed.clone();
        settings.stars.psf_texture.file = Some(path);
        settings
    };
    let light = |frame: &Frame| frame.images[0].hdr.clone().expect("asked for");
    let expected = light(&render_hdr(&mut renderer, &scene, &rig, &computed));

    let missing = with_file(folder.path().join("missing.exr"));
    let error = renderer
        .render(FrameRequest::new(&scene, &rig).settings(&missing).wanted(Wanted::hdr()))
        .expect_err("no such file");
    assert!(
        matches!(&error, RenderError::Plan(PlanError::Psf(PsfError::Read { .. })))
            && error.to_string().contains("missing.exr")
    );

    let difference = |found: &[[f32; 4]]| {
        let sum = |value: &dyn Fn(usize) -> f32| (0..found.len()).map(|i| f64::from(value(i))).sum::<f64>();
        sum(&|i| (found[i][1] - expected[i][1]).abs()) / sum(&|i| expected[i][1])
    };
    let found = light(&render_hdr(&mut renderer, &scene, &rig, &with_file(path)));
    println!("psf_texture from a file against the computed one: {:.1e}", difference(&found));
    assert!(difference(&found) < 1e-6);
    let mut other = computed.clone();
    other.stars.psf_texture.aperture = "hubble".to_owned();
    let found = light(&render_hdr(&mut renderer, &scene, &rig, &other));
    println!("another aperture: {:.1e}", difference(&found));
    assert!(difference(&found) > 0.05);
    // A frame with another method in between does not change the function.
    render_hdr(&mut renderer, &scene, &rig, &manual(StarMethod::Sprite));
    let found = light(&render_hdr(&mut renderer, &scene, &rig, &computed));
    assert_eq!(difference(&found), 0.0);
}
