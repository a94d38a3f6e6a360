//! A steady state makes nothing: frames like the last one use its buffers, bind groups and pipelines again.

use std::{path::Path, sync::Arc};

use glam::DQuat;
use steradian::{
    config::Config,
    gpu::GpuOptions,
    render::{FrameRequest, Renderer, Wanted},
    scene::{SceneSnapshot, loader::load_stars},
};

use crate::common::renderer_with;

/// Frames until everything is there: a view may turn to where its tiles have more items.
const WARM_FRAMES: usize = 4;

/// Objects that each frame of a configuration makes while the camera turns. Pictures are 96 pixels wide at most.
fn made(renderer: &mut Renderer, file: &str, overrides: &[&str], frames: usize) -> Vec<u64> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs").join(file);
    let overrides: Vec<String> = overrides.iter().map(|&text| text.to_owned()).collect();
    let config = Config::load(&path, &overrides).unwrap();
    let rig = config.rig().unwrap();
    let (stars, _) = load_stars(&config.star_sources(), &mut |_| {}).unwrap();
    let mut scene = SceneSnapshot {
        revision: 1,
        stars: Arc::new(stars),
        objects: Arc::new(config.objects().unwrap()),
        camera: config.camera().unwrap(),
    };
    let settings = config.render_settings();
    let wanted = vec![Wanted { display: true, hdr: false, ..Wanted::default() }; rig.views().len()];
    let from = scene.camera.world_from_camera;
    (0..frames)
        .map(|frame| {
            // To and fro, so that what is seen does not grow.
            let angle_rad = [0.0, 1e-3][frame % 2];
            scene.camera.world_from_camera = from * DQuat::from_rotation_y(angle_rad);
            renderer
                .render(FrameRequest::new(&scene, &rig).settings(&settings).wanted_of_each(&wanted))
                .unwrap()
                .times
                .objects_made
        })
        .collect()
}

const DOME: &str = "views.dome.size=[96,96]";
const FACE: &str = "views.0.face_size=48";
const FEW_STARS: &str = "scene.catalogues=[\"builtin:bright\"]";

#[test]
fn a_steady_frame_makes_no_buffer_bind_group_or_pipeline() {
    let cases: &[(&str, &[&str])] = &[
        ("dome.toml", &[DOME, FEW_STARS]),
        ("dome.toml", &[DOME, FEW_STARS, "glare.method=none", "exposure.mode=manual"]),
        ("dome.toml", &[DOME, FEW_STARS, "glare.method=view_pyramid"]),
        ("dome.toml", &[DOME, FEW_STARS, "stars.method=packed_cas"]),
        // Views of unlike sizes share one texture that is blended into, which is made anew for each: here they are alike.
        ("cubemap.toml", &[FEW_STARS, FACE, "views.1.face_size=48", "stars.method=psf_texture", "glare.method=none"]),
        ("dome.toml", &[DOME, FEW_STARS, "stars.method=cell_sky", "glare.method=none"]),
        ("cubemap.toml", &[FEW_STARS, FACE]),
        ("perspective.toml", &[FEW_STARS]),
        ("asteroids.toml", &[FEW_STARS, DOME, "views.window.size=[96,54]", "views.headset.size=[48,48]"]),
    ];
    for (file, overrides) in cases {
        // Strips, so that there are several tiles and batches.
        let options = GpuOptions { binding_limit_bytes: Some(1 << 20), ..GpuOptions::default() };
        let mut renderer = renderer_with(&options);
        let frames = made(&mut renderer, file, overrides, WARM_FRAMES + 4);
        println!("{file} {overrides:?}: {frames:?}");
        assert!(frames[0] > 0, "{file} {overrides:?}: the first frame makes what it needs: {frames:?}");
        assert!(frames[WARM_FRAMES..].iter().all(|made| *made == 0), "{file} {overrides:?}: {frames:?}");
    }
}

#[test]
fn another_size_is_noticed() {
    let mut renderer = renderer_with(&GpuOptions::default());
    let steady = made(&mut renderer, "dome.toml", &[DOME, FEW_STARS], WARM_FRAMES + 1);
    assert_eq!(steady[WARM_FRAMES], 0);
    assert!(made(&mut renderer, "dome.toml", &["views.dome.size=[128,128]", FEW_STARS], 1)[0] > 0);
}
