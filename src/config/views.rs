//! `[[views]]`: the specification of a view, in seven types.
//!
//! Configurations, messages of clients and state files all describe a view by a [`ViewSpec`]. [`ViewSpec::view`] converts it to a [`View`] of the
//! rig, in radians. The keys of [`ViewSpec`] and of [`ViewGeometry`] are common to all types; the other keys belong to a type, and a key of another
//! type counts as unknown.

use std::path::Path;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Serialize, de::DeserializeOwned};
use serde_json::json;
use toml::{Table, Value};

use super::document::{check_ranges, deserialise};
use super::error::finite;
use super::keys::table_of;
use super::projector::ProjectorConfig;
use crate::plan::settings::{ExposureKeys, GlareKeys, ToneMapKeys};
use crate::ranges::KeyError;
use crate::ranges::schema_of;
use crate::scene::{PoseError, finite_vector, unit_quaternion};
use crate::view::projection::{Face, FisheyeMapping, MAX_EDGE_DEG, ProjectionError};
use crate::view::{Fov, MAX_EYE_OFFSET_M, Packing, RigError, View, ViewKind};

/// Maximum length of a view's name, which becomes part of file names.
const MOST_NAME: usize = 64;

/// Names of the types, the values of `type`.
pub const VIEW_TYPES: [&str; 7] =
    ["perspective", "stereo", "cubemap", "fisheye", "dome_master", "equirectangular", "projector"];

/// Specification of a view.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
#[schemars(rename = "CommonKeysOfViews")]
pub struct ViewSpec {
    /// Unique name: at most 64 letters, digits, `_` and `-`.
    pub name: String,
    /// Type of the view, and its position and orientation.
    #[serde(skip)]
    pub geometry: ViewGeometry,
    /// Whether display images show a test pattern for aligning projectors.
    pub test_pattern: bool,
    /// Arrangement of the pictures of two eyes in the files of `render` and `film`.
    pub packing: PackingConfig,
    /// Name of a group of views that share one exposure: letters, digits, `_` and `-`.
    pub exposure_group: Option<String>,
    /// Exposure of this view, or of its group; the general table gives the missing keys.
    pub exposure: Option<ExposureKeys>,
    /// Glare of this view; the general table gives the missing keys.
    pub glare: Option<GlareKeys>,
    /// Tone mapping of this view; the general table gives the missing keys.
    pub tone_map: Option<ToneMapKeys>,
}

/// Type of a view, and its position and orientation in the axes of the camera.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct ViewGeometry {
    /// Type and its keys.
    #[serde(skip)]
    pub kind: ViewKindSpec,
    /// Unit quaternion from view axes to camera axes.
    pub orientation: [f64; 4],
    /// Position of the view in camera axes.
    #[schemars(inner(range(min = -MAX_EYE_OFFSET_M, max = MAX_EYE_OFFSET_M)), extend("x-unit" = "m"))]
    pub position_m: [f64; 3],
}

/// Type of a view with its keys.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[serde(tag = "type", rename_all = "snake_case")]
pub enum ViewKindSpec {
    /// A view made by the program, without keys.
    #[default]
    #[serde(skip)]
    Custom,
    /// `perspective`.
    Perspective(PerspectiveSpec),
    /// `stereo`.
    Stereo(StereoSpec),
    /// `cubemap`.
    Cubemap(CubemapSpec),
    /// `fisheye`.
    Fisheye(FisheyeSpec),
    /// `dome_master`.
    DomeMaster(DomeMasterSpec),
    /// `equirectangular`.
    Equirectangular(EquirectangularSpec),
    /// `projector`. Its calibration is a file, so only configurations can have this type.
    #[serde(skip)]
    Projector(Box<ProjectorConfig>),
}

impl Default for ViewGeometry {
    fn default() -> Self {
        Self { kind: ViewKindSpec::Custom, orientation: IDENTITY, position_m: [0.0; 3] }
    }
}

