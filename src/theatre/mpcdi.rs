//! MPCDI sets, versions 1 and 2 (VESA): a ZIP with a description in XML, warp maps as PFM, masks as PNG, look-up tables
//! as `.cube`.
//!
//! | profile | content of the warp map | source of directions |
//! |---|---|---|
//! | `2d`, `3d` | coordinates in the picture of the region's frustum, 0 to 1, and an error estimate | the frustum |
//! | `a3`, `sl` | points of the screen in a length unit | the points, as seen from the eye |

use std::collections::HashSet;

use glam::{DMat3, DVec2, DVec3};

use super::{
    Axes, Border, Grid, Interpolation, MOST_REGIONS, Placement, Reader, Region, RowOrder,
    archive::Archive,
    content::{Content, yaw_pitch_roll},
    edge::{Placed, placed},
    fault::{Fault, shown},
    mesh::{Warped, sampled},
    mpcdi_files::named_file,
    mpcdi_names::unknown_names,
    pfm,
    screen::ScreenSums,
    xml::{self, Element},
};

/// Tolerance for the lengths and the orthogonality of axes.
const AXES_WITHIN: f64 = 1e-3;

#[derive(Clone, Copy, PartialEq)]
enum Profile {
    /// `2d` and `3d`.
    Frustum(&'static str),
    /// `a3` and `sl`.
    Points(&'static str),
}

/// Source of the direction of a sample.
enum Geometry {
    Picture(Content),
    Points {
        dome_from_file: DMat3,
        /// The eye, in the unit of the file.
        origin: DVec3,
        /// In dome axes.
        eye: DVec3,
        /// Metres per unit of the file.
        metres: f64,
    },
}

impl Reader<'_> {
    pub(super) fn mpcdi(&mut self, bytes: &[u8]) -> Result<Vec<Region>, Fault> {
        let mut archive = Archive::open(bytes)?;
        let name = archive.named("mpcdi.xml")?.ok_or_else(|| {
            Fault::new("archive", "there is no mpcdi.xml in it", "an MPCDI set must have its description in its root")
        })?;
        if !name.eq_ignore_ascii_case("mpcdi.xml") {
            self.note(format!("the description lies in a folder of the archive: {}", name.escape_debug()));
        }
        archive.described = name.clone();
        let text = archive.bytes(&name)?;
        let document = xml::parse(&text).map_err(|fault| fault.within(&name))?;
        let root = Element::root(&document);
        for note in unknown_names(&root) {
            self.note(note);
        }
        self.described(&root, &mut archive).map_err(|fault| fault.within(&name))
    }

    fn described(&mut self, root: &Element, archive: &mut Archive) -> Result<Vec<Region>, Fault> {
        let profile = self.profile(root)?;
        let display = root.needed("display")?;
        // Some programs write <fileset> next to <files>, not inside it.
        let files = root.child("files")?;
        let filesets: Vec<Element> = files.iter().chain([root]).flat_map(|parent| parent.children("fileset")).collect();
        let lenses = lenses(root)?;
        let mut names = Vec::new();
        let mut ids = HashSet::new();
        let mut regions = Vec::new();
        // Read the selected regions of all buffers, each with its set of files.
        for buffer in display.children("buffer") {
            let buffer_id = buffer.needed_attribute("id")?;
            for region in buffer.children("region") {
                let id = region.needed_attribute("id")?;
                if !ids.insert(id) {
                    let problem = format!("the id `{}` occurs twice", id.escape_debug());
                    return Err(Fault::new(&region.place, problem, "ids of regions must be unique"));
                }
                if ids.len() > MOST_REGIONS {
                    return Err(Fault::new(
                        &region.place,
                        "too many regions",
                        format!("must be at most {MOST_REGIONS}"),
                    ));
                }
                let name = format!("{buffer_id}/{id}");
                if self.wants(&name, id) {
                    let size_px = self.region_size(&buffer, &region)?;
                    let mut region_sets = filesets.iter().filter(|set| set.attribute("region") == Some(id));
                    let place = format!("<files> <fileset region={id}>");
                    let (fileset, second) = (region_sets.next(), region_sets.next());
                    let fileset = match (fileset, second) {
                        (Some(fileset), None) => Some(Element { node: fileset.node, place }),
                        (None, _) if region.child("frustum")?.is_some() => None,
                        (None, _) => {
                            let allowed = "every region must have a set of files, or a frustum";
                            return Err(Fault::new(place, "it is missing", allowed));
                        }
                        (_, Some(_)) => {
                            return Err(Fault::new(
                                place,
                                "it occurs twice",
                                "every region must have at most one set of files",
                            ));
                        }
                    };
                    let lens = lenses.iter().find(|(buffer, region, _)| *buffer == buffer_id && *region == id);
                    let read = self.region(
                        profile,
                        name.clone(),
                        (size_px, lens.map(|(_, _, lens)| lens)),
                        &region,
                        fileset.as_ref(),
                        archive,
                    )?;
                    regions.push(self.finished(read));
                }
                names.push(name);
            }
        }
        // Every set of files must belong to a region.
        if let Some(orphan) =
            filesets.iter().find(|set| set.attribute("region").is_none_or(|region| !ids.contains(region)))
        {
            let region = orphan.attribute("region").unwrap_or_default();
            let problem = format!("region `{}` does not exist in any buffer", region.escape_debug());
            return Err(Fault::new(
                &orphan.place,
                problem,
                format!("must be one of {}", names.join(", ").escape_debug()),
            ));
        }
        if regions.is_empty() {
            let wanted = self.options.region.as_deref().unwrap_or("any");
            let allowed = format!("must be one of {}", names.join(", ").escape_debug());
            return Err(Fault::new("<display>", format!("no region `{}`", wanted.escape_debug()), allowed));
        }
        Ok(regions)
    }

    /// Returns the profile. Also checks the version and the levels.
    fn profile(&mut self, root: &Element) -> Result<Profile, Fault> {
        if !root.node.tag_name().name().eq_ignore_ascii_case("mpcdi") {
            return Err(Fault::new(&root.place, "this is not the root of an MPCDI set", "the root must be <MPCDI>"));
        }
        let version = root.needed_attribute("version")?;
        let major = version.split('.').next().unwrap_or_default();
        let levels: &[(&str, f64)] = match major {
            "1" => &[("level", 4.0)],
            "2" => &[("geometry", 2.0), ("color", 5.0)],
            _ => {
                let problem = format!("version `{}`", version.escape_debug());
                return Err(Fault::new(&root.place, problem, "must be version 1 or 2"));
            }
        };
        for (name, most) in levels {
            if let Some(level) = root.attribute_number(name)?
                && !(level.fract() == 0.0 && (1.0..=*most).contains(&level))
            {
                let allowed = format!("must be an integer from 1 to {most} in version {major}");
                return Err(Fault::new(&root.place, format!("{name} = {level}"), allowed));
            }
        }
        let written = root.needed_attribute("profile")?;
        let profile = match written.to_ascii_lowercase().as_str() {
            "2d" => Profile::Frustum("2d"),
            "3d" => Profile::Frustum("3d"),
            "a3" => Profile::Points("a3"),
            "sl" => Profile::Points("sl"),
            _ => {
                let problem = format!("profile `{}`", written.escape_debug());
                return Err(Fault::new(&root.place, problem, "must be one of 2d, 3d, a3 and sl"));
            }
        };
        let (Profile::Frustum(name) | Profile::Points(name)) = profile;
        self.note(format!("MPCDI {version}, profile {name}"));
        Ok(profile)
    }

    /// Returns the size of a region in pixels, which must match its share of the buffer.
    fn region_size(&self, buffer: &Element, region: &Element) -> Result<[u32; 2], Fault> {
        let pixels = |element: &Element, name: &str| -> Result<Option<f64>, Fault> {
            let Some(count) = element.attribute_number(name)? else { return Ok(None) };
            if count.fract() != 0.0 || !(1.0..=65536.0).contains(&count) {
                let place = format!("{} {name}", element.place);
                return Err(Fault::new(place, format!("{count}"), "must be a number of pixels"));
            }
            Ok(Some(count))
        };
        let mut size = [0; 2];
        let mut known = true;
        for (axis, (resolution, (start, share))) in
            [("xResolution", ("x", "xsize")), ("yResolution", ("y", "ysize"))].into_iter().enumerate()
        {
            let start = region.attribute_number(start)?.unwrap_or(0.0);
            let share = region.attribute_number(share)?.unwrap_or(1.0);
            if !(share > 0.0 && start >= -1e-6 && start + share <= 1.0 + 1e-6) {
                let problem = format!("it extends from {start} to {} of its buffer", start + share);
                return Err(Fault::new(&region.place, problem, "a region must lie between 0 and 1 of its buffer"));
            }
            let in_buffer = pixels(buffer, resolution)?.map(|pixels| pixels * share);
            match (pixels(region, resolution)?, in_buffer) {
                (Some(own), Some(shared)) if (own - shared).abs() > 1.0 => {
                    let problem = format!("{resolution} = {own}, but its share of the buffer is {shared}");
                    return Err(Fault::new(&region.place, problem, "the two must agree within a pixel"));
                }
                (Some(own), _) => size[axis] = own as u32,
                (None, Some(shared)) => size[axis] = shared.round() as u32,
                (None, None) => known = false,
            }
        }
        self.size_px(known.then_some(size), &region.place)
    }

    fn region(
        &mut self,
        profile: Profile,
        name: String,
        (size_px, lens): ([u32; 2], Option<&Element>),
        region: &Element,
        fileset: Option<&Element>,
        archive: &mut Archive,
    ) -> Result<Region, Fault> {
        let child = |name: &str| fileset.map_or(Ok(None), |fileset| named_file(fileset, name));
        if let Some(distortion) = child("distortionMap")? {
            return Err(Fault::refused(distortion.place, "a second map on top of the warp map is not supported"));
        }
        let warp = child("geometryWarpFile")?;
        let has_frustum = region.child("frustum")?.is_some();
        let needs_frustum = matches!(profile, Profile::Frustum(_)) || (warp.is_none() && has_frustum);
        if let Some(lens) = lens.filter(|_| needs_frustum) {
            return Err(Fault::refused(
                lens.place.clone(),
                "the extension describes the lens of the projector by coefficients whose unit differs between programs, and the region has no points of the screen; export a warp map of the profile a3 or sl",
            ));
        }
        let (grid, border, screen) = match (profile, &warp) {
            (Profile::Points(_), None) if !has_frustum => {
                let problem = "<geometryWarpFile> is missing";
                let allowed =
                    "with the profiles a3 and sl, there must be points there, or the region must have a frustum";
                return Err(Fault::new(fileset.map_or(&region.place, |set| &set.place), problem, allowed));
            }
            (_, None) => {
                self.note(format!("region {name}: no warp map, so the raster is the picture of its frustum"));
                let content = frustum_with_axes(&region.needed("frustum")?, self)?;
                let columns_rows = [65, 65];
                self.take_grid(columns_rows[0], columns_rows[1], &region.place)?;
                let Warped { grid, border, .. } = sampled(&content, columns_rows);
                (grid, border, None)
            }
            (_, Some(warp)) => {
                let geometry = match profile {
                    Profile::Frustum(_) => {
                        self.note(
                            "coordinates in the picture: u from 0 (left) to 1 (right), v from 0 (bottom) to 1 (top), as in an OpenGL texture look-up",
                        );
                        self.note(
                            "frustum: yaw to the right, then pitch upwards, then roll clockwise as seen from behind",
                        );
                        let frustum = region.needed("frustum").map_err(|_| {
                            let problem = "<frustum> is missing, so its coordinates have no directions";
                            Fault::new(
                                &region.place,
                                problem,
                                "a region must have the frustum of its picture, or points of the screen (a3, sl)",
                            )
                        })?;
                        Geometry::Picture(frustum_with_axes(&frustum, self)?)
                    }
                    Profile::Points(_) => self.points(region, warp)?,
                };
                self.warp(&geometry, warp, archive)?
            }
        };
        let (alpha, beta, lut) = match fileset {
            None => (None, None, None),
            Some(fileset) => (
                self.mask("alphaMap", size_px, fileset, archive)?,
                self.mask("betaMap", size_px, fileset, archive)?,
                self.table(&name, fileset, archive)?,
            ),
        };
        Ok(Region { border, alpha, beta, lut, screen, ..Region::of_grid(name, size_px, grid) })
    }

    /// Returns the eye point, origin and axes of the points of `a3` and `sl`.
    fn points(&mut self, region: &Element, warp: &Element) -> Result<Geometry, Fault> {
        // Unit of the points, and the eye in this unit.
        let unit = word(warp, "geometricUnit")?;
        let metres = match unit.as_deref() {
            Some("mm") => Some(1e-3),
            Some("cm") => Some(1e-2),
            Some("dm") => Some(0.1),
            Some("m") => Some(1.0),
            Some("in") => Some(0.0254),
            Some("ft") => Some(0.3048),
            Some("yd") => Some(0.9144),
            Some("unknown") => None,
            None => {
                self.note("points: no unit is specified, metres are assumed");
                Some(1.0)
            }
            Some(other) => {
                let problem = format!("geometricUnit `{}`", other.escape_debug());
                return Err(Fault::new(&warp.place, problem, "must be one of mm, cm, dm, m, in, ft, yd and unknown"));
            }
        };
        let eye_m = self.options.eye_m;
        let eye = match metres {
            Some(metres) => eye_m / metres,
            None if eye_m == DVec3::ZERO => DVec3::ZERO,
            None => {
                return Err(Fault::new(
                    &warp.place,
                    "the unit of the points is unknown, but the eye is specified in metres",
                    "the unit must be specified, or the eye must be at the origin",
                ));
            }
        };
        // Origin of the points, to which the position of the eye is relative.
        let origin = warp.child_text("originOf3DData")?;
        match word(warp, "originOf3DData")?.as_deref() {
            Some("idealeyepoint") => {}
            Some("centerofmass" | "floorcenter" | "unknown") | None => self.note(format!(
                "the origin of the points is {}: the eye is at {} m from it (right, up, backwards), from the options",
                origin.as_deref().unwrap_or("not specified"),
                shown(eye_m.to_array())
            )),
            Some(other) => {
                let problem = format!("originOf3DData `{}`", other.escape_debug());
                let allowed = "must be one of centerOfMass, idealEyePoint, floorCenter and unknown";
                return Err(Fault::new(&warp.place, problem, allowed));
            }
        }
        if let Some(unit) = unit {
            self.note(format!("points in the unit {unit}"));
        }
        (self.uses.eye, self.uses.axes) = (true, true);
        // Axes and origin come from the options, otherwise from the coordinate frame, otherwise they have default values.
        let frame = region.child("coordinateFrame")?;
        let position = match &frame {
            Some(frame) => vector(frame, "pos")?,
            None => DVec3::ZERO,
        };
        let dome_from_file = match (&self.options.axes, &frame) {
            (Axes::Map(matrix), _) => {
                let matrix = *matrix;
                self.note(format!("axes of the points: {}", self.options.axes.describe("")));
                matrix
            }
            (Axes::AsFormat, Some(frame)) => {
                self.note(
                    "axes of the points: those of coordinateFrame (pitch axis = right, yaw axis = down, roll axis = forward), whose position is \
                     the origin",
                );
                frame_axes(frame)?
            }
            (Axes::AsFormat, None) => {
                self.note("axes of the points: +x right, +y up, -z forward; there is no coordinateFrame");
                DMat3::IDENTITY
            }
        };
        // If the unit of the points is unknown, the size of the screen is also unknown.
        Ok(Geometry::Points { dome_from_file, origin: position, eye, metres: metres.unwrap_or(1.0) })
    }

    /// Returns the warp map as directions, and the screen points from which they were computed.
    fn warp(
        &mut self,
        geometry: &Geometry,
        warp: &Element,
        archive: &mut Archive,
    ) -> Result<(Grid, Option<Border>, Option<ScreenSums>), Fault> {
        // Interpolation between samples.
        let interpolation = match word(warp, "interpolation")?.as_deref() {
            Some("linear") => Interpolation::Linear,
            Some("smooth" | "unknown" | "") | None => Interpolation::Smooth,
            Some("keystone") => {
                let reason = "interpolation `keystone` is not supported; only linear, smooth and unknown are";
                return Err(Fault::refused(&warp.place, reason));
            }
            Some(other) => {
                let problem = format!("interpolation `{}`", other.escape_debug());
                return Err(Fault::new(&warp.place, problem, "must be one of linear, smooth and unknown"));
            }
        };
        // Decode the map.
        let path = warp.needed("path")?.text();
        let place = format!("entry `{}`", path.escape_debug());
        let bytes = self.entry(&path, archive)?;
        let plane = pfm::decode(&bytes).map_err(|fault| fault.within(&place))?;
        drop(bytes);
        let (columns, rows) = (plane.width, plane.height);
        self.take_grid(columns, rows, &place)?;
        let order = self.rows(RowOrder::BottomFirst, "PFM (Netpbm)");
        self.note("samples of the warp map are at the centres of cells that fill the raster");
        // Convert each sample to a direction.
        let mut samples = Vec::with_capacity(columns * rows);
        let mut places = Vec::new();
        let mut screen = ScreenSums::default();
        // A map shows each point only once, so samples with zeros are unknown samples if there are several.
        let zeros = plane.top_down(order).filter(|(_, _, value)| no_value(value)).count();
        if zeros > 1 {
            self.note(format!("{place}: {zeros} of {} samples are zeros: they are treated as unknown", columns * rows));
        }
        for (column, row, value) in plane.top_down(order) {
            let here = |problem: String, allowed: &str| {
                Err(Fault::new(
                    format!("{place}: column {column} of row {row} (from the top, from 0)"),
                    problem,
                    allowed,
                ))
            };
            if zeros > 1 && no_value(&value) {
                match geometry {
                    Geometry::Picture(_) => places.push(None),
                    Geometry::Points { .. } => samples.push(None),
                }
                continue;
            }
            let coordinates = value.map(f64::from);
            match geometry {
                Geometry::Picture(_) => {
                    let [u, v, error] = coordinates;
                    if u.is_nan() || v.is_nan() || error == 1.0 {
                        places.push(None);
                    } else if !(u.is_finite() && v.is_finite()) || !(error.is_nan() || (0.0..=1.0).contains(&error)) {
                        let allowed =
                            "must be finite coordinates and an error from 0 to 1 (or NaN); NaN for unknown samples";
                        return here(format!("[{u}, {v}, {error}]"), allowed);
                    } else {
                        places.push(Some(DVec2::new(u, v)));
                    }
                }
                Geometry::Points { dome_from_file, origin, eye, metres } => {
                    let point = DVec3::from_array(coordinates);
                    if point.is_nan() {
                        samples.push(None);
                    } else if !point.is_finite() {
                        return here(format!("{point}"), "must be finite points; NaN for unknown samples");
                    } else {
                        let from_eye = *dome_from_file * (point - *origin) - *eye;
                        let Some(direction) = from_eye.try_normalize() else {
                            return here(format!("{point} is the eye point"), "must be points of the screen");
                        };
                        screen.add(from_eye * *metres);
                        samples.push(Some(direction));
                    }
                }
            }
        }
        let grid = |samples| Grid { columns, rows, samples, placement: Placement::Centres, interpolation };
        let Geometry::Picture(content) = geometry else { return Ok((grid(samples), None, Some(screen))) };
        // Refuse maps whose coordinates lie mostly outside of the picture: offsets or pixels.
        let known = places.iter().flatten().count();
        let found = placed(content, places, columns, interpolation == Interpolation::Smooth);
        if found.outside * 2 > known {
            return Err(Fault::new(
                place,
                format!("{} of {known} coordinates lie outside of 0 to 1", found.outside),
                "must be absolute coordinates in the picture, not offsets or pixels",
            ));
        }
        self.note_edge(&place, "coordinates", known, &found);
        let Placed { samples, border, .. } = found;
        Ok((grid(samples), border, None))
    }
}

/// Returns the buffer, region and element of each lens in the extension `BufferExtension`, except planar lenses with square pixels.
fn lenses<'a, 'input>(root: &Element<'a, 'input>) -> Result<Vec<(&'a str, &'a str, Element<'a, 'input>)>, Fault> {
    let mut found = Vec::new();
    for set in root.children("extensionSet") {
        let named = |extension: &Element| extension.attribute("name") == Some("BufferExtension");
        for buffer in set.children("extension").filter(named).flat_map(|extension| extension.children("buffer")) {
            for region in buffer.children("region") {
                for kind in ["fisheye", "anamorphic"] {
                    if let Some(lens) = region.child(kind)? {
                        found.push((buffer.needed_attribute("id")?, region.needed_attribute("id")?, lens));
                    }
                }
            }
        }
    }
    Ok(found)
}

/// Reads one of several words, in lower case. Scalable's library misspells one of the words.
fn word(element: &Element, name: &str) -> Result<Option<String>, Fault> {
    Ok(element.child_word(name)?.map(|word| if word == "unkown" { "unknown".to_owned() } else { word }))
}

/// Returns whether a sample has zeros instead of a position.
fn no_value(value: &[f32; 3]) -> bool {
    *value == [0.0; 3]
}

/// Reads three numbers from elements whose names end with x, y and z.
fn vector(element: &Element, stem: &str) -> Result<DVec3, Fault> {
    let part = |axis: &str| element.number(&format!("{stem}{axis}"));
    Ok(DVec3::new(part("x")?, part("y")?, part("z")?))
}

/// Returns the picture of a frustum in the axes of the frustum.
fn frustum(element: &Element) -> Result<Content, Fault> {
    let degrees = |name: &str| Ok(element.number(name)?.to_radians());
    let rotation = yaw_pitch_roll(degrees("yaw")?, degrees("pitch")?, degrees("roll")?);
    Content::frustum(
        degrees("leftAngle")?,
        degrees("rightAngle")?,
        degrees("downAngle")?,
        degrees("upAngle")?,
        rotation,
    )
    .map_err(|fault| fault.within(&element.place))
}

/// Returns the picture of a frustum in dome axes.
fn frustum_with_axes(element: &Element, reader: &mut Reader) -> Result<Content, Fault> {
    let content = frustum(element)?;
    reader.uses.axes = true;
    let axes = &reader.options.axes;
    if let Axes::Map(matrix) = axes
        && let Content::Plane { lower_left, right, up } = content
    {
        let (matrix, note) = (*matrix, format!("axes of the frustum: {}", axes.describe("")));
        reader.note(note);
        return Ok(Content::Plane { lower_left: matrix * lower_left, right: matrix * right, up: matrix * up });
    }
    Ok(content)
}

/// Rotation from the axes of the file to dome axes.
fn frame_axes(frame: &Element) -> Result<DMat3, Fault> {
    let (down, right, forward) = (vector(frame, "yaw")?, vector(frame, "pitch")?, vector(frame, "roll")?);
    let axes = DMat3::from_cols(right, -down, -forward);
    let product = axes * axes.transpose();
    if !product.abs_diff_eq(DMat3::IDENTITY, AXES_WITHIN) || axes.determinant() < 0.0 {
        return Err(Fault::new(
            &frame.place,
            format!("axes yaw {down}, pitch {right}, roll {forward}"),
            "must be three orthogonal unit vectors with roll x pitch = yaw, where yaw points down",
        ));
    }
    Ok(axes.transpose())
}
