//! Shapes from meshes, centred, rotated and scaled so that every shape has mean radius 1 and spins about its +z axis;
//! and the five procedural shapes.
//!
//! All levels are moved and rotated with the transform of the finest one: its centroid to the origin, and the axis of the largest moment of inertia
//! to +z, that of the smallest to +x (for uniform density). Then each level is scaled separately to a mean projected area of pi. A coarse mesh whose
//! vertices lie on the surface is inside of it and would cover less. With this scale it covers on average as much as the finest mesh. So no light is
//! lost where levels change, and the surface error of the coarse mesh is half as large as without scaling.

use std::{f64::consts::PI, sync::LazyLock};

use glam::DVec3;
use rayon::prelude::*;

use super::{
    Lod, Mesh, Shape, ShapeSet,
    solid::{Solid, principal_axes},
    sphere::{self, Sphere},
    surface::{SEMI_AXES, Surface},
    tree::MeshTree,
};

/// Triangles of the levels of a procedural shape, finest first: from 1400 down to 500, as in the published method.
pub const LEVEL_TRIANGLES: [usize; 5] = [1400, 1150, 900, 700, 500];

/// Number of procedural shapes.
pub const PROCEDURAL_SHAPES: usize = SEMI_AXES.len();

/// Maximum number of shapes of a set.
pub const MOST_SHAPES: usize = 256;

/// Number of parts of a triangle's edge, for the sample points at which distances between meshes are measured.
const ERROR_STEPS: usize = 4;

/// Number of sample points that one task compares with a surface.
const POINTS_AT_ONCE: usize = 4096;

/// Relative margin by which bounds are enlarged, for f32 rounding.
pub(super) const F32_ROUNDING: f64 = 1e-6;

/// Spheres that become the levels of procedural shapes. They are the same for all seeds.
static SPHERES: LazyLock<[Sphere; 5]> = LazyLock::new(|| LEVEL_TRIANGLES.map(sphere::sphere));

impl ShapeSet {
    /// Five asteroid-like shapes, from nearly round to twice as long as thick, each with [`LEVEL_TRIANGLES`]. The same
    /// seed gives the same bits.
    pub fn procedural(seed: u64) -> Self {
        let spheres = &*SPHERES;
        let shapes = (0..PROCEDURAL_SHAPES)
            .into_par_iter()
            .map(|number| {
                let surface = Surface::new(seed, number);
                finished(spheres.iter().map(|sphere| sampled(&surface, sphere)).collect())
            })
            .collect();
        Self::from_shapes(shapes)
    }

    pub(super) fn from_shapes(shapes: Vec<Shape>) -> Self {
        let digest = digest_of(&shapes);
        Self { shapes, digest }
    }

    /// [`Shape::bound`] of every shape, as [`super::Instances::place`] needs them.
    pub fn bounds(&self) -> Vec<f64> {
        self.shapes.iter().map(|shape| shape.bound).collect()
    }
}

fn sampled(surface: &Surface, (directions, triangles): &Sphere) -> Solid {
    Solid {
        positions: directions.iter().map(|direction| surface.place(*direction)).collect(),
        albedos: directions.iter().map(|direction| surface.albedo(*direction)).collect(),
        triangles: triangles.clone(),
    }
}

/// Builds a shape from its levels, finest first: closed meshes of positive volume around a common origin.
pub(super) fn finished(mut levels: Vec<Solid>) -> Shape {
    let Some(finest) = levels.first() else { return Shape::default() };
    let moments = finest.moments();
    let shape_from_mesh = principal_axes(moments.covariance).transpose();
    for level in &mut levels {
        level.move_by(|position| shape_from_mesh * (position - moments.centroid));
        let scale = (PI / level.mean_projected_area()).sqrt();
        level.move_by(|position| position * scale);
    }
    let bound = levels.iter().map(Solid::bound).fold(0.0, f64::max) * (1.0 + F32_ROUNDING);
    let meshes: Vec<Mesh> = levels.iter().map(Solid::to_mesh).collect();
    let finest = Sampled::new(&meshes[0]);
    let lods = meshes
        .iter()
        .enumerate()
        .map(|(level, mesh)| Lod {
            mesh: mesh.clone(),
            error: if level == 0 { 0.0 } else { finest.distance(&Sampled::new(mesh)) },
            longest_edge: longest_edge(mesh),
        })
        .collect();
    Shape { lods, bound }
}

fn place(mesh: &Mesh, vertex: u32) -> DVec3 {
    DVec3::from_array(mesh.positions[vertex as usize].map(f64::from))
}

fn longest_edge(mesh: &Mesh) -> f64 {
    let longest_squared = |&[a, b, c]: &[u32; 3]| {
        let [a, b, c] = [a, b, c].map(|vertex| place(mesh, vertex));
        a.distance_squared(b).max(b.distance_squared(c)).max(c.distance_squared(a))
    };
    mesh.triangles.iter().map(longest_squared).fold(0.0, f64::max).sqrt()
}

/// Hausdorff distance between the surfaces of two meshes, measured at a grid of points on every triangle, including
/// corners and edges.
pub fn surface_distance(a: &Mesh, b: &Mesh) -> f64 {
    Sampled::new(a).distance(&Sampled::new(b))
}

/// A mesh's surface as sample points and as a tree.
struct Sampled {
    points: Vec<DVec3>,
    tree: MeshTree,
}

impl Sampled {
    fn new(mesh: &Mesh) -> Self {
        let mut points = Vec::new();
        for triangle in &mesh.triangles {
            let [a, b, c] = triangle.map(|vertex| place(mesh, vertex));
            for i in 0..=ERROR_STEPS {
                for j in 0..=ERROR_STEPS - i {
                    let (u, v) = (i as f64 / ERROR_STEPS as f64, j as f64 / ERROR_STEPS as f64);
                    points.push(a + (b - a) * u + (c - a) * v);
                }
            }
        }
        Self { points, tree: MeshTree::new(mesh) }
    }

    fn distance(&self, other: &Self) -> f64 {
        let one_way = |points: &[DVec3], tree: &MeshTree| {
            let largest = |points: &[DVec3]| {
                let (mut largest, mut near) = (0.0_f64, 0);
                for point in points {
                    largest = largest.max(tree.distance_beyond(*point, largest, &mut near));
                }
                largest
            };
            points.par_chunks(POINTS_AT_ONCE).map(largest).reduce(|| 0.0, f64::max)
        };
        one_way(&self.points, &other.tree).max(one_way(&other.points, &self.tree))
    }
}

/// FNV-1a, 64 bits, of the bits of all meshes and their counts.
pub(super) fn digest_of(shapes: &[Shape]) -> u64 {
    let mut hash = 0xcbf2_9ce4_8422_2325u64;
    let mut add = |bytes: &[u8]| {
        for byte in bytes {
            hash = (hash ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3);
        }
    };
    for shape in shapes {
        add(&(shape.lods.len() as u64).to_le_bytes());
        for Lod { mesh, .. } in &shape.lods {
            add(&(mesh.positions.len() as u64).to_le_bytes());
            add(&(mesh.triangles.len() as u64).to_le_bytes());
            add(bytemuck::cast_slice(&mesh.positions));
            add(bytemuck::cast_slice(&mesh.normals));
            add(bytemuck::cast_slice(&mesh.albedos));
            add(bytemuck::cast_slice(&mesh.triangles));
        }
    }
    hash
}
