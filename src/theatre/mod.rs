//! Calibrations of projector installations. For each projector, they give the direction that every point of its raster
//! shows, blend masks and look-up tables.
//!
//! [`read`] recognises the format by the first bytes: MPCDI sets, SGCT configurations, meshes of several programs,
//! directions as PFM or OpenEXR. All become a [`Calibration`]: for each region a [`Grid`] of unit vectors in dome axes
//! (+x right, +y towards the zenith of the screen, -z forward). If a format leaves something undefined, one
//! interpretation is chosen. It is documented in `docs/projectors.md` and recorded in [`Calibration::notes`].
//! Contradictions are errors. Angles are in radians, except in fields named `_deg`.
//!
//! All sizes are limited: those of files, archive entries, grids and masks, and the work that a mesh may cause.

mod archive;
pub mod check;
mod content;
mod edge;
mod exr_file;
mod fault;
mod json;
mod lut;
mod mask;
mod mesh;
mod mesh_files;
mod mesh_text;
mod mpcdi;
mod mpcdi_files;
mod mpcdi_names;
mod names;
mod options;
mod pfm;
mod screen;
mod sgct;
mod sgct_keys;
mod sgct_projection;
mod sgct_users;
mod unlit;
mod xml;

use std::path::{Path, PathBuf};

use glam::DVec3;

#[cfg(feature = "cli")]
pub(crate) use self::names::plain as plain_name;
use self::{
    content::Content,
    fault::{Fault, rounded, shown},
};
pub use self::{
    lut::{Lut, LutKind, read_lut},
    mask::{Mask, read_mask},
    options::{Axes, ReadOptions, RowOrder, Uses},
    screen::{ScreenSums, Sphere},
};
/// Directions in dome axes: +x right, +y up (zenith side of the screen), -z forward.
pub use crate::view::projection::DirectionGrid as Grid;
pub use crate::view::projection::{Border, Interpolation, Placement};
use crate::{
    files,
    view::projection::{Warp, WarpError},
};

/// Maximum size of a file, bytes.
const MOST_BYTES: u64 = 1 << 30;
/// Maximum number of columns or rows of a grid.
pub const MOST_SIDE: usize = crate::view::projection::MOST_SAMPLES;
/// Maximum number of samples of all grids of a calibration together.
const MOST_SAMPLES: usize = MOST_SIDE * MOST_SIDE;
/// Maximum number of values of all masks of a calibration together.
const MOST_MASK_VALUES: usize = 1 << 28;
/// Maximum number of regions of a calibration.
const MOST_REGIONS: usize = 256;
/// Minimum and maximum width or height of a raster, pixels. Directions cannot be interpolated across a single pixel.
const RASTER_PX: std::ops::RangeInclusive<u32> = 2..=16384;

/// Calibration of one projector, or of one part of its raster.
#[derive(Clone, Debug, PartialEq)]
pub struct Region {
    /// `buffer/region` in MPCDI, `node/window/viewport` in SGCT (counted from 0), otherwise the file name without its
    /// extension.
    pub name: String,
    /// The name that the file gives to its window, if any. If a view of a configuration cannot have this name, the title is a part of it or a
    /// different name.
    pub title: Option<String>,
    /// Width and height of its raster, pixels.
    pub size_px: [u32; 2],
    /// Directions of its pixels.
    pub grid: Grid,
    /// Where the content ends; `None` if it fills the grid. Pixels beyond the border are dark.
    pub border: Option<Border>,
    /// Factor on the light.
    pub alpha: Option<Mask>,
    /// Whether the programs for which the file is made multiply display codes. Alpha is then this factor to the power
    /// of [`DISPLAY_GAMMA`](crate::view::projector::DISPLAY_GAMMA).
    pub multiplies_codes: bool,
    /// Black level: the displayed light is `L * alpha * (1 - beta) + beta`, in units of the projector's white.
    pub beta: Option<Mask>,
    /// Colour correction.
    pub lut: Option<Lut>,
    /// The points of the screen, in the grid's axes, if the file contains them.
    pub screen: Option<ScreenSums>,
    /// The options that its directions depend on.
    pub uses: Uses,
}

