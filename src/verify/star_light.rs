//! The light of stars: checks that every view shows the illuminance of the catalogue, wherever the star is.

use std::f64::consts::PI;

use glam::{DQuat, DVec2, DVec3};

use super::{
    Figure,
    context::{CheckError, Context, hdr_pixels, images, light_of_views_lx, worst, worst_error},
    scenes::{all_views, directions_inside, fisheye, hard_places, rig, snapshot, spiral, star},
    solid_angle::whole_sky,
};
use crate::{
    metrics::relative_variation,
    units::illuminance_lx_from_magnitude,
    view::{
        View, ViewKind,
        projection::{FisheyeMapping, Perspective},
    },
};

/// 5: stars on both poles and next to them.
pub(super) fn pole(context: &mut Context<'_>) -> Result<Vec<Figure>, CheckError> {
    let rig = rig([("v", ViewKind::Equirectangular { size: [256, 128] })])?;
    let mut pairs = Vec::new();
    for pole in [DVec3::Y, DVec3::NEG_Y] {
        for (x, z) in [(0.0, 0.0), (1e-7, 0.0), (1e-3, -2e-3), (-0.012, 0.004), (0.02, 0.03)] {
            let light = context.light_lx(&snapshot(vec![star(pole + DVec3::new(x, 0.0, z), 2.0)]), &rig)?;
            pairs.push((light[0], illuminance_lx_from_magnitude(2.0)));
        }
    }
    Ok(vec![Figure::at_most("light", context.worst_flux_error(&pairs)?, 1e-4, "relative")])
}

/// 6: flat views of 150 to 178 degrees; wider views must be refused with a message that gives the limit.
pub(super) fn wide_perspective(context: &mut Context<'_>) -> Result<Vec<Figure>, CheckError> {
    let (mut pairs, mut solid_angles) = (Vec::new(), Vec::new());
    for degrees in [150.0_f64, 160.0, 170.0, 178.0] {
        let rig = rig([("v", ViewKind::Perspective { size: [255, 255], fov_y_rad: degrees.to_radians() })])?;
        let mapping = rig.views()[0].images[0].projection.mapping();
        // Stars from the centre towards an edge and towards a corner.
        for part in [0.0, 0.3, 0.6, 0.9] {
            for axis in [DVec2::X, DVec2::ONE, DVec2::new(-0.4, 1.0)] {
                let pixel = DVec2::splat(127.5) + axis * 127.5 * part;
                let direction = mapping.direction_from_pixel(pixel).ok_or(CheckError::Missing("a direction"))?;
                let frame = context.render(&snapshot(vec![star(direction, 2.0)]), &rig)?;
                let expected = illuminance_lx_from_magnitude(2.0) * context.share_inside(mapping, direction);
                pairs.push((light_of_views_lx(&frame, &rig)?[0], expected));
                if part == 0.0 {
                    for (index, pixel) in hdr_pixels(&frame.images[0])?.iter().enumerate() {
                        let exact = mapping.solid_angle_sr(index as u32 % 255, index as u32 / 255);
                        solid_angles.push((f64::from(pixel[3]) / exact - 1.0).abs());
                    }
                }
            }
        }
    }
    let refused = |degrees: &f64| {
        let answer = Perspective::symmetric([255, 255], degrees.to_radians());
        answer.is_err_and(|error| error.to_string().contains("178 degrees"))
    };
    let accepted = [178.5, 180.0, 200.0, 360.0].iter().filter(|degrees| !refused(degrees)).count();
    Ok(vec![
        Figure::at_most("light up to 178 degrees", context.worst_flux_error(&pairs)?, 1e-3, "relative"),
        Figure::at_most("solid angle", worst(solid_angles), 1e-4, "relative"),
        Figure::at_most("wider fields not refused", accepted as f64, 0.0, ""),
    ])
}

