#![allow(clippy::unwrap_used, reason = "tests")]

use std::collections::BTreeSet;

use glam::{DMat3, DQuat, DVec3};

use super::{
    super::ImpostorMethod::{EulerAtlas, Octahedral, OctahedralBlend},
    euler::{Angles, Rounding},
    *,
};

const N: u32 = 32;

/// Numbers that are evenly distributed from 0 to 1, by the additive recurrence of the plastic number's generalisation (Roberts 2018).
fn spread(i: u32, axis: i32) -> f64 {
    let g: f64 = 1.220_744_084_605_759_6;
    (0.5 + f64::from(i) * g.powi(-axis)).fract()
}

/// Evenly distributed rotations (Shoemake 1992).
fn rotations(count: u32) -> impl Iterator<Item = DMat3> {
    (0..count).map(|i| {
        let (u, v, w) = (spread(i, 1), spread(i, 2) * std::f64::consts::TAU, spread(i, 3) * std::f64::consts::TAU);
        let (a, b) = ((1.0 - u).sqrt(), u.sqrt());
        DMat3::from_quat(DQuat::from_xyzw(a * v.sin(), a * v.cos(), b * w.sin(), b * w.cos()))
    })
}

/// Mean and greatest of angles, degrees.
fn mean_and_max(angles: impl Iterator<Item = f64>) -> [f64; 2] {
    let (mut sum, mut max, mut count) = (0.0, 0.0_f64, 0.0);
    for angle in angles {
        (sum, max, count) = (sum + angle, max.max(angle), count + 1.0);
    }
    [sum / count, max].map(f64::to_degrees)
}

fn euler_errors(rounding: Rounding) -> [f64; 2] {
    mean_and_max(rotations(100_000).map(|view_from_shape| {
        let tile = euler::tile(Angles::from_rotation(view_from_shape), N, rounding);
        angle_between_rad(euler::axes(tile, N).direction, view_from_shape.row(2))
    }))
}

#[test]
fn euler_angles_without_rounding_give_the_exact_picture_at_the_centre() {
    for view_from_shape in rotations(1000) {
        let angles = Angles::from_rotation(view_from_shape);
        assert!(angles.matrix().abs_diff_eq(view_from_shape, 1e-12));
    }
    // If the shape has the angles of a tile, the tile's picture turned by the roll is the picture of the shape.
    for (column, row) in [(0, 0), (3, 5), (31, 29), (17, 2)] {
        let tile = AtlasTile { column, row };
        for roll in [0.0, 1.0, -2.5] {
            let view_from_shape = DMat3::from_rotation_z(roll) * euler::axes(tile, N).shape_from_tile().transpose();
            // Round to the nearest tile: rounding up would depend on the last digit.
            assert_eq!(euler::tile(Angles::from_rotation(view_from_shape), N, Rounding::Nearest), tile);
            let displayed = shown_view_from_shape(EulerAtlas, tile, view_from_shape, DVec3::Z, N).unwrap();
            assert!(rotation_angle_rad(displayed, view_from_shape) < 1e-7);
        }
    }
}

#[test]
fn the_published_choice_has_the_measured_error() {
    let up = euler_errors(Rounding::Up);
    let nearest = euler_errors(Rounding::Nearest);
    println!("euler_atlas, direction error: up {up:.2?} deg, nearest {nearest:.2?} deg (mean, max)");
    assert!((up[0] - 7.8).abs() < 0.1 && (up[1] - 15.7).abs() < 0.3, "{up:?}");
    assert!((nearest[0] - 3.9).abs() < 0.1 && (nearest[1] - 7.9).abs() < 0.2, "{nearest:?}");
    let whole = mean_and_max(rotations(20_000).map(|v| orientation_error_rad(EulerAtlas, v, DVec3::Z, N).unwrap()));
    println!("euler_atlas, orientation error: {whole:.2?} deg");
    assert!(
        whole[0] > up[0] && whole[1] < (2.0 * (std::f64::consts::PI / 32.0).cos().powi(2).acos()).to_degrees() + 1e-6
    );
}

#[test]
fn only_about_half_of_the_published_tiles_can_be_displayed() {
    let displayed = |rounding| -> BTreeSet<AtlasTile> {
        let poles = (0..64).map(|i| Angles {
            pitch_rad: 0.1 * f64::from(i),
            yaw_rad: -0.5 * std::f64::consts::PI,
            roll_rad: 0.0,
        });
        rotations(200_000)
            .map(Angles::from_rotation)
            .chain(poles)
            .map(|angles| euler::tile(angles, N, rounding))
            .collect()
    };
    let (up, nearest) = (displayed(Rounding::Up), displayed(Rounding::Nearest));
    println!("euler_atlas: {} tiles rounding up, {} nearest, of {}", up.len(), nearest.len(), N * N);
    assert_eq!((up.len(), nearest.len()), (544, 544));
    assert_eq!(reachable_tiles(AtlasLayout::Euler, N), 544);
    let octahedral: BTreeSet<AtlasTile> = rotations(100_000).map(|v| octahedral::nearest(v.row(2), N)).collect();
    assert_eq!(octahedral.len() as u32, reachable_tiles(AtlasLayout::Octahedral, N));
}

