//! Overlays on the adapter: display codes equal the CPU reference; lines have their position and width in every
//! projection; bodies hide overlays behind them; HDR images contain no overlays.

use std::{
    f64::consts::{FRAC_PI_2, PI},
    sync::Arc,
};

use crate::common::{renderer, settings, snapshot, spiral, star};
use glam::{DQuat, DVec2, DVec3, EulerRot};
use steradian::{
    coordinates::direction_from_lon_lat,
    photometry::tone_map::linear_from_srgb,
    plan::{
        overlay::{OverlayInputs, OverlayPlan, OverlayPlanner, Shape},
        settings::{RenderSettings, StarMethod},
    },
    reference::overlay::draw::{Cover, OverlayTarget, draw},
    render::{Frame, FrameImage, FrameRequest, Renderer, Wanted},
    scene::{
        Camera, SceneObjects, SceneSnapshot,
        bodies::{Body, SolarBody},
        overlay::{Anchor, Colour, Grid, GridKind, Label, LineStyle, Overlay, Picture, PictureLevels, Trajectory},
    },
    view::{
        Fov, Rig, View, ViewKind,
        projection::{Face, FisheyeMapping, pixel_centre},
    },
};

fn views() -> Vec<(&'static str, ViewKind)> {
    let fov = Fov { left_rad: -0.3, right_rad: 1.2, up_rad: 0.9, down_rad: -0.2 };
    let fisheye =
        |mapping, degrees: f64| ViewKind::Fisheye { size: [224, 224], mapping, fov_rad: degrees.to_radians() };
    vec![
        ("flat", ViewKind::Perspective { size: [240, 160], fov_y_rad: 1.1 }),
        ("off-axis", ViewKind::OffAxis { size: [200, 150], fov }),
        ("cube", ViewKind::Cubemap { face_size: 128, faces: Face::ALL.to_vec() }),
        ("dome", ViewKind::DomeMaster { size: 256, fov_rad: PI, tilt_rad: 0.3 }),
        ("equidistant", fisheye(FisheyeMapping::Equidistant, 360.0)),
        ("equisolid", fisheye(FisheyeMapping::Equisolid, 300.0)),
        ("orthographic", fisheye(FisheyeMapping::Orthographic, 180.0)),
        ("stereographic", fisheye(FisheyeMapping::Stereographic, 260.0)),
        ("sphere", ViewKind::Equirectangular { size: [320, 160] }),
    ]
}

fn rig_of(views: Vec<(&str, ViewKind)>) -> Rig {
    let view = |(name, kind)| View::new(name, kind, DQuat::IDENTITY, DVec3::ZERO).unwrap();
    Rig::new(views.into_iter().map(view).collect()).unwrap()
}

/// Returns a scene with a few stars and a rotated camera.
fn scene(overlay: Overlay, bodies: Vec<Body>) -> SceneSnapshot {
    let objects = SceneObjects {
        bodies: bodies.into_iter().map(Arc::new).collect(),
        overlay: Arc::new(overlay),
        ..SceneObjects::default()
    };
    SceneSnapshot {
        objects: Arc::new(objects),
        camera: Camera { world_from_camera: DQuat::from_euler(EulerRot::XYZ, 1.1, 0.5, 0.3), ..Camera::default() },
        ..snapshot(spiral(60).map(|direction| star(direction, 2.0)).collect())
    }
}

fn stars_alone() -> RenderSettings {
    settings(StarMethod::BSpline)
}

fn render(renderer: &mut Renderer, scene: &SceneSnapshot, rig: &Rig) -> Frame {
    let wanted = vec![Wanted { display: true, hdr: true, ..Wanted::default() }; rig.views().len()];
    renderer.render(FrameRequest::new(scene, rig).settings(&stars_alone()).wanted_per_view(&wanted)).unwrap()
}

