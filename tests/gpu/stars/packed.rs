//! The published rasterisers on the adapter, compared with their f64 reference.

use crate::common::*;
use steradian::{
    catalogue::StarRecord,
    plan::settings::StarMethod,
    reference::stars::{packed, splat::Eye},
    render::FrameImage,
};

/// Returns the largest difference of any channel, relative to the brightest channel of the image.
fn difference(image: &FrameImage, twin: &[[f64; 3]]) -> f64 {
    let brightest = twin.iter().flatten().fold(0.0_f64, |most, value| most.max(*value));
    let pixels = image.hdr.as_ref().unwrap().iter().zip(twin);
    pixels
        .flat_map(|(drawn, expected)| (0..3).map(move |i| (f64::from(drawn[i]) - expected[i]).abs() / brightest))
        .fold(0.0, f64::max)
}

#[test]
fn the_packed_rasterisers_equal_their_reference() {
    let mut renderer = renderer();
    let records: Vec<StarRecord> = spiral(800)
        .enumerate()
        .map(|(i, d)| StarRecord { temperature_k: 2500.0 + i as f32 * 20.0, ..star(d, (i % 3) as f32) })
        .collect();
    let scene = snapshot(records);
    for (name, kind) in all_views() {
        let rig = rig(vec![(name, kind)]);
        for method in [StarMethod::PackedCas, StarMethod::PackedCasSorted] {
            let frame = render_hdr(&mut renderer, &scene, &rig, &settings(method));
            let other = render_hdr(&mut renderer, &scene, &rig, &settings(StarMethod::BSpline));
            let mut worst = (0.0_f64, 0.0_f64);
            for (image, place) in frame.images.iter().zip(&rig.views()[0].images) {
                let eye = Eye { world_from_view: place.camera_from_view, ..Eye::default() };
                let twin = packed::draw(&scene.stars, eye, place.projection.mapping());
                worst.0 = worst.0.max(difference(image, &twin));
                let same = other.images.iter().find(|other| other.part == image.part).unwrap();
                worst.1 = worst.1.max(difference(same, &twin));
            }
            println!(
                "{name}, {}: largest difference {:.1e} of the brightest pixel; with the B-spline {:.1e}",
                method.name(),
                worst.0,
                worst.1
            );
            // Half floats are rounded by 5e-4 at each of a few additions, and the triangles in f32 are less accurate for small pixels.
            assert!(worst.0 < 1e-2 && worst.1 > 0.1, "{name} {method:?}: {worst:?}");
        }
    }
}
