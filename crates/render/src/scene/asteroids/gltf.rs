//! Shapes from glTF 2.0 files (.glb, or .gltf with embedded or external buffers).
//!
//! A file is one shape. The triangles of all meshes of its scene, transformed by their nodes, form one surface; vertices at the same position are
//! merged. The surface must be closed, because inertia, silhouette and impostors need an inside. Normals are computed; those in the file are ignored.
//! Materials are ignored too: the albedo varies with the luminance of the vertex colour (`COLOR_0`), if there is one.
//!
//! Nodes or meshes with names that end in `_LOD0`, `_LOD1` and so on are the levels of detail, finest first. Without such names, the whole surface is
//! the finest level, and coarser levels are generated, down to the last entry of [`LEVEL_TRIANGLES`]. If a mesh has fewer triangles than the first
//! entry, the last entry is reduced in proportion.

mod accessors;

use std::{
    collections::{BTreeMap, HashMap, HashSet},
    path::{Path, PathBuf},
};

use glam::{DMat4, DVec3};
use gltf::{
    Document, Node, Primitive, Semantic,
    accessor::{DataType, Dimensions},
    mesh::Mode,
};

use super::{
    ShapeSet,
    shapes::{LEVEL_TRIANGLES, MOST_SHAPES, finished},
    simplify::simplified,
    solid::Solid,
};
use crate::{files, photometry::rec709};

/// Maximum number of triangles of a level of detail.
pub const MOST_TRIANGLES: usize = 500_000;
/// Maximum number of vertices and corners of all levels together. It suffices for [`MOST_LEVELS`] levels whose triangles share no vertices, if each
/// level has half as many triangles as the one before.
const MOST_CORNERS: usize = 2 * 2 * 3 * MOST_TRIANGLES;
/// Maximum number of levels of detail of a shape.
pub const MOST_LEVELS: usize = 8;

/// Reasons why shapes cannot be read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ShapeError {
    /// No files, or too many.
    #[error("{count} shape files: must be between 1 and {MOST_SHAPES}")]
    Files {
        /// Number of files.
        count: usize,
    },
    /// A file is invalid.
    #[error("{}: {problem}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// The problem.
        #[source]
        problem: MeshProblem,
    },
}

/// Maximum total size of a shape's file and all of its buffers, embedded and external, bytes.
const MOST_BYTES: u64 = 256 << 20;

/// Problem in a shape's file.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum MeshProblem {
    /// It cannot be read.
    #[error("cannot be read: {0}")]
    Read(#[from] std::io::Error),
    /// It is not glTF 2.0.
    #[error("is not a valid glTF 2.0 file: {0}")]
    Gltf(#[from] gltf::Error),
    /// A buffer is missing or too short.
    #[error("buffer {buffer}: {reason}")]
    Buffer {
        /// Its number.
        buffer: usize,
        /// The problem.
        reason: String,
    },
    /// An accessor does not have the required form.
    #[error("accessor {accessor}: {reason}")]
    Accessor {
        /// Its number.
        accessor: usize,
        /// The problem.
        reason: String,
    },
    /// A mesh cannot be used.
    #[error("mesh {mesh}: {reason}")]
    Mesh {
        /// Its name or number.
        mesh: String,
        /// The problem, and the valid values.
        reason: String,
    },
    /// The nodes do not form a tree.
    #[error("node {node} is reached twice: nodes must form a tree")]
    Cycle {
        /// Number of the node.
        node: usize,
    },
    /// Only some meshes have level names, or levels are missing.
    #[error(
        "{reason}; either no mesh name may contain `_LOD`, or all must be numbered `_LOD0`, `_LOD1` ... without gaps, \
         at most {MOST_LEVELS} levels"
    )]
    Levels {
        /// The problem.
        reason: String,
    },
    /// A level of detail is not a valid shape.
    #[error("level {level}: {reason}")]
    Surface {
        /// Number of the level.
        level: usize,
        /// The problem, and the valid values.
        reason: String,
    },
}

impl ShapeSet {
    /// Reads one shape from each file. The documentation of this module describes the valid contents.
    ///
    /// # Errors
    ///
    /// [`ShapeError`] with the file and the problem.
    pub fn from_gltf(paths: &[PathBuf]) -> Result<Self, ShapeError> {
        if paths.is_empty() || paths.len() > MOST_SHAPES {
            return Err(ShapeError::Files { count: paths.len() });
        }
        let read = |path: &PathBuf| {
            levels_of(path).map(finished).map_err(|problem| ShapeError::File { path: path.clone(), problem })
        };
        Ok(Self::from_shapes(paths.iter().map(read).collect::<Result<_, _>>()?))
    }
}

