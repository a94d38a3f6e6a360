//! The views of a scene, and the parts that clients may change: the list of views, their geometry, their own exposure, glare and
//! tone mapping, and the groups that share an exposure.
//!
//! Every view is kept as its [`ViewSpec`], together with the rig's view that was made from it. The exposure of a named group belongs
//! to the group: a change through any of its views changes it. Requests for frames refer to a view by its [`ViewId`], because its
//! index in the rig changes when another view is deleted.

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

use crate::{
    config::{ViewGeometry, ViewSettingsError, ViewSpec, resolve_views},
    plan::{
        settings::{ExposureKeys, GlareKeys, RenderSettings, ToneMapKeys},
        view_settings::{FrameGroup, ViewSettings, frame_groups},
    },
    ranges::{KeyEffects, PartialSettings},
    view::{Rig, View},
};

/// Field of a request for the specification of a view.
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

/// A change of a view's own settings.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum SettingsChange<K> {
    /// No change.
    #[default]
    Keep,
    /// Replaces all keys. If there are no keys, the general settings apply.
    Replace(K),
    /// Changes some keys.
    Edit {
        /// Keys that get a value.
        set: K,
        /// Names of the keys for which the general value applies again.
        clear: Vec<String>,
    },
}

impl<K: PartialSettings> SettingsChange<K> {
    /// Sets the given keys.
    pub fn set(keys: K) -> Self {
        Self::Edit { set: keys, clear: Vec::new() }
    }

    fn apply(&self, keys: &mut Option<K>) {
        let mut changed = keys.take().unwrap_or_default();
        match self {
            Self::Keep => {}
            Self::Replace(all) => changed = all.clone(),
            Self::Edit { set, clear } => {
                clear.iter().for_each(|name| changed.remove(name));
                changed.extend(set.clone());
            }
        }
        *keys = non_empty(Some(changed));
    }

    /// Applies the change to keys that are set over general settings. Removes keys without effect, except those that the change sets, which are
    /// refused later.
    fn apply_over<S: KeyEffects<Keys = K>>(&self, general: &S, keys: &mut Option<K>) {
        self.apply(keys);
        remove_useless(keys, |keys| general.without_effect(keys), |key| !self.sets(key));
    }

    /// Whether the change sets a key.
    fn sets(&self, key: &str) -> bool {
        match self {
            Self::Keep => false,
            Self::Replace(keys) | Self::Edit { set: keys, .. } => keys.given().contains(&key),
        }
    }
}

/// Changes of a view; `None` and [`SettingsChange::Keep`] keep a value.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ViewUpdate {
    /// Type with its keys, orientation and position.
    pub geometry: Option<ViewGeometry>,
    /// Whether display images show a test pattern.
    pub test_pattern: Option<bool>,
    /// Exposure group; empty: none.
    pub exposure_group: Option<String>,
    /// Keys of `[exposure]`; they apply to the whole group if the view is in one.
    pub exposure: SettingsChange<ExposureKeys>,
    /// Keys of `[glare]` except `psf_file`: files come only from the configuration.
    pub glare: SettingsChange<GlareKeys>,
    /// Keys of `[tone_map]`.
    pub tone_map: SettingsChange<ToneMapKeys>,
}

/// One view of a scene.
#[derive(Clone, Debug, PartialEq)]
struct ViewEntry {
    /// Its specification. Settings without keys are `None`, and so is the exposure of a view in a group. A test pattern is part of the overlay.
    spec: ViewSpec,
    /// Whether a client created the view or changed its geometry.
    from_client: bool,
}

/// The views that the daemon was started with.
#[derive(Debug)]
struct Configured {
    views: Vec<(ViewSpec, View)>,
    /// Folder that relative paths in their settings start from.
    folder: PathBuf,
}

/// All views of a scene.
#[derive(Clone, Debug)]
pub(crate) struct ViewSet {
    configured: Arc<Configured>,
    /// The rig that is drawn. The lists below have the same order.
    rig: Arc<Rig>,
    ids: Arc<[ViewId]>,
    entries: Vec<ViewEntry>,
    /// Exposures of the groups.
    groups: BTreeMap<String, ExposureKeys>,
    /// Effective settings of each view.
    pub(crate) settings: Vec<ViewSettings>,
}

