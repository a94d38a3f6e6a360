//! The cache of compiled shaders that Mesa's software driver keeps on disk.
//!
//! Its files do not state which shaders they contain. Therefore this program records in its own cache which shaders have been compiled, together with
//! the identity of the driver's cache folder: if that folder is removed and created again, the records no longer apply.

use std::{
    env,
    ffi::OsString,
    path::{Path, PathBuf},
    time::UNIX_EPOCH,
};

use crate::cache::{self, Form, Part};

use super::ShaderSource;

/// Records of compiled shaders: entries without content.
const PART: Part = Part { name: "compiled-shader", version: 1 };
const FORM: Form<()> = Form { to_bytes: |()| Vec::new(), from_bytes: |bytes| bytes.is_empty().then_some(()) };

/// Names of Mesa's cache folders in the user's cache folder. Versions of Mesa differ in the name.
const FOLDERS: [&str; 2] = ["mesa_shader_cache_db", "mesa_shader_cache"];

/// The driver's cache.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct DriverCache {
    /// Name and version of the driver.
    driver: String,
    /// Folders in which the driver may keep shaders.
    folders: Vec<PathBuf>,
}

impl DriverCache {
    /// Returns the cache of a driver; `None` if the driver is not known to keep compiled shaders.
    pub(super) fn of_driver(driver: &str) -> Option<Self> {
        let is_off = |name| env::var(name).is_ok_and(|value| value == "true" || value == "1");
        if !driver.contains("Mesa") || is_off("MESA_SHADER_CACHE_DISABLE") {
            return None;
        }
        let folders = folders(|name| env::var_os(name).filter(|value| !value.is_empty()));
        Some(Self { driver: driver.to_owned(), folders })
    }

    /// Calls `compile`, unless an earlier call has put this shader with these constants into the driver's cache.
    ///
    /// # Errors
    ///
    /// The error of `compile`.
    pub(super) fn compile<E>(
        &self,
        source: &ShaderSource,
        constants: &[(&str, f64)],
        compile: impl FnOnce() -> Result<(), E>,
    ) -> Result<(), E> {
        let Some(identity) = self.identity() else { return compile() };
        let constants = format!("{constants:?}");
        let inputs = [env!("CARGO_PKG_VERSION"), &self.driver, &identity, source.entry_point, &constants, &source.text];
        cache::kept_or_made(PART, &inputs.map(str::as_bytes), FORM, compile)
    }

    /// Returns the existing folders with the times of their creation. Returns `None` if no folder exists or the system does not record creation
    /// times.
    fn identity(&self) -> Option<String> {
        let folders: Vec<String> = self.folders.iter().filter_map(|folder| created(folder)).collect();
        (!folders.is_empty()).then(|| folders.join("\n"))
    }
}

/// Returns a folder and the time of its creation.
fn created(folder: &Path) -> Option<String> {
    let created = folder.metadata().ok()?.created().ok()?.duration_since(UNIX_EPOCH).ok()?;
    Some(format!("{} {}", folder.display(), created.as_nanos()))
}

/// Returns the folders in which Mesa may keep shaders, given the values of environment variables (`docs.mesa3d.org/envvars.html`).
fn folders(variable: impl Fn(&str) -> Option<OsString>) -> Vec<PathBuf> {
    let base = variable("MESA_SHADER_CACHE_DIR")
        .or_else(|| variable("XDG_CACHE_HOME"))
        .map(PathBuf::from)
        .or_else(|| variable("HOME").map(|home| Path::new(&home).join(".cache")));
    base.map(|base| FOLDERS.map(|folder| base.join(folder)).to_vec()).unwrap_or_default()
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "an unexpected error fails the test")]
mod tests {
    use super::*;
    use crate::gpu::GpuOptions;

    #[test]
    fn the_folder_follows_the_environment() {
        let folders_with = |set: &[(&str, &str)]| {
            folders(|name| set.iter().find(|(other, _)| *other == name).map(|(_, value)| OsString::from(value)))
        };
        let first = |set: &[(&str, &str)]| folders_with(set).first().cloned();
        assert_eq!(first(&[("HOME", "/h")]), Some(PathBuf::from("/h/.cache/mesa_shader_cache_db")));
        assert_eq!(first(&[("HOME", "/h"), ("XDG_CACHE_HOME", "/c")]), Some("/c/mesa_shader_cache_db".into()));
        let all = [("HOME", "/h"), ("XDG_CACHE_HOME", "/c"), ("MESA_SHADER_CACHE_DIR", "/m")];
        assert_eq!(first(&all), Some("/m/mesa_shader_cache_db".into()));
        assert_eq!(first(&[]), None);
    }

    #[test]
    fn another_folder_has_another_identity() {
        let parent = tempfile::tempdir().unwrap();
        let folders = vec![parent.path().join("one"), parent.path().join("other")];
        let cache = DriverCache { driver: "Mesa".to_owned(), folders: folders.clone() };
        assert_eq!(cache.identity(), None);
        std::fs::create_dir(&folders[0]).unwrap();
        let first = cache.identity().unwrap();
        assert_eq!(cache.identity(), Some(first.clone()));
        std::fs::create_dir(&folders[1]).unwrap();
        assert_ne!(cache.identity(), Some(first));
    }

    #[test]
    fn drivers_without_a_known_cache_compile_nothing_ahead() {
        assert_eq!(DriverCache::of_driver("SwiftShader driver"), None);
        let gpu = crate::gpu::Gpu::open(&GpuOptions::default()).unwrap();
        assert_eq!(gpu.compile_ahead.is_some(), gpu.software && gpu.report().driver.contains("Mesa"));
    }
}
