//! Fits a sphere to the points of a screen, by least squares.

use glam::{DMat3, DMat4, DVec3, DVec4};

/// Sums over points of a screen. Sums for several projectors can be added.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScreenSums {
    count: f64,
    /// Sums of p, p p^T, |p|^2 p, |p|^2 and |p|^4.
    first: DVec3,
    second: DMat3,
    third: DVec3,
    squares: f64,
    fourth: f64,
}

/// A sphere.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sphere {
    /// Its centre, m.
    pub centre_m: DVec3,
    /// Its radius, m.
    pub radius_m: f64,
    /// Root mean square distance of the points from it, m.
    pub rough_m: f64,
}

impl Default for ScreenSums {
    /// Sums without points. Written out, because the default of a matrix is the identity and not zero.
    fn default() -> Self {
        let zero = DVec3::ZERO;
        Self { count: 0.0, first: zero, second: DMat3::ZERO, third: zero, squares: 0.0, fourth: 0.0 }
    }
}

impl ScreenSums {
    /// Adds a point, m from the eye.
    pub fn add(&mut self, point_m: DVec3) {
        let square = point_m.length_squared();
        self.count += 1.0;
        self.first += point_m;
        self.second += DMat3::from_cols(point_m * point_m.x, point_m * point_m.y, point_m * point_m.z);
        self.third += point_m * square;
        self.squares += square;
        self.fourth += square * square;
    }

    /// Adds the points of another sum in the same axes.
    pub fn merge(&mut self, other: &Self) {
        self.count += other.count;
        self.first += other.first;
        self.second += other.second;
        self.third += other.third;
        self.squares += other.squares;
        self.fourth += other.fourth;
    }

    /// Returns the sums for the same points in rotated axes.
    #[must_use]
    pub fn turned(&self, rotation: DMat3) -> Self {
        Self {
            first: rotation * self.first,
            second: rotation * self.second * rotation.transpose(),
            third: rotation * self.third,
            ..*self
        }
    }

    /// Returns the sphere |p|^2 = 2 c p + k that minimises the squared residuals of this equation; `None` if the points
    /// are coplanar or too few.
    pub fn sphere(&self) -> Option<Sphere> {
        if self.count < 4.0 {
            return None;
        }
        let mean = |sum: f64| sum / self.count;
        let [x, y, z] =
            [self.second.x_axis, self.second.y_axis, self.second.z_axis].map(|column| column * 4.0 / self.count);
        let first = self.first * 2.0 / self.count;
        let matrix = DMat4::from_cols(x.extend(first.x), y.extend(first.y), z.extend(first.z), first.extend(1.0));
        let size = mean(self.squares);
        // For coplanar points, the determinant is 0 except for rounding errors.
        if matrix.determinant().abs() < 1e-9 * size.powi(3) {
            return None;
        }
        let right = (self.third * 2.0 / self.count).extend(size);
        let solution: DVec4 = matrix.inverse() * right;
        let (centre_m, k) = (solution.truncate(), solution.w);
        let radius_m = (k + centre_m.length_squared()).sqrt();
        // The residual |p|^2 - 2 c p - k is about 2 r times the distance of a point from the sphere.
        let [c, s] = [centre_m, self.first / self.count];
        let square = mean(self.fourth) - 4.0 * c.dot(self.third) / self.count - 2.0 * k * size
            + 4.0 * c.dot(self.second * c) / self.count
            + 4.0 * k * c.dot(s)
            + k * k;
        let rough_m = square.max(0.0).sqrt() / (2.0 * radius_m);
        (radius_m.is_finite() && rough_m.is_finite()).then_some(Sphere { centre_m, radius_m, rough_m })
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failed assumption of a test panics")]
mod tests {
    use super::*;

    fn points(noise_m: f64) -> Vec<DVec3> {
        let golden = std::f64::consts::PI * (3.0 - 5.0_f64.sqrt());
        let point = |n: i32| {
            let z = 0.95 * f64::from(n) / 500.0;
            let (sin, cos) = (golden * f64::from(n)).sin_cos();
            let radius_m = 8.0 + noise_m * if n % 2 == 0 { 1.0 } else { -1.0 };
            DVec3::new(1.0, -2.0, 0.5)
                + DVec3::new(cos * (1.0 - z * z).sqrt(), sin * (1.0 - z * z).sqrt(), z) * radius_m
        };
        (0..500).map(point).collect()
    }

    #[test]
    fn the_sphere_of_a_cap_is_recovered() {
        for (noise_m, allowed) in [(0.0, 1e-6), (0.05, 3e-3)] {
            let mut halves = [ScreenSums::default(), ScreenSums::default()];
            let turn = DMat3::from_rotation_y(0.7);
            for (index, point) in points(noise_m).into_iter().enumerate() {
                halves[index % 2].add(turn.transpose() * point);
            }
            let mut sums = halves[0].turned(turn);
            sums.merge(&halves[1].turned(turn));
            let Sphere { centre_m, radius_m, rough_m } = sums.sphere().unwrap();
            assert!(centre_m.distance(DVec3::new(1.0, -2.0, 0.5)) < 2.0 * allowed, "{centre_m}");
            assert!(
                (radius_m - 8.0).abs() < 2.0 * allowed && (rough_m - noise_m).abs() < 1e-4 + allowed,
                "{radius_m} {rough_m}"
            );
        }
    }

    #[test]
    fn a_plane_has_no_sphere() {
        let mut sums = ScreenSums::default();
        for n in 0..100 {
            sums.add(DVec3::new(f64::from(n % 10), f64::from(n / 10), -3.0));
        }
        assert_eq!(sums.sphere(), None);
    }
}
