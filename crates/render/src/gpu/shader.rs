//! Joins the files that a shader needs into one module: WGSL itself has no import.
//!
//! A file names what it needs in lines of its own, and a shader is a file with everything that it needs before it, each
//! file once, in the order in which a walk from the first to the last `#import` meets them:
//!
//! - `#import shared/projection`: the file `shaders/shared/projection.wgsl`, or a table of constants that Rust has too
//!   (`constants/...`, see [`super::constants`]);
//! - `#import accumulate = shared/accumulate_u32 | shared/accumulate_u64`: one of these, which the shader chooses by the
//!   name `accumulate`. `stars/billboards/profile_*` stands for all files whose names begin so;
//! - `#when shared/tabulated` ... `#end`: what stands between is part of the shader only if that file is, and has been met
//!   before; there are no directives in it;
//! - `#requires u64`: 64-bit integers and atomics.
//!
//! Comments are the `//` kind alone.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;

/// A complete shader module.
#[derive(Clone, Debug)]
pub struct ShaderSource {
    /// Path of its file below `shaders/`, without extension.
    pub name: &'static str,
    /// Entry point.
    pub entry_point: &'static str,
    /// WGSL.
    pub text: String,
    /// Whether it needs 64-bit integers and atomics.
    pub needs_u64: bool,
}

/// Why files cannot be joined to a shader.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ShaderError {
    /// No such file.
    #[error("there is no shader file shaders/{0}.wgsl")]
    UnknownFile(String),
    /// A file imports what there is not.
    #[error("{place}: `{file}` is neither a file below shaders/ nor a table of constants")]
    UnknownImport {
        /// Where it is imported.
        place: Place,
        /// What is imported.
        file: String,
    },
    /// A file needs itself.
    #[error("{place}: imports run in a circle: {}", cycle.join(" -> "))]
    Cycle {
        /// Where the circle closes.
        place: Place,
        /// The files, from the first to itself.
        cycle: Vec<String>,
    },
    /// A line that begins like a directive.
    #[error(
        "{place}: `{line}` is no directive here; allowed: `#import FILE`, `#import NAME = FILE | FILE`, `#when FILE`, `#end`, `#requires u64`"
    )]
    Directive {
        /// Where it stands.
        place: Place,
        /// What stands there.
        line: String,
    },
    /// A `#when` without its `#end`.
    #[error("{place}: this `#when` has no `#end`")]
    NoEnd {
        /// Where it stands.
        place: Place,
    },
    /// Nothing is chosen between alternatives.
    #[error("{place}: `{slot}` is not chosen; allowed: {}", alternatives.join(", "))]
    NoChoice {
        /// Where the alternatives stand.
        place: Place,
        /// Name of the choice.
        slot: String,
        /// What may be chosen.
        alternatives: Vec<String>,
    },
    /// What is chosen is no alternative.
    #[error("{place}: `{chosen}` cannot be chosen as `{slot}`; allowed: {}", alternatives.join(", "))]
    WrongChoice {
        /// Where the alternatives stand.
        place: Place,
        /// Name of the choice.
        slot: String,
        /// What is chosen.
        chosen: String,
        /// What may be chosen.
        alternatives: Vec<String>,
    },
    /// Two files ask for a choice of the same name.
    #[error("{place}: `{slot}` has other alternatives than at {first}")]
    OtherAlternatives {
        /// Where the second one asks.
        place: Place,
        /// Name of the choice.
        slot: String,
        /// Where the first one asks.
        first: String,
    },
    /// Something is chosen that nobody asks for.
    #[error("shaders/{file}.wgsl: neither it nor what it imports asks for a choice `{slot}`")]
    UnusedChoice {
        /// The shader's file.
        file: String,
        /// Name of the choice.
        slot: String,
    },
    /// An imported file has an entry point.
    #[error("{place}: `{file}` has an entry point, and cannot be imported")]
    ImportsEntryPoint {
        /// Where it is imported.
        place: Place,
        /// The imported file.
        file: String,
    },
    /// A file has none or several entry points.
    #[error("shaders/{file}.wgsl: one entry point is wanted, found: {}", names_or_none(found))]
    EntryPoints {
        /// The shader's file.
        file: String,
        /// Their names.
        found: Vec<String>,
    },
}

fn names_or_none(names: &[String]) -> String {
    if names.is_empty() { "none".to_owned() } else { names.join(", ") }
}

/// A line of a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Place {
    /// Path below `shaders/`, without its extension.
    pub file: String,
    /// Number of the line, from 1.
    pub line: usize,
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "shaders/{}.wgsl:{}", self.file, self.line)
    }
}

/// Chosen files, by what the importing files call them.
pub(crate) type Choices = BTreeMap<String, String>;

