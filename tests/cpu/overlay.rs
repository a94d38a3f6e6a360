//! Overlays in f64: their plan, and their configuration.

use std::{f64::consts::PI, path::Path, sync::Arc};

use glam::{DQuat, DVec2, DVec3};
use steradian::{
    config::Config,
    coordinates::{direction_from_lon_lat, icrs_from_galactic},
    plan::overlay::{
        OverlayInputs, OverlayPlan, OverlayPlanError, OverlayPlanner, Shape, arc::Arc as SkyArc, trace::Tracer,
    },
    reference::overlay::draw::{OverlayTarget, draw},
    relativity::Motion,
    scene::{
        Camera, SceneObjects,
        overlay::{Anchor, Colour, Grid, GridKind, LineStyle, Overlay, Trajectory},
    },
    view::{
        Fov, Rig, View, ViewKind, Viewport,
        projection::{CubeFace, Equirectangular, Face, Fisheye, FisheyeMapping, Perspective, Projection, pixel_centre},
    },
};

fn fisheye(mapping: FisheyeMapping, degrees: f64) -> Projection {
    Projection::Fisheye(Fisheye::new([400, 400], mapping, f64::to_radians(degrees)).unwrap())
}

fn projections() -> Vec<(&'static str, Projection)> {
    let degrees = f64::to_radians;
    vec![
        ("perspective", Projection::Perspective(Perspective::symmetric([400, 300], degrees(60.0)).unwrap())),
        ("wide", Projection::Perspective(Perspective::symmetric([300, 300], degrees(170.0)).unwrap())),
        (
            "off-axis",
            Projection::Perspective(
                Perspective::off_axis([400, 300], degrees(-10.0), degrees(70.0), degrees(50.0), degrees(-5.0)).unwrap(),
            ),
        ),
        ("cube face", Projection::CubeFace(CubeFace::new(Face::Up, 300).unwrap())),
        ("equidistant 180", fisheye(FisheyeMapping::Equidistant, 180.0)),
        ("equidistant 360", fisheye(FisheyeMapping::Equidistant, 360.0)),
        ("equisolid 360", fisheye(FisheyeMapping::Equisolid, 360.0)),
        ("orthographic 180", fisheye(FisheyeMapping::Orthographic, 180.0)),
        ("stereographic 300", fisheye(FisheyeMapping::Stereographic, 300.0)),
        ("equirectangular", Projection::Equirectangular(Equirectangular::new([600, 300]).unwrap())),
    ]
}

/// Returns circles of many sizes and positions. Some of them pass through poles, axes and antipodes.
fn arcs() -> Vec<SkyArc> {
    let mut arcs = Vec::new();
    for index in 0..20 {
        let turn = DQuat::from_euler(
            glam::EulerRot::XYZ,
            f64::from(index) * 0.7,
            f64::from(index) * 1.1 + 0.03,
            f64::from(index) * 0.3,
        );
        let [x, y, z] = [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| turn * axis);
        arcs.push(SkyArc::circle(z, x, y, 0.02 + 0.16 * f64::from(index)));
    }
    for (middle, along) in [
        (DVec3::NEG_Z, DVec3::X),
        (DVec3::NEG_Z, DVec3::Y),
        (DVec3::X, DVec3::Y),
        (DVec3::NEG_Z, DVec3::new(0.6, 0.8, 0.0)),
    ] {
        arcs.push(SkyArc::half_circle(middle, along, PI));
    }
    arcs.push(SkyArc::straight_line(DVec3::new(-3.0, 1.0, 5.0), DVec3::new(40.0, 2.0, -3.0)).unwrap());
    arcs
}

fn distance_to_piece(point: DVec2, [from, to]: [DVec2; 2]) -> f64 {
    let along = to - from;
    let part = ((point - from).dot(along) / along.length_squared().max(1e-300)).clamp(0.0, 1.0);
    point.distance(from + along * part)
}

