#![allow(clippy::unwrap_used, reason = "a failing test may panic")]

use base64::{Engine, engine::general_purpose::STANDARD};
use serde_json::{Value, json};
use tempfile::TempDir;

use super::*;
use crate::scene::asteroids::{
    Mesh, surface_distance,
    tests::{box_solid, moved, sphere_solid},
};

/// A document with one buffer: each mesh with its positions, grey vertex colours and indices.
fn document(meshes: &[(&str, &Mesh)], uri: Option<String>) -> (Value, Vec<u8>) {
    let mut binary: Vec<u8> = Vec::new();
    let (mut views, mut accessors, mut listed, mut nodes) = (vec![], vec![], vec![], vec![]);
    for (name, mesh) in meshes {
        let colours: Vec<[f32; 3]> = mesh.albedos.iter().map(|albedo| [*albedo; 3]).collect();
        let parts: [(&[u8], Value); 3] = [
            (
                bytemuck::cast_slice(&mesh.positions),
                json!({"componentType": 5126, "type": "VEC3",
                "count": mesh.positions.len(), "min": [-9, -9, -9], "max": [9, 9, 9]}),
            ),
            (bytemuck::cast_slice(&colours), json!({"componentType": 5126, "type": "VEC3", "count": colours.len()})),
            (
                bytemuck::cast_slice(&mesh.triangles),
                json!({"componentType": 5125, "type": "SCALAR",
                "count": mesh.triangles.len() * 3}),
            ),
        ];
        let first = accessors.len();
        for (bytes, mut accessor) in parts {
            views.push(json!({"buffer": 0, "byteOffset": binary.len(), "byteLength": bytes.len()}));
            accessor["bufferView"] = json!(accessors.len());
            accessors.push(accessor);
            binary.extend(bytes);
        }
        listed.push(json!({"name": name, "primitives": [{"attributes": {"POSITION": first, "COLOR_0": first + 1},
            "indices": first + 2}]}));
        nodes.push(json!({"mesh": nodes.len()}));
    }
    let mut buffer = json!({"byteLength": binary.len()});
    if let Some(uri) = uri {
        buffer["uri"] = json!(uri);
    }
    let scene: Vec<usize> = (0..nodes.len()).collect();
    let document = json!({"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": scene}], "nodes": nodes,
        "meshes": listed, "accessors": accessors, "bufferViews": views, "buffers": [buffer]});
    (document, binary)
}

/// A .glb file: header, JSON chunk, binary chunk.
fn glb(document: &Value, binary: &[u8]) -> Vec<u8> {
    let mut json = document.to_string().into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let mut binary = binary.to_vec();
    binary.resize(binary.len().next_multiple_of(4), 0);
    let mut bytes = b"glTF".to_vec();
    for word in [2, 12 + 8 + json.len() + 8 + binary.len(), json.len(), 0x4E4F_534A] {
        bytes.extend((word as u32).to_le_bytes());
    }
    bytes.extend(json);
    bytes.extend((binary.len() as u32).to_le_bytes());
    bytes.extend(0x004E_4942u32.to_le_bytes());
    bytes.extend(binary);
    bytes
}

fn written(name: &str, bytes: &[u8]) -> (TempDir, PathBuf) {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join(name);
    std::fs::write(&path, bytes).unwrap();
    (folder, path)
}

fn read(name: &str, bytes: &[u8]) -> Result<ShapeSet, ShapeError> {
    let (_folder, path) = written(name, bytes);
    ShapeSet::from_gltf(&[path])
}

fn read_document((document, binary): &(Value, Vec<u8>)) -> Result<ShapeSet, ShapeError> {
    read("shape.glb", &glb(document, binary))
}

/// Smallest distance between the surfaces for all half turns about x, y and z, which preserve the principal axes.
fn distance_up_to_half_turns(a: &Mesh, b: &Mesh) -> f64 {
    let signs = [[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]].map(DVec3::from_array);
    signs.iter().map(|signs| surface_distance(a, &moved(b, |p| p * *signs))).fold(f64::INFINITY, f64::min)
}

