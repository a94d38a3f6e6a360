//! The keys of SGCT's configurations, from its JSON schema. Unknown keys cause a note: because of a misspelled key, a mask or a mesh would be
//! ignored.

use serde_json::Value;

use super::{
    fault::Fault,
    json::{ANGLES, Field},
};

/// Maximum number of notes on unknown keys.
const MOST_NOTES: usize = 20;

/// The name of an object and its keys. The name is the key that holds the object; after `projection` it has the type of the projection, in lower
/// case.
const KEYS: [(&str, &[&str]); 24] = [
    (
        "",
        &[
            "$schema",
            "version",
            "masteraddress",
            "externalcontrolport",
            "debuglog",
            "threadaffinity",
            "firmsync",
            "scene",
            "nodes",
            "users",
            "capture",
            "trackers",
            "settings",
            "generator",
            "meta",
        ],
    ),
    ("scene", &["offset", "orientation", "scale"]),
    ("nodes", &["address", "port", "datatransferport", "swaplock", "windows"]),
    ("users", &["name", "eyeseparation", "pos", "matrix", "orientation", "tracking"]),
    (
        "windows",
        &[
            "pos",
            "size",
            "res",
            "viewports",
            "id",
            "name",
            "tags",
            "bufferbitdepth",
            "fullscreen",
            "autoiconify",
            "hidemousecursor",
            "floating",
            "alwaysrender",
            "hidden",
            "takescreenshot",
            "alpha",
            "msaa",
            "fxaa",
            "border",
            "resizable",
            "draw2d",
            "draw3d",
            "noerror",
            "blitwindowid",
            "mirrorx",
            "mirrory",
            "monitor",
            "stereo",
            "spout",
            "ndi",
            "scalablemesh",
        ],
    ),
    (
        "viewports",
        &["pos", "size", "projection", "overlay", "blendmask", "blacklevelmask", "mesh", "tracked", "eye", "user"],
    ),
    ("projection planar", PLANAR),
    ("projection texturemapped", PLANAR),
    ("planarprojection", PLANAR),
    ("projection projectionplane", &["type", "lowerleft", "upperleft", "upperright"]),
    (
        "projection fisheye",
        &[
            "type",
            "fov",
            "quality",
            "interpolation",
            "tilt",
            "diameter",
            "crop",
            "keepaspectratio",
            "offset",
            "background",
        ],
    ),
    (
        "projection spoutflat",
        &["type", "planarprojection", "width", "height", "mappingspoutname", "drawmain", "background"],
    ),
    ("fov", &["left", "right", "down", "up", "hfov", "vfov", "distance"]),
    ("crop", &["left", "right", "bottom", "top"]),
    ("orientation", &["x", "y", "z", "w"]),
    ("pos", POINT),
    ("size", &["x", "y"]),
    ("res", &["x", "y"]),
    ("offset", POINT),
    ("scale", POINT),
    ("lowerleft", POINT),
    ("upperleft", POINT),
    ("upperright", POINT),
    ("tracking", &["tracker", "device"]),
];

const PLANAR: &[&str] = &["type", "fov", "distance", "orientation", "offset"];
const POINT: &[&str] = &["x", "y", "z"];

/// Returns notes on keys that are not read, and on old names of keys.
pub(super) fn unknown_keys(root: &Field) -> Vec<String> {
    let mut notes = Vec::new();
    collect(root, "", &mut notes);
    notes.truncate(MOST_NOTES);
    notes
}

fn collect(object: &Field, held_by: &str, notes: &mut Vec<String>) {
    if let Value::Array(_) = object.value {
        for element in object.list().into_iter().flatten() {
            collect(&element, held_by, notes);
        }
        return;
    }
    let Value::Object(map) = object.value else { return };
    let context = match held_by {
        "projection" => format!("projection {}", projection_type(object).unwrap_or_default()),
        other => other.to_owned(),
    };
    let Some((_, known)) = KEYS.iter().find(|(of, _)| *of == context) else { return };
    for (key, value) in map {
        let name = key.to_ascii_lowercase();
        let place = match object.place.as_str() {
            "" => key.escape_debug().to_string(),
            outer => format!("{outer}.{}", key.escape_debug()),
        };
        if notes.len() >= MOST_NOTES {
            return;
        } else if known.contains(&name.as_str()) {
            collect(&Field { value, place }, &name, notes);
        } else if let Some([now, ..]) =
            ANGLES.iter().find(|names| context == "orientation" && names.contains(&name.as_str()))
        {
            if *now != name {
                notes.push(format!("{place}: read as {now}, as in SGCT's configurations in XML"));
            }
        } else if context == "windows" && name == "mpcdi" {
            notes.push(format!("{place}: the set is not read; import it by itself"));
        } else {
            notes.push(format!("{place}: the key is not known; it has no effect"));
        }
    }
}

/// Returns the type of a projection in lower case, without `projection` at its end.
pub(super) fn projection_type(projection: &Field) -> Result<String, Fault> {
    let name = projection.needed("type")?.text()?.to_ascii_lowercase();
    Ok(name.strip_suffix("projection").unwrap_or(&name).to_owned())
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failed assumption of a test panics")]
mod tests {
    use super::*;

    #[test]
    fn unknown_keys_and_old_names_are_noted() {
        let notes = |text: &str| {
            let value: Value = serde_json::from_str(text).unwrap();
            unknown_keys(&Field { value: &value, place: String::new() })
        };
        let known = r#"{"version":1,"Nodes":[{"windows":[{"size":{"x":1,"y":1},"viewports":[{"projection":{"type":"PlanarProjection",
            "fov":{"hfov":1,"vfov":1},"orientation":{"yaw":0,"pitch":0,"roll":0}}}]}]}],"meta":{"any":1}}"#;
        assert_eq!(notes(known), Vec::<String>::new());
        let unknown = r#"{"nodes":[{"windows":[{"mpcdi":"a","viewports":[{"blend_mask":"b","projection":{"type":"planar","tilt":3,
            "orientation":{"heading":0,"pitch":0,"roll":0}}}]}]}]}"#;
        let found = notes(unknown);
        assert_eq!(found.len(), 4, "{found:?}");
        for part in [
            "nodes[0].windows[0].mpcdi: the set is not read",
            "viewports[0].blend_mask: the key is not known",
            "projection.tilt: the key is not known",
            "orientation.heading: read as yaw",
        ] {
            assert!(found.iter().any(|note| note.contains(part)), "{part}: {found:?}");
        }
    }
}
