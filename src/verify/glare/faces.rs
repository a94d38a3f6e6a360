//! One sky cut in several ways: into the faces of a cube, into strips, by a head that rolls.

use std::f64::consts::TAU;

use glam::{DQuat, DVec3};

use super::{
    super::{
        Figure,
        context::{CheckError, Context, hdr_pixels, worst},
        scenes::{cube, fisheye, rig, snapshot, spiral, star},
    },
    Picture, flat, pictures,
};
use crate::{
    gpu::{Gpu, GpuOptions},
    photometry::glare::GlareKernel,
    plan::settings::{ExposureMode, Metering},
    render::{Frame, FrameImage, FrameRequest, Renderer, Wanted},
    scene::SceneSnapshot,
    view::{Rig, ViewKind, projection::FisheyeMapping},
};

/// Directions in which views are compared.
const DIRECTIONS: usize = 400;
/// Only those this far from every star, pixels of the picture with the widest: nearer by, what pixels of different shapes show differs.
const APART_PX: f64 = 4.0;
/// Stars of the sky that is cut.
const STARS: usize = 40;
/// Most bytes of a strip: 19 rows of 128 pixels of 16 bytes.
const STRIP_BYTES: u64 = 128 * 16 * 19;

fn whole_spheres() -> [(&'static str, ViewKind); 3] {
    [
        ("cube", cube(96)),
        ("equirectangular", ViewKind::Equirectangular { size: [384, 192] }),
        ("fisheye-360", fisheye(256, FisheyeMapping::Equidistant, 360.0)),
    ]
}

/// 23: the same sky in a cube's faces, in equirectangular and fisheye views, in strips, and to a head that rolls.
pub(in crate::verify) fn cut_into_faces(context: &mut Context<'_>) -> Result<Vec<Figure>, CheckError> {
    let scene = snapshot(spiral(STARS).enumerate().map(|(i, d)| star(d, (i % 7) as f32)).collect());
    let kernel = context.expected_kernel()?;
    context.scatter_all();
    let all = rig(whole_spheres().into_iter().chain([("again", whole_spheres()[1].1.clone())]))?;
    let frame =
        context.renderer.render(FrameRequest::new(&scene, &all).settings(&context.settings).wanted(Wanted::both()))?;
    let (between, upright) = between_views(&scene, &all, &frame, &*kernel)?;

    // Two views of one frame that look alike are alike, bit for bit, on the display too.
    let of_view = |index: usize| frame.images.iter().filter(move |image| image.view == index);
    let pairs: Vec<_> = of_view(1).zip(of_view(3)).collect();
    let mut different = if pairs.is_empty() { f64::NAN } else { 0.0 };
    for (one, other) in pairs {
        different += different_pixels(one, other)?;
        different += f64::from(u8::from(one.display.is_none() || one.display != other.display));
    }

    // A head that rolls: the camera turned about its axis of view.
    let mut rolled = scene.clone();
    rolled.camera.world_from_camera = DQuat::from_rotation_z(TAU / 12.0);
    let rolled_frame = context.render(&rolled, &all)?;
    let (_, turned) = between_views(&rolled, &all, &rolled_frame, &*kernel)?;
    let of_roll = worst(upright.iter().zip(&turned).map(|(upright, turned)| largest_difference(&[*upright, *turned])));

    Ok(vec![
        Figure::at_most("veil between cube, equirectangular and fisheye", between, 0.02, "relative"),
        Figure::at_most("between upright and rolled", of_roll, 0.02, "relative"),
        Figure::at_most("pixels that differ between views alike", different, 0.0, ""),
        Figure::at_most("pixels that strips change", strips(context, &scene)?, 0.0, ""),
        Figure::at_most("exposure between views and rolls", exposures(context, &scene, &rolled)?, 1e-3, "EV"),
    ])
}

/// Scattered light over what the kernel says in directions that lie far from every star, in world axes: the largest difference between
/// views, and the means over the views. What the kernel says is for the pixel that shows the direction, so that a pixel's size and
/// the place of its centre do not count.
fn between_views(
    scene: &SceneSnapshot,
    rig: &Rig,
    frame: &Frame,
    kernel: &dyn GlareKernel,
) -> Result<(f64, Vec<f64>), CheckError> {
    let pictures = pictures(scene, rig, frame)?;
    let camera_from_world = scene.camera.world_from_camera.conjugate();
    let apart_rad =
        APART_PX * pictures.iter().map(|picture| picture.of_view.projection.middle_pixel_rad()).fold(0.0, f64::max);
    let is_apart = |direction: &DVec3| {
        scene.stars.iter().all(|(place, _, _)| place.normalize_or_zero().angle_between(*direction) > apart_rad)
    };
    let (mut differences, mut means) = (Vec::new(), Vec::new());
    for direction in spiral(DIRECTIONS).filter(is_apart) {
        let seen = camera_from_world * direction;
        let ratio = |view: &crate::view::View| {
            let shows = |picture: &Picture<'_>| picture.pixel_of(seen).filter(|_| picture.name == view.name);
            let found = pictures.iter().find_map(|picture| Some((picture, shows(picture)?)));
            found.map_or(f64::NAN, |(picture, pixel)| picture.ratio(kernel, pixel))
        };
        let ratios: Vec<f64> = rig.views().iter().map(ratio).collect();
        differences.push(largest_difference(&ratios));
        means.push(ratios.iter().sum::<f64>() / ratios.len() as f64);
    }
    Ok((worst(differences), means))
}

/// Largest over smallest, less 1; NaN where one of them is, or where nothing is lit.
fn largest_difference(values: &[f64]) -> f64 {
    worst(values.iter().flat_map(|a| values.iter().map(move |b| (a / b - 1.0).abs())))
}

fn different_pixels(one: &FrameImage, other: &FrameImage) -> Result<f64, CheckError> {
    let (one, other) = (hdr_pixels(one)?, hdr_pixels(other)?);
    let pairs = one.iter().zip(other).filter(|(a, b)| a.map(f32::to_bits) != b.map(f32::to_bits));
    Ok((pairs.count() + one.len().abs_diff(other.len())) as f64)
}

/// Pixels that differ where the adapter can hold no whole picture.
fn strips(context: &mut Context<'_>, scene: &SceneSnapshot) -> Result<f64, CheckError> {
    let rig = rig([("flat", flat(128, 90.0)), ("dome", fisheye(128, FisheyeMapping::Equidistant, 180.0))])?;
    let whole = context.render(scene, &rig)?;
    let options = GpuOptions {
        adapter: Some(context.renderer.adapter().adapter.clone()),
        binding_limit_bytes: Some(STRIP_BYTES),
        ..GpuOptions::default()
    };
    let mut renderer = Renderer::new(Gpu::open(&options)?);
    let cut = renderer.render(FrameRequest::new(scene, &rig).settings(&context.settings).wanted(Wanted::hdr()))?;
    let mut different = 0.0;
    for (one, other) in whole.images.iter().zip(&cut.images) {
        different += different_pixels(one, other)?;
    }
    Ok(if whole.images.len() == cut.images.len() { different } else { f64::NAN })
}

/// Largest difference of the exposure by the mean between views that see the whole sphere, each alone, and of one of them to a head
/// that rolls, EV. With the share of the settings: stars are light too.
fn exposures(context: &mut Context<'_>, scene: &SceneSnapshot, rolled: &SceneSnapshot) -> Result<f64, CheckError> {
    context.settings.glare = context.glare.clone();
    context.settings.exposure.mode = ExposureMode::Auto;
    context.settings.exposure.metering = Metering::Mean;
    let mut found = Vec::new();
    for kind in whole_spheres() {
        found.push(context.render(scene, &rig([kind])?)?.metered_ev100);
    }
    found.push(context.render(rolled, &rig([("cube", cube(96))])?)?.metered_ev100);
    Ok(worst(found.iter().map(|ev100| (ev100 - found[0]).abs())))
}
