//! Tests that `docs/configuration.md` and `docs/steradian.schema.json` match the types, and that the schema and the
//! parser accept and refuse the same texts: every configuration in `configs/`, values on both sides of every bound of
//! every range, and mistakes.
//!
//! `STERADIAN_WRITE_REFERENCE=1 cargo test --release --test program configuration_reference` regenerates both files.

#![allow(clippy::unwrap_used, reason = "a test: a missing value fails it")]

use std::{collections::BTreeSet, fs, path::Path};

use serde_json::{Map, Value, json};
use steradian::{
    config::{Config, reference},
    ranges::{Range, Ranges},
};

fn repository() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Converts TOML to JSON as an editor does.
fn json_of(value: &toml::Value) -> Value {
    match value {
        toml::Value::Array(values) => values.iter().map(json_of).collect(),
        toml::Value::Table(table) => table.iter().map(|(key, value)| (key.clone(), json_of(value))).collect(),
        toml::Value::Datetime(time) => json!(time.to_string()),
        toml::Value::String(text) => json!(text),
        toml::Value::Integer(number) => json!(number),
        toml::Value::Float(number) => json!(number),
        toml::Value::Boolean(value) => json!(value),
    }
}

fn validator() -> jsonschema::Validator {
    jsonschema::draft7::new(&reference::schema()).unwrap()
}

/// Returns whether the schema accepts a text, and whether the parser accepts it.
fn accepted(validator: &jsonschema::Validator, text: &str) -> [bool; 2] {
    let document = json_of(&toml::Value::Table(text.parse().unwrap_or_else(|error| panic!("{error} in\n{text}"))));
    [validator.is_valid(&document), Config::from_text(text, "test.toml", Path::new("/sky"), &[]).is_ok()]
}

/// The generated files are identical to the committed ones.
#[test]
fn page_and_schema_match_the_types() {
    let schema = format!("{}\n", serde_json::to_string_pretty(&reference::schema()).unwrap());
    let write = std::env::var_os("STERADIAN_WRITE_REFERENCE").is_some();
    for (file, generated) in [("docs/configuration.md", reference::page()), ("docs/steradian.schema.json", schema)] {
        let path = repository().join(file);
        if write {
            fs::write(&path, &generated).unwrap();
        }
        let committed = fs::read_to_string(&path).unwrap_or_else(|error| panic!("{file}: {error}"));
        let differs = committed.lines().zip(generated.lines()).position(|(old, new)| old != new);
        assert!(
            committed == generated,
            "{file} does not match the types (line {:?}): STERADIAN_WRITE_REFERENCE=1 regenerates it",
            differs.map(|line| line + 1)
        );
    }
}

#[test]
fn configurations_are_valid_and_name_the_schema() {
    let validator = validator();
    for file in fs::read_dir(repository().join("configs")).unwrap() {
        let path = file.unwrap().path();
        let text = fs::read_to_string(&path).unwrap();
        let document = json_of(&toml::Value::Table(text.parse().unwrap()));
        let problems: Vec<String> =
            validator.iter_errors(&document).map(|error| format!("{}: {error}", error.instance_path())).collect();
        assert!(problems.is_empty(), "{}: {problems:#?}", path.display());
        assert!(text.starts_with("#:schema ../docs/steradian.schema.json\n"), "{}: no #:schema line", path.display());
    }
}