/// 7: stars from the centre of a picture outwards.
pub(super) fn centre_to_corner(context: &mut Context<'_>) -> Result<Vec<Figure>, CheckError> {
    let kinds = [
        ("perspective", ViewKind::Perspective { size: [192, 108], fov_y_rad: PI / 3.0 }),
        ("perspective-150", ViewKind::Perspective { size: [160, 160], fov_y_rad: 150f64.to_radians() }),
        ("equidistant-180", fisheye(160, FisheyeMapping::Equidistant, 180.0)),
        ("stereographic-220", fisheye(160, FisheyeMapping::Stereographic, 220.0)),
    ];
    let mut worst_variation = (0.0, "");
    for (name, kind) in kinds {
        let round = matches!(kind, ViewKind::Fisheye { .. });
        let rig = rig([(name, kind)])?;
        let mapping = rig.views()[0].images[0].projection.mapping();
        let [width, height] = mapping.size().map(f64::from);
        let middle = DVec2::new(width, height) / 2.0;
        // The last star is eight pixels inside, so that no kernel is cut.
        let outwards = if round { DVec2::X * (width / 2.0 - 8.0) } else { middle - 8.0 };
        let mut light = Vec::new();
        for step in 0..=24 {
            let pixel = middle + outwards * (f64::from(step) / 24.0);
            let direction = mapping.direction_from_pixel(pixel).ok_or(CheckError::Missing("a direction"))?;
            let share = context.share_inside(mapping, direction);
            light.extend(
                context.light_lx(&snapshot(vec![star(direction, 2.0)]), &rig)?.into_iter().map(|lx| lx / share),
            );
        }
        let variation = relative_variation(&light)?;
        if variation >= worst_variation.0 {
            worst_variation = (variation, name);
        }
    }
    let (variation, name) = worst_variation;
    Ok(vec![Figure::at_most(format!("variation of the light, {name}"), variation, 1e-4, "relative")])
}

/// 8: stars across every edge and corner of a cube, the poles, the date line, and the antipode of a full fisheye.
pub(super) fn edges_corners_poles(context: &mut Context<'_>) -> Result<Vec<Figure>, CheckError> {
    let rig = rig(whole_sky(1))?;
    let mut pairs = vec![Vec::new(); 3];
    for place in hard_places() {
        let across = place.any_orthonormal_vector();
        for step in [-3.0, -1.0, 0.0, 1.0, 2.0] {
            // Sub-pixel steps across the place, and the place itself.
            let swept = place + across * (step * 0.013) + place.cross(across) * (step * 0.004);
            let light = context.light_lx(&snapshot(vec![star(swept, 2.0)]), &rig)?;
            for (of_view, light) in pairs.iter_mut().zip(light) {
                of_view.push((light, illuminance_lx_from_magnitude(2.0)));
            }
        }
    }
    let figure = |(view, pairs): (&View, &Vec<(f64, f64)>)| {
        let error = context.worst_flux_error(pairs)?;
        Ok(Figure::at_most(format!("light, {}", view.name), error, 1e-4, "relative"))
    };
    rig.views().iter().zip(&pairs).map(figure).collect()
}

/// Draws stars of several magnitudes, each magnitude in a separate catalogue, at 50 directions in every projection.
pub(super) fn every_projection(context: &mut Context<'_>) -> Result<Vec<Figure>, CheckError> {
    let magnitudes = [-1.0_f32, 2.0, 6.0, 15.0];
    let mut pairs = Vec::new();
    for (name, kind) in all_views() {
        let view = View::new(name, kind.clone(), DQuat::IDENTITY, DVec3::ZERO)?;
        let directions = directions_inside(&view, 50, 8);
        let eyes = if matches!(kind, ViewKind::Stereo { .. }) { 2.0 } else { 1.0 };
        let rig = rig([(name, kind)])?;
        for magnitude in magnitudes {
            let expected = illuminance_lx_from_magnitude(f64::from(magnitude)) * directions.len() as f64 * eyes;
            let records = directions.iter().map(|direction| star(*direction, magnitude)).collect();
            let light: f64 = context.light_lx(&snapshot(records), &rig)?.iter().sum();
            pairs.push((light, expected));
        }
    }
    let faint = pairs.iter().copied().skip(magnitudes.len() - 1).step_by(magnitudes.len()).collect::<Vec<_>>();
    let bright: Vec<_> = pairs.iter().enumerate().filter(|(i, _)| i % magnitudes.len() != 3).map(|(_, p)| *p).collect();
    let scale = context.scale(&bright)?;
    Ok(vec![
        Figure::at_most("light of magnitudes -1, 2, 6", worst_error(scale, &bright), 1e-3, "relative"),
        Figure::at_most("of magnitude 15", worst_error(scale, &faint), 1e-3, "relative"),
    ])
}

/// Measures three views of the whole sky with the same stars.
pub(super) fn light_of_the_sky(
    context: &mut Context<'_>,
    scale: u32,
    stars: usize,
) -> Result<(Vec<f64>, f64), CheckError> {
    let magnitude = |i: usize| (i % 8) as f32;
    let scene = snapshot(spiral(stars).enumerate().map(|(i, d)| star(d, magnitude(i))).collect());
    let expected = (0..stars).map(|i| illuminance_lx_from_magnitude(f64::from(magnitude(i)))).sum();
    let rig = rig(whole_sky(scale))?;
    let frame = context.render(&scene, &rig)?;
    // Every image must exist: a missing one would only look dark.
    if images(&frame, &rig).count() != 8 {
        return Err(CheckError::Missing("an image"));
    }
    Ok((light_of_views_lx(&frame, &rig)?, expected))
}
