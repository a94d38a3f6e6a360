//! Coarser meshes by edge collapse (Garland and Heckbert 1997, *Surface simplification using quadric error metrics*).
//!
//! Every vertex has a quadric: the sum of squared distances from the planes of its triangles, weighted by their areas.
//! The edge with the lowest cost is collapsed first, to the position that minimises the sum of the quadrics of its two
//! vertices. A collapse that would flip a triangle, or join two parts of the surface, is skipped: a closed mesh remains
//! closed.

use std::{
    cmp::{Ordering, Reverse},
    collections::{BTreeSet, BinaryHeap},
};

use glam::{DMat3, DVec3};

use super::solid::Solid;

/// Smallest cosine of the angle by which a triangle may rotate in one collapse.
const LEAST_COSINE: f64 = 0.2;
/// Weight of the edge's midpoint relative to the planes, so that even flat neighbourhoods have a unique optimum.
const TOWARDS_MIDDLE: f64 = 1e-6;

/// The quadratic form x -> x A x + 2 b x + c.
#[derive(Clone, Copy)]
struct Quadric {
    a: DMat3,
    b: DVec3,
    c: f64,
}

impl Quadric {
    const ZERO: Self = Self { a: DMat3::ZERO, b: DVec3::ZERO, c: 0.0 };

    /// Weighted squared distance from a point.
    fn of_point(point: DVec3, weight: f64) -> Self {
        Self { a: DMat3::IDENTITY * weight, b: -point * weight, c: point.length_squared() * weight }
    }

    fn of_triangle([a, b, c]: [DVec3; 3]) -> Self {
        let doubled = (b - a).cross(c - a);
        let n = doubled.normalize_or_zero();
        let (d, area) = (-n.dot(a), doubled.length() / 2.0);
        Self { a: DMat3::from_cols(n * n.x, n * n.y, n * n.z) * area, b: n * (d * area), c: d * d * area }
    }

    fn plus(self, other: Self) -> Self {
        Self { a: self.a + other.a, b: self.b + other.b, c: self.c + other.c }
    }

    fn value(&self, x: DVec3) -> f64 {
        x.dot(self.a * x) + 2.0 * self.b.dot(x) + self.c
    }
}

/// A candidate collapse. Among equal costs, the one with the lower vertex indices comes first.
#[derive(Clone, Copy, PartialEq)]
struct Collapse {
    cost: f64,
    vertices: [u32; 2],
    /// Versions of the two vertices when this candidate was created.
    versions: [u32; 2],
    place: DVec3,
}

impl Eq for Collapse {}

impl Ord for Collapse {
    fn cmp(&self, other: &Self) -> Ordering {
        self.cost
            .total_cmp(&other.cost)
            .then(self.vertices.cmp(&other.vertices))
            .then(self.versions.cmp(&other.versions))
    }
}

impl PartialOrd for Collapse {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

struct Simplifier {
    solid: Solid,
    alive: Vec<bool>,
    left: usize,
    quadrics: Vec<Quadric>,
    /// Triangles around each vertex.
    around: Vec<Vec<u32>>,
    versions: Vec<u32>,
    queue: BinaryHeap<Reverse<Collapse>>,
}

/// Copies of a closed mesh with at most `targets` triangles each, `targets` decreasing. Ends early if no edge can be
/// collapsed any more.
pub(super) fn simplified(solid: &Solid, targets: &[usize]) -> Vec<Solid> {
    let mut simplifier = Simplifier::new(solid.clone());
    let mut made = Vec::new();
    for &target in targets {
        while simplifier.left > target {
            if !simplifier.step() {
                return made;
            }
        }
        made.push(simplifier.compact());
    }
    made
}

impl Simplifier {
    fn new(solid: Solid) -> Self {
        let count = solid.positions.len();
        let mut quadrics = vec![Quadric::ZERO; count];
        let mut around = vec![Vec::new(); count];
        let mut edges = BTreeSet::new();
        for (number, &triangle) in solid.triangles.iter().enumerate() {
            let quadric = Quadric::of_triangle(solid.corners(triangle));
            for k in 0..3 {
                let (vertex, next) = (triangle[k], triangle[(k + 1) % 3]);
                quadrics[vertex as usize] = quadrics[vertex as usize].plus(quadric);
                around[vertex as usize].push(number as u32);
                edges.insert([vertex.min(next), vertex.max(next)]);
            }
        }
        let left = solid.triangles.len();
        let (alive, versions) = (vec![true; left], vec![0; count]);
        let mut made = Self { solid, alive, left, quadrics, around, versions, queue: BinaryHeap::new() };
        edges.into_iter().for_each(|edge| made.offer(edge));
        made
    }

    fn offer(&mut self, vertices: [u32; 2]) {
        let [u, v] = vertices.map(|vertex| vertex as usize);
        let quadric = self.quadrics[u].plus(self.quadrics[v]);
        let middle = (self.solid.positions[u] + self.solid.positions[v]) / 2.0;
        let trace = quadric.a.x_axis.x + quadric.a.y_axis.y + quadric.a.z_axis.z;
        let bound = quadric.plus(Quadric::of_point(middle, trace * TOWARDS_MIDDLE));
        let place = if trace > 0.0 { bound.a.inverse() * -bound.b } else { middle };
        let place = if place.is_finite() { place } else { middle };
        let versions = [self.versions[u], self.versions[v]];
        self.queue.push(Reverse(Collapse { cost: quadric.value(place).max(0.0), vertices, versions, place }));
    }

