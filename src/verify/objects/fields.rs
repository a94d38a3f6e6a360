//! The light of asteroid fields, drawn as meshes, impostors and points: in every projection, across the seams of
//! projections, and with occlusion.

use std::sync::{Arc, OnceLock};

use glam::{DQuat, DVec3};

use super::{
    super::{
        Figure,
        context::{CheckError, Context, worst},
        scenes::{cube, fisheye, rig, star},
    },
    stage::{
        ALBEDO, Detail, Fault, Light, Posed, all_shapes, black, light_around_lx, scene, scene_of, silhouette, sun,
        window,
    },
};
use crate::{
    catalogue::chunks::StarSet,
    plan::settings::AsteroidSettings,
    scene::{
        SceneObjects, SceneSnapshot,
        asteroids::{AsteroidField, FieldParameters, Instances, Placement},
        bodies::{Body, ReflectionLaw},
    },
    view::{Rig, View, ViewKind, projection::FisheyeMapping},
};

/// Distance of the fields, m.
const DISTANCE_M: f64 = 1000.0;
/// Phase angle of the illumination, rad.
const PHASE_RAD: f64 = 0.7;

/// Returns asteroids in a box with a given side, m.
fn instances(count: u32, side_m: f64, radius_m: [f64; 2]) -> Result<Arc<Instances>, CheckError> {
    let parameters = FieldParameters {
        instances: count,
        seed: 11,
        placement: Placement::Box { size_m: DVec3::splat(side_m) },
        radius_m,
        size_index: 1.0,
        spin_period_s: [1e4, 1e5],
    };
    let shapes = all_shapes();
    let placed = Instances::place(&parameters, shapes.shapes.len(), &shapes.bounds());
    placed.map(Arc::new).map_err(|_| CheckError::Missing("the instances of a field"))
}

fn small() -> Result<Arc<Instances>, CheckError> {
    static SMALL: OnceLock<Arc<Instances>> = OnceLock::new();
    if let Some(known) = SMALL.get() {
        return Ok(known.clone());
    }
    // The asteroids cover a hundredth of their box, so that they rarely hide each other. This matters because points do not hide anything.
    let made = instances(12, 200.0, [2.0, 6.0])?;
    Ok(SMALL.get_or_init(|| made).clone())
}

fn large() -> Result<Arc<Instances>, CheckError> {
    static LARGE: OnceLock<Arc<Instances>> = OnceLock::new();
    if let Some(known) = LARGE.get() {
        return Ok(known.clone());
    }
    let made = instances(12, 500.0, [25.0, 60.0])?;
    Ok(LARGE.get_or_init(|| made).clone())
}

/// Returns a field in a direction, lit at a phase angle.
fn lit(instances: Arc<Instances>, direction: DVec3, phase_rad: f64, fault: Fault, bodies: Vec<Body>) -> SceneSnapshot {
    let direction = direction.normalize();
    let to_sun = DQuat::from_axis_angle(direction.any_orthonormal_vector(), phase_rad) * -direction;
    let field = AsteroidField {
        name: "field".to_owned(),
        position_m: direction * DISTANCE_M + DVec3::X * fault.shift,
        orientation: DQuat::from_rotation_x(0.4),
        law: ReflectionLaw::LommelSeeliger,
        geometric_albedo: [ALBEDO * fault.albedo; 3],
        instances,
        shapes: all_shapes(),
    };
    scene_of(bodies.into_iter().chain([sun(to_sun)]).collect(), vec![field])
}

/// Measures the light of every view around the field in a direction, lx, with other settings of asteroids.
fn light_lx(
    context: &mut Context<'_>,
    scene: &SceneSnapshot,
    rig: &Rig,
    direction: DVec3,
    settings: AsteroidSettings,
) -> Result<Vec<f64>, CheckError> {
    let kept = std::mem::replace(&mut context.settings.asteroids, settings);
    let frame = context.render(scene, rig);
    context.settings.asteroids = kept;
    // Exclude the light of the sun, which is on the opposite side.
    light_around_lx(&frame?, rig, direction, 0.6)
}

