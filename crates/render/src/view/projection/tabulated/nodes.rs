//! The directions of a tabulated picture at the centres of its pixels and of a fringe around it, and the interpolation
//! between them.

use glam::{DVec2, DVec3};

/// Width of the fringe: the number of pixels around the picture that also have a direction, if the mapping continues
/// there. Kernels of stars outside the picture reach over its border.
pub const FRINGE: i64 = 8;

/// Unit directions at the nodes of a grid of pixel centres; node (0, 0) is the centre of pixel (-[`FRINGE`],
/// -[`FRINGE`]).
pub(super) struct Nodes {
    /// Width and height of the picture, pixels.
    pub(super) size: [u32; 2],
    /// Direction in view axes, and solid angle in sr (0 outside of the picture). All 0 if there is no direction.
    pub(super) values: Vec<[f32; 4]>,
}

/// Nodes along each side.
pub(super) fn node_counts(size: [u32; 2]) -> [i64; 2] {
    [i64::from(size[0]) + 2 * FRINGE, i64::from(size[1]) + 2 * FRINGE]
}

/// Node coordinates of a point of the picture.
pub(super) fn place_of_pixel(pixel: DVec2) -> DVec2 {
    pixel - 0.5 + FRINGE as f64
}

/// Point of the picture at given node coordinates.
pub(super) fn pixel_of_place(place: DVec2) -> DVec2 {
    place + 0.5 - FRINGE as f64
}

/// The largest integer that is not above a position. On baseline processors, `f64::floor` calls the C library.
#[inline]
fn floor(position: f64) -> i64 {
    let toward_zero = position as i64;
    toward_zero - i64::from(toward_zero as f64 > position)
}

/// Fractions of a position between its nodes.
#[inline]
pub(super) fn part_of(place: DVec2) -> DVec2 {
    place - DVec2::new(floor(place.x) as f64, floor(place.y) as f64)
}

/// Weights of a cubic convolution (Keys 1981, with a = -1/2) at the fraction `part` between the second and the third
/// node.
fn cubic_weights(part: f64) -> [f64; 4] {
    let rest = 1.0 - part;
    [
        -0.5 * part * rest * rest,
        1.0 + part * part * (1.5 * part - 2.5),
        1.0 + rest * rest * (1.5 * rest - 2.5),
        -0.5 * rest * part * part,
    ]
}

impl Nodes {
    fn value(&self, [x, y]: [i64; 2]) -> Option<[f32; 4]> {
        let [columns, rows] = node_counts(self.size);
        let inside = (0..columns).contains(&x) && (0..rows).contains(&y);
        inside.then(|| self.values[(y * columns + x) as usize])
    }

    /// Direction at a node, if it has one.
    pub(super) fn direction(&self, node: [i64; 2]) -> Option<DVec3> {
        let [x, y, z, _] = self.value(node)?;
        let direction = DVec3::new(f64::from(x), f64::from(y), f64::from(z));
        (direction != DVec3::ZERO).then_some(direction)
    }

    /// Whether a pixel lies in the picture.
    pub(super) fn contains(&self, x: u32, y: u32) -> bool {
        let inside = x < self.size[0] && y < self.size[1];
        let node = [i64::from(x) + FRINGE, i64::from(y) + FRINGE];
        inside && self.value(node).is_some_and(|value| value[3] > 0.0)
    }

    /// Directions at the four nodes around a position, row by row.
    pub(super) fn quad(&self, place: DVec2) -> Option<[DVec3; 4]> {
        let [x, y] = [floor(place.x), floor(place.y)];
        let node = |i: i64, j: i64| self.direction([x + i, y + j]);
        Some([node(0, 0)?, node(1, 0)?, node(0, 1)?, node(1, 1)?])
    }

    /// Direction at a position by cubic convolution, of nearly unit length; bilinear between the four nodes around it
    /// if a node is missing.
    pub(super) fn between(&self, place: DVec2) -> Option<DVec3> {
        let first = [floor(place.x), floor(place.y)];
        let part = part_of(place);
        let [x, y] = [first[0] - 1, first[1] - 1];
        let (across, down) = (cubic_weights(part.x), cubic_weights(part.y));
        let cubic = || {
            let mut sum = DVec3::ZERO;
            for (y, down) in (y..).zip(&down) {
                for (x, across) in (x..).zip(&across) {
                    sum += self.direction([x, y])? * (across * down);
                }
            }
            Some(sum)
        };
        cubic().or_else(|| {
            let [a, b, c, d] = self.quad(place)?;
            Some(a.lerp(b, part.x).lerp(c.lerp(d, part.x), part.y))
        })
    }
}
