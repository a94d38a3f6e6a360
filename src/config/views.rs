//! `[[views]]`: one table per view, seven types.
//!
//! The keys `name`, `type`, `orientation`, `position_m`, `test_pattern`, `packing`, `exposure_group` and the tables `exposure`, `glare` and `tone_map`
//! are common; the others belong to the type, and a key of another type is unknown. Degrees end here: what comes out is the rig's [`View`] in radians.

use std::path::Path;

use glam::DQuat;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use toml::{Table, Value};

use super::document::deserialise;
use super::error::{Fault, finite, join};
use super::projector::ProjectorConfig;
use super::view_tables::ViewTables;
use crate::plan::settings::{ExposureSettings, GlareSettings, ToneMapSettings};
use crate::scene::{PoseError, finite_vector, unit_quaternion};
use crate::view::projection::{Face, FisheyeMapping, ProjectionError};
use crate::view::{Fov, Packing, RigError, View, ViewKind};

/// Names of the types, as they stand in `type`.
pub const VIEW_TYPES: [&str; 7] =
    ["perspective", "stereo", "cubemap", "fisheye", "dome_master", "equirectangular", "projector"];

/// One view.
#[derive(Clone, Debug, PartialEq)]
pub struct ViewConfig {
    /// Unique name: letters, digits, `_` and `-`.
    pub name: String,
    /// Unit quaternion x, y, z, w from view axes to camera axes.
    pub orientation: [f64; 4],
    /// Position in camera axes, m.
    pub position_m: [f64; 3],
    /// Whether its display images show a test pattern.
    pub test_pattern: bool,
    /// How the pictures of its eyes lie in files.
    pub packing: PackingConfig,
    /// Its exposure, glare and tone mapping, as far as it has its own.
    pub tables: ViewTables,
    /// Type and what belongs to it.
    pub kind: ViewKindConfig,
    /// The keys of its geometry as they stand: type, what belongs to it, orientation and position. [`Self::read`] takes them again, but for
    /// those of a projector, whose geometry is in a file.
    pub definition: Table,
}

/// What is wrong with the table of a view.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{}", join_problem(.key, .problem))]
pub struct DefinitionError {
    /// Path of the key within the table; empty for the table itself.
    pub key: String,
    /// What is wrong and what is allowed.
    pub problem: String,
}

fn join_problem(key: &str, problem: &str) -> String {
    if key.is_empty() { problem.to_owned() } else { format!("{key}: {problem}") }
}

impl DefinitionError {
    /// The same seen from outside: `prefix` is the path to the table.
    #[must_use]
    pub fn within(self, prefix: &str) -> Self {
        Self { key: join(prefix, &self.key), ..self }
    }
}

impl From<Fault> for DefinitionError {
    fn from(fault: Fault) -> Self {
        Self { key: fault.key, problem: fault.problem }
    }
}

/// What belongs to a view's type.
#[derive(Clone, Debug, PartialEq)]
pub enum ViewKindConfig {
    /// `perspective`.
    Perspective(PerspectiveConfig),
    /// `stereo`.
    Stereo(StereoConfig),
    /// `cubemap`.
    Cubemap(CubemapConfig),
    /// `fisheye`.
    Fisheye(FisheyeConfig),
    /// `dome_master`.
    DomeMaster(DomeMasterConfig),
    /// `equirectangular`.
    Equirectangular(EquirectangularConfig),
    /// `projector`.
    Projector(Box<ProjectorConfig>),
}

/// Signed angles of the four edges from the view axis; left and down are usually negative.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FovConfig {
    /// Angle of the left edge, less than that of the right edge.
    pub left_deg: f64,
    /// Angle of the right edge.
    pub right_deg: f64,
    /// Angle of the upper edge.
    pub up_deg: f64,
    /// Angle of the lower edge, less than that of the upper edge.
    pub down_deg: f64,
}

/// A flat (gnomonic) view: exactly one of `fov_y_deg` and `fov` is needed.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PerspectiveConfig {
    /// Width and height.
    pub size: [u32; 2],
    /// Vertical field of view; the horizontal one must not exceed 178 degrees either.
    pub fov_y_deg: Option<f64>,
    /// Off-axis field of view by its four edges.
    pub fov: Option<FovConfig>,
}

/// Two eyes: needs either `fov` (left eye, mirrored for the right eye) or both `fov_left` and `fov_right`.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StereoConfig {
    /// Width and height per eye.
    pub size: [u32; 2],
    /// Interpupillary distance.
    pub ipd_m: f64,
    /// Field of view of the left eye, mirrored for the right eye.
    pub fov: Option<FovConfig>,
    /// Field of view of the left eye.
    pub fov_left: Option<FovConfig>,
    /// Field of view of the right eye.
    pub fov_right: Option<FovConfig>,
}

