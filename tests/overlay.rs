//! Overlays: their plan in f64, and what the twin draws of it.
#![allow(clippy::unwrap_used, reason = "a failed expectation of a test's own helpers is a failed test")]

use std::{f64::consts::PI, path::Path, sync::Arc};

use glam::{DQuat, DVec2, DVec3};
use steradian::{
    config::Config,
    plan::overlay::{OverlayInputs, OverlayPlan, OverlayPlanner, Shape, arc::Arc as SkyArc, trace::Tracer},
    reference::overlay::draw::{OverlayTarget, draw},
    scene::{Camera, SceneObjects, overlay::*},
    view::{
        Rig, View, ViewKind,
        projection::{CubeFace, Equirectangular, Face, Fisheye, FisheyeMapping, Perspective, Projection},
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

/// Circles of many sizes in many places, some through poles, axes and antipodes.
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

/// Points of a curve a twentieth of a pixel apart, wherever it is near the picture and does not jump.
fn sample_densely(
    at: &dyn Fn(f64) -> Option<DVec2>,
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
        let pixel = at(middle);
        sample_densely(at, [a, middle], [Some(start), pixel], depth - 1, curve);
        sample_densely(at, [middle, b], [pixel, Some(end)], depth - 1, curve);
    }
}

/// Farthest that a point of the pieces is from the curve, and a point of the curve inside of the picture from the pieces; pixels.
fn errors_px(projection: &Projection, arc: &SkyArc, pieces: &[[DVec2; 2]]) -> [f64; 2] {
    let mapping = projection.mapping();
    let [width, height] = mapping.size().map(f64::from);
    let steps = 20_000;
    let [from, to] = arc.angles;
    // Of round pictures the corners are outside.
    let inside = |pixel: &DVec2| {
        let in_image = pixel.x >= 0.0 && pixel.x <= width && pixel.y >= 0.0 && pixel.y <= height;
        in_image && mapping.direction_from_pixel(*pixel).is_some()
    };
    let at = |angle: f64| mapping.pixel_from_direction(arc.direction(angle));
    let mut curve: Vec<DVec2> = Vec::new();
    for step in 0..steps {
        let angles = [step, step + 1].map(|step| from + (to - from) * f64::from(step) / f64::from(steps));
        sample_densely(&at, angles, angles.map(at), 30, &mut curve);
    }
    // By cells, so that only what is near is compared.
    let cell = |pixel: DVec2| [(pixel.x / 8.0).floor() as i64, (pixel.y / 8.0).floor() as i64];
    let mut cells: std::collections::HashMap<[i64; 2], Vec<DVec2>> = std::collections::HashMap::new();
    // An equirectangular image goes on at its sides.
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
            let mut tracer = Tracer::new(&projection, 3.0, &identity, true);
            let pieces: Vec<[DVec2; 2]> = tracer.trace(&arc).into_iter().map(|piece| piece.ends).collect();
            count += pieces.len();
            let errors = errors_px(&projection, &arc, &pieces);
            worst = [worst[0].max(errors[0]), worst[1].max(errors[1])];
        }
        println!("{name}: {worst:?} px, {count} pieces");
        assert!(worst[0] < 0.1 && worst[1] < 0.1, "{name}: {worst:?}");
    }
}

fn picture(plan: &OverlayPlan, viewport: usize, projection: &Projection) -> Vec<u8> {
    let [width, height] = projection.mapping().size();
    let mut codes: Vec<u8> = [0, 0, 0, 255].repeat((width * height) as usize);
    let contains = |x, y| projection.mapping().contains(x, y);
    let mut target =
        OverlayTarget { size: [width, height], codes: &mut codes, contains: &contains, cover: &|_, _| None };
    draw(&mut target, plan.items_of(viewport), &plan.texels);
    codes
}

