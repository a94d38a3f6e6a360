//! The elements and attributes of an MPCDI description. Unknown names cause a note: because of a misspelled name, a mask or a map would be ignored.

use super::xml::Element;

/// Maximum number of notes on unknown names.
const MOST_NOTES: usize = 20;

/// An element, its attributes and its child elements.
type Known = (&'static str, &'static [&'static str], &'static [&'static str]);

/// Children of a mask. Some programs write the same children for a look-up table.
const PICTURE: &[&str] = &["path", "componentDepth", "bitDepth", "gammaEmbedded"];

const NAMES: [Known; 16] = [
    (
        "MPCDI",
        &["version", "profile", "level", "geometry", "color", "date"],
        &["display", "files", "fileset", "extensionSet"],
    ),
    ("display", &[], &["buffer"]),
    ("buffer", &["id", "xResolution", "yResolution"], &["region"]),
    ("region", &["id", "xResolution", "yResolution", "x", "y", "xsize", "ysize"], &["frustum", "coordinateFrame"]),
    ("frustum", &[], &["yaw", "pitch", "roll", "leftAngle", "rightAngle", "upAngle", "downAngle"]),
    (
        "coordinateFrame",
        &[],
        &["posx", "posy", "posz", "yawx", "yawy", "yawz", "pitchx", "pitchy", "pitchz", "rollx", "rolly", "rollz"],
    ),
    ("files", &[], &["fileset"]),
    (
        "fileset",
        &["region"],
        &[
            "geometryWarpFile",
            "distortionMap",
            "alphaMap",
            "betaMap",
            "correctLUT",
            "colorCorrectLUT",
            "encodeLUT",
            "decodeLUT",
        ],
    ),
    ("geometryWarpFile", &[], &["path", "interpolation", "geometricUnit", "originOf3DData"]),
    ("distortionMap", &[], &["path", "interpolation"]),
    ("alphaMap", &[], PICTURE),
    ("betaMap", &[], PICTURE),
    ("correctLUT", &[], PICTURE),
    ("colorCorrectLUT", &[], PICTURE),
    ("encodeLUT", &[], PICTURE),
    ("decodeLUT", &[], PICTURE),
];

/// Returns notes on the elements and attributes below `root` that are not read, and on extensions.
pub(super) fn unknown_names(root: &Element) -> Vec<String> {
    let mut notes = Vec::new();
    collect(root, &mut notes);
    notes.truncate(MOST_NOTES);
    notes
}

fn collect(element: &Element, notes: &mut Vec<String>) {
    let own = element.node.tag_name().name();
    let Some((_, attributes, children)) = NAMES.iter().find(|(name, ..)| name.eq_ignore_ascii_case(own)) else {
        return;
    };
    let is_one_of = |names: &[&str], name: &str| names.iter().any(|known| known.eq_ignore_ascii_case(name));
    for attribute in element.node.attributes().filter(|attribute| attribute.namespace().is_none()) {
        if !is_one_of(attributes, attribute.name()) {
            let name = attribute.name().escape_debug();
            notes.push(format!("{}: the attribute {name} is not known; it has no effect", element.place));
        }
    }
    for node in element.node.children().filter(roxmltree::Node::is_element) {
        let name = node.tag_name().name();
        let child = Element { node, place: format!("{} <{}>", element.place, name.escape_debug()) };
        if !is_one_of(children, name) {
            notes.push(format!("{}: this element is not known here; it has no effect", child.place));
        } else if name.eq_ignore_ascii_case("extensionSet") {
            collect_extensions(&child, notes);
        } else if notes.len() < MOST_NOTES {
            collect(&child, notes);
        }
    }
}

/// Extensions other than the one from which lenses are read.
fn collect_extensions(set: &Element, notes: &mut Vec<String>) {
    for extension in set.children("extension") {
        let name = extension.attribute("name").unwrap_or_default();
        if name != "BufferExtension" {
            notes.push(format!("{}: the extension `{}` is not read", extension.place, name.escape_debug()));
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failed assumption of a test panics")]
mod tests {
    use super::{super::xml::parse, *};

    #[test]
    fn unknown_elements_and_attributes_are_noted() {
        let notes = |text: &str| unknown_names(&Element::root(&parse(text.as_bytes()).unwrap()));
        let known = r#"<mpcdi Version="2.0" profile="2d" xmlns:x="y"><FILES><fileset region="a"><alphaMap><path>a</path></alphaMap>
            </fileset></FILES><extensionSet><extension Name="BufferExtension"><any/></extension></extensionSet></mpcdi>"#;
        assert_eq!(notes(known), Vec::<String>::new());
        let unknown = r#"<MPCDI version="2.0"><files><fileset region="a" regoin="b"><alfaMap><path>a</path></alfaMap></fileset></files>
            <extensionSet><extension name="Other"/></extensionSet></MPCDI>"#;
        let found = notes(unknown);
        assert_eq!(found.len(), 3, "{found:?}");
        for part in ["attribute regoin", "<files> <fileset> <alfaMap>", "extension `Other`"] {
            assert!(found.iter().any(|note| note.contains(part)), "{part}: {found:?}");
        }
        let many = format!("<MPCDI>{}</MPCDI>", "<q/>".repeat(1000));
        assert_eq!(notes(&many).len(), MOST_NOTES);
    }
}
