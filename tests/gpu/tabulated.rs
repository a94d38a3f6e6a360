//! Tabulated projections on the adapter. If a projection has a closed form, its table gives the same picture as the closed form, in every technique.
//! A map without closed form agrees with the f64 reference, and keeps the light of all stars.

use std::{f64::consts::PI, sync::Arc};

use glam::{DQuat, DVec2, DVec3};
use steradian::{
    gpu::{Gpu, GpuOptions},
    photometry::kernel::SplatKernel,
    plan::settings::{ExposureSettings, GlareMethod, Metering, RenderSettings, StarMethod},
    reference::stars::splat::{Eye, draw},
    render::{
        Frame, FrameImage, FrameRequest, Renderer, Wanted,
        probe::{Probe, probe},
    },
    scene::SceneSnapshot,
    units::illuminance_lx_from_magnitude,
    view::{
        Part, Rig, ViewKind, Viewport,
        projection::{Fisheye, FisheyeMapping, Perspective, PlaneMapping, Projection, TabulatedMapping},
    },
};

use crate::common::{
    self, configured, difference_from_twin, hammer::Hammer, illuminance_lx, new_renderer, render_hdr, renderer, rig,
    settings, snapshot, spiral, star,
};

fn table(mapping: impl PlaneMapping + Send + 'static) -> Arc<TabulatedMapping> {
    Arc::new(TabulatedMapping::new(mapping).unwrap())
}

fn tabulated(mapping: &Arc<TabulatedMapping>) -> ViewKind {
    ViewKind::Tabulated { mapping: Arc::clone(mapping) }
}

/// Returns projections, each as closed form and as table.
fn pairs() -> Vec<(&'static str, ViewKind, Arc<TabulatedMapping>)> {
    let [flat, round] = [[120, 90], [128, 128]];
    let fisheye = Fisheye::new(round, FisheyeMapping::Equidistant, PI).unwrap();
    vec![
        (
            "perspective",
            ViewKind::Perspective { size: flat, fov_y_rad: 1.2 },
            table(Perspective::symmetric(flat, 1.2).unwrap()),
        ),
        (
            "fisheye",
            ViewKind::Fisheye { size: round, mapping: FisheyeMapping::Equidistant, fov_rad: PI },
            table(fisheye),
        ),
    ]
}

/// Returns the centroid of the light of an image, pixels.
fn centroid(image: &FrameImage) -> DVec2 {
    let (mut sum, mut weighted) = (0.0, DVec2::ZERO);
    for (index, [r, g, b, omega]) in image.hdr.as_ref().unwrap().iter().enumerate() {
        let light = f64::from(r + g + b) * f64::from(*omega);
        let (x, y) = (index as u32 % image.width, index as u32 / image.width);
        sum += light;
        weighted += light * DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5);
    }
    weighted / sum
}

#[test]
fn stars_of_tables_have_the_position_and_light_of_closed_forms() {
    let mut renderer = renderer();
    let (mut worst_px, mut worst_light) = (0.0_f64, 0.0_f64);
    for (name, closed, table) in pairs() {
        let rig = rig(vec![("closed", closed), ("table", tabulated(&table))]);
        for direction in common::directions_inside(&rig.views()[0], 24, 3) {
            let sky = snapshot(vec![star(direction, 3.0)]);
            let frame = render_hdr(&mut renderer, &sky, &rig, &settings(StarMethod::BSpline));
            let [closed, of_table] = [&frame.images[0], &frame.images[1]];
            worst_px = worst_px.max(centroid(closed).distance(centroid(of_table)));
            let [closed, of_table] = [closed, of_table].map(|image| illuminance_lx(image, &*table));
            worst_light = worst_light.max((of_table / closed - 1.0).abs());
            assert!(closed > 0.0, "{name} {direction}");
        }
        assert_eq!(frame_counts(&mut renderer, &rig), [1, 1], "{name}: each view shows the star");
    }
    println!("centroids {worst_px:.1e} px apart, light {worst_light:.1e}");
    assert!(worst_px < 8e-5 && worst_light < 1e-6, "{worst_px} px, {worst_light}");
}

/// Returns the number of stars that each view of a rig draws. The scene has one star near the view axis.
fn frame_counts(renderer: &mut Renderer, rig: &Rig) -> Vec<u64> {
    let sky = snapshot(vec![star(DVec3::new(0.1, 0.05, -1.0), 3.0)]);
    let frame = render_hdr(renderer, &sky, rig, &settings(StarMethod::BSpline));
    frame.views.iter().map(|view| view.stars_drawn).collect()
}