impl Region {
    /// Returns a region that has directions and nothing else.
    fn of_grid(name: String, size_px: [u32; 2], grid: Grid) -> Self {
        Self {
            name,
            title: None,
            size_px,
            grid,
            border: None,
            alpha: None,
            multiplies_codes: false,
            beta: None,
            lut: None,
            screen: None,
            uses: Uses::default(),
        }
    }

    /// Returns the projection of its raster.
    ///
    /// # Errors
    ///
    /// The grid or its border is invalid.
    pub fn warp(&self) -> Result<Warp, WarpError> {
        Warp::within(self.size_px, &self.grid, self.border.as_ref())
    }

    /// Returns bytes that identify the projection of its raster: different projections have different bytes.
    pub fn identity(&self) -> Vec<u8> {
        let mut bytes = self.grid.identity(self.size_px);
        bytes.extend(self.border.iter().flat_map(Border::identity));
        bytes
    }
}

/// Contents of a calibration file or set of files.
#[derive(Clone, Debug, PartialEq)]
pub struct Calibration {
    /// Name of the format.
    pub format: &'static str,
    /// The regions; at least one.
    pub regions: Vec<Region>,
    /// All assumptions, in words: axes, order of rows, units, eye point.
    pub notes: Vec<String>,
}

/// Reasons why a calibration cannot be read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TheatreError {
    /// The file cannot be read, or it is too large.
    #[error("cannot read {}: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// The I/O error.
        source: std::io::Error,
    },
    /// Part of the file is damaged, contradictory or unknown.
    #[error("{}: {place}: {problem}; {allowed}", path.display())]
    Content {
        /// The file.
        path: PathBuf,
        /// Entry and field.
        place: String,
        /// The problem.
        problem: String,
        /// The valid values.
        allowed: String,
    },
    /// A format, or a part of one, that cannot be interpreted reliably.
    #[error("{}: {what} is refused: {reason}", path.display())]
    Refused {
        /// The file.
        path: PathBuf,
        /// The refused format or part.
        what: String,
        /// The reason, and an alternative.
        reason: String,
    },
}

/// State of a call of [`read`].
pub(crate) struct Reader<'a> {
    /// The file.
    path: &'a Path,
    /// Options of the caller.
    options: &'a ReadOptions,
    notes: Vec<String>,
    /// The options on which the current region depends.
    uses: Uses,
    samples_left: usize,
    mask_values_left: usize,
}

impl<'a> Reader<'a> {
    fn new(path: &'a Path, options: &'a ReadOptions) -> Self {
        Self {
            path,
            options,
            notes: Vec::new(),
            uses: Uses::default(),
            samples_left: MOST_SAMPLES,
            mask_values_left: MOST_MASK_VALUES,
        }
    }

    /// Records an assumption, unless it is already recorded.
    fn note(&mut self, text: impl Into<String>) {
        let text = text.into();
        if !self.notes.contains(&text) {
            self.notes.push(text);
        }
    }

    /// Returns a region that has been read, with the options that it depends on.
    fn finished(&mut self, region: Region) -> Region {
        Region { uses: std::mem::take(&mut self.uses), ..region }
    }

    /// Checks the size of a grid, and the total size of all grids.
    fn take_grid(&mut self, columns: usize, rows: usize, place: &str) -> Result<(), Fault> {
        let allowed = || {
            format!(
                "a grid must have 2 to {MOST_SIDE} columns and rows, and all grids together at most {MOST_SAMPLES} samples"
            )
        };
        if !(2..=MOST_SIDE).contains(&columns) || !(2..=MOST_SIDE).contains(&rows) {
            return Err(Fault::new(place, format!("a grid of {columns} x {rows}"), allowed()));
        }
        self.samples_left = self
            .samples_left
            .checked_sub(columns * rows)
            .ok_or_else(|| Fault::new(place, "all grids together are too large", allowed()))?;
        Ok(())
    }

    /// Checks the total size of all masks.
    fn take_mask(&mut self, width: u32, height: u32, place: &str) -> Result<(), Fault> {
        let values = u64::from(width) * u64::from(height);
        self.mask_values_left = usize::try_from(values)
            .ok()
            .and_then(|values| self.mask_values_left.checked_sub(values))
            .ok_or_else(|| {
                let allowed = format!("all masks together must have at most {MOST_MASK_VALUES} pixels");
                Fault::new(place, format!("a mask of {width} x {height} pixels is too large"), allowed)
            })?;
        Ok(())
    }

