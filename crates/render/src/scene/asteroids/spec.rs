//! The specification of a field of asteroids, and its construction. Parts that do not change from one field to the next
//! are reused.

use std::{path::PathBuf, sync::Arc};

use glam::{DQuat, DVec3};

use super::{AsteroidField, FieldError, FieldParameters, Instances, MOST_INSTANCES, ShapeError, ShapeSet};
use crate::ranges::KeyError;
use crate::scene::bodies::{ReflectionLaw, check_albedo, check_name, check_names, check_position};

/// Maximum number of fields of a scene.
pub const MOST_FIELDS: usize = 64;

/// Source of the shapes of a field.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ShapeSource {
    /// Generated from a seed ([`ShapeSet::procedural`]).
    Procedural {
        /// Seed of the random numbers.
        seed: u64,
    },
    /// glTF files, one shape each ([`ShapeSet::from_gltf`]).
    Files(Vec<PathBuf>),
    /// The files of the field with this name in the configuration, since clients cannot name files. The daemon replaces this name with the files
    /// before it makes the field.
    OfField(String),
}

/// Specification of a field.
#[derive(Clone, Debug, PartialEq)]
pub struct FieldSpec {
    /// Unique among the fields of a scene.
    pub name: String,
    /// Its centre: ICRS, barycentric, m.
    pub position_m: DVec3,
    /// Rotation from the field's axes to world axes.
    pub orientation: DQuat,
    /// Positions, sizes and spins of the asteroids.
    pub parameters: FieldParameters,
    /// Their shapes.
    pub shapes: ShapeSource,
    /// Reflection law.
    pub law: ReflectionLaw,
    /// Geometric albedo for red, green and blue.
    pub geometric_albedo: [f64; 3],
}