/// Square faces with a field of view of 90 degrees.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CubemapConfig {
    /// Side of a face.
    pub face_size: u32,
    /// Faces to render, each at most once.
    #[serde(default = "all_faces")]
    pub faces: Vec<String>,
}

pub(super) fn all_faces() -> Vec<String> {
    Face::ALL.iter().map(|face| face.name().to_owned()).collect()
}

/// Name of a fisheye mapping.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize, Default, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum MappingConfig {
    /// r ~ theta: radius proportional to the angle from the axis, up to 360 degrees.
    #[default]
    Equidistant,
    /// r ~ sin(theta/2): equal solid angles have equal areas, up to 360 degrees.
    Equisolid,
    /// r ~ sin(theta), up to 180 degrees.
    Orthographic,
    /// r ~ tan(theta/2): conformal, up to 359 degrees.
    Stereographic,
}

/// A circular fisheye image.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FisheyeConfig {
    /// Width and height.
    pub size: [u32; 2],
    /// Mapping from the angle to the axis to the radius in the image.
    #[serde(default)]
    pub mapping: MappingConfig,
    /// Field of view across the circle; the mapping limits it.
    pub fov_deg: f64,
}

/// The domemaster of planetariums: an equidistant fisheye image, zenith in the centre, front at the bottom.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DomeMasterConfig {
    /// Width and height, equal.
    pub size: [u32; 2],
    /// Field of view across the circle.
    #[serde(default = "half_turn_deg")]
    pub fov_deg: f64,
    /// Tilt of the dome towards the front.
    #[serde(default)]
    pub tilt_deg: f64,
    /// Interpupillary distance: makes a picture for each eye, in omni-directional stereo.
    pub ipd_m: Option<f64>,
}

fn half_turn_deg() -> f64 {
    180.0
}

/// An equirectangular (plate carrée) map of the whole sky in the axes of the view: -z in the centre, +y at the top.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct EquirectangularConfig {
    /// Width, an even number, and height.
    pub size: [u32; 2],
}

/// How the pictures of two eyes lie in the files of `render` and `film`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize, Default, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum PackingConfig {
    /// Each in a file of its own.
    #[default]
    None,
    /// In one, the left eye's above the right eye's.
    TopBottom,
    /// In one, the left eye's left of the right eye's.
    SideBySide,
}

impl From<PackingConfig> for Packing {
    fn from(packing: PackingConfig) -> Self {
        match packing {
            PackingConfig::None => Self::None,
            PackingConfig::TopBottom => Self::TopBottom,
            PackingConfig::SideBySide => Self::SideBySide,
        }
    }
}

/// The keys that every view has beside its name and type.
#[derive(Deserialize, Serialize, JsonSchema)]
#[serde(default)]
pub(super) struct Common {
    /// Unit quaternion from view axes to camera axes.
    orientation: [f64; 4],
    /// Position of the view in camera axes.
    position_m: [f64; 3],
    /// Whether display images show a test pattern for aligning projectors.
    test_pattern: bool,
    /// How the pictures of two eyes lie in the files of `render` and `film`.
    packing: PackingConfig,
    /// Name of a group of views that share one exposure: letters, digits, `_` and `-`.
    exposure_group: Option<String>,
    /// Exposure of this view, or of its group; keys that are not given are those of the general table.
    #[schemars(with = "Option<ExposureSettings>")]
    exposure: Option<Table>,
    /// Glare of this view; keys that are not given are those of the general table.
    #[schemars(with = "Option<GlareSettings>")]
    glare: Option<Table>,
    /// Tone mapping of this view; keys that are not given are those of the general table.
    #[schemars(with = "Option<ToneMapSettings>")]
    tone_map: Option<Table>,
}

impl Default for Common {
    fn default() -> Self {
        Self {
            orientation: [0.0, 0.0, 0.0, 1.0],
            position_m: [0.0; 3],
            test_pattern: false,
            packing: PackingConfig::None,
            exposure_group: None,
            exposure: None,
            glare: None,
            tone_map: None,
        }
    }
}

/// Keys that every view may have beside those of its geometry.
const BESIDE_GEOMETRY: [&str; 6] = ["test_pattern", "packing", "exposure_group", "exposure", "glare", "tone_map"];

