//! The views of a scene, and the parts that clients may change: the list of views, their geometry, their own exposure, glare and
//! tone mapping, and the groups that share an exposure.
//!
//! Tables have the keys of configurations and are validated in the same way; missing keys come from the general tables.
//! The exposure of a named group belongs to the group: a change through any of its views changes it. Requests for
//! frames refer to a view by its [`ViewId`], because its index in the rig changes when another view is deleted.

#[cfg(test)]
mod tests;

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
    sync::{
        Arc,
        atomic::{AtomicU64, Ordering::Relaxed},
    },
};

use toml::{Table, Value};

use crate::{
    config::{ViewConfig, ViewTables, ViewTablesError, resolve_views},
    plan::{
        settings::RenderSettings,
        view_settings::{FrameGroup, ViewSettings, frame_groups},
    },
    view::{Rig, View},
};

/// Key under which clients send a view's geometry.
const DEFINITION: &str = "definition";

/// Identity of a view: a number that is never reused, even for a new view of the same name. It is valid within the
/// process only.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) struct ViewId(u64);

impl ViewId {
    /// The view of a headset, which is not part of the scene's rig.
    pub(crate) const HEADSET: Self = Self(0);

    fn new() -> Self {
        static NEXT: AtomicU64 = AtomicU64::new(1);
        Self(NEXT.fetch_add(1, Relaxed))
    }
}

/// A change of one of a view's tables.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum TableChange {
    /// No change.
    #[default]
    Nothing,
    /// Replaces the table; an empty table restores the general settings.
    All(Table),
    /// Changes of keys; `None` restores the general value.
    Keys(Vec<(String, Option<Value>)>),
}

/// Changes of a view; `None` and [`TableChange::Nothing`] keep a value.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ViewUpdate {
    /// Keys of the geometry: `type`, those of the type, `orientation` and `position_m`.
    pub definition: TableChange,
    /// Whether display images show a test pattern.
    pub test_pattern: Option<bool>,
    /// Exposure group; empty: none.
    pub exposure_group: Option<String>,
    /// Keys of `[exposure]`; they apply to the whole group if the view is in one.
    pub exposure: TableChange,
    /// Keys of `[glare]` except `psf_file`: files come only from the configuration.
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

    /// Whether the change sets a key.
    fn names(&self, key: &str) -> bool {
        match self {
            Self::Nothing => false,
            Self::All(all) => all.contains_key(key),
            Self::Keys(keys) => keys.iter().any(|(name, value)| name == key && value.is_some()),
        }
    }
}

/// A view as defined by a configuration, a client or a state file.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct GivenView {
    pub(crate) view: View,
    /// Keys of the geometry; `None` if the program derived it from another source.
    pub(crate) definition: Option<Table>,
    /// The view's own settings.
    pub(crate) tables: ViewTables,
}

impl GivenView {
    /// Reads a view from a table of `[[views]]`, and whether it shows a test pattern; the error names the key within
    /// the table.
    pub(crate) fn read(table: Table) -> Result<(Self, bool), String> {
        let (config, view) = ViewConfig::read(table).map_err(|error| error.within(DEFINITION).to_string())?;
        let ViewConfig { definition, tables, test_pattern, .. } = config;
        Ok((Self { view, definition: Some(definition), tables }, test_pattern))
    }

    /// Creates a view from a name and the keys of its geometry.
    fn defined(name: &str, definition: &Table) -> Result<Self, String> {
        let mut table = definition.clone();
        table.insert("name".to_owned(), Value::from(name));
        Self::read(table).map(|(given, _)| given)
    }
}

/// The views that the daemon was started with.
#[derive(Debug)]
struct Configured {
    views: Vec<GivenView>,
    /// Folder that relative paths in their tables start from.
    folder: PathBuf,
}

/// A view's own settings. Empty tables count as none.
#[derive(Clone, Debug, Default)]
struct Own {
    /// Keys of the geometry; `None` if the program derived it from another source.
    definition: Option<Table>,
    /// Whether a client created the view or changed its geometry.
    of_client: bool,
    group: Option<String>,
    /// Own exposure of a view that is in no group.
    exposure: Table,
    glare: Table,
    tone_map: Table,
}

/// All views of a scene.
#[derive(Clone, Debug)]
pub(crate) struct ViewSet {
    configured: Arc<Configured>,
    /// The rig that is drawn. The lists below have the same order.
    rig: Arc<Rig>,
    ids: Arc<[ViewId]>,
    own: Vec<Own>,
    /// Exposures of the groups.
    groups: BTreeMap<String, Table>,
    /// Effective settings of each view.
    pub(crate) settings: Vec<ViewSettings>,
}

