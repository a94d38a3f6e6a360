//! Stars of a deep store: composite stars and pages of leaves are compared with the same stars in an ordinary catalogue.

use std::{
    path::Path,
    sync::{Arc, LazyLock},
    thread,
    time::{Duration, Instant},
};

use glam::{DQuat, DVec3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use steradian::{
    catalogue::{
        StarRecord,
        chunks::StarSet,
        deep::build::{Build, BuildOptions, NewStar},
        epoch::Epoch,
    },
    chart::DisplayErrors,
    memory_size::MemorySize,
    plan::{
        DeepReport, Output, PlanError,
        settings::{ExposureSettings, ExposureValues, GlareSettings, Metering, RenderSettings, StarMethod},
    },
    render::{Frame, FrameRequest, RenderError, Renderer, SkyMapUse, Wanted},
    scene::{
        Camera, SceneSnapshot,
        loader::{LoadError, StarSource, load_stars},
    },
    units::PARSEC_M,
    view::{
        Rig, ViewKind,
        projection::{Face, FisheyeMapping},
    },
};

use crate::common::{renderer, rig};

/// Direction of the middle of the stars.
const TOWARDS: DVec3 = DVec3::new(0.0, -0.6, 0.8);
/// Number of stars, which are within 12 degrees. A third of them is in a cluster of 2 degrees.
const STARS: usize = 60_000;

/// Returns stars of V 11 to 19. At each magnitude there are ten times as many as three magnitudes brighter.
fn records() -> Vec<StarRecord> {
    let mut random = ChaCha8Rng::seed_from_u64(7);
    (0..STARS)
        .map(|index| {
            let radius: f64 = if index % 3 == 0 { 0.035 } else { 0.21 };
            let mut offset = DVec3::ONE;
            while offset.length() > 1.0 {
                offset = DVec3::from_array(std::array::from_fn(|_| random.random_range(-1.0..1.0)));
            }
            let distance_pc = 10_f64.powf(random.random_range(2.1..3.8));
            let v_mag = 19.0 + 3.0 * random.random_range(0.005_f64..1.0).log10();
            StarRecord {
                position: (TOWARDS + offset * radius).normalize() * distance_pc,
                magnitude: (v_mag - 5.0 * (distance_pc / 10.0).log10()) as f32,
                temperature_k: random.random_range(2500.0..12_000.0),
                distance_known: true,
            }
        })
        .collect()
}

/// Returns a store of these stars, which is built only once.
pub(super) fn store() -> &'static Path {
    static STORE: LazyLock<tempfile::TempDir> = LazyLock::new(|| {
        let folder = tempfile::tempdir().unwrap();
        let options = BuildOptions {
            out: folder.path().join("deep"),
            memory_bytes: 1 << 28,
            job: "test".to_owned(),
            cells: None,
        };
        let mut build = Build::open(options).unwrap();
        records().into_iter().for_each(|star| build.add(star, NewStar::default()).unwrap());
        build.finish(None, "a test".to_owned(), &mut |_| ()).unwrap();
        folder
    });
    STORE.path()
}

pub(super) fn scene_of(sources: &[StarSource]) -> SceneSnapshot {
    let (stars, _) = load_stars(sources, &Epoch::default(), &mut |_| {}).unwrap();
    looking(Arc::new(stars), DVec3::ZERO)
}

pub(super) fn looking(stars: Arc<StarSet>, place_pc: DVec3) -> SceneSnapshot {
    let camera = Camera {
        position_m: place_pc * PARSEC_M,
        world_from_camera: DQuat::from_rotation_arc(DVec3::NEG_Z, TOWARDS.normalize()),
        ..Camera::default()
    };
    SceneSnapshot { revision: 1, stars, objects: Arc::default(), camera }
}

pub(super) fn deep_scene() -> SceneSnapshot {
    scene_of(&[StarSource::File(store().join("deep"))])
}

pub(super) fn settings() -> RenderSettings {
    let mut settings = RenderSettings { glare: GlareSettings::none(), ..RenderSettings::default() };
    settings.exposure = ExposureSettings::manual(-7.5);
    settings
}

