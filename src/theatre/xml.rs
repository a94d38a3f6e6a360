//! Bounded XML with case-insensitive names of elements and attributes, as MPCDI requires.

use std::borrow::Cow;

use roxmltree::{Document, Node, ParsingOptions};

use super::fault::Fault;

/// Maximum size of a document, bytes.
const MOST_BYTES: usize = 16 << 20;
/// Maximum number of nodes of a document.
const MOST_NODES: u32 = 200_000;
/// Maximum nesting depth of elements.
const MOST_DEPTH: usize = 32;

/// Reads a document. Type definitions, and thus entities, are refused.
pub(super) fn parse(bytes: &[u8]) -> Result<Document<'_>, Fault> {
    let allowed = "must be XML in UTF-8 of at most 16 MiB, 200000 nodes and 32 levels, without a type definition";
    let bad = |problem: String| Fault::new("XML", problem, allowed);
    if bytes.len() > MOST_BYTES {
        return Err(bad(format!("{} bytes", bytes.len())));
    }
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let text = std::str::from_utf8(bytes).map_err(|_| bad("not UTF-8".to_owned()))?;
    let options = ParsingOptions { allow_dtd: false, nodes_limit: MOST_NODES, ..ParsingOptions::default() };
    let document = Document::parse_with_options(text, options).map_err(|error| bad(error.to_string()))?;
    // Visits the nodes in document order, and tracks the nesting depth.
    let mut levels = vec![];
    for node in document.descendants() {
        while levels.last().is_some_and(|last| Some(*last) != node.parent().map(|parent| parent.id())) {
            levels.pop();
        }
        levels.push(node.id());
        if levels.len() > MOST_DEPTH {
            return Err(bad(format!("more than {MOST_DEPTH} levels")));
        }
    }
    Ok(document)
}

/// An element, with its location for messages.
#[derive(Clone)]
pub(super) struct Element<'a, 'input> {
    pub node: Node<'a, 'input>,
    pub place: String,
}

impl<'a, 'input> Element<'a, 'input> {
    pub fn root(document: &'a Document<'input>) -> Self {
        let node = document.root_element();
        Self { node, place: format!("<{}>", node.tag_name().name()) }
    }

    fn is(node: Node<'a, 'input>, name: &str) -> bool {
        node.is_element() && node.tag_name().name().eq_ignore_ascii_case(name)
    }

    /// Returns the direct child elements with a name.
    pub fn children<'n>(&self, name: &'n str) -> impl Iterator<Item = Self> + use<'a, 'input, 'n> {
        let place = self.place.clone();
        self.node
            .children()
            .filter(move |node| Self::is(*node, name))
            .map(move |node| Self { node, place: format!("{place} <{name}>") })
    }

    /// Returns the child element with a name, which must occur at most once.
    pub fn child(&self, name: &str) -> Result<Option<Self>, Fault> {
        let mut found = self.children(name);
        match (found.next(), found.next()) {
            (Some(_), Some(second)) => Err(Fault::new(second.place, "it occurs twice", "must occur once")),
            (first, _) => Ok(first),
        }
    }

    /// Returns the child element with a name, which must exist.
    pub fn needed(&self, name: &str) -> Result<Self, Fault> {
        self.child(name)?.ok_or_else(|| Fault::new(&self.place, format!("<{name}> is missing"), "it is required"))
    }

    pub fn attribute(&self, name: &str) -> Option<&'a str> {
        let mut found = self.node.attributes().filter(|attribute| attribute.name().eq_ignore_ascii_case(name));
        found.next().map(|attribute| attribute.value().trim())
    }

    /// A required attribute.
    pub fn needed_attribute(&self, name: &str) -> Result<&'a str, Fault> {
        self.attribute(name)
            .ok_or_else(|| Fault::new(&self.place, format!("the attribute {name} is missing"), "it is required"))
    }

    /// Returns the text content; comments within it do not separate words.
    pub fn text(&self) -> Cow<'a, str> {
        let mut texts = self.node.children().filter(Node::is_text).filter_map(|node| node.text());
        match (texts.next(), texts.next()) {
            (first, None) => Cow::Borrowed(first.unwrap_or_default().trim()),
            (first, second) => {
                let whole: String = first.into_iter().chain(second).chain(texts).collect();
                Cow::Owned(whole.trim().to_owned())
            }
        }
    }

    /// Returns the text of the child element with a name.
    pub fn child_text(&self, name: &str) -> Result<Option<Cow<'a, str>>, Fault> {
        Ok(self.child(name)?.map(|child| child.text()))
    }

    /// Returns the same text in lower case, for keywords.
    pub fn child_word(&self, name: &str) -> Result<Option<String>, Fault> {
        Ok(self.child_text(name)?.map(|text| text.to_ascii_lowercase()))
    }

    /// Returns the finite number in the child element with a name, which must exist.
    pub fn number(&self, name: &str) -> Result<f64, Fault> {
        let child = self.needed(name)?;
        let text = child.text();
        finite(&text).ok_or_else(|| not_a_number(&child.place, &text))
    }

    /// Returns the finite number in an optional attribute.
    pub fn attribute_number(&self, name: &str) -> Result<Option<f64>, Fault> {
        let Some(text) = self.attribute(name) else { return Ok(None) };
        finite(text).map(Some).ok_or_else(|| not_a_number(&format!("{} {name}", self.place), text))
    }
}

fn finite(text: &str) -> Option<f64> {
    text.parse::<f64>().ok().filter(|value| value.is_finite())
}

fn not_a_number(place: &str, text: &str) -> Fault {
    Fault::new(place, format!("`{}`", text.escape_debug()), "must be a finite number")
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failed assumption of a test panics")]
mod tests {
    use super::*;

    #[test]
    fn names_are_case_insensitive_and_duplicates_are_refused() {
        let document = parse(b"<A Key='1'><Bee>2.5</Bee><c/><C/></A>").unwrap();
        let root = Element::root(&document);
        assert_eq!(root.attribute("KEY"), Some("1"));
        assert_eq!(root.number("bEE").unwrap(), 2.5);
        assert!(root.child("c").is_err() && root.needed("d").is_err() && root.number("a").is_err());
    }

    #[test]
    fn comments_within_a_text_drop_nothing() {
        let text = |content: &str| {
            let bytes = format!("<a><b>{content}</b></a>");
            let document = parse(bytes.as_bytes()).unwrap();
            Element::root(&document).child_text("b").unwrap().unwrap().into_owned()
        };
        for content in
            ["<!-- p1 -->a.png", "a<!-- p1 -->.png ", " a.png<!-- p1 -->", "<![CDATA[a]]>.png", "<?x?>a.<!---->png"]
        {
            assert_eq!(text(content), "a.png", "{content}");
        }
        assert_eq!(text("<!-- none -->"), "");
    }

    #[test]
    fn entity_and_nesting_bombs_are_refused() {
        assert!(parse(b"<!DOCTYPE a [<!ENTITY b 'c'>]><a>&b;</a>").is_err());
        let deep = |levels: usize| format!("{}{}", "<a>".repeat(levels), "</a>".repeat(levels));
        assert!(parse(deep(30).as_bytes()).is_ok());
        assert!(parse(deep(40).as_bytes()).is_err());
        assert!(parse(deep(300_000).as_bytes()).is_err());
        assert!(parse("<a/>".repeat(2).as_bytes()).is_err());
        assert!(parse(b"<a>\xff</a>").is_err());
    }
}
