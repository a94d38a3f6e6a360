//! Bodies and asteroid fields as clients define them, and the effect of changes on the objects of a scene.
//!
//! Textures and shape files come only from the configuration: a client names the body or field of the configuration
//! that has them.

use std::{fmt::Display, sync::Arc};

use super::{
    excerpts::listed,
    observer::{GivenObserver, MadeObserver, ObserverChange},
};
use crate::{
    config::{ObserverConfig, check_place},
    observer::Moment,
    scene::{
        SceneObjects,
        asteroids::{FieldSpec, MadeField, ShapeSource, check_fields, make_fields},
        bodies::{Body, MOST_BODIES, Texture, check_names, check_suns},
    },
};

/// A body with the name of its texture.
#[derive(Clone, Debug, PartialEq)]
pub struct BodyForm {
    /// The body without its texture.
    pub body: Body,
    /// Body of the configuration whose texture it uses.
    pub texture_of: Option<String>,
}

impl From<Body> for BodyForm {
    /// Returns a body without a texture.
    fn from(mut body: Body) -> Self {
        body.surface.texture = None;
        Self { body, texture_of: None }
    }
}

/// A change of a list of named items.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Change<T> {
    /// No change.
    #[default]
    Nothing,
    /// Replaces the whole list.
    All(Vec<T>),
    /// Adds or replaces items by name; `None` removes one.
    Named(Vec<(String, Option<T>)>),
}

impl<T> Change<T> {
    /// Adds or replaces one item.
    pub fn put(name: &str, value: T) -> Self {
        Self::Named(vec![(name.to_owned(), Some(value))])
    }

    /// Removes an item by name.
    pub fn remove(name: &str) -> Self {
        Self::Named(vec![(name.to_owned(), None)])
    }

    /// Whether the change has no effect.
    pub fn is_nothing(&self) -> bool {
        matches!(self, Self::Nothing)
    }

    /// Converts the change to another item type, item by item.
    pub(super) fn map<U, E>(&self, mut make: impl FnMut(&T) -> Result<U, E>) -> Result<Change<U>, E> {
        Ok(match self {
            Self::Nothing => Change::Nothing,
            Self::All(all) => Change::All(all.iter().map(make).collect::<Result<_, E>>()?),
            Self::Named(named) => {
                let one = |(name, value): &(String, Option<T>)| {
                    Ok((name.clone(), value.as_ref().map(&mut make).transpose()?))
                };
                Change::Named(named.iter().map(one).collect::<Result<_, E>>()?)
            }
        })
    }
}

impl<T: Clone> Change<T> {
    /// Returns the list after the change. The error names an item that is to be removed but does not exist. `kind` is the name of the list.
    pub(crate) fn applied(&self, list: &[T], kind: &str, name_of: impl Fn(&T) -> &str) -> Result<Vec<T>, String> {
        let mut list = match self {
            Self::Nothing => return Ok(list.to_vec()),
            Self::All(all) => return Ok(all.clone()),
            Self::Named(_) => list.to_vec(),
        };
        let Self::Named(named) = self else { return Ok(list) };
        for (name, value) in named {
            let place = list.iter().position(|one| name_of(one) == name);
            match (place, value) {
                (Some(place), Some(value)) => list[place] = value.clone(),
                (None, Some(value)) => list.push(value.clone()),
                (Some(place), None) => {
                    list.remove(place);
                }
                (None, None) => {
                    let names = listed(list.iter().map(&name_of));
                    return Err(format!(
                        "{kind}.{name}: cannot be removed because it does not exist; the existing ones are: {names}"
                    ));
                }
            }
        }
        Ok(list)
    }
}

/// Textures and shapes of the configuration that clients can refer to by name.
#[derive(Clone, Debug, Default)]
pub(crate) struct Library {
    textures: Vec<(String, Arc<Texture>)>,
    shapes: Vec<(String, ShapeSource)>,
}

/// Returns the item of the library that has a name.
fn known<T: Clone>(list: &[(String, T)], name: &str, key: &str, what: &str) -> Result<T, String> {
    if let Some((_, found)) = list.iter().find(|(known, _)| known == name) {
        return Ok(found.clone());
    }
    let names = listed(list.iter().map(|(name, _)| name.as_str()));
    Err(format!("{key} = `{name}`: must be one of the {what} of the configuration: {names}"))
}

/// Bodies, asteroid fields and observer of a scene.
#[derive(Clone, Debug)]
pub(crate) struct Objects {
    /// The placed objects that are drawn.
    pub(crate) drawn: Arc<SceneObjects>,
    /// The fields with their definitions.
    made: Arc<Vec<MadeField>>,
    library: Arc<Library>,
    /// The observer as it was defined, if there is one.
    observer: Option<Arc<GivenObserver>>,
}

