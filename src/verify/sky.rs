//! Whole skies: resolution, magnitude limits, flights, and stars at the camera.

use glam::DVec3;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::{
    Figure,
    context::{CheckError, Context, hdr_pixels, worst},
    scenes::{all_views, directions_inside, fisheye, rig, snapshot, spiral, star, star_at},
    star_light::light_of_the_sky,
};
use crate::{
    catalogue::StarRecord,
    units::{PARSEC_M, illuminance_lx_from_magnitude},
    view::{Rig, View, ViewKind, projection::FisheyeMapping},
};

/// Compares views of the whole sky with each other and with the catalogue.
pub(super) fn whole_sky(context: &mut Context<'_>) -> Result<Vec<Figure>, CheckError> {
    let (light, expected) = light_of_the_sky(context, 4, 3000)?;
    let pairs: Vec<_> = light.iter().map(|light| (*light, expected)).collect();
    let [most, least] = [f64::max, f64::min].map(|choose| light.iter().copied().reduce(choose).unwrap_or(f64::NAN));
    Ok(vec![
        Figure::at_most("between cube, equirectangular and fisheye", most / least - 1.0, 1e-3, "relative"),
        Figure::at_most("against the catalogue", context.worst_flux_error(&pairs)?, 1e-3, "relative"),
    ])
}

fn solid_angle_sr(rig: &Rig) -> f64 {
    rig.views().iter().flat_map(|view| &view.images).map(|image| image.projection.picture_solid_angle_sr()).sum()
}

/// 16: draws the same sky with twice as many pixels in both directions.
pub(super) fn resolution_doubled(context: &mut Context<'_>) -> Result<Vec<Figure>, CheckError> {
    let (once, _) = light_of_the_sky(context, 1, 2000)?;
    let (twice, _) = light_of_the_sky(context, 2, 2000)?;
    let mut changes: Vec<f64> = once.iter().zip(&twice).map(|(a, b)| (b / a - 1.0).abs()).collect();
    // These pictures have a border. The stars are inside, so that none is cut off.
    for (name, kind) in all_views().into_iter().take(2) {
        let ViewKind::Perspective { size, fov_y_rad } = kind else { continue };
        let mean = |context: &mut Context<'_>, factor: u32| -> Result<f64, CheckError> {
            let view = View::new(name, kind.clone(), glam::DQuat::IDENTITY, DVec3::ZERO)?;
            let records = directions_inside(&view, 60, 8).into_iter().map(|d| star(d, 3.0)).collect();
            let rig = rig([(name, ViewKind::Perspective { size: size.map(|side| side * factor), fov_y_rad })])?;
            Ok(context.light_lx(&snapshot(records), &rig)?[0] / solid_angle_sr(&rig))
        };
        changes.push((mean(context, 2)? / mean(context, 1)? - 1.0).abs());
    }
    Ok(vec![Figure::at_most("mean luminance", worst(changes), 1e-3, "relative")])
}

/// 17: moves the magnitude limit star by star. The limit must remove exactly the light of the fainter stars.
pub(super) fn cut_moved(context: &mut Context<'_>) -> Result<Vec<Figure>, CheckError> {
    let magnitude = |i: usize| 0.25 + 0.5 * ((i * 7) % 16) as f32;
    let scene = snapshot(spiral(3000).enumerate().map(|(i, d)| star(d, magnitude(i))).collect());
    let rig = rig([("v", ViewKind::Equirectangular { size: [512, 256] })])?;
    let mut pairs = Vec::new();
    for limit in [3.0, 4.0, 5.0, 6.0, 7.0, 99.0] {
        context.settings.stars.magnitude_limit = limit;
        let brighter = (0..3000).map(|i| f64::from(magnitude(i))).filter(|magnitude| *magnitude < limit);
        let expected = brighter.map(illuminance_lx_from_magnitude).sum();
        pairs.push((context.light_lx(&scene, &rig)?[0], expected));
    }
    Ok(vec![Figure::at_most("light of the stars above the cut", context.worst_flux_error(&pairs)?, 1e-4, "relative")])
}

