//! The tile of an atlas that replaces an asteroid, and its error. Pure f64 functions.
//!
//! A tile is an orthographic picture of the shape from one direction. *direction* points from the shape to the eye, *right* and *up* are the
//! picture's axes, all in the shape's axes, with right x up = direction. View axes are +x right, +y up, looking along -z. `view_from_shape` is the
//! apparent rotation of the asteroid in the view. *To the eye* is the unit vector from the asteroid to the eye; at the centre of a view that is +z.
//!
//! - `euler` selects a tile by the camera's orientation, as published;
//! - `octahedral` selects one or three tiles by the eye's position;
//! - [`super::bounds`] converts their errors to distances.

pub mod euler;
pub mod octahedral;
#[cfg(test)]
mod tests;

use glam::{DMat3, DQuat, DVec3};

use self::euler::Rounding;
use super::ImpostorMethod;

/// Position of a tile in an atlas, from the top left.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Default)]
pub struct AtlasTile {
    /// Column.
    pub column: u32,
    /// Row.
    pub row: u32,
}

/// Axes of a tile's picture: unit vectors in the shape's axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TileAxes {
    /// To the right of the picture.
    pub right: DVec3,
    /// To its top.
    pub up: DVec3,
    /// From the shape to the eye.
    pub direction: DVec3,
}

impl TileAxes {
    /// Rotation from the picture's axes (right, up, towards the eye) to those of the shape.
    pub fn shape_from_tile(&self) -> DMat3 {
        DMat3::from_cols(self.right, self.up, self.direction)
    }
}

/// Arrangement of the tiles of an atlas.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum AtlasLayout {
    /// Columns are pitch, rows are yaw, both over a full turn.
    Euler,
    /// The octahedral map of the sphere of directions.
    Octahedral,
}

named!(AtlasLayout {
    Euler = "euler",
    Octahedral = "octahedral",
});

impl AtlasLayout {
    /// The layout of a method; `None`: the method has no atlas.
    pub fn for_method(method: ImpostorMethod) -> Option<Self> {
        match method.chosen() {
            ImpostorMethod::EulerAtlas => Some(Self::Euler),
            ImpostorMethod::Octahedral | ImpostorMethod::OctahedralBlend | ImpostorMethod::OctahedralSplat => {
                Some(Self::Octahedral)
            }
            ImpostorMethod::Auto | ImpostorMethod::None => None,
        }
    }

    /// Axes of a tile, in an atlas of `tiles` x `tiles`.
    pub fn axes(self, tile: AtlasTile, tiles: u32) -> TileAxes {
        match self {
            Self::Euler => euler::axes(tile, tiles),
            Self::Octahedral => octahedral::axes(tile, tiles),
        }
    }
}

/// The tiles that a method draws, and their weights, which add up to 1. Unused entries of the three have weight 0. `None`: the method has no atlas.
/// `to_eye` is in view axes.
pub fn tiles_shown(
    method: ImpostorMethod,
    view_from_shape: DMat3,
    to_eye: DVec3,
    tiles: u32,
) -> Option<[(AtlasTile, f64); 3]> {
    let one = |tile: AtlasTile| [(tile, 1.0), (tile, 0.0), (tile, 0.0)];
    let direction = view_from_shape.transpose() * to_eye;
    match method.chosen() {
        ImpostorMethod::EulerAtlas => {
            Some(one(euler::tile(euler::Angles::from_rotation(view_from_shape), tiles, Rounding::Up)))
        }
        ImpostorMethod::Octahedral => Some(one(octahedral::nearest(direction, tiles))),
        ImpostorMethod::OctahedralBlend | ImpostorMethod::OctahedralSplat => {
            Some(octahedral::blended(direction, tiles))
        }
        ImpostorMethod::Auto | ImpostorMethod::None => None,
    }
}

/// Rotation from the shape's axes to view axes that one tile displays. The published method rotates the tile by the roll in the image plane. The
/// others rotate it by the shortest way until it faces the eye, which is equivalent to projecting the tile's axes onto the plane across the line of
/// sight.
pub fn shown_view_from_shape(
    method: ImpostorMethod,
    tile: AtlasTile,
    view_from_shape: DMat3,
    to_eye: DVec3,
    tiles: u32,
) -> Option<DMat3> {
    let layout = AtlasLayout::for_method(method)?;
    let axes = layout.axes(tile, tiles);
    Some(match layout {
        AtlasLayout::Euler => {
            let roll = euler::Angles::from_rotation(view_from_shape).roll_rad;
            DMat3::from_rotation_z(roll) * axes.shape_from_tile().transpose()
        }
        AtlasLayout::Octahedral => {
            DMat3::from_quat(DQuat::from_rotation_arc(view_from_shape * axes.direction, to_eye)) * view_from_shape
        }
    })
}

/// Angle between the displayed direction and the true one, rad. For a blend: of the weighted mean direction.
pub fn direction_error_rad(method: ImpostorMethod, view_from_shape: DMat3, to_eye: DVec3, tiles: u32) -> Option<f64> {
    let layout = AtlasLayout::for_method(method)?;
    let displayed: DVec3 = tiles_shown(method, view_from_shape, to_eye, tiles)?
        .iter()
        .map(|(tile, weight)| *weight * layout.axes(*tile, tiles).direction)
        .sum();
    Some(angle_between_rad(displayed, view_from_shape.transpose() * to_eye))
}

/// Angle of the rotation between the displayed and the true orientation, rad: direction and rotation in the picture. For a blend:
/// of the tile with the greatest weight.
pub fn orientation_error_rad(method: ImpostorMethod, view_from_shape: DMat3, to_eye: DVec3, tiles: u32) -> Option<f64> {
    let displayed = tiles_shown(method, view_from_shape, to_eye, tiles)?;
    let heaviest = displayed.iter().fold(displayed[0], |best, next| if next.1 > best.1 { *next } else { best }).0;
    let picture = shown_view_from_shape(method, heaviest, view_from_shape, to_eye, tiles)?;
    // A picture in the image plane shows the asteroid as seen by an eye in front of it, which is wrong off the axis.
    let true_picture = match AtlasLayout::for_method(method)? {
        AtlasLayout::Euler => DMat3::from_quat(DQuat::from_rotation_arc(to_eye, DVec3::Z)) * view_from_shape,
        AtlasLayout::Octahedral => view_from_shape,
    };
    Some(rotation_angle_rad(picture, true_picture))
}

/// Number of tiles that some orientation displays, including tiles that only an exact pole displays.
pub fn reachable_tiles(layout: AtlasLayout, tiles: u32) -> u32 {
    match layout {
        AtlasLayout::Euler => euler::reachable(tiles),
        AtlasLayout::Octahedral => tiles * tiles,
    }
}

/// Angle between two non-zero vectors, rad; accurate even if the cosine would cancel.
pub fn angle_between_rad(a: DVec3, b: DVec3) -> f64 {
    a.cross(b).length().atan2(a.dot(b))
}

/// Angle of the rotation from one orientation to another, rad.
pub fn rotation_angle_rad(from: DMat3, to: DMat3) -> f64 {
    let turn = DQuat::from_mat3(&(to * from.transpose()));
    2.0 * turn.xyz().length().atan2(turn.w.abs())
}
