//! Mesh files; the first bytes determine the format.
//!
//! | format | positions on the raster | content |
//! |---|---|---|
//! | Paul Bourke's `.data` | x from -aspect to aspect, y from -1 to 1 upwards | u, v upwards; the number of the mapping gives the kind |
//! | `.sgc` | 0 to 1, y downwards | 0 to 1, v upwards, in the frustum of the file's header |
//! | OBJ | -1 to 1, y upwards | 0 to 1, v upwards |
//! | CSV | 0 to 1, y downwards | 0 to 1, v downwards |

use std::collections::HashMap;

use glam::{DMat3, DQuat, DVec2};

use super::{
    MOST_SIDE, Reader, Region,
    content::Content,
    fault::Fault,
    mesh::{MOST_NODES, MOST_TRIANGLES, Mesh, Node, Warped},
    mesh_text::{open_mesh, sim_cad, sky_skan},
    unlit,
};

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Bourke,
    Sciss,
    Obj,
    Csv,
    Open,
    SkySkan,
    SimCad,
}

impl Kind {
    pub fn name(self) -> &'static str {
        match self {
            Kind::Bourke => "Paul Bourke's mesh",
            Kind::Sciss => "SGC mesh",
            Kind::Obj => "OBJ mesh",
            Kind::Csv => "CSV mesh",
            Kind::Open => "OPENMESH",
            Kind::SkySkan => "Sky-Skan mesh",
            Kind::SimCad => "SimCAD mesh",
        }
    }
}

/// A mesh, and the description of the content in its file.
pub(super) struct Loaded {
    pub mesh: Mesh,
    /// Number of the mapping of a `.data` file.
    pub mapping: Option<u32>,
    /// The frustum of a file that has one (`.sgc`, OPENMESH, Sky-Skan).
    pub content: Option<Content>,
    /// Width and height of the raster, pixels, if the file has them (OPENMESH).
    pub size_px: Option<[u32; 2]>,
    /// What was assumed.
    pub notes: Vec<String>,
}

/// Returns the format of a file that begins with these bytes.
pub(super) fn kind(bytes: &[u8]) -> Option<Kind> {
    if bytes.starts_with(b"SGC") {
        return Some(Kind::Sciss);
    }
    let head = std::str::from_utf8(&bytes[..bytes.len().min(1 << 16)]);
    // The last character of the examined bytes may be incomplete.
    let text = match head {
        Ok(text) => text,
        Err(error) => std::str::from_utf8(&bytes[..error.valid_up_to()]).ok()?,
    };
    let mut lines = text.trim_start_matches('\u{feff}').lines().map(str::trim).filter(|line| !line.is_empty());
    let mut first = lines.next()?;
    if first.starts_with('#') {
        first = lines.find(|line| !line.starts_with('#'))?;
    }
    const OBJ: [&str; 9] = ["v", "vt", "vn", "o", "g", "f", "s", "mtllib", "usemtl"];
    let sky_skan = ["Dome Azimuth=", "Dome Elevation=", "Horizontal FOV=", "Vertical FOV="];
    if first.starts_with("OPENMESH") {
        Some(Kind::Open)
    } else if sky_skan.iter().any(|key| first.starts_with(key)) {
        Some(Kind::SkySkan)
    } else if first.starts_with('<') && text.contains("<GeometryFile") {
        Some(Kind::SimCad)
    } else if first.split_whitespace().next().is_some_and(|word| OBJ.contains(&word)) {
        Some(Kind::Obj)
    } else if first.split(';').count() == 6 {
        Some(Kind::Csv)
    } else if first.parse::<u32>().is_ok() {
        Some(Kind::Bourke)
    } else {
        None
    }
}

/// Reads a mesh. `aspect` is the ratio of width to height of its raster.
pub(super) fn load(kind: Kind, bytes: &[u8], aspect: f64) -> Result<Loaded, Fault> {
    if kind == Kind::Sciss {
        return sciss(bytes);
    }
    if kind == Kind::SimCad {
        return sim_cad(bytes);
    }
    let text = std::str::from_utf8(bytes).map_err(|_| Fault::new(kind.name(), "not text in UTF-8", "must be text"))?;
    let text = text.trim_start_matches('\u{feff}');
    match kind {
        Kind::Bourke => bourke(text, aspect),
        Kind::Obj => obj(text),
        Kind::Open => open_mesh(text),
        Kind::SkySkan => sky_skan(text),
        Kind::Csv | Kind::Sciss | Kind::SimCad => csv(text),
    }
}

