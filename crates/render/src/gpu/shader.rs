//! Joins the files of a shader into one module, because WGSL has no imports.
//!
//! A file lists the files that it needs in directives, one per line. A shader is a file with an entry point, after all files that it needs
//! directly or indirectly. Each file is included once, before the first file that imports it, in the order of the `#import` lines:
//!
//! - `#import shared/projection`: the file `shaders/shared/projection.wgsl`. `constants/...` and `structs/...` are tables of constants
//!   and structures that are generated from Rust (see [`super::constants`] and [`super::structs`]).
//! - `#import accumulate = shared/accumulate_u32 | shared/accumulate_u64`: one of these files. The Rust code of the shader chooses it by the
//!   name `accumulate`. `stars/billboards/profile_*` matches all files whose paths begin with the part before the `*`.
//! - `#when shared/tabulated` ... `#end`: the lines between are included only if that file has already been included. They contain no directives.
//! - `#requires u64`: the shader needs 64-bit integers and atomics.
//!
//! Comments begin with `//`; block comments are not recognised.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::path::PathBuf;

/// A complete shader module.
#[derive(Clone, Debug)]
pub struct ShaderSource {
    /// Path of its file below `shaders/`, without extension.
    pub name: &'static str,
    /// Entry point.
    pub entry_point: &'static str,
    /// WGSL.
    pub text: String,
    /// Whether the shader needs 64-bit integers and atomics.
    pub needs_u64: bool,
}

impl ShaderSource {
    /// The same shader for software drivers: its loops test at their end, so that no loop runs once more than needed.
    #[must_use]
    pub fn for_software(&self) -> Self {
        Self { text: loops::tested_at_end(&self.text), ..self.clone() }
    }
}

/// Reasons why files cannot be joined into a shader.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ShaderError {
    /// A file does not exist.
    #[error("shaders/{0}.wgsl does not exist")]
    UnknownFile(String),
    /// The folder of the shaders, or a file in it, cannot be read.
    #[error("cannot read {}: {reason}", path.display())]
    Unreadable {
        /// The folder or file.
        path: PathBuf,
        /// The system's message.
        reason: String,
    },
    /// The folder of the shaders lacks a file.
    #[error("{} is missing: the program needs this shader file", .0.display())]
    MissingFile(PathBuf),
    /// An import names an unknown file.
    #[error("{place}: `{file}` is neither a file below shaders/ nor a table of constants nor a shared structure")]
    UnknownImport {
        /// Line of the import.
        place: Place,
        /// The unknown file.
        file: String,
    },
    /// A file imports itself, directly or indirectly.
    #[error("{place}: circular import: {}", cycle.join(" -> "))]
    Cycle {
        /// Line of the import that closes the cycle.
        place: Place,
        /// The files of the cycle; the first one is repeated at the end.
        cycle: Vec<String>,
    },
    /// A directive is unknown, or not valid in its place.
    #[error(
        "{place}: `{line}` is not a valid directive here; it must be one of `#import FILE`, `#import NAME = FILE | FILE`, `#when FILE`, `#end`, `#requires u64`"
    )]
    Directive {
        /// The line.
        place: Place,
        /// Its text.
        line: String,
    },
    /// A `#when` without its `#end`.
    #[error("{place}: this `#when` has no `#end`")]
    NoEnd {
        /// Line of the `#when`.
        place: Place,
    },
    /// The shader does not choose between alternatives.
    #[error("{place}: no file is chosen for `{slot}`; it must be one of {}", alternatives.join(", "))]
    NoChoice {
        /// Line of the alternatives.
        place: Place,
        /// Name of the choice.
        slot: String,
        /// The alternatives.
        alternatives: Vec<String>,
    },
    /// The chosen file is not an alternative.
    #[error("{place}: `{chosen}` cannot be chosen for `{slot}`; it must be one of {}", alternatives.join(", "))]
    WrongChoice {
        /// Line of the alternatives.
        place: Place,
        /// Name of the choice.
        slot: String,
        /// The chosen file.
        chosen: String,
        /// The alternatives.
        alternatives: Vec<String>,
    },
    /// Two choices of the same name have different alternatives.
    #[error("{place}: the alternatives of `{slot}` differ from those at {first}")]
    OtherAlternatives {
        /// Line of the second one.
        place: Place,
        /// Name of the choice.
        slot: String,
        /// Line of the first one.
        first: String,
    },
    /// A choice has no alternatives in the shader.
    #[error("shaders/{file}.wgsl: neither this file nor its imports have alternatives named `{slot}`")]
    UnusedChoice {
        /// The shader's file.
        file: String,
        /// Name of the choice.
        slot: String,
    },
    /// An imported file has an entry point.
    #[error("{place}: `{file}` has an entry point and cannot be imported")]
    ImportsEntryPoint {
        /// Line of the import.
        place: Place,
        /// The imported file.
        file: String,
    },
    /// A file has no entry point or several.
    #[error("shaders/{file}.wgsl must have one entry point; found: {}", names_or_none(found))]
    EntryPoints {
        /// The shader's file.
        file: String,
        /// Names of its entry points.
        found: Vec<String>,
    },
}

