//! What installers of projectors deliver: for each projector the direction that every point of its raster shows, blend masks and look-up tables.
//!
//! [`read`] tells the formats apart by their first bytes: MPCDI sets, SGCT configurations, meshes of several programs, directions as PFM or
//! OpenEXR. All become a [`Calibration`]: per region a [`Grid`] of unit vectors in the axes of the dome (+x right, +y towards the zenith of
//! the screen, -z forward). Where a format leaves something open, one reading is chosen, `docs/projectors.md` tells which, and it
//! stands in [`Calibration::notes`]. What contradicts itself is an error. Angles are radians but for the fields named `_deg`.
//!
//! Every size is bounded: files, entries of archives, grids, masks, and the work that a mesh may cause.

mod archive;
pub mod check;
mod content;
mod exr_file;
mod fault;
mod lut;
mod mask;
mod mesh;
mod mesh_files;
mod mpcdi;
mod options;
mod pfm;
mod screen;
mod sgct;
mod xml;

use std::path::{Path, PathBuf};

use glam::DVec3;

use self::{content::Content, fault::Fault};
pub use self::{
    lut::{Lut, LutKind, read_lut},
    mask::{Mask, read_mask},
    options::{Axes, ReadOptions, RowOrder},
    screen::{ScreenSums, Sphere},
};
use crate::files;
/// Directions in axes of the dome: +x right, +y up (zenith side of the screen), -z forward.
pub use crate::view::projection::DirectionGrid as Grid;
pub use crate::view::projection::{Interpolation, Placement};

/// Bytes of a file, at most.
const MOST_BYTES: u64 = 1 << 30;
/// Columns or rows of a grid, at most.
pub const MOST_SIDE: usize = crate::view::projection::MOST_SAMPLES;
/// Samples of all grids of a calibration together, at most.
const MOST_SAMPLES: usize = MOST_SIDE * MOST_SIDE;
/// Values of all masks of a calibration together, at most.
const MOST_MASK_VALUES: usize = 1 << 28;
/// Regions of a calibration, at most.
const MOST_REGIONS: usize = 256;
/// Width or height of a raster, pixels, at most.
const MOST_RASTER_PX: u32 = 16384;

/// What one projector, or one part of its raster, shows.
#[derive(Clone, Debug, PartialEq)]
pub struct Region {
    /// `buffer/region` of MPCDI, `node/window/viewport` of SGCT (counted from 0), else the file's name without its extension.
    pub name: String,
    /// Width and height of its raster, pixels.
    pub size_px: [u32; 2],
    /// Where its pixels lie.
    pub grid: Grid,
    /// Factor on the light.
    pub alpha: Option<Mask>,
    /// Black level: the light shown is `L * alpha * (1 - beta) + beta`, as shares of the projector's white.
    pub beta: Option<Mask>,
    /// Correction of colours.
    pub lut: Option<Lut>,
    /// The points of the screen, in the grid's axes, where the file has points.
    pub screen: Option<ScreenSums>,
}

/// What a file or set of files tells of projectors.
#[derive(Clone, Debug, PartialEq)]
pub struct Calibration {
    /// Name of the format.
    pub format: &'static str,
    /// At least one.
    pub regions: Vec<Region>,
    /// Every assumption that was made, in words: axes, order of rows, units, eye point.
    pub notes: Vec<String>,
}

/// Why a calibration cannot be read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TheatreError {
    /// The system does not let it be read, or it is too large.
    #[error("cannot read {}: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// Something in it is damaged, contradicts itself or is not known.
    #[error("{}: {place}: {problem}; {allowed}", path.display())]
    Content {
        /// The file.
        path: PathBuf,
        /// Entry and field.
        place: String,
        /// What is wrong.
        problem: String,
        /// What is allowed.
        allowed: String,
    },
    /// A format, or a part of one, that cannot be read truthfully.
    #[error("{}: {what} is refused: {reason}", path.display())]
    Refused {
        /// The file.
        path: PathBuf,
        /// What.
        what: String,
        /// Why, and what to do instead.
        reason: String,
    },
}

/// What one call of [`read`] has, besides the bytes.
pub(crate) struct Reader<'a> {
    /// The file.
    path: &'a Path,
    /// What the caller asks for.
    options: &'a ReadOptions,
    notes: Vec<String>,
    samples_left: usize,
    mask_values_left: usize,
}

impl<'a> Reader<'a> {
    fn new(path: &'a Path, options: &'a ReadOptions) -> Self {
        Self { path, options, notes: Vec::new(), samples_left: MOST_SAMPLES, mask_values_left: MOST_MASK_VALUES }
    }

    /// Keeps an assumption, once.
    fn note(&mut self, text: impl Into<String>) {
        let text = text.into();
        if !self.notes.contains(&text) {
            self.notes.push(text);
        }
    }