fn plan_of(scene: &SceneSnapshot, rig: &Rig) -> Arc<OverlayPlan> {
    let viewports = rig.viewports(scene.camera.world_from_camera);
    let views: Vec<String> = rig.views().iter().map(|view| view.name.clone()).collect();
    let inputs = OverlayInputs { objects: &scene.objects, camera: &scene.camera, viewports: &viewports, views: &views };
    OverlayPlanner::default().plan(&inputs).unwrap().unwrap()
}

fn style(colour: [u8; 3], width_px: f64, opacity: f64) -> LineStyle {
    LineStyle { colour: Colour(colour), width_px, opacity }
}

/// Returns a large translucent picture, and a fine, rolled picture with an odd size.
fn pictures() -> Vec<Picture> {
    let smooth = |size: [u32; 2]| {
        let texel = |index: u32| {
            let (x, y) = (f64::from(index % size[0]), f64::from(index / size[0]));
            let wave = |angle: f64| (128.0 + 100.0 * angle.sin()) as u8;
            [wave(0.1 * x), wave(0.07 * y), wave(0.05 * (x + y)), wave(0.04 * (x - y))]
        };
        std::sync::Arc::new(PictureLevels::new(size, (0..size[0] * size[1]).map(texel).collect()))
    };
    let picture = |name: &str, size: [u32; 2], direction: DVec3, width_rad: f64, roll_rad: f64| Picture {
        name: name.to_owned(),
        levels: smooth(size),
        png: None,
        anchor: Anchor::Direction(direction.normalize()),
        width_rad,
        roll_rad,
        opacity: 0.8,
    };
    vec![
        picture("wide", [64, 40], DVec3::new(0.2, -0.3, -0.9), 2.0, 0.0),
        picture("fine", [301, 211], DVec3::new(0.7, 0.6, -0.3), 0.5, 0.7),
        picture("seam", [40, 40], DVec3::new(0.1, -0.1, 1.0), 0.8, -1.0),
    ]
}

fn everything() -> Overlay {
    let label = |index: usize, direction: DVec3| Label {
        name: format!("l{index}"),
        text: ["Beteigeuze", "α Cen", "M 31 (Andromeda)"][index % 3].to_owned(),
        anchor: Anchor::Direction(direction),
        colour: Colour([250, 220, 200]),
        size_px: 9.0 + index as f64,
        opacity: 0.8,
    };
    let points_m = (0..60).map(|i| f64::from(i) * 0.2).map(|t| DVec3::new(3.0 * t.cos(), 3.0 * t.sin(), t - 6.0));
    Overlay {
        pictures: pictures(),
        cardinal_points: false,
        grids: vec![
            Grid::new(GridKind::Equatorial, 6, style([80, 130, 190], 1.5, 0.7)),
            Grid { numbers: false, ..Grid::new(GridKind::Galactic, 3, style([190, 90, 90], 3.0, 0.4)) },
            Grid { numbers: false, ..Grid::new(GridKind::Altitude, 2, style([90, 190, 90], 1.0, 1.0)) },
        ],
        trajectories: vec![Trajectory::new("way", points_m.collect(), Trajectory::STYLE)],
        labels: spiral(20).enumerate().map(|(index, direction)| label(index, direction)).collect(),
        test_patterns: ["flat", "dome", "cube", "sphere"].map(str::to_owned).to_vec(),
    }
}

/// Returns the CPU reference for a viewport: the overlay drawn over the display image of a frame without overlays.
fn twin(plan: &OverlayPlan, rig: &Rig, scene: &SceneSnapshot, index: usize, below: &FrameImage) -> Vec<u8> {
    let viewport = &rig.viewports(scene.camera.world_from_camera)[index];
    let mut codes = below.display.clone().unwrap();
    let contains = |x, y| viewport.projection.mapping().contains(x, y);
    let cover = |_, _| -> Option<Cover> { None };
    let direction = |x, y| viewport.projection.mapping().direction_from_pixel(pixel_centre(x, y));
    let mut target = OverlayTarget {
        size: viewport.size(),
        codes: &mut codes,
        contains: &contains,
        direction: &direction,
        cover: &cover,
    };
    draw(&mut target, plan.items_of(index), &plan.texels);
    codes
}