/// Samples a curve at points that are a twentieth of a pixel apart, wherever it is continuous and near the picture.
fn sample_densely(
    position: &dyn Fn(f64) -> Option<DVec2>,
    [a, b]: [f64; 2],
    pixels: [Option<DVec2>; 2],
    depth: u32,
    curve: &mut Vec<DVec2>,
) {
    let near = |pixel: Option<DVec2>| pixel.filter(|pixel| pixel.abs().max_element() < 2000.0);
    let [start, end] = pixels.map(near);
    curve.extend(start);
    let (Some(start), Some(end)) = (start, end) else { return };
    if start.distance(end) > 0.05 && depth > 0 {
        let middle = (a + b) / 2.0;
        let pixel = position(middle);
        sample_densely(position, [a, middle], [Some(start), pixel], depth - 1, curve);
        sample_densely(position, [middle, b], [pixel, Some(end)], depth - 1, curve);
    }
}

/// Returns two distances, pixels: the largest distance from the curve to a point of the pieces, and the largest
/// distance from the pieces to a point of the curve inside the picture.
fn errors_px(projection: &Projection, arc: &SkyArc, pieces: &[[DVec2; 2]]) -> [f64; 2] {
    let mapping = projection.mapping();
    let [width, height] = mapping.size().map(f64::from);
    let steps = 20_000;
    let [from, to] = arc.angles;
    // The corners of round pictures count as outside.
    let inside = |pixel: &DVec2| {
        let in_image = pixel.x >= 0.0 && pixel.x <= width && pixel.y >= 0.0 && pixel.y <= height;
        in_image && mapping.direction_from_pixel(*pixel).is_some()
    };
    let position = |angle: f64| mapping.pixel_from_direction(arc.direction(angle));
    let mut curve: Vec<DVec2> = Vec::new();
    for step in 0..steps {
        let angles = [step, step + 1].map(|step| from + (to - from) * f64::from(step) / f64::from(steps));
        sample_densely(&position, angles, angles.map(position), 30, &mut curve);
    }
    // Sort the points into cells, so that only neighbours are compared.
    let cell = |pixel: DVec2| [(pixel.x / 8.0).floor() as i64, (pixel.y / 8.0).floor() as i64];
    let mut cells: std::collections::HashMap<[i64; 2], Vec<DVec2>> = std::collections::HashMap::new();
    // An equirectangular image wraps around at its sides.
    let turns = if matches!(projection, Projection::Equirectangular(_)) { &[0.0, 1.0, -1.0][..] } else { &[0.0] };
    for pixel in curve.iter().flat_map(|pixel| turns.iter().map(|turn| *pixel + DVec2::new(turn * width, 0.0))) {
        cells.entry(cell(pixel)).or_default().push(pixel);
    }
    let mut piece_cells: std::collections::HashMap<[i64; 2], Vec<usize>> = std::collections::HashMap::new();
    let mut off_curve = 0.0_f64;
    for (index, &[a, b]) in pieces.iter().enumerate() {
        let count = (a.distance(b) / 2.0).ceil().max(1.0) as usize;
        for step in 0..=count {
            let point = a + (b - a) * step as f64 / count as f64;
            let [x, y] = cell(point);
            for dy in -1..=1 {
                for dx in -1..=1 {
                    let list = piece_cells.entry([x + dx, y + dy]).or_default();
                    if list.last() != Some(&index) {
                        list.push(index);
                    }
                }
            }
            if inside(&point) {
                let near = (-1..=1).flat_map(|dy| (-1..=1).map(move |dx| [x + dx, y + dy]));
                let nearest = near
                    .filter_map(|cell| cells.get(&cell))
                    .flatten()
                    .map(|pixel| pixel.distance(point))
                    .fold(8.0, f64::min);
                off_curve = off_curve.max(nearest);
            }
        }
    }
    let mut uncovered = 0.0_f64;
    for pixel in curve.iter().filter(|pixel| inside(pixel)) {
        let near = piece_cells.get(&cell(*pixel)).map_or(&[][..], Vec::as_slice);
        let nearest = near.iter().map(|&index| distance_to_piece(*pixel, pieces[index])).fold(8.0, f64::min);
        uncovered = uncovered.max(nearest);
    }
    [off_curve, uncovered]
}