/// Parses exactly N finite numbers.
pub(super) fn numbers<'a, const N: usize>(words: impl Iterator<Item = &'a str>) -> Option<[f64; N]> {
    let mut values = [0.0; N];
    let mut words = words;
    for value in &mut values {
        *value = words.next()?.trim().parse::<f64>().ok().filter(|number| number.is_finite())?;
    }
    words.next().is_none().then_some(values)
}

fn bourke(text: &str, aspect: f64) -> Result<Loaded, Fault> {
    let mut lines = text.lines().enumerate().map(|(i, line)| (i + 1, line.trim())).filter(|(_, line)| !line.is_empty());
    let mut line = || lines.next().unwrap_or((0, ""));
    let (_, mapping) = line();
    let bad = |number: usize, problem: &str, allowed: &str| Err(Fault::new(format!("line {number}"), problem, allowed));
    let Ok(mapping @ 1..=5) = mapping.parse::<u32>() else {
        return bad(1, "not a mapping", "must be a number from 1 to 5: 2 is a fisheye, 4 an equirectangular map");
    };
    let (number, size) = line();
    let sides: Option<Vec<usize>> = size.split_whitespace().take(3).map(|side| side.parse().ok()).collect();
    let allowed = |sides: &[usize]| {
        sides.iter().all(|side| (2..=MOST_SIDE).contains(side)) && sides.iter().product::<usize>() <= MOST_NODES
    };
    let Some(&[columns, rows]) = sides.as_deref().filter(|sides| sides.len() == 2 && allowed(sides)) else {
        let allowed = format!("must be columns and rows from 2 to {MOST_SIDE}, and at most {MOST_NODES} nodes");
        return bad(number, "not a mesh size", &allowed);
    };
    let mut mesh = Mesh::default();
    for (number, line) in lines {
        let Some([x, y, u, v, intensity]) = numbers(line.split_whitespace()) else {
            return bad(number, "not a node", "must be five finite numbers: x, y, u, v, intensity");
        };
        if mesh.nodes.len() == columns * rows {
            return bad(number, "more nodes than the size specifies", &format!("must be {columns} x {rows}"));
        }
        let place = DVec2::new(x / aspect + 1.0, y + 1.0) / 2.0;
        mesh.nodes.push(Node { place, content: DVec2::new(u, v), intensity });
    }
    if mesh.nodes.len() != columns * rows {
        let problem = format!("{} nodes", mesh.nodes.len());
        return Err(Fault::new("mesh", problem, format!("must be {columns} x {rows} according to its second line")));
    }
    if mesh.nodes.iter().all(|node| node.intensity <= 0.0) {
        let allowed = "nodes that get light must have an intensity above 0; 1 means full light";
        return Err(Fault::new("mesh", "no node has an intensity above 0: nothing would be drawn", allowed));
    }
    let unknown = unlit::settle(&mut mesh, columns, rows);
    let notes = if unknown > 0 {
        vec![format!(
            "{unknown} of {} nodes have the intensity 0 and coordinates that do not continue those of their neighbours: they are treated as unknown",
            mesh.nodes.len()
        )]
    } else {
        Vec::new()
    };
    mesh.join_lattice(columns, rows);
    Ok(Loaded { mesh, mapping: Some(mapping), content: None, size_px: None, notes })
}

