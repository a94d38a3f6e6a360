//! Views and their settings: conversion between protobuf messages and plain types. Errors state the problem and the valid values.
//!
//! The messages `ViewDefinition`, `ExposureSettings`, `GlareSettings` and `ToneMapSettings` have the keys of configurations as
//! fields, and `crates/proto/build.rs` makes serde read and write them under these names. A specification is thus converted to a
//! message and back without a list of keys; a new key needs a field in `proto/steradian/v1/view.proto` and one in the specification.

use std::{collections::BTreeSet, sync::LazyLock};

use prost::Message;
use serde::{Serialize, de::DeserializeOwned};

use super::objects::orientation_to_pb;
use crate::{
    config::{KeyError, PackingConfig, VIEW_TYPES, ViewGeometry, ViewKindSpec, ViewSpec, with_keys_of, with_same_keys},
    plan::{
        settings::{ExposureKeys, GlareKeys, StarMethod, ToneMapKeys},
        view_settings::ViewSettings,
    },
    ranges::{KeyEffects, PartialSettings},
    service::{
        proto,
        scene::{
            state::SceneState,
            views::{SettingsChange, ViewUpdate},
        },
    },
    view::{
        View,
        projection::{Perspective, Projection},
    },
};

/// Maximum number of paths in a mask.
const MOST_PATHS: usize = 64;

/// Field of views and requests for the specification.
const DEFINITION: &str = "definition";

/// Fields of `ViewDefinition` that define the geometry of a view.
static GEOMETRY_KEYS: LazyLock<Vec<String>> = LazyLock::new(|| {
    let others = ViewSpec::shared_keys();
    fields_of("ViewDefinition").into_iter().filter(|field| !others.contains(&field.as_str())).collect()
});

/// Returns the names of the fields of a message, from its descriptor.
fn fields_of(message: &str) -> Vec<String> {
    let files = prost_types::FileDescriptorSet::decode(proto::DESCRIPTORS).unwrap_or_default();
    let mut messages = files.file.into_iter().flat_map(|file| file.message_type);
    let found = messages.find(|candidate| candidate.name() == message).unwrap_or_default();
    found.field.iter().map(|field| field.name().to_owned()).collect()
}

fn within(prefix: &'static str) -> impl Fn(KeyError) -> String {
    move |error| error.within(prefix).to_string()
}

/// Returns the partial settings of a message; the error names the key within `table`.
pub(crate) fn keys_from_pb<K: DeserializeOwned>(message: &impl Serialize, table: &'static str) -> Result<K, String> {
    with_same_keys(message).map_err(within(table))
}

/// Type of views that only a configuration can define, because clients cannot name files.
const PROJECTOR: &str = "projector";

/// Checks that clients may define views of this type; the error names the types that they may define.
fn check_type(kind: Option<&str>) -> Result<(), KeyError> {
    let valid: Vec<&str> = VIEW_TYPES.into_iter().filter(|kind| *kind != PROJECTOR).collect();
    let problem = match kind {
        Some(kind) if valid.contains(&kind) => return Ok(()),
        Some(PROJECTOR) => format!("`{PROJECTOR}`: projectors come only from the configuration"),
        Some(kind) => format!("unknown type `{kind}`"),
        None => "missing key".to_owned(),
    };
    Err(KeyError::new("type", format!("{problem}: must be one of {}", valid.join(", "))))
}