#[test]
fn pieces_follow_their_curve_in_every_projection_and_leave_no_gap() {
    for (name, projection) in projections() {
        let identity = |direction: DVec3| direction;
        let (mut worst, mut count) = ([0.0_f64; 2], 0);
        for arc in arcs() {
            let mut tracer = Tracer::new(&projection, 3.0, &identity, Some(0.0));
            let pieces: Vec<[DVec2; 2]> = tracer.trace(&arc).into_iter().map(|piece| piece.ends).collect();
            count += pieces.len();
            let errors = errors_px(&projection, &arc, &pieces);
            worst = [worst[0].max(errors[0]), worst[1].max(errors[1])];
        }
        println!("{name}: {worst:?} px, {count} pieces");
        assert!(worst[0] < 0.1 && worst[1] < 0.1, "{name}: {worst:?}");
    }
}

/// Returns the plan of a scene for viewports along the camera's axes.
fn plan_of(objects: &SceneObjects, camera: &Camera, viewports: &[Viewport], names: &[String]) -> Arc<OverlayPlan> {
    let inputs = OverlayInputs { objects, camera, viewports, views: names };
    OverlayPlanner::default().plan(&inputs).unwrap().unwrap()
}

fn rig() -> (Rig, Vec<String>) {
    let fov = Fov { left_rad: -0.9, right_rad: 0.7, up_rad: 0.8, down_rad: -0.8 };
    let views = [
        ("dome", ViewKind::DomeMaster { size: 300, fov_rad: PI, tilt_rad: 0.0 }),
        ("eyes", ViewKind::Stereo { size: [300, 240], ipd_m: 0.4, fov_left: fov, fov_right: fov.mirrored() }),
        ("sphere", ViewKind::Equirectangular { size: [400, 200] }),
    ];
    let view = |(name, kind)| View::new(name, kind, DQuat::IDENTITY, DVec3::ZERO).unwrap();
    let rig = Rig::new(views.into_iter().map(view).collect()).unwrap();
    let names = rig.views().iter().map(|view| view.name.clone()).collect();
    (rig, names)
}

/// Finds the line of a viewport that is nearest to a pixel. Returns how far it is from the pixel, in pixels, and the
/// inverse of its distance in space at that point.
fn nearest_line(plan: &OverlayPlan, viewport: usize, pixel: DVec2) -> (f64, f64) {
    let lines = plan.items_of(viewport).iter().filter_map(|item| match item.shape {
        Shape::Line { from, to, nearness, .. } => Some((from, to, nearness)),
        _ => None,
    });
    let distances = lines.map(|(from, to, nearness)| {
        let along = to - from;
        let part = ((pixel - from).dot(along) / along.length_squared().max(1e-300)).clamp(0.0, 1.0);
        (pixel.distance(from + along * part), nearness[0] + (nearness[1] - nearness[0]) * part)
    });
    distances.min_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or((f64::INFINITY, 0.0))
}

/// Returns the pixel in which a vector in world axes appears, if it is in the picture.
fn pixel_of(viewport: &Viewport, vector: DVec3) -> Option<DVec2> {
    let mapping = viewport.projection.mapping();
    let pixel = mapping.pixel_from_direction(viewport.world_from_view.inverse() * vector)?;
    mapping.direction_from_pixel(pixel).map(|_| pixel)
}

#[test]
fn a_moving_camera_sees_grids_aligned_with_the_stars() {
    let (rig, names) = rig();
    let grid = Grid { numbers: false, ..Grid::new(GridKind::Galactic, 1, Grid::STYLE) };
    let overlay = Arc::new(Overlay { grids: vec![grid], ..Overlay::default() });
    let objects = SceneObjects { overlay, ..SceneObjects::default() };
    let resting = Camera { world_from_camera: DQuat::from_rotation_x(1.0), ..Camera::default() };
    let moving = Camera { velocity_c: DVec3::new(0.5, 0.3, -0.4), ..resting };
    let motion = Motion::new(moving.velocity_c).unwrap();
    let viewports = rig.viewports(moving.world_from_camera);
    let [right, wrong] = [moving, resting].map(|camera| plan_of(&objects, &camera, &viewports, &names));
    let (mut worst, mut worst_wrong, mut count) = (0.0_f64, 0.0_f64, 0);
    for (index, viewport) in viewports.iter().enumerate() {
        for step in 0..360 {
            let star = icrs_from_galactic() * direction_from_lon_lat(f64::from(step).to_radians(), 0.0);
            let Some(pixel) = pixel_of(viewport, motion.seen(star)) else { continue };
            count += 1;
            worst = worst.max(nearest_line(&right, index, pixel).0);
            worst_wrong = worst_wrong.max(nearest_line(&wrong, index, pixel).0);
        }
    }
    println!("{count} positions: largest error {worst} px, without aberration {worst_wrong} px");
    assert!(count > 500 && worst < 0.1 && worst_wrong > 10.0, "{count} {worst} {worst_wrong}");
}