/// Returns the sum of the differences between two images divided by the sum of the first.
fn difference(closed: &FrameImage, other: &FrameImage) -> f64 {
    let [closed, other] = [closed, other].map(|image| image.hdr.as_ref().unwrap());
    let light = |pixel: &[f32; 4]| f64::from(pixel[0] + pixel[1] + pixel[2]);
    let apart: f64 = closed.iter().zip(other).map(|(a, b)| (light(a) - light(b)).abs()).sum();
    apart / closed.iter().map(light).sum::<f64>()
}

/// Returns the largest difference of a code between two display images, and the share of codes that differ by more than one.
fn code_difference(closed: &FrameImage, other: &FrameImage) -> (u8, f64) {
    let [closed, other] = [closed, other].map(|image| image.display.as_ref().unwrap());
    let apart: Vec<u8> = closed.iter().zip(other).map(|(a, b)| a.abs_diff(*b)).collect();
    let beyond = apart.iter().filter(|apart| **apart > 1).count();
    (apart.iter().copied().max().unwrap(), beyond as f64 / apart.len() as f64)
}

fn frame(renderer: &mut Renderer, scene: &SceneSnapshot, rig: &Rig, settings: &RenderSettings) -> Frame {
    renderer.render(FrameRequest::new(scene, rig).settings(settings).wanted(Wanted::both())).unwrap()
}

/// Returns the scene of a configuration, with fewer stars.
fn scene_of(file: &str, set: &[&str]) -> (SceneSnapshot, RenderSettings) {
    let few = ["scene.catalogues=[\"builtin:bright\"]"];
    let (scene, _, settings) = configured(file, &[&few[..], set].concat());
    (scene, settings)
}

#[test]
fn tables_equal_closed_forms_in_every_technique() {
    let mut renderer = renderer();
    // The bounds are four times the measured values.
    let methods = [
        (StarMethod::Auto, GlareMethod::SkyCube, 7e-5),
        // At the rim, the texels of this picture are on the corners of pixels, where the table is less accurate than the closed form.
        (StarMethod::BSpline, GlareMethod::ViewPyramid, 8e-3),
        (StarMethod::Tent, GlareMethod::ScreenPyramid, 9e-5),
        (StarMethod::PixelGaussian, GlareMethod::None, 1.4e-4),
        (StarMethod::PackedCas, GlareMethod::None, 8e-5),
        (StarMethod::PackedCasSorted, GlareMethod::None, 8e-5),
        (StarMethod::Disc, GlareMethod::None, 2e-5),
        (StarMethod::CellSky, GlareMethod::None, 1e-5),
    ];
    let sky = snapshot(spiral(3000).enumerate().map(|(i, at)| star(at, (i % 9) as f32 - 1.0)).collect());
    for (name, closed, table) in pairs().into_iter().skip(1) {
        for (stars, glare, bound) in methods {
            let rig = rig(vec![("closed", closed.clone()), ("table", tabulated(&table))]);
            let mut settings = settings(stars);
            settings.glare.method = glare;
            settings.exposure = ExposureSettings::auto(Metering::Mean);
            settings.tone_map.desaturation = 0.0;
            let frame = frame(&mut renderer, &sky, &rig, &settings);
            let apart = difference(&frame.images[0], &frame.images[1]);
            let (codes, beyond) = code_difference(&frame.images[0], &frame.images[1]);
            println!(
                "{name} {stars:?} {glare:?}: light {apart:.1e}, largest difference {codes} codes, {beyond:.1e} of them above 1"
            );
            assert!(apart < bound && beyond < 4.0 * bound, "{name} {stars:?} {glare:?}: {apart} {codes} {beyond}");
            let [of_closed, of_table] = [0, 1].map(|view: usize| frame.views[view].stars_drawn);
            assert!(
                of_closed.abs_diff(of_table) <= 2,
                "{stars:?}: {of_closed} stars with the closed form, {of_table} with the table"
            );
        }
    }
}

