//! The light of stars: every view shows exactly the illuminance that the catalogue says.

mod common;

use common::*;
use steradian::{
    plan::settings::StarMethod,
    units::illuminance_lx_from_magnitude,
    view::{
        ViewKind,
        projection::{Face, FisheyeMapping},
    },
};

#[test]
fn full_spheres_hold_the_whole_sky() {
    let magnitudes = [-1.0, 2.0, 5.0, 8.0, 12.0, 15.0];
    let records: Vec<_> = spiral(3000).enumerate().map(|(i, d)| star(d, magnitudes[i % 6])).collect();
    let expected: f64 = records.iter().map(|star| illuminance_lx_from_magnitude(f64::from(star.magnitude))).sum();
    let scene = snapshot(records);
    let mut renderer = renderer();
    for method in [StarMethod::BSpline, StarMethod::Tent, StarMethod::Auto] {
        for (name, kind) in [
            ("equirectangular", ViewKind::Equirectangular { size: [256, 128] }),
            ("cube", ViewKind::Cubemap { face_size: 96, faces: Face::ALL.to_vec() }),
            (
                "fisheye",
                ViewKind::Fisheye {
                    size: [256, 256],
                    mapping: FisheyeMapping::Equidistant,
                    fov_rad: std::f64::consts::TAU,
                },
            ),
            (
                "equisolid",
                ViewKind::Fisheye {
                    size: [256, 256],
                    mapping: FisheyeMapping::Equisolid,
                    fov_rad: std::f64::consts::TAU,
                },
            ),
        ] {
            let rig = rig(vec![(name, kind)]);
            let frame = render_hdr(&mut renderer, &scene, &rig, &settings(method));
            let error = total_illuminance_lx(&frame, &rig) / expected - 1.0;
            println!("{method:?} {name}: relative flux error {error:.1e}, {} stars", frame.views[0].stars_drawn);
            assert!(error.abs() < 1e-4, "{method:?} {name}: {error}");
            assert_eq!(frame.views[0].stars_drawn, 3000);
        }
    }
}