/// Measures one field in windows with increasingly coarse pixels, so that meshes are replaced by impostors and points,
/// and in every projection.
pub(in crate::verify) fn light(context: &mut Context<'_>) -> Result<Vec<Figure>, CheckError> {
    const WINDOWS: [(&str, f64); 5] =
        [("fine", 3e-4), ("medium", 8e-4), ("coarse", 2e-3), ("points", 6e-3), ("far", 3e-2)];
    let windows = WINDOWS.map(|(name, pixel_rad)| (name, window((0.3 / pixel_rad).ceil() as u32, pixel_rad, 0.0)));
    let finest = context.finest();
    // Use many samples, so that sampling errors at edges matter as little as possible.
    let settings = AsteroidSettings { samples: 4, ..context.settings.asteroids.clone() };
    let truth_rig = rig([windows[0].clone()])?;
    let ahead: Vec<(&str, ViewKind)> = vec![
        ("cube", cube(256)),
        ("equidistant", fisheye(256, FisheyeMapping::Equidistant, 170.0)),
        ("stereographic", fisheye(256, FisheyeMapping::Stereographic, 170.0)),
        ("equirectangular", ViewKind::Equirectangular { size: [512, 256] }),
    ];
    let kinds: Vec<(&str, ViewKind)> = windows.into_iter().chain(ahead).collect();
    let names: Vec<&str> = kinds.iter().map(|(name, _)| *name).collect();
    let rig = rig(kinds)?;
    let mut figures = Vec::new();
    // At full phase, the whole outline is equally bright, so a point has exactly the light of its outline. At other
    // phases, a point shines like a sphere. Single shapes differ from a sphere by some tenths, and the mean of twelve
    // shapes differs by some per cent.
    for (phase, phase_rad, limit) in [("full phase", 1e-3, 0.02), ("40 deg phase", PHASE_RAD, 0.05)] {
        let truth_scene = lit(small()?, DVec3::NEG_Z, phase_rad, context.object_fault, Vec::new());
        let truth_lx = light_lx(context, &truth_scene, &truth_rig, DVec3::NEG_Z, finest.clone())?[0];
        let scene = lit(small()?, DVec3::NEG_Z, phase_rad, Fault::NONE, Vec::new());
        let light = light_lx(context, &scene, &rig, DVec3::NEG_Z, settings.clone())?;
        figures.extend(names.iter().zip(light).map(|(name, light)| {
            let error = (light / truth_lx - 1.0).abs();
            Figure::at_most(format!("error of light, {phase}, {name}"), error, limit, "relative")
        }));
    }
    Ok(figures)
}

