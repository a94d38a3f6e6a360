//! The reference of all keys, generated from the types of the configuration: a JSON Schema for editors and a page for people,
//! `docs/steradian.schema.json` and `docs/configuration.md`.
//!
//! Keys, types, defaults, ranges and texts come from the types by `schemars` (texts are the doc comments), units from the endings of the keys or from
//! the ranges. Rules that involve several keys are not in the schema; the parser checks them.

use schemars::{Schema, SchemaGenerator, json_schema};
use serde_json::{Map, Value, json};

use super::reading::Sections;
use super::views::all_faces;
use crate::photometry::psf::Aperture;
use crate::ranges::{Range, number, schema_of};
use crate::scene::bodies::BRIGHTEST_ALBEDO;
use crate::solar_system::SolarBody;

/// Order of the sections on the page; a test checks that it is complete.
const SECTIONS: [&str; 16] = [
    "scene",
    "views",
    "bodies",
    "asteroid_fields",
    "overlay",
    "asteroids",
    "stars",
    "glare",
    "exposure",
    "tone_map",
    "accuracy",
    "headset",
    "windows",
    "cluster",
    "nodes",
    "server",
];

/// Units of keys, by the ending of the key. Longer endings come first.
const UNITS: [(&str, &str); 21] = [
    ("_cd_m2", "cd/m²"),
    ("_deg_s", "deg/s"),
    ("_m_s", "m/s"),
    ("_px2", "pixels²"),
    ("_arcmin", "arcminutes"),
    ("_deg", "degrees"),
    ("_years", "years"),
    ("_px", "pixels"),
    ("_mm", "mm"),
    ("_m", "m"),
    ("_s", "s"),
    ("_k", "K"),
    ("temperature_c", "°C"),
    ("_c", "speed of light"),
    ("_ev", "EV"),
    ("ev100", "EV100"),
    ("magnitude", "mag"),
    ("magnitude_limit", "mag"),
    ("fainter_than", "mag"),
    ("face_size", "pixels"),
    ("size", "pixels"),
];

/// Sections that views may also have as tables; the section gives the keys that a view does not give.
const OF_VIEWS: [&str; 3] = ["exposure", "glare", "tone_map"];

/// Schema of an albedo: one number, or one for each of red, green and blue.
pub(super) fn albedo(_: &mut SchemaGenerator) -> Schema {
    let number = json!({ "type": "number", "minimum": 0.0, "maximum": BRIGHTEST_ALBEDO });
    json_schema!({
        "anyOf": [
            number,
            { "type": "array", "items": number, "minItems": 3, "maxItems": 3 },
        ]
    })
}

/// Schema of the source of a body's position.
pub(super) fn ephemeris(_: &mut SchemaGenerator) -> Schema {
    json_schema!({
        "anyOf": [
            { "type": "string", "enum": SolarBody::ALL.map(SolarBody::name) },
            { "type": "string", "pattern": "^spk:-?[0-9]+$" },
        ]
    })
}

/// Schema of a monitor: its name, its number, or a text of its EDID.
pub(super) fn monitor(_: &mut SchemaGenerator) -> Schema {
    json_schema!({
        "anyOf": [
            { "type": "string", "minLength": 1 },
            { "type": "integer", "minimum": 1 },
            {
                "type": "object",
                "propertyNames": { "enum": ["edid"] },
                "minProperties": 1,
                "additionalProperties": { "type": "string", "minLength": 1 },
            },
        ]
    })
}

/// Schema of a date with time and offset.
pub(super) fn time(_: &mut SchemaGenerator) -> Schema {
    let text = "^([+-]?[0-9]{4,6}-[0-9]{2}-[0-9]{2}T.*|(JD|jd) *-?[0-9]+([.][0-9]+)?)$";
    json_schema!({ "type": "string", "anyOf": [{ "format": "date-time" }, { "const": "now" }, { "pattern": text }] })
}