pub(super) fn window(fov_y_deg: f64) -> Rig {
    let kind = ViewKind::Perspective { size: [480, 360], fov_y_rad: fov_y_deg.to_radians() };
    rig(vec![("window", kind)])
}

/// Returns a window with so many stars per pixel that a map of faint light is worth its cost.
fn small_window(fov_y_deg: f64) -> Rig {
    let kind = ViewKind::Perspective { size: [160, 120], fov_y_rad: fov_y_deg.to_radians() };
    rig(vec![("window", kind)])
}

pub(super) fn dome() -> Rig {
    let kind = ViewKind::Fisheye { size: [512; 2], mapping: FisheyeMapping::Equidistant, fov_rad: 1.0 };
    rig(vec![("dome", kind)])
}

fn draw(renderer: &mut Renderer, scene: &SceneSnapshot, rig: &Rig, settings: &RenderSettings, output: Output) -> Frame {
    let request = FrameRequest::new(scene, rig).settings(settings).wanted(Wanted::hdr()).sky_map(SkyMapUse::Off);
    renderer.render(request.drawn_for(output)).unwrap()
}

fn luminances(frame: &Frame) -> Vec<f64> {
    frame.images[0].hdr.as_ref().unwrap().iter().map(|pixel| f64::from(pixel[1])).collect()
}

/// Returns the sum of green light, lx.
fn light_lx(frame: &Frame) -> f64 {
    let pixels = frame.images[0].hdr.as_ref().unwrap().iter();
    pixels.map(|pixel| f64::from(pixel[1]) * f64::from(pixel[3])).sum()
}

pub(super) fn every_star(settings: &RenderSettings) -> RenderSettings {
    let mut settings = settings.clone();
    settings.stars.every_star = true;
    settings
}

/// Pages draw the same picture as the same stars in chunks, from the barycentre and from among the stars.
#[test]
fn leaves_draw_the_stars_of_the_catalogue() {
    let deep = deep_scene();
    let plain = Arc::new(StarSet::from_records(records()));
    let mut renderer = renderer();
    let among_stars = DVec3::new(20.0, -30.0, 10.0);
    for (place_pc, fov_y_deg) in [(DVec3::ZERO, 20.0), (DVec3::ZERO, 0.8), (among_stars, 20.0)] {
        let is_exact = place_pc == DVec3::ZERO;
        let rig = window(fov_y_deg);
        let mut settings = every_star(&settings());
        settings.stars.method = StarMethod::BSpline;
        let found = draw(&mut renderer, &looking(Arc::clone(&deep.stars), place_pc), &rig, &settings, Output::Hdr);
        let expected = draw(&mut renderer, &looking(Arc::clone(&plain), place_pc), &rig, &settings, Output::Hdr);
        assert!(expected.views[0].stars_drawn > 100);
        let [drawn, of_catalogue] = [&found, &expected].map(|frame| frame.views[0].stars_drawn as f64);
        assert!((drawn / of_catalogue - 1.0).abs() < if is_exact { 1e-9 } else { 1e-3 }, "{drawn} {of_catalogue}");
        // The words of leaves round the light of a star to 0.5 %, such that the sum does not change, and its distance to 0.4 %.
        let ratio = light_lx(&found) / light_lx(&expected);
        assert!((ratio - 1.0).abs() < if is_exact { 2e-5 } else { 1e-3 }, "{place_pc} {fov_y_deg}: light {ratio}");
        if !is_exact {
            continue;
        }
        let (found, expected) = (luminances(&found), luminances(&expected));
        let brightest = expected.iter().copied().fold(0.0, f64::max);
        let worst = found.iter().zip(&expected).map(|(found, expected)| (found - expected).abs()).fold(0.0, f64::max);
        assert!(worst < 0.01 * brightest, "{place_pc} {fov_y_deg}: {worst} of {brightest}");
    }
}

