//! Display images that use the map of faint stars, compared with exact frames that draw every star.

use std::{f64::consts::PI, sync::OnceLock};

use glam::{DQuat, DVec3};
use steradian::{
    chart::DisplayErrors,
    plan::{
        Output,
        settings::{GlareMethod, RenderSettings},
    },
    render::{Frame, FrameRequest, Renderer, SkyMapUse, Wanted},
    scene::SceneSnapshot,
    units::PARSEC_M,
    view::{
        Rig, ViewKind,
        projection::{Face, FisheyeMapping},
    },
};

use crate::common::{configured, renderer, rig};

/// At this exposure and in a dome of 512 pixels, the map contains more than a third of the 1.2 million stars.
const EV100: f64 = -5.4;

/// Scene and settings, loaded once.
fn loaded() -> &'static (SceneSnapshot, RenderSettings) {
    static LOADED: OnceLock<(SceneSnapshot, RenderSettings)> = OnceLock::new();
    LOADED.get_or_init(|| with_galaxy("dome.toml"))
}

/// Returns the scene and the settings of a configuration, with a galaxy and a fixed exposure.
fn with_galaxy(name: &str) -> (SceneSnapshot, RenderSettings) {
    let galaxy = "scene.catalogues=[{ galaxy = { stars = 1200000, seed = 1, fainter_than = 3.5 } }]";
    let exposure = format!("exposure={{ mode = \"manual\", ev100 = {EV100} }}");
    let (scene, _, settings) = configured(name, &[galaxy, &exposure]);
    (scene, settings)
}

fn settings() -> RenderSettings {
    loaded().1.clone()
}

fn scene(world_from_camera: DQuat) -> SceneSnapshot {
    let mut scene = loaded().0.clone();
    scene.camera.world_from_camera = world_from_camera;
    scene
}

fn dome(size: u32) -> (&'static str, ViewKind) {
    ("dome", ViewKind::Fisheye { size: [size; 2], mapping: FisheyeMapping::Equidistant, fov_rad: PI })
}

fn draw(renderer: &mut Renderer, scene: &SceneSnapshot, rig: &Rig, output: Output, sky_map: SkyMapUse) -> Frame {
    let settings = settings();
    let request = FrameRequest::new(scene, rig).settings(&settings).wanted(Wanted::hdr());
    renderer.render(request.drawn_for(output).sky_map(sky_map)).unwrap()
}

/// Returns the exact frame, the display image that reads the map, and the one that draws every star.
fn three_ways(renderer: &mut Renderer, scene: &SceneSnapshot, rig: &Rig) -> [Frame; 3] {
    let ways = [(Output::Hdr, SkyMapUse::Wait), (Output::Display, SkyMapUse::Wait), (Output::Display, SkyMapUse::Off)];
    ways.map(|(output, sky_map)| draw(renderer, scene, rig, output, sky_map))
}

/// Returns the light of a frame, lx.
fn light_lx(frame: &Frame) -> f64 {
    let pixels = frame.images.iter().flat_map(|image| image.hdr.as_ref().unwrap());
    pixels.map(|pixel| f64::from(pixel[1]) * f64::from(pixel[3])).sum()
}

/// Returns view directions towards faces, edges and corners of the map.
fn directions() -> [DQuat; 4] {
    [DVec3::Z, DVec3::new(1.0, 1.0, 0.0), DVec3::new(-1.0, -1.0, 1.0), DVec3::new(0.3, -2.0, 0.7)]
        .map(|towards| DQuat::from_rotation_arc(DVec3::NEG_Z, towards.normalize()))
}

#[test]
fn the_map_keeps_the_error_budget_and_the_light_of_a_dome() {
    let rig = rig(vec![dome(512)]);
    let mut renderer = renderer();
    for (case, towards) in directions().into_iter().enumerate() {
        let scene = scene(towards);
        let [exact, display, star_by_star] = three_ways(&mut renderer, &scene, &rig);
        let (in_map, drawn) = (display.views[0].stars_in_map, display.views[0].stars_drawn);
        assert!(in_map > 200_000 && drawn < exact.views[0].stars_drawn - 50_000, "{in_map} {drawn}");
        assert_eq!([exact.views[0].stars_in_map, star_by_star.views[0].stars_in_map], [0, 0]);
        let settings = settings();
        let [with_map, without] =
            [&display, &star_by_star].map(|frame| DisplayErrors::between(&exact, frame, &settings));
        let of_map = DisplayErrors::between(&star_by_star, &display, &settings);
        let statistics = |errors: &DisplayErrors| [errors.rms(), errors.quantile(0.999), errors.quantile(1.0)];
        let light = light_lx(&display) / light_lx(&star_by_star) - 1.0;
        println!(
            "{case}: {in_map} stars in the map, {drawn} drawn of {}: rms, 99.9 %, largest {:.3?}, without the map {:.3?}, of the map alone {:.3?}; relative error of the light {light:.1e}",
            exact.views[0].stars_drawn,
            statistics(&with_map),
            statistics(&without),
            statistics(&of_map)
        );
        assert!(of_map.quantile(0.999) < LIMITS[0] && of_map.quantile(1.0) < LIMITS[1], "{case}: {:?}", of_map.worst);
        assert!(light.abs() < 1e-4, "{case}: {light:.1e}");
    }
}