/// Reasons why a field cannot be made.
#[derive(Debug, thiserror::Error)]
pub enum SpecError {
    /// The name, position, orientation or albedo is invalid.
    #[error(transparent)]
    Part(#[from] KeyError),
    /// Another parameter is out of range.
    #[error(transparent)]
    Parameter(#[from] FieldError),
    /// The shapes cannot be read.
    #[error("shapes: {0}")]
    Shapes(#[from] ShapeError),
}

/// A field with its specification.
#[derive(Clone, Debug)]
pub struct MadeField {
    /// Its specification.
    pub spec: Arc<FieldSpec>,
    /// The field.
    pub field: Arc<AsteroidField>,
}

impl FieldSpec {
    /// Checks every part, except whether the name is unique; shapes are not read.
    ///
    /// # Errors
    ///
    /// A part is out of range; the error names it and the valid values.
    pub fn check(&self) -> Result<(), SpecError> {
        check_name(&self.name)?;
        check_position(self.position_m)?;
        crate::scene::unit_quaternion(self.orientation.to_array())
            .map_err(|error| KeyError::new("orientation", error.to_string()))?;
        self.parameters.check()?;
        check_albedo(self.geometric_albedo)?;
        Ok(())
    }

    /// Makes the field. Reuses the shapes and instances of `before` that have the same specification.
    ///
    /// # Errors
    ///
    /// A part is out of range, or the shapes cannot be read.
    pub fn make(self: &Arc<Self>, before: &[MadeField]) -> Result<MadeField, SpecError> {
        if let Some(same) = before.iter().find(|made| made.spec == *self) {
            return Ok(same.clone());
        }
        self.check()?;
        let like_shapes = before.iter().find(|made| made.spec.shapes == self.shapes);
        let shapes = match (like_shapes, &self.shapes) {
            (Some(made), _) => Arc::clone(&made.field.shapes),
            (None, ShapeSource::Procedural { seed }) => Arc::new(ShapeSet::procedural(*seed)),
            (None, ShapeSource::Files(paths)) => Arc::new(ShapeSet::from_gltf(paths)?),
            (None, ShapeSource::OfField(name)) => {
                let problem = format!("`{name}`: only a daemon's clients can refer to the shapes of another field");
                return Err(KeyError::new("shapes_of", problem).into());
            }
        };
        let like_instances = before
            .iter()
            .find(|made| made.spec.parameters == self.parameters && Arc::ptr_eq(&made.field.shapes, &shapes));
        let instances = match like_instances {
            Some(made) => Arc::clone(&made.field.instances),
            None => Arc::new(Instances::place(&self.parameters, shapes.shapes.len(), &shapes.bounds())?),
        };
        let field = Arc::new(AsteroidField {
            name: self.name.clone(),
            position_m: self.position_m,
            orientation: self.orientation,
            law: self.law,
            geometric_albedo: self.geometric_albedo,
            instances,
            shapes,
        });
        Ok(MadeField { spec: Arc::clone(self), field })
    }
}

/// Maximum number of shape sets of a scene: each has its own meshes and impostor atlas.
pub const MOST_SETS: usize = 8;

/// Checks that the fields of a scene have unique names, and limits the number of fields, instances and shape sets. The
/// error comes with the index of the offending field.
pub fn check_fields<'a>(specs: impl Iterator<Item = &'a FieldSpec> + Clone) -> Result<(), (usize, KeyError)> {
    check_names(specs.clone().map(|spec| spec.name.as_str()), MOST_FIELDS)?;
    let mut all = 0;
    let mut sets: Vec<&ShapeSource> = Vec::new();
    for (index, spec) in specs.enumerate() {
        all += u64::from(spec.parameters.instances);
        if all > u64::from(MOST_INSTANCES) {
            let problem = format!(
                "{all} in the fields up to this one: must be at most {MOST_INSTANCES} in all fields of a scene"
            );
            return Err((index, KeyError::new("instances", problem)));
        }
        if !sets.contains(&&spec.shapes) {
            sets.push(&spec.shapes);
        }
        if sets.len() > MOST_SETS {
            let problem = format!("one set of shapes too many: must be at most {MOST_SETS} in all fields of a scene");
            return Err((index, KeyError::new("shapes", problem)));
        }
    }
    Ok(())
}

/// Makes fields in order; each reuses parts of `before` and of the fields already made.
///
/// # Errors
///
/// The index of the offending field, and the error.
pub fn make_fields(specs: &[Arc<FieldSpec>], before: &[MadeField]) -> Result<Vec<MadeField>, (usize, SpecError)> {
    let mut known = before.to_vec();
    for (index, spec) in specs.iter().enumerate() {
        known.push(spec.make(&known).map_err(|error| (index, error))?);
    }
    Ok(known.split_off(before.len()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::asteroids::Placement;

    fn spec(name: &str) -> FieldSpec {
        FieldSpec {
            name: name.to_owned(),
            position_m: DVec3::ZERO,
            orientation: DQuat::IDENTITY,
            parameters: FieldParameters {
                instances: 300,
                seed: 1,
                placement: Placement::Box { size_m: DVec3::splat(1e5) },
                radius_m: [10.0, 100.0],
                size_index: 2.5,
                spin_period_s: [7200.0, 86_400.0],
            },
            shapes: ShapeSource::Procedural { seed: 3 },
            law: ReflectionLaw::default(),
            geometric_albedo: [0.1; 3],
        }
    }

    #[test]
    fn only_changed_parts_are_rebuilt() {
        let first = Arc::new(spec("a")).make(&[]).unwrap();
        let made = |change: &dyn Fn(&mut FieldSpec)| {
            let mut next = spec("a");
            change(&mut next);
            Arc::new(next).make(std::slice::from_ref(&first)).unwrap()
        };
        assert!(Arc::ptr_eq(&made(&|_| ()).field, &first.field));
        let moved = made(&|spec| spec.position_m.x = 5.0);
        assert_eq!(moved.field.position_m.x, 5.0);
        assert!(Arc::ptr_eq(&moved.field.instances, &first.field.instances));
        let other_seed = made(&|spec| spec.parameters.seed = 2);
        assert!(Arc::ptr_eq(&other_seed.field.shapes, &first.field.shapes));
        assert_ne!(other_seed.field.instances, first.field.instances);
        let other_shapes = made(&|spec| spec.shapes = ShapeSource::Procedural { seed: 4 });
        assert_ne!(other_shapes.field.shapes, first.field.shapes);
        assert!(!Arc::ptr_eq(&other_shapes.field.instances, &first.field.instances));
        let twins = make_fields(&[Arc::new(spec("b")), Arc::new(spec("c"))], &[]).unwrap();
        assert!(twins.len() == 2 && Arc::ptr_eq(&twins[0].field.instances, &twins[1].field.instances));
    }

    #[test]
    fn parts_out_of_range_are_named() {
        let message = |change: &dyn Fn(&mut FieldSpec)| {
            let mut bad = spec("a");
            change(&mut bad);
            let error = Arc::new(bad.clone()).make(&[]).unwrap_err().to_string();
            assert_eq!(bad.check().map_err(|error| error.to_string()).err().unwrap_or(error.clone()), error);
            error
        };
        assert!(message(&|spec| spec.parameters.instances = 0).contains("instances = 0"));
        assert!(message(&|spec| spec.geometric_albedo[2] = 3.0).contains("between 0 and 2"));
        assert!(message(&|spec| spec.orientation.x = 1.0).contains("unit quaternion"));
        assert!(message(&|spec| spec.shapes = ShapeSource::Files(vec!["no.glb".into()])).contains("no.glb"));
        assert!(message(&|spec| spec.shapes = ShapeSource::OfField("rocks".to_owned())).contains("shapes_of"));
        let mut many = [spec("a"), spec("b")];
        many[1].parameters.instances = MOST_INSTANCES;
        let (place, error) = check_fields(many.iter()).unwrap_err();
        assert!(place == 1 && error.to_string().contains("in all fields"), "{error}");
        assert!(check_fields([spec("a"), spec("a")].iter()).is_err());
    }
}