#[test]
fn a_shape_from_a_file_is_independent_of_rotation_translation_and_scale() {
    let shape = ShapeSet::procedural(1).shapes.swap_remove(3);
    let mesh = &shape.lods[0].mesh;
    let same = |set: &ShapeSet| distance_up_to_half_turns(mesh, &set.shapes[0].lods[0].mesh) < 1e-3;

    let mut file = document(&[("rock", mesh)], None);
    let set = read_document(&file).unwrap();
    let back = &set.shapes[0].lods[0].mesh;
    assert!(surface_distance(mesh, back) < 1e-4, "{}", surface_distance(mesh, back));
    assert_eq!(back.triangles.len(), mesh.triangles.len());
    assert!(back.albedos.iter().zip(&mesh.albedos).all(|(a, b)| (a - b).abs() < 1e-4));

    file.0["nodes"][0] =
        json!({"mesh": 0, "rotation": [0.5, -0.5, 0.1, 0.7], "translation": [300, -20, 5], "scale": [7, 7, 7]});
    assert!(same(&read_document(&file).unwrap()));
    // Below another node that also rotates.
    file.0["nodes"] = json!([{"children": [1], "rotation": [0, 0, 0.6, 0.8]}, file.0["nodes"][0]]);
    assert!(same(&read_document(&file).unwrap()));
    // The mirrored shape is a different one, and its triangles still face outwards.
    file.0["nodes"] = json!([{"mesh": 0, "scale": [-2, 2, 2]}]);
    let mirrored = read_document(&file).unwrap();
    assert!(!same(&mirrored));
    let mesh_volume = |mesh: &Mesh| {
        let place = |v: &u32| DVec3::from_array(mesh.positions[*v as usize].map(f64::from));
        mesh.triangles.iter().map(|[a, b, c]| place(a).dot(place(b).cross(place(c))) / 6.0).sum::<f64>()
    };
    assert!((mesh_volume(&mirrored.shapes[0].lods[0].mesh) / mesh_volume(mesh) - 1.0).abs() < 1e-3);
    // The stretched shape is a different one.
    file.0["nodes"] = json!([{"mesh": 0, "scale": [1, 1, 1.3]}]);
    assert!(!same(&read_document(&file).unwrap()));
}

#[test]
fn buffers_may_be_binary_external_or_embedded() {
    let mesh = sphere_solid(200).to_mesh();
    let (inside, binary) = document(&[("rock", &mesh)], None);
    let expected = read_document(&(inside, binary.clone())).unwrap();
    let uri = format!("data:application/octet-stream;base64,{}", STANDARD.encode(&binary));
    let (embedded, _) = document(&[("rock", &mesh)], Some(uri));
    assert_eq!(read("shape.gltf", embedded.to_string().as_bytes()).unwrap(), expected);

    let (external, _) = document(&[("rock", &mesh)], Some("the%20data.bin".to_owned()));
    let (folder, path) = written("shape.gltf", external.to_string().as_bytes());
    std::fs::write(folder.path().join("the data.bin"), &binary).unwrap();
    assert_eq!(ShapeSet::from_gltf(std::slice::from_ref(&path)).unwrap(), expected);
    std::fs::write(folder.path().join("the data.bin"), &binary[..100]).unwrap();
    let message = ShapeSet::from_gltf(&[path]).unwrap_err().to_string();
    assert!(message.contains("buffer 0: it has 100 bytes"), "{message}");
}

