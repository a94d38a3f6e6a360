//! A shape for tests: an icosphere, stretched and with bumps.

use std::collections::BTreeMap;

use glam::DVec3;

use crate::scene::asteroids::{Lod, Mesh, Shape};

/// Returns a shape like an ellipsoid, with 1280 triangles and bumps of this height, mean radii.
pub(crate) fn bumpy(bump: f64) -> Shape {
    let (directions, triangles) = icosphere(3);
    let place = |d: DVec3| {
        let waves =
            (3.0 * d.x + 1.0).sin() * (4.0 * d.y - 0.5).cos() + (5.0 * d.z + 2.0 * d.x).sin() * (3.0 * d.y).cos();
        d * DVec3::new(1.15, 0.95, 0.85) * (1.0 + 0.5 * bump * waves)
    };
    let positions: Vec<DVec3> = directions.iter().map(|d| place(*d)).collect();
    let mut normals = vec![DVec3::ZERO; positions.len()];
    for [a, b, c] in &triangles {
        let [pa, pb, pc] = [*a, *b, *c].map(|index| positions[index as usize]);
        for index in [a, b, c] {
            normals[*index as usize] += (pb - pa).cross(pc - pa);
        }
    }
    let packed = |v: &DVec3| v.to_array().map(|x| x as f32);
    let mesh = Mesh {
        positions: positions.iter().map(packed).collect(),
        normals: normals.iter().map(|normal| packed(&normal.normalize())).collect(),
        albedos: directions.iter().map(|d| (1.0 + 0.3 * (4.0 * d.x).sin()) as f32).collect(),
        triangles,
    };
    let bound = positions.iter().map(|position| position.length()).fold(0.0, f64::max) * (1.0 + 1e-6);
    Shape { lods: vec![Lod { mesh, error: 0.0, longest_edge: 0.2 }], bound }
}

fn icosphere(divisions: u32) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let t = 0.5 * (1.0 + 5.0_f64.sqrt());
    let mut points: Vec<DVec3> = [
        [-1.0, t, 0.0],
        [1.0, t, 0.0],
        [-1.0, -t, 0.0],
        [1.0, -t, 0.0],
        [0.0, -1.0, t],
        [0.0, 1.0, t],
        [0.0, -1.0, -t],
        [0.0, 1.0, -t],
        [t, 0.0, -1.0],
        [t, 0.0, 1.0],
        [-t, 0.0, -1.0],
        [-t, 0.0, 1.0],
    ]
    .map(|p| DVec3::from_array(p).normalize())
    .to_vec();
    let mut triangles: Vec<[u32; 3]> = vec![
        [0, 11, 5],
        [0, 5, 1],
        [0, 1, 7],
        [0, 7, 10],
        [0, 10, 11],
        [1, 5, 9],
        [5, 11, 4],
        [11, 10, 2],
        [10, 7, 6],
        [7, 1, 8],
        [3, 9, 4],
        [3, 4, 2],
        [3, 2, 6],
        [3, 6, 8],
        [3, 8, 9],
        [4, 9, 5],
        [2, 4, 11],
        [6, 2, 10],
        [8, 6, 7],
        [9, 8, 1],
    ];
    for _ in 0..divisions {
        let mut middles: BTreeMap<(u32, u32), u32> = BTreeMap::new();
        let mut middle = |a: u32, b: u32| {
            *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                points.push((points[a as usize] + points[b as usize]).normalize());
                points.len() as u32 - 1
            })
        };
        triangles = triangles
            .iter()
            .flat_map(|&[a, b, c]| {
                let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
                [[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]
            })
            .collect();
    }
    (points, triangles)
}
