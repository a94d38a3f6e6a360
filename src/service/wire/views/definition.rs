//! Definitions of views: conversion between a table of `[[views]]` and the message `ViewDefinition`.

use toml::{Table, Value};

use super::{
    Field, exposure_from_table, exposure_to_table, glare_from_table, glare_to_table, read, tone_map_from_table,
    tone_map_to_table,
};
use crate::{
    config::ViewTables,
    service::{
        proto,
        scene::{
            state::SceneState,
            views::{TableChange, ViewUpdate},
        },
        wire::camera::{quaternion_from_pb, vector_from_pb},
    },
};

/// Returns the numbers of a message as a TOML list.
fn numbers<const N: usize>(numbers: [f64; N]) -> Value {
    Value::Array(numbers.map(Value::from).to_vec())
}

fn numbers_from<const N: usize>(value: &Value) -> Option<[f64; N]> {
    let numbers: Vec<f64> = value.as_array()?.iter().map(f64::read).collect::<Option<_>>()?;
    numbers.try_into().ok()
}

impl Field for u32 {
    fn read(value: &Value) -> Option<Self> {
        value.as_integer().and_then(|whole| whole.try_into().ok())
    }
}

table_message!(
    FIELD_OF_VIEW_KEYS,
    field_of_view_to_table,
    field_of_view_from_table,
    FieldOfView,
    [left_deg, right_deg, up_deg, down_deg]
);

/// Defines the conversion between the keys of a view's geometry and the fields of a message.
macro_rules! definition_message {
    (plain: [$($plain:ident),* $(,)?], lists: [$($list:ident),* $(,)?], edges: [$($edges:ident),* $(,)?]) => {
        /// Keys of a view's geometry.
        pub(super) const DEFINITION_KEYS: &[&str] =
            &["type", $(stringify!($plain),)* $(stringify!($list),)* $(stringify!($edges),)* "orientation", "position_m"];

        pub(super) fn geometry_to_table(message: &proto::ViewDefinition) -> Table {
            let mut table = Table::new();
            let mut put = |key: &str, value: Option<Value>| {
                if let Some(value) = value {
                    table.insert(key.to_owned(), value);
                }
            };
            put("type", message.r#type.clone().map(Value::from));
            $(put(stringify!($plain), message.$plain.clone().map(Value::from));)*
            $(put(stringify!($list), Some(Value::from(message.$list.clone())).filter(|_| !message.$list.is_empty()));)*
            $(put(stringify!($edges), message.$edges.as_ref().map(|edges| Value::Table(field_of_view_to_table(edges))));)*
            put("orientation", message.orientation.map(|q| numbers(quaternion_from_pb(q))));
            put("position_m", message.position_m.map(|v| numbers(vector_from_pb(v))));
            table
        }

        pub(super) fn geometry_from_table(table: &Table) -> Result<proto::ViewDefinition, String> {
            if let Some(key) = table.keys().find(|key| !DEFINITION_KEYS.contains(&key.as_str())) {
                return Err(format!("unknown key `{key}`: must be one of {}", DEFINITION_KEYS.join(", ")));
            }
            let wrong = |key: &str| format!("{key}: the value has the wrong type");
            Ok(proto::ViewDefinition {
                r#type: read(table, "type")?,
                $($plain: read(table, stringify!($plain))?,)*
                $($list: read::<List<_>>(table, stringify!($list))?.map(|list| list.0).unwrap_or_default(),)*
                $($edges: match table.get(stringify!($edges)) {
                    Some(Value::Table(edges)) => Some(field_of_view_from_table(edges)?),
                    Some(_) => return Err(wrong(stringify!($edges))),
                    None => None,
                },)*
                orientation: table
                    .get("orientation")
                    .map(|value| numbers_from(value).ok_or_else(|| wrong("orientation")))
                    .transpose()?
                    .map(|[x, y, z, w]| proto::Quaternion { x, y, z, w }),
                position_m: table
                    .get("position_m")
                    .map(|value| numbers_from(value).ok_or_else(|| wrong("position_m")))
                    .transpose()?
                    .map(|[x, y, z]| proto::Vector3 { x, y, z }),
                ..Default::default()
            })
        }
    };
}

definition_message!(
    plain: [fov_y_deg, ipd_m, face_size, mapping, fov_deg, tilt_deg],
    lists: [size, faces],
    edges: [fov, fov_left, fov_right]
);

/// Returns a list of a table.
struct List<T>(Vec<T>);

impl<T: Field> Field for List<T> {
    fn read(value: &Value) -> Option<Self> {
        value.as_array()?.iter().map(T::read).collect::<Option<_>>().map(Self)
    }
}

/// Returns the table of `[[views]]` for a message.
pub(crate) fn definition_from_pb(message: &proto::ViewDefinition) -> Table {
    let mut table = geometry_to_table(message);
    let tables = [
        ("exposure", message.exposure.as_ref().map(exposure_to_table)),
        ("glare", message.glare.as_ref().map(glare_to_table)),
        ("tone_map", message.tone_map.as_ref().map(tone_map_to_table)),
    ];
    table.extend(tables.into_iter().filter_map(|(key, own)| Some((key.to_owned(), Value::Table(own?)))));
    table.extend(message.name.clone().map(|name| ("name".to_owned(), Value::from(name))));
    table.extend(message.exposure_group.clone().map(|group| ("exposure_group".to_owned(), Value::from(group))));
    table.extend(message.test_pattern.map(|shown| ("test_pattern".to_owned(), Value::from(shown))));
    table
}

/// Returns the message for a table of `[[views]]`. The error names an unknown key, or a value of the wrong type.
pub(crate) fn definition_to_pb(table: &Table) -> Result<proto::ViewDefinition, String> {
    let mut geometry = table.clone();
    let mut own = |key: &'static str| match geometry.remove(key) {
        Some(Value::Table(own)) => Ok(Some(own)),
        Some(_) => Err(format!("{key}: the value must be a table")),
        None => Ok(None),
    };
    let within = |table: &'static str| move |problem: String| format!("{table}: {problem}");
    let exposure = own("exposure")?.as_ref().map(exposure_from_table).transpose().map_err(within("exposure"))?;
    let glare = own("glare")?.as_ref().map(glare_from_table).transpose().map_err(within("glare"))?;
    let tone_map = own("tone_map")?.as_ref().map(tone_map_from_table).transpose().map_err(within("tone_map"))?;
    let (name, exposure_group) = (read(table, "name")?, read(table, "exposure_group")?);
    let test_pattern = read(table, "test_pattern")?;
    geometry.retain(|key, _| !["name", "exposure_group", "test_pattern"].contains(&key));
    let definition = geometry_from_table(&geometry)?;
    Ok(proto::ViewDefinition { name, exposure_group, test_pattern, exposure, glare, tone_map, ..definition })
}

