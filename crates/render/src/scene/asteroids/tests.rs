//! Compares shapes and fields with results from geometry.

#![allow(clippy::unwrap_used, reason = "a failing test may panic")]

mod fields;
mod shapes;

use glam::DVec3;

use super::{Mesh, solid::Solid, sphere};

/// A unit sphere.
pub(super) fn sphere_solid(triangles: usize) -> Solid {
    let (positions, triangles) = sphere::sphere(triangles);
    Solid { albedos: vec![1.0; positions.len()], positions, triangles }
}

/// A box with a size and a centre.
pub(super) fn box_solid(size: DVec3, middle: DVec3) -> Solid {
    let corner = |k: u32| middle + size * (DVec3::new((k & 1).into(), (k >> 1 & 1).into(), (k >> 2).into()) - 0.5);
    let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    Solid {
        positions: (0..8).map(corner).collect(),
        albedos: vec![1.0; 8],
        triangles: quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect(),
    }
}

/// A copy of a mesh with its vertices moved by a function.
pub(super) fn moved(mesh: &Mesh, step: impl Fn(DVec3) -> DVec3) -> Mesh {
    let positions = mesh.positions.iter().map(|p| step(DVec3::from_array(p.map(f64::from))).as_vec3().to_array());
    Mesh { positions: positions.collect(), ..mesh.clone() }
}