#[test]
fn near_the_published_poles_pitch_and_roll_change_fast() {
    let tilt = 0.06_f64.to_radians();
    for from_pole_deg in [0.01_f64, 0.1, 0.129, 1.0, 10.0] {
        let [pitch, roll] = euler::pole_swing_rad(from_pole_deg.to_radians(), tilt).map(f64::to_degrees);
        println!(
            "euler_atlas, {from_pole_deg} deg from the pole, tilt 0.06 deg: pitch {pitch:.1} deg, roll {roll:.1} deg"
        );
        let expected = (tilt.tan() / from_pole_deg.to_radians().sin()).atan().to_degrees();
        assert!((pitch - expected).abs() < 1e-6 && (roll - expected).abs() < 0.1, "{pitch} {roll} {expected}");
    }
    let [pitch, roll] = euler::pole_swing_rad(0.129_f64.to_radians(), tilt).map(f64::to_degrees);
    assert!((pitch - 25.0).abs() < 0.2 && (roll - 25.0).abs() < 0.2);
}

#[test]
fn the_octahedral_choices_have_the_measured_errors() {
    let error = |method| mean_and_max(rotations(100_000).map(|v| direction_error_rad(method, v, DVec3::Z, N).unwrap()));
    let (one, three) = (error(Octahedral), error(OctahedralBlend));
    println!("octahedral: {one:.3?} deg; octahedral_blend: {three:.3?} deg (mean, max)");
    assert!((one[0] - 2.8).abs() < 0.3, "{one:?}");
    assert!(three[0] < 0.15, "{three:?}");
    let whole = mean_and_max(rotations(1000).map(|v| orientation_error_rad(Octahedral, v, DVec3::Z, N).unwrap()));
    assert!(whole[1] <= one[1] + 1e-6);
}

#[test]
fn the_map_is_invertible_and_axes_are_right_handed() {
    for v in rotations(5000) {
        let d = v.row(2);
        assert!(octahedral::decode(octahedral::encode(d)).abs_diff_eq(d, 1e-12));
    }
    for layout in [AtlasLayout::Euler, AtlasLayout::Octahedral] {
        for index in 0..N * N {
            let axes = layout.axes(AtlasTile { column: index % N, row: index / N }, N);
            let m = axes.shape_from_tile();
            assert!((m.transpose() * m).abs_diff_eq(DMat3::IDENTITY, 1e-12) && m.determinant() > 0.0);
            let tile = AtlasTile { column: index % N, row: index / N };
            let middle = octahedral::decode(octahedral::middle(tile, N));
            assert!(layout == AtlasLayout::Euler || middle.abs_diff_eq(axes.direction, 1e-12));
            // A tile on the fold has the axes of the upper half, even if rounding changes z = 0.
            let on_fold = layout == AtlasLayout::Octahedral && axes.direction.z.abs() < 1e-9;
            assert!(!on_fold || axes.right.x >= 0.0 && axes.direction.z == 0.0);
        }
    }
}

/// Greatest change of any tile's weight in a step of `step` rad along a circle, for circles all over the sphere.
fn weight_jump(blend: impl Fn(DVec3) -> [(AtlasTile, f64); 3], step: f64) -> f64 {
    let mut worst = 0.0_f64;
    for circle in rotations(40) {
        let mut before: Option<[(AtlasTile, f64); 3]> = None;
        for i in 0..(std::f64::consts::TAU / step) as u32 {
            let (sin, cos) = (f64::from(i) * step).sin_cos();
            let now = blend(circle * DVec3::new(cos, sin, 0.0));
            let weight = |of: &[(AtlasTile, f64); 3], tile| of.iter().filter(|t| t.0 == tile).map(|t| t.1).sum::<f64>();
            assert!((now.iter().map(|t| t.1).sum::<f64>() - 1.0).abs() < 1e-12 && now.iter().all(|t| t.1 > -1e-12));
            if let Some(before) = before {
                for (tile, _) in before.iter().chain(&now) {
                    worst = worst.max((weight(&now, *tile) - weight(&before, *tile)).abs());
                }
            }
            before = Some(now);
        }
    }
    worst
}