/// Files by their paths without extension.
pub(crate) struct Library {
    texts: BTreeMap<String, String>,
}

/// A file with all that it needs.
#[derive(Debug, PartialEq)]
pub(crate) struct Joined {
    pub text: String,
    pub needs_u64: bool,
}

enum Directive<'a> {
    Import(&'a str),
    Choose { slot: &'a str, patterns: Vec<&'a str> },
    When(&'a str),
    End,
    RequiresU64,
}

impl<'a> Directive<'a> {
    /// The directive of a line, `None` if it is none at all, an error if it cannot be read.
    fn of(line: &'a str) -> Option<Result<Self, ()>> {
        if !line.trim_start().starts_with('#') {
            return None;
        }
        let words: Vec<&str> = line.split_whitespace().collect();
        Some(match words.as_slice() {
            ["#requires", "u64"] => Ok(Self::RequiresU64),
            ["#import", stem] => Ok(Self::Import(stem)),
            ["#when", stem] => Ok(Self::When(stem)),
            ["#end"] => Ok(Self::End),
            ["#import", slot, "=", alternatives @ ..] if alternatives.len() % 2 == 1 => {
                let bars = alternatives.iter().skip(1).step_by(2);
                let patterns: Vec<&str> = alternatives.iter().step_by(2).copied().collect();
                if bars.copied().all(|bar| bar == "|") && !patterns.contains(&"|") {
                    Ok(Self::Choose { slot, patterns })
                } else {
                    Err(())
                }
            }
            _ => Err(()),
        })
    }
}

/// Names of the entry points of a file.
fn entry_points(text: &str) -> Vec<&str> {
    let mut found = Vec::new();
    let mut marked = false;
    for line in text.lines() {
        let code = line.split("//").next().unwrap_or_default();
        marked |= ["@compute", "@vertex", "@fragment"].iter().any(|stage| code.contains(stage));
        if marked && let Some((_, function)) = code.split_once("fn ") {
            found.push(function.split('(').next().unwrap_or_default().trim());
            marked = false;
        }
    }
    found
}

impl Library {
    pub(crate) fn new<'a>(files: impl IntoIterator<Item = (&'a str, &'a str)>) -> Self {
        Self { texts: files.into_iter().map(|(stem, text)| (stem.to_owned(), text.to_owned())).collect() }
    }

    /// The files that have an entry point.
    pub(crate) fn entry_files(&self) -> impl Iterator<Item = &str> {
        self.texts.iter().filter(|(_, text)| !entry_points(text).is_empty()).map(|(stem, _)| stem.as_str())
    }

    /// Name and entry point of a file that must have exactly one.
    pub(crate) fn entry(&self, stem: &str) -> Result<(&str, &str), ShaderError> {
        let (name, text) = self.texts.get_key_value(stem).ok_or_else(|| ShaderError::UnknownFile(stem.to_owned()))?;
        match entry_points(text).as_slice() {
            [one] => Ok((name, one)),
            several => Err(ShaderError::EntryPoints {
                file: stem.to_owned(),
                found: several.iter().map(|&name| name.to_owned()).collect(),
            }),
        }
    }

    /// A file after everything that it needs.
    pub(crate) fn join(&self, stem: &str, choices: &Choices) -> Result<Joined, ShaderError> {
        let (stem, text) = self.texts.get_key_value(stem).ok_or_else(|| ShaderError::UnknownFile(stem.to_owned()))?;
        let mut walk = Walk {
            library: self,
            choices,
            path: Vec::new(),
            done: BTreeSet::new(),
            slots: BTreeMap::new(),
            joined: Joined { text: String::new(), needs_u64: false },
        };
        walk.visit(stem, text)?;
        if let Some((slot, _)) = choices.iter().find(|(slot, _)| !walk.slots.contains_key(slot.as_str())) {
            return Err(ShaderError::UnusedChoice { file: stem.clone(), slot: slot.clone() });
        }
        Ok(walk.joined)
    }

    /// Every combination of choices with which a file can be joined.
    pub(crate) fn combinations(&self, stem: &str) -> Result<Vec<Choices>, ShaderError> {
        let mut complete = Vec::new();
        let mut open = vec![Choices::new()];
        while let Some(choices) = open.pop() {
            match self.join(stem, &choices) {
                Ok(_) => complete.push(choices),
                Err(ShaderError::NoChoice { slot, alternatives, .. }) => {
                    open.extend(alternatives.into_iter().rev().map(|alternative| {
                        let mut choices = choices.clone();
                        choices.insert(slot.clone(), alternative);
                        choices
                    }));
                }
                Err(error) => return Err(error),
            }
        }
        Ok(complete)
    }

    /// The files that a pattern names.
    fn matching(&self, pattern: &str) -> Vec<&str> {
        match pattern.strip_suffix('*') {
            Some(start) => self.texts.keys().map(String::as_str).filter(|stem| stem.starts_with(start)).collect(),
            None => self.texts.get_key_value(pattern).map(|(stem, _)| stem.as_str()).into_iter().collect(),
        }
    }
}

