//! Meshes as text: those with their own frustum, which are OPENMESH (`.ol`) of Scalable and EasyBlend and Sky-Skan's
//! meshes, and the shifts of SimCAD, which have no frustum.
//!
//! | format | positions on the raster | content |
//! |---|---|---|
//! | OPENMESH | pixels of the native resolution, y upwards | 1 - t to the right, 1 - s upwards |
//! | Sky-Skan | 0 to 1, y downwards; -1: not drawn | u, v downwards |
//! | SimCAD | a lattice and shifts of it, y downwards | the lattice |
//!
//! Sources: the readers of SGCT (the correction module "scalable", `skyskan.cpp`, `simcad.cpp`), which draw these files.

use std::collections::HashMap;

use glam::{DMat3, DVec2, DVec3};

use super::{
    content::{Content, yaw_pitch_roll},
    fault::Fault,
    mesh::{MOST_NODES, MOST_TRIANGLES, Mesh, Node},
    mesh_files::{Loaded, numbers},
    xml::{self, Element},
};

/// Distance of a frustum's plane from the room's origin, m. Offsets apply at this distance.
const PLANE_M: f64 = 10.0;
/// Height of Sky-Skan's pictures relative to their width, if the file has no vertical field of view.
const SKY_SKAN_HEIGHT: f64 = 1200.0 / 2048.0;

/// Keys of an OPENMESH whose effect on the geometry is not documented.
const UNKNOWN_GEOMETRY: [&str; 2] = ["USE_SPHERE_SAMPLE_COORDINATE_SYSTEM", "FRUSTUM_EULER_ANGLES"];

/// Other keys of an OPENMESH: keys that are read, and keys that only describe the file.
const OPEN_KEYS: [&str; 27] = [
    "OPENMESH",
    "SUBVERSION",
    "VERTICES",
    "FACES",
    "MAPPING",
    "SAMPLING",
    "PROJECTION",
    "ORTHO_TOP",
    "ORTHO_BOTTOM",
    "ORTHO_LEFT",
    "ORTHO_RIGHT",
    "PERSPECTIVE_XOFFSET",
    "PERSPECTIVE_YOFFSET",
    "PERSPECTIVE_ZOFFSET",
    "PERSPECTIVE_ROLL",
    "PERSPECTIVE_PITCH",
    "PERSPECTIVE_YAW",
    "PERSPECTIVE_LEFT",
    "PERSPECTIVE_RIGHT",
    "PERSPECTIVE_TOP",
    "PERSPECTIVE_BOTTOM",
    "NATIVEXRES",
    "NATIVEYRES",
    "GAMMA",
    "APPLY_MASK",
    "APPLY_BLACK_LEVEL",
    "APPLY_COLOR",
];
/// Maximum number of notes on unknown keys.
const MOST_NOTES: usize = 20;

