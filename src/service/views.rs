//! What of views clients may change: exposure, glare and tone mapping of their own, and the groups that share an exposure.
//!
//! Tables have the keys of configurations and are checked as those are; keys that they do not give are those of the general tables. The
//! exposure of a named group belongs to the group, whoever of its views was asked to change it.

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};

use toml::{Table, Value};

use crate::{
    config::{ViewTables, resolve_views},
    plan::{settings::RenderSettings, view_settings::ViewSettings},
};

/// A change of one of the tables of a view.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum TableChange {
    /// It stays.
    #[default]
    Nothing,
    /// This takes its place; an empty one leaves the view the general settings.
    All(Table),
    /// Keys that change; `None` leaves the general value.
    Keys(Vec<(String, Option<Value>)>),
}

/// Changes of a view; what is `None` or [`TableChange::Nothing`] stays.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ViewUpdate {
    /// The group whose exposure it shares; empty: none.
    pub exposure_group: Option<String>,
    /// Keys of `[exposure]`; of the whole group where the view is in one.
    pub exposure: TableChange,
    /// Keys of `[glare]` but `psf_file`: files are the configuration's.
    pub glare: TableChange,
    /// Keys of `[tone_map]`.
    pub tone_map: TableChange,
}

impl TableChange {
    fn apply(&self, table: &mut Table) {
        match self {
            Self::Nothing => {}
            Self::All(all) => table.clone_from(all),
            Self::Keys(keys) => {
                for (key, value) in keys {
                    match value {
                        Some(value) => table.insert(key.clone(), value.clone()),
                        None => table.remove(key),
                    };
                }
            }
        }
    }

    /// Whether it gives that key.
    fn names(&self, key: &str) -> bool {
        match self {
            Self::Nothing => false,
            Self::All(all) => all.contains_key(key),
            Self::Keys(keys) => keys.iter().any(|(name, value)| name == key && value.is_some()),
        }
    }
}

/// What one view has of its own. Empty tables are none.
#[derive(Clone, Debug, Default)]
struct Own {
    group: Option<String>,
    /// Of a view that is in no group.
    exposure: Table,
    glare: Table,
    tone_map: Table,
}

/// The settings of all views.
#[derive(Clone, Debug)]
pub(super) struct ViewSet {
    names: Vec<String>,
    folder: PathBuf,
    own: Vec<Own>,
    /// Exposures of groups.
    groups: BTreeMap<String, Table>,
    /// What it comes to, view by view.
    pub(super) settings: Vec<ViewSettings>,
}

fn some(table: &Table) -> Option<Table> {
    Some(table.clone()).filter(|table| !table.is_empty())
}

impl ViewSet {
    /// Views of these names; `tables` has what they have of their own, or is empty. The error says what is wrong with it.
    pub(super) fn new(
        general: &RenderSettings,
        names: Vec<String>,
        tables: &[ViewTables],
        folder: &Path,
    ) -> Result<Self, String> {
        // All of them as they stand: of the tables of a group none is preferred.
        let given: Vec<(&str, &ViewTables)> = names.iter().map(String::as_str).zip(tables).collect();
        resolve_views(general, &given, folder).map_err(|error| format!("views[{}]: {error}", error.view))?;
        let mut groups = BTreeMap::new();
        let mut own = Vec::with_capacity(names.len());
        for index in 0..names.len() {
            let tables = tables.get(index).cloned().unwrap_or_default();
            let mut exposure = tables.exposure.unwrap_or_default();
            if let Some(group) = &tables.exposure_group {
                let of_group: &mut Table = groups.entry(group.clone()).or_default();
                if !exposure.is_empty() {
                    *of_group = std::mem::take(&mut exposure);
                }
            }
            own.push(Own {
                group: tables.exposure_group,
                exposure,
                glare: tables.glare.unwrap_or_default(),
                tone_map: tables.tone_map.unwrap_or_default(),
            });
        }
        Self { names, folder: folder.to_owned(), own, groups, settings: Vec::new() }.resolved(general)
    }

    /// Names of the views.
    pub(super) fn names(&self) -> &[String] {
        &self.names
    }

    /// The same views with other tables; the error says what is wrong with them.
    pub(super) fn with_tables(&self, general: &RenderSettings, tables: &[ViewTables]) -> Result<Self, String> {
        Self::new(general, self.names.clone(), tables, &self.folder)
    }

