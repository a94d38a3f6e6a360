//! Packing of an asteroid into 24 bytes, and the interpretation of these bytes on the GPU.
//!
//! **Axis.** Octahedral map (Meyer et al. 2010) in integers: i and j, the two signed halves, from -32767 to 32767, and
//! k = 32767 - |i| - |j|. The axis is (i, j, k) normalised; if k < 0, x is (32767 - |j|) with the sign of i and y is
//! (32767 - |i|) with the sign of j, with zero counted as positive. Integers are used because the frame below depends
//! on the sign of k: a shader that rounds 1 - |x| - |y| could get the other sign.
//!
//! **Frame.** (t, b, axis) of Duff et al. 2017, *Building an orthonormal basis, revisited*: with the axis (x, y, z), s
//! = 1 if k >= 0 and -1 otherwise, a = -1 / (s + z) and c = x y a, t = (1 + s x^2 a, s c, -s x) and b = (c, s + y^2 a,
//! -y). Right-handed and defined for every axis, including -z.
//!
//! **Orientation.** A point (x, y, z) of the shape maps to t x' + b y' + axis z, with (x', y') = (x cos w - y sin w, x
//! sin w + y cos w) and w the rotation angle.
//!
//! **Rotation angle.** phase 2^16 + rate time, in units of 2^-32 turns, all wrapping integers: exact for any time.

use std::f64::consts::TAU;

use glam::{DMat3, DQuat, DVec3, Vec3};

use super::PackedAsteroid;

/// Number of steps of a packed radius.
pub const RADIUS_PARTS: u32 = 65_535;
/// Largest component of a packed axis.
pub const AXIS_PARTS: i32 = 32_767;

/// Unpacked form of [`PackedAsteroid`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Asteroid {
    /// Position relative to the middle of its group, in the field's axes, m.
    pub offset_m: Vec3,
    /// Ratio of the mean radius to the largest of the field, 0 to 1. It is packed as a number of steps of 1 / [`RADIUS_PARTS`], at least one.
    pub radius_over_largest: f64,
    /// Index of the shape.
    pub shape: u8,
    /// Spin axis in the field's axes, of any nonzero length.
    pub axis: DVec3,
    /// Rotation angle at time 0, in units of 1/65536 turn.
    pub phase: u16,
    /// Turns per base period.
    pub rate: i16,
}

fn not_negative(value: f64) -> f64 {
    if value < 0.0 { -1.0 } else { 1.0 }
}

/// Returns the octahedral coordinates of a direction of any nonzero length, packed as by `pack2x16snorm`.
fn packed_axis(axis: DVec3) -> u32 {
    let axis = axis / axis.abs().element_sum();
    let [x, y] = if axis.z >= 0.0 {
        [axis.x, axis.y]
    } else {
        [(1.0 - axis.y.abs()) * not_negative(axis.x), (1.0 - axis.x.abs()) * not_negative(axis.y)]
    };
    let [i, j] = [x, y].map(|part| (part * f64::from(AXIS_PARTS)).round() as i16 as u16);
    u32::from(i) | u32::from(j) << 16
}

impl From<Asteroid> for PackedAsteroid {
    fn from(asteroid: Asteroid) -> Self {
        let radius = (asteroid.radius_over_largest * f64::from(RADIUS_PARTS)).round() as u32;
        Self {
            offset: asteroid.offset_m.to_array().map(f32::to_bits),
            radius_and_shape: radius.clamp(1, RADIUS_PARTS) | u32::from(asteroid.shape) << 16,
            axis: packed_axis(asteroid.axis),
            spin: u32::from(asteroid.phase) | u32::from(asteroid.rate as u16) << 16,
        }
    }
}

impl PackedAsteroid {
    /// Position relative to the middle of its group, in the field's axes, m.
    pub fn offset_m(&self) -> DVec3 {
        Vec3::from_array(self.offset.map(f32::from_bits)).as_dvec3()
    }

    /// Mean radius, m, in a field whose largest is `largest_m`.
    pub fn radius_m(&self, largest_m: f64) -> f64 {
        f64::from(self.radius_and_shape & 0xffff) / f64::from(RADIUS_PARTS) * largest_m
    }

    /// Index of the shape.
    pub fn shape(&self) -> usize {
        (self.radius_and_shape >> 16 & 0xff) as usize
    }

    /// The axis in integers, not normalised, and whether it is in the half with s = 1.
    fn whole_axis(&self) -> (DVec3, bool) {
        let [i, j] = [self.axis as u16, (self.axis >> 16) as u16].map(|half| i32::from(half as i16).max(-AXIS_PARTS));
        let k = AXIS_PARTS - i.abs() - j.abs();
        let sign = |value: i32| if value < 0 { -1 } else { 1 };
        let (x, y) = if k >= 0 { (i, j) } else { ((AXIS_PARTS - j.abs()) * sign(i), (AXIS_PARTS - i.abs()) * sign(j)) };
        (DVec3::new(f64::from(x), f64::from(y), f64::from(k)), k >= 0)
    }

    /// Spin axis in the field's axes, unit.
    pub fn axis(&self) -> DVec3 {
        self.whole_axis().0.normalize()
    }

    /// Turns per base period, signed.
    pub fn rate(&self) -> i16 {
        (self.spin >> 16) as u16 as i16
    }

    /// Rotation angle at a time from [`super::Instances::time_parts`], in units of 2^-32 turns.
    pub fn turn_parts(&self, time_parts: u32) -> u32 {
        (self.spin << 16).wrapping_add((i32::from(self.rate()) as u32).wrapping_mul(time_parts))
    }

    /// Rotation angle at a time from [`super::Instances::time_parts`], 0 to 2 pi, rad.
    pub fn turn(&self, time_parts: u32) -> f64 {
        f64::from(self.turn_parts(time_parts)) / 4_294_967_296.0 * TAU
    }

    /// The frame (t, b, axis) in which the shape rotates: the columns, in the field's axes.
    pub fn frame(&self) -> DMat3 {
        let (whole, positive) = self.whole_axis();
        let axis = whole.normalize();
        let s = if positive { 1.0 } else { -1.0 };
        let a = -1.0 / (s + axis.z);
        let c = axis.x * axis.y * a;
        DMat3::from_cols(
            DVec3::new(1.0 + s * axis.x * axis.x * a, s * c, -s * axis.x),
            DVec3::new(c, s + axis.y * axis.y * a, -axis.y),
            axis,
        )
    }

    /// Rotation from the shape's axes to the field's at a time from [`super::Instances::time_parts`].
    pub fn field_from_shape(&self, time_parts: u32) -> DQuat {
        DQuat::from_mat3(&self.frame()) * DQuat::from_rotation_z(self.turn(time_parts))
    }
}