/// A view that is to be added to a set.
struct Member {
    id: ViewId,
    spec: ViewSpec,
    view: View,
    from_client: bool,
}

fn non_empty<K: PartialSettings>(keys: Option<K>) -> Option<K> {
    keys.filter(|keys| !keys.is_empty())
}

/// Removes those of the `useless` keys for which `may_go` is true, and returns their names.
fn remove_useless<K: PartialSettings>(
    keys: &mut Option<K>,
    useless: impl Fn(&K) -> Vec<&'static str>,
    may_go: impl Fn(&str) -> bool,
) -> Vec<&'static str> {
    let Some(given) = keys else { return Vec::new() };
    let removed: Vec<&str> = useless(given).into_iter().filter(|key| may_go(key)).collect();
    removed.iter().for_each(|key| given.remove(key));
    if given.is_empty() {
        *keys = None;
    }
    removed
}

/// Removes keys that have lost their effect since they were given, for example because the star method has changed, and returns their names.
fn remove_outdated(spec: &mut ViewSpec, general: &RenderSettings) -> Vec<String> {
    let is_relative = general.stars.method.is_relative();
    let tables = [
        (
            "exposure",
            remove_useless(&mut spec.exposure, |keys| keys.without_effect(&general.exposure, is_relative), |_| true),
        ),
        ("glare", remove_useless(&mut spec.glare, |keys| general.glare.without_effect(keys), |_| true)),
        ("tone_map", remove_useless(&mut spec.tone_map, |keys| general.tone_map.without_effect(keys), |_| true)),
    ];
    tables.into_iter().flat_map(|(table, keys)| keys.into_iter().map(move |key| format!("{table}.{key}"))).collect()
}

/// Checks the specification of a client or a state file, and returns it with the rig's view made from it. The error names the key within the request.
fn checked(spec: &ViewSpec) -> Result<(ViewSpec, View), String> {
    spec.checked().map_err(|error| error.within(DEFINITION).to_string())
}

impl ViewSet {
    /// Creates the views that the daemon starts with; paths in their settings start from `folder`. The error describes an
    /// invalid view.
    pub(crate) fn new(general: &RenderSettings, views: Vec<(ViewSpec, View)>, folder: &Path) -> Result<Self, String> {
        let configured = Arc::new(Configured { views: views.clone(), folder: folder.to_owned() });
        let member = |(spec, view)| Member { id: ViewId::new(), spec, view, from_client: false };
        let members = views.into_iter().map(member).collect();
        Self::from_members(general, configured, members).map_err(|error| format!("views[{}]: {error}", error.view))
    }

    fn from_members(
        general: &RenderSettings,
        configured: Arc<Configured>,
        mut members: Vec<Member>,
    ) -> Result<Self, ViewSettingsError> {
        for Member { spec, .. } in &mut members {
            spec.exposure = non_empty(spec.exposure.take());
            spec.glare = non_empty(spec.glare.take());
            spec.tone_map = non_empty(spec.tone_map.take());
        }
        let settings = resolve_views(general, members.iter().map(|member| &member.spec), &configured.folder)?;
        let mut groups = BTreeMap::new();
        let (mut ids, mut entries, mut views) = (Vec::new(), Vec::new(), Vec::new());
        for Member { id, mut spec, view, from_client } in members {
            if let Some(group) = &spec.exposure_group {
                let of_group: &mut ExposureKeys = groups.entry(group.clone()).or_default();
                if let Some(exposure) = spec.exposure.take() {
                    *of_group = exposure;
                }
            }
            views.push(view);
            ids.push(id);
            entries.push(ViewEntry { spec, from_client });
        }
        let rig = Self::rig_of(views)?;
        Ok(Self { configured, rig, ids: ids.into(), entries, groups, settings })
    }