/// 18: flies among stars. The expected light of every step follows from the stars' distances; any additional jump is a pop.
pub(super) fn flight(context: &mut Context<'_>) -> Result<Vec<Figure>, CheckError> {
    const STEPS: u32 = 40;
    let mut random = ChaCha8Rng::seed_from_u64(7);
    let mut place = || DVec3::from_array([0; 3].map(|_| random.random::<f64>() * 16.0 - 8.0));
    let mut records: Vec<StarRecord> = (0..1500).map(|i| star_at(place(), (i % 9) as f32)).collect();
    // One star is next to the path.
    records.push(star_at(DVec3::new(0.52, 0.03, 0.01), 6.0));
    let rig = rig([("v", ViewKind::Equirectangular { size: [256, 128] })])?;
    let mut scene = snapshot(records.clone());
    let mut pairs = Vec::new();
    for step in 0..=STEPS {
        let camera_pc = DVec3::X * (f64::from(step) / f64::from(STEPS));
        scene.camera.position_m = camera_pc * PARSEC_M;
        let light = |r: &StarRecord| {
            illuminance_lx_from_magnitude(f64::from(r.magnitude)) * 100.0 / (r.position - camera_pc).length_squared()
        };
        pairs.push((context.light_lx(&scene, &rig)?[0], records.iter().map(light).sum()));
    }
    let scale = context.scale(&pairs)?;
    let ratios: Vec<f64> = pairs.iter().map(|(found, expected)| scale * found / expected).collect();
    let pop = worst(ratios.windows(2).map(|pair| (pair[1] - pair[0]).abs()));
    Ok(vec![
        Figure::at_most("jump of the light between steps", pop, context.settings.accuracy.flux, "relative"),
        Figure::at_most("light", context.worst_flux_error(&pairs)?, context.settings.accuracy.flux, "relative"),
    ])
}

/// 19: draws a star at the camera's position, behind it, and a millionth of a parsec away.
pub(super) fn near_camera(context: &mut Context<'_>) -> Result<Vec<Figure>, CheckError> {
    let rig = rig([
        ("all", ViewKind::Equirectangular { size: [64, 32] }),
        ("flat", ViewKind::Perspective { size: [64, 64], fov_y_rad: 1.0 }),
        ("fisheye", fisheye(64, FisheyeMapping::Stereographic, 286.0)),
    ])?;
    let absolute = 4.8_f32;
    // Illuminance at 10 pc, the reference distance of absolute magnitudes.
    let at_10_pc = illuminance_lx_from_magnitude(f64::from(absolute));
    let (mut not_finite, mut pairs) = (0_u64, Vec::new());
    for position in [DVec3::ZERO, DVec3::Z, DVec3::NEG_Z * 1e-6, DVec3::Z * 1e-6, DVec3::new(1e-6, -1e-6, 0.0)] {
        let scene = snapshot(vec![star_at(position, absolute), star_at(DVec3::NEG_Z * 10.0, absolute)]);
        let frame = context.render(&scene, &rig)?;
        not_finite += u64::from(!frame.exposure_ev100.is_finite());
        for image in &frame.images {
            not_finite += hdr_pixels(image)?.iter().flatten().filter(|value| !value.is_finite()).count() as u64;
        }
        let near = if position == DVec3::ZERO { 0.0 } else { at_10_pc * 100.0 / position.length_squared() };
        if not_finite == 0 {
            pairs.push((super::context::light_of_views_lx(&frame, &rig)?[0], at_10_pc + near));
        }
    }
    let mut figures = vec![Figure::at_most("values that are not finite", not_finite as f64, 0.0, "")];
    if not_finite == 0 {
        figures.push(Figure::at_most("light", context.worst_flux_error(&pairs)?, 1e-4, "relative"));
    }
    Ok(figures)
}
