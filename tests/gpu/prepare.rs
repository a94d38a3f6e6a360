//! Preparation of a renderer: it makes all pipelines that a configuration needs before the first frame.

use std::{path::Path, sync::Arc};

use steradian::{Gpu, GpuOptions, Renderer, SceneSnapshot, Wanted, config::Config, scene::loader::load_stars};

/// Number of pipelines that `prepare` creates for a configuration, and number of further ones that the first frame
/// creates.
fn made(file: &str, set: &[&str]) -> [u64; 2] {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs").join(file);
    let small = ["scene.catalogues=[\"builtin:bright\"]"];
    let set: Vec<String> = small.iter().chain(set).map(|text| (*text).to_owned()).collect();
    let config = Config::load(&path, &set).unwrap();
    let (rig, settings) = (config.rig().unwrap(), config.render_settings());
    let mut renderer = Renderer::new(Gpu::open(&GpuOptions::default()).unwrap());
    assert_eq!(renderer.gpu().made().pipelines, 0, "a new renderer has no pipelines");
    let objects = Arc::new(config.objects().unwrap());
    let wanted = Wanted::both();
    let mut steps = Vec::new();
    renderer.prepare(&objects, &rig, &settings, wanted, &[], &mut |step| steps.push(step)).unwrap();
    let total = steps.len();
    assert!(steps.iter().enumerate().all(|(index, step)| (step.done, step.total) == (index + 1, total)), "{steps:?}");
    let prepared = renderer.gpu().made().pipelines;
    let (stars, _) = load_stars(&config.star_sources(), &config.epoch(), &mut |_| ()).unwrap();
    let scene = SceneSnapshot { revision: 1, stars: Arc::new(stars), objects, camera: config.camera().unwrap() };
    renderer.warm_up(&scene, &rig, &settings, wanted).unwrap();
    [prepared, renderer.gpu().made().pipelines - prepared]
}

#[test]
fn the_first_frame_creates_no_further_pipelines() {
    let small = "views.dome.size=[64,64]";
    let cases: [(&str, &[&str]); 11] = [
        ("perspective.toml", &["views.0.size=[64,48]"]),
        ("dome.toml", &[small]),
        ("dome.toml", &[small, "glare.method=none"]),
        ("dome.toml", &[small, "glare.method=none", "exposure.mode=manual", "exposure.ev100=-5.4"]),
        ("dome.toml", &[small, "glare.method=view_pyramid"]),
        ("dome.toml", &[small, "glare.kernel=cie"]),
        ("dome.toml", &[small, "stars.method=packed_cas", "glare.method=none"]),
        ("dome.toml", &[small, "stars.method=packed_cas_sorted", "glare.method=none"]),
        ("dome.toml", &[small, "stars.method=disc", "glare.method=none"]),
        ("asteroids.toml", &["views.0.size=[64,48]"]),
        ("tonight.toml", &["views.dome.size=[64,64]", "views.south.size=[64,48]"]),
    ];
    for (file, set) in cases {
        let [prepared, late] = made(file, set);
        assert!(prepared > 0 && late == 0, "{file} {set:?}: {prepared} prepared, {late} more by the frame");
    }
}

#[test]
fn a_frame_creates_pipelines_that_were_not_prepared() {
    // Shows that the counter works.
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/dome.toml");
    let set = ["scene.catalogues=[\"builtin:bright\"]", "views.dome.size=[64,64]"].map(str::to_owned);
    let config = Config::load(&path, &set).unwrap();
    let mut renderer = Renderer::new(Gpu::open(&GpuOptions::default()).unwrap());
    let (stars, _) = load_stars(&config.star_sources(), &config.epoch(), &mut |_| ()).unwrap();
    let objects = Arc::new(config.objects().unwrap());
    let scene = SceneSnapshot { revision: 1, stars: Arc::new(stars), objects, camera: config.camera().unwrap() };
    let wanted = Wanted { display: true, ..Wanted::default() };
    renderer.warm_up(&scene, &config.rig().unwrap(), &config.render_settings(), wanted).unwrap();
    assert!(renderer.gpu().made().pipelines > 0);
}