fn names_or_none(names: &[String]) -> String {
    if names.is_empty() { "none".to_owned() } else { names.join(", ") }
}

/// A line of a shader file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Place {
    /// Path below `shaders/`, without extension.
    pub file: String,
    /// Number of the line; the first is 1.
    pub line: usize,
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "shaders/{}.wgsl:{}", self.file, self.line)
    }
}

/// Chosen files, by the names of the choices in the importing files.
pub(crate) type Choices = BTreeMap<String, String>;

/// All shader files, by their paths without extension (stems).
pub(crate) struct Library {
    texts: BTreeMap<String, String>,
}

/// Text of a file, preceded by all files that it needs.
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
    /// Parses a line: `None` if it is not a directive, an error if the directive is invalid.
    fn parse(line: &'a str) -> Option<Result<Self, ()>> {
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

/// Returns the part of a line before its comment.
fn without_comment(line: &str) -> &str {
    line.split_once("//").map_or(line, |(code, _)| code)
}

/// Returns the names of the entry points of a file.
fn entry_points(text: &str) -> Vec<&str> {
    let mut found = Vec::new();
    let mut marked = false;
    for line in text.lines() {
        let code = without_comment(line);
        marked |= ["@compute", "@vertex", "@fragment"].iter().any(|stage| code.contains(stage));
        if marked && let Some((_, function)) = code.split_once("fn ") {
            found.push(function.split('(').next().unwrap_or_default().trim());
            marked = false;
        }
    }
    found
}

impl Library {
    /// Creates the library from the stems and texts of files.
    pub(crate) fn new(files: impl IntoIterator<Item = (impl Into<String>, impl Into<String>)>) -> Self {
        Self { texts: files.into_iter().map(|(stem, text)| (stem.into(), text.into())).collect() }
    }

    /// Returns the files with entry points.
    pub(crate) fn entry_files(&self) -> impl Iterator<Item = &str> {
        self.texts.iter().filter(|(_, text)| !entry_points(text).is_empty()).map(|(stem, _)| stem.as_str())
    }

    /// Returns the stem and the entry point of a file, which must have exactly one entry point.
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

    /// Joins a file and all files that it needs.
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

    /// Returns every valid combination of choices of a file.
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

    /// Joins every file with an entry point in every combination of choices.
    pub(crate) fn check(&self) -> Result<(), ShaderError> {
        for stem in self.entry_files() {
            self.entry(stem)?;
            self.combinations(stem)?;
        }
        Ok(())
    }

    /// Returns the files that a pattern matches.
    fn matching(&self, pattern: &str) -> Vec<&str> {
        match pattern.strip_suffix('*') {
            Some(start) => self.texts.keys().map(String::as_str).filter(|stem| stem.starts_with(start)).collect(),
            None => self.texts.get_key_value(pattern).map(|(stem, _)| stem.as_str()).into_iter().collect(),
        }
    }
}

/// State of joining a file and the files that it needs.
struct Walk<'a> {
    library: &'a Library,
    choices: &'a Choices,
    /// The files that are being included: each imports the next one.
    path: Vec<&'a str>,
    /// The included files.
    done: BTreeSet<&'a str>,
    /// Line of the first occurrence of each choice, and its alternatives.
    slots: BTreeMap<&'a str, (Place, Vec<&'a str>)>,
    joined: Joined,
}

impl<'a> Walk<'a> {
    fn visit(&mut self, stem: &'a str, text: &'a str) -> Result<(), ShaderError> {
        self.path.push(stem);
        let mut own = format!("// shaders/{stem}.wgsl\n");
        // The open `#when`, if any: its line, and whether its contents are omitted.
        let mut when: Option<(Place, bool)> = None;
        for (index, line) in text.lines().enumerate() {
            let place = || Place { file: stem.to_owned(), line: index + 1 };
            match Directive::parse(line) {
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

    /// Returns the chosen file, which must be among those that the patterns match.
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

mod folder;
mod loops;

pub(crate) use folder::read_folder;

#[cfg(test)]
mod tests;