/// Returns the definition of a view of the rig by its index; `None` if messages cannot express it.
pub(super) fn definition_of(number: usize, scene: &SceneState) -> Option<proto::ViewDefinition> {
    let geometry = geometry_from_table(scene.views.definition(number)?).ok()?;
    let ViewTables { exposure_group, exposure, mut glare, tone_map } = scene.views.tables_with_group(number);
    if let Some(file) = glare.as_mut().and_then(|glare| glare.get_mut("psf_file"))
        && let Some(in_effect) = &scene.views.settings[number].glare.psf_file
    {
        // It may be sent back, so it holds the effective path.
        *file = Value::from(in_effect.display().to_string());
    }
    let name = scene.views.rig().views()[number].name.clone();
    Some(proto::ViewDefinition {
        test_pattern: scene.objects.drawn.overlay.test_patterns.contains(&name).then_some(true),
        name: Some(name),
        exposure_group,
        exposure: exposure.and_then(|own| exposure_from_table(&own).ok()),
        glare: glare.and_then(|own| glare_from_table(&own).ok()),
        tone_map: tone_map.and_then(|own| tone_map_from_table(&own).ok()),
        ..geometry
    })
}

pub(super) const IS_ALL_OF_IT: &str = "update_mask: `definition` names the whole view: it must be the only path";

/// Returns the change that applies a complete definition.
pub(super) fn whole_definition(given: &proto::ViewDefinition) -> ViewUpdate {
    let whole = |table: Option<Table>| TableChange::All(table.unwrap_or_default());
    let group = given.exposure_group.clone().unwrap_or_default();
    let exposure = match &given.exposure {
        // The view uses the exposure of its group.
        None if !group.is_empty() => TableChange::Nothing,
        exposure => whole(exposure.as_ref().map(exposure_to_table)),
    };
    ViewUpdate {
        definition: TableChange::All(geometry_to_table(given)),
        test_pattern: Some(given.test_pattern.unwrap_or_default()),
        exposure_group: Some(group),
        exposure,
        glare: whole(given.glare.as_ref().map(glare_to_table)),
        tone_map: whole(given.tone_map.as_ref().map(tone_map_to_table)),
    }
}

