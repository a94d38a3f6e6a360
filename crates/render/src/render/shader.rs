//! Shaders: WGSL files below `shaders/`, joined with their imports. `build.rs` finds the files, so no list of them
//! needs to be maintained. `tests/cpu/shaders.rs` checks every file with an entry point in every combination of its
//! choices.

use std::collections::BTreeMap;
use std::fmt;
use std::path::PathBuf;
use std::sync::LazyLock;

use super::{constants, struct_layouts, tabulated};
use crate::gpu::{Choices, Gpu, Joined, Library, ShaderError, ShaderSource, read_folder};
use crate::plan::tables::TableForm;

include!(concat!(env!("OUT_DIR"), "/shader_files.rs"));

/// Environment variable with a folder of shader files, for development. They replace those that are built into the program, so that an edit
/// of a shader takes effect at the next start, without compiling.
pub const SHADER_FOLDER_VARIABLE: &str = "STERADIAN_SHADERS";

/// All files, and the constants and structures that shaders share with Rust.
static LIBRARY: LazyLock<Result<Library, ShaderError>> = LazyLock::new(|| {
    let folder = shader_folder();
    let files: BTreeMap<String, String> = match &folder {
        Some(folder) => read_folder(folder, SHADER_FILES.iter().map(|(stem, _)| *stem))?,
        None => SHADER_FILES.iter().map(|(stem, text)| ((*stem).to_owned(), (*text).to_owned())).collect(),
    };
    let constants = constants::tables().into_iter().map(|table| (format!("constants/{}", table.name), table.wgsl()));
    let structs = struct_layouts().into_iter().map(|layout| (format!("structs/{}", layout.name), layout.wgsl()));
    let library = Library::new(files.into_iter().chain(constants).chain(structs));
    // Tests check the files that are built in.
    if folder.is_some() {
        library.check()?;
    }
    Ok(library)
});

fn library() -> Result<&'static Library, ShaderError> {
    LIBRARY.as_ref().map_err(Clone::clone)
}

fn shader_folder() -> Option<PathBuf> {
    std::env::var_os(SHADER_FOLDER_VARIABLE).filter(|folder| !folder.is_empty()).map(PathBuf::from)
}

/// Reads and checks the files of the folder in [`SHADER_FOLDER_VARIABLE`]. Returns the folder, or `None` if the variable is not set.
///
/// # Errors
///
/// A file is missing, cannot be read, or has a wrong directive.
pub fn checked_shader_folder() -> Result<Option<PathBuf>, ShaderError> {
    library()?;
    Ok(shader_folder())
}

/// A shader: a file with one entry point, and the chosen alternatives of it and of its imports.
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
    /// Returns the shader of `shaders/{file}.wgsl`.
    pub fn new(file: &str) -> Self {
        Self { file: file.to_owned(), choices: Choices::new() }
    }

    /// Chooses `file` where files import alternatives under the name `slot`.
    #[must_use]
    pub fn with(mut self, slot: &str, file: &str) -> Self {
        self.choices.insert(slot.to_owned(), file.to_owned());
        self
    }

    /// Returns the text of the file and of all its imports. An entry point is not required.
    pub fn text(&self) -> Result<String, ShaderError> {
        Ok(self.join()?.text)
    }

    /// Joins the file and its imports. Projections use no tables unless a choice says otherwise.
    fn join(&self) -> Result<Joined, ShaderError> {
        let library = library()?;
        match library.join(&self.file, &self.choices) {
            Err(ShaderError::NoChoice { slot, .. }) if slot == tabulated::SLOT => {
                library.join(&self.file, &tabulated::with_tables(self.clone(), TableForm::None).choices)
            }
            joined => joined,
        }
    }

    /// Resolves the complete module.
    pub fn resolve(&self) -> Result<ShaderSource, ShaderError> {
        let (name, entry_point) = library()?.entry(&self.file)?;
        let joined = self.join()?;
        Ok(ShaderSource { name, entry_point, text: joined.text, needs_u64: joined.needs_u64 })
    }

    /// Resolves the complete module of a shader named in the program itself.
    ///
    /// # Panics
    ///
    /// There is no such shader. This is an error of the program: files and choices do not depend on input, except in development
    /// ([`checked_shader_folder`]).
    pub fn source(&self) -> ShaderSource {
        self.resolve().unwrap_or_else(|error| panic!("shader {self}: {error}"))
    }
}

/// Returns the overridable constant that keeps short loops as loops on software drivers, which need seconds to compile unrolled loops.
pub(crate) fn rolled_loops(gpu: &Gpu) -> (&'static str, f64) {
    ("ROLLED", f64::from(u8::from(gpu.software)))
}

/// Returns the overridable constant that selects the brightest kernel of splatted light.
pub(crate) fn kernel_constant(has_round_kernel: bool) -> (&'static str, f64) {
    ("ROUND_KERNEL", f64::from(u8::from(has_round_kernel)))
}

/// Returns the workgroup size that depends on the adapter. On a GPU it is one or two waves. A software driver runs a workgroup as a loop of SIMD
/// steps and repeats uniform work in each step, so there the size is a single step.
pub(crate) fn workgroup(gpu: &Gpu) -> u32 {
    if gpu.software { 8 } else { 64 }
}

/// Returns the overridable constant for shaders with this workgroup size.
pub(crate) fn workgroup_constant(gpu: &Gpu) -> (&'static str, f64) {
    ("WORKGROUP", f64::from(workgroup(gpu)))
}

/// Lists every shader: every file with an entry point, in every combination of choices.
pub fn shaders() -> Result<Vec<Shader>, ShaderError> {
    let mut shaders = Vec::new();
    let library = library()?;
    for file in library.entry_files() {
        let of_file = |choices| Shader { file: file.to_owned(), choices };
        shaders.extend(library.combinations(file)?.into_iter().map(of_file));
    }
    Ok(shaders)
}