#[test]
fn trajectories_have_the_position_and_distance_of_each_eye() {
    let (rig, names) = rig();
    let points_m: Vec<DVec3> = (0..12)
        .map(|i| f64::from(i) * 0.9)
        .map(|t| DVec3::new(6.0 * t.cos(), 3.0 * t.sin() + 1.0, -4.0 + 5.0 * (t * 0.7).sin()))
        .collect();
    let camera = Camera { position_m: DVec3::new(1e3, 0.0, 5e2), ..Camera::default() };
    let corners = points_m.iter().map(|point| camera.position_m + *point).collect();
    let way = Trajectory::new("way", corners, Trajectory::STYLE);
    let overlay = Arc::new(Overlay { trajectories: vec![way], ..Overlay::default() });
    let objects = SceneObjects { overlay, ..SceneObjects::default() };
    let viewports = rig.viewports(camera.world_from_camera);
    let plan = plan_of(&objects, &camera, &viewports, &names);
    let (mut worst_px, mut worst_nearness, mut count) = (0.0_f64, 0.0_f64, 0);
    for (index, viewport) in viewports.iter().enumerate() {
        for pair in points_m.windows(2) {
            for step in 0..50 {
                let point = pair[0].lerp(pair[1], f64::from(step) / 50.0) - viewport.eye_offset_m;
                let Some(pixel) = pixel_of(viewport, point) else { continue };
                let (off_px, nearness) = nearest_line(&plan, index, pixel);
                count += 1;
                worst_px = worst_px.max(off_px);
                worst_nearness = worst_nearness.max((nearness * point.length() - 1.0).abs());
            }
        }
    }
    println!("{count} positions: largest error {worst_px} px, largest relative error of the distance {worst_nearness}");
    assert!(count > 1000 && worst_px < 0.1, "{count} {worst_px}");
    // The lines do not cross here; if they did, the nearest piece could belong to another line.
    assert!(worst_nearness < 0.01, "{worst_nearness}");
    // The eyes have different pictures.
    let lines = |index: usize| plan.items_of(index).first().map(|item| item.shape);
    assert_ne!(lines(1), lines(2));
}

#[test]
fn an_equal_frame_reuses_the_plan_and_too_many_items_are_refused() {
    let (rig, names) = rig();
    let fine = Grid { numbers: false, ..Grid::new(GridKind::Equatorial, 90, Grid::STYLE) };
    let objects_of = |grids: Vec<Grid>| SceneObjects {
        overlay: Arc::new(Overlay { grids, ..Overlay::default() }),
        ..SceneObjects::default()
    };
    let objects = objects_of(vec![Grid { spacing_deg: 30.0, ..fine }]);
    let (camera, viewports) = (Camera::default(), rig.viewports(DQuat::IDENTITY));
    let mut planner = OverlayPlanner::default();
    let mut plan = |objects: &SceneObjects, camera: &Camera, viewports: &[Viewport], names: &[String]| {
        planner.plan(&OverlayInputs { objects, camera, viewports, views: names })
    };
    let first = plan(&objects, &camera, &viewports, &names).unwrap().unwrap();
    let later = Camera { revision: 7, ..camera };
    let again = plan(&objects, &later, &viewports, &names).unwrap().unwrap();
    assert!(Arc::ptr_eq(&first, &again));
    let turned = Camera { world_from_camera: DQuat::from_rotation_y(0.1), ..camera };
    let other = plan(&objects, &turned, &rig.viewports(turned.world_from_camera), &names).unwrap().unwrap();
    assert!(!Arc::ptr_eq(&first, &other) && *first != *other);
    assert_eq!(plan(&objects_of(vec![]), &camera, &viewports, &names), Ok(None));
    // Too many items: thirty images of the whole sphere with eight grids of 1 degree.
    let sphere = &viewports[3];
    let many: Vec<Viewport> = vec![sphere.clone(); 30];
    let names = vec!["sphere".to_owned(); 5];
    let refused = plan(&objects_of(vec![fine; 8]), &camera, &many, &names);
    assert_eq!(refused, Err(OverlayPlanError::TooMany));
}