/// Size of the whole-sky map. Its pixels at the equator are as large as those in the middle of a dome of 512 pixels.
const WHOLE_SKY: [u32; 2] = [1024, 512];

/// Near the poles of a whole-sky map and in the corners of a cubemap, pixels are far smaller than in the middle.
#[test]
fn pictures_of_the_whole_sky_use_the_map() {
    let mut renderer = renderer();
    let settings = settings();
    let map = ViewKind::Equirectangular { size: WHOLE_SKY };
    let cube = ViewKind::Cubemap { face_size: 256, faces: Face::ALL.to_vec() };
    let with_dome = vec![("map", map.clone()), ("dome", dome(512).1)];
    for (name, views) in [("map", vec![("map", map)]), ("cube", vec![("cube", cube)]), ("map and dome", with_dome)] {
        let rig = rig(views);
        for towards in directions() {
            let scene = scene(towards);
            let [exact, display, star_by_star] = three_ways(&mut renderer, &scene, &rig);
            let (in_map, drawn) = (display.views[0].stars_in_map, display.views[0].stars_drawn);
            assert!(in_map > 150_000 && drawn < exact.views[0].stars_drawn - 150_000, "{name}: {in_map} {drawn}");
            let of_map = DisplayErrors::between(&star_by_star, &display, &settings);
            let [most, largest] = [0.999, 1.0].map(|share| of_map.quantile(share));
            let light = light_lx(&display) / light_lx(&star_by_star) - 1.0;
            println!(
                "{name}: {in_map} stars in the map, {drawn} drawn: 99.9 % {most:.3}, largest {largest:.3}; relative error of the light {light:.1e}"
            );
            assert!(most < LIMITS[0] && largest < LIMITS[1], "{name}: {most} {largest} {:?}", of_map.worst);
            assert!(light.abs() < 1e-4, "{name}: {light:.1e}");
        }
    }
}

/// Greatest relative error of the mean luminance of eight rows of a whole-sky map.
fn row_error(exact: &Frame, display: &Frame) -> f64 {
    let [width, _] = WHOLE_SKY.map(|side| side as usize);
    let light_of_rows = |frame: &Frame| -> Vec<f64> {
        let rows = frame.images[0].hdr.as_ref().unwrap().chunks(8 * width);
        rows.map(|pixels| pixels.iter().map(|pixel| f64::from(pixel[1])).sum()).collect()
    };
    let errors = light_of_rows(exact).into_iter().zip(light_of_rows(display)).map(|(of, by)| (by / of - 1.0).abs());
    errors.fold(0.0, f64::max)
}

/// The map and the stars of a cap share the light at its edge. If they did not, there would be a ring.
#[test]
fn caps_of_a_whole_sky_map_have_no_ring() {
    let rig = rig(vec![("map", ViewKind::Equirectangular { size: WHOLE_SKY })]);
    let mut renderer = renderer();
    for towards in directions() {
        let scene = scene(towards);
        let star_by_star = draw(&mut renderer, &scene, &rig, Output::Display, SkyMapUse::Off);
        let mut display = draw(&mut renderer, &scene, &rig, Output::Display, SkyMapUse::Wait);
        let error = row_error(&star_by_star, &display);
        println!("error of the light of rows: {error:.1e}");
        assert!(error < ROW_LIMIT, "{error}");
        // A ring of one row must fail the comparison.
        let row = WHOLE_SKY[0] as usize;
        let pixels = display.images[0].hdr.as_mut().unwrap();
        pixels[50 * row..51 * row].iter_mut().for_each(|pixel| pixel[1] *= 1.01);
        assert!(row_error(&star_by_star, &display) > ROW_LIMIT);
    }
}

