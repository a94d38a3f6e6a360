//! Buffers of a scene's asteroid fields that stay on the adapter until the fields change: instances, shapes and meshes.
//!
//! No shader: holds buffers.
//! No twin: holds buffers.

use std::sync::Arc;

use super::{
    impostors::{
        atlas::{BakedImpostors, ImpostorAtlas},
        draw::AsteroidImpostorPass,
    },
    mesh::MeshVertex,
};
use crate::{
    gpu::{Gpu, filled_buffer, storage_buffer},
    plan::{
        asteroids::{
            areas::AREA_NODES,
            kinds::{Kinds, SetKinds},
        },
        settings::{AsteroidSettings, ImpostorMethod},
    },
    render::{RenderError, constants::asteroid_classes::FIRST_SHAPE},
    scene::{
        SceneObjects,
        asteroids::{Instances, PackedAsteroid, ShapeSet},
    },
};

/// Asteroid fields of a scene on the adapter.
pub(super) struct Held {
    sources: Vec<(Arc<Instances>, Arc<ShapeSet>)>,
    pub(super) kinds: Kinds,
    pub(super) instances: wgpu::Buffer,
    /// Room for the tables of a frame's pictures, followed by the tables of [`encode_shapes`].
    pub(super) tables: wgpu::Buffer,
    /// Projected areas of the shapes, divided by pi, set by set.
    areas_of_sets: Vec<Vec<f32>>,
    pub(super) meshes: wgpu::Buffer,
    /// Per mesh: number of indices, first index, first vertex.
    mesh_arguments: Vec<[u32; 3]>,
    pub(super) vertices: wgpu::Buffer,
    pub(super) indices: wgpu::Buffer,
    /// Impostor atlases of every set, with their method and size.
    atlases: Option<Atlases>,
    /// Areas and atlases of a previous scene, for reuse.
    spare: Option<Spare>,
}

/// Areas and atlases of shapes that another scene can reuse.
pub(super) struct Spare {
    areas: Vec<(Arc<ShapeSet>, Vec<f32>)>,
    /// Atlases with their method and size.
    atlases: Option<SpareAtlases>,
}

type SpareAtlases = (ImpostorMethod, [u32; 2], Vec<(Arc<ShapeSet>, ImpostorAtlas)>);

/// Atlases of all sets in order, with their method and size.
struct Atlases {
    method: ImpostorMethod,
    size: [u32; 2],
    atlases: Vec<ImpostorAtlas>,
    /// Bind groups of the atlases for impostors drawn as squares.
    groups: Vec<wgpu::BindGroup>,
}

/// Encodes the shapes of all sets for `shaders/asteroids/shape.wgsl`, after room for the tables of pictures: for each shape its
/// first kind, number of levels, bound, first level and first area; then error and longest edge of each level; then projected areas,
/// each with the next one. Indices are below 2^24, so they are exact as floats: see [`crate::plan::asteroids::kinds::MAX_SHAPES`].
fn encode_shapes(kinds: &Kinds, areas_of_sets: &[Vec<f32>]) -> Vec<[f32; 2]> {
    let shapes = || kinds.sets.iter().flat_map(|set| set.shapes.shapes.iter().zip(&set.shape_kinds));
    let mut tables = vec![[0.0; 2]; FIRST_SHAPE as usize];
    let mut level = tables.len() + 3 * shapes().count();
    let mut area = level + shapes().map(|(shape, _)| shape.lods.len()).sum::<usize>();
    for (shape, first_kind) in shapes() {
        tables.push([*first_kind as f32, shape.lods.len() as f32]);
        tables.push([shape.bound as f32, level as f32]);
        tables.push([area as f32, 0.0]);
        level += shape.lods.len();
        area += AREA_NODES * AREA_NODES;
    }
    let lods = shapes().flat_map(|(shape, _)| &shape.lods);
    tables.extend(lods.map(|lod| [lod.error as f32, lod.longest_edge as f32]));
    for areas in areas_of_sets {
        tables.extend(areas.iter().zip(areas.iter().skip(1).chain([&0.0])).map(|(area, next)| [*area, *next]));
    }
    tables
}

