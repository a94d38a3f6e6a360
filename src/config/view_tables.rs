//! The tables `exposure`, `glare` and `tone_map` that views may have of their own, and their groups: what they come to together with the
//! general tables. A configuration is checked by this, and so is what clients change later.

use std::path::Path;

use serde::{Serialize, de::DeserializeOwned};
use toml::{Table, Value};

use super::document::deserialise;
use super::error::Fault;
use super::{effects, limits, ranges};
use crate::plan::settings::{ExposureSettings, RenderSettings, StarMethod};
use crate::plan::view_settings::{ExposureGroup, ViewSettings};
use crate::view::check_name;

/// Letters of the name of a group at most: clients give such names.
const MOST_GROUP_LETTERS: usize = 64;

/// What one view has of its own; keys that its tables do not give are those of the general tables.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ViewTables {
    /// The group that it shares one exposure with.
    pub exposure_group: Option<String>,
    /// Keys of `[exposure]`.
    pub exposure: Option<Table>,
    /// Keys of `[glare]`.
    pub glare: Option<Table>,
    /// Keys of `[tone_map]`.
    pub tone_map: Option<Table>,
}

/// What is wrong with the tables of a view.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{key}: {problem}")]
pub struct ViewTablesError {
    /// Number of the view.
    pub view: usize,
    /// The key within the view.
    pub key: String,
    /// What is wrong and what is allowed.
    pub problem: String,
}

/// General settings with what a table gives; a fault names the key below `name`.
pub(super) fn merged<T: Serialize + DeserializeOwned>(general: &T, own: &Table, name: &str) -> Result<T, Fault> {
    let general = Value::try_from(general).map_err(|error| Fault::new(name, error.to_string()))?;
    let Value::Table(mut table) = general else { return Err(Fault::new(name, "a table is needed")) };
    table.extend(own.clone());
    deserialise(Value::Table(table), name)
}

/// The settings of one view, with the exposure of its own table alone.
fn settings_of(
    general: &RenderSettings,
    name: &str,
    tables: &ViewTables,
    folder: &Path,
) -> Result<ViewSettings, Fault> {
    let mut settings = ViewSettings::general(general);
    let given = [("exposure", &tables.exposure), ("glare", &tables.glare), ("tone_map", &tables.tone_map)];
    let sections = given.iter().filter_map(|(key, table)| Some(((*key).to_owned(), Value::Table((*table).clone()?))));
    let sections: Table = sections.collect();
    if let Some(own) = &tables.exposure {
        settings.exposure = merged(&general.exposure, own, "exposure")?;
        settings.group = ExposureGroup::OfView(name.to_owned());
    }
    if let Some(own) = &tables.glare {
        settings.glare = merged(&general.glare, own, "glare")?;
        if own.contains_key("psf_file") {
            settings.glare.psf_file = settings.glare.psf_file.map(|file| folder.join(file));
        }
    }
    if let Some(own) = &tables.tone_map {
        settings.tone_map = merged(&general.tone_map, own, "tone_map")?;
    }
    ranges::check(&sections)?;
    if let Some(own) = &tables.exposure {
        limits::check_exposure(&settings.exposure, own, general.stars.method)
            .map_err(|fault| fault.within("exposure"))?;
    }
    limits::check_glare(&settings.glare).map_err(|fault| fault.within("glare"))?;
    limits::check_tone_map(&settings.tone_map).map_err(|fault| fault.within("tone_map"))?;
    if let Some(group) = &tables.exposure_group {
        if check_name(group).is_err() || group.len() > MOST_GROUP_LETTERS {
            let shown: String = group.chars().take(MOST_GROUP_LETTERS).collect();
            let problem = format!(
                "`{shown}`: allowed are letters, digits, `_` and `-`, at least one and at most {MOST_GROUP_LETTERS}"
            );
            return Err(Fault::new("exposure_group", problem));
        }
        settings.group = ExposureGroup::Named(group.clone());
    }
    Ok(settings)
}

/// The settings of every view, by their names and tables. Relative paths start at `folder`.
///
/// # Errors
///
/// The first table that has an unknown key, one without effect or a value that is not allowed, or that gives a group another exposure than
/// a view before.
pub fn resolve_views(
    general: &RenderSettings,
    views: &[(&str, &ViewTables)],
    folder: &Path,
) -> Result<Vec<ViewSettings>, ViewTablesError> {
    let at = |view: usize| move |fault: Fault| ViewTablesError { view, key: fault.key, problem: fault.problem };
    let mut all: Vec<ViewSettings> = Vec::with_capacity(views.len());
    for (index, (name, tables)) in views.iter().enumerate() {
        all.push(settings_of(general, name, tables, folder).map_err(at(index))?);
    }
    // The first table of a group is that of all of its views.
    for index in 0..views.len() {
        let group = all[index].group.clone();
        let tells = |view: &usize| all[*view].group == group && views[*view].1.exposure.is_some();
        let Some(first) = (0..views.len()).find(tells) else { continue };
        let of_group = all[first].exposure;
        if views[index].1.exposure.is_some() && all[index].exposure != of_group {
            let (group, name) = (views[index].1.exposure_group.as_deref().unwrap_or_default(), views[first].0);
            let problem = format!(
                "exposure_group `{group}` has the exposure of views[{first}] (view `{name}`), and a group has one: \
                 allowed are an equal table, none, or another exposure_group"
            );
            return Err(at(index)(Fault::new("exposure", problem)));
        }
        all[index].exposure = of_group;
    }
    Ok(all)
}

impl ViewTables {
    /// Whether the view has nothing of its own.
    pub fn is_empty(&self) -> bool {
        *self == Self::default()
    }

    /// Leaves the keys of the exposure out that have no effect with its mode, but those that are to be `kept`: for changes of
    /// the mode, after which they would be refused.
    pub fn leave_out_without_effect(
        &mut self,
        general: &ExposureSettings,
        stars: StarMethod,
        kept: impl Fn(&str) -> bool,
    ) {
        if let Some(own) = &mut self.exposure
            && let Ok(exposure) = merged(general, own, "")
        {
            effects::leave_out(own, &exposure, stars, kept);
        }
    }
}