/// The caps of a whole-sky map lie in the air: their stars are raised and dimmed like the light of the map. The picture is turned, so that the horizon
/// crosses the caps.
#[test]
fn caps_share_the_light_of_an_observers_sky() {
    let (mut scene, settings) = with_galaxy("tonight.toml");
    scene.camera.world_from_camera *= DQuat::from_rotation_x(1.2);
    let rig = rig(vec![("map", ViewKind::Equirectangular { size: WHOLE_SKY })]);
    let mut renderer = renderer();
    let [display, star_by_star] = [SkyMapUse::Wait, SkyMapUse::Off].map(|sky_map| {
        let request = FrameRequest::new(&scene, &rig).settings(&settings).wanted(Wanted::hdr());
        renderer.render(request.drawn_for(Output::Display).sky_map(sky_map)).unwrap()
    });
    assert!(display.views[0].stars_in_map > 100_000, "{}", display.views[0].stars_in_map);
    let error = row_error(&star_by_star, &display);
    let errors = DisplayErrors::between(&star_by_star, &display, &settings);
    let [most, largest] = [0.999, 1.0].map(|share| errors.quantile(share));
    println!("error of the light of rows: {error:.1e}; 99.9 % {most:.3}, largest {largest:.3}");
    // The air is brighter than the stars, so the limits are lower here.
    assert!(error < 5e-5 && most < 0.4 && largest < 1.0, "{error} {most} {largest}");
}

/// Limit of [`row_error`]: about four times the measured value.
const ROW_LIMIT: f64 = 4.5e-4;

/// Display images use the map of faint stars even without glare.
#[test]
fn a_dome_without_glare_also_uses_the_map() {
    let rig = rig(vec![dome(512)]);
    let mut renderer = renderer();
    let scene = scene(directions()[0]);
    let mut settings = settings();
    settings.glare.method = GlareMethod::None;
    let mut frame = |settings: &RenderSettings, output: Output| {
        let request = FrameRequest::new(&scene, &rig).settings(settings).wanted(Wanted::hdr()).drawn_for(output);
        renderer.render(request).unwrap()
    };
    let (exact, display) = (frame(&settings, Output::Hdr), frame(&settings, Output::Display));
    assert!(display.views[0].stars_in_map > 200_000 && exact.views[0].stars_in_map == 0);
    let errors = DisplayErrors::between(&exact, &display, &settings);
    let [most, largest] = [0.999, 1.0].map(|share| errors.quantile(share));
    println!("99.9 % {most:.3}, largest {largest:.3}");
    assert!(most < LIMITS[0] && largest < LIMITS[1], "{most} {largest} {:?}", errors.worst);
    settings.accuracy.display_codes = 0.0;
    assert_eq!(frame(&settings, Output::Display).views[0].stars_in_map, 0);
}

/// Limits of the 99.9 % quantile and of the largest error, codes: about twice the measured values.
const LIMITS: [f64; 2] = [0.8, 2.0];

/// A rotation by one texel of the map must fail the comparison.
#[test]
fn a_sky_turned_by_a_texel_fails() {
    let rig = rig(vec![dome(512)]);
    let mut renderer = renderer();
    let [towards, ..] = directions();
    let display = draw(&mut renderer, &scene(towards), &rig, Output::Display, SkyMapUse::Wait);
    let turned = scene(towards * DQuat::from_rotation_z(0.0061));
    let exact = draw(&mut renderer, &turned, &rig, Output::Hdr, SkyMapUse::Wait);
    let errors = DisplayErrors::between(&exact, &display, &settings());
    assert!(errors.quantile(0.999) > 10.0 * LIMITS[0], "{}", errors.quantile(0.999));
}

#[test]
fn a_map_built_over_several_frames_is_the_same() {
    let rig = rig(vec![dome(512)]);
    let [towards, away, ..] = directions();
    let images = |frame: Frame| frame.images.into_iter().map(|image| image.hdr.unwrap()).collect::<Vec<_>>();
    let mut waiting = renderer();
    let first = draw(&mut waiting, &scene(towards), &rig, Output::Display, SkyMapUse::Wait);
    draw(&mut waiting, &scene(away), &rig, Output::Display, SkyMapUse::Wait);
    let again = draw(&mut waiting, &scene(towards), &rig, Output::Display, SkyMapUse::Wait);
    let mut in_turn = renderer();
    let turns: Vec<Frame> =
        (0..7).map(|_| draw(&mut in_turn, &scene(towards), &rig, Output::Display, SkyMapUse::InTurn)).collect();
    let in_map: Vec<bool> = turns.iter().map(|frame| frame.views[0].stars_in_map > 0).collect();
    assert_eq!(in_map, [false, false, false, false, false, true, true]);
    let all = images(first);
    assert_eq!(all, images(again));
    for frame in turns.into_iter().skip(5) {
        assert_eq!(all, images(frame));
    }
}