pub(super) fn open_mesh(text: &str) -> Result<Loaded, Fault> {
    let mut mesh = Mesh::default();
    let mut keys: HashMap<&str, (usize, &str)> = HashMap::new();
    for (index, line) in text.lines().enumerate() {
        let place = || format!("line {}", index + 1);
        let line = line.trim();
        let (first, rest) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
        if line.is_empty() {
            continue;
        }
        if line.starts_with('[') {
            let corners: Option<Vec<u32>> =
                line.trim_matches(['[', ']']).split_whitespace().map(|word| word.parse().ok()).collect();
            let Some(&[a, b, c]) = corners.as_deref() else {
                return Err(Fault::new(place(), "not a face", "must be [ i j k ], the numbers of three nodes from 0"));
            };
            mesh.triangles.push([a, b, c]);
        } else if first.parse::<f64>().is_ok() {
            let Some(values) = numbers::<5>(line.split_whitespace()) else {
                return Err(Fault::new(place(), "not a node", "must be five finite numbers: x, y, intensity, s, t"));
            };
            let [x, y, intensity, s, t] = values;
            let node =
                Node { place: DVec2::new(x, y), content: DVec2::new(1.0 - t, 1.0 - s), intensity: intensity / 255.0 };
            mesh.nodes.push(node);
        } else if keys.insert(first, (index + 1, rest.trim())).is_some() {
            return Err(Fault::new(place(), format!("`{}` occurs twice", first.escape_debug()), "must occur once"));
        }
        if mesh.nodes.len() > MOST_NODES || mesh.triangles.len() > MOST_TRIANGLES {
            let allowed = format!("must have at most {MOST_NODES} nodes and {MOST_TRIANGLES} faces");
            return Err(Fault::new(place(), "too much", allowed));
        }
    }
    let number = |key: &str| -> Result<Option<f64>, Fault> {
        let Some((line, value)) = keys.get(key) else { return Ok(None) };
        let number = value.parse::<f64>().ok().filter(|value| value.is_finite());
        let problem =
            || Fault::new(format!("line {line}"), format!("{key} is not a number"), "must be a finite number");
        number.map(Some).ok_or_else(problem)
    };
    let needed = |key: &str| number(key)?.ok_or_else(|| Fault::new("OPENMESH", format!("no {key}"), "it is required"));
    for (key, count) in [("VERTICES", mesh.nodes.len()), ("FACES", mesh.triangles.len())] {
        let declared = needed(key)?;
        if declared != count as f64 {
            return Err(Fault::new(key, format!("{declared}, but there are {count}"), "both must agree"));
        }
    }
    for (key, wanted) in [("MAPPING", "NORMALIZED"), ("PROJECTION", "PERSPECTIVE")] {
        if let Some((line, value)) = keys.get(key)
            && *value != wanted
        {
            let problem = format!("{key} {}", value.escape_debug());
            return Err(Fault::new(format!("line {line}"), problem, format!("only {wanted} is supported")));
        }
    }
    for key in UNKNOWN_GEOMETRY {
        if number(key)?.unwrap_or(0.0) != 0.0 {
            return Err(Fault::refused(key, "its effect on the geometry is not documented"));
        }
    }
    let native = DVec2::new(needed("NATIVEXRES")?, needed("NATIVEYRES")?);
    let ortho = |key: &str, default: f64| Ok::<f64, Fault>(number(key)?.unwrap_or(default));
    let low = DVec2::new(ortho("ORTHO_LEFT", 0.0)?, ortho("ORTHO_BOTTOM", 0.0)?);
    let high = DVec2::new(ortho("ORTHO_RIGHT", 1.0)?, ortho("ORTHO_TOP", 1.0)?);
    if native.min_element() < 1.0 || (high - low).abs().min_element() < 1e-9 {
        let problem = format!("NATIVEXRES and NATIVEYRES {native}, ORTHO from {low} to {high}");
        return Err(Fault::new("OPENMESH", problem, "must be a number of pixels, and a part of the raster"));
    }
    for node in &mut mesh.nodes {
        node.place = (node.place / native - low) / (high - low);
    }
    let degrees = |key: &str| Ok::<f64, Fault>(number(key)?.unwrap_or(0.0).to_radians());
    let edge = |key: &str| Ok::<f64, Fault>(needed(key)?.to_radians());
    // Yaw is positive to the left; roll is about the axis of the room.
    let rotation = DMat3::from_rotation_z(degrees("PERSPECTIVE_ROLL")?)
        * DMat3::from_rotation_y(degrees("PERSPECTIVE_YAW")?)
        * DMat3::from_rotation_x(degrees("PERSPECTIVE_PITCH")?);
    let [left, right] = [edge("PERSPECTIVE_LEFT")?, edge("PERSPECTIVE_RIGHT")?];
    let [down, up] = [edge("PERSPECTIVE_BOTTOM")?, edge("PERSPECTIVE_TOP")?];
    let mut offset = DVec3::ZERO;
    for (part, key) in ["PERSPECTIVE_XOFFSET", "PERSPECTIVE_YOFFSET", "PERSPECTIVE_ZOFFSET"].into_iter().enumerate() {
        offset[part] = number(key)?.unwrap_or(0.0);
    }
    let mut content = Content::frustum(left, right, down, up, rotation)?;
    if let Content::Plane { lower_left, .. } = &mut content {
        *lower_left += offset / PLANE_M;
    }
    let mut notes = Vec::new();
    if offset != DVec3::ZERO {
        notes.push(format!("OPENMESH: the plane of its picture is {PLANE_M} m away and shifted by {offset} m"));
    }
    for key in ["APPLY_MASK", "APPLY_BLACK_LEVEL", "APPLY_COLOR"] {
        if number(key)?.unwrap_or(0.0) != 0.0 {
            notes.push(format!("OPENMESH: {key} names pictures that are not in the file: they are not applied"));
        }
    }
    if let Some((_, gamma)) = keys.get("GAMMA") {
        let gamma = gamma.escape_debug();
        notes
            .push(format!("OPENMESH: GAMMA {gamma} is not applied; `gamma` of the view sets the projector's response"));
    }
    notes.extend(unknown_keys(&keys));
    let is_whole = native.fract() == DVec2::ZERO && native.max_element() <= 65536.0;
    let size_px = is_whole.then(|| native.to_array().map(|side| side as u32));
    Ok(Loaded { mesh, mapping: None, content: Some(content), size_px, notes })
}