/// Returns the means and variances of blocks of 24 x 24 pixels.
fn blocks(luminances: &[f64], width: usize) -> Vec<[f64; 2]> {
    let rows = luminances.len() / width;
    let mut blocks = Vec::new();
    for y in (0..rows - 23).step_by(24) {
        for x in (0..width - 23).step_by(24) {
            let pixels: Vec<f64> = (0..576).map(|i| luminances[(y + i / 24) * width + x + i % 24]).collect();
            let mean = pixels.iter().sum::<f64>() / 576.0;
            blocks.push([mean, pixels.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / 576.0]);
        }
    }
    blocks
}

/// Asserts that the blocks of a frame have the same variance as those of a frame with all stars.
fn assert_same_variance(case: &str, frame: &Frame, stars: &Frame, width: usize) {
    let both = blocks(&luminances(frame), width).into_iter().zip(blocks(&luminances(stars), width));
    let (found, expected) = both.fold((0.0, 0.0), |(found, expected), ([_, a], [_, b])| (found + a, expected + b));
    println!("{case}: variance {:.4} of that of the stars", found / expected);
    assert!((found / expected - 1.0).abs() < 0.02, "{case}: variance {found} of {expected}");
}

/// Composite stars keep the light, its distribution and its graininess.
#[test]
fn composite_stars_look_like_the_stars() {
    let scene = deep_scene();
    let mut renderer = renderer();
    for (case, rig, width) in [("dome", dome(), 512), ("window", window(25.0), 480)] {
        let settings = settings();
        let composites = draw(&mut renderer, &scene, &rig, &settings, Output::Hdr);
        let stars = draw(&mut renderer, &scene, &rig, &every_star(&settings), Output::Hdr);
        let report = composites.plan.deep.clone().unwrap();
        assert!(report.stars < 50_000 && report.missing == 0 && report.residual_codes == 0.0, "{case}: {report:?}");
        let ratio = light_lx(&composites) / light_lx(&stars);
        assert!((ratio - 1.0).abs() < 2e-5, "{case}: light {ratio}");
        let errors = DisplayErrors::between(&stars, &composites, &settings);
        println!("{case}: 99.9 % {:.3} codes, largest {:.3}", errors.quantile(0.999), errors.quantile(1.0));
        assert!(errors.quantile(0.999) < 0.5, "{case}");
        assert_same_variance(case, &composites, &stars, width);
    }
}

/// Draws a display image that may read a map of faint light.
pub(super) fn with_map(
    renderer: &mut Renderer,
    scene: &SceneSnapshot,
    rig: &Rig,
    settings: &RenderSettings,
    sky_map: SkyMapUse,
) -> Frame {
    let request = FrameRequest::new(scene, rig).settings(settings).wanted(Wanted::hdr()).sky_map(sky_map);
    renderer.render(request.drawn_for(Output::Display)).unwrap()
}

/// Returns the same scene with the camera turned around one of its own axes.
fn turned(scene: &SceneSnapshot, axis: DVec3, angle_rad: f64) -> SceneSnapshot {
    let mut scene = scene.clone();
    scene.camera.world_from_camera *= DQuat::from_axis_angle(axis.normalize(), angle_rad);
    scene
}

