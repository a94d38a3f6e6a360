//! Compiles the protocol definitions to Rust, without any other tool, and keeps their descriptors for server reflection. Tells
//! the compiler which optional test data the environment offers, so that tests without it show as ignored. Lists the
//! shader files.

use std::{
    env,
    error::Error,
    fmt::Write,
    fs,
    path::{Path, PathBuf},
};

#[cfg(feature = "service")]
fn compile_protocol() -> Result<(), Box<dyn Error>> {
    use protox::prost::Message;

    println!("cargo::rerun-if-changed=proto");
    let files = ["scene", "camera", "view", "diagnostics"].map(|name| format!("proto/steradian/v1/{name}.proto"));
    let descriptors = protox::compile(files, ["proto"])?;
    let out = PathBuf::from(env::var("OUT_DIR")?);
    fs::write(out.join("steradian_descriptors.bin"), descriptors.encode_to_vec())?;
    // Images are shared among those who get them.
    tonic_prost_build::configure().bytes(".steradian.v1.Image.data").compile_fds(descriptors)?;
    Ok(())
}

/// Paths of the WGSL files in a folder and below, relative to `shaders`, with slashes and without extension.
fn shader_stems(folder: &Path, prefix: &str) -> Result<Vec<String>, Box<dyn Error>> {
    let mut stems = Vec::new();
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        let wrong = || format!("{}: shaders/ holds folders and .wgsl files with plain names", path.display());
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

/// Writes the table of all shader files, which `src/gpu/shader.rs` includes.
fn list_shaders() -> Result<(), Box<dyn Error>> {
    println!("cargo::rerun-if-changed=shaders");
    let mut stems = shader_stems(Path::new("shaders"), "")?;
    stems.sort();
    let mut table = "/// Path below `shaders/` without extension, and text, of every file.\n".to_owned();
    table += "const SHADER_FILES: &[(&str, &str)] = &[\n";
    for stem in stems {
        let path = format!("/shaders/{stem}.wgsl");
        writeln!(table, "    ({stem:?}, include_str!(concat!(env!(\"CARGO_MANIFEST_DIR\"), {path:?}))),")?;
    }
    table += "];\n";
    let out = PathBuf::from(env::var("OUT_DIR")?);
    Ok(fs::write(out.join("shader_files.rs"), table)?)
}

fn main() -> Result<(), Box<dyn Error>> {
    // tests/cpu/stars/bright_stars.rs, tests/gpu/stars/whole_sky.rs
    println!("cargo::rustc-check-cfg=cfg(has_bsc_csv)");
    println!("cargo::rerun-if-env-changed=STERADIAN_BSC_CSV");
    if std::env::var_os("STERADIAN_BSC_CSV").is_some_and(|path| !path.is_empty()) {
        println!("cargo::rustc-cfg=has_bsc_csv");
    }
    #[cfg(feature = "service")]
    compile_protocol()?;
    list_shaders()
}