#[test]
fn levels_are_taken_from_names_or_generated() {
    let meshes = [300, 200, 100].map(|triangles| sphere_solid(triangles).to_mesh());
    let named = [("rock_LOD1", &meshes[1]), ("rock_LOD0", &meshes[0]), ("rock_LOD2", &meshes[2])];
    let counts = |set: &ShapeSet| set.shapes[0].lods.iter().map(|lod| lod.mesh.triangles.len()).collect::<Vec<_>>();
    assert_eq!(counts(&read_document(&document(&named, None)).unwrap()), [300, 200, 100]);

    for (triangles, expected) in [(300, [300, 232, 180, 138, 108]), (5600, [5600, 3062, 1674, 914, 500])] {
        let mesh = sphere_solid(triangles).to_mesh();
        let set = read_document(&document(&[("rock", &mesh)], None)).unwrap();
        assert_eq!(counts(&set), expected);
        assert!(set.shapes[0].lods[4].error < 0.08);
    }
    let cases = [
        (vec![("rock_LOD0", &meshes[0]), ("rock", &meshes[1])], "none, _LOD0"),
        (vec![("rock_LOD0", &meshes[0]), ("rock_LOD2", &meshes[1])], "_LOD0, _LOD2"),
        (vec![("rock_LOD1", &meshes[0])], "_LOD1"),
        (vec![("rock_LOD0", &meshes[1]), ("rock_LOD1", &meshes[0])], "level 1: it must have fewer"),
    ];
    for (meshes, expected) in cases {
        let message = read_document(&document(&meshes, None)).unwrap_err().to_string();
        assert!(message.contains(expected) && message.contains("shape.glb"), "{message}");
    }
}

#[test]
fn coincident_vertices_are_merged_and_inside_out_meshes_reversed() {
    let solid = box_solid(DVec3::new(3.0, 2.0, 1.0), DVec3::splat(10.0));
    let mut mesh = solid.to_mesh();
    // Every triangle has its own vertices, in reversed order.
    mesh.positions = mesh.triangles.iter().flatten().map(|v| mesh.positions[*v as usize]).collect();
    mesh.albedos = vec![0.25; mesh.positions.len()];
    mesh.triangles = (0..12).map(|k| [3 * k, 3 * k + 2, 3 * k + 1]).collect();
    let set = read_document(&document(&[("box", &mesh)], None)).unwrap();
    let read = &set.shapes[0].lods[0].mesh;
    assert_eq!((read.positions.len(), read.triangles.len()), (8, 12));
    let expected = finished(vec![solid]);
    assert!(surface_distance(read, &expected.lods[0].mesh) < 1e-5);
    assert!(read.albedos.iter().all(|albedo| (albedo - 1.0).abs() < 1e-6));
    // The longest side is along x, the shortest along z.
    let most = |axis: usize| read.positions.iter().map(|p| p[axis]).fold(0.0, f32::max);
    assert!(most(0) > most(1) && most(1) > most(2));
}

/// A file of a few kilobytes may refer to one mesh, or to one buffer, any number of times.
#[test]
fn meshes_and_buffers_count_once_per_reference() {
    let mesh = sphere_solid(20_000).to_mesh();
    let mut file = document(&[("rock", &mesh)], None);
    let node = file.0["nodes"][0].clone();
    file.0["nodes"] = json!(vec![node; 100]);
    file.0["scenes"][0]["nodes"] = json!((0..100).collect::<Vec<usize>>());
    let message = read_document(&file).unwrap_err().to_string();
    assert!(message.contains("vertices and corners, more than the maximum of 6000000"), "{message}");

    let (mut external, _) = document(&[("rock", &mesh)], Some("data.bin".to_owned()));
    external["buffers"] = json!(vec![external["buffers"][0].clone(); 3]);
    let (folder, path) = written("shape.gltf", external.to_string().as_bytes());
    let half = std::fs::File::create(folder.path().join("data.bin")).unwrap();
    half.set_len(MOST_BYTES / 2).unwrap();
    let message = ShapeSet::from_gltf(&[path]).unwrap_err().to_string();
    assert!(message.contains("buffer 2:") && message.contains("at most 0 bytes"), "{message}");
}