/// Returns the specification in a message, and the rig's view made from it.
pub(crate) fn spec_from_pb(message: &proto::ViewDefinition) -> Result<(ViewSpec, View), KeyError> {
    let checked = check_type(message.r#type.as_deref()).and_then(|()| ViewSpec::from_keys(message));
    checked.map_err(|error| error.within(DEFINITION))
}

/// Returns the message of a specification. It does not contain the packing, because only `render` and `film` write files of views.
pub(crate) fn spec_to_pb(spec: &ViewSpec) -> Result<proto::ViewDefinition, KeyError> {
    ViewSpec { packing: PackingConfig::None, ..spec.clone() }.keys().map_err(|error| error.within(DEFINITION))
}

/// Returns the keys of settings that have an effect.
fn with_effect<S: KeyEffects>(settings: &S) -> S::Keys
where
    for<'a> S::Keys: From<&'a S>,
{
    let mut keys = S::Keys::from(settings);
    settings.without_effect(&keys).into_iter().for_each(|key| keys.remove(key));
    keys
}

/// Returns a view's effective settings as messages, without its geometry.
pub(crate) fn settings_to_pb(settings: &ViewSettings, stars: StarMethod) -> proto::View {
    // Only a non-UTF-8 path cannot be serialised; the glare is then left out.
    proto::View {
        exposure: with_same_keys(&ExposureKeys::with_effect(&settings.exposure, stars.is_relative())).ok(),
        glare: with_same_keys(&with_effect(&settings.glare)).ok(),
        tone_map: with_same_keys(&with_effect(&settings.tone_map)).ok(),
        ..proto::View::default()
    }
}

/// Returns the specification of a view of the rig, which can be sent back; `None` if its geometry has no keys.
fn definition_of(number: usize, scene: &SceneState) -> Option<proto::ViewDefinition> {
    let mut spec = scene.views.spec(number);
    spec.test_pattern = scene.objects.drawn.overlay.test_patterns.contains(&spec.name);
    if let Some(file) = spec.glare.as_mut().and_then(|glare| glare.psf_file.as_mut())
        && let Some(effective) = &scene.views.settings[number].glare.psf_file
    {
        file.clone_from(effective);
    }
    spec.geometry.has_keys().then(|| spec_to_pb(&spec).ok())?
}

fn projection_to_pb(projection: &Projection) -> proto::Projection {
    let flat = |plane: &Perspective| {
        let [left_tan, right_tan, down_tan, up_tan] = plane.edge_tangents(0.0);
        proto::Projection {
            mapping: "perspective".to_owned(),
            left_tan,
            right_tan,
            down_tan,
            up_tan,
            ..Default::default()
        }
    };
    let named = |mapping: &str| proto::Projection { mapping: mapping.to_owned(), ..Default::default() };
    match projection {
        Projection::Perspective(plane) => flat(plane),
        Projection::CubeFace(face) => flat(face.plane()),
        Projection::Fisheye(fisheye) => {
            proto::Projection { fov_rad: 2.0 * fisheye.half_fov_rad, ..named(fisheye.mapping.name()) }
        }
        Projection::Equirectangular(_) => named("equirectangular"),
        Projection::Tabulated(_) => named("tabulated"),
    }
}

/// Returns a view of the rig by its index.
pub(crate) fn view_to_pb(number: usize, scene: &SceneState) -> proto::View {
    let view = &scene.views.rig().views()[number];
    let images = view.images.iter().map(|image| {
        let [width, height] = view.output_size(image);
        proto::ViewImage {
            part: image.part.name().unwrap_or_default().to_owned(),
            width,
            height,
            orientation: Some(orientation_to_pb(image.camera_from_view)),
            projection: Some(projection_to_pb(&image.projection)),
        }
    });
    proto::View {
        name: view.name.clone(),
        r#type: view.kind.type_name().to_owned(),
        images: images.collect(),
        exposure_group: scene.views.group_of(number).to_owned(),
        own_keys: scene.views.own_keys(number),
        revision: scene.revision,
        definition: definition_of(number, scene),
        ..settings_to_pb(&scene.views.settings[number], scene.stars.method)
    }
}

/// A change that a client asks for.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum ViewChange {
    /// The view is replaced by a specification.
    Replace(Box<ViewSpec>),
    /// Some settings are changed.
    Update(Box<ViewUpdate>),
}

const IS_ALL: &str = "names the whole view: the mask must name no other field";
const IS_WHOLE_TABLE: &str = "names the whole table: use either this path, or keys below it";

/// Paths of a mask below one field.
#[derive(Default)]
struct Paths<'a> {
    whole: bool,
    keys: BTreeSet<&'a str>,
}