/// A narrow window reads the faint stars from pieces of a map, and has the light and the graininess of the stars.
#[test]
fn a_window_reads_faint_stars_from_pieces_of_a_map() {
    let scene = deep_scene();
    let mut renderer = renderer();
    let settings = settings();
    for (case, fov_y_deg, angle_rad) in [("middle", 9.0, 0.0), ("beside", 8.0, 0.03), ("narrow", 6.0, 0.02)] {
        let scene = turned(&scene, DVec3::new(0.3, 1.0, 0.2), angle_rad);
        let rig = small_window(fov_y_deg);
        let stars = draw(&mut renderer, &scene, &rig, &every_star(&settings), Output::Hdr);
        let without = with_map(&mut renderer, &scene, &rig, &settings, SkyMapUse::Off);
        let map = with_map(&mut renderer, &scene, &rig, &settings, SkyMapUse::Wait);
        let [drawn, of_without] = [&map, &without].map(|frame| frame.views[0].stars_drawn);
        println!("{case}: {drawn} stars with the map, {of_without} without it");
        assert!(drawn > 100 && drawn < of_without / 5, "{case}: {drawn} of {of_without}");
        let ratio = light_lx(&map) / light_lx(&stars);
        let errors = DisplayErrors::between(&stars, &map, &settings);
        let quantile = errors.quantile(0.999);
        println!("{case}: light {:.1e}, 99.9 % {quantile:.3} codes, largest {:.3}", ratio - 1.0, errors.quantile(1.0));
        // The light of a star varies by a few percent with its position between the texels, and a few hundred stars give most of the light here.
        assert!((ratio - 1.0).abs() < 4e-3 && quantile < 0.6, "{case}: {ratio} {quantile}");
        assert_same_variance(case, &map, &stars, 160);
        // The comparison must fail for a sky that is turned by a texel.
        let wrong = turned(&scene, DVec3::Y, 0.775 * fov_y_deg.to_radians() / 120.0);
        let wrong = with_map(&mut renderer, &wrong, &rig, &settings, SkyMapUse::Wait);
        let of_wrong = DisplayErrors::between(&stars, &wrong, &settings).quantile(0.999);
        assert!(of_wrong > 6.0 * quantile, "{case}: {of_wrong}");
    }
}

/// Cubemaps read pieces whose texels have several sizes. The cluster of the stars is in the middle of a face, at an edge and at a corner.
#[test]
fn a_cubemap_reads_faint_stars_from_pieces_of_a_map() {
    let scene = deep_scene();
    let mut renderer = renderer();
    let mut settings = settings();
    settings.exposure = ExposureSettings::manual(-8.5);
    let rig = rig(vec![("cube", ViewKind::Cubemap { face_size: 80, faces: vec![Face::Front] })]);
    for (case, axis, angle_rad) in
        [("middle", DVec3::Y, 0.02), ("edge", DVec3::Y, 0.6), ("corner", DVec3::new(1.0, -1.0, 0.0), 0.8)]
    {
        let scene = turned(&scene, axis, angle_rad);
        let stars = draw(&mut renderer, &scene, &rig, &every_star(&settings), Output::Hdr);
        let map = with_map(&mut renderer, &scene, &rig, &settings, SkyMapUse::Wait);
        let drawn = map.views[0].stars_drawn;
        assert!(
            map.views[0].stars_in_map > 0 && drawn < stars.views[0].stars_drawn / 5,
            "{case}: {drawn} {}",
            map.views[0].stars_in_map
        );
        let ratio = light_lx(&map) / light_lx(&stars);
        let errors = DisplayErrors::between(&stars, &map, &settings);
        println!(
            "{case}: {drawn} stars drawn, light {:.1e}, 99.9 % {:.3} codes, largest {:.3}",
            ratio - 1.0,
            errors.quantile(0.999),
            errors.quantile(1.0)
        );
        // A third of the light is that of the cluster, which is as narrow as two pixels.
        assert!((ratio - 1.0).abs() < 0.03 && errors.quantile(0.999) < 0.5 && errors.quantile(1.0) < 1.0, "{case}");
    }
}

/// The renderer must read the bright stars before it knows whether a map is worth its cost. A frame that waits has all stars with or without a map.
#[test]
fn a_frame_that_waits_has_all_stars_whether_it_reads_a_map_or_not() {
    let mut renderer = renderer();
    let mut maps = Vec::new();
    for ev100 in [-7.5, -8.5, -9.0] {
        let mut settings = settings();
        settings.exposure = ExposureSettings::manual(ev100);
        for rows in [100, 140, 170, 200, 230, 260, 300] {
            let kind = ViewKind::Perspective { size: [rows * 4 / 3, rows], fov_y_rad: 0.2 };
            let frame =
                with_map(&mut renderer, &deep_scene(), &rig(vec![("window", kind)]), &settings, SkyMapUse::Wait);
            let report = frame.plan.deep.clone().unwrap();
            assert_eq!((report.missing, report.residual_codes), (0, 0.0), "{ev100} {rows}");
            maps.push(frame.views[0].stars_in_map > 0);
        }
    }
    println!("{maps:?}");
    assert!(maps.contains(&true) && maps.contains(&false));
}

