//! Writes the table of all shader files.

use std::{
    env,
    error::Error,
    fmt::Write,
    fs,
    path::{Path, PathBuf},
};

/// Path of the shader folder, relative to the folder of this crate.
const SHADERS: &str = "../../shaders";

/// Returns the paths of the WGSL files in a folder and its subfolders, relative to `shaders`, with slashes and without extension.
fn shader_stems(folder: &Path, prefix: &str) -> Result<Vec<String>, Box<dyn Error>> {
    let mut stems = Vec::new();
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        let wrong =
            || format!("{}: shaders/ must contain folders and .wgsl files with plain names only", path.display());
        let stem = path.file_stem().and_then(|stem| stem.to_str()).ok_or_else(wrong)?;
        if path.is_dir() {
            stems.extend(shader_stems(&path, &format!("{prefix}{stem}/"))?);
        } else if path.extension().is_some_and(|extension| extension == "wgsl") {
            stems.push(format!("{prefix}{stem}"));
        } else {
            return Err(wrong().into());
        }
    }
    Ok(stems)
}

/// Writes the table that `crates/render/src/render/shader.rs` includes.
fn main() -> Result<(), Box<dyn Error>> {
    println!("cargo::rerun-if-changed={SHADERS}");
    let mut stems = shader_stems(Path::new(SHADERS), "")?;
    stems.sort();
    let mut table = "/// Path below `shaders/` without extension, and text, of every file.\n".to_owned();
    table += "const SHADER_FILES: &[(&str, &str)] = &[\n";
    for stem in stems {
        let path = format!("/{SHADERS}/{stem}.wgsl");
        writeln!(table, "    ({stem:?}, include_str!(concat!(env!(\"CARGO_MANIFEST_DIR\"), {path:?}))),")?;
    }
    table += "];\n";
    let out = PathBuf::from(env::var("OUT_DIR")?);
    Ok(fs::write(out.join("shader_files.rs"), table)?)
}