impl Paths<'_> {
    /// Returns the change of settings that the paths name; the error names the key below `table`.
    fn change<K, M>(&self, table: &'static str, given: Option<&M>) -> Result<SettingsChange<K>, String>
    where
        K: PartialSettings + DeserializeOwned,
        M: Clone + Default + Serialize + DeserializeOwned,
    {
        let given = given.cloned().unwrap_or_default();
        if self.whole {
            return Ok(SettingsChange::Replace(keys_from_pb(&given, table)?));
        }
        if self.keys.is_empty() {
            return Ok(SettingsChange::Keep);
        }
        // Ignore values that the mask does not name.
        let keys: Vec<&str> = self.keys.iter().copied().collect();
        let named: M = with_keys_of(&M::default(), &given, &keys).map_err(within(table))?;
        let set: K = keys_from_pb(&named, table)?;
        let clear = keys.iter().filter(|key| !set.given().contains(key)).map(|key| (*key).to_owned()).collect();
        Ok(SettingsChange::Edit { set, clear })
    }
}

/// Returns the keys below a table that a mask may name; none if it is not a table.
fn keys_below(table: &str) -> Vec<&'static str> {
    match table {
        "exposure" => ExposureKeys::NAMES.to_vec(),
        "glare" => GlareKeys::NAMES.to_vec(),
        "tone_map" => ToneMapKeys::NAMES.to_vec(),
        DEFINITION => GEOMETRY_KEYS.iter().map(String::as_str).collect(),
        _ => Vec::new(),
    }
}

/// Lists the valid paths of a mask, as text: those below the table of a path, or the tables.
fn valid_paths(table: &str) -> String {
    let keys: Vec<&str> = keys_below(table).into_iter().filter(|key| *key != "psf_file").collect();
    if keys.is_empty() {
        let keys =
            "must be one of exposure_group, exposure, glare, tone_map and definition, or a key of one of these tables";
        return format!("{keys}, such as exposure.ev100 and definition.fov_deg");
    }
    let test_pattern = if table == DEFINITION { ", test_pattern" } else { "" };
    format!("must be {table}, or below it one of {}{test_pattern}", keys.join(", "))
}

/// Reads the change that the mask names, for a view with its current specification; the error states the problem and the valid
/// values.
pub(crate) fn view_change_from_pb(
    request: &proto::UpdateViewRequest,
    current: &ViewSpec,
) -> Result<ViewChange, String> {
    let paths = request.update_mask.as_ref().map_or(&[][..], |mask| &mask.paths);
    if paths.is_empty() {
        return Err(format!("update_mask names no field: {}", valid_paths("")));
    }
    if paths.len() > MOST_PATHS {
        return Err(format!("update_mask names {} fields: there must be at most {MOST_PATHS}", paths.len()));
    }
    if let Some(path) = paths.iter().enumerate().find(|(index, path)| paths[..*index].contains(path)) {
        return Err(format!("update_mask: `{}` is named twice", path.1));
    }
    let view = request.view.clone().unwrap_or_default();
    let given = view.definition.clone().unwrap_or_default();
    if let Some(name) = given.name.as_ref().filter(|name| **name != view.name) {
        return Err(format!(
            "definition.name: `{name}`: the name of a view cannot change: it must be `{}`, or missing",
            view.name
        ));
    }
    if paths.iter().any(|path| path == DEFINITION) {
        if paths.len() > 1 {
            return Err(format!("update_mask: `{DEFINITION}` {IS_ALL}"));
        }
        check_geometry(current)?;
        let whole = proto::ViewDefinition { name: Some(view.name), ..given };
        let (spec, _) = spec_from_pb(&whole).map_err(|error| error.to_string())?;
        return Ok(ViewChange::Replace(Box::new(spec)));
    }
    let (mut geometry, mut exposure, mut glare, mut tone_map) =
        (Paths::default(), Paths::default(), Paths::default(), Paths::default());
    let mut update = ViewUpdate::default();
    for path in paths {
        let (table, key) = path.split_once('.').map_or((path.as_str(), None), |(table, key)| (table, Some(key)));
        let paths = match (table, key) {
            ("definition", Some("test_pattern")) => {
                update.test_pattern = Some(given.test_pattern.unwrap_or_default());
                continue;
            }
            ("exposure_group", None) => {
                update.exposure_group = Some(view.exposure_group.clone());
                continue;
            }
            ("glare", Some("psf_file")) => {
                return Err(format!("update_mask: `{path}` cannot be changed: files come only from the configuration"));
            }
            ("exposure", _) => &mut exposure,
            ("glare", _) => &mut glare,
            ("tone_map", _) => &mut tone_map,
            ("definition", _) => &mut geometry,
            ("name" | "type" | "images" | "own_keys" | "revision", _) => {
                return Err(format!("update_mask: `{path}` cannot be changed: {}", valid_paths("")));
            }
            _ => return Err(format!("update_mask: no field `{path}`: {}", valid_paths(""))),
        };
        match key {
            None => paths.whole = true,
            Some(key) if keys_below(table).contains(&key) => drop(paths.keys.insert(key)),
            Some(_) => return Err(format!("update_mask: no field `{path}`: {}", valid_paths(table))),
        }
        if paths.whole && !paths.keys.is_empty() {
            return Err(format!("update_mask: `{table}` {IS_WHOLE_TABLE}"));
        }
    }
    update.exposure = exposure.change("exposure", view.exposure.as_ref())?;
    update.glare = glare.change("glare", view.glare.as_ref())?;
    update.tone_map = tone_map.change("tone_map", view.tone_map.as_ref())?;
    if !geometry.keys.is_empty() {
        update.geometry = Some(changed_geometry(current, &given, &geometry.keys.into_iter().collect::<Vec<_>>())?);
    }
    Ok(ViewChange::Update(Box::new(update)))
}