fn csv(text: &str) -> Result<Loaded, Fault> {
    let mut nodes = HashMap::new();
    let (mut columns, mut rows) = (0, 0);
    for (index, line) in text.lines().enumerate() {
        let line = line.trim();
        if line.is_empty() {
            continue;
        }
        let numbers = numbers::<6>(line.split(';'));
        let heading = index == 0 && line.chars().any(|c| c.is_alphabetic());
        if numbers.is_none() && heading {
            continue;
        }
        let whole = |value: f64| value.fract() == 0.0 && (0.0..MOST_SIDE as f64).contains(&value);
        let Some([x, y, u, v, column, row]) = numbers.filter(|numbers| whole(numbers[4]) && whole(numbers[5])) else {
            let allowed = format!(
                "must be six finite numbers x;y;u;v;column;row, the last two integers from 0 to {}",
                MOST_SIDE - 1
            );
            return Err(Fault::new(format!("line {}", index + 1), "not a node", allowed));
        };
        let (column, row) = (column as usize, row as usize);
        (columns, rows) = (columns.max(column + 1), rows.max(row + 1));
        let node = Node { place: DVec2::new(x, 1.0 - y), content: DVec2::new(u, 1.0 - v), intensity: 1.0 };
        if nodes.insert((row, column), node).is_some() {
            let problem = format!("column {column} of row {row} occurs twice");
            return Err(Fault::new(format!("line {}", index + 1), problem, "every node must occur once"));
        }
    }
    if nodes.len() != columns * rows || columns < 2 || rows < 2 || nodes.len() > MOST_NODES {
        let problem = format!("{} nodes in {columns} columns and {rows} rows", nodes.len());
        return Err(Fault::new(
            "mesh",
            problem,
            format!("must have every position of a lattice of 2 x 2 to {MOST_NODES} nodes"),
        ));
    }
    let mut mesh = Mesh::default();
    let order = (0..rows).flat_map(|row| (0..columns).map(move |column| (row, column)));
    mesh.nodes.extend(order.filter_map(|place| nodes.get(&place).copied()));
    mesh.join_lattice(columns, rows);
    Ok(Loaded { mesh, mapping: None, content: None, size_px: None, notes: Vec::new() })
}

fn obj(text: &str) -> Result<Loaded, Fault> {
    let mut places: Vec<DVec2> = Vec::new();
    let mut contents: Vec<DVec2> = Vec::new();
    let mut mesh = Mesh::default();
    let mut known: HashMap<(usize, usize), u32> = HashMap::new();
    for (index, line) in text.lines().enumerate() {
        let bad = |problem: &str, allowed: &str| Err(Fault::new(format!("line {}", index + 1), problem, allowed));
        let mut words = line.split_whitespace();
        let keyword = words.next().unwrap_or_default();
        // Returns all numbers of a line if their count is valid.
        let coordinates = |words: std::str::SplitWhitespace, counts: std::ops::RangeInclusive<usize>| {
            let values: Option<Vec<f64>> =
                words.take(5).map(|word| word.parse::<f64>().ok().filter(|value| value.is_finite())).collect();
            values.filter(|values| counts.contains(&values.len()))
        };
        match keyword {
            "v" => {
                let Some(values) = coordinates(words, 2..=4) else { return bad("not a vertex", "must be x y z") };
                if values.get(2).is_some_and(|z| *z != 0.0) {
                    return bad("a vertex outside the raster's plane", "z must be 0");
                }
                places.push((DVec2::new(values[0], values[1]) + 1.0) / 2.0);
            }
            "vt" => {
                let Some(values) = coordinates(words, 2..=3) else {
                    return bad("not texture coordinates", "must be u v");
                };
                contents.push(DVec2::new(values[0], values[1]));
            }
            "f" => {
                let mut corners = Vec::new();
                for word in words.take(65) {
                    let mut parts = word.split('/');
                    // Indices start at 1; negative indices count back from the last element.
                    let one = |part: Option<&str>, count: usize| match part?.parse::<i64>().ok()? {
                        0 => None,
                        back @ ..0 => count.checked_sub(usize::try_from(back.unsigned_abs()).ok()?),
                        ahead => usize::try_from(ahead - 1).ok().filter(|i| *i < count),
                    };
                    let place = one(parts.next(), places.len());
                    let content = match parts.next() {
                        None | Some("") => place.filter(|i| *i < contents.len()),
                        part => one(part, contents.len()),
                    };
                    let (Some(place), Some(content)) = (place, content) else {
                        return bad(
                            "a corner of a face refers to a missing vertex or to missing texture coordinates",
                            "both must precede the face",
                        );
                    };
                    // A node for each combination of vertex and texture coordinates.
                    let next = mesh.nodes.len() as u32;
                    let node = *known.entry((place, content)).or_insert(next);
                    if node == next {
                        mesh.nodes.push(Node { place: places[place], content: contents[content], intensity: 1.0 });
                    }
                    corners.push(node);
                }
                if !(3..=64).contains(&corners.len()) {
                    return bad("not a face", "must have 3 to 64 corners");
                }
                // Split the polygon into a fan of triangles.
                mesh.triangles.extend((2..corners.len()).map(|i| [corners[0], corners[i - 1], corners[i]]));
            }
            "" | "vn" | "vp" | "o" | "g" | "s" | "l" | "mtllib" | "usemtl" => {}
            comment if comment.starts_with('#') => {}
            _ => {
                return bad(
                    "an unknown keyword",
                    "must be v, vt or f, or one of vn, vp, o, g, s, l, mtllib and usemtl, which are ignored",
                );
            }
        }
        if places.len().max(contents.len()) > MOST_NODES || mesh.triangles.len() > MOST_TRIANGLES {
            return bad("too much", &format!("must have at most {MOST_NODES} vertices and {MOST_TRIANGLES} triangles"));
        }
    }
    Ok(Loaded { mesh, mapping: None, content: None, size_px: None, notes: Vec::new() })
}