/// Returns the JSON Schema of a configuration, draft 7, without references.
pub fn schema() -> Value {
    let mut schema = schema_of::<Sections>().clone();
    tidy(&mut schema);
    let apertures = json!(Aperture::NAMES);
    change_at(&mut schema, &["stars", "psf_texture", "aperture"], &mut |text| text["enum"] = apertures.clone());
    change_at(&mut schema, &["views[]", "faces[]"], &mut |text| text["enum"] = json!(all_faces()));
    schema["title"] = json!("Configuration of Steradian");
    schema["description"] =
        json!("Scene, views and settings of Steradian; docs/configuration.md has the same content as a page.");
    schema
}

/// Removes null, which TOML does not have, and number formats, which editors do not know. Writes times as TOML does.
fn tidy(schema: &mut Value) {
    match schema {
        Value::Array(values) => values.iter_mut().for_each(tidy),
        Value::Object(object) => {
            object.values_mut().for_each(tidy);
            let null = |value: &Value| *value == json!("null") || *value == json!({ "type": "null" });
            if let Some(Value::Array(types)) = object.get_mut("type") {
                types.retain(|name| !null(name));
                if let [only] = types.as_slice() {
                    let only = only.clone();
                    object.insert("type".to_owned(), only);
                }
            }
            if let Some(Value::Array(forms)) = object.get_mut("anyOf") {
                forms.retain(|form| !null(form));
                if let [Value::Object(only)] = forms.as_slice() {
                    // Properties of the key override the properties of its type.
                    let mut only = only.clone();
                    object.remove("anyOf");
                    only.append(object);
                    *object = only;
                }
            }
            let is_object = object.get("type") == Some(&json!("object"));
            match object.get_mut("default") {
                Some(Value::Null) => {
                    object.remove("default");
                }
                // The defaults of a table are the defaults of its keys.
                Some(Value::Object(_)) if is_object => {
                    object.remove("default");
                }
                Some(Value::Object(time)) => {
                    if let Some(text) = time.get("$__toml_private_datetime").cloned() {
                        object.insert("default".to_owned(), text);
                    }
                }
                _ => {}
            }
            if matches!(object.get("type"), Some(Value::String(kind)) if kind == "number" || kind == "integer") {
                object.remove("format");
            }
            if let Some(Value::String(text)) = object.get_mut("description") {
                *text = text.replace('\n', " ").replace("[`", "`").replace("`]", "`");
            }
        }
        _ => {}
    }
}

/// Calls `change` with every schema at a path, including those in alternatives.
fn change_at(schema: &mut Value, path: &[&str], change: &mut dyn FnMut(&mut Value)) {
    for form in ["oneOf", "anyOf"] {
        if let Some(Value::Array(forms)) = schema.get_mut(form) {
            forms.iter_mut().for_each(|form| change_at(form, path, change));
            return;
        }
    }
    let Some((step, rest)) = path.split_first() else { return change(schema) };
    let (name, element) = step.strip_suffix("[]").map_or((*step, false), |name| (name, true));
    let Some(mut inner) = schema.get_mut("properties").and_then(|properties| properties.get_mut(name)) else { return };
    if element {
        match inner.get_mut("items") {
            Some(items) => inner = items,
            None => return,
        }
    }
    change_at(inner, rest, change);
}

/// Returns the page of all keys as Markdown.
pub fn page() -> String {
    let schema = schema();
    let mut page = Page { text: HEAD.to_owned(), printed: Vec::new() };
    let properties = properties(&schema);
    // Tables of views that repeat a section are not written again.
    for section in OF_VIEWS {
        let mut schema = schema.clone();
        change_at(&mut schema, &["views[]", section], &mut |table| {
            page.printed.push((format!("[{section}]"), table["properties"].as_object().cloned().unwrap_or_default()));
        });
    }
    for section in SECTIONS {
        let Some(inner) = properties.get(section) else { continue };
        if inner["type"] == json!("array") {
            page.table(&format!("[[{section}]]"), &format!("{section}[]"), &inner["items"]);
        } else {
            page.table(&format!("[{section}]"), section, inner);
        }
    }
    page.text
}

const HEAD: &str = "# Configuration

