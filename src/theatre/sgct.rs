//! Configurations of SGCT in JSON: a region for each viewport, with its projection, mesh and masks.
//!
//! SGCT draws a viewport with its projection, then warps that picture with the mesh, then applies blend mask and black
//! level. The raster is the viewport's part of the window. Directions are those of the projection in the room's axes
//! (+x right, +y up, -z forward).

use std::path::{Component, Path};

use glam::{DMat3, DQuat, DVec2, DVec3};
use serde_json::Value;

use super::{
    Grid, Interpolation, MOST_BYTES, MOST_REGIONS, Mask, Placement, Reader, Region, RowOrder,
    content::{Content, yaw_pitch_roll},
    fault::Fault,
    mask,
    mesh::{DISPLAY_GAMMA, sampled},
    mesh_files::{self, Kind, load},
    pfm, refused,
};
use crate::files;

/// Maximum size of a configuration, bytes.
const MOST_TEXT: usize = 16 << 20;
/// Columns and rows of the grid of a viewport without a mesh.
const PLAIN: [usize; 2] = [65, 65];

/// A value with its location for messages. Keys are case-insensitive.
#[derive(Clone)]
struct Field<'a> {
    value: &'a Value,
    place: String,
}

impl<'a> Field<'a> {
    fn get(&self, key: &str) -> Result<Option<Self>, Fault> {
        let Value::Object(map) = self.value else {
            return Err(Fault::new(&self.place, "not an object", "must be an object"));
        };
        let mut found = map.iter().filter(|(name, _)| name.eq_ignore_ascii_case(key));
        let place = if self.place.is_empty() { key.to_owned() } else { format!("{}.{key}", self.place) };
        match (found.next(), found.next()) {
            (Some(_), Some(_)) => Err(Fault::new(place, "it occurs twice", "must occur once")),
            (Some((_, value)), None) if !value.is_null() => Ok(Some(Self { value, place })),
            _ => Ok(None),
        }
    }

    fn needed(&self, key: &str) -> Result<Self, Fault> {
        let place = if self.place.is_empty() { "configuration" } else { &self.place };
        self.get(key)?.ok_or_else(|| Fault::new(place, format!("`{key}` is missing"), "it is required"))
    }

    fn number(&self) -> Result<f64, Fault> {
        self.value
            .as_f64()
            .filter(|number| number.is_finite())
            .ok_or_else(|| Fault::new(&self.place, "not a number", "must be a finite number"))
    }

    fn optional_number(&self, key: &str) -> Result<Option<f64>, Fault> {
        self.get(key)?.map(|field| field.number()).transpose()
    }

    fn text(&self) -> Result<&'a str, Fault> {
        self.value.as_str().ok_or_else(|| Fault::new(&self.place, "not a text", "must be a text"))
    }

    fn list(&self) -> Result<Vec<Self>, Fault> {
        let Value::Array(values) = self.value else {
            return Err(Fault::new(&self.place, "not a list", "must be a list"));
        };
        Ok(values.iter().enumerate().map(|(i, value)| Self { value, place: format!("{}[{i}]", self.place) }).collect())
    }

    fn pair(&self) -> Result<DVec2, Fault> {
        Ok(DVec2::new(self.needed("x")?.number()?, self.needed("y")?.number()?))
    }

    fn vector(&self) -> Result<DVec3, Fault> {
        Ok(DVec3::new(self.needed("x")?.number()?, self.needed("y")?.number()?, self.needed("z")?.number()?))
    }

    /// A quaternion, or yaw, pitch and roll in degrees.
    fn rotation(&self) -> Result<DMat3, Fault> {
        let numbers = |keys: &[&str]| -> Result<Option<Vec<f64>>, Fault> {
            let found: Vec<f64> = keys
                .iter()
                .map(|key| self.optional_number(key))
                .collect::<Result<Vec<_>, _>>()?
                .into_iter()
                .flatten()
                .collect();
            match found.len() {
                0 => Ok(None),
                n if n == keys.len() => Ok(Some(found)),
                _ => Err(Fault::new(&self.place, "a part is missing", format!("must have all of {}", keys.join(", ")))),
            }
        };
        match (numbers(&["yaw", "pitch", "roll"])?, numbers(&["x", "y", "z", "w"])?) {
            (Some(angles), None) => {
                let [yaw, pitch, roll] = [angles[0], angles[1], angles[2]].map(f64::to_radians);
                Ok(yaw_pitch_roll(yaw, pitch, roll))
            }
            (None, Some(parts)) => {
                let quaternion = DQuat::from_xyzw(parts[0], parts[1], parts[2], parts[3]);
                if quaternion.length().is_nan() || (quaternion.length() - 1.0).abs() >= 1e-3 {
                    let problem = format!("it has the length {}", quaternion.length());
                    return Err(Fault::new(&self.place, problem, "must be a unit quaternion"));
                }
                Ok(DMat3::from_quat(quaternion.normalize()))
            }
            _ => Err(Fault::new(
                &self.place,
                "neither yaw, pitch and roll nor a quaternion",
                "must have yaw, pitch and roll in degrees, or x, y, z and w",
            )),
        }
    }
}

