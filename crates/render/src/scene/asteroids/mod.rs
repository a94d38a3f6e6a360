//! Fields of asteroids: a few shapes, and up to millions of instances of them, in groups of neighbours.
//!
//! Positions in the field's axes are f64; only positions relative to the middle of a group are f32. An instance spins around its shape's +z axis,
//! like a body in its relaxed rotation state; each instance has its own axis direction. Rotation angles are integers in units of 2^-32 turns, so that
//! multiplying a time by a rate wraps exactly, for any time.
//!
//! - `shapes`: the five procedural shapes (`surface`, `sphere`), and the conversion of any mesh to a shape (`solid`,
//!   `silhouette`, `tree`);
//! - `gltf`: shapes from files, with coarser levels from `simplify`;
//! - `placement`: random instances from a seed; `groups`: the groups and the tree; `packed`: the packed form of an
//!   instance;
//! - `spec`: the specification of a field.

mod gltf;
mod groups;
pub mod packed;
mod placement;
mod shapes;
pub(crate) mod silhouette;
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
    /// Positions of the vertices.
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
    /// Hausdorff distance between this mesh's surface and the finest one's, mean radii.
    pub error: f64,
    /// Longest edge, mean radii.
    pub longest_edge: f64,
}

/// A shape whose mean projected area is pi: its mean radius is 1.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct Shape {
    /// Levels of detail, finest first; at least one.
    pub lods: Vec<Lod>,
    /// Radius of the sphere around the origin that contains all levels, mean radii.
    pub bound: f64,
}

/// The shapes of a field.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct ShapeSet {
    /// The shapes; between 1 and 256.
    pub shapes: Vec<Shape>,
    /// Identifies a set: equal meshes have equal digests, even in different runs of the program.
    pub digest: u64,
}

/// An asteroid as the GPU reads it, 24 bytes. The documentation of [`packed`] defines axis, orientation and rotation
/// angle.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Pod, Zeroable)]
#[repr(C)]
pub struct PackedAsteroid {
    /// Position relative to the middle of its group, in the field's axes, m: three f32 as bits.
    pub offset: [u32; 3],
    /// Low 16 bits: ratio of the mean radius to the largest of the field, in units of 1/65535. Next 8 bits: index of the shape.
    pub radius_and_shape: u32,
    /// Spin axis in the field's axes, octahedral, two signed 16-bit fractions (`pack2x16snorm`).
    pub axis: u32,
    /// Low 16 bits: rotation angle at time 0, in units of 1/65536 turn. High 16 bits: turns per base period, a signed
    /// integer.
    pub spin: u32,
}

/// A node of neighbours: instances at level 0, nodes of the level below at other levels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Node {
    /// Middle, in the field's axes, m.
    pub middle_m: DVec3,
    /// Radius of the sphere around `middle_m` that contains every instance completely, m.
    pub radius_m: f64,
    /// Mean position, weighted by projected area, field's axes, m.
    pub centroid_m: DVec3,
    /// Sum of the mean projected areas, m^2.
    pub area_m2: f64,
    /// Largest mean radius, m.
    pub largest_m: f64,
    /// Smallest mean radius, m.
    pub smallest_m: f64,
    /// Index of the first instance, or of the first node of the level below.
    pub first: u32,
    /// Number of instances, or of nodes.
    pub count: u32,
}

/// Instances in groups of neighbours, and the tree over the groups.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct Instances {
    /// All instances, group by group.
    pub packed: Vec<PackedAsteroid>,
    /// Nodes by level: first the groups of at most [`GROUP`] instances. The last level has one node; there are no
    /// levels if there are no instances.
    pub levels: Vec<Vec<Node>>,
    /// The mean radius relative to which radii are packed, m.
    pub largest_m: f64,
    /// The base period, s.
    pub base_period_s: f64,
}

/// Maximum number of instances in a group.
pub const GROUP: usize = 256;

/// A field of asteroids.
#[derive(Clone, Debug, PartialEq)]
pub struct AsteroidField {
    /// Unique among the fields of a scene.
    pub name: String,
    /// Its centre: ICRS, barycentric, m.
    pub position_m: DVec3,
    /// Rotation from the field's axes to world axes.
    pub orientation: DQuat,
    /// Reflection law of the asteroids.
    pub law: ReflectionLaw,
    /// Geometric albedo for red, green and blue.
    pub geometric_albedo: [f64; 3],
    /// The instances.
    pub instances: Arc<Instances>,
    /// The shapes.
    pub shapes: Arc<ShapeSet>,
}

impl Instances {
    /// Converts a time, s, to units of 2^-32 base periods.
    pub fn time_parts(&self, time_s: f64) -> u32 {
        // A fraction that rounds up to 1 wraps to 0.
        ((time_s / self.base_period_s).rem_euclid(1.0) * 4_294_967_296.0) as u64 as u32
    }

    /// Index of the group of an instance: all groups are full except the last.
    pub fn group_of(&self, instance: usize) -> usize {
        instance / GROUP
    }

    /// Position of an instance in the field's axes, m; `None` if there is no such instance.
    pub fn place_m(&self, instance: usize) -> Option<DVec3> {
        let group = self.levels.first()?.get(self.group_of(instance))?;
        Some(group.middle_m + self.packed.get(instance)?.offset_m())
    }
}