/// Returns the minimal keys of a view, a body or a field.
fn listed(list: &str, type_or_shape: &str) -> Map<String, Value> {
    let value = match (list, type_or_shape) {
        ("views", "perspective") => json!({ "size": [8, 8], "fov_y_deg": 60.0 }),
        ("views", "off_axis") => json!({ "type": "perspective", "size": [8, 8], "fov": edges() }),
        ("views", "stereo") => json!({ "size": [8, 8], "ipd_m": 0.06, "fov_left": edges(), "fov_right": edges() }),
        ("views", "mirrored") => json!({ "type": "stereo", "size": [8, 8], "ipd_m": 0.06, "fov": edges() }),
        ("views", "cubemap") => json!({ "face_size": 8 }),
        ("views", "fisheye") => json!({ "size": [8, 8], "fov_deg": 180.0 }),
        ("views", "dome_master") => json!({ "size": [8, 8] }),
        ("views", _) => json!({ "size": [8, 8] }),
        ("bodies", "sphere") => json!({ "position_m": [1e11, 0.0, 0.0], "radius_m": 1e3, "geometric_albedo": 0.1 }),
        ("bodies", "ellipsoid") => {
            json!({ "position_m": [1e11, 0.0, 0.0], "radii_m": [1e3, 1e3, 1e3], "geometric_albedo": [0.1, 0.2, 0.3] })
        }
        ("bodies", _) => json!({ "preset": "sun", "emission": {} }),
        ("asteroid_fields", shape) => {
            let mut field = json!({
                "position_m": [0.0, 0.0, 0.0], "instances": 3, "shape": shape, "radius_m": [1.0, 1.0],
                "spin_period_s": [1.0, 1.0], "geometric_albedo": 0.1, "size_index": 2.5,
            });
            let place = match shape {
                "box" => json!({ "size_m": [1.0, 1.0, 1.0] }),
                "belt" => json!({ "inner_m": 0.0, "outer_m": 1e18, "height_m": 1.0 }),
                _ => json!({ "inner_m": 0.0, "outer_m": 1e18, "thickness_m": 1.0 }),
            };
            field.as_object_mut().unwrap().extend(place.as_object().unwrap().clone());
            field
        }
        _ => panic!("no list {list}"),
    };
    let mut table = value.as_object().unwrap().clone();
    table.insert("name".to_owned(), json!("it"));
    if list == "views" {
        table.entry("type").or_insert(json!(type_or_shape));
    }
    table
}

fn edges() -> Value {
    json!({ "left_deg": -89.0, "right_deg": 89.0, "up_deg": 89.0, "down_deg": -89.0 })
}

/// Returns the ranges of all keys that a document can contain without referring to files. The tables of views are left
/// out, because they have the ranges of the general sections.
fn ranges() -> Vec<(String, Range)> {
    let elsewhere = ["exposure", "glare", "tone_map", "source_scale", "gamma", "white_cd_m2", "black_cd_m2"];
    let is_here =
        |key: &str| key.strip_prefix("views[].").is_none_or(|key| !elsewhere.contains(&key.split('.').next().unwrap()));
    // A camera without an observer has no horizon.
    let has_no_frame = ["scene.camera.look.azimuth_deg", "scene.camera.look.altitude_deg"];
    let all = Ranges::of(&reference::schema());
    all.iter()
        .filter(|(key, _)| is_here(key) && !has_no_frame.contains(key))
        .map(|(key, range)| (key.to_owned(), range.clone()))
        .collect()
}

/// Returns a document with an overlay and an observer.
fn on_earth(overlay: Value) -> Value {
    json!({ "overlay": overlay, "scene": { "observer": { "latitude_deg": 0.0, "longitude_deg": 0.0 } } })
}

/// Returns a `look` in the frame that `key` belongs to.
fn look_with(key: &str) -> Value {
    match key.rsplit('.').next().unwrap() {
        "azimuth_deg" | "altitude_deg" => json!({ "azimuth_deg": 0.0, "altitude_deg": 0.0 }),
        "longitude_deg" | "latitude_deg" => json!({ "frame": "galactic", "longitude_deg": 0.0, "latitude_deg": 0.0 }),
        _ => json!({ "ra_deg": 0.0, "dec_deg": 0.0 }),
    }
}

