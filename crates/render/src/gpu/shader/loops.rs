//! Moves the test of loops from their start to their end, for software drivers.
//!
//! A software driver runs several invocations at once, as lanes of a SIMD register. Mesa's llvmpipe leaves a loop only at its end: a loop
//! that tests at its start runs once more than needed, with all lanes off. A loop that tests at its end does not. The results are the same.

use std::fmt::Write;

use super::without_comment;

/// Returns the code without comments, with `for` and `while` loops that test at their end. Line numbers do not change.
///
/// Loops without a condition, and text that is not complete WGSL, are not changed.
pub(super) fn tested_at_end(text: &str) -> String {
    let code: Vec<&str> = text.lines().map(without_comment).collect();
    let mut changed = String::with_capacity(text.len() + text.len() / 8);
    convert(&code.join("\n"), &mut changed);
    changed
}

/// A loop that tests at its start.
struct Loop<'a> {
    /// Everything before the loop.
    before: &'a str,
    initial: &'a str,
    condition: &'a str,
    update: &'a str,
    body: &'a str,
    /// Everything after the loop.
    after: &'a str,
}

/// Appends `code` to `changed`, with its loops changed.
fn convert(mut code: &str, changed: &mut String) {
    while let Some(found) = first_loop(code) {
        changed.push_str(found.before);
        // The block limits the scope of the variable. The test before the first iteration costs only a mask.
        let Loop { initial, condition, update, .. } = found;
        let _ = write!(changed, "{{ {initial}; if {condition} {{ loop {{");
        convert(found.body, changed);
        let _ = write!(changed, " continuing {{ {update}; break if !({condition}); }} }} }} }}");
        code = found.after;
    }
    changed.push_str(code);
}

/// Returns the first loop of `code` that has a condition.
fn first_loop(code: &str) -> Option<Loop<'_>> {
    let mut from = 0;
    loop {
        let (start, word) =
            ["for", "while"].iter().filter_map(|word| Some((find_word(code, word, from)?, *word))).min()?;
        let head = start + word.len();
        let (open, parts) = if word == "for" {
            let first = head + code[head..].find('(')?;
            let last = closing(code, first)?;
            let parts: Vec<&str> = code[first + 1..last].split(';').map(str::trim).collect();
            (last + code[last..].find('{')?, parts)
        } else {
            let open = head + code[head..].find('{')?;
            (open, vec!["", code[head..open].trim(), ""])
        };
        let close = closing(code, open)?;
        if let [initial, condition, update] = parts[..]
            && !condition.is_empty()
        {
            let (body, after) = (&code[open + 1..close], &code[close + 1..]);
            return Some(Loop { before: &code[..start], initial, condition, update, body, after });
        }
        from = open + 1;
    }
}

/// Returns the position of `word` as a separate word in `code`, at `from` or later.
fn find_word(code: &str, word: &str, from: usize) -> Option<usize> {
    let is_part = |letter: Option<char>| letter.is_some_and(|letter| letter.is_alphanumeric() || letter == '_');
    code[from..]
        .match_indices(word)
        .map(|(at, _)| from + at)
        .find(|&at| !is_part(code[..at].chars().next_back()) && !is_part(code[at + word.len()..].chars().next()))
}

/// Returns the position of the bracket that closes the one at `open`.
fn closing(code: &str, open: usize) -> Option<usize> {
    let mut depth = 0_usize;
    for (at, letter) in code[open..].char_indices() {
        match letter {
            '(' | '{' => depth += 1,
            ')' | '}' => depth = depth.checked_sub(1)?,
            _ => {}
        }
        if depth == 0 {
            return Some(open + at);
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn loops_test_at_their_end() {
        let text = "for (var i = 0u; i < min(4u, n); i++) { // rows\n    x += before_for[i];\n}\n";
        let expected = "{ var i = 0u; if i < min(4u, n) { loop { \n    x += before_for[i];\n \
                        continuing { i++; break if !(i < min(4u, n)); } } } }";
        assert_eq!(tested_at_end(text), expected);
        let text = "while (tiles & 1u) != 0u { tiles >>= 1u; } a = 1;";
        let expected = "{ ; if (tiles & 1u) != 0u { loop { tiles >>= 1u;  continuing { ; break if !((tiles & 1u) != 0u); } } } } a = 1;";
        assert_eq!(tested_at_end(text), expected);
    }

    #[test]
    fn loops_inside_of_loops_change_too() {
        let changed = tested_at_end(
            "for (var j = 0; j < 2; j++) { for (var i = j; i < 3; i++) { a(i); } while b { c(); } }\nd();",
        );
        assert_eq!(changed.matches("break if !(").count(), 3);
        assert!(!changed.contains("for") && !changed.contains("while"), "{changed}");
        assert!(changed.ends_with("\nd();"), "{changed}");
    }

    #[test]
    fn other_text_is_not_changed() {
        for text in [
            "loop { if a { break; } }",
            "for (;;) { break; }",
            "for (var i = 0; i < 2",
            "let for_all = while_2;",
            "while a",
        ] {
            assert_eq!(tested_at_end(text), text);
        }
        // A loop without a condition does not hide the one inside it.
        assert_eq!(tested_at_end("for (;;) { while a { b(); } }").matches("break if !(a)").count(), 1);
    }
}
