//! Reads configurations of SGCT in JSON. Each viewport becomes a region with its projection, mesh and masks.
//!
//! SGCT draws a viewport with its projection, then warps that picture with the mesh, then applies the blend mask and
//! the black level. The raster is the viewport's part of the window. Directions are those of the projection in the
//! room's axes (+x right, +y up, -z forward).

use std::path::{Component, Path, PathBuf};

use glam::DVec2;
use serde_json::Value;

use super::{
    Grid, Interpolation, MOST_BYTES, MOST_REGIONS, Mask, Placement, Reader, Region, RowOrder,
    edge::{Placed, placed},
    fault::{Fault, shown},
    json::Field,
    mask,
    mesh::{Warped, sampled},
    mesh_files::{self, Kind, load},
    pfm, refused,
    sgct_keys::unknown_keys,
    sgct_projection::{Area, Drawn},
};
use crate::{files, view::projector::DISPLAY_GAMMA};

/// Maximum size of a configuration, bytes.
const MOST_TEXT: usize = 16 << 20;
/// Columns and rows of the grid of a viewport without a mesh.
const PLAIN: [usize; 2] = [65, 65];
/// The same for fisheyes that extend almost to the antipode of their centre, where small errors are many pixels.
const WIDE: [usize; 2] = [257, 257];