/// Returns complete JSON documents into which the key of a range can be inserted.
fn documents(range_key: &str) -> Vec<Value> {
    let list = range_key.split("[]").next().unwrap();
    let kinds: &[&str] = match list {
        "views" => {
            &["perspective", "off_axis", "stereo", "mirrored", "cubemap", "fisheye", "dome_master", "equirectangular"]
        }
        "bodies" => &["sphere", "ellipsoid", "sun"],
        "asteroid_fields" => &["box", "belt", "ring"],
        "scene.catalogues" if range_key.contains(".light.") => {
            let light = json!({ "file": "sky.fits", "unit": "s10" });
            return vec![json!({ "scene": { "catalogues": [{ "light": light }] } })];
        }
        "scene.catalogues" => return vec![json!({ "scene": { "catalogues": [{ "galaxy": { "stars": 3 } }] } })],
        "windows" => {
            let view = Value::Object(listed("views", "perspective"));
            let window = json!({ "view": "it", "position": [0, 0], "size": [8, 8] });
            return vec![json!({ "views": [view], "windows": [window] })];
        }
        list if list.split('.').next() == Some("cluster") => {
            let view = Value::Object(listed("views", "perspective"));
            let node = json!({ "name": "one", "views": ["it"] });
            let cluster = json!({ "endpoints": ["tcp/127.0.0.1:7447"] });
            return vec![json!({ "views": [view], "cluster": cluster, "nodes": [node] })];
        }
        "overlay.grids" => return vec![json!({ "overlay": { "grids": [{ "kind": "galactic" }] } })],
        "overlay.trajectories" => {
            let way = json!({ "name": "it", "points_m": [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]] });
            return vec![json!({ "overlay": { "trajectories": [way] } })];
        }
        "overlay.labels" => {
            let labels = [
                json!({ "name": "it", "ra_deg": 0.0, "dec_deg": 0.0 }),
                json!({ "name": "it", "position_m": [0.0, 0.0, 0.0] }),
                json!({ "name": "it", "azimuth_deg": 0.0, "altitude_deg": 0.0 }),
            ];
            return labels.into_iter().map(|label| on_earth(json!({ "labels": [label] }))).collect();
        }
        "overlay.pictures" => {
            let pictures = [
                json!({ "name": "it", "file": "it.png", "width_deg": 5.0, "ra_deg": 0.0, "dec_deg": 0.0 }),
                json!({ "name": "it", "file": "it.png", "width_deg": 5.0, "azimuth_deg": 0.0, "altitude_deg": 0.0 }),
            ];
            return pictures.into_iter().map(|picture| on_earth(json!({ "pictures": [picture] }))).collect();
        }
        _ => {
            // Add other keys that a bound requires.
            let others = match range_key {
                key if key.starts_with("scene.camera.look.") => {
                    json!({ "scene": { "camera": { "look": look_with(key) } } })
                }
                key if key.starts_with("scene.observer.look.") => {
                    let look = look_with(key);
                    json!({ "scene": { "observer": { "latitude_deg": 0.0, "longitude_deg": 0.0, "look": look } } })
                }
                "scene.observer.ground.landscape_azimuth_deg" => {
                    let ground = json!({ "landscape": "hills.png" });
                    json!({ "scene": { "observer": { "latitude_deg": 0.0, "longitude_deg": 0.0, "ground": ground } } })
                }
                key if key.starts_with("scene.observer.") => {
                    json!({ "scene": { "observer": { "latitude_deg": 0.0, "longitude_deg": 0.0 } } })
                }
                "tone_map.white" => json!({ "tone_map": { "operator": "reinhard" } }),
                "tone_map.peak_cd_m2" => json!({ "tone_map": { "operator": "calibrated" } }),
                "tone_map.black_cd_m2" => json!({ "tone_map": { "operator": "calibrated", "peak_cd_m2": 1e6 } }),
                "glare.age_years" => json!({ "glare": { "kernel": "cie" } }),
                "accuracy.hdr_floor_cd_m2" => json!({ "accuracy": { "hdr": 0.01 } }),
                "stars.psf_texture.diameter_mm" => json!({ "stars": { "psf_texture": { "file": "star.exr" } } }),
                "stars.psf_texture.width_arcmin" => json!({ "stars": { "psf_texture": { "file": "star.exr" } } }),
                "stars.billboard.brightest_magnitude" => {
                    json!({ "stars": { "billboard": { "faintest_magnitude": 100.0 } } })
                }
                "stars.billboard.faintest_magnitude" => {
                    json!({ "stars": { "billboard": { "brightest_magnitude": -100.0 } } })
                }
                "stars.gaussian_psf.limiting_magnitude" => {
                    json!({ "stars": { "gaussian_psf": { "saturation_magnitude": -100.0 } } })
                }
                "stars.gaussian_psf.saturation_magnitude" => {
                    json!({ "stars": { "gaussian_psf": { "limiting_magnitude": 100.0 } } })
                }
                // Add other keys without which the key has no effect.
                "exposure.ev100" => json!({ "exposure": { "mode": "manual" } }),
                "exposure.key" => json!({ "exposure": { "metering": "mean" } }),
                "exposure.spot_deg" => json!({ "exposure": { "metering": "spot" } }),
                "exposure.min_ev100" => json!({ "exposure": { "max_ev100": 100.0 } }),
                "exposure.max_ev100" => json!({ "exposure": { "min_ev100": -100.0 } }),
                _ => json!({}),
            };
            return vec![others];
        }
    };
    // Select the kinds of list entries that have the key.
    let keys: Vec<&str> = range_key.split("[].").nth(1).unwrap().split('.').collect();
    let all = kinds.iter().map(|kind| listed(list, kind));
    let has = |table: &Map<String, Value>| match keys.as_slice() {
        ["emission", ..] => table.contains_key("emission"),
        ["spin", ..] => table.contains_key("position_m"),
        ["tilt_deg"] => table["type"] == "dome_master",
        ["position_m"] => true,
        ["fov_deg"] => table["type"] == "fisheye" || table["type"] == "dome_master",
        [key, ..] => table.contains_key(*key),
        [] => false,
    };
    all.filter(has).map(|table| json!({ list: [table] })).collect()
}