    fn neighbours(&self, vertex: u32) -> BTreeSet<u32> {
        let triangles = self.around[vertex as usize].iter();
        triangles.flat_map(|t| self.solid.triangles[*t as usize]).filter(|other| *other != vertex).collect()
    }

    /// Collapses the cheapest valid edge; returns false if there is none.
    fn step(&mut self) -> bool {
        while let Some(Reverse(collapse)) = self.queue.pop() {
            let [u, v] = collapse.vertices;
            let current = [u, v].map(|vertex| self.versions[vertex as usize]) == collapse.versions;
            if current && self.may_go(&collapse) {
                self.collapse(&collapse);
                return true;
            }
        }
        false
    }

    fn may_go(&self, collapse: &Collapse) -> bool {
        let [u, v] = collapse.vertices;
        let (around_u, around_v) = (self.neighbours(u), self.neighbours(v));
        // The two ends may share only the tips of the two triangles between them; and a tetrahedron is not collapsed.
        if around_u.intersection(&around_v).count() != 2 || self.left <= 4 {
            return false;
        }
        [(u, v), (v, u)].into_iter().all(|(moved, other)| {
            self.around[moved as usize].iter().all(|&t| {
                let triangle = self.solid.triangles[t as usize];
                if triangle.contains(&other) {
                    return true;
                }
                let normal = |[a, b, c]: [DVec3; 3]| (b - a).cross(c - a);
                let before = normal(self.solid.corners(triangle));
                let place = |w: u32| if w == moved { collapse.place } else { self.solid.positions[w as usize] };
                let after = normal(triangle.map(place));
                before.dot(after) > LEAST_COSINE * before.length() * after.length()
            })
        })
    }

    fn collapse(&mut self, collapse: &Collapse) {
        let [u, v] = collapse.vertices.map(|vertex| vertex as usize);
        let edge = self.solid.positions[v] - self.solid.positions[u];
        let along = ((collapse.place - self.solid.positions[u]).dot(edge) / edge.length_squared()).clamp(0.0, 1.0);
        let along = if along.is_nan() { 0.5 } else { along };
        self.solid.albedos[u] += (self.solid.albedos[v] - self.solid.albedos[u]) * along;
        self.solid.positions[u] = collapse.place;
        self.quadrics[u] = self.quadrics[u].plus(self.quadrics[v]);
        for number in std::mem::take(&mut self.around[v]) {
            let triangle = &mut self.solid.triangles[number as usize];
            if triangle.contains(&(u as u32)) {
                self.alive[number as usize] = false;
                self.left -= 1;
                for &vertex in triangle.iter().filter(|vertex| **vertex as usize != v) {
                    self.around[vertex as usize].retain(|t| *t != number);
                }
            } else {
                triangle.iter_mut().filter(|vertex| **vertex as usize == v).for_each(|vertex| *vertex = u as u32);
                self.around[u].push(number);
            }
        }
        self.versions[u] += 1;
        self.versions[v] += 1;
        for other in self.neighbours(u as u32) {
            self.offer([other.min(u as u32), other.max(u as u32)]);
        }
    }

    /// The remaining mesh, with vertices renumbered without gaps.
    fn compact(&self) -> Solid {
        let mut numbers = vec![u32::MAX; self.solid.positions.len()];
        let mut made = Solid::default();
        for (triangle, _) in self.solid.triangles.iter().zip(&self.alive).filter(|(_, alive)| **alive) {
            made.triangles.push(triangle.map(|vertex| {
                let number = &mut numbers[vertex as usize];
                if *number == u32::MAX {
                    *number = made.positions.len() as u32;
                    made.positions.push(self.solid.positions[vertex as usize]);
                    made.albedos.push(self.solid.albedos[vertex as usize]);
                }
                *number
            }));
        }
        made
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::asteroids::{shapes::finished, tests::sphere_solid};

    #[test]
    fn a_simplified_sphere_remains_closed_and_close_to_the_sphere() {
        let sphere = sphere_solid(3000);
        let levels = simplified(&sphere, &[1400, 500, 100]);
        assert_eq!(levels.iter().map(|level| level.triangles.len()).collect::<Vec<_>>(), [1400, 500, 100]);
        for level in &levels {
            assert_eq!(level.open_edge(), None);
            assert_eq!(level.positions.len(), level.triangles.len() / 2 + 2);
        }
        let shape = finished(std::iter::once(sphere).chain(levels).collect());
        // The sagitta of an equilateral triangle is a sixth of its squared side: 0.0034, 0.0097 and 0.048 for these
        // counts.
        let errors: Vec<f64> = shape.lods.iter().map(|lod| lod.error).collect();
        assert!(errors[0] == 0.0 && errors[1] < 0.01 && errors[2] < 0.025 && errors[3] < 0.12, "{errors:?}");
        assert!(errors[1] < errors[2] && errors[2] < errors[3], "{errors:?}");
    }

    #[test]
    fn simplification_stops_at_a_tetrahedron() {
        let levels = simplified(&sphere_solid(20), &[4, 3]);
        assert_eq!(levels.len(), 1);
        assert_eq!((levels[0].triangles.len(), levels[0].open_edge()), (4, None));
    }
}
