//! A tree of bounding boxes over a mesh's triangles: finds the first triangle that a ray hits, and the distance of a
//! point from the surface.
//!
//! f64, in the units of the mesh. Triangles are split at the median along the longest side of the box of their
//! centroids.

use glam::DVec3;

use super::Mesh;

/// Maximum number of triangles in a leaf.
const LEAF: usize = 4;
/// More than the levels of any tree: triangles have numbers of 32 bits, and each level halves them.
const MOST_LEVELS: usize = 34;
/// Relative tolerance: a ray that passes a triangle this closely still hits it, so that rays along edges do not slip through.
const EDGE: f64 = 1e-12;

/// A tree over the triangles of a mesh.
#[derive(Clone, Debug)]
pub struct MeshTree {
    corners: Vec<[DVec3; 3]>,
    /// Indices of the triangles, leaf by leaf.
    order: Vec<u32>,
    nodes: Vec<Branch>,
}

#[derive(Clone, Copy, Debug)]
struct Branch {
    low: DVec3,
    high: DVec3,
    /// For a leaf: index of its first triangle in `order`.
    first: usize,
    /// For a leaf: number of triangles. 0: the node has two children, the next node and `second`.
    count: usize,
    second: usize,
}

/// Intersection of a ray with a mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Distance from the ray's start, in lengths of its direction.
    pub distance: f64,
    /// Index of the triangle.
    pub triangle: usize,
    /// Barycentric weights of the triangle's corners at the point; they sum to 1.
    pub weights: [f64; 3],
}

impl MeshTree {
    /// Builds the tree of a mesh.
    pub fn new(mesh: &Mesh) -> Self {
        let place = |vertex: u32| DVec3::from_array(mesh.positions[vertex as usize].map(f64::from));
        let corners: Vec<[DVec3; 3]> = mesh.triangles.iter().map(|triangle| triangle.map(place)).collect();
        let order = (0..corners.len() as u32).collect();
        let mut tree = Self { corners, order, nodes: Vec::new() };
        if !tree.corners.is_empty() {
            tree.divide(0, tree.corners.len());
        }
        tree
    }

    fn divide(&mut self, first: usize, count: usize) -> usize {
        let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        let (mut low_middle, mut high_middle) = (low, high);
        let middle = |corners: &[DVec3; 3]| (corners[0] + corners[1] + corners[2]) / 3.0;
        for &triangle in &self.order[first..first + count] {
            let corners = &self.corners[triangle as usize];
            for corner in corners {
                (low, high) = (low.min(*corner), high.max(*corner));
            }
            (low_middle, high_middle) = (low_middle.min(middle(corners)), high_middle.max(middle(corners)));
        }
        let number = self.nodes.len();
        self.nodes.push(Branch { low, high, first, count, second: 0 });
        if count > LEAF {
            let axis = (high_middle - low_middle).max_position();
            let corners = &self.corners;
            let along = |triangle: &u32| middle(&corners[*triangle as usize])[axis];
            let half = count / 2;
            self.order[first..first + count].select_nth_unstable_by(half, |i, j| along(i).total_cmp(&along(j)));
            self.divide(first, half);
            let second = self.divide(first + half, count - half);
            self.nodes[number] = Branch { second, count: 0, ..self.nodes[number] };
        }
        number
    }

    /// The first triangle that a ray hits ahead of its origin, from either side.
    pub fn first_hit(&self, origin: DVec3, direction: DVec3) -> Option<Hit> {
        let inverse = 1.0 / direction;
        let mut best: Option<Hit> = None;
        let mut open = vec![0];
        while let Some(branch) = open.pop().and_then(|number: usize| self.nodes.get(number).map(|b| (number, b))) {
            let (number, branch) = branch;
            let (a, b) = ((branch.low - origin) * inverse, (branch.high - origin) * inverse);
            // A ray within a face of the box gives NaN here; `min` and `max` ignore it.
            let enter = (0..3).fold(0.0, |t: f64, k| t.max(a[k].min(b[k])));
            let leave = (0..3).fold(f64::INFINITY, |t: f64, k| t.min(a[k].max(b[k])));
            if enter > leave * (1.0 + 1e-12) || best.is_some_and(|hit| enter > hit.distance) {
                continue;
            }
            if branch.count == 0 {
                open.extend([branch.second, number + 1]);
                continue;
            }
            for &triangle in &self.order[branch.first..branch.first + branch.count] {
                if let Some((distance, weights)) = meets(&self.corners[triangle as usize], origin, direction)
                    && best.is_none_or(|hit| distance < hit.distance)
                {
                    best = Some(Hit { distance, triangle: triangle as usize, weights });
                }
            }
        }
        best
    }

    /// Distance of a point from the surface; infinite for an empty mesh.
    pub fn distance(&self, point: DVec3) -> f64 {
        self.distance_beyond(point, 0.0, &mut 0)
    }

