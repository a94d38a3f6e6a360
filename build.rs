//! Compiles the protocol definitions to Rust, without any other tool, and keeps their descriptors for server reflection. Tells
//! the compiler which optional test data the environment offers, so that tests without it show as ignored.

use std::{env, error::Error, fs, path::PathBuf};

use protox::prost::Message;

fn compile_protocol() -> Result<(), Box<dyn Error>> {
    println!("cargo::rerun-if-changed=proto");
    let files = ["scene", "camera", "view", "diagnostics"].map(|name| format!("proto/steradian/v1/{name}.proto"));
    let descriptors = protox::compile(files, ["proto"])?;
    let out = PathBuf::from(env::var("OUT_DIR")?);
    fs::write(out.join("steradian_descriptors.bin"), descriptors.encode_to_vec())?;
    tonic_prost_build::configure().compile_fds(descriptors)?;
    Ok(())
}

fn main() -> Result<(), Box<dyn Error>> {
    // tests/cpu/stars/bright_stars.rs, tests/gpu/stars/whole_sky.rs
    println!("cargo::rustc-check-cfg=cfg(has_bsc_csv)");
    println!("cargo::rerun-if-env-changed=STERADIAN_BSC_CSV");
    if std::env::var_os("STERADIAN_BSC_CSV").is_some_and(|path| !path.is_empty()) {
        println!("cargo::rustc-cfg=has_bsc_csv");
    }
    compile_protocol()
}