/// All composite stars are in the map, however bright they are, so a crowd of faint stars is as bright with the map as without it.
#[test]
fn a_crowd_of_faint_stars_keeps_its_light_in_a_map() {
    let deep = deep_scene();
    let rig = dome();
    let mut renderer = renderer();
    // At this exposure the steps of codes are bright, so only stars that are much fainter than the light of a cell of the cluster may be in the map.
    let mut settings = settings();
    settings.exposure = ExposureSettings::manual(-4.5);
    let map = with_map(&mut renderer, &deep, &rig, &settings, SkyMapUse::Wait);
    let without = with_map(&mut renderer, &deep, &rig, &settings, SkyMapUse::Off);
    let ratio = light_lx(&map) / light_lx(&without);
    assert!((ratio - 1.0).abs() < 1e-4, "light {ratio}");
}

/// While a view turns, frames read pieces of the map that were drawn for earlier frames. The frame reports stars that these pieces lack, and the
/// pieces are redrawn.
#[test]
fn the_pieces_of_a_map_follow_a_turning_window() {
    /// Largest allowed error of a pixel if the map has all of its stars, codes.
    const OF_MAP_CODES: f64 = 2.0;
    let (settings, rig) = (settings(), small_window(6.0));
    let [mut live_renderer, mut renderer] = [renderer(), renderer()];
    // Use two readers of the same store, one of which waits for all stars.
    let [scene, whole] = [deep_scene(), deep_scene()];
    scene.stars.deep.as_ref().unwrap().set_delay(Duration::from_millis(6));
    let at = |scene: &SceneSnapshot, number: u32| turned(scene, DVec3::Y, 0.002 * f64::from(number));
    let mut live = |number: u32| with_map(&mut live_renderer, &at(&scene, number), &rig, &settings, SkyMapUse::InTurn);
    // The first frame does not begin a new map.
    assert_eq!(live(0).views[0].stars_in_map, 0);
    let (mut reading, mut incomplete) = (0, 0);
    for number in 0..24 {
        let frame = live(number);
        let report = frame.plan.deep.clone().unwrap();
        let exact = draw(&mut renderer, &at(&whole, number), &rig, &settings, Output::Hdr);
        let errors = DisplayErrors::between(&exact, &frame, &settings);
        let (error, most) = (errors.quantile(1.0), report.residual_codes + OF_MAP_CODES);
        assert!(error <= most, "{number}: {error} codes of {report:?}");
        let is_read = frame.views[0].stars_in_map > 0;
        reading += u32::from(is_read);
        incomplete += u32::from(is_read && report.missing > 0);
    }
    println!("{reading} frames read the map, {incomplete} of them before all stars were read");
    assert!(reading > 5 && incomplete > 0);
    let start = Instant::now();
    while live(23).plan.deep.clone().unwrap().missing > 0 {
        assert!(start.elapsed() < Duration::from_secs(60), "pages are missing");
        thread::sleep(Duration::from_millis(20));
    }
    let frame = live(23);
    let exact = draw(&mut renderer, &at(&whole, 23), &rig, &settings, Output::Hdr);
    let errors = DisplayErrors::between(&exact, &frame, &settings);
    println!("99.9 % {:.3} codes, largest {:.3}", errors.quantile(0.999), errors.quantile(1.0));
    assert!(frame.views[0].stars_in_map > 0 && errors.quantile(0.999) < 0.6);
}

