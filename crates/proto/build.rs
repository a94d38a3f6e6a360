//! Compiles `proto/steradian/v1` to Rust without `protoc`, and keeps the descriptors for server reflection.

use std::{env, error::Error, fs, path::PathBuf};

use protox::prost::Message;

const PROTO: &str = "../../proto";

fn main() -> Result<(), Box<dyn Error>> {
    println!("cargo::rerun-if-changed={PROTO}");
    let files = ["scene", "camera", "view", "diagnostics"].map(|name| format!("{PROTO}/steradian/v1/{name}.proto"));
    let descriptors = protox::compile(files, [PROTO])?;
    let out = PathBuf::from(env::var("OUT_DIR")?);
    fs::write(out.join("steradian_descriptors.bin"), descriptors.encode_to_vec())?;
    // `Bytes` lets all subscribers of a frame share one copy of an image.
    tonic_prost_build::configure().bytes(".steradian.v1.Image.data").compile_fds(descriptors)?;
    Ok(())
}