/// Measures large asteroids across the edges and corners of a cube, the date line and a pole of an equirectangular
/// picture, and the rims of two round pictures back to back.
pub(in crate::verify) fn seams(context: &mut Context<'_>) -> Result<Vec<Figure>, CheckError> {
    let places = [
        ("edge", DVec3::new(1.0, 0.1, -1.0)),
        ("corner", DVec3::new(1.0, 1.0, -1.0)),
        ("date line", DVec3::new(0.0, 0.2, 1.0)),
        ("pole", DVec3::new(0.05, 1.0, 0.02)),
        ("rim", DVec3::new(1.0, 0.0, 0.0)),
    ];
    let kinds = || -> [(&'static str, ViewKind, DQuat); 4] {
        let half = || fisheye(256, FisheyeMapping::Equidistant, 180.0);
        [
            ("cube", cube(128), DQuat::IDENTITY),
            ("equirectangular", ViewKind::Equirectangular { size: [512, 256] }, DQuat::IDENTITY),
            ("dome", half(), DQuat::IDENTITY),
            ("dome-back", half(), DQuat::from_rotation_y(std::f64::consts::PI)),
        ]
    };
    let views = kinds().map(|(name, kind, orientation)| View::new(name, kind, orientation, DVec3::ZERO));
    let rig_of_all = Rig::new(views.into_iter().collect::<Result<_, _>>()?)?;
    let finest = context.finest();
    // Use many samples, because sampling errors at edges must not matter.
    let settings = AsteroidSettings { samples: 4, ..context.settings.asteroids.clone() };
    let mut figures = Vec::new();
    for (name, direction) in places {
        let direction = direction.normalize();
        let look = DQuat::from_rotation_arc(DVec3::NEG_Z, direction);
        let flat = View::new("flat", window(320, 3e-3, 0.0), look, DVec3::ZERO)?;
        let truth_scene = lit(large()?, direction, PHASE_RAD, context.object_fault, Vec::new());
        let truth_lx = light_lx(context, &truth_scene, &Rig::new(vec![flat])?, direction, finest.clone())?[0];
        let scene = lit(large()?, direction, PHASE_RAD, Fault::NONE, Vec::new());
        let light_of_views = light_lx(context, &scene, &rig_of_all, direction, settings.clone())?;
        for (kind, light) in [
            ("cube", light_of_views[0]),
            ("equirectangular", light_of_views[1]),
            ("two domes", light_of_views[2] + light_of_views[3]),
        ] {
            let error = (light / truth_lx - 1.0).abs();
            // The rim of a round picture is a staircase: a pixel belongs to the picture if its centre does.
            let on_rim = kind == "two domes" && direction.z.abs() < 0.5;
            let limit = if on_rim { 0.04 } else { 0.02 };
            figures.push(Figure::at_most(
                format!("error of light across the {name}, {kind}"),
                error,
                limit,
                "relative",
            ));
        }
    }
    Ok(figures)
}

/// Measures asteroids in front of and behind a body, and stars behind an asteroid: as meshes, impostors and points.
pub(in crate::verify) fn occlusion(context: &mut Context<'_>) -> Result<Vec<Figure>, CheckError> {
    let kinds = || {
        let pixels = [("fine-asteroids", 1e-3), ("coarse-asteroids", 2e-3), ("points", 8e-3)];
        pixels.map(|(name, pixel_rad)| (name, window((0.3 / pixel_rad) as u32, pixel_rad, 0.0)))
    };
    let rig_of_windows = rig(kinds())?;
    let open_lx =
        context.light_lx(&lit(small()?, DVec3::NEG_Z, PHASE_RAD, Fault::NONE, Vec::new()), &rig_of_windows)?;
    // A body in front of the asteroids covers all of them. A body behind them covers none.
    let radius = context.object_fault.radius;
    let body = |distance_m: f64, radius_m: f64| black("body", DVec3::NEG_Z * distance_m, DVec3::splat(radius_m));
    let before = lit(small()?, DVec3::NEG_Z, PHASE_RAD, Fault::NONE, vec![body(700.0, 160.0 / radius)]);
    let behind = lit(small()?, DVec3::NEG_Z, PHASE_RAD, Fault::NONE, vec![body(3000.0, 1000.0)]);
    let [before, behind] = [context.light_lx(&before, &rig_of_windows)?, context.light_lx(&behind, &rig_of_windows)?];
    let share = |light: &[f64]| light.iter().zip(&open_lx).map(|(light, open)| light / open).collect::<Vec<_>>();
    let mut figures = vec![Figure::at_most("light of asteroids behind a body", worst(share(&before)), 1e-3, "of all")];
    for ((name, _), share) in kinds().into_iter().zip(share(&behind)) {
        let change = (share - 1.0).abs();
        figures.push(Figure::at_most(
            format!("change in the light of {name} in front of a body"),
            change,
            0.01,
            "relative",
        ));
    }

    // Draw a grid of stars behind one asteroid: as a mesh, and at the distance where only its impostor is drawn.
    let single = rig([("window", window(96, 2e-3, 0.0))])?;
    let image = &single.views()[0].images[0];
    let detail = Detail::new(&context.settings.asteroids, &image.projection, DVec3::NEG_Z, 0.0);
    for (name, distance_m) in [("a mesh", 0.6 * detail.nearest_m()), ("an impostor", detail.nearest_m())] {
        let pose = Posed { place_m: DVec3::NEG_Z * distance_m, camera_from_shape: DQuat::from_rotation_x(1.0) };
        let kept = context.settings.asteroids.clone();
        context.settings.asteroids.samples = 4;
        let wall = context.render(&scene(&[pose], Light::Wall, context.object_fault), &single);
        context.settings.asteroids = kept;
        let covered = silhouette(&wall?.images[0], image, DVec3::NEG_Z, 1.0)?;
        let mapping = image.projection.mapping();
        let along = |index: i32| f64::from(index) * 0.7e-3 + 1.1e-4;
        let directions = (-100..100).flat_map(|y| (-100..100).map(move |x| DVec3::new(along(x), along(y), -1.0)));
        let (mut hidden, mut all) = (0.0, 0.0);
        let mut records = Vec::new();
        for direction in directions {
            let pixel = mapping.pixel_from_direction(direction).ok_or(CheckError::Missing("a pixel"))?;
            let index = pixel.y as usize * 96 + pixel.x as usize;
            let omega = mapping.solid_angle_sr(pixel.x as u32, pixel.y as u32);
            hidden += covered[index] / omega;
            all += 1.0;
            records.push(star(direction, 6.0));
        }
        let stars = Arc::new(StarSet::from_records(records));
        let dark = SceneSnapshot { stars: stars.clone(), ..scene(&[pose], Light::Wall, Fault::NONE) };
        let fields = dark.objects.fields.clone();
        let only = |fields| SceneObjects { bodies: Vec::new(), fields, time_s: 0.0, ..Default::default() };
        let with = SceneSnapshot { objects: Arc::new(only(fields)), ..dark.clone() };
        let without = SceneSnapshot { objects: Arc::new(only(Vec::new())), ..dark };
        let [with, without] = [context.light_lx(&with, &single)?[0], context.light_lx(&without, &single)?[0]];
        let lost = (1.0 - with / without) * all;
        let error = (lost / hidden - 1.0).abs();
        figures.push(Figure::at_most(format!("light of the stars behind {name}"), error, 0.03, "relative"));
    }
    Ok(figures)
}
