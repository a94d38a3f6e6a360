//! The views of a scene, and what of them clients may change: which there are, what each shows, exposure, glare and tone mapping of their own, and the
//! groups that share an exposure.
//!
//! Tables have the keys of configurations and are checked as those are; keys that they do not give are those of the general tables. The
//! exposure of a named group belongs to the group, whoever of its views was asked to change it. Whoever waits for frames of a view knows it by its
//! [`ViewId`]: its place in the rig moves when another one is deleted.

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

/// Where the keys of a view's geometry stand in what clients send.
const DEFINITION: &str = "definition";

/// Which view: a number that no other one gets, not even one of the same name after it was deleted. It is not kept beyond the process.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct ViewId(u64);

impl ViewId {
    /// The view of a headset, which is in no rig of a scene.
    pub(super) const HEADSET: Self = Self(0);

    fn new() -> Self {
        static NEXT: AtomicU64 = AtomicU64::new(1);
        Self(NEXT.fetch_add(1, Relaxed))
    }
}

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
    /// Keys of its geometry: `type`, those of the type, `orientation` and `position_m`.
    pub definition: TableChange,
    /// Whether its display images show a test pattern.
    pub test_pattern: Option<bool>,
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

/// A view as a configuration, a client or a file of states gives it.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct GivenView {
    pub(super) view: View,
    /// The keys of its geometry; `None`: the program has made it of something else.
    pub(super) definition: Option<Table>,
    /// What it has of its own.
    pub(super) tables: ViewTables,
}

impl GivenView {
    /// A view of a table of `[[views]]`, and whether it shows a test pattern; the error names the key within the table.
    pub(super) fn read(table: Table) -> Result<(Self, bool), String> {
        let (config, view) = ViewConfig::read(table).map_err(|error| error.within(DEFINITION).to_string())?;
        let ViewConfig { definition, tables, test_pattern, .. } = config;
        Ok((Self { view, definition: Some(definition), tables }, test_pattern))
    }

    /// A view of a name and the keys of its geometry.
    fn defined(name: &str, definition: &Table) -> Result<Self, String> {
        let mut table = definition.clone();
        table.insert("name".to_owned(), Value::from(name));
        Self::read(table).map(|(given, _)| given)
    }
}

/// The views that a daemon was started with.
#[derive(Debug)]
struct Configured {
    views: Vec<GivenView>,
    /// Where relative paths in their tables start.
    folder: PathBuf,
}

/// What one view has of its own. Empty tables are none.
#[derive(Clone, Debug, Default)]
struct Own {
    /// The keys of its geometry; `None`: the program has made it of something else.
    definition: Option<Table>,
    /// A client has made it, or changed its geometry.
    of_client: bool,
    group: Option<String>,
    /// Of a view that is in no group.
    exposure: Table,
    glare: Table,
    tone_map: Table,
}

/// All views of a scene.
#[derive(Clone, Debug)]
pub(super) struct ViewSet {
    configured: Arc<Configured>,
    /// What is drawn. The lists below have its order.
    rig: Arc<Rig>,
    ids: Arc<[ViewId]>,
    own: Vec<Own>,
    /// Exposures of groups.
    groups: BTreeMap<String, Table>,
    /// What it comes to, view by view.
    pub(super) settings: Vec<ViewSettings>,
}

/// A view on its way into a set.
struct Member {
    id: ViewId,
    given: GivenView,
    of_client: bool,
}

/// What a file of states keeps of a view.
pub(super) struct KeptView {
    pub(super) name: String,
    /// The keys of its geometry, where a client has given them.
    pub(super) definition: Option<Table>,
    /// What it has of its own.
    pub(super) tables: ViewTables,
}

fn some(table: &Table) -> Option<Table> {
    Some(table.clone()).filter(|table| !table.is_empty())
}