/// Returns the largest difference of codes, and the number of different codes.
fn difference(a: &[u8], b: &[u8]) -> (u8, usize) {
    assert_eq!(a.len(), b.len());
    let differences = a.iter().zip(b).map(|(a, b)| a.abs_diff(*b));
    (differences.clone().max().unwrap_or(0), differences.filter(|difference| *difference > 0).count())
}

#[test]
fn display_codes_equal_the_reference_and_hdr_is_unchanged() {
    let rig = rig_of(views());
    let (plain, drawn) = (scene(Overlay::default(), vec![]), scene(everything(), vec![]));
    let mut renderer = renderer();
    let before = render(&mut renderer, &plain, &rig);
    let after = render(&mut renderer, &drawn, &rig);
    let plan = plan_of(&drawn, &rig);
    // Make the lines a quarter of a pixel too wide.
    let mut wider = (*plan).clone();
    for item in &mut wider.items {
        if let Shape::Line { half_width_px, .. } = &mut item.shape {
            *half_width_px += 0.125;
        }
    }
    for (index, (below, image)) in before.images.iter().zip(&after.images).enumerate() {
        let name = format!("{} {:?}", rig.views()[image.view].name, image.part);
        let bits = |image: &FrameImage| -> Vec<[u32; 4]> {
            image.hdr.as_ref().unwrap().iter().map(|pixel| pixel.map(f32::to_bits)).collect()
        };
        assert!(bits(below) == bits(image), "{name}: the HDR image has changed");
        let codes = image.display.as_ref().unwrap();
        assert!(difference(codes, below.display.as_ref().unwrap()).1 > 1000, "{name}: nothing is drawn");
        let expected = twin(&plan, &rig, &drawn, index, below);
        let (most, count) = difference(codes, &expected);
        println!("{name}: {count} of {} codes differ, by at most {most}", codes.len());
        assert!(most <= 1, "{name}: {most} codes");
        assert!(count * 200 < codes.len(), "{name}: {count} codes differ");
        // A wrong picture must fail the comparison.
        let (most, _) = difference(codes, &twin(&wider, &rig, &drawn, index, below));
        assert!(most > 5, "{name}: wider lines make {most} codes");
    }
    assert_eq!(after.exposure_ev100.to_bits(), before.exposure_ev100.to_bits());
    // When the overlays are removed, the display images are the same as before.
    let again = render(&mut renderer, &plain, &rig);
    for (a, b) in again.images.iter().zip(&before.images) {
        assert!(a.display == b.display, "the display image without overlays has changed");
    }
}

#[test]
fn a_test_pattern_appears_only_in_its_view() {
    let rig = rig_of(vec![
        ("a", ViewKind::Perspective { size: [96, 64], fov_y_rad: 1.0 }),
        ("b", ViewKind::Equirectangular { size: [96, 48] }),
    ]);
    let overlay = Overlay { test_patterns: vec!["b".to_owned()], ..Overlay::default() };
    let mut renderer = renderer();
    let before = render(&mut renderer, &scene(Overlay::default(), vec![]), &rig);
    let after = render(&mut renderer, &scene(overlay, vec![]), &rig);
    assert!(before.images[0].display == after.images[0].display);
    assert!(before.images[1].display != after.images[1].display);
    // The outermost pixels are white on all sides.
    let codes = after.images[1].display.as_ref().unwrap();
    for x in 0..96 {
        assert_eq!((codes[4 * x], codes[4 * (47 * 96 + x)]), (255, 255));
    }
}

/// Returns the coverage of every pixel by white lines on a black sky.
fn coverage(image: &FrameImage) -> Vec<f64> {
    let codes = image.display.as_ref().unwrap();
    codes.chunks(4).map(|pixel| linear_from_srgb(f64::from(pixel[1]) / 255.0)).collect()
}

/// Returns a black sky with white lines.
fn dark_sky(overlay: Overlay) -> SceneSnapshot {
    let lit = scene(overlay, vec![]);
    SceneSnapshot { stars: snapshot(vec![]).stars, ..lit }
}

