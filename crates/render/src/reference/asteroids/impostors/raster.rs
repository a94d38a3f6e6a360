//! Visible points of a triangle mesh for samples on a grid: every triangle is tested at every sample that it covers,
//! and the nearest wins.

use glam::{DVec2, DVec3};

use crate::scene::asteroids::Mesh;

/// A vertex on the grid.
#[derive(Clone, Copy)]
pub(super) struct Projected {
    /// Position, in samples; sample (i, j) is at (i + 0.5, j + 0.5).
    pub place: DVec2,
    /// Depth: larger is nearer. It is linear on the grid.
    pub nearness: f64,
    /// Inverse of the depth by which the projection divides; 1 for a parallel projection.
    pub weight: f64,
}

/// The visible point of a sample.
#[derive(Clone, Copy)]
pub(super) struct Hit {
    pub normal: DVec3,
    pub albedo: f64,
    pub position: DVec3,
    nearness: f64,
}

/// Returns the visible points of `side` x `side` samples, row by row.
pub(super) fn hits(mesh: &Mesh, side: usize, project: impl Fn(DVec3) -> Projected) -> Vec<Option<Hit>> {
    let vector = |v: [f32; 3]| DVec3::from_array(v.map(f64::from));
    let vertices: Vec<Projected> = mesh.positions.iter().map(|position| project(vector(*position))).collect();
    let mut found: Vec<Option<Hit>> = vec![None; side * side];
    for triangle in &mesh.triangles {
        let corners = triangle.map(|index| index as usize);
        let [a, b, c] = corners.map(|index| vertices[index]);
        let area = (b.place - a.place).perp_dot(c.place - a.place);
        if area == 0.0 {
            continue;
        }
        let low = a.place.min(b.place).min(c.place);
        let high = a.place.max(b.place).max(c.place);
        let range = |low: f64, high: f64| {
            let first = (low - 0.5).ceil().max(0.0) as usize;
            first..((high - 0.5).floor() + 1.0).clamp(0.0, side as f64) as usize
        };
        for j in range(low.y, high.y) {
            for i in range(low.x, high.x) {
                let place = DVec2::new(i as f64 + 0.5, j as f64 + 0.5);
                let share =
                    |from: Projected, to: Projected| (to.place - from.place).perp_dot(place - from.place) / area;
                let shares = [share(b, c), share(c, a), share(a, b)];
                if shares.iter().any(|share| *share < 0.0) {
                    continue;
                }
                let nearness = shares[0] * a.nearness + shares[1] * b.nearness + shares[2] * c.nearness;
                let hit = &mut found[j * side + i];
                if hit.is_some_and(|hit| hit.nearness >= nearness) {
                    continue;
                }
                let weighted = [shares[0] * a.weight, shares[1] * b.weight, shares[2] * c.weight];
                let sum: f64 = weighted.iter().sum();
                let mut seen = Hit { normal: DVec3::ZERO, albedo: 0.0, position: DVec3::ZERO, nearness };
                for (corner, weight) in corners.into_iter().zip(weighted) {
                    seen.normal += weight / sum * vector(mesh.normals[corner]);
                    seen.position += weight / sum * vector(mesh.positions[corner]);
                    seen.albedo += weight / sum * f64::from(mesh.albedos[corner]);
                }
                seen.normal = seen.normal.normalize_or_zero();
                *hit = Some(seen);
            }
        }
    }
    found
}
