//! Bodies and asteroid fields in configurations: each is created as written, and every mistake is refused with a
//! message that names the file, the key and the valid values.

use std::{f64::consts::PI, fs::File, path::Path};

use glam::{DQuat, DVec3};
use steradian::{
    config::{Config, ConfigError},
    photometry::rec709::luminance,
    plan::settings::ImpostorMethod,
    scene::{
        asteroids::{Placement, ShapeSource},
        bodies::{Body, Emission, ReflectionLaw, SolarBody},
    },
};

fn parse(text: &str) -> Result<Config, ConfigError> {
    Config::from_text(text, "test.toml", Path::new("/sky"), &[])
}

/// Asserts that the text is refused with a message that contains all of these parts.
#[track_caller]
fn refused(text: &str, parts: &[&str]) {
    let message = parse(text).expect_err("the configuration is refused").to_string();
    for part in parts.iter().chain(&["test.toml"]) {
        assert!(message.contains(part), "`{part}` is not in: {message}");
    }
}

#[test]
fn presets_provide_missing_keys() {
    let config = parse(
        "[[bodies]]\nname = 'sol'\npreset = 'sun'\n\
         [[bodies]]\nname = 'earth'\npreset = 'earth'\nposition_m = [1.5e11, 0, 0]\nspin = { phase_deg = 90 }\n\
         [[bodies]]\nname = 'ball'\nposition_m = [0, 1, 2]\nradii_m = [3, 2, 1]\ngeometric_albedo = [0.1, 0.2, 0.3]\nlaw = 'lambert'\n\
         orientation = [0, 0, 0.70712, 0.70712]\nspin = { period_s = -100.0 }\n\
         [[bodies]]\nname = 'lamp'\nposition_m = [9e9, 0, 0]\nradius_m = 1e6\ngeometric_albedo = 0\nemission = { absolute_magnitude = 20, temperature_k = 3000 }\n\
         [[bodies]]\nname = 'giant'\npreset = 'sun'\nposition_m = [1e12, 0, 0]\nradius_m = 1e10\nemission = { temperature_k = 4000.0 }\n",
    )
    .unwrap();
    let bodies = config.objects().unwrap().bodies;
    assert_eq!(*bodies[0], Body::preset(SolarBody::Sun, "sol", DVec3::ZERO));
    let mut earth = Body::preset(SolarBody::Earth, "earth", DVec3::X * 1.5e11);
    earth.spin.phase_rad = PI / 2.0;
    assert_eq!(*bodies[1], earth);
    let ball = &bodies[2];
    assert_eq!((ball.radii_m, ball.surface.law), (DVec3::new(3.0, 2.0, 1.0), ReflectionLaw::Lambert));
    assert_eq!((ball.surface.geometric_albedo, ball.spin.period_s), ([0.1, 0.2, 0.3], Some(-100.0)));
    assert!(ball.orientation.angle_between(DQuat::from_rotation_z(PI / 2.0)) < 1e-6);
    assert_eq!(bodies[3].emission, Some(Emission::of_star(20.0, 3000.0, 1e6, 0.0)));
    assert_eq!(bodies[3].surface.geometric_albedo, [0.0; 3]);
    // A larger sun of the same magnitude has a lower luminance.
    let [sun, giant] = [0, 4].map(|i: usize| luminance(bodies[i].emission.unwrap().luminance_cd_m2));
    assert!((giant / sun / (695.7e6f64 / 1e10).powi(2) - 1.0).abs() < 1.3e-15, "{giant} {sun}");
    assert!(parse("").unwrap().objects().unwrap().is_empty());
}

