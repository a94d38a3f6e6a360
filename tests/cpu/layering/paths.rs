//! Tokens of Rust source, and the paths in them.

/// Token of Rust source, as far as needed for paths.
#[derive(Clone, Debug, PartialEq)]
pub enum Token {
    Word(String),
    PathSeparator,
    Other(char),
}

/// Splits source into tokens. Comments, strings, characters and white space produce none.
pub fn tokens(source: &str) -> Vec<Token> {
    let text: Vec<char> = source.chars().collect();
    let char_at = |i: usize| text.get(i).copied().unwrap_or('\0');
    let is_word = |c: char| c.is_alphanumeric() || c == '_';
    let mut found = Vec::new();
    let mut i = 0;
    while i < text.len() {
        let c = text[i];
        if c == '/' && char_at(i + 1) == '/' {
            while i < text.len() && text[i] != '\n' {
                i += 1;
            }
        } else if c == '/' && char_at(i + 1) == '*' {
            i = end_of_block_comment(&text, i);
        } else if c == '"' {
            i = end_of_string(&text, i);
        } else if c == '\'' {
            // This is a character ('x', '\n', '\u{7f}') or a lifetime ('a). A lifetime has no quote after its first
            // letter.
            if char_at(i + 1) == '\\' {
                i += 3;
                while i < text.len() && text[i] != '\'' {
                    i += 1;
                }
                i += 1;
            } else if char_at(i + 2) == '\'' {
                i += 3;
            } else {
                i += 1;
            }
        } else if is_word(c) {
            let start = i;
            while is_word(char_at(i)) {
                i += 1;
            }
            let word: String = text[start..i].iter().collect();
            let hashes = (i..).take_while(|&k| char_at(k) == '#').count();
            if matches!(word.as_str(), "r" | "br" | "cr") && char_at(i + hashes) == '"' {
                i = end_of_raw_string(&text, i + hashes, hashes);
            } else if word == "r" && hashes == 1 {
                // In a raw identifier, the name follows.
                i += 1;
            } else {
                found.push(Token::Word(word));
            }
        } else if c == ':' && char_at(i + 1) == ':' {
            found.push(Token::PathSeparator);
            i += 2;
        } else {
            if !c.is_whitespace() {
                found.push(Token::Other(c));
            }
            i += 1;
        }
    }
    found
}

/// Returns the index after the block comment that starts at `i`. Block comments can be nested.
fn end_of_block_comment(text: &[char], mut i: usize) -> usize {
    let mut depth = 0;
    while i < text.len() {
        match (text[i], text.get(i + 1)) {
            ('/', Some('*')) => (depth, i) = (depth + 1, i + 2),
            ('*', Some('/')) => (depth, i) = (depth - 1, i + 2),
            _ => i += 1,
        }
        if depth == 0 {
            break;
        }
    }
    i
}

/// Returns the index after the string whose opening quote is at `i`.
fn end_of_string(text: &[char], mut i: usize) -> usize {
    i += 1;
    while i < text.len() && text[i] != '"' {
        i += if text[i] == '\\' { 2 } else { 1 };
    }
    i + 1
}

/// Returns the index after the raw string whose opening quote is at `i`. It ends at a quote that is followed by
/// `hashes` hashes.
fn end_of_raw_string(text: &[char], mut i: usize, hashes: usize) -> usize {
    i += 1;
    while i < text.len()
        && !(text[i] == '"' && text[i + 1..].iter().take(hashes).filter(|&&c| c == '#').count() == hashes)
    {
        i += 1;
    }
    i + 1 + hashes
}

/// Returns every path of the source that starts at the crate's root. The root is left out, and at most two parts are
/// returned: `crate::gpu::Device` gives `["gpu", "Device"]`. `module` is the path of the file's module: `["render",
/// "display"]`.
pub fn root_paths(tokens: &[Token], module: &[&str]) -> Vec<Vec<String>> {
    let mut paths = Vec::new();
    // For each open brace, the name of the inline module that it opens, if any.
    let mut braces: Vec<Option<String>> = Vec::new();
    let mut i = 0;
    while i < tokens.len() {
        let word_before = |back: usize| match i.checked_sub(back).map(|k| &tokens[k]) {
            Some(Token::Word(word)) => word.as_str(),
            _ => "",
        };
        match &tokens[i] {
            Token::Other('{') => {
                braces.push((word_before(2) == "mod").then(|| word_before(1).to_owned()));
                i += 1;
            }
            Token::Other('}') => {
                braces.pop();
                i += 1;
            }
            Token::Word(word) if tokens.get(i + 1) == Some(&Token::PathSeparator) => {
                let start = match word.as_str() {
                    "crate" | "steradian" | "steradian_lock" | "steradian_sky" | "steradian_render" => Some(Vec::new()),
                    "super" | "self" => {
                        let inline = braces.iter().flatten().map(String::as_str);
                        Some(module.iter().copied().chain(inline).map(str::to_owned).collect())
                    }
                    _ => None,
                };
                match start {
                    Some(mut start) => {
                        if word == "super" {
                            start.pop();
                        }
                        i = follow(tokens, i + 2, start, &mut paths);
                    }
                    None => i += 1,
                }
            }
            _ => i += 1,
        }
    }
    paths
}

/// Follows a path or a group of paths from token `i`, and returns the index after it. `so_far` is the path up to
/// there.
fn follow(tokens: &[Token], mut i: usize, mut so_far: Vec<String>, paths: &mut Vec<Vec<String>>) -> usize {
    loop {
        match tokens.get(i) {
            Some(Token::Word(word)) => {
                if word == "super" {
                    so_far.pop();
                } else if word != "self" {
                    so_far.push(word.clone());
                }
                i += 1;
                if tokens.get(i) == Some(&Token::PathSeparator) {
                    i += 1;
                    continue;
                }
            }
            Some(Token::Other('*')) => {
                so_far.push("*".to_owned());
                i += 1;
            }
            Some(Token::Other('{')) => {
                i += 1;
                while i < tokens.len() && tokens[i] != Token::Other('}') {
                    match &tokens[i] {
                        // `as name` renames the path before it.
                        Token::Word(word) if word == "as" => i += 2,
                        Token::Other(',') => i += 1,
                        _ => i = follow(tokens, i, so_far.clone(), paths).max(i + 1),
                    }
                }
                return i + 1;
            }
            _ => {}
        }
        so_far.truncate(2);
        paths.push(so_far);
        return i;
    }
}
