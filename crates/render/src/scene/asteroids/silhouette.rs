//! Areas of silhouettes of meshes, by counting pixels.
//!
//! A pixel is covered if some triangle that faces the eye covers it. The number of such triangles is the winding number of their outline, which
//! consists of the edges whose other side does not face the eye. The outline contains only a twentieth of all edges.

use glam::DVec3;

/// Triangle on the other side of an edge that has none.
const NO_TRIANGLE: u32 = u32::MAX;

/// A mesh with the neighbours of its triangles, for silhouettes along many directions.
pub(crate) struct Silhouettes<'a> {
    positions: &'a [DVec3],
    triangles: &'a [[u32; 3]],
    /// Triangles beyond the edges from corner k to corner k + 1, or [`NO_TRIANGLE`].
    neighbours: Vec<[u32; 3]>,
}

impl<'a> Silhouettes<'a> {
    /// Finds the neighbours. Triangles are counter-clockwise seen from outside.
    pub fn new(positions: &'a [DVec3], triangles: &'a [[u32; 3]]) -> Self {
        // Edges, sorted by their vertices: each is next to those with the opposite direction.
        let mut edges: Vec<([u32; 2], bool, usize)> = triangles
            .iter()
            .enumerate()
            .flat_map(|(number, corners)| {
                (0..3).map(move |k| {
                    let (from, to) = (corners[k], corners[(k + 1) % 3]);
                    ([from.min(to), from.max(to)], from > to, 3 * number + k)
                })
            })
            .collect();
        edges.sort_unstable();
        let mut neighbours = vec![[NO_TRIANGLE; 3]; triangles.len()];
        for same in edges.chunk_by(|a, b| a.0 == b.0) {
            let (ahead, back) = same.split_at(same.partition_point(|(_, is_reversed, _)| !is_reversed));
            for (&(.., a), &(.., b)) in ahead.iter().zip(back) {
                neighbours[a / 3][a % 3] = (b / 3) as u32;
                neighbours[b / 3][b % 3] = (a / 3) as u32;
            }
        }
        Self { positions, triangles, neighbours }
    }

    /// Area of the silhouette along a unit direction, square units of the positions. `bound` is the radius of a sphere around all
    /// positions; the picture has `side` x `side` pixels.
    pub fn area(&self, bound: f64, direction: DVec3, side: usize) -> f64 {
        let (right, up) = direction.any_orthonormal_pair();
        let scale = side as f64 / (2.0 * bound);
        let mut flat = Vec::with_capacity(self.positions.len());
        for position in self.positions {
            flat.push([(position.dot(right) + bound) * scale, (position.dot(up) + bound) * scale]);
        }
        let mut faces_eye = Vec::with_capacity(self.triangles.len());
        for [a, b, c] in self.triangles {
            faces_eye.push(is_counter_clockwise([flat[*a as usize], flat[*b as usize], flat[*c as usize]]));
        }
        // Changes of the winding number.
        let mut crossings = Vec::with_capacity(4 * side);
        for (number, triangle) in self.triangles.iter().enumerate().filter(|(number, _)| faces_eye[*number]) {
            for (k, beyond) in self.neighbours[number].into_iter().enumerate() {
                if beyond == NO_TRIANGLE || !faces_eye[beyond as usize] {
                    let ends = [flat[triangle[k] as usize], flat[triangle[(k + 1) % 3] as usize]];
                    cross_rows(ends, side, &mut crossings);
                }
            }
        }
        crossings.sort_unstable();
        // Pixels from each crossing to the next one of its row, where the outline winds around them.
        let (mut covered, mut winding, mut last) = (0, 0_i32, 0);
        for Crossing(crossing) in crossings {
            let pixel = crossing / 2;
            if winding > 0 {
                covered += pixel - last;
            }
            winding += if crossing % 2 == 1 { 1 } else { -1 };
            last = pixel;
        }
        f64::from(covered) / (scale * scale)
    }
}

