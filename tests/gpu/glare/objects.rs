//! Glare of bodies and asteroids: it conserves light, and the points from which the glare of a disc is computed are not
//! visible on the disc.

use std::sync::Arc;

use crate::common::*;
use glam::{DQuat, DVec3};
use steradian::{
    photometry::rec709::luminance,
    plan::settings::{GlareMethod, GlareSettings, RenderSettings, StarMethod},
    scene::{
        SceneObjects, SceneSnapshot,
        asteroids::{AsteroidField, FieldParameters, Instances, Placement, ShapeSet},
        bodies::{Body, Emission, ReflectionLaw, SolarBody},
    },
    view::{Rig, ViewKind},
};

const AU_M: f64 = 1.495_978_707e11;

fn whole_sky() -> Rig {
    rig(vec![("sky", ViewKind::Equirectangular { size: [512, 256] })])
}

fn with_glare(fraction: f64) -> RenderSettings {
    let glare = GlareSettings { method: GlareMethod::SkyCube, fraction, ..GlareSettings::default() };
    RenderSettings { glare, ..settings(StarMethod::Auto) }
}

fn scene(objects: SceneObjects) -> SceneSnapshot {
    SceneSnapshot { objects: Arc::new(objects), ..snapshot(Vec::new()) }
}

fn bodies(bodies: Vec<Body>) -> SceneSnapshot {
    scene(SceneObjects { bodies: bodies.into_iter().map(Arc::new).collect(), ..Default::default() })
}

/// Returns a scene with a sun 60 degrees wide that is darker towards its limb.
fn wide_sun() -> SceneSnapshot {
    let mut sun = Body::preset(SolarBody::Sun, "sun", DVec3::new(0.3, 0.2, -2.0) * 1e9);
    sun.radii_m = DVec3::new(1.1e9, 1e9, 0.9e9);
    sun.emission = Some(Emission { luminance_cd_m2: [1e6, 9e5, 8e5], limb_darkening: 0.5, corona: false });
    bodies(vec![sun])
}

/// Returns a scene with a swarm of asteroids 40 degrees wide. Each asteroid is at most a few pixels in size.
fn swarm() -> SceneSnapshot {
    let shapes = Arc::new(ShapeSet::procedural(1));
    let parameters = FieldParameters {
        instances: 3000,
        seed: 2,
        placement: Placement::Box { size_m: DVec3::splat(7e6) },
        radius_m: [1e4, 6e4],
        size_index: 1.0,
        spin_period_s: [1e4, 1e5],
    };
    let instances = Instances::place(&parameters, shapes.shapes.len(), &shapes.bounds()).unwrap();
    let field = AsteroidField {
        name: "swarm".to_owned(),
        position_m: DVec3::new(AU_M, 0.0, -1e7),
        orientation: DQuat::IDENTITY,
        law: ReflectionLaw::Lambert,
        geometric_albedo: [0.3; 3],
        instances: Arc::new(instances),
        shapes,
    };
    let sun = Body::preset(SolarBody::Sun, "sun", DVec3::ZERO);
    let objects =
        SceneObjects { bodies: vec![Arc::new(sun)], fields: vec![Arc::new(field)], time_s: 0.0, ..Default::default() };
    let mut scene = scene(objects);
    scene.camera.position_m = DVec3::new(AU_M, 0.0, 0.0);
    scene
}

/// The light of the whole sky does not change with glare, for any scattered fraction.
#[test]
fn glare_of_bodies_and_asteroids_conserves_light() {
    let mut renderer = renderer();
    let rig = whole_sky();
    let mut light = |scene: &SceneSnapshot, settings: &RenderSettings| {
        total_illuminance_lx(&render_hdr(&mut renderer, scene, &rig, settings), &rig)
    };
    let dim = |scene: &SceneSnapshot| {
        // The sun of the swarm would outshine the asteroids, so it is dimmed to a thousandth and moved away.
        let mut objects = (*scene.objects).clone();
        if objects.fields.is_empty() {
            return scene.clone();
        }
        let mut sun = (*objects.bodies[0]).clone();
        sun.position_m = DVec3::new(AU_M, 1e13, 0.0);
        sun.emission = sun
            .emission
            .map(|emission| Emission { luminance_cd_m2: emission.luminance_cd_m2.map(|l| l * 1e-3), ..emission });
        objects.bodies = vec![Arc::new(sun)];
        SceneSnapshot { objects: Arc::new(objects), ..scene.clone() }
    };
    for (name, scene) in [("a sun 60 degrees wide", wide_sun()), ("a swarm", dim(&swarm()))] {
        let without = light(&scene, &settings(StarMethod::Auto));
        for fraction in [0.1, 0.5] {
            let error = light(&scene, &with_glare(fraction)) / without - 1.0;
            println!("{name}, {fraction} scattered: relative error of the light {error:+.4}");
            assert!(error.abs() < 0.01, "{name}, {fraction}: {error}");
        }
    }
}

/// Glare multiplies the disc of a body by a nearly constant factor, so the points from which the glare is computed are
/// not visible.
#[test]
fn glare_on_a_disc_is_uniform() {
    let mut renderer = renderer();
    let rig = rig(vec![("window", ViewKind::Perspective { size: [300, 300], fov_y_rad: 1.2 })]);
    let scene = wide_sun();
    let without = render_hdr(&mut renderer, &scene, &rig, &settings(StarMethod::Auto));
    let glaring = render_hdr(&mut renderer, &scene, &rig, &with_glare(0.1));
    let luminances = |frame: &steradian::render::Frame| -> Vec<f64> {
        let hdr = frame.images[0].hdr.as_ref().unwrap();
        hdr.iter().map(|[r, g, b, _]| luminance([*r, *g, *b].map(f64::from))).collect()
    };
    let ratios: Vec<f64> =
        luminances(&glaring).iter().zip(luminances(&without)).filter(|(_, b)| *b > 3e5).map(|(a, b)| a / b).collect();
    let (least, most) = ratios.iter().fold((f64::MAX, 0.0_f64), |(l, m), r| (l.min(*r), m.max(*r)));
    println!("{} pixels of the disc: luminance with glare over without, {least:.4} to {most:.4}", ratios.len());
    assert!(ratios.len() > 20_000 && least > 0.93 && most < 1.0, "{least} {most}");
}