/// Reads the levels of detail of a file, finest first.
fn levels_of(path: &Path) -> Result<Vec<Solid>, MeshProblem> {
    let bytes = files::read_bounded(path, MOST_BYTES)?;
    let gltf::Gltf { document, blob } = gltf::Gltf::from_slice_without_validation(&bytes)?;
    let document = validated(document)?;
    let buffers = accessors::buffers(&document, path.parent().unwrap_or(Path::new(".")), blob)?;
    let mut reader = Reader { buffers, levels: BTreeMap::new(), seen: HashSet::new(), corners: 0 };
    reader.document(&document)?;
    // Either all meshes have level names without gaps, or none has.
    let named = reader.levels.keys().filter(|level| level.is_some()).count();
    if named > 0 && (named < reader.levels.len() || !reader.levels.contains_key(&Some(named - 1))) {
        let found = reader.levels.keys().map(|level| level.map_or("none".to_owned(), |level| format!("_LOD{level}")));
        let reason = format!("the names of the meshes have the levels {}", found.collect::<Vec<_>>().join(", "));
        return Err(MeshProblem::Levels { reason });
    }
    if named > MOST_LEVELS {
        return Err(MeshProblem::Levels { reason: format!("there are {named} levels") });
    }
    // Each level must be a closed surface with fewer triangles than the level before.
    let mut levels = Vec::new();
    for (level, welder) in reader.levels.into_values().enumerate() {
        levels.push(welder.closed().map_err(|reason| MeshProblem::Surface { level, reason })?);
    }
    if let Some(level) = levels.windows(2).position(|pair| pair[1].triangles.len() >= pair[0].triangles.len()) {
        let reason = "it must have fewer triangles than the level before".to_owned();
        return Err(MeshProblem::Surface { level: level + 1, reason });
    }
    match levels.first() {
        None => Err(MeshProblem::Surface { level: 0, reason: "the scene has no meshes".to_owned() }),
        Some(finest) if named == 0 => {
            let coarser = simplified(finest, &coarser_targets(finest.triangles.len()));
            levels.extend(coarser);
            Ok(levels)
        }
        Some(_) => Ok(levels),
    }
}

/// Validates a document. The crate looks up the positions of a mesh before it checks the accessor index, and panics on
/// a bad one, so accessor indices are checked first.
fn validated(document: Document) -> Result<Document, MeshProblem> {
    let root = document.into_json();
    let count = root.accessors.len();
    let primitives = root.meshes.iter().flat_map(|mesh| &mesh.primitives);
    let mut named = primitives.flat_map(|primitive| primitive.attributes.values()).map(|accessor| accessor.value());
    if let Some(accessor) = named.find(|accessor| *accessor >= count) {
        return Err(MeshProblem::Accessor {
            accessor,
            reason: format!("a mesh refers to it, but there are only {count}"),
        });
    }
    Ok(Document::from_json(root)?)
}

/// Triangle counts of the levels that are coarser than a level of `finest` triangles: a geometric series in which each count is smaller than the one
/// before.
fn coarser_targets(finest: usize) -> Vec<usize> {
    let [most, .., least] = LEVEL_TRIANGLES;
    let last = finest.min(most) as f64 * least as f64 / most as f64;
    let steps = LEVEL_TRIANGLES.len() - 1;
    let target = |step: usize| finest as f64 * (last / finest as f64).powf(step as f64 / steps as f64);
    // A closed mesh has an even number of triangles.
    let mut targets: Vec<usize> = (1..=steps).map(|step| (target(step) / 2.0).round() as usize * 2).collect();
    targets.retain(|target| *target >= 4 && *target < finest);
    targets.dedup();
    targets
}

/// The number after `_LOD` at the end of a name.
fn level_in(name: Option<&str>) -> Option<usize> {
    name?.rsplit_once("_LOD")?.1.parse().ok()
}

struct Reader {
    buffers: Vec<Vec<u8>>,
    /// Surfaces by level of detail; `None`: the name has no level.
    levels: BTreeMap<Option<usize>, Welder>,
    seen: HashSet<usize>,
    /// Vertices and corners of all primitives so far: a mesh counts once for every node that uses it.
    corners: usize,
}

