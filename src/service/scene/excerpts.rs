//! Short forms of names and lists for messages. Names come from clients, and lists may have any length. An answer whose error text is too long for
//! the headers of HTTP/2 ends all calls of its connection.

use std::borrow::Cow;

/// Maximum length of a name in a list, bytes.
const MOST_NAME: usize = 96;
/// Maximum length of a list, bytes.
const MOST_LIST: usize = 320;

/// Returns the bytes of a character in the header `grpc-message`, which is percent-encoded.
fn encoded_bytes(character: char) -> usize {
    let is_plain = matches!(character, '!'..='~') && !"\"#%<>`?{}".contains(character);
    if is_plain { 1 } else { 3 * character.len_utf8() }
}

/// Returns the bytes of a text in the header `grpc-message`.
pub(crate) fn encoded_length(text: &str) -> usize {
    text.chars().map(encoded_bytes).sum()
}

/// Returns the start of a text that takes at most this many encoded bytes.
pub(crate) fn start_of(text: &str, most: usize) -> &str {
    let mut bytes = 0;
    let end = text.char_indices().find(|(_, character)| {
        bytes += encoded_bytes(*character);
        bytes > most
    });
    &text[..end.map_or(text.len(), |(index, _)| index)]
}

/// Returns the end of a text that takes at most this many encoded bytes.
pub(crate) fn end_of(text: &str, most: usize) -> &str {
    let mut bytes = 0;
    let start = text.char_indices().rev().find(|(_, character)| {
        bytes += encoded_bytes(*character);
        bytes > most
    });
    &text[start.map_or(0, |(index, character)| index + character.len_utf8())..]
}

/// Shortens a text to about this many encoded bytes.
pub(crate) fn excerpt(text: &str, most: usize) -> Cow<'_, str> {
    match start_of(text, most) {
        all if all.len() == text.len() => Cow::Borrowed(text),
        start => Cow::Owned(format!("{start}...")),
    }
}

/// Lists names: either all, or the first of them and the number of the others.
pub(crate) fn listed<'a>(names: impl IntoIterator<Item = &'a str>) -> String {
    let names: Vec<&str> = names.into_iter().collect();
    let (mut list, mut bytes) = (String::new(), 0);
    for (index, name) in names.iter().enumerate() {
        let name = excerpt(name, MOST_NAME);
        bytes += encoded_length(&name);
        if bytes > MOST_LIST {
            return format!("{list} and {} more", names.len() - index);
        }
        let separator = if index == 0 { "" } else { ", " };
        list += separator;
        list += &name;
    }
    if list.is_empty() { "none".to_owned() } else { list }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_are_cut_at_characters_by_their_encoded_length() {
        assert_eq!(encoded_length("a b`ä"), 1 + 3 + 1 + 3 + 6);
        assert_eq!((start_of("aäb", 6), start_of("aäb", 7), start_of("aäb", 8)), ("a", "aä", "aäb"));
        assert_eq!((end_of("aäb", 6), end_of("aäb", 7), end_of("aäb", 8)), ("b", "äb", "aäb"));
        assert_eq!(excerpt("abc", 3), "abc");
        assert_eq!(excerpt("abcd", 3), "abc...");
    }

    #[test]
    fn long_lists_have_their_first_names_and_the_number_of_the_others() {
        assert_eq!(listed([]), "none");
        assert_eq!(listed(["a", "b c"]), "a, b c");
        let names: Vec<String> = (0..90).map(|number| format!("{number:035}")).collect();
        let list = listed(names.iter().map(String::as_str));
        assert!(list.starts_with(&names[0]) && list.ends_with(" and 81 more"), "{list}");
        let long = "y".repeat(100_000);
        assert!(listed([&*long, &*long, &*long, &*long]).len() < 2 * MOST_LIST);
    }
}