    /// Returns the size of the raster: that of the file if it has one, otherwise that of the options.
    fn size_px(&self, file_size: Option<[u32; 2]>, place: &str) -> Result<[u32; 2], Fault> {
        let size = match (file_size, self.options.size_px) {
            (Some(size), Some(asked)) if size != asked => {
                let [[w, h], [asked_w, asked_h]] = [size, asked];
                return Err(Fault::new(
                    place,
                    format!("the raster has {w} x {h} pixels in the file, but {asked_w} x {asked_h} in the options"),
                    "omit the size, or use that of the file",
                ));
            }
            (Some(size), _) | (None, Some(size)) => size,
            (None, None) => {
                return Err(Fault::new(
                    place,
                    "the file does not contain the size of the raster",
                    "give its width and height in pixels (`--size 1920x1080`, or `size = [1920, 1080]` in a configuration)",
                ));
            }
        };
        if size.iter().any(|side| !RASTER_PX.contains(side)) {
            let allowed = format!("must be {} to {} pixels per side", RASTER_PX.start(), RASTER_PX.end());
            return Err(Fault::new(place, format!("a raster of {} x {} pixels", size[0], size[1]), allowed));
        }
        Ok(size)
    }

    /// Returns the content of meshes that have only coordinates in a picture: a fisheye with the field of view from the
    /// options.
    fn fisheye(&mut self) -> Result<Content, Fault> {
        let ReadOptions { fov_deg, tilt_deg, .. } = *self.options;
        self.uses.fisheye = true;
        self.note(format!(
            "content: equidistant fisheye of {fov_deg} degrees filling the square, centre = apex of the dome tilted by {tilt_deg} degrees to \
             the front, bottom of the picture = front, as in a domemaster"
        ));
        Content::fisheye(fov_deg.to_radians(), tilt_deg.to_radians(), [1.0, 1.0])
    }

    /// Refuses options that no region of the file depends on.
    fn refuse_idle_options(&self, format: &str, regions: &[Region]) -> Result<(), Fault> {
        let is_used = |uses: fn(&Uses) -> bool| regions.iter().any(|region| uses(&region.uses));
        match self.options.idle(is_used) {
            None => Ok(()),
            Some((given, reason, allowed)) => {
                let problem = format!("{given} has no effect: the directions of this file ({format}) {reason}");
                Err(Fault::new("options", problem, allowed))
            }
        }
    }

    /// Returns the name of the only region of a file: the file name without its extension.
    fn stem(&self) -> String {
        self.path.file_stem().map_or_else(|| "region".to_owned(), |stem| stem.to_string_lossy().into_owned())
    }

    /// Returns whether the options select the region with this name or short name.
    fn wants(&self, name: &str, short: &str) -> bool {
        self.options.region.as_deref().is_none_or(|wanted| wanted == name || wanted == short)
    }

    /// Adds a note if the directions of a grid are mirrored, which indicates a wrong order of rows or a wrong axis.
    fn note_orientation(&mut self, region: &Region) {
        let name = &region.name;
        let is_shown = |sample: usize| {
            let holds = |border: &Border| border.places[sample].is_some_and(|place| border.shape.holds(place));
            region.border.as_ref().is_none_or(holds)
        };
        let [right_way, mirrored] = cells_by_side(&region.grid, is_shown);
        if mirrored > right_way {
            self.note(format!(
                "region {name}: as seen from the eye the raster is mirrored in {mirrored} of {} cells: the rows or an axis may be reversed",
                right_way + mirrored
            ));
        }
    }
}

/// Returns the numbers of upright and of mirrored cells, as seen from the eye. In upright cells, rows run to the right and columns run down.
pub fn upright_and_mirrored_cells(grid: &Grid) -> [usize; 2] {
    cells_by_side(grid, |_| true)
}

/// Returns the same numbers, but only for cells for whose upper left sample `is_counted` returns true.
fn cells_by_side(grid: &Grid, is_counted: impl Fn(usize) -> bool) -> [usize; 2] {
    let mut counts = [0; 2];
    for row in 1..grid.rows {
        for column in 1..grid.columns {
            let sample = |i: usize, j: usize| grid.samples[j * grid.columns + i];
            let (Some(here), Some(right), Some(low)) =
                (sample(column - 1, row - 1), sample(column, row - 1), sample(column - 1, row))
            else {
                continue;
            };
            let turn = (right - here).cross(low - here).dot(here);
            if turn != 0.0 && is_counted((row - 1) * grid.columns + column - 1) {
                counts[usize::from(turn < 0.0)] += 1;
            }
        }
    }
    counts
}