/// A view that is about to join a set.
struct Member {
    id: ViewId,
    given: GivenView,
    of_client: bool,
}

/// The part of a view that a state file keeps.
pub(crate) struct KeptView {
    pub(crate) name: String,
    /// Keys of the geometry if a client has set them.
    pub(crate) definition: Option<Table>,
    /// The view's own settings.
    pub(crate) tables: ViewTables,
}

fn some(table: &Table) -> Option<Table> {
    Some(table.clone()).filter(|table| !table.is_empty())
}

impl ViewSet {
    /// Creates the views that the daemon starts with; paths in their tables start from `folder`. The error describes an
    /// invalid view.
    pub(crate) fn new(general: &RenderSettings, views: Vec<GivenView>, folder: &Path) -> Result<Self, String> {
        let configured = Arc::new(Configured { views: views.clone(), folder: folder.to_owned() });
        let members = views.into_iter().map(|given| Member { id: ViewId::new(), given, of_client: false });
        Self::from_members(general, configured, members.collect())
            .map_err(|error| format!("views[{}]: {error}", error.view))
    }

    fn from_members(
        general: &RenderSettings,
        configured: Arc<Configured>,
        members: Vec<Member>,
    ) -> Result<Self, ViewTablesError> {
        // Pass all tables unmerged, so that no view of a group takes precedence.
        let given: Vec<(&str, &ViewTables)> =
            members.iter().map(|member| (member.given.view.name.as_str(), &member.given.tables)).collect();
        resolve_views(general, &given, &configured.folder)?;
        let ids = members.iter().map(|member| member.id).collect();
        let mut groups = BTreeMap::new();
        let mut own = Vec::with_capacity(members.len());
        let mut views = Vec::with_capacity(members.len());
        for Member { given: GivenView { view, definition, tables }, of_client, .. } in members {
            let mut exposure = tables.exposure.unwrap_or_default();
            if let Some(group) = &tables.exposure_group {
                let of_group: &mut Table = groups.entry(group.clone()).or_default();
                if !exposure.is_empty() {
                    *of_group = std::mem::take(&mut exposure);
                }
            }
            views.push(view);
            own.push(Own {
                definition,
                of_client,
                group: tables.exposure_group,
                exposure,
                glare: tables.glare.unwrap_or_default(),
                tone_map: tables.tone_map.unwrap_or_default(),
            });
        }
        let rig = Self::rig_of(views)?;
        Self { configured, rig, ids, own, groups, settings: Vec::new() }.resolved(general)
    }

    fn rig_of(views: Vec<View>) -> Result<Arc<Rig>, ViewTablesError> {
        let count = views.len();
        Rig::new(views).map(Arc::new).map_err(|error| ViewTablesError {
            view: count.saturating_sub(1),
            key: "name".to_owned(),
            problem: error.to_string(),
        })
    }

    /// Returns the rig that is drawn.
    pub(crate) fn rig(&self) -> &Arc<Rig> {
        &self.rig
    }

    /// Returns the identities of the views, in the order of the rig.
    pub(crate) fn ids(&self) -> &Arc<[ViewId]> {
        &self.ids
    }

    /// Returns the index of a view in the rig; `None` if it was deleted.
    pub(crate) fn index_of(&self, id: ViewId) -> Option<usize> {
        self.ids.iter().position(|known| *known == id)
    }

    /// Returns the view of a name, and its index in the rig.
    pub(crate) fn named(&self, name: &str) -> Option<(ViewId, usize)> {
        self.rig.index_of(name).map(|index| (self.ids[index], index))
    }

    /// Names of the views.
    pub(crate) fn names(&self) -> impl Iterator<Item = &str> {
        self.rig.views().iter().map(|view| view.name.as_str())
    }

    /// Returns the pixel count of all images of a view.
    pub(crate) fn pixels_of(&self, index: usize) -> u64 {
        let of_image = |[width, height]: [u32; 2]| u64::from(width) * u64::from(height);
        let Some(view) = self.rig.views().get(index) else { return 0 };
        let drawn = view.images.iter().map(|image| of_image(image.projection.mapping().size()));
        // A warped picture of a projector exists twice.
        let bent =
            view.kind.projector().filter(|output| output.resampling().is_some()).map(|output| of_image(output.size()));
        drawn.chain(bent).fold(0, u64::saturating_add)
    }