impl Reader {
    /// Reads all nodes of the default scene, or of the first scene if there is no default. If there is no scene, it reads all nodes that are not
    /// children.
    fn document(&mut self, document: &Document) -> Result<(), MeshProblem> {
        if let Some(scene) = document.default_scene().or(document.scenes().next()) {
            return self.nodes(scene.nodes());
        }
        let children: HashSet<usize> =
            document.nodes().flat_map(|node| node.children().map(|child| child.index()).collect::<Vec<_>>()).collect();
        self.nodes(document.nodes().filter(|node| !children.contains(&node.index())))
    }

    /// Reads nodes with their descendants, parents before children. Iterative, so that deep trees do not overflow the
    /// stack.
    fn nodes<'a>(&mut self, roots: impl Iterator<Item = Node<'a>>) -> Result<(), MeshProblem> {
        let mut waiting: Vec<(Node<'a>, DMat4)> = roots.map(|node| (node, DMat4::IDENTITY)).collect();
        waiting.reverse();
        while let Some((node, world_from_parent)) = waiting.pop() {
            let world_from_node = self.node(&node, world_from_parent)?;
            let first = waiting.len();
            waiting.extend(node.children().map(|child| (child, world_from_node)));
            waiting[first..].reverse();
        }
        Ok(())
    }

    /// Reads one node; returns the transform from its axes to world axes.
    fn node(&mut self, node: &Node<'_>, world_from_parent: DMat4) -> Result<DMat4, MeshProblem> {
        if !self.seen.insert(node.index()) {
            return Err(MeshProblem::Cycle { node: node.index() });
        }
        let columns = node.transform().matrix().map(|column| column.map(f64::from));
        let world_from_node = world_from_parent * DMat4::from_cols_array_2d(&columns);
        if let Some(mesh) = node.mesh() {
            let level = level_in(node.name()).or(level_in(mesh.name()));
            let name = mesh.name().map_or_else(|| mesh.index().to_string(), |name| format!("{name:?}"));
            let welder = self.levels.entry(level).or_default();
            for primitive in mesh.primitives() {
                add_primitive(welder, &self.buffers, &name, &primitive, world_from_node, &mut self.corners)?;
            }
        }
        Ok(world_from_node)
    }
}

fn add_primitive(
    welder: &mut Welder,
    buffers: &[Vec<u8>],
    mesh: &str,
    primitive: &Primitive<'_>,
    world_from_node: DMat4,
    corners_so_far: &mut usize,
) -> Result<(), MeshProblem> {
    let refused = |reason: String| MeshProblem::Mesh { mesh: mesh.to_owned(), reason };
    if primitive.mode() != Mode::Triangles {
        return Err(refused(format!("its primitives are {:?}, but only Triangles are supported", primitive.mode())));
    }
    let positions = primitive.get(&Semantic::Positions).ok_or_else(|| refused("it has no POSITION".to_owned()))?;
    accessors::check_kind(&positions, &[DataType::F32], &[Dimensions::Vec3])?;
    let indices = primitive.indices();
    let corners = indices.as_ref().map_or(positions.count(), |indices| indices.count());
    let too_many = 3 * MOST_TRIANGLES;
    if corners > too_many || positions.count() > too_many {
        return Err(refused(format!(
            "it has {} vertices and {corners} corners; both must be at most {too_many}",
            positions.count()
        )));
    }
    if !corners.is_multiple_of(3) {
        return Err(refused(format!("its {corners} corners do not make whole triangles")));
    }
    // Checked before reading: a short file may refer to one mesh any number of times.
    *corners_so_far += corners + positions.count();
    if *corners_so_far > MOST_CORNERS {
        return Err(refused(format!(
            "with it the scene has {corners_so_far} vertices and corners, more than the maximum of {MOST_CORNERS}"
        )));
    }
    let numbers = accessors::numbers(&positions, buffers)?;
    let places: Vec<DVec3> =
        numbers.chunks_exact(3).map(|p| world_from_node.transform_point3(DVec3::new(p[0], p[1], p[2]))).collect();
    if let Some(vertex) = places.iter().position(|place| !place.is_finite()) {
        return Err(refused(format!("vertex {vertex} is at {}, which is not finite", places[vertex])));
    }
    let albedos = albedos(primitive, buffers, places.len(), &refused)?;
    let vertices: Vec<u32> = places.iter().zip(albedos).map(|(place, albedo)| welder.vertex(*place, albedo)).collect();
    let order = match indices {
        None => (0..places.len()).collect(),
        Some(indices) => {
            accessors::check_kind(&indices, &[DataType::U8, DataType::U16, DataType::U32], &[Dimensions::Scalar])?;
            accessors::numbers(&indices, buffers)?.into_iter().map(|index| index as usize).collect::<Vec<_>>()
        }
    };
    // A mirroring transform reverses the winding of triangles.
    let mirrored = world_from_node.determinant() < 0.0;
    for corners in order.chunks_exact(3) {
        let mut triangle = [0; 3];
        for (vertex, &index) in triangle.iter_mut().zip(corners) {
            *vertex = *vertices
                .get(index)
                .ok_or_else(|| refused(format!("a triangle refers to vertex {index} of {}", vertices.len())))?;
        }
        if mirrored {
            triangle.swap(1, 2);
        }
        welder.triangle(triangle);
    }
    Ok(())
}

