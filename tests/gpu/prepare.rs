//! Preparation of a renderer: it makes all pipelines that a configuration needs before the first frame.

use steradian::Wanted;

use crate::common::{configured, new_renderer};

const SMALL_CATALOGUE: &str = "scene.catalogues=[\"builtin:bright\"]";

/// Number of pipelines that `prepare` creates for a configuration, and number of further ones that the first frame
/// creates.
fn made(file: &str, set: &[&str]) -> [u64; 2] {
    let (scene, rig, settings) = configured(file, &[&[SMALL_CATALOGUE], set].concat());
    let mut renderer = new_renderer();
    assert_eq!(renderer.gpu().made().pipelines, 0, "a new renderer has no pipelines");
    let wanted = Wanted::both();
    let mut steps = Vec::new();
    renderer.prepare(&scene.objects, &rig, &settings, wanted, &[], &mut |step| steps.push(step)).unwrap();
    let total = steps.len();
    assert!(steps.iter().enumerate().all(|(index, step)| (step.done, step.total) == (index + 1, total)), "{steps:?}");
    let prepared = renderer.gpu().made().pipelines;
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
    let (scene, rig, settings) = configured("dome.toml", &[SMALL_CATALOGUE, "views.dome.size=[64,64]"]);
    let mut renderer = new_renderer();
    let wanted = Wanted { display: true, ..Wanted::default() };
    renderer.warm_up(&scene, &rig, &settings, wanted).unwrap();
    assert!(renderer.gpu().made().pipelines > 0);
}
