//! What a field of asteroids is made from, and how it is made: what stays the same from one field to the next is not
//! made anew.

use std::{path::PathBuf, sync::Arc};

use glam::{DQuat, DVec3};

use super::{AsteroidField, FieldError, FieldParameters, Instances, MOST_INSTANCES, ShapeError, ShapeSet};
use crate::scene::bodies::{BodyError, ReflectionLaw, check_albedo, check_name, check_names, check_position};

/// Most fields of a scene.
pub const MOST_FIELDS: usize = 64;

/// Where the shapes of a field come from.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ShapeSource {
    /// Made from a seed ([`ShapeSet::procedural`]).
    Procedural {
        /// Another seed gives others.
        seed: u64,
    },
    /// glTF files, one shape each ([`ShapeSet::from_gltf`]).
    Files(Vec<PathBuf>),
}

/// What a field is made from.
#[derive(Clone, Debug, PartialEq)]
pub struct FieldSpec {
    /// Unique among the fields of a scene.
    pub name: String,
    /// Its middle: ICRS, barycentric, m.
    pub position_m: DVec3,
    /// Rotation from the field's axes to world axes.
    pub orientation: DQuat,
    /// Where the asteroids are, how large, and how they spin.
    pub parameters: FieldParameters,
    /// What they look like.
    pub shapes: ShapeSource,
    /// How they reflect.
    pub law: ReflectionLaw,
    /// Geometric albedo, of red, green and blue.
    pub geometric_albedo: [f64; 3],
}

/// Why a field cannot be made.
#[derive(Debug, thiserror::Error)]
pub enum SpecError {
    /// Name, place, orientation or albedo are out of range.
    #[error(transparent)]
    Part(#[from] BodyError),
    /// Another parameter is out of range.
    #[error(transparent)]
    Parameter(#[from] FieldError),
    /// The shapes cannot be read.
    #[error("shapes: {0}")]
    Shapes(#[from] ShapeError),
}

/// A field with what it was made from.
#[derive(Clone, Debug)]
pub struct MadeField {
    /// What it was made from.
    pub spec: Arc<FieldSpec>,
    /// The field.
    pub field: Arc<AsteroidField>,
}

impl FieldSpec {
    /// Checks every part of it but the name's being unique; shapes are not read.
    ///
    /// # Errors
    ///
    /// A part is out of range; the error names it and says what is allowed.
    pub fn check(&self) -> Result<(), SpecError> {
        check_name(&self.name)?;
        check_position(self.position_m)?;
        crate::scene::unit_quaternion(self.orientation.to_array())
            .map_err(|error| BodyError::new("orientation", error.to_string()))?;
        self.parameters.check()?;
        check_albedo(self.geometric_albedo)?;
        Ok(())
    }

    /// Makes the field. Shapes and instances of `before` that come from the same are used again.
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

/// Most sets of shapes of a scene: each has meshes and an atlas of impostors of its own.
pub const MOST_SETS: usize = 8;

/// Checks that the fields of a scene have unique names and are not too many, nor their instances. The error comes with
/// the place of the field at fault.
pub fn check_fields<'a>(specs: impl Iterator<Item = &'a FieldSpec> + Clone) -> Result<(), (usize, BodyError)> {
    check_names(specs.clone().map(|spec| spec.name.as_str()), MOST_FIELDS)?;
    let mut all = 0;
    let mut sets: Vec<&ShapeSource> = Vec::new();
    for (index, spec) in specs.enumerate() {
        all += u64::from(spec.parameters.instances);
        if all > u64::from(MOST_INSTANCES) {
            let problem = format!("{all} up to this field: allowed are {MOST_INSTANCES} in all fields of a scene");
            return Err((index, BodyError::new("instances", problem)));
        }
        if !sets.contains(&&spec.shapes) {
            sets.push(&spec.shapes);
        }
        if sets.len() > MOST_SETS {
            let problem = format!("another set of shapes: allowed are {MOST_SETS} in all fields of a scene");
            return Err((index, BodyError::new("shapes", problem)));
        }
    }
    Ok(())
}

/// Makes fields one after the other; each uses again what it can of `before` and of those made already.
///
/// # Errors
///
/// The place of the field at fault, and what is wrong with it.
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
    fn only_what_changed_is_made_anew() {
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
        assert!(message(&|spec| spec.geometric_albedo[2] = 3.0).contains("0 to 2"));
        assert!(message(&|spec| spec.orientation.x = 1.0).contains("unit quaternion"));
        assert!(message(&|spec| spec.shapes = ShapeSource::Files(vec!["no.glb".into()])).contains("no.glb"));
        let mut many = [spec("a"), spec("b")];
        many[1].parameters.instances = MOST_INSTANCES;
        let (place, error) = check_fields(many.iter()).unwrap_err();
        assert!(place == 1 && error.to_string().contains("in all fields"), "{error}");
        assert!(check_fields([spec("a"), spec("a")].iter()).is_err());
    }
}