const IDENTITY: [f64; 4] = [0.0, 0.0, 0.0, 1.0];

/// Signed angles of the four edges from the view axis; left and down are usually negative.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FovSpec {
    /// Angle of the left edge, less than that of the right edge.
    #[schemars(range(min = -MAX_EDGE_DEG, max = MAX_EDGE_DEG), extend("x-unit" = "degrees"))]
    pub left_deg: f64,
    /// Angle of the right edge.
    #[schemars(range(min = -MAX_EDGE_DEG, max = MAX_EDGE_DEG), extend("x-unit" = "degrees"))]
    pub right_deg: f64,
    /// Angle of the upper edge.
    #[schemars(range(min = -MAX_EDGE_DEG, max = MAX_EDGE_DEG), extend("x-unit" = "degrees"))]
    pub up_deg: f64,
    /// Angle of the lower edge, less than that of the upper edge.
    #[schemars(range(min = -MAX_EDGE_DEG, max = MAX_EDGE_DEG), extend("x-unit" = "degrees"))]
    pub down_deg: f64,
}

/// A flat (gnomonic) view: exactly one of `fov_y_deg` and `fov` is required.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PerspectiveSpec {
    /// Width and height.
    #[schemars(inner(range(min = 1)), extend("x-unit" = "pixels"))]
    pub size: [u32; 2],
    /// Vertical field of view. The horizontal field of view also must not exceed 178 degrees.
    #[schemars(range(max = 178.0), extend("exclusiveMinimum" = 0.0, "x-unit" = "degrees"))]
    pub fov_y_deg: Option<f64>,
    /// Off-axis field of view by its four edges.
    pub fov: Option<FovSpec>,
}

/// Flat views for two eyes. Needs either `fov` (left eye, mirrored for the right eye) or both `fov_left` and `fov_right`.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StereoSpec {
    /// Width and height per eye.
    #[schemars(inner(range(min = 1)), extend("x-unit" = "pixels"))]
    pub size: [u32; 2],
    /// Interpupillary distance.
    #[schemars(range(min = 0.0, max = 2.0 * MAX_EYE_OFFSET_M), extend("x-unit" = "m"))]
    pub ipd_m: f64,
    /// Field of view of the left eye, mirrored for the right eye.
    pub fov: Option<FovSpec>,
    /// Field of view of the left eye.
    pub fov_left: Option<FovSpec>,
    /// Field of view of the right eye.
    pub fov_right: Option<FovSpec>,
}

/// Square faces with a field of view of 90 degrees.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CubemapSpec {
    /// Side of a face.
    #[schemars(range(min = 1), extend("x-unit" = "pixels"))]
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
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FisheyeSpec {
    /// Width and height.
    #[schemars(inner(range(min = 1)), extend("x-unit" = "pixels"))]
    pub size: [u32; 2],
    /// Mapping from the angle to the axis to the radius in the image.
    #[serde(default)]
    pub mapping: MappingConfig,
    /// Field of view across the circle; the mapping limits it.
    #[schemars(range(max = 360.0), extend("exclusiveMinimum" = 0.0, "x-unit" = "degrees"))]
    pub fov_deg: f64,
}

/// The domemaster of planetariums: an equidistant fisheye image, zenith in the centre, front at the bottom.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DomeMasterSpec {
    /// Width and height, equal.
    #[schemars(inner(range(min = 1)), extend("x-unit" = "pixels"))]
    pub size: [u32; 2],
    /// Field of view across the circle.
    #[serde(default = "half_turn_deg")]
    #[schemars(range(max = 360.0), extend("exclusiveMinimum" = 0.0, "x-unit" = "degrees"))]
    pub fov_deg: f64,
    /// Tilt of the dome towards the front.
    #[serde(default)]
    #[schemars(range(min = -360.0, max = 360.0), extend("x-unit" = "degrees"))]
    pub tilt_deg: f64,
    /// Interpupillary distance. If it is given, there is a picture for each eye, in omni-directional stereo.
    #[schemars(range(min = 0.0, max = 2.0 * MAX_EYE_OFFSET_M), extend("x-unit" = "m"))]
    pub ipd_m: Option<f64>,
}