<!-- Generated from the types: `STERADIAN_WRITE_REFERENCE=1 cargo test --release --test program configuration_reference` -->

Configurations are TOML. Unknown keys and values out of range are refused with file, key and valid values. Keys that have no effect with the
other keys are refused too, such as `tone_map.peak_cd_m2` with `operator = \"filmic\"`. Those that clients can put into effect at run time are kept, and
a warning names them: the tables of star methods, `glare.psf_file`, `glare.weights`, and the keys of air and ground with `enabled = false`. All sections and,
unless the column *default* has a dash, all keys may be left out. Paths of files are relative to the folder of the
configuration. `--set key=value` overrides a key for one run; an element of a list is named by its index or, if it has one, its
name: `--set views.dome.tilt_deg=15`, `--set scene.catalogues.0=my.csv`.

[steradian.schema.json](steradian.schema.json) is the same reference as a JSON Schema. Editors with Taplo (Even Better TOML in VS Code) use it for
validation and completion where the file begins with a line `#:schema` and the path of the schema, as those in [configs](../configs) do.

The schema does not express rules that tie several keys together, such as \"exactly one of `fov_y_deg` and `fov`\"; `steradian render`
and `serve` check them when they load a configuration.

Lists have one entry for each axis or channel. Coordinates are ICRS, barycentric. Quaternions are written x, y, z, w.
";

fn properties(schema: &Value) -> Map<String, Value> {
    schema["properties"].as_object().cloned().unwrap_or_default()
}

/// The page under construction.
struct Page {
    text: String,
    /// Headings and keys of the tables so far. A table with the same keys is not written again.
    printed: Vec<(String, Map<String, Value>)>,
}

impl Page {
    /// Writes the keys of a table and of the tables below it; `path` is the path used for ranges.
    fn table(&mut self, heading: &str, path: &str, schema: &Value) {
        self.text.push_str(&format!("\n## {heading}\n"));
        let text = schema["description"].as_str().unwrap_or_default();
        // Remove the name of the table from the beginning of the type's text, such as "`[stars]`: how stars are drawn.".
        let text = if text.starts_with("`[") { text.split_once("`: ").map_or("", |(_, text)| text) } else { text };
        if !text.is_empty() {
            self.text.push_str(&format!("\n{text}\n"));
        }
        if let Some(Value::Array(forms)) = schema.get("oneOf") {
            for form in forms {
                let kind = form["properties"]["type"]["const"].as_str().unwrap_or_default();
                self.table(&format!("{heading}, type = \"{kind}\""), path, form);
            }
            return;
        }
        let own = properties(schema);
        self.printed.push((heading.to_owned(), own.clone()));
        self.text.push_str("\n| key | type | unit | default | range | meaning |\n|---|---|---|---|---|---|\n");
        let required: Vec<&str> =
            schema["required"].as_array().into_iter().flatten().filter_map(Value::as_str).collect();
        for (key, inner) in &own {
            let needed = required.contains(&key.as_str());
            let same = self.printed.iter().find(|(_, keys)| *keys == properties(inner) && !keys.is_empty());
            let type_of = same.map_or_else(|| type_of(inner), |(heading, _)| format!("table as `{heading}`"));
            self.text.push_str(&row(key, &type_of, inner, needed));
        }
        for (key, inner) in &own {
            let forms = inner["oneOf"].as_array().or(inner["items"]["oneOf"].as_array());
            if let Some(forms) = forms {
                self.text.push_str(&format!("\nValues of `{key}`:\n\n"));
                for form in forms {
                    let (value, text) = (form["const"].as_str(), form["description"].as_str());
                    self.text.push_str(&format!("- `{}`: {}\n", value.unwrap_or_default(), text.unwrap_or_default()));
                }
            }
        }
        for (key, inner) in &own {
            let inner_path = format!("{path}.{key}");
            if inner["type"] == json!("object") && !self.printed.iter().any(|(_, keys)| *keys == properties(inner)) {
                let heading = inner_path.replace("[]", "");
                let heading = if path.contains("[]") { heading } else { format!("[{heading}]") };
                self.table(&heading, &inner_path, inner);
            }
            if inner["items"]["type"] == json!("object") {
                self.table(&format!("[[{inner_path}]]"), &format!("{inner_path}[]"), &inner["items"]);
            }
            for form in inner["items"]["anyOf"].as_array().into_iter().flatten() {
                for (name, entry) in properties(form) {
                    self.table(&format!("{inner_path}, entry {name}"), &format!("{inner_path}[].{name}"), &entry);
                }
            }
        }
    }
}