/// Sets a key to a number. In a list of numbers, sets the first element, or all elements if `whole_list` is true.
fn put(document: &Value, key: &str, number: Value, whole_list: bool) -> Value {
    let mut document = document.clone();
    let mut place = &mut document;
    for step in key.split('.') {
        let (name, element) = step.strip_suffix("[]").map_or((step, false), |name| (name, true));
        if place.is_null() {
            *place = json!({});
        }
        place = &mut place[name];
        if element {
            place = &mut place[0];
        }
    }
    match place.as_array_mut() {
        Some(list) if whole_list => list.fill(number),
        Some(list) => list[0] = number,
        None if key.ends_with("velocity_c") || key.ends_with("position_m") => *place = json!([number, 0.0, 0.0]),
        None => *place = number,
    }
    document
}

/// Bounds that no configuration can reach, because another rule refuses them first: the key, whether it is the upper
/// bound, and a nearby value that is accepted.
const UNREACHED: &[(&str, bool, f64)] = &[
    // The two keys must have different values, and the other key has the same bound.
    ("stars.billboard.brightest_magnitude", true, 99.9),
    ("stars.billboard.faintest_magnitude", false, -99.9),
    ("stars.gaussian_psf.saturation_magnitude", true, 99.9),
    ("stars.gaussian_psf.limiting_magnitude", false, -99.9),
    ("asteroid_fields[].inner_m", true, 9e17),
    ("left_deg", true, 88.9),
    ("right_deg", false, -88.9),
    ("up_deg", false, -88.9),
    ("down_deg", true, 88.9),
    // The luminance would exceed its limit.
    ("bodies[].emission.absolute_magnitude", false, -10.0),
];

/// Returns a bound, or a nearby value if no configuration can reach the bound.
fn reached(key: &str, upper: bool, bound: f64) -> f64 {
    let matches = |entry: &str| if entry.contains('.') { entry == key } else { key.rsplit('.').next() == Some(entry) };
    UNREACHED.iter().find(|(entry, of_upper, _)| matches(entry) && *of_upper == upper).map_or(bound, |entry| entry.2)
}