fn half_turn_deg() -> f64 {
    180.0
}

/// An equirectangular (plate carrée) map of the whole sky in the axes of the view: -z in the centre, +y at the top.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct EquirectangularSpec {
    /// Width, an even number, and height.
    #[schemars(inner(range(min = 1)), extend("x-unit" = "pixels"))]
    pub size: [u32; 2],
}

/// Arrangement of the pictures of two eyes in the files of `render` and `film`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize, Default, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum PackingConfig {
    /// Each eye has its own file.
    #[default]
    None,
    /// In one file, with the left eye's picture above the right eye's.
    TopBottom,
    /// In one file, with the left eye's picture to the left of the right eye's.
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

/// Returns the keys of a type, from its schema.
fn keys_of<T: JsonSchema + 'static>() -> Vec<&'static str> {
    schema_of::<T>()["properties"].as_object().into_iter().flatten().map(|(key, _)| key.as_str()).collect()
}

impl ViewSpec {
    /// Returns the names of the keys that all types of views have, except those of the geometry.
    pub fn shared_keys() -> Vec<&'static str> {
        keys_of::<Self>()
    }

    /// Returns a view made by the program, without keys.
    pub fn custom(name: &str) -> Self {
        Self { name: name.to_owned(), ..Self::default() }
    }

    /// Reads a view from a value with its keys, such as a message, and converts it to a view of the rig. Settings of the view are checked together
    /// with the general ones, by [`resolve_views`](super::resolve_views).
    ///
    /// # Errors
    ///
    /// The first key that is unknown, is missing or has an invalid value.
    pub fn from_keys(keys: &impl Serialize) -> Result<(Self, View), KeyError> {
        let spec = Self::from_table(table_of(keys)?)?;
        let view = spec.view(None)?;
        Ok((spec, view))
    }

    /// Reads a table of `[[views]]`, as [`Self::from_keys`] does.
    ///
    /// # Errors
    ///
    /// Those of [`Self::from_keys`], and text that is not TOML.
    pub fn from_toml(text: &str) -> Result<(Self, View), KeyError> {
        let table = text.parse::<Table>();
        Self::from_keys(&table.map_err(|error| KeyError::new("", error.to_string()))?)
    }

    /// Reads the settings of a view from a value with its keys, without a geometry.
    ///
    /// # Errors
    ///
    /// The first key that is unknown or has an invalid value.
    pub fn settings_from_keys(keys: &impl Serialize) -> Result<Self, KeyError> {
        deserialise(Value::Table(table_of(keys)?), "")
    }

    /// Checks the specification as if it had been read, and converts it to a view of the rig.
    ///
    /// # Errors
    ///
    /// Those of [`Self::from_keys`].
    pub fn checked(&self) -> Result<(Self, View), KeyError> {
        Self::from_keys(&self.table()?)
    }

    /// Converts the view to another type with the same keys, such as a message. Keys with default values are left out. A geometry that only the
    /// program or the configuration can give is also left out.
    ///
    /// # Errors
    ///
    /// A key that the other type does not have, or a path that is not UTF-8.
    pub fn keys<T: DeserializeOwned>(&self) -> Result<T, KeyError> {
        deserialise(Value::Table(self.table()?), "")
    }

    fn table(&self) -> Result<Table, KeyError> {
        let mut table = table_of(self)?;
        if self.geometry.has_keys() {
            table.extend(table_of(&self.geometry.kind)?);
            table.extend(table_of(&self.geometry)?);
        }
        table.retain(|key, value| default_of(self.geometry.kind.name(), key).as_ref() != Some(value));
        Ok(table)
    }

    /// Reads a view's table; an error names the key within it.
    pub(super) fn from_table(mut table: Table) -> Result<Self, KeyError> {
        let given = Value::Table(table.clone());
        let name = text(&mut table, "name", "a unique name of letters, digits, `_` and `-`")?;
        let shared = taken(&mut table, &Self::shared_keys());
        let geometry = ViewGeometry::read(table)?;
        let spec = Self { name, geometry, ..deserialise(shared, "")? };
        check_ranges::<ViewTable>(&given)?;
        Ok(spec)
    }

    /// Converts the specification to a view of the rig; an error names the key within the view. Relative paths refer to `folder`; without a folder,
    /// no file is read.
    pub(super) fn view(&self, folder: Option<&Path>) -> Result<View, KeyError> {
        if self.name.len() > MOST_NAME {
            let problem = format!("{} characters: must have at most {MOST_NAME}", self.name.len());
            return Err(KeyError::new("name", problem));
        }
        let ViewGeometry { kind, orientation, position_m } = &self.geometry;
        let orientation = unit_quaternion(*orientation).map_err(|error| pose_fault(&error))?;
        let position_m = finite_vector("position_m", *position_m).map_err(|error| pose_fault(&error))?;
        let view = View::new(&self.name, kind.kind(folder)?, orientation, position_m);
        view.and_then(|view| view.packed(self.packing.into())).map_err(|error| match error {
            RigError::Projection { source, .. } => kind.projection_fault(&source),
            RigError::Parameter { problem, .. } => KeyError::new("", problem),
            RigError::Name { .. } | RigError::Duplicate { .. } => KeyError::new("name", error.to_string()),
        })
    }
}