impl ViewSet {
    /// The views that a daemon is started with; paths in their tables start at `folder`. The error says what is wrong with them.
    pub(super) fn new(general: &RenderSettings, views: Vec<GivenView>, folder: &Path) -> Result<Self, String> {
        let configured = Arc::new(Configured { views: views.clone(), folder: folder.to_owned() });
        let members = views.into_iter().map(|given| Member { id: ViewId::new(), given, of_client: false });
        Self::of(general, configured, members.collect()).map_err(|error| format!("views[{}]: {error}", error.view))
    }

    fn of(
        general: &RenderSettings,
        configured: Arc<Configured>,
        members: Vec<Member>,
    ) -> Result<Self, ViewTablesError> {
        // All of them as they stand: of the tables of a group none is preferred.
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

    /// What is drawn.
    pub(super) fn rig(&self) -> &Arc<Rig> {
        &self.rig
    }

    /// Which views these are, in the order of the rig.
    pub(super) fn ids(&self) -> &Arc<[ViewId]> {
        &self.ids
    }

    /// The place of a view in the rig; `None`: it was deleted.
    pub(super) fn index_of(&self, id: ViewId) -> Option<usize> {
        self.ids.iter().position(|known| *known == id)
    }

    /// The view of a name, and its place in the rig.
    pub(super) fn named(&self, name: &str) -> Option<(ViewId, usize)> {
        self.rig.index_of(name).map(|index| (self.ids[index], index))
    }

    /// Names of the views.
    pub(super) fn names(&self) -> impl Iterator<Item = &str> {
        self.rig.views().iter().map(|view| view.name.as_str())
    }

    /// Pixels of all images of a view of the rig.
    pub(super) fn pixels_of(&self, index: usize) -> u64 {
        let of_image = |[width, height]: [u32; 2]| u64::from(width) * u64::from(height);
        let Some(view) = self.rig.views().get(index) else { return 0 };
        let drawn = view.images.iter().map(|image| of_image(image.projection.mapping().size()));
        // A projector's picture that is bent is there twice.
        let bent =
            view.kind.projector().filter(|output| output.resampling().is_some()).map(|output| of_image(output.size()));
        drawn.chain(bent).fold(0, u64::saturating_add)
    }

    /// Pixels of all images of all views.
    pub(super) fn pixels(&self) -> u64 {
        (0..self.ids.len()).map(|index| self.pixels_of(index)).fold(0, u64::saturating_add)
    }

    /// The frames that they make.
    pub(super) fn frame_groups(&self, general: &RenderSettings) -> Vec<FrameGroup> {
        frame_groups(&self.rig, general, &self.settings)
    }

    /// The keys of a view's geometry; `None`: the program has made it of something else.
    pub(super) fn definition(&self, view: usize) -> Option<&Table> {
        self.own[view].definition.as_ref()
    }

    /// The tables of a view, with the exposure of its group.
    pub(super) fn tables_with_group(&self, view: usize) -> ViewTables {
        let Own { group, exposure, glare, tone_map, .. } = &self.own[view];
        let exposure = group.as_ref().and_then(|name| self.groups.get(name)).unwrap_or(exposure);
        ViewTables {
            exposure_group: group.clone(),
            exposure: some(exposure),
            glare: some(glare),
            tone_map: some(tone_map),
        }
    }

    /// The tables of a view as a configuration would have them; a group's exposure stands with its first view.
    pub(super) fn tables(&self, view: usize) -> ViewTables {
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

    /// Name of the group that a view is in; empty: none.
    pub(super) fn group_of(&self, view: usize) -> &str {
        self.own[view].group.as_deref().unwrap_or_default()
    }

    /// The keys that are not the general ones for a view, with the name of their table: `glare.fraction`.
    pub(super) fn own_keys(&self, view: usize) -> Vec<String> {
        let Own { group, exposure, glare, tone_map, .. } = &self.own[view];
        let exposure = group.as_ref().and_then(|name| self.groups.get(name)).unwrap_or(exposure);
        [("exposure", exposure), ("glare", glare), ("tone_map", tone_map)]
            .into_iter()
            .flat_map(|(name, table)| table.keys().map(move |key| format!("{name}.{key}")))
            .collect()
    }

    /// The views with another one, which comes last; the error says what is not allowed.
    pub(super) fn with(&self, general: &RenderSettings, given: GivenView) -> Result<Self, String> {
        if given.tables.glare.as_ref().is_some_and(|glare| glare.contains_key("psf_file")) {
            return Err(format!(
                "{DEFINITION}.glare.psf_file: files are those of the configuration: a new view can have none of its own"
            ));
        }
        let new = self.ids.len();
        let members = self.members().chain([Member { id: ViewId::new(), given, of_client: true }]);
        Self::of(general, Arc::clone(&self.configured), members.collect()).map_err(|error| {
            let place = if error.view == new { format!("{DEFINITION}.") } else { String::new() };
            format!("{place}{}: {}", error.key, error.problem)
        })
    }

    /// The views without one; the error says why the others are not what they were.
    pub(super) fn without(&self, general: &RenderSettings, view: usize) -> Result<Self, String> {
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

    /// Another geometry of a view.
    fn redefine(&mut self, view: usize, change: &TableChange) -> Result<(), String> {
        let before = &self.rig.views()[view];
        let mut definition = match (change, &self.own[view].definition) {
            (TableChange::Nothing, _) => return Ok(()),
            (TableChange::Keys(_), None) => {
                return Err(format!(
                    "{DEFINITION}: view `{}` is none of a configuration and has no keys: allowed is a whole definition",
                    before.name
                ));
            }
            (_, definition) => definition.clone().unwrap_or_default(),
        };
        change.apply(&mut definition);
        let after = GivenView::defined(&before.name, &definition)?;
        let own = &mut self.own[view];
        // What is sent back as it was does not become the client's.
        own.of_client |= own.definition != after.definition;
        own.definition = after.definition;
        let mut views = self.rig.views().to_vec();
        views[view] = after.view;
        self.rig = Self::rig_of(views).map_err(|error| error.problem)?;
        Ok(())
    }

    /// The views after a change of one of them; the error says what is not allowed.
    pub(super) fn changed(&self, general: &RenderSettings, view: usize, update: &ViewUpdate) -> Result<Self, String> {
        let mut changed = self.clone();
        changed.redefine(view, &update.definition)?;
        let own = &mut changed.own[view];
        if matches!(update.definition, TableChange::All(_)) && matches!(update.exposure, TableChange::Nothing) {
            // A definition without an exposure: nothing that the view had goes into its group.
            own.exposure.clear();
        }
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
        changed.forget_empty_groups();
        changed.resolved(general).map_err(|error| error.to_string())
    }

    /// What a file of states keeps of the views.
    pub(super) fn kept(&self) -> impl Iterator<Item = KeptView> {
        self.members().map(|Member { given, of_client, .. }| KeptView {
            name: given.view.name,
            definition: given.definition.filter(|_| of_client),
            tables: given.tables,
        })
    }

    /// Names of the views that the daemon was started with and that were deleted.
    pub(super) fn deleted(&self) -> impl Iterator<Item = &str> {
        let configured = self.configured.views.iter().map(|given| given.view.name.as_str());
        configured.filter(|name| self.rig.index_of(name).is_none())
    }

    /// The views that were kept in place of these. Views that the daemon was started with are there with what was kept of them, but for those that were
    /// deleted, then those that clients have made. A view that is there before and after, by its name, is the same one. The error says what is not
    /// allowed.
    pub(super) fn restored(
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
                (None, None) => tracing::warn!(
                    "view `{name}` is left out: it was a view of the configuration, and is not there any more"
                ),
            }
        }
        let all = of_configuration.into_iter().chain(of_clients).map(|(given, of_client)| {
            let id = self.named(&given.view.name).map_or_else(ViewId::new, |(id, _)| id);
            Member { id, given, of_client }
        });
        Self::of(general, Arc::clone(&self.configured), all.collect()).map_err(|error| error.to_string())
    }
}
