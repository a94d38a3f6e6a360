//! Glare of bodies and asteroids: light moves, none is lost, and a disc shows none of the parts that its glare is made of.

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

/// A sun 60 degrees wide, darker towards its limb.
fn wide_sun() -> SceneSnapshot {
    let mut sun = Body::preset(SolarBody::Sun, "sun", DVec3::new(0.3, 0.2, -2.0) * 1e9);
    sun.radii_m = DVec3::new(1.1e9, 1e9, 0.9e9);
    sun.emission = Some(Emission { luminance_cd_m2: [1e6, 9e5, 8e5], limb_darkening: 0.5, corona: false });
    bodies(vec![sun])
}

/// A swarm of asteroids 40 degrees wide, each of them a few pixels or less.
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

/// The light of the whole sky is the same with glare, whichever share of it is scattered.
#[test]
fn glare_of_bodies_and_asteroids_moves_light_and_loses_none() {
    let mut renderer = renderer();
    let rig = whole_sky();
    let mut light = |scene: &SceneSnapshot, settings: &RenderSettings| {
        total_illuminance_lx(&render_hdr(&mut renderer, scene, &rig, settings), &rig)
    };
    let dim = |scene: &SceneSnapshot| {
        // The sun of the swarm would hide what asteroids lose: a thousandth of it stands for the rest.
        let mut objects = (*scene.objects).clone();
        if objects.fields.is_empty() {
            return scene.clone();
        }
        let mut sun = (*objects.bodies[0]).clone();
        sun.position_m = DVec3::new(AU_M, 1e13, 0.0);
        sun.emission = sun.emission.map(|of| Emission { luminance_cd_m2: of.luminance_cd_m2.map(|l| l * 1e-3), ..of });
        objects.bodies = vec![Arc::new(sun)];
        SceneSnapshot { objects: Arc::new(objects), ..scene.clone() }
    };
    for (name, scene) in [("a sun 60 degrees wide", wide_sun()), ("a swarm", dim(&swarm()))] {
        let without = light(&scene, &settings(StarMethod::Auto));
        for fraction in [0.1, 0.5] {
            let error = light(&scene, &with_glare(fraction)) / without - 1.0;
            println!("{name}, {fraction} scattered: light {error:+.4}");
            assert!(error.abs() < 0.01, "{name}, {fraction}: {error}");
        }
    }
}

/// The disc of a body with glare is the disc without it times a factor that hardly changes: no part of its glare stands out.
#[test]
fn a_disc_shows_none_of_the_parts_of_its_glare() {
    let mut renderer = renderer();
    let rig = rig(vec![("window", ViewKind::Perspective { size: [300, 300], fov_y_rad: 1.2 })]);
    let scene = wide_sun();
    let without = render_hdr(&mut renderer, &scene, &rig, &settings(StarMethod::Auto));
    let with = render_hdr(&mut renderer, &scene, &rig, &with_glare(0.1));
    let of = |frame: &steradian::render::Frame| -> Vec<f64> {
        let hdr = frame.images[0].hdr.as_ref().unwrap();
        hdr.iter().map(|[r, g, b, _]| luminance([*r, *g, *b].map(f64::from))).collect()
    };
    let ratios: Vec<f64> = of(&with).iter().zip(of(&without)).filter(|(_, b)| *b > 3e5).map(|(a, b)| a / b).collect();
    let (least, most) = ratios.iter().fold((f64::MAX, 0.0_f64), |(l, m), r| (l.min(*r), m.max(*r)));
    println!("{} pixels of the disc: {least:.4} to {most:.4} of their luminance", ratios.len());
    assert!(ratios.len() > 20_000 && least > 0.93 && most < 1.0, "{least} {most}");
}
