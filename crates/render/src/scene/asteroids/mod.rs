//! Fields of asteroids: a few shapes, and up to millions of instances of them, in groups of neighbours.
//!
//! Places are f64 in the field's axes, f32 only relative to the middle of a group. An instance spins around its shape's
//! +z axis, as a body does that has come to rest; where this axis points is its own. Its turn is counted in 2^32 parts,
//! so that multiplying a moment by a rate wraps exactly, however far away the moment is.
//!
//! - `shapes`: the five procedural shapes (`surface`, `sphere`), and how any mesh becomes a shape (`solid`, `tree`);
//! - `gltf`: shapes from files, their coarser levels from `simplify`;
//! - `placement`: instances drawn from a seed, `groups` the groups and the tree, `packed` how an instance is packed;
//! - `spec`: what a field is made from.

mod gltf;
mod groups;
pub mod packed;
mod placement;
mod shapes;
mod simplify;
mod solid;
mod spec;
mod sphere;
mod surface;
#[cfg(test)]
mod tests;
mod tree;

use std::sync::Arc;

use bytemuck::{Pod, Zeroable};
use glam::{DQuat, DVec3};

pub use self::{
    gltf::{MOST_TRIANGLES, ShapeError},
    groups::BRANCHING,
    placement::{
        FieldError, FieldParameters, LARGEST_EXTENT_M, LARGEST_PERIOD_RATIO, LARGEST_RADIUS_RATIO, LEAST_OF_RANGE,
        MOST_INSTANCES, Placement, STEEPEST_SIZE_INDEX,
    },
    shapes::{LEVEL_TRIANGLES, MOST_SHAPES, PROCEDURAL_SHAPES, surface_distance},
    spec::{FieldSpec, MOST_FIELDS, MOST_SETS, MadeField, ShapeSource, SpecError, check_fields, make_fields},
    tree::{Hit, MeshTree},
};
use super::bodies::ReflectionLaw;

/// A triangle mesh around the origin, in units of the shape's mean radius.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct Mesh {
    /// Places of the vertices.
    pub positions: Vec<[f32; 3]>,
    /// Unit normals, one per vertex, smooth.
    pub normals: Vec<[f32; 3]>,
    /// Factors on the albedo, one per vertex; their mean over the surface is 1.
    pub albedos: Vec<f32>,
    /// Triangles, counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
}

/// A shape at one level of detail.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct Lod {
    /// The mesh.
    pub mesh: Mesh,
    /// Greatest distance between this mesh's surface and the finest one's, either way, mean radii.
    pub error: f64,
    /// Longest edge, mean radii.
    pub longest_edge: f64,
}

/// A shape whose mean projected area is pi: its mean radius is 1.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct Shape {
    /// Levels of detail, the finest first; at least one.
    pub lods: Vec<Lod>,
    /// Radius of the sphere around the origin that holds all levels, mean radii.
    pub bound: f64,
}

/// The shapes of a field.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct ShapeSet {
    /// The shapes; at least one, at most 256.
    pub shapes: Vec<Shape>,
    /// Tells sets apart: equal meshes give equal digests, also in other runs.
    pub digest: u64,
}

/// An asteroid as the adapter reads it, 24 bytes. The head of [`packed`] tells how to read axis, orientation and turn.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Pod, Zeroable)]
#[repr(C)]
pub struct PackedAsteroid {
    /// Place relative to the middle of its group, in the field's axes, m: three f32 as bits.
    pub offset: [u32; 3],
    /// Low 16 bits: mean radius over the largest of the field, in parts of 65535. Next 8 bits: number of the shape.
    pub radius_and_shape: u32,
    /// Spin axis in the field's axes, octahedral, two signed 16-bit parts (`pack2x16snorm`).
    pub axis: u32,
    /// Low 16 bits: turn at time 0, in parts of 65536. High 16 bits: turns per base period, a signed whole number.
    pub spin: u32,
}

/// Neighbours: of level 0 instances, of the other levels nodes of the level below.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Node {
    /// Middle, in the field's axes, m.
    pub middle_m: DVec3,
    /// Radius of the sphere around it that holds all of every instance, m.
    pub radius_m: f64,
    /// Mean of the places, weighted by projected area, field's axes, m.
    pub centroid_m: DVec3,
    /// Sum of the mean projected areas, m^2.
    pub area_m2: f64,
    /// Largest mean radius, m.
    pub largest_m: f64,
    /// Smallest mean radius, m.
    pub smallest_m: f64,
    /// First instance, or node of the level below.
    pub first: u32,
    /// Number of instances, or of nodes.
    pub count: u32,
}

/// Instances in groups of neighbours, and the tree of these.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct Instances {
    /// All instances, group by group.
    pub packed: Vec<PackedAsteroid>,
    /// Nodes by level: groups of at most [`GROUP`] instances first; the last level has one node, or none if there are
    /// no instances.
    pub levels: Vec<Vec<Node>>,
    /// Mean radius that the packed radii are parts of, m.
    pub largest_m: f64,
    /// The base period, s.
    pub base_period_s: f64,
}

/// Most instances of a group.
pub const GROUP: usize = 256;

/// A field of asteroids.
#[derive(Clone, Debug, PartialEq)]
pub struct AsteroidField {
    /// Unique among the fields of a scene.
    pub name: String,
    /// Its middle: ICRS, barycentric, m.
    pub position_m: DVec3,
    /// Rotation from the field's axes to world axes.
    pub orientation: DQuat,
    /// How the asteroids reflect.
    pub law: ReflectionLaw,
    /// Geometric albedo, of red, green and blue.
    pub geometric_albedo: [f64; 3],
    /// Where they are.
    pub instances: Arc<Instances>,
    /// What they look like.
    pub shapes: Arc<ShapeSet>,
}

impl Instances {
    /// A moment, s, in 2^32 parts of the base period.
    pub fn time_parts(&self, time_s: f64) -> u32 {
        // A share that rounds up to 1 wraps to 0.
        ((time_s / self.base_period_s).rem_euclid(1.0) * 4_294_967_296.0) as u64 as u32
    }

    /// Number of the group of an instance: all groups are full but the last.
    pub fn group_of(&self, instance: usize) -> usize {
        instance / GROUP
    }

    /// Place of an instance in the field's axes, m; `None` if there is no such instance.
    pub fn place_m(&self, instance: usize) -> Option<DVec3> {
        let group = self.levels.first()?.get(self.group_of(instance))?;
        Some(group.middle_m + self.packed.get(instance)?.offset_m())
    }
}