impl ViewConfig {
    /// Reads a table of `[[views]]` as it would be read in a configuration, and makes the rig's view of it. What its tables `exposure`, `glare` and
    /// `tone_map` come to is judged with the general ones, by [`resolve_views`](super::resolve_views).
    ///
    /// # Errors
    ///
    /// The first key that is unknown, missing, or has a value that is not allowed.
    pub fn read(table: Table) -> Result<(Self, View), DefinitionError> {
        let config = Self::from_table(table)?;
        let view = config.view(None)?;
        Ok((config, view))
    }

    /// Reads a view's table; a fault names the key within it.
    pub(super) fn from_table(mut table: Table) -> Result<Self, Fault> {
        let name = text(&mut table, "name", "a unique name of letters, digits, `_` and `-`")?;
        let mut definition = table.clone();
        definition.retain(|key, _| !BESIDE_GEOMETRY.contains(&key));
        let kind = text(&mut table, "type", &VIEW_TYPES.join(", "))?;
        let mut common = Table::new();
        for key in ["orientation", "position_m"].into_iter().chain(BESIDE_GEOMETRY) {
            common.extend(table.remove_entry(key));
        }
        let common: Common = deserialise(Value::Table(common), "")?;
        let own = Value::Table(table);
        let kind = match kind.as_str() {
            "perspective" => ViewKindConfig::Perspective(deserialise(own, "")?),
            "stereo" => ViewKindConfig::Stereo(deserialise(own, "")?),
            "cubemap" => ViewKindConfig::Cubemap(deserialise(own, "")?),
            "fisheye" => ViewKindConfig::Fisheye(deserialise(own, "")?),
            "dome_master" => ViewKindConfig::DomeMaster(deserialise(own, "")?),
            "equirectangular" => ViewKindConfig::Equirectangular(deserialise(own, "")?),
            "projector" => ViewKindConfig::Projector(Box::new(deserialise(own, "")?)),
            _ => {
                return Err(Fault::new(
                    "type",
                    format!("unknown type `{kind}`: allowed are {}", VIEW_TYPES.join(", ")),
                ));
            }
        };
        let Common { orientation, position_m, test_pattern, packing, exposure_group, exposure, glare, tone_map } =
            common;
        let tables = ViewTables { exposure_group, exposure, glare, tone_map };
        Ok(Self { name, orientation, position_m, test_pattern, packing, tables, kind, definition })
    }

    /// The rig's view; a fault names the key within the view. `folder` is where relative paths start; without one no file is read.
    pub(super) fn view(&self, folder: Option<&Path>) -> Result<View, Fault> {
        let orientation = unit_quaternion(self.orientation).map_err(|error| pose_fault(&error))?;
        let position_m = finite_vector("position_m", self.position_m).map_err(|error| pose_fault(&error))?;
        self.named(self.kind.kind(folder)?, orientation, position_m)
    }

    fn projection_fault(&self, error: &ProjectionError) -> Fault {
        match error {
            ProjectionError::ZeroSize { .. } => {
                let key = if matches!(self.kind, ViewKindConfig::Cubemap(_)) { "face_size" } else { "size" };
                Fault::new(key, error.to_string())
            }
            ProjectionError::OutOfRange { parameter, value, allowed } => {
                // Back from radians: without the digits that the way there and back has left.
                let value = (value * 1e9).round() / 1e9;
                Fault::new(*parameter, format!("{value}: {allowed}"))
            }
        }
    }

    fn named(&self, kind: ViewKind, orientation: DQuat, position_m: glam::DVec3) -> Result<View, Fault> {
        let view = View::new(&self.name, kind, orientation, position_m);
        view.and_then(|view| view.packed(self.packing.into())).map_err(|error| match error {
            RigError::Projection { source, .. } => self.projection_fault(&source),
            RigError::Parameter { problem, .. } => Fault::new("", problem),
            RigError::Name { .. } | RigError::Duplicate { .. } => Fault::new("name", error.to_string()),
        })
    }
}

fn pose_fault(error: &PoseError) -> Fault {
    match error {
        PoseError::NotFinite { key, .. } => Fault::new(*key, error.to_string()),
        _ => Fault::new("orientation", error.to_string()),
    }
}

/// Takes a string out of the table.
fn text(table: &mut Table, key: &str, allowed: &str) -> Result<String, Fault> {
    match table.remove(key) {
        Some(Value::String(text)) => Ok(text),
        Some(other) => Err(Fault::new(key, format!("{} is no string: allowed are {allowed}", other))),
        None => Err(Fault::new(key, format!("missing key: needed is one of {allowed}").replace("one of a ", "a "))),
    }
}