    /// Checks the size of a grid, and that all grids together are not too large.
    fn take_grid(&mut self, columns: usize, rows: usize, place: &str) -> Result<(), Fault> {
        let allowed =
            || format!("a grid has 2 to {MOST_SIDE} columns and rows, all grids together {MOST_SAMPLES} samples");
        if !(2..=MOST_SIDE).contains(&columns) || !(2..=MOST_SIDE).contains(&rows) {
            return Err(Fault::new(place, format!("a grid of {columns} x {rows}"), allowed()));
        }
        self.samples_left = self
            .samples_left
            .checked_sub(columns * rows)
            .ok_or_else(|| Fault::new(place, "all grids together are too large", allowed()))?;
        Ok(())
    }

    /// The same for the values of a mask.
    fn take_mask(&mut self, width: u32, height: u32, place: &str) -> Result<(), Fault> {
        let values = u64::from(width) * u64::from(height);
        self.mask_values_left = usize::try_from(values)
            .ok()
            .and_then(|values| self.mask_values_left.checked_sub(values))
            .ok_or_else(|| {
                let allowed = format!("all masks together have at most {MOST_MASK_VALUES} pixels");
                Fault::new(place, format!("a mask of {width} x {height} pixels is too much"), allowed)
            })?;
        Ok(())
    }

    /// The raster's size: the one of the file, if it has one, else the caller's.
    fn size_px(&self, of_file: Option<[u32; 2]>, place: &str) -> Result<[u32; 2], Fault> {
        let size = match (of_file, self.options.size_px) {
            (Some(size), Some(asked)) if size != asked => {
                let [[w, h], [asked_w, asked_h]] = [size, asked];
                return Err(Fault::new(
                    place,
                    format!("the raster has {w} x {h} pixels in the file and {asked_w} x {asked_h} in the options"),
                    "leave the size out, or give the file's",
                ));
            }
            (Some(size), _) | (None, Some(size)) => size,
            (None, None) => {
                return Err(Fault::new(place, "the file does not tell the raster's size", "give size_px"));
            }
        };
        if size.iter().any(|side| !(1..=MOST_RASTER_PX).contains(side)) {
            let allowed = format!("1 to {MOST_RASTER_PX} pixels each way");
            return Err(Fault::new(place, format!("a raster of {} x {} pixels", size[0], size[1]), allowed));
        }
        Ok(size)
    }

    /// The content of meshes that have but coordinates in a picture: a fisheye of the caller's field of view.
    fn fisheye(&mut self) -> Result<Content, Fault> {
        let ReadOptions { fov_deg, tilt_deg, .. } = *self.options;
        self.note(format!(
            "content: equidistant fisheye of {fov_deg} degrees in the whole square, centre = apex of the dome tilted by {tilt_deg} degrees to \
             the front, bottom of the picture = front, as in a domemaster"
        ));
        Content::fisheye(fov_deg.to_radians(), tilt_deg.to_radians(), [1.0, 1.0])
    }

    /// Name of the only region of a file.
    fn stem(&self) -> String {
        self.path.file_stem().map_or_else(|| "region".to_owned(), |stem| stem.to_string_lossy().into_owned())
    }

    /// Whether the caller wants a region of this name, or this short name.
    fn wants(&self, name: &str, short: &str) -> bool {
        self.options.region.as_deref().is_none_or(|wanted| wanted == name || wanted == short)
    }

    /// A note on how the directions of a grid turn: an order of rows or an axis that is not as assumed shows here first.
    fn note_orientation(&mut self, name: &str, grid: &Grid) {
        let [right_way, mirrored] = upright_and_mirrored_cells(grid);
        if mirrored > right_way {
            self.note(format!(
                "region {name}: seen from the eye the raster is mirrored in {mirrored} of {} cells: rows or an axis may run the other way",
                right_way + mirrored
            ));
        }
    }
}

/// Numbers of cells that are seen upright from the eye (rows to the right, columns down), and of mirrored cells.
pub fn upright_and_mirrored_cells(grid: &Grid) -> [usize; 2] {
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
            if turn != 0.0 {
                counts[usize::from(turn < 0.0)] += 1;
            }
        }
    }
    counts
}

/// Reads a calibration. The format is told by the file's content; where it names further files, they are looked for beside it.
///
/// # Errors
///
/// See [`TheatreError`]: every message names the file, the entry and field, and what is allowed.
pub fn read(path: &Path, options: &ReadOptions) -> Result<Calibration, TheatreError> {
    let named = |fault: Fault| fault.of_file(path);
    options.check().map_err(named)?;
    let bytes =
        files::read_bounded(path, MOST_BYTES).map_err(|source| TheatreError::Read { path: path.to_owned(), source })?;
    let mut reader = Reader::new(path, options);
    let (format, regions) = reader.regions(&bytes).map_err(named)?;
    for region in &regions {
        if region.grid.samples.iter().all(Option::is_none) {
            let fault =
                Fault::new(&region.name, "no point of the raster has a direction", "at least one must be known");
            return Err(named(fault));
        }
        reader.note_orientation(&region.name, &region.grid);
    }
    Ok(Calibration { format, regions, notes: reader.notes })
}