    fn rig_of(views: Vec<View>) -> Result<Arc<Rig>, ViewSettingsError> {
        let count = views.len();
        Rig::new(views).map(Arc::new).map_err(|error| ViewSettingsError {
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

    /// Returns the names of the views.
    pub(crate) fn names(&self) -> impl Iterator<Item = &str> {
        self.rig.views().iter().map(|view| view.name.as_str())
    }

    /// Returns the pixel count of all images of a view.
    pub(crate) fn pixels_of(&self, index: usize) -> u64 {
        let of_image = |[width, height]: [u32; 2]| u64::from(width) * u64::from(height);
        let Some(view) = self.rig.views().get(index) else { return 0 };
        let drawn = view.images.iter().map(|image| of_image(image.projection.mapping().size()));
        // The picture of a projector that warps exists twice.
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

    /// Returns the specification of a view, with the exposure of its group.
    pub(crate) fn spec(&self, view: usize) -> ViewSpec {
        let spec = self.entries[view].spec.clone();
        let of_group = spec.exposure_group.as_ref().and_then(|name| self.groups.get(name));
        let exposure = of_group.map_or_else(|| spec.exposure.clone(), |keys| non_empty(Some(keys.clone())));
        ViewSpec { exposure, ..spec }
    }

    /// Returns the specification of a view as in a configuration. The exposure of a group is in the specification of its first view.
    fn spec_in_configuration(&self, view: usize) -> ViewSpec {
        let group = &self.entries[view].spec.exposure_group;
        let is_first = self.entries[..view].iter().all(|other| other.spec.exposure_group != *group);
        let spec = self.spec(view);
        ViewSpec { exposure: spec.exposure.filter(|_| group.is_none() || is_first), ..spec }
    }

    /// Returns the views without keys that have lost their effect since they were given.
    fn up_to_date(&self, general: &RenderSettings) -> Self {
        let mut views = self.clone();
        for entry in &mut views.entries {
            remove_outdated(&mut entry.spec, general);
        }
        for keys in views.groups.values_mut() {
            for key in keys.without_effect(&general.exposure, general.stars.method.is_relative()) {
                keys.remove(key);
            }
        }
        views
    }

    fn members(&self) -> impl Iterator<Item = Member> {
        self.rig.views().iter().enumerate().map(|(index, view)| Member {
            id: self.ids[index],
            spec: self.spec_in_configuration(index),
            view: view.clone(),
            from_client: self.entries[index].from_client,
        })
    }

    fn resolved(mut self, general: &RenderSettings) -> Result<Self, ViewSettingsError> {
        let in_use: Vec<Option<&String>> =
            self.entries.iter().map(|entry| entry.spec.exposure_group.as_ref()).collect();
        self.groups.retain(|group, _| in_use.contains(&Some(group)));
        let specs: Vec<ViewSpec> = (0..self.ids.len()).map(|view| self.spec_in_configuration(view)).collect();
        self.settings = resolve_views(general, &specs, &self.configured.folder)?;
        Ok(self)
    }

    /// Returns the name of a view's group; empty if it is in none.
    pub(crate) fn group_of(&self, view: usize) -> &str {
        self.entries[view].spec.exposure_group.as_deref().unwrap_or_default()
    }

    /// Returns the names of the keys with values that differ from the general settings, including the names of their tables, as in `glare.fraction`.
    pub(crate) fn own_keys(&self, view: usize) -> Vec<String> {
        let ViewSpec { exposure, glare, tone_map, .. } = self.spec(view);
        let tables = [
            ("exposure", exposure.map(|keys| keys.given())),
            ("glare", glare.map(|keys| keys.given())),
            ("tone_map", tone_map.map(|keys| keys.given())),
        ];
        let mut keys: Vec<String> = tables
            .into_iter()
            .flat_map(|(table, keys)| keys.unwrap_or_default().into_iter().map(move |key| format!("{table}.{key}")))
            .collect();
        keys.sort_unstable();
        keys
    }

    /// Returns the views with a new one at the end; the error states the valid values.
    pub(crate) fn with(&self, general: &RenderSettings, spec: ViewSpec, view: View) -> Result<Self, String> {
        if spec.glare.as_ref().is_some_and(|glare| glare.psf_file.is_some()) {
            return Err(format!(
                "{DEFINITION}.glare.psf_file: files come only from the configuration: a new view cannot have one"
            ));
        }
        let new = self.ids.len();
        let before = self.up_to_date(general);
        let members = before.members().chain([Member { id: ViewId::new(), spec, view, from_client: true }]);
        Self::from_members(general, Arc::clone(&self.configured), members.collect()).map_err(|error| {
            let place = if error.view == new { format!("{DEFINITION}.") } else { String::new() };
            format!("{place}{}: {}", error.key, error.problem)
        })
    }

    /// Returns the views without the deleted one; the error explains why another view would change.
    pub(crate) fn without(&self, general: &RenderSettings, view: usize) -> Result<Self, String> {
        let mut left = self.up_to_date(general);
        let others: Vec<usize> = (0..self.ids.len()).filter(|index| *index != view).collect();
        left.rig = Arc::new(self.rig.of_views(&others));
        left.ids = others.iter().map(|index| self.ids[*index]).collect();
        left.entries.remove(view);
        left.resolved(general).map_err(|error| error.to_string())
    }

    /// Changes the geometry of a view.
    fn set_geometry(&mut self, view: usize, geometry: &ViewGeometry) -> Result<(), String> {
        let entry = &mut self.entries[view];
        if entry.spec.geometry == *geometry {
            return Ok(());
        }
        let spec = ViewSpec { geometry: geometry.clone(), ..ViewSpec::custom(&entry.spec.name) };
        let (spec, made) = checked(&spec)?;
        entry.spec.geometry = spec.geometry;
        entry.from_client = true;
        let mut views = self.rig.views().to_vec();
        views[view] = made;
        self.rig = Self::rig_of(views).map_err(|error| error.problem)?;
        Ok(())
    }

    /// Puts a view into a group, or takes it out of its group. A new group starts with the exposure of its first view.
    fn set_group(&mut self, view: usize, group: &str) {
        let spec = &mut self.entries[view].spec;
        let group = Some(group.to_owned()).filter(|group| !group.is_empty());
        if spec.exposure_group != group {
            let exposure = spec.exposure.take().unwrap_or_default();
            if let Some(group) = &group {
                self.groups.entry(group.clone()).or_insert(exposure);
            }
            spec.exposure_group = group;
        }
    }

    /// Changes the glare of a view. The file stays the same; its effective value may be sent back with the other keys.
    fn set_glare(
        &mut self,
        general: &RenderSettings,
        view: usize,
        change: &SettingsChange<GlareKeys>,
    ) -> Result<(), String> {
        let glare = &mut self.entries[view].spec.glare;
        let file = glare.as_ref().and_then(|glare| glare.psf_file.clone());
        change.apply_over(&general.glare, glare);
        if change.sets("psf_file") {
            let effective = &self.settings[view].glare.psf_file;
            let given = glare.as_ref().and_then(|glare| glare.psf_file.as_ref());
            if given != effective.as_ref() {
                let valid = effective.as_ref().map_or("none".to_owned(), |file| file.display().to_string());
                return Err(format!(
                    "glare.psf_file: files come only from the configuration: the only valid value is {valid}"
                ));
            }
            let mut keys = glare.take().unwrap_or_default();
            keys.psf_file = file;
            *glare = non_empty(Some(keys));
        }
        Ok(())
    }

    /// Changes the exposure of a view, or of its group. Removes keys without effect, except those that the change sets, which are refused later.
    fn set_exposure(&mut self, general: &RenderSettings, view: usize, change: &SettingsChange<ExposureKeys>) {
        let spec = &mut self.entries[view].spec;
        let mut exposure = match &spec.exposure_group {
            Some(group) => self.groups.remove(group),
            None => spec.exposure.take(),
        };
        change.apply(&mut exposure);
        let is_relative = general.stars.method.is_relative();
        let useless = |keys: &ExposureKeys| keys.without_effect(&general.exposure, is_relative);
        remove_useless(&mut exposure, useless, |key| !change.sets(key));
        match &spec.exposure_group {
            Some(group) => drop(self.groups.insert(group.clone(), exposure.unwrap_or_default())),
            None => spec.exposure = exposure,
        }
    }

    /// Returns the views after a change of one of them; the error states the valid values.
    pub(crate) fn changed(&self, general: &RenderSettings, view: usize, update: &ViewUpdate) -> Result<Self, String> {
        let mut changed = self.up_to_date(general);
        if let Some(geometry) = &update.geometry {
            changed.set_geometry(view, geometry)?;
        }
        if let Some(group) = &update.exposure_group {
            changed.set_group(view, group);
        }
        changed.set_glare(general, view, &update.glare)?;
        update.tone_map.apply_over(&general.tone_map, &mut changed.entries[view].spec.tone_map);
        changed.set_exposure(general, view, &update.exposure);
        changed.resolved(general).map_err(|error| error.to_string())
    }

    /// Returns the views after the replacement of one of them by a specification; its name stays. The exposure of its group changes
    /// only if the specification has one.
    pub(crate) fn replaced(&self, general: &RenderSettings, view: usize, spec: &ViewSpec) -> Result<Self, String> {
        let mut before = self.clone();
        before.entries[view].spec.exposure = None;
        let is_in_group = spec.exposure_group.is_some();
        let update = ViewUpdate {
            geometry: Some(spec.geometry.clone()),
            test_pattern: None,
            exposure_group: Some(spec.exposure_group.clone().unwrap_or_default()),
            exposure: match &spec.exposure {
                None if is_in_group => SettingsChange::Keep,
                exposure => SettingsChange::Replace(exposure.clone().unwrap_or_default()),
            },
            glare: SettingsChange::Replace(spec.glare.clone().unwrap_or_default()),
            tone_map: SettingsChange::Replace(spec.tone_map.clone().unwrap_or_default()),
        };
        before.changed(general, view, &update)
    }

    /// Returns the specifications that a state file keeps, with the geometry only of views whose geometry a client has set.
    pub(crate) fn kept(&self) -> impl Iterator<Item = ViewSpec> {
        self.members().map(
            |Member { spec, from_client, .. }| {
                if from_client { spec } else { ViewSpec { geometry: ViewGeometry::default(), ..spec } }
            },
        )
    }

    /// Returns the names of deleted views that the daemon was started with.
    pub(crate) fn deleted(&self) -> impl Iterator<Item = &str> {
        let configured = self.configured.views.iter().map(|(spec, _)| spec.name.as_str());
        configured.filter(|name| self.rig.index_of(name).is_none())
    }

    /// Returns the saved views: first those that the daemon was started with, with their saved changes and without the
    /// deleted ones, then those that clients created. A view keeps its identity if its name existed before. The error
    /// states the valid values.
    pub(crate) fn restored(
        &self,
        general: &RenderSettings,
        kept: Vec<ViewSpec>,
        deleted: &[String],
    ) -> Result<Self, String> {
        let id = |name: &str| self.named(name).map_or_else(ViewId::new, |(id, _)| id);
        let remaining = self.configured.views.iter().filter(|(spec, _)| !deleted.contains(&spec.name)).cloned();
        let configured = remaining.map(|(spec, view)| Member { id: id(&spec.name), spec, view, from_client: false });
        let mut members: Vec<Member> = configured.collect();
        for mut spec in kept {
            for key in remove_outdated(&mut spec, general) {
                tracing::warn!("view `{}`: {key} is left out: it no longer has an effect", spec.name);
            }
            let known = members.iter_mut().find(|member| member.spec.name == spec.name && !member.from_client);
            match (spec.geometry.has_keys(), known) {
                (true, known) => {
                    let (spec, view) = checked(&spec).map_err(|error| format!("view `{}`: {error}", spec.name))?;
                    let made = Member { id: id(&spec.name), spec, view, from_client: true };
                    match known {
                        Some(known) => *known = made,
                        None => members.push(made),
                    }
                }
                (false, Some(known)) => {
                    let ViewSpec { geometry, packing, .. } = known.spec.clone();
                    known.spec = ViewSpec { geometry, packing, ..spec };
                }
                (false, None) => tracing::warn!("view `{}` is left out: the configuration no longer has it", spec.name),
            }
        }
        Self::from_members(general, Arc::clone(&self.configured), members).map_err(|error| error.to_string())
    }
}
