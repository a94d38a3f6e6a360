//! HEALPix cells in nested order, and positions inside them (Górski et al. 2005, ApJ 622, 759).
//!
//! The sphere consists of 12 base cells ("faces"). A position has coordinates x and y from 0 to 1 in its face: from the southern corner, x increases
//! to the east and y to the west. Here both are fixed-point numbers of 32 bits: a step is 0.08 mas. The first k bits of x and y select a cell of
//! order k; its number interleaves these bits. The remaining bits are the position in the cell.

use glam::{DVec3, Vec3};

/// Number of cells of an order.
pub const fn cell_count(order: u8) -> u64 {
    12 << (2 * order)
}

/// For each face, the ring of its southern corner and the longitude of its centre, in units of the ring's quarter.
const FACE_RING: [f64; 12] = [2.0, 2.0, 2.0, 2.0, 3.0, 3.0, 3.0, 3.0, 4.0, 4.0, 4.0, 4.0];
const FACE_LONGITUDE: [f64; 12] = [1.0, 3.0, 5.0, 7.0, 0.0, 2.0, 4.0, 6.0, 1.0, 3.0, 5.0, 7.0];

/// Number of steps of a coordinate in its face.
const STEPS: f64 = 4_294_967_296.0;

/// A position on the sphere.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SkyPlace {
    /// Face, 0 to 11.
    pub face: u8,
    /// Coordinates in the face, in units of 2^-32.
    pub xy: [u32; 2],
}

/// Converts a number from 0 to 1 to steps of 2^-32.
fn fixed(value: f64) -> u32 {
    // The conversion saturates at both ends.
    (value * STEPS) as u32
}

/// Spreads the bits of a number: bit i moves to 2 i.
pub(super) const fn spread(bits: u32) -> u64 {
    let mut wide = bits as u64;
    wide = (wide | wide << 16) & 0x0000_ffff_0000_ffff;
    wide = (wide | wide << 8) & 0x00ff_00ff_00ff_00ff;
    wide = (wide | wide << 4) & 0x0f0f_0f0f_0f0f_0f0f;
    wide = (wide | wide << 2) & 0x3333_3333_3333_3333;
    (wide | wide << 1) & 0x5555_5555_5555_5555
}

/// Inverse of [`spread`]; odd bits are ignored.
const fn gathered(wide: u64) -> u32 {
    let mut bits = wide & 0x5555_5555_5555_5555;
    bits = (bits | bits >> 1) & 0x3333_3333_3333_3333;
    bits = (bits | bits >> 2) & 0x0f0f_0f0f_0f0f_0f0f;
    bits = (bits | bits >> 4) & 0x00ff_00ff_00ff_00ff;
    bits = (bits | bits >> 8) & 0x0000_ffff_0000_ffff;
    (bits | bits >> 16) as u32
}

impl SkyPlace {
    /// Returns the position of a direction, which need not have unit length.
    pub fn from_direction(direction: DVec3) -> Self {
        let length = direction.length();
        let z = direction.z / length;
        let sine = direction.x.hypot(direction.y) / length;
        // Longitude in quarters of the circle, 0 to 4.
        let quarter = (direction.y.atan2(direction.x) / std::f64::consts::FRAC_PI_2).rem_euclid(4.0);
        let (face, x, y) = if z.abs() <= 2.0 / 3.0 {
            let (middle, height) = (0.5 + quarter, 0.75 * z);
            let (falling, rising) = (middle - height, middle + height);
            let (south, north) = (falling.floor().min(4.0), rising.floor().min(4.0));
            let face = match south.total_cmp(&north) {
                std::cmp::Ordering::Equal => south as u8 % 4 + 4,
                std::cmp::Ordering::Less => south as u8,
                std::cmp::Ordering::Greater => north as u8 + 8,
            };
            (face, rising - north, 1.0 - (falling - south))
        } else {
            // Near the pole, the distance from the pole is exact if it is computed from the sine.
            let from_pole = sine / ((1.0 + z.abs()) / 3.0).sqrt();
            let cap = quarter.floor().min(3.0);
            let (before, after) = ((quarter - cap) * from_pole, (1.0 - (quarter - cap)) * from_pole);
            if z > 0.0 { (cap as u8, 1.0 - after, 1.0 - before) } else { (cap as u8 + 8, before, after) }
        };
        Self { face, xy: [fixed(x), fixed(y)] }
    }

    /// Returns the number of the cell of an order (at most 29) that contains the position.
    pub fn cell(self, order: u8) -> u64 {
        if order == 0 {
            return u64::from(self.face);
        }
        let [x, y] = self.xy.map(|bits| spread(bits >> (32 - order)));
        u64::from(self.face) << (2 * order) | x | y << 1
    }