impl Reader<'_> {
    pub(super) fn sgct(&mut self, bytes: &[u8]) -> Result<Vec<Region>, Fault> {
        if bytes.len() > MOST_TEXT {
            let allowed = format!("a configuration must have at most {MOST_TEXT} bytes");
            return Err(Fault::new("JSON", format!("{} bytes", bytes.len()), allowed));
        }
        let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
        let value: Value = serde_json::from_slice(bytes).map_err(|error| {
            let allowed = "must be a configuration of SGCT in JSON, which has no comments";
            Fault::new("JSON", error.to_string(), allowed)
        })?;
        let root = Field { value: &value, place: String::new() };
        for note in unknown_keys(&root) {
            self.note(note);
        }
        if let Some(version) = root.get("version")?
            && version.value.as_f64() != Some(1.0)
        {
            self.note(format!("version {}: only version 1 is known; it is read as version 1", version.value));
        }
        let nodes = root.needed("nodes")?.list()?;
        let users = root.get("users")?.map(|users| users.list()).transpose()?.unwrap_or_default();
        let mut names = Vec::new();
        let mut regions = Vec::new();
        let mut windows_found = 0;
        for (n, node) in nodes.iter().enumerate() {
            let windows = node.get("windows")?.map_or(Ok(Vec::new()), |windows| windows.list())?;
            windows_found += windows.len();
            for (w, window) in windows.iter().enumerate() {
                if !window.flag("draw3d", true)? {
                    let title =
                        window_name(window)?.map_or(String::new(), |title| format!(" `{}`", title.escape_debug()));
                    self.note(format!(
                        "{}{title}: it does not draw the 3D scene, so it is not a projector",
                        window.place
                    ));
                    continue;
                }
                let viewports = window.needed("viewports")?.list()?;
                for (v, viewport) in viewports.iter().enumerate() {
                    let name = format!("{n}/{w}/{v}");
                    if names.len() == MOST_REGIONS {
                        let allowed = format!("must be at most {MOST_REGIONS}");
                        return Err(Fault::new(&viewport.place, "too many viewports", allowed));
                    }
                    if self.wants(&name, &name) {
                        let mut region = self.viewport(name.clone(), window, viewport, &users)?;
                        // Several viewports share the name of their window.
                        let number = if viewports.len() > 1 { format!("_{}", v + 1) } else { String::new() };
                        region.title = window_name(window)?.map(|title| format!("{title}{number}"));
                        regions.push(self.finished(region));
                    }
                    names.push(name);
                }
            }
        }
        if windows_found == 0 {
            return Err(Fault::new("nodes", "no node has a window", "at least one must have `windows` with viewports"));
        }
        if names.is_empty() {
            return Err(Fault::new("nodes", "no window draws the 3D scene", "at least one window must (draw3D)"));
        }
        if regions.is_empty() {
            let wanted = self.options.region.as_deref().unwrap_or("any");
            let allowed = format!("must be node/window/viewport, each from 0: one of {}", names.join(", "));
            return Err(Fault::new("nodes", format!("no viewport `{}`", wanted.escape_debug()), allowed));
        }
        self.note("axes of the room: +x right, +y up, -z forward");
        if let Some(scene) = root.get("scene")? {
            self.turn_scene(&scene, &mut regions)?;
        }
        Ok(regions)
    }

    /// Applies the rotation of the scene. A direction of the room shows the direction of the scene that is turned back by this rotation.
    fn turn_scene(&mut self, scene: &Field, regions: &mut [Region]) -> Result<(), Fault> {
        for (key, idle) in [("offset", 0.0), ("scale", 1.0)] {
            if let Some(field) = scene.get(key)? {
                let numbers = field.value.as_object().map_or_else(
                    || vec![field.value.as_f64()],
                    |parts| parts.values().map(serde_json::Value::as_f64).collect(),
                );
                if numbers.iter().any(|number| *number != Some(idle)) {
                    self.note(format!(
                        "{}: it is not applied, because it does not change directions in the sky",
                        field.place
                    ));
                }
            }
        }
        let Some(orientation) = scene.get("orientation")? else { return Ok(()) };
        let zeros = |map: &serde_json::Map<String, Value>| map.values().all(|value| value.as_f64() == Some(0.0));
        if orientation.value.as_object().is_some_and(zeros) {
            // A quaternion of zeros has no effect, as in SGCT.
            return Ok(());
        }
        let rotation = orientation.rotation()?;
        self.note(format!(
            "{}: the scene is turned in the room, so all directions are turned by the opposite rotation",
            orientation.place
        ));
        let turned_back = rotation.transpose();
        for region in regions {
            for sample in region.grid.samples.iter_mut().flatten() {
                *sample = turned_back * *sample;
            }
        }
        Ok(())
    }

    fn viewport(&mut self, name: String, window: &Field, viewport: &Field, users: &[Field]) -> Result<Region, Fault> {
        for key in ["mirrorx", "mirrory"] {
            if let Some(mirror) = window.get(key)?
                && mirror.value != &Value::Bool(false)
            {
                return Err(Fault::new(mirror.place, "a mirrored window", "must be false"));
            }
        }
        if let Some(overlay) = viewport.get("overlay")? {
            self.note(format!("{}: its picture is not imported; [[overlay]] can show it", overlay.place));
        }
        if let Some(stereo) = window.get("stereo")? {
            check_stereo(&stereo)?;
        }
        let area = self.area(window, viewport)?;
        let mesh = match (viewport.get("mesh")?, window.get("scalablemesh")?) {
            (Some(mesh), Some(_)) => {
                return Err(Fault::new(
                    mesh.place,
                    "a mesh in addition to the scalablemesh of its window",
                    "only one can be applied",
                ));
            }
            (mesh, scalable) => self.referenced_file(mesh.or(scalable))?,
        };
        let is_bourke = mesh.as_ref().is_some_and(|(_, bytes)| mesh_files::kind(bytes) == Some(Kind::Bourke));
        let projection = viewport.needed("projection")?;
        let eye = self.eye(viewport, users)?;
        let drawn = self.projection(&projection, &area, eye, is_bourke)?;
        let Warped { grid, border, intensities } = match &mesh {
            None => {
                let nodes = if drawn.is_wide() { WIDE } else { PLAIN };
                self.take_grid(nodes[0], nodes[1], &projection.place)?;
                self.uses.eye |= drawn.has_eye;
                sampled(&drawn.content, nodes)
            }
            Some((place, bytes)) => self.mesh_grid(&drawn, &area, place, bytes).map_err(|fault| fault.within(place))?,
        };
        let blend = self.masked(viewport.get("blendmask")?, area.size_px)?;
        // SGCT multiplies the picture's codes by each of them; its "black level" does not raise black.
        let black = self.masked(viewport.get("blacklevelmask")?, area.size_px)?;
        if black.is_some() {
            self.note(
                "blacklevelmask: SGCT multiplies the picture by it (white changes nothing); it does not raise black",
            );
        }
        let alpha =
            [blend, black, intensities].into_iter().flatten().reduce(|first, second| mask::product(&first, &second));
        Ok(Region { border, alpha, multiplies_codes: true, ..Region::of_grid(name, area.size_px, grid) })
    }

    fn area(&self, window: &Field, viewport: &Field) -> Result<Area, Fault> {
        let share = |key: &str, default: DVec2| viewport.get(key)?.map_or(Ok(default), |field| field.pair());
        let (position, size) = (share("pos", DVec2::ZERO)?, share("size", DVec2::ONE)?);
        if !(position.min_element() >= -1e-6
            && size.min_element() > 0.0
            && (position + size).max_element() <= 1.0 + 1e-6)
        {
            let [low, high] = [position, position + size].map(|at| shown(at.to_array()));
            let problem = format!("it extends from {low} to {high} of its window");
            return Err(Fault::new(&viewport.place, problem, "a viewport must lie between 0 and 1 of its window"));
        }
        // `res` is the size of SGCT's internal picture, which is then scaled to the window.
        let pixels = match (window.get("size")?, window.get("res")?) {
            (Some(field), _) | (None, Some(field)) => {
                let pixels = field.pair()?;
                if !(pixels.min_element() >= 1.0 && pixels.max_element() <= 65536.0) || pixels.fract() != DVec2::ZERO {
                    return Err(Fault::new(field.place, format!("{pixels}"), "must be numbers of pixels"));
                }
                Some(pixels * size)
            }
            (None, None) => None,
        };
        let file_size = pixels.map(|pixels| pixels.to_array().map(|side| (side.round() as u32).max(1)));
        let size_px = self.size_px(file_size, &viewport.place)?;
        let aspect = pixels.map_or(f64::from(size_px[0]) / f64::from(size_px[1]), |pixels| pixels.x / pixels.y);
        Ok(Area { position, size, size_px, aspect })
    }

    fn mesh_grid(&mut self, drawn: &Drawn, area: &Area, place: &str, bytes: &[u8]) -> Result<Warped, Fault> {
        if pfm::is_pfm(bytes) {
            return self.pfm_grid(drawn, bytes);
        }
        if let Some((what, reason)) = refused(Path::new(place), bytes) {
            return Err(Fault::refused(what, reason));
        }
        let Some(kind) = mesh_files::kind(bytes) else {
            let allowed =
                "must be one of Paul Bourke's .data, .sgc, .ol, Sky-Skan's and SimCAD's meshes, OBJ, CSV and PFM";
            return Err(Fault::new("mesh", "the first bytes match no known format", allowed));
        };
        let mut loaded = load(kind, bytes, area.aspect)?;
        for note in &loaded.notes {
            self.note(note);
        }
        if let Some(mapping) = loaded.mapping
            && (mapping == 2) != drawn.round
        {
            let problem = format!("a mesh by Paul Bourke for mapping {mapping}");
            return Err(Fault::new("mesh", problem, "a fisheye requires mapping 2, and mapping 2 requires a fisheye"));
        }
        if kind == Kind::Obj {
            self.note("OBJ meshes have positions and coordinates relative to the whole window");
            for node in &mut loaded.mesh.nodes {
                node.place = (node.place - area.position) / area.size;
                node.content = (node.content - area.position) / area.size;
            }
        }
        self.note_reach(&loaded.mesh);
        let content = match loaded.content {
            Some(_) if drawn.round => {
                let problem = format!("{} with its own frustum", kind.name());
                return Err(Fault::new("mesh", problem, "it requires a planar projection"));
            }
            Some(content) => {
                self.note(format!(
                    "{}: the mesh has its own frustum, which replaces that of the viewport",
                    kind.name()
                ));
                content
            }
            None => {
                self.uses.eye |= drawn.has_eye;
                drawn.content.clone()
            }
        };
        self.warped(&loaded.mesh, &content, area.size_px, "mesh")
    }

    /// Reads a PFM with positions in the picture, for nodes from edge to edge of the raster.
    fn pfm_grid(&mut self, drawn: &Drawn, bytes: &[u8]) -> Result<Warped, Fault> {
        if !drawn.texture_mapped {
            let reason =
                "with a projection other than texturemapped it contains positions on the raster, one set for each eye";
            return Err(Fault::refused("a PFM as mesh", reason));
        }
        let plane = pfm::decode(bytes)?;
        self.uses.eye |= drawn.has_eye;
        let (columns, rows) = (plane.width, plane.height);
        self.take_grid(columns, rows, "PFM")?;
        let order = self.rows(RowOrder::TopFirst, "a PFM as mesh of SGCT, which reads them in the order of the file");
        self.note("nodes of a PFM mesh extend from edge to edge of the raster; u to the right, v upwards, the third value is ignored");
        let mut places = Vec::with_capacity(columns * rows);
        for (column, row, [u, v, _]) in plane.top_down(order) {
            let (u, v) = (f64::from(u), f64::from(v));
            if u.is_infinite() || v.is_infinite() {
                let place = format!("column {column} of row {row} (from the top, from 0)");
                return Err(Fault::new(
                    place,
                    format!("[{u}, {v}]"),
                    "must be finite coordinates; NaN for unknown samples",
                ));
            }
            places.push((!(u.is_nan() || v.is_nan())).then_some(DVec2::new(u, v)));
        }
        let known = places.iter().flatten().count();
        let found = placed(&drawn.content, places, columns, true);
        let outside = found.outside;
        if outside * 2 > known {
            let problem = format!("{outside} of {known} coordinates lie outside of 0 to 1");
            return Err(Fault::new(
                "PFM",
                problem,
                "must be absolute coordinates in the picture, not offsets or pixels",
            ));
        }
        self.note_edge("PFM", "coordinates", known, &found);
        let Placed { samples, border, .. } = found;
        let grid = Grid { columns, rows, samples, placement: Placement::Corners, interpolation: Interpolation::Smooth };
        Ok(Warped { grid, border, intensities: None })
    }

    fn masked(&mut self, field: Option<Field>, size_px: [u32; 2]) -> Result<Option<Mask>, Fault> {
        let Some((place, bytes)) = self.referenced_file(field)? else { return Ok(None) };
        let take = &mut |width, height| self.take_mask(width, height, "size");
        let decoded = mask::decode(&bytes, DISPLAY_GAMMA, take).map_err(|fault| fault.within(&place))?;
        if decoded.from_alpha {
            self.note(format!("{place}: its alpha channel is the mask"));
        }
        if decoded.coloured {
            self.note(format!("{place}: it is coloured; only its luminance is used"));
        }
        self.note_shape(&place, &decoded.mask, size_px);
        self.note_black(&place, &decoded.mask);
        self.note(format!(
            "masks multiply the display codes; the light is computed with the mask to the power {DISPLAY_GAMMA}"
        ));
        Ok(Some(decoded.mask))
    }

    /// Reads the file that a field refers to. It must be in the configuration's folder or below it. Returns its
    /// location for messages, and its content.
    fn referenced_file(&mut self, field: Option<Field>) -> Result<Option<(String, Vec<u8>)>, Fault> {
        let Some(field) = field else { return Ok(None) };
        let name = field.text()?;
        if name.is_empty() {
            return Ok(None);
        }
        let place = format!("{} = `{}`", field.place, name.escape_debug());
        let allowed = "must be a relative path without `..` to a regular file of at most 1 GiB in the configuration's folder or below it";
        let portable = name.replace('\\', "/");
        let relative = Path::new(&portable);
        let inside = relative.components().all(|part| matches!(part, Component::Normal(_) | Component::CurDir));
        if !inside || portable.contains(':') {
            return Err(Fault::new(place, "it leads out of the folder", allowed));
        }
        let folder = self.path.parent().unwrap_or(Path::new(""));
        let similar = ignoring_case(folder, relative);
        if let Some(similar) = &similar {
            self.note(format!("{place}: read from {}, whose name differs in upper and lower case", similar.display()));
        }
        let path = similar.unwrap_or_else(|| folder.join(relative));
        let bytes =
            files::read_bounded(&path, MOST_BYTES).map_err(|error| Fault::new(&place, error.to_string(), allowed))?;
        Ok(Some((place, bytes)))
    }
}