/// Checks that clients may change the geometry of a view.
fn check_geometry(current: &ViewSpec) -> Result<(), String> {
    if !matches!(current.geometry.kind, ViewKindSpec::Projector(_)) {
        return Ok(());
    }
    Err(format!(
        "{DEFINITION}: view `{}` is a projector, whose geometry only the configuration can change; exposure_group, exposure, glare, \
         tone_map and definition.test_pattern can be changed",
        current.name
    ))
}

/// Returns the geometry of a view after a change of some keys.
fn changed_geometry(current: &ViewSpec, given: &proto::ViewDefinition, keys: &[&str]) -> Result<ViewGeometry, String> {
    check_geometry(current)?;
    if !current.geometry.has_keys() {
        return Err(format!(
            "{DEFINITION}: view `{}` does not come from a configuration and has no keys: send a whole definition",
            current.name
        ));
    }
    let current = ViewSpec { geometry: current.geometry.clone(), ..ViewSpec::custom(&current.name) };
    let message = spec_to_pb(&current).map_err(|error| error.to_string())?;
    let changed = with_keys_of(&message, given, keys).map_err(within(DEFINITION))?;
    Ok(spec_from_pb(&changed).map_err(|error| error.to_string())?.0.geometry)
}

/// Returns the request for a change of some settings. The error names a geometry without keys.
pub(crate) fn view_update_to_pb(
    name: &str,
    update: &ViewUpdate,
    expected_revision: Option<u64>,
) -> Result<proto::UpdateViewRequest, String> {
    let mut paths = Vec::new();
    let mut definition = proto::ViewDefinition::default();
    if let Some(geometry) = &update.geometry {
        let spec = ViewSpec { geometry: geometry.clone(), ..ViewSpec::custom(name) };
        definition = spec_to_pb(&spec).map_err(|error| error.to_string())?;
        paths.extend(GEOMETRY_KEYS.iter().map(|key| format!("{DEFINITION}.{key}")));
    }
    definition.test_pattern = update.test_pattern;
    paths.extend(update.test_pattern.map(|_| "definition.test_pattern".to_owned()));
    paths.extend(update.exposure_group.is_some().then(|| "exposure_group".to_owned()));
    let view = proto::View {
        name: name.to_owned(),
        exposure_group: update.exposure_group.clone().unwrap_or_default(),
        exposure: named("exposure", &update.exposure, &mut paths)?,
        glare: named("glare", &update.glare, &mut paths)?,
        tone_map: named("tone_map", &update.tone_map, &mut paths)?,
        definition: Some(definition),
        ..proto::View::default()
    };
    let update_mask = Some(prost_types::FieldMask { paths });
    Ok(proto::UpdateViewRequest { view: Some(view), update_mask, expected_revision })
}