#[test]
fn weights_are_continuous_over_cells_octants_and_borders() {
    for tiles in [4, 7, 32] {
        let step = 1e-3;
        let jump = weight_jump(|d| octahedral::blended(d, tiles), step);
        // A weight grows from 0 to 1 across one tile. Tiles are smallest near the corners of a face, where they are half as wide as at its centre.
        assert!(jump < 1.5 * step * f64::from(tiles), "{tiles}: {jump}");
    }
    // The weight of a single tile jumps, and so do those of a blend that wraps around at a border instead of mirroring.
    let around = |d: DVec3| {
        let wrong =
            |t: AtlasTile| AtlasTile { column: t.column, row: if t.column == N - 1 { N - 1 - t.row } else { t.row } };
        octahedral::blended(d, N).map(|(t, w)| (if w < 0.5 { wrong(t) } else { t }, w))
    };
    assert!(weight_jump(around, 1e-3) > 0.4);
    let nearest = |d: DVec3| {
        let tile = octahedral::nearest(d, N);
        [(tile, 1.0), (tile, 0.0), (tile, 0.0)]
    };
    assert!(weight_jump(nearest, 1e-3) > 0.9);
}

#[test]
fn a_choice_by_orientation_has_the_whole_angle_off_the_axis_as_its_error() {
    let off_axis = 35.0_f64.to_radians();
    let to_eye = DVec3::new(-off_axis.sin(), 0.0, off_axis.cos());
    // The atlas contains these orientations exactly, so the remaining error is that of the method.
    let worst = (0..8)
        .map(|i| {
            let tile = AtlasTile { column: 3 * i, row: i };
            let v = DMat3::from_rotation_z(0.7) * euler::axes(tile, N).shape_from_tile().transpose();
            let displayed = euler::axes(tile, N).direction;
            angle_between_rad(displayed, v.transpose() * to_eye)
        })
        .fold(0.0_f64, |worst, error| worst.max((error - off_axis).abs()));
    assert!(worst < 1e-9, "{worst}");
    let mean = mean_and_max(rotations(20_000).map(|v| direction_error_rad(EulerAtlas, v, to_eye, N).unwrap()));
    let ours = mean_and_max(rotations(20_000).map(|v| direction_error_rad(OctahedralBlend, v, to_eye, N).unwrap()));
    println!("35 deg off the axis: euler_atlas {mean:.2?} deg, octahedral_blend {ours:.3?} deg (mean, max)");
    assert!(mean[0] > 30.0 && ours[0] < 0.15);
}

#[test]
fn squares_in_the_image_plane_shrink_off_the_axis() {
    // Angle across a small square parallel to the image plane, relative to one that faces the eye.
    let spanned = |off_axis: f64, along: DVec3| {
        let centre = 1e3 * DVec3::new(off_axis.sin(), 0.0, -off_axis.cos());
        angle_between_rad(centre - 0.5 * along, centre + 0.5 * along) * 1e3
    };
    let off_axis = 35.0_f64.to_radians();
    let shrunk = 1.0 - spanned(off_axis, DVec3::X);
    println!("35 deg off the axis a square in the image plane spans {:.1} % less", 100.0 * shrunk);
    assert!((shrunk - 0.18).abs() < 0.005);
    let facing = DVec3::new(off_axis.cos(), 0.0, off_axis.sin());
    assert!((1.0 - spanned(off_axis, facing)).abs() < 1e-6);
}

#[test]
fn turning_the_head_changes_only_the_published_choice() {
    // The asteroid is seen from the same position, but with the head turned.
    let to_eye = DVec3::new(0.3, -0.2, 0.9).normalize();
    for (view_from_shape, head) in rotations(300).zip(rotations(600).skip(300)) {
        for method in [Octahedral, OctahedralBlend] {
            let before = tiles_shown(method, view_from_shape, to_eye, N).unwrap();
            let after = tiles_shown(method, head * view_from_shape, head * to_eye, N).unwrap();
            assert!(before.iter().zip(&after).all(|(a, b)| a.0 == b.0 && (a.1 - b.1).abs() < 1e-9));
            let displayed = |v, e| shown_view_from_shape(method, before[0].0, v, e, N).unwrap();
            let turned = displayed(head * view_from_shape, head * to_eye);
            assert!(rotation_angle_rad(turned, head * displayed(view_from_shape, to_eye)) < 1e-7);
        }
    }
    let yaw = DMat3::from_rotation_y(0.5);
    let changed = rotations(300).filter(|v| {
        let tile = |v: DMat3| euler::tile(Angles::from_rotation(v), N, Rounding::Up);
        tile(*v) != tile(yaw * *v)
    });
    assert!(changed.count() > 250);
}