    /// The tables of a view as a configuration would have them; a group's exposure stands with its first view.
    pub(super) fn tables(&self, view: usize) -> ViewTables {
        let Own { group, exposure, glare, tone_map } = &self.own[view];
        let exposure = match group {
            Some(name) => {
                let is_first = self.own[..view].iter().all(|other| other.group != *group);
                self.groups.get(name).filter(|_| is_first).and_then(some)
            }
            None => some(exposure),
        };
        ViewTables { exposure_group: group.clone(), exposure, glare: some(glare), tone_map: some(tone_map) }
    }

    fn resolved(mut self, general: &RenderSettings) -> Result<Self, String> {
        let tables: Vec<ViewTables> = (0..self.names.len()).map(|view| self.tables(view)).collect();
        let views: Vec<(&str, &ViewTables)> = self.names.iter().map(String::as_str).zip(&tables).collect();
        self.settings = resolve_views(general, &views, &self.folder)
            .map_err(|error| format!("{}: {}", error.key, error.problem))?;
        Ok(self)
    }

    /// Name of the group that a view is in; empty: none.
    pub(super) fn group_of(&self, view: usize) -> &str {
        self.own[view].group.as_deref().unwrap_or_default()
    }

    /// The keys that are not the general ones for a view, with the name of their table: `glare.fraction`.
    pub(super) fn own_keys(&self, view: usize) -> Vec<String> {
        let Own { group, exposure, glare, tone_map } = &self.own[view];
        let exposure = group.as_ref().and_then(|name| self.groups.get(name)).unwrap_or(exposure);
        [("exposure", exposure), ("glare", glare), ("tone_map", tone_map)]
            .into_iter()
            .flat_map(|(name, table)| table.keys().map(move |key| format!("{name}.{key}")))
            .collect()
    }

    /// The views after a change of one of them; the error says what is not allowed.
    pub(super) fn changed(&self, general: &RenderSettings, view: usize, update: &ViewUpdate) -> Result<Self, String> {
        let mut changed = self.clone();
        let own = &mut changed.own[view];
        if let Some(group) = &update.exposure_group {
            let group = Some(group.clone()).filter(|group| !group.is_empty());
            if own.group != group {
                // A group that is new begins with the exposure of its first view.
                let exposure = std::mem::take(&mut own.exposure);
                if let Some(group) = &group {
                    changed.groups.entry(group.clone()).or_insert(exposure);
                }
                own.group = group;
            }
        }
        let file = own.glare.get("psf_file").cloned();
        update.glare.apply(&mut own.glare);
        if update.glare.names("psf_file") {
            // The one in effect may be sent back with the rest.
            let in_effect = self.settings[view].glare.psf_file.as_ref().map(|file| file.display().to_string());
            let given = own.glare.remove("psf_file");
            if given.as_ref().and_then(Value::as_str) != in_effect.as_deref() {
                let allowed = in_effect.unwrap_or_else(|| "none".to_owned());
                return Err(format!("glare.psf_file: files are those of the configuration: allowed is {allowed}"));
            }
            own.glare.extend(file.map(|file| ("psf_file".to_owned(), file)));
        }
        update.tone_map.apply(&mut own.tone_map);
        let exposure = match &own.group {
            Some(group) => changed.groups.entry(group.clone()).or_default(),
            None => &mut own.exposure,
        };
        update.exposure.apply(exposure);
        if update.exposure.names("mode") || update.exposure.names("metering") {
            let mut tables = ViewTables { exposure: some(exposure), ..ViewTables::default() };
            tables.leave_out_without_effect(&general.exposure, general.stars.method, |key| update.exposure.names(key));
            *exposure = tables.exposure.unwrap_or_default();
        }
        let in_use: Vec<Option<String>> = changed.own.iter().map(|own| own.group.clone()).collect();
        changed.groups.retain(|group, _| in_use.contains(&Some(group.clone())));
        changed.resolved(general)
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "what must not happen in a test may panic")]
mod tests {
    use super::*;
    use crate::plan::{
        settings::{ExposureMode, Metering},
        view_settings::ExposureGroup,
    };

    fn table(text: &str) -> Table {
        text.parse().unwrap()
    }

    fn keys(text: &str) -> TableChange {
        TableChange::Keys(table(text).into_iter().map(|(key, value)| (key, Some(value))).collect())
    }

    fn views(tables: &[ViewTables]) -> ViewSet {
        let names = ["a", "b", "c"].map(str::to_owned).to_vec();
        ViewSet::new(&RenderSettings::default(), names, tables, Path::new("")).unwrap()
    }