/// Little-endian words of a binary file.
struct Words<'a>(&'a [u8]);

impl Words<'_> {
    fn u32(&mut self) -> Option<u32> {
        let (four, rest) = self.0.split_first_chunk()?;
        self.0 = rest;
        Some(u32::from_le_bytes(*four))
    }

    fn f64(&mut self) -> Option<f64> {
        self.u32().map(|bits| f64::from(f32::from_bits(bits)))
    }

    fn floats<const N: usize>(&mut self) -> Option<[f64; N]> {
        let mut values = [0.0; N];
        for value in &mut values {
            *value = self.f64()?;
        }
        Some(values)
    }
}

fn sciss(bytes: &[u8]) -> Result<Loaded, Fault> {
    let bad = |field: &str, problem: String, allowed: &str| Fault::new(field, problem, allowed);
    let short = || bad("SGC mesh", "it ends too early".to_owned(), "must have a header, nodes and indices");
    let version = *bytes.get(3).ok_or_else(short)?;
    if ![1, 2, b'1', b'2'].contains(&version) {
        let shown = if version.is_ascii_digit() { char::from(version).to_string() } else { version.to_string() };
        return Err(bad("version", shown, "must be 1 or 2"));
    }
    let mut words = Words(&bytes[4..]);
    match words.u32().ok_or_else(short)? {
        0 => {}
        1 => {
            return Err(Fault::refused(
                "a mesh for a cube map",
                "its nodes do not specify which face of the cube they show; only planar coordinates (0) are supported",
            ));
        }
        other => return Err(bad("mapping", other.to_string(), "must be 0 (planar)")),
    }
    // Orientation, position (ignored) and edges of the frustum.
    let [x, y, z, w] = words.floats().ok_or_else(short)?;
    let [_, _, _, up, down, left, right] = words.floats::<7>().ok_or_else(short)?;
    let rotation = DQuat::from_xyzw(x, y, z, w);
    let length = rotation.length();
    if length.is_nan() || (length - 1.0).abs() >= 1e-3 {
        let problem = format!("[{x}, {y}, {z}, {w}] has the length {length}");
        return Err(bad("orientation", problem, "must be a unit quaternion"));
    }
    let rotation = DMat3::from_quat(rotation.normalize());
    let [left, right, down, up] = [left, right, down, up].map(f64::to_radians);
    let content = Content::frustum(left, right, down, up, rotation)?;
    // Version 1 has the numbers of columns and rows here. Version 2 has the kind of the triangles (4 for separate ones,
    // 5 for a strip) and the number of nodes, but some files of version 2 have columns and rows. The length of the file
    // distinguishes them.
    let [first, second] = [words.u32().ok_or_else(short)?, words.u32().ok_or_else(short)?].map(|n| n as usize);
    let is_second = version == 2 || version == b'2';
    let fits = |count: usize| {
        let after = words.0.get(count.checked_mul(24)?..)?;
        let indices = u32::from_le_bytes(*after.first_chunk()?) as usize;
        (after.len() == indices.checked_mul(4)?.checked_add(4)?).then_some(count)
    };
    let lattice = first.checked_mul(second);
    let count = if is_second { fits(second).or(lattice.and_then(fits)).or(Some(second)) } else { lattice }
        .filter(|count| (3..=MOST_NODES).contains(count))
        .ok_or_else(|| bad("size", format!("{first}, {second}"), &format!("must have 3 to {MOST_NODES} nodes")))?;
    let mut mesh = Mesh::default();
    for _ in 0..count {
        let [x, y, _, u, v, _] = words.floats().ok_or_else(short)?;
        mesh.nodes.push(Node { place: DVec2::new(x, 1.0 - y), content: DVec2::new(u, v), intensity: 1.0 });
    }
    // Indices: separate triangles or one strip.
    let indices = words.u32().ok_or_else(short)? as usize;
    if words.0.len() != indices.saturating_mul(4) || !(3..=3 * MOST_TRIANGLES).contains(&indices) {
        let problem = format!("{indices} indices in {} bytes", words.0.len());
        return Err(bad("indices", problem, "must be 3 or more of four bytes each, up to the end of the file"));
    }
    let list: Vec<u32> = std::iter::from_fn(|| words.u32()).collect();
    mesh.triangles = if is_second && first == 4 && indices.is_multiple_of(3) {
        list.chunks_exact(3).map(|three| [three[0], three[1], three[2]]).collect()
    } else {
        // A triangle strip. Where the strip turns back, a triangle contains a node twice and is degenerate.
        list.windows(3).map(|three| [three[0], three[1], three[2]]).collect()
    };
    Ok(Loaded { mesh, mapping: None, content: Some(content), size_px: None, notes: Vec::new() })
}

