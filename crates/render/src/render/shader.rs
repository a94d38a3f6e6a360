//! Shaders: WGSL files below `shaders/`, joined with their imports. `build.rs` finds the files, so no list of them
//! needs to be maintained. `tests/cpu/shaders.rs` checks every file with an entry point in every combination of its
//! choices.

use std::fmt;
use std::sync::LazyLock;

use super::{constants, tabulated};
use crate::gpu::{Choices, Gpu, Joined, Library, ShaderError, ShaderSource};

include!(concat!(env!("OUT_DIR"), "/shader_files.rs"));

/// All files, and the constants shared with Rust.
static LIBRARY: LazyLock<Library> = LazyLock::new(|| {
    let constants: Vec<(String, String)> =
        constants::tables().iter().map(|table| (format!("constants/{}", table.name), table.wgsl())).collect();
    let constants = constants.iter().map(|(stem, text)| (stem.as_str(), text.as_str()));
    Library::new(SHADER_FILES.iter().copied().chain(constants))
});

/// A shader: a file with one entry point, and the files chosen for the import slots that have alternatives.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Shader {
    file: String,
    choices: Choices,
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

    /// Text of the file and of all its imports. An entry point is not required.
    pub fn text(&self) -> Result<String, ShaderError> {
        Ok(self.join()?.text)
    }

    /// Joins the file and its imports. Projections use no tables unless a choice says otherwise.
    fn join(&self) -> Result<Joined, ShaderError> {
        match LIBRARY.join(&self.file, &self.choices) {
            Err(ShaderError::NoChoice { slot, .. }) if slot == tabulated::SLOT => {
                LIBRARY.join(&self.file, &tabulated::with_tables(self.clone(), 0).choices)
            }
            joined => joined,
        }
    }

    /// Resolves the complete module.
    pub fn resolve(&self) -> Result<ShaderSource, ShaderError> {
        let (name, entry_point) = LIBRARY.entry(&self.file)?;
        let joined = self.join()?;
        Ok(ShaderSource { name, entry_point, text: joined.text, needs_u64: joined.needs_u64 })
    }

    /// Resolves the complete module of a shader named in the program itself.
    ///
    /// # Panics
    ///
    /// The shader does not exist. That is a bug of the program, since files and choices do not depend on input.
    pub fn source(&self) -> ShaderSource {
        self.resolve().unwrap_or_else(|error| panic!("shader {self}: {error}"))
    }
}

/// Overridable constant that keeps short loops rolled on software drivers, which need seconds to compile unrolled
/// loops.
pub(crate) fn rolled_loops(gpu: &Gpu) -> (&'static str, f64) {
    ("ROLLED", f64::from(u8::from(gpu.software)))
}

/// Workgroup size that depends on the adapter. On a GPU it is one or two waves. A software driver runs a workgroup as a
/// loop of SIMD steps and repeats uniform work in each step, so there the size is a single step.
pub(crate) fn workgroup(gpu: &Gpu) -> u32 {
    if gpu.software { 8 } else { 64 }
}

/// Overridable constant for shaders with this workgroup size.
pub(crate) fn workgroup_constant(gpu: &Gpu) -> (&'static str, f64) {
    ("WORKGROUP", f64::from(workgroup(gpu)))
}

/// Lists every shader: every file with an entry point, in every combination of choices.
pub fn shaders() -> Result<Vec<Shader>, ShaderError> {
    let mut shaders = Vec::new();
    for file in LIBRARY.entry_files() {
        let with_choices = |choices| Shader { file: file.to_owned(), choices };
        shaders.extend(LIBRARY.combinations(file)?.into_iter().map(with_choices));
    }
    Ok(shaders)
}