#[test]
fn lines_have_their_position_and_width_in_every_projection() {
    let rig = rig_of(views());
    const SIGMA_PX: f64 = 1.5;
    let width_px = 2.5;
    let grid = |kind| Grid { numbers: false, ..Grid::new(kind, 1, style([255; 3], width_px, 1.0)) };
    let sky = dark_sky(Overlay { grids: vec![grid(GridKind::Galactic)], ..Overlay::default() });
    let frame = render(&mut renderer(), &sky, &rig);
    let viewports = rig.viewports(sky.camera.world_from_camera);
    // Draw the galactic equator and four meridians.
    let galactic = steradian::coordinates::icrs_from_galactic();
    let circle = |index: usize, angle: f64| match index {
        0 => galactic * direction_from_lon_lat(angle, 0.0),
        _ => {
            galactic * direction_from_lon_lat((index - 1) as f64 * FRAC_PI_2, (angle / 2.0).rem_euclid(PI) - FRAC_PI_2)
        }
    };
    let (mut points, mut worst_off_px, mut worst_width) = (0, 0.0_f64, 0.0_f64);
    for (image, viewport) in frame.images.iter().zip(&viewports) {
        let name = format!("{} {:?}", rig.views()[image.view].name, image.part);
        let mapping = viewport.projection.mapping();
        let covered = coverage(image);
        let [width, height] = viewport.size();
        let pixel_at = |index: usize, angle: f64| {
            let direction = viewport.world_from_view.inverse() * circle(index, angle);
            mapping.pixel_from_direction(direction)
        };
        let mut of_image = 0;
        for index in 0..5 {
            for step in 0..90 {
                let angle = f64::from(step) * PI / 45.0 + 0.011;
                let Some(pixel) = pixel_at(index, angle) else { continue };
                // Use only positions at which the line is nearly straight, away from other lines, and inside of the picture.
                let ends = [pixel_at(index, angle - 0.01), pixel_at(index, angle + 0.01)];
                let [Some(before), Some(after)] = ends else { continue };
                let reach = 7.0;
                let inside = pixel.min_element() > reach
                    && pixel.x < f64::from(width) - reach
                    && pixel.y < f64::from(height) - reach;
                let bend = ((before + after) / 2.0).distance(pixel) / before.distance_squared(after).max(1e-9);
                let others = (0..5).filter(|other| *other != index).any(|other| {
                    (0..720)
                        .filter_map(|k| pixel_at(other, f64::from(k) * PI / 360.0))
                        .any(|near| near.distance(pixel) < 14.0)
                });
                if !inside || bend > 0.0005 || others || !(0.5..20.0).contains(&before.distance(after)) {
                    continue;
                }
                let normal = (after - before).normalize().perp();
                let tangent = (after - before).normalize();
                // The sum over pixels, weighted by a Gaussian along the line and equally across it, approximates the integral.
                let (mut sum, mut moment) = (0.0, 0.0);
                let mut rim = false;
                for dy in -7..=7 {
                    for dx in -7..=7 {
                        let (x, y) = ((pixel.x as i64 + dx) as u32, (pixel.y as i64 + dy) as u32);
                        rim |= !mapping.contains(x, y);
                        let offset = DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5) - pixel;
                        let weight =
                            (-0.5 * (offset.dot(tangent) / SIGMA_PX).powi(2)).exp() / (SIGMA_PX * (2.0 * PI).sqrt());
                        if offset.dot(normal).abs() < 4.0 {
                            let value = covered[(y * width + x) as usize];
                            sum += weight * value;
                            moment += weight * value * offset.dot(normal);
                        }
                    }
                }
                if rim {
                    continue;
                }
                of_image += 1;
                let (off_px, measured) = (moment / sum, sum);
                worst_off_px = worst_off_px.max(off_px.abs());
                worst_width = worst_width.max((measured / width_px - 1.0).abs());
                assert!(off_px.abs() < 0.1, "{name}: the line is {off_px} px off at {pixel}");
                assert!((measured / width_px - 1.0).abs() < 0.06, "{name}: {measured} px wide at {pixel}");
            }
        }
        println!("{name}: {of_image} places");
        points += of_image;
    }
    println!("{points} places: largest offset {worst_off_px} px, largest relative error of the width {worst_width}");
    assert!(points > 200, "{points} places");
}