/// Returns the nearest value beyond a bound that the type of the key can distinguish from the bound.
fn beyond(bound: f64, upwards: bool, whole: bool, angle: bool) -> f64 {
    let sign = if upwards { 1.0 } else { -1.0 };
    if whole {
        bound + sign
    } else if angle {
        // Degrees are compared in radians with a tolerance for rounding.
        bound + sign * 1e-6
    } else {
        bound + sign * (bound.abs() * 1e-9).max(1e-12)
    }
}

/// Lists the bounds of a range that the parser or the schema refuses, and the values just beyond a bound that the
/// parser or the schema accepts. Also returns the number of checks.
fn disagreements(validator: &jsonschema::Validator, key: &str, range: &Range) -> (Vec<String>, usize) {
    let documents = documents(key);
    assert!(!documents.is_empty(), "{key}: no document has this key");
    let name = key.rsplit('.').next().unwrap();
    let whole = [
        "cells",
        "layers",
        "stars",
        "size",
        "position",
        "face_size",
        "instances",
        "tiles",
        "tile_px",
        "samples",
        "monitor",
        "misses",
    ]
    .contains(&name);
    let angle = key.starts_with("views") && name.ends_with("_deg");
    // Pairs of a value and whether it is valid.
    let least = range.least.unwrap();
    let mut values = vec![(beyond(least, false, whole, angle), false)];
    if range.above {
        values.extend([(least, false), (beyond(least, true, whole, angle), true)]);
    } else {
        values.push((reached(key, false, least), true));
    }
    if let Some(most) = range.most {
        values.push((reached(key, true, most), true));
        values.push((beyond(most, true, whole, angle), false));
    }
    let (mut found, mut asked) = (Vec::new(), 0);
    for (value, allowed) in values {
        let number = if whole { json!(value as i64) } else { json!(value) };
        let both: Vec<[bool; 2]> = documents
            .iter()
            .flat_map(|document| [false, true].map(|whole_list| put(document, key, number.clone(), whole_list)))
            .map(|document| accepted(validator, &toml::to_string(&document).unwrap()))
            .collect();
        asked += both.len();
        // Other rules may refuse a valid value in some combinations; at least one combination must accept it.
        let agree = if allowed {
            both.contains(&[true, true])
        } else {
            both.iter().all(|accepted| *accepted == [false, false])
        };
        if !agree {
            found.push(format!("{key} = {value}, valid: {allowed}, accepted by [schema, parser]: {both:?}"));
        }
    }
    (found, asked)
}

#[test]
fn schema_and_parser_agree_on_both_sides_of_every_bound() {
    let validator = validator();
    let (found, asked): (Vec<_>, Vec<_>) =
        ranges().iter().map(|(key, range)| disagreements(&validator, key, range)).unzip();
    let found = found.concat();
    assert!(found.is_empty(), "{found:#?}");
    assert!(asked.iter().sum::<usize>() > 300, "only {asked:?} checks");
}

#[test]
fn wrong_bound_is_detected() {
    let validator = validator();
    for key in
        ["accuracy.flux", "views[].fov_y_deg", "bodies[].radii_m", "asteroid_fields[].size_index", "asteroids.samples"]
    {
        let range = ranges().into_iter().find(|known| known.0 == key).unwrap().1;
        assert_eq!(disagreements(&validator, key, &range).0, Vec::<String>::new());
        let (least, most) = (range.least.unwrap(), range.most.unwrap());
        for (least, most) in [(least, most * 2.0), (least, most - 0.1 * most.max(10.0)), (least - 1.0, most)] {
            let wrong = Range { least: Some(least), most: Some(most), ..range.clone() };
            assert!(!disagreements(&validator, key, &wrong).0.is_empty(), "{wrong:?} passed");
        }
    }
}