/// A viewport within its window.
struct Area {
    /// Position of its lower left corner and its size, relative to the window.
    position: DVec2,
    size: DVec2,
    size_px: [u32; 2],
    aspect: f64,
}

/// The picture of a viewport.
struct Drawn {
    content: Content,
    /// Whether it is a fisheye, which may need a mask around its circle.
    round: bool,
    /// Whether the values of the mesh are positions in the picture, also in a PFM.
    texture_mapped: bool,
}

impl Reader<'_> {
    pub(super) fn sgct(&mut self, bytes: &[u8]) -> Result<Vec<Region>, Fault> {
        if bytes.len() > MOST_TEXT {
            let allowed = format!("a configuration must have at most {MOST_TEXT} bytes");
            return Err(Fault::new("JSON", format!("{} bytes", bytes.len()), allowed));
        }
        let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
        let value: Value = serde_json::from_slice(bytes)
            .map_err(|error| Fault::new("JSON", error.to_string(), "must be a configuration of SGCT in JSON"))?;
        let root = Field { value: &value, place: String::new() };
        let nodes = root.needed("nodes")?.list()?;
        let users = root.get("users")?.map(|users| users.list()).transpose()?.unwrap_or_default();
        let mut names = Vec::new();
        let mut regions = Vec::new();
        for (n, node) in nodes.iter().enumerate() {
            for (w, window) in node.needed("windows")?.list()?.iter().enumerate() {
                let viewports = window.needed("viewports")?.list()?;
                for (v, viewport) in viewports.iter().enumerate() {
                    let name = format!("{n}/{w}/{v}");
                    if names.len() == MOST_REGIONS {
                        let allowed = format!("must be at most {MOST_REGIONS}");
                        return Err(Fault::new(&viewport.place, "too many viewports", allowed));
                    }
                    if self.wants(&name, &name) {
                        regions.push(self.viewport(name.clone(), window, viewport, &users)?);
                    }
                    names.push(name);
                }
            }
        }
        if regions.is_empty() {
            let wanted = self.options.region.as_deref().unwrap_or("any");
            let allowed = format!("must be node/window/viewport, each from 0: one of {}", names.join(", "));
            return Err(Fault::new("nodes", format!("no viewport `{}`", wanted.escape_debug()), allowed));
        }
        self.note("axes of the room: +x right, +y up, -z forward");
        Ok(regions)
    }

    fn viewport(&mut self, name: String, window: &Field, viewport: &Field, users: &[Field]) -> Result<Region, Fault> {
        if let Some(mesh) = window.get("scalablemesh")? {
            let (what, reason) = refused(Path::new(".ol"), b"").unwrap_or_default();
            return Err(Fault::refused(format!("{}: {what}", mesh.place), reason));
        }
        for key in ["mirrorx", "mirrory"] {
            if let Some(mirror) = window.get(key)?
                && mirror.value != &Value::Bool(false)
            {
                return Err(Fault::new(mirror.place, "a mirrored window", "must be false"));
            }
        }
        if let Some(stereo) = window.get("stereo")?
            && !["none", "no_stereo"].contains(&stereo.text()?)
        {
            return Err(Fault::new(
                &stereo.place,
                format!("`{}`", stereo.text()?.escape_debug()),
                "only one eye (none) is supported",
            ));
        }
        let area = self.area(window, viewport)?;
        let mesh = self.referenced_file(viewport.get("mesh")?)?;
        let is_bourke = mesh.as_ref().is_some_and(|(_, bytes)| mesh_files::kind(bytes) == Some(Kind::Bourke));
        let projection = viewport.needed("projection")?;
        let eye = self.eye(viewport, users)?;
        let drawn = self.projection(&projection, &area, eye, is_bourke)?;
        let (grid, intensities) = match &mesh {
            None => {
                let place = &projection.place;
                self.take_grid(PLAIN[0], PLAIN[1], place)?;
                (sampled(&drawn.content, PLAIN), self.circle(&drawn, &area, place)?)
            }
            Some((place, bytes)) => self.mesh_grid(&drawn, &area, place, bytes).map_err(|fault| fault.within(place))?,
        };
        let blend = self.masked(viewport.get("blendmask")?)?;
        let alpha = match (blend, intensities) {
            (Some(_), Some(_)) => {
                return Err(Fault::new(
                    &viewport.place,
                    "a blend mask together with mesh intensities or the rim of a fisheye",
                    "only one mask can be applied: set the intensities to 1, or omit the blend mask",
                ));
            }
            (blend, intensities) => blend.or(intensities),
        };
        let beta = self.masked(viewport.get("blacklevelmask")?)?;
        Ok(Region { name, size_px: area.size_px, grid, alpha, beta, lut: None, screen: None })
    }

    fn area(&self, window: &Field, viewport: &Field) -> Result<Area, Fault> {
        let share = |key: &str, default: DVec2| viewport.get(key)?.map_or(Ok(default), |field| field.pair());
        let (position, size) = (share("pos", DVec2::ZERO)?, share("size", DVec2::ONE)?);
        if !(position.min_element() >= -1e-6
            && size.min_element() > 0.0
            && (position + size).max_element() <= 1.0 + 1e-6)
        {
            let problem = format!("it covers {position} to {} of its window", position + size);
            return Err(Fault::new(&viewport.place, problem, "a viewport must lie within 0 to 1 of its window"));
        }
        let pixels = match (window.get("res")?, window.get("size")?) {
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

    /// Position of the eye: from the viewport's user, or from the options.
    fn eye(&mut self, viewport: &Field, users: &[Field]) -> Result<DVec3, Fault> {
        let user = match viewport.get("user")? {
            None => users.first().cloned(),
            Some(wanted) => {
                let name = wanted.text()?;
                let mut found = None;
                for user in users {
                    if let Some(own) = user.get("name")?
                        && own.text()? == name
                    {
                        found = Some(user.clone());
                    }
                }
                Some(found.ok_or_else(|| {
                    let problem = format!("no user `{}`", name.escape_debug());
                    Fault::new(&wanted.place, problem, "must be one of `users`")
                })?)
            }
        };
        let position = match user {
            Some(user) => user.get("pos")?.map(|position| Ok((position.vector()?, position.place))).transpose()?,
            None => None,
        };
        let requested = self.options.eye_m;
        match position {
            Some((position, place)) if requested != DVec3::ZERO && !requested.abs_diff_eq(position, 1e-9) => {
                let problem = format!("the eye is at {position} in the file and at {requested} in the options");
                Err(Fault::new(place, problem, "omit one, or make them equal"))
            }
            Some((position, _)) => {
                self.note(format!("eye: from the user in the file, at {position} m"));
                Ok(position)
            }
            None => {
                self.note(format!("eye: at {requested} m, the file does not specify it"));
                Ok(requested)
            }
        }
    }

    fn projection(&mut self, field: &Field, area: &Area, eye: DVec3, is_bourke: bool) -> Result<Drawn, Fault> {
        let kind = field.needed("type")?;
        let known = "must be one of planar, projectionplane, fisheye and texturemapped";
        let name = kind.text()?.to_ascii_lowercase();
        let name = name.strip_suffix("projection").unwrap_or(&name);
        let drawn = |content: Content| Drawn { content, round: false, texture_mapped: name == "texturemapped" };
        match name {
            "planar" | "texturemapped" => Ok(drawn(planar(field, eye)?)),
            "projectionplane" => {
                let corner = |key: &str| field.needed(key)?.vector();
                let (lower_left, upper_left, upper_right) =
                    (corner("lowerleft")?, corner("upperleft")?, corner("upperright")?);
                let content = Content::corners(lower_left, upper_left, upper_right, eye);
                Ok(drawn(content.map_err(|fault| fault.within(&field.place))?))
            }
            "fisheye" => {
                for key in ["crop", "offset"] {
                    if let Some(part) = field.get(key)?
                        && part
                            .value
                            .as_object()
                            .is_none_or(|map| map.values().any(|value| value.as_f64() != Some(0.0)))
                    {
                        return Err(Fault::new(part.place, format!("a fisheye with {key}"), "must be zeros"));
                    }
                }
                let fov_deg = field.optional_number("fov")?.unwrap_or(180.0);
                let tilt_deg = field.optional_number("tilt")?.unwrap_or(0.0);
                let keep = match field.get("keepaspectratio")? {
                    None => true,
                    Some(keep) => keep
                        .value
                        .as_bool()
                        .ok_or_else(|| Fault::new(&keep.place, "neither true nor false", "must be one of them"))?,
                };
                // A mesh by Paul Bourke has coordinates in a square picture.
                let radius =
                    if keep && !is_bourke { [(1.0 / area.aspect).min(1.0), area.aspect.min(1.0)] } else { [1.0; 2] };
                self.note(format!(
                    "fisheye of {fov_deg} degrees, equidistant, centre = apex of the dome tilted by {tilt_deg} degrees to the front, bottom = front"
                ));
                let content = Content::fisheye(fov_deg.to_radians(), tilt_deg.to_radians(), radius);
                let content = content.map_err(|fault| fault.within(&field.place))?;
                Ok(Drawn { content, round: true, texture_mapped: false })
            }
            "sphericalmirror" => Err(Fault::refused(
                format!("{}: a spherical mirror", field.place),
                "its meshes refer to four pictures whose directions the file does not contain; export one mesh of a fisheye (Paul Bourke's .data)",
            )),
            "cubemap" | "cylindrical" | "equirectangular" => Err(Fault::refused(
                format!("{}: the projection `{name}`", field.place),
                format!("it shows all directions and is not a projector; {known}"),
            )),
            other => Err(Fault::new(&kind.place, format!("`{}`", other.escape_debug()), known)),
        }
    }

    /// A mask that ends a fisheye at its rim.
    fn circle(&mut self, drawn: &Drawn, area: &Area, place: &str) -> Result<Option<Mask>, Fault> {
        if !drawn.round {
            return Ok(None);
        }
        let [width, height] = area.size_px;
        self.take_mask(width, height, place)?;
        let middle = |i: u32, count: u32| (f64::from(i) + 0.5) / f64::from(count);
        let pixels = (0..height).flat_map(|j| (0..width).map(move |i| (i, j)));
        let inside = pixels.map(|(i, j)| {
            let distance = drawn.content.distance_from_centre(middle(i, width), 1.0 - middle(j, height));
            if distance <= 1.0 { 1.0 } else { 0.0 }
        });
        Ok(Some(Mask { width: width as usize, height: height as usize, values: inside.collect(), levels: 65535 }))
    }

    fn mesh_grid(
        &mut self,
        drawn: &Drawn,
        area: &Area,
        place: &str,
        bytes: &[u8],
    ) -> Result<(Grid, Option<Mask>), Fault> {
        if pfm::is_pfm(bytes) {
            return Ok((self.pfm_grid(drawn, bytes)?, None));
        }
        if let Some((what, reason)) = refused(Path::new(place), bytes) {
            return Err(Fault::refused(what, reason));
        }
        let Some(kind) = mesh_files::kind(bytes) else {
            let allowed = "must be one of Paul Bourke's .data, .sgc, OBJ, CSV and PFM";
            return Err(Fault::new("mesh", "the first bytes match no known format", allowed));
        };
        let mut loaded = load(kind, bytes, area.aspect)?;
        if let Some(mapping) = loaded.mapping
            && (mapping == 2) != drawn.round
        {
            let problem = format!("a mesh by Paul Bourke for mapping {mapping}");
            return Err(Fault::new("mesh", problem, "a fisheye requires mapping 2, and mapping 2 a fisheye"));
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
                return Err(Fault::new("mesh", "an .sgc mesh with its own frustum", "it requires a planar projection"));
            }
            Some(content) => {
                self.note("an .sgc mesh has its own frustum, which replaces that of the viewport");
                content
            }
            None => drawn.content.clone(),
        };
        self.warped(&loaded.mesh, &content, area.size_px, "mesh")
    }

    /// A PFM of positions in the picture, at nodes from edge to edge.
    fn pfm_grid(&mut self, drawn: &Drawn, bytes: &[u8]) -> Result<Grid, Fault> {
        if !drawn.texture_mapped {
            let reason = "for projections other than texturemapped it contains positions on the raster for two eyes";
            return Err(Fault::refused("a PFM as mesh", reason));
        }
        let plane = pfm::decode(bytes)?;
        let (columns, rows) = (plane.width, plane.height);
        self.take_grid(columns, rows, "PFM")?;
        let order = self.rows(RowOrder::TopFirst, "a PFM as mesh of SGCT, which reads them in the order of the file");
        self.note("nodes of a PFM mesh extend from edge to edge of the raster; u to the right, v upwards, the third value is ignored");
        let mut samples = Vec::with_capacity(columns * rows);
        let (mut known, mut outside) = (0_usize, 0_usize);
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
            let direction = if u.is_nan() || v.is_nan() { None } else { drawn.content.direction(u, v) };
            known += usize::from(!(u.is_nan() || v.is_nan()));
            outside += usize::from(!(u.is_nan() || v.is_nan()) && direction.is_none());
            samples.push(direction);
        }
        if outside * 2 > known {
            let problem = format!("{outside} of {known} coordinates lie outside of 0 to 1");
            return Err(Fault::new("PFM", problem, "must be absolute coordinates in the picture, not offsets"));
        }
        if outside > 0 {
            self.note(format!("PFM: {outside} of {known} coordinates lie outside of 0 to 1: no light is sent there"));
        }
        Ok(Grid { columns, rows, samples, placement: Placement::Corners, interpolation: Interpolation::Smooth })
    }

    fn masked(&mut self, field: Option<Field>) -> Result<Option<Mask>, Fault> {
        let Some((place, bytes)) = self.referenced_file(field)? else { return Ok(None) };
        let take = &mut |width, height| self.take_mask(width, height, "size");
        let decoded = mask::decode(&bytes, DISPLAY_GAMMA, take).map_err(|fault| fault.within(&place))?;
        if decoded.coloured {
            self.note(format!("{place}: it is coloured, its luminance is used"));
        }
        self.note(format!(
            "masks multiply the display codes: the factor on the light is the mask to the power {DISPLAY_GAMMA}, and the black level is treated in the same way"
        ));
        Ok(Some(decoded.mask))
    }

    /// Reads the file that a field refers to, in the configuration's folder or below it; returns its location for
    /// messages, and its content.
    fn referenced_file(&self, field: Option<Field>) -> Result<Option<(String, Vec<u8>)>, Fault> {
        let Some(field) = field else { return Ok(None) };
        let name = field.text()?;
        if name.is_empty() {
            return Ok(None);
        }
        let place = format!("{} = `{}`", field.place, name.escape_debug());
        let allowed = "must be a regular file in the configuration's folder or below it, of at most 1 GiB, without an absolute path or `..`";
        let portable = name.replace('\\', "/");
        let relative = Path::new(&portable);
        let inside = relative.components().all(|part| matches!(part, Component::Normal(_) | Component::CurDir));
        if !inside || portable.contains(':') {
            return Err(Fault::new(place, "it leads out of the folder", allowed));
        }
        let path = self.path.parent().unwrap_or(Path::new("")).join(relative);
        let bytes =
            files::read_bounded(&path, MOST_BYTES).map_err(|error| Fault::new(&place, error.to_string(), allowed))?;
        Ok(Some((place, bytes)))
    }
}

