//! Tests of `sky_cube` in addition to the checks of `verify`: state kept between frames, short sprite lists, parallax, aberration, and kernels that
//! end.

use crate::common::*;
use glam::{DQuat, DVec3};
use steradian::{
    catalogue::StarRecord,
    gpu::GpuOptions,
    photometry::{glare::GlareKernelName, rec709::luminance},
    plan::PlanError,
    plan::settings::{AccuracySettings, GlareMethod, GlareSettings, RenderSettings, StarMethod},
    render::{FrameRequest, RenderError, Renderer, Wanted},
    scene::SceneSnapshot,
    units::PARSEC_M,
    verify::scenes::{fisheye, star_at},
    view::{
        Rig, ViewKind,
        projection::{FisheyeMapping, pixel_centre},
    },
};

fn scattered() -> RenderSettings {
    let glare = GlareSettings { method: GlareMethod::SkyCube, fraction: 1.0, ..GlareSettings::default() };
    RenderSettings { glare, ..RenderSettings::default() }
}

fn crowd(stars: usize) -> SceneSnapshot {
    let records: Vec<StarRecord> =
        spiral(stars).enumerate().map(|(i, direction)| star(direction, (i * 7919 % 60) as f32 / 10.0)).collect();
    snapshot(records)
}

fn views() -> Rig {
    rig(vec![
        ("window", ViewKind::Perspective { size: [200, 120], fov_y_rad: 1.0 }),
        ("dome", fisheye(96, FisheyeMapping::Equidistant, 200.0)),
    ])
}

fn pixels(renderer: &mut Renderer, scene: &SceneSnapshot, settings: &RenderSettings) -> Vec<[f32; 4]> {
    let frame = render_hdr(renderer, scene, &views(), settings);
    frame.images.into_iter().flat_map(|image| image.hdr.unwrap()).collect()
}

/// The cached sky depends only on the current scene, camera position and settings.
#[test]
fn glare_does_not_depend_on_earlier_frames() {
    let scene = crowd(400);
    let mut turned = scene.clone();
    turned.camera.world_from_camera = DQuat::from_rotation_y(1.0);
    let mut flown = scene.clone();
    flown.camera.position_m = DVec3::new(0.3e9, -100.0, 0.4e9);
    let other = crowd(300);
    let mut wider = scattered();
    wider.glare.inner_deg = 0.5;
    // The cells are the same, but other sources are drawn individually.
    let mut finer = scattered();
    finer.accuracy.glare *= 0.01;
    let mut used = renderer();
    let frames = [
        (&scene, scattered()),
        (&turned, scattered()),
        (&other, scattered()),
        (&scene, wider),
        (&flown, scattered()),
        (&scene, scattered()),
        (&scene, finer),
    ];
    let of_used: Vec<_> = frames.iter().map(|(scene, settings)| pixels(&mut used, scene, settings)).collect();
    for ((scene, settings), drawn) in frames.iter().zip(&of_used) {
        assert!(pixels(&mut new_renderer(), scene, settings) == *drawn, "a fresh renderer draws the same bits");
    }
    assert!(of_used[0] == of_used[5] && [1, 2, 3, 6].into_iter().all(|other| of_used[0] != of_used[other]));
}

/// If a star is so near that it shows parallax within a cached map, its glare is around the position at which the camera sees it.
#[test]
fn glare_of_a_near_star_follows_parallax() {
    let rig = rig(vec![("window", ViewKind::Perspective { size: [100, 100], fov_y_rad: 0.01 })]);
    let draw = |camera_m: DVec3, star_m: DVec3| {
        let mut scene = snapshot(vec![star_at(star_m / PARSEC_M, 5.0)]);
        scene.camera.position_m = camera_m;
        let frame = render_hdr(&mut renderer(), &scene, &rig, &scattered());
        frame.images[0].hdr.clone().unwrap()
    };
    let difference = |a: &[[f32; 4]], b: &[[f32; 4]]| {
        a.iter().zip(b).map(|(a, b)| f64::from((a[1] / b[1] - 1.0).abs())).fold(0.0, f64::max)
    };
    let (camera_m, ahead_m) = (DVec3::new(0.45e9, -0.2e9, 0.0), DVec3::new(0.0, 0.0, -2e12));
    let from_the_centre = draw(DVec3::ZERO, ahead_m);
    let both_shifted = draw(camera_m, camera_m + ahead_m);
    let same = difference(&both_shifted, &from_the_centre);
    let parallax = difference(&draw(camera_m, ahead_m), &from_the_centre);
    println!("camera and star shifted together: {same:.1e}; only the camera shifted: {parallax:.2}");
    assert!(same < 1e-6 && parallax > 0.05);
}