impl Held {
    pub(super) fn new(gpu: &Gpu, objects: &SceneObjects, spare: Option<Spare>, ahead: &BakedImpostors) -> Self {
        let fields = objects.fields.iter().map(Arc::as_ref);
        let kinds = Kinds::new(fields);
        let sources = objects.fields.iter().map(|field| (field.instances.clone(), field.shapes.clone())).collect();
        let instances = match objects.fields.as_slice() {
            [field] => storage_buffer(gpu, "asteroids", &field.instances.packed),
            fields => {
                let all: Vec<PackedAsteroid> =
                    fields.iter().flat_map(|field| field.instances.packed.iter().copied()).collect();
                storage_buffer(gpu, "asteroids", &all)
            }
        };
        // Projected areas of each set: kept from a previous scene, prepared in advance, or computed now.
        let known = |shapes: &Arc<ShapeSet>| {
            let mut areas = spare.iter().flat_map(|spare| &spare.areas);
            areas.find(|(known, _)| Arc::ptr_eq(known, shapes)).map(|(_, areas)| areas.clone())
        };
        let areas_of = |set: &SetKinds| known(&set.shapes).unwrap_or_else(|| ahead.areas_of(&set.shapes));
        let areas_of_sets: Vec<Vec<f32>> = kinds.sets.iter().map(areas_of).collect();
        // Shapes, levels of detail and meshes of all sets, one after the other.
        let mut meshes = Vec::new();
        let (mut vertices, mut indices): (Vec<MeshVertex>, Vec<u32>) = (Vec::new(), Vec::new());
        for set in &kinds.sets {
            for shape in &set.shapes.shapes {
                for lod in &shape.lods {
                    let triangles = lod.mesh.triangles.as_flattened();
                    meshes.push([triangles.len() as u32, indices.len() as u32, vertices.len() as u32, 0]);
                    indices.extend_from_slice(triangles);
                    let corners = lod.mesh.positions.iter().zip(&lod.mesh.normals).zip(&lod.mesh.albedos);
                    vertices.extend(
                        corners.map(|(([x, y, z], [nx, ny, nz]), albedo)| [*x, *y, *z, *nx, *ny, *nz, *albedo]),
                    );
                }
            }
        }
        Self {
            sources,
            instances,
            tables: storage_buffer(gpu, "asteroid tables", &encode_shapes(&kinds, &areas_of_sets)),
            areas_of_sets,
            meshes: storage_buffer(gpu, "asteroid meshes", &meshes),
            vertices: filled_buffer(gpu, "asteroid vertices", &vertices, wgpu::BufferUsages::VERTEX),
            indices: filled_buffer(gpu, "asteroid indices", &indices, wgpu::BufferUsages::INDEX),
            mesh_arguments: meshes.iter().map(|[indices, index, vertex, _]| [*indices, *index, *vertex]).collect(),
            atlases: None,
            spare,
            kinds,
        }
    }

    /// Keeps the parts that fields of another scene can reuse.
    pub(super) fn into_spare(self) -> Spare {
        let sets: Vec<Arc<ShapeSet>> = self.kinds.sets.iter().map(|set| Arc::clone(&set.shapes)).collect();
        let without_groups = |Atlases { method, size, atlases, .. }: Atlases| {
            (method, size, sets.iter().cloned().zip(atlases).collect())
        };
        Spare {
            atlases: self.atlases.map(without_groups),
            areas: sets.iter().cloned().zip(self.areas_of_sets).collect(),
        }
    }

    /// Creates the atlases of a method, unless those in use have the same method and size.
    pub(super) fn hold_atlases(
        &mut self,
        gpu: &Gpu,
        ahead: &BakedImpostors,
        pass: Option<&AsteroidImpostorPass>,
        (settings, method): (&AsteroidSettings, ImpostorMethod),
    ) -> Result<(), RenderError> {
        let size = [settings.tiles, settings.tile_px];
        if self.atlases.as_ref().is_some_and(|held| held.method == method && held.size == size) {
            return Ok(());
        }
        // Drop the old atlases before the new ones are made, so that both never exist at once.
        self.atlases = None;
        let spare = self.spare.take().and_then(|spare| spare.atlases);
        let of_same = spare.filter(|(spare_method, spare_size, _)| (*spare_method, *spare_size) == (method, size));
        let mut spare = of_same.map_or(Vec::new(), |(_, _, atlases)| atlases);
        let mut atlases = Vec::new();
        for set in &self.kinds.sets {
            let known = spare.iter().position(|(shapes, _)| Arc::ptr_eq(shapes, &set.shapes));
            let atlas = match known {
                Some(index) => Some(spare.swap_remove(index).1),
                None => ImpostorAtlas::new(gpu, ahead, &set.shapes, method, settings).map_err(Box::new)?,
            };
            atlases.extend(atlas);
        }
        let groups = match pass {
            Some(pass) => atlases.iter().map(|atlas| pass.atlas_group(gpu, &atlas.bindings())).collect(),
            None => Vec::new(),
        };
        self.atlases = Some(Atlases { method, size, atlases, groups });
        Ok(())
    }

    /// Returns the atlases of all sets; empty without impostors.
    pub(super) fn atlases(&self) -> &[ImpostorAtlas] {
        self.atlases.as_ref().map_or(&[], |held| &held.atlases)
    }

    /// Returns the bind groups of the atlases for squares; empty if no squares are drawn.
    pub(super) fn atlas_groups(&self) -> &[wgpu::BindGroup] {
        self.atlases.as_ref().map_or(&[], |held| &held.groups)
    }

    /// Per mesh: number of indices, first index, first vertex.
    pub(super) fn mesh_arguments(&self) -> &[[u32; 3]] {
        &self.mesh_arguments
    }

    /// Whether these buffers hold the instances and shapes of `objects`.
    pub(super) fn holds(&self, objects: &SceneObjects) -> bool {
        self.sources.len() == objects.fields.len()
            && self.sources.iter().zip(&objects.fields).all(|((instances, shapes), field)| {
                Arc::ptr_eq(instances, &field.instances) && Arc::ptr_eq(shapes, &field.shapes)
            })
    }
}
