//! `cache info` and `cache clear` show and remove data that the program keeps between runs.

use std::{
    collections::BTreeMap,
    env,
    ffi::{OsStr, OsString},
    io,
    path::{Path, PathBuf},
};

use clap::{Args, Subcommand};
use directories::ProjectDirs;

use super::{CliError, results};
use crate::cache::{self, Cache, Entry};
use crate::files;

/// Environment variable with the path of the cache folder; an empty value disables the cache.
const FOLDER_VARIABLE: &str = "STERADIAN_CACHE_DIR";
/// Environment variable with the size limit, MiB.
const LIMIT_VARIABLE: &str = "STERADIAN_CACHE_MIB";
/// Default size limit, MiB.
const MOST_MIB: u64 = 2048;

/// Arguments of `cache`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    steradian cache info\n  \
    steradian cache clear\n\n\
    Kept are synthetic stars, tables and computed blends of projectors, and atlases of asteroids, each under a hash of its\n\
    inputs. The folder is STERADIAN_CACHE_DIR, otherwise that of the system for the user; an empty variable or --no-cache\n\
    switches it off.\n\
    STERADIAN_CACHE_MIB is its size limit in MiB (2048). Entries that were not used for the longest time are removed first.")]
pub struct CacheArguments {
    #[command(subcommand)]
    command: CacheCommand,
}

#[derive(Clone, Copy, Debug, Subcommand)]
enum CacheCommand {
    /// Show the folder, the size limit, and the number and size of the entries of each kind.
    Info {
        /// Print JSON.
        #[arg(long)]
        json: bool,
    },
    /// Remove all entries; other files in the folder stay.
    Clear,
}

/// Sets the cache of this process from the environment; with `unused`, the process has no cache.
pub fn set(unused: bool) -> Result<(), CliError> {
    let cache = if unused { None } else { from_environment(|name| env::var_os(name))? };
    if let Some((folder, problem)) = cache.as_ref().and_then(unusable) {
        tracing::warn!("the cache folder {} cannot be used, so nothing is kept: {problem}", folder.display());
        cache::set_for_process(None);
        return Ok(());
    }
    if cache.is_none() && !unused {
        tracing::debug!("the program has no cache folder and keeps nothing between runs");
    }
    cache::set_for_process(cache);
    Ok(())
}

/// Returns the folder and the error if the folder of a cache neither exists nor can be created. A folder that exists but cannot be written is usable:
/// its entries are read.
fn unusable(cache: &Cache) -> Option<(&Path, io::Error)> {
    let folder = &*cache.folder;
    if folder.is_dir() { None } else { files::check_folder(folder).err().map(|problem| (folder, problem)) }
}

/// Runs the command.
pub fn run(CacheArguments { command }: &CacheArguments) -> Result<(), CliError> {
    let Some(cache) = from_environment(|name| env::var_os(name))? else {
        let problem = format!("there is no cache folder: set {FOLDER_VARIABLE}, or the home folder of the user");
        return Err(CliError::Usage(problem));
    };
    let problem = |source| CliError::Cache { folder: cache.folder.clone(), source };
    match command {
        CacheCommand::Info { json } => {
            let info = Info::new(&cache, &cache.entries().map_err(problem)?);
            if *json { results::line(serde_json::json!(info)) } else { info.print() }
        }
        CacheCommand::Clear => {
            let removed = cache.clear().map_err(problem)?;
            let bytes: u64 = removed.iter().map(|entry| entry.bytes).sum();
            results::line(format!("removed {} entries, {}, from {}", removed.len(), mib(bytes), cache.folder.display()))
        }
    }
}

#[derive(serde::Serialize)]
struct Info {
    folder: PathBuf,
    most_bytes: u64,
    bytes: u64,
    parts: BTreeMap<String, PartInfo>,
}

#[derive(Default, serde::Serialize)]
struct PartInfo {
    entries: usize,
    bytes: u64,
}

impl Info {
    fn new(cache: &Cache, entries: &[Entry]) -> Self {
        let mut parts: BTreeMap<String, PartInfo> = BTreeMap::new();
        for entry in entries {
            let part = parts.entry(entry.part.clone()).or_default();
            part.entries += 1;
            part.bytes += entry.bytes;
        }
        let bytes = entries.iter().map(|entry| entry.bytes).sum();
        Self { folder: cache.folder.clone(), most_bytes: cache.most_bytes, bytes, parts }
    }

    fn print(&self) -> Result<(), CliError> {
        results::line(format!("folder: {}", self.folder.display()))?;
        results::line(format!("size:   {} of at most {}", mib(self.bytes), mib(self.most_bytes)))?;
        self.parts.iter().try_for_each(|(name, part)| {
            results::line(format!("{name}: {} entries, {}", part.entries, mib(part.bytes)))
        })
    }
}

fn mib(bytes: u64) -> String {
    format!("{:.1} MiB", bytes as f64 / f64::from(1 << 20))
}

/// Returns the cache that environment variables describe; `None`: no cache.
fn from_environment(variable: impl Fn(&str) -> Option<OsString>) -> Result<Option<Cache>, CliError> {
    let most_mib = variable(LIMIT_VARIABLE).map_or(Ok(MOST_MIB), |text| most_mib(&text))?;
    let folder = match variable(FOLDER_VARIABLE) {
        Some(folder) => Some(PathBuf::from(folder)).filter(|folder| !folder.as_os_str().is_empty()),
        None => ProjectDirs::from("", "", "steradian").map(|folders| folders.cache_dir().to_owned()),
    };
    Ok(folder.map(|folder| Cache { folder, most_bytes: most_mib << 20 }))
}

/// Reads a size limit, MiB.
fn most_mib(text: &OsStr) -> Result<u64, CliError> {
    let number = text.to_str().and_then(|text| text.parse().ok());
    number.filter(|mib| (1..1 << 40).contains(mib)).ok_or_else(|| {
        let text = text.display();
        CliError::Usage(format!("{LIMIT_VARIABLE}={text}: must be a whole number of MiB, at least 1"))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn variables_name_folder_and_limit_and_wrong_ones_are_refused() {
        let found = |set: &[(&str, &str)]| {
            from_environment(|name| set.iter().find(|(known, _)| *known == name).map(|(_, value)| value.into()))
        };
        let cache = found(&[(FOLDER_VARIABLE, "own"), (LIMIT_VARIABLE, "3")]).unwrap();
        assert_eq!(cache, Some(Cache { folder: "own".into(), most_bytes: 3 << 20 }));
        assert_eq!(found(&[(FOLDER_VARIABLE, "")]).unwrap(), None, "switched off");
        let of_user = found(&[]).unwrap().expect("the user has a home folder");
        assert!(of_user.folder.ends_with("steradian") && of_user.most_bytes == 2 << 30, "{of_user:?}");
        // The path leads to a file, so no folder can be created below it.
        let file = tempfile::NamedTempFile::new().unwrap();
        for folder in [file.path().to_owned(), file.path().join("cache")] {
            assert!(unusable(&Cache { folder, most_bytes: 1 }).is_some());
        }
        let new = tempfile::tempdir().unwrap().path().join("cache");
        assert!(unusable(&Cache { folder: new, most_bytes: 1 }).is_none());
        for wrong in ["", "0", "-1", "2.5", "many", "99999999999999999999"] {
            let problem = found(&[(LIMIT_VARIABLE, wrong)]).unwrap_err().to_string();
            assert!(problem.contains(&format!("{LIMIT_VARIABLE}={wrong}: ")), "{problem}");
        }
    }
}
