//! Shaders: WGSL files below `shaders/`, joined with what they import. `build.rs` finds the files, so that no list of them
//! stands anywhere; `tests/cpu/shaders.rs` checks every file with an entry point in every combination of its choices.

mod library;

use std::fmt;
use std::sync::LazyLock;

pub use library::Place;
use library::{Choices, Library};

use super::constants;

include!(concat!(env!("OUT_DIR"), "/shader_files.rs"));

/// All files, and the constants that they share with Rust.
static LIBRARY: LazyLock<Library> = LazyLock::new(|| {
    let constants: Vec<(String, String)> =
        constants::tables().iter().map(|table| (format!("constants/{}", table.name), table.wgsl())).collect();
    let constants = constants.iter().map(|(stem, text)| (stem.as_str(), text.as_str()));
    Library::new(SHADER_FILES.iter().copied().chain(constants))
});

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

/// A shader: a file with one entry point, and what is chosen where it or what it imports has alternatives.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Shader {
    file: String,
    choices: Choices,
}

/// Why files cannot be joined to a shader.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
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
        "{place}: `{line}` is no directive; allowed: `#import FILE`, `#import NAME = FILE | FILE`, `#requires u64`"
    )]
    Directive {
        /// Where it stands.
        place: Place,
        /// What stands there.
        line: String,
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

impl fmt::Display for Shader {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.file)?;
        self.choices.iter().try_for_each(|(slot, chosen)| write!(f, ", {slot} = {chosen}"))
    }
}

impl Shader {
    /// The shader of `shaders/{file}.wgsl`.
    pub fn new(file: &str) -> Self {
        Self { file: file.to_owned(), choices: Choices::new() }
    }

    /// Chooses `file` where files import alternatives under the name `slot`.
    #[must_use]
    pub fn with(mut self, slot: &str, file: &str) -> Self {
        self.choices.insert(slot.to_owned(), file.to_owned());
        self
    }

    /// The file and all that it imports, whether it has an entry point or not.
    pub fn text(&self) -> Result<String, ShaderError> {
        Ok(LIBRARY.join(&self.file, &self.choices)?.text)
    }

    /// The complete module.
    pub fn resolve(&self) -> Result<ShaderSource, ShaderError> {
        let (name, entry_point) = LIBRARY.entry(&self.file)?;
        let joined = LIBRARY.join(&self.file, &self.choices)?;
        Ok(ShaderSource { name, entry_point, text: joined.text, needs_u64: joined.needs_u64 })
    }

    /// The complete module of a shader that the program itself names.
    ///
    /// # Panics
    ///
    /// If there is no such shader, which is an error of the program: files and choices do not depend on input.
    pub(crate) fn source(&self) -> ShaderSource {
        self.resolve().unwrap_or_else(|error| panic!("shader {self}: {error}"))
    }
}

/// Every shader: every file with an entry point, in every combination of choices.
pub fn shaders() -> Result<Vec<Shader>, ShaderError> {
    let mut shaders = Vec::new();
    for file in LIBRARY.entry_files() {
        let of_file = |choices| Shader { file: file.to_owned(), choices };
        shaders.extend(LIBRARY.combinations(file)?.into_iter().map(of_file));
    }
    Ok(shaders)
}
