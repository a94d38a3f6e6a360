//! Checks which pictures of an atlas a method shows: the errors of their directions, how many of them are ever used,
//! and how far the picture swings when an asteroid is tilted slightly. The checks run on the CPU, with the functions
//! with which the shaders are compared.

use std::{collections::BTreeSet, f64::consts::TAU};

use glam::{DMat3, DQuat, DVec3};

use super::super::{
    Figure,
    context::{CheckError, Context},
    scenes::spiral,
};
use crate::plan::asteroids::{
    ImpostorMethod,
    bounds::direction_error_bound_rad,
    tiles::{
        AtlasLayout, angle_between_rad, direction_error_rad, euler, octahedral, rotation_angle_rad,
        shown_view_from_shape, tiles_shown,
    },
};

/// Number of tested orientations.
const ORIENTATIONS: usize = 40_000;

/// Returns rotations spread over all orientations. Directions are spread evenly; the turns about them follow the golden angle.
fn orientations(count: usize) -> impl Iterator<Item = DMat3> {
    spiral(count).enumerate().map(|(index, towards)| {
        let turn = DQuat::from_rotation_z((index as f64 * 0.618_033_988_749_895).fract() * TAU);
        DMat3::from_quat(turn * DQuat::from_rotation_arc(towards, DVec3::Z))
    })
}

/// Returns the mean and the maximum, degrees.
fn mean_and_greatest_deg(angles_rad: impl Iterator<Item = f64>) -> [f64; 2] {
    let (mut sum, mut greatest, mut count) = (0.0, 0.0_f64, 0.0);
    for angle in angles_rad {
        (sum, greatest, count) = (sum + angle, greatest.max(angle), count + 1.0);
    }
    [sum / count, greatest].map(f64::to_degrees)
}

/// Measures the weaknesses of atlases for the method under test; without impostors there are no errors.
pub(in crate::verify) fn tiles(context: &mut Context<'_>) -> Result<Vec<Figure>, CheckError> {
    let (method, tiles) = (context.settings.asteroids.impostor.chosen(), context.settings.asteroids.tiles);
    let (Some(layout), Some(bound_rad)) = (AtlasLayout::for_method(method), direction_error_bound_rad(method, tiles))
    else {
        return Ok(vec![Figure::informative("no impostors, tiles", 0.0, "")]);
    };
    let error = |to_eye: DVec3| {
        let errors = orientations(ORIENTATIONS)
            .map(|orientation| direction_error_rad(method, orientation, to_eye, tiles).unwrap_or(f64::NAN));
        mean_and_greatest_deg(errors)
    };
    let [mean, greatest] = error(DVec3::Z);
    // The asteroid is 35 degrees to the left, so the eye is to its right.
    let (sin, cos) = 35.0_f64.to_radians().sin_cos();
    let [mean_aside, greatest_aside] = error(DVec3::new(sin, 0.0, cos));
    let bound_deg = bound_rad.to_degrees();
    let mut shown = BTreeSet::new();
    for orientation in orientations(4 * ORIENTATIONS) {
        shown.extend(match layout {
            AtlasLayout::Euler => {
                Some(euler::tile(euler::Angles::from_rotation(orientation), tiles, euler::Rounding::Up))
            }
            AtlasLayout::Octahedral => Some(octahedral::nearest(orientation.transpose() * DVec3::Z, tiles)),
        });
    }
    let all = f64::from(tiles * tiles);
    Ok(vec![
        Figure::informative("direction error, mean", mean, "deg"),
        Figure::at_most("greatest", greatest, bound_deg, "deg"),
        Figure::informative("35 deg off the axis, mean", mean_aside, "deg"),
        Figure::at_most("greatest", greatest_aside, bound_deg, "deg"),
        Figure::informative("tiles shown", shown.len() as f64, ""),
        Figure::at_most("share never shown", 1.0 - shown.len() as f64 / all, 0.0, ""),
        Figure::at_most(
            "tilted by 0.06 deg near a pole, the lookup moves",
            swing_deg(method, tiles),
            0.1,
            "deg further",
        ),
        Figure::at_most("loss of width 35 deg off the axis", narrower(method), 0.01, "relative"),
    ])
}

/// Returns by how many degrees the lookup in an atlas changes: its position, and the turn of the picture. The asteroid,
/// whose gimbal pole is 0.129 degrees from the eye, is tilted by 0.06 degrees.
fn swing_deg(method: ImpostorMethod, tiles: u32) -> f64 {
    let (from_pole, tilt) = (0.129_f64.to_radians(), 0.06_f64.to_radians());
    if AtlasLayout::for_method(method) == Some(AtlasLayout::Euler) {
        let [pitch, roll] = euler::pole_swing_rad(from_pole, tilt);
        return pitch.max(roll).to_degrees();
    }
    let before = DMat3::from_quat(
        DQuat::from_rotation_arc(DVec3::X, DVec3::Z) * DQuat::from_rotation_y(from_pole) * DQuat::from_rotation_x(0.3),
    );
    let after = DMat3::from_rotation_y(tilt) * before;
    // The direction alone determines the lookup position.
    let entered = [before, after].map(|view_from_shape| view_from_shape.transpose() * DVec3::Z);
    let direction = angle_between_rad(entered[0], entered[1]);
    // The picture of the same tile follows the asteroid.
    let turn = tiles_shown(method, before, DVec3::Z, tiles).and_then(|shown| {
        let picture = |view_from_shape| shown_view_from_shape(method, shown[0].0, view_from_shape, DVec3::Z, tiles);
        Some(rotation_angle_rad(picture(before)?, picture(after)?))
    });
    (direction.max(turn.unwrap_or(f64::NAN)) - tilt).to_degrees().max(0.0)
}

/// Returns by how much a small square is narrower 35 degrees off the axis than straight ahead, relative.
fn narrower(method: ImpostorMethod) -> f64 {
    let (sin, cos) = 35.0_f64.to_radians().sin_cos();
    let middle = 1e4 * DVec3::new(sin, 0.0, -cos);
    let along = match AtlasLayout::for_method(method) {
        // Parallel to the image plane.
        Some(AtlasLayout::Euler) => DVec3::X,
        // Perpendicular to the line of sight.
        _ => DVec3::new(cos, 0.0, sin),
    };
    1.0 - 1e4 * angle_between_rad(middle - 0.5 * along, middle + 0.5 * along)
}