/// A level camera that looks north, at a place with hills of 10 degrees in the east.
const PLACE: &str = "[scene]\ntime = 2026-11-09T20:00:00Z\ncatalogues = []\n[scene.observer]\nlatitude_deg = 48\nlongitude_deg = 11\nazimuth_deg = 0\n\
    [scene.observer.ground]\nhorizon_deg = [[0, 0], [80, 0], [85, 10], [95, 10], [100, 0]]\n\
    [[views]]\nname = 'sky'\ntype = 'equirectangular'\nsize = [720, 360]\n";

/// Returns the centres of the glyphs in a configuration's overlay, in columns and rows of half a degree. Azimuth 0 is
/// in the middle of the picture.
fn glyphs(overlay: &str) -> Vec<DVec2> {
    let config = Config::from_text(&format!("{PLACE}{overlay}"), "test.toml", Path::new("/sky"), &[]).unwrap();
    let camera = config.camera().unwrap();
    let viewports = config.rig().unwrap().viewports(camera.world_from_camera);
    let objects = config.objects().unwrap();
    let inputs =
        OverlayInputs { objects: &objects, camera: &camera, viewports: &viewports, views: &["sky".to_owned()] };
    let plan = OverlayPlanner::default().plan(&inputs).unwrap().unwrap();
    let middle = |shape: &Shape| match shape {
        Shape::Glyph { from, size, .. } => {
            Some(DVec2::from_array(from.map(f64::from)) + DVec2::from_array(size.map(f64::from)) / 2.0)
        }
        _ => None,
    };
    plan.items.iter().filter_map(|item| middle(&item.shape)).collect()
}

fn lies(glyphs: &[DVec2], azimuth_deg: f64, altitude_deg: f64, within_px: f64) -> bool {
    let column = (360.0 + 2.0 * azimuth_deg).rem_euclid(720.0);
    let place = DVec2::new(column, 180.0 - 2.0 * altitude_deg);
    glyphs.iter().any(|glyph| glyph.distance(place) < within_px)
}

#[test]
fn cardinal_points_and_labels_by_azimuth_stand_above_the_ground() {
    let compass = glyphs("[overlay]\ncardinal_points = true\n");
    for (azimuth_deg, altitude_deg) in [(0.0, 4.0), (90.0, 14.0), (270.0, 4.0), (45.0, 4.0)] {
        assert!(lies(&compass, azimuth_deg, altitude_deg, 12.0), "{azimuth_deg}: {compass:?}");
        assert!(!lies(&compass, azimuth_deg, altitude_deg + 15.0, 12.0), "{azimuth_deg}");
    }
    // There are eight points of one or two letters, each letter with an edge; the south is drawn on both sides of the
    // seam.
    assert!((24..=26).contains(&compass.len()), "{}", compass.len());
    // Refraction does not raise the label, because its altitude is apparent. A label is drawn above and to the right of
    // its position.
    let label = glyphs("[[overlay.labels]]\nname = 'N'\nazimuth_deg = 20.0\naltitude_deg = 0.0\nsize_px = 6\n");
    assert!(label.len() == 2 && lies(&label, 21.5, 1.5, 4.0), "{label:?}");
    // The azimuth labels of the grid are above the hills.
    let numbers = glyphs("[[overlay.grids]]\nkind = 'horizon'\nspacing_deg = 90\n");
    assert!(lies(&numbers, 92.0, 14.0, 8.0) && !lies(&numbers, 92.0, 3.0, 8.0), "{numbers:?}");
    for keys in
        ["[overlay]\ncardinal_points = true", "[[overlay.labels]]\nname = 'N'\nazimuth_deg = 1\naltitude_deg = 2"]
    {
        refused(keys, &["overlay.", "the scene has no observer"]);
    }
}