    /// Returns the pixel count of all images of all views.
    pub(crate) fn pixels(&self) -> u64 {
        (0..self.ids.len()).map(|index| self.pixels_of(index)).fold(0, u64::saturating_add)
    }

    /// Returns the groups of views that share a frame.
    pub(crate) fn frame_groups(&self, general: &RenderSettings) -> Vec<FrameGroup> {
        frame_groups(&self.rig, general, &self.settings)
    }

    /// Returns the keys of a view's geometry; `None` if the program derived it from another source.
    pub(crate) fn definition(&self, view: usize) -> Option<&Table> {
        self.own[view].definition.as_ref()
    }

    /// Returns the tables of a view, with the exposure of its group.
    pub(crate) fn tables_with_group(&self, view: usize) -> ViewTables {
        let Own { group, exposure, glare, tone_map, .. } = &self.own[view];
        let exposure = group.as_ref().and_then(|name| self.groups.get(name)).unwrap_or(exposure);
        ViewTables {
            exposure_group: group.clone(),
            exposure: some(exposure),
            glare: some(glare),
            tone_map: some(tone_map),
        }
    }

    /// Returns the tables of a view as in a configuration; a group's exposure is in the table of its first view.
    pub(crate) fn tables(&self, view: usize) -> ViewTables {
        let group = &self.own[view].group;
        let is_first = self.own[..view].iter().all(|other| other.group != *group);
        let mut tables = self.tables_with_group(view);
        tables.exposure = tables.exposure.filter(|_| group.is_none() || is_first);
        tables
    }

    fn members(&self) -> impl Iterator<Item = Member> {
        self.rig.views().iter().enumerate().map(|(index, view)| Member {
            id: self.ids[index],
            of_client: self.own[index].of_client,
            given: GivenView {
                view: view.clone(),
                definition: self.own[index].definition.clone(),
                tables: self.tables(index),
            },
        })
    }

    fn resolved(mut self, general: &RenderSettings) -> Result<Self, ViewTablesError> {
        let tables: Vec<ViewTables> = (0..self.ids.len()).map(|view| self.tables(view)).collect();
        let views: Vec<(&str, &ViewTables)> = self.names().zip(&tables).collect();
        self.settings = resolve_views(general, &views, &self.configured.folder)?;
        Ok(self)
    }

    /// Returns the name of a view's group; empty if it is in none.
    pub(crate) fn group_of(&self, view: usize) -> &str {
        self.own[view].group.as_deref().unwrap_or_default()
    }

    /// Returns the keys that differ from the general ones, with the name of their table: `glare.fraction`.
    pub(crate) fn own_keys(&self, view: usize) -> Vec<String> {
        let Own { group, exposure, glare, tone_map, .. } = &self.own[view];
        let exposure = group.as_ref().and_then(|name| self.groups.get(name)).unwrap_or(exposure);
        [("exposure", exposure), ("glare", glare), ("tone_map", tone_map)]
            .into_iter()
            .flat_map(|(name, table)| table.keys().map(move |key| format!("{name}.{key}")))
            .collect()
    }

    /// Returns the views with a new one at the end; the error states the valid values.
    pub(crate) fn with(&self, general: &RenderSettings, given: GivenView) -> Result<Self, String> {
        if given.tables.glare.as_ref().is_some_and(|glare| glare.contains_key("psf_file")) {
            return Err(format!(
                "{DEFINITION}.glare.psf_file: files come only from the configuration: a new view cannot have one"
            ));
        }
        let new = self.ids.len();
        let members = self.members().chain([Member { id: ViewId::new(), given, of_client: true }]);
        Self::from_members(general, Arc::clone(&self.configured), members.collect()).map_err(|error| {
            let place = if error.view == new { format!("{DEFINITION}.") } else { String::new() };
            format!("{place}{}: {}", error.key, error.problem)
        })
    }

    /// Returns the views without one; the error explains why another view would change.
    pub(crate) fn without(&self, general: &RenderSettings, view: usize) -> Result<Self, String> {
        let mut left = self.clone();
        let others: Vec<usize> = (0..self.ids.len()).filter(|index| *index != view).collect();
        left.rig = Arc::new(self.rig.of_views(&others));
        left.ids = others.iter().map(|index| self.ids[*index]).collect();
        left.own.remove(view);
        left.forget_empty_groups();
        left.resolved(general).map_err(|error| error.to_string())
    }

    fn forget_empty_groups(&mut self) {
        let in_use: Vec<Option<&String>> = self.own.iter().map(|own| own.group.as_ref()).collect();
        self.groups.retain(|group, _| in_use.contains(&Some(group)));
    }