/// Luminance of the vertex colours; 1 without colours.
fn albedos(
    primitive: &Primitive<'_>,
    buffers: &[Vec<u8>],
    vertices: usize,
    refused: &dyn Fn(String) -> MeshProblem,
) -> Result<Vec<f64>, MeshProblem> {
    let Some(colours) = primitive.get(&Semantic::Colors(0)) else { return Ok(vec![1.0; vertices]) };
    let kinds = [DataType::F32, DataType::U8, DataType::U16];
    accessors::check_kind(&colours, &kinds, &[Dimensions::Vec3, Dimensions::Vec4])?;
    let numbers = accessors::numbers(&colours, buffers)?;
    let components = colours.dimensions().multiplicity();
    let albedos: Vec<f64> =
        numbers.chunks_exact(components).map(|rgb| rec709::luminance([rgb[0], rgb[1], rgb[2]])).collect();
    if albedos.len() != vertices {
        return Err(refused(format!("it has {vertices} vertices and {} colours", albedos.len())));
    }
    if let Some(vertex) = albedos.iter().position(|albedo| !albedo.is_finite() || *albedo < 0.0) {
        return Err(refused(format!(
            "the colour of vertex {vertex} has luminance {}; it must be 0 or more",
            albedos[vertex]
        )));
    }
    Ok(albedos)
}

/// Merges vertices at the same position, and drops triangles that become degenerate.
#[derive(Default)]
struct Welder {
    solid: Solid,
    /// Index of the vertex at a position, keyed by the bits of its coordinates.
    numbers: HashMap<[u64; 3], u32>,
    /// Number of merged file vertices for each vertex.
    joined: Vec<f64>,
}

impl Welder {
    fn vertex(&mut self, place: DVec3, albedo: f64) -> u32 {
        // Minus zero is the same position as zero.
        let key = place.to_array().map(|coordinate| (coordinate + 0.0).to_bits());
        let next = self.solid.positions.len() as u32;
        let number = *self.numbers.entry(key).or_insert(next);
        if number == next {
            self.solid.positions.push(place);
            self.solid.albedos.push(albedo);
            self.joined.push(1.0);
        } else {
            let (mean, count) = (&mut self.solid.albedos[number as usize], &mut self.joined[number as usize]);
            *count += 1.0;
            *mean += (albedo - *mean) / *count;
        }
        number
    }

    fn triangle(&mut self, [a, b, c]: [u32; 3]) {
        if a != b && b != c && c != a {
            self.solid.triangles.push([a, b, c]);
        }
    }

    /// Returns the surface if it is a valid shape, otherwise the problem.
    fn closed(self) -> Result<Solid, String> {
        let mut solid = self.solid;
        let triangles = solid.triangles.len();
        if triangles == 0 || triangles > MOST_TRIANGLES {
            return Err(format!("it has {triangles} triangles with an area: must be between 4 and {MOST_TRIANGLES}"));
        }
        if let Some([from, to]) = solid.open_edge() {
            let [from, to] = [from, to].map(|vertex| solid.positions[vertex as usize]);
            return Err(format!(
                "the edge from {from} to {to} is not shared by exactly two triangles with the same orientation: \
                 only closed surfaces are allowed"
            ));
        }
        let first = solid.positions[0];
        let bound = solid.positions.iter().map(|position| position.distance(first)).fold(0.0, f64::max);
        let volume = solid.moments().volume;
        if !bound.is_finite() || volume.abs() <= 1e-9 * bound.powi(3) {
            return Err(format!("its volume is {volume}: a closed surface around a volume is needed"));
        }
        if volume < 0.0 {
            solid.turn_over();
        }
        if solid.area_and_mean_albedo().1 <= 0.0 {
            return Err("its vertex colours are all black: their mean over the surface must be above 0".to_owned());
        }
        Ok(solid)
    }
}

#[cfg(test)]
mod tests;