/// A change of the winding number, encoded as twice the index of its pixel (row by row), plus 1 if the number increases.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Crossing(u32);

/// Whether a triangle faces the eye.
#[inline]
fn is_counter_clockwise([a, b, c]: [[f64; 2]; 3]) -> bool {
    (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1]) > 0.0
}

/// Adds an edge of the outline to the rows whose middle it crosses. Edges that point down have the body to their right.
fn cross_rows([from, to]: [[f64; 2]; 2], side: usize, crossings: &mut Vec<Crossing>) {
    let grows = u32::from(from[1] > to[1]);
    for row in first_centre(from[1].min(to[1]))..first_centre(from[1].max(to[1])).min(side) {
        let y = row as f64 + 0.5;
        let x = from[0] + (to[0] - from[0]) * (y - from[1]) / (to[1] - from[1]);
        crossings.push(Crossing(2 * (row * side + first_centre(x).min(side)) as u32 + grows));
    }
}

/// The first pixel whose centre is not before a position. On baseline processors, `f64::ceil` calls the C library, and
/// this function is called for every row.
#[inline]
pub(crate) fn first_centre(position: f64) -> usize {
    let beyond = position - 0.5;
    let below = beyond as usize;
    below.saturating_add(usize::from((below as f64) < beyond))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::asteroids::ShapeSet;

    /// Area of the triangles that face the eye, triangle by triangle and pixel by pixel.
    fn counted(positions: &[DVec3], triangles: &[[u32; 3]], bound: f64, direction: DVec3, side: usize) -> f64 {
        let (right, up) = direction.any_orthonormal_pair();
        let scale = side as f64 / (2.0 * bound);
        let flat = |v: u32| [right, up].map(|axis| (positions[v as usize].dot(axis) + bound) * scale);
        let facing: Vec<_> = triangles.iter().map(|t| t.map(flat)).filter(|t| is_counter_clockwise(*t)).collect();
        let is_covered = |x: f64, y: f64| {
            let is_left = |[a, b]: [[f64; 2]; 2]| is_counter_clockwise([a, b, [x, y]]);
            facing.iter().any(|&[a, b, c]| is_left([a, b]) && is_left([b, c]) && is_left([c, a]))
        };
        let pixels = (0..side * side).filter(|i| is_covered((i % side) as f64 + 0.5, (i / side) as f64 + 0.5));
        pixels.count() as f64 / (scale * scale)
    }

    #[test]
    fn areas_are_those_of_all_triangles_that_face_the_eye() {
        let set = ShapeSet::procedural(9);
        let mesh = &set.shapes[4].lods[4].mesh;
        let positions: Vec<DVec3> = mesh.positions.iter().map(|p| DVec3::from_array(p.map(f64::from))).collect();
        // The whole mesh; an open one; one with a triangle twice, which has an edge at three triangles.
        let open = &mesh.triangles[..320];
        let twice: Vec<[u32; 3]> = open.iter().chain(&open[..1]).copied().collect();
        for triangles in [&mesh.triangles[..], open, &twice] {
            let silhouettes = Silhouettes::new(&positions, triangles);
            for direction in [DVec3::Z, DVec3::new(0.3, -0.5, 0.8).normalize(), DVec3::new(-0.9, 0.1, -0.2).normalize()]
            {
                let area = silhouettes.area(set.shapes[4].bound, direction, 96);
                let expected = counted(&positions, triangles, set.shapes[4].bound, direction, 96);
                assert!((area - expected).abs() < 1e-3, "{area} for {expected} along {direction}");
            }
        }
    }

    #[test]
    fn the_first_centre_is_that_of_the_ceiling() {
        for (position, first) in [(-3.0, 0), (0.0, 0), (0.5, 0), (0.51, 1), (1.5, 1), (1.6, 2), (7.49, 7)] {
            assert_eq!(first_centre(position), first, "{position}");
        }
        assert_eq!(first_centre(f64::INFINITY), usize::MAX);
    }
}