    /// Returns the coordinates in the cell of an order, with `bits` bits each.
    pub fn in_cell(self, order: u8, bits: u32) -> [u32; 2] {
        self.xy.map(|fixed| (fixed << order) >> (32 - bits))
    }
}

/// A cell, prepared to convert coordinates in it to directions.
#[derive(Clone, Copy, Debug)]
pub struct CellFrame {
    face: usize,
    corner: [f64; 2],
    scale: f64,
    middle: Longitude,
    /// Unit vector towards the centre, ICRS axes.
    pub centre: DVec3,
}

/// A longitude in rad, with its sine and cosine.
#[derive(Clone, Copy, Debug)]
struct Longitude {
    rad: f64,
    sin: f64,
    cos: f64,
}

/// Largest difference of longitude for which sine and cosine are computed by series, rad; their error is then below 5e-17.
const NEAR_RAD: f64 = 1.0 / 64.0;

impl Longitude {
    fn new(rad: f64) -> Self {
        let (sin, cos) = rad.sin_cos();
        Self { rad, sin, cos }
    }

    /// Sine and cosine of another longitude. If it is near this one, the computation takes a third of the time of the standard library's functions.
    fn sin_cos_of(self, rad: f64) -> (f64, f64) {
        let by = rad - self.rad;
        if by.abs() > NEAR_RAD {
            return rad.sin_cos();
        }
        let square = by * by;
        let sin = by * (1.0 - square * (1.0 / 6.0 - square * (1.0 / 120.0)));
        let cos_less_1 = -square * (0.5 - square * (1.0 / 24.0 - square * (1.0 / 720.0)));
        (self.sin + (self.sin * cos_less_1 + self.cos * sin), self.cos + (self.cos * cos_less_1 - self.sin * sin))
    }
}

/// A circle of latitude on the unit sphere, and a longitude.
struct Circle {
    longitude_rad: f64,
    radius: f64,
    z: f64,
}

impl CellFrame {
    /// Creates the frame of a cell; `cell` must be less than [`cell_count`] of the order.
    pub fn new(order: u8, cell: u64) -> Self {
        let face = ((cell >> (2 * order)) % 12) as usize;
        let inside = cell & ((1 << (2 * order)) - 1);
        let scale = 1.0 / f64::from(1_u32 << order);
        let corner = [gathered(inside), gathered(inside >> 1)].map(|index| f64::from(index) * scale);
        let mut frame = Self { face, corner, scale, middle: Longitude::new(0.0), centre: DVec3::ZERO };
        frame.middle = Longitude::new(frame.circle([0.5, 0.5]).longitude_rad);
        frame.centre = frame.direction([0.5, 0.5]);
        frame
    }

    /// Returns the longitude of coordinates in the cell, and their circle of latitude.
    #[inline]
    fn circle(&self, inside: [f64; 2]) -> Circle {
        let [x, y] = [0, 1].map(|axis| self.corner[axis] + self.scale * inside[axis]);
        let ring = FACE_RING[self.face] - x - y;
        // `width` is a quarter of the ring's circumference, in the units of the longitude.
        let (width, z, sine) = if !(1.0..=3.0).contains(&ring) {
            let width = if ring < 1.0 { ring } else { 4.0 - ring };
            let below = width * width / 3.0;
            let z = 1.0 - below;
            (width, if ring < 1.0 { z } else { -z }, (below * (2.0 - below)).sqrt())
        } else {
            let z = (2.0 - ring) * (2.0 / 3.0);
            (1.0, z, (1.0 - z * z).sqrt())
        };
        let along = FACE_LONGITUDE[self.face] * width + x - y;
        let longitude_rad = if width < 1e-15 { 0.0 } else { std::f64::consts::FRAC_PI_4 * along / width };
        Circle { longitude_rad, radius: sine, z }
    }

    /// Unit vector towards coordinates in the cell, each 0 to 1.
    #[inline]
    pub fn direction(&self, inside: [f64; 2]) -> DVec3 {
        let Circle { longitude_rad, radius, z } = self.circle(inside);
        let (sin, cos) = self.middle.sin_cos_of(longitude_rad);
        DVec3::new(radius * cos, radius * sin, z)
    }

