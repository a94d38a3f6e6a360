//! The package reads the protocol from `steradian.binpb`, a serialised `FileDescriptorSet` that is checked in.
//! Therefore the package works with every version of the protobuf runtime, and needs no compiler. The file is the
//! output of the build script for `proto/`, without comments.
//!
//! `STERADIAN_WRITE_REFERENCE=1 cargo test --release --test python protocol` updates it.

use std::{fs, path::Path};

use prost::Message;
use prost_types::FileDescriptorSet;

use crate::Test;

pub const TESTS: &[Test] =
    &[("protocol::matches_proto", matches_proto), ("protocol::a_change_is_detected", a_change_is_detected)];

/// Descriptors of the protocol, with comments and positions.
const COMPILED: &[u8] = steradian_proto::v1::DESCRIPTORS;

/// Returns the same descriptors without comments and positions.
fn descriptors() -> FileDescriptorSet {
    let mut set = FileDescriptorSet::decode(COMPILED).unwrap();
    for file in &mut set.file {
        file.source_code_info = None;
    }
    set
}

/// Returns the names of files that differ between the sets, or that one of the sets lacks.
fn differences(a: &FileDescriptorSet, b: &FileDescriptorSet) -> Vec<String> {
    let only = |a: &FileDescriptorSet, b: &FileDescriptorSet| -> Vec<String> {
        let files = a.file.iter().filter(|file| !b.file.contains(file));
        files.map(|file| file.name().to_owned()).collect()
    };
    let mut names = [only(a, b), only(b, a)].concat();
    names.sort();
    names.dedup();
    names
}

fn matches_proto() -> Result<(), String> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("python/src/steradian/steradian.binpb");
    let compiled = descriptors();
    if std::env::var_os("STERADIAN_WRITE_REFERENCE").is_some() {
        fs::write(&path, compiled.encode_to_vec()).unwrap();
    }
    let committed = fs::read(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    let other = differences(&FileDescriptorSet::decode(&*committed).unwrap(), &compiled);
    assert!(
        other.is_empty() && committed == compiled.encode_to_vec(),
        "steradian.binpb differs from proto/ ({other:?}): STERADIAN_WRITE_REFERENCE=1 updates it"
    );
    Ok(())
}

fn a_change_is_detected() -> Result<(), String> {
    let compiled = descriptors();
    assert!(differences(&compiled, &compiled).is_empty());
    let mut changed = compiled.clone();
    let file = changed.file.iter_mut().find(|file| file.name() == "steradian/v1/view.proto").unwrap();
    file.service[0].method.pop().unwrap();
    assert_eq!(differences(&changed, &compiled), ["steradian/v1/view.proto"]);
    changed.file.retain(|file| file.name() != "steradian/v1/camera.proto");
    assert_eq!(differences(&changed, &compiled), ["steradian/v1/camera.proto", "steradian/v1/view.proto"]);
    Ok(())
}