/// If only display images are requested, the veil of bright stars is added to the sums, and the remaining veil is interpolated on a grid. Some points
/// of the grid are outside of a round picture.
#[test]
fn veils_of_tables_equal_closed_forms_in_display_images() {
    let mut renderer = renderer();
    let sky = snapshot(spiral(600).enumerate().map(|(i, at)| star(at, (i % 9) as f32 - 2.0)).collect());
    for (name, closed, table) in pairs() {
        let rig = rig(vec![("closed", closed), ("table", tabulated(&table))]);
        let mut settings = settings(StarMethod::Auto);
        settings.glare.method = GlareMethod::SkyCube;
        let mut display = |settings: &RenderSettings| {
            let request = FrameRequest::new(&sky, &rig).settings(settings).wanted(Wanted::display());
            renderer.render(request).unwrap()
        };
        let glaring = display(&settings);
        settings.glare.method = GlareMethod::None;
        let bare = display(&settings);
        let (codes, beyond) = code_difference(&glaring.images[0], &glaring.images[1]);
        let (_, glare) = code_difference(&glaring.images[1], &bare.images[1]);
        println!("{name}: largest difference {codes} codes, {beyond:.1e} of them above 1; glare changes {glare:.1e}");
        assert!(glare > 0.2 && beyond < 1e-3, "{name}: {codes} {beyond} {glare}");
    }
}

#[test]
fn overlays_of_tables_equal_closed_forms() {
    let (scene, settings) = scene_of("overlay.toml", &[]);
    let mut renderer = renderer();
    for (name, closed, table) in pairs() {
        let rig = rig(vec![("closed", closed), ("table", tabulated(&table))]);
        let with_overlay = frame(&mut renderer, &scene, &rig, &settings);
        let (codes, beyond) = code_difference(&with_overlay.images[0], &with_overlay.images[1]);
        let bare = SceneSnapshot { objects: Default::default(), ..scene.clone() };
        let bare = frame(&mut renderer, &bare, &rig, &settings);
        let (_, drawn) = code_difference(&with_overlay.images[1], &bare.images[1]);
        println!(
            "{name}: largest difference {codes} codes, {beyond:.1e} of them above 1; the overlay changes {drawn:.1e}"
        );
        assert!(drawn > 0.01 && beyond < 0.01 * drawn, "{name}: {codes} {beyond} {drawn}");
    }
}

#[test]
fn bodies_and_asteroids_of_tables_equal_closed_forms() {
    let (mut scene, settings) = scene_of("asteroids.toml", &[]);
    scene.camera.world_from_camera *= DQuat::from_rotation_x(0.2);
    let mut renderer = renderer();
    for (name, closed, table) in pairs().into_iter().skip(1) {
        let rig = rig(vec![("closed", closed), ("table", tabulated(&table))]);
        let frame = frame(&mut renderer, &scene, &rig, &settings);
        let apart = difference(&frame.images[0], &frame.images[1]);
        println!("{name}: relative difference {apart:.1e}");
        // With the closed form, small asteroids are drawn without cube faces, so their edges differ by a fraction of a sample.
        assert!(apart < 0.02, "{name}: {apart}");
    }
}

const HEIGHT: u32 = 96;
/// Four times the largest measured difference of a pixel, relative to its surroundings.
const TWIN_BOUND: f64 = 0.0125;

#[test]
fn a_table_without_closed_form_equals_the_reference() {
    let table = table(Hammer(HEIGHT));
    let rig = rig(vec![("hammer", tabulated(&table))]);
    // Stay away from the poles, where the mapping has no derivative.
    let places = spiral(4000).filter(|at| at.y.abs() < 0.97);
    let sky = snapshot(places.map(|at| star(at, 4.0)).collect());
    let frame = render_hdr(&mut renderer(), &sky, &rig, &settings(StarMethod::BSpline));
    let twin = |mapping: &dyn PlaneMapping| draw(&sky.stars, Eye::default(), mapping, |_| Some(SplatKernel::BSpline));
    let apart = difference_from_twin(&frame.images[0], &twin(&*table), &*table);
    println!("relative difference of pixels {apart:.1e}");
    assert!(apart < TWIN_BOUND, "{apart}");
    // A rotation by half a pixel fails the comparison.
    let turned =
        Eye { world_from_view: DQuat::from_rotation_y(0.5 * 2.0 * PI / f64::from(2 * HEIGHT)), ..Eye::default() };
    let wrong = draw(&sky.stars, turned, &*table, |_| Some(SplatKernel::BSpline));
    assert!(difference_from_twin(&frame.images[0], &wrong, &*table) > 4.0 * TWIN_BOUND);
}

