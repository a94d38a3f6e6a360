//! The renderer compared with the f64 reference of the sky.

use steradian::{
    metrics::{HdrView, illuminance_lx},
    plan::settings::StarMethod,
    reference::{
        sky::{SkyKernel, draw, stars_for},
        stars::splat::Eye,
    },
    view::ViewKind,
};

use crate::common::{render_hdr, renderer, rig, settings, snapshot, spiral, star, total_illuminance_lx};

/// Compare only the total light, because a comparison pixel by pixel would need wide kernels.
#[test]
fn the_renderer_has_the_light_of_the_reference() {
    let mut renderer = renderer();
    let scene = snapshot(spiral(60).enumerate().map(|(i, d)| star(d, (i % 7) as f32)).collect());
    let kind = ViewKind::Equirectangular { size: [256, 128] };
    let rig = rig(vec![("sky", kind)]);
    let mapping = rig.views()[0].images[0].projection.mapping();
    let stars = stars_for(&scene.stars, Eye::default(), 0.0);
    let luminances = draw(&stars, mapping, SkyKernel::Point).luminance_cd_m2(mapping);
    let truth = illuminance_lx(&HdrView::new(mapping, &luminances).unwrap()).unwrap();
    let frame = render_hdr(&mut renderer, &scene, &rig, &settings(StarMethod::BSpline));
    let error = total_illuminance_lx(&frame, &rig) / truth - 1.0;
    println!("relative error of the light {error:.1e}");
    // The limit allows for four roundings of f32. Summed over 60 stars, the errors cancel to about 4e-9.
    assert!(error.abs() < 2.4e-7);
}