    fn changed(views: &ViewSet, view: usize, update: ViewUpdate) -> Result<ViewSet, String> {
        views.changed(&RenderSettings::default(), view, &update)
    }

    #[test]
    fn a_change_concerns_its_view_and_the_rest_is_inherited() {
        let before = views(&[]);
        assert!(before.settings.iter().all(|view| view.group == ExposureGroup::General));
        let update = ViewUpdate {
            glare: keys("fraction = 0.25"),
            exposure: keys("limiting_magnitude = 8.0"),
            ..Default::default()
        };
        let after = changed(&before, 1, update).unwrap();
        assert_eq!(after.settings[1].glare.fraction, 0.25);
        assert_eq!(after.settings[1].exposure.limiting_magnitude, 8.0);
        assert_eq!(after.settings[1].group, ExposureGroup::OfView("b".to_owned()));
        assert_eq!([&after.settings[0], &after.settings[2]], [&before.settings[0], &before.settings[2]]);
        assert_eq!(after.own_keys(1), ["exposure.limiting_magnitude", "glare.fraction"]);
        // Nothing of its own again.
        let reset = ViewUpdate {
            exposure: TableChange::All(Table::new()),
            glare: TableChange::Keys(vec![("fraction".to_owned(), None)]),
            ..Default::default()
        };
        assert_eq!(changed(&after, 1, reset).unwrap().settings, before.settings);
    }

    #[test]
    fn a_group_has_one_exposure_whoever_changes_it() {
        let join = |group: &str| ViewUpdate { exposure_group: Some(group.to_owned()), ..Default::default() };
        let before = views(&[]);
        let named =
            changed(&before, 0, ViewUpdate { exposure: keys("mode = 'manual'\nev100 = 2.0"), ..join("g") }).unwrap();
        let both = changed(&named, 2, join("g")).unwrap();
        assert_eq!((both.settings[2].exposure, both.group_of(2)), (both.settings[0].exposure, "g"));
        let brighter = changed(&both, 2, ViewUpdate { exposure: keys("ev100 = 1.0"), ..Default::default() }).unwrap();
        assert_eq!([0, 2].map(|view| brighter.settings[view].exposure.ev100), [1.0; 2]);
        assert_eq!(brighter.settings[1], before.settings[1]);
        // Who leaves takes nothing along, and the group stays as it is.
        let left = changed(&brighter, 0, join("")).unwrap();
        assert_eq!(left.settings[0], before.settings[0]);
        assert_eq!(left.settings[2].exposure.ev100, 1.0);
        assert_eq!(changed(&left, 2, join("")).unwrap().settings, before.settings);
        assert!(changed(&before, 0, join("a b")).unwrap_err().contains("exposure_group"));
    }

    #[test]
    fn another_mode_leaves_out_what_it_has_no_use_for_but_not_what_is_asked_for() {
        let tables =
            ViewTables { exposure: Some(table("limiting_magnitude = 5.0\nadaptation_s = 0.0")), ..Default::default() };
        let before = views(&[tables]);
        let mean =
            changed(&before, 0, ViewUpdate { exposure: keys("metering = 'mean'"), ..Default::default() }).unwrap();
        assert_eq!(mean.settings[0].exposure.metering, Metering::Mean);
        assert_eq!(mean.own_keys(0), ["exposure.adaptation_s", "exposure.metering"]);
        let manual = changed(&mean, 0, ViewUpdate { exposure: keys("mode = 'manual'"), ..Default::default() }).unwrap();
        assert_eq!(manual.settings[0].exposure.mode, ExposureMode::Manual);
        let wrong = ViewUpdate { exposure: keys("mode = 'manual'\nkey = 0.2"), ..Default::default() };
        assert!(
            changed(&before, 0, wrong).unwrap_err().starts_with("exposure.key: has no effect with mode = \"manual\"")
        );
        for (update, told) in [
            (ViewUpdate { exposure: keys("spot_deg = 5.0"), ..Default::default() }, "exposure.spot_deg: has no effect"),
            (
                ViewUpdate { glare: keys("fraction = 2.0"), ..Default::default() },
                "glare.fraction: 2: allowed are 0 to 1",
            ),
            (ViewUpdate { tone_map: keys("gamma = 2.0"), ..Default::default() }, "tone_map.gamma: unknown key"),
        ] {
            let problem = changed(&before, 0, update).unwrap_err();
            assert!(problem.starts_with(told), "{problem}");
        }
    }
}