#[test]
fn pictures() {
    let grid = |kind, colour| Grid {
        kind,
        divisions: 6,
        numbers: true,
        style: LineStyle { colour: Colour(colour), ..Grid::STYLE },
    };
    let label = |name: &str, ra: f64, dec: f64| Label {
        name: name.to_owned(),
        text: name.to_owned(),
        anchor: Anchor::Direction(steradian::coordinates::direction_from_lon_lat(ra.to_radians(), dec.to_radians())),
        colour: Label::COLOUR,
        size_px: 16.0,
        opacity: 1.0,
    };
    let points_m = (0..200)
        .map(|i| f64::from(i) * 0.05)
        .map(|t| DVec3::new(t.cos() * 2.0, t.sin() * 2.0, t * 0.5 - 2.0))
        .collect();
    let overlay = Overlay {
        grids: vec![grid(GridKind::Equatorial, [79, 127, 191]), grid(GridKind::Altitude, [160, 90, 90])],
        trajectories: vec![Trajectory { name: "spiral".into(), points_m, style: Trajectory::STYLE }],
        labels: vec![label("Sirius", 101.3, -16.7), label("Betelgeuse", 88.8, 7.4), label("Vega", 279.2, 38.8)],
        test_patterns: std::env::var("PATTERN")
            .is_ok()
            .then(|| vec!["dome".into(), "cube".into(), "flat".into(), "sphere".into()])
            .unwrap_or_default(),
    };
    let views: Vec<(&str, ViewKind)> = vec![
        ("dome", ViewKind::DomeMaster { size: 1024, fov_rad: PI, tilt_rad: 0.0 }),
        ("flat", ViewKind::Perspective { size: [1024, 768], fov_y_rad: 1.2 }),
        ("cube", ViewKind::Cubemap { face_size: 512, faces: Face::ALL.to_vec() }),
        ("sphere", ViewKind::Equirectangular { size: [1600, 800] }),
    ];
    let rig = Rig::new(
        views.into_iter().map(|(name, kind)| View::new(name, kind, DQuat::IDENTITY, DVec3::ZERO).unwrap()).collect(),
    )
    .unwrap();
    let camera =
        Camera { world_from_camera: DQuat::from_euler(glam::EulerRot::XYZ, 1.2, 0.4, 0.2), ..Camera::default() };
    let objects = SceneObjects { overlay: Arc::new(overlay), ..SceneObjects::default() };
    let viewports = rig.viewports(camera.world_from_camera);
    let names: Vec<String> = rig.views().iter().map(|view| view.name.clone()).collect();
    let inputs = OverlayInputs { objects: &objects, camera: &camera, viewports: &viewports, views: &names };
    let mut planner = OverlayPlanner::default();
    let start = std::time::Instant::now();
    planner.plan(&inputs).unwrap().unwrap();
    planner = OverlayPlanner::default();
    println!("first plan {:?}", start.elapsed());
    let start = std::time::Instant::now();
    let plan = planner.plan(&inputs).unwrap().unwrap();
    println!(
        "plan {:?}: {} items, {} blocks, {} entries, {} texels",
        start.elapsed(),
        plan.items.len(),
        plan.blocks.len(),
        plan.entries.len(),
        plan.texels.len()
    );
    let lines = plan.items.iter().filter(|item| matches!(item.shape, Shape::Line { .. })).count();
    println!("{lines} lines");
    for (index, viewport) in viewports.iter().enumerate() {
        let [width, height] = viewport.size();
        let codes = picture(&plan, index, &viewport.projection);
        let file = std::fs::File::create(format!(
            "/tmp/ov/{}{}.png",
            names[viewport.view],
            viewport.part.name().unwrap_or("")
        ))
        .unwrap();
        let mut encoder = png::Encoder::new(std::io::BufWriter::new(file), width, height);
        encoder.set_color(png::ColorType::Rgba);
        encoder.write_header().unwrap().write_image_data(&codes).unwrap();
    }
}