/// If the binding limit truncates sprite lists, pixels search the list of their square, and then that of the whole sky.
#[test]
fn short_sprite_lists_lose_no_light() {
    let scene = crowd(3000);
    let whole = pixels(&mut renderer(), &scene, &scattered());
    let sum = |pixels: &[[f32; 4]]| pixels.iter().map(|pixel| f64::from(pixel[1])).sum::<f64>();
    for binding_limit_bytes in [1 << 20, 600 << 10] {
        let options = GpuOptions { binding_limit_bytes: Some(binding_limit_bytes), ..GpuOptions::default() };
        let short = pixels(&mut renderer_with(&options), &scene, &scattered());
        let worst = whole
            .iter()
            .zip(&short)
            .map(|(a, b)| f64::from((a[1] - b[1]).abs() / a[1].max(1e-30)))
            .fold(0.0_f64, f64::max);
        assert!(worst < 1e-5, "{binding_limit_bytes}: {worst}");
        assert!((sum(&short) / sum(&whole) - 1.0).abs() < 1e-6);
    }
}

/// A moving camera sees glare around the aberrated position of the star.
#[test]
fn glare_follows_aberration() {
    let mut scene = snapshot(vec![star(DVec3::new(0.9, 0.0, -0.2), 0.0)]);
    let brightest = |scene: &SceneSnapshot| {
        let rig = rig(vec![("window", ViewKind::Perspective { size: [200, 120], fov_y_rad: 1.0 })]);
        let frame = render_hdr(&mut renderer(), scene, &rig, &scattered());
        let hdr = frame.images[0].hdr.clone().unwrap();
        let brightest = (0..hdr.len()).max_by(|a, b| hdr[*a][1].total_cmp(&hdr[*b][1])).unwrap();
        (brightest % 200, hdr[brightest][1])
    };
    let (column, at_rest) = brightest(&scene);
    assert_eq!(column, 199, "the star is to the right of the picture");
    scene.camera.velocity_c = DVec3::new(0.0, 0.0, -0.9);
    let (column, moving) = brightest(&scene);
    // tan(apparent) = sin a / (gamma (cos a + beta)), with a measured from the direction of flight.
    let sine = 0.9 / 0.9_f64.hypot(0.2);
    let cosine = 0.2 / 0.9_f64.hypot(0.2);
    let tangent = sine * (1.0 - 0.81_f64).sqrt() / (cosine + 0.9);
    let expected = 100.0 + tangent / 0.5_f64.tan() * 60.0;
    assert!((column as f64 + 0.5 - expected).abs() < 1.0, "column {column}, expected {expected}");
    assert!(moving > 10.0 * at_rest);
}

