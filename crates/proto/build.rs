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
    let mut builder = tonic_prost_build::configure().bytes(".steradian.v1.Image.data");
    // Messages with the keys of configurations are serialised under these keys: see `src/service/wire/views.rs`.
    for message in ["ViewDefinition", "FieldOfView", "ExposureSettings", "GlareSettings", "ToneMapSettings"] {
        let path = format!(".steradian.v1.{message}");
        builder = builder
            .type_attribute(&path, "#[derive(serde::Serialize, serde::Deserialize)]")
            .type_attribute(&path, "#[serde(default, deny_unknown_fields)]");
    }
    for (field, attribute) in [
        ("size", "skip_serializing_if = \"Vec::is_empty\""),
        ("faces", "skip_serializing_if = \"Vec::is_empty\""),
        ("orientation", "with = \"crate::lists::quaternion\""),
        ("position_m", "with = \"crate::lists::vector\""),
    ] {
        let path = format!(".steradian.v1.ViewDefinition.{field}");
        builder = builder.field_attribute(path, format!("#[serde({attribute})]"));
    }
    builder.compile_fds(descriptors)?;
    Ok(())
}
