//! Times of display images at several quality levels. This prints figures and asserts nothing.

use std::time::Instant;

use glam::DQuat;
use steradian::{
    plan::settings::GlareMethod,
    render::{FrameRequest, SkyMapUse, Wanted},
};

use crate::common::{configured, renderer};

#[test]
#[ignore = "measures: cargo test --release --test gpu quality:: -- --ignored --nocapture"]
fn times_of_quality_levels() {
    let set = [
        "scene.catalogues=[\"builtin:bright\", { galaxy = { stars = 3000000, seed = 1, fainter_than = 6.5 } }]",
        "views.dome.size=[1024,1024]",
    ];
    for ev100 in [-5.4, -8.5] {
        let (mut scene, rig, mut settings) = configured("dome.toml", &set);
        let rig = rig.of_views(&[0]);
        settings.exposure = steradian::plan::settings::ExposureSettings::manual(ev100);
        let mut renderer = renderer();
        for (codes, glare) in [(0.5, true), (1.0, true), (2.0, true), (4.0, true), (8.0, true), (8.0, false)] {
            settings.accuracy.display_codes = codes;
            settings.glare.method = if glare { GlareMethod::Auto } else { GlareMethod::None };
            let mut times = Vec::new();
            for frame in 0..14 {
                scene.camera.world_from_camera *= DQuat::from_rotation_y(0.002);
                let request = FrameRequest::new(&scene, &rig).settings(&settings).wanted(Wanted::display());
                let start = Instant::now();
                renderer.render(request.sky_map(SkyMapUse::Wait)).unwrap();
                if frame >= 3 {
                    times.push(start.elapsed().as_secs_f64() * 1e3);
                }
            }
            times.sort_by(f64::total_cmp);
            println!(
                "ev100 {ev100}, display_codes {codes}, glare {glare}: {:.1} ms (fastest {:.1})",
                times[5], times[0]
            );
        }
    }
}