/// Returns the file that matches a path in a folder if case is ignored; `None` if the path exists as written, or if no file or several files match.
fn ignoring_case(folder: &Path, relative: &Path) -> Option<PathBuf> {
    if folder.join(relative).exists() {
        return None;
    }
    relative.components().try_fold(folder.to_owned(), |folder, part| {
        let Component::Normal(wanted) = part else { return Some(folder) };
        let here = if folder.as_os_str().is_empty() { Path::new(".") } else { &folder };
        let entries = std::fs::read_dir(here).ok()?.filter_map(|entry| entry.ok().map(|entry| entry.file_name()));
        let fitting: Vec<_> = entries.filter(|entry| entry.eq_ignore_ascii_case(wanted)).collect();
        let exact = fitting.iter().find(|entry| *entry == wanted);
        let only = if fitting.len() == 1 { fitting.first() } else { None };
        exact.or(only).map(|entry| folder.join(entry))
    })
}

/// Returns the name of a window, if it has one.
fn window_name<'a>(window: &Field<'a>) -> Result<Option<&'a str>, Fault> {
    Ok(window.get("name")?.map(|name| name.text()).transpose()?.filter(|name| !name.is_empty()))
}

/// Ways in which a window of SGCT shows two eyes.
const STEREO: [&str; 14] = [
    "active",
    "quadbuffer",
    "anaglyph_red_cyan",
    "anaglyph_amber_blue",
    "anaglyph_red_cyan_wimmer",
    "checkerboard",
    "checkerboard_inverted",
    "vertical_interlaced",
    "vertical_interlaced_inverted",
    "dummy",
    "side_by_side",
    "side_by_side_inverted",
    "top_bottom",
    "top_bottom_inverted",
];

/// Refuses a window that shows two eyes.
fn check_stereo(stereo: &Field) -> Result<(), Fault> {
    let mode = stereo.text()?.to_ascii_lowercase();
    if ["none", "no_stereo", "off"].contains(&&*mode) {
        return Ok(());
    }
    let shown = mode.escape_debug();
    Err(if STEREO.contains(&&*mode) {
        let problem = format!("`{shown}`: the window shows two pictures, one for each eye");
        let reason = "a projector has one picture: give each eye a window with stereo `none`, whose viewports have eye `left` or `right`";
        Fault::new(&stereo.place, problem, reason)
    } else {
        Fault::new(&stereo.place, format!("`{shown}`"), format!("must be none; SGCT also knows {}", STEREO.join(", ")))
    })
}
