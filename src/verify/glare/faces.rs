//! One sky shown in several ways: cut into the faces of a cube, cut into strips, and seen with a rolling head.

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
    plan::settings::{ExposureSettings, Metering},
    render::{Frame, FrameImage, FrameRequest, Renderer, Wanted},
    scene::SceneSnapshot,
    view::{Rig, ViewKind, projection::FisheyeMapping},
};

/// Number of directions in which views are compared.
const DIRECTIONS: usize = 400;
/// Minimum distance of these directions from every star, pixels of the coarsest picture. Nearer to a star, pixels of
/// different shapes show different light.
const APART_PX: f64 = 4.0;
/// Number of stars in the sky.
const STARS: usize = 40;
/// Maximum size of a strip: 19 rows of 128 pixels of 16 bytes, bytes.
const STRIP_BYTES: u64 = 128 * 16 * 19;

fn whole_spheres() -> [(&'static str, ViewKind); 3] {
    [
        ("cube", cube(96)),
        ("equirectangular", ViewKind::Equirectangular { size: [384, 192] }),
        ("fisheye-360", fisheye(256, FisheyeMapping::Equidistant, 360.0)),
    ]
}

/// 23: compares the same sky in cube faces, in equirectangular and fisheye views, in strips, and with a rolling head.
pub(in crate::verify) fn cut_into_faces(context: &mut Context<'_>) -> Result<Vec<Figure>, CheckError> {
    let scene = snapshot(spiral(STARS).enumerate().map(|(i, d)| star(d, (i % 7) as f32)).collect());
    let kernel = context.expected_kernel()?;
    context.scatter_all();
    let all = rig(whole_spheres().into_iter().chain([("again", whole_spheres()[1].1.clone())]))?;
    let frame =
        context.renderer.render(FrameRequest::new(&scene, &all).settings(&context.settings).wanted(Wanted::both()))?;
    let (between, upright) = between_views(&scene, &all, &frame, &*kernel)?;

    // Two equal views of one frame have identical bits, including those of the display images.
    let of_view = |index: usize| frame.images.iter().filter(move |image| image.view == index);
    let pairs: Vec<_> = of_view(1).zip(of_view(3)).collect();
    let mut different = if pairs.is_empty() { f64::NAN } else { 0.0 };
    for (one, other) in pairs {
        different += different_pixels(one, other)?;
        different += f64::from(u8::from(one.display.is_none() || one.display != other.display));
    }

    // Roll the head: turn the camera about its viewing axis.
    let mut rolled = scene.clone();
    rolled.camera.world_from_camera = DQuat::from_rotation_z(TAU / 12.0);
    let rolled_frame = context.render(&rolled, &all)?;
    let (_, turned) = between_views(&rolled, &all, &rolled_frame, &*kernel)?;
    let of_roll = worst(upright.iter().zip(&turned).map(|(upright, turned)| largest_difference(&[*upright, *turned])));

    Ok(vec![
        Figure::at_most("veil between cube, equirectangular and fisheye", between, 0.02, "relative"),
        Figure::at_most("between upright and rolled", of_roll, 0.02, "relative"),
        Figure::at_most("pixels that differ between equal views", different, 0.0, ""),
        Figure::at_most("pixels that strips change", strips(context, &scene)?, 0.0, ""),
        Figure::at_most("exposure between views and rolls", exposures(context, &scene, &rolled)?, 1e-3, "EV"),
    ])
}

/// Compares the ratios of scattered light to the kernel's prediction in directions (world axes) far from every star.
/// Returns the largest difference between views, and the means over the views. The prediction is for the pixel that
/// shows the direction, so the size of pixels and the position of their centres do not matter.
fn between_views(
    scene: &SceneSnapshot,
    rig: &Rig,
    frame: &Frame,
    kernel: &dyn GlareKernel,
) -> Result<(f64, Vec<f64>), CheckError> {
    let pictures = pictures(scene, rig, frame)?;
    let camera_from_world = scene.camera.world_from_camera.conjugate();
    let apart_rad =
        APART_PX * pictures.iter().map(|picture| picture.view_image.projection.middle_pixel_rad()).fold(0.0, f64::max);
    let is_apart = |direction: &DVec3| {
        scene.stars.iter().all(|(place, _, _)| place.normalize_or_zero().angle_between(*direction) > apart_rad)
    };
    let (mut differences, mut means) = (Vec::new(), Vec::new());
    for direction in spiral(DIRECTIONS).filter(is_apart) {
        let camera_direction = camera_from_world * direction;
        let ratio = |view: &crate::view::View| {
            let shows =
                |picture: &Picture<'_>| picture.pixel_of(camera_direction).filter(|_| picture.name == view.name);
            let found = pictures.iter().find_map(|picture| Some((picture, shows(picture)?)));
            found.map_or(f64::NAN, |(picture, pixel)| picture.ratio(kernel, pixel))
        };
        let ratios: Vec<f64> = rig.views().iter().map(ratio).collect();
        differences.push(largest_difference(&ratios));
        means.push(ratios.iter().sum::<f64>() / ratios.len() as f64);
    }
    Ok((worst(differences), means))
}

/// Returns the ratio of the largest to the smallest value, minus 1; NaN if a value is NaN or all values are 0.
fn largest_difference(values: &[f64]) -> f64 {
    worst(values.iter().flat_map(|a| values.iter().map(move |b| (a / b - 1.0).abs())))
}

fn different_pixels(one: &FrameImage, other: &FrameImage) -> Result<f64, CheckError> {
    let (one, other) = (hdr_pixels(one)?, hdr_pixels(other)?);
    let pairs = one.iter().zip(other).filter(|(a, b)| a.map(f32::to_bits) != b.map(f32::to_bits));
    Ok((pairs.count() + one.len().abs_diff(other.len())) as f64)
}

/// Draws with a limit on buffers, as on an adapter that cannot hold a whole picture. Counts the pixels that differ from pictures without that limit.
fn strips(context: &mut Context<'_>, scene: &SceneSnapshot) -> Result<f64, CheckError> {
    let rig = rig([("flat", flat(128, 90.0)), ("dome", fisheye(128, FisheyeMapping::Equidistant, 180.0))])?;
    let whole = context.render(scene, &rig)?;
    let options = GpuOptions { binding_limit_bytes: Some(STRIP_BYTES), ..context.renderer.gpu_options().clone() };
    let mut renderer = Renderer::new(Gpu::open(&options)?);
    let cut = renderer.render(FrameRequest::new(scene, &rig).settings(&context.settings).wanted(Wanted::hdr()))?;
    let mut different = 0.0;
    for (one, other) in whole.images.iter().zip(&cut.images) {
        different += different_pixels(one, other)?;
    }
    Ok(if whole.images.len() == cut.images.len() { different } else { f64::NAN })
}

/// Returns the largest difference in mean exposure, EV, between views of the whole sphere, each drawn alone, and
/// between one of them and its picture with the head rolled. It uses the scattered fraction of the settings, because
/// the metered light includes stars.
fn exposures(context: &mut Context<'_>, scene: &SceneSnapshot, rolled: &SceneSnapshot) -> Result<f64, CheckError> {
    context.settings.glare = context.glare.clone();
    context.settings.exposure = ExposureSettings::auto(Metering::Mean);
    let mut found = Vec::new();
    for kind in whole_spheres() {
        found.push(context.render(scene, &rig([kind])?)?.metered_ev100);
    }
    found.push(context.render(rolled, &rig([("cube", cube(96))])?)?.metered_ev100);
    Ok(worst(found.iter().map(|ev100| (ev100 - found[0]).abs())))
}