#[test]
fn a_tabulated_whole_sphere_keeps_the_light_of_all_stars() {
    let table = table(Hammer(HEIGHT));
    let rig = rig(vec![("hammer", tabulated(&table))]);
    let mut renderer = renderer();
    let all: Vec<_> = spiral(20_000).map(|at| star(at, 5.0)).collect();
    // Use directions on the cut behind the eye, and within the precision of f32 from it, from pole to pole.
    let on_cut = |angle: f64, side: f64| DVec3::new(side, angle.sin(), angle.cos());
    let at_cut = [0.0, 1e-7, -1e-7, 1e-3, -1e-3, 0.02, -0.02]
        .into_iter()
        .flat_map(|side| (-15..=15).map(move |step| star(on_cut(f64::from(step) / 15.0 * (PI / 2.0), side), 3.0)));
    for (name, stars) in [("all over", all), ("at the cut", at_cut.collect())] {
        for method in [StarMethod::Auto, StarMethod::Tent, StarMethod::BSpline] {
            let sky = snapshot(stars.clone());
            let frame = render_hdr(&mut renderer, &sky, &rig, &settings(method));
            let drawn_lx = illuminance_lx(&frame.images[0], &*table);
            let true_lx: f64 = sky.stars.iter().map(|(_, _, star)| star.illuminance_at_1_pc_lx()).sum();
            let error = drawn_lx / true_lx - 1.0;
            println!("{name} {method:?}: light {error:+.1e}");
            assert!(error.abs() < 1e-6, "{name} {method:?}: {error}");
            assert_eq!(frame.views[0].stars_drawn, stars.len() as u64, "{name} {method:?}");
        }
    }
}

#[test]
fn the_search_on_the_adapter_equals_the_f64_search() {
    let gpu = Gpu::open(&GpuOptions::default()).unwrap();
    let fisheye = Fisheye::new([256, 256], FisheyeMapping::Equisolid, 3.5).unwrap();
    // Bounds, pixels, of four times the measured differences between the search in f32 and that in f64, and between the search in f32 and the
    // mapping.
    for (table, bounds_px) in [(table(fisheye), [1.2e-4, 1.5e-4]), (table(Hammer(256)), [5e-4, 7e-3])] {
        let projection = Projection::Tabulated(Arc::clone(&table));
        let viewport = Viewport {
            view: 0,
            part: Part::Whole,
            projection,
            world_from_view: DQuat::IDENTITY,
            eye_offset_m: DVec3::ZERO,
            viewing_circle_m: 0.0,
        };
        let [width, height] = table.size();
        let inside = |direction: &DVec3| {
            let image = table.pixel_from_direction(*direction).unwrap();
            let in_picture = image.x >= 0.0 && image.y >= 0.0 && table.contains(image.x as u32, image.y as u32);
            in_picture && direction.y.abs() < 0.98
        };
        let directions: Vec<DVec3> = spiral(40_000).filter(inside).collect();
        let pixel = |i: usize| [(i as u32 * 7919) % width, (i as u32 * 104_729) % height];
        let probes: Vec<Probe> = directions
            .iter()
            .enumerate()
            .map(|(i, direction)| Probe { direction: *direction, pixel: pixel(i) })
            .collect();
        let probed = probe(&gpu, &viewport, &probes).unwrap();
        let (mut to_search, mut to_mapping, mut omega, mut to_direction) = (0.0_f64, 0.0_f64, 0.0_f64, 0.0_f64);
        for (of_probe, found) in probes.iter().zip(&probed) {
            let image = found.image.unwrap_or_else(|| panic!("{} has no image", of_probe.direction));
            let image = DVec2::new(f64::from(image[0]), f64::from(image[1]));
            to_search = to_search.max(image.distance(table.lookup(of_probe.direction).unwrap()));
            to_mapping = to_mapping.max(image.distance(table.pixel_from_direction(of_probe.direction).unwrap()));
            let [x, y] = of_probe.pixel;
            let expected_sr = table.solid_angle_sr(x, y);
            omega = omega.max((f64::from(found.solid_angle_sr) - expected_sr).abs() / table.smallest_pixel_sr());
            let centre = DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5);
            match (table.direction_from_pixel(centre), found.direction) {
                (Some(expected), Some(found)) => {
                    to_direction = to_direction.max(expected.distance(DVec3::from(found.map(f64::from))));
                }
                (None, None) => {}
                other => panic!("pixel ({x}, {y}): {other:?}"),
            }
        }
        println!(
            "{table:?}: {} directions, errors: {to_search:.1e} px from the f64 search, {to_mapping:.1e} px from the mapping, solid angle {omega:.1e}, direction {to_direction:.1e}",
            probes.len()
        );
        assert!(to_search < bounds_px[0] && to_mapping < bounds_px[1], "{table:?}: {to_search} {to_mapping}");
        assert!(omega < 1e-6 && to_direction < 2e-7, "{table:?}: {omega} {to_direction}");
    }
}