/// Adds notes on keys of an OPENMESH that are not read.
fn unknown_keys(keys: &HashMap<&str, (usize, &str)>) -> Vec<String> {
    let is_known = |key: &str| OPEN_KEYS.contains(&key) || UNKNOWN_GEOMETRY.contains(&key);
    let mut unknown: Vec<(usize, &str)> =
        keys.iter().filter(|(key, _)| !is_known(key)).map(|(key, (line, _))| (*line, *key)).collect();
    unknown.sort_unstable();
    let note = |(line, key): &(usize, &str)| {
        format!("OPENMESH: line {line}: the key {} is not known; it has no effect", key.escape_debug())
    };
    unknown.iter().take(MOST_NOTES).map(note).collect()
}

pub(super) fn sky_skan(text: &str) -> Result<Loaded, Fault> {
    const KEYS: [&str; 8] = [
        "Dome Azimuth",
        "Dome Elevation",
        "Horizontal FOV",
        "Vertical FOV",
        "Horizontal Tweak",
        "Vertical Tweak",
        "U Tweak",
        "V Tweak",
    ];
    let mut values: [Option<f64>; 8] = [None; 8];
    let mut size: Option<[usize; 2]> = None;
    let mut mesh = Mesh::default();
    for (index, line) in text.lines().enumerate() {
        let place = || format!("line {}", index + 1);
        let line = line.trim();
        if line.is_empty() {
            continue;
        }
        if let Some((key, value)) = line.split_once('=') {
            let known = KEYS.iter().position(|known| *known == key.trim());
            let value = value.trim().parse::<f64>().ok().filter(|value| value.is_finite());
            let (Some(known), Some(value)) = (known, value) else {
                let allowed = format!("must be one of {} = a finite number", KEYS.join(", "));
                return Err(Fault::new(place(), "not a key with a number", allowed));
            };
            values[known] = Some(value);
        } else if size.is_none() {
            let sides = numbers::<2>(line.split_whitespace())
                .map(|sides| sides.map(|side| side as usize))
                .filter(|[columns, rows]| *columns >= 2 && *rows >= 2 && columns.saturating_mul(*rows) <= MOST_NODES);
            let allowed = format!("must be columns and rows, at least 2 each, with at most {MOST_NODES} nodes");
            size = Some(sides.ok_or_else(|| Fault::new(place(), "not a mesh size", allowed))?);
        } else {
            let Some([x, y, u, v]) = numbers(line.split_whitespace()) else {
                return Err(Fault::new(place(), "not a node", "must be four finite numbers: x, y, u, v"));
            };
            let drawn = x != -1.0 && y != -1.0;
            let intensity = if drawn { 1.0 } else { -1.0 };
            mesh.nodes.push(Node { place: DVec2::new(x, 1.0 - y), content: DVec2::new(u, v), intensity });
        }
    }
    let [azimuth, elevation, wide, high, wide_tweak, high_tweak, u_tweak, v_tweak] = values;
    let [columns, rows] = size.unwrap_or_default();
    if mesh.nodes.len() != columns * rows || mesh.nodes.is_empty() {
        let problem = format!("{} nodes, {columns} x {rows} expected", mesh.nodes.len());
        return Err(Fault::new("Sky-Skan mesh", problem, "must have a line with its columns and rows, then all nodes"));
    }
    let needed = |value: Option<f64>, key: &str| {
        value.ok_or_else(|| Fault::new("Sky-Skan mesh", format!("no `{key}`"), "it is required"))
    };
    let (azimuth, elevation) = (needed(azimuth, KEYS[0])?, needed(elevation, KEYS[1])?);
    let wide = needed(wide, KEYS[2])?.to_radians();
    let high = high
        .filter(|high| *high > 0.0)
        .map_or_else(|| 2.0 * (SKY_SKAN_HEIGHT * (wide / 2.0).tan()).atan(), f64::to_radians);
    let tweaked = |value: f64, tweak: Option<f64>| value * tweak.filter(|tweak| *tweak > 0.0).unwrap_or(1.0);
    let (wide, high) = (tweaked(wide, wide_tweak) / 2.0, tweaked(high, high_tweak) / 2.0);
    let scale = [u_tweak, v_tweak].map(|tweak| tweak.filter(|tweak| *tweak > -1.0).unwrap_or(1.0));
    for node in &mut mesh.nodes {
        node.content = DVec2::new(node.content.x * scale[0], 1.0 - node.content.y * scale[1]);
    }
    let rotation = yaw_pitch_roll(azimuth.to_radians(), elevation.to_radians(), 0.0);
    let content = Content::frustum(-wide, wide, -high, high, rotation)?;
    mesh.join_lattice(columns, rows);
    Ok(Loaded { mesh, mapping: None, content: Some(content), size_px: None, notes: Vec::new() })
}

