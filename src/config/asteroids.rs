//! `[[asteroid_fields]]` and `[asteroids]`: where asteroids are, and how they are drawn.

use std::path::{Path, PathBuf};

use glam::DVec3;
use schemars::JsonSchema;
use serde::Deserialize;
use toml::{Table, Value};

use super::bodies::albedo;
use super::document::read;
use crate::plan::settings::AsteroidSettings;
use crate::ranges::KeyError;
use crate::scene::asteroids::{
    FieldError, FieldParameters, FieldSpec, LARGEST_EXTENT_M, LEAST_OF_RANGE, MOST_INSTANCES, Placement,
    STEEPEST_SIZE_INDEX, ShapeSource, SpecError,
};
use crate::scene::bodies::{FARTHEST_M, ReflectionLaw};
use crate::scene::unit_quaternion;

/// Shape of the volume that the asteroids of a field fill.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum FieldShape {
    /// A box: `size_m`.
    Box,
    /// A torus without edges: `inner_m`, `outer_m`, `height_m`.
    Belt,
    /// A flat ring: `inner_m`, `outer_m`, `thickness_m`.
    Ring,
}

/// A field of asteroids, generated from a seed. `shape` determines which keys give the size of the field.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FieldConfig {
    /// Unique name: letters, digits, `_` and `-`.
    pub name: String,
    /// Centre, ICRS, barycentric.
    #[schemars(inner(range(min = -FARTHEST_M, max = FARTHEST_M)), extend("x-unit" = "m"))]
    pub position_m: [f64; 3],
    /// Unit quaternion from the field's axes to ICRS axes.
    #[serde(default = "identity")]
    pub orientation: [f64; 4],
    /// Number of asteroids.
    #[schemars(range(min = 1, max = MOST_INSTANCES))]
    pub instances: u32,
    /// Seed of positions, sizes and spins.
    #[serde(default = "one")]
    pub seed: u64,
    /// Shape of the volume that the asteroids fill.
    pub shape: FieldShape,
    /// `box`: lengths of the sides.
    #[schemars(inner(range(max = LARGEST_EXTENT_M)), extend("exclusiveMinimum" = 0.0, "x-unit" = "m"))]
    pub size_m: Option<[f64; 3]>,
    /// `belt`, `ring`: inner radius.
    #[schemars(range(min = 0.0, max = LARGEST_EXTENT_M), extend("x-unit" = "m"))]
    pub inner_m: Option<f64>,
    /// `belt`, `ring`: outer radius, larger than the inner one.
    #[schemars(range(max = LARGEST_EXTENT_M), extend("exclusiveMinimum" = 0.0, "x-unit" = "m"))]
    pub outer_m: Option<f64>,
    /// `belt`: full height.
    #[schemars(range(max = LARGEST_EXTENT_M), extend("exclusiveMinimum" = 0.0, "x-unit" = "m"))]
    pub height_m: Option<f64>,
    /// `ring`: full thickness.
    #[schemars(range(min = 0.0, max = LARGEST_EXTENT_M), extend("x-unit" = "m"))]
    pub thickness_m: Option<f64>,
    /// Smallest and largest mean radius; the largest is at most 1000 times the smallest.
    #[schemars(inner(range(min = LEAST_OF_RANGE, max = LARGEST_EXTENT_M)), extend("x-unit" = "m"))]
    pub radius_m: [f64; 2],
    /// Exponent of the cumulative size distribution: N(>r) ~ r^-size_index.
    #[serde(default = "collisional")]
    #[schemars(range(min = 0.0, max = STEEPEST_SIZE_INDEX))]
    pub size_index: f64,
    /// Shortest and longest spin period, uniform in the logarithm; the longest is at most 1000 times the shortest.
    #[serde(default = "two_hours_to_two_days")]
    #[schemars(inner(range(min = LEAST_OF_RANGE, max = LARGEST_EXTENT_M)), extend("x-unit" = "s"))]
    pub spin_period_s: [f64; 2],
    /// Geometric albedo, one number or [red, green, blue]; required.
    #[serde(default, deserialize_with = "albedo")]
    #[schemars(schema_with = "super::reference::albedo")]
    pub geometric_albedo: Option<[f64; 3]>,
    /// Reflection law of the surfaces.
    #[serde(default)]
    pub law: ReflectionLaw,
    /// glTF files, one shape each, instead of procedural shapes.
    pub shapes: Option<Vec<PathBuf>>,
    /// Seed of the procedural shapes; 1 if neither it nor `shapes` is given.
    pub shape_seed: Option<u64>,
}

fn identity() -> [f64; 4] {
    [0.0, 0.0, 0.0, 1.0]
}

fn one() -> u64 {
    1
}

/// Exponent of a population in collisional equilibrium (Dohnanyi 1969, "Collisional model of asteroids and their debris").
fn collisional() -> f64 {
    2.5
}