/// While pages are being read, a frame reports a bound of its error, and the error never exceeds this bound.
#[test]
fn the_residual_bounds_the_error_until_all_pages_are_read() {
    let scene = deep_scene();
    let deep = scene.stars.deep.as_ref().unwrap();
    let mut renderer = renderer();
    let rig = window(9.0);
    let settings = settings();
    deep.set_delay(Duration::from_millis(3));
    let live = |renderer: &mut Renderer| {
        let request =
            FrameRequest::new(&scene, &rig).settings(&settings).wanted(Wanted::hdr()).sky_map(SkyMapUse::InTurn);
        renderer.render(request.drawn_for(Output::Hdr)).unwrap()
    };
    let started = Instant::now();
    let mut frames = Vec::new();
    loop {
        let frame = live(&mut renderer);
        let DeepReport { missing, residual_cd_m2, .. } = frame.plan.deep.clone().unwrap();
        frames.push((luminances(&frame), residual_cd_m2, missing));
        if missing == 0 {
            break;
        }
        assert!(started.elapsed() < Duration::from_secs(60), "{missing} pages are missing");
        thread::sleep(Duration::from_millis(20));
    }
    let (last, residual, _) = frames.pop().unwrap();
    assert_eq!(residual, 0.0);
    assert!(frames.len() > 2 && frames[0].2 > 10, "{} frames", frames.len());
    let mut largest: f64 = 0.0;
    for (luminances, residual, missing) in frames {
        let error = luminances.iter().zip(&last).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(error <= residual, "{missing} pages missing: {error} of {residual}");
        largest = largest.max(error / residual);
    }
    println!("the errors are at most {largest:.3} of the residual");
    assert!(largest > 0.0);
}

/// If a view turns steadily, its next pages are already in memory; if it jumps, they are not.
#[test]
fn pages_are_read_ahead_of_a_turning_view() {
    const TURN_RAD: f64 = 0.02;
    let rig = window(9.0);
    let settings = settings();
    let missing_after = |turns: bool| -> u64 {
        let mut scene = deep_scene();
        let deep = Arc::clone(scene.stars.deep.as_ref().unwrap());
        let mut renderer = renderer();
        let from = scene.camera.world_from_camera;
        let mut at = |angle_rad: f64| {
            scene.camera.world_from_camera = DQuat::from_rotation_x(angle_rad) * from;
            let request = FrameRequest::new(&scene, &rig).settings(&settings).wanted(Wanted::hdr());
            let request = request.sky_map(SkyMapUse::InTurn).drawn_for(Output::Hdr);
            renderer.render(request).unwrap().plan.deep.clone().unwrap().missing
        };
        let read_all = || {
            let (mut read, mut rested) = (0, 0);
            while rested < 10 {
                thread::sleep(Duration::from_millis(20));
                let now = deep.statistics().pages_read;
                rested = if now == read { rested + 1 } else { 0 };
                read = now;
            }
        };
        while at(0.0) > 0 {
            thread::sleep(Duration::from_millis(20));
        }
        // Frames that are far apart in time do not count as a turn. A slow machine may need several attempts to draw two frames in quick succession.
        let mut angle_rad = 0.0;
        loop {
            let start = Instant::now();
            at(angle_rad);
            thread::sleep(Duration::from_millis(if turns { 100 } else { 600 }));
            angle_rad += TURN_RAD;
            at(angle_rad);
            let apart = start.elapsed();
            read_all();
            if !turns || apart < Duration::from_millis(500) {
                return at(angle_rad + TURN_RAD);
            }
        }
    };
    assert!(missing_after(false) > 0, "nothing new is seen, so this test shows nothing");
    assert_eq!(missing_after(true), 0);
}

