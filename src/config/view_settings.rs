//! The settings of views: the general tables, changed by the views' own `exposure`, `glare` and `tone_map` keys, and the groups that share one
//! exposure. This module checks configurations, and also every later change by a client.

use std::path::Path;

use super::keys::table_of;
use super::{limits, views::ViewSpec};
use crate::plan::settings::RenderSettings;
use crate::plan::view_settings::{ExposureGroup, ViewSettings};
use crate::ranges;
use crate::ranges::{KeyEffects, KeyError};
use crate::view::check_name;
use schemars::JsonSchema;
use serde::Serialize;
use toml::Value;

/// Maximum number of characters in the name of a group. Clients may choose such names.
const MOST_GROUP_LETTERS: usize = 64;

/// An error in the settings of a view.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{key}: {problem}")]
pub struct ViewSettingsError {
    /// Index of the view.
    pub view: usize,
    /// The key within the view.
    pub key: String,
    /// The problem, and the valid values.
    pub problem: String,
}

/// Checks the numbers of partial settings; an error names the key below `name`.
fn check_numbers<T: Serialize + JsonSchema + 'static>(keys: &T, name: &str) -> Result<(), KeyError> {
    let table = Value::Table(table_of(keys).map_err(|fault| fault.within(name))?);
    ranges::check::<T>(&table).map_err(|error| error.within(name))
}

/// Returns the settings of one view with its own exposure, regardless of its group.
fn settings_alone(general: &RenderSettings, spec: &ViewSpec, folder: &Path) -> Result<ViewSettings, KeyError> {
    let mut settings = ViewSettings::general(general);
    if let Some(own) = &spec.exposure {
        check_numbers(own, "exposure")?;
        settings.exposure = limits::check_exposure(own, &general.exposure, general.stars.method)
            .map_err(|fault| fault.within("exposure"))?;
        settings.group = ExposureGroup::OfView(spec.name.clone());
    }
    if let Some(own) = &spec.glare {
        check_numbers(own, "glare")?;
        general.glare.check_effects(own).map_err(|fault| fault.within("glare"))?;
        let mut own = own.clone();
        own.psf_file = own.psf_file.map(|file| folder.join(file));
        settings.glare = general.glare.with(&own);
    }
    if let Some(own) = &spec.tone_map {
        check_numbers(own, "tone_map")?;
        general.tone_map.check_effects(own).map_err(|fault| fault.within("tone_map"))?;
        settings.tone_map = general.tone_map.with(own);
    }
    limits::check_glare(&settings.glare).map_err(|fault| fault.within("glare"))?;
    limits::check_tone_map(&settings.tone_map).map_err(|fault| fault.within("tone_map"))?;
    if let Some(group) = &spec.exposure_group {
        if check_name(group).is_err() || group.len() > MOST_GROUP_LETTERS {
            let shown: String = group.chars().take(MOST_GROUP_LETTERS).collect();
            let problem = format!(
                "`{shown}`: must have between 1 and {MOST_GROUP_LETTERS} characters: letters, digits, `_` and `-`"
            );
            return Err(KeyError::new("exposure_group", problem));
        }
        settings.group = ExposureGroup::Named(group.clone());
    }
    Ok(settings)
}

/// Returns the settings of every view. Relative paths refer to `folder`.
///
/// # Errors
///
/// The first key that has no effect or an invalid value, or an exposure that differs from that of an earlier view of the same group.
pub fn resolve_views<'a>(
    general: &RenderSettings,
    views: impl IntoIterator<Item = &'a ViewSpec>,
    folder: &Path,
) -> Result<Vec<ViewSettings>, ViewSettingsError> {
    let error = |view: usize| move |fault: KeyError| ViewSettingsError { view, key: fault.key, problem: fault.problem };
    let specs: Vec<&ViewSpec> = views.into_iter().collect();
    let settings =
        specs.iter().enumerate().map(|(index, spec)| settings_alone(general, spec, folder).map_err(error(index)));
    let mut all: Vec<ViewSettings> = settings.collect::<Result<_, _>>()?;
    // The first exposure given in a group applies to all views of the group.
    for index in 0..specs.len() {
        let group = all[index].group.clone();
        let gives_exposure = |view: &usize| all[*view].group == group && specs[*view].exposure.is_some();
        let Some(first) = (0..specs.len()).find(gives_exposure) else { continue };
        let of_group = all[first].exposure;
        if specs[index].exposure.is_some() && all[index].exposure != of_group {
            let (group, name) = (specs[index].exposure_group.as_deref().unwrap_or_default(), &specs[first].name);
            let problem = format!(
                "exposure_group `{group}` already has the exposure of views[{first}] (view `{name}`), and a group has only one: \
                 give an equal table, none, or another exposure_group"
            );
            return Err(error(index)(KeyError::new("exposure", problem)));
        }
        all[index].exposure = of_group;
    }
    Ok(all)
}

impl From<ViewSettingsError> for KeyError {
    fn from(ViewSettingsError { key, problem, .. }: ViewSettingsError) -> Self {
        Self { key, problem }
    }
}
