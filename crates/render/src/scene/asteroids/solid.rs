//! A closed triangle mesh in f64, used while a shape is made: its volume, principal axes, normals and silhouette.
//!
//! Moments are those of a body of uniform density, summed over the tetrahedra between the triangles and a point. The mean projected area is measured:
//! silhouettes are drawn from many directions, and their pixels are counted. Cauchy's formula holds only for convex bodies; the mean projected area
//! of a concave body is less than a quarter of its surface.

use std::f64::consts::PI;

use glam::{DMat3, DVec3};
use rayon::prelude::*;

use super::{Mesh, silhouette::Silhouettes, sphere::fibonacci_point};

/// Directions from which silhouettes are drawn, on one half of the sphere: opposite directions have the same area.
const DIRECTIONS: usize = 256;
/// Pixels along a side of a silhouette's picture. The random counting error is 1e-3 for one silhouette, and 1e-4 for
/// the mean.
const SIDE: usize = 160;

/// A triangle mesh in f64, closed unless stated otherwise.
#[derive(Clone, Debug, Default)]
pub(super) struct Solid {
    /// Positions of the vertices.
    pub positions: Vec<DVec3>,
    /// Factors on the albedo, one per vertex.
    pub albedos: Vec<f64>,
    /// Triangles, counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
}

/// Volume, centroid and covariance of a body.
pub(super) struct Moments {
    /// Volume; negative if the triangles face inwards.
    pub volume: f64,
    /// Centroid.
    pub centroid: DVec3,
    /// Mean over the volume of the products of coordinates relative to the centroid.
    pub covariance: DMat3,
}

fn outer(a: DVec3) -> DMat3 {
    DMat3::from_cols(a * a.x, a * a.y, a * a.z)
}

impl Solid {
    /// The corners of a triangle.
    pub fn corners(&self, triangle: [u32; 3]) -> [DVec3; 3] {
        triangle.map(|vertex| self.positions[vertex as usize])
    }

    /// Volume, centroid and covariance. The last two are NaN if the volume is 0.
    pub fn moments(&self) -> Moments {
        // Relative to a point of the surface, so that a mesh far from its origin keeps its precision.
        let origin = self.positions.first().copied().unwrap_or_default();
        let mut volume = 0.0;
        let mut first = DVec3::ZERO;
        let mut second = DMat3::ZERO;
        for &triangle in &self.triangles {
            let [a, b, c] = self.corners(triangle).map(|corner| corner - origin);
            let part = a.dot(b.cross(c)) / 6.0;
            let sum = a + b + c;
            volume += part;
            first += sum * (part / 4.0);
            second += (outer(a) + outer(b) + outer(c) + outer(sum)) * (part / 20.0);
        }
        let centroid = first / volume;
        Moments { volume, centroid: origin + centroid, covariance: second * (1.0 / volume) - outer(centroid) }
    }

    /// An edge that is not shared by exactly two triangles with opposite edge directions, if there is one.
    pub fn open_edge(&self) -> Option<[u32; 2]> {
        let mut edges: Vec<[u32; 2]> = self.triangles.iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]).collect();
        edges.sort_unstable();
        let alone = |&&[a, b]: &&[u32; 2]| a == b || edges.binary_search(&[b, a]).is_err();
        edges.windows(2).find(|pair| pair[0] == pair[1]).map(|pair| pair[0]).or(edges.iter().find(alone).copied())
    }

    /// Reverses every triangle.
    pub fn turn_over(&mut self) {
        for triangle in &mut self.triangles {
            triangle.swap(1, 2);
        }
    }

    /// Applies a function to every vertex position.
    pub fn move_by(&mut self, step: impl Fn(DVec3) -> DVec3) {
        for position in &mut self.positions {
            *position = step(*position);
        }
    }

    /// Unit normals of the vertices: those of the adjacent triangles, weighted by their angles (Thuermer and Wuethrich
    /// 1998, *Computing vertex normals from polygonal facets*). A vertex without a triangle uses its direction from the
    /// origin.
    pub fn vertex_normals(&self) -> Vec<DVec3> {
        let mut normals = vec![DVec3::ZERO; self.positions.len()];
        for &triangle in &self.triangles {
            let corners = self.corners(triangle);
            let flat = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalize_or_zero();
            for k in 0..3 {
                let (ahead, behind) = (corners[(k + 1) % 3] - corners[k], corners[(k + 2) % 3] - corners[k]);
                let angle = ahead.cross(behind).length().atan2(ahead.dot(behind));
                normals[triangle[k] as usize] += flat * angle;
            }
        }
        let fallback = |position: &DVec3| position.try_normalize().unwrap_or(DVec3::Z);
        normals.iter().zip(&self.positions).map(|(n, p)| n.try_normalize().unwrap_or_else(|| fallback(p))).collect()
    }

    /// Surface area, and mean of the albedo factors over the surface.
    pub fn area_and_mean_albedo(&self) -> (f64, f64) {
        let (mut area, mut sum) = (0.0, 0.0);
        for &triangle in &self.triangles {
            let [a, b, c] = self.corners(triangle);
            let part = 0.5 * (b - a).cross(c - a).length();
            area += part;
            sum += part * triangle.iter().map(|&vertex| self.albedos[vertex as usize]).sum::<f64>() / 3.0;
        }
        (area, sum / area)
    }

    /// Greatest distance of a vertex from the origin.
    pub fn bound(&self) -> f64 {
        self.positions.iter().map(|position| position.length()).fold(0.0, f64::max)
    }

    /// Area of the silhouette, averaged over all directions, accurate to 1e-3.
    pub fn mean_projected_area(&self) -> f64 {
        let bound = self.bound();
        let silhouettes = Silhouettes::new(&self.positions, &self.triangles);
        let areas: Vec<f64> = (0..DIRECTIONS)
            .into_par_iter()
            .map(|k| silhouettes.area(bound, fibonacci_point(k, 2 * DIRECTIONS), SIDE))
            .collect();
        areas.iter().sum::<f64>() / DIRECTIONS as f64
    }

    /// The mesh for the GPU, with normals, and with the albedo factors divided by their mean.
    pub fn to_mesh(&self) -> Mesh {
        let (_, mean_albedo) = self.area_and_mean_albedo();
        Mesh {
            positions: self.positions.iter().map(|p| p.as_vec3().to_array()).collect(),
            normals: self.vertex_normals().iter().map(|n| n.as_vec3().to_array()).collect(),
            albedos: self.albedos.iter().map(|albedo| (albedo / mean_albedo) as f32).collect(),
            triangles: self.triangles.clone(),
        }
    }
}