/// A prepared change: its fields are placed.
#[derive(Clone, Debug, Default)]
pub(crate) struct MadeChange {
    bodies: Change<Arc<Body>>,
    fields: Change<MadeField>,
    observer: Option<MadeObserver>,
}

impl Objects {
    /// Creates the objects that the daemon starts with from the placed objects, the definitions of their fields (`specs`) and of their observer
    /// (`observer`). The error names definitions that do not match.
    pub(crate) fn new(
        drawn: Arc<SceneObjects>,
        specs: &[Arc<FieldSpec>],
        observer: Option<ObserverConfig>,
    ) -> Result<Self, String> {
        let places = [drawn.observer.map(|observer| observer.place), observer.as_ref().map(ObserverConfig::place)];
        if places[0] != places[1] {
            return Err(format!("the scene has an observer at {:?}, but its definition is {:?}", places[0], places[1]));
        }
        let observer = observer.map(|given| Arc::new(GivenObserver::new(given, &drawn)));
        let [of_fields, of_specs] = [
            drawn.fields.iter().map(|field| field.name.as_str()).collect::<Vec<_>>(),
            specs.iter().map(|spec| spec.name.as_str()).collect(),
        ];
        if of_fields != of_specs {
            return Err(format!("the scene has the fields {of_fields:?}, but the definitions are for {of_specs:?}"));
        }
        let made = specs.iter().zip(&drawn.fields);
        let made = made.map(|(spec, field)| MadeField { spec: Arc::clone(spec), field: Arc::clone(field) }).collect();
        let texture = |body: &Arc<Body>| Some((body.name.clone(), Arc::clone(body.surface.texture.as_ref()?)));
        let shapes = specs.iter().filter(|spec| matches!(spec.shapes, ShapeSource::Files(_)));
        let library = Library {
            textures: drawn.bodies.iter().filter_map(texture).collect(),
            shapes: shapes.map(|spec| (spec.name.clone(), spec.shapes.clone())).collect(),
        };
        Ok(Self { drawn, made: Arc::new(made), library: Arc::new(library), observer })
    }

    /// Returns the observer as it was defined.
    pub(crate) fn observer(&self) -> Option<&GivenObserver> {
        self.observer.as_deref()
    }

    /// Returns the bodies as clients see them, at a time in s since 2000-01-01T12:00:00Z.
    pub(crate) fn body_forms(&self, time_s: f64) -> Vec<BodyForm> {
        let moved = (time_s != self.drawn.time_s).then(|| self.drawn.at(time_s));
        let form = |body: &Arc<Body>| {
            let texture = body.surface.texture.as_ref();
            let lent = texture.and_then(|own| self.library.textures.iter().find(|(_, lent)| Arc::ptr_eq(lent, own)));
            BodyForm { texture_of: lent.map(|(name, _)| name.clone()), ..BodyForm::from((**body).clone()) }
        };
        moved.as_ref().unwrap_or(&self.drawn).bodies.iter().map(form).collect()
    }

    /// Returns the fields as clients see them.
    pub(crate) fn field_specs(&self) -> Vec<FieldSpec> {
        let seen = |made: &MadeField| {
            let spec = &made.spec;
            let lent = || self.library.shapes.iter().find(|(_, source)| *source == spec.shapes);
            let shapes = match &spec.shapes {
                ShapeSource::Files(_) => {
                    ShapeSource::OfField(lent().map_or_else(String::new, |(name, _)| name.clone()))
                }
                other => other.clone(),
            };
            FieldSpec { shapes, ..(**spec).clone() }
        };
        self.made.iter().map(seen).collect()
    }

    /// Checks that ephemeris kernels cover the time after a client's change of `before`. This concerns all bodies if the change sets the time,
    /// otherwise only new bodies. A running scene that leaves the range of its kernels continues, and so does one from a state file.
    pub(crate) fn check_covered(&self, before: &Self, sets_time: bool) -> Result<(), String> {
        let moment = Moment::new(self.drawn.time_s, self.drawn.observer.as_ref());
        let stood = |body: &Body| {
            before.drawn.bodies.iter().any(|old| (&old.name, old.ephemeris) == (&body.name, body.ephemeris))
        };
        for body in self.drawn.bodies.iter().filter(|body| sets_time || !stood(body)) {
            let Some(of) = body.ephemeris else { continue };
            check_place(of, self.drawn.kernels.as_deref(), &moment)
                .map_err(|problem| format!("bodies.{}: ephemeris = {problem}", body.name))?;
        }
        Ok(())
    }

