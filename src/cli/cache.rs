//! The user's cache folder of the program: `STERADIAN_CACHE_DIR`, or `steradian` in the one of the XDG Base Directory Specification 0.8.

use std::{
    env,
    ffi::OsString,
    path::{Path, PathBuf},
};

use crate::{config::Config, plan::settings::AsteroidSettings};

/// Names the folder itself; empty: none.
const VARIABLE: &str = "STERADIAN_CACHE_DIR";

/// Replaces `asteroids.cache = "auto"` by a folder of the user, or by none if the user has no cache folder.
pub fn place(config: &mut Config) {
    if config.asteroids.cache != Path::new(AsteroidSettings::USER_CACHE) {
        return;
    }
    let folder = folder(|name| env::var_os(name));
    if folder.is_none() {
        tracing::info!("baked atlases of asteroids are not kept: no cache folder is known");
    }
    config.asteroids.cache = folder.map(|folder| folder.join("atlases")).unwrap_or_default();
}

/// The cache folder from environment variables; `None`: there is none. The specification ignores relative paths.
fn folder(variable: impl Fn(&str) -> Option<OsString>) -> Option<PathBuf> {
    if let Some(folder) = variable(VARIABLE) {
        return Some(PathBuf::from(folder)).filter(|folder| !folder.as_os_str().is_empty());
    }
    let absolute = |name| variable(name).map(PathBuf::from).filter(|folder| folder.is_absolute());
    let caches = absolute("XDG_CACHE_HOME").or_else(|| Some(absolute("HOME")?.join(".cache")));
    caches.map(|caches| caches.join("steradian"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_usable_variable_decides() {
        let found = |set: &[(&str, &str)]| {
            folder(|name| set.iter().find(|(known, _)| *known == name).map(|(_, value)| value.into()))
        };
        let home = ("HOME", "/home/u");
        assert_eq!(found(&[home]), Some("/home/u/.cache/steradian".into()));
        assert_eq!(found(&[home, ("XDG_CACHE_HOME", "/c")]), Some("/c/steradian".into()));
        assert_eq!(found(&[home, ("XDG_CACHE_HOME", "c")]), Some("/home/u/.cache/steradian".into()), "relative");
        assert_eq!(found(&[home, ("XDG_CACHE_HOME", "/c"), (VARIABLE, "own")]), Some("own".into()));
        assert_eq!(found(&[home, (VARIABLE, "")]), None, "switched off");
        assert_eq!(found(&[]), None);
    }
}