fn refused(text: &str, parts: &[&str]) {
    let message = Config::from_text(text, "test.toml", Path::new("/sky"), &[]).expect_err(text).to_string();
    for part in parts.iter().chain(&["test.toml"]) {
        assert!(message.contains(part), "`{part}` is not in: {message}");
    }
}

#[test]
fn configurations_are_read_as_written_and_filled_in() {
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
    assert_eq!(overlay.grids[0], Grid { kind: GridKind::Galactic, divisions: 4, numbers: false, style });
    assert_eq!(overlay.grids[1], Grid { kind: GridKind::Altitude, divisions: 6, numbers: true, style: Grid::STYLE });
    assert_eq!(overlay.trajectories[0].points_m, [DVec3::ZERO, DVec3::new(1e9, 0.0, 2.0)]);
    assert_eq!(overlay.trajectories[0].style, Trajectory::STYLE);
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
    let at = "ra_deg = 1\ndec_deg = 2\n";
    for (text, parts) in [
        ("[overlay]\ngrid = []".to_owned(), &["overlay.grid", "unknown key"][..]),
        (
            "[[overlay.grids]]\nkind = 'ecliptic'".to_owned(),
            &["overlay.grids[0].kind", "equatorial, galactic, altitude"],
        ),
        (grid("spacing_deg = 7"), &["overlay.grids[0].spacing_deg", "1 to 90"]),
        (grid("spacing_deg = 0.5"), &["overlay.grids[0].spacing_deg", "1 to 90"]),
        (grid("spacing_deg = nan"), &["overlay.grids[0].spacing_deg", "finite"]),
        (grid("colour = 'red'"), &["overlay.grids[0].colour", "#rrggbb"]),
        (grid("colour = '#12345+'"), &["overlay.grids[0].colour", "#rrggbb"]),
        (grid("width_px = 0.5"), &["overlay.grids[0].width_px", "1 to 32"]),
        (grid("opacity = 1.5"), &["overlay.grids[0].opacity", "0 to 1"]),
        (grid("").repeat(9), &["overlay.grids[8]", "allowed are 8"]),
        (way("points_m = [[0, 0, 0]]"), &["overlay.trajectories[0].points_m", "2 to 32768"]),
        (way("points_m = [[0, 0, 0], [inf, 0, 0]]"), &["overlay.trajectories[0].points_m", "[1]"]),
        (way("points_m = [[0, 0, 0], [1, 0, 0]]\n").repeat(2), &["overlay.trajectories[1].name", "unique"]),
        (
            way(&format!("points_m = [{}]", "[0, 0, 0],".repeat(20_000)))
                + "\n"
                + &way(&format!("points_m = [{}]", "[0, 0, 0],".repeat(20_000))).replace("'way'", "'other'"),
            &["overlay.trajectories[1].points_m", "40000 points", "32768"],
        ),
        (label(""), &["overlay.labels[0].position_m", "exactly one"]),
        (label(&format!("{at}position_m = [0, 0, 0]")), &["overlay.labels[0].position_m", "exactly one"]),
        (label("ra_deg = 1"), &["overlay.labels[0].position_m", "exactly one"]),
        (label("ra_deg = 1\ndec_deg = 91"), &["overlay.labels[0].dec_deg", "-90 to 90"]),
        (label(&format!("{at}text = ''")), &["overlay.labels[0].text", "1 to 64"]),
        (label(&format!("{at}text = '{}'", "x".repeat(65))), &["overlay.labels[0].text", "65 characters"]),
        (label(&format!("{at}text = '漢'")), &["overlay.labels[0].text", "漢"]),
        (label(&format!("{at}size_px = 5")), &["overlay.labels[0].size_px", "6 to 200"]),
        (
            "[[views]]\nname = 'a'\ntype = 'equirectangular'\nsize = [8, 4]\ntest_pattern = 'yes'".to_owned(),
            &["views[0].test_pattern", "boolean"],
        ),
    ] {
        refused(&text, parts);
    }
}