/// Removes the given keys from a table, and returns them with their values.
fn taken(table: &mut Table, keys: &[&str]) -> Value {
    Value::Table(keys.iter().filter_map(|key| table.remove_entry(*key)).collect())
}

impl ViewGeometry {
    /// Whether clients know the keys of the type. They do not for a projector, whose geometry is a file, and a view made by the program has no keys.
    pub fn has_keys(&self) -> bool {
        !matches!(self.kind, ViewKindSpec::Custom | ViewKindSpec::Projector(_))
    }

    fn read(mut table: Table) -> Result<Self, KeyError> {
        let kind = text(&mut table, "type", &VIEW_TYPES.join(", "))?;
        check_keys(&kind, &table)?;
        let placement = deserialise(taken(&mut table, &keys_of::<Self>()), "")?;
        let keys = Value::Table(table);
        let kind = match kind.as_str() {
            "perspective" => ViewKindSpec::Perspective(deserialise(keys, "")?),
            "stereo" => ViewKindSpec::Stereo(deserialise(keys, "")?),
            "cubemap" => ViewKindSpec::Cubemap(deserialise(keys, "")?),
            "fisheye" => ViewKindSpec::Fisheye(deserialise(keys, "")?),
            "dome_master" => ViewKindSpec::DomeMaster(deserialise(keys, "")?),
            "equirectangular" => ViewKindSpec::Equirectangular(deserialise(keys, "")?),
            "projector" => ViewKindSpec::Projector(Box::new(deserialise(keys, "")?)),
            _ => {
                let problem = format!("unknown type `{kind}`: must be one of {}", VIEW_TYPES.join(", "));
                return Err(KeyError::new("type", problem));
            }
        };
        Ok(Self { kind, ..placement })
    }
}

/// Schemas of the types of views, each with the keys that all views have.
fn forms() -> impl Iterator<Item = &'static serde_json::Value> {
    schema_of::<ViewTable>()["oneOf"].as_array().into_iter().flatten()
}

fn is_form_of(form: &serde_json::Value, kind: &str) -> bool {
    form["properties"]["type"]["const"] == kind
}