pub(super) fn sim_cad(bytes: &[u8]) -> Result<Loaded, Fault> {
    let document = xml::parse(bytes)?;
    let definition = Element::root(&document).needed("GeometryDefinition")?;
    let shifts = |name: &str| -> Result<Vec<f64>, Fault> {
        let element = definition.needed(name)?;
        let range = element.attribute_number("range")?.unwrap_or(1.0);
        let values: Option<Vec<f64>> = element
            .text()
            .split_whitespace()
            .map(|word| word.parse::<f64>().ok().map(|value| value / range).filter(|value| value.is_finite()))
            .collect();
        values.ok_or_else(|| {
            Fault::new(&element.place, "not a list of numbers", "must be finite numbers, and the range must not be 0")
        })
    };
    let (across, down) = (shifts("X-FlatParameters")?, shifts("Y-FlatParameters")?);
    let side = across.len().isqrt();
    if across.len() != down.len() || side * side != across.len() || side < 2 || across.len() > MOST_NODES {
        let problem = format!("{} shifts across and {} down", across.len(), down.len());
        return Err(Fault::new(&definition.place, problem, "must be the numbers of a square lattice, such as 33 x 33"));
    }
    let mut mesh = Mesh::default();
    for (index, (x, y)) in across.iter().zip(&down).enumerate() {
        let share = |at: usize| at as f64 / (side - 1) as f64;
        let content = DVec2::new(share(index % side), 1.0 - share(index / side));
        mesh.nodes.push(Node { place: content + DVec2::new(*x, -*y), content, intensity: 1.0 });
    }
    mesh.join_lattice(side, side);
    Ok(Loaded { mesh, mapping: None, content: None, size_px: None, notes: Vec::new() })
}