    /// Unit vector towards a position in a finer cell. The arguments are the number of the finer cell in this one, the difference of their orders,
    /// and the coordinates in the finer cell.
    #[inline]
    pub fn direction_in_finer(&self, finer: u64, orders: u8, inside: [f64; 2]) -> DVec3 {
        let scale = 1.0 / f64::from(1_u32 << orders);
        let [x, y] = [gathered(finer), gathered(finer >> 1)].map(f64::from);
        self.direction([(x + inside[0]) * scale, (y + inside[1]) * scale])
    }

    /// Half-angle of a cone around the centre that contains the cell, rad.
    pub fn radius_rad(&self) -> f64 {
        // The corners are the farthest points; add a tenth for the curvature of the sides.
        let corners = [[0.0, 0.0], [0.0, 1.0], [1.0, 0.0], [1.0, 1.0]];
        let chord_squared = corners.map(|corner| self.direction(corner).distance_squared(self.centre));
        1.1 * 2.0 * (0.5 * chord_squared.into_iter().fold(0.0, f64::max).sqrt()).asin()
    }

    /// Direction minus [`CellFrame::centre`], ICRS axes. In cells of order 6 and finer, its steps as f32 are below 0.2 mas; those of a unit vector
    /// are 12 mas.
    pub fn offset(&self, inside: [f64; 2]) -> Vec3 {
        (self.direction(inside) - self.centre).as_vec3()
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::{coordinates::lon_lat_from_direction, units::ARCSECOND_RAD};

    /// Directions all over the sphere, including the poles, the meridian and the boundaries of the polar caps.
    pub fn directions(count: u32) -> Vec<DVec3> {
        let spiral = (0..count).map(|i| {
            let z = 1.0 - 2.0 * (f64::from(i) + 0.5) / f64::from(count);
            let (sin, cos) = (f64::from(i) * 2.399_963_229_728_653).sin_cos();
            DVec3::new(cos, sin, 0.0) * (1.0 - z * z).sqrt() + DVec3::Z * z
        });
        let near_poles = (0..200).flat_map(|i| {
            let (sin, cos) = (f64::from(i) * 0.31).sin_cos();
            let sine = 10_f64.powf(-0.05 * f64::from(i));
            [1.0, -1.0].map(|z| DVec3::new(sine * cos, sine * sin, z).normalize())
        });
        let special = [DVec3::X, DVec3::Y, DVec3::Z, DVec3::NEG_X, DVec3::NEG_Y, DVec3::NEG_Z];
        let caps = [-1.0, 1.0].map(|sign| DVec3::new((5.0_f64 / 9.0).sqrt(), 0.0, sign * 2.0 / 3.0));
        spiral.chain(near_poles).chain(special).chain(caps).collect()
    }

    #[test]
    fn cells_are_those_of_another_implementation() {
        let mut different = 0;
        let all = directions(20_000);
        for &direction in &all {
            let (longitude, latitude) = lon_lat_from_direction(direction);
            let place = SkyPlace::from_direction(direction);
            for order in [0, 4, 5, 8, 12] {
                let expected = cdshealpix::nested::hash(order, longitude.rem_euclid(std::f64::consts::TAU), latitude);
                let found = place.cell(order);
                assert!(found < cell_count(order));
                different += u32::from(found != expected);
            }
        }
        // A position on a boundary belongs to either of the two cells.
        assert!(different < 60, "{different}");
    }

    #[test]
    fn places_are_exact_to_a_tenth_of_a_milliarcsecond_and_more_digits_select_finer_cells() {
        let mut worst: f64 = 0.0;
        for direction in directions(20_000) {
            let place = SkyPlace::from_direction(direction);
            for order in [4, 8, 12] {
                let frame = CellFrame::new(order, place.cell(order));
                let bits = 32 - u32::from(order);
                let inside = place.in_cell(order, bits).map(|x| (f64::from(x) + 0.5) / f64::from(1_u32 << bits));
                let found = frame.direction(inside);
                worst = worst.max((found - direction).length());
                assert!((found.length() - 1.0).abs() < 1e-15);
                let relative = frame.centre + frame.offset(inside).as_dvec3();
                assert!((relative - found).length() < if order == 4 { 4e-9 } else { 5e-10 });
                assert_eq!(place.cell(order) >> 2, place.cell(order - 1));
                // The same position relative to a coarser cell, whose centre is farther away.
                let coarser = CellFrame::new(order - 3, place.cell(order) >> 6);
                let same = coarser.direction_in_finer(place.cell(order) & 63, 3, inside);
                assert!((same - found).length() < 4e-16, "{:e}", (same - found).length());
            }
        }
        assert!(worst < 0.1e-3 * ARCSECOND_RAD, "{} mas", worst / ARCSECOND_RAD * 1e3);
    }
}