#[test]
fn tables_do_not_affect_later_frames_of_other_rigs() {
    let plain = rig(vec![("sky", ViewKind::Equirectangular { size: [96, 48] })]);
    let with_table = rig(vec![("hammer", tabulated(&table(Hammer(64))))]);
    let sky = snapshot(spiral(500).map(|at| star(at, 2.0)).collect());
    let settings = RenderSettings::default();
    let mut renderer = new_renderer();
    let before = frame(&mut renderer, &sky, &plain, &settings);
    let first = frame(&mut renderer, &sky, &with_table, &settings);
    let after = frame(&mut renderer, &sky, &plain, &settings);
    assert_eq!(before.images[0].hdr, after.images[0].hdr);
    assert_eq!(before.images[0].display, after.images[0].display);
    let again = frame(&mut renderer, &sky, &with_table, &settings);
    assert_eq!(first.images[0].display, again.images[0].display);
    // Another table of the same size replaces the first one; from then on, frames create no objects.
    let other = rig(vec![("hammer", tabulated(&table(Hammer(64))))]);
    let made: Vec<u64> = (0..6).map(|_| frame(&mut renderer, &sky, &other, &settings).times.objects_made).collect();
    assert!(made[0] > 0 && made[4..] == [0, 0], "{made:?}");
}

#[test]
fn views_that_tables_do_not_support_are_refused_by_name() {
    let hammer = rig(vec![("map", tabulated(&table(Hammer(64))))]);
    let sky = snapshot(vec![star(DVec3::NEG_Z, 3.0)]);
    let mut renderer = renderer();
    let mut refusal = |rig: &Rig, settings: &RenderSettings| {
        renderer.render(FrameRequest::new(&sky, rig).settings(settings)).unwrap_err().to_string()
    };
    let error = refusal(&hammer, &settings(StarMethod::PixelGaussian));
    assert!(error.contains("view `map`") && error.contains("`pixel_gaussian`") && error.contains("cut"), "{error}");
    let flat = table(Perspective::symmetric([64, 64], 1.0).unwrap());
    let window = rig(vec![("window", tabulated(&flat))]);
    let mut wide = settings(StarMethod::PixelGaussian);
    wide.stars.pixel_gaussian.sigma_px = 6.0;
    let error = refusal(&window, &wide);
    assert!(error.contains("view `window`") && error.contains("reach"), "{error}");
}

/// There are six tables of half a megabyte, and bindings of less than two megabytes. Each view shows its star at the position that its own table
/// gives.
#[test]
fn tables_too_large_for_a_binding_are_in_a_texture() {
    let limit_bytes = 7 << 18;
    draw_from_six_tables(&GpuOptions { binding_limit_bytes: Some(limit_bytes), ..GpuOptions::default() }, limit_bytes);
}

#[test]
fn tables_are_in_a_texture_if_there_are_few_bindings() {
    draw_from_six_tables(&GpuOptions { storage_buffers: Some(8), ..GpuOptions::default() }, 0);
}

fn draw_from_six_tables(options: &GpuOptions, limit_bytes: u64) {
    let mut renderer = common::renderer_with(options);
    let tables: Vec<Arc<TabulatedMapping>> = (0..6)
        .map(|index| table(Perspective::symmetric([150 + 4 * index, 150], 0.5 + 0.1 * f64::from(index)).unwrap()))
        .collect();
    let bytes: Vec<u64> = tables.iter().map(|table| table.bytes()).collect();
    assert!(bytes.iter().sum::<u64>() > limit_bytes, "{bytes:?}");
    let names: Vec<String> = (0..6).map(|index| format!("view{index}")).collect();
    let rig = rig(names.iter().map(String::as_str).zip(tables.iter().map(tabulated)).collect());
    let direction = DVec3::new(0.13, -0.07, -1.0).normalize();
    let frame = render_hdr(&mut renderer, &snapshot(vec![star(direction, 3.0)]), &rig, &settings(StarMethod::BSpline));
    for (index, (image, table)) in frame.images.iter().zip(&tables).enumerate() {
        let off_px = centroid(image).distance(table.pixel_from_direction(direction).unwrap());
        let light = illuminance_lx(image, &**table) / illuminance_lx_from_magnitude(3.0) - 1.0;
        assert!(off_px < 4e-4 && light.abs() < 1e-5, "view {index}: {off_px} px, {light}");
    }
}