impl Reader<'_> {
    /// Returns the content of a `.data` file, given the number of its mapping.
    fn mapped(&mut self, mapping: u32) -> Result<Content, Fault> {
        let refused = |reason: &str| Err(Fault::refused(format!("mapping {mapping} of Paul Bourke's meshes"), reason));
        match mapping {
            1 => {
                refused("the directions of a flat picture depend on its field of view, which the file does not contain")
            }
            2 => self.fisheye(),
            3 => {
                refused("the directions of a cylindrical picture depend on its height, which the file does not contain")
            }
            4 => {
                self.note(
                    "content: equirectangular map of the whole sphere, longitude to the right, latitude upwards, front in the centre",
                );
                Ok(Content::Equirectangular)
            }
            _ => refused("the file does not specify the order of a cube map's faces in the picture"),
        }
    }

    /// Reads a mesh file that is not part of a configuration.
    pub(super) fn plain_mesh(&mut self, kind: Kind, bytes: &[u8]) -> Result<Region, Fault> {
        // Only Paul Bourke's meshes depend on the aspect ratio of the raster, and their files do not contain its size.
        let of_file = if kind == Kind::Bourke { None } else { Some(load(kind, bytes, 1.0)?) };
        let own_size = of_file.as_ref().and_then(|loaded| loaded.size_px);
        let size_px = self.size_px(self.options.size_px.or(own_size), kind.name())?;
        if let Some([width, height]) = own_size {
            let source = if size_px == [width, height] { "is" } else { "is from the options and not" };
            self.note(format!("{}: the raster {source} that of the file, {width} x {height} pixels", kind.name()));
        }
        let loaded = match of_file {
            Some(loaded) => loaded,
            None => load(kind, bytes, f64::from(size_px[0]) / f64::from(size_px[1]))?,
        };
        for note in &loaded.notes {
            self.note(note);
        }
        let content = match (&loaded.content, loaded.mapping) {
            (Some(content), _) if kind != Kind::Sciss => {
                self.note("content: the frustum of the file's header, seen from the origin of its room");
                content.clone()
            }
            (Some(content), _) => {
                self.note("content: the frustum of the file's header; its eye position is ignored, directions are relative to it");
                content.clone()
            }
            (None, Some(mapping)) => self.mapped(mapping)?,
            (None, None) => self.fisheye()?,
        };
        self.note_reach(&loaded.mesh);
        let Warped { grid, border, intensities } = self.warped(&loaded.mesh, &content, size_px, kind.name())?;
        let region = Region::of_grid(self.stem(), size_px, grid);
        Ok(Region { border, alpha: intensities, multiplies_codes: true, ..region })
    }

    /// Adds a note if a mesh does not fill the raster: it is then often made for a different raster.
    pub(super) fn note_reach(&mut self, mesh: &Mesh) {
        let Some(first) = mesh.nodes.first() else { return };
        let (low, high) = mesh
            .nodes
            .iter()
            .fold((first.place, first.place), |(low, high), node| (low.min(node.place), high.max(node.place)));
        if !(low.abs_diff_eq(DVec2::ZERO, 0.01) && high.abs_diff_eq(DVec2::ONE, 0.01)) {
            self.note(format!(
                "the mesh extends from {:.3} to {:.3} of the raster's width and from {:.3} to {:.3} of its height",
                low.x, high.x, low.y, high.y
            ));
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failed assumption of a test panics")]
mod tests {
    use super::*;

    #[test]
    fn formats_are_recognised_by_their_first_lines() {
        assert_eq!(kind(b"2\n3 3\n"), Some(Kind::Bourke));
        assert_eq!(kind(b"# made by hand\nv 0 0 0\n"), Some(Kind::Obj));
        assert_eq!(kind(b"x;y;u;v;column;row\n0;0;0;0;0;0\n"), Some(Kind::Csv));
        assert_eq!(kind(b"SGC\x01"), Some(Kind::Sciss));
        assert_eq!(kind(b"something else\n"), None);
        assert_eq!(kind(b"\xff\xff"), None);
    }

    #[test]
    fn a_face_has_separate_texture_indices() {
        let text = "v -1 -1 0\nv 1 -1 0\nv 1 1 0\nvt 1 1\nvt 0 0\nvt 1 0\nf 1/2 2/3 3/1\nf -3/2/1 -2/3/1 -1/1/1\n";
        let mesh = load(Kind::Obj, text.as_bytes(), 1.0).unwrap().mesh;
        assert_eq!(mesh.nodes.len(), 3);
        assert_eq!(mesh.nodes[2], Node { place: DVec2::ONE, content: DVec2::ONE, intensity: 1.0 });
        assert_eq!(mesh.triangles, [[0, 1, 2], [0, 1, 2]]);
        for wrong in ["f 1 2 3", "v 0 0 1", "v 0 nan 0", "v 0 0 0\nvt 0 0\nf 1 1 2", "q 1", "v 0 0 0\nvt 0 0\nf 0 1 1"]
        {
            assert!(load(Kind::Obj, wrong.as_bytes(), 1.0).is_err(), "{wrong}");
        }
    }

    #[test]
    fn meshes_with_too_many_or_too_few_nodes_are_refused() {
        let node = "0 0 0.5 0.5 1\n";
        for (count, right) in [(3, false), (4, true), (5, false)] {
            let text = format!("2\n2 2\n{}", node.repeat(count));
            assert_eq!(load(Kind::Bourke, text.as_bytes(), 1.0).is_ok(), right, "{count}");
        }
        for wrong in ["0\n2 2\n", "2\n1 2\n", "2\n9000 2\n", "2\n2 2\n0 0 0 0\n", "2\n2 2\n0 0 0 0 inf\n"] {
            assert!(load(Kind::Bourke, wrong.as_bytes(), 1.0).is_err(), "{wrong}");
        }
        let csv = "0;0;0;0;0;0\n1;0;1;0;1;0\n0;1;0;1;0;1\n";
        assert!(load(Kind::Csv, csv.as_bytes(), 1.0).is_err());
        assert!(load(Kind::Csv, format!("{csv}1;1;1;1;1;1\n").as_bytes(), 1.0).is_ok());
        assert!(load(Kind::Csv, format!("{csv}1;1;1;1;1;1\n1;1;1;1;1;1\n").as_bytes(), 1.0).is_err());
    }
}