/// A walk through the files that one file needs.
struct Walk<'a> {
    library: &'a Library,
    choices: &'a Choices,
    /// The files between the first one and the one at hand.
    path: Vec<&'a str>,
    done: BTreeSet<&'a str>,
    /// Where each choice was asked for first, and between what.
    slots: BTreeMap<&'a str, (Place, Vec<&'a str>)>,
    joined: Joined,
}

impl<'a> Walk<'a> {
    fn visit(&mut self, stem: &'a str, text: &'a str) -> Result<(), ShaderError> {
        self.path.push(stem);
        let mut own = format!("// shaders/{stem}.wgsl\n");
        // Where a `#when` stands that has not ended yet, and whether what it encloses is left out.
        let mut when: Option<(Place, bool)> = None;
        for (index, line) in text.lines().enumerate() {
            let place = || Place { file: stem.to_owned(), line: index + 1 };
            match Directive::of(line) {
                None => {
                    if !matches!(when, Some((_, true))) {
                        own.push_str(line);
                        own.push('\n');
                    }
                }
                Some(Ok(Directive::End)) if when.is_some() => when = None,
                Some(Ok(Directive::When(file))) if when.is_none() => {
                    if !self.library.texts.contains_key(file) {
                        return Err(ShaderError::UnknownImport { place: place(), file: file.to_owned() });
                    }
                    when = Some((place(), !self.done.contains(file)));
                }
                Some(Err(()) | Ok(Directive::End | Directive::When(_))) => {
                    return Err(ShaderError::Directive { place: place(), line: line.trim().to_owned() });
                }
                Some(Ok(_)) if when.is_some() => {
                    return Err(ShaderError::Directive { place: place(), line: line.trim().to_owned() });
                }
                Some(Ok(Directive::RequiresU64)) => self.joined.needs_u64 = true,
                Some(Ok(Directive::Import(stem))) => self.import(stem, place())?,
                Some(Ok(Directive::Choose { slot, patterns })) => {
                    let chosen = self.chosen(slot, &patterns, &place())?;
                    self.import(chosen, place())?;
                }
            }
        }
        if let Some((place, _)) = when {
            return Err(ShaderError::NoEnd { place });
        }
        self.path.pop();
        self.done.insert(stem);
        self.joined.text.push_str(&own);
        Ok(())
    }

    fn import(&mut self, stem: &str, place: Place) -> Result<(), ShaderError> {
        let Some((stem, text)) = self.library.texts.get_key_value(stem) else {
            return Err(ShaderError::UnknownImport { place, file: stem.to_owned() });
        };
        if let Some(start) = self.path.iter().position(|&before| before == stem) {
            let mut cycle: Vec<String> = self.path[start..].iter().map(|&stem| stem.to_owned()).collect();
            cycle.push(stem.clone());
            return Err(ShaderError::Cycle { place, cycle });
        }
        if self.done.contains(stem.as_str()) {
            return Ok(());
        }
        if !entry_points(text).is_empty() {
            return Err(ShaderError::ImportsEntryPoint { place, file: stem.clone() });
        }
        self.visit(stem, text)
    }

    /// The file that was chosen among those that the patterns name.
    fn chosen(&mut self, slot: &'a str, patterns: &[&'a str], place: &Place) -> Result<&'a str, ShaderError> {
        let mut alternatives = Vec::new();
        for pattern in patterns {
            let found = self.library.matching(pattern);
            if found.is_empty() {
                return Err(ShaderError::UnknownImport { place: place.clone(), file: (*pattern).to_owned() });
            }
            alternatives.extend(found);
        }
        let (first, known) = self.slots.entry(slot).or_insert_with(|| (place.clone(), alternatives.clone()));
        if *known != alternatives {
            let [slot, first] = [slot.to_owned(), first.to_string()];
            return Err(ShaderError::OtherAlternatives { place: place.clone(), slot, first });
        }
        let owned = || alternatives.iter().map(|&stem| stem.to_owned()).collect();
        let Some(chosen) = self.choices.get(slot) else {
            return Err(ShaderError::NoChoice { place: place.clone(), slot: slot.to_owned(), alternatives: owned() });
        };
        alternatives.iter().copied().find(|&stem| stem == chosen).ok_or_else(|| ShaderError::WrongChoice {
            place: place.clone(),
            slot: slot.to_owned(),
            chosen: chosen.clone(),
            alternatives: owned(),
        })
    }
}

#[cfg(test)]
mod tests;