const KNOWN: &str = "known are MPCDI (.mpcdi), SGCT configurations (JSON), meshes (Paul Bourke's .data, .sgc, OBJ, CSV), and directions \
                     as PFM or OpenEXR";

/// Why two formats of projectors' sets are not read: by the extension, or by the first bytes.
fn refused(path: &Path, bytes: &[u8]) -> Option<(&'static str, &'static str)> {
    let extension = path.extension().map(|extension| extension.to_string_lossy().to_lowercase());
    let is = |wanted: &str| extension.as_deref() == Some(wanted);
    if bytes.starts_with(b"vwf0") || bytes.starts_with(b"vwf1") || is("vwf") {
        Some((
            "a VIOSO warp file (VWF)",
            "those of OEM builds open in the OEM's software alone; export MPCDI 2, or the map and the blend picture apart",
        ))
    } else if is("pol") || is("ol") {
        Some((
            "an EasyBlend file (.pol, .ol)",
            "it takes a closed SDK to read it; export MPCDI from the alignment software",
        ))
    } else {
        None
    }
}

impl Reader<'_> {
    fn regions(&mut self, bytes: &[u8]) -> Result<(&'static str, Vec<Region>), Fault> {
        let text_start = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes).trim_ascii_start();
        if bytes.starts_with(b"PK") {
            return Ok(("MPCDI", self.mpcdi(bytes)?));
        }
        if pfm::is_pfm(bytes) {
            return Ok(("PFM of directions", vec![self.directions(pfm::decode(bytes)?, RowOrder::BottomFirst)?]));
        }
        if exr_file::is_exr(bytes) {
            return Ok(("OpenEXR of directions", vec![self.directions(exr_file::decode(bytes)?, RowOrder::TopFirst)?]));
        }
        if let Some((what, reason)) = refused(self.path, bytes) {
            return Err(Fault::refused(what, reason));
        }
        if text_start.starts_with(b"{") {
            return Ok(("SGCT", self.sgct(bytes)?));
        }
        if text_start.starts_with(b"<") {
            let problem = "XML outside of a set";
            return Err(Fault::new(
                "content",
                problem,
                "of MPCDI the whole .mpcdi file is read, with the files that it names",
            ));
        }
        if lut::is_cube(bytes) {
            return Err(Fault::refused(
                "a look-up table alone (.cube)",
                "it tells colours and no directions; give it beside a calibration",
            ));
        }
        let Some(kind) = mesh_files::kind(bytes) else {
            return Err(Fault::new("content", "no known format by its first bytes", KNOWN));
        };
        let region = self.plain_mesh(kind, bytes)?;
        Ok((kind.name(), vec![region]))
    }

    /// A picture of unit vectors.
    fn directions(&mut self, plane: pfm::Plane, of_format: RowOrder) -> Result<Region, Fault> {
        let place = "samples";
        self.take_grid(plane.width, plane.height, place)?;
        let of_file = [plane.width as u32, plane.height as u32];
        let size_px = self.options.size_px.unwrap_or(of_file);
        let size_px = self.size_px(Some(size_px), place)?;
        if self.options.size_px.is_none() {
            self.note("the raster is taken for as large as the picture of directions");
        }
        let order = self.rows(of_format, "the picture of directions");
        let axes = self.options.axes.clone();
        self.note(format!(
            "directions are unit vectors from the eye, samples are centres of cells; axes: {}",
            axes.describe("+x right, +y up, -z forward")
        ));
        let matrix = axes.dome_from_file();
        let mut samples = Vec::with_capacity(plane.width * plane.height);
        for (column, row, value) in plane.top_down(order) {
            let here = || format!("column {column} of row {row} (from the top, from 0)");
            let vector = DVec3::from_array(value.map(f64::from));
            if vector.is_nan() {
                samples.push(None);
                continue;
            }
            let length = vector.length();
            // Three halves are good to 5e-4.
            if !length.is_finite() || (length - 1.0).abs() >= 2e-3 {
                return Err(Fault::new(
                    here(),
                    format!("[{}, {}, {}] has the length {length}", value[0], value[1], value[2]),
                    "a direction is a unit vector, or NaN where no light is sent",
                ));
            }
            samples.push(Some(matrix * (vector / length)));
        }
        let grid = Grid {
            columns: plane.width,
            rows: plane.height,
            samples,
            placement: Placement::Centres,
            interpolation: Interpolation::Smooth,
        };
        Ok(Region { name: self.stem(), size_px, grid, alpha: None, beta: None, lut: None, screen: None })
    }

    /// The order of rows, noted.
    fn rows(&mut self, of_format: RowOrder, of: &str) -> RowOrder {
        let (order, why) = match self.options.rows {
            RowOrder::AsFormat => (of_format, "as the format says"),
            asked => (asked, "as asked for"),
        };
        let first = if order == RowOrder::TopFirst { "top" } else { "bottom" };
        self.note(format!("rows of {of}: the {first} one comes first, {why}"));
        order
    }
}