fn two_hours_to_two_days() -> [f64; 2] {
    [7200.0, 172_800.0]
}

impl FieldConfig {
    /// Reads a field's table and checks it; an error names the key within it. Shapes are not read.
    pub(super) fn from_table(table: Table) -> Result<Self, KeyError> {
        let config: Self = read(Value::Table(table))?;
        config.spec(Path::new(""))?;
        Ok(config)
    }

    /// The specification of the field; paths are relative to `folder`.
    pub(super) fn spec(&self, folder: &Path) -> Result<FieldSpec, KeyError> {
        let shapes = match (&self.shapes, self.shape_seed) {
            (Some(_), Some(_)) => {
                let problem = "shapes is also given: at most one of shape_seed and shapes is allowed";
                return Err(KeyError::new("shape_seed", problem));
            }
            (Some(files), None) if files.is_empty() => {
                return Err(KeyError::new("shapes", "an empty list: name glTF files, or leave the key out"));
            }
            (Some(files), None) => ShapeSource::Files(files.iter().map(|file| folder.join(file)).collect()),
            (None, seed) => ShapeSource::Procedural { seed: seed.unwrap_or(1) },
        };
        let missing = "missing key: a number, or [red, green, blue], is needed";
        let spec = FieldSpec {
            name: self.name.clone(),
            position_m: DVec3::from_array(self.position_m),
            orientation: unit_quaternion(self.orientation).map_err(|e| KeyError::new("orientation", e.to_string()))?,
            parameters: FieldParameters {
                instances: self.instances,
                seed: self.seed,
                placement: self.placement()?,
                radius_m: self.radius_m,
                size_index: self.size_index,
                spin_period_s: self.spin_period_s,
            },
            shapes,
            law: self.law,
            geometric_albedo: self.geometric_albedo.ok_or_else(|| KeyError::new("geometric_albedo", missing))?,
        };
        spec.check().map_err(|error| spec_fault(&error))?;
        Ok(spec)
    }

    fn placement(&self) -> Result<Placement, KeyError> {
        let radii = || -> Result<(f64, f64), KeyError> {
            Ok((needed("inner_m", self.shape, self.inner_m)?, needed("outer_m", self.shape, self.outer_m)?))
        };
        let (allowed, placement): (&[&str], _) = match self.shape {
            FieldShape::Box => {
                let size_m = DVec3::from_array(needed("size_m", self.shape, self.size_m)?);
                (&["size_m"], Placement::Box { size_m })
            }
            FieldShape::Belt => {
                let (inner_m, outer_m) = radii()?;
                let height_m = needed("height_m", self.shape, self.height_m)?;
                (&["inner_m", "outer_m", "height_m"], Placement::Belt { inner_m, outer_m, height_m })
            }
            FieldShape::Ring => {
                let (inner_m, outer_m) = radii()?;
                let thickness_m = needed("thickness_m", self.shape, self.thickness_m)?;
                (&["inner_m", "outer_m", "thickness_m"], Placement::Ring { inner_m, outer_m, thickness_m })
            }
        };
        let given = [
            ("size_m", self.size_m.is_some()),
            ("inner_m", self.inner_m.is_some()),
            ("outer_m", self.outer_m.is_some()),
            ("height_m", self.height_m.is_some()),
            ("thickness_m", self.thickness_m.is_some()),
        ];
        match given.into_iter().find(|(key, is_given)| *is_given && !allowed.contains(key)) {
            Some((key, _)) => {
                let problem = format!("not a key of {}, which has {}", named(self.shape), allowed.join(", "));
                Err(KeyError::new(key, problem))
            }
            None => Ok(placement),
        }
    }
}

fn needed<T>(key: &'static str, shape: FieldShape, value: Option<T>) -> Result<T, KeyError> {
    value.ok_or_else(|| KeyError::new(key, format!("missing key: {} needs it", named(shape))))
}

fn named(shape: FieldShape) -> &'static str {
    match shape {
        FieldShape::Box => "shape = \"box\"",
        FieldShape::Belt => "shape = \"belt\"",
        FieldShape::Ring => "shape = \"ring\"",
    }
}

/// Converts an error that the scene reports to one that names the key of the configuration.
pub(super) fn spec_fault(error: &SpecError) -> KeyError {
    match error {
        SpecError::Part(error) => error.clone(),
        SpecError::Parameter(FieldError::OutOfRange { key, value, allowed }) => {
            KeyError::new(key.strip_prefix("placement.").unwrap_or(key), format!("{value}: {allowed}"))
        }
        SpecError::Parameter(error @ FieldError::Shapes { .. }) => KeyError::new("shapes", error.to_string()),
        SpecError::Shapes(error) => KeyError::new("shapes", error.to_string()),
    }
}

/// Ranges of `[asteroids]`.
pub(super) fn check_settings(settings: &AsteroidSettings) -> Result<(), KeyError> {
    settings.check().map_err(|(key, problem)| KeyError::new(key, problem))
}