#[test]
fn schema_and_parser_refuse_the_same_mistakes() {
    let validator = validator();
    let map = "[[views]]\nname = 'v'\ntype = 'equirectangular'\nsize = [8, 4]\n";
    let own =
        format!("{map}exposure_group = 'g'\nexposure = {{ limiting_magnitude = 8 }}\n[views.glare]\nfraction = 0.5");
    for good in ["", &own, "[stars]\nmethod = 'tent'", map, "[scene]\ntime = 2026-01-01T00:00:00Z"] {
        assert_eq!(accepted(&validator, good), [true, true], "{good}");
    }
    for wrong in [
        "[moons]",
        "colour = 3",
        "[stars]\ncolour = 3",
        "[stars.billboard]\ncolour = 3",
        "[stars]\nmethod = 'dots'",
        "[stars]\nmethod = 3",
        "[stars.psf_texture]\naperture = 'square'",
        "[exposure]\nkey = 'bright'",
        "[scene]\ncatalogues = [3]",
        "[scene]\ncatalogues = [{ galaxy = { stars = 3, colour = 4 } }]",
        "[scene]\ntime = 3",
        "[scene.camera]\nposition_m = [0.0, 0.0]",
        "[[views]]\nname = 'v'\ntype = 'panorama'\nsize = [8, 4]",
        "[[views]]\nname = 'v'\nsize = [8, 4]",
        "[[views]]\ntype = 'equirectangular'\nsize = [8, 4]",
        &format!("{map}fov_deg = 90"),
        &format!("{map}orientation = [1, 0, 0]"),
        &format!("{map}exposure_group = 3"),
        &format!("{map}exposure = {{ colour = 3 }}"),
        &format!("{map}exposure = {{ limiting_magnitude = 31 }}"),
        &format!("{map}[views.glare]\nfraction = 1.5"),
        &format!("{map}[views.tone_map]\noperator = 'hable'"),
        "[[views]]\nname = 'v'\ntype = 'cubemap'\nface_size = 4\nfaces = ['top']",
        "[[bodies]]\nname = 'b'\npreset = 'pluto'",
        "[[bodies]]\nname = 'b'\npreset = 'sun'\ncolour = 3",
        "[[bodies]]\nname = 'b'\npreset = 'sun'\ngeometric_albedo = [0.1, 0.2]",
        "[[asteroid_fields]]\nname = 'f'",
        "[headset]\nformat = 'rgb565'",
        "[server]\nport = 7143",
    ] {
        assert_eq!(accepted(&validator, wrong), [false, false], "[schema, parser] {wrong}");
    }
}

/// Calls `visit` with the path and the schema of every key.
fn keys(schema: &Value, path: &str, visit: &mut dyn FnMut(&str, &Value)) {
    for form in ["oneOf", "anyOf"].iter().filter_map(|form| schema[*form].as_array()).flatten() {
        keys(form, path, visit);
    }
    if schema["items"].is_object() {
        keys(&schema["items"], &format!("{path}[]"), visit);
    }
    for (key, inner) in schema["properties"].as_object().into_iter().flatten() {
        let path = if path.is_empty() { key.clone() } else { format!("{path}.{key}") };
        visit(&path, inner);
        keys(inner, &path, visit);
    }
}

#[test]
fn every_key_is_documented() {
    let (schema, page) = (reference::schema(), reference::page());
    let mut known = BTreeSet::new();
    keys(&schema, "", &mut |path, inner| {
        known.insert(path.to_owned());
        let top = !path.contains('.');
        assert!(top || inner["description"].as_str().is_some_and(|text| !text.is_empty()), "{path} has no description");
        let key = path.rsplit('.').next().unwrap();
        let found = if top { page.contains(&format!("[{key}]")) } else { page.contains(&format!("| `{key}` |")) };
        let is_kind = ["scene.catalogues[].galaxy", "scene.catalogues[].light"].contains(&path);
        assert!(found || is_kind, "{path} is not on the page");
    });
    assert!(known.len() > 100, "only {} keys", known.len());
}