/// Draws an overlay on a black picture of [`PLACE`]; returns the codes at pairs of azimuth and altitude. The file
/// `quarters.png` has 2 by 2 texels: red and green above blue and white.
fn codes_at(overlay: &str, places: &[[f64; 2]]) -> Vec<[u8; 3]> {
    let folder = tempfile::tempdir().unwrap();
    let quarters = [[255, 0, 0], [0, 255, 0], [0, 0, 255], [255, 255, 255]].concat();
    let file = std::fs::File::create(folder.path().join("quarters.png")).unwrap();
    let mut encoder = png::Encoder::new(file, 2, 2);
    encoder.set_color(png::ColorType::Rgb);
    encoder.write_header().unwrap().write_image_data(&quarters).unwrap();
    let config = Config::from_text(&format!("{PLACE}{overlay}"), "test.toml", folder.path(), &[]).unwrap();
    let camera = config.camera().unwrap();
    let viewports = config.rig().unwrap().viewports(camera.world_from_camera);
    let objects = config.objects().unwrap();
    let inputs =
        OverlayInputs { objects: &objects, camera: &camera, viewports: &viewports, views: &["sky".to_owned()] };
    let plan = OverlayPlanner::default().plan(&inputs).unwrap().unwrap();
    let mapping = viewports[0].projection.mapping();
    let mut codes = vec![0; 4 * 720 * 360];
    let mut target = OverlayTarget {
        size: [720, 360],
        codes: &mut codes,
        contains: &|_, _| true,
        direction: &|x, y| mapping.direction_from_pixel(pixel_centre(x, y)),
        cover: &|_, _| None,
    };
    draw(&mut target, &plan.items, &plan.texels);
    let at = |[azimuth_deg, altitude_deg]: &[f64; 2]| {
        let column = (360.0 + 2.0 * azimuth_deg).rem_euclid(720.0) as usize;
        let index = 4 * (720 * (180.0 - 2.0 * altitude_deg) as usize + column);
        [0, 1, 2].map(|channel| codes[index + channel])
    };
    places.iter().map(at).collect()
}

#[test]
fn pictures_have_their_place_width_and_direction() {
    let [red, green, blue, white, nothing] = [[255, 0, 0], [0, 255, 0], [0, 0, 255], [255, 255, 255], [0, 0, 0]];
    let picture =
        "[[overlay.pictures]]\nname = 'p'\nfile = 'quarters.png'\nwidth_deg = 40\nazimuth_deg = 0\naltitude_deg = 20\n";
    // The centres of the texels are a quarter of the width from the centre of the picture, on a tangent plane.
    let quarter = (0.25 * 2.0 * 20_f64.to_radians().tan()).atan().to_degrees();
    let around = |[x, y]: [f64; 2]| [x / 20_f64.to_radians().cos(), 20.0 + y];
    let places = [[-quarter, quarter], [quarter, quarter], [-quarter, -quarter], [quarter, -quarter]].map(around);
    let near = |found: [u8; 3], expected: [u8; 3]| found.iter().zip(expected).all(|(a, b)| a.abs_diff(b) < 95);
    let check = |overlay: &str, places: &[[f64; 2]], expected: &[[u8; 3]]| {
        let found = codes_at(overlay, places);
        for ((place, found), expected) in places.iter().zip(&found).zip(expected) {
            assert!(near(*found, *expected), "{overlay} {place:?}: {found:?} instead of {expected:?}");
        }
    };
    check(picture, &places, &[red, green, blue, white]);
    // Nothing is drawn outside of the picture and its fading edges.
    check(picture, &[[-32.0, 20.0], [32.0, 20.0], [0.0, 52.0], [0.0, -12.0]], &[nothing; 4]);
    // A roll turns the top to the left. Pictures are drawn on both sides of the seam.
    check(&format!("{picture}roll_deg = 90\n"), &places, &[green, white, red, blue]);
    let south = picture.replace("azimuth_deg = 0", "azimuth_deg = 180");
    check(&south, &places.map(|[azimuth, altitude]| [azimuth + 180.0, altitude]), &[red, green, blue, white]);
    // For a picture in equatorial coordinates, the direction of the north celestial pole is up, and right ascension
    // increases to the left. The pole is in the north at an altitude of 48 degrees.
    let config = Config::from_text(PLACE, "test.toml", Path::new("/sky"), &[]).unwrap();
    let camera = config.camera().unwrap();
    let south = camera.world_from_camera * direction_from_camera(180.0, 40.0);
    let [ra_deg, dec_deg] = [south.y.atan2(south.x), south.z.asin()].map(f64::to_degrees);
    let sky = format!(
        "[[overlay.pictures]]\nname = 'p'\nfile = 'quarters.png'\nwidth_deg = 40\nra_deg = {ra_deg}\ndec_deg = {dec_deg}\n"
    );
    check(&sky, &[[166.0, 49.0], [194.0, 49.0], [168.0, 31.0], [192.0, 31.0]], &[red, green, blue, white]);
    let opaque = codes_at(picture, &places[..1])[0][0];
    let faint = codes_at(&format!("{picture}opacity = 0.25\n"), &places[..1])[0][0];
    // Code 133 has a quarter of the light of code 248.
    assert!(opaque.abs_diff(248) < 4 && faint.abs_diff(133) < 4, "{opaque} {faint}");
    let unread = Config::from_text(&format!("{PLACE}{picture}"), "test.toml", Path::new("/sky"), &[]).unwrap();
    let problem = unread.objects().unwrap_err().to_string();
    assert!(problem.contains("overlay.pictures[0].file") && problem.contains("/sky/quarters.png"), "{problem}");
    refused(&picture.replace("40", "151"), &["overlay.pictures[0].width_deg", "between 0.01 and 150"]);
    refused(&picture.replace("azimuth_deg = 0", "ra_deg = 0"), &["overlay.pictures[0].ra_deg", "exactly one"]);
}