/// The map depends on the position of the camera, so it is drawn again if the camera moves.
#[test]
fn another_camera_position_has_another_map() {
    let rig = rig(vec![dome(512)]);
    let mut renderer = renderer();
    let [towards, ..] = directions();
    draw(&mut renderer, &scene(towards), &rig, Output::Display, SkyMapUse::Wait);
    let mut elsewhere = scene(towards);
    elsewhere.camera.position_m = DVec3::new(20.0, -5.0, 3.0) * PARSEC_M;
    let exact = draw(&mut renderer, &elsewhere, &rig, Output::Hdr, SkyMapUse::Wait);
    let display = draw(&mut renderer, &elsewhere, &rig, Output::Display, SkyMapUse::Wait);
    assert!(display.views[0].stars_in_map > 200_000);
    let errors = DisplayErrors::between(&exact, &display, &settings());
    let [most, largest] = [0.999, 1.0].map(|share| errors.quantile(share));
    println!("99.9 % {most:.3}, largest {largest:.3}");
    assert!(most < LIMITS[0] && largest < LIMITS[1], "{most} {largest} {:?}", errors.worst);
}

#[test]
fn views_unsuitable_for_a_map_use_none() {
    let mut renderer = renderer();
    let scene = scene(directions()[0]);
    let sky = ("sky", ViewKind::Equirectangular { size: [512, 512] });
    let wide = ("wide", ViewKind::Perspective { size: [512, 512], fov_y_rad: 2.4 });
    for views in [vec![sky], vec![wide], vec![dome(512), ("small", dome(300).1)]] {
        let rig = rig(views);
        let frame = draw(&mut renderer, &scene, &rig, Output::Display, SkyMapUse::Wait);
        assert!(frame.views.iter().all(|view| view.stars_in_map == 0));
    }
}

/// The air dims stars near the horizon. Stars that become fainter than the limit of the map only by this are not in the map, so the frame draws them.
#[test]
fn stars_that_the_air_dims_are_drawn_beside_the_map() {
    let (scene, settings) = with_galaxy("tonight.toml");
    let rig = rig(vec![("dome", ViewKind::DomeMaster { size: 512, fov_rad: PI, tilt_rad: 0.0 })]);
    let mut renderer = renderer();
    let mut frame = |sky_map: SkyMapUse, magnitude_limit: f64| {
        let mut settings = settings.clone();
        settings.stars.magnitude_limit = magnitude_limit;
        let request = FrameRequest::new(&scene, &rig).settings(&settings).wanted(Wanted::hdr());
        renderer.render(request.drawn_for(Output::Display).sky_map(sky_map)).unwrap()
    };
    // Sum the light from altitudes of 4 to 12 degrees.
    let near_horizon_lx = |frame: &Frame| -> f64 {
        let pixels = frame.images[0].hdr.as_ref().unwrap().iter().enumerate();
        let is_low = |index: usize| {
            let [x, y] = [index % 512, index / 512].map(|place| place as f64 + 0.5 - 256.0);
            (78.0..86.0).contains(&(90.0 * x.hypot(y) / 256.0))
        };
        pixels.filter(|(index, _)| is_low(*index)).map(|(_, pixel)| f64::from(pixel[1]) * f64::from(pixel[3])).sum()
    };
    let map = frame(SkyMapUse::Wait, 30.0);
    assert!(map.views[0].stars_in_map > 100_000, "{}", map.views[0].stars_in_map);
    let [with_map, star_by_star] = [&map, &frame(SkyMapUse::Off, 30.0)].map(near_horizon_lx);
    // This is the light of the stars alone: without those fainter than magnitude 0, nearly no light remains.
    let of_stars = star_by_star - near_horizon_lx(&frame(SkyMapUse::Off, 0.0));
    let error = (with_map - star_by_star) / of_stars;
    println!("error of the light of stars near the horizon: {error:.1e}");
    assert!(error.abs() < 5e-3, "{error}");
}
