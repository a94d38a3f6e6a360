//! Fields of asteroids drawn by the whole renderer: light, statistics, and equal pictures with culling on the CPU and
//! on the GPU.

use std::sync::Arc;

use crate::common::{render_hdr, renderer, rig, settings, snapshot};
use glam::{DQuat, DVec3};
use steradian::{
    plan::settings::{Culling, ImpostorMethod, RenderSettings, StarMethod},
    scene::{
        Camera, SceneObjects, SceneSnapshot,
        asteroids::{AsteroidField, FieldParameters, Instances, Placement, ShapeSet},
        bodies::{Body, Emission, ReflectionLaw, Spin, Surface},
    },
    view::{ViewKind, projection::FisheyeMapping},
};

/// Returns a scene with a box of asteroids around the camera, and a distant sun.
pub(super) fn scene(instances: u32, half_m: f64, radius_m: [f64; 2]) -> SceneSnapshot {
    let shapes = Arc::new(ShapeSet::procedural(4));
    let parameters = FieldParameters {
        instances,
        seed: 5,
        placement: Placement::Box { size_m: DVec3::splat(2.0 * half_m) },
        radius_m,
        size_index: 2.0,
        spin_period_s: [1e4, 1e5],
    };
    let placed = Instances::place(&parameters, shapes.shapes.len(), &shapes.bounds()).unwrap();
    let position_m = DVec3::new(1.5e11, 2e10, -3e9);
    let field = AsteroidField {
        name: "field".to_owned(),
        position_m,
        orientation: DQuat::from_rotation_x(0.4),
        law: ReflectionLaw::LommelSeeliger,
        geometric_albedo: [0.2, 0.15, 0.1],
        instances: Arc::new(placed),
        shapes,
    };
    let sun = Body {
        name: "sun".to_owned(),
        ephemeris: None,
        position_m: DVec3::ZERO,
        radii_m: DVec3::splat(6.96e8),
        orientation: DQuat::IDENTITY,
        spin: Spin::default(),
        surface: Surface { law: ReflectionLaw::Lambert, geometric_albedo: [0.0; 3], phase_curve: None, texture: None },
        emission: Some(Emission { luminance_cd_m2: [1.9e9, 1.9e9, 1.9e9], limb_darkening: 0.6, corona: false }),
        seen_through: [1.0; 3],
    };
    let objects =
        SceneObjects { bodies: vec![Arc::new(sun)], fields: vec![Arc::new(field)], time_s: 1e7, ..Default::default() };
    SceneSnapshot {
        objects: Arc::new(objects),
        camera: Camera { position_m, ..Camera::default() },
        ..snapshot(Vec::new())
    }
}

fn views() -> Vec<(&'static str, ViewKind)> {
    vec![
        ("flat", ViewKind::Perspective { size: [160, 120], fov_y_rad: 1.2 }),
        ("dome", ViewKind::Fisheye { size: [128, 128], mapping: FisheyeMapping::Equidistant, fov_rad: 3.1 }),
        ("sphere", ViewKind::Equirectangular { size: [192, 96] }),
    ]
}

pub(super) fn settings_with(impostor: ImpostorMethod, culling: Culling) -> RenderSettings {
    let mut settings = settings(StarMethod::BSpline);
    settings.asteroids.impostor = impostor;
    settings.asteroids.culling = culling;
    settings
}

#[test]
fn statistics_add_up_and_every_drawing_method_is_used() {
    let mut renderer = renderer();
    let scene = scene(3001, 2e3, [2.0, 40.0]);
    let rig = rig(views());
    let frame = render_hdr(&mut renderer, &scene, &rig, &settings_with(ImpostorMethod::Auto, Culling::Gpu));
    for view in &frame.views {
        let counts = &view.asteroids;
        println!("{}: {counts:?}", view.name);
        let drawn = counts.meshes.iter().sum::<u64>() + counts.impostors + counts.points;
        // An asteroid is counted more than once only if it is blended between two levels, or drawn on several faces.
        let sum = drawn + counts.unresolved + counts.culled;
        assert!((3001..3001 + drawn).contains(&sum) && drawn > 0, "{counts:?}");
    }
    // The view of the whole sphere contains all asteroids. The flat view, whose pixels are finest, uses every drawing
    // method.
    assert_eq!(frame.views[2].asteroids.culled, 0);
    let flat = &frame.views[0].asteroids;
    assert!(flat.points > 0 && flat.impostors > 0 && flat.meshes.iter().sum::<u64>() > 0, "{flat:?}");
}

#[test]
fn counts_of_only_meshes_or_only_points_are_exact() {
    let mut renderer = renderer();
    let scene = scene(3001, 2e3, [2.0, 40.0]);
    let flat = rig(vec![("flat", ViewKind::Perspective { size: [160, 120], fov_y_rad: 1.2 })]);
    let mut settings = settings_with(ImpostorMethod::None, Culling::Gpu);
    settings.asteroids.finest_only = true;
    let counts = render_hdr(&mut renderer, &scene, &flat, &settings).views[0].asteroids.clone();
    assert_eq!(counts.meshes[0] + counts.culled, 3001, "{counts:?}");
    assert!(counts.meshes[0] > 100 && counts.culled > 100 && counts.meshes[1..].iter().all(|count| *count == 0));
    // Look from a distance at which every asteroid is a point.
    let mut far = scene.clone();
    far.camera.position_m += DVec3::new(0.0, 0.0, 1.2e5);
    settings.asteroids.finest_only = false;
    let narrow = rig(vec![("narrow", ViewKind::Perspective { size: [160, 120], fov_y_rad: 0.02 })]);
    settings.asteroids.quality = 0.05;
    let counts = render_hdr(&mut renderer, &far, &narrow, &settings).views[0].asteroids.clone();
    assert_eq!(counts.points + counts.unresolved + counts.culled, 3001, "{counts:?}");
    assert!(counts.points > 100 && counts.culled > 100, "{counts:?}");
}

#[test]
fn culling_on_cpu_and_gpu_gives_the_same_picture() {
    assert_culling_gives_the_same_picture(&[ImpostorMethod::Auto]);
}

#[test]
#[ignore = "long: make test-all"]
fn culling_on_cpu_and_gpu_gives_the_same_picture_for_every_impostor() {
    assert_culling_gives_the_same_picture(&[ImpostorMethod::Auto, ImpostorMethod::None, ImpostorMethod::Octahedral]);
}

fn assert_culling_gives_the_same_picture(methods: &[ImpostorMethod]) {
    let mut renderer = renderer();
    let scene = scene(1501, 1e3, [2.0, 40.0]);
    let rig = rig(views());
    for &method in methods {
        let [first, second] = [Culling::Gpu, Culling::Cpu]
            .map(|culling| render_hdr(&mut renderer, &scene, &rig, &settings_with(method, culling)));
        let again = render_hdr(&mut renderer, &scene, &rig, &settings_with(method, Culling::Gpu));
        for ((one, two), same) in first.images.iter().zip(&second.images).zip(&again.images) {
            assert_eq!(one.hdr, same.hdr, "the same frame drawn twice");
            let pairs = || one.hdr.as_ref().unwrap().iter().zip(two.hdr.as_ref().unwrap());
            let light: f64 = pairs().map(|(a, _)| f64::from(a[1] * a[3])).sum();
            let differing: f64 = pairs().map(|(a, b)| f64::from((a[1] - b[1]).abs() * a[3])).sum();
            assert!(light > 0.0 && differing < 2e-3 * light, "{method:?}, view {}: {differing} of {light}", one.view);
        }
    }
}