/// Returns the message of changed settings, and adds their paths to the mask.
fn named<K: PartialSettings + Serialize, M: DeserializeOwned>(
    table: &'static str,
    change: &SettingsChange<K>,
    paths: &mut Vec<String>,
) -> Result<Option<M>, String> {
    let keys = match change {
        SettingsChange::Keep => return Ok(None),
        SettingsChange::Replace(keys) => {
            paths.push(table.to_owned());
            keys
        }
        SettingsChange::Edit { set, clear } => {
            let given = set.given();
            let names =
                given.iter().copied().chain(clear.iter().map(String::as_str).filter(|name| !given.contains(name)));
            paths.extend(names.map(|key| format!("{table}.{key}")));
            set
        }
    };
    with_same_keys(keys).map(Some).map_err(within(table))
}

/// Returns the request that replaces a view by a specification. The error names a geometry without keys.
pub(crate) fn view_replacement_to_pb(
    spec: &ViewSpec,
    expected_revision: Option<u64>,
) -> Result<proto::UpdateViewRequest, String> {
    let definition = spec_to_pb(spec).map_err(|error| error.to_string())?;
    let view = proto::View { name: spec.name.clone(), definition: Some(definition), ..proto::View::default() };
    let update_mask = Some(prost_types::FieldMask { paths: vec![DEFINITION.to_owned()] });
    Ok(proto::UpdateViewRequest { view: Some(view), update_mask, expected_revision })
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic on unexpected values")]
mod tests {
    use super::*;
    use crate::plan::settings::{
        ExposureMode, ExposureSettings, GlareSettings, RenderSettings, ToneMapOperator, ToneMapSettings,
    };

    const ALL_KEYS: &str = "
        name = 'v'
        type = 'stereo'
        size = [8, 6]
        fov_y_deg = 60.0
        fov = { left_deg = -50.5, right_deg = 40.0, up_deg = 45.0, down_deg = -45.0 }
        fov_left = { left_deg = -50.0 }
        fov_right = { down_deg = 1e-3 }
        ipd_m = 0.064
        face_size = 8
        faces = ['front', 'up']
        mapping = 'equisolid'
        fov_deg = 180.0
        tilt_deg = -15.0
        orientation = [0.0, 0.6, 0.0, 0.8]
        position_m = [1.0, 2.0, 1e-300]
        test_pattern = true
        exposure_group = 'g'
        exposure = { mode = 'manual', ev100 = 2.0 }
        glare = { fraction = 0.1 }
        tone_map = { dither = false }";

    fn fisheye(more: &str) -> ViewSpec {
        ViewSpec::from_toml(&format!("name = 'v'\ntype = 'fisheye'\nsize = [8, 8]\nfov_deg = 90.0\n{more}")).unwrap().0
    }

    fn update_of(request: &proto::UpdateViewRequest) -> ViewUpdate {
        match view_change_from_pb(request, &fisheye("")).unwrap() {
            ViewChange::Update(update) => *update,
            ViewChange::Replace(_) => panic!("a replacement"),
        }
    }

    #[test]
    fn messages_have_the_keys_of_configurations() {
        let sorted = |keys: &[&str]| keys.iter().map(|key| (*key).to_owned()).collect::<BTreeSet<_>>();
        let fields = |message: &str| fields_of(message).into_iter().collect::<BTreeSet<_>>();
        assert_eq!(fields("ExposureSettings"), sorted(ExposureKeys::NAMES));
        assert_eq!(fields("GlareSettings"), sorted(GlareKeys::NAMES));
        assert_eq!(fields("ToneMapSettings"), sorted(ToneMapKeys::NAMES));
        let schema = crate::config::reference::schema();
        let kinds = schema["properties"]["views"]["items"]["oneOf"].as_array().unwrap();
        // Clients can name neither the files of projectors nor packed files.
        let kinds = kinds.iter().filter(|kind| kind["properties"]["type"]["const"] != "projector");
        let properties = kinds.flat_map(|kind| kind["properties"].as_object().unwrap().keys().cloned());
        let properties: BTreeSet<String> = properties.filter(|key| key != "packing").collect();
        assert_eq!(fields("ViewDefinition"), properties);
    }

    #[test]
    fn a_message_keeps_every_key() {
        let message: proto::ViewDefinition = toml::from_str(ALL_KEYS).unwrap();
        let again: proto::ViewDefinition = with_same_keys(&message).unwrap();
        assert_eq!(again, message);
    }

    #[test]
    fn specifications_become_messages_without_defaults_and_back() {
        for more in ["", "mapping = 'equisolid'\norientation = [0.0, 0.6, 0.0, 0.8]\n[glare]\nfraction = 0.25"] {
            let spec = fisheye(more);
            let message = spec_to_pb(&spec).unwrap();
            assert_eq!(spec_from_pb(&message).unwrap().0, spec);
            assert_eq!((message.test_pattern, message.position_m, message.tilt_deg), (None, None, None));
        }
        let stereo: proto::ViewDefinition = toml::from_str(ALL_KEYS).unwrap();
        for (message, expected) in [
            (stereo, "definition.face_size: unknown key `face_size`"),
            (
                proto::ViewDefinition { fov_y_deg: Some(3.0), ..spec_to_pb(&fisheye("")).unwrap() },
                "definition.fov_y_deg: unknown key",
            ),
            (
                proto::ViewDefinition { r#type: Some("fisheye".to_owned()), ..Default::default() },
                "definition.name: missing key",
            ),
            (
                proto::ViewDefinition { r#type: Some("dome".to_owned()), ..Default::default() },
                "definition.type: unknown type `dome`: must be one of perspective, stereo, cubemap, fisheye, dome_master, equirectangular",
            ),
            (
                proto::ViewDefinition { r#type: Some("projector".to_owned()), ..Default::default() },
                "definition.type: `projector`: projectors come only from the configuration: must be one of perspective",
            ),
            (
                proto::ViewDefinition { name: Some("v".to_owned()), ..Default::default() },
                "definition.type: missing key: must be one of perspective",
            ),
            (
                proto::ViewDefinition { mapping: Some("round".to_owned()), ..spec_to_pb(&fisheye("")).unwrap() },
                "definition.mapping: unknown variant `round`",
            ),
        ] {
            let problem = spec_from_pb(&message).unwrap_err().to_string();
            assert!(problem.starts_with(expected) && !problem.contains(", projector"), "{problem}");
        }
    }

    #[test]
    fn projectors_keep_their_geometry() {
        let config = toml::from_str("file = 'dome.mpcdi'").unwrap();
        let geometry = ViewGeometry { kind: ViewKindSpec::Projector(Box::new(config)), ..ViewGeometry::default() };
        let projector = ViewSpec { geometry, ..ViewSpec::custom("v") };
        let mut request = view_replacement_to_pb(&fisheye(""), None).unwrap();
        for path in ["definition", "definition.tilt_deg", "definition.size", "definition.position_m"] {
            request.update_mask = Some(prost_types::FieldMask { paths: vec![path.to_owned()] });
            let problem = view_change_from_pb(&request, &projector).unwrap_err();
            assert!(
                problem.starts_with("definition: view `v` is a projector, whose geometry only"),
                "{path}: {problem}"
            );
        }
        for path in ["definition.test_pattern", "exposure", "tone_map.dither", "exposure_group"] {
            request.update_mask = Some(prost_types::FieldMask { paths: vec![path.to_owned()] });
            view_change_from_pb(&request, &projector).unwrap();
        }
    }

    #[test]
    fn messages_contain_only_settings_with_an_effect() {
        let mut settings = ViewSettings::general(&RenderSettings::default());
        let exposure = settings_to_pb(&settings, StarMethod::Auto).exposure.unwrap();
        assert_eq!((exposure.limiting_magnitude, exposure.key, exposure.ev100), (Some(6.5), None, None));
        settings.exposure = ExposureSettings::manual(-3.0);
        let message = settings_to_pb(&settings, StarMethod::Auto);
        let exposure = message.exposure.unwrap();
        assert_eq!((exposure.limiting_magnitude, exposure.metering, exposure.ev100), (None, None, Some(-3.0)));
        assert_eq!(message.glare.unwrap().fraction, Some(0.1));
        let tone_map = message.tone_map.unwrap();
        assert_eq!((tone_map.operator.as_deref(), tone_map.peak_cd_m2, tone_map.white), (Some("filmic"), None, None));
        settings.glare = GlareSettings::none();
        settings.tone_map = ToneMapSettings::of(ToneMapOperator::Calibrated);
        let message = settings_to_pb(&settings, StarMethod::Auto);
        assert_eq!((message.glare.unwrap().fraction, message.tone_map.unwrap().peak_cd_m2), (None, Some(100.0)));
    }

    #[test]
    fn updates_survive_a_round_trip_and_bad_masks_are_refused() {
        let update = ViewUpdate {
            geometry: Some(fisheye("mapping = 'equisolid'").geometry),
            test_pattern: Some(true),
            exposure_group: Some("dim".to_owned()),
            exposure: SettingsChange::Replace(ExposureKeys {
                mode: Some(ExposureMode::Manual),
                ev100: Some(2.0),
                ..Default::default()
            }),
            glare: SettingsChange::Edit {
                set: GlareKeys { fraction: Some(0.2), ..Default::default() },
                clear: vec!["kernel".to_owned()],
            },
            tone_map: SettingsChange::Keep,
        };
        let request = view_update_to_pb("v", &update, Some(3)).unwrap();
        assert_eq!(update_of(&request), update);
        let request = |paths: &[&str]| proto::UpdateViewRequest {
            update_mask: Some(prost_types::FieldMask { paths: paths.iter().map(|path| (*path).to_owned()).collect() }),
            ..Default::default()
        };
        for (paths, expected) in [
            (&[][..], "names no field: must be one of exposure_group, exposure"),
            (&["colour"], "no field `colour`"),
            (&["exposure.iso"], "no field `exposure.iso`: must be exposure, or below it one of mode"),
            (&["exposure.mode.x"], "no field `exposure.mode.x`"),
            (&["name"], "`name` cannot be changed"),
            (&["glare.psf_file"], "`glare.psf_file` cannot be changed: files come only from the configuration"),
            (&["glare", "glare"], "`glare` is named twice"),
            (&["glare", "glare.fraction"], "either this path, or keys below it"),
            (&["glare.fraction", "glare"], "either this path, or keys below it"),
            (&["definition.colour"], "no field `definition.colour`"),
            (&["definition", "definition.size"], "names the whole view"),
            (&["glare", "definition"], "names the whole view"),
            (&["definition.name"], "no field `definition.name`"),
            (&["exposure.mode"; 65], "names 65 fields: there must be at most 64"),
        ] {
            let problem = view_change_from_pb(&request(paths), &fisheye("")).unwrap_err();
            assert!(problem.contains(expected), "{problem}");
        }
    }

    #[test]
    fn values_that_are_not_valid_are_refused_only_if_the_mask_names_them() {
        let view = proto::View {
            exposure: Some(proto::ExposureSettings {
                metering: Some("median".to_owned()),
                ev100: Some(1.0),
                ..Default::default()
            }),
            definition: Some(proto::ViewDefinition {
                fov_deg: Some(400.0),
                mapping: Some("round".to_owned()),
                ..Default::default()
            }),
            ..Default::default()
        };
        let change = |path: &str| {
            let update_mask = Some(prost_types::FieldMask { paths: vec![path.to_owned()] });
            let request = proto::UpdateViewRequest { view: Some(view.clone()), update_mask, expected_revision: None };
            view_change_from_pb(&request, &fisheye("")).map(drop)
        };
        assert_eq!(change("exposure.ev100"), Ok(()));
        assert_eq!(change("definition.tilt_deg"), Ok(()));
        for (path, expected) in [
            ("exposure.metering", "exposure.metering: unknown variant `median`"),
            ("definition.fov_deg", "definition.fov_deg: 400: "),
            ("definition.mapping", "definition.mapping: unknown variant `round`"),
        ] {
            let problem = change(path).unwrap_err();
            assert!(problem.starts_with(expected), "{problem}");
        }
        let mut request = view_replacement_to_pb(&fisheye(""), None).unwrap();
        let replaced = view_change_from_pb(&request, &ViewSpec::custom("v")).unwrap();
        assert_eq!(replaced, ViewChange::Replace(Box::new(fisheye(""))));
        request.view.as_mut().unwrap().definition.as_mut().unwrap().name = Some("w".to_owned());
        assert!(view_change_from_pb(&request, &fisheye("")).unwrap_err().starts_with("definition.name: `w`"));
        let by_keys =
            view_update_to_pb("v", &ViewUpdate { geometry: Some(fisheye("").geometry), ..Default::default() }, None);
        let problem = view_change_from_pb(&by_keys.unwrap(), &ViewSpec::custom("v")).unwrap_err();
        assert!(problem.contains("`v` does not come from a configuration"), "{problem}");
    }
}