/// Reads a calibration. The format is recognised by the content; files that it refers to are searched next to it.
///
/// # Errors
///
/// See [`TheatreError`]: every message names the file, the entry and field, and the valid values.
pub fn read(path: &Path, options: &ReadOptions) -> Result<Calibration, TheatreError> {
    let named = |fault: Fault| fault.of_file(path);
    options.check().map_err(named)?;
    let bytes =
        files::read_bounded(path, MOST_BYTES).map_err(|source| TheatreError::Read { path: path.to_owned(), source })?;
    let mut reader = Reader::new(path, options);
    let (format, mut regions) = reader.regions(&bytes).map_err(named)?;
    for region in &regions {
        if region.grid.samples.iter().all(Option::is_none) {
            let fault =
                Fault::new(&region.name, "no point of the raster has a direction", "at least one must be known");
            return Err(named(fault));
        }
        reader.note_orientation(region);
    }
    reader.refuse_idle_options(format, &regions).map_err(named)?;
    reader.title(&mut regions);
    Ok(Calibration { format, regions, notes: reader.notes })
}

const KNOWN: &str = "must be one of MPCDI (.mpcdi), SGCT configurations (JSON), meshes (Paul Bourke's .data, .sgc, .ol, Sky-Skan's, OBJ, CSV), and directions \
                     as PFM or OpenEXR";

/// Explains why two projector formats are not supported; recognised by extension or first bytes.
fn refused(path: &Path, bytes: &[u8]) -> Option<(&'static str, &'static str)> {
    let extension = path.extension().map(|extension| extension.to_string_lossy().to_lowercase());
    let is = |wanted: &str| extension.as_deref() == Some(wanted);
    if bytes.starts_with(b"vwf0") || bytes.starts_with(b"vwf1") || is("vwf") {
        Some((
            "a VIOSO warp file (VWF)",
            "files of OEM builds can only be opened in the OEM's software; export MPCDI 2, or the map and the blend picture separately",
        ))
    } else if is("pol") {
        Some((
            "an EasyBlend file (.pol)",
            "reading it requires a closed SDK; export MPCDI or an OPENMESH (.ol) from the alignment software",
        ))
    } else {
        None
    }
}

/// Returns the reason why an XML document cannot be read by itself.
fn lone_xml(bytes: &[u8]) -> Fault {
    let document = match xml::parse(bytes) {
        Ok(document) => document,
        Err(fault) => return fault,
    };
    let root = document.root_element().tag_name().name().to_owned();
    match root.to_ascii_lowercase().as_str() {
        "cluster" => Fault::refused(
            "a configuration of SGCT in XML",
            "since version 3, SGCT itself reads only JSON; convert the file with SGCT's config-converter, and import the JSON",
        ),
        "geometryfile" => Fault::refused(
            "a lone SimCAD mesh",
            "it shifts the points of a picture and does not contain the field of view of that picture; name it as `mesh` of a viewport in a \
             configuration of SGCT (JSON), and import that",
        ),
        "mpcdi" => Fault::new(
            "content",
            "the description of an MPCDI set, without the rest of the set",
            "use the whole .mpcdi file, which includes the files that it refers to",
        ),
        _ => Fault::new("content", format!("XML with the root <{}>", root.escape_debug()), KNOWN),
    }
}

/// Returns the reason why text in another encoding, or JSON with comments, cannot be read.
fn other_text(bytes: &[u8]) -> Option<Fault> {
    let text_start = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes).trim_ascii_start();
    if bytes.starts_with(b"\xff\xfe") || bytes.starts_with(b"\xfe\xff") {
        return Some(Fault::new("content", "text in UTF-16", "must be text in UTF-8: save it in that encoding"));
    }
    if text_start.starts_with(b"//") || text_start.starts_with(b"/*") {
        let allowed = "JSON has no comments: remove those in the configuration of SGCT";
        return Some(Fault::new("content", "it begins with a comment (`//` or `/*`)", allowed));
    }
    None
}