/// If the table of a kernel ends near the source, there is no light beyond its end, and the star is not drawn over the whole sky.
#[test]
fn a_kernel_table_gives_light_only_up_to_its_end() {
    let folder = tempfile::tempdir().unwrap();
    let psf_file = folder.path().join("narrow.csv");
    std::fs::write(&psf_file, "theta_deg,per_sr\n0.1,100\n1,1\n4,0.0625\n5,0\n").unwrap();
    let mut settings = scattered();
    settings.glare.kernel = GlareKernelName::Psf;
    settings.glare.psf_file = Some(psf_file);
    let scene = snapshot(vec![star(DVec3::new(0.0, 0.0, -1.0), 0.0)]);
    let rig = rig(vec![("window", ViewKind::Perspective { size: [300, 300], fov_y_rad: 30f64.to_radians() })]);
    let frame = render_hdr(&mut renderer(), &scene, &rig, &settings);
    let hdr = frame.images[0].hdr.as_ref().unwrap();
    let kernel = settings.glare.kernel().unwrap();
    let illuminance_lx = steradian::units::illuminance_lx_from_magnitude(0.0);
    let mapping = rig.views()[0].images[0].projection.mapping();
    for column in 150..300_u32 {
        let angle = mapping.direction_from_pixel(pixel_centre(column, 150)).unwrap().angle_between(DVec3::NEG_Z);
        let expected = illuminance_lx * kernel.per_sr(angle);
        let found = f64::from(hdr[150 * 300 + column as usize][1]);
        let scale = illuminance_lx * kernel.per_sr(0.05);
        // The colour of the light is neutral to within a tenth. The light is spread over two pixels, and fades towards the end of the table.
        if (0.004..0.03).contains(&angle) {
            assert!((found / expected - 1.0).abs() < 0.2, "{angle}: {found} {expected}");
        } else if angle > 0.2 {
            assert!(found < 0.02 * scale, "{angle}: {found}");
        }
    }
}

/// The procedural sky does not draw the stars of catalogues, so there is no source of glare.
#[test]
fn glare_with_the_procedural_sky_is_refused() {
    let mut settings = scattered();
    settings.stars.method = StarMethod::CellSky;
    let error = renderer()
        .render(FrameRequest::new(&crowd(10), &views()).settings(&settings).wanted(Wanted::hdr()))
        .unwrap_err();
    assert!(matches!(error, RenderError::Plan(PlanError::GlareOfCatalogue("cell_sky"))), "{error}");
    assert!(error.to_string().contains("view_pyramid"));
}

/// Returns the luminances of the pixels of the evening sky in an exact frame, cd/m^2.
fn luminances_in_air(renderer: &mut Renderer, time: &str, tolerance: f64) -> Vec<f64> {
    let set = [
        "views.dome.size=[384,384]".to_owned(),
        "views.south.size=[320,180]".to_owned(),
        format!("scene.time={time}"),
        format!("accuracy.glare={tolerance}"),
    ];
    let (scene, rig, settings) = configured("tonight.toml", &set.each_ref().map(String::as_str));
    let frame = render_hdr(renderer, &scene, &rig, &settings);
    let pixels = frame.images.into_iter().flat_map(|image| image.hdr.unwrap());
    pixels.map(|[r, g, b, _]| luminance([r, g, b].map(f64::from))).collect()
}

/// The glow of the sky hides the glare of faint stars. The nights are without and with the Moon. The limits are 1.3 times the measured values. Errors
/// are relative to the light that the eye scatters in the pixel: the sky is smooth, so this is about the scattered fraction of all light there.
#[test]
fn the_glow_of_the_sky_hides_little_glare() {
    let tolerance = AccuracySettings::default().glare;
    let fraction = GlareSettings::default().fraction_scattered();
    let mut renderer = renderer();
    for (time, limit) in [("2026-11-09T20:00:00Z", 1.6), ("2026-11-23T20:00:00Z", 0.3)] {
        let exact = luminances_in_air(&mut renderer, time, 1e-4);
        let mut greatest_of_tolerance = |drawn_with: f64| {
            let drawn = luminances_in_air(&mut renderer, time, drawn_with);
            let lit = exact.iter().zip(&drawn).filter(|(exact, _)| **exact > 0.0);
            let errors = lit.map(|(exact, drawn)| (drawn / exact - 1.0).abs() / fraction / tolerance);
            errors.fold(0.0, f64::max)
        };
        let greatest = greatest_of_tolerance(tolerance);
        println!("{time}: greatest error {greatest:.3} of the tolerance");
        assert!(greatest < limit, "{time}: {greatest}");
        let coarse = greatest_of_tolerance(10.0 * tolerance);
        assert!(coarse > limit, "{time}: {coarse} with ten times the tolerance");
    }
}