#[test]
fn bodies_hide_what_is_behind_them() {
    let rig = rig_of(vec![("flat", ViewKind::Perspective { size: [200, 200], fov_y_rad: 0.8 })]);
    let camera = Camera::default();
    // Returns a scene with a black ball straight ahead, which has a radius of about 24 pixels. One line is in front of it and one behind it.
    let mut ball = Body::preset(SolarBody::Moon, "ball", DVec3::NEG_Z * 1e8);
    ball.radii_m = DVec3::splat(1e7);
    ball.surface.geometric_albedo = [0.0; 3];
    let radius_px = (1e7_f64 / 1e8).asin().tan() / 0.4_f64.tan() * 100.0;
    let way = |name: &str, distance_m: f64, y: f64, colour| {
        let ends = [-0.2, 0.2].map(|x| DVec3::new(x, y, -1.0) * distance_m);
        Trajectory::new(name, ends.to_vec(), style(colour, 2.0, 1.0))
    };
    let label = |name: &str, anchor| Label {
        name: name.to_owned(),
        text: "█████".to_owned(),
        anchor,
        colour: Colour([255, 255, 0]),
        size_px: 10.0,
        opacity: 1.0,
    };
    let centre_px = |x: f64, y: f64| DVec2::new(100.0 + x / 0.4_f64.tan() * 100.0, 100.0 - y / 0.4_f64.tan() * 100.0);
    let code = |image: &FrameImage, pixel: DVec2| {
        let index = 4 * (pixel.y as usize * 200 + pixel.x as usize);
        let codes = image.display.as_ref().unwrap();
        [codes[index], codes[index + 1], codes[index + 2]]
    };
    let overlay = Overlay {
        trajectories: vec![way("before", 5e7, 0.03, [255, 0, 0]), way("behind", 2e8, -0.03, [0, 0, 255])],
        grids: vec![Grid { numbers: false, ..Grid::new(GridKind::Altitude, 1, style([0, 255, 0], 2.0, 1.0)) }],
        labels: vec![label("own", Anchor::Point(DVec3::NEG_Z * 1e8 + DVec3::Y * 6e6))],
        ..Overlay::default()
    };
    let scene_with = |overlay: Overlay, bodies| SceneSnapshot { camera, ..scene(overlay, bodies) };
    let mut renderer = renderer();
    let open = render(&mut renderer, &scene_with(overlay.clone(), vec![]), &rig);
    let hidden = render(&mut renderer, &scene_with(overlay, vec![ball]), &rig);
    let [open, hidden] = [&open.images[0], &hidden.images[0]];
    for (x, y, name) in [(0.0, 0.03, "before"), (0.0, -0.03, "behind"), (0.05, 0.0, "grid")] {
        let (inside, outside) = (centre_px(x, y), centre_px(x + 0.15, y));
        assert!(inside.distance(DVec2::splat(100.0)) < radius_px - 3.0);
        assert_eq!(code(open, outside), code(hidden, outside), "{name} next to the ball");
        assert_ne!(code(open, inside), [0; 3], "{name} without the ball");
        if name == "before" {
            assert_eq!(code(hidden, inside), code(open, inside), "{name}");
        } else {
            assert_eq!(code(hidden, inside), [0; 3], "{name}");
        }
    }
    // The label of the ball is drawn in front of it: inside of the disc, above and to the right of the labelled point.
    assert_eq!(code(hidden, centre_px(0.0, 0.06) + DVec2::new(6.0, -6.0)), [255, 255, 0]);
}