    /// Returns the distance of a point from the surface. If this distance is at most `enough`, the result is merely some distance that is at most
    /// `enough`. `near` is a triangle that may be near the point; it is replaced by the nearest triangle that was found. If the largest distance of
    /// many points is searched, and each point is next to the one before, the search ends at once for most points (Taha and Hanbury 2015, *An
    /// efficient algorithm for calculating the exact Hausdorff distance*).
    pub fn distance_beyond(&self, point: DVec3, enough: f64, near: &mut usize) -> f64 {
        let squared = |triangle: usize| (point - nearest(&self.corners[triangle], point)).length_squared();
        let mut best = if *near < self.corners.len() { squared(*near) } else { f64::INFINITY };
        // Pending nodes. Each level of the tree leaves at most one.
        let mut open = [0; MOST_LEVELS];
        let mut waiting = usize::from(!self.nodes.is_empty());
        while waiting > 0 && best > enough * enough {
            waiting -= 1;
            let number = open[waiting];
            let branch = &self.nodes[number];
            if (point - point.clamp(branch.low, branch.high)).length_squared() >= best {
                continue;
            }
            if branch.count == 0 {
                // Push the nearer half last, so that it is visited first.
                let far = |k: usize| (point - (self.nodes[k].low + self.nodes[k].high) / 2.0).length_squared();
                let (a, b) = (number + 1, branch.second);
                (open[waiting], open[waiting + 1]) = if far(a) < far(b) { (b, a) } else { (a, b) };
                waiting += 2;
                continue;
            }
            for &triangle in &self.order[branch.first..branch.first + branch.count] {
                let found = squared(triangle as usize);
                if found < best {
                    (best, *near) = (found, triangle as usize);
                }
            }
        }
        best.sqrt()
    }
}

/// Intersection of a ray with a triangle (Moeller and Trumbore 1997), with the weights of the corners.
fn meets([a, b, c]: &[DVec3; 3], origin: DVec3, direction: DVec3) -> Option<(f64, [f64; 3])> {
    let (ab, ac) = (b - a, c - a);
    let p = direction.cross(ac);
    let determinant = ab.dot(p);
    if determinant == 0.0 {
        return None;
    }
    let from_a = origin - a;
    let u = from_a.dot(p) / determinant;
    let q = from_a.cross(ab);
    let v = direction.dot(q) / determinant;
    let distance = ac.dot(q) / determinant;
    (u >= -EDGE && v >= -EDGE && u + v <= 1.0 + EDGE && distance >= 0.0).then_some((distance, [1.0 - u - v, u, v]))
}

/// The point of a triangle nearest to `point` (Ericson 2005, *Real-Time Collision Detection*, 5.1.5).
fn nearest(&[a, b, c]: &[DVec3; 3], point: DVec3) -> DVec3 {
    let (ab, ac) = (b - a, c - a);
    let along_sides = |corner: DVec3| (ab.dot(point - corner), ac.dot(point - corner));
    let ((d1, d2), (d3, d4), (d5, d6)) = (along_sides(a), along_sides(b), along_sides(c));
    if d1 <= 0.0 && d2 <= 0.0 {
        return a;
    }
    if d3 >= 0.0 && d4 <= d3 {
        return b;
    }
    if d6 >= 0.0 && d5 <= d6 {
        return c;
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        return a + ab * (d1 / (d1 - d3));
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        return a + ac * (d2 / (d2 - d6));
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 - d3 >= 0.0 && d5 - d6 >= 0.0 {
        return b + (c - b) * ((d4 - d3) / ((d4 - d3) + (d5 - d6)));
    }
    let sum = va + vb + vc;
    a + ab * (vb / sum) + ac * (vc / sum)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a failing test may panic")]

    use super::*;
    use crate::scene::asteroids::{sphere::fibonacci_point, tests::sphere_solid};

    #[test]
    fn rays_and_distances_agree_with_the_brute_force_over_all_triangles() {
        let mesh = sphere_solid(500).to_mesh();
        let tree = MeshTree::new(&mesh);
        assert!(tree.nodes.len() > 100);
        let mut hits = 0;
        for k in 0..400 {
            let origin = fibonacci_point(k, 400) * 3.0;
            let direction = (fibonacci_point((k * 37) % 400, 400) * 1.1 - origin).normalize();
            let brute = tree.corners.iter().filter_map(|t| meets(t, origin, direction)).map(|(distance, _)| distance);
            let brute = brute.reduce(f64::min);
            let hit = tree.first_hit(origin, direction);
            assert_eq!(hit.map(|hit| hit.distance), brute);
            if let Some(hit) = hit {
                hits += 1;
                assert!(((origin + direction * hit.distance).length() - 1.0).abs() < 0.02);
                assert!((hit.weights.iter().sum::<f64>() - 1.0).abs() < 1e-12);
            }
            let brute = tree.corners.iter().map(|t| (nearest(t, origin) - origin).length()).reduce(f64::min).unwrap();
            assert!((tree.distance(origin) - brute).abs() < 1e-12);
            assert!((brute - 2.0).abs() < 0.02);
        }
        assert!((100..400).contains(&hits), "{hits}");
    }

    #[test]
    fn the_nearest_point_of_a_triangle_is_found_near_its_corners_edges_and_face() {
        let triangle = [DVec3::ZERO, DVec3::X, DVec3::Y];
        for (point, expected) in [
            (DVec3::new(-1.0, -1.0, 1.0), DVec3::ZERO),
            (DVec3::new(2.0, -0.5, 1.0), DVec3::X),
            (DVec3::new(-0.5, 2.0, 1.0), DVec3::Y),
            (DVec3::new(0.5, -1.0, 1.0), DVec3::X * 0.5),
            (DVec3::new(-1.0, 0.5, 1.0), DVec3::Y * 0.5),
            (DVec3::new(1.0, 1.0, 1.0), DVec3::new(0.5, 0.5, 0.0)),
            (DVec3::new(0.25, 0.25, 3.0), DVec3::new(0.25, 0.25, 0.0)),
        ] {
            assert!((nearest(&triangle, point) - expected).length() < 1e-15, "{point}");
        }
    }
}