    /// Returns a view with changed geometry.
    fn redefine(&mut self, view: usize, change: &TableChange) -> Result<(), String> {
        let before = &self.rig.views()[view];
        let mut definition = match (change, &self.own[view].definition) {
            (TableChange::Nothing, _) => return Ok(()),
            (TableChange::Keys(_), None) => {
                return Err(format!(
                    "{DEFINITION}: view `{}` does not come from a configuration and has no keys: send a whole definition",
                    before.name
                ));
            }
            (_, definition) => definition.clone().unwrap_or_default(),
        };
        change.apply(&mut definition);
        let after = GivenView::defined(&before.name, &definition)?;
        let own = &mut self.own[view];
        // A definition that is sent back unchanged still counts as the configuration's.
        own.of_client |= own.definition != after.definition;
        own.definition = after.definition;
        let mut views = self.rig.views().to_vec();
        views[view] = after.view;
        self.rig = Self::rig_of(views).map_err(|error| error.problem)?;
        Ok(())
    }

    /// Returns the views after a change of one of them; the error states the valid values.
    pub(crate) fn changed(&self, general: &RenderSettings, view: usize, update: &ViewUpdate) -> Result<Self, String> {
        let mut changed = self.clone();
        changed.redefine(view, &update.definition)?;
        let own = &mut changed.own[view];
        if matches!(update.definition, TableChange::All(_)) && matches!(update.exposure, TableChange::Nothing) {
            // For a definition without an exposure, the group takes nothing from the view.
            own.exposure.clear();
        }
        if let Some(group) = &update.exposure_group {
            let group = Some(group.clone()).filter(|group| !group.is_empty());
            if own.group != group {
                // A new group starts with the exposure of its first view.
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
            // The effective value may be sent back with the other keys.
            let in_effect = self.settings[view].glare.psf_file.as_ref().map(|file| file.display().to_string());
            let given = own.glare.remove("psf_file");
            if given.as_ref().and_then(Value::as_str) != in_effect.as_deref() {
                let allowed = in_effect.unwrap_or_else(|| "none".to_owned());
                return Err(format!(
                    "glare.psf_file: files come only from the configuration: the only valid value is {allowed}"
                ));
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
        changed.forget_empty_groups();
        changed.resolved(general).map_err(|error| error.to_string())
    }

    /// Returns the part of the views that a state file keeps.
    pub(crate) fn kept(&self) -> impl Iterator<Item = KeptView> {
        self.members().map(|Member { given, of_client, .. }| KeptView {
            name: given.view.name,
            definition: given.definition.filter(|_| of_client),
            tables: given.tables,
        })
    }

    /// Returns the names of deleted views that the daemon was started with.
    pub(crate) fn deleted(&self) -> impl Iterator<Item = &str> {
        let configured = self.configured.views.iter().map(|given| given.view.name.as_str());
        configured.filter(|name| self.rig.index_of(name).is_none())
    }

    /// Returns the saved views: first those that the daemon was started with, with their saved changes and without the
    /// deleted ones, then those that clients created. A view keeps its identity if its name existed before. The error
    /// states the valid values.
    pub(crate) fn restored(
        &self,
        general: &RenderSettings,
        kept: Vec<KeptView>,
        deleted: &[String],
    ) -> Result<Self, String> {
        let (mut of_configuration, mut of_clients) = (Vec::new(), Vec::new());
        for given in &self.configured.views {
            if !deleted.contains(&given.view.name) {
                of_configuration.push((given.clone(), false));
            }
        }
        for KeptView { name, definition, tables } in kept {
            let known = of_configuration.iter_mut().find(|(given, _)| given.view.name == name);
            match (definition, known) {
                (Some(definition), known) => {
                    let defined =
                        GivenView::defined(&name, &definition).map_err(|error| format!("view `{name}`: {error}"))?;
                    let made = (GivenView { tables, ..defined }, true);
                    match known {
                        Some(known) => *known = made,
                        None => of_clients.push(made),
                    }
                }
                (None, Some((given, _))) => given.tables = tables,
                (None, None) => tracing::warn!("view `{name}` is left out: the configuration no longer has it"),
            }
        }
        let all = of_configuration.into_iter().chain(of_clients).map(|(given, of_client)| {
            let id = self.named(&given.view.name).map_or_else(ViewId::new, |(id, _)| id);
            Member { id, given, of_client }
        });
        Self::from_members(general, Arc::clone(&self.configured), all.collect()).map_err(|error| error.to_string())
    }
}
