//! Points spread evenly on a sphere, and their triangulation.
//!
//! The points lie on a spiral with the golden angle (Swinbank and Purser 2006, *Fibonacci grids*). Their convex hull is
//! the mesh: any number n of points gives 2 n - 4 triangles of nearly equal size, so a level of detail may have any
//! even number of triangles.

use std::f64::consts::PI;

use glam::DVec3;

/// Point `index` of `count` on the unit sphere, from +z to -z.
pub(super) fn fibonacci_point(index: usize, count: usize) -> DVec3 {
    let z = 1.0 - (2.0 * index as f64 + 1.0) / count as f64;
    let angle = index as f64 * PI * (3.0 - 5f64.sqrt());
    let (sin, cos) = angle.sin_cos();
    let rho = (1.0 - z * z).sqrt();
    DVec3::new(rho * cos, rho * sin, z)
}

/// Points on the unit sphere, and triangles between them.
pub(super) type Sphere = (Vec<DVec3>, Vec<[u32; 3]>);

/// Points on the unit sphere and their triangulation with exactly `triangles` triangles, an even number of at least 8.
pub(super) fn sphere(triangles: usize) -> Sphere {
    let count = triangles / 2 + 2;
    let points: Vec<DVec3> = (0..count).map(|index| fibonacci_point(index, count)).collect();
    let hull = hull_of_sphere_points(&points);
    (points, hull)
}

/// Triangles of the convex hull of points on a sphere, counter-clockwise seen from outside. Incremental: for each new
/// point, the triangles that see it are replaced by a fan from the point to their common rim.
fn hull_of_sphere_points(points: &[DVec3]) -> Vec<[u32; 3]> {
    let volume = |[a, b, c]: [u32; 3], d: u32| {
        let [a, b, c, d] = [a, b, c, d].map(|index| points[index as usize]);
        (b - a).cross(c - a).dot(d - a)
    };
    let count = points.len() as u32;
    let farthest = |value: &dyn Fn(u32) -> f64| (0..count).max_by(|&i, &j| value(i).total_cmp(&value(j))).unwrap_or(0);
    let first = 0;
    let second = farthest(&|i| points[i as usize].distance_squared(points[0]));
    let (a, b) = (points[first as usize], points[second as usize]);
    let third = farthest(&|i| (points[i as usize] - a).cross(b - a).length_squared());
    let fourth = farthest(&|i| volume([first, second, third], i).abs());
    let mut base = [first, second, third];
    if volume(base, fourth) > 0.0 {
        base.swap(1, 2);
    }
    let [a, b, c] = base;
    let mut hull = vec![base, [b, a, fourth], [c, b, fourth], [a, c, fourth]];
    for point in (0..count).filter(|point| ![first, second, third, fourth].contains(point)) {
        let (seen, mut kept): (Vec<_>, Vec<_>) = hull.iter().copied().partition(|&face| volume(face, point) > 0.0);
        let edges: Vec<[u32; 2]> = seen.iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]).collect();
        let rim = edges.iter().filter(|[from, to]| !edges.contains(&[*to, *from]));
        kept.extend(rim.map(|&[from, to]| [from, to, point]));
        hull = kept;
    }
    hull
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hulls_have_the_requested_number_of_triangles_facing_outwards() {
        for triangles in [8, 20, 500, 1400] {
            let (points, hull) = sphere(triangles);
            assert_eq!(hull.len(), triangles);
            let mut longest = 0f64;
            for triangle in &hull {
                let [a, b, c] = triangle.map(|index| points[index as usize]);
                assert!((b - a).cross(c - a).dot(a) > 0.0);
                // No point lies outside of a face.
                assert!(points.iter().all(|p| (b - a).cross(c - a).dot(*p - a) < 1e-12));
                longest = longest.max(a.distance(b));
            }
            // The points are spread evenly: compare the longest edge with that of equilateral triangles of the mean size.
            let equilateral = (16.0 * PI / triangles as f64 / 3f64.sqrt()).sqrt();
            assert!(triangles < 100 || longest < 1.6 * equilateral, "{triangles}: {longest} against {equilateral}");
        }
    }
}
