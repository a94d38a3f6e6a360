//! Numbering of the lists that asteroids are sorted into: per plane, one list for each mesh of each set of shapes, then one for the impostors
//! of each set. A plane is a surface to draw onto: a picture, or a face of the cube behind it.

use std::sync::Arc;

use crate::{
    plan::stars::cull::MAX_VIEWPORTS,
    scene::asteroids::{AsteroidField, ShapeSet},
    view::projection::Face,
};

/// Maximum number of meshes of a set: culling counts them in the memory of a workgroup.
pub const MAX_SET_MESHES: usize = 1280;

/// Maximum number of planes of a frame: pictures, and six faces behind each.
pub const MAX_PLANES: usize = 7 * MAX_VIEWPORTS;
/// Maximum number of shapes in all fields of a scene. With this limit, the table of shapes, which includes their levels and projected areas, has
/// fewer than 2^24 entries.
pub const MAX_SHAPES: usize = 12_000;
/// Maximum number of fields of a scene.
pub const MAX_FIELDS: usize = 256;

/// A picture, or a face of the cube behind it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Plane {
    /// Index of the viewport.
    pub viewport: usize,
    /// The face; `None`: the picture itself.
    pub face: Option<Face>,
}

/// All planes of a frame: the pictures first, then the necessary faces, by viewport.
pub fn planes_of(faces: &[u8]) -> Vec<Plane> {
    let pictures = (0..faces.len()).map(|viewport| Plane { viewport, face: None });
    let behind = faces.iter().enumerate().flat_map(|(viewport, bits)| {
        let needed = Face::ALL.into_iter().filter(move |face| bits >> *face as u8 & 1 == 1);
        needed.map(move |face| Plane { viewport, face: Some(face) })
    });
    pictures.chain(behind).collect()
}

/// A set of shapes with the indices of its lists.
#[derive(Clone, Debug)]
pub struct SetKinds {
    /// The set.
    pub shapes: Arc<ShapeSet>,
    /// Index of its first shape among those of all sets.
    pub first_shape: usize,
    /// For each shape, the kind of its finest mesh. The kinds of its coarser meshes follow.
    pub shape_kinds: Vec<usize>,
    /// Index of its first kind.
    pub first_kind: usize,
    /// Number of its meshes.
    pub meshes: usize,
}

/// Kinds of lists of all fields.
#[derive(Clone, Debug, Default)]
pub struct Kinds {
    /// The distinct sets.
    pub sets: Vec<SetKinds>,
    /// Index of the set of each field.
    pub set_of_field: Vec<usize>,
    /// Index of the first asteroid of each field among those of all fields.
    pub first_instance: Vec<usize>,
    /// Number of meshes of all sets.
    pub meshes: usize,
}

impl Kinds {
    /// Numbers the lists of these fields.
    pub fn new<'a>(fields: impl IntoIterator<Item = &'a AsteroidField>) -> Self {
        let mut kinds = Self::default();
        let (mut shapes, mut instances) = (0, 0);
        for field in fields {
            let known = kinds.sets.iter().position(|set| Arc::ptr_eq(&set.shapes, &field.shapes));
            let set = known.unwrap_or_else(|| {
                let first_kind = kinds.meshes;
                let shape_kinds = field.shapes.shapes.iter().map(|shape| {
                    let first = kinds.meshes;
                    kinds.meshes += shape.lods.len();
                    first
                });
                let shape_kinds = shape_kinds.collect();
                let meshes = kinds.meshes - first_kind;
                let shapes_before = shapes;
                shapes += field.shapes.shapes.len();
                kinds.sets.push(SetKinds {
                    shapes: Arc::clone(&field.shapes),
                    first_shape: shapes_before,
                    shape_kinds,
                    first_kind,
                    meshes,
                });
                kinds.sets.len() - 1
            });
            kinds.set_of_field.push(set);
            kinds.first_instance.push(instances);
            instances += field.instances.packed.len();
        }
        kinds
    }

    /// The set of a field.
    pub fn set(&self, field: usize) -> &SetKinds {
        &self.sets[self.set_of_field[field]]
    }

    /// Kind of the impostors of a set.
    pub fn impostor_kind(&self, set: usize) -> usize {
        self.meshes + set
    }

    /// Number of lists of a plane: meshes and impostors.
    pub fn lists(&self) -> usize {
        self.meshes + self.sets.len()
    }
}