/// Refuses keys that a type of view does not have.
fn check_keys(kind: &str, table: &Table) -> Result<(), KeyError> {
    let form = forms().find(|form| is_form_of(form, kind));
    let Some(known) = form.and_then(|form| form["properties"].as_object()) else { return Ok(()) };
    match table.keys().find(|key| !known.contains_key(*key)) {
        None => Ok(()),
        Some(unknown) => {
            let known: Vec<String> = known.keys().map(|key| format!("`{key}`")).collect();
            Err(KeyError::new(unknown, format!("unknown key `{unknown}`, expected one of {}", known.join(", "))))
        }
    }
}

/// Default of a key of a type of view, from the schema. Keys that several types share have the same default in all of them.
fn default_of(kind: &str, key: &str) -> Option<Value> {
    let form = forms().find(|form| is_form_of(form, kind)).or_else(|| forms().next())?;
    Value::try_from(form["properties"][key].get("default").filter(|default| !default.is_null())?).ok()
}

/// Schema of a table of `[[views]]`: one alternative for each type, each with the keys that all views have.
pub(super) struct ViewTable;

impl JsonSchema for ViewTable {
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "ViewTable".into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let shared = [ViewGeometry::json_schema(generator), ViewSpec::json_schema(generator)].map(Schema::to_value);
        let kinds = [
            PerspectiveSpec::json_schema(generator),
            StereoSpec::json_schema(generator),
            CubemapSpec::json_schema(generator),
            FisheyeSpec::json_schema(generator),
            DomeMasterSpec::json_schema(generator),
            EquirectangularSpec::json_schema(generator),
            ProjectorConfig::json_schema(generator),
        ];
        let alternatives: Vec<serde_json::Value> = VIEW_TYPES
            .iter()
            .zip(kinds)
            .map(|(name, kind)| {
                let mut kind = kind.to_value();
                if let Some(properties) = kind["properties"].as_object_mut() {
                    let shared = shared.iter().filter_map(|shared| shared["properties"].as_object().cloned());
                    properties.extend(shared.flatten());
                    if let Some(name) = properties.get_mut("name").and_then(serde_json::Value::as_object_mut) {
                        name.remove("default");
                    }
                    properties.insert("type".to_owned(), json!({ "const": name, "description": "Type of the view." }));
                }
                if let Some(required) = kind["required"].as_array_mut() {
                    required.extend([json!("name"), json!("type")]);
                }
                kind
            })
            .collect();
        json_schema!({ "oneOf": alternatives })
    }
}

fn pose_fault(error: &PoseError) -> KeyError {
    match error {
        PoseError::NotFinite { key, .. } => KeyError::new(*key, error.to_string()),
        _ => KeyError::new("orientation", error.to_string()),
    }
}

/// Takes a string out of the table.
fn text(table: &mut Table, key: &str, valid: &str) -> Result<String, KeyError> {
    match table.remove(key) {
        Some(Value::String(text)) => Ok(text),
        Some(other) => Err(KeyError::new(
            key,
            format!("{other} is not a string: must be one of {valid}").replace("one of a ", "a "),
        )),
        None => Err(KeyError::new(key, format!("missing key: must be one of {valid}").replace("one of a ", "a "))),
    }
}

