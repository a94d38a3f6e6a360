//! Texts that logs and messages repeat.

/// Returns the first character of a text that is invisible or changes the appearance of the text around it. Such characters are control characters,
/// line and paragraph separators, and format characters. Format characters are those of the category Cf of Unicode 16 (UnicodeData.txt): the soft
/// hyphen, characters of zero width, and marks of the writing direction.
pub(crate) fn hidden_character(text: &str) -> Option<char> {
    text.chars().find(|c| c.is_control() || is_format(*c))
}

fn is_format(c: char) -> bool {
    matches!(c,
        '\u{ad}' | '\u{600}'..='\u{605}' | '\u{61c}' | '\u{6dd}' | '\u{70f}' | '\u{890}'..='\u{891}' | '\u{8e2}'
        | '\u{180e}' | '\u{200b}'..='\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2060}'..='\u{206f}' | '\u{feff}'
        | '\u{fff9}'..='\u{fffb}' | '\u{110bd}' | '\u{110cd}' | '\u{13430}'..='\u{1343f}' | '\u{1bca0}'..='\u{1bca3}'
        | '\u{1d173}'..='\u{1d17a}' | '\u{e0001}'..='\u{e007f}')
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn letters_of_all_scripts_are_plain_and_hidden_characters_are_not() {
        for plain in ["", "first desk", "Pult № 2", "नियंत्रण", "操作台", "e\u{301}", "\u{a0}"] {
            assert_eq!(hidden_character(plain), None, "{plain}");
        }
        for hidden in [
            '\n',
            '\r',
            '\t',
            '\0',
            '\u{1b}',
            '\u{7f}',
            '\u{85}',
            '\u{202e}',
            '\u{2066}',
            '\u{200b}',
            '\u{200d}',
            '\u{2028}',
            '\u{feff}',
            '\u{ad}',
            '\u{e0041}',
        ] {
            assert_eq!(hidden_character(&format!("a{hidden}b")), Some(hidden), "{hidden:?}");
        }
    }
}
