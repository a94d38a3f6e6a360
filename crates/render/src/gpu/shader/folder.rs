//! Reads shader files from a folder instead of those that are built into the program.

use std::collections::BTreeMap;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use super::ShaderError;

/// Returns the texts of the `.wgsl` files in a folder and its subfolders, keyed by their paths without extension.
///
/// # Errors
///
/// The folder or a file cannot be read, or one of the `required` files is missing.
pub(crate) fn read_folder<'a>(
    folder: &Path,
    required: impl IntoIterator<Item = &'a str>,
) -> Result<BTreeMap<String, String>, ShaderError> {
    let mut texts = BTreeMap::new();
    read_below(folder, "", &mut texts)?;
    match required.into_iter().find(|&stem| !texts.contains_key(stem)) {
        Some(stem) => Err(ShaderError::MissingFile(folder.join(format!("{stem}.wgsl")))),
        None => Ok(texts),
    }
}

/// Reads the files of `folder` and its subfolders. `prefix` is the path of `folder` relative to the top folder, with a slash at its end.
fn read_below(folder: &Path, prefix: &str, texts: &mut BTreeMap<String, String>) -> Result<(), ShaderError> {
    let unreadable =
        |path: PathBuf| move |error: io::Error| ShaderError::Unreadable { path, reason: error.to_string() };
    for entry in fs::read_dir(folder).map_err(unreadable(folder.to_owned()))? {
        let path = entry.map_err(unreadable(folder.to_owned()))?.path();
        let Some(stem) = path.file_stem().and_then(|stem| stem.to_str()) else { continue };
        if path.is_dir() {
            read_below(&path, &format!("{prefix}{stem}/"), texts)?;
        } else if path.extension().is_some_and(|extension| extension == "wgsl") {
            let text = fs::read_to_string(&path).map_err(unreadable(path.clone()))?;
            texts.insert(format!("{prefix}{stem}"), text);
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_have_their_paths_without_extension() {
        let folder = tempfile::tempdir().unwrap();
        let write = |name: &str, text: &[u8]| fs::write(folder.path().join(name), text).unwrap();
        fs::create_dir_all(folder.path().join("stars/billboards")).unwrap();
        write("probe.wgsl", b"probe");
        write("stars/billboards/place.wgsl", b"place");
        write("stars/splat.wgsl~", b"a copy that an editor keeps");
        let texts = read_folder(folder.path(), ["probe", "stars/billboards/place"]).unwrap();
        let wanted = [("probe", "probe"), ("stars/billboards/place", "place")];
        assert_eq!(texts, wanted.map(|(stem, text)| (stem.to_owned(), text.to_owned())).into());
    }

    #[test]
    fn missing_and_unreadable_files_are_named() {
        let folder = tempfile::tempdir().unwrap();
        let error = |folder: &Path| read_folder(folder, ["stars/splat"]).unwrap_err().to_string();
        let path = |name: &str| folder.path().join(name);
        assert_eq!(
            error(&path("none")),
            format!("cannot read {}: No such file or directory (os error 2)", path("none").display())
        );
        assert_eq!(
            error(folder.path()),
            format!("{} is missing: the program needs this shader file", path("stars/splat.wgsl").display())
        );
        fs::write(path("broken.wgsl"), [0xff, 0xfe]).unwrap();
        let unreadable = error(folder.path());
        assert!(unreadable.starts_with(&format!("cannot read {}: ", path("broken.wgsl").display())), "{unreadable}");
    }
}