#[test]
fn mistakes_in_bodies() {
    let ball = "[[bodies]]\nname = 'ball'\nposition_m = [0, 0, 0]\n";
    let with = |keys: &str| format!("{ball}radius_m = 1\ngeometric_albedo = 0.1\n{keys}\n");
    assert!(parse(&with("")).is_ok());
    refused("[[bodies]]\nposition_m = [0, 0, 0]", &["bodies[0]", "missing key `name`"]);
    refused("[[bodies]]\nname = 'mars'\npreset = 'mars'", &["bodies[0].position_m (body `mars`)", "missing key"]);
    refused("[[bodies]]\nname = 'x'\npreset = 'pluto'", &["bodies[0].preset", "pluto", "neptune"]);
    refused(&with("rings = 3"), &["bodies[0].rings (body `ball`)", "unknown key", "emission"]);
    refused(ball, &["bodies[0].radius_m", "missing key", "radii_m"]);
    refused(&format!("{ball}radius_m = 1"), &["bodies[0].geometric_albedo", "missing key"]);
    refused(&with("radii_m = [1, 1, 1]"), &["bodies[0].radius_m", "exactly one"]);
    refused(&with("law = 'phong'"), &["bodies[0].law", "phong", "lommel_seeliger"]);
    refused(&with("orientation = [0, 0, 0, 2]"), &["bodies[0].orientation", "unit quaternion"]);
    refused(&with("spin = { period_s = 0 }"), &["bodies[0].spin.period_s", "0.001"]);
    refused(&with("spin = { phase_deg = nan }"), &["bodies[0].spin.phase_deg", "finite"]);
    refused(&with("spin = { period_h = 1 }"), &["bodies[0].spin.period_h", "unknown key"]);
    refused(&with("emission = { temperature_k = 5000 }"), &["bodies[0].emission.absolute_magnitude", "missing key"]);
    refused(&with("emission = { absolute_magnitude = 5 }"), &["bodies[0].emission.temperature_k", "missing key"]);
    for (keys, key, expected) in [
        ("absolute_magnitude = 51, temperature_k = 5000", "absolute_magnitude", "between -50 and 50"),
        ("absolute_magnitude = 5, temperature_k = 10", "temperature_k", "between 100 and 1e8"),
        ("absolute_magnitude = 5, temperature_k = 5000, limb_darkening = 1.5", "limb_darkening", "between 0 and 1"),
    ] {
        refused(&with(&format!("emission = {{ {keys} }}")), &[&format!("bodies[0].emission.{key}"), expected]);
    }
    refused(&format!("{ball}radius_m = 0\ngeometric_albedo = 0.1"), &["bodies[0].radius_m", "0.001"]);
    refused(&format!("{ball}radius_m = 1\ngeometric_albedo = 'grey'"), &["bodies[0].geometric_albedo", "[red"]);
    refused(&format!("{ball}radius_m = 1\ngeometric_albedo = 2.5"), &["bodies[0].geometric_albedo", "between 0 and 2"]);
    refused(&format!("{}{}", with(""), with("")), &["bodies[1].name (body `ball`)", "unique"]);
    refused(&with("").replace("ball", "a b"), &["bodies[0].name", "letters"]);
    let overridden = Config::from_text(&with(""), "test.toml", Path::new(""), &["bodies.ball.radius_m=-1".to_owned()]);
    let message = overridden.unwrap_err().to_string();
    assert!(message.contains("--set bodies.ball.radius_m=-1") && message.contains("bodies[0].radius_m"), "{message}");
}

#[test]
fn textures_are_read_from_the_configurations_folder() {
    let folder = tempfile::tempdir().unwrap();
    let mut encoder = png::Encoder::new(File::create(folder.path().join("map.png")).unwrap(), 2, 1);
    encoder.set_color(png::ColorType::Rgb);
    encoder.write_header().unwrap().write_image_data(&[255, 0, 0, 0, 0, 255]).unwrap();
    let text = |file: &str| {
        format!("[[bodies]]\nname = 'moon'\npreset = 'moon'\nposition_m = [0, 0, 0]\ntexture = '{file}'\n")
    };
    let path = folder.path().join("sky.toml");
    std::fs::write(&path, text("map.png")).unwrap();
    let objects = Config::load(&path, &[]).unwrap().objects().unwrap();
    let texture = objects.bodies[0].surface.texture.clone().unwrap();
    assert_eq!((texture.size, texture.rgb.as_slice()), ([2, 1], &[[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]][..]));
    std::fs::write(&path, text("no.png")).unwrap();
    let message = Config::load(&path, &[]).unwrap().objects().unwrap_err().to_string();
    for part in ["sky.toml", "bodies[0].texture (body `moon`)", "no.png"] {
        assert!(message.contains(part), "{message}");
    }
}

const FIELD: &str = "[[asteroid_fields]]\nname = 'f'\nposition_m = [1, 2, 3]\ninstances = 500\nradius_m = [1, 10]\ngeometric_albedo = 0.1\n";

#[test]
fn fields_are_made_as_written() {
    let config = parse(&format!(
        "{FIELD}shape = 'box'\nsize_m = [1e3, 2e3, 3e3]\n\
         [[asteroid_fields]]\nname = 'ring'\nposition_m = [0, 0, 0]\norientation = [1, 0, 0, 0]\ninstances = 300\nseed = 9\nshape = 'ring'\ninner_m = 1e7\nouter_m = 2e7\nthickness_m = 0\nradius_m = [5, 6]\nsize_index = 0\nspin_period_s = [60, 61]\ngeometric_albedo = [0.1, 0.2, 0.3]\nlaw = 'lambert'\nshape_seed = 4\n\
         [[asteroid_fields]]\nname = 'belt'\nposition_m = [0, 0, 0]\ninstances = 3\nshape = 'belt'\ninner_m = 1e7\nouter_m = 2e7\nheight_m = 5\nradius_m = [5, 6]\ngeometric_albedo = 0.1\nshapes = ['a.glb', '/b.gltf']\n\
         [asteroids]\nimpostor = 'octahedral'\nculling = 'cpu'\nquality = 0.5\ntiles = 16\ntile_px = 64\nsamples = 4\n"
    ))
    .unwrap();
    let specs = config.field_specs().unwrap();
    assert_eq!(specs[0].parameters.placement, Placement::Box { size_m: DVec3::new(1e3, 2e3, 3e3) });
    assert_eq!((specs[0].parameters.seed, &specs[0].shapes), (1, &ShapeSource::Procedural { seed: 1 }));
    assert_eq!(specs[1].parameters.placement, Placement::Ring { inner_m: 1e7, outer_m: 2e7, thickness_m: 0.0 });
    assert_eq!(specs[1].shapes, ShapeSource::Procedural { seed: 4 });
    assert_eq!((specs[1].law, specs[1].geometric_albedo), (ReflectionLaw::Lambert, [0.1, 0.2, 0.3]));
    assert_eq!(specs[2].parameters.placement, Placement::Belt { inner_m: 1e7, outer_m: 2e7, height_m: 5.0 });
    assert_eq!(specs[2].shapes, ShapeSource::Files(vec!["/sky/a.glb".into(), "/b.gltf".into()]));
    let settings = config.render_settings().asteroids;
    assert_eq!((settings.impostor, settings.tiles, settings.tile_px), (ImpostorMethod::Octahedral, 16, 64));
    let message = config.objects().unwrap_err().to_string();
    assert!(
        message.contains("asteroid_fields[2].shapes (field `belt`)") && message.contains("/sky/a.glb"),
        "{message}"
    );

    let objects = parse(&format!("{FIELD}shape = 'box'\nsize_m = [1e3, 2e3, 3e3]\n")).unwrap().objects().unwrap();
    let field = &objects.fields[0];
    assert_eq!((field.instances.packed.len(), field.position_m), (500, DVec3::new(1.0, 2.0, 3.0)));
    assert!(!field.shapes.shapes.is_empty());
    assert_eq!(objects.time_s, 820_497_600.0, "2026-01-01T00:00:00Z");
}