impl ViewKindSpec {
    /// Name of the type in configurations; empty for a view that has no keys.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Custom => "",
            Self::Perspective(_) => "perspective",
            Self::Stereo(_) => "stereo",
            Self::Cubemap(_) => "cubemap",
            Self::Fisheye(_) => "fisheye",
            Self::DomeMaster(_) => "dome_master",
            Self::Equirectangular(_) => "equirectangular",
            Self::Projector(_) => "projector",
        }
    }

    fn projection_fault(&self, error: &ProjectionError) -> KeyError {
        match error {
            ProjectionError::ZeroSize { .. } => {
                let key = if matches!(self, Self::Cubemap(_)) { "face_size" } else { "size" };
                KeyError::new(key, error.to_string())
            }
            ProjectionError::OutOfRange { parameter, value, allowed } => {
                // The value was converted from degrees to radians and back: round off the error of both conversions.
                let value = (value * 1e9).round() / 1e9;
                KeyError::new(*parameter, format!("{value}: {allowed}"))
            }
        }
    }

    fn kind(&self, folder: Option<&Path>) -> Result<ViewKind, KeyError> {
        Ok(match self {
            ViewKindSpec::Custom => {
                return Err(KeyError::new("type", format!("missing key: must be one of {}", VIEW_TYPES.join(", "))));
            }
            ViewKindSpec::Perspective(view) => match (view.fov_y_deg, view.fov) {
                (Some(fov_y_deg), None) => {
                    finite("fov_y_deg", fov_y_deg)?;
                    ViewKind::Perspective { size: view.size, fov_y_rad: fov_y_deg.to_radians() }
                }
                (None, Some(fov)) => ViewKind::OffAxis { size: view.size, fov: fov.radians("fov")? },
                (Some(_), Some(_)) => {
                    return Err(KeyError::new("fov", "fov_y_deg is also given: give exactly one of fov and fov_y_deg"));
                }
                (None, None) => {
                    return Err(KeyError::new("fov_y_deg", "missing key: give exactly one of fov_y_deg and fov"));
                }
            },
            ViewKindSpec::Stereo(view) => {
                let (fov_left, fov_right) = match (view.fov, view.fov_left, view.fov_right) {
                    (Some(left), None, None) => {
                        let left = left.radians("fov")?;
                        (left, left.mirrored())
                    }
                    (None, Some(left), Some(right)) => (left.radians("fov_left")?, right.radians("fov_right")?),
                    _ => {
                        let problem = "a stereo view needs either fov (left eye, mirrored for the right one) or both fov_left and fov_right";
                        return Err(KeyError::new("fov", problem));
                    }
                };
                ViewKind::Stereo { size: view.size, ipd_m: view.ipd_m, fov_left, fov_right }
            }
            ViewKindSpec::Cubemap(view) => {
                let faces: Result<Vec<Face>, KeyError> =
                    view.faces.iter().enumerate().map(|(index, name)| face(index, name)).collect();
                ViewKind::Cubemap { face_size: view.face_size, faces: faces? }
            }
            ViewKindSpec::Fisheye(view) => {
                finite("fov_deg", view.fov_deg)?;
                ViewKind::Fisheye { size: view.size, mapping: view.mapping.into(), fov_rad: view.fov_deg.to_radians() }
            }
            ViewKindSpec::DomeMaster(view) => {
                finite("fov_deg", view.fov_deg)?;
                finite("tilt_deg", view.tilt_deg)?;
                let [width, height] = view.size;
                if width != height {
                    return Err(KeyError::new("size", format!("{width} x {height}: a domemaster is square, [n, n]")));
                }
                let (fov_rad, tilt_rad) = (view.fov_deg.to_radians(), view.tilt_deg.to_radians());
                match view.ipd_m {
                    Some(ipd_m) => ViewKind::StereoDome { size: width, fov_rad, tilt_rad, ipd_m },
                    None => ViewKind::DomeMaster { size: width, fov_rad, tilt_rad },
                }
            }
            ViewKindSpec::Equirectangular(view) => ViewKind::Equirectangular { size: view.size },
            ViewKindSpec::Projector(view) => match folder {
                Some(folder) => view.kind(folder)?,
                None => {
                    let problem = "only a configuration can have a projector: its calibration is a file, which clients cannot name";
                    return Err(KeyError::new("type", problem));
                }
            },
        })
    }
}

fn face(index: usize, name: &str) -> Result<Face, KeyError> {
    Face::from_name(name).ok_or_else(|| {
        let problem = format!("unknown face `{name}`: must be one of {}", all_faces().join(", "));
        KeyError::new(format!("faces[{index}]"), problem)
    })
}

impl FovSpec {
    fn radians(self, key: &str) -> Result<Fov, KeyError> {
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
