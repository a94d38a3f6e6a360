//! Robustness of exposure: compares exposures if the same picture is cut into faces and windows, or seen with a rolled head.

use glam::{DQuat, DVec3};

use super::{
    Figure,
    context::{CheckError, Context, hdr_pixels, images, light_of_views_lx, worst},
    scenes::{cube, rig, snapshot, spiral, star},
};
use crate::{
    photometry::{exposure::mean_luminance_cd_m2, rec709::luminance},
    plan::settings::ExposureSettings,
    view::{Fov, ViewKind},
};

/// 23: compares the same sky as a map and as cube faces, a window with its halves, a rolling head, and a view drawn
/// twice in a frame.
pub(super) fn picture_cut(context: &mut Context<'_>) -> Result<Vec<Figure>, CheckError> {
    // `auto` chooses kernels by the displayed exposure of a frame. As in a stream, that exposure is the same for all
    // frames; the metered exposures are compared.
    context.settings.exposure = ExposureSettings::manual(-10.0);
    // The stars are concentrated on one side, so that a wrong weight is visible.
    let records = spiral(3000).enumerate().map(|(i, d)| star(d + 0.8 * DVec3::X, (i % 9) as f32)).collect();
    let mut scene = snapshot(records);
    let window = |left_rad: f64, right_rad: f64, width: u32| {
        let fov = Fov { left_rad, right_rad, up_rad: 0.6, down_rad: -0.6 };
        ViewKind::OffAxis { size: [width, 192], fov }
    };
    let whole_rig = rig([("whole", window(-0.6, 0.6, 192)), ("again", window(-0.6, 0.6, 192))])?;
    let halves_rig = rig([("left", window(-0.6, 0.0, 96)), ("right", window(0.0, 0.6, 96))])?;
    let map_rig = rig([("map", ViewKind::Equirectangular { size: [384, 192] })])?;
    let faces_rig = rig([("faces", cube(96))])?;

    let whole = context.render(&scene, &whole_rig)?;
    let halves = context.render(&scene, &halves_rig)?;
    let map = context.render(&scene, &map_rig)?;
    let faces = context.render(&scene, &faces_rig)?;
    let mut turned = Vec::new();
    for roll_rad in [0.4, 1.9] {
        scene.camera.world_from_camera = DQuat::from_rotation_z(roll_rad);
        turned.push(context.render(&scene, &map_rig)?.metered_ev100);
        turned.push(context.render(&scene, &faces_rig)?.metered_ev100);
    }

    let light_of_whole = light_of_views_lx(&whole, &whole_rig)?[0];
    let light_of_halves: f64 = light_of_views_lx(&halves, &halves_rig)?.iter().sum();
    let [one, again] = [0, 1].map(|index| whole.images.get(index).ok_or(CheckError::Missing("an image")));
    let bits = |pixels: &[[f32; 4]]| -> Vec<u32> { pixels.iter().flatten().map(|value| value.to_bits()).collect() };
    let (one, again) = (bits(hdr_pixels(one?)?), bits(hdr_pixels(again?)?));
    let differing = one.iter().zip(&again).filter(|(a, b)| a != b).count();

    // Recompute the exposure in f64 from the pixels of the faces.
    let mut pixels = Vec::new();
    for (image, of_view) in images(&faces, &faces_rig) {
        let mapping = of_view.projection.mapping();
        for (index, [r, g, b, _]) in (0..).zip(hdr_pixels(image)?) {
            let omega = mapping.solid_angle_sr(index % image.width, index / image.width);
            pixels.push([luminance([*r, *g, *b].map(f64::from)), omega]);
        }
    }
    let in_f64 = context.settings.exposure.metered_ev100(mean_luminance_cd_m2(pixels));

    let difference = |a: f64, b: f64| (a - b).abs();
    let rolled = worst(turned.iter().map(|ev100| difference(*ev100, map.metered_ev100)));
    Ok(vec![
        Figure::at_most("exposure of faces", difference(faces.metered_ev100, map.metered_ev100), 1e-3, "EV"),
        Figure::at_most("of halves", difference(halves.metered_ev100, whole.metered_ev100), 1e-3, "EV"),
        Figure::at_most("of a rolled head", rolled, 1e-3, "EV"),
        Figure::at_most("against f64", difference(faces.metered_ev100, in_f64), 0.01, "EV"),
        Figure::at_most("light of halves", (light_of_halves / light_of_whole - 1.0).abs(), 1e-4, "relative"),
        Figure::at_most("values that differ between two equal views", differing as f64, 0.0, ""),
    ])
}