/// Returns a direction in the axes of a level camera that looks north.
fn direction_from_camera(azimuth_deg: f64, altitude_deg: f64) -> DVec3 {
    let [azimuth, altitude] = [azimuth_deg, altitude_deg].map(f64::to_radians);
    DVec3::new(azimuth.sin() * altitude.cos(), altitude.sin(), -azimuth.cos() * altitude.cos())
}

fn refused(text: &str, parts: &[&str]) {
    let message = Config::from_text(text, "test.toml", Path::new("/sky"), &[]).expect_err(text).to_string();
    for part in parts.iter().chain(&["test.toml"]) {
        assert!(message.contains(part), "`{part}` is not in: {message}");
    }
}

#[test]
fn configurations_are_read_as_written_with_defaults() {
    let text = "[[views]]\nname = 'a'\ntype = 'perspective'\nsize = [8, 8]\nfov_y_deg = 60\ntest_pattern = true\n\
        [[views]]\nname = 'b'\ntype = 'equirectangular'\nsize = [8, 4]\n\
        [[overlay.grids]]\nkind = 'galactic'\nspacing_deg = 22.5\ncolour = '#0aFF10'\nwidth_px = 3\nopacity = 0.25\nnumbers = false\n\
        [[overlay.grids]]\nkind = 'altitude'\n\
        [[overlay.trajectories]]\nname = 'way'\npoints_m = [[0, 0, 0], [1e9, 0, 2]]\n\
        [[overlay.labels]]\nname = 'pole'\nra_deg = 0\ndec_deg = 90\n\
        [[overlay.labels]]\nname = 'there'\ntext = 'β Ori'\nposition_m = [1, 2, 3]\nsize_px = 30\n";
    let config = Config::from_text(text, "test.toml", Path::new("/sky"), &[]).unwrap();
    let overlay = config.objects().unwrap().overlay;
    assert_eq!(overlay.test_patterns, ["a"]);
    let style = LineStyle { colour: Colour([10, 255, 16]), width_px: 3.0, opacity: 0.25 };
    assert_eq!(overlay.grids[0], Grid { numbers: false, ..Grid::new(GridKind::Galactic, 4, style) });
    assert_eq!(overlay.grids[1], Grid::new(GridKind::Altitude, 6, Grid::STYLE));
    assert_eq!(overlay.trajectories[0].points_m, [DVec3::ZERO, DVec3::new(1e9, 0.0, 2.0)]);
    assert_eq!(overlay.trajectories[0].style(), Trajectory::STYLE);
    let [pole, there] = &overlay.labels[..] else { panic!("two labels") };
    assert_eq!(pole.text, "pole");
    let Anchor::Direction(direction) = pole.anchor else { panic!("a direction") };
    assert!((direction - DVec3::Z).length() < 1e-12);
    assert_eq!(
        (there.text.as_str(), there.anchor, there.size_px),
        ("β Ori", Anchor::Point(DVec3::new(1.0, 2.0, 3.0)), 30.0)
    );
    let none = Config::from_text("", "test.toml", Path::new("/sky"), &[]).unwrap();
    assert!(none.objects().unwrap().overlay.is_empty());
}