/// The picture of a planar projection. Its plane is at a distance from the room's origin, not from the eye.
fn planar(field: &Field, eye: DVec3) -> Result<Content, Fault> {
    let fov = field.needed("fov")?;
    let edge = |single: &str, whole: &str| -> Result<f64, Fault> {
        match (fov.optional_number(single)?, fov.optional_number(whole)?) {
            (Some(edge), _) => Ok(edge.to_radians()),
            (None, Some(whole)) => Ok((whole / 2.0).to_radians()),
            (None, None) => Err(Fault::new(
                &fov.place,
                format!("neither `{single}` nor `{whole}`"),
                "must have one of them, in degrees",
            )),
        }
    };
    let (left, right) = (-edge("left", "hfov")?, edge("right", "hfov")?);
    let (down, up) = (-edge("down", "vfov")?, edge("up", "vfov")?);
    let rotation = field.get("orientation")?.map_or(Ok(DMat3::IDENTITY), |orientation| orientation.rotation())?;
    let distance = match (field.optional_number("distance")?, fov.optional_number("distance")?) {
        (Some(distance), _) | (None, Some(distance)) => distance,
        (None, None) => 10.0,
    };
    if distance <= 0.0 {
        return Err(Fault::new(&field.place, format!("distance = {distance}"), "must be more than 0"));
    }
    let offset = field.get("offset")?.map_or(Ok(DVec3::ZERO), |offset| offset.vector())?;
    let content = Content::frustum(left, right, down, up, rotation).map_err(|fault| fault.within(&fov.place))?;
    let Content::Plane { lower_left, right, up } = content else {
        return Ok(content);
    };
    let lower_left = lower_left * distance + offset;
    let (upper_left, upper_right) = (lower_left + up * distance, lower_left + up * distance + right * distance);
    Content::corners(lower_left, upper_left, upper_right, eye).map_err(|fault| fault.within(&field.place))
}