#[test]
fn broken_files_are_refused_with_the_problem() {
    let mesh = sphere_solid(100).to_mesh();
    let good = || document(&[("rock", &mesh)], None);
    let refusal = |file: (Value, Vec<u8>)| read_document(&file).unwrap_err().to_string();
    let changed = |path: &str, value: Value| {
        let mut file = good();
        *file.0.pointer_mut(path).unwrap() = value;
        refusal(file)
    };
    let with_mesh = |change: &dyn Fn(&mut Mesh)| {
        let mut mesh = mesh.clone();
        change(&mut mesh);
        refusal(document(&[("rock", &mesh)], None))
    };
    let mut strips = good();
    strips.0["meshes"][0]["primitives"][0]["mode"] = json!(5);
    let mut sparse = good();
    sparse.0["accessors"][0]["sparse"] = json!({"count": 1, "indices": {"bufferView": 2, "componentType": 5125},
        "values": {"bufferView": 0}});
    let mut short = good();
    short.1.truncate(64);
    let mut cycle = good();
    cycle.0["nodes"][0]["children"] = json!([0]);
    let mut compressed = good();
    compressed.0["extensionsRequired"] = json!(["KHR_draco_mesh_compression"]);
    compressed.0["extensionsUsed"] = json!(["KHR_draco_mesh_compression"]);
    let cases = [
        (refusal(strips), "only Triangles"),
        (refusal(sparse), "sparse"),
        (refusal(short), "buffer 0: it has 64 bytes"),
        (refusal(cycle), "reached twice"),
        (refusal(compressed), "not a valid glTF"),
        (changed("/accessors/0/type", json!("VEC2")), "accessor 0: it holds Vec2 of F32"),
        (changed("/accessors/2/componentType", json!(5126)), "accessor 2: it holds Scalar of F32"),
        (changed("/accessors/0/count", json!(100_000)), "accessor 0: it reaches beyond"),
        (changed("/accessors/1/count", json!(5)), "5 colours"),
        (
            changed("/meshes/0/primitives/0/attributes/POSITION", json!(u32::MAX)),
            "accessor 4294967295: a mesh refers to it",
        ),
        (changed("/accessors/2/count", json!(200)), "whole triangles"),
        (changed("/accessors/2/count", json!(6_000_000)), "at most 1500000"),
        (changed("/bufferViews/0/byteOffset", json!(u64::MAX / 2)), "accessor 0: it reaches beyond"),
        (changed("/nodes/0", json!({"mesh": 7})), "not a valid glTF"),
        (changed("/nodes/0", json!({})), "no meshes"),
        (with_mesh(&|mesh| mesh.triangles.clear()), "triangles"),
        (with_mesh(&|mesh| mesh.triangles[3][1] = 1000), "vertex 1000 of 52"),
        (with_mesh(&|mesh| mesh.positions[9][2] = f32::NAN), "vertex 9"),
        (with_mesh(&|mesh| mesh.albedos[9] = -1.0), "vertex 9"),
        (with_mesh(&|mesh| mesh.albedos.fill(0.0)), "all black"),
        (with_mesh(&|mesh| mesh.triangles.truncate(99)), "only closed surfaces"),
        (with_mesh(&|mesh| mesh.triangles[0].swap(0, 1)), "only closed surfaces"),
        (with_mesh(&|mesh| mesh.positions.iter_mut().for_each(|p| p[2] = 0.0)), "volume"),
    ];
    for (message, expected) in cases {
        assert!(message.contains(expected) && message.contains("shape.glb"), "{expected}: {message}");
    }
    for bytes in [&b""[..], b"glTF", b"{}", b"no glTF at all"] {
        assert!(matches!(read("shape.gltf", bytes), Err(ShapeError::File { .. })));
    }
    assert!(matches!(ShapeSet::from_gltf(&[]), Err(ShapeError::Files { count: 0 })));
    let missing = ShapeSet::from_gltf(&[PathBuf::from("missing.glb")]).unwrap_err().to_string();
    assert!(missing.contains("missing.glb") && missing.contains("cannot be read"), "{missing}");
}