#[test]
fn mistakes_in_configurations_are_refused() {
    let grid = |keys: &str| format!("[[overlay.grids]]\nkind = 'equatorial'\n{keys}");
    let way = |keys: &str| format!("[[overlay.trajectories]]\nname = 'way'\n{keys}");
    let label = |keys: &str| format!("[[overlay.labels]]\nname = 'star'\n{keys}");
    let coordinates = "ra_deg = 1\ndec_deg = 2\n";
    for (text, parts) in [
        ("[overlay]\ngrid = []".to_owned(), &["overlay.grid", "unknown key"][..]),
        (
            "[[overlay.grids]]\nkind = 'polar'".to_owned(),
            &["overlay.grids[0].kind", "equatorial", "galactic", "altitude"],
        ),
        (grid("spacing_deg = 7"), &["overlay.grids[0].spacing_deg: 7: must be between 1 and 90 degrees and divide 90"]),
        (grid("spacing_deg = 91"), &["overlay.grids[0].spacing_deg: 91: must be between 1 and 90"]),
        (
            grid("spacing_deg = 10").replace("equatorial", "constellations"),
            &["overlay.grids[0].spacing_deg: 10: ", "omit"],
        ),
        (grid("spacing_deg = 0.5"), &["overlay.grids[0].spacing_deg", "between 1 and 90"]),
        (grid("spacing_deg = nan"), &["overlay.grids[0].spacing_deg", "finite"]),
        (grid("colour = 'red'"), &["overlay.grids[0].colour", "#rrggbb"]),
        (grid("colour = '#12345+'"), &["overlay.grids[0].colour", "#rrggbb"]),
        (grid("width_px = 0.5"), &["overlay.grids[0].width_px", "between 1 and 32"]),
        (grid("opacity = 1.5"), &["overlay.grids[0].opacity", "between 0 and 1"]),
        (grid("").repeat(9), &["overlay.grids[8]", "at most 8"]),
        (way("points_m = [[0, 0, 0]]"), &["overlay.trajectories[0].points_m", "between 2 and 32768"]),
        (way("points_m = [[0, 0, 0], [inf, 0, 0]]"), &["overlay.trajectories[0].points_m", "[1]"]),
        (way("points_m = [[0, 0, 0], [1, 0, 0]]\n").repeat(2), &["overlay.trajectories[1].name", "unique"]),
        (
            way(&format!("points_m = [{}]", "[0, 0, 0],".repeat(20_000)))
                + "\n"
                + &way(&format!("points_m = [{}]", "[0, 0, 0],".repeat(20_000))).replace("'way'", "'other'"),
            &["overlay.trajectories[1].points_m", "40000 points", "32768"],
        ),
        (label(""), &["overlay.labels[0].position_m", "exactly one"]),
        (label(&format!("{coordinates}position_m = [0, 0, 0]")), &["overlay.labels[0].position_m", "exactly one"]),
        (label("ra_deg = 1"), &["overlay.labels[0].position_m", "exactly one"]),
        (label("ra_deg = 1\ndec_deg = 91"), &["overlay.labels[0].dec_deg", "between -90 and 90"]),
        (label(&format!("{coordinates}text = ''")), &["overlay.labels[0].text", "between 1 and 64"]),
        (label(&format!("{coordinates}text = '{}'", "x".repeat(65))), &["overlay.labels[0].text", "65 characters"]),
        (label(&format!("{coordinates}text = '漢'")), &["overlay.labels[0].text", "漢"]),
        (label(&format!("{coordinates}size_px = 5")), &["overlay.labels[0].size_px", "between 6 and 200"]),
        (
            "[[views]]\nname = 'a'\ntype = 'equirectangular'\nsize = [8, 4]\ntest_pattern = 'yes'".to_owned(),
            &["views[0].test_pattern", "true or false"],
        ),
    ] {
        refused(&text, parts);
    }
}