/// Stars that do not fit into memory together are read while the frame is drawn: the picture contains all of them.
#[test]
fn stars_beyond_the_memory_are_drawn_in_turns() {
    let (scene, mut renderer) = (deep_scene(), renderer());
    let whole = every_star(&settings());
    let mut little = whole.clone();
    little.stars.memory = MemorySize { bytes: 1 << 19 };
    let window = window(20.0);
    for rig in [window.clone(), dome()] {
        let expected = draw(&mut renderer, &scene, &rig, &whole, Output::Hdr);
        let found = draw(&mut renderer, &scene, &rig, &little, Output::Hdr);
        assert_eq!(found.views[0].stars_drawn, expected.views[0].stars_drawn);
        let DeepReport { stars, missing, residual_cd_m2, cell_px, .. } = found.plan.deep.clone().unwrap();
        assert!(stars > 40_000 && missing == 0 && (residual_cd_m2, cell_px) == (0.0, 0.0), "{stars} {missing}");
        let ratio = light_lx(&found) / light_lx(&expected);
        let (found, expected) = (luminances(&found), luminances(&expected));
        let off = found.iter().zip(&expected).map(|(found, expected)| (found - expected).abs()).fold(0.0, f64::max);
        let mean = expected.iter().sum::<f64>() / expected.len() as f64;
        println!("light {:.1e}, pixels off by {:.1e} of the mean", ratio - 1.0, off / mean);
        // The sums have different units, because each star is rounded to a 4096th of the light of the faintest one.
        assert!((ratio - 1.0).abs() < 1e-5 && off < 2e-2 * mean);
    }
    // The meter uses composite stars instead, even for a live frame.
    let spot = ExposureValues { metering: Metering::Spot, ..ExposureValues::default() };
    let metered = RenderSettings { exposure: spot.into(), ..little.clone() };
    let all = RenderSettings { exposure: spot.into(), ..whole.clone() };
    let [metered, all] =
        [metered, all].map(|settings| draw(&mut renderer, &scene, &window, &settings, Output::Hdr).metered_ev100);
    assert!((metered - all).abs() < 1e-6, "{metered} {all}");
    // A live frame does not wait for the disk.
    let request = FrameRequest::new(&scene, &window).settings(&little).sky_map(SkyMapUse::InTurn);
    assert!(matches!(renderer.render(request), Err(RenderError::Plan(PlanError::DeepMemory { .. }))));
    // A frame that lacks a damaged leaf is never returned.
    let folder = tempfile::tempdir().unwrap();
    let scene = damaged_store(folder.path());
    let request = FrameRequest::new(&scene, &window).settings(&little);
    let error = renderer.render(request).err().unwrap().to_string();
    assert!(error.contains("leaves-17: damaged store: leaf") && error.contains("skip_damaged"), "{error}");
}

#[test]
fn what_cannot_be_drawn_is_refused_with_its_reason() {
    let mut renderer = renderer();
    let scene = deep_scene();
    let rig = window(20.0);
    let mut refused = |scene: &SceneSnapshot, settings: &RenderSettings| match renderer
        .render(FrameRequest::new(scene, &rig).settings(settings).sky_map(SkyMapUse::InTurn))
    {
        Err(RenderError::Plan(error)) => error,
        other => panic!("{:?}", other.map(|frame| frame.number)),
    };
    let mut packed = settings();
    packed.stars.method = StarMethod::PackedCas;
    assert!(matches!(refused(&scene, &packed), PlanError::DeepMethod("packed_cas")));
    let mut moving = scene.clone();
    moving.camera.velocity_c = DVec3::X * 0.1;
    assert!(matches!(refused(&moving, &settings()), PlanError::DeepAtRest));
    // The smallest memory that users can set is enough for these stars, so set less.
    let mut little = every_star(&settings());
    little.stars.memory = MemorySize { bytes: 1 << 20 };
    let error = refused(&scene, &little);
    assert!(matches!(error, PlanError::DeepMemory { memory_mib: 1, .. }), "{error}");
    // The memory is enough for composite stars, but they are coarser, and the frame reports this.
    little.stars.every_star = false;
    little.stars.memory = MemorySize { bytes: 1 << 18 };
    let frame = draw(&mut renderer, &scene, &window(3.0), &little, Output::Hdr);
    let cells = frame.plan.certificate.iter().find(|bound| bound.name.contains("composite stars")).unwrap();
    assert_eq!(cells.within_budget, Some(false), "{cells:?}");
    // The resulting error is at most the residual.
    let DeepReport { missing, residual_cd_m2, .. } = frame.plan.deep.clone().unwrap();
    assert!(missing == 0 && residual_cd_m2 > 0.0, "{missing} {residual_cd_m2}");
    let whole = draw(&mut renderer, &scene, &window(3.0), &settings(), Output::Hdr);
    let errors =
        luminances(&frame).into_iter().zip(luminances(&whole)).map(|(found, expected)| (found - expected).abs());
    let worst = errors.fold(0.0, f64::max);
    assert!(worst > 0.001 * residual_cd_m2 && worst <= residual_cd_m2, "{worst} {residual_cd_m2}");
    // A galaxy would repeat the light of the store.
    let galaxy = steradian::catalogue::galaxy::GalaxyParameters {
        stars: 10,
        seed: 1,
        fainter_than: None,
        unresolved_light: false,
    };
    let path = store().join("deep");
    let sources = [StarSource::File(path.clone()), StarSource::Galaxy(galaxy)];
    let load = |sources: &[StarSource]| load_stars(sources, &Epoch::default(), &mut |_| {}).unwrap_err();
    assert!(matches!(load(&sources), LoadError::GalaxyBesideDeep { index: 1 }));
    let twice = [StarSource::File(path.clone()), StarSource::File(path)];
    assert!(matches!(load(&twice), LoadError::SecondDeep { index: 1, .. }));
}

