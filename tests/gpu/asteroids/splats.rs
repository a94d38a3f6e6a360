//! Splatted impostors: they look like the finest meshes, the picture does not depend on the size of words or on bands, and samples that nearer
//! asteroids hide are counted.

use steradian::{
    gpu::GpuOptions,
    plan::settings::{Culling, ImpostorMethod, RenderSettings},
    render::Frame,
    view::{Rig, ViewKind, projection::FisheyeMapping},
};

use super::fields::{scene, settings_with};
use crate::common::{render_hdr, renderer, renderer_with, rig};

fn splats() -> RenderSettings {
    settings_with(ImpostorMethod::OctahedralSplat, Culling::Gpu)
}

fn views() -> Rig {
    rig(vec![
        ("flat", ViewKind::Perspective { size: [240, 180], fov_y_rad: 1.2 }),
        ("dome", ViewKind::Fisheye { size: [200, 200], mapping: FisheyeMapping::Equidistant, fov_rad: 3.1 }),
        ("sphere", ViewKind::Equirectangular { size: [320, 160] }),
    ])
}

/// Returns three sums of green light over an image, cd/m^2: for the first frame, for the second, and for the absolute difference of the two in blocks
/// of 4 x 4 pixels.
fn compared(one: &Frame, two: &Frame, image: usize) -> [f64; 3] {
    let width = one.images[image].width as usize;
    let [a, b] = [one, two].map(|frame| frame.images[image].hdr.as_ref().unwrap());
    let mut blocks = std::collections::BTreeMap::<[usize; 2], [f64; 2]>::new();
    for (i, (a, b)) in a.iter().zip(b).enumerate() {
        let block = blocks.entry([i % width / 4, i / width / 4]).or_default();
        block[0] += f64::from(a[1]);
        block[1] += f64::from(b[1]);
    }
    blocks.values().fold([0.0; 3], |sum, [a, b]| [sum[0] + a, sum[1] + b, sum[2] + (a - b).abs()])
}

#[test]
#[ignore = "long: make test-all"]
fn splats_look_like_the_finest_meshes() {
    let mut renderer = renderer();
    let scene = scene(3001, 1e3, [2.0, 12.0]);
    let rig = views();
    let mut finest = splats();
    finest.asteroids.finest_only = true;
    finest.asteroids.samples = 4;
    let truth = render_hdr(&mut renderer, &scene, &rig, &finest);
    let frame = render_hdr(&mut renderer, &scene, &rig, &splats());
    let blended =
        render_hdr(&mut renderer, &scene, &rig, &settings_with(ImpostorMethod::OctahedralBlend, Culling::Gpu));
    // A different picture of equal light must fail the comparison.
    let mut turned = scene.clone();
    turned.camera.world_from_camera = glam::DQuat::from_rotation_y(0.5);
    let wrong = render_hdr(&mut renderer, &turned, &rig, &splats());
    for image in 0..truth.images.len() {
        let view = &frame.views[frame.images[image].view];
        let [splatted, squares, other] = [&frame, &blended, &wrong].map(|drawn| {
            let [light, expected, difference] = compared(drawn, &truth, image);
            [light / expected - 1.0, difference / expected]
        });
        println!(
            "{}: {:?}: splats {splatted:.4?}, squares {squares:.4?}, another {other:.2?}",
            view.name, view.asteroids
        );
        assert!(view.asteroids.impostors > 100, "{:?}", view.asteroids);
        // The remaining difference comes from points, and from edges, which the reference samples twice as finely. Pictures with squares differ in
        // the same way.
        assert!(splatted[0].abs() < 0.04 && splatted[1] < squares[1] + 0.02 && squares[1] < 0.4, "{}", view.name);
        assert!(other[1] > 0.6, "{}: {other:?}", view.name);
    }
}

#[test]
#[ignore = "long: make test-all"]
fn words_and_bands_do_not_change_the_picture() {
    let scene = scene(1201, 300.0, [2.0, 12.0]);
    let rig = views();
    let mut frames = Vec::new();
    // The samples of the whole sphere need 1.6 MB.
    let limits = [(false, None), (true, None), (false, Some(1 << 20))];
    for (force_u32_accumulator, binding_limit_bytes) in limits {
        let mut renderer =
            renderer_with(&GpuOptions { force_u32_accumulator, binding_limit_bytes, ..Default::default() });
        frames.push(render_hdr(&mut renderer, &scene, &rig, &splats()));
    }
    for (other, limits) in frames.iter().zip(limits).skip(1) {
        for (one, two) in frames[0].images.iter().zip(&other.images) {
            let pixels = one.hdr.as_ref().unwrap().iter().zip(two.hdr.as_ref().unwrap());
            // With 32-bit words, points are summed in other units. With bands, the windows of tiles cut the edges of meshes at other positions.
            let most = if limits.0 { 1e-5 } else { 1e-2 };
            let differs = |(one, two): &(&[f32; 4], &[f32; 4])| {
                one.iter().zip(*two).any(|(one, two)| (one - two).abs() > most * one.abs())
            };
            let differing = pixels.filter(differs).count();
            assert_eq!(differing, 0, "differing pixels of view {}, {limits:?}", one.view);
        }
    }
    for (one, two) in frames[0].views.iter().zip(&frames[1].views) {
        assert_eq!(one.asteroids, two.asteroids);
        assert!(one.asteroids.hidden > 0 && one.asteroids.hidden < one.asteroids.impostors, "{:?}", one.asteroids);
    }
}

#[test]
#[ignore = "long: make test-all"]
fn hidden_samples_are_counted_behind_many_asteroids() {
    let mut renderer = renderer();
    let flat = rig(vec![("flat", ViewKind::Perspective { size: [160, 120], fov_y_rad: 0.6 })]);
    let mut hidden = [(2000, 4e3), (20_000, 700.0)].map(|(instances, half_m)| {
        let frame = render_hdr(&mut renderer, &scene(instances, half_m, [4.0, 40.0]), &flat, &splats());
        let counts = &frame.views[0].asteroids;
        println!("{instances}: {counts:?}");
        counts.hidden as f64 / counts.impostors as f64
    });
    assert!(hidden[0] < 0.4 && hidden[1] > 0.7, "{hidden:?}");
    // Samples are not counted for impostors drawn as squares.
    let frame = render_hdr(
        &mut renderer,
        &scene(20_000, 700.0, [4.0, 40.0]),
        &flat,
        &settings_with(ImpostorMethod::OctahedralBlend, Culling::Gpu),
    );
    hidden[1] = frame.views[0].asteroids.hidden as f64;
    assert_eq!(hidden[1], 0.0);
}
