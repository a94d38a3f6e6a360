//! A head that rolls, turns and moves sideways: the picture of an asteroid depends only on the position of the eye.

use glam::{DQuat, DVec3};

use super::{
    super::{
        Figure,
        context::{CheckError, Context, worst},
    },
    stage::{Detail, Light, Posed, bound_m, iou, silhouette, window},
};
use crate::view::{Rig, View, ViewKind};

/// Angle of a pixel of the windows, rad.
const PIXEL_RAD: f64 = 1e-3;
/// Number of tested orientations of the asteroid.
const ORIENTATIONS: usize = 6;
/// Sideways movement of the eyes, m: half of the asteroid's mean radius.
const ASIDE_M: f64 = 0.5;

/// A movement of the head: name, rotation from view axes to camera axes, position of the eye in m, and the resulting
/// angle of the asteroid off the axis, rad.
struct Movement {
    name: &'static str,
    turn: DQuat,
    eye_m: DVec3,
    off_axis_rad: f64,
}

fn movements() -> Vec<Movement> {
    let still = Movement { name: "at rest", turn: DQuat::IDENTITY, eye_m: DVec3::ZERO, off_axis_rad: 0.0 };
    let roll = |name, degrees: f64| Movement {
        name,
        turn: DQuat::from_rotation_z(degrees.to_radians()),
        eye_m: DVec3::ZERO,
        off_axis_rad: 0.0,
    };
    // To the left, so that the asteroid moves to the right.
    let yaw = |name, degrees: f64, roll: f64| Movement {
        name,
        turn: DQuat::from_rotation_y(degrees.to_radians()) * DQuat::from_rotation_z(roll),
        eye_m: DVec3::ZERO,
        off_axis_rad: degrees.to_radians(),
    };
    let aside = |name, x: f64| Movement { name, turn: DQuat::IDENTITY, eye_m: DVec3::X * x, off_axis_rad: 0.0 };
    vec![
        still,
        roll("rolled by 90 deg", 90.0),
        roll("rolled by 30 deg", 30.0),
        yaw("turned by 20 deg", 20.0, 0.0),
        yaw("turned by 40 deg", 40.0, 0.0),
        aside("left eye aside", -ASIDE_M),
        aside("right eye aside", ASIDE_M),
    ]
}

/// Compares silhouettes with the finest mesh after each movement, at the smallest distance at which impostors are
/// drawn. Also checks that the picture turns with the head. For this, a square picture is turned back by a quarter
/// turn, which is exact.
pub(in crate::verify) fn moves(context: &mut Context<'_>) -> Result<Vec<Figure>, CheckError> {
    let movements = movements();
    // With some quality settings, impostors start near the eye, so the size of the window depends on this setting. An
    // even size puts the axis between pixels.
    let side = 2 * (24.0 / context.settings.asteroids.quality.min(1.0)).ceil() as u32;
    let view = |index: usize, movement: &Movement| {
        let kind: ViewKind = window(side, PIXEL_RAD, movement.off_axis_rad);
        View::new(&format!("head-{index}"), kind, movement.turn, movement.eye_m)
    };
    let views = movements.iter().enumerate().map(|(index, movement)| view(index, movement));
    let rig = Rig::new(views.collect::<Result<_, _>>()?)?;
    let images: Vec<_> = rig.views().iter().flat_map(|view| &view.images).collect();
    let far_enough = images.iter().zip(&movements).map(|(image, movement)| {
        let (sin, cos) = movement.off_axis_rad.sin_cos();
        Detail::new(&context.settings.asteroids, &image.projection, DVec3::new(sin, 0.0, -cos), 0.0).nearest_m()
    });
    let distance_m = far_enough.fold(0.0, f64::max);

    let mut differing = vec![Vec::new(); movements.len()];
    let mut turned = Vec::new();
    for index in 0..ORIENTATIONS {
        let pose = Posed {
            place_m: DVec3::NEG_Z * distance_m,
            camera_from_shape: DQuat::from_rotation_x(1.0 + index as f64) * DQuat::from_rotation_y(0.7 * index as f64),
        };
        let [drawn, truth] = context.drawn_and_true(&[pose], Light::Wall, &rig)?;
        let mut silhouettes = Vec::new();
        for (number, ((drawn, truth), view_image)) in drawn.iter().zip(&truth).zip(&images).enumerate() {
            let to_asteroid =
                view_image.camera_from_view.conjugate() * (pose.place_m - view_image.eye_position_m).normalize();
            let within_rad = 1.5 * (bound_m() / distance_m).asin();
            let of_drawn = silhouette(drawn, view_image, to_asteroid, within_rad)?;
            differing[number].push(1.0 - iou(&of_drawn, &silhouette(truth, view_image, to_asteroid, within_rad)?));
            silhouettes.push(of_drawn);
        }
        turned.push(1.0 - iou(&silhouettes[0], &rolled_back(&silhouettes[1], side as usize)));
    }
    let figure = |(movement, differing): (&Movement, Vec<f64>)| {
        Figure::at_most(format!("1 - IoU, {}", movement.name), worst(differing), 0.05, "")
    };
    let mut figures: Vec<Figure> = movements.iter().zip(differing).map(figure).collect();
    // After the turn, rows of samples are where columns were. The only remaining differences are roundings of samples at an edge.
    figures.push(Figure::at_most("1 - IoU, rolled back by 90 deg", worst(turned), 0.01, ""));
    Ok(figures)
}

/// Turns a square picture upright that was drawn with the head rolled to the left by a quarter turn. The right side of this picture becomes the upper
/// side.
fn rolled_back(pixels: &[f64], side: usize) -> Vec<f64> {
    let pixel = |x: usize, y: usize| pixels.get(y * side + x).copied().unwrap_or(f64::NAN);
    // Look up the upright pixel (x, y) in the turned axes, in which right is up.
    (0..side * side).map(|index| pixel(side - 1 - index / side, index % side)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn head_rolled_left_sees_the_top_on_the_right() {
        // The upright picture has 1 at the top left, 2 at the top right, and 3 and 4 below. After the roll to the left,
        // the right side of the view is up in the world.
        let rolled = [3.0, 1.0, 4.0, 2.0];
        assert_eq!(rolled_back(&rolled, 2), vec![1.0, 2.0, 3.0, 4.0]);
    }
}
