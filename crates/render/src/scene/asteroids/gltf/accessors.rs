//! Buffers of a glTF document and the numbers in them. Every offset and size comes from the file, so all of them are checked.

use std::path::{Component, Path, PathBuf};

use base64::{Engine, engine::general_purpose::STANDARD};
use gltf::{
    Accessor, Document,
    accessor::{DataType, Dimensions},
    buffer::Source,
};

use super::{MOST_BYTES, MeshProblem};
use crate::files;

/// Reads the contents of the buffers, by index. `folder` is the folder of the document, `blob` the binary part of a .glb file.
pub(super) fn buffers(
    document: &Document,
    folder: &Path,
    mut blob: Option<Vec<u8>>,
) -> Result<Vec<Vec<u8>>, MeshProblem> {
    let mut left = MOST_BYTES;
    let read = |buffer: gltf::Buffer<'_>| {
        let refused = |reason: String| MeshProblem::Buffer { buffer: buffer.index(), reason };
        let bytes = match buffer.source() {
            Source::Bin => blob.take().ok_or_else(|| refused("the file has no binary part for it".to_owned()))?,
            Source::Uri(uri) => from_uri(uri, folder, left).map_err(refused)?,
        };
        // Limit for all buffers together: many buffers may refer to the same file.
        left = left
            .checked_sub(bytes.len() as u64)
            .ok_or_else(|| refused(format!("the buffers up to it have more than the maximum of {MOST_BYTES} bytes")))?;
        if bytes.len() < buffer.length() {
            return Err(refused(format!("it has {} bytes, but {} are declared", bytes.len(), buffer.length())));
        }
        Ok(bytes)
    };
    document.buffers().map(read).collect()
}

/// The bytes that a URI refers to, at most `most_bytes`.
fn from_uri(uri: &str, folder: &Path, most_bytes: u64) -> Result<Vec<u8>, String> {
    if let Some(data) = uri.strip_prefix("data:") {
        let encoded = data.split_once(";base64,").ok_or("a data URI must be base64")?.1;
        return STANDARD.decode(encoded).map_err(|error| format!("its data URI is not base64: {error}"));
    }
    let refused =
        || format!("its URI {uri:?} is not allowed: must be a path below the folder of the file, or a data URI");
    if uri.contains(':') {
        return Err(refused());
    }
    // Check the decoded path: a slash or a dot may be percent-encoded.
    let below = PathBuf::from(percent_decoded(uri).ok_or_else(|| format!("its URI {uri:?} is not valid"))?);
    if !below.components().all(|part| matches!(part, Component::Normal(_) | Component::CurDir)) {
        return Err(refused());
    }
    let path = folder.join(below);
    files::read_bounded(&path, most_bytes).map_err(|error| format!("{}: {error}", path.display()))
}

/// Decodes a percent-encoded path; `None` if it is malformed.
fn percent_decoded(uri: &str) -> Option<String> {
    let mut bytes = Vec::new();
    let mut rest = uri.as_bytes();
    while let Some((&first, behind)) = rest.split_first() {
        rest = behind;
        bytes.push(if first == b'%' {
            let digits = std::str::from_utf8(rest.get(..2)?).ok()?;
            rest = &rest[2..];
            u8::from_str_radix(digits, 16).ok()?
        } else {
            first
        });
    }
    String::from_utf8(bytes).ok()
}

/// The numbers of an accessor, element by element, as f64; normalised integers are converted to fractions of their
/// range.
pub(super) fn numbers(accessor: &Accessor<'_>, buffers: &[Vec<u8>]) -> Result<Vec<f64>, MeshProblem> {
    let refused = |reason: &str| MeshProblem::Accessor { accessor: accessor.index(), reason: reason.to_owned() };
    if accessor.sparse().is_some() {
        return Err(refused("sparse accessors are not supported"));
    }
    let view = accessor.view().ok_or_else(|| refused("it has no buffer view"))?;
    let (components, size) = (accessor.dimensions().multiplicity(), accessor.data_type().size());
    let element = components * size;
    let stride = view.stride().unwrap_or(element);
    let beyond = || refused("it reaches beyond its buffer");
    let buffer = buffers.get(view.buffer().index()).ok_or_else(beyond)?;
    let end = view.offset().checked_add(view.length()).ok_or_else(beyond)?;
    let bytes = buffer.get(view.offset()..end).ok_or_else(beyond)?;
    let mut read = Vec::new();
    for index in 0..accessor.count() {
        let first = index.checked_mul(stride).and_then(|offset| offset.checked_add(accessor.offset()));
        let element = first.and_then(|first| bytes.get(first..first.checked_add(element)?)).ok_or_else(beyond)?;
        read.extend(element.chunks_exact(size).map(|bytes| number(bytes, accessor.data_type(), accessor.normalized())));
    }
    Ok(read)
}

fn number(bytes: &[u8], kind: DataType, normalized: bool) -> f64 {
    // `bytes` has the size of the type; missing bytes would read as 0.
    let unsigned = bytes.iter().rev().fold(0u64, |value, byte| value << 8 | u64::from(*byte));
    let (value, most) = match kind {
        DataType::F32 => return f64::from(f32::from_bits(unsigned as u32)),
        DataType::I8 => (f64::from(unsigned as u8 as i8), 127.0),
        DataType::I16 => (f64::from(unsigned as u16 as i16), 32_767.0),
        DataType::U8 => (unsigned as f64, 255.0),
        DataType::U16 => (unsigned as f64, 65_535.0),
        DataType::U32 => (unsigned as f64, f64::from(u32::MAX)),
    };
    if normalized { (value / most).max(-1.0) } else { value }
}

/// Refuses an accessor whose type does not match its use in a mesh.
pub(super) fn check_kind(
    accessor: &Accessor<'_>,
    kinds: &[DataType],
    dimensions: &[Dimensions],
) -> Result<(), MeshProblem> {
    if kinds.contains(&accessor.data_type()) && dimensions.contains(&accessor.dimensions()) {
        return Ok(());
    }
    let reason = format!(
        "it holds {:?} of {:?}; must be one of {dimensions:?} of {kinds:?}",
        accessor.dimensions(),
        accessor.data_type()
    );
    Err(MeshProblem::Accessor { accessor: accessor.index(), reason })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_are_decoded_and_bad_ones_refused() {
        assert_eq!(percent_decoded("a%20b.bin").as_deref(), Some("a b.bin"));
        assert_eq!([percent_decoded("a%2"), percent_decoded("%zz"), percent_decoded("%ff")], [None, None, None]);
        for uri in [
            "http://example.org/a.bin",
            "file:///a.bin",
            "/a.bin",
            "%2Fetc/passwd",
            "../a.bin",
            "a/%2e%2E/../b.bin",
            "data:text/plain,abc",
            "data:;base64,!!",
        ] {
            assert!(from_uri(uri, Path::new("."), 100).is_err(), "{uri}");
        }
        assert_eq!(from_uri("data:application/octet-stream;base64,AQID", Path::new("."), 100), Ok(vec![1, 2, 3]));
    }

    #[test]
    fn numbers_are_decoded_from_their_bytes() {
        assert_eq!(number(&1.5f32.to_le_bytes(), DataType::F32, false), 1.5);
        assert_eq!(number(&[0x34, 0x12], DataType::U16, false), f64::from(0x1234));
        assert_eq!(number(&[0xff], DataType::U8, true), 1.0);
        assert_eq!(number(&[0x80], DataType::I8, true), -1.0);
    }
}