#[test]
fn mistakes_in_fields_and_their_settings() {
    let boxed = |keys: &str| format!("{FIELD}shape = 'box'\nsize_m = [1, 1, 1]\n{keys}\n");
    let key = |key: &str| format!("asteroid_fields[0].{key} (field `f`)");
    refused(FIELD, &["asteroid_fields[0] (field `f`)", "missing key `shape`"]);
    refused(&format!("{FIELD}shape = 'disc'"), &[&key("shape"), "disc", "belt"]);
    refused(&format!("{FIELD}shape = 'box'"), &[&key("size_m"), "missing key", "box"]);
    refused(&format!("{FIELD}shape = 'belt'\ninner_m = 1\nouter_m = 2"), &[&key("height_m"), "missing key"]);
    refused(
        &format!("{FIELD}shape = 'ring'\ninner_m = 3\nouter_m = 2\nthickness_m = 1"),
        &[&key("outer_m"), "inner_m"],
    );
    refused(&boxed("inner_m = 1"), &[&key("inner_m"), "size_m"]);
    refused(&boxed("shape_seed = 1\nshapes = ['x.glb']"), &[&key("shape_seed"), "at most one"]);
    refused(&boxed("shapes = []"), &[&key("shapes"), "empty"]);
    refused(&boxed("size_index = -1"), &[&key("size_index"), "between 0 and 10"]);
    refused(&boxed("spin_period_s = [2, 1]"), &[&key("spin_period_s"), "smallest first"]);
    refused(&boxed("colour = 1"), &[&key("colour"), "unknown key", "geometric_albedo"]);
    refused(&boxed("").replace("500", "0"), &[&key("instances"), "between 1 and"]);
    refused(&boxed("").replace("= 0.1", "= -0.1"), &[&key("geometric_albedo"), "between 0 and 2"]);
    refused(&boxed("").replace("geometric_albedo = 0.1", ""), &[&key("geometric_albedo"), "missing key"]);
    refused(&boxed("").replace("[1, 10]", "[10, 1]"), &[&key("radius_m"), "smallest first"]);
    refused(&format!("{}{}", boxed(""), boxed("")), &["asteroid_fields[1].name", "unique"]);
    for (line, parts) in [
        ("quality = 0.05", ["asteroids.quality", "between 0.1 and 10"]),
        ("quality = nan", ["asteroids.quality", "finite"]),
        ("tiles = 24", ["asteroids.tiles", "a power of two from 4 to 64"]),
        ("tile_px = 512", ["asteroids.tile_px", "between 8 and 256 pixels, a power of two"]),
        ("samples = 0", ["asteroids.samples", "between 1 and 4"]),
        ("impostor = 'sprite'", ["asteroids.impostor", "octahedral_blend"]),
        ("lod = 1", ["asteroids.lod", "unknown key"]),
    ] {
        refused(&format!("[asteroids]\n{line}"), &parts);
    }
}

#[test]
fn the_example_has_a_sun_a_planet_and_a_field_ahead_of_the_camera() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/asteroids.toml");
    let config = Config::load(&path, &[]).unwrap();
    let (objects, camera) = (config.objects().unwrap(), config.camera().unwrap());
    assert_eq!((objects.bodies.len(), objects.fields[0].instances.packed.len()), (2, 4000));
    let forward = camera.world_from_camera * DVec3::NEG_Z;
    for place in [objects.bodies[1].position_m, objects.fields[0].position_m] {
        assert!((place - camera.position_m).normalize().dot(forward) > 0.9999, "{place}");
    }
    for name in ["window", "headset", "dome"] {
        assert!(config.rig().unwrap().index_of(name).is_some(), "{name}");
    }
}