/// Returns the definition for a change of the whole view. The error names a change that a definition cannot express.
pub(super) fn whole_definition_to_pb(
    name: &str,
    geometry: &Table,
    update: &ViewUpdate,
) -> Result<proto::ViewDefinition, String> {
    let mut table = geometry.clone();
    table.insert("name".to_owned(), Value::from(name));
    for (key, change) in [("exposure", &update.exposure), ("glare", &update.glare), ("tone_map", &update.tone_map)] {
        match change {
            TableChange::Nothing => {}
            TableChange::All(all) => {
                table.insert(key.to_owned(), Value::Table(all.clone()));
            }
            TableChange::Keys(_) => return Err(IS_ALL_OF_IT.to_owned()),
        }
    }
    let group = update.exposure_group.clone().filter(|group| !group.is_empty());
    table.extend(group.map(|group| ("exposure_group".to_owned(), Value::from(group))));
    table.extend(update.test_pattern.map(|shown| ("test_pattern".to_owned(), Value::from(shown))));
    definition_to_pb(&table).map_err(|problem| format!("definition: {problem}"))
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic on unexpected values")]
mod tests {
    use prost::Message as _;

    use super::{
        super::{view_update_from_pb, view_update_to_pb},
        *,
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

    #[test]
    fn every_key_of_a_view_survives_a_round_trip() {
        let table: Table = ALL_KEYS.parse().unwrap();
        let message = definition_to_pb(&table).unwrap();
        assert_eq!(definition_from_pb(&message), table);
        // The fields of the message are exactly the keys of a configuration's table.
        let mut keys: Vec<String> = table.keys().cloned().collect();
        keys.sort();
        let files = prost_types::FileDescriptorSet::decode(proto::DESCRIPTORS).unwrap();
        let message = files.file.iter().flat_map(|file| &file.message_type).find(|m| m.name() == "ViewDefinition");
        let mut fields: Vec<String> = message.unwrap().field.iter().map(|field| field.name().to_owned()).collect();
        fields.sort();
        assert_eq!(fields, keys);
        let schema = crate::config::reference::schema();
        let kinds = schema["properties"]["views"]["items"]["oneOf"].as_array().unwrap();
        // Clients cannot name files of projectors, ...
        let kinds = kinds.iter().filter(|kind| kind["properties"]["type"]["const"] != "projector");
        let properties = kinds.flat_map(|kind| kind["properties"].as_object().unwrap().keys().cloned());
        // ... and cannot write files.
        let properties: std::collections::BTreeSet<String> = properties.filter(|key| key != "packing").collect();
        assert_eq!(properties.into_iter().collect::<Vec<_>>(), keys);
        for (text, expected) in
            [("colour = 1", "unknown key `colour`"), ("size = 3", "size"), ("fov = 1.0", "fov"), ("glare = 1", "glare")]
        {
            let problem = definition_to_pb(&text.parse().unwrap()).unwrap_err();
            assert!(problem.contains(expected), "{problem}");
        }
    }

    #[test]
    fn a_definition_sets_the_whole_view() {
        let geometry: Table = "type = 'fisheye'\nsize = [8, 8]\nfov_deg = 90.0".parse().unwrap();
        let update = ViewUpdate { definition: TableChange::All(geometry), ..ViewUpdate::default() };
        let request = view_update_to_pb("v", &update, None).unwrap();
        let whole = view_update_from_pb(&request).unwrap();
        let nothing = TableChange::All(Table::new());
        let rest = ViewUpdate {
            exposure: nothing.clone(),
            glare: nothing.clone(),
            tone_map: nothing,
            exposure_group: Some(String::new()),
            test_pattern: Some(false),
            ..update.clone()
        };
        assert_eq!(whole, rest);
        // In a group, a missing exposure is that of the group.
        let update = ViewUpdate { exposure_group: Some("g".to_owned()), ..update };
        let whole = view_update_from_pb(&view_update_to_pb("v", &update, None).unwrap()).unwrap();
        assert_eq!(whole.exposure, TableChange::Nothing);
        let mut renamed = request;
        renamed.view.as_mut().unwrap().definition.as_mut().unwrap().name = Some("w".to_owned());
        assert!(view_update_from_pb(&renamed).unwrap_err().starts_with("definition.name: `w`"));
        let keys = ViewUpdate { glare: TableChange::Keys(Vec::new()), ..update };
        assert!(view_update_to_pb("v", &keys, None).unwrap_err().contains("the whole view"));
    }
}