#[test]
fn the_limb_of_a_body_hides_lines_by_pixel_coverage() {
    let rig = rig_of(vec![("flat", ViewKind::Perspective { size: [200, 200], fov_y_rad: 0.8 })]);
    let mut ball = Body::preset(SolarBody::Moon, "ball", DVec3::NEG_Z * 1e8);
    ball.radii_m = DVec3::splat(1e7);
    ball.surface.geometric_albedo = [0.0; 3];
    let radius_px = (1e7_f64 / 1e8).asin().tan() / 0.4_f64.tan() * 100.0;
    let grid = Grid { numbers: false, ..Grid::new(GridKind::Altitude, 1, style([255; 3], 32.0, 1.0)) };
    let overlay = Overlay { grids: vec![grid], ..Overlay::default() };
    let sky = SceneSnapshot { camera: Camera::default(), stars: snapshot(vec![]).stars, ..scene(overlay, vec![ball]) };
    let frame = render(&mut renderer(), &sky, &rig);
    let open = coverage(&frame.images[0]);
    // Returns the share of a pixel that is outside of a disc around the centre of the image.
    let outside = |x: usize, y: usize, radius_px: f64| {
        let offset_px = |corner: usize, part: usize| corner as f64 + (part as f64 + 0.5) / 32.0 - 100.0;
        let parts = (0..32).flat_map(|j| (0..32).map(move |i| (i, j)));
        parts.filter(|(i, j)| offset_px(x, *i).hypot(offset_px(y, *j)) > radius_px).count() as f64 / 1024.0
    };
    let error = |radius_px: f64| {
        let pixels = (88..112).flat_map(|y| (60..140).map(move |x| (x, y)));
        pixels.map(|(x, y)| (open[y * 200 + x] - outside(x, y, radius_px)).abs()).fold(0.0, f64::max)
    };
    println!("radius {radius_px} px: largest error of the coverage {}", error(radius_px));
    assert!(error(radius_px) < 0.06, "{}", error(radius_px));
    // A disc that is a quarter of a pixel larger fails the comparison.
    assert!(error(radius_px + 0.25) > 0.15, "{}", error(radius_px + 0.25));
}

#[test]
fn lines_have_no_gap_at_seams_and_cube_edges() {
    let rig = rig_of(vec![
        ("sphere", ViewKind::Equirectangular { size: [240, 120] }),
        ("cube", ViewKind::Cubemap { face_size: 96, faces: Face::ALL.to_vec() }),
    ]);
    let grid = Grid { numbers: false, ..Grid::new(GridKind::Altitude, 3, style([255; 3], 3.0, 1.0)) };
    let sky = dark_sky(Overlay { grids: vec![grid], ..Overlay::default() });
    let frame = render(&mut renderer(), &sky, &rig);
    // The horizon crosses every column at the same height. The meridian behind the camera is on the seam, with half of its width on each side.
    let sphere = coverage(&frame.images[0]);
    for x in 0..240 {
        assert!(sphere[60 * 240 + x] > 0.99 && sphere[59 * 240 + x] > 0.99, "a gap in the horizon at {x}");
    }
    for y in [45, 50, 70] {
        let coverage_at = |x: usize| sphere[y * 240 + x];
        assert!(coverage_at(0) > 0.99 && coverage_at(239) > 0.99, "row {y}: {} {}", coverage_at(0), coverage_at(239));
        assert!(
            (coverage_at(1) - coverage_at(238)).abs() < 0.01 && coverage_at(1) > 0.4,
            "row {y}: {} {}",
            coverage_at(1),
            coverage_at(238)
        );
    }
    // A line of constant altitude continues from the front face to the right face.
    let [front, right] = [1, 2].map(|index| coverage(&frame.images[index]));
    let column = |face: &[f64], x: usize| -> f64 {
        let rows = (0..96).map(|y| (face[y * 96 + x], y as f64 + 0.5)).filter(|(_, y)| (8.0..40.0).contains(y));
        let (sum, moment) = rows.fold((0.0, 0.0), |(sum, moment), (value, y)| (sum + value, moment + value * y));
        moment / sum
    };
    let [left, right] = [column(&front, 95), column(&right, 0)];
    // The two columns are half a pixel from the edge, on either side of a bend of the line.
    assert!((left - right).abs() < 0.1, "{left} {right}");
}