/// Principal axes of a symmetric matrix, unit and right-handed, by decreasing eigenvalues (Jacobi's method). For equal
/// eigenvalues the axes are as close to x, y and z as the method leaves them.
pub(super) fn principal_axes(symmetric: DMat3) -> DMat3 {
    let mut matrix = symmetric.to_cols_array_2d();
    let mut axes = DMat3::IDENTITY.to_cols_array_2d();
    for _ in 0..30 {
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            if matrix[p][q] == 0.0 {
                continue;
            }
            let angle = 0.5 * (2.0 * matrix[p][q]).atan2(matrix[q][q] - matrix[p][p]);
            // The smaller of the two rotations that zero the element.
            let angle = if angle.abs() > PI / 4.0 { angle - angle.signum() * PI / 2.0 } else { angle };
            let (s, c) = angle.sin_cos();
            for row in &mut matrix {
                (row[p], row[q]) = (c * row[p] - s * row[q], s * row[p] + c * row[q]);
            }
            for k in 0..3 {
                (matrix[p][k], matrix[q][k]) =
                    (c * matrix[p][k] - s * matrix[q][k], s * matrix[p][k] + c * matrix[q][k]);
                (axes[p][k], axes[q][k]) = (c * axes[p][k] - s * axes[q][k], s * axes[p][k] + c * axes[q][k]);
            }
            (matrix[p][q], matrix[q][p]) = (0.0, 0.0);
        }
    }
    let mut order = [0, 1, 2];
    order.sort_by(|&i, &j| matrix[j][j].total_cmp(&matrix[i][i]));
    let [x, y] = [0, 1].map(|k| DVec3::from_array(axes[order[k]]).normalize());
    let y = (y - x * x.dot(y)).normalize();
    DMat3::from_cols(x, y, x.cross(y))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_of_a_rotated_ellipsoid_are_found() {
        let turn = DMat3::from_quat(glam::DQuat::from_euler(glam::EulerRot::ZYX, 0.7, -1.1, 2.0));
        let matrix = turn * DMat3::from_diagonal(DVec3::new(1.0, 5.0, 3.0)) * turn.transpose();
        let axes = principal_axes(matrix);
        for (axis, expected) in [(axes.x_axis, turn.y_axis), (axes.y_axis, turn.z_axis), (axes.z_axis, turn.x_axis)] {
            assert!((axis.dot(expected).abs() - 1.0).abs() < 1e-12, "{axis} is not {expected}");
        }
        assert!((axes.determinant() - 1.0).abs() < 1e-12);
        assert_eq!(principal_axes(DMat3::from_diagonal(DVec3::new(3.0, 2.0, 1.0))), DMat3::IDENTITY);
    }

    #[test]
    fn a_box_has_its_volume_moments_and_silhouette() {
        let size = DVec3::new(2.0, 1.0, 0.5);
        let solid = super::super::tests::box_solid(size, DVec3::new(0.3, -0.2, 0.1));
        let moments = solid.moments();
        assert!((moments.volume - 1.0).abs() < 1e-12);
        assert!((moments.centroid - DVec3::new(0.3, -0.2, 0.1)).length() < 1e-12);
        let expected = DMat3::from_diagonal(size * size / 12.0);
        assert!((moments.covariance - expected).to_cols_array().iter().all(|d| d.abs() < 1e-12));
        // Cauchy: the mean projected area of a convex body is a quarter of its surface.
        let centred = super::super::tests::box_solid(size, DVec3::ZERO);
        let (area, _) = centred.area_and_mean_albedo();
        assert!((area - 7.0).abs() < 1e-12);
        let ratio = centred.mean_projected_area() / (area / 4.0);
        assert!((ratio - 1.0).abs() < 1e-3, "{ratio}");
        assert_eq!(solid.open_edge(), None);
        let mut open = solid;
        open.triangles.pop();
        assert!(open.open_edge().is_some());
    }
}