    fn body(&self, form: &BodyForm) -> Result<Arc<Body>, String> {
        let prefixed = |problem: &dyn Display| format!("bodies.{}: {problem}", form.body.name);
        let mut body = form.body.clone();
        body.surface.texture = match &form.texture_of {
            Some(name) => Some(
                known(&self.library.textures, name, "texture_of", "bodies with a texture").map_err(|e| prefixed(&e))?,
            ),
            None => None,
        };
        body.check().map_err(|error| prefixed(&error))?;
        if let Some(of) = body.ephemeris {
            let moment = Moment::new(self.drawn.time_s, self.drawn.observer.as_ref());
            let placed = moment.place(of, self.drawn.kernels.as_deref());
            placed.map_err(|problem| prefixed(&format!("ephemeris = {problem}")))?;
        }
        // Reuse an equal body, because the data that were prepared for it stay valid.
        let same = self.drawn.bodies.iter().find(|old| ***old == body);
        Ok(same.map_or_else(|| Arc::new(body), Arc::clone))
    }

    /// Returns the specification of a field with the files of the shapes that it refers to, checked.
    fn spec(&self, given: &FieldSpec) -> Result<Arc<FieldSpec>, String> {
        let prefixed = |problem: &dyn Display| format!("asteroid_fields.{}: {problem}", given.name);
        let mut spec = given.clone();
        if let ShapeSource::OfField(name) = &given.shapes {
            let found = known(&self.library.shapes, name, "shapes_of", "fields with shapes from files");
            spec.shapes = found.map_err(|problem| prefixed(&problem))?;
        }
        spec.check().map_err(|error| prefixed(&error))?;
        Ok(Arc::new(spec))
    }

    /// Prepares a change, which takes long if asteroids have to be placed. Nothing is prepared if the change is
    /// invalid.
    pub(crate) fn make(
        &self,
        bodies: &Change<BodyForm>,
        fields: &Change<FieldSpec>,
        observer: &ObserverChange,
    ) -> Result<MadeChange, String> {
        let observer = match (self.observer.as_deref().zip(self.drawn.observer.as_ref()), observer.is_nothing()) {
            (_, true) => None,
            (Some((given, now)), false) => Some(given.changed(observer, now)?),
            (None, false) => {
                return Err("observer: the scene has none; define scene.observer in the configuration".to_owned());
            }
        };
        let bodies = bodies.map(|form| self.body(form))?;
        let specs = fields.map(|given| self.spec(given))?;
        let now: Vec<Arc<FieldSpec>> = self.made.iter().map(|made| Arc::clone(&made.spec)).collect();
        let after = specs.applied(&now, "asteroid_fields", |spec| &spec.name)?;
        check_fields(after.iter().map(Arc::as_ref)).map_err(|(_, error)| format!("asteroid_fields: {error}"))?;
        let made = make_fields(&after, &self.made)
            .map_err(|(index, error)| format!("asteroid_fields.{}: {error}", after[index].name))?;
        let fields = specs.map(|spec| {
            let found = made.iter().find(|made| made.spec == *spec);
            found.cloned().ok_or_else(|| format!("asteroid_fields.{}: given more than once", spec.name))
        })?;
        Ok(MadeChange { bodies, fields, observer })
    }

    /// Returns the objects after a change, at a time.
    pub(crate) fn changed(&self, change: &MadeChange, time_s: f64) -> Result<Self, String> {
        let stays = change.bodies.is_nothing() && change.fields.is_nothing() && change.observer.is_none();
        if stays && time_s == self.drawn.time_s {
            return Ok(self.clone());
        }
        let bodies = change.bodies.applied(&self.drawn.bodies, "bodies", |body| &body.name)?;
        check_names(bodies.iter().map(|body| body.name.as_str()), MOST_BODIES)
            .map_err(|(_, error)| format!("bodies: {error}"))?;
        check_suns(bodies.iter().map(|body| body.as_ref())).map_err(|(_, error)| format!("bodies: {error}"))?;
        let made = change.fields.applied(&self.made, "asteroid_fields", |made| &made.spec.name)?;
        check_fields(made.iter().map(|made| made.spec.as_ref()))
            .map_err(|(_, error)| format!("asteroid_fields: {error}"))?;
        let made_observer = change.observer.as_ref();
        let surroundings = match made_observer {
            Some(made) => made.surroundings.clone(),
            None => self.drawn.surroundings.clone(),
        };
        let drawn = SceneObjects {
            bodies,
            fields: made.iter().map(|made| Arc::clone(&made.field)).collect(),
            time_s,
            observer: made_observer.map(|made| made.observer).or(self.drawn.observer),
            kernels: self.drawn.kernels.clone(),
            surroundings,
            local_sky: None,
            earth_m: None,
            zodiacal_light: self.drawn.zodiacal_light,
            overlay: Arc::clone(&self.drawn.overlay),
        }
        .placed();
        let observer = made_observer.map(|made| Arc::new(made.given.clone())).or_else(|| self.observer.clone());
        Ok(Self { drawn: Arc::new(drawn), made: Arc::new(made), library: Arc::clone(&self.library), observer })
    }
}
