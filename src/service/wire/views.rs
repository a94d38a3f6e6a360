//! Views and their settings: conversion between protobuf messages and plain types. Tables have the keys of
//! configurations. Errors state the problem and the valid values.

use toml::{Table, Value};

use super::objects::orientation_to_pb;
use crate::{
    config::has_effect,
    plan::{settings::StarMethod, view_settings::ViewSettings},
    service::{
        proto,
        scene::{
            state::SceneState,
            views::{TableChange, ViewUpdate},
        },
    },
    view::projection::{Perspective, Projection},
};

/// Maximum number of paths in a mask.
const MOST_PATHS: usize = 64;

/// Type of a message field that is read from a table's value.
trait Field: Sized {
    fn read(value: &Value) -> Option<Self>;
}

impl Field for String {
    fn read(value: &Value) -> Option<Self> {
        value.as_str().map(str::to_owned)
    }
}

impl Field for f64 {
    fn read(value: &Value) -> Option<Self> {
        value.as_float().or(value.as_integer().map(|whole| whole as f64))
    }
}

impl Field for bool {
    fn read(value: &Value) -> Option<Self> {
        value.as_bool()
    }
}

/// Returns the value of a key; the error states that its type is wrong.
fn read<T: Field>(table: &Table, key: &str) -> Result<Option<T>, String> {
    let wrong = |value: &Value| format!("{key} = {value}: the value has the wrong type");
    table.get(key).map(|value| T::read(value).ok_or_else(|| wrong(value))).transpose()
}

/// Defines the conversion between the keys of a table and the fields of a message.
macro_rules! table_message {
    ($keys:ident, $to_table:ident, $from_table:ident, $message:ident, [$($key:ident),* $(,)?]) => {
        const $keys: &[&str] = &[$(stringify!($key)),*];

        pub(crate) fn $to_table(message: &proto::$message) -> Table {
            let mut table = Table::new();
            $(
                if let Some(value) = message.$key.clone() {
                    table.insert(stringify!($key).to_owned(), Value::from(value));
                }
            )*
            table
        }

        fn $from_table(table: &Table) -> Result<proto::$message, String> {
            if let Some(key) = table.keys().find(|key| !$keys.contains(&key.as_str())) {
                return Err(format!("unknown key `{key}`: must be one of {}", $keys.join(", ")));
            }
            Ok(proto::$message { $($key: read(table, stringify!($key))?),* })
        }
    };
}

mod definition;

use definition::{
    DEFINITION_KEYS, IS_ALL_OF_IT, definition_of, geometry_from_table, geometry_to_table, whole_definition,
    whole_definition_to_pb,
};
pub(crate) use definition::{definition_from_pb, definition_to_pb};

table_message!(
    EXPOSURE_KEYS,
    exposure_to_table,
    exposure_from_table,
    ExposureSettings,
    [mode, metering, limiting_magnitude, ev100, key, spot_deg, compensation_ev, min_ev100, max_ev100, adaptation_s]
);
table_message!(
    GLARE_KEYS,
    glare_to_table,
    glare_from_table,
    GlareSettings,
    [method, kernel, inner_deg, fraction, age_years, eye_colour, absolute, psf_file, weights]
);
table_message!(
    TONE_MAP_KEYS,
    tone_map_to_table,
    tone_map_from_table,
    ToneMapSettings,
    [operator, white, peak_cd_m2, black_cd_m2, desaturation, scotopic, dither]
);