impl ViewKindConfig {
    fn kind(&self, folder: Option<&Path>) -> Result<ViewKind, Fault> {
        Ok(match self {
            ViewKindConfig::Perspective(view) => match (view.fov_y_deg, view.fov) {
                (Some(fov_y_deg), None) => {
                    finite("fov_y_deg", fov_y_deg)?;
                    ViewKind::Perspective { size: view.size, fov_y_rad: fov_y_deg.to_radians() }
                }
                (None, Some(fov)) => ViewKind::OffAxis { size: view.size, fov: fov.radians("fov")? },
                (Some(_), Some(_)) => {
                    return Err(Fault::new(
                        "fov",
                        "fov_y_deg is given too: exactly one of fov and fov_y_deg is allowed",
                    ));
                }
                (None, None) => {
                    return Err(Fault::new("fov_y_deg", "missing key: exactly one of fov_y_deg and fov is needed"));
                }
            },
            ViewKindConfig::Stereo(view) => {
                let (fov_left, fov_right) = match (view.fov, view.fov_left, view.fov_right) {
                    (Some(left), None, None) => {
                        let left = left.radians("fov")?;
                        (left, left.mirrored())
                    }
                    (None, Some(left), Some(right)) => (left.radians("fov_left")?, right.radians("fov_right")?),
                    _ => {
                        let problem = "a stereo view needs either fov (left eye, mirrored for the right one) or both fov_left and fov_right";
                        return Err(Fault::new("fov", problem));
                    }
                };
                ViewKind::Stereo { size: view.size, ipd_m: view.ipd_m, fov_left, fov_right }
            }
            ViewKindConfig::Cubemap(view) => {
                let faces: Result<Vec<Face>, Fault> =
                    view.faces.iter().enumerate().map(|(index, name)| face(index, name)).collect();
                ViewKind::Cubemap { face_size: view.face_size, faces: faces? }
            }
            ViewKindConfig::Fisheye(view) => {
                finite("fov_deg", view.fov_deg)?;
                ViewKind::Fisheye { size: view.size, mapping: view.mapping.into(), fov_rad: view.fov_deg.to_radians() }
            }
            ViewKindConfig::DomeMaster(view) => {
                finite("fov_deg", view.fov_deg)?;
                finite("tilt_deg", view.tilt_deg)?;
                let [width, height] = view.size;
                if width != height {
                    return Err(Fault::new("size", format!("{width} x {height}: a domemaster is square, [n, n]")));
                }
                let (fov_rad, tilt_rad) = (view.fov_deg.to_radians(), view.tilt_deg.to_radians());
                match view.ipd_m {
                    Some(ipd_m) => ViewKind::StereoDome { size: width, fov_rad, tilt_rad, ipd_m },
                    None => ViewKind::DomeMaster { size: width, fov_rad, tilt_rad },
                }
            }
            ViewKindConfig::Equirectangular(view) => ViewKind::Equirectangular { size: view.size },
            ViewKindConfig::Projector(view) => match folder {
                Some(folder) => view.kind(folder)?,
                None => {
                    let problem = "projectors are views of configurations alone: their calibration is a file, which clients cannot name";
                    return Err(Fault::new("type", problem));
                }
            },
        })
    }
}

fn face(index: usize, name: &str) -> Result<Face, Fault> {
    Face::from_name(name).ok_or_else(|| {
        let problem = format!("unknown face `{name}`: allowed are {}", all_faces().join(", "));
        Fault::new(format!("faces[{index}]"), problem)
    })
}

impl FovConfig {
    fn radians(self, key: &str) -> Result<Fov, Fault> {
        for (edge, value) in [
            ("left_deg", self.left_deg),
            ("right_deg", self.right_deg),
            ("up_deg", self.up_deg),
            ("down_deg", self.down_deg),
        ] {
            finite(&format!("{key}.{edge}"), value)?;
        }
        Ok(Fov {
            left_rad: self.left_deg.to_radians(),
            right_rad: self.right_deg.to_radians(),
            up_rad: self.up_deg.to_radians(),
            down_rad: self.down_deg.to_radians(),
        })
    }
}

impl From<MappingConfig> for FisheyeMapping {
    fn from(mapping: MappingConfig) -> Self {
        match mapping {
            MappingConfig::Equidistant => FisheyeMapping::Equidistant,
            MappingConfig::Equisolid => FisheyeMapping::Equisolid,
            MappingConfig::Orthographic => FisheyeMapping::Orthographic,
            MappingConfig::Stereographic => FisheyeMapping::Stereographic,
        }
    }
}
