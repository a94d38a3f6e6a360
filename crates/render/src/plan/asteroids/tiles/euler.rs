//! The published atlas: tile (i, j) of R x R shows the shape turned by a pitch of 2 pi i / R and a yaw of 2 pi j / R,
//! and the square is turned by the remaining angle, the roll.
//!
//! The relative rotation is M_R = M_C M_A^T. M_C transforms world axes to view axes. The rows of M_A are the asteroid's axes in world axes, so that
//! M_A^T transforms shape to world. The publication's conversion to Euler angles is written here as M_R = Rz(roll) Ry(yaw) Rx(pitch): pitch acts
//! first, on the shape, and roll last, in the image plane, by turning the square. With exact angles the picture of an asteroid at the centre of the
//! view is correct. The angles are singular if yaw is a quarter turn.

use std::f64::consts::{PI, TAU};

use glam::{DMat3, DVec3};

use super::{AtlasTile, TileAxes};

/// Angles of a rotation, rad.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Angles {
    /// Rotation around x, applied first; range of a full turn.
    pub pitch_rad: f64,
    /// Rotation around y, applied second; from -pi/2 to pi/2.
    pub yaw_rad: f64,
    /// Rotation around z, applied last; range of a full turn.
    pub roll_rad: f64,
}

impl Angles {
    /// The angles of a rotation.
    pub fn from_rotation(view_from_shape: DMat3) -> Self {
        // The third row is (-sin yaw, sin pitch cos yaw, cos pitch cos yaw), the first column (cos roll cos yaw, sin
        // roll cos yaw, -sin yaw).
        let towards = view_from_shape.row(2);
        let x = view_from_shape.x_axis;
        Self {
            pitch_rad: towards.y.atan2(towards.z),
            yaw_rad: (-towards.x).clamp(-1.0, 1.0).asin(),
            roll_rad: x.y.atan2(x.x),
        }
    }

    /// The rotation with these angles, `view_from_shape`.
    pub fn matrix(self) -> DMat3 {
        DMat3::from_rotation_z(self.roll_rad)
            * DMat3::from_rotation_y(self.yaw_rad)
            * DMat3::from_rotation_x(self.pitch_rad)
    }
}

/// How angles are rounded to tiles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rounding {
    /// Up to the next tile, as published.
    Up,
    /// To the nearest tile.
    Nearest,
}

/// The tile for the angles, in an atlas of `tiles` x `tiles`.
pub fn tile(angles: Angles, tiles: u32, rounding: Rounding) -> AtlasTile {
    let index = |angle_rad: f64| {
        let place = angle_rad * f64::from(tiles) / TAU;
        let whole = match rounding {
            Rounding::Up => place.ceil(),
            Rounding::Nearest => place.round(),
        };
        (whole as i64).rem_euclid(i64::from(tiles)) as u32
    };
    AtlasTile { column: index(angles.pitch_rad), row: index(angles.yaw_rad) }
}

/// Axes of a tile.
pub fn axes(tile: AtlasTile, tiles: u32) -> TileAxes {
    let angle = |index: u32| TAU * f64::from(index) / f64::from(tiles);
    let turned = Angles { pitch_rad: angle(tile.column), yaw_rad: angle(tile.row), roll_rad: 0.0 }.matrix();
    TileAxes { right: turned.row(0), up: turned.row(1), direction: turned.row(2) }
}

/// Number of tiles that can be displayed: yaw is at most a quarter turn in either direction. If angles are rounded up, the row of the lowest yaw is
/// displayed only for exactly that angle.
pub fn reachable(tiles: u32) -> u32 {
    let quarter = (f64::from(tiles) / 4.0).ceil() as i64;
    let lowest = (-f64::from(tiles) / 4.0).ceil() as i64;
    tiles * ((quarter - lowest + 1) as u32).min(tiles)
}

/// Returns the changes of pitch and roll, rad, that a tilt by `tilt_rad` causes. The asteroid's yaw is `from_pole_rad` from a quarter turn, and the
/// axis of the tilt leaves the yaw unchanged.
pub fn pole_swing_rad(from_pole_rad: f64, tilt_rad: f64) -> [f64; 2] {
    let before = Angles { pitch_rad: 0.3, yaw_rad: 0.5 * PI - from_pole_rad, roll_rad: -0.4 };
    // The axis of the tilt is the x axis, turned by the roll only.
    let middle = DMat3::from_rotation_z(before.roll_rad);
    let axis = middle * DVec3::X;
    let after = Angles::from_rotation(DMat3::from_axis_angle(axis, tilt_rad) * before.matrix());
    let swing = |a: f64, b: f64| (b - a + PI).rem_euclid(TAU) - PI;
    [swing(before.pitch_rad, after.pitch_rad).abs(), swing(before.roll_rad, after.roll_rad).abs()]
}