/// Returns a view's effective settings as messages, without its geometry.
pub(crate) fn settings_to_pb(settings: &ViewSettings, stars: StarMethod) -> proto::View {
    let table = |value: Result<Value, toml::ser::Error>| match value {
        Ok(Value::Table(table)) => table,
        // Only a non-UTF-8 path fails to serialise; it is then left out.
        _ => Table::new(),
    };
    let mut exposure = table(Value::try_from(settings.exposure));
    exposure.retain(|key, _| has_effect(key, &settings.exposure, stars));
    let (glare, tone_map) = (table(Value::try_from(&settings.glare)), table(Value::try_from(settings.tone_map)));
    proto::View {
        exposure: exposure_from_table(&exposure).ok(),
        glare: glare_from_table(&glare).ok(),
        tone_map: tone_map_from_table(&tone_map).ok(),
        ..proto::View::default()
    }
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

/// Reads the fields that the mask names; the error states the problem and the valid values.
pub(crate) fn view_update_from_pb(request: &proto::UpdateViewRequest) -> Result<ViewUpdate, String> {
    let keys = |table: &str, keys: &[&str]| keys.iter().map(|key| format!("{table}.{key}")).collect::<Vec<_>>();
    let tables = [("exposure", EXPOSURE_KEYS), ("glare", GLARE_KEYS), ("tone_map", TONE_MAP_KEYS)];
    let allowed = || {
        let keys: Vec<String> = tables.iter().flat_map(|(table, of)| keys(table, of)).collect();
        let keys: Vec<&str> = keys.iter().map(String::as_str).filter(|key| *key != "glare.psf_file").collect();
        let of_definition = DEFINITION_KEYS.iter().map(|key| format!("definition.{key}")).collect::<Vec<_>>();
        format!(
            "must be one of exposure_group, exposure, glare, tone_map, definition, {}, {}, definition.test_pattern",
            keys.join(", "),
            of_definition.join(", ")
        )
    };
    let paths = request.update_mask.as_ref().map_or(&[][..], |mask| &mask.paths);
    if paths.is_empty() {
        return Err(format!("update_mask names no field: {}", allowed()));
    }
    if paths.len() > MOST_PATHS {
        return Err(format!("update_mask names {} fields: there must be at most {MOST_PATHS}", paths.len()));
    }
    if let Some(path) = paths.iter().enumerate().find(|(index, path)| paths[..*index].contains(path)) {
        return Err(format!("update_mask: `{}` is named twice", path.1));
    }
    let view = request.view.clone().unwrap_or_default();
    let given = view.definition.clone().unwrap_or_default();
    if given.name.as_ref().is_some_and(|name| *name != view.name) {
        let name = given.name.unwrap_or_default();
        return Err(format!(
            "definition.name: `{name}`: the name of a view cannot change: it must be `{}`, or missing",
            view.name
        ));
    }
    if paths.iter().any(|path| path == "definition") {
        return if paths.len() == 1 { Ok(whole_definition(&given)) } else { Err(IS_ALL_OF_IT.to_owned()) };
    }
    let mut update = ViewUpdate::default();
    for path in paths {
        if path == "definition.test_pattern" {
            update.test_pattern = Some(given.test_pattern.unwrap_or_default());
            continue;
        }
        if path == "exposure_group" {
            update.exposure_group = Some(view.exposure_group.clone());
            continue;
        }
        let (table, key) = path.split_once('.').map_or((path.as_str(), None), |(table, key)| (table, Some(key)));
        let (change, given, known) = match table {
            "exposure" => (&mut update.exposure, view.exposure.as_ref().map(exposure_to_table), EXPOSURE_KEYS),
            "glare" => (&mut update.glare, view.glare.as_ref().map(glare_to_table), GLARE_KEYS),
            "tone_map" => (&mut update.tone_map, view.tone_map.as_ref().map(tone_map_to_table), TONE_MAP_KEYS),
            "definition" => (&mut update.definition, Some(geometry_to_table(&given)), DEFINITION_KEYS),
            "name" | "type" | "images" | "own_keys" | "revision" => {
                return Err(format!("update_mask: `{path}` cannot be changed: {}", allowed()));
            }
            _ => return Err(format!("update_mask: no field `{path}`: {}", allowed())),
        };
        let mut given = given.unwrap_or_default();
        let Some(key) = key else {
            if !matches!(change, TableChange::Nothing) {
                let problem = "names the whole table: use either it, or keys below it";
                return Err(format!("update_mask: `{path}` {problem}"));
            }
            *change = TableChange::All(given);
            continue;
        };
        if !known.contains(&key) {
            return Err(format!("update_mask: no field `{path}`: {}", allowed()));
        }
        if path == "glare.psf_file" {
            return Err(format!("update_mask: `{path}` cannot be changed: files come only from the configuration"));
        }
        let value = given.remove(key);
        match change {
            TableChange::Nothing => *change = TableChange::Keys(vec![(key.to_owned(), value)]),
            TableChange::Keys(keys) => keys.push((key.to_owned(), value)),
            TableChange::All(_) => {
                let problem = "names the whole table: use either it, or keys below it";
                return Err(format!("update_mask: `{table}` {problem}"));
            }
        }
    }
    Ok(update)
}

/// Returns the request for a change. The error names an unknown key.
pub(crate) fn view_update_to_pb(
    name: &str,
    update: &ViewUpdate,
    expected_revision: Option<u64>,
) -> Result<proto::UpdateViewRequest, String> {
    if let TableChange::All(geometry) = &update.definition {
        let definition = Some(whole_definition_to_pb(name, geometry, update)?);
        return Ok(proto::UpdateViewRequest {
            view: Some(proto::View { name: name.to_owned(), definition, ..proto::View::default() }),
            update_mask: Some(prost_types::FieldMask { paths: vec!["definition".to_owned()] }),
            expected_revision,
        });
    }
    let mut paths = Vec::new();
    let mut table = |name: &str, change: &TableChange| match change {
        TableChange::Nothing => Table::new(),
        TableChange::All(all) => {
            paths.push(name.to_owned());
            all.clone()
        }
        TableChange::Keys(keys) => {
            paths.extend(keys.iter().map(|(key, _)| format!("{name}.{key}")));
            keys.iter().filter_map(|(key, value)| Some((key.clone(), value.clone()?))).collect()
        }
    };
    let (definition, exposure, glare, tone_map) = (
        table("definition", &update.definition),
        table("exposure", &update.exposure),
        table("glare", &update.glare),
        table("tone_map", &update.tone_map),
    );
    paths.extend(update.test_pattern.map(|_| "definition.test_pattern".to_owned()));
    paths.extend(update.exposure_group.is_some().then(|| "exposure_group".to_owned()));
    let within = |table: &'static str| move |problem: String| format!("{table}: {problem}");
    let view = proto::View {
        name: name.to_owned(),
        exposure_group: update.exposure_group.clone().unwrap_or_default(),
        definition: Some(proto::ViewDefinition {
            test_pattern: update.test_pattern,
            ..geometry_from_table(&definition).map_err(within("definition"))?
        }),
        exposure: Some(exposure_from_table(&exposure).map_err(within("exposure"))?),
        glare: Some(glare_from_table(&glare).map_err(within("glare"))?),
        tone_map: Some(tone_map_from_table(&tone_map).map_err(within("tone_map"))?),
        ..proto::View::default()
    };
    Ok(proto::UpdateViewRequest {
        view: Some(view),
        update_mask: Some(prost_types::FieldMask { paths }),
        expected_revision,
    })
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic on unexpected values")]
mod tests {
    use super::*;
    use crate::plan::settings::{ExposureMode, ExposureSettings, GlareSettings, RenderSettings, ToneMapSettings};

    #[test]
    fn every_configuration_key_has_a_field() {
        let keys = |value: Value| value.as_table().unwrap().keys().cloned().collect::<Vec<_>>();
        let glare = GlareSettings { psf_file: Some("a.csv".into()), ..GlareSettings::default() };
        for (mut settings, fields) in [
            (keys(Value::try_from(ExposureSettings::default()).unwrap()), EXPOSURE_KEYS),
            (keys(Value::try_from(glare).unwrap()), GLARE_KEYS),
            (keys(Value::try_from(ToneMapSettings::default()).unwrap()), TONE_MAP_KEYS),
        ] {
            let mut fields: Vec<&str> = fields.to_vec();
            settings.sort_unstable();
            fields.sort_unstable();
            assert_eq!(settings, fields);
        }
    }

    #[test]
    fn messages_contain_only_settings_with_an_effect() {
        let mut settings = ViewSettings::general(&RenderSettings::default());
        let message = settings_to_pb(&settings, StarMethod::Auto).exposure.unwrap();
        assert_eq!((message.limiting_magnitude, message.key, message.ev100), (Some(6.5), None, None));
        settings.exposure.mode = ExposureMode::Manual;
        let message = settings_to_pb(&settings, StarMethod::Auto);
        let exposure = message.exposure.unwrap();
        assert_eq!((exposure.limiting_magnitude, exposure.metering, exposure.ev100), (None, None, Some(-3.0)));
        assert_eq!(message.glare.unwrap().fraction, Some(0.1));
        assert_eq!(message.tone_map.unwrap().operator.as_deref(), Some("filmic"));
    }

    #[test]
    fn updates_survive_a_round_trip_and_bad_masks_are_refused() {
        let table = |text: &str| text.parse::<Table>().unwrap();
        let update = ViewUpdate {
            definition: TableChange::Keys(vec![
                ("fov_deg".to_owned(), Some(Value::Float(90.0))),
                ("mapping".to_owned(), None),
            ]),
            test_pattern: Some(true),
            exposure_group: Some("dim".to_owned()),
            exposure: TableChange::All(table("mode = 'manual'\nev100 = 2.0")),
            glare: TableChange::Keys(vec![
                ("fraction".to_owned(), Some(Value::Float(0.2))),
                ("kernel".to_owned(), None),
            ]),
            tone_map: TableChange::Nothing,
        };
        let request = view_update_to_pb("v", &update, Some(3)).unwrap();
        assert_eq!(view_update_from_pb(&request).unwrap(), update);
        let request = |paths: &[&str]| proto::UpdateViewRequest {
            update_mask: Some(prost_types::FieldMask { paths: paths.iter().map(|path| (*path).to_owned()).collect() }),
            ..Default::default()
        };
        for (paths, expected) in [
            (&[][..], "names no field: must be one of exposure_group, exposure"),
            (&["colour"], "no field `colour`"),
            (&["exposure.iso"], "no field `exposure.iso`"),
            (&["exposure.mode.x"], "no field `exposure.mode.x`"),
            (&["name"], "`name` cannot be changed"),
            (&["glare.psf_file"], "`glare.psf_file` cannot be changed: files"),
            (&["glare", "glare"], "`glare` is named twice"),
            (&["glare", "glare.fraction"], "either it, or keys below it"),
            (&["glare.fraction", "glare"], "either it, or keys below it"),
            (&["definition.colour"], "no field `definition.colour`"),
            (&["definition", "definition.size"], "names the whole view"),
            (&["glare", "definition"], "names the whole view"),
            (&["definition.name"], "no field `definition.name`"),
            (&["exposure.mode"; 65], "names 65 fields: there must be at most 64"),
        ] {
            let problem = view_update_from_pb(&request(paths)).unwrap_err();
            assert!(problem.contains(expected), "{problem}");
        }
        let unknown = ViewUpdate { glare: TableChange::All(table("colour = 1")), ..ViewUpdate::default() };
        assert!(view_update_to_pb("v", &unknown, None).unwrap_err().contains("glare: unknown key `colour`"));
    }
}