impl Reader<'_> {
    fn regions(&mut self, bytes: &[u8]) -> Result<(&'static str, Vec<Region>), Fault> {
        let text_start = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes).trim_ascii_start();
        if text_start.is_empty() {
            let problem = if bytes.is_empty() { "the file is empty" } else { "the file contains only white space" };
            return Err(Fault::new("content", problem, KNOWN));
        }
        if bytes.starts_with(b"PK") {
            return Ok(("MPCDI", self.mpcdi(bytes)?));
        }
        if pfm::is_pfm(bytes) {
            let region = self.directions(pfm::decode(bytes)?, RowOrder::BottomFirst)?;
            return Ok(("PFM of directions", vec![self.finished(region)]));
        }
        if exr_file::is_exr(bytes) {
            let region = self.directions(exr_file::decode(bytes)?, RowOrder::TopFirst)?;
            return Ok(("OpenEXR of directions", vec![self.finished(region)]));
        }
        if let Some((what, reason)) = refused(self.path, bytes) {
            return Err(Fault::refused(what, reason));
        }
        if text_start.starts_with(b"{") {
            return Ok(("SGCT", self.sgct(bytes)?));
        }
        if text_start.starts_with(b"<") {
            return Err(lone_xml(bytes));
        }
        if let Some(fault) = other_text(bytes) {
            return Err(fault);
        }
        if lut::is_cube(bytes) {
            return Err(Fault::refused(
                "a look-up table (.cube) by itself",
                "it contains colours and no directions; use it together with a calibration",
            ));
        }
        let Some(kind) = mesh_files::kind(bytes) else {
            return Err(Fault::new("content", "the first bytes match no known format", KNOWN));
        };
        let region = self.plain_mesh(kind, bytes)?;
        Ok((kind.name(), vec![self.finished(region)]))
    }

    /// Reads a picture of unit vectors.
    fn directions(&mut self, plane: pfm::Plane, format_order: RowOrder) -> Result<Region, Fault> {
        let place = "samples";
        self.take_grid(plane.width, plane.height, place)?;
        let file_size = [plane.width as u32, plane.height as u32];
        let size_px = self.options.size_px.unwrap_or(file_size);
        let size_px = self.size_px(Some(size_px), place)?;
        if self.options.size_px.is_none() {
            self.note("the raster is assumed to be as large as the picture of directions");
        }
        let order = self.rows(format_order, "the picture of directions");
        let axes = self.options.axes.clone();
        self.note(format!(
            "directions are unit vectors from the eye, samples are at cell centres; axes: {}",
            axes.describe("+x right, +y up, -z forward")
        ));
        let matrix = axes.dome_from_file();
        self.uses.axes = true;
        let mut samples = Vec::with_capacity(plane.width * plane.height);
        let mut zeros = 0;
        for (column, row, value) in plane.top_down(order) {
            let here = || format!("column {column} of row {row} (from the top, from 0)");
            let vector = DVec3::from_array(value.map(f64::from));
            if vector.is_nan() || vector == DVec3::ZERO {
                zeros += usize::from(vector == DVec3::ZERO);
                samples.push(None);
                continue;
            }
            let length = vector.length();
            // The length of a vector of three half floats is accurate to 5e-4.
            if !length.is_finite() || (length - 1.0).abs() >= 2e-3 {
                return Err(Fault::new(
                    here(),
                    format!("{} has the length {}", shown(vector.to_array()), rounded(length)),
                    "a direction must be a unit vector, or NaN where no light is sent",
                ));
            }
            samples.push(Some(matrix * (vector / length)));
        }
        if zeros > 0 {
            self.note(format!("{zeros} of {} samples are zeros: they are treated as unknown", samples.len()));
        }
        let grid = Grid {
            columns: plane.width,
            rows: plane.height,
            samples,
            placement: Placement::Centres,
            interpolation: Interpolation::Smooth,
        };
        Ok(Region::of_grid(self.stem(), size_px, grid))
    }

    /// Returns the order of rows, and records it as a note.
    fn rows(&mut self, format_order: RowOrder, what: &str) -> RowOrder {
        self.uses.rows = true;
        let (order, why) = match self.options.rows {
            RowOrder::AsFormat => (format_order, "as the format specifies"),
            asked => (asked, "from the options"),
        };
        let first = if order == RowOrder::TopFirst { "top" } else { "bottom" };
        self.note(format!("rows of {what}: the {first} row comes first, {why}"));
        order
    }
}