/// Writes the row of a key.
fn row(key: &str, type_of: &str, schema: &Value, needed: bool) -> String {
    let default = match schema.get("default") {
        Some(value) => format!("`{}`", toml_value(value)),
        None if needed => "–, needed".to_owned(),
        None => "–".to_owned(),
    };
    let range = range_of(schema);
    let unit = match unit_of(key, schema) {
        "" => range.as_ref().map_or("", |range| &range.unit),
        unit => unit,
    };
    let allowed = match (&range, schema["enum"].as_array().or(schema["items"]["enum"].as_array())) {
        (Some(range), _) => range.short(),
        (None, Some(values)) => list(values),
        (None, None) => schema.get("const").map(|value| list(std::slice::from_ref(value))).unwrap_or_default(),
    };
    let text = schema["description"].as_str().unwrap_or_default().replace('|', "\\|");
    format!("| `{key}` | {type_of} | {unit} | {default} | {allowed} | {text} |\n")
}

fn list(values: &[Value]) -> String {
    values.iter().map(|value| format!("`{}`", toml_value(value))).collect::<Vec<_>>().join(", ")
}

/// Returns the range of a number, of the elements of a list, or of the first alternative that has a range.
fn range_of(schema: &Value) -> Option<Range> {
    let first = || schema["anyOf"].as_array()?.iter().find_map(range_of);
    Range::of_schema(schema).or_else(|| range_of(schema.get("items")?)).or_else(first)
}

fn type_of(schema: &Value) -> String {
    if let Some(forms) = schema["anyOf"].as_array() {
        return forms.iter().map(type_of).collect::<Vec<_>>().join(" or ");
    }
    if schema.get("oneOf").is_some() || schema.get("const").is_some() {
        return "name".to_owned();
    }
    match schema["type"].as_str() {
        Some("array") => {
            let of = match schema["items"].get("anyOf") {
                Some(_) => "entries".to_owned(),
                None => plural(&type_of(&schema["items"])),
            };
            schema["minItems"].as_u64().map_or(format!("list of {of}"), |count| format!("{count} {of}"))
        }
        Some("object") => "table".to_owned(),
        None if schema["format"] == json!("date-time") => "date and time".to_owned(),
        None if schema.get("pattern").is_some() => "text".to_owned(),
        Some("string") if schema["format"] == json!("date-time") => "date and time".to_owned(),
        Some(name) => name.to_owned(),
        None => String::new(),
    }
}

fn plural(name: &str) -> String {
    // "2 numbers" is already a list.
    if name.starts_with(|first: char| first.is_ascii_digit()) { format!("lists of {name}") } else { format!("{name}s") }
}

fn unit_of(key: &str, schema: &Value) -> &'static str {
    let counts = schema["type"] == json!("number")
        || schema["type"] == json!("integer")
        || schema["items"]["type"] == json!("number")
        || schema["items"]["type"] == json!("integer");
    let unit = UNITS.iter().find(|(ending, _)| key.ends_with(ending));
    unit.filter(|_| counts).map_or("", |(_, unit)| unit)
}

/// Formats a default value as TOML.
fn toml_value(value: &Value) -> String {
    match value {
        Value::Array(values) => format!("[{}]", values.iter().map(toml_value).collect::<Vec<_>>().join(", ")),
        Value::Number(value) if value.is_f64() => {
            let text = number(value.as_f64().unwrap_or_default());
            if text.contains(['.', 'e']) { text } else { format!("{text}.0") }
        }
        other => other.to_string(),
    }
}