/// Returns a copy of the store in which leaves of V = 17 are damaged.
pub(super) fn damaged_store(folder: &Path) -> SceneSnapshot {
    for file in std::fs::read_dir(store().join("deep")).unwrap() {
        let file = file.unwrap();
        std::fs::copy(file.path(), folder.join(file.file_name())).unwrap();
    }
    let path = folder.join("leaves-17");
    let mut bytes = std::fs::read(&path).unwrap();
    for byte in bytes.iter_mut().step_by(8 * 64) {
        *byte ^= 4;
    }
    std::fs::write(&path, bytes).unwrap();
    scene_of(&[StarSource::File(folder.to_owned())])
}

/// A frame with a damaged leaf is refused. If the settings allow it, the frame is drawn without the leaf.
#[test]
fn frames_without_damaged_leaves_are_drawn_on_request_only() {
    let folder = tempfile::tempdir().unwrap();
    let scene = damaged_store(folder.path());
    let (mut renderer, rig) = (renderer(), window(20.0));
    let mut settings = every_star(&settings());
    let request = FrameRequest::new(&scene, &rig).settings(&settings);
    let error = renderer.render(request).err().unwrap().to_string();
    assert!(error.contains("leaves-17") && error.contains("skip_damaged"), "{error}");
    settings.stars.skip_damaged = true;
    let frame = draw(&mut renderer, &scene, &rig, &settings, Output::Hdr);
    let DeepReport { missing, residual_cd_m2, stars, .. } = frame.plan.deep.clone().unwrap();
    assert!(missing > 100 && residual_cd_m2 > 0.0 && stars > 1000, "{missing} {residual_cd_m2} {stars}");
    let whole = draw(&mut renderer, &deep_scene(), &rig, &settings, Output::Hdr);
    let errors = luminances(&frame).into_iter().zip(luminances(&whole)).map(|(found, expected)| expected - found);
    let worst = errors.fold(0.0, f64::max);
    assert!(worst > 0.0 && worst <= residual_cd_m2, "{worst} {residual_cd_m2}");
}

/// A magnitude limit selects the stars of leaves one by one.
#[test]
fn a_magnitude_limit_leaves_out_what_is_fainter() {
    let deep = deep_scene();
    let plain = Arc::new(StarSet::from_records(records()));
    let mut renderer = renderer();
    let rig = window(20.0);
    for limit in [12.5, 14.3, 17.9] {
        let mut settings = settings();
        settings.stars.magnitude_limit = limit;
        let found = draw(&mut renderer, &deep, &rig, &settings, Output::Hdr);
        let expected = draw(&mut renderer, &looking(Arc::clone(&plain), DVec3::ZERO), &rig, &settings, Output::Hdr);
        let [found, expected] = [&found, &expected].map(|frame| frame.views[0].stars_drawn as f64);
        // Stars at the limit may be on either side of it, because the rounding of 0.5 % of their light is 0.005 mag.
        assert!(expected > 50.0 && (found - expected).abs() < 0.01 * expected + 3.0, "{limit}: {found} {expected}");
    }
}
